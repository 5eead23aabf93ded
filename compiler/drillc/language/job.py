"""A Job: what a spec says, with every name resolved and every number in mm, radians and seconds.

Rules, processes and regions are objects; holes are rows of the columns in `HoleTable`. Nothing here
knows a controller: an `Emit` is only a name with settings, for the output stage to understand.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from drillc.catalogue.model import ArmModel
from drillc.geometry.shapes import Mesh, RoundedHull
from drillc.language.source import Source, Span

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Texts = NDArray[np.str_]


@dataclass(frozen=True)
class Named:
    """A name and where it was written."""

    text: str
    span: Span


@dataclass(frozen=True, eq=False)
class Pose:
    """A rigid transform `to_from_of`: rotation (3, 3) and translation (3,) in mm."""

    rotation: Floats
    translation_mm: Floats


@dataclass(frozen=True, eq=False)
class WorkFrame:
    """The frame in which poses are programmed: its number on the controller and, when the spec
    states it, where the part stands (`world_from_part`); else the shop's own data is used."""

    number: int
    world_from_part: Pose | None
    span: Span


@dataclass(frozen=True, eq=False)
class Part:
    """`up` is a unit vector in part coordinates, or None when nothing asked for it."""

    name: Named
    up: Floats | None
    normals_into: bool
    unit_tolerance: float
    frame: WorkFrame | None
    surface: Surface | None = None
    normals_from_surface: bool = False


@dataclass(frozen=True, eq=False)
class Surface:
    """The part's surface, normals outward, in part coordinates. Holes must lie within `within_mm`
    of it, their normals within `within_rad` of its own."""

    mesh: Mesh
    within_mm: float
    within_rad: float
    span: Span


@dataclass(frozen=True, eq=False)
class Tool:
    """`flange_from_tool` places the TCP; mass and centre of gravity only if a post needs them.

    `body` is its solid in flange coordinates, as convex pieces; empty when the spec gives none.
    """

    name: Named
    number: int
    flange_from_tool: Pose
    mass_kg: float | None
    centre_of_gravity_mm: Floats | None
    body: tuple[RoundedHull, ...] = ()


@dataclass(frozen=True, eq=False)
class Solid:
    """One solid of a fixture, in part coordinates: a convex shape, or a mesh."""

    shape: RoundedHull | Mesh
    span: Span


@dataclass(frozen=True)
class Fixture:
    """A body that nothing may enter: one or more solids in part coordinates."""

    name: Named
    solids: tuple[Solid, ...]


# ── machine ──────────────────────────────────────────────────────────────────────────────────────

HeightRule = Literal["centre", "widest_margin", "least_travel", "fixed"]


@dataclass(frozen=True)
class Limit:
    """An inclusive range, in mm or radians; `span`: where it is written (None: from geometry)."""

    low: float
    high: float
    span: Span | None


PORTAL_JOINTS = ("q1", "q2", "q3", "q4", "q5", "q6")
#: The portal's one turning joint (q3 = β, the bar about its own axis).
ROTARY_JOINT = 2


@dataclass(frozen=True, eq=False)
class Portal:
    """The riveting portal of the second seed. Joints q1, q2, q4, q5, q6 in mm, q3 in radians.

    `limits` holds q1…q6 in order; `tilt_limit` bounds α in radians when the spec narrows it.
    `speeds` holds v₁…v₆ (mm/s or rad/s), or None where the spec gives none.
    """

    name: Named
    column_distance_mm: float
    column_height_mm: float
    hinge_inset_mm: float
    height: HeightRule
    height_mm: float | None
    height_span: Span
    side: Literal["above", "below"]
    limits: tuple[Limit, ...]
    tilt_limit: Limit | None
    speeds: tuple[float | None, ...]


@dataclass(frozen=True, eq=False)
class Station:
    """A parking place of the arm. `frame` is the number of the part's frame on the controller when
    the arm stands here; `name` is None for the only place of a spec (`base at …`)."""

    name: Named | None
    part_from_root: Pose
    frame: int | None
    span: Span


