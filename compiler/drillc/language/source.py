"""Source files and places in them. A place is numbers; text is looked up only to draw it."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True)
class Span:
    """A stretch of one line: `line` and `column` count from 1, `length` in characters."""

    source: Source
    line: int
    column: int
    length: int = 1


@dataclass(frozen=True, eq=False)
class Source:
    """A file that was read. `text` is empty for one that is no text, such as a mesh.

    `shown` is its path as a person would type it, for messages. `key` is its path below the root
    and `sha256` the hash of its bytes, for the manifest: neither depends on where the tree lies.
    """

    path: Path
    shown: str
    text: str
    key: str = ""
    sha256: str = ""
    _line_starts: list[int] = field(default_factory=list, init=False, repr=False)

    def line_starts(self) -> list[int]:
        """Offsets at which each line begins (computed once, when first asked for)."""
        if not self._line_starts:
            starts = [0]
            find, at = self.text.find, 0
            while (at := find("\n", at) + 1) > 0:
                starts.append(at)
            self._line_starts.extend(starts)
        return self._line_starts

    def span(self, start: int, end: int) -> Span:
        """The span from offset `start` to `end`, cut at the end of its first line."""
        starts = self.line_starts()
        line = bisect_right(starts, start)
        begin = starts[line - 1]
        stop = starts[line] - 1 if line < len(starts) else len(self.text)
        return Span(self, line, start - begin + 1, max(1, min(end, stop) - start))

    def line_text(self, line: int) -> str:
        """The text of line `line` (from 1), without its end; empty when there is no such line."""
        starts = self.line_starts()
        if not 1 <= line <= len(starts):
            return ""
        end = starts[line] - 1 if line < len(starts) else len(self.text)
        return self.text[starts[line - 1] : end].rstrip("\r")
