"""What drillc says to its user: located, coded, with values, units and a hint that mends.

A `Diagnostic` is data; `render` draws it for a person and `as_json` for an editor. `Report`
collects a stage's diagnostics so that all mistakes of a stage are said at once; `Refused` carries
them out. The codes themselves, with cause and mend, are listed in docs/diagnostics.md.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal

from drillc.language.source import Span

Severity = Literal["error", "warning"]

#: Lines longer than this are drawn as a window around the caret.
DRAWN_WIDTH = 120
#: How many holes of one code are named one by one before the rest is only counted.
NAMED_ROWS = 10
#: Messages are cut at this length: a name or a number in one may have 100,000 characters.
MESSAGE_LENGTH = 800


@dataclass(frozen=True)
class Label:
    """A second place that belongs to a diagnostic, with a few words."""

    span: Span
    text: str


@dataclass(frozen=True)
class Diagnostic:
    """One message. `code` is stable: a letter for the severity and three digits."""

    code: str
    message: str
    span: Span | None = None
    labels: tuple[Label, ...] = ()
    hint: str | None = None

    @property
    def severity(self) -> Severity:
        return "warning" if self.code.startswith("W") else "error"


class Refused(Exception):  # noqa: N818  (a verdict on the spec, no error of the program)
    """A stage found errors; the report holds them all. Never shown as a traceback."""

    def __init__(self, report: Report) -> None:
        super().__init__("\n".join(d.message for d in report.diagnostics))
        self.report = report


@dataclass
class Report:
    """Diagnostics in the order they were found, and notes: what drillc decided where the spec left
    it to decide."""

    diagnostics: list[Diagnostic] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def error(
        self,
        code: str,
        message: str,
        span: Span | None = None,
        *,
        labels: Iterable[Label] = (),
        hint: str | None = None,
    ) -> None:
        """Add a diagnostic; a code that starts with W makes it a warning."""
        clipped = _clipped(message), None if hint is None else _clipped(hint)
        self.diagnostics.append(Diagnostic(code, clipped[0], span, tuple(labels), clipped[1]))

    warn = error

    def note(self, text: str) -> None:
        """Add a note: one line, no mistake."""
        self.notes.append(text)

    @property
    def failed(self) -> bool:
        return any(d.severity == "error" for d in self.diagnostics)

    def stop_if_failed(self) -> None:
        """End a stage: raises `Refused` when an error was reported."""
        if self.failed:
            raise Refused(self)


def render(diagnostic: Diagnostic) -> str:
    """Draw a diagnostic: `file:line:col: error E101: …`, the line with a caret, labels, hint."""
    head = f"{diagnostic.severity} {diagnostic.code}: {printable(diagnostic.message)}"
    lines = [f"{_place(diagnostic.span)}: {head}" if diagnostic.span else head]
    if diagnostic.span:
        lines += _drawn(diagnostic.span)
    for label in diagnostic.labels:
        lines.append(f"  {_place(label.span)}: {printable(label.text)}")
        lines += _drawn(label.span)
    if diagnostic.hint:
        lines.append(f"  hint: {printable(diagnostic.hint)}")
    return "\n".join(lines)


def as_json(diagnostic: Diagnostic) -> dict[str, object]:
    """The same as plain data, for editors (`--json`)."""
    return {
        "severity": diagnostic.severity,
        "code": diagnostic.code,
        "message": diagnostic.message,
        **_json_span(diagnostic.span),
        "labels": [{"text": label.text, **_json_span(label.span)} for label in diagnostic.labels],
        "hint": diagnostic.hint,
    }


def in_order(diagnostics: Iterable[Diagnostic]) -> list[Diagnostic]:
    """As one reads the files: those without a place first, then by file (in the order in which the
    files turn up), line and column."""
    files: dict[str, int] = {}

    def place(diagnostic: Diagnostic) -> tuple[int, int, int]:
        span = diagnostic.span
        if span is None:
            return -1, 0, 0
        return files.setdefault(span.source.shown, len(files)), span.line, span.column

    return sorted(diagnostics, key=place)


def printable(text: str) -> str:
    """`text` with control characters replaced, so that no input can steer a terminal."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)


def _clipped(text: str) -> str:
    return text if len(text) <= MESSAGE_LENGTH else text[: MESSAGE_LENGTH - 1] + "…"


def _json_span(span: Span | None) -> dict[str, object]:
    if span is None:
        return {"file": None, "line": None, "column": None, "end_column": None}
    return {
        "file": span.source.shown,
        "line": span.line,
        "column": span.column,
        "end_column": span.column + span.length,
    }


def _place(span: Span) -> str:
    return f"{printable(span.source.shown)}:{span.line}:{span.column}"


def _drawn(span: Span) -> list[str]:
    text = span.source.line_text(span.line)
    if not text.strip():
        return []
    start, length = span.column - 1, max(1, span.length)
    if len(text) > DRAWN_WIDTH:
        cut = max(0, min(start - DRAWN_WIDTH // 2, len(text) - DRAWN_WIDTH))
        more = len(text) > cut + DRAWN_WIDTH
        text, start = text[cut : cut + DRAWN_WIDTH], start - cut
        text = ("…" if cut else text[0]) + text[1:-1] + ("…" if more else text[-1])
    text = printable(text.expandtabs(1))
    carets = "^" * max(1, min(length, len(text) - start))
    number = str(span.line)
    return [f"  {number} | {text}", f"  {' ' * len(number)} | {' ' * start}{carets}"]
