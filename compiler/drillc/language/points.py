"""Inline points, read in bulk: one regular expression over the whole block, floats by column.

A parser takes some 150 µs a point; this takes about 3 µs and still knows where each point stands.
What lies between two points is a mistake, and is explained from its first character on.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from drillc.language.ast import PointBlock
from drillc.language.characters import is_strange, meant, said_character
from drillc.language.columns import numbers
from drillc.language.diagnostics import NAMED_ROWS, Report
from drillc.language.job import Floats, Ints, Texts
from drillc.language.source import Source, Span
from drillc.language.units import Unit

#: Characters of a hole id.
MAX_ID_LENGTH = 64

#: Points handled at a time: bounds the memory that their texts take. Small, since Python's garbage
#: collector walks over all of them again and again: eight times as many take a quarter longer.
BLOCK_POINTS = 8192

_FINITE = r"(?:[0-9]++(?:\.[0-9]*+)?|\.[0-9]++)(?:[eE][+-]?[0-9]++)?"
_NUMBER = rf"[+-]?(?:{_FINITE}|[nN][aA][nN]|[iI][nN][fF](?:[iI][nN][iI][tT][yY])?)"
_ID = r"[A-Za-z0-9_][A-Za-z0-9_.:/-]*+"
_TRIPLE = rf"\(\s*+({_NUMBER})\s*+,\s*+({_NUMBER})\s*+,\s*+({_NUMBER})\s*+\)"
# A point; or one word or sign of what is none, so that nothing is ever looked at twice: the time
# stays proportional to the text, whatever it holds. Possessive for the same reason.
_POINT = re.compile(
    rf"\s*+(?:({_ID})\s*+{_TRIPLE}\s*+normal\s*+{_TRIPLE}|[^\s(),]++|[(),]|\Z)", re.ASCII
)
# A point whose normal is the surface's. "normal" is no id there: a normal that is written all the
# same would be a hole at a place of its own.
_BARE_ID = rf"(?!normal(?![A-Za-z0-9_.:/-])){_ID}"
_BARE_POINT = re.compile(rf"\s*+(?:({_BARE_ID})\s*+{_TRIPLE}|[^\s(),]++|[(),]|\Z)", re.ASCII)
# Where the next point seems to begin, behind one that is malformed: at a line that does not look as
# if it went on with this one.
_BEGIN = re.compile(rf"(?<=\n)[ \t]*+(?!normal\b){_ID}\s*+[^\s,)]")
_COMMENT = re.compile(r"#[^\n]*")
_BLANK = re.compile(r"\s*", re.ASCII)
_WORD = re.compile(r"[^\s(),]+|[(),]")

#: What a point is made of, in order, with how to say it: used to explain a mistake.
_PIECES = (
    (re.compile(_ID), "a hole id"),
    (re.compile(r"\("), '"(" before the position'),
    (re.compile(_NUMBER), "the position's x"),
    (re.compile(","), '"," after x'),
    (re.compile(_NUMBER), "the position's y"),
    (re.compile(","), '"," after y'),
    (re.compile(_NUMBER), "the position's z"),
    (re.compile(r"\)"), '")" after the position'),
    (re.compile("normal"), '"normal" and the hole\'s normal'),
    (re.compile(r"\("), '"(" before the normal'),
    (re.compile(_NUMBER), "the normal's x"),
    (re.compile(","), '"," after x'),
    (re.compile(_NUMBER), "the normal's y"),
    (re.compile(","), '"," after y'),
    (re.compile(_NUMBER), "the normal's z"),
    (re.compile(r"\)"), '")" after the normal'),
)
_BARE_PIECES = ((re.compile(_BARE_ID), "a hole id"), *_PIECES[1:8])


@dataclass(frozen=True, eq=False)
class RawHoles:
    """Holes as written, in columns: normals not yet checked or turned. NaN where not given."""

    ids: Texts
    position_mm: Floats  # (n, 3)
    normal: Floats  # (n, 3)
    diameter_mm: Floats  # (n,)
    stack_mm: Floats  # (n,)
    line: Ints  # (n,)
    column: Ints  # (n,)

    def span(self, row: int, source: Source) -> Span:
        """Where hole `row` is written in `source`."""
        length = max(1, len(str(self.ids[row])))
        return Span(source, int(self.line[row]), int(self.column[row]), length)


def read_points(block: PointBlock, unit: Unit, report: Report, *, normals: bool = True) -> RawHoles:
    """Read a points block whose positions are in `unit`. Reports every malformed point.

    Without `normals` its points state none, and NaN stands in their place.
    """
    source = block.source
    text = source.text[block.start : block.stop]
    if "#" in text:
        text = _COMMENT.sub(lambda m: " " * (m.end() - m.start()), text)
    gaps = _Gaps(block, text, normals, report)
    offsets: list[NDArray[np.int64]] = []
    ids: list[Texts] = []
    columns: list[list[Floats]] = []
    found = (_POINT if normals else _BARE_POINT).finditer(text)
    while some := list(islice(found, BLOCK_POINTS)):
        matches = [m for m in some if m.lastindex]
        gaps.look(matches)
        if matches:
            names, *cells = zip(*(m.groups() for m in matches), strict=True)
            offsets.append(np.fromiter((m.start(1) for m in matches), np.int64, len(matches)))
            ids.append(id_column(names))
            position = [numbers(c, unit).values for c in cells[:3]]
            normal = [_normal_component(c) for c in cells[3:]]
            columns.append(position + (normal or [np.full(len(matches), np.nan)] * 3))
    gaps.finish()
    line, column = _places(block, np.concatenate([np.empty(0, np.int64), *offsets]))
    x, y, z, i, j, k = (np.concatenate([np.empty(0), *parts]) for parts in _by_column(columns))
    count = len(line)
    return RawHoles(
        ids=np.concatenate([np.empty(0, dtype="<U1"), *ids]),
        position_mm=np.stack([x, y, z], axis=1),
        normal=np.stack([i, j, k], axis=1),
        diameter_mm=np.full(count, np.nan),
        stack_mm=np.full(count, np.nan),
        line=line,
        column=column,
    )


def id_column(names: Sequence[str]) -> Texts:
    """Ids as a column. Too long ones are cut to one character too many, and so still refused: one
    of them would make every row as wide."""
    if max(map(len, names)) > MAX_ID_LENGTH:
        names = [name[: MAX_ID_LENGTH + 1] for name in names]
    return np.array(names, dtype=np.str_)


def _by_column(blocks: list[list[Floats]]) -> list[list[Floats]]:
    return [[block[place] for block in blocks] for place in range(6)]


def _normal_component(texts: tuple[str, ...]) -> Floats:
    """Numbers, with nan and inf let through: the normal's own check names them."""
    return np.array(texts, dtype=np.float64)


