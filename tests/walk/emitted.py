"""A spec compiled to KRL, its text read back and walked before the fixtures that the spec names."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from drillc.cli import main
from readers import krl
from scipy.spatial import KDTree
from walk.arm import KR210, Arm
from walk.scene import Scene, block, placement, solids, without_comments
from walk.walking import (
    LEAP_DEG,
    ROUNDING_DEG,
    ROUNDING_MM,
    STEP_MM,
    Walk,
    flange_poses,
    outside,
    straight,
    walk,
)

Array = np.ndarray


@dataclass(frozen=True)
class Spec:
    """The text of a spec and of the cell file that it uses, read by this folder's own means."""

    path: Path

    @cached_property
    def text(self) -> str:
        """Spec and cell file as one; paths of meshes are made absolute."""
        text = without_comments(self.path.read_text("utf-8"))
        for used in re.findall(r'^use "([^"]+)"', text, re.MULTILINE):
            cell = self.path.parent / used
            text += self._absolute(without_comments(cell.read_text("utf-8")), cell.parent)
        return self._absolute(text, self.path.parent)

    @staticmethod
    def _absolute(text: str, folder: Path) -> str:
        return re.sub(r'mesh "([^/"][^"]*)"', lambda m: f'mesh "{folder / m[1]}"', text)

    def scene(self, station: str | None = None) -> Scene:
        """The arm at a station, its tool and all fixtures."""
        head = r"base\s+at" if station is None else rf"station\s+{station}\s+(?:frame \d+\s+)?at"
        where = re.search(head, self.text)
        assert where is not None
        fixtures = {
            name: solids(block(self.text, rf"fixture\s+{name}"), self.path.parent)
            for name in re.findall(r"\bfixture\s+(\w+)", self.text)
        }
        tool = block(block(self.text, r"tool\s+\w+"), "body")
        part_from_root = placement(self.text[where.end() :])
        return Scene(self.arm, part_from_root, fixtures, solids(tool, self.path.parent))

    @property
    def arm(self) -> Arm:
        """The model that all of these specs name, within their limits."""
        assert re.findall(r"\bmodel (\w+)", self.text) == ["kuka_kr210_r3100_2"]
        limits = list(KR210.limits_deg)
        for stated in re.findall(r"\blimits\s*\{[^}]*\}", self.text):
            for joint, low, high in re.findall(r"A(\d) (\S+) deg \.\. (\S+) deg", stated):
                limits[int(joint) - 1] = (float(low), float(high))
        return replace(KR210, limits_deg=tuple(limits))

    @cached_property
    def flange_from_tool(self) -> Array:
        where = re.search(r"\btcp\b", self.text)
        assert where is not None
        return placement(self.text[where.end() :])

    @cached_property
    def home(self) -> Array:
        angles = re.findall(r"A(\d)\s+(\S+)\s+deg", block(self.text, "home"))
        assert [int(i) for i, _ in angles] == [1, 2, 3, 4, 5, 6]
        return np.array([float(angle) for _, angle in angles])


@dataclass(frozen=True)
class Hole:
    """A hole as the program states it: pose (4, 4) in part coordinates, S and T, and how deep."""

    pose: Array
    status_and_turn: tuple[int, int]
    depth_mm: float


@dataclass(frozen=True)
class Emitted:
    """One station's program, run by the reader. `holes` in the order in which they are made."""

    run: krl.Run
    holes: tuple[Hole, ...]
    root_from_part: Array
    flange_from_tool: Array


def compiled(spec: Path, folder: Path) -> dict[str, bytes]:
    """The KRL files of a spec, by name."""
    assert main(["compile", str(spec), "-o", str(folder), "--post", "krl"]) == 0
    return {path.name: path.read_bytes() for path in sorted((folder / "krl").iterdir())}


def read(
    files: dict[str, bytes], name: str, change: Callable[[str], str] = lambda text: text
) -> Emitted:
    """Run the program `name` among the files; `change` may falsify their text first."""
    own = {k: change(v.decode("ascii")).encode("ascii") for k, v in files.items() if name in k}
    run = krl.run(krl.load(own), name)
    (tool,), (base,) = run.tool_data.values(), run.base_data.values()
    holes = []
    for _, arguments in run.calls:
        if arguments and isinstance(arguments[0], dict) and "X" in arguments[0]:
            at = arguments[0]
            holes.append(Hole(krl.matrix(at), (int(at["S"]), int(at["T"])), arguments[1]))
    return Emitted(run, tuple(holes), krl.matrix(base), krl.matrix(tool))


# ── what must hold ───────────────────────────────────────────────────────────────────────────────


def check_frames(spec: Spec, scene: Scene, emitted: Emitted) -> None:
    """Tool and base are what the spec says: the base is the part as the arm's root sees it."""
    assert np.abs(emitted.flange_from_tool - spec.flange_from_tool).max() < ROUNDING_MM
    assert np.abs(emitted.root_from_part @ scene.part_from_root - np.eye(4)).max() < ROUNDING_MM


def check_walk(scene: Scene, emitted: Emitted, home: Array) -> Walk:
    """Walk the whole program from home, and see that nothing happens on the way."""
    base, tool = emitted.root_from_part, emitted.flange_from_tool
    went = walk(scene.arm, emitted.run.events, base, tool, home)
    joints = np.concatenate(went.joints)
    over = outside(scene.arm, joints)
    assert over <= ROUNDING_DEG, f"{over:.3f} deg beyond the limits"
    assert not scene.root_meets()
    check_steps(scene.arm, joints, tool)
    met = scene.meetings(joints)
    assert not met, f"{len(met)} of {len(joints)} steps, at first {met[0]}"
    check_status(scene.arm, emitted, joints)
    return went


def check_steps(arm: Arm, joints: Array, flange_from_tool: Array) -> None:
    """No jump anywhere, from the first step to the last; and the steps are as small as promised."""
    point = (flange_poses(arm, joints) @ flange_from_tool)[:, :3, 3]
    step = float(np.linalg.norm(np.diff(point, axis=0), axis=1).max())
    assert step <= STEP_MM + ROUNDING_MM, f"a step of {step:.3f} mm"
    turn = float(np.abs(np.diff(joints, axis=0)).max())
    assert turn <= LEAP_DEG, f"a joint jumps by {turn:.2f} deg"


def check_status(arm: Arm, emitted: Emitted, joints: Array) -> None:
    """S and T of every hole's position are those of the joints with which the arm gets there."""
    point = (flange_poses(arm, joints) @ emitted.flange_from_tool)[:, :3, 3]
    where = np.array([(emitted.root_from_part @ hole.pose)[:3, 3] for hole in emitted.holes])
    far, row = KDTree(point).query(where)
    assert far.max() <= STEP_MM
    for hole, near in zip(emitted.holes, row.tolist(), strict=True):
        flange = emitted.root_from_part @ hole.pose @ np.linalg.inv(emitted.flange_from_tool)
        there = straight(arm, joints[near], flange, emitted.flange_from_tool)[-1]
        turned = flange_poses(arm, joints[near][None])[0, :3, :3].T @ flange[:3, :3]
        assert np.degrees(np.arccos(np.clip((np.trace(turned) - 1) / 2, -1, 1))) < 0.1
        meant = arm.status_and_turn(there)
        assert meant == hole.status_and_turn, f"S and T are {hole.status_and_turn}, not {meant}"
