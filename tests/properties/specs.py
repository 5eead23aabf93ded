"""Specs written by hypothesis: poses and portals, with inline points or a CSV table, in mm or m."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path

import numpy as np
from drillc.driver import Planned, compile_spec, plan_spec
from drillc.language.diagnostics import Refused, Report
from hypothesis import strategies as st

#: Between statements, so that a test can take a spec apart again.
SEPARATOR = "\n\n"

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Hole:
    """A hole as a person has it: decimal millimetres, and a normal of about unit length."""

    id: str
    position_mm: tuple[Decimal, Decimal, Decimal]
    normal: Vector


@dataclass(frozen=True)
class Spec:
    """The parts of a spec. `texts` are its statements apart from the regions, in any order."""

    texts: tuple[str, ...]
    #: Region name → what it says beside its holes.
    regions: Mapping[str, str]
    holes: Mapping[str, Sequence[Hole]]
    unit: str = "mm"
    table: bool = False

    def files(self) -> dict[str, str]:
        """The spec and, where it reads one, its table."""
        statements = list(self.texts)
        files = {}
        if self.table:
            columns = "id ID x X y Y z Z i I j J k K"
            statements.append(
                f'holes all from "all.csv" {{ units {self.unit} columns {{ {columns} }} }}'
            )
            rows = [row(hole, self.unit) for holes in self.holes.values() for hole in holes]
            files["all.csv"] = "\n".join(["ID,X,Y,Z,I,J,K", *rows, ""])
        for name, rest in self.regions.items():
            holes = self.holes[name]
            if self.table:
                either = " or ".join(f'id == "{hole.id}"' for hole in holes)
                source = f"select all where {either}"
            else:
                points = "\n".join("  " + point(hole, self.unit) for hole in holes)
                source = f"points {self.unit} {{\n{points}\n}}"
            statements.append(f"region {name} {{ {rest} {source} }}")
        files["spec.drill"] = SEPARATOR.join(["drill 1", *statements, ""])
        return files


def in_unit(value_mm: Decimal, unit: str) -> str:
    """A length as a decimal text, exactly."""
    return format(value_mm.scaleb({"mm": 0, "m": -3, "um": 3, "cm": -1}[unit]), "f")


def point(hole: Hole, unit: str) -> str:
    place = ", ".join(in_unit(v, unit) for v in hole.position_mm)
    return f"{hole.id} ({place}) normal ({', '.join(map(repr, hole.normal))})"


def row(hole: Hole, unit: str) -> str:
    place = [in_unit(v, unit) for v in hole.position_mm]
    return ",".join([hole.id, *place, *map(repr, hole.normal)])


# ── running ──────────────────────────────────────────────────────────────────────────────────────


def planned(spec: Spec) -> Planned:
    """Every pass up to the program; `Refused` when the spec has errors."""
    with tempfile.TemporaryDirectory() as folder:
        return plan_spec(write(spec.files(), Path(folder)), None, Report())


def emitted(spec: Spec | Mapping[str, str]) -> dict[str, bytes]:
    """Every file of every post; not the manifest and the map, which tell of the inputs."""
    files = spec.files() if isinstance(spec, Spec) else spec
    with tempfile.TemporaryDirectory() as folder:
        report = Report()
        out = Path(folder) / "out"
        try:
            paths = compile_spec(write(files, Path(folder)), out, report).paths
        except Refused as refused:
            raise AssertionError(f"{refused}\n{files['spec.drill']}") from refused
        found = {path.relative_to(out).as_posix(): path.read_bytes() for path in paths}
    told = ("manifest.json", "source-map/")
    return {path: data for path, data in found.items() if not path.startswith(told)}


def write(files: Mapping[str, str], folder: Path) -> Path:
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder / "spec.drill"


# ── strategies ───────────────────────────────────────────────────────────────────────────────────

SIGNED_AXES = ("+X", "-X", "+Y", "-Y", "+Z", "-Z")


def axis_vector(axis: str) -> np.ndarray:
    """`-Y` as a vector."""
    vector = np.zeros(3)
    vector["XYZ".index(axis[1])] = 1.0 if axis[0] == "+" else -1.0
    return vector


_COMPONENT = st.floats(-1.0, 1.0, allow_subnormal=False)
#: Unit vectors everywhere on the sphere, the axes among them.
UNIT_VECTORS = st.one_of(
    st.tuples(_COMPONENT, _COMPONENT, _COMPONENT)
    .filter(lambda v: np.linalg.norm(v) > 1e-3)
    .map(lambda v: tuple((np.array(v) / np.linalg.norm(v)).tolist())),
    st.sampled_from(SIGNED_AXES).map(lambda axis: tuple(axis_vector(axis).tolist())),
)
#: Hole positions: decimals as a CAD export has them, on a grid so that no two are one.
_DIGITS = st.decimals("-0.499999", "0.499999", places=6)


@st.composite
def positions(draw: st.DrawFn, count: int) -> list[tuple[Decimal, Decimal, Decimal]]:
    cells = draw(
        st.lists(
            st.tuples(*[st.integers(-9000, 9000)] * 3), min_size=count, max_size=count, unique=True
        )
    )
    places = draw(st.sampled_from((0, 1, 3, 6)))
    return [
        tuple(round(Decimal(cell) + draw(_DIGITS), places) for cell in triple)  # type: ignore[misc]
        for triple in cells
    ]


_COUNTS = st.lists(st.integers(1, 4), min_size=1, max_size=3)

TOOL = "tool ee { number 3 tcp (-350, 0, 250) mm rotate y -90 deg mass 40 kg cog (1, 2, 3) mm }"
IO = (
    "io { spindle_on output 17 spindle_speed analog 1 full 6000 rpm spindle_running input 17"
    " clamp output 18 clamped input 18 released input 19 clamp_force analog 2 full 2000 N"
    ' set output 20 as "doSet" set_done input 20 }'
)
DRILL = (
    "process drill6 { approach 60 mm spindle 3000 rpm feed 0.1 mm/rev depth 12 mm peck 5 mm"
    " clamp 500 N timeout 2 s retract 55 mm }"
)
RIVET = "process rivet { approach 30 mm rivet timeout 4 s clamp timeout 2 s retract 40 mm }"


@dataclass(frozen=True)
class Rule:
    """A posture rule, as a test can check it without reading specs."""

    axis: int
    horizontal: bool
    toward: str | None

    def __str__(self) -> str:
        words = ["posture", "xy"[self.axis]]
        words += ["horizontal"] if self.horizontal else []
        words += ["toward", self.toward] if self.toward else []
        return " ".join(words)


_STANDS = "frame 2 at (1200, -300.5, 850) mm rotate z 90 deg rotate x 0.5 rad"
RULES = st.builds(
    Rule, st.integers(0, 1), st.just(True), st.sampled_from((None, *SIGNED_AXES))
) | st.builds(Rule, st.integers(0, 1), st.just(False), st.sampled_from(SIGNED_AXES))


#: Within this of the direction along which a rule is singular, a spec is refused.
CONE_RAD = float(np.radians(0.5))


def clearance_rad(rule: Rule, up: str, feed: Vector) -> float:
    """How far a feed is from the line along which the rule decides nothing."""
    line = axis_vector(up if rule.horizontal or rule.toward is None else rule.toward)
    sine = float(np.linalg.norm(np.cross(line, feed)) / np.linalg.norm(feed))
    return float(np.arcsin(min(1.0, sine)))


def sense(rule: Rule, up: str, feed: Vector) -> float:
    """The part of the horizontal direction along `toward`; 1 where there is nothing to choose."""
    if not rule.horizontal or rule.toward is None:
        return 1.0
    across = np.cross(axis_vector(up), feed)
    length = float(np.linalg.norm(across))
    return float(axis_vector(rule.toward) @ across) / length if length else 0.0


def decided(rule: Rule, up: str, normal: Vector) -> bool:
    """Whether the rule gives a posture, whichever way the normal points."""
    return clearance_rad(rule, up, normal) > 1.01 * CONE_RAD and abs(sense(rule, up, normal)) > 1e-5


@dataclass(frozen=True)
class PoseCase:
    """A spec in poses with what it was made from."""

    spec: Spec
    rules: tuple[Rule, ...]
    up: str
    into: bool


@st.composite
def pose_cases(draw: st.DrawFn, singular: bool = False) -> PoseCase:
    """One to three regions of one to four holes; with `singular`, also where rules fail."""
    up, into = draw(st.sampled_from(SIGNED_AXES)), draw(st.booleans())
    rules = RULES if singular else RULES.filter(lambda r: not r.horizontal or _chooses(r, up))
    counts = draw(_COUNTS)
    places = draw(positions(sum(counts)))
    holes, chosen, regions, at = {}, [], {}, 0
    for index, count in enumerate(counts):
        name = f"region_{index}"
        rule = draw(rules)
        chosen.append(rule)
        process = draw(st.sampled_from(("process drill6", "process rivet", "")))
        regions[name] = f"{rule} {process}"
        normals = UNIT_VECTORS
        if not singular:
            normals = normals.filter(lambda n, rule=rule: decided(rule, up, n))
        holes[name] = [Hole(f"P{at + k}", places[at + k], draw(normals)) for k in range(count)]
        at += count
    frame, wobj = draw(st.sampled_from((("frame 2", "wobjdata wSkin"), (_STANDS, ""), ("", ""))))
    texts = [
        "program POSES",
        f"part skin {{ up {up} normals {'into' if into else 'outward'} {frame} }}",
        TOOL,
        IO,
        "emit krl",
        f"emit rapid {{ {wobj} }}",
    ]
    used = " ".join(regions.values())
    texts += [text for name, text in (("drill6", DRILL), ("rivet", RIVET)) if name in used]
    return PoseCase(Spec(tuple(texts), regions, holes), tuple(chosen), up, into)


def _chooses(rule: Rule, up: str) -> bool:
    """`toward` along `up` chooses between no two horizontal directions."""
    return rule.toward is None or rule.toward[1] != up[1]


EMIT_JOINTS = (
    "emit krl { axes { q1 E1 q2 E2 q3 E3 q4 A1 q5 A2 q6 A3 } }",
    "emit rapid { axes { q1 eax_a q2 eax_b q3 eax_c q4 eax_d q5 eax_e q6 eax_f }"
    " rotary_speed 10 deg/s }",
)

#: The exam's machine; joints are drawn well inside its limits, so that the whole cycle fits.
COLUMN_DISTANCE_MM, COLUMN_HEIGHT_MM, HINGE_INSET_MM = 10_000.0, 5_000.0, 750.0


@dataclass(frozen=True)
class PortalCase:
    """A spec of the portal whose holes are known to be within its reach."""

    spec: Spec
    side: str


@st.composite
def portal_cases(
    draw: st.DrawFn, heights: Sequence[str] = ("widest_margin", "least_travel")
) -> PortalCase:
    """Joints are drawn, and the holes follow by the machine's geometry."""
    counts = draw(_COUNTS)
    holes, regions, at = {}, {}, 0
    taken: set[tuple[int, ...]] = set()
    for index, count in enumerate(counts):
        name = f"region_{index}"
        found = []
        for _ in range(count):
            position, normal = draw(_reachable)
            cell = tuple(int(v) for v in position)
            if cell in taken:
                continue
            taken.add(cell)
            found.append(Hole(f"R{at}", position, normal))
            at += 1
        if found:
            holes[name] = found
            regions[name] = draw(st.sampled_from(("process drill6", "process rivet", "")))
    side = draw(st.sampled_from(("below", "above")))
    height = draw(st.sampled_from(heights))
    texts = [
        "program PORTAL",
        "part skin { normals outward }",
        f"robot riveter portal {{ D 10 m H 5 m d 0.75 m height {height} side {side}"
        " limits { q3 -180 deg .. 180 deg q5 -20 m .. 20 m } }",
        IO,
        "emit gcode { axes { q1 U q2 V q3 A q4 X q5 Y q6 Z } }",
    ]
    used = " ".join(regions.values())
    # What KRL cannot do with single axes is feed a drill.
    posts = ("rapid",) if "drill6" in used else ("krl", "rapid")
    texts += [text for text in EMIT_JOINTS if text.split()[1] in posts]
    texts += [text for name, text in (("drill6", DRILL), ("rivet", RIVET)) if name in used]
    return PortalCase(Spec(tuple(texts), regions, holes), side)