@dataclass(frozen=True, eq=False)
class AutoBase:
    """`base auto within …`: parking places to be found in a rectangle of the floor.

    The root's origin is sought in the box low_mm … high_mm (3,) of part coordinates, on a grid of
    `step_mm`, with the given orientation; at most `most` places.
    """

    low_mm: Floats
    high_mm: Floats
    rotation: Floats  # (3, 3) part_from_root
    step_mm: float
    most: int
    span: Span


@dataclass(frozen=True, eq=False)
class Arm:
    """A six-axis arm, where it stands, and what narrows its motion.

    Exactly one of `stations` (not empty) and `auto` is given. `limits` are the model's, narrowed by
    the spec. `home_rad` (6,) is where programs begin and end; None when the spec gives none.
    `singular_rad`: the wrist's bend (A5 for KUKA's zero) is kept at least this far from straight.
    `links`: bodies by link 0 … 6 (0: the root, i: moves with joint i), each in its link's frame
    (`kernels.arm.link_frames`); None: capsules derived from the dimensions.
    """

    name: Named
    model: ArmModel
    stations: tuple[Station, ...]
    auto: AutoBase | None
    limits: tuple[Limit, ...]
    speeds: Floats  # (6,) rad/s
    home_rad: Floats | None
    home_span: Span | None
    singular_rad: float
    links: tuple[tuple[RoundedHull, ...] | None, ...]  # (7,)


# ── process ──────────────────────────────────────────────────────────────────────────────────────


@dataclass(frozen=True)
class Signal:
    """A named input or output. `full_scale` is what an analog output's full value stands for
    (rev/s for a spindle, N for a force)."""

    role: str
    kind: Literal["input", "output", "analog"]
    number: int
    full_scale: float | None
    alias: str | None
    span: Span


@dataclass(frozen=True)
class Drill:
    """Drilling to `depth_mm` plus the hole's own stack where `depth_from_stack`."""

    spindle_rev_s: float
    feed_mm_s: float
    depth_mm: float
    depth_from_stack: bool
    peck_mm: float | None
    dwell_s: float


@dataclass(frozen=True)
class Countersink:
    """A cone of `angle_rad` that the combined tool sinks beyond the drilled depth: by `by_mm`, or
    as deep as the rim `diameter_mm` asks of the hole's own diameter."""

    angle_rad: float
    by_mm: float | None
    diameter_mm: float | None


@dataclass(frozen=True)
class Handshake:
    """How long to wait for the input that answers an output, and where the spec says so."""

    timeout_s: float
    span: Span


@dataclass(frozen=True)
class Clamp:
    """Pressing the stack together before anything is cut or set; let go afterwards."""

    force_n: float | None
    handshake: Handshake


@dataclass(frozen=True)
class Rivet:
    """Setting a rivet, and the answer that it is set."""

    handshake: Handshake


@dataclass(frozen=True)
class Process:
    """What is done at a hole. Exactly one of `drill` and `rivet` is given, or neither: then the
    tool only visits the hole's position."""

    name: str
    span: Span | None
    approach_mm: float
    clearance_mm: float  # the feed begins this far before the surface (drilling)
    retract_mm: float
    travel_mm_s: float
    approach_mm_s: float
    retract_mm_s: float
    clamp: Clamp | None = None
    drill: Drill | None = None
    countersink: Countersink | None = None
    rivet: Rivet | None = None


# ── posture and regions ──────────────────────────────────────────────────────────────────────────


@dataclass(frozen=True, eq=False)
class PostureRule:
    """`axis` (0 x, 1 y) is held horizontal, or as near to `toward` as the tangent plane lets it.

    `toward` is a unit vector in part coordinates. `cone_rad` is the half-angle around the singular
    direction within which the rule decides nothing; `fallback` decides there.
    """

    axis: int
    horizontal: bool
    toward: Floats | None
    cone_rad: float
    fallback: PostureRule | None
    span: Span


@dataclass(frozen=True, eq=False)
class Avoid:
    """A fixture (index into Job.fixtures; None: the part's own surface) that the tool keeps
    `clearance_mm` away from during the whole cycle. The arm's links, and both on the way to the
    hole, may come nearer by up to `planning.cell.LEAST_GAP_MM`."""

    fixture: int | None
    clearance_mm: float
    span: Span


