"""The plug-in for the invented Boreas controller passes the kit with its own reader."""

from __future__ import annotations

import re
from pathlib import Path

from testing.installed import install, python

TESTS = Path(__file__).parents[1]

KIT = """
import pytest
from drillc.testing import PROGRAMS, accepted, check_post

@pytest.mark.parametrize("program", PROGRAMS)
def test_it_is_proven_or_refused(program):
    check_post("boreas", program)

def test_it_takes_poses_and_joints():
    taken = accepted("boreas")
    assert {"poses_drill", "poses_modules", "portal_drill", "portal_modules"} <= set(taken)
"""


def test_it_passes_the_kit(tmp_path: Path) -> None:
    site = install(TESTS / "plugin", tmp_path)
    (tmp_path / "test_boreas.py").write_text(KIT)
    done = python(
        *("-m", "pytest", "-q", "-p", "no:cacheprovider", "test_boreas.py"),
        cwd=tmp_path,
        site=site,
    )
    assert done.returncode == 0, done.stdout[-3000:]
    assert int(re.findall(r"([0-9]+) passed", done.stdout)[0]) > 15
