"""Faults put into program text: the common ground of the three languages' kinds of fault.

A fault looks for a place in the files, taken at random, and changes the text there. It returns None
where the files have no such place. Comments are never touched.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from random import Random

Lines = dict[str, list[str]]

#: So many lines above and below a fault are kept, to judge it by.
_AROUND = 40


@dataclass(frozen=True)
class Mutant:
    """Files with one fault: what kind, where, how the line read before and after, and what stands
    above and below it."""

    kind: str
    files: Mapping[str, bytes]
    place: str
    before: str
    after: str
    above: str
    below: str

    def __str__(self) -> str:
        return f"{self.kind} at {self.place}: {self.before!r} -> {self.after!r}"


@dataclass(frozen=True)
class Edit:
    """Line `index` of `path` (and perhaps others) was changed."""

    lines: Lines
    path: str
    index: int
    after: str


Fault = Callable[["Text", Random], Edit | None]


@dataclass(frozen=True)
class Text:
    """Program files by path, as lines; `code` gives what of a line is no comment."""

    lines: Lines
    code: Callable[[str], str]

    def matches(
        self, pattern: str, path: str = "", within: str = ""
    ) -> list[tuple[str, int, re.Match[str]]]:
        """Where `pattern` is found in code, in the files whose path matches `path`, in the lines
        that match `within`."""
        return [
            (name, index, match)
            for name, lines in sorted(self.lines.items())
            if re.search(path, name)
            for index, line in enumerate(lines)
            if re.search(within, self.code(line))
            for match in re.finditer(pattern, self.code(line))
        ]

    def with_line(self, path: str, index: int, *new: str) -> Edit:
        lines = {name: list(one) for name, one in self.lines.items()}
        lines[path][index : index + 1] = new
        return Edit(lines, path, index, "\n".join(new))


def mutate(
    kind: str, fault: Fault, files: Mapping[str, bytes], code: Callable[[str], str], rng: Random
) -> Mutant | None:
    """The files with one fault of that kind; files that are no programs are passed on."""
    programs = {p: raw for p, raw in files.items() if not p.endswith((".csv", ".map", ".json"))}
    split = {path: raw.decode("utf-8").split("\n") for path, raw in programs.items()}
    edit = fault(Text(split, code), rng)
    if edit is None or edit.lines == split:
        return None
    raw = {path: "\n".join(lines).encode() for path, lines in edit.lines.items()}
    before = split[edit.path][edit.index] if edit.index < len(split[edit.path]) else ""
    place = f"{edit.path}:{edit.index + 1}"
    above, below = split[edit.path][: edit.index], split[edit.path][edit.index + 1 :]
    around = (_block(part) for part in (above[-_AROUND:], below[:_AROUND]))
    return Mutant(kind, {**files, **raw}, place, before.strip(), edit.after.strip(), *around)


def _block(lines: Sequence[str]) -> str:
    return "".join(f"{line.strip()}\n" for line in lines)


# ── makers of faults ─────────────────────────────────────────────────────────────────────────────


def replaced(
    pattern: str, new: Callable[[re.Match[str], Random], str], path: str = "", within: str = ""
) -> Fault:
    """The group `x` of one match (or all of it) is replaced."""

    def fault(text: Text, rng: Random) -> Edit | None:
        found = text.matches(pattern, path, within)
        rng.shuffle(found)
        for name, index, match in found:
            group = "x" if "x" in match.re.groupindex else 0
            fresh = new(match, rng)
            if fresh != match.group(group):
                line = text.lines[name][index]
                start, end = match.span(group)
                return text.with_line(name, index, line[:start] + fresh + line[end:])
        return None

    return fault


def any_of(*faults: Fault) -> Fault:
    """One of several faults, taken at random, that has a place."""

    def fault(text: Text, rng: Random) -> Edit | None:
        for one in rng.sample(faults, len(faults)):
            if (edit := one(text, rng)) is not None:
                return edit
        return None

    return fault


def digit(pattern: str, path: str = "", within: str = "", last: bool = False) -> Fault:
    """One digit of the number in group `x` becomes another; `last`: its last one, by one."""

    def other(match: re.Match[str], rng: Random) -> str:
        number = match["x"]
        places = [i for i, c in enumerate(number) if c.isdigit()]
        place = places[-1] if last or len(places) == 1 else rng.choice(places[:-1])
        old = int(number[place])
        new = (old + 1) % 10 if last else rng.choice([d for d in range(10) if d != old])
        if last and old == 9:
            new = 8
        return number[:place] + str(new) + number[place + 1 :]

    return replaced(pattern, other, path, within)


def sign(pattern: str, path: str = "", within: str = "") -> Fault:
    """The number in group `x` changes its sign; zero is left alone."""

    def turned(match: re.Match[str], rng: Random) -> str:
        number = match["x"]
        if float(number) == 0.0:
            return number
        return number[1:] if number.startswith("-") else f"-{number}"

    return replaced(pattern, turned, path, within)


def word(pattern: str, new: str, path: str = "", within: str = "") -> Fault:
    """The group `x` (or the match) becomes `new`."""
    return replaced(pattern, lambda match, rng: new, path, within)


def swapped_groups(pattern: str, path: str = "") -> Fault:
    """The groups `a` and `b` of a match change places."""

    def fault(text: Text, rng: Random) -> Edit | None:
        found = [m for m in text.matches(pattern, path) if m[2]["a"] != m[2]["b"]]
        if not found:
            return None
        name, index, match = rng.choice(found)
        line = text.lines[name][index]
        (a, b), (c, d) = match.span("a"), match.span("b")
        return text.with_line(
            name, index, line[:a] + match["b"] + line[b:c] + match["a"] + line[d:]
        )

    return fault


def swapped_lines(pattern: str, path: str = "") -> Fault:
    """Two neighbouring lines that match and differ change places."""

    def fault(text: Text, rng: Random) -> Edit | None:
        found = [(name, index) for name, index, _ in text.matches(pattern, path)]
        pairs = [
            (name, i, j)
            for (name, i), (other, j) in pairwise(found)
            if name == other and text.code(text.lines[name][i]) != text.code(text.lines[name][j])
        ]
        if not pairs:
            return None
        name, i, j = rng.choice(pairs)
        lines = {path_: list(one) for path_, one in text.lines.items()}
        lines[name][i], lines[name][j] = lines[name][j], lines[name][i]
        return Edit(lines, name, i, lines[name][i])

    return fault


def exchanged(pattern: str, path: str = "") -> Fault:
    """The group `x` of two lines changes places: two holes with each other's values, say."""

    def fault(text: Text, rng: Random) -> Edit | None:
        found = text.matches(pattern, path)
        rng.shuffle(found)
        for name, i, one in found:
            for other, j, two in found:
                if name == other and i != j and one["x"] != two["x"]:
                    edit = text.with_line(name, i, _put(text.lines[name][i], one, two["x"]))
                    edit.lines[name][j] = _put(text.lines[name][j], two, one["x"])
                    return edit
        return None

    return fault


