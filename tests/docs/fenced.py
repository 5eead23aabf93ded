"""The fenced blocks of a document in `docs/`, for the tests that run them.

A block begins with ```` ```LANGUAGE WORD … ````. A word is a flag (`given`) or `key=value`
(`file=cells/a.cell`, `error=E203`); the document says what they mean.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"

_BLOCK = re.compile(r"^```(\w+)([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_INLINE = re.compile(r"`([^`\n]+)`")


@dataclass(frozen=True)
class Block:
    """One fenced block; `line` is where its text begins in the document."""

    language: str
    words: dict[str, str]
    text: str
    line: int

    @property
    def file(self) -> str | None:
        return self.words.get("file")


def document(name: str) -> str:
    """The text of `docs/NAME`."""
    return (DOCS / name).read_text(encoding="utf-8")


def blocks(text: str) -> list[Block]:
    """All fenced blocks, in order."""
    found = []
    for match in _BLOCK.finditer(text):
        words = dict(word.partition("=")[::2] for word in match[2].split())
        line = text.count("\n", 0, match.start(3)) + 1
        found.append(Block(match[1], words, match[3], line))
    return found


def code(text: str) -> str:
    """Everything that the document sets as code: fenced blocks and inline code."""
    fenced = "\n".join(block.text for block in blocks(text))
    return fenced + "\n" + "\n".join(_INLINE.findall(_BLOCK.sub("", text)))
