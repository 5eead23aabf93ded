"""The .pgf of a program: an XML file with the modules to be loaded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree import ElementTree

from ..reading import Finding, ReadError

#: A program of a hundred thousand modules is none.
MOST_BYTES = 10_000_000


@dataclass(frozen=True)
class Listing:
    """`modules`: the line and the name of each file; `findings` are of file number 0."""

    path: str
    modules: Sequence[tuple[int, str]]
    findings: Sequence[Finding]


def listing(path: str, raw: bytes) -> Listing:
    """Raises ReadError. A document type is refused: with it a few lines could become gigabytes."""
    findings = []
    text = raw.decode("latin-1")
    if len(raw) > MOST_BYTES or "<!" in text.replace("<!--", ""):
        raise ReadError(0, 1, 1, "a list of modules has no document type, and is short")
    if text.count("\n") != text.count("\r\n"):
        lines = text.split("\n")[:-1]
        bare = next(i for i, line in enumerate(lines, 1) if not line.endswith("\r"))
        findings.append(Finding("rules", 0, bare, 1, "the line does not end in CRLF"))
    try:
        root = ElementTree.fromstring(raw)
    except ElementTree.ParseError as error:
        line, column = error.position
        raise ReadError(0, line, column + 1, f"the list of modules is no XML: {error}") from None
    except (LookupError, ValueError) as error:  # an encoding that there is not
        raise ReadError(0, 1, 1, f"the list of modules is no text: {error}") from None
    if root.tag != "Program":
        raise ReadError(0, 1, 1, f"the list of modules begins with {root.tag}, not Program")
    between = [root.text, *(child.tail for child in root)]
    if stray := "".join(text or "" for text in between).strip():
        raise ReadError(0, 1, 1, f"{stray} stands beside the modules")
    found, at = [], 0
    for child in root:
        name = (child.text or "").strip()
        if child.tag != "Module" or not name or len(child):
            raise ReadError(0, 1, 1, f"{child.tag} {name} is no module")
        at = max(text.find(name, at), 0)
        found.append((text.count("\n", 0, at) + 1, name))
    names = [name.lower() for _, name in found]
    for (line, name), lower in zip(found, names, strict=True):
        if names.count(lower) > 1:
            raise ReadError(0, line, 1, f"module {name} is listed twice")
    if not found:
        raise ReadError(0, 1, 1, "the list of modules is empty")
    return Listing(path, tuple(found), tuple(findings))
