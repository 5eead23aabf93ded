"""Every sample against arithmetic of its own: numpy and scipy, never drillc's kernels.

The nacelle and the portal are the seeds' printed examples. Of the two panels every hole is checked,
from its id and from its row in the table.
"""

from __future__ import annotations

import csv
import io
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from drillc.driver import Planned, check_spec, plan_spec
from drillc.inspection import write_inspection
from drillc.language.diagnostics import Refused, Report
from scipy import sparse
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

SAMPLES = Path(__file__).parents[2] / "samples"
SPECS = sorted(path.name for path in SAMPLES.glob("*.drill"))

#: Warnings that a sample gives on purpose, by file: none so far.
EXPLAINED: dict[str, list[str]] = {}

Columns = dict[str, np.ndarray]


@cache
def planned(name: str) -> Planned:
    return plan_spec(SAMPLES / name, None, Report())


@cache
def inspected(name: str) -> Columns:
    """What `drillc inspect --format csv` prints."""
    text = io.StringIO()
    write_inspection(planned(name), "csv", text)
    text.seek(0)
    return columns(text, ",", {"id", "region"})


def columns(file: io.TextIOBase, delimiter: str, texts: set[str]) -> Columns:
    header, *rows = csv.reader(file, delimiter=delimiter)
    return {
        title: np.array(values, dtype=str if title in texts else float)
        for title, values in zip(header, zip(*rows, strict=True), strict=True)
    }


def table(name: str, delimiter: str) -> Columns:
    with (SAMPLES / name).open(encoding="ascii", newline="") as file:
        return columns(file, delimiter, {"FAST_ID"})


def triples(found: Columns, *titles: str) -> np.ndarray:
    return np.stack([found[title] for title in titles], axis=1)


def rotations(found: Columns) -> Rotation:
    return Rotation.from_quat(triples(found, "qx", "qy", "qz", "qw"))


def apart(a: Rotation, b: Rotation) -> np.ndarray:
    """The angle between orientations, in degrees."""
    return np.degrees((a.inv() * b).magnitude())


def variant(folder: Path, name: str, old: str, new: str) -> Path:
    """A sample with one text replaced, among copies of all that it reads."""
    shutil.copytree(SAMPLES, folder / "samples")
    path = folder / "samples" / name
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == 1
    path.write_text(text.replace(old, new), encoding="utf-8")
    return path


def refusal(path: Path) -> Report:
    report = Report()
    with pytest.raises(Refused):
        plan_spec(path, None, report)
    return report


# ── all samples ──────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("name", SPECS)
def test_a_sample_passes_without_a_word(name):
    report = Report()
    check_spec(SAMPLES / name, report)
    assert [d.code for d in report.diagnostics] == EXPLAINED.get(name, [])


def test_the_samples_stay_small():
    files = [p for p in SAMPLES.rglob("*") if p.is_file() and "__pycache__" not in p.parts]
    assert sum(path.stat().st_size for path in files) < 600_000


def test_the_generator_makes_the_very_tables_that_are_kept(tmp_path):
    subprocess.run([sys.executable, SAMPLES / "make_panels.py", tmp_path], check=True)
    made = sorted(path.name for path in tmp_path.iterdir())
    assert made == sorted(path.name for path in SAMPLES.glob("*.csv"))
    for name in made:
        assert (tmp_path / name).read_bytes() == (SAMPLES / name).read_bytes()


# ── the nacelle: the posture article's table ─────────────────────────────────────────────────────

# Name, feed direction, its rule (which axis, toward), and the printed angles (α, β, γ).
ARTICLE = [
    ("P1", (-0.233, -0.012, 0.972), "y", (0, -1, 0), (0.0, 13.469, -177.035)),
    ("P2", (-0.236, -0.011, 0.972), "y", (0, -1, 0), (0.0, 13.634, -177.222)),
    ("P4", (-0.693, 0.035, 0.721), "x", (0, -1, 0), (43.898, 0.0, -92.889)),
    ("P5", (-0.754, 0.037, 0.655), "x", (0, -1, 0), (49.047, 0.0, -92.826)),
    ("P7", (-0.970, 0.110, -0.217), "y", (0, 1, 0), (0.0, -102.533, -6.483)),
    ("P8", (-0.922, 0.120, -0.369), "y", (0, 1, 0), (0.0, -111.641, -7.416)),
]


