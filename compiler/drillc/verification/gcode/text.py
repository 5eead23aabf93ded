"""The lines of a G-code file as LinuxCNC sees them: in lower case, without blanks and comments.

Lines that differ only in numbers have one *shape*, so that it is parsed once; a file is then a row
of shapes, and its numbers in one array.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..reading import Finding, ReadError

#: LinuxCNC refuses longer lines, counted without the line end.
LONGEST_LINE = 252
#: Stands for a number in a shape; for a comment that tells the operator something; and for another
#: comment between words, which it keeps apart.
SLOT, MESSAGE, GAP = "\x01", "\x03", "\x04"

_COMMENT = re.compile(r"\(([^()\n]*)\)|;[^\n]*")
#: A line that is nothing but a comment, which tells the operator nothing: most of them are.
_ALONE = re.compile(
    r"^[ \t]*\((?![ \t]*(?:msg|debug|print)[ \t]*,)[^()\n]*\)(?=[ \t]*\r?$)", re.I | re.M
)
_TELLS = re.compile(r"[ \t]*(msg|debug|print)[ \t]*,", re.IGNORECASE)
# Not after g, m, o and #, whose numbers say what is done; nor within <a name>.
_NUMBER = re.compile(r"(?<=[a-fh-lnp-z\[=*/+\-])([+-]?(?:\d+\.?\d*|\.\d+))(?![^<>\n]*>)")
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f]")
_BLANKS = str.maketrans("", "", " \t\r")


@dataclass(frozen=True, eq=False)
class Lines:
    """The lines of a file that say anything.

    `shape` indexes `shapes`; `number` are the lines' numbers from 1; `start` says where a line's
    numbers begin in `values`. `raw` are all lines as they stand in the file.
    """

    file: int
    raw: Sequence[str]
    shapes: Sequence[str]
    shape: NDArray[np.intp]
    number: NDArray[np.int32]
    start: NDArray[np.intp]
    values: NDArray[np.float64]
    percent: bool  # the program is between two lines with %

    def error(self, row: int, position: int, message: str) -> ReadError:
        """An error at a character of the shape of a row."""
        line = int(self.number[row])
        return ReadError(self.file, line, column_of(self.raw[line - 1], position), message)


def lines_of(file: int, data: bytes, findings: list[Finding]) -> Lines:
    """The lines of a file. Raises ReadError; adds to `findings`."""
    text = data.decode("latin-1")
    raw = text.split("\n")
    _check_characters(file, text, raw, findings)
    text = _COMMENT.sub(_comment, _ALONE.sub("", text)).translate(_BLANKS).lower()
    pieces = _NUMBER.split(text)
    shaped = SLOT.join(pieces[::2]).split("\n")
    percent = _cut_at_percent(file, raw, shaped, findings)
    shapes = list(dict.fromkeys(shaped))
    known = {shape: index for index, shape in enumerate(shapes)}
    ids = np.fromiter(map(known.__getitem__, shaped), np.intp, len(shaped))
    for wrong in "()":
        for shape in shapes:
            if wrong in shape:
                _refuse_parenthesis(file, raw, shaped.index(shape))
    held = np.array([shape.count(SLOT) for shape in shapes], dtype=np.intp)[ids]
    start = np.concatenate([[0], np.cumsum(held)])
    values = np.fromiter(map(float, pieces[1::2]), np.float64)[: start[-1]]
    says = np.flatnonzero(np.array([bool(shape) for shape in shapes])[ids])
    return Lines(
        file,
        raw,
        shapes,
        ids[says],
        (says + 1).astype(np.int32),
        start[says],
        values,
        percent,
    )


def column_of(raw: str, position: int) -> int:
    """The column, from 1, in a line as it stands of a character of its shape."""
    comments = {match.start(): match for match in _COMMENT.finditer(raw)}
    kept: list[int] = []  # columns of the characters that are left
    text = ""
    i = 0
    while i < len(raw):
        if i in comments:
            told = _comment(comments[i])
            kept += [i] * len(told)
            text += told
            i = comments[i].end()
            continue
        if raw[i] not in " \t\r":
            kept.append(i)
            text += raw[i].lower()
        i += 1
    shaped: list[int] = []
    last = 0
    for match in _NUMBER.finditer(text):
        shaped += [*kept[last : match.start()], kept[match.start()]]
        last = match.end()
    shaped += kept[last:]
    return 1 + (shaped[position] if position < len(shaped) else len(raw.rstrip()))


def _comment(match: re.Match[str]) -> str:
    """What is left of a comment."""
    inside = match[1]
    if inside is None:
        return ""
    if _TELLS.match(inside):
        return MESSAGE
    start, end, text = match.start(), match.end(), match.string
    ends = end == len(text) or text[end] in "\r\n"
    return "" if ends or start == 0 or text[start - 1] == "\n" else GAP


def _check_characters(file: int, text: str, raw: Sequence[str], findings: list[Finding]) -> None:
    if _CONTROL.search(text):
        for number, line in enumerate(raw, 1):
            for column, c in enumerate(line, 1):
                if ord(c) < 32 and c not in "\r\t":
                    raise ReadError(file, number, column, f"a control character ({ord(c)})")
    if not text.isascii():
        number, line = next((n, line) for n, line in enumerate(raw, 1) if not line.isascii())
        column = next(i for i, c in enumerate(line, 1) if not c.isascii())
        findings.append(Finding("rules", file, number, column, "a character that is not ASCII"))
    if max(map(len, raw)) > LONGEST_LINE:
        for number, line in enumerate(raw, 1):
            if len(line) > LONGEST_LINE:
                raise ReadError(
                    file,
                    number,
                    LONGEST_LINE + 1,
                    f"the line has {len(line)} characters; LinuxCNC takes {LONGEST_LINE}",
                )


def _refuse_parenthesis(file: int, raw: Sequence[str], index: int) -> None:
    line = raw[index]
    opened = line.find("(")
    nested = line.find("(", opened + 1)
    if opened < 0 or 0 <= line.find(")") < opened:
        raise ReadError(
            file, index + 1, line.find(")") + 1, "a comment is closed, but none is open"
        )
    if nested >= 0 and not 0 <= line.find(")", opened) < nested:
        raise ReadError(file, index + 1, nested + 1, "a comment within a comment")
    left = _COMMENT.sub(lambda match: " " * len(match[0]), line)
    column = max(left.find("("), left.find(")")) + 1
    raise ReadError(file, index + 1, column, "a comment is not closed, or none is open")


def _cut_at_percent(
    file: int, raw: Sequence[str], shaped: list[str], findings: list[Finding]
) -> bool:
    """Whether the program is between two lines with %; what stands after them is dropped."""
    first = next((i for i, line in enumerate(shaped) if line), None)
    if first is None or shaped[first] != "%":
        return False
    shaped[first] = ""
    second = next((i for i in range(first + 1, len(shaped)) if shaped[i] == "%"), None)
    if second is None:
        return True
    for i in range(second + 1, len(shaped)):
        if shaped[i]:
            findings.append(Finding("rules", file, i + 1, 1, "after the second % nothing is read"))
            break
    shaped[second:] = [""] * (len(shaped) - second)
    return True
