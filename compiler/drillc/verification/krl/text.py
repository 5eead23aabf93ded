"""Program text as lines of code: comments gone, columns kept, and the rules for plain text."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from drillc.verification.reading import Finding

from .words import LINE_LENGTH, MOST_BYTES, NAME_LENGTH, TEXT_LENGTH

_COMMENT = re.compile(r"[ \t]*;[^\n]*")
_COMMENT_OR_TEXT = re.compile(r'("[^"\n]*")|[ \t]*;[^\n]*')
_HEADER = re.compile(r"^&[^\n]*", re.MULTILINE)
_FOLD = re.compile(r"^[ \t]*;[ \t]*(END)?FOLD\b", re.MULTILINE | re.IGNORECASE)
_LONG = re.compile(rf'"[^"\n]*"|(?<![\w$])[#$]?[A-Za-z_][\w$]{{{NAME_LENGTH},}}')
_BARE_LINE_END = re.compile(r"(?<!\r)\n|\r(?!\n)")
_STRANGE = re.compile(r"[^\x00-\x7f]")


@dataclass(frozen=True, eq=False)
class Text:
    """A file. `code` are its lines without comments and without what is before `DEF`."""

    file: int
    stem: str
    code: list[str]
    findings: list[Finding]


def read_text(file: int, path: str, raw: bytes) -> Text:
    """The lines of a file, whatever rules it breaks."""
    whole = raw.decode("latin-1")
    plain = whole.replace("\r\n", "\n").replace("\r", "\n")
    code = _without_comments(_HEADER.sub("", plain) if "&" in plain else plain)
    lines = code.split("\n")
    stem = path.rsplit("/", 1)[-1].rsplit(".", 1)[0]
    found = [
        Finding("rules", file, line, column, message)
        for line, column, message in (
            *_of_text(whole, plain),
            *_folds(plain),
            *_lengths(code, lines),
        )
    ]
    if len(raw) > MOST_BYTES:
        size = f"{len(raw) / 1e6:.1f} MB are more than {MOST_BYTES / 1e6:.0f} MB"
        found.append(Finding("rules", file, 1, 1, f"{size}, which a controller may not load"))
    return Text(file, stem, lines, found)


def _without_comments(text: str) -> str:
    if '"' in text:
        return _COMMENT_OR_TEXT.sub(r"\1", text)
    return _COMMENT.sub("", text)


_Found = Iterator[tuple[int, int, str]]


def _of_text(whole: str, plain: str) -> _Found:
    if whole.count("\n") == whole.count("\r") == whole.count("\r\n"):
        match = None
    else:
        match = _BARE_LINE_END.search(whole)
    if match is not None:
        line = len(
            _BARE_LINE_END.sub("\n", whole[: match.start()].replace("\r\n", "\n")).split("\n")
        )
        yield line, 1, "the line does not end in CR and LF, as lines of the controller do"
    elif whole and not whole.endswith("\n"):
        yield plain.count("\n") + 1, 1, "the last line has no end"
    if not plain.isascii() and (match := _STRANGE.search(plain)):
        line, column = _place(plain, match.start())
        yield line, column, f"the character {match.group()!a} is not plain ASCII"


def _folds(plain: str) -> _Found:
    """Folds are the editor's, but a module with one that is left open is shown as one line."""
    open_at: list[int] = []
    for match in _FOLD.finditer(plain):
        line, column = _place(plain, match.start())
        if not match[1]:
            open_at.append(line)
        elif open_at:
            open_at.pop()
        else:
            yield line, column, "ENDFOLD closes no fold"
    for line in open_at:
        yield line, 1, "the fold is not closed"


def _lengths(code: str, lines: list[str]) -> _Found:
    # most files have nothing that is so long, which is quickly seen
    may_be_long = max(map(len, code.split()), default=0) > NAME_LENGTH or '"' in code
    for match in _LONG.finditer(code) if may_be_long else ():
        text = match.group()
        if text.startswith('"'):
            if len(text) - 2 > TEXT_LENGTH:
                line, column = _place(code, match.start())
                yield line, column, f"the text has {len(text) - 2} characters, of {TEXT_LENGTH}"
        else:
            name = text.lstrip("#$")
            if len(name) > NAME_LENGTH:
                line, column = _place(code, match.start())
                yield line, column, f"{name} has {len(name)} characters, of {NAME_LENGTH}"
    if max(map(len, lines)) > LINE_LENGTH:
        for number, text in enumerate(lines, 1):
            if len(text) > LINE_LENGTH:
                yield number, LINE_LENGTH, f"the line has more than {LINE_LENGTH} characters"


def _place(text: str, offset: int) -> tuple[int, int]:
    before = text.rfind("\n", 0, offset)
    return text.count("\n", 0, offset) + 1, offset - before
