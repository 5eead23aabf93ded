"""README.md is true: its spec compiles, its output is what comes out, its files exist."""

import re
from pathlib import Path

import pytest
from docs.told import settled
from drillc.cli import _parser, main

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)


@pytest.fixture
def nacelle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(ROOT)
    out = tmp_path / "out" / "nacelle"
    assert main(["compile", "samples/nacelle.drill", "-o", str(out)]) == 0
    return out


def blocks(kind: str) -> list[str]:
    return [text for name, text in BLOCKS if name == kind]


def test_there_are_two_commands_and_the_first_is_the_sample() -> None:
    first, second = blocks("sh")
    assert len(first.splitlines()) == len(second.splitlines()) == 1
    assert "drillc compile samples/nacelle.drill -o out/nacelle" in first
    assert "pytest" in second


def test_the_emitted_code_is_shown_as_it_is(nacelle: Path) -> None:
    source, data, listing, _, mistake = blocks("")
    krl = nacelle / "krl"
    assert source in (krl / "NACELLE_A.src").read_bytes().decode().replace("\r\n", "\n")
    assert data in (krl / "NACELLE_A.dat").read_bytes().decode().replace("\r\n", "\n")
    files = sorted(p.relative_to(nacelle).as_posix() for p in nacelle.rglob("*") if p.is_file())
    assert [f"out/nacelle/{name}" for name in files] == listing.splitlines()
    assert mistake.startswith("samples/nacelle.drill:")


def test_what_is_proven_is_told_as_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    assert main(["compile", "samples/nacelle.drill", "-o", str(tmp_path / "out")]) == 0
    assert settled(blocks("")[3]) == settled(capsys.readouterr().err)


def test_every_command_has_a_row() -> None:
    section = README[README.index("## Use") : README.index("## The samples")]
    rows = set(re.findall(r"^\| `drillc ([a-z-]+)", section, re.MULTILINE))
    [commands] = (a.choices for a in _parser()._actions if a.dest == "command")
    assert rows == set(commands or ())


def test_the_spec_shown_is_the_sample(nacelle: Path, tmp_path: Path) -> None:
    (shown,) = blocks("drill")
    (ROOT / "samples/cells/drilling.cell").exists()
    (tmp_path / "cells").mkdir()
    cell = (ROOT / "samples/cells/drilling.cell").read_bytes()
    (tmp_path / "cells/drilling.cell").write_bytes(cell)
    spec = tmp_path / "shown.drill"
    spec.write_text(f'drill 1\nprogram NACELLE_A\nuse "cells/drilling.cell"\n{shown}')
    out = tmp_path / "shown"
    assert main(["compile", str(spec), "-o", str(out)]) == 0
    lines = (nacelle / "krl/NACELLE_A.dat").read_bytes().splitlines()
    found = (out / "krl/NACELLE_A.dat").read_bytes().splitlines()
    holes = [line for line in found if line.startswith(b"DECL E6POS P")]
    assert len(holes) == 2
    assert set(holes) <= set(lines)


def test_the_mistake_shown_is_what_drillc_says(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    samples = tmp_path / "samples"
    (samples / "cells").mkdir(parents=True)
    cell = (ROOT / "samples/cells/drilling.cell").read_bytes()
    (samples / "cells/drilling.cell").write_bytes(cell)
    text = (ROOT / "samples/nacelle.drill").read_text(encoding="utf-8")
    assert text.count("depth 12 mm") == 1
    (samples / "nacelle.drill").write_text(text.replace("depth 12 mm", "depth 12 s "))
    monkeypatch.chdir(tmp_path)
    assert main(["check", "samples/nacelle.drill"]) == 1
    said = capsys.readouterr().err.splitlines()[0]
    assert blocks("")[-1].strip() == said


@pytest.mark.parametrize("target", sorted(set(re.findall(r"\]\(([^)#]+)\)", README))))
def test_every_file_named_exists(target: str) -> None:
    assert (ROOT / target).exists()
