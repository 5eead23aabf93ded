"""`expect`: what holds passes, what does not is refused, and the tolerance is what decides."""

from __future__ import annotations

from pathlib import Path

import pytest
from language.texts import attempted, codes, only

POSES = """drill 1
program P
part p { up +Z  normals into }
region r {
  posture x toward +X
  points mm { A (10, 20, 30) normal (0, 0, -1)  B (40, 20, 30) normal (0, 0.6, -0.8) }
}
region s { posture x toward +X  points mm { C (70, 20, 30) normal (0, 0, -1) } }
"""
PORTAL = """drill 1
program P
part p { normals outward }
robot r portal {
  D 10 m  H 5 m  d 0.75 m  height centre  side below
  limits { q3 -180 deg .. 180 deg  q5 -3 m .. 3 m }
}
region s { points m { A (5, 0.1, 0.2) normal (0, 0, 1) } }
"""


def said(folder: Path, text: str) -> list[str]:
    return codes(attempted(folder, text)[1])


@pytest.mark.parametrize(
    ("expect", "found"),
    [
        # x stays, z points down: a half turn about x. B leans by asin 0.6 = 36.8699° about x.
        ("A euler zyx (0, 0, 180) deg within 0.001 deg", []),
        ("A euler zyx (0, 0, -3.14159265358979) rad within 0.001 deg", []),
        ("A euler zyx (180, 180, 0) deg within 0.001 deg", []),
        ("A euler xyz (180, 0, 0) deg within 0.001 deg", []),
        ("A euler zyx (0.5, 0, 180) deg within 0.501 deg", []),
        ("A euler zyx (0.5, 0, 180) deg within 0.499 deg", ["E501"]),
        ("A euler zyx (0.5, 0, 180) deg within 0.0086 rad", ["E501"]),
        ("A euler zyx (0.5, 0, 180) deg within 0.0088 rad", []),
        ("B euler zyx (0, 0, -143.1301) deg within 0.001 deg", []),
        ("B euler zyx (0, 0, 143.1301) deg within 0.001 deg", ["E501"]),
        ("A quaternion (0, 1, 0, 0) within 0.001 deg", []),
        ("A quaternion (0, -1, 0, 0) within 0.001 deg", []),
        ("A quaternion (0, 0, 1, 0) within 179 deg", ["E501"]),
        ("A at (10, 20, 30) mm within 0.001 mm", []),
        ("A at (0.01, 0.02, 0.03) m within 0.001 mm", []),
        ("A at (13, 24, 30) mm within 5.001 mm", []),
        ("A at (13, 24, 30) mm within 4.999 mm", ["E502"]),  # 3-4-5
        ("r holes 2", []),
        ("s holes 1", []),
        ("r holes 3", ["E504"]),
        ("r holes 0", ["E504"]),
        ("D at (10, 20, 30) mm within 1 mm", ["E210"]),
        ("A holes 1", ["E210"]),
    ],
)
def test_poses(tmp_path: Path, expect: str, found: list[str]) -> None:
    assert said(tmp_path, f"{POSES}expect {expect}\n") == found


@pytest.mark.parametrize(
    ("joints", "within", "found"),
    [
        # By hand: α = β = 0, so q1 = q2 = H/2, q4 = d + px, q5 = py, q6 = H/2 + pz.
        ("2.5 m, 2.5 m, 0 deg, 5.75 m, 0.1 m, 2.7 m", "0.001 mm, 0.001 deg", []),
        ("2500 mm, 2.5 m, 0 rad, 5.75 m, 10 cm, 2.7 m", "0.001 deg, 0.001 mm", []),
        ("2.501 m, 2.5 m, 0 deg, 5.75 m, 0.1 m, 2.7 m", "1.001 mm, 1 deg", []),
        ("2.501 m, 2.5 m, 0 deg, 5.75 m, 0.1 m, 2.7 m", "0.999 mm, 1 deg", ["E503"]),
        ("2.5 m, 2.5 m, 1 deg, 5.75 m, 0.1 m, 2.7 m", "9 m, 0.999 deg", ["E503"]),
        ("2.5 m, 2.5 m, 1 deg, 5.75 m, 0.1 m, 2.7 m", "1 um, 1.001 deg", []),
        ("2.5 m, 2.5 m, 360 deg, 5.75 m, 0.1 m, 2.7 m", "1 mm, 1 deg", ["E503"]),
    ],
)
def test_joints(tmp_path: Path, joints: str, within: str, found: list[str]) -> None:
    assert said(tmp_path, f"{PORTAL}expect A joints ({joints}) within {within}\n") == found


def test_a_miss_names_the_joints_that_miss(tmp_path: Path) -> None:
    wanted = "2.499 m, 2.5 m, 2 deg, 5.75 m, 0.1 m, 2.7 m"
    text = f"{PORTAL}expect A joints ({wanted}) within 0.1 mm, 0.1 deg\n"
    message = only(attempted(tmp_path, text)[1]).message
    assert "q1 by +1.0000 mm" in message
    assert "q3 by -2.0000 deg" in message
    assert not any(f"{name} by" in message for name in ("q2", "q4", "q5", "q6"))


def test_every_expectation_is_checked(tmp_path: Path) -> None:
    wrong = "expect A at (1, 20, 30) mm within 1 mm\nexpect r holes 9\n"
    _, report = attempted(tmp_path, POSES + wrong + "expect s holes 1\n" + wrong)
    assert codes(report) == ["E502", "E504", "E502", "E504"]
    lines = [d.span.line for d in report.diagnostics if d.span]
    assert lines == [9, 10, 12, 13]
