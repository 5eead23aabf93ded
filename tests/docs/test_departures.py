"""docs/departures.md is right: its examples do what it says, and its formulas are the kernels'."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from docs.examples import check_example, drill_examples
from docs.fenced import Block, document
from drillc.kernels.portal import PortalGeometry, height_interval, offsets, pointing
from drillc.kernels.posture import horizontal
from drillc.kernels.rotations import kuka_abc_from_matrix, matrix_from_euler

TEXT = document("departures.md")

#: The article's normals and its angles (α, β, γ) in deg, as printed.
TABLE = (
    ((-0.233, -0.012, 0.972), (0.0, 13.469, -177.035)),
    ((-0.236, -0.011, 0.972), (0.0, 13.634, -177.222)),
    ((-0.693, 0.035, 0.721), (43.898, 0.0, -92.889)),
    ((-0.754, 0.037, 0.655), (49.047, 0.0, -92.826)),
    ((-0.970, 0.110, -0.217), (0.0, -102.533, -6.483)),
    ((-0.922, 0.120, -0.369), (0.0, -111.641, -7.416)),
)


@pytest.mark.parametrize(
    "block", drill_examples("departures.md"), ids=lambda block: f"line {block.line}"
)
def test_example(block: Block, tmp_path: Path) -> None:
    check_example(block, tmp_path)


def test_the_sign_of_the_articles_third_step() -> None:
    feed = np.array([-0.233, -0.012, 0.972])
    feed /= np.linalg.norm(feed)
    ax, ay, az = feed
    s = np.hypot(ax, ay)
    n = np.array([-ay, ax, 0.0]) / s
    printed = np.array([ax * az, ay * az, -s * s]) / s
    assert np.linalg.det(np.stack([n, printed, feed], axis=1)) == pytest.approx(-1)
    posture = horizontal(feed[None], (0.0, 0.0, 1.0), 0, None, 0.0)
    mended = np.array([-ax * az, -ay * az, s * s]) / s
    assert posture.part_from_tool[0] == pytest.approx(np.stack([n, mended, feed], axis=1))


@pytest.mark.parametrize(
    ("printed", "canonical"),
    [
        (TABLE[4][1], "A 173.517, B -77.467, C 180"),
        (TABLE[5][1], "A 172.584, B -68.359, C 180"),
    ],
)
def test_the_tables_angles_in_canonical_form(
    printed: tuple[float, float, float], canonical: str
) -> None:
    rotation = matrix_from_euler(np.radians(printed[::-1]), "zyx")
    a, b, c = np.degrees(kuka_abc_from_matrix(rotation))
    assert f"A {a:.3f}, B {b:.3f}, C {c:.0f}" == canonical
    assert canonical in TEXT


def test_the_tables_columns_belong_to_x_y_z() -> None:
    """The rows' tool axes are the printed normals only when the last column turns about z."""
    by_columns = []
    for normal, angles in TABLE:
        unit = np.array(normal) / np.linalg.norm(normal)
        reversed_ = matrix_from_euler(np.radians(angles[::-1]), "zyx")[:, 2]
        assert np.degrees(np.arccos(unit @ reversed_)) < 0.05
        as_headed = matrix_from_euler(np.radians(angles), "zyx")[:, 2]
        by_columns.append(np.degrees(np.arccos(unit @ as_headed)))
    assert max(by_columns) > 10.0


def test_the_second_pair_would_look_feasible() -> None:
    geometry = PortalGeometry(10_000.0, 5_000.0, 750.0)
    alpha, _ = pointing(np.array([[0.5, 0.8138, -0.2962]]))
    assert abs(alpha[0, 0]) <= geometry.alpha_max_rad < np.pi / 2 <= abs(alpha[0, 1])
    assert np.tan(alpha[0, 0]) == pytest.approx(-np.tan(alpha[0, 1]))


def test_half_the_height_is_not_always_best() -> None:
    geometry = PortalGeometry(10_000.0, 5_000.0, 750.0)
    normal = np.array([[0.25, -0.3, 0.9205976]])
    alpha, beta = pointing(normal)
    asked = offsets(geometry, np.array([[8000.0, -600.0, 1900.0]]), alpha[:, 0], beta[:, 0])
    none = np.zeros(1)
    limits = (0.0, 5000.0)
    low, high = height_interval(asked, limits, limits, limits, none, none)
    assert 2500.0 + asked.lift_mm[0] == pytest.approx(5331.8, abs=0.05)
    assert (low[0], high[0]) == pytest.approx((1097.3, 2168.2), abs=0.05)


def test_the_bars_length() -> None:
    geometry = PortalGeometry(10_000.0, 5_000.0, 750.0)
    assert geometry.span_mm == 8500.0
    assert geometry.span_mm / np.cos(geometry.alpha_max_rad) == pytest.approx(9861.5, abs=0.05)
