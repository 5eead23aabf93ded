"""A mini RAPID controller: reads .pgf and .mod as text, checks them, and runs them.

It knows the words that drilling programs use and refuses all others. It shares no code with the
post; rotations are scipy's. What it checks beside running: line ends, ASCII, lengths of names and
texts, scopes, the shape of every target, the length of every quaternion, and that every position is
reached exactly (`fine`).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any
from xml.etree import ElementTree

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

NAME_LENGTH, STRING_LENGTH = 32, 80
NO_AXIS = 9e9
ROBOT = tuple(f"rax_{i}" for i in range(1, 7))
EXTERNAL = tuple(f"eax_{c}" for c in "abcdef")
TYPES = ("num", "bool", "robtarget", "jointtarget", "tooldata", "wobjdata")
_KEYWORDS = """
    module endmodule proc endproc if then endif while do endwhile var const pers local exit
    true false and or not else elseif for from to step endfor func return trap test case
""".split()  # noqa: SIM905 (a table of words)
_TOKEN = re.compile(
    r'\s*(?:(?P<num>\d+(?:\.\d+)?(?:E[+-]?\d+)?)|(?P<str>"(?:[^"]|"")*")|'
    r"(?P<name>[A-Za-z][A-Za-z0-9_]*)|(?P<op>:=|<=|>=|<>|[-+*/<>=(){}\[\],.;\\]))"
)


@dataclass
class Routine:
    name: str
    module: str
    parameters: list[tuple[str, str]]
    locals: list[tuple[str, str]]
    body: list[Any]


@dataclass
class Module:
    name: str
    data: dict[str, Any] = field(default_factory=dict)
    routines: dict[str, Routine] = field(default_factory=dict)
    local: set[str] = field(default_factory=set)


@dataclass
class Controller:
    modules: dict[str, Module] = field(default_factory=dict)


# ── reading ──────────────────────────────────────────────────────────────────────────────────────


def load(files: Mapping[str, bytes]) -> Controller:
    """Read the .pgf and the modules that it lists; raises ReadError."""
    by_name = {path.rsplit("/", 1)[-1]: raw for path, raw in files.items()}
    [listing] = [name for name in by_name if name.endswith(".pgf")]
    head = check_lines(listing, by_name[listing])[0]
    if head != '<?xml version="1.0" encoding="ISO-8859-1" ?>':
        raise ReadError(head)
    root = ElementTree.fromstring(by_name[listing])
    if root.tag != "Program" or {child.tag for child in root} != {"Module"}:
        raise ReadError(f"{listing}: {root.tag}")
    listed = [child.text or "" for child in root]
    if sorted(listed) != sorted(name for name in by_name if name.endswith(".mod")):
        raise ReadError(f"{listing} lists {listed}")
    controller = Controller()
    for name in listed:
        module = _Reader(name, by_name[name]).module()
        if f"{module.name}.mod" != name or module.name.lower() in controller.modules:
            raise ReadError(f"{name} holds module {module.name}")
        controller.modules[module.name.lower()] = module
    shared: list[str] = list(controller.modules)
    for module in controller.modules.values():
        shared += [n for n in (*module.data, *module.routines) if n not in module.local]
        own = {*module.data, *module.routines}
        if module.name.lower() in own:
            raise ReadError(f"module {module.name} holds a thing of its name")
    if len(set(shared)) != len(shared):
        raise ReadError(f"global names are not distinct: {sorted(shared)}")
    return controller


def check_lines(name: str, raw: bytes) -> list[str]:
    text = raw.decode("ascii")
    if text.count("\n") != text.count("\r\n") or not text.endswith("\r\n"):
        raise ReadError(f"{name}: lines end otherwise than in CRLF")
    lines = text.split("\r\n")[:-1]
    for number, line in enumerate(lines, 1):
        indent = len(line) - len(line.lstrip(" "))
        if "\r" in line or "\t" in line or line != line.rstrip() or indent % 2:
            raise ReadError(f"{name}:{number}: {line!r}")
    return lines


def _tokens(line: str) -> list[str]:
    found, at = [], 0
    while line[at:].strip() and not line[at:].lstrip().startswith("!"):
        match = _TOKEN.match(line, at)
        if match is None:
            raise ReadError(f"{line!r}: not RAPID at {line[at:]!r}")
        at = match.end()
        text = match.group().strip()
        if match["str"] and len(text) - 2 > STRING_LENGTH:
            raise ReadError(f"{text}: longer than {STRING_LENGTH}")
        if match["name"]:
            if len(text) > NAME_LENGTH:
                raise ReadError(f"{text}: longer than {NAME_LENGTH}")
            text = text.lower()
        found.append(text)
    return found


class _Reader:
    """One module's text into data and routines; every name is in lower case."""

    def __init__(self, name: str, raw: bytes) -> None:
        lines = check_lines(name, raw)
        self.name = name
        self.title = lines[0].split(" ")[-1]
        self.words = [word for line in lines for word in _tokens(line)]

    def expect(self, *wanted: str) -> None:
        for word in wanted:
            if not self.words or self.words[0] != word:
                raise ReadError(f"{self.name}: {word} was expected before {self.words[:8]}")
            self.words.pop(0)

    def take(self, *words: str) -> bool:
        if tuple(self.words[: len(words)]) == words:
            del self.words[: len(words)]
            return True
        return False

    def declared(self) -> str:
        name = self.words.pop(0)
        if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or name in (*_KEYWORDS, *TYPES):
            raise ReadError(f"{self.name}: {name} is no name")
        return name

    def type(self) -> str:
        kind = self.words.pop(0)
        if kind not in TYPES:
            raise ReadError(f"{self.name}: type {kind}")
        return kind

    def until(self, end: str) -> list[str]:
        at = self.words.index(end)
        part, self.words = self.words[:at], self.words[at + 1 :]
        return part

    def module(self) -> Module:
        self.expect("module", self.title.lower())
        module = Module(self.title)
        while not self.take("endmodule"):
            local = self.take("local")
            if self.take("proc"):
                if local:
                    raise ReadError("LOCAL PROC is not read")
                routine = self.routine(module)
                self.add(module, routine.name, routine, local)
                module.routines[routine.name] = routine
            elif self.take("const") or self.take("pers"):
                self.data(module, local)
            else:
                raise ReadError(f"{self.name}: {self.words[:8]}")
        if self.words:
            raise ReadError(f"{self.name}: {self.words[:8]} after ENDMODULE")
        return module

    def add(self, module: Module, name: str, value: Any, local: bool) -> None:
        if name in module.data or name in module.routines:
            raise ReadError(f"{self.name}: {name} is declared twice")
        if local:
            module.local.add(name)

    def data(self, module: Module, local: bool) -> None:
        kind, name = self.type(), self.declared()
        size = 0
        if self.take("{"):
            size = int(self.words.pop(0))
            self.expect("}")
        self.expect(":=")
        value = self.constant()
        self.expect(";")
        if size and (not isinstance(value, list) or len(value) != size):
            raise ReadError(f"{name}: {size} values were declared")
        if not size:
            value = _typed(kind, value, name)
        self.add(module, name, value, local)
        module.data[name] = value

    def constant(self) -> Any:
        if self.take("["):
            values = [self.constant()]
            while self.take(","):
                values.append(self.constant())
            self.expect("]")
            return values
        sign = -1.0 if self.take("-") else 1.0
        word = self.words.pop(0)
        if word.startswith('"'):
            return word.strip('"')
        if word in ("true", "false"):
            return word == "true"
        if not re.fullmatch(r"[0-9.E+-]+", word):
            raise ReadError(f"{self.name}: {word} is no constant")
        return sign * float(word)

    def routine(self, module: Module) -> Routine:
        name = self.declared()
        self.expect("(")
        parameters = []
        while not self.take(")"):
            kind = self.type()
            parameters.append((kind, self.declared()))
            self.take(",")
        own = []
        while self.take("var"):
            kind = self.type()
            own.append((kind, self.declared()))
            self.expect(";")
        names = [n for _, n in parameters + own]
        if len(set(names)) != len(names):
            raise ReadError(f"{name}: {names}")
        return Routine(name, module.name.lower(), parameters, own, self.block("endproc"))

    def block(self, end: str) -> list[Any]:
        statements: list[Any] = []
        while not self.take(end):
            if self.take("if"):
                condition = self.until("then")
                statements.append(("if", condition, self.block("endif")))
            elif self.take("while"):
                condition = self.until("do")
                statements.append(("while", condition, self.block("endwhile")))
            elif not self.words or (self.words[0] in _KEYWORDS and self.words[0] != "exit"):
                raise ReadError(f"{self.name}: {self.words[:8]} where a statement was expected")
            else:
                statements.append(("do", self.until(";")))
        return statements


