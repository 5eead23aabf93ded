"""Shapes of lines: what stays of a line without its numbers and the names of positions.

Most lines are shaped like the line before. So a shape, once seen, becomes a pattern, and the next
line is matched with it before it is taken apart.
"""

from __future__ import annotations

import re
from collections.abc import Set
from dataclasses import dataclass, field

from ..alike import NAME_SLOT, NUMBER_SLOT, Shape

_DIGITS = r"(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?(?![A-Za-z0-9_.])"
#: A sign belongs to its number behind one of these; elsewhere it is that of a sum.
_BEFORE_SIGN = "[,(="
_NUMBER = re.compile(rf"((?:(?<=[\[,(=])\s*-)?(?<![A-Za-z0-9_.]){_DIGITS})")
_WORD = re.compile(r"([A-Za-z]\w*)")
_SLOT = re.compile(f"([{NUMBER_SLOT}{NAME_SLOT}])")


@dataclass(eq=False)
class Shapes:
    """The shape of a line and what is in its slots. `names`: which names become slots, in capital
    letters. A line with a text has no slots, for the text may hold numbers."""

    names: Set[str]
    _last: re.Pattern[str] | None = None
    _shown: str = ""
    _words: tuple[int, ...] = ()
    _patterns: dict[str, re.Pattern[str]] = field(default_factory=dict)

    def __call__(self, line: str) -> Shape:
        if self._last is not None and (match := self._last.fullmatch(line)):
            held = match.groups()
            for i in self._words:
                if held[i].upper() not in self.names:
                    break
            else:
                return self._shown, held
        if '"' in line:
            return line, ()
        return self._apart(line)

    def _apart(self, line: str) -> Shape:
        pieces = _NUMBER.split(line)
        held = pieces[1::2]
        words = _WORD.split(NUMBER_SLOT.join(pieces[::2]))
        before, found = 0, []
        for i in range(1, len(words), 2):
            before += words[i - 1].count(NUMBER_SLOT)
            if words[i].upper() in self.names:
                held.insert(before, words[i])
                found.append(before)
                before += 1
                words[i] = NAME_SLOT
        shown = "".join(words)
        if held:
            if shown not in self._patterns:
                self._patterns[shown] = _pattern(shown)
            self._last, self._shown = self._patterns[shown], shown
            self._words = tuple(found)
        return shown, tuple(held)


def _pattern(shown: str) -> re.Pattern[str]:
    """Matches the lines that have a shape, with a group for each slot."""
    made, before = "", ""
    for piece in _SLOT.split(shown):
        if piece == NUMBER_SLOT:
            signed = before and before[-1] in _BEFORE_SIGN
            made += rf"((?:\s*-)?{_DIGITS})" if signed else f"({_DIGITS})"
        elif piece == NAME_SLOT:
            made += r"([A-Za-z]\w*)"
        else:
            made += re.escape(piece)
            before = piece
    return re.compile(made)
