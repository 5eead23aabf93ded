"""The portal's joints, its limits, its height rules and how the tool withdraws.

Worked out here without trigonometry, as in the checked facts about the second seed: with a unit
normal n and r = hypot(ny, nz): q6 = q1 + n·p, q5 = (py nz - pz ny)/r, q4 = d + (px - nx n·p)/r,
q1 - q2 = -(D - 2d) nx/r.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from language.texts import attempted, codes, interval, only, planned, refused

RIVET = "process v { approach 120 mm  clamp timeout 3 s  rivet timeout 5 s  retract 120 mm }\n"
#: Its 120 mm of standoff and a bore's depth are asked of q6, too.
BORE = "process v { approach 120 mm  retract 90 mm  spindle 600 rpm  feed 1 mm/s  depth 30 mm }\n"
#: The seed's exam, and the hole of the facts that its h = H/2 cannot serve.
EXAM = "R1 (5.5, -0.3, -0.2) normal (0.5, 0.8138, -0.2962)"
HIGH = "R (8, -0.6, 1.9) normal (0.25, -0.3, 0.9205976)"


def spec(
    *points: str,
    height: str = "centre",
    side: str = "below",
    limits: str = "",
    process: str = "",
    geometry: str = "D 10 m  H 5 m  d 0.75 m",
) -> str:
    """The robot's limits stand on line 5, the points from line 8 (without a process) on."""
    ranges = {"q3": "-180 deg .. 180 deg", "q5": "-3 m .. 3 m"}
    extra = ""
    for part in filter(None, map(str.strip, limits.split(","))):
        name, _, written = part.partition(" ")
        if name in ranges:
            ranges[name] = written
        else:
            extra += f"  {name} {written}"
    named = "process v " if process else ""
    lines = "\n".join(points)
    return f"""drill 1
program P
part p {{ normals outward }}
robot r portal {{ {geometry}  height {height}  side {side}
  limits {{ q3 {ranges["q3"]}  q5 {ranges["q5"]}{extra} }} }}
{process}region s {{ {named}
points m {{
{lines}
}} }}
"""


def joints(folder: Path, text: str) -> np.ndarray:
    solution = planned(folder, text).solution
    assert solution is not None
    return solution.motion.joints


def by_hand(position_m: tuple[float, ...], normal: tuple[float, ...], h_mm: float) -> list[float]:
    n = np.array(normal) / np.linalg.norm(normal)
    p = 1000 * np.array(position_m)
    r, along = math.hypot(n[1], n[2]), float(n @ p)
    delta = -8500 * n[0] / r / 2
    q1 = h_mm + delta
    q4, q5 = 750 + (p[0] - n[0] * along) / r, (p[1] * n[2] - p[2] * n[1]) / r
    return [q1, h_mm - delta, math.atan2(n[1], n[2]), q4, q5, q1 + along]


# ── the exam and its missing hole ────────────────────────────────────────────────────────────────


def test_the_exam(tmp_path: Path) -> None:
    q = joints(tmp_path, spec(EXAM))[0]
    wanted = by_hand((5.5, -0.3, -0.2), (0.5, 0.8138, -0.2962), 2500)
    assert q.tolist() == pytest.approx(wanted, abs=1e-9)
    # As printed, in m and degrees.
    printed = [0.0463, 4.9537, 110.0, 5.6199, 0.2905, 2.6114]
    shown = [math.degrees(v) if i == 2 else v / 1000 for i, v in enumerate(q)]
    assert shown == pytest.approx(printed, abs=1e-4)


@pytest.mark.parametrize("process", ["", RIVET])
def test_the_height_of_the_centre_can_miss_what_another_reaches(
    tmp_path: Path, process: str
) -> None:
    found = only(refused(tmp_path, spec(HIGH, process=process)))
    assert found.code == "E406"
    assert "q6" in found.message
    assert "5.3318 m" in found.message
    low, high = interval(found.message, "any h in ")
    assert (low, high) == pytest.approx((1.0973, 2.1682), abs=1e-4)
    assert found.span is not None
    assert found.span.source.line_text(found.span.line) == HIGH
    assert found.labels[0].span.line == 4  # height centre