@pytest.mark.parametrize(("name", "feed", "axis", "toward", "printed"), ARTICLE)
def test_the_nacelle_is_the_articles_table(name, feed, axis, toward, printed):
    found = inspected("nacelle.drill")
    got = rotations(found)[found["id"].tolist().index(name)]

    z = np.array(feed) / np.linalg.norm(feed)
    level = np.array([-z[1], z[0], 0.0]) / np.hypot(z[0], z[1])
    level *= np.sign(level @ toward)
    x, y = (level, np.cross(z, level)) if axis == "x" else (np.cross(level, z), level)
    by_hand = Rotation.from_matrix(np.stack([x, y, z], axis=1))
    difference = got.as_quat(canonical=True) - by_hand.as_quat(canonical=True)
    assert np.abs(difference).max() < 1e-9

    alpha, beta, gamma = printed
    assert apart(got, Rotation.from_euler("ZYX", [gamma, beta, alpha], degrees=True)) < 0.2


def test_the_nacelle_has_the_articles_points_and_no_more():
    found = inspected("nacelle.drill")
    assert found["id"].tolist() == [row[0] for row in ARTICLE]
    assert triples(found, "x_mm", "y_mm", "z_mm")[[0, 5]].tolist() == [
        [240, 2379, -542],
        [571, 1730, 392],
    ]


# ── the portal: the exam's answer ────────────────────────────────────────────────────────────────


def test_the_portal_gives_the_exams_answer():
    found = inspected("portal.drill")
    lengths = triples(found, *(f"q{i}_mm" for i in (1, 2, 4, 5, 6)))[0] / 1000.0
    assert np.abs(lengths - [0.0463, 4.9537, 5.6199, 0.2905, 2.6114]).max() < 1e-4
    assert abs(found["q3_deg"][0] - 110.0) < 0.01
    assert abs(np.radians(found["q3_deg"][0]) - 1.9199) < 1e-4


# ── the barrels ──────────────────────────────────────────────────────────────────────────────────


def beyond(position, crown, meridian, station, below):
    """How far points (n, 3) lie outside a barrel (its outward normal is this one's gradient)."""
    x, y, z = position.T
    return np.hypot(x - station, np.hypot(y, z + below) - (crown - meridian)) - meridian


PANEL = (2000.0, 20_000.0, 0.0, 0.0)
SKIN = (3000.0, 9000.0, 4250.0, 1300.0)


@pytest.mark.parametrize(
    ("name", "delimiter", "to_mm", "barrel"),
    [("panel.csv", ";", 1.0, PANEL), ("skin_portal.csv", ",", 1000.0, SKIN)],
)
def test_the_tables_lie_on_their_barrels(name, delimiter, to_mm, barrel):
    found = table(name, delimiter)
    position, normal = triples(found, "X", "Y", "Z") * to_mm, triples(found, "NX", "NY", "NZ")
    assert len(set(found["FAST_ID"].tolist())) == len(normal) > 2000
    assert np.abs(np.linalg.norm(normal, axis=1) - 1.0).max() < 1e-7
    assert np.abs(beyond(position, *barrel)).max() < 2e-4
    gradient = [
        beyond(position + step, *barrel) - beyond(position - step, *barrel)
        for step in np.eye(3) * 0.05
    ]
    assert np.abs(np.stack(gradient, axis=1) / 0.1 - normal).max() < 1e-6
    text = (SAMPLES / name).read_text(encoding="ascii")
    assert not any(
        float(cell) == 0.0 and cell.startswith("-")
        for line in text.splitlines()[1:]
        for cell in line.split(delimiter)[1:]
    )


