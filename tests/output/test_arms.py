"""Programs for arms, in KRL and in RAPID: read back, run, and compared with arms of the tests' own.

Joints are chosen here; where they take the tool, and which bits say so, is computed by
`readers.arms`, which shares no code with drillc.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from drillc.language.diagnostics import Report
from drillc.language.job import Emit
from drillc.output.emission import PostError, emit_files, emit_programs
from drillc.output.post import PostProcessor
from drillc.planning.program import Program
from drillc.postprocessors.krl import KrlPost, told_by_status
from drillc.postprocessors.rapid import RapidPost
from judges import rapidchecker
from output import test_krl, test_rapid
from output.arm_programs import (
    DIMENSIONS,
    HOME_DEG,
    STANDING,
    TOOL,
    Way,
    arm_program,
    shifted,
    some_joints,
)
from output.programs import (
    drill_cycle,
    emit_of,
    named,
    rivet_cycle,
    visit_cycle,
    with_ids,
)
from readers import arms, krl, rapid
from readers.events import Event, Move, ReadError, Stop, World, compare, expected

#: Reading back, as in the posts' own tests; joints have five digits.
MM, DEG, JOINT_DEG = 0.0009, {"krl": 1e-3, "rapid": 5e-6}, 6e-6
MAKERS = {"krl": "kuka", "rapid": "abb"}
VIA_ARRAYS = ("VIA_PTP", "VIA_AXIS", "VIA_LIN")
POSTS: dict[str, PostProcessor] = {"krl": KrlPost(), "rapid": RapidPost()}
#: The tool has no load here, and this is about arms.
SETTINGS: dict[str, dict[str, str]] = {"krl": {}, "rapid": {"tooldata": "tCell"}}


def emitted(post: str, program: Program, **settings: float) -> dict[str, bytes]:
    report = Report()
    emit = emit_of(post, **SETTINGS[post], **settings)
    made = emit_files(POSTS[post], program, emit, report)
    assert not report.diagnostics, [d.message for d in report.diagnostics]
    return {file.path: file.read() for file in made if not file.path.endswith(".csv")}


def errors(post: PostProcessor, program: Program, emit: Emit | None = None) -> dict[str, str]:
    report = Report()
    assert not emit_files(post, program, emit or emit_of(post.name), report)
    return {d.code: f"{d.message} | {d.hint}" for d in report.diagnostics}


def events(
    post: str, program: Program, text: Mapping[str, bytes], dead: Mapping[str, int] | None = None
) -> list[Event]:
    """What the text does, signals by role, axes called A1 … A6."""
    if post == "krl":
        world = World(test_krl.numbered(program, dead or {}))
        ran = krl.run(krl.load(text), program.name, world)
        return test_krl.by_role(program, ran.events)
    world = World(test_rapid.named_by(program, dead), dict.fromkeys(rapid.ROBOT, 0.0))
    names = list(test_rapid.signals(program))
    found = rapid.run(rapid.load(text), world, names, ("tool0", "wobj0", "tCell"))
    for i, event in enumerate(found.events):
        if isinstance(event, Move) and event.joints is not None:
            axes = {f"A{axis[-1]}": to for axis, to in event.joints.items()}
            found.events[i] = replace(event, joints=axes)
    return test_rapid.by_role(program, found.events)


def judge(
    post: str,
    program: Program,
    text: Mapping[str, bytes],
    dead: Mapping[str, int] | None = None,
) -> None:
    """The text makes every via and every hole: by the axes to the same joints, or with S and T of
    these joints to the same pose."""
    found = events(post, program, text, dead)
    wanted = expected(program, home=False, dead=dead)
    assert program.arm is not None
    if program.arm.arm.home_rad is None and post == "krl":
        wanted = [Move(False), *wanted, *([] if isinstance(wanted[-1], Stop) else [Move(False)])]
    dimensions = DIMENSIONS[program.arm.arm.model.maker]
    for i, (one, two) in enumerate(zip(found, wanted, strict=False)):
        if not (isinstance(one, Move) and isinstance(two, Move) and two.joints is not None):
            continue
        if one.joints is None:
            status = arms.status_and_turn(dimensions, list(two.joints.values()))
            assert one.configuration == status, f"event {i}: {one}, wanted S, T {status}"
            wanted[i] = replace(two, joints=None)
        else:
            wanted[i] = replace(two, pose=None)
    compare(found, wanted, mm=MM, deg=DEG[post], joint_mm=JOINT_DEG)


# ── the corpus ───────────────────────────────────────────────────────────────────────────────────


def _detours(maker: str) -> dict[int, list[Way]]:
    """Vias of both kinds, before holes within sections and before the first of one."""
    joints = some_joints(8, maker)
    back = [Way(False, tuple(shifted(maker, row, -150.0))) for row in joints]
    flip, wind = np.array(
        [[0.0, 0.0, 0.0, -180.0, -100.0, 180.0], [0.0, 0.0, 0.0, 0.0, 0.0, -360.0]]
    )
    turned, wound = Way(True, tuple(joints[4] + flip)), Way(True, tuple(joints[1] + wind))
    return {
        1: [back[0], back[1]],
        2: [wound],
        3: [back[3], turned],
        5: [turned, back[2], wound],
        7: [back[6]],
    }


PROGRAMS: dict[str, Callable[[str], Program]] = {
    "one_hole": lambda m: arm_program([("a", 0, 1)], [drill_cycle()], maker=m),
    "peck": lambda m: arm_program([("a", 0, 5)], [drill_cycle(peck_mm=3.0)], maker=m),
    "visit": lambda m: arm_program([("a", 0, 3)], [visit_cycle()], maker=m),
    "from_home_unasked": lambda m: arm_program(
        [("a", 0, 2), ("b", 0, 1)], [visit_cycle()], maker=m, home_first=False
    ),
    "no_home": lambda m: arm_program([("a", 0, 3)], [drill_cycle()], maker=m, home_deg=None),
    "detours": lambda m: arm_program(
        [("upper", 0, 3), ("lower", 1, 3), ("rim", 0, 1)],
        [drill_cycle(peck_mm=3.0), rivet_cycle()],
        maker=m,
        ways=_detours(m),
    ),
    "detours_without_home": lambda m: arm_program(
        [("upper", 0, 3), ("lower", 1, 4)],
        [drill_cycle(clamp=True), rivet_cycle()],
        maker=m,
        ways=_detours(m),
        home_deg=None,
    ),
    "home_in_between": lambda m: arm_program(
        [("a", 0, 4), ("b", 0, 2)],
        [drill_cycle()],
        maker=m,
        ways={
            2: [Way(True, HOME_DEG), Way(True, tuple(shifted(m, some_joints(3, m)[2], -60.0)))],
            4: [Way(True, HOME_DEG)],
        },
    ),
}


@pytest.mark.parametrize("maker", ["its own", "other"])
@pytest.mark.parametrize("size", [1000, 3, 2, 1])
@pytest.mark.parametrize("name", PROGRAMS)
@pytest.mark.parametrize("post", POSTS)
def test_the_text_does_what_the_program_says(post: str, name: str, size: int, maker: str) -> None:
    program = PROGRAMS[name](MAKERS[post] if maker == "its own" else "other")
    judge(post, program, emitted(post, program, holes_per_module=float(size)))


@pytest.mark.parametrize("post", POSTS)
def test_an_answer_that_fails_to_come_ends_the_program(post: str) -> None:
    program = PROGRAMS["detours"](MAKERS[post])
    for dead in ({"spindle_running": 1}, {"clamped": 1}, {"set_done": 2}):
        judge(post, program, emitted(post, program), dead)


@pytest.mark.parametrize("post", POSTS)
def test_thousands_of_vias(post: str) -> None:
    """A via before each hole: the text is the same as for few, only longer."""
    maker, n = MAKERS[post], 600
    joints = some_joints(n, maker)
    ways = {i: [Way(i % 3 == 0, tuple(row))] for i, row in enumerate(joints)}
    program = arm_program([("a", 0, n)], [visit_cycle()], maker=maker, ways=ways)
    judge(post, program, emitted(post, program, holes_per_module=250.0))


# ── status and turn, configuration data ──────────────────────────────────────────────────────────


def every_posture(maker: str) -> list[list[float]]:
    """All eight branches, with axes 1, 4 and 6 in every quadrant, windings among them."""
    shoulders = [(-70.0, 95.0), (-40.0, -80.0), (-165.0, 60.0), (-150.0, -60.0)]
    if maker == "abb":
        shoulders = [(a2 + 90.0, a3 - 90.0) for a2, a3 in shoulders]
    turns = [
        (a1, a4, a6)
        for a1 in (-130, -20, 60, 100)
        for a4, a6 in zip(
            (-300, -200, -100, -10, 10, 100, 200, 300),
            (200, -10, 300, 100, -300, 10, -200, -100),
            strict=True,
        )
    ]
    return [
        [float(a1), a2, a3, float(a4), a5, float(a6)]
        for (a2, a3), a5, (a1, a4, a6) in product(shoulders, (-55.0, 55.0), turns)
    ]


def branches(maker: str, postures: Sequence[Sequence[float]]) -> set[int]:
    if maker == "kuka":
        return {arms.status_and_turn(arms.KR210, row)[0] for row in postures}
    return {arms.confdata(arms.IRB6640, row)[3] for row in postures}


def joints_of_text(maker: str, pose: np.ndarray, near_deg: Sequence[float]) -> list[float]:
    """The joints of a pose that a text states, found from joints that are off by a degree."""
    target = np.linalg.inv(STANDING) @ pose @ np.linalg.inv(TOOL)
    return arms.joints_near(DIMENSIONS[maker], target, np.array(near_deg) + 1.0)


def test_every_status_and_turn_of_the_text() -> None:
    """S and T of each E6POS are those of the joints that bring the tool there."""
    postures = every_posture("kuka")
    assert branches("kuka", postures) == set(range(8))
    program = arm_program([("a", 0, len(postures))], [visit_cycle()], joints_deg=postures)
    data = krl.load(emitted("krl", program)).data[program.name]
    turns = set()
    for i, posture in enumerate(postures):
        said = data[f"P{i + 1}"]
        joints = joints_of_text("kuka", krl.matrix(said), posture)
        assert np.abs(np.array(joints) - posture).max() < 0.01
        assert (said["S"], said["T"]) == arms.status_and_turn(arms.KR210, joints)
        turns.add(said["T"])
    assert len(turns) >= 16


def test_all_configuration_data_of_the_text() -> None:
    """cf1, cf4, cf6 and cfx of each robtarget are those of the joints that bring the tool there."""
    postures = every_posture("abb")
    assert branches("abb", postures) == set(range(8))
    program = arm_program(
        [("a", 0, len(postures))], [visit_cycle()], joints_deg=postures, maker="abb"
    )
    data = rapid.load(emitted("rapid", program)).modules["panel_7l"].data
    found = set()
    for i, posture in enumerate(postures):
        said = data[f"p{i + 1}"]
        joints = joints_of_text("abb", said["matrix"], posture)
        assert np.abs(np.array(joints) - posture).max() < 0.01
        assert said["conf"] == arms.confdata(arms.IRB6640, joints)
        found.add(said["conf"][1])
    assert found == {-4, -3, -2, -1, 0, 1, 2, 3}


@pytest.mark.parametrize("post", POSTS)
def test_the_branch_is_kept_from_via_to_hole(post: str) -> None:
    """A controller's own view: from the axes of the via along every line of the text, in small
    steps, the joints arrive at those that were planned, and so at the data of each hole."""
    maker = MAKERS[post]
    first = np.array(some_joints(1, maker)[0])
    rows = [(first + 0.8 * i * np.array([1, -0.5, 0.7, 1, -1, 2])).tolist() for i in range(8)]
    program = arm_program([("a", 0, 8)], [visit_cycle()], maker=maker, joints_deg=rows)
    here: list[float] | None = None
    pose = np.eye(4)
    arrived = []
    for event in events(post, program, emitted(post, program)):
        assert isinstance(event, Move)
        if event.joints is not None:
            here = list(event.joints.values())
            pose = np.linalg.inv(STANDING) @ arms.root_from_flange(DIMENSIONS[maker], here) @ TOOL
            pose = STANDING @ STANDING @ pose
        elif event.pose is not None:
            assert here is not None
            if not event.straight:  # a PTP with S and T: the planned standoff
                assert program.arm is not None
                here = np.degrees(program.arm.standoff_joints[0]).tolist()
            for share in np.linspace(0.0, 1.0, 1 if not event.straight else 8)[1:]:
                between = event.pose.copy()
                between[:3, 3] = (1 - share) * pose[:3, 3] + share * event.pose[:3, 3]
                turn = arms.Rotation.from_matrix(event.pose[:3, :3] @ pose[:3, :3].T).as_rotvec()
                between[:3, :3] = arms.Rotation.from_rotvec(share * turn).as_matrix() @ pose[:3, :3]
                target = np.linalg.inv(STANDING) @ between @ np.linalg.inv(TOOL)
                here = arms.joints_near(DIMENSIONS[maker], target, here)
            pose = event.pose
            arrived.append(here)
    for row in rows:
        assert min(np.abs(np.array(at) - row).max() for at in arrived) < 1e-3


# ── which moves say S and T ──────────────────────────────────────────────────────────────────────


def test_axes_where_status_and_turn_would_mislead() -> None:
    """Near 0 rounding could send an axis once around; beyond half a turn T leaves it to the
    controller; near a change of S the arm could fold over."""
    plain = [25.0, -70.0, 95.0, 35.0, 50.0, 20.0]
    wrist_over_axis_1 = [25.0, -143.0, 60.0, 35.0, 50.0, 20.0]
    stretched = [25.0, -70.0, np.degrees(np.arctan2(115.0, 1420.0)), 35.0, 50.0, 20.0]
    at = arms.points(arms.KR210, wrist_over_axis_1)
    assert abs(at["wrist"] @ at["forward"]) > 10.0  # so this one is still told
    cases = {
        True: [plain, wrist_over_axis_1, [-25.0, -70.0, 95.0, -35.0, -50.0, -20.0]],
        False: [
            stretched,
            *(
                [*plain[:axis], value, *plain[axis + 1 :]]
                for axis in (0, 3, 4, 5)
                for value in (0.0, -0.01, 0.05)
            ),
            *(
                [*plain[:axis], value, *plain[axis + 1 :]]
                for axis in (3, 5)
                for value in (180.0, -180.0, 179.95, 200.0, -340.0)
            ),
        ],
    }
    program = arm_program([("a", 0, 1)], [visit_cycle()])
    assert program.arm is not None
    for told, rows in cases.items():
        found = told_by_status(program.arm, np.radians(np.array(rows, dtype=float)))
        assert found.tolist() == [told] * len(rows)


def test_the_first_move_of_each_section_says_how_the_arm_stands() -> None:
    program = PROGRAMS["detours"]("kuka")
    text = emitted("krl", program)["krl/PANEL_7L.src"].decode()
    assert text.count("  PTP VIA_HOME\r\n") == 2
    for fold in re.findall(r";FOLD region \w+,.*?;ENDFOLD", text, re.DOTALL):
        moves = re.findall(r"^  (\w+)[ (].*\r$", fold, re.MULTILINE)
        first = next(i for i, word in enumerate(moves) if word in ("drill6", "rivet"))
        assert moves[first - 1] == "PTP"
    assert "H_POS" not in text


def test_an_arm_without_a_home_starts_at_the_controllers_own() -> None:
    program = PROGRAMS["no_home"]("kuka")
    text = emitted("krl", program)["krl/PANEL_7L.src"].decode()
    assert text.count("  PTP $H_POS\r\n") == 2
    assert "VIA_HOME" not in text
    assert b"via_home" not in emitted("rapid", PROGRAMS["no_home"]("abb"))["rapid/PANEL_7L.mod"]


@pytest.mark.parametrize("post", POSTS)
def test_an_arm_of_ones_own_has_no_configuration(post: str) -> None:
    text = b"".join(emitted(post, PROGRAMS["detours"]("other")).values()).decode()
    assert "VIA_PTP" not in text
    assert not re.search(r",[ST] \d", text)
    assert set(re.findall(r"\],(\[-?\d,-?\d,-?\d,\d\]),\[9E", text)) <= {"[0,0,0,0]"}


def test_the_parts_of_a_program_follow_on_one_another() -> None:
    program = PROGRAMS["detours"]("kuka")
    made = emitted("krl", program, holes_per_module=3.0)
    assert b"GLOBAL" not in made["krl/PANEL_7L.dat"]
    sources = [made[f"krl/PANEL_7L_{i}.src"].decode() for i in (1, 2, 3)]
    assert [text.count("PTP VIA_HOME") for text in sources] == [1, 0, 1]
    assert ["do not select this part by itself" in text for text in sources] == [False, True, True]
    for i in (1, 2, 3):
        data = krl.load(made).data[f"PANEL_7L_{i}"]
        arrays = {name: len(data[name]) for name in data if name in VIA_ARRAYS}
        assert arrays
        source = made[f"krl/PANEL_7L_{i}.src"].decode()
        for name, size in arrays.items():
            assert re.findall(rf"{name}\[(\d+)\]", source) == [str(k + 1) for k in range(size)]


# ── several stations ─────────────────────────────────────────────────────────────────────────────


def at_station(program: Program, name: str) -> Program:
    """The same, called as the program of one of several stations is."""
    arm = program.arm
    assert arm is not None
    place = replace(arm.station, name=named(name, 12))
    return replace(program, name=f"{program.name}_{name}", arm=replace(arm, station=place))


def both(post: str, names: Sequence[str], report: Report, **settings: float) -> dict[str, bytes]:
    program = PROGRAMS["peck"](MAKERS[post])
    programs = [at_station(program, name) for name in names]
    emit = emit_of(post, **SETTINGS[post], **settings)
    return {f.path: f.read() for f in emit_programs(POSTS[post], programs, emit, report)}


@pytest.mark.parametrize("size", [1000, 2])
@pytest.mark.parametrize("post", POSTS)
def test_each_station_has_a_program_of_its_own(post: str, size: int) -> None:
    """All of them fit on one controller: no routine of one is called like one of another."""
    report = Report()
    made = both(post, ["left", "right"], report, holes_per_module=float(size))
    assert not report.diagnostics
    if post == "krl":
        routines = krl.load(made).routines
        assert ("DRILL6_LEFT" in routines) == (size == 2)
    for name in ("PANEL_7L_left", "PANEL_7L_right"):
        own = {path: raw for path, raw in made.items() if name in path}
        program = at_station(PROGRAMS["peck"](MAKERS[post]), name.split("_")[-1])
        judge(post, program, own)
    if size == 2:
        table = made[f"{post}/names.csv"].decode().splitlines()
        assert table == [
            "kind,spec,emitted",
            "process,drill6,drill6_left",
            "process,drill6,drill6_right",
        ]


def test_stations_whose_files_would_be_one_are_refused() -> None:
    report = Report()
    assert both("krl", ["left", "left_1"], report, holes_per_module=2.0) == {}
    assert [d.code for d in report.diagnostics] == ["E663"]
    assert both("krl", ["left", "LEFT"], report) == {}


def test_what_is_wrong_with_every_station_is_said_once() -> None:
    report = Report()
    programs = [at_station(PROGRAMS["one_hole"]("abb"), name) for name in ("left", "right")]
    assert emit_programs(POSTS["krl"], programs, emit_of("krl"), report) == []
    assert [d.code for d in report.diagnostics] == ["E660"]


# ── refusals ─────────────────────────────────────────────────────────────────────────────────────


def test_an_arm_of_another_maker_is_refused() -> None:
    for post, maker in (("krl", "abb"), ("rapid", "kuka")):
        report = Report()
        program = PROGRAMS["one_hole"](maker)
        assert not emit_files(POSTS[post], program, emit_of(post), report)
        [diagnostic] = report.diagnostics
        assert diagnostic.code == "E660"
        assert f"is of {maker}" in diagnostic.message
        assert diagnostic.span == emit_of(post).post.span
        assert program.arm is not None
        assert [label.span for label in diagnostic.labels] == [program.arm.arm.name.span]


def test_the_part_is_where_the_station_says() -> None:
    """The controller's world is the arm's root."""
    krl_text, rapid_text = (emitted(post, PROGRAMS["one_hole"](MAKERS[post])) for post in POSTS)
    [base] = krl.run(krl.load(krl_text), "PANEL_7L").base_data.values()
    work = rapid.load(rapid_text).modules["panel_7l"].data["part_frame"]["matrix"]
    for world_from_part in (krl.matrix(base), work):
        assert np.abs(world_from_part @ STANDING - np.eye(4)).max() < 1e-3


def test_a_post_that_makes_no_vias_is_given_no_arm() -> None:
    class Plain(KrlPost):
        accepts = replace(KrlPost.accepts, arms=())

    assert list(errors(Plain(), PROGRAMS["one_hole"]("kuka"))) == ["E661"]


def test_the_names_of_vias_are_taken() -> None:
    program = PROGRAMS["detours"]("kuka")
    ids = program.holes.ids.tolist()
    for name in ("VIA_HOME", "via_ptp", "VIA_AXIS", "Via_Lin"):
        assert "E642" in errors(KrlPost(), with_ids(program, [name, *ids[1:]]))
    program = PROGRAMS["detours"]("abb")
    emit = emit_of("rapid", **SETTINGS["rapid"])
    for name in ("VIA_HOME", "via_axes_1", "Via_line_2"):
        assert "E647" in errors(RapidPost(), with_ids(program, [name, *ids[1:]]), emit)
    assert emitted("rapid", with_ids(program, ["via_axes_99", *ids[1:]]))


def test_vias_that_no_text_could_make_are_a_bug_of_the_planner() -> None:
    program = PROGRAMS["detours"]("kuka")
    arm = program.arm
    assert arm is not None
    vias = arm.vias
    for wrong, said in (
        (replace(vias, before=vias.before[::-1].copy()), "not in the order"),
        (replace(vias, before=vias.before + 1), "not in the order"),
        (replace(vias, by_joints=np.zeros_like(vias.by_joints)), "not begun by"),
    ):
        broken = replace(program, arm=replace(arm, vias=wrong))
        with pytest.raises((PostError, ValueError), match=said):
            emit_files(KrlPost(), broken, emit_of("krl"), Report())
    with pytest.raises(ValueError, match="where the part lies"):
        emit_files(KrlPost(), replace(program, frame=None), emit_of("krl"), Report())


# ── the reader can fail, and so can the judge ────────────────────────────────────────────────────


@pytest.mark.parametrize(
    ("post", "old", "new"),
    [
        ("krl", "  PTP VIA_HOME\r\n", ""),
        ("krl", "PTP VIA_PTP[1]", "PTP VIA_PTP[2]"),
        ("krl", "PTP VIA_PTP[1] ;", "LIN VIA_PTP[1] ;"),
        ("krl", "LIN VIA_LIN[1]", "PTP VIA_LIN[1]"),
        ("krl", "LIN VIA_LIN[2]", "LIN VIA_LIN[3]"),
        ("krl", "  $VEL.CP=0.250\r\n  LIN VIA_LIN[1]", "  LIN VIA_LIN[1]"),
        ("krl", "  PTP VIA_AXIS[1] ; to P3\r\n", ""),
        ("krl", "S 2,T 34} ; to P1", "S 6,T 34} ; to P1"),
        ("krl", "S 2,T 34} ; to P1", "S 2,T 35} ; to P1"),
        ("krl", "VIA_HOME={A1 0.00000,A2 -90.00000", "VIA_HOME={A1 0.00000,A2 90.00000"),
        ("krl", "DECL FRAME VIA_LIN[5]", "DECL FRAME VIA_LIN[4]"),
        ("krl", "DECL FRAME VIA_LIN", "DECL E6AXIS VIA_LIN"),
        ("krl", "VIA_LIN[2]=", "VIA_LIN[1]="),
        ("rapid", "    MoveAbsJ via_home\\NoEOffs,v100\\V:=250.000,fine,tCell;\r\n", ""),
        ("rapid", "MoveAbsJ via_axes_1\\", "MoveAbsJ via_axes_2\\"),
        ("rapid", "MoveL via_line_1,", "MoveL via_line_3,"),
        ("rapid", "MoveL via_line_1,v100\\V:=250.000", "MoveL via_line_1,v100\\V:=2500.000"),
        ("rapid", "via_home:=[[0.00000,-90.00000", "via_home:=[[0.00000,90.00000"),
        ("rapid", "ConfL\\Off", "ConfL\\On"),
        ("rapid", "via_axes_2:=[[", "via_axes_2:=[[1"),
    ],
)
def test_a_changed_text_is_noticed(post: str, old: str, new: str) -> None:
    program = PROGRAMS["detours"](MAKERS[post])
    made = {path: raw.decode() for path, raw in emitted(post, program).items()}
    changed = {path: text.replace(old, new).encode() for path, text in made.items()}
    assert changed != {path: text.encode() for path, text in made.items()}
    with pytest.raises((ReadError, AssertionError, IndexError)):
        judge(post, program, changed)


def test_an_outside_judge_reads_programs_for_arms() -> None:
    rapidchecker.require()
    for name in ("detours", "no_home"):
        made = emitted("rapid", PROGRAMS[name]("abb"), holes_per_module=4.0)
        for path, raw in made.items():
            if path.endswith(".mod"):
                assert rapidchecker.complaints(raw) == []
