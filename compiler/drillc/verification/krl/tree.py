"""Lines of KRL → syntax trees, by `grammars/krl.lark`; equal lines are parsed once."""

from __future__ import annotations

import functools
import re
from importlib.resources import files
from typing import Any

from lark import Lark, Token, Tree, UnexpectedCharacters, UnexpectedInput, UnexpectedToken

from drillc.verification.reading import ReadError

#: The library's trees, whose leaves it does not tell apart from branches.
Node = Tree[Any]

#: The blocks that a line can open or close, and what else a line can be.
_DECIMAL_COMMA = re.compile(r"\d,\d")


class Parser:
    """Parses lines, and remembers them."""

    def __init__(self) -> None:
        self._known: dict[str, Node] = {}

    def line(self, file: int, line: int, code: str) -> Node:
        """The tree of one line, which is not empty. Raises ReadError."""
        tree = self._known.get(code)
        if tree is None:
            try:
                tree = _lark().parse(code)
            except UnexpectedInput as error:
                column, message = _said(code, error)
                raise ReadError(file, line, column, message) from None
            self._known[code] = tree
        return tree


@functools.cache
def _lark() -> Lark:
    grammar = files("drillc.grammars").joinpath("krl.lark").read_text(encoding="utf-8")
    return Lark(grammar, parser="lalr", lexer="contextual", maybe_placeholders=True)


def _said(code: str, error: UnexpectedInput) -> tuple[int, str]:
    if isinstance(error, UnexpectedToken) and error.token.type == "$END":
        column, shown = len(code) + 1, ""
    elif isinstance(error, UnexpectedToken):
        column, shown = error.column, str(error.token)
    else:
        column = error.column
        shown = code[column - 1 :].split()[0] if isinstance(error, UnexpectedCharacters) else ""
    for match in _DECIMAL_COMMA.finditer(code):
        if match.start() < column <= match.end():
            return match.start() + 2, "a number has a decimal point, not a comma"
    if isinstance(error, UnexpectedToken) and error.token.type == "COMPARISON":
        return column, f"{shown} compares once more: put each comparison in brackets"
    if shown.startswith('"'):
        return column, "the text is not closed, or does not belong here"
    if not shown:
        return column, "the line ends before the statement does"
    return column, f"{shown} is not understood here"


# ── what is in a tree ────────────────────────────────────────────────────────────────────────────


def written(name: Any) -> str:
    """A name as it is written."""
    return str(name.children[0])


def upper(name: Any) -> str:
    """A name in upper case: KRL has no other."""
    return str(name.children[0]).upper()


def column_of(tree: Any) -> int:
    """The column where something begins, counted from 1."""
    while isinstance(tree, Tree):
        tree = next((child for child in tree.children if child is not None), None)
    return tree.column or 1 if isinstance(tree, Token) else 1


def has(tree: Node, kind: str) -> bool:
    """Whether one of the tree's own tokens is of this kind."""
    return any(isinstance(child, Token) and child.type == kind for child in tree.children)


def modifiers(tree: Node) -> set[str]:
    """DECL, GLOBAL and CONST, as far as a declaration has them."""
    return {str(part.children[0]).upper() for part in trees(tree, "modifier")}


def trees(tree: Node, kind: str) -> list[Node]:
    """The tree's own children of a kind."""
    return [child for child in tree.children if isinstance(child, Tree) and child.data == kind]


def plain_name(tree: Any) -> str | None:
    """The name, in upper case, of a reference that is nothing but a name."""
    if isinstance(tree, Tree) and tree.data == "reference" and len(tree.children) == 1:
        return upper(tree.children[0])
    return None


def slot_of(name: Any) -> int | None:
    """The number of the slot, if a name or number stands for one."""
    token = name.children[0]
    text = str(token)
    return int(text[1:-1]) if text[0] in "\x01\x02" else None


def number_of(tree: Any) -> float | int | None:
    """The value of a plain number, with its sign."""
    sign = 1
    while isinstance(tree, Tree) and tree.data == "minus":
        sign, tree = -sign, tree.children[0]
    if not isinstance(tree, Tree) or tree.data != "number":
        return None
    text = str(tree.children[0])
    if text[0] == "\x01":
        return None
    return sign * (int(text) if text.isdigit() else float(text))