# ── the panel ────────────────────────────────────────────────────────────────────────────────────


def panel_angles(name: str) -> tuple[float, float]:
    """u and θ in degrees, from an id as make_panels.py describes them."""
    row, place = int(name[1:3]), int(name[3:])
    match name[0]:
        case "S":
            return (place - 43) / 10, 5.0 * (row - 10)
        case "L":
            return (place - 43) / 10, 48.0 + row
        case _:
            return 1.4 * (4 - row), place - 48.0


@pytest.fixture(scope="module")
def panel() -> Columns:
    """What inspect prints, with the table's columns beside it and the angles from the ids."""
    found = inspected("panel.drill")
    rows = table("panel.csv", ";")
    order = {name: i for i, name in enumerate(rows["FAST_ID"].tolist())}
    row = [order[name] for name in found["id"].tolist()]
    angles = np.array([panel_angles(name) for name in found["id"].tolist()])
    extra = {title: values[row] for title, values in rows.items()}
    return {**extra, **found, "u": angles[:, 0], "theta": angles[:, 1]}


def test_the_panels_regions_share_out_the_table(panel):
    """All but the tooling holes, in the table's own order, each region as its name promises."""
    listed = [i for i in table("panel.csv", ";")["FAST_ID"].tolist() if i[0] != "T"]
    assert panel["id"].tolist() == listed
    first = np.array([name[0] for name in listed])
    theta = panel["theta"]
    wanted = np.select(
        [first == "F", first == "L", np.abs(theta) <= 5, theta < 0],
        ["frames", "lap", "crown", "starboard"],
        "port",
    )
    assert (panel["region"] == wanted).all()
    assert np.array_equal(triples(panel, "x_mm", "y_mm", "z_mm"), triples(panel, "X", "Y", "Z"))


def test_the_panels_tool_points_into_the_skin_and_keeps_to_its_rule(panel):
    x, y, z = np.moveaxis(rotations(panel).as_matrix(), -1, 0)
    normal = triples(panel, "NX", "NY", "NZ")
    assert np.abs(z + normal / np.linalg.norm(normal, axis=1)[:, None]).max() < 1e-10

    steep = np.degrees(np.arctan2(np.hypot(normal[:, 0], normal[:, 1]), np.abs(normal[:, 2])))
    forward = (panel["region"] == "crown") | ((panel["region"] == "frames") & (steep < 10.0))
    quarter = panel["region"] == "lap"
    level = ~forward & ~quarter
    assert forward.sum() > 300
    assert np.abs(y[forward, 0]).max() < 1e-10  # x leans as far forward as the skin allows
    assert x[forward, 0].min() > 0.9
    assert np.abs(x[level, 2]).max() < 1e-10
    assert x[level, 0].min() > 0
    assert np.abs(y[quarter, 2]).max() < 1e-10
    assert y[quarter, 0].max() < 0


def test_the_panels_orientations_follow_from_the_ids(panel):
    """The formulas beside the spec's expectations, for all holes."""
    u, theta = np.radians(panel["u"]), np.radians(panel["theta"])
    side = np.where(theta < 0, -1.0, 1.0)
    across = np.arctan2(-side * np.sin(u), np.cos(u) * np.abs(np.sin(theta)))
    over = side * np.arccos(-np.cos(u) * np.cos(theta))
    level = Rotation.from_euler("ZX", np.stack([across, over], axis=1))
    forward = Rotation.from_euler("XYX", np.stack([-theta, u, np.full(len(u), np.pi)], axis=1))
    quarter = level * Rotation.from_euler("Z", 90, degrees=True)
    steep = np.degrees(np.arccos(np.cos(u) * np.cos(theta)))
    ahead = (panel["region"] == "crown") | ((panel["region"] == "frames") & (steep < 10.0))
    got = rotations(panel)
    wanted = np.where(
        ahead[:, None, None],
        forward.as_matrix(),
        np.where((panel["region"] == "lap")[:, None, None], quarter.as_matrix(), level.as_matrix()),
    )
    assert apart(got, Rotation.from_matrix(wanted)).max() < 1e-5  # the table's eight decimals