@pytest.mark.parametrize("process", ["", RIVET])
def test_the_interval_that_is_said_does_serve(tmp_path: Path, process: str) -> None:
    """Whatever is read from the message works, and a little beyond it nothing does."""
    low, high = interval(only(refused(tmp_path, spec(HIGH, process=process))).message, "any h in ")
    for height in (low, high):
        joints(tmp_path, spec(HIGH, height=f"{height} m", process=process))
    for height in (low - 2e-5, high + 2e-5):
        report = refused(tmp_path, spec(HIGH, height=f"{height} m", process=process))
        assert codes(report) == ["E406"]


def test_a_bore_takes_its_depth_from_the_interval(tmp_path: Path) -> None:
    message = only(refused(tmp_path, spec(HIGH, process=BORE))).message
    assert interval(message, "any h in ") == pytest.approx((1.0973, 2.1682 - 0.030), abs=1e-4)
    # From above the standoff, the greater of the two, lies above the hole and the depth below it.
    message = only(refused(tmp_path, spec(HIGH, process=BORE, side="above"))).message
    assert interval(message, "any h in ") == pytest.approx((1.0973, 2.1682 - 0.120), abs=1e-4)


@pytest.mark.parametrize("process", ["", RIVET])
def test_the_widest_margin(tmp_path: Path, process: str) -> None:
    result = planned(tmp_path, spec(HIGH, height="widest_margin", process=process))
    solution = result.solution
    assert solution is not None
    q = solution.motion.joints[0]
    assert (q[0] + q[1]) / 2 == pytest.approx(1632.8, abs=0.05)
    # q1's lower end and q6's upper are equally near, at (H - A - B)/2 of H = 5 m.
    assert q[0] == pytest.approx(5000 - q[5], abs=1e-6)
    assert solution.margin[0] == pytest.approx(q[0] / 5000)
    wanted = by_hand((8, -0.6, 1.9), (0.25, -0.3, 0.9205976), (q[0] + q[1]) / 2)
    assert q.tolist() == pytest.approx(wanted, abs=1e-6)


def test_one_hole_of_least_travel_stands_at_its_widest_margin(tmp_path: Path) -> None:
    wide = joints(tmp_path, spec(HIGH, height="widest_margin", process=RIVET))
    least = joints(tmp_path, spec(HIGH, height="least_travel", process=RIVET))
    assert least == pytest.approx(wide)


def test_a_hint_names_a_height_for_all(tmp_path: Path) -> None:
    other = "S (4, 0.2, 0.1) normal (0, 0, 1)"
    hint = only(refused(tmp_path, spec(HIGH, other, process=RIVET))).hint
    assert hint is not None
    low, high = interval(hint, "any h in ")
    assert hint.endswith("serves all holes")
    for height in (low, high):
        q = joints(tmp_path, spec(HIGH, other, height=f"{height} m", process=RIVET))
        assert (q[:, 0] + q[:, 1]) / 2 == pytest.approx([height * 1000] * 2)


def test_no_hint_where_no_height_serves_all(tmp_path: Path) -> None:
    """HIGH wants h ≤ 2.168 m, the other at least 2.4 m and its standoff."""
    deep = "S (4, 0, -2.4) normal (0, 0, 1)"
    report = refused(tmp_path, spec(HIGH, deep, process=RIVET))
    assert codes(report) == ["E406", "E406"]
    assert all(d.hint and "serves all" not in d.hint for d in report.diagnostics)
    joints(tmp_path, spec(HIGH, deep, height="least_travel", process=RIVET))


