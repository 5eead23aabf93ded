"""A module's text into what it declares: data, positions in columns, heads of routines."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from lark import Token, Tree
from lark.tree import Meta

from ..alike import NAME_SLOT, NUMBER_SLOT, Stretch
from ..events import Floats, Ints
from ..reading import Finding, ReadError
from . import lines
from .data import Datum, Head, Module, Parameter, Place
from .quaternions import check_columns
from .syntax import Bulk, Node, parsed, subtrees
from .types import TYPES, Type, array_of

NAME_LENGTH = 32
_ATTRIBUTES = ("SYSMODULE", "NOVIEW", "NOSTEPIN", "VIEWONLY", "READONLY")
_SLOT = re.compile(f"[{NUMBER_SLOT}{NAME_SLOT}](\\d+)[{NUMBER_SLOT}{NAME_SLOT}]")


def read(index: int, file: int, path: str, raw: bytes, in_bulk: bool = True) -> Module:
    """Read the module in file number `file`. Raises ReadError."""
    text = lines.split(file, raw)
    syntax = parsed(file, text.code, in_bulk)
    title, attributes, *items = syntax.tree.children
    assert isinstance(title, Token)
    module = Module(str(title), index, file, _place(file, title), syntax.bulk, text.code)
    module.findings.extend(text.findings)
    _Declarations(module).read(attributes, [item for item in items if isinstance(item, Tree)])
    _check_title(module, path)
    # the texts of declarations are in columns now, and would take ten times their memory
    module.bulk = [
        replace(bulk, stretch=replace(bulk.stretch, columns=())) if bulk.data else bulk
        for bulk in module.bulk
    ]
    return module


def slot(token: Token) -> int | None:
    """The number of the slot that a token is, if it is one."""
    match = _SLOT.fullmatch(token)
    return int(match.group(1)) if match else None


def type_named(name: Token, known: Mapping[str, Type], file: int) -> Type:
    """The type of that name, in any case of letters. Raises ReadError."""
    kind = known.get(name.lower()) or TYPES.get(name.lower())
    if kind is None:
        raise error(file, name, f"{name} is no type of data that is read")
    return kind


def error(file: int, at: Token | Node, message: str) -> ReadError:
    """At a place of the tree."""
    if isinstance(at, Token):
        return ReadError(file, at.line or 1, at.column or 1, message)
    return ReadError(
        file, getattr(at.meta, "line", 1) or 1, getattr(at.meta, "column", 1) or 1, message
    )


def _place(file: int, token: Token) -> Place:
    return Place(file, token.line or 1, token.column or 1)


class _Declarations:
    """Fills a module with what its items declare."""

    def __init__(self, module: Module) -> None:
        self.module = module
        self.columns: dict[str, list[tuple[Floats, Ints, bool, bool]]] = {}

    def read(self, attributes: Node | Token | None, items: Sequence[Node]) -> None:
        module = self.module
        for word in attributes.children if isinstance(attributes, Tree) else ():
            if str(word).upper() not in _ATTRIBUTES:
                raise self.error(word, f"{word} is no attribute of a module")
        for item in items:
            match item.data:
                case "stretch":
                    bulk = module.bulk[int(str(item.children[0]).strip("\x03"))]
                    if not bulk.data:
                        raise self.error(item, "statements stand outside of all routines")
                    for number, declaration in enumerate(subtrees(bulk.tree)):
                        self.in_columns(bulk, declaration, number)
                case "declaration":
                    self.datum(item)
                case "record":
                    self.record(item)
                case "alias":
                    self.alias(item)
                case "procedure" | "function":
                    self.routine(item)
                case "trap":
                    raise self.error(item, "interrupts (TRAP) are not read")
        for name, parts in self.columns.items():
            module.positions[name].extend(parts)

    def error(self, at: Token | Node, message: str) -> ReadError:
        return error(self.module.file, at, message)

    def declared(self, name: Token) -> str:
        """A name in capital letters; notes what is wrong with it. Of two things that are called
        alike, the first is read."""
        if message := wrong_name(name):
            self.finding(name, message)
        upper = name.upper()
        if (line := self.line_of(upper)) is not None:
            self.finding(name, f"{name} is declared a second time; the first is in line {line}")
        return upper

    def line_of(self, upper: str) -> int | None:
        """Where a name of this module is declared."""
        if upper in self.module.data:
            return self.module.data[upper].place.line
        if upper in self.module.routines:
            return self.module.routines[upper].place.line
        return None

    def finding(self, at: Token, message: str) -> None:
        place = _place(self.module.file, at)
        self.module.findings.append(Finding("rules", place.file, place.line, place.column, message))

    # data

    def datum(self, item: Node) -> None:
        scope, storage, kind_name, name, sizes, value = item.children
        assert isinstance(kind_name, Token)
        assert isinstance(name, Token)
        kind = type_named(kind_name, self.module.types, self.module.file)
        if isinstance(sizes, Tree):
            kind = array_of(kind, self.sizes(sizes))
        upper = self.declared(name)
        if str(storage).upper() == "CONST" and value is None:
            raise self.error(name, f"constant {name} has no value")
        datum = Datum(
            str(name),
            kind,
            str(storage).upper(),
            str(scope).upper() == "LOCAL",
            self.module.index,
            _place(self.module.file, name),
            value if isinstance(value, Tree) else None,
        )
        if self.line_of(upper) is None:
            self.module.data[upper] = datum

    def sizes(self, sizes: Node) -> tuple[int, ...]:
        return array_sizes(sizes, self.module.file)

    def in_columns(self, bulk: Bulk, item: Node, number: int) -> None:
        """A declaration of a stretch: all its positions at once, or each for itself."""
        scope, storage, kind_name, name, sizes, value = item.children
        assert isinstance(kind_name, Token)
        assert isinstance(name, Token)
        positions = self.module.positions.get(kind_name.lower())
        name_slot = slot(name)
        texts = list(_numbers(value)) if isinstance(value, Tree) else None
        shape = _shape_of(value) if isinstance(value, Tree) else None
        if (
            positions is None
            or name_slot is None
            or sizes is not None
            or texts is None
            or shape != _SHAPES[positions.kind.name]
        ):
            self.one_by_one(bulk, item, number)
            return
        names = [text.upper() for text in bulk.stretch.columns[name_slot]]
        file_lines = np.ascontiguousarray(bulk.stretch.lines()[:, number])
        start = len(positions.rows)
        rows = dict(zip(names, range(start, start + len(names)), strict=True))
        if len(rows) < len(names) or rows.keys() & positions.rows.keys():
            self.one_by_one(bulk, item, number)
            return
        table = np.empty((len(texts), len(names)))
        for i, text in enumerate(texts):
            table[i] = _column(bulk.stretch, text)
        positions.rows.update(rows)
        if len(max(names, key=len)) > NAME_LENGTH:
            for text, line in zip(names, file_lines.tolist(), strict=True):
                if message := wrong_name(text):
                    self.module.findings.append(
                        Finding("rules", self.module.file, line, 1, message)
                    )
        self.columns.setdefault(positions.kind.name, []).append(
            (
                table,
                file_lines,
                str(scope).upper() == "LOCAL",
                str(storage).upper() == "CONST",
            )
        )
        if positions.kind.name == "robtarget":
            columns = [_texts(bulk.stretch, text) for text in texts[3:7]]
            for row, message in check_columns(columns, table[3:7]):
                self.module.findings.append(
                    Finding(
                        "quaternions",
                        self.module.file,
                        int(file_lines[row]),
                        1,
                        f"{bulk.stretch.columns[name_slot][row]}: {message}",
                    )
                )

    def one_by_one(self, bulk: Bulk, item: Node, number: int) -> None:
        for row in range(bulk.stretch.count):
            line = bulk.stretch.first + row * len(bulk.stretch.text) + number
            self.datum(filled(item, bulk.stretch, row, line))

    def record(self, item: Node) -> None:
        _, name, *components = item.children
        assert isinstance(name, Token)
        parts = []
        for component in components:
            assert isinstance(component, Tree)
            kind, part = component.children
            assert isinstance(kind, Token)
            parts.append((str(part).lower(), type_named(kind, self.module.types, self.module.file)))
        self.declared(name)
        self.module.types[name.lower()] = Type(name.lower(), tuple(parts))

    def alias(self, item: Node) -> None:
        _, kind, name = item.children
        assert isinstance(kind, Token)
        assert isinstance(name, Token)
        self.declared(name)
        self.module.types[name.lower()] = type_named(kind, self.module.types, self.module.file)

    # routines

    def routine(self, item: Node) -> None:
        scope, *kind_name, name, parameters, body = item.children
        assert isinstance(name, Token)
        assert isinstance(body, Tree)
        result = None
        if kind_name:
            assert isinstance(kind_name[0], Token)
            result = type_named(kind_name[0], self.module.types, self.module.file)
        upper = self.declared(name)
        head = Head(
            str(name),
            tuple(self.parameters(parameters) if isinstance(parameters, Tree) else ()),
            result,
            str(scope).upper() == "LOCAL",
            self.module.index,
            _place(self.module.file, name),
            body,
        )
        if self.line_of(upper) is None:
            self.module.routines[upper] = head

    def parameters(self, parameters: Node) -> Iterator[Parameter]:
        for item in subtrees(parameters):
            optional = item.data == "optional"
            for parameter in subtrees(item) if optional else [item]:
                mode, kind_name, name, stars = parameter.children
                assert isinstance(kind_name, Token)
                assert isinstance(name, Token)
                if stars is not None:
                    raise self.error(name, f"{name}: arrays as parameters are not read")
                if message := wrong_name(name):
                    self.finding(name, message)
                switch = optional and kind_name.lower() == "switch"
                kind = (
                    TYPES["bool"]
                    if switch
                    else type_named(kind_name, self.module.types, self.module.file)
                )
                yield Parameter(name.upper(), kind, mode is not None, optional, switch)


def array_sizes(sizes: Node, file: int) -> tuple[int, ...]:
    """The sizes in { } of a declaration. Raises ReadError."""
    found = []
    for size in sizes.children:
        text = str(size.children[0]) if isinstance(size, Tree) and size.data == "number" else ""
        if not text.isdigit() or int(text) < 1:
            raise error(file, size, "the size of an array is no whole number")
        found.append(int(text))
    if len(found) > 3:
        raise error(file, sizes, "an array has at most three dimensions")
    return tuple(found)


def wrong_name(name: str) -> str:
    """What is wrong with a name, or nothing."""
    if len(name) > NAME_LENGTH:
        return f"name {name} has {len(name)} characters; {NAME_LENGTH} are taken"
    if not name[:1].isalpha():
        return f"name {name} does not begin with a letter"
    return ""


def _check_title(module: Module, path: str) -> None:
    stem = path.rsplit("/", 1)[-1].rsplit(".", 1)[0]
    place = module.place

    def finding(message: str) -> None:
        module.findings.append(Finding("rules", place.file, place.line, place.column, message))

    if message := wrong_name(module.name):
        finding(message)
    if module.name.lower() != stem.lower():
        finding(f"module {module.name} stands in a file of another name, {path.rsplit('/', 1)[-1]}")
    own = module.name.upper()
    if own in module.data or own in module.routines or module.position(own):
        finding(f"module {module.name} bears the name of something that it declares")


def filled(node: Node, stretch: Stretch, row: int, line: int) -> Node:
    """The tree of one line of a stretch, its slots filled; signs stay with their numbers."""

    def token(old: Token) -> Token:
        number = slot(old)
        text = old if number is None else stretch.columns[number][row].replace(" ", "")
        return Token(old.type, str(text), line=line, column=1)

    meta = Meta()  # type: ignore[no-untyped-call]
    meta.line, meta.column, meta.empty = line, 1, False
    return Tree(
        node.data,
        [
            filled(child, stretch, row, line)
            if isinstance(child, Tree)
            else (token(child) if isinstance(child, Token) else child)
            for child in node.children
        ],
        meta,
    )


# ── aggregates of numbers ────────────────────────────────────────────────────────────────────────


def _numbers(node: Node) -> Iterator[str]:
    """The numbers of an aggregate as texts, in order."""
    if node.data == "number":
        yield str(node.children[0])
    elif node.data == "signed" and isinstance(node.children[1], Tree):
        yield f"{node.children[0]}{next(_numbers(node.children[1]))}"
    elif node.data == "aggregate":
        for child in subtrees(node):
            yield from _numbers(child)


def _shape_of(node: Node) -> object:
    """How an aggregate of numbers is nested; a text where it holds something else."""
    if node.data == "aggregate":
        return tuple(_shape_of(child) for child in subtrees(node))
    if node.data == "number" or (
        node.data == "signed"
        and isinstance(node.children[1], Tree)
        and node.children[1].data == "number"
        and slot(node.children[1].children[0]) is None  # type: ignore[arg-type]
    ):
        return 1
    return node.data


def _shape_of_type(kind: Type) -> object:
    return tuple(_shape_of_type(part) for part in kind.parts) if kind.parts else 1


_SHAPES = {name: _shape_of_type(TYPES[name]) for name in ("robtarget", "jointtarget")}


def _texts(stretch: Stretch, text: str) -> Sequence[str]:
    """What a number of a stretch is in each line."""
    match = _SLOT.fullmatch(text)
    return stretch.columns[int(match.group(1))] if match else [text] * stretch.count


def _column(stretch: Stretch, text: str) -> float | Floats:
    if not _SLOT.fullmatch(text):
        return number_of(text)
    column = _texts(stretch, text)
    if column[0] == column[-1] and len(set(column)) == 1:
        return number_of(column[0])
    return numbers_of(column)


def numbers_of(texts: Sequence[str]) -> Floats:
    """A column of numbers."""
    try:
        return np.fromiter(map(float, texts), np.float64, len(texts))
    except ValueError:
        return np.array([number_of(text) for text in texts])


def number_of(text: str) -> float:
    """A number as RAPID writes it."""
    text = text.replace(" ", "").lower()
    for prefix, base in (("0x", 16), ("0b", 2)):
        if text.lstrip("-").startswith(prefix):
            return float(int(text, base))
    return float(text)
