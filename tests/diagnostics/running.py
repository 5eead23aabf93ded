"""Running drillc in this process, in a folder that holds a case and an earlier output."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest
from drillc.cli import main

CASES = Path(__file__).parent / "cases"
EXPECTED = "expected.txt"
MENDED = "mended.drill"
#: A spec and its tool, compiled without a message: the output that must survive.
FINE = """drill 1
program BEFORE
use "tool.cell"
part p { up +Z  normals into  frame 1 at (0, 0, 0) mm }
region r { posture x toward +X  points mm { P1 (1, 2, 3) normal (0, 0, -1) } }
emit krl
emit rapid
"""
TOOL = """drill 1
tool t { number 1  tcp (0, 0, 100) mm  mass 5 kg  cog (0, 0, 50) mm }
"""


@dataclass(frozen=True)
class Ran:
    """What one run of the command line came to."""

    code: int
    out: str
    err: str


def run(arguments: Sequence[str], capsys: pytest.CaptureFixture[str]) -> Ran:
    """Run a command line; the folder it runs in is the current one."""
    capsys.readouterr()
    code = main(arguments)
    out, err = capsys.readouterr()
    return Ran(code, out, err)


def files_of(folder: Path) -> dict[str, bytes]:
    """Every file below a folder, by its path there."""
    found = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in found}


@dataclass(frozen=True)
class Bench:
    """A folder in which a spec called spec.drill is compiled into out/spec, which is not empty."""

    folder: Path
    capsys: pytest.CaptureFixture[str]
    earlier: Path

    def write(self, files: dict[str, str | bytes]) -> None:
        """Put files into the folder; texts as UTF-8."""
        for name, content in files.items():
            path = self.folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content.encode() if isinstance(content, str) else content)

    def run(self, *arguments: str) -> Ran:
        """Run drillc here."""
        return run(arguments, self.capsys)

    def refused(self, *arguments: str) -> str:
        """Compile spec.drill, which must be refused and leave the earlier output as it was; what
        was said."""
        target = self.folder / "out" / "spec"
        shutil.rmtree(target.parent, ignore_errors=True)
        shutil.copytree(self.earlier, target)
        ran = self.run("compile", "spec.drill", *arguments)
        assert ran.code == 1, f"exit {ran.code}\n{ran.out}\n{ran.err}"
        assert ran.out == ""
        assert "Traceback" not in ran.err
        assert files_of(target.parent) == {
            f"spec/{name}": content for name, content in files_of(self.earlier).items()
        }
        return ran.err