@dataclass(frozen=True, eq=False)
class Region:
    """Rows `start` … `stop` of the hole table, one process, one rule.

    `turning_rad`: the heading may leave the rule's by up to this, either way (pi: any heading);
    0 where the rule is to be kept exactly. `station` is an index into the arm's stations.
    """

    name: Named
    start: int
    stop: int
    process: int
    posture: PostureRule | None
    avoid: tuple[Avoid, ...] = ()
    turning_rad: float = 0.0
    station: int = 0


@dataclass(frozen=True, eq=False)
class HoleTable:
    """Columns over n holes, in the order in which they will be made.

    `feed` is the unit direction into the part. `source`, `line` and `column` say where the hole was
    written (`sources[source]`), so that any stage can point at it.
    """

    ids: Texts
    position_mm: Floats  # (n, 3), part coordinates
    feed: Floats  # (n, 3), part coordinates, unit, into the part
    diameter_mm: Floats  # (n,), NaN where not given
    stack_mm: Floats  # (n,), NaN where not given
    region: Ints  # (n,), index into Job.regions
    source: Ints  # (n,), index into `sources`
    line: Ints  # (n,), from 1
    column: Ints  # (n,), from 1
    sources: tuple[Source, ...]

    def __len__(self) -> int:
        return len(self.ids)

    def span(self, row: int) -> Span:
        """Where hole `row` is written."""
        source = self.sources[int(self.source[row])]
        return Span(source, int(self.line[row]), int(self.column[row]), len(str(self.ids[row])))


# ── expectations and outputs ─────────────────────────────────────────────────────────────────────


@dataclass(frozen=True, eq=False)
class ExpectRotation:
    """Hole `row`'s tool orientation, as a rotation (3, 3) in part coordinates."""

    row: int
    part_from_tool: Floats
    within_rad: float
    span: Span


@dataclass(frozen=True, eq=False)
class ExpectPosition:
    """Hole `row`'s position (3,) in mm."""

    row: int
    position_mm: Floats
    within_mm: float
    span: Span


@dataclass(frozen=True, eq=False)
class ExpectJoints:
    """Hole `row`'s joints (6,), with a tolerance for lengths (infinite for an arm, whose joints all
    turn) and one for angles."""

    row: int
    joints: Floats
    within_mm: float
    within_rad: float
    span: Span


@dataclass(frozen=True)
class ExpectCount:
    """How many holes a region has."""

    region: int
    count: int
    span: Span


Expect = ExpectRotation | ExpectPosition | ExpectJoints | ExpectCount


@dataclass(frozen=True)
class Setting:
    """One `name value` of an `emit` block: a number in the base unit of `unit` (the unit as
    written, or empty), a word or a text."""

    name: Named
    value: float | str
    unit: str
    span: Span


@dataclass(frozen=True)
class Emit:
    """A post asked for by name. `axes` maps joint names (q1 …) to the controller's axes."""

    post: Named
    settings: tuple[Setting, ...]
    axes: tuple[tuple[Named, Named], ...]


@dataclass(frozen=True)
class Weights:
    """What a sequence's cost is made of, in seconds: per radian by which a heading leaves the
    rule's, per second of joint travel at full speed (summed over the joints), and for closeness to
    limits and to the wrist's singularity (`planning.sequence.closeness`, 0 to 1 for each)."""

    deviation: float = 10.0
    travel: float = 1.0
    margin: float = 1.0


@dataclass(frozen=True, eq=False)
class Job:
    """Everything that a spec says."""

    program: Named
    part: Part
    tool: Tool | None
    robot: Portal | Arm | None
    fixtures: tuple[Fixture, ...]
    signals: dict[str, Signal]
    processes: tuple[Process, ...]
    regions: tuple[Region, ...]
    holes: HoleTable
    heading_jump_max_rad: float | None
    order_shortest: bool
    weights: Weights
    expects: tuple[Expect, ...]
    emits: tuple[Emit, ...]
    inputs: tuple[Source, ...]  # every file that was read, in reading order