def test_the_panel_is_drilled_through_and_sunk(panel):
    assert set(panel["DIA"].tolist()) == {4.8}
    depth = panel["GRIP"] + 2.0 + (8.2 - 4.8) / 2.0 / np.tan(np.radians(50.0))
    assert np.abs(planned("panel.drill").programs[0].depth_mm - depth).max() < 1e-9
    assert set(panel["GRIP"].tolist()) == {3.4, 3.8, 4.6, 5.0}


def test_between_two_holes_the_panel_is_not_scratched_and_the_tool_not_spun(panel):
    """Straight from standoff to standoff: outside the skin; and in a region turned by little."""
    normal = triples(panel, "NX", "NY", "NZ")
    standoff = triples(panel, "X", "Y", "Z") + 60.0 * normal
    for share in np.linspace(0.0, 1.0, 9):
        point = standoff[:-1] + share * (standoff[1:] - standoff[:-1])
        assert beyond(point, *PANEL).min() > 50.0

    # Carry a tool's x axis to the next hole by the smallest rotation that takes z there.
    x, _, z = np.moveaxis(rotations(panel).as_matrix(), -1, 0)
    axis = np.cross(z[:-1], z[1:])
    carried = Rotation.from_rotvec(
        axis * (np.arcsin(np.linalg.norm(axis, axis=1)) / np.linalg.norm(axis, axis=1))[:, None]
    ).apply(x[:-1])
    turned = np.degrees(np.arccos(np.clip((carried * x[1:]).sum(axis=1), -1, 1)))
    together = panel["region"][1:] == panel["region"][:-1]
    assert turned[together].max() < 30.0


def test_without_the_crowns_own_rule_the_panel_is_refused(tmp_path):
    """ "Horizontal" decides nothing on the crown's ridge."""
    path = variant(
        tmp_path, "panel.drill", "posture x toward +X\n", "posture x horizontal toward +X\n"
    )
    assert {d.code for d in refusal(path).diagnostics} == {"E351", "E353"}


def test_without_the_fallback_the_panels_frames_spin_the_tool(tmp_path):
    """And the hole that the spec expects to be made with x forward is not."""
    path = variant(tmp_path, "panel.drill", "cone 10 deg fallback x toward +X", "")
    assert {d.code for d in refusal(path).diagnostics} == {"W350", "E501"}


# ── the skin on the portal ───────────────────────────────────────────────────────────────────────

SPAN, INSET = 8500.0, 750.0  # D - 2d, d
SPEED = 50.0, 50.0, 200.0  # q1, q2, q6


def skin_angles(name: str) -> tuple[float, float]:
    if name[0] == "F":
        return 3.6 * (int(name[1:3]) - 8) + 0.6, 0.6 * (int(name[3:]) - 71)
    return 0.45 * (int(name[2:]) - 57) + 0.6, {"1": -43.2, "2": 43.2}[name[1]]


class Skin:
    """What the table asks of the joints, by the identities without trigonometry."""

    def __init__(self) -> None:
        rows = table("skin_portal.csv", ",")
        self.ids = rows["FAST_ID"].tolist()
        p, n = triples(rows, "X", "Y", "Z") * 1000.0, triples(rows, "NX", "NY", "NZ")
        n /= np.linalg.norm(n, axis=1)[:, None]
        self.normal, r, along = n, np.hypot(n[:, 1], n[:, 2]), (n * p).sum(axis=1)
        self.tilt = -SPAN * n[:, 0] / r  # q1 - q2
        self.rise = along  # q6 - q1
        self.q4 = INSET + (p[:, 0] - n[:, 0] * along) / r
        self.q5 = (p[:, 1] * n[:, 2] - p[:, 2] * n[:, 1]) / r
        # The heights that the limits allow, with the standoff below the hole.
        delta, lift = self.tilt / 2, self.tilt / 2 + along
        self.standoff = np.array([180.0 if name[0] == "J" else 120.0 for name in self.ids])
        self.low = np.maximum(50.0 + np.abs(delta), 100.0 + self.standoff - lift)
        self.high = np.minimum(4950.0 - np.abs(delta), 4920.0 - lift)
        self.delta, self.lift = delta, lift

    def travel_s(self, height: np.ndarray) -> float:
        joints = height + self.delta, height - self.delta, height + self.lift
        return sum(np.abs(np.diff(q)).sum() / v for q, v in zip(joints, SPEED, strict=True))


