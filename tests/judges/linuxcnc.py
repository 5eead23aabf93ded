"""LinuxCNC as a judge: its own interpreter reads what drillc emits.

    from judges.linuxcnc import run_gcode

    judged = run_gcode(tmp_path / "gcode" / "portal_a.ngc")
    assert judged.error is None

It shares no code with drillc. Where LinuxCNC is absent, `run_gcode` and `run_rs274` skip the test
and say so; with the environment variable DRILLC_REQUIRE_LINUXCNC=1 (as in CI) they fail it.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

PYTHON = "/usr/bin/python3"  # Debian's own, for which the `gcode` module is built
_CANON = Path(__file__).with_name("linuxcnc_canon.py")


@dataclass(frozen=True)
class Move:
    """What LinuxCNC would do in one block: `place` maps all nine letters to mm or degrees.

    `feed` is in mm/min (None: rapid). `comments` are those read since the move before. A dwell has
    `seconds` and no place.
    """

    kind: str  # "traverse", "feed", "dwell"
    line: int
    comments: tuple[str, ...]
    place: dict[str, float]
    feed: float | None = None
    seconds: float | None = None


@dataclass(frozen=True)
class Judged:
    """`error` is None when the interpreter read the program to its end."""

    error: str | None
    moves: tuple[Move, ...]
    messages: tuple[str, ...]
    others: tuple[str, ...]  # whatever else it called: arcs, offsets, …
    trailing_comments: tuple[str, ...]


@cache
def absence() -> str | None:
    """Why LinuxCNC cannot judge here; None when it can."""
    if shutil.which("rs274") is None:
        return "rs274 is not installed (Debian: apt install linuxcnc-uspace)"
    probe = subprocess.run([PYTHON, "-c", "import gcode"], capture_output=True, text=True)
    return f"{PYTHON} has no gcode module: {probe.stderr[-200:]}" if probe.returncode else None


def require_linuxcnc() -> None:
    """Skip the running test, loudly, or fail it when LinuxCNC must be there."""
    if (why := absence()) is not None:
        if os.environ.get("DRILLC_REQUIRE_LINUXCNC") == "1":
            pytest.fail(f"DRILLC_REQUIRE_LINUXCNC=1, but {why}")
        pytest.skip(f"NOT JUDGED BY LINUXCNC: {why}")


def run_gcode(path: Path) -> Judged:
    """Interpret `path` with the `gcode` module: all nine axes, full precision."""
    require_linuxcnc()
    done = subprocess.run(
        [PYTHON, str(_CANON), str(path)], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    data = json.loads(done.stdout)
    return Judged(
        data["error"],
        tuple(
            Move(
                kind=move["kind"],
                line=move["line"],
                comments=tuple(move["comments"]),
                place=move.get("place", {}),
                feed=move.get("feed"),
                seconds=move.get("seconds"),
            )
            for move in data["moves"]
        ),
        tuple(data["messages"]),
        tuple(data["others"]),
        tuple(data["trailing_comments"]),
    )


def run_rs274(path: Path) -> subprocess.CompletedProcess[str]:
    """`rs274 -g` over `path`, from its folder: the stand-alone interpreter (XYZABC only).

    A non-zero return code means that it refused the program.
    """
    require_linuxcnc()
    return subprocess.run(
        ["rs274", "-g", path.name], cwd=path.parent, capture_output=True, text=True, timeout=300
    )
