"""Where drillc is run from, and how its files are named, changes nothing in what it writes."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from drillc import cli

SAMPLES = Path(__file__).parents[2] / "samples"


def tree(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.fixture
def specs(tmp_path: Path) -> Path:
    shutil.copytree(SAMPLES, tmp_path / "specs")
    return tmp_path / "specs"


def compiled(arguments: list[str], out: Path) -> dict[str, bytes]:
    assert cli.main(["compile", *arguments]) == cli.EXIT_FINE
    return tree(out)


def test_by_whatever_name_the_spec_is_called(
    specs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "result"
    wanted = compiled([str(specs / "nacelle.drill"), "-o", str(out)], out)
    (specs / "deep").mkdir()
    (tmp_path / "link").symlink_to(specs)
    ways = [
        (specs, "nacelle.drill", "../result"),
        (specs, "./nacelle.drill", str(out)),
        (specs / "deep", "../nacelle.drill", "../../result"),
        (specs, "deep/../nacelle.drill", "deep/../../result"),
        (tmp_path, "specs/nacelle.drill", "result"),
        (tmp_path, "link/nacelle.drill", "./result/"),
        (tmp_path / "link", "nacelle.drill", str(out)),
    ]
    for folder, spec, target in ways:
        monkeypatch.chdir(folder)
        assert compiled([spec, "-o", target], out) == wanted, (folder, spec, target)


def test_the_output_stands_in_out_by_default(
    specs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.main(["compile", str(specs / "portal.drill")]) == cli.EXIT_FINE
    assert (tmp_path / "out/portal/manifest.json").is_file()


def test_a_wider_root(specs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A cell beside the specs' folder can be used only where --root allows it."""
    shutil.move(specs / "cells", tmp_path / "cells")
    spec = specs / "nacelle.drill"
    spec.write_text(spec.read_text().replace('"cells/', '"../cells/'))
    out = tmp_path / "result"
    assert cli.main(["compile", str(spec), "-o", str(out)]) == cli.EXIT_ERRORS
    assert "E125" in capsys.readouterr().err
    assert not out.exists()
    files = compiled([str(spec), "-o", str(out), "--root", str(tmp_path)], out)
    inputs = json.loads(files["manifest.json"])["inputs"]
    assert sorted(inputs) == ["cells/drilling.cell", "specs/nacelle.drill"]


@pytest.mark.parametrize(
    "leave",
    [
        lambda specs, other: (specs / "t.cell").symlink_to(other),
        lambda specs, other: (specs / "dir").symlink_to(other.parent),
    ],
    ids=["link to a file", "link to a folder"],
)
def test_a_link_does_not_lead_out(
    specs: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    leave: Callable[[Path, Path], None],
) -> None:
    other = tmp_path / "secret" / "t.cell"
    other.parent.mkdir()
    shutil.copy(specs / "cells/drilling.cell", other)
    leave(specs, other)
    name = "t.cell" if (specs / "t.cell").is_symlink() else "dir/t.cell"
    spec = specs / "nacelle.drill"
    spec.write_text(spec.read_text().replace("cells/drilling.cell", name))
    out = tmp_path / "result"
    assert cli.main(["compile", str(spec), "-o", str(out)]) == cli.EXIT_ERRORS
    assert "E125" in capsys.readouterr().err
    assert not out.exists()
    compiled([str(spec), "-o", str(out), "--root", str(tmp_path)], out)


def test_names_that_a_file_system_allows(specs: Path, tmp_path: Path) -> None:
    """Blanks, accents and bytes that are no text, in the spec's and the output's name."""
    wanted = None
    for name in ("a b", "é", "-x", "x'y\"z", "{0}%s", "\udcff"):
        folder = tmp_path / name
        folder.mkdir()
        shutil.copy(specs / "portal.drill", folder / f"{name}.drill")
        out = folder / f"{name} out"
        files = compiled([str(folder / f"{name}.drill"), "-o", str(out)], out)
        programs = {key: data for key, data in files.items() if key.startswith("gcode/")}
        assert programs == (wanted := wanted or programs)
        assert f"{name}.drill" in json.loads(files["manifest.json"])["inputs"]


def test_nothing_beside_the_output_is_written(specs: Path, tmp_path: Path) -> None:
    before = tree(tmp_path)
    out = tmp_path / "new" / "folders" / "out"
    compiled([str(specs / "panel.drill"), "-o", str(out)], out)
    shutil.rmtree(tmp_path / "new")
    assert tree(tmp_path) == before
    for command in ("check", "inspect"):
        assert cli.main([command, str(specs / "panel.drill")]) == cli.EXIT_FINE
    assert tree(tmp_path) == before


@pytest.mark.parametrize("way", ["spec", "out", "root", "below"])
def test_a_loop_of_links_is_an_error_like_any_other(
    specs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], way: str
) -> None:
    loop = tmp_path / "loop"
    loop.symlink_to(loop)
    spec, out, root = specs / "portal.drill", tmp_path / "out", specs
    spec = loop / "portal.drill" if way == "spec" else spec
    out = {"out": loop, "below": loop / "out"}.get(way, out)
    root = loop if way == "root" else root
    arguments = ["compile", str(spec), "-o", str(out), "--root", str(root)]
    assert cli.main(arguments) == cli.EXIT_ERRORS
    assert "error E" in capsys.readouterr().err
    assert loop.is_symlink()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["loop", "specs"]


@pytest.mark.parametrize("length", [200, 250, 256, 5000])
def test_a_name_that_is_too_long(specs: Path, tmp_path: Path, length: int) -> None:
    before = tree(tmp_path)
    out = tmp_path / ("x" * length)
    code = cli.main(["compile", str(specs / "portal.drill"), "-o", str(out)])
    assert code == (cli.EXIT_FINE if length == 200 else cli.EXIT_ERRORS)
    assert length == 200 or tree(tmp_path) == before
    long = str(tmp_path / ("x" * length) / "a.drill")
    assert cli.main(["check", long]) == cli.EXIT_ERRORS