def test_no_height_at_all(tmp_path: Path) -> None:
    """q1 and q2 may only be far below where q6 must be."""
    text = spec(HIGH, height="widest_margin", limits="q1 1 m .. 4 m, q2 4.2 m .. 5 m")
    found = only(refused(tmp_path, text))
    assert found.code == "E405"
    # δ = -1.0973 m + …: q2 = h - δ in [4.2, 5], so h in [3.1027, 3.9027]; q6 = h + 2.8318 ≤ 5.
    assert interval(found.message, "q1 and q2 need h in ") == pytest.approx(
        (3.1027, 3.9027), abs=1e-4
    )
    assert interval(found.message, "needs h in ")[1] == pytest.approx(2.1682, abs=1e-4)


# ── limits ───────────────────────────────────────────────────────────────────────────────────────


def tilted(nx: float) -> str:
    return f"T (4, 0, 0) normal ({nx:.9f}, 0, {math.sqrt(1 - nx * nx):.9f})"


#: H/√(H² + (D-2d)²): the steepest normal that the columns allow.
STEEPEST = 5 / math.hypot(5, 8.5)


def test_the_columns_limit_the_tilt(tmp_path: Path) -> None:
    for nx in (STEEPEST - 1e-6, 1e-6 - STEEPEST):
        q = joints(tmp_path, spec(tilted(nx), height="2.5 m"))[0]
        assert sorted(q[:2]) == pytest.approx([0, 5000], abs=0.1)
    for nx in (STEEPEST + 1e-5, -STEEPEST - 1e-5, 1.0, -1.0):
        found = only(refused(tmp_path, spec(tilted(nx))))
        assert found.code == "E401"
        assert "30.47 deg" in found.message
        assert "0.5070" in found.message


def test_a_narrower_tilt(tmp_path: Path) -> None:
    """α = -asin(nx): a normal that leans towards +x takes the bar's right end up."""
    for nx, fine in ((0.5, False), (-0.5, False), (0.17, True), (-0.34, True), (0.18, False)):
        text = spec(tilted(nx), height="widest_margin", limits="alpha -10 deg .. 20 deg")
        result, report = attempted(tmp_path, text)
        assert (result is not None) == fine, nx
        assert codes(report) == ([] if fine else ["E402"])


def test_a_normal_that_points_down_is_turned_over_by_q3_not_by_alpha(tmp_path: Path) -> None:
    q = joints(tmp_path, spec("T (4, 0.1, 0.2) normal (0.1, 0, -0.9949874)"))[0]
    assert abs(q[2]) == pytest.approx(math.pi)
    assert q[0] - q[1] == pytest.approx(-8500 * 0.1 / 0.9949874, rel=1e-6)


@pytest.mark.parametrize(
    ("limits", "q3_deg"),
    [
        ("q3 -180 deg .. 180 deg", 110),
        ("q3 0 deg .. 120 deg", 110),
        ("q3 -360 deg .. 0 deg", -250),
        ("q3 360 deg .. 720 deg", 470),
        ("q3 -720 deg .. -560 deg", -610),
    ],
)
def test_windings_of_q3(tmp_path: Path, limits: str, q3_deg: float) -> None:
    """The exam's β = 110°, or a full turn more or less, as the limits have it."""
    text = spec(EXAM, limits=limits)
    assert math.degrees(joints(tmp_path, text)[0, 2]) == pytest.approx(q3_deg, abs=0.01)


def test_windings_follow_each_other(tmp_path: Path) -> None:
    """Around a barrel by way of 180°: without a jump back where the limits allow it."""
    points = []
    for i, angle in enumerate(range(0, 400, 25)):
        a = math.radians(angle)
        points.append(
            f"H{i} ({3 + i / 10}, {math.sin(a):.9f}, {math.cos(a):.9f}) "
            f"normal (0, {math.sin(a):.9f}, {math.cos(a):.9f})"
        )
    text = spec(*points, height="least_travel", limits="q3 -400 deg .. 400 deg")
    q3 = np.degrees(joints(tmp_path, text)[:, 2])
    assert np.diff(q3) == pytest.approx([25.0] * 15, abs=1e-4)


