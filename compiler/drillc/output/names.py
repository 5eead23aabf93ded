"""Names in the spec → names on the controller: stable, and refused where two would be one.

A name keeps its text wherever the controller takes it. Otherwise it is mapped by rules that look at
the name alone, never at its neighbours: the name of a hole does not change because another hole was
added. What the rules cannot mend is an error at the place where the name is written.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from drillc.language.diagnostics import NAMED_ROWS, Label, Report
from drillc.language.job import Texts
from drillc.language.source import Span
from drillc.planning.program import Program

#: What can bear a name on a controller. A post says which of these its files really name.
Kind = Literal["program", "module", "process", "region", "hole"]

_LETTER: Mapping[Kind, str] = {
    "program": "P",
    "module": "M",
    "process": "R",  # a routine
    "region": "G",  # a group of holes
    "hole": "H",
}
_ILLEGAL = re.compile(r"[^A-Za-z0-9_\n]")
_NO_LETTER = re.compile(r"^(?=[^A-Za-z])", re.MULTILINE)
_UNPRINTABLE = re.compile(r"[^\x20-\x7e]")


#: No file on Windows, where KRC and many an offline PC run, can bear these names.
_NO_FILES = frozenset({"con", "prn", "aux", "nul"}) | {
    f"{device}{number}" for device in ("com", "lpt") for number in range(1, 10)
}


@dataclass(frozen=True)
class NameRules:
    """What a controller takes as a name, beyond "a letter, then letters, digits and _".

    `keywords` are words that the language reserves (any case unless `case_sensitive`); `reserved`
    are names that the templates use themselves. With `lower`, names are written in lower case.
    """

    max_length: int
    case_sensitive: bool = False
    lower: bool = False
    keywords: frozenset[str] = frozenset()
    reserved: frozenset[str] = frozenset()

    def fold(self, name: str) -> str:
        """Two names are one to the controller when their folds are equal."""
        return name if self.case_sensitive else name.lower()

    def mapped(self, names: Sequence[str], kind: Kind) -> list[str]:
        """The names as the controller will see them, in bulk.

        >>> NameRules(8).mapped(["P1", "7-a", "RIVET_000123"], "hole")
        ['P1', 'H7_a', 'RIV_0123']
        """
        if not names:
            return []
        text = "\n".join(names)
        text = _NO_LETTER.sub(_LETTER[kind], _ILLEGAL.sub("_", text))
        if self.lower:
            text = text.lower()
        mapped = text.split("\n")
        if max(map(len, mapped)) > self.max_length:
            mapped = [self._shortened(name) for name in mapped]
        return mapped

    def _shortened(self, name: str) -> str:
        """The tail is kept longer than the head: it carries the numbering."""
        if len(name) <= self.max_length:
            return name
        head = (self.max_length - 1) // 2
        return f"{name[:head]}_{name[len(name) - (self.max_length - 1 - head) :]}"


@dataclass(frozen=True, eq=False)
class Names:
    """The controller's names. `holes` is (n,), or None where the post's files do not name holes.

    `processes` has one entry per cycle, `regions` maps the spec's names. `changed` lists (kind,
    spec's name, emitted name) wherever the two differ.
    """

    program: str
    modules: tuple[str, ...]
    processes: tuple[str, ...]
    regions: Mapping[str, str]
    holes: Texts | None
    changed: Sequence[tuple[Kind, str, str]]


@dataclass(frozen=True)
class _Entry:
    """One name that stands beside the holes' names."""

    kind: Kind
    spec: str
    emitted: str
    span: Span


def map_names(
    program: Program,
    rules: NameRules,
    kinds: Collection[Kind],
    modules: int,
    emit_span: Span,
    report: Report,
) -> Names:
    """Map every name of `kinds`, and report what cannot be told apart or is not free.

    All kinds share one name space: KRL has a single one, and elsewhere it costs nothing to keep
    them apart. What has no place of its own in the spec is reported at `emit_span`.
    """
    ids: list[str] = program.holes.ids.tolist()
    processes = [cycle.process for cycle in program.cycles]
    regions = {section.region: section.span for section in reversed(program.sections)}
    if not _all_printable(program, ids, regions, emit_span, report):
        return Names(program.name, (program.name,), (), {}, None, ())

    [title] = rules.mapped([program.name], "program")
    entries = [_Entry("program", program.name, title, emit_span)]
    if modules > 1:
        numbered = rules.mapped([f"{title}_{i + 1}" for i in range(modules)], "module")
        entries += [_Entry("module", name, name, emit_span) for name in numbered]
    else:
        numbered = [title]
    suffix = _suffix(program, modules)
    routines = rules.mapped([process.name + suffix for process in processes], "process")
    for process, name in zip(processes, routines, strict=True):
        entries.append(_Entry("process", process.name, name, process.span or emit_span))
    groups = dict(zip(regions, rules.mapped(list(regions), "region"), strict=True))
    entries += [_Entry("region", spec, name, regions[spec]) for spec, name in groups.items()]
    entries = [entry for entry in entries if entry.kind in kinds]
    holes = rules.mapped(ids, "hole") if "hole" in kinds else []

    _check(program, rules, entries, holes, report)
    changed = [(e.kind, e.spec, e.emitted) for e in entries if e.spec != e.emitted]
    if holes != ids and "hole" in kinds:
        pairs = zip(ids, holes, strict=True)
        changed += [("hole", spec, name) for spec, name in pairs if spec != name]
    return Names(
        title,
        tuple(numbered),
        tuple(routines),
        groups,
        np.array(holes, dtype=np.str_) if "hole" in kinds else None,
        changed,
    )


