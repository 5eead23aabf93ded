"""The syntax tree of a spec: what was written, where, with nothing resolved yet.

A statement is a keyword, a name and items; an item is a keyword and values. Values keep a number's
text, because a unit is applied in decimal arithmetic (`units.convert`).
"""

from __future__ import annotations

from dataclasses import dataclass

from drillc.language.source import Source, Span


@dataclass(frozen=True)
class Word:
    """A name, a keyword or a hole id."""

    text: str
    span: Span


@dataclass(frozen=True)
class Text:
    """A quoted text, without its quotes."""

    text: str
    span: Span


@dataclass(frozen=True)
class Quantity:
    """A number and its unit, if one was written."""

    number: str
    unit: str | None
    span: Span


@dataclass(frozen=True)
class Numbers:
    """Numbers in parentheses, and the unit behind them, if one was written. `spans` places each."""

    numbers: tuple[str, ...]
    unit: str | None
    span: Span
    spans: tuple[Span, ...]


@dataclass(frozen=True)
class Range:
    """`low .. high`."""

    low: Quantity
    high: Quantity
    span: Span


@dataclass(frozen=True)
class Rotation:
    """`rotate AXIS ANGLE`."""

    axis: Word
    angle: Quantity


@dataclass(frozen=True)
class FrameAxes:
    """`axes (…) (…) (…)`: a frame's x, y and z axes."""

    axes: tuple[Numbers, Numbers, Numbers]
    span: Span


@dataclass(frozen=True)
class Orientation:
    """A frame's axes, where given, then rotations about the turned frame's own axes, left to
    right."""

    axes: FrameAxes | None
    rotations: tuple[Rotation, ...]


@dataclass(frozen=True)
class Placement:
    """A translation, then an orientation about the moved frame's origin."""

    at: Numbers
    orientation: Orientation


@dataclass(frozen=True)
class Rule:
    """One posture rule. `toward` is a signed axis (`-Y`) or three numbers."""

    axis: Word
    horizontal: bool
    toward: Word | Numbers | None
    cone: Quantity | None
    span: Span


@dataclass(frozen=True)
class PointBlock:
    """The offsets of a points block's inside in its source, and its unit."""

    source: Source
    start: int
    stop: int
    unit: Word | None
    span: Span


# ── conditions of `select … where` ───────────────────────────────────────────────────────────────


@dataclass(frozen=True)
class Member:
    """The hole is in region `region`."""

    region: Word


@dataclass(frozen=True)
class Compare:
    """`column < 3 mm`, `id == "F12"`."""

    column: Word
    operator: str
    value: Quantity | Text


@dataclass(frozen=True)
class Between:
    """`column in 1 mm .. 2 mm`, both ends included."""

    column: Word
    range: Range


@dataclass(frozen=True)
class Like:
    """`id like "F*"`: a name pattern with * and ?."""

    column: Word
    pattern: Text


@dataclass(frozen=True)
class Not:
    inner: Condition


@dataclass(frozen=True)
class Both:
    """All of `parts` hold (two or more)."""

    parts: tuple[Condition, ...]


@dataclass(frozen=True)
class Either:
    """At least one of `parts` holds (two or more)."""

    parts: tuple[Condition, ...]


Condition = Member | Compare | Between | Like | Not | Both | Either


@dataclass(frozen=True)
class Select:
    """Holes of table `table` for which `condition` holds (None: all)."""

    table: Word
    condition: Condition | None
    span: Span


# ── statements ───────────────────────────────────────────────────────────────────────────────────

Value = (
    Word
    | Text
    | Quantity
    | Numbers
    | Range
    | Orientation
    | Placement
    | Rule
    | PointBlock
    | Select
    | None
)


@dataclass(frozen=True)
class Item:
    """`keyword value …` inside a block, or `NAME value …` (then `key` is that name)."""

    key: Word
    values: tuple[Value, ...]
    span: Span
    items: tuple[Item, ...] = ()


@dataclass(frozen=True)
class Statement:
    """A top-level statement. `values` and `items` are as the grammar's rule of that name says."""

    kind: str
    name: Word
    values: tuple[Value, ...]
    items: tuple[Item, ...]
    span: Span


@dataclass(frozen=True)
class SpecFile:
    """One parsed file."""

    source: Source
    statements: tuple[Statement, ...]
