"""Pouring: columns through the formats of a rendered template, a block of rows at a time.

What each block did to the lines is noted on the way, so that whoever asks later which row a line
belongs to need not look at the text again.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from drillc.output.marks import Mark
from drillc.output.numbers import Column

#: Rows that are formatted at once: large enough that `%` dominates, small enough for the cache.
BLOCK_ROWS = 2048
#: Small pieces are joined until a chunk has about this many characters.
CHUNK_CHARACTERS = 1 << 18

#: What the rows of a body are; the word that a template's author has for one of them.
Table = Literal["hole", "via"]


@dataclass(frozen=True)
class Rows:
    """The holes, or vias, `start` … `stop`. True when there are any."""

    start: int
    stop: int
    table: Table = "hole"

    def __len__(self) -> int:
        return max(0, self.stop - self.start)


@dataclass(frozen=True)
class Body:
    """The text of one `per_hole` or `per_via` block: a %-format for one row, its columns, and its
    rows."""

    format: str
    columns: tuple[str, ...]
    rows: Rows


#: How each row (b, 2) of a block breaks lines: how often, and whether it ends with a break (-1: the
#: row is empty). None where every row breaks them as the body's format does, and ends as that does.
Breaks = NDArray[np.int32] | None


@dataclass(frozen=True, eq=False)
class StagedText:
    """A rendered template with its bodies still to be poured; can be iterated again and again."""

    parts: tuple[str | Body | Mark, ...]
    tables: Mapping[Table, Mapping[str, Column]]
    # Noted as blocks are poured, by part and first row, so that nobody has to pour them for it.
    _breaks: dict[tuple[int, int], Breaks] = field(default_factory=dict, init=False, repr=False)

    def __iter__(self) -> Iterator[bytes]:
        """The text as chunks of ASCII, never the whole file at once."""
        waiting: list[str] = []
        size = 0
        for piece in self._pieces():
            waiting.append(piece)
            size += len(piece)
            if size >= CHUNK_CHARACTERS:
                yield "".join(waiting).encode("ascii")
                waiting.clear()
                size = 0
        if waiting:
            yield "".join(waiting).encode("ascii")

    def breaks(self, index: int) -> Iterator[tuple[Rows, Breaks]]:
        """The body that is part `index`, block by block: its rows, and how they break lines."""
        body = self.parts[index]
        assert isinstance(body, Body)
        for start in range(body.rows.start, body.rows.stop, BLOCK_ROWS):
            if (index, start) not in self._breaks:
                self._poured(index, body, start)
            rows = replace(body.rows, start=start, stop=min(start + BLOCK_ROWS, body.rows.stop))
            yield rows, self._breaks[index, start]

    def _pieces(self) -> Iterator[str]:
        for index, part in enumerate(self.parts):
            if isinstance(part, str):
                yield part
            elif isinstance(part, Body):
                for start in range(part.rows.start, part.rows.stop, BLOCK_ROWS):
                    yield self._poured(index, part, start)

    def _poured(self, index: int, body: Body, start: int) -> str:
        """The body's text for the block of rows that begins at `start`."""
        columns, width = self.tables[body.rows.table], len(body.columns)
        stop = min(start + BLOCK_ROWS, body.rows.stop)
        flat: list[object] = [None] * (width * (stop - start))
        for place, name in enumerate(body.columns):
            flat[place::width] = columns[name].cells(start, stop)
        text = (body.format * (stop - start)) % tuple(flat)
        self._breaks[index, start] = _row_breaks(body.format, flat, stop - start, text)
        return text


def _row_breaks(format_: str, flat: Sequence[object], count: int, text: str) -> Breaks:
    """How the rows of `text` break lines. Cells may hold line breaks, and be empty."""
    last = format_.rpartition("\n")[2]
    if "%" not in last and text.count("\n") == format_.count("\n") * count:
        return None
    width = len(flat) // count
    rows = [format_ % tuple(flat[width * i : width * (i + 1)]) for i in range(count)]
    ends = [int(row.endswith("\n")) if row else -1 for row in rows]
    return np.array([[row.count("\n") for row in rows], ends], dtype=np.int32).T
