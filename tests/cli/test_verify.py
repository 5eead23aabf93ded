"""`drillc verify`, and verification as `drillc compile` does it: words, files, exit codes."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from drillc.cli import main

SAMPLES = Path(__file__).parents[2] / "samples"

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def drillc(capsys: pytest.CaptureFixture[str]) -> Run:
    """Run a command: exit code, output, error output."""

    def run(*arguments: object) -> tuple[int, str, str]:
        capsys.readouterr()
        code = main([str(argument) for argument in arguments])
        return code, *capsys.readouterr()

    return run


@pytest.fixture
def nacelle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, drillc: Run) -> Path:
    """A folder with the spec, compiled into out/nacelle."""
    shutil.copy(SAMPLES / "nacelle.drill", tmp_path)
    shutil.copytree(SAMPLES / "cells", tmp_path / "cells")
    monkeypatch.chdir(tmp_path)
    code, out, err = drillc("compile", "nacelle.drill")
    assert code == 0
    assert "out/nacelle/krl/NACELLE_A.src" in out.split()
    assert "krl NACELLE_A: 6 holes, verified\n" in err
    return tmp_path / "out/nacelle"


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_bytes().decode()
    assert text.count(old) >= 1
    path.write_bytes(text.replace(old, new, 1).encode())


def line_of(path: Path, text: str) -> int:
    lines = path.read_bytes().decode().split("\r\n")
    return next(i for i, line in enumerate(lines, 1) if text in line)


def test_what_was_compiled_is_verified(nacelle: Path, drillc: Run) -> None:
    assert json.loads((nacelle / "manifest.json").read_bytes())["verified"] is True
    code, out, err = drillc("verify", nacelle)
    assert (code, err) == (0, "")
    assert out.startswith("against nacelle.drill\nkrl NACELLE_A: 6 holes, verified\n")


def test_a_peck_and_a_hole_edited_by_hand(nacelle: Path, drillc: Run) -> None:
    source, data = nacelle / "krl/NACELLE_A.src", nacelle / "krl/NACELLE_A.dat"
    call = line_of(source, "drill6(P5,")
    edit(source, "  drill6(P5,", "; drill6(P5,")
    edit(source, "BOTTOM=BOTTOM+3.000", "BOTTOM=BOTTOM+3.500")
    code, out, _ = drillc("verify", nacelle)
    assert code == 3
    assert "note: krl/NACELLE_A.src (edited since drillc wrote it)\n" in out
    assert "krl NACELLE_A: 6 holes, NOT VERIFIED\n" in out
    # the hole, and where it was declared in vain
    assert "P5 is never made" in out
    declared = line_of(data, "E6POS P5=")
    assert f"krl/NACELLE_A.dat:{declared}:" in out
    assert "P5" in next(line for line in out.splitlines() if f".dat:{declared}:" in line)
    assert call
    # the peck: the line of the move, a hole that it is made at, and both depths
    stroke = line_of(source, "AT.Z=BOTTOM") + 1
    told = next(line for line in out.splitlines() if f"krl/NACELLE_A.src:{stroke}: " in line)
    assert "a peck at P" in told
    assert "1.500 mm" in told
    assert "1.000 mm" in told


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("P2={X 240.000,Y 2336.000", "P2={X 240.000,Y 2337.000", ["P2", "1.000 mm"]),
        ("drill6(P2,12.000)", "drill6(P2,13.000)", ["P2", "13.000 mm", "12.000 mm"]),
        ("drill6(P2,12.000)", "drill6(P1,12.000)", ["P2 is never made", "P1 is made again"]),
        ("$VEL.CP=0.005", "$VEL.CP=0.050", ["50", "5"]),
        ("$OUT[17]=TRUE", "$OUT[17]=FALSE", ["spindle_on"]),
        ("S 2,T 43", "S 6,T 43", ["P1"]),
        ("\r\nEND\r\n", "\r\n", ["NACELLE_A has not ended"]),
    ],
)
def test_edits_are_told(nacelle: Path, drillc: Run, old: str, new: str, words: list[str]) -> None:
    name = "NACELLE_A.dat" if "{" in old or "S 2" in old else "NACELLE_A.src"
    edit(nacelle / "krl" / name, old, new)
    code, out, _ = drillc("verify", nacelle)
    assert code == 3
    for word in words:
        assert word in out


def test_json_has_every_figure(nacelle: Path, drillc: Run) -> None:
    code, out, _ = drillc("verify", nacelle, "--json")
    data = json.loads(out)
    assert code == 0
    assert data["passed"] is True
    (program,) = data["programs"]
    checks = {check["name"]: check for check in program["checks"]}
    assert checks["coverage"]["compared"] == 6
    assert checks["position"]["worst"] <= checks["position"]["limit"] <= 0.0005 * 3**0.5 + 1e-6


def test_a_spec_that_has_moved_on(nacelle: Path, drillc: Run) -> None:
    spec = nacelle.parents[1] / "nacelle.drill"
    edit(spec, "depth 12 mm", "depth 11 mm")
    code, _, err = drillc("verify", nacelle)
    assert code == 2
    assert "nacelle.drill, has changed since (nacelle.drill): name the spec with --spec" in err
    code, out, _ = drillc("verify", nacelle, "--spec", spec)
    assert code == 3
    assert "note: nacelle.drill (the spec has moved on: changed since)\n" in out
    assert "11.000 mm" in out


def test_files_that_are_missing_or_strange(nacelle: Path, drillc: Run) -> None:
    (nacelle / "krl/MORE.src").write_bytes(b"")
    code, out, _ = drillc("verify", nacelle)
    assert code == 3
    assert "note: krl/MORE.src (not written by drillc)\n" in out
    (nacelle / "krl/MORE.src").unlink()
    (nacelle / "krl/NACELLE_A.dat").unlink()
    code, out, _ = drillc("verify", nacelle)
    assert code == 3
    assert "note: krl/NACELLE_A.dat (missing)\n" in out


def test_what_cannot_be_verified(tmp_path: Path, drillc: Run) -> None:
    code, _, err = drillc("verify", tmp_path)
    assert code == 2
    assert "has no manifest.json: drillc did not write it" in err
    (tmp_path / "manifest.json").write_text("{}")
    code, _, err = drillc("verify", tmp_path)
    assert code == 2
    assert "is no manifest of this version of drillc: compile again" in err


def test_without_proof_only_when_asked_for(nacelle: Path, drillc: Run) -> None:
    spec = nacelle.parents[1] / "nacelle.drill"
    code, _, err = drillc("compile", spec, "--no-verify")
    assert code == 0
    assert "not verified, as asked for" in err
    assert json.loads((nacelle / "manifest.json").read_bytes())["verified"] is False
    assert drillc("verify", nacelle)[0] == 0


def test_a_wrong_program_is_never_written(
    nacelle: Path, drillc: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A bug in a post: its angles have the wrong sign."""
    from drillc.postprocessors import krl

    before = {path: path.read_bytes() for path in sorted(nacelle.rglob("*")) if path.is_file()}
    right = krl.KrlPost.columns

    def wrong(self: object, task: object) -> object:
        columns = dict(right(self, task))  # type: ignore[arg-type]
        columns["x"], columns["y"] = columns["y"], columns["x"]
        return columns

    monkeypatch.setattr(krl.KrlPost, "columns", wrong)
    code, out, err = drillc("compile", "nacelle.drill")
    assert (code, out) == (3, "")
    assert "NOT VERIFIED" in err
    assert err.endswith("the programs do not do what the spec says; nothing was written\n")
    after = {path: path.read_bytes() for path in sorted(nacelle.rglob("*")) if path.is_file()}
    assert after == before
    assert [path.name for path in nacelle.parent.iterdir()] == ["nacelle"]
