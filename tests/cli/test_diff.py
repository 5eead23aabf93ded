"""`drillc diff`, by itself and as git's external diff driver, with git itself."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from drillc.cli import main

SPEC = """\
drill 1
program PLATE
tool ee90 { number 1  tcp (-350, 0, 250) mm rotate y -90 deg  mass 85 kg  cog (-140, 0, 130) mm }
io { spindle_on output 17 }
part plate { up +Z  normals into  frame 1 at (600, 0, 300) mm }
process drill6 {
  approach 60 mm  spindle 3000 rpm  feed 0.1 mm/rev  depth 12 mm  peck 3 mm  retract 60 mm
}
region top {
  posture x toward +X
  process drill6
  points mm {
    P1 (100, 40, 0) normal (0, 0, -1)
    P2 (140, 40, 0) normal (0, 0, -1)
    P3 (180, 40, 0) normal (0, 0, -1)
  }
}
emit krl
emit rapid
"""


def spec(folder: Path, *changes: tuple[str, str], name: str = "plate.drill") -> Path:
    text = SPEC
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / name
    path.write_text(text)
    return path


def diff(*arguments: object, capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    capsys.readouterr()
    code = main(["diff", *map(str, arguments)])
    return code, capsys.readouterr().out


CHANGES = [
    (
        ("posture x toward +X", "posture x toward +Y"),
        ["heading turned by -90.0000 deg"],
    ),  # the axis looks down
    (("P2 (140, 40, 0)", "P2 (140, 41.5, 0)"), ["~ P2 ", "moved sideways by 1.500 mm"]),
    (("depth 12 mm", "depth 12.4 mm"), ["~ P1, P2, P3 ", "0.400 mm deeper"]),
    (("feed 0.1 mm/rev", "feed 0.08 mm/rev"), ["the plunge: mm/s 5 -> 4"]),
    (("peck 3 mm", "peck 4 mm"), ["the plunge: pecks in mm 3 -> 4"]),
    (
        ("approach 60 mm", "approach 80 mm"),
        ["the move to 72.000 mm out: mm from the bottom -72 -> -92"],
    ),
    (("    P2 (140, 40, 0) normal (0, 0, -1)\n", ""), ["3 -> 2 holes", "removed: 1\n  - P2 "]),
    (("normal (0, 0, -1)\n  }", "normal (0, 0.1, -0.995)\n  }"), ["~ P3 ", "axis tilted by 5.73"]),
]


@pytest.mark.parametrize(("change", "words"), CHANGES)
def test_specs_and_programs_differ_alike(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    change: tuple[str, str],
    words: list[str],
) -> None:
    """Two specs, a spec and a program, two programs: the same words each time."""
    before, after = spec(tmp_path), spec(tmp_path, change, name="after.drill")
    assert main(["compile", str(before), "-o", str(tmp_path / "one")]) == 0
    assert main(["compile", str(after), "-o", str(tmp_path / "two")]) == 0
    for one, two in (
        (before, after),
        (tmp_path / "one", after),
        (before, tmp_path / "two"),
        (tmp_path / "one", tmp_path / "two"),
        (tmp_path / "one/krl/PLATE.src", tmp_path / "two/krl/PLATE.src"),
    ):
        code, out = diff(one, two, capsys=capsys)
        assert code == 1
        for word in words:
            assert word in out, f"{one} {two}:\n{out}"


def test_the_same_is_the_same(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one = spec(tmp_path)
    two = spec(tmp_path, ("program PLATE", "program PLATE  # the plate"), name="two.drill")
    assert main(["compile", str(one), "-o", str(tmp_path / "out")]) == 0
    assert diff(one, two, capsys=capsys)[0] == 0
    code, out = diff(one, tmp_path / "out", capsys=capsys)
    assert code == 0
    assert f"krl PLATE: {one} and {tmp_path / 'out'} mean the same: 3 holes\n" in out
    assert f"rapid PLATE: {one} and {tmp_path / 'out'} mean the same: 3 holes\n" in out


def test_order_and_a_program_edited_by_hand(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one = spec(tmp_path)
    for out in ("one", "two"):
        assert main(["compile", str(one), "--post", "krl", "-o", str(tmp_path / out)]) == 0
    source = tmp_path / "two/krl/PLATE.src"
    lines = source.read_bytes().split(b"\r\n")
    calls = [i for i, line in enumerate(lines) if line.startswith(b"  drill6(")]
    lines[calls[0]], lines[calls[2]] = lines[calls[2]], lines[calls[0]]
    source.write_bytes(b"\r\n".join(lines))
    code, out = diff(tmp_path / "one", tmp_path / "two", capsys=capsys)
    assert code == 1
    assert "out of turn: 2: " in out
    code, out = diff(tmp_path / "one", tmp_path / "two", "--json", capsys=capsys)
    data = json.loads(out)
    assert code == 1
    assert not data["same"]
    assert len(data["programs"][0]["order"]) == 2


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["a.drill"], "name two specs or programs"),
        (["nothing.drill", "nothing.drill"], "E120"),
        (["folder", "folder"], "has no manifest.json: drillc did not write it"),
    ],
)
def test_trouble_is_neither_same_nor_different(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    assert main(["diff", *arguments]) == 2
    assert said in capsys.readouterr().err


# ── git ──────────────────────────────────────────────────────────────────────────────────────────


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """A repository with the spec, and the driver set up as docs/verification.md says."""
    assert shutil.which("git"), "git is needed"
    folder = tmp_path / "repo"
    (folder / "specs").mkdir(parents=True)
    spec(folder / "specs")
    (folder / ".gitattributes").write_text("*.drill diff=drill\n")
    git(folder, "init", "-q")
    git(folder, "config", "diff.drill.command", f"{sys.executable} -m drillc diff --git")
    git(folder, "add", ".")
    git(folder, "commit", "-qm", "first")
    return folder


def git(folder: Path, *arguments: str) -> str:
    who = {
        f"GIT_{role}_{key}": "x@y" for role in ("AUTHOR", "COMMITTER") for key in ("NAME", "EMAIL")
    }
    run = subprocess.run(
        ["git", *arguments],
        cwd=folder,
        env={**os.environ, **who, "GIT_CONFIG_NOSYSTEM": "1", "HOME": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    return run.stdout


def test_git_diff_shows_what_a_changed_rule_means(repository: Path) -> None:
    spec(repository / "specs", ("posture x toward +X", "posture x toward +Y"))
    told = git(repository, "diff")
    assert told == (
        "drillc diff specs/plate.drill\n"
        "PLATE: 3 -> 3 holes\n"
        "changed: 3\n"
        "  heading turned: 3 holes, by -90.000 deg\n"
        "  ~ P1, P2, P3  (specs/plate.drill:13)\n"
        "      heading turned by -90.0000 deg\n"
    )
    git(repository, "commit", "-qam", "turned")
    assert "heading turned by 90.0000 deg" in git(repository, "diff", "HEAD", "HEAD~1")
    assert "heading turned by -90.0000 deg" in git(repository, "log", "-p", "--ext-diff", "-1")


def test_git_shows_text_where_meaning_has_none(repository: Path) -> None:
    spec(repository / "specs", ("process drill6\n", "process drill7\n"))
    told = git(repository, "diff")
    assert "one of the versions has errors, so they are compared as text\n" in told
    assert "-  process drill6\n+  process drill7\n" in told


def test_git_tells_of_new_and_deleted_specs(repository: Path) -> None:
    (repository / "specs/plate.drill").rename(repository / "specs/other.drill")
    git(repository, "add", "-A")
    told = git(repository, "diff", "--cached", "--no-renames")
    assert "drillc diff specs/other.drill\nnew file\n" in told
    assert "drillc diff specs/plate.drill\ndeleted file\n" in told
