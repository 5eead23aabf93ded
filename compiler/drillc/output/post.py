"""What a post-processor is: one small class that declares, and a folder of templates.

A post says what its controller can express (`Accepts`), how names look there (`NameRules`), what an
`emit` block may set (`Option`) and which files it writes. It computes per-hole columns and whatever
else its templates print; everything that all posts have in common (refusing what cannot be
expressed, names, splitting into modules, staging) is in `drillc.output.emission`.

A post never guesses: what it cannot express it reports, at the line of the spec that asks for it.
"""

from __future__ import annotations

from abc import ABC
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from drillc.language.diagnostics import Report
from drillc.language.job import Emit, Texts
from drillc.language.units import Dimension
from drillc.output.names import Kind, NameRules, Names
from drillc.output.numbers import Column
from drillc.output.vias import plain_kinds
from drillc.planning.program import Program

#: Controllers whose numbers are single precision resolve about 0.01 mm this far out.
FARTHEST_MM = 100_000.0


@dataclass(frozen=True)
class Accepts:
    """What a controller can be told. Whatever is not accepted is refused before `check`.

    `poses` and `joints` are the two kinds of program. `arms` are the makers whose arms the post
    programs, "other" among them if it programs those of any other maker too; a program for an arm
    is refused where there are none, because it needs its vias made too. A post that takes no poses
    programs an arm by its joints, and an axis map is asked for. `joint_feed`: a
    program in joints can feed a drill in mm/s. `spindle`: the language has words for it ("native"),
    or it is switched through the signals `spindle_on` and `spindle_speed`. `axes` are the names
    that an axis map may use, as they are written in the output (a spec may write them in any case).
    `inputs`, `outputs` and `analogs` are the numbers that signals may have.
    """

    poses: bool = False
    joints: bool = False
    arms: tuple[str, ...] = ()
    joint_feed: bool = True
    spindle: Literal["native", "signals"] = "signals"
    axes: tuple[str, ...] = ()
    inputs: range = range(4097)
    outputs: range = range(4097)
    analogs: range = range(4097)
    farthest_mm: float = FARTHEST_MM


@dataclass(frozen=True)
class Option:
    """One thing that `emit krl { velocity 20 % }` may set, and its default.

    A `count` is a whole number without a unit. A `number` has the unit of its `dimension` (none: a
    bare number). A `word` is one of `words`. A `name` is a name on the controller, as the post's
    rules have it. `low` and `high` are inclusive, in the base unit (mm, rad, s, a share of one).
    """

    name: str
    kind: Literal["count", "number", "word", "name"]
    default: float | str | None
    dimension: Dimension | None = None
    low: float | None = None
    high: float | None = None
    words: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Task:
    """One program to be emitted by one post.

    `settings` has a value for every option of the post. `axes` has the controller's axis for each
    joint of `program.motion`, or of an arm that is programmed by its joints, in order; it is empty
    for a program in poses, and in `check` when the axis map itself is wrong.
    """

    program: Program
    emit: Emit
    settings: Mapping[str, Any]
    axes: tuple[str, ...]
    names: Names


class PostProcessor(ABC):
    """Base of all posts. A subclass is made without arguments and keeps no state."""

    #: What `emit NAME` calls it: lower-case letters, digits and _; also its output folder.
    name: ClassVar[str]
    #: The controller in words, for `drillc posts`.
    title: ClassVar[str]
    accepts: ClassVar[Accepts]
    names: ClassVar[NameRules]
    #: The kinds of name that really occur as names in this post's files.
    named: ClassVar[tuple[Kind, ...]] = ("program", "module", "process", "hole")
    options: ClassVar[tuple[Option, ...]] = ()
    #: File name → template. `{program}` is filled in; a file with `{module}` is made per module.
    files: ClassVar[Mapping[str, str]]
    #: The same for a program of several modules; empty: this post never splits.
    split_files: ClassVar[Mapping[str, str]] = {}
    #: The default of the setting `holes_per_module`, which every post that splits has.
    holes_per_module: ClassVar[int] = 1000
    newline: ClassVar[Literal["\n", "\r\n"]] = "\r\n"
    #: The package that holds the templates. A plug-in names its own.
    template_package: ClassVar[str] = "drillc.templates"
    #: Filters beside `fixed`.
    filters: ClassVar[Mapping[str, Callable[..., Any]]] = {}
    #: Decimals of the column `depth`.
    length_decimals: ClassVar[int] = 3
    #: Characters that end or nest a comment; they are replaced by _ in every text that is printed.
    comment_forbidden: ClassVar[str] = ""
    #: Texts in comments are cut to this length.
    comment_length: ClassVar[int] = 80
    #: A regular expression for the line with which a hole's turn comes; its group is the hole's
    #: name or id as emitted. The conformance tests count holes by it.
    hole_line: ClassVar[str] = ""

    def check(self, task: Task, report: Report) -> None:  # noqa: B027 — most posts need no more
        """Report, located, what this controller cannot express beyond `accepts`."""

    def columns(self, task: Task) -> dict[str, Column]:
        """Per-hole columns (n,) beside `id` (safe in a comment), `name` and `depth`."""
        return {}

    def via_kinds(self, task: Task) -> Texts:
        """A word for each via (m,) of a program for an arm: those in a row that have the same come
        as one stretch to the templates, so that each kind has its own text there."""
        arm = task.program.arm
        if arm is None:
            raise ValueError("only a program for an arm has vias")
        return plain_kinds(arm)

    def via_columns(self, task: Task) -> dict[str, Column]:
        """Per-via columns (m,) of a program for an arm, beside `number` and `to`."""
        return {}

    def context(self, task: Task) -> dict[str, object]:
        """What the templates print beside what every template has (see `emission.context_of`)."""
        return {}

    def comment(self, text: str) -> str:
        """`text` as it may stand inside a comment of this language."""
        return text.translate({ord(c): "_" for c in self.comment_forbidden})[: self.comment_length]
