"""Finds stretches of lines that differ only in their numbers, so that they are parsed once.

A *slot* stands for a number or a name that may differ from line to line; a line with slots in their
places is its shape. A grammar knows slots as one more kind of number and name, so the one grammar
reads single lines and whole stretches alike.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

#: What a slot looks like in a shape; numbered, `\x01` or `\x02` stands on both sides of its number.
NUMBER_SLOT, NAME_SLOT = "\x01", "\x02"
#: Fewer lines than this are not worth it.
LEAST = 8
#: A stretch may repeat so many lines at a time.
MOST_LINES = 4
_SLOT = re.compile("[\x01\x02]")
#: A shape that has come so often is looked for before a line is taken apart.
_OFTEN = 4
#: Slots next to what could be part of a number or name: the shape does not tell where they end.
_TOUCHED = re.compile("[\x01\x02][\\w.\x01\x02]")

Shape = tuple[str, Sequence[str]]


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


def shapes_by(token: re.Pattern[str], names: Collection[str]) -> Callable[[str], Shape]:
    """A function from a line to its shape, and what its slots hold.

    `token` has the groups `number` and `name`; whatever else it matches (texts, say) stays. A name
    becomes a slot only if it is in `names`, which hold upper case.
    """

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

    times: dict[str, int] = {}
    often: list[_Often] = []

    def shape(line: str) -> Shape:
        for place, known in enumerate(often):
            match = known.pattern.fullmatch(line)
            if match is None:
                continue
            held = match.groups()
            if all(held[k].upper() in names for k in known.name_slots):
                if place:
                    often.insert(0, often.pop(place))
                return known.shape, held
        shown, slots = taken_apart(line)
        times[shown] = times.get(shown, 0) + 1
        if times[shown] == _OFTEN and slots and not _TOUCHED.search(shown):
            often.insert(0, _often(shown))
            del often[MOST_LINES:]
        return shown, slots

    return shape


@dataclass(frozen=True, eq=False)
class _Often:
    """A shape as a pattern with a group for each slot."""

    shape: str
    pattern: re.Pattern[str]
    name_slots: tuple[int, ...]


def _often(shape: str) -> _Often:
    slots = _SLOT.findall(shape)
    groups = {NUMBER_SLOT: r"(-?\d+(?:\.\d+)?)", NAME_SLOT: r"([A-Za-z_]\w*)"}
    parts = re.split("([\x01\x02])", shape)
    pattern = "".join(groups.get(part) or re.escape(part) for part in parts)
    name_slots = tuple(k for k, slot in enumerate(slots) if slot == NAME_SLOT)
    return _Often(shape, re.compile(pattern), name_slots)


def stretches(lines: Sequence[str], shape: Callable[[str], Shape]) -> list[Stretch]:
    """All stretches, in order. Control characters in a line keep it out of all stretches."""
    known: dict[str, int] = {}
    held: list[Sequence[str]] = []
    ids = np.empty(len(lines), dtype=np.int64)
    for i, line in enumerate(lines):
        if NUMBER_SLOT in line or NAME_SLOT in line:
            ids[i] = -1 - i
            held.append(())
            continue
        shown, slots = shape(line)
        ids[i] = known.setdefault(shown, len(known))
        held.append(slots)
    texts = list(known)
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