def part_from_base(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The portal from its mechanics, without its closed form: the bar hangs between the hinges
    (d, 0, q1) and (D - d, 0, q2), the part turns about it by q3. Rotation (3, 3) and the place
    (3,) of the part's origin, the first hinge, both in the base frame: base_from_part."""
    first = np.array([HINGE_INSET_MM, 0.0, q[0]])
    second = np.array([COLUMN_DISTANCE_MM - HINGE_INSET_MM, 0.0, q[1]])
    bar = (second - first) / np.linalg.norm(second - first)
    across = np.array([0.0, 1.0, 0.0])
    up = np.cross(bar, across)
    turned = np.cos(q[2]) * across + np.sin(q[2]) * up
    return np.stack([bar, turned, np.cross(bar, turned)], axis=1), first


@st.composite
def _reach(draw: st.DrawFn) -> tuple[tuple[Decimal, Decimal, Decimal], Vector]:
    inside = st.floats(200.0, COLUMN_HEIGHT_MM - 200.0)
    q = np.array([
        draw(inside), draw(inside), draw(st.floats(-3.1, 3.1)), draw(st.floats(10.0, 9990.0)),
        draw(st.floats(-3000.0, 3000.0)), draw(inside),
    ])  # fmt: skip
    rotation, origin = part_from_base(q)
    position = rotation.T @ (q[3:] - origin)
    normal = rotation.T @ np.array([0.0, 0.0, 1.0])
    return tuple(round(Decimal(v), 4) for v in position.tolist()), tuple(normal.tolist())  # type: ignore[return-value]


_reachable = _reach()


def with_unit(spec: Spec, unit: str) -> Spec:
    return replace(spec, unit=unit)
