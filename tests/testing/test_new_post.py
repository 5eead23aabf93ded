"""`drillc new-post` writes a package that works, and touches nothing that is there."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from drillc.cli import EXIT_ERRORS, EXIT_FINE, EXIT_USAGE, main
from testing.installed import install, python

SPEC = """drill 1
program PLATE
tool ee90 { number 1  tcp (-350, 0, 250) mm rotate y -90 deg }
io { spindle_on output 17  spindle_running input 17  spindle_speed analog 1 full 6000 rpm }
part plate { up +Z  normals into  frame 1 at (600, 0, 300) mm rotate z 90 deg }
process drill6 {
  approach 60 mm  spindle 3000 rpm  feed 0.1 mm/rev  depth 12 mm  peck 3 mm  retract 60 mm
}
region top {
  posture x toward +X
  process drill6
  points mm { P1 (100, 40, 0) normal (0, 0, -1)  P2 (140, 40, 0) normal (0, 0, -1) }
}
emit demo
"""


def test_a_generated_package_works_without_an_edit(tmp_path: Path) -> None:
    done = python("-m", "drillc", "new-post", "demo", cwd=tmp_path)
    assert done.returncode == EXIT_FINE, done.stderr
    assert "demo/drillc_demo/reader.py" in done.stdout.splitlines()
    site = install(tmp_path / "demo", tmp_path / "installed")

    tests = ("-m", "pytest", "-q", "-p", "no:cacheprovider", "demo/tests")
    done = python(*tests, cwd=tmp_path, site=site)
    assert done.returncode == 0, done.stdout[-3000:]
    assert int(re.findall(r"([0-9]+) passed", done.stdout)[0]) > 15

    (tmp_path / "plate.drill").write_text(SPEC)
    done = python("-m", "drillc", "compile", "plate.drill", cwd=tmp_path, site=site)
    assert done.returncode == EXIT_FINE, done.stderr
    emitted = (tmp_path / "out" / "plate" / "demo" / "PLATE.txt").read_text()
    assert "do drill6 P2 12.000 ; P2" in emitted


def test_its_files_bear_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new-post", "my_robot2", "-o", "deep/er/folder"]) == EXIT_FINE
    folder = tmp_path / "deep" / "er" / "folder"
    written = sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file())
    assert written == [
        "README.md",
        "drillc_my_robot2/__init__.py",
        "drillc_my_robot2/post.py",
        "drillc_my_robot2/program.j2",
        "drillc_my_robot2/reader.py",
        "pyproject.toml",
        "tests/test_my_robot2.py",
    ]
    told = capsys.readouterr().out.splitlines()
    assert told == [f"deep/er/folder/{path}" for path in written]
    assert not any("newpost" in (folder / path).read_text().lower() for path in written)
    project = tomllib.loads((folder / "pyproject.toml").read_text())["project"]
    assert project["entry-points"] == {
        "drillc.postprocessors": {"my_robot2": "drillc_my_robot2.post:MyRobot2Post"},
        "drillc.readers": {"my_robot2": "drillc_my_robot2.reader:MyRobot2Reader"},
    }


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("Demo", "lower-case letters"),
        ("2demo", "begins with a letter"),
        ("a-b", "lower-case letters"),
        ("../demo", "lower-case letters"),
        ("", "lower-case letters"),
        ("demo\n", "lower-case letters"),
        ("a" * 31, "at most 30 characters"),
        ("class", "a word of Python"),
        ("krl", "there is a post krl already"),
    ],
)
def test_names_that_no_post_can_have(
    name: str,
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new-post", name]) == EXIT_USAGE
    told = capsys.readouterr()
    assert said in told.err
    assert told.out == ""
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", ["a folder", "an empty folder", "a file"])
def test_nothing_is_overwritten(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    place = tmp_path / "demo"
    if kind == "a file":
        place.write_text("mine")
    else:
        place.mkdir()
        if kind == "a folder":
            (place / "README.md").write_text("mine")
    before = {path: path.is_file() and path.read_text() for path in tmp_path.rglob("*")}
    assert main(["new-post", "demo"]) == EXIT_ERRORS
    assert "demo is there already; nothing was written" in capsys.readouterr().err
    assert {path: path.is_file() and path.read_text() for path in tmp_path.rglob("*")} == before


def test_a_place_that_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("mine")
    assert main(["new-post", "demo", "-o", "file/demo"]) == EXIT_ERRORS
    assert "drillc new-post: file/demo: Not a directory" in capsys.readouterr().err