@pytest.mark.parametrize(
    ("limits", "code", "said"),
    [
        ("q3 0 deg .. 100 deg", "E403", "q3 110.00 deg"),
        ("q4 5.7 m .. 9 m", "E404", "q4 5619.9 mm"),
        ("q4 1 m .. 5.6 m", "E404", "q4 5619.9 mm"),
        ("q5 -3 m .. 0.29 m", "E404", "q5 290.5 mm"),
        ("q5 0.291 m .. 1 m", "E404", "q5 290.5 mm"),
        ("q6 2.5 m .. 5 m", "E406", "q6 2.6114 m"),
        ("q1 0.047 m .. 5 m", "E406", "q1 0.0463 m"),
        ("q2 0 m .. 4.95 m", "E406", "q2 4.9537 m"),
    ],
)
def test_each_limit(tmp_path: Path, limits: str, code: str, said: str) -> None:
    found = only(refused(tmp_path, spec(EXAM, limits=limits, process=RIVET)))
    assert found.code == code
    name, value = said.split(" ", 1)
    assert name in found.message
    assert value in found.message


def test_what_lies_on_a_limit_passes(tmp_path: Path) -> None:
    flat = "T (4, 0.5, 1) normal (0, 0, 1)"  # q4 = 4.75, q5 = 0.5, q6 = h + 1
    exact = (
        "q1 2 m .. 2.5 m, q2 2.5 m .. 3 m, q4 4.75 m .. 9 m, q5 0 m .. 0.5 m, q6 3.38 m .. 3.5 m"
    )
    solution = planned(tmp_path, spec(flat, limits=exact, process=RIVET)).solution
    assert solution is not None
    q = solution.motion.joints[0]
    assert q.tolist() == pytest.approx([2500, 2500, 0, 4750, 500, 3500], abs=1e-9)
    assert solution.margin[0] == pytest.approx(0, abs=1e-9)
    report = refused(tmp_path, spec(flat, limits=exact.replace("3.38", "3.3801"), process=RIVET))
    assert codes(report) == ["E405"]


def test_the_margin_is_of_the_whole_cycle(tmp_path: Path) -> None:
    """The nearest limit as a share of its joint's range: q6 goes 120 mm below and 30 mm above."""
    flat = "T (4, 0, 0) normal (0, 0, 1)"  # q1 = q2 = q6 = h, q3 = 0, q4 = 4.75 m, q5 = 0
    text = spec(flat, process=BORE, limits="q6 2 m .. 3 m")
    solution = planned(tmp_path, text).solution
    assert solution is not None
    assert solution.margin.tolist() == pytest.approx([0.38])  # 2.5 - 0.12 - 2 of 1 m
    solution = planned(tmp_path, text.replace("2 m .. 3 m", "2 m .. 2.6 m")).solution
    assert solution is not None
    assert solution.margin.tolist() == pytest.approx([0.07 / 0.6])
    solution = planned(tmp_path, text.replace("below", "above")).solution
    assert solution is not None
    assert solution.margin.tolist() == pytest.approx([0.38])  # now 120 mm above: 3 - 2.62
    solution = planned(tmp_path, spec(flat, limits="q3 -10 deg .. 90 deg")).solution
    assert solution is not None
    assert solution.margin.tolist() == pytest.approx([0.1])


# ── side ─────────────────────────────────────────────────────────────────────────────────────────


def test_the_side_turns_the_tool_not_the_plate(tmp_path: Path) -> None:
    below = planned(tmp_path, spec(EXAM, process=RIVET))
    above = planned(tmp_path, spec(EXAM, process=RIVET, side="above"))
    assert below.solution is not None
    assert above.solution is not None
    assert above.solution.motion.joints.tolist() == below.solution.motion.joints.tolist()
    normal = np.array([0.5, 0.8138, -0.2962]) / np.linalg.norm([0.5, 0.8138, -0.2962])
    for result, sign in ((below, 1), (above, -1)):
        assert result.part_from_tool[0, :, 2] == pytest.approx(sign * normal)
        assert np.linalg.det(result.part_from_tool[0]) == pytest.approx(1)
        assert result.solution is not None
        assert result.solution.motion.feed_sign == sign
        assert result.solution.motion.feed_axis == 5


