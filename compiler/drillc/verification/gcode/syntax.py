"""What a line of G-code says, as data: parsed by `grammars/gcode.lark`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from lark import Lark, Token, Transformer, v_args
from lark.exceptions import UnexpectedInput, UnexpectedToken

from .text import GAP, MESSAGE, SLOT


class Misread(Exception):  # noqa: N818
    """A line is not what LinuxCNC, or the reader, understands, at a character of its shape."""

    def __init__(self, position: int, message: str) -> None:
        super().__init__(message)
        self.position, self.message = position, message


@dataclass(frozen=True)
class Slot:
    """The line's own number, by its place among the line's numbers."""

    index: int


@dataclass(frozen=True)
class Constant:
    value: float


@dataclass(frozen=True)
class Numbered:
    """Parameter `#…`, whose number is a value itself."""

    index: Value


@dataclass(frozen=True)
class Named:
    """Parameter `#<name>`."""

    name: str


@dataclass(frozen=True)
class Operation:
    """A function or an operator, and what it is applied to."""

    name: str
    operands: tuple[Value, ...]


@dataclass(frozen=True)
class Exists:
    parameter: Numbered | Named


Value = Slot | Constant | Numbered | Named | Operation | Exists


@dataclass(frozen=True)
class Word:
    letter: str
    value: Value
    position: int


@dataclass(frozen=True)
class Setting:
    """`#… = value`."""

    parameter: Numbered | Named
    value: Value


@dataclass(frozen=True)
class Message:
    """A comment that tells the operator something."""


@dataclass(frozen=True)
class Control:
    """An O-word: `kind` is sub, call, if, …; `label` its number or name."""

    kind: str
    label: str
    values: tuple[Value, ...]
    deletable: bool
    message: bool


@dataclass(frozen=True)
class Block:
    """A line that is no O-word."""

    items: tuple[Word | Setting | Message, ...]
    deletable: bool

    @property
    def words(self) -> tuple[Word, ...]:
        return tuple(item for item in self.items if isinstance(item, Word))

    @property
    def settings(self) -> tuple[Setting, ...]:
        return tuple(item for item in self.items if isinstance(item, Setting))


Line = Control | Block

#: What a reader of other languages may have expected, at the character that was not understood.
_HINTS = {
    ",": "a number has a decimal point, no comma",
    ".": "a number has one decimal point",
    "%": "% stands alone in the first line, and in the last one",
    "n": "a line's number N stands first",
    "o": "an O-word stands first",
}


def parsed(shape: str) -> Line:
    """What a line says. Raises Misread."""
    try:
        tree = _parser().parse(shape)
    except UnexpectedInput as error:
        position = error.pos_in_stream
        if isinstance(error, UnexpectedToken) and error.token.type == "$END":
            position = None
        if position is None or not 0 <= position < len(shape):
            position = len(shape)
        raise Misread(position, _complaint(shape, position)) from None
    line: Line = _Lowering(shape).transform(tree)
    return line


def _complaint(shape: str, position: int) -> str:
    if position == len(shape):
        return "the line ends where more is expected"
    if shape[position] == SLOT:
        return "a number where none is expected"
    if shape[position] in (MESSAGE, GAP):
        return "a comment where none is expected"
    hint = _HINTS.get(shape[position])
    return f"{shape[position]!r} is not understood here" + (f": {hint}" if hint else "")


@cache
def _parser() -> Lark:
    grammar = files("drillc.grammars").joinpath("gcode.lark").read_text("utf-8")
    return Lark(grammar, start="line", parser="lalr", maybe_placeholders=False)


@v_args(inline=True)
class _Lowering(Transformer[Token, Any]):
    """From the parser's tree to the data above."""

    def __init__(self, shape: str) -> None:
        super().__init__()
        places = [i for i, c in enumerate(shape) if c == SLOT]
        self._slots = {place: index for index, place in enumerate(places)}

    def number(self, token: Token) -> Value:
        if token.type == "SLOT":
            assert token.start_pos is not None
            return Slot(self._slots[token.start_pos])
        return Constant(float(token))

    def place(self, of: Token | Value) -> Numbered | Named:
        return Named(str(of)[1:-1]) if isinstance(of, Token) else Numbered(of)

    def parameter(self, place: Numbered | Named) -> Numbered | Named:
        return place

    def negative(self, *parts: Value) -> Value:
        return Operation("negative", (parts[-1],))

    def binary(self, left: Value, operator: Token, right: Value) -> Value:
        return Operation(str(operator), (left, right))

    def call_of(self, function: Token, operand: Value) -> Value:
        return Operation(str(function), (operand,))

    def atan(self, above: Value, _: Token, below: Value) -> Value:
        return Operation("atan", (above, below))

    def exists(self, place: Numbered | Named) -> Value:
        return Exists(place)

    def word(self, letter: Token, value: Value) -> Word:
        assert letter.start_pos is not None
        return Word(str(letter), value, letter.start_pos)

    def setting(self, place: Numbered | Named, value: Value) -> Setting:
        return Setting(place, value)

    def item(self, item: Any) -> Word | Setting | Message | None:
        if not isinstance(item, Token):
            said: Word | Setting = item
            return said
        return Message() if item.type == "MESSAGE" else None

    def label(self, token: Token) -> str:
        text = str(token)
        return text[1:-1] if token.type == "NAME" else text

    def plain(self, word: Token) -> tuple[str, tuple[Value, ...]]:
        return str(word), ()

    def may_return(self, word: Token, *values: Value) -> tuple[str, tuple[Value, ...]]:
        return str(word), values

    tested = may_return

    def call(self, word: Token, *values: Any) -> tuple[str, tuple[Value, ...]]:
        return str(word), tuple(value for value in values if not isinstance(value, Token))

    def control(self, label: str, what: tuple[str, tuple[Value, ...]], *message: Token) -> Control:
        return Control(
            what[0], label, what[1], False, any(token.type == "MESSAGE" for token in message)
        )

    def number_word(self, *_: Token) -> None:
        return None

    def line(self, *parts: Any) -> Line:
        deletable = any(isinstance(part, Token) for part in parts)
        kept = [part for part in parts if part is not None and not isinstance(part, Token)]
        if len(kept) == 1 and isinstance(kept[0], Control):
            said = kept[0]
            return Control(said.kind, said.label, said.values, deletable, said.message)
        return Block(tuple(kept), deletable)
