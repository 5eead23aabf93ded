"""Finds stretches of lines that differ only in their numbers, so that they are parsed once.

A *slot* stands for a number or a name that may differ from line to line; a line with slots in their
places is its shape. A grammar knows slots as one more kind of number and name, so the one grammar
reads single lines and whole stretches alike.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from itertools import accumulate, chain

import numpy as np
from numpy.typing import NDArray

#: What a slot looks like in a shape; numbered, `\x01` or `\x02` stands on both sides of its number.
NUMBER_SLOT, NAME_SLOT = "\x01", "\x02"
#: Fewer lines than this are not worth it.
LEAST = 8
#: A stretch may repeat so many lines at a time.
MOST_LINES = 4
_SLOT = re.compile("[\x01\x02]")
#: Slots next to what could be part of a number or name: the shape does not tell where they end.
_TOUCHED = re.compile("[\x01\x02][\\w.\x01\x02]")

#: A line with slots in the places of numbers and names, and what stands there.
Shape = tuple[str, Sequence[str]]


@dataclass(frozen=True, eq=False)
class Shapes:
    """What shape lines have. `apart` takes a line apart; names become slots only if `names` holds
    them, in upper case. A minus sign is part of a number behind one of `before_sign`, or anywhere
    (None); elsewhere it is that of a difference."""

    apart: Callable[[str], Shape]
    names: Collection[str]
    before_sign: str | None = None


@dataclass(frozen=True, eq=False)
class Stretch:
    """`count` times the lines `text`, from line `first` (from 1) on.

    The slots in `text` are numbered through: `\\x01` and a number and `\\x01` for a number, with
    `\\x02` for a name. `columns` has what stands in each slot, a text for each repetition.
    """

    first: int
    count: int
    text: tuple[str, ...]
    columns: tuple[tuple[str, ...], ...]

    def lines(self) -> NDArray[np.int32]:
        """Line numbers (count, len(text))."""
        each = len(self.text)
        return self.first + np.arange(self.count * each, dtype=np.int32).reshape(self.count, each)

    def numbers(self, slot: int) -> NDArray[np.float64]:
        """The numbers (count,) in a slot."""
        column = self.columns[slot]
        return np.fromiter(map(float, column), dtype=np.float64, count=len(column))


def shapes_by(token: re.Pattern[str], names: Collection[str]) -> Shapes:
    """The shapes of a language whose `token` has the groups `number` and `name`; whatever else it
    matches (texts, say) stays."""

    def taken_apart(line: str) -> Shape:
        held: list[str] = []

        def slot(match: re.Match[str]) -> str:
            text = match.group()
            if match.lastgroup == "number":
                held.append(text)
                return NUMBER_SLOT
            if match.lastgroup == "name" and text.upper() in names:
                held.append(text)
                return NAME_SLOT
            return text

        return token.sub(slot, line), held

    return Shapes(taken_apart, names)


def stretches(lines: Sequence[str], shapes: Shapes) -> list[Stretch]:
    """All stretches, in order. Control characters in a line keep it out of all stretches."""
    texts, ids, held = _apart(lines, shapes)
    alike = [_alike_from(ids, period).tolist() for period in range(1, MOST_LINES + 1)]
    found, i = [], 0
    while i < len(lines):
        best = 0
        for period in range(1, MOST_LINES + 1):
            count = alike[period - 1][i] // period + 1
            has_slots = any(held[i : i + period])
            if count >= LEAST and has_slots:
                best = period
                break
        if not best:
            i += 1
            continue
        text = _numbered([texts[k] for k in ids[i : i + best]])
        rows = held[i : i + count]
        if best > 1:
            rows = [
                [value for slots in held[start : start + best] for value in slots]
                for start in range(i, i + count * best, best)
            ]
        found.append(Stretch(i + 1, count, text, tuple(zip(*rows, strict=True))))
        i += count * best
    return found


def _apart(
    lines: Sequence[str], shapes: Shapes
) -> tuple[list[str], NDArray[np.int64], list[Sequence[str]]]:
    """All lines taken apart: the shapes that there are, which of them each line has (below 0: one
    of its own), and what its slots hold."""
    known: dict[str, int] = {}
    ids: list[int] = []
    held: list[Sequence[str]] = []
    text = "\n".join(lines) + "\n"
    blocks: dict[tuple[str, ...], re.Pattern[str] | None] = {}
    shown: list[str] = []  # the shapes of the last lines
    start = 0
    while len(ids) < len(lines):
        line = lines[len(ids)]
        start += len(line) + 1
        if NUMBER_SLOT in line or NAME_SLOT in line:
            ids.append(-1 - len(ids))
            held.append(())
            shown.clear()
            continue
        shape, slots = shapes.apart(line)
        ids.append(known.setdefault(shape, len(known)))
        held.append(slots)
        shown = [*shown[1 - 2 * MOST_LINES :], shape]
        for period in range(1, MOST_LINES + 1):
            block = tuple(shown[-period:])
            if len(shown) < 2 * period or block != tuple(shown[-2 * period : -period]):
                continue
            if block not in blocks:
                blocks[block] = _block(block, shapes)
            if (pattern := blocks[block]) is not None:
                start = _in_bulk(block, pattern, text, start, shapes, ids, held)
                break
    return list(known), np.array(ids, dtype=np.int64), held


def _in_bulk(
    block: Sequence[str],
    pattern: re.Pattern[str],
    text: str,
    start: int,
    shapes: Shapes,
    ids: list[int],
    held: list[Sequence[str]],
) -> int:
    """Take apart all lines of `text` from `start` on that repeat a block of shapes, whose ids are
    the last ones. Returns where they end."""
    slots = [_SLOT.findall(shape) for shape in block]
    stops, rows = [start], []
    for match in pattern.finditer(text, start):
        if match.lastindex is None:
            break
        stops.append(match.end())
        rows.append(match.groups())
    count = len(rows)
    for column, slot in enumerate(chain(*slots)):
        if slot == NAME_SLOT:
            known = [row[column].upper() in shapes.names for row in rows[:count]]
            count = count if all(known) else known.index(False)
    del rows[count:]
    ids += ids[-len(block) :] * count
    if len(block) == 1:
        held += rows
    else:
        ends = list(accumulate(map(len, slots)))
        parts = [slice(end - len(own), end) for end, own in zip(ends, slots, strict=True)]
        held += [row[part] for row in rows for part in parts]
    return stops[count]


def _block(block: Sequence[str], shapes: Shapes) -> re.Pattern[str] | None:
    """Matches lines that have the shapes of a block, with a group for each slot, and else any one
    character without a group. None if the shapes do not tell all."""
    if not any(map(_SLOT.search, block)) or any(map(_TOUCHED.search, block)):
        return None
    made = ""
    for shape in block:
        before = ""
        for piece in re.split("([\x01\x02])", shape):
            if piece == NUMBER_SLOT:
                signed = shapes.before_sign is None or (before and before in shapes.before_sign)
                made += rf"({'-?' if signed else ''}\d++(?:\.\d++)?+)"
            elif piece == NAME_SLOT:
                made += r"([A-Za-z_]\w*+)"
            else:
                made += re.escape(piece)
            before = piece[-1:]
        made += "\n"
    return re.compile(f"{made}|.", re.DOTALL)


def without(lines: Sequence[str], found: Sequence[Stretch], mark: Callable[[int], str]) -> str:
    """The text with each stretch replaced by `mark(its index)` and empty lines, so that all other
    lines keep their numbers."""
    kept = list(lines)
    for index, stretch in enumerate(found):
        first = stretch.first - 1
        size = stretch.count * len(stretch.text)
        kept[first : first + size] = [mark(index), *[""] * (size - 1)]
    return "\n".join(kept) + "\n"


def _alike_from(ids: NDArray[np.int64], period: int) -> NDArray[np.int64]:
    """For each line, how many lines from it on are like the line `period` later, without a gap."""
    n = len(ids)
    alike = np.zeros(n, dtype=bool)
    if n > period:
        alike[: n - period] = (ids[:-period] == ids[period:]) & (ids[:-period] >= 0)
    ends = np.where(alike, n, np.arange(n))
    following = np.minimum.accumulate(ends[::-1])[::-1] if n else ends
    return following - np.arange(n)


def _numbered(texts: Sequence[str]) -> tuple[str, ...]:
    count = 0

    def number(match: re.Match[str]) -> str:
        nonlocal count
        count += 1
        return f"{match.group()}{count - 1}{match.group()}"

    return tuple(_SLOT.sub(number, text) for text in texts)
