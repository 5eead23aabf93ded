"""The text of a module as lines: what the controller asks of them, whatever they say."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from ..reading import Finding

#: As many characters a text may have.
STRING_LENGTH = 80

_COMMENT = re.compile(r'((?:[^"!]|"[^"]*")*)!')
_STRING = re.compile(r'"((?:[^"]|"")*)"')
_STRANGE = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f]")
_CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f]")
#: What stands before some saved modules: %%% VERSION:1 LANGUAGE:ENGLISH %%%.
_HEADER = re.compile(r"\s*%%%.*?%%%", re.DOTALL)
_BOM = b"\xef\xbb\xbf"


@dataclass(frozen=True)
class Lines:
    """Lines of a file without their comments, and the rules that they break. Columns are as they
    stand in the file."""

    code: Sequence[str]
    findings: Sequence[Finding]


def split(file: int, raw: bytes) -> Lines:
    """The lines of file number `file`."""
    findings: list[Finding] = []

    def finding(line: int, column: int, message: str) -> None:
        findings.append(Finding("rules", file, line, column, message))

    if raw.startswith(_BOM):
        finding(1, 1, "the file begins with a byte order mark, which the controller does not read")
        raw = raw[len(_BOM) :]
    text = raw.decode("latin-1")
    if text.count("\n") != text.count("\r\n"):
        bare = next(
            number
            for number, line in enumerate(text.split("\n"), 1)
            if number <= text.count("\n") and not line.endswith("\r")
        )
        finding(bare, 1, "the line does not end in CRLF")
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    strange = _STRANGE
    if not raw.isascii() and _is_utf8(raw):
        first = next(i for i, part in enumerate(text.split("\n"), 1) if not part.isascii())
        finding(first, 1, "the file is in UTF-8; the controller reads ISO-8859-1")
        strange = _CONTROL
    if header := _HEADER.match(text):
        text = re.sub(r"[^\n]", " ", header.group()) + text[header.end() :]
    if found := strange.search(text):
        place = text.count("\n", 0, found.start()) + 1
        finding(place, 1, f"character {ord(found.group())} is none that the controller reads")
        text = strange.sub(" ", text)
    code = text.split("\n")
    for i, line in enumerate(code):
        if "!" in line:
            if '"' not in line:
                code[i] = line[: line.index("!")].rstrip()
                continue
            if comment := _COMMENT.match(line):
                code[i] = line = comment.group(1).rstrip()
        if '"' in line:
            for string in _STRING.finditer(line):
                if len(string.group(1)) > STRING_LENGTH:
                    finding(
                        i + 1,
                        string.start() + 1,
                        f"the text has {len(string.group(1))} characters;"
                        f" {STRING_LENGTH} are taken",
                    )
    return Lines(code, findings)


def _is_utf8(raw: bytes) -> bool:
    """Letters beyond ASCII are read as ISO-8859-1: UTF-8 would come out as other letters."""
    try:
        raw.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return True