@pytest.fixture(scope="module")
def skin() -> Skin:
    return Skin()


def joints(found: Columns) -> np.ndarray:
    """(n, 6) in mm and degrees."""
    return triples(found, "q1_mm", "q2_mm", "q3_deg", "q4_mm", "q5_mm", "q6_mm")


def test_the_skins_joints_obey_the_identities(skin):
    found = inspected("skin_portal.drill")
    assert found["id"].tolist() == skin.ids
    q1, q2, q3, q4, q5, q6 = joints(found).T
    assert np.abs(q1 - q2 - skin.tilt).max() < 1e-5
    assert np.abs(q6 - q1 - skin.rise).max() < 1e-5
    assert np.abs(q4 - skin.q4).max() < 1e-5
    assert np.abs(q5 - skin.q5).max() < 1e-5
    # q3 turns the normal into the bar's vertical plane, upper side up.
    _, ny, nz = skin.normal.T
    sin, cos = np.sin(np.radians(q3)), np.cos(np.radians(q3))
    assert np.abs(ny * cos - nz * sin).max() < 1e-9
    assert (ny * sin + nz * cos).min() > 0
    assert np.abs(skin.normal[:, 0]).max() <= 0.50702


def test_the_skins_joints_follow_from_the_ids(skin):
    """The formulas beside the spec's expectations, for all rivets, the heights included."""
    u, theta = np.radians(np.array([skin_angles(name) for name in skin.ids]).T)
    g = 3000 - 9000 * (1 - np.cos(u)) - 1300 * np.cos(theta)
    px = 4250 + 9000 * np.sin(u)
    delta = -4250 * np.tan(u)
    lift = delta + px * np.sin(u) + g * np.cos(u)
    at_end = np.where(np.abs(theta) > np.radians(43), theta, np.radians(42))
    end = lift + 1300 * (np.cos(theta) - np.cos(at_end)) * np.cos(u)
    last = (50 + abs(delta[-1]) + 4920 - lift[-1]) / 2
    h = last + lift[-1] - end
    wanted = [
        h + delta,
        h - delta,
        np.degrees(theta),
        750 + px * np.cos(u) - g * np.sin(u),
        1300 * np.sin(theta),
        h + lift,
    ]
    got = joints(inspected("skin_portal.drill"))
    assert np.abs(got - np.stack(wanted, axis=1)).max() < 1e-3


def test_the_skins_cycles_stay_inside_the_limits(skin):
    """Every joint; q6 also at the standoff, and where the tool waits while the part moves."""
    q = joints(inspected("skin_portal.drill"))
    low = np.array([50.0, 50.0, -60.0, 200.0, -1500.0, 100.0])
    high = np.array([4950.0, 4950.0, 60.0, 9800.0, 1500.0, 4920.0])
    assert ((q >= low - 1e-6) & (q <= high + 1e-6)).all()
    assert (q[:, 5] - skin.standoff >= 100.0).all()
    motion = planned("skin_portal.drill").programs[0].motion
    assert motion is not None
    assert (motion.withdraw_mm >= 100.0).all()
    assert (motion.withdraw_mm <= q[:, 5] - skin.standoff + 1e-6).all()
    alpha = np.degrees(np.arctan((q[:, 0] - q[:, 1]) / SPAN))
    assert np.abs(alpha).max() <= 26.0