def _put(line: str, match: re.Match[str], new: str) -> str:
    start, end = match.span("x")
    return line[:start] + new + line[end:]


def dropped(pattern: str, path: str = "") -> Fault:
    """A line that matches goes."""

    def fault(text: Text, rng: Random) -> Edit | None:
        found = text.matches(pattern, path)
        if not found:
            return None
        name, index, _ = rng.choice(found)
        return text.with_line(name, index)

    return fault


def doubled(pattern: str, path: str = "") -> Fault:
    """A line that matches comes twice."""

    def fault(text: Text, rng: Random) -> Edit | None:
        found = text.matches(pattern, path)
        if not found:
            return None
        name, index, _ = rng.choice(found)
        line = text.lines[name][index]
        return text.with_line(name, index, line, line)

    return fault


def put_before(pattern: str, new: str, path: str = "") -> Fault:
    """A new line comes before a line that matches."""

    def fault(text: Text, rng: Random) -> Edit | None:
        found = text.matches(pattern, path)
        if not found:
            return None
        name, index, _ = rng.choice(found)
        line = text.lines[name][index]
        end = "\r" if line.endswith("\r") else ""
        return text.with_line(name, index, new + end, line)

    return fault


def commented(pattern: str, opening: str, closing: str = "", path: str = "") -> Fault:
    """A line that matches becomes a comment."""

    def fault(text: Text, rng: Random) -> Edit | None:
        found = text.matches(pattern, path)
        if not found:
            return None
        name, index, _ = rng.choice(found)
        line = text.lines[name][index]
        bare = text.code(line).rstrip("\r")
        end = "\r" if line.endswith("\r") else ""
        return text.with_line(name, index, f"{opening}{bare}{closing}{end}")

    return fault
