"""What the lines of emitted programs are about, as a reader of the text would say.

Knows the three languages and what drillc's comments look like; nothing of templates, staging or the
source map. A line that gives no hint is left out.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

#: (file, line from 1) → ("hole" | "via" | "region" | "process", id or name)
About = dict[tuple[str, int], tuple[str, str]]

_REGION = {
    "krl": re.compile(r" *;FOLD region (\w+).*"),
    "rapid": re.compile(r" *! Region (\w+).*"),
    "gcode": re.compile(r"\(region (\w+)\)"),
}
#: A routine: its first line with its process, and its last.
_ROUTINE = {
    "krl": (re.compile(r";FOLD process (\w+)"), re.compile(";ENDFOLD")),
    "rapid": (re.compile(r"  ! Process (\w+) at one hole\."), re.compile("  ENDPROC")),
    "gcode": (re.compile(r"o<([a-z]\w*)> sub \(#1.*"), re.compile("o<[a-z].*> endsub")),
}
#: A hole's turn: its name and its id.
_CALL = {
    "krl": re.compile(r"  \w+\((\w+)(?:,[-0-9.]+)*\) ; (.*)"),
    "rapid": re.compile(r"    \w+ (\w+)(?:,[-0-9.]+)*; ! (.*)"),
}
#: Other lines with a hole's name: its declaration, the way to the first of a section.
_NAMED = {
    "krl": re.compile(r"(?:DECL E6(?:POS|AXIS) | {2}PTP )(\w+)[:=].*|  NOW\.\w+=(\w+)\.\w+"),
    "rapid": re.compile(
        r" +(?:LOCAL )?CONST (?:rob|joint)target (\w+):=.*|    MoveJ RelTool\((\w+),.*"
        r"|    now\.[\w.]+:=(\w+)\.[\w.]+;"
    ),
}
_WAY = re.compile(r".*(?:;|!) to (.*)")


def lines_of(text: bytes) -> list[str]:
    return text.decode("ascii").replace("\r\n", "\n").removesuffix("\n").split("\n")


def about(post: str, files: Mapping[str, bytes]) -> About:
    """What lines of a post's files are about, by path."""
    own = {path: lines_of(text) for path, text in files.items() if not path.endswith(".csv")}
    calls = [
        _CALL[post].fullmatch(line) for lines in own.values() for line in lines if post in _CALL
    ]
    ids = {call[1]: call[2] for call in calls if call}
    found: About = {}
    for path, lines in own.items():
        hints = _blocks(lines) if post == "gcode" else _hints(post, lines, ids)
        routines = _routines(post, lines)
        for at, said in [*hints, *routines]:
            found[path, at] = said
    return found


def _routines(post: str, lines: list[str]) -> Iterator[tuple[int, tuple[str, str]]]:
    begin, end = _ROUTINE[post]
    process = ""
    for at, line in enumerate(lines, 1):
        if match := begin.fullmatch(line):
            process = match[1]
        if process:
            yield at, ("process", process)
        if end.fullmatch(line):
            process = ""


def _hints(
    post: str, lines: list[str], ids: Mapping[str, str]
) -> Iterator[tuple[int, tuple[str, str]]]:
    for at, line in enumerate(lines, 1):
        if match := _REGION[post].fullmatch(line):
            yield at, ("region", match[1])
        elif match := _CALL[post].fullmatch(line):
            yield at, ("hole", match[2])
        elif match := _WAY.fullmatch(line):
            yield at, ("via", match[1])
        elif (match := _NAMED[post].fullmatch(line)) and match[match.lastindex or 1] in ids:
            yield at, ("hole", ids[match[match.lastindex or 1]])


def _blocks(lines: list[str]) -> Iterator[tuple[int, tuple[str, str]]]:
    """G-code: a comment begins the blocks of a hole or of a way, and the call of the process'
    routine ends the hole's; an empty line, or the next comment, ends all."""
    said: tuple[str, str] | None = None
    for at, line in enumerate(lines, 1):
        if match := _REGION["gcode"].fullmatch(line):
            said = None
            yield at, ("region", match[1])
        elif match := re.fullmatch(r"\((hole|to) (.*)\)", line):
            said = ("hole" if match[1] == "hole" else "via", match[2])
        elif not line or line.startswith("("):
            said = None
        if said:
            yield at, said
            if said[0] == "hole" and re.match(r"o<[a-z]\w*> call", line):
                said = None