def _typed(kind: str, value: Any, name: str) -> Any:
    """The value of one piece of data, its shape checked."""

    def shaped(part: Any, *lengths: int) -> list[Any]:
        if not isinstance(part, list) or len(part) != len(lengths):
            raise ReadError(f"{name}: {part}")
        for item, length in zip(part, lengths, strict=True):
            if length and (not isinstance(item, list) or len(item) != length):
                raise ReadError(f"{name}: {item} has not {length} parts")
        return part

    if kind == "robtarget":
        trans, rot, conf, ext = shaped(value, 3, 4, 4, 6)
        if any(part != int(part) for part in conf) or ext != [NO_AXIS] * 6:
            raise ReadError(f"{name}: {conf} {ext}")
        return {"matrix": pose([trans, rot]), "conf": tuple(int(part) for part in conf)}
    if kind == "jointtarget":
        robax, extax = shaped(value, 6, 6)
        return {
            "robax": dict(zip(ROBOT, robax, strict=True)),
            "extax": dict(zip(EXTERNAL, extax, strict=True)),
        }
    if kind == "tooldata":
        held, frame, load = shaped(value, 0, 2, 6)
        mass, centre = load[:2]
        if held is not True or load[2:] != [[1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0]:
            raise ReadError(f"{name}: {load}")
        return {"matrix": pose(frame), "mass": mass, "centre": centre}
    if kind == "wobjdata":
        held, fixed, unit, user, own = shaped(value, 0, 0, 0, 2, 2)
        if (held, fixed, unit) != (False, True, "") or not np.array_equal(pose(own), np.eye(4)):
            raise ReadError(f"{name}: {value}")
        return {"matrix": pose(user)}
    raise ReadError(f"{name}: a constant {kind} is not read")


def pose(parts: Sequence[Sequence[float]]) -> Matrix:
    """[[x,y,z],[q1,q2,q3,q4]], q1 the scalar, as (4, 4)."""
    trans, rot = parts
    if abs(float(np.linalg.norm(rot)) - 1.0) > 1.5e-8:
        raise ReadError(f"{rot} has length {np.linalg.norm(rot)}")
    w, x, y, z = rot
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_quat([x, y, z, w]).as_matrix()
    matrix[:3, 3] = trans
    return matrix


# ── running ──────────────────────────────────────────────────────────────────────────────────────


class _ExitError(Exception):
    """EXIT: the program pointer is gone."""


@dataclass
class Run:
    events: list[Event] = field(default_factory=list)
    speeds: list[tuple[float, ...]] = field(default_factory=list)
    calls: list[tuple[str, tuple[Any, ...]]] = field(default_factory=list)


def run(
    controller: Controller,
    world: World | None = None,
    signals: Sequence[str] = (),
    known: Sequence[str] = ("tool0", "wobj0"),
    main: str = "main",
) -> Run:
    """Run the program. `signals` and `known` are what the cell itself has, beside RAPID's own."""
    machine = _Machine(controller, world or World(), [s.lower() for s in signals], known)
    try:
        machine.call(main, [])
    except _ExitError:
        machine.run.events.append(Stop())
    return machine.run


class _Machine:
    def __init__(
        self, controller: Controller, world: World, signals: Sequence[str], known: Sequence[str]
    ) -> None:
        self.controller = controller
        self.world = world
        self.signals = signals
        self.known = [name.lower() for name in known]
        self.run = Run()
        self.watched = {"confj": True, "confl": True}  # as the controller has it at first
        self.frames: list[dict[str, Any]] = []
        self.here: Routine

    def call(self, name: str, arguments: list[Any]) -> None:
        found = [m.routines[name] for m in self.controller.modules.values() if name in m.routines]
        if not found:
            raise ReadError(f"{name} is not known")
        [routine] = found
        if len(arguments) != len(routine.parameters):
            raise ReadError(f"{name} takes {routine.parameters}, not {arguments}")
        frame: dict[str, Any] = {}
        for (kind, parameter), value in zip(routine.parameters, arguments, strict=True):
            if not _is(kind, value):
                raise ReadError(f"{name}: {parameter} is no {kind}")
            frame[parameter] = value
        for kind, variable in routine.locals:
            frame[variable] = {"num": 0.0, "bool": False}.get(kind, {"of": kind})
        before = getattr(self, "here", None)
        self.here = routine
        self.frames.append(frame)
        self._block(routine.body)
        self.frames.pop()
        if before is not None:
            self.here = before

    def _block(self, statements: Sequence[Any]) -> None:
        for kind, head, *body in statements:
            if kind == "if":
                if self._bool(head):
                    self._block(body[0])
            elif kind == "while":
                while self._bool(head):
                    self._block(body[0])
            else:
                self._statement(head)

    def _statement(self, words: list[str]) -> None:
        if words == ["exit"]:
            raise _ExitError
        if ":=" in words and words[1] in (".", ":="):
            self._assign(words)
            return
        name, parts = words[0], _split(words[1:])
        match name:
            case "confj" | "confl":
                if words[1:-1] != ["\\"] or words[-1] not in ("on", "off"):
                    raise ReadError(f"{words}")
                self.watched[name] = words[-1] == "on"
            case "movej" | "movel":
                self._move(name == "movel", parts)
            case "moveabsj":
                self._move_axes(parts)
            case "setdo":
                value = self._number(parts[1])
                self.run.events.append(Output(self._signal(parts[0]), bool(int(value))))
                if value not in (0.0, 1.0):
                    raise ReadError(f"{words}")
            case "setao":
                self.run.events.append(Analog(self._signal(parts[0]), self._number(parts[1])))
            case "waittime":
                self.run.events.append(Pause(self._number(parts[0])))
            case "waitdi":
                self._wait(parts)
            case "tpwrite":
                [[text]] = parts
                self.run.events.append(Message(text.strip('"')))
            case _:
                arguments = [self._value(part) for part in parts if part]
                if arguments:
                    self.run.calls.append((name, tuple(arguments)))
                self.call(name, arguments)

    def _signal(self, words: Sequence[str]) -> str:
        [name] = words
        shadows = [*self.frames[-1], *self.controller.modules[self.here.module].data]
        if name not in self.signals or name in shadows:
            raise ReadError(f"{name} is no signal here")
        return name

    def _wait(self, parts: list[list[str]]) -> None:
        match parts:
            case [[name], ["1", "\\", "maxtime", ":=", limit, "\\", "timeflag", ":=", flag]]:
                seconds = float(limit)
                if self.frames[-1].get(flag) not in (True, False):
                    raise ReadError(f"{flag} is no bool here")
            case _:
                raise ReadError(f"WaitDI {parts}: would wait for ever, or is not read")
        came = self.world.comes(self._signal([name]))
        self.frames[-1][flag] = not came
        self.run.events.append(Await(name, seconds, came))

    def _move(self, straight: bool, parts: list[list[str]]) -> None:
        if self.watched["confl" if straight else "confj"]:
            raise ReadError("a move with configurations watched")
        target, speed, zone, tool = parts
        if zone != ["fine"]:
            raise ReadError(f"{zone}: not reached exactly")
        if speed[:4] != ["v100", "\\", "v", ":="]:
            raise ReadError(f"{speed}")
        mm_s = self._number(speed[4:])
        match tool:
            case [tool_name, "\\", "wobj", ":=", frame]:
                pass
            case _:
                raise ReadError(f"{tool}: no tool\\WObj")
        for name in (tool_name, frame):
            if name not in self.known:
                self.lookup(name)
        value = self._value(target)
        if not _is("robtarget", value):
            raise ReadError(f"{target}: no robtarget")
        self.run.events.append(
            Move(straight, value["matrix"], speed=mm_s, tool=tool_name, frame=frame)
        )

    def _move_axes(self, parts: list[list[str]]) -> None:
        place, speed, zone, tool = parts
        if place[1:] != ["\\", "noeoffs"] or zone != ["fine"]:
            raise ReadError(f"{parts}")
        [tool_name] = tool
        if tool_name not in self.known:
            self.lookup(tool_name)
        if speed[:4] == ["v100", "\\", "v", ":="]:
            tcp = linear = self._number(speed[4:])
        elif (speed[0], speed[2::2], len(speed)) == ("[", [",", ",", ",", "]"], 9):
            tcp, turn, linear, rotary = (float(word) for word in speed[1::2])
            self.run.speeds.append((tcp, turn, linear, rotary))
        else:
            raise ReadError(f"{speed}: no speeddata")
        value = self._value(place[:1])
        if not _is("jointtarget", value):
            raise ReadError(f"{place}: no jointtarget")
        moved = set()
        for axis, to in {**value["robax"], **value["extax"]}.items():
            if to == NO_AXIS:
                continue
            if axis not in self.world.joints:
                raise ReadError(f"{axis} does not exist in this machine")
            if self.world.joints[axis] != to:
                moved.add(axis)
            self.world.joints[axis] = to
        if moved & set(ROBOT) and tcp != linear:
            raise ReadError("robot and external axes at different speeds")
        self.run.events.append(Move(True, joints=dict(self.world.joints), speed=linear))

    def _assign(self, words: list[str]) -> None:
        at = words.index(":=")
        name, *path = words[:at]
        value = self._value(words[at + 1 :])
        frame = self.frames[-1]
        if name not in frame:
            raise ReadError(f"{name} is not declared in {self.here.name}")
        parts = [word for word in path if word != "."]
        if not parts:
            frame[name] = value
            return
        group, axis = parts
        if axis not in frame[name].get(group, {}):
            raise ReadError(f"{' '.join(words)}: no such component, or the others have no value")
        if not isinstance(value, float):
            raise ReadError(f"{' '.join(words)}: {value}")
        frame[name] = {**frame[name], group: {**frame[name][group], axis: value}}

    # expressions

    def _number(self, words: Sequence[str]) -> float:
        value = self._value(words)
        if not isinstance(value, float):
            raise ReadError(f"{' '.join(words)}: {value!r} is no num")
        return value

    def _bool(self, words: Sequence[str]) -> bool:
        value = self._value(words)
        if not isinstance(value, bool):
            raise ReadError(f"{' '.join(words)}: {value!r} is no bool")
        return value

    def _value(self, words: Sequence[str]) -> Any:
        rest = list(words)
        value = self._compare(rest)
        if rest:
            raise ReadError(f"{' '.join(words)}: {rest} is left over")
        return value

    def _compare(self, rest: list[str]) -> Any:
        value = self._sum(rest)
        if rest and rest[0] in ("<", ">"):
            return value < self._sum(rest) if rest.pop(0) == "<" else value > self._sum(rest)
        return value

    def _sum(self, rest: list[str]) -> Any:
        value = self._single(rest)
        while rest and rest[0] in ("+", "-"):
            sign = 1.0 if rest.pop(0) == "+" else -1.0
            value = float(value) + sign * float(self._single(rest))
        return value

    def _single(self, rest: list[str]) -> Any:
        word = rest.pop(0)
        if word == "-":
            return -self._single(rest)
        if word == "(":
            value = self._sum(rest)
            _pop(rest, ")")
            return value
        if re.fullmatch(r"[0-9.]+", word):
            return float(word)
        if word == "cjointt":
            _pop(rest, "(", ")")
            return self._where()
        if word == "reltool":
            _pop(rest, "(")
            numbers = []
            base = self._single(rest)
            while rest[0] == ",":
                _pop(rest, ",")
                numbers.append(self._sum(rest))
            _pop(rest, ")")
            if not _is("robtarget", base) or len(numbers) != 3:
                raise ReadError("RelTool takes a robtarget and three nums")
            shift = np.eye(4)
            shift[:3, 3] = numbers
            return {"matrix": base["matrix"] @ shift}
        value = self.lookup(word)
        while rest and rest[0] in (".", "{"):
            if rest.pop(0) == ".":
                value = value[rest.pop(0)]
            else:
                value = value[int(self._sum(rest)) - 1]
                _pop(rest, "}")
        return value

    def _where(self) -> Any:
        here = {axis: self.world.joints.get(axis, NO_AXIS) for axis in (*ROBOT, *EXTERNAL)}
        return {
            "robax": {axis: here[axis] for axis in ROBOT},
            "extax": {axis: here[axis] for axis in EXTERNAL},
        }

    def lookup(self, name: str) -> Any:
        if name in self.frames[-1]:
            return self.frames[-1][name]
        for module in self.controller.modules.values():
            own = module.name.lower() == self.here.module
            if name in module.data and (own or name not in module.local):
                return module.data[name]
        raise ReadError(f"{name} is not known in {self.here.name}")


def _is(kind: str, value: Any) -> bool:
    match kind:
        case "num":
            return isinstance(value, float)
        case "robtarget":
            return isinstance(value, dict) and "matrix" in value
        case "jointtarget":
            return isinstance(value, dict) and set(value) == {"robax", "extax"}
    return False


def _pop(rest: list[str], *wanted: str) -> None:
    for word in wanted:
        if not rest or rest.pop(0) != word:
            raise ReadError(f"{word} was expected before {rest}")


def _split(words: Sequence[str]) -> list[list[str]]:
    """Arguments, cut at commas outside of brackets."""
    parts: list[list[str]] = [[]]
    depth = 0
    for word in words:
        depth += (word in "([{") - (word in ")]}")
        if word == "," and depth == 0:
            parts.append([])
        else:
            parts[-1].append(word)
    return parts
