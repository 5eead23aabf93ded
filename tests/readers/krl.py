"""A mini KRL controller: reads .src and .dat as text, checks them, and runs them.

It knows the words that drilling programs use and refuses all others, so a program that it runs
holds nothing unread. It shares no code with the post; rotations are scipy's. What it checks beside
running: line ends, ASCII, lengths, folds, declarations before statements, names declared once,
components that have no value, signals and timers that the advance run would reach before the tool.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from readers.events import (
    Analog,
    Await,
    Event,
    Matrix,
    Message,
    Move,
    Output,
    Pause,
    ReadError,
    Stop,
    World,
)
from scipy.spatial.transform import Rotation

NAME_LENGTH, STRING_LENGTH, LINE_LENGTH = 24, 80, 470
FRAME_PARTS = ("X", "Y", "Z", "A", "B", "C")
STATUS = ("S", "T")
AXES = tuple(f"{letter}{i}" for letter in "AE" for i in range(1, 7))
TYPES = ("INT", "REAL", "BOOL", "FRAME", "E6POS", "E6AXIS")
#: Words that begin a line and that this reader runs, beside assignments and calls.
HEADERS = ("&ACCESS", "&REL", "&PARAM", "&COMMENT")
PREDEFINED = ("BAS", "IR_STOPM", "MSGNOTIFY", "TOOL_DATA", "BASE_DATA", "LOAD_DATA")
_TOKEN = re.compile(
    r'\s*(?:(?P<num>\d+\.\d+|\d+)|(?P<str>"[^"]*")|(?P<name>[#$]?[A-Za-z_][A-Za-z0-9_]*)'
    r"|(?P<op><=|>=|==|<>|[-+*/:<>(){}\[\],.=]))"
)


@dataclass
class Routine:
    name: str
    parameters: list[str]
    body: list[list[str]]
    scope: str  # the file it stands in
    is_global: bool


@dataclass
class Controller:
    """Files that were loaded: routines by name (file and name, if local), data by file, and what is
    global."""

    routines: dict[str, Routine] = field(default_factory=dict)
    data: dict[str, dict[str, Any]] = field(default_factory=dict)
    shared: dict[str, Any] = field(default_factory=dict)
    public: set[str] = field(default_factory=set)


class Array(list[dict[str, float]]):
    """A declared array: aggregates of one type, empty until they are given a value."""

    def __init__(self, kind: str, size: int) -> None:
        super().__init__({} for _ in range(size))
        self.kind = kind


# ── reading ──────────────────────────────────────────────────────────────────────────────────────


def load(files: Mapping[str, bytes]) -> Controller:
    """Read every .src and .dat of `files` (path → bytes); raises ReadError."""
    controller = Controller()
    for path, raw in files.items():
        name = path.rsplit("/", 1)[-1]
        if name == "names.csv":
            continue
        stem, _, kind = name.rpartition(".")
        lines = check_lines(path, raw)
        if kind == "dat":
            _read_data(controller, stem, lines)
        elif kind == "src":
            _read_source(controller, stem, lines)
        else:
            raise ReadError(f"{path}: not a file of this controller")
    for stem in controller.data:
        names = {routine.name for routine in controller.routines.values()}
        clash = set(controller.data[stem]) & names
        if clash:
            raise ReadError(f"{stem}: {clash} are both data and routines")
    return controller


def check_lines(path: str, raw: bytes) -> list[str]:
    """Text in CRLF lines of plain ASCII, with folds that match; returns lines without comments."""
    text = raw.decode("ascii")
    if text.count("\n") != text.count("\r\n") or not text.endswith("\r\n"):
        raise ReadError(f"{path}: lines end otherwise than in CRLF")
    depth, kept = 0, []
    for number, line in enumerate(text.split("\r\n")[:-1], 1):
        where = f"{path}:{number}: {line}"
        if "\r" in line or "\t" in line or len(line) > LINE_LENGTH or line != line.rstrip():
            raise ReadError(where)
        bare = line.strip()
        if bare.startswith(";FOLD"):
            depth += 1
        elif bare.startswith(";ENDFOLD"):
            depth -= 1
        if depth < 0:
            raise ReadError(f"{where}: no fold is open")
        kept.append(_without_comment(line))
    if depth:
        raise ReadError(f"{path}: {depth} folds are open at the end")
    if [line.split(" ")[0] for line in kept[:2]] != ["&ACCESS", "&REL"]:
        raise ReadError(f"{path}: no &ACCESS and &REL")
    return [line.strip() for line in kept if line.strip() and not line.startswith(HEADERS)]


def _without_comment(line: str) -> str:
    quoted = False
    for i, c in enumerate(line):
        quoted ^= c == '"'
        if c == ";" and not quoted:
            return line[:i]
    if quoted:
        raise ReadError(f"{line}: a text is not closed")
    return line


def tokens(line: str) -> list[str]:
    found, at = [], 0
    while at < len(line.rstrip()):
        match = _TOKEN.match(line, at)
        if match is None:
            raise ReadError(f"{line!r}: not KRL at {line[at:]!r}")
        at = match.end()
        text = match.group().strip()
        if match["str"] and len(text) - 2 > STRING_LENGTH:
            raise ReadError(f"{text}: longer than {STRING_LENGTH}")
        if match["name"]:
            if len(text.lstrip("#$")) > NAME_LENGTH:
                raise ReadError(f"{text}: longer than {NAME_LENGTH}")
            text = text.upper()
        found.append(text)
    return found


def _declare(table: dict[str, Any], name: str, value: Any, where: str) -> None:
    if not re.fullmatch(r"[A-Z_][A-Z0-9_]*", name) or name in PREDEFINED or name in TYPES:
        raise ReadError(f"{where}: {name} cannot be declared")
    if name in table:
        raise ReadError(f"{where}: {name} is declared twice")
    table[name] = value


def _read_data(controller: Controller, stem: str, lines: Sequence[str]) -> None:
    head = tokens(lines[0])
    if head[:2] != ["DEFDAT", stem.upper()] or head[2:] not in ([], ["PUBLIC"]):
        raise ReadError(f"{stem}.dat: {lines[0]}")
    if tokens(lines[-1]) != ["ENDDAT"]:
        raise ReadError(f"{stem}.dat: no ENDDAT")
    own: dict[str, Any] = {}
    controller.data[stem.upper()] = own
    for line in lines[1:-1]:
        words = tokens(line)
        if words[0] == "EXT":
            if words[1] != "BAS":
                raise ReadError(line)
            continue
        table = own
        if words[0] == "DECL":
            words = words[1:]
            if words[0] == "GLOBAL":
                if head[2:] != ["PUBLIC"]:
                    raise ReadError(f"{line}: global data in a list that is not PUBLIC")
                table, words = controller.shared, words[1:]
            kind, name = words[0], words[1]
            if kind not in TYPES:
                raise ReadError(f"{line}: type {kind}")
            if words[2:3] == ["["]:
                _declare(table, name, Array(kind, int(words[3])), line)
                if words[4:] != ["]"]:
                    raise ReadError(line)
                continue
            if words[2] != "=":
                raise ReadError(f"{line}: no value")
            value = _aggregate(words[3:], kind, line)
            _declare(table, name, value, line)
            continue
        name = words[0]
        array = own[name] if name in own else controller.shared[name]
        index = int(words[2]) - 1
        if words[1] != "[" or words[3:5] != ["]", "="] or not isinstance(array, Array):
            raise ReadError(line)
        if not 0 <= index < len(array) or array[index]:
            raise ReadError(f"{line}: no such element, or it has its value already")
        array[index] = _aggregate(words[5:], array.kind, line)
    if stem.upper() in own:
        raise ReadError(f"{stem}: data with the name of its module")


def _aggregate(words: Sequence[str], kind: str, line: str) -> dict[str, float]:
    """{X 1.0,Y -2.0,…}: constants only, each component once, all of the type's. S and T, which are
    whole numbers, only both."""
    if words[0] != "{" or words[-1] != "}":
        raise ReadError(f"{line}: no aggregate")
    allowed = AXES if kind == "E6AXIS" else FRAME_PARTS
    allowed += STATUS if kind == "E6POS" else ()
    parts: dict[str, float] = {}
    at = 1
    while at < len(words) - 1:
        name, sign = words[at], 1.0
        at += 1
        if words[at] == "-":
            sign, at = -1.0, at + 1
        if name not in allowed or name in parts or not re.fullmatch(r"[0-9.]+", words[at]):
            raise ReadError(f"{line}: component {name}")
        parts[name] = sign * float(words[at])
        at += 1
        if at < len(words) - 1 and words[at] != ",":
            raise ReadError(line)
        at += 1
    if kind != "E6AXIS" and tuple(parts) not in (FRAME_PARTS, FRAME_PARTS + STATUS):
        raise ReadError(f"{line}: not all of {FRAME_PARTS}")
    for part, most in zip(STATUS, (8, 64), strict=True):
        if parts.get(part, 0.0) not in range(most):
            raise ReadError(f"{line}: {part}")
    return parts


def _read_source(controller: Controller, stem: str, lines: Sequence[str]) -> None:
    current: Routine | None = None
    for number, line in enumerate(lines):
        words = tokens(line)
        is_global = words[:2] == ["GLOBAL", "DEF"]
        if is_global or words[0] == "DEF":
            if current is not None:
                raise ReadError(f"{stem}: DEF inside of DEF")
            words = words[1:] if is_global else words
            parameters = [w for w in words[3:-1] if w not in (":", "IN", ",")]
            if words[2] != "(" or words[-1] != ")":
                raise ReadError(line)
            current = Routine(words[1], parameters, [], stem.upper(), is_global or number == 0)
            if number == 0 and words[1] != stem.upper():
                raise ReadError(f"{stem}.src begins with {words[1]}")
        elif words == ["END"]:
            if current is None:
                raise ReadError(f"{stem}: END without DEF")
            _check_order(current)
            own = current.name if current.is_global else f"{current.scope}.{current.name}"
            if {own, current.name} & set(controller.routines):
                raise ReadError(f"{current.name} is defined twice")
            controller.routines[own] = current
            current = None
        elif current is None:
            raise ReadError(f"{stem}: {line} outside of DEF")
        else:
            current.body.append(words)
    if current is not None:
        raise ReadError(f"{stem}: no END")


def _check_order(routine: Routine) -> None:
    """Declarations stand before every statement; parameters are declared."""
    declared: list[str] = []
    statements = False
    for words in routine.body:
        if words[0] == "DECL":
            if statements:
                raise ReadError(f"{routine.name}: {' '.join(words)} after a statement")
            declared += [w for w in words[2:] if w != ","]
        else:
            statements = True
    missing = set(routine.parameters) - set(declared)
    if missing or len(set(declared)) != len(declared):
        raise ReadError(f"{routine.name}: {missing or declared} not declared once")


# ── running ──────────────────────────────────────────────────────────────────────────────────────


class _HaltedError(Exception):
    """HALT was reached again and again: the program does not go on."""


_CLOSING = {"WHILE": "ENDWHILE", "IF": "ENDIF", "LOOP": "ENDLOOP"}


@dataclass
class Run:
    """What happened. `tool_data` and `base_data` are what the program itself wrote."""

    events: list[Event] = field(default_factory=list)
    tool_data: dict[int, dict[str, float]] = field(default_factory=dict)
    load_data: dict[int, Any] = field(default_factory=dict)
    base_data: dict[int, dict[str, float]] = field(default_factory=dict)
    velocities: set[float] = field(default_factory=set)
    calls: list[tuple[str, tuple[Any, ...]]] = field(default_factory=list)


def run(
    controller: Controller,
    main: str,
    world: World | None = None,
    home: Mapping[str, float] | None = None,
    starts: int = 4,
) -> Run:
    """Run routine `main`. Outputs, inputs and timers have their numbers as names, such as `$IN[3]`.

    After a HALT the operator presses start, `starts` times in all; then the run is over.
    """
    machine = _Machine(controller, world or World(), dict(home or {}), starts)
    try:
        machine.call(main.upper(), [])
    except _HaltedError:
        machine.run.events.append(Stop())
    return machine.run


class _Machine:
    def __init__(
        self, controller: Controller, world: World, home: dict[str, float], starts: int
    ) -> None:
        self.controller = controller
        self.world = world
        self.home = home
        self.starts = starts
        self.run = Run()
        self.timers: dict[int, float] = {}
        self.running: set[int] = set()
        self.outputs: dict[int, bool] = {}
        self.speed: float | None = None  # m/s, none until it is set
        self.tool = self.base = ""
        self.ahead = False  # whether the interpreter may be ahead of the tool
        self.settled = False  # whether a PTP has said where the axes are
        self.initialised = False
        self.frames: list[dict[str, Any]] = []
        self.here: Routine

    # statements

    def call(self, name: str, arguments: list[Any]) -> None:
        routines, before = self.controller.routines, getattr(self, "here", None)
        routine = routines.get(name)
        if before is not None:
            routine = routines.get(f"{before.scope}.{name}", routine)
        if routine is None:
            raise ReadError(f"{name} is not known here")
        if len(arguments) != len(routine.parameters):
            raise ReadError(f"{name} takes {routine.parameters}, not {arguments}")
        self.here = routine
        self.frames.append({})
        local = self.frames[-1]
        given = dict(zip(routine.parameters, arguments, strict=True))
        for words in routine.body:
            if words[0] == "DECL":
                for variable in (w for w in words[2:] if w != ","):
                    start: Any = None if words[1] in ("REAL", "INT", "BOOL") else {}
                    value = given.pop(variable, start)
                    if isinstance(value, dict) != (words[1] in ("FRAME", "E6POS", "E6AXIS")):
                        raise ReadError(f"{name}: {variable} is no {words[1]}")
                    local[variable] = dict(value) if isinstance(value, dict) else value
        self._block([w for w in routine.body if w[0] != "DECL"])
        self.frames.pop()
        if before is not None:
            self.here = before

    def _block(self, body: Sequence[list[str]]) -> None:
        at = 0
        while at < len(body):
            words = body[at]
            if words[0] in _CLOSING:
                end = self._closing(body, at)
                inside = body[at + 1 : end]
                if words[0] == "WHILE":
                    while self._bool(words[1:]):
                        self._block(inside)
                elif words[0] == "IF":
                    if words[-1] != "THEN":
                        raise ReadError(" ".join(words))
                    if self._bool(words[1:-1]):
                        self._block(inside)
                else:
                    while True:
                        self._block(inside)
                at = end + 1
            else:
                self._statement(words)
                at += 1

    def _closing(self, body: Sequence[list[str]], at: int) -> int:
        depth, kind = 0, body[at][0]
        for i in range(at, len(body)):
            depth += (body[i][0] == kind) - (body[i][0] == _CLOSING[kind])
            if depth == 0:
                return i
        raise ReadError(f"{kind} is not closed")

    def _statement(self, words: list[str]) -> None:
        text = " ".join(words)
        match words:
            case ["GLOBAL", "INTERRUPT", "DECL", _, "WHEN", "$STOPMESS", "==", "TRUE", "DO", *_]:
                pass
            case ["INTERRUPT", "ON", _]:
                pass
            case ["HALT"]:
                self.starts -= 1
                if self.starts < 0:
                    raise _HaltedError
            case ["WAIT", "SEC", *rest]:
                seconds = self._number(rest)
                self.ahead = False
                if seconds:
                    self._pass_time(seconds)
                    self.run.events.append(Pause(seconds))
            case ["WAIT", "FOR", *rest]:
                self._wait_for(rest)
            case ["PTP" | "LIN" as kind, *rest]:
                self._move(kind == "LIN", rest)
            case ["BAS", "(", command, ",", *rest, ")"]:
                self._bas(command, self._number(rest))
            case ["MSGNOTIFY", "(", message, ",", module, ")"]:
                if self.ahead:
                    raise ReadError(f"{text}: said before the tool has arrived")
                if len(module) - 2 > NAME_LENGTH:
                    raise ReadError(text)
                self.run.events.append(Message(message.strip('"')))
            case [name, "(", *rest, ")"] if re.fullmatch(r"[A-Z_][A-Z0-9_]*", name):
                arguments = [self._value(part) for part in _split(rest)] if rest else []
                if arguments:
                    self.run.calls.append((name, tuple(arguments)))
                self.call(name, arguments)
            case _ if "=" in words:
                self._assign(words[: words.index("=")], words[words.index("=") + 1 :], text)
            case _:
                raise ReadError(f"{text}: not read")

    def _bas(self, command: str, value: float) -> None:
        if command == "#INITMOV":
            self.initialised = True
            self.speed, self.tool, self.base = None, "", ""
        elif not self.initialised:
            raise ReadError(f"BAS({command}) before #INITMOV")
        elif command == "#TOOL":
            self.tool = f"{value:g}"
        elif command == "#BASE":
            self.base = f"{value:g}"
        elif command == "#VEL_PTP":
            self.run.velocities.add(value)
        else:
            raise ReadError(f"BAS({command})")

    def _move(self, straight: bool, words: list[str]) -> None:
        if not (self.initialised and self.run.velocities):
            raise ReadError("a move before BAS has set speeds")
        self.ahead = True
        if straight and not self.settled:
            raise ReadError(f"LIN {words}: the first move, whatever the axes are at")
        self.settled = True
        if words == ["$H_POS"]:
            self.world.joints.update(self.home)
            self.run.events.append(Move(False))
            return
        target = self._value(words)
        if not isinstance(target, dict):
            raise ReadError(f"{words}: no place")
        if set(target) & set(AXES):
            if straight:
                raise ReadError("LIN to axes")
            self.world.joints.update(target)
            self.run.events.append(Move(True, joints=dict(target)))
            return
        if not (self.tool and self.base):
            raise ReadError("a pose without tool and base")
        speed = None
        if straight:
            if self.speed is None:
                raise ReadError("LIN without $VEL.CP")
            speed = self.speed * 1000.0
        said = () if straight else tuple(int(target[part]) for part in STATUS if part in target)
        self.run.events.append(
            Move(straight, matrix(target), None, speed, self.tool, self.base, said)
        )

    def _wait_for(self, words: list[str]) -> None:
        """WAIT FOR $IN[n] OR $TIMER_FLAG[k]: asks the world once, else lets the time run out."""
        match words:
            case ["$IN", "[", number, "]", "OR", "$TIMER_FLAG", "[", timer, "]"]:
                index = int(timer)
            case _:
                raise ReadError(f"WAIT FOR {words}: would wait for ever, or is not read")
        if index not in self.running or self.timers.get(index, 0.0) >= 0.0:
            raise ReadError("the timer does not run")
        self.ahead = False
        came = self.world.comes(f"$IN[{number}]")
        limit = -self.timers[index]
        if not came:
            self._pass_time(limit)
        self.run.events.append(Await(f"$IN[{number}]", limit, came))

    def _pass_time(self, seconds: float) -> None:
        for timer in self.running:
            self.timers[timer] += seconds

    def _assign(self, left: list[str], right: list[str], text: str) -> None:
        match left:
            case ["$VEL", ".", "CP"]:
                self.speed = self._number(right)
                if not 0.0 < self.speed <= 3.0:
                    raise ReadError(text)
            case ["$OUT", "[", number, "]"]:
                # writing an output stops the advance run by itself
                self.ahead = False
                self.run.events.append(Output(f"$OUT[{number}]", self._bool(right)))
            case ["$ANOUT", "[", number, "]"]:
                if self.ahead:
                    raise ReadError(f"{text}: set before the tool has arrived")
                value = self._number(right)
                if not -1.0 <= value <= 1.0:
                    raise ReadError(text)
                self.run.events.append(Analog(f"$ANOUT[{number}]", value))
            case ["$TIMER", "[", number, "]"]:
                self.timers[int(number)] = self._number(right) / 1000.0
            case ["$TIMER_STOP", "[", number, "]"]:
                stop = self._bool(right)
                if not stop and self.ahead:
                    raise ReadError(f"{text}: started before the tool has arrived")
                (self.running.discard if stop else self.running.add)(int(number))
            case ["TOOL_DATA" | "BASE_DATA" | "LOAD_DATA" as table, "[", number, "]"]:
                if table == "LOAD_DATA":
                    self.run.load_data[int(number)] = " ".join(right)
                else:
                    data = self.run.tool_data if table == "TOOL_DATA" else self.run.base_data
                    data[int(number)] = _aggregate(right, "FRAME", text)
            case [name]:
                self._local(name)
                value = self._value(right)
                self.frames[-1][name] = dict(value) if isinstance(value, dict) else value
            case [name, ".", part]:
                self._local(name)
                self.frames[-1][name][part] = self._number(right)
            case _:
                raise ReadError(f"{text}: not read")

    def _local(self, name: str) -> None:
        if name not in self.frames[-1]:
            raise ReadError(f"{name} is not declared in {self.here.name}")

    # expressions: OR < AND < NOT < comparison < + - < * < : < sign < value

    def _number(self, words: Sequence[str]) -> float:
        value = self._value(words)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ReadError(f"{' '.join(words)}: {value!r} is no number")
        return float(value)

    def _bool(self, words: Sequence[str]) -> bool:
        value = self._value(words)
        if not isinstance(value, bool):
            raise ReadError(f"{' '.join(words)}: {value!r} is not TRUE or FALSE")
        return value

    def _value(self, words: Sequence[str]) -> Any:
        parser = _Expression(list(words), self)
        value = parser.comparison()
        if parser.rest:
            raise ReadError(f"{' '.join(words)}: {parser.rest} is left over")
        return value

    def lookup(self, name: str) -> Any:
        if name in self.frames[-1]:
            value = self.frames[-1][name]
        else:
            own = self.controller.data.get(self.here.scope, {})
            value = own[name] if name in own else self.controller.shared.get(name)
        if value is None or value == {}:
            raise ReadError(f"{name} has no value in {self.here.name}")
        return value


class _Expression:
    def __init__(self, words: list[str], machine: _Machine) -> None:
        self.rest = words
        self.machine = machine

    def take(self, *wanted: str) -> str | None:
        if self.rest and self.rest[0] in wanted:
            return self.rest.pop(0)
        return None

    def comparison(self) -> Any:
        left = self.sum()
        if sign := self.take("<", ">", "<=", ">=", "==", "<>"):
            right = self.sum()
            if sign not in ("<", ">"):
                raise ReadError(f"{sign}: not read")
            return left < right if sign == "<" else left > right
        return left

    def sum(self) -> Any:
        value = self.chain()
        while sign := self.take("+", "-"):
            other = self.chain()
            value = np.float64(value) + other if sign == "+" else np.float64(value) - other
            value = float(value)
        return value

    def chain(self) -> Any:
        value = self.single()
        while self.take(":"):
            product = matrix(value) @ matrix(self.single())
            value = {"matrix": product}
        return value

    def single(self) -> Any:
        if self.take("-"):
            return -self.single()
        word = self.rest.pop(0)
        if re.fullmatch(r"[0-9.]+", word):
            return float(word)
        if word in ("TRUE", "FALSE"):
            return word == "TRUE"
        if word == "$NULLFRAME":
            return dict.fromkeys(FRAME_PARTS, 0.0)
        if word == "$AXIS_ACT":
            self.machine.ahead = False
            return dict(self.machine.world.joints)
        if word == "$TIMER_FLAG":
            return self.machine.timers[int(self._index())] >= 0.0
        if word.startswith(("$", "#")) or not re.fullmatch(r"[A-Z_][A-Z0-9_]*", word):
            raise ReadError(f"{word}: not read")
        value = self.machine.lookup(word)
        if isinstance(value, list):
            return value[int(self._index()) - 1]
        if self.take("."):
            part = self.rest.pop(0)
            if part not in value:
                raise ReadError(f"{word}.{part} has no value")
            return value[part]
        return value

    def _index(self) -> str:
        if not self.take("["):
            raise ReadError("an index is missing")
        index = self.rest.pop(0)
        if not self.take("]"):
            raise ReadError("an index is not closed")
        return index


def _split(words: Sequence[str]) -> list[list[str]]:
    parts: list[list[str]] = [[]]
    for word in words:
        if word == ",":
            parts.append([])
        else:
            parts[-1].append(word)
    return parts


def matrix(frame: Mapping[str, Any]) -> Matrix:
    """{X, Y, Z, A, B, C} in mm and degrees as (4, 4): A about z, then B about y, then C about x."""
    if "matrix" in frame:
        product: Matrix = frame["matrix"]
        return product
    if not set(frame) >= set(FRAME_PARTS):
        raise ReadError(f"{frame}: components without a value")
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("ZYX", [frame[k] for k in "ABC"], degrees=True).as_matrix()
    pose[:3, 3] = [frame[k] for k in "XYZ"]
    return pose
