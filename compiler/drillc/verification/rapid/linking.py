"""Modules that are loaded together become one program."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from lark import Token, Tree

from .data import Head, Module, column_of
from .expressions import link
from .lowering import Lowering
from .modules import slot
from .program import Program
from .syntax import Bulk, Node, subtrees
from .types import JOINTTARGET, ROBTARGET

#: Instructions that change what they are given first.
_CHANGING = ("incr", "decr", "add", "clear")


def linked(modules: Sequence[Module]) -> Lowering:
    """What lowers the routines of the program. Raises ReadError where data cannot be given its
    value."""
    program = Program(modules, assigned_names(modules))
    program.calls = lowering = Lowering(program)
    for module in modules:
        for datum in module.data.values():
            if not datum.linked:
                link(program, datum)
    for module in modules:
        _into_tables(program, module)
    program.check_positions()
    return lowering


def _into_tables(program: Program, module: Module) -> None:
    """Single positions join those of stretches, so that calls may name both."""
    for kind in (ROBTARGET, JOINTTARGET):
        positions = module.positions[kind.name]
        parts = []
        for name, datum in list(module.data.items()):
            if datum.kind != kind or name in positions.rows:
                continue
            positions.rows[name] = len(positions.rows)
            line = np.array([datum.place.line], dtype=np.int32)
            parts.append((column_of(datum.value), line, datum.local, datum.storage == "CONST"))
            del module.data[name]
            if program.shared.get(name) is datum:
                del program.shared[name]
        positions.extend(parts)


# ── which names are given values ─────────────────────────────────────────────────────────────────


def assigned_names(modules: Sequence[Module]) -> frozenset[str]:
    """Names in capital letters that some statement gives a value, whatever they mean there."""
    routines = {name: head for module in modules for name, head in module.routines.items()}
    found: set[str] = set()
    for module in modules:
        for head in module.routines.values():
            found.update(_names(_given(head.body, routines), None))
        for bulk in module.bulk:
            if not bulk.data:
                found.update(_names(_given(bulk.tree, routines), bulk))
    return frozenset(found)


def _names(variables: Iterator[Node], bulk: Bulk | None) -> Iterator[str]:
    for variable in variables:
        token = variable.children[0]
        assert isinstance(token, Token)
        number = slot(token)
        if number is None:
            yield token.upper()
        elif bulk is not None:
            yield from (name.upper() for name in bulk.stretch.columns[number])


def _given(tree: Node, routines: Mapping[str, Head]) -> Iterator[Node]:
    """The variables that the statements under a tree give values."""
    for node in tree.iter_subtrees():
        if node.data == "assignment":
            yield subtrees(node)[0]
        elif node.data in ("call", "function_call"):
            name, arguments = node.children
            if isinstance(arguments, Tree):
                yield from _given_back(str(name), subtrees(arguments), routines)


def _given_back(
    name: str, arguments: Sequence[Node], routines: Mapping[str, Head]
) -> Iterator[Node]:
    head = routines.get(name.upper())
    needed = [p for p in head.parameters if not p.optional] if head else []
    by_name = {p.name for p in head.parameters if p.by_reference} if head else {"TIMEFLAG"}
    place = 0
    for argument in arguments:
        if argument.data == "option":
            option, value = argument.children
            if (
                isinstance(value, Tree)
                and value.data == "variable"
                and str(option).upper() in by_name
            ):
                yield value
            continue
        changed = name.lower() in _CHANGING and place == 0
        if head and place < len(needed):
            changed = needed[place].by_reference
        if changed and argument.data == "variable":
            yield argument
        place += 1
