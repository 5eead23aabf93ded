"""Shapes of lines: what stays of a line without its numbers and the names of positions."""

from __future__ import annotations

import re
from collections.abc import Set

from ..alike import NAME_SLOT, NUMBER_SLOT, Shape, Shapes

_DIGITS = r"(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?(?![A-Za-z0-9_.])"
#: A sign belongs to its number behind one of these; elsewhere it is that of a sum.
_BEFORE_SIGN = "[,(="
_NUMBER = re.compile(rf"((?:(?<=[\[,(=])\s*-)?(?<![A-Za-z0-9_.]){_DIGITS})")
_WORD = re.compile(r"(?<![A-Za-z0-9_.])([A-Za-z]\w*)")
#: An axis that a position says nothing of: as good as a word, and six of them in most lines.
_NO_AXIS = "9E+09"


def shapes(names: Set[str]) -> Shapes:
    """`names`: which names become slots, in capital letters. A line with a text has no slots, for
    the text may hold numbers."""

    def apart(line: str) -> Shape:
        if '"' in line:
            return line, ()
        pieces = _NUMBER.split(line)
        numbers = [number for number in pieces[1::2] if number != _NO_AXIS]
        pieces[1::2] = [_NO_AXIS if n == _NO_AXIS else NUMBER_SLOT for n in pieces[1::2]]
        words = _WORD.split("".join(pieces))
        held, used = [], 0
        for i in range(0, len(words), 2):
            count = words[i].count(NUMBER_SLOT)
            held += numbers[used : used + count]
            used += count
            if i + 1 < len(words) and words[i + 1].upper() in names:
                held.append(words[i + 1])
                words[i + 1] = NAME_SLOT
        return "".join(words), held

    return Shapes(apart, names, _BEFORE_SIGN)
