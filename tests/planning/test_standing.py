"""Where an arm may stand, and wait."""

from __future__ import annotations

import numpy as np
from drillc.language.diagnostics import Report
from drillc.planning.cell import make_cells
from drillc.planning.reach import moved
from drillc.planning.standing import check_standing, stands_clear
from planning.arm_specs import arm_spec, plan

#: The root's capsule has 0.12 of upper arm and forearm as its radius: 332.4 mm.
RADIUS_MM = 0.12 * (1350 + 1420)


def errors(report):
    return [(d.code, d.message) for d in report.diagnostics if d.severity == "error"]


def beside(gap_mm):
    """A post beside the root, on the side away from the work."""
    x = 1500 + RADIUS_MM + gap_mm
    return f"fixture post {{ box ({x}, -50, 0) ({x + 100}, 50, 300) mm }}"


def test_how_near_the_root_may_stand(tmp_path):
    assert plan(tmp_path, arm_spec(more=beside(2.1)))[0] is not None
    [(code, message)] = errors(plan(tmp_path, arm_spec(more=beside(1.0)))[1])
    assert code == "E413"
    assert "its root is only 1.0 mm from fixture post (it keeps 2 mm)" in message
    [(code, message)] = errors(plan(tmp_path, arm_spec(more=beside(-1.0)))[1])
    assert code == "E413"
    assert "its root stands in fixture post" in message


def test_home_is_said_once_for_all_that_is_in_the_way(tmp_path):
    wall = "fixture wall { box (-500, -400, 1700) (800, 400, 2300) mm }"
    [(code, message)] = errors(plan(tmp_path, arm_spec(more=wall))[1])
    assert code == "E414"
    assert message.startswith("at home, ")
    assert "; likewise the arm's link" in message


def test_without_a_home_only_the_root_counts(tmp_path):
    wall = "fixture wall { box (-500, -400, 2400) (800, 400, 2500) mm }"
    near = arm_spec(more=wall.replace("2400", "1900"))
    assert errors(plan(tmp_path, near)[1])[0][0] == "E414"
    codes = {code for code, _ in errors(plan(tmp_path, arm_spec(more=wall, home=""))[1])}
    assert "E414" not in codes


def test_moved_at_once_is_as_moved_one_by_one(tmp_path):
    more = "fixture post { box (700, -1200, -400) (900, -300, 2600) mm }"
    planned, _ = plan(tmp_path, arm_spec(home=""))
    job = plan(tmp_path, arm_spec(more=more.replace("700, -1200", "-700, -5200")))[0].job
    assert planned is not None
    [cell] = make_cells(job, job.robot)
    moves = np.stack(np.meshgrid(*[np.arange(-3000.0, 3001, 750)] * 2, [0.0, 400.0]), -1)
    moves = moves.reshape(-1, 3) - [2000, 5000, 0]
    found = stands_clear(cell, moves)
    assert 0 < found.sum() < len(found)
    assert [check_standing(moved(cell, move), Report()) for move in moves] == found.tolist()