def test_while_the_part_moves_the_tool_stays_clear_of_the_skin(skin):
    """From rivet to rivet all joints but q6 run together, with the tool withdrawn; forward
    kinematics put the tool's tip into the part's frame."""
    q = joints(inspected("skin_portal.drill"))
    motion = planned("skin_portal.drill").programs[0].motion
    assert motion is not None
    for share in np.linspace(0.0, 1.0, 9):
        q1, q2, q3, q4, q5, _ = (q[:-1] + share * (q[1:] - q[:-1])).T
        tool = np.stack([q4 - INSET, q5, motion.withdraw_mm[1:] - q1], axis=1)
        alpha = np.arctan((q1 - q2) / SPAN)
        base_from_part = Rotation.from_euler("YX", np.stack([alpha, np.radians(q3)], axis=1))
        assert beyond(base_from_part.inv().apply(tool), *SKIN).max() < -100.0


def test_least_travel_is_least(skin, least_s):
    """No heights travel less (a linear program), widest_margin's travel more."""
    found = joints(inspected("skin_portal.drill"))
    height = (found[:, 0] + found[:, 1]) / 2
    assert ((height >= skin.low - 1e-6) & (height <= skin.high + 1e-6)).all()
    travel = skin.travel_s(height)
    assert travel == pytest.approx(least_s, rel=1e-6)
    # The spec's comment: in all, of it the tilting (q1 and q2 apart), and with the widest margins.
    assert round(travel) == 525
    assert round(2 * np.abs(np.diff(skin.delta)).sum() / SPEED[0]) == 477
    assert round(skin.travel_s((skin.low + skin.high) / 2)) == 733


@pytest.fixture(scope="module")
def least_s(skin) -> float:
    """What no heights can beat: Σ t / speed over heights h and, for each step and joint, a bound
    t ≥ |step|."""
    n = len(skin.ids)
    step = sparse.diags([-np.ones(n - 1), np.ones(n - 1)], [0, 1], shape=(n - 1, n))
    blocks, bounds = [], []
    for joint, offset in enumerate((skin.delta, -skin.delta, skin.lift)):
        t = sparse.kron(np.eye(3)[[joint]], sparse.identity(n - 1))
        for sign in (1, -1):
            blocks.append(sparse.hstack([sign * step, -t]))
            bounds.append(-sign * np.diff(offset))
    found = linprog(
        np.concatenate([np.zeros(n), *(np.full(n - 1, 1 / v) for v in SPEED)]),
        A_ub=sparse.vstack(blocks, format="csr"),
        b_ub=np.concatenate(bounds),
        bounds=[*zip(skin.low, skin.high, strict=True), *[(0, None)] * (3 * (n - 1))],
        method="highs",
    )
    assert found.success
    return float(found.fun)


def test_widest_margin_serves_the_skin_too(skin, least_s, tmp_path):
    path = variant(tmp_path, "skin_portal.drill", "height least_travel", "height widest_margin")
    text = path.read_text(encoding="utf-8")
    path.write_text("\n".join(x for x in text.splitlines() if " joints (" not in x), "utf-8")
    got = plan_spec(path, None, Report()).solution
    assert got is not None
    q = got.motion.joints
    assert np.abs((q[:, 0] + q[:, 1]) - (skin.low + skin.high)).max() < 1e-5
    assert skin.travel_s((q[:, 0] + q[:, 1]) / 2) > 1.3 * least_s


def test_no_single_height_serves_the_skin(skin, tmp_path):
    """As the spec's comment says."""
    assert ((skin.low > 2500.0) | (skin.high < 2500.0)).sum() == 267
    ends = [skin.ids.index(name) for name in ("F01001", "F01141", "F15001", "F15141")]
    assert (skin.high[ends[:2]] / 1000).round(3).tolist() == [2.077, 2.077]
    assert (skin.low[ends[2:]] / 1000).round(3).tolist() == [2.105, 2.105]
    path = variant(tmp_path, "skin_portal.drill", "height least_travel", "height centre")
    report = refusal(path)
    assert {d.code for d in report.diagnostics} == {"E406"}
    assert report.diagnostics[-1].message == "and 257 more like this"
