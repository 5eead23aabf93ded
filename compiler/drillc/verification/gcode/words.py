"""The words of a block, and the rules that LinuxCNC checks before it does anything."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from .state import LETTERS
from .syntax import Block, Constant, Misread, Value, Word

MOTIONS = frozenset({"G0", "G1", "G73", "G80", "G81", "G82", "G83"})
CYCLES = frozenset({"G73", "G81", "G82", "G83"})

#: Codes that are understood, by modal group: no two of a group in one block.
_GROUPS = {
    "motion": MOTIONS,
    "dwell": frozenset({"G4"}),
    "plane": frozenset({"G17", "G18", "G19"}),
    "distance": frozenset({"G90", "G91"}),
    "arc distance": frozenset({"G90.1", "G91.1"}),
    "feed": frozenset({"G93", "G94", "G95"}),
    "units": frozenset({"G20", "G21"}),
    "cutter": frozenset({"G40"}),
    "length": frozenset({"G49"}),
    "retract": frozenset({"G98", "G99"}),
    "coordinates": frozenset({"G54"}),
    "path": frozenset({"G61", "G61.1", "G64"}),
    "spindle mode": frozenset({"G97"}),
    "stop": frozenset({"M0", "M1", "M2", "M30", "M60"}),
    "spindle": frozenset({"M3", "M4", "M5"}),
    "coolant": frozenset({"M7", "M8", "M9"}),
    "override": frozenset({"M48", "M49", "M50", "M51", "M52", "M53"}),
    "signal": frozenset({"M62", "M63", "M64", "M65", "M66", "M67", "M68"}),
}
_GROUP_OF = {code: group for group, codes in _GROUPS.items() for code in codes}

#: Codes that LinuxCNC knows and drillc refuses, and why.
_REFUSED = {
    **dict.fromkeys(("G2", "G3", "G2.1"), "an arc, while a hole is drilled and left straight"),
    **dict.fromkeys(("G5", "G5.1", "G5.2", "G5.3"), "a spline"),
    "G10": "it changes offsets and tools, which are the machine's",
    **dict.fromkeys(
        ("G28", "G28.1", "G30", "G30.1"), "it goes to a place that only the machine knows"
    ),
    **dict.fromkeys(("G33", "G33.1", "G76", "G74", "G84"), "it cuts a thread"),
    **dict.fromkeys(("G38.2", "G38.3", "G38.4", "G38.5"), "where a probe stops is not known"),
    **dict.fromkeys(("G41", "G42", "G41.1", "G42.1"), "cutter compensation moves the tool aside"),
    **dict.fromkeys(("G43", "G43.1", "G43.2"), "the tool's length is the machine's"),
    "G52": "an offset moves the holes",
    "G53": "where the machine's own coordinates are in G54 is not known",
    **dict.fromkeys(
        ("G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"),
        "where another coordinate system is in G54 is not known",
    ),
    **dict.fromkeys(("G92", "G92.1", "G92.2", "G92.3"), "an offset moves the holes"),
    **dict.fromkeys(("G17.1", "G18.1", "G19.1"), "cycles along U, V or W are not understood"),
    **dict.fromkeys(
        ("G70", "G71", "G72", "G85", "G86", "G87", "G88", "G89"), "not a drilling cycle"
    ),
    "G7": "it counts X as a diameter",
    "G8": "it belongs to lathes",
    "G96": "it belongs to lathes",
    "M6": "another tool is not what the spec was planned for",
    "M61": "another tool is not what the spec was planned for",
    "M19": "the spindle's angle is not followed",
    **dict.fromkeys(("M70", "M71", "M72", "M73"), "saved modes are not followed"),
    **dict.fromkeys(("M98", "M99"), "a routine is called by an O-word"),
}

#: Which codes use a word; else it is an error. Cycles may be those of the block before.
_USERS = {
    "p": frozenset({"G4", "G64", "G82", "M62", "M63", "M64", "M65", "M66"})
    | frozenset({"M50", "M51", "M52", "M53"}),
    "q": frozenset({"G64", "G73", "G83", "M66", "M67", "M68"}),
    "e": frozenset({"M66", "M67", "M68"}),
    "l": frozenset({"G73", "G81", "G82", "G83", "M66"}),
    "r": frozenset({"G73", "G81", "G82", "G83"}),
}
_KNOWN = frozenset("fs") | frozenset(letter.lower() for letter in LETTERS) | frozenset(_USERS)
_REFUSED_WORDS = {
    "t": "a tool is selected; the spec was planned for one",
    "h": "it belongs to G43",
    "d": "it belongs to G41 and G42",
    "i": "it belongs to arcs",
    "j": "it belongs to arcs",
    "k": "it belongs to arcs",
}
_MOST_M = 4


@dataclass(frozen=True)
class Words:
    """A block's codes by modal group, and the values of its other words by letter, in upper case.

    `cycle_words`: it has words that only a canned cycle uses, and names none itself."""

    codes: Mapping[str, str]
    values: Mapping[str, Value]
    cycle_words: bool

    @property
    def axes(self) -> tuple[str, ...]:
        return tuple(letter for letter in LETTERS if letter in self.values)


def words_of(block: Block) -> Words:
    """Raises Misread."""
    codes: dict[str, str] = {}
    values: dict[str, Value] = {}
    place: dict[str, int] = {}
    for word in block.words:
        if word.letter in "gm":
            code = _code(word)
            group = _GROUP_OF[code]
            # LinuxCNC lets G80 stand beside another motion, which then counts.
            if group in codes and "G80" not in (code, codes[group]):
                raise Misread(
                    word.position,
                    f"{codes[group]} and {code} in one block: they exclude each other",
                )
            if code != "G80" or group not in codes:
                codes[group] = code
            continue
        letter = word.letter.upper()
        if word.letter in _REFUSED_WORDS:
            raise Misread(word.position, f"{letter}: {_REFUSED_WORDS[word.letter]}")
        if word.letter not in _KNOWN:
            raise Misread(word.position, f"there is no word {letter}")
        if letter in values:
            raise Misread(word.position, f"{letter} is given twice in one block")
        values[letter], place[letter] = word.value, word.position
    if sum(word.letter == "m" for word in block.words) > _MOST_M:
        raise Misread(0, f"more than {_MOST_M} M codes in one block")
    return _used(codes, values, place)


def _code(word: Word) -> str:
    """A G or M word: G0, G61.1, M66, …"""
    letter = word.letter.upper()
    if not isinstance(word.value, Constant):
        raise Misread(word.position, f"{letter} with a computed number is not understood")
    code = f"{letter}{word.value.value:g}"
    if code in _GROUP_OF:
        return code
    if code in _REFUSED:
        raise Misread(word.position, f"{code} is not taken: {_REFUSED[code]}")
    raise Misread(word.position, f"{code} is not understood")


def _used(codes: dict[str, str], values: dict[str, Value], place: dict[str, int]) -> Words:
    given = frozenset(codes.values())
    motion = codes.get("motion")
    axes = [letter for letter in values if letter in LETTERS]
    if motion == "G80" and axes:
        raise Misread(place[axes[0]], f"{axes[0]} beside G80, which moves nothing")
    if motion in CYCLES and not axes:
        raise Misread(0, f"{motion} without an axis")
    left = False  # words for a cycle that an earlier block named
    for letter, users in _USERS.items():
        if letter.upper() in values and not given & users:
            if motion is None and axes and users & CYCLES:
                left = True
                continue
            raise Misread(
                place[letter.upper()],
                f"{letter.upper()} without a code that uses it"
                + (": numbers have no exponent" if letter == "e" else ""),
            )
    needs = {"G4": "P", "M62": "P", "M63": "P", "M64": "P", "M65": "P", "M67": "E", "M68": "E"}
    for code, letter in needs.items():
        if code in given and letter not in values:
            raise Misread(0, f"{code} without {letter}")
    if "M66" in given and "P" not in values:
        raise Misread(0, "M66 without P: an analog input is not waited for")
    return Words(codes, values, left)
