"""Hand-made programs for arms: joints are chosen, the places they come to are the tests' own.

`joints` of hole i are chosen; `readers.arms` says where that is, and which joints bring the tool to
the standoff. All that drillc's kernels could get wrong is so beside the point here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from drillc.catalogue.model import ArmModel
from drillc.kernels.arm import ArmGeometry
from drillc.language.job import (
    Arm,
    Floats,
    Limit,
    Pose,
    Station,
    WorkFrame,
)
from drillc.planning.program import ArmMotion, Cycle, Program, Vias
from output.programs import hole_table, named, pose_program, some_ids, span
from readers import arms

#: Where the arm stands: hung upside down, and turned a little.
STANDING = np.array(
    [
        [0.96, 0.28, 0.0, 1500.0],
        [0.28, -0.96, 0.0, 3000.0],
        [0.0, 0.0, -1.0, 1500.0],
        [0.0, 0.0, 0.0, 1.0],
    ]
)
HOME_DEG = (0.0, -90.0, 90.0, 0.0, 0.0, 0.0)
DIMENSIONS = {"kuka": arms.KR210, "abb": arms.IRB6640, "other": arms.KR210}
TITLES = {
    "kuka": "KUKA KR 210 R3100-2",
    "abb": "ABB IRB 6640-185/2.8",
    "other": "an arm of one's own",
}
#: The tool of `pose_program`, (4, 4).
TOOL = np.array([[0.0, 0, -1, -350], [0, 1, 0, 0], [1, 0, 0, 250], [0, 0, 0, 1]])


@dataclass(frozen=True)
class Way:
    """A via before a hole: by joints, or straight, to where the joints (deg) take the tool."""

    by_joints: bool
    joints_deg: tuple[float, ...]


def some_joints(n: int, maker: str = "kuka") -> list[list[float]]:
    """Joints of n holes, in degrees: no axis near 0, every quadrant of axes 4 and 6 in turn."""
    zero = np.array([25.0, -70.0, 95.0, 35.0, 50.0, 20.0])
    if maker == "abb":
        zero = np.array([25.0, 20.0, 5.0, 35.0, 50.0, 20.0])
    rows = []
    for i in range(n):
        step = i % 40
        turn = np.array([0.3 * step, 0.2 * step, -0.25 * step, 1.5 * step, 0.4 * step, 0.9 * step])
        rows.append((zero + turn + 90.0 * np.array([0, 0, 0, i % 2, 0, (i % 3) - 1])).tolist())
    return rows


def tool_at(maker: str, joints_deg: Sequence[float]) -> Floats:
    """part_from_tool (4, 4) with the joints there."""
    pose: Floats = STANDING @ arms.root_from_flange(DIMENSIONS[maker], joints_deg) @ TOOL
    return pose


def shifted(maker: str, joints_deg: Sequence[float], depth_mm: float) -> list[float]:
    """The joints with the tool moved along its axis, in the same branch."""
    return list(_shifted(maker, tuple(joints_deg), depth_mm))


@cache
def _shifted(maker: str, joints_deg: tuple[float, ...], depth_mm: float) -> list[float]:
    shift = np.eye(4)
    shift[2, 3] = depth_mm
    target = np.linalg.inv(STANDING) @ tool_at(maker, joints_deg) @ shift @ np.linalg.inv(TOOL)
    return arms.joints_near(DIMENSIONS[maker], target, joints_deg)


def arm_of(maker: str, home_deg: Sequence[float] | None) -> Arm:
    size = DIMENSIONS[maker]
    signs = np.array([-1.0 if i + 1 in size.turned else 1.0 for i in range(6)])
    geometry = ArmGeometry(
        a1_mm=size.a1,
        a2_mm=size.a2,
        b_mm=0.0,
        c1_mm=size.c1,
        c2_mm=size.c2,
        c3_mm=size.c3,
        c4_mm=size.c4,
        offset_rad=np.radians(signs * np.array(size.straight)),
        sign=signs,
    )
    limit = np.full(6, np.radians(350.0))
    model = ArmModel(maker, TITLES[maker], maker, geometry, -limit, limit, np.ones(6), "a test")
    return Arm(
        name=named("arm1", 10),
        model=model,
        stations=(station(),),
        auto=None,
        limits=tuple(Limit(-limit[0], limit[0], span(11)) for _ in range(6)),
        speeds=np.ones(6),
        home_rad=None if home_deg is None else np.radians(home_deg),
        home_span=None,
        singular_rad=np.radians(2.0),
        links=(None,) * 7,
    )


def station() -> Station:
    return Station(None, Pose(STANDING[:3, :3], STANDING[:3, 3]), 2, span(12))


def arm_program(
    sections: Sequence[tuple[str, int, int]],
    cycles: Sequence[Cycle],
    *,
    maker: str = "kuka",
    name: str = "PANEL_7L",
    ids: Sequence[str] | None = None,
    joints_deg: Sequence[Sequence[float]] | None = None,
    home_deg: Sequence[float] | None = HOME_DEG,
    home_first: bool = True,
    ways: Mapping[int, Sequence[Way]] | None = None,
) -> Program:
    """Sections as `pose_program` takes them. Each begins with a move of the joints to its first
    standoff; `ways` are made before that, or before the cycle of a hole in a section; those of
    hole n, at the end. With a home, the last via leads there, and if it is `home_first`, the first
    one too."""
    plain = pose_program(sections, cycles, name=name)
    n = len(plain.holes)
    joints = joints_deg or some_joints(n, maker)
    poses = np.array([tool_at(maker, row) for row in joints]).reshape(-1, 4, 4)
    approach = {
        row: plain.cycles[section.cycle].process.approach_mm
        for section in plain.sections
        for row in range(section.start, section.stop)
    }
    standoffs = [shifted(maker, row, -approach[i]) for i, row in enumerate(joints)]
    starts = {section.start for section in plain.sections if section.stop > section.start}
    home = [] if home_deg is None else [Way(True, tuple(home_deg))]
    made: list[tuple[int, Way]] = []
    for hole in range(n + 1):
        made += [(hole, way) for way in home if hole == 0 and home_first]
        made += [(hole, way) for way in (ways or {}).get(hole, ())]
        made += [(hole, Way(True, tuple(standoffs[hole])))] if hole in starts else []
        made += [(hole, way) for way in home if hole == n]
    there = np.array([tool_at(maker, way.joints_deg) for _, way in made]).reshape(-1, 4, 4)
    vias = Vias(
        before=np.array([hole for hole, _ in made], dtype=np.int32),
        by_joints=np.array([way.by_joints for _, way in made], dtype=np.bool_),
        joints=np.radians(np.array([way.joints_deg for _, way in made]).reshape(-1, 6)),
        position_mm=there[:, :3, 3],
        part_from_tool=there[:, :3, :3],
    )
    world = np.linalg.inv(STANDING)
    return replace(
        plain,
        frame=WorkFrame(2, Pose(world[:3, :3], world[:3, 3]), span(6)),
        holes=hole_table(ids or some_ids(n), poses[:, :3, 3], poses[:, :3, 2].copy()),
        part_from_tool=poses[:, :3, :3],
        arm=ArmMotion(
            arm=arm_of(maker, home_deg),
            station=station(),
            joints=np.radians(np.array(joints).reshape(-1, 6)),
            standoff_joints=np.radians(np.array(standoffs).reshape(-1, 6)),
            vias=vias,
        ),
    )
