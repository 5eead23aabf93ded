"""Reads Boreas programs back, poses and joints, in one file or in parts."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from drillc.language.job import Floats, Signal
from drillc.verification.events import Kind, Step, ToolFrame
from drillc.verification.machine import Machine
from drillc.verification.reading import Finding, Precision, Reader, ReadError, Run
from drillc.verification.statements import At, Call, Do, If, Routine, Statement, While
from scipy.spatial.transform import Rotation

AXES = tuple(f"J{i}" for i in range(1, 10))
WORD = re.compile(r'"[^"]*"|[^\s"\[\]]+|[\[\]]')
NUMBER = re.compile(r"-?[0-9]+(\.[0-9]+)?")
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,15}")


class BoreasReader(Reader):
    name = "boreas"
    precision = Precision(0.0005, 1e-9, 5e-5, np.radians(5e-6), speed_mm_s=0.5e-6, analog=0.5e-5)

    def read(self, files: Mapping[str, bytes]) -> Sequence[Run]:
        texts = {p: _Text(raw) for p, raw in files.items() if p.endswith(".bor")}
        parts = {t.name: p for p, t in texts.items() if t.kind == "part"}
        mains = [path for path, text in texts.items() if text.kind == "program"]
        runs = [BoreasRun(path, texts, parts) for path in mains]
        read = {path for run in runs for path in run.files}
        if left := sorted(texts.keys() - read):
            raise ReadError(sorted(texts).index(left[0]), 1, 1, "no program is or chains this file")
        return runs

    def signal_name(self, signal: Signal, renamed: Mapping[str, str]) -> str:
        return f"{signal.kind} {signal.number}"

    def analog_value(self, signal: Signal, value: float) -> float:
        return value / signal.full_scale if signal.full_scale else value


class _Text:
    """One file: the words of its lines, one line after another."""

    def __init__(self, raw: bytes) -> None:
        self.lines = raw.decode("ascii", "replace").split("\n")
        words = WORD.findall(self.lines[0])
        self.kind, self.name = [*words, "", ""][:2]


@dataclass(frozen=True, eq=False)
class _Hole:
    """A point or a set of axes; `numbers` by name (axes), or a place in the base."""

    file: int
    line: int
    numbers: Mapping[str, float]
    position_mm: Floats | None = None
    rotation: Floats | None = None
    used: list[tuple[int, int]] = field(default_factory=list)


class BoreasRun(Run):
    axes = AXES

    def __init__(self, path: str, texts: Mapping[str, _Text], parts: Mapping[str, str]) -> None:
        self.name = texts[path].name
        self.files: list[str] = [path]
        self.signals: dict[str, int] = {}
        self.frames: list[ToolFrame] = []
        self.holes: dict[str, _Hole] = {}
        self.routines: dict[str, Routine] = {}
        self.feeds: dict[str, tuple[str, float] | None] = {}
        self.texts, self.parts = texts, parts
        self.file, self.line = 0, 0
        self.found: list[Finding] = []
        self.main = Routine("main", tuple(self.whole("program")), steps=True)

    def steps(self) -> Iterator[Step]:
        state: dict[str, Any] = {"locals": [{}], "tool": -1, "base": -1}
        state["joints"] = [np.nan] * len(AXES)
        return Machine(AXES, state, None, self.signals, self.frames).run(self.main)

    def findings(self) -> Sequence[Finding]:
        return self.found + [
            Finding("used", hole.file, hole.line, 1, f"nothing uses {name}")
            for name, hole in self.holes.items()
            if not hole.used
        ]

    def name_of(self, file: int, line: int) -> str | None:
        return next((name for name, h in self.holes.items() if (file, line) in h.used), None)

    # ── lines ────────────────────────────────────────────────────────────────────────────────────

    def words(self) -> list[str]:
        lines = self.texts[self.files[self.file]].lines
        while self.line < len(lines):
            self.line += 1
            text = lines[self.line - 1]
            if WORD.sub("", text).strip():
                raise self.wrong("a text is not closed")
            if words := WORD.findall(text):
                return words
        raise self.wrong("the file ends too early")

    def wrong(self, message: str) -> ReadError:
        return ReadError(self.file, self.line, 1, message)

    def number(self, word: str) -> float:
        if not NUMBER.fullmatch(word):
            raise self.wrong(f"{word} is no number")
        return float(word)

    def new_name(self, word: str, known: Mapping[str, object]) -> str:
        if not NAME.fullmatch(word) or word in known:
            raise self.wrong(f"{word} is no name, too long for one, or there already")
        return word

    def place(self, words: list[str]) -> tuple[Floats, Floats]:
        """Rotation and position of `x y z [w x y z]`."""
        match words:
            case [x, y, z, "[", *turn, "]"] if len(turn) == 4:
                q = np.array([self.number(word) for word in turn])
            case _:
                raise self.wrong("a place is x y z [w x y z]")
        if abs(np.linalg.norm(q) - 1.0) > 2e-9:
            self.found.append(Finding("quaternions", self.file, self.line, 1, "no unit quaternion"))
        rotation = Rotation.from_quat(q[[1, 2, 3, 0]]).as_matrix()
        return rotation, np.array([self.number(word) for word in (x, y, z)])

    # ── the body ─────────────────────────────────────────────────────────────────────────────────

    def whole(self, kind: str) -> Iterator[Statement]:
        """All of a file that is a program or a part."""
        match self.words():
            case ["program", name, _, "blend", radius] if kind == "program":
                self.number(radius)
            case ["part", name, index] if kind == "part":
                self.number(index)
            case _:
                raise self.wrong(f"a {kind} was expected")
        self.new_name(name, {})
        while (words := self.words()) != ["end", kind]:
            yield from self.body(words)
        if any(line.strip() for line in self.texts[self.files[self.file]].lines[self.line :]):
            raise self.wrong("nothing can follow the end")

    def body(self, words: list[str]) -> Iterator[Statement]:
        at = At(self.file, self.line)
        match words:
            case ["region", title] if title[0] == '"':
                return
            case ["routine", name, title, *feed] if title[0] == '"':
                self.feeds[self.new_name(name, self.routines)] = self.feed(feed)
                body = tuple(self.block("routine", self.feeds[name]))
                self.routines[name] = Routine(name, body)
            case ["tool" | "base" as kind, number]:
                yield self.frame(kind, ToolFrame(f"{self.number(number):g}"))
            case ["tool" | "base" as kind, number, *place]:
                frame = ToolFrame(f"{self.number(number):g}", *self.place(place))
                yield self.frame(kind, frame)
            case ["point", name, id_, *place] if id_[0] == '"':
                rotation, position_mm = self.place(place)
                self.holes[self.new_name(name, self.holes)] = _Hole(
                    self.file, self.line, {}, position_mm, rotation
                )
            case ["axes", name, id_, *pairs] if id_[0] == '"':
                split = [pair.partition("=") for pair in pairs]
                numbers = {axis: self.number(value) for axis, _, value in split}
                if "out" not in numbers or not numbers.keys() - {"out"} <= set(AXES):
                    raise self.wrong("axes are J1 to J9, and out")
                if len(numbers) != len(pairs):
                    raise self.wrong("an axis is given twice")
                hole = _Hole(self.file, self.line, numbers)
                self.holes[self.new_name(name, self.holes)] = hole
            case ["reach", name, depth]:
                yield Do(at, self.reach(self.hole(name), self.number(depth)))
            case ["run", routine, "at", name, "depth", depth] if routine in self.routines:
                variables = {"hole": self.hole(name), "depth": self.number(depth)}
                yield Call(at, lambda: self.routines[routine], lambda m: dict(variables))
            case ["chain", name] if name in self.parts:
                yield from self.chained(self.parts[name])
            case _:
                raise self.wrong(f"{' '.join(words)} is not understood")

    def chained(self, path: str) -> Iterator[Statement]:
        if path in self.files:
            raise self.wrong("a part is chained twice")
        here = self.file, self.line
        self.files.append(path)
        self.file, self.line = len(self.files) - 1, 0
        yield from self.whole("part")
        self.file, self.line = here

    def hole(self, name: str) -> _Hole:
        if name not in self.holes:
            raise self.wrong(f"there is no {name}")
        self.holes[name].used.append((self.file, self.line))
        return self.holes[name]

    def feed(self, words: list[str]) -> tuple[str, float] | None:
        match words:
            case []:
                return None
            case ["along", axis, "1" | "-1" as sign] if axis in AXES:
                return axis, float(sign)
        raise self.wrong("a routine is for points, or along an axis 1 or -1")

    def frame(self, kind: str, frame: ToolFrame) -> Do:
        def act(m: Machine) -> None:
            m.state[kind] = m.frame(frame)

        return Do(At(self.file, self.line), act)

    def reach(self, hole: _Hole, depth_mm: float) -> Any:
        return lambda m: _to_point(m, hole, Kind.JOINTS, depth_mm, np.nan)

    # ── routines ─────────────────────────────────────────────────────────────────────────────────

    def block(self, kind: str, feed: tuple[str, float] | None) -> Iterator[Statement]:
        while (words := self.words()) != ["end", kind]:
            yield from self.statement(words, feed)

    def statement(self, words: list[str], feed: tuple[str, float] | None) -> Iterator[Statement]:
        at = At(self.file, self.line)
        match words:
            case ["go", depth, "speed", speed]:
                yield self.go(at, self.number(depth), self.number(speed), feed)
            case ["feed", "depth", "speed", speed]:
                yield self.go(at, "depth", self.number(speed), feed)
            case ["feed", "depth", "speed", *given]:
                feed_mm_s, peck, begin, gap, back = self.pecks(given)
                yield self.bottom(at, lambda m: begin + peck)
                pecks = (
                    self.go(at, "bottom", feed_mm_s, feed),
                    self.go(at, begin, back, feed),
                    self.go(at, "bottom", back, feed, -gap),
                    self.bottom(at, lambda m: m.locals["bottom"] + peck),
                )
                yield While(at, lambda m: m.locals["bottom"] < m.locals["depth"] - 0.001, pecks)
                yield self.go(at, "depth", feed_mm_s, feed)
            case ["withdraw"] if feed:
                yield Do(at, lambda m: _joints(m, {feed[0]: _axes(m)["out"]}, Kind.JOINTS))
            case ["carry"] if feed:
                yield Do(at, lambda m: _joints(m, _others(m, feed[0]), Kind.JOINTS))
            case ["out", number, "on" | "off" as state]:
                on = float(state == "on")
                yield self.emitted(at, Kind.OUTPUT, f"output {self.number(number):g}", on)
            case ["volts", number, share]:
                name = f"analog {self.number(number):g}"
                yield self.emitted(at, Kind.ANALOG, name, self.number(share))
            case ["pause", seconds]:
                yield self.emitted(at, Kind.PAUSE, None, self.number(seconds))
            case ["await", number, "for", seconds]:
                name, timeout_s = f"input {self.number(number):g}", self.number(seconds)
                body = tuple(self.block("await", feed))
                yield If(at, lambda m: not m.wait(name, 1.0, timeout_s), body)
            case ["tell", text] if text[0] == '"':
                yield Do(at, lambda m: m.emit(Kind.MESSAGE))
            case ["halt"]:
                yield Do(at, lambda m: m.stop())
            case _:
                raise self.wrong(f"{' '.join(words)} is not understood in a routine")

    def pecks(self, words: list[str]) -> list[float]:
        match words:
            case [speed, "peck", peck, "from", begin, "gap", gap, "back", back]:
                return [self.number(word) for word in (speed, peck, begin, gap, back)]
        raise self.wrong("a feed in pecks says: speed, peck, from, gap, back")

    def bottom(self, at: At, value: Any) -> Do:
        return Do(at, lambda m: m.locals.update(bottom=value(m)))

    def go(
        self,
        at: At,
        depth: float | str,
        speed: float,
        feed: tuple[str, float] | None,
        more: float = 0.0,
    ) -> Do:
        def act(m: Machine) -> None:
            to = more + (m.locals[depth] if isinstance(depth, str) else depth)
            if feed is None:
                _to_point(m, m.locals["hole"], Kind.STRAIGHT, to, speed)
            else:
                axis, sign = feed
                _joints(m, {axis: _axes(m)[axis] + sign * to}, Kind.STRAIGHT, speed)

        return Do(at, act)

    def emitted(self, at: At, kind: Kind, signal: str | None, value: float) -> Do:
        def act(m: Machine) -> None:
            m.emit(kind, value=value, signal=-1 if signal is None else m.signal(signal))

        return Do(at, act)


def _to_point(m: Machine, hole: _Hole, kind: Kind, depth_mm: float, speed: float) -> None:
    if hole.position_mm is None or hole.rotation is None:
        raise m.fail("axes are no point")
    m.emit(
        kind,
        position_mm=hole.position_mm + hole.rotation[:, 2] * depth_mm,
        rotation=hole.rotation,
        speed_mm_s=speed,
        tool=m.state["tool"],
        base=m.state["base"],
    )


def _axes(m: Machine) -> Mapping[str, float]:
    numbers: Mapping[str, float] = m.locals["hole"].numbers
    if not numbers:
        raise m.fail("a point has no axes")
    return numbers


def _others(m: Machine, feed: str) -> Mapping[str, float]:
    return {axis: value for axis, value in _axes(m).items() if axis not in (feed, "out")}


def _joints(m: Machine, to: Mapping[str, float], kind: Kind, speed: float = np.nan) -> None:
    joints = m.state["joints"]
    m.state["joints"] = [to.get(axis, was) for axis, was in zip(AXES, joints, strict=True)]
    m.emit(kind, joints=np.array(m.state["joints"]), speed_mm_s=speed)