def _places(block: PointBlock, offsets: NDArray[np.int64]) -> tuple[Ints, Ints]:
    starts = np.array(block.source.line_starts(), dtype=np.int64)
    at = offsets + block.start
    line = np.searchsorted(starts, at, side="right")
    column = at - starts[line - 1] + 1
    return line.astype(np.int32), column.astype(np.int32)


class _Gaps:
    """What stands between points and is none, reported as it is come by."""

    def __init__(self, block: PointBlock, text: str, normals: bool, report: Report) -> None:
        self.block, self.text, self.report = block, text, report
        self.pieces = _PIECES if normals else _BARE_PIECES
        self.hint = _HINT if normals else _BARE_HINT
        self.end = 0
        self.found = 0

    def look(self, matches: list[re.Match[str]]) -> None:
        """Look at the gaps before and between `matches`, which follow those of the last call."""
        begins = np.fromiter((m.start() for m in matches), np.int64, len(matches))
        ends = np.fromiter((m.end() for m in matches), np.int64, len(matches))
        before = np.concatenate([[self.end], ends[:-1]]) if len(ends) else ends
        for index in np.flatnonzero(before != begins).tolist():
            self._gap(int(before[index]), int(begins[index]))
        self.end = int(ends[-1]) if len(ends) else self.end

    def finish(self) -> None:
        """Look at what follows the last point."""
        self._gap(self.end, len(self.text))

    def _gap(self, start: int, stop: int) -> None:
        """One message for every malformed point of a gap."""
        while self.found <= NAMED_ROWS and self.text[start:stop].strip():
            self.found += 1
            if self.found > NAMED_ROWS:
                message = "more points of this block are malformed; mend those above first"
                blank = _BLANK.match(self.text, start, stop)
                at = self.block.start + (blank.end() if blank else start)
                self.report.error("E301", message, self.block.source.span(at, at + 1))
                return
            begin = _BEGIN.search(self.text, self._report(start), stop)
            start = begin.start() if begin else stop

    def _report(self, start: int) -> int:
        """Report the point that begins at `start`; the offset up to which it was understood."""
        text, source = self.text, self.block.source
        at, behind, wanted = _explain(text, start, self.pieces)
        character = text[at : at + 1]
        if character and is_strange(character):
            code, message = (
                "E110",
                f"a character that a point cannot have: {said_character(character)}",
            )
            shown, length, hint = at, 1, meant(character) or self.hint
        else:
            word = _WORD.match(text, at)
            found = f'"{word[0][:40]}"' if word else "the end of the block"
            code, message = "E301", f"expected {wanted}, found {found}"
            shown, length, hint = at, len(word[0]) if word else 1, self.hint
            if wanted.startswith('")"') and character == ",":
                hint += "; numbers have a decimal point"
        if (start < behind and "\n" in text[behind:at]) or at == len(text):
            # What is missing is missing behind the last good piece, not on some later line.
            shown, length = max(behind - 1, start), 1
        span = source.span(self.block.start + shown, self.block.start + shown + length)
        self.report.error(code, message, span, hint=hint)
        return max(behind, start)


_HINT = "a point is written: P1 (240, 2379, -542) normal (-0.233, -0.012, 0.972)"
_BARE_HINT = "a point is written: P1 (240, 2379, -542); its normal is taken from the part's surface"


def _explain(
    text: str, at: int, pieces: Sequence[tuple[re.Pattern[str], str]]
) -> tuple[int, int, str]:
    """Where the point that begins at `at` goes wrong, where its last good piece ends, and what
    should stand there."""
    behind = at
    for pattern, wanted in pieces:
        blank = _BLANK.match(text, at)
        at = blank.end() if blank else at
        match = pattern.match(text, at)
        if not match:
            return at, behind, wanted
        behind = at = match.end()
    return at, behind, "the next point"