# ── withdrawing ──────────────────────────────────────────────────────────────────────────────────

UNEVEN = "process v { approach 60 mm  retract 150 mm  clamp timeout 3 s  rivet timeout 5 s }\n"
NEAR = [f"N{i} ({4 + i / 100}, 0, 0) normal (0, 0, 1)" for i in range(4)]


def withdrawn(folder: Path, text: str) -> tuple[np.ndarray, np.ndarray]:
    solution = planned(folder, text).solution
    assert solution is not None
    return solution.motion.withdraw_mm, solution.motion.joints[:, 5]


@pytest.mark.parametrize(
    ("process", "away"), [(RIVET, 120), (UNEVEN, 150), (UNEVEN.replace("60 mm", "200 mm"), 200)]
)
def test_near_holes_are_left_by_the_farther_standoff(
    tmp_path: Path, process: str, away: float
) -> None:
    withdraw, q6 = withdrawn(tmp_path, spec(*NEAR, process=process))
    assert withdraw[1:] == pytest.approx(q6[1:] - away)
    assert withdraw[0] == 0  # the region's first: as far as it goes
    text = spec(*NEAR, process=process, side="above", limits="q6 0 m .. 4.9 m")
    withdraw, q6 = withdrawn(tmp_path, text)
    assert withdraw[1:] == pytest.approx(q6[1:] + away)
    assert withdraw[0] == 4900


def test_never_nearer_than_either_standoff(tmp_path: Path) -> None:
    """Up and down a stair: q6 of the hole that is left counts as much as that of the next."""
    stair = [f"N{i} ({4 + i / 100}, 0, {0.02 * (i % 3)}) normal (0, 0, 1)" for i in range(7)]
    for side, sign in (("below", 1), ("above", -1)):
        text = spec(*stair, process=UNEVEN, side=side)
        withdraw, q6 = withdrawn(tmp_path, text)
        for i in range(1, len(q6)):
            leave, arrive = q6[i - 1] - sign * 150, q6[i] - sign * 60
            assert sign * withdraw[i] <= min(sign * leave, sign * arrive) + 1e-9
        assert len(set(withdraw[1:])) > 1  # not all the way out each time


def test_full_withdrawal_at_the_first_hole_of_every_region(tmp_path: Path) -> None:
    text = spec(*NEAR[:2], process=RIVET, limits="q6 0.1 m .. 5 m")
    more = "\n".join(NEAR[2:])
    text += f"region t {{ process v  points m {{\n{more}\n}} }}\n"
    withdraw, q6 = withdrawn(tmp_path, text)
    assert withdraw.tolist() == pytest.approx([100, q6[1] - 120, 100, q6[3] - 120])


def test_full_withdrawal_where_the_plate_may_be_in_the_way(tmp_path: Path) -> None:
    """Two holes on a bulge towards the tool, far apart: the standoff is not enough."""
    # Outward normals point up; below, the tool meets the plate's inner side: a bowl bulges down.
    bowl = [
        "A (2, 0, 0) normal (0.4, 0, 0.9165151)",
        "B (6, 0, 0) normal (-0.4, 0, 0.9165151)",
    ]
    withdraw, _ = withdrawn(tmp_path, spec(*bowl, height="widest_margin", process=RIVET))
    assert withdraw[1] == 0
    flat = ["A (2, 0, 0) normal (0, 0, 1)", "B (6, 0, 0) normal (0, 0, 1)"]
    withdraw, q6 = withdrawn(tmp_path, spec(*flat, height="widest_margin", process=RIVET))
    assert withdraw[1] == pytest.approx(q6[1] - 120)