def _suffix(program: Program, modules: int) -> str:
    """What tells the routines of one of an arm's stations from those of another. Routines that
    several modules call are known to the whole controller, where both programs may lie."""
    station = program.arm.station.name if program.arm else None
    return f"_{station.text}" if station and modules > 1 else ""


def names_csv(changed: Iterable[tuple[Kind, str, str]]) -> bytes:
    """The table of changed names: kind, spec, emitted."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([("kind", "spec", "emitted"), *changed])
    return text.getvalue().encode("ascii")


def _all_printable(
    program: Program,
    ids: Sequence[str],
    regions: Mapping[str, Span],
    emit_span: Span,
    report: Report,
) -> bool:
    """Texts reach comments and messages: a line break in one would begin a line of program."""
    before = len(report.diagnostics)

    def refuse(what: str, text: str, span: Span | None) -> None:
        wrong = f"{what} {text!a} holds a character that no controller reads"
        report.error(
            "E640",
            wrong if text else f"the {what} is empty",
            span,
            hint="use letters, digits and plain punctuation (ASCII)",
        )

    joined = "\n".join(ids)
    strange = _UNPRINTABLE.search(joined.replace("\n", "")) is not None
    if strange or joined.count("\n") != max(0, len(ids) - 1) or "" in ids:
        rows = [row for row, text in enumerate(ids) if not text or _UNPRINTABLE.search(text)]
        for row in rows[:NAMED_ROWS]:
            refuse("hole id", ids[row], program.holes.span(row))
        _count_rest("E640", "hole ids with such characters", rows, program, report)
    if not program.name or _UNPRINTABLE.search(program.name):
        refuse("program name", program.name, emit_span)
    for cycle in program.cycles:
        if not cycle.process.name or _UNPRINTABLE.search(cycle.process.name):
            refuse("process name", cycle.process.name, cycle.process.span or emit_span)
    for region, span in regions.items():
        if not region or _UNPRINTABLE.search(region):
            refuse("region name", region, span)
    return len(report.diagnostics) == before


def _check(
    program: Program,
    rules: NameRules,
    entries: Sequence[_Entry],
    holes: Sequence[str],
    report: Report,
) -> None:
    """No two names are one, and none is taken by the language or by the post's own templates."""
    folded = rules.fold("\n".join(holes)).split("\n") if holes else []
    distinct = set(folded)
    taken = {rules.fold(word): "a word of the language" for word in rules.keywords}
    taken.update(
        {rules.fold(word): "a name that the program itself uses" for word in rules.reserved}
    )

    seen: dict[str, _Entry] = {}
    for entry in entries:
        fold = rules.fold(entry.emitted)
        if fold in taken:
            _report_taken(entry, taken[fold], report)
        elif entry.kind in ("program", "module") and fold.lower() in _NO_FILES:
            _report_taken(entry, "a name that no file on Windows can have", report)
        if other := seen.get(fold):
            _report_equal(other, entry, report)
        seen.setdefault(fold, entry)

    crossing = distinct.intersection(seen.keys() | taken.keys())
    if len(distinct) == len(folded) and not crossing:
        return  # the common case, without a Python loop over the holes

    first: dict[str, int] = {}
    doubled: list[int] = []
    reserved: list[int] = []
    for row, fold in enumerate(folded):
        if first.setdefault(fold, row) != row or fold in seen:
            doubled.append(row)
        if fold in taken:
            reserved.append(row)
    for row in doubled[:NAMED_ROWS]:
        other_row = first[folded[row]]
        other = _hole(program, holes, other_row) if other_row != row else seen[folded[row]]
        _report_equal(other, _hole(program, holes, row), report)
    _count_rest("E641", "holes whose name another one has", doubled, program, report)
    for row in reserved[:NAMED_ROWS]:
        _report_taken(_hole(program, holes, row), taken[folded[row]], report)
    _count_rest("E642", "holes with such names", reserved, program, report)


def _hole(program: Program, holes: Sequence[str], row: int) -> _Entry:
    return _Entry("hole", str(program.holes.ids[row]), holes[row], program.holes.span(row))


def _report_equal(one: _Entry, two: _Entry, report: Report) -> None:
    emitted = f"both are {two.emitted} on the controller"
    if one.emitted != two.emitted:
        emitted = f"the controller takes {one.emitted} and {two.emitted} for one name"
    report.error(
        "E641",
        f"{two.kind} {two.spec} and {one.kind} {one.spec} cannot be told apart: {emitted}",
        two.span,
        labels=[Label(one.span, f"{one.kind} {one.spec}")],
        hint="rename one of them",
    )


def _report_taken(entry: _Entry, why: str, report: Report) -> None:
    written = "" if entry.spec == entry.emitted else f" (emitted as {entry.emitted})"
    report.error(
        "E642",
        f"{entry.kind} {entry.spec}{written} bears {why}",
        entry.span,
        hint="give it another name",
    )


def _count_rest(
    code: str, what: str, rows: Sequence[int], program: Program, report: Report
) -> None:
    """What was not named one by one is counted, and the first of it shown."""
    if len(rows) > NAMED_ROWS:
        span = program.holes.span(rows[NAMED_ROWS])
        report.error(code, f"{len(rows) - NAMED_ROWS} more {what}, the first of them here", span)
