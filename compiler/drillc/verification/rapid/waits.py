"""Waits that may run out, in the program's frame.

The machine runs the frame's statements one after another, and looks at both ways of a wait within
one statement only. So a wait and what is done when it ran out are put together.
"""

from __future__ import annotations

from collections.abc import Sequence

from lark import Tree

from ..statements import Call, If, Repeated, Statement
from .syntax import Node, subtrees


def has_flag(tree: Node) -> bool:
    """Whether it is a wait that says in a variable whether it ran out."""
    arguments = tree.children[1] if tree.data == "call" else None
    return isinstance(arguments, Tree) and any(
        option.data == "option" and str(option.children[0]).lower() == "timeflag"
        for option in subtrees(arguments)
    )


def is_outermost(statement: Statement) -> bool:
    """Whether it can only be run as a statement of the program's frame."""
    return isinstance(statement, Repeated) or (
        isinstance(statement, Call) and statement.routine().steps
    )


def together(statements: Sequence[Statement]) -> Statement:
    """A wait and what is done when it ran out, as one statement of the frame: so the machine looks
    at both ways."""
    at = statements[0].at  # type: ignore[union-attr]  # none is Repeated
    return If(at, lambda m: True, tuple(statements))
