"""WAIT FOR: an input, an input or a timer, or what is known: that stops the advance run."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from lark import Tree

from drillc.verification.events import Kind
from drillc.verification.machine import UNDECIDED, Machine

from . import arithmetic as ar
from .expressions import Expressions, described
from .references import Evaluate
from .scope import Scope
from .state import arrive, pass_time
from .system import timer_of
from .tree import Node, plain_name, upper


@dataclass(frozen=True)
class _Input:
    """$IN[place] is to be `on`."""

    place: Evaluate
    on: bool


def waiting(
    tree: Any, scope: Scope, values: Expressions, going_on: bool
) -> Callable[[Machine], None]:
    """The act of WAIT FOR. Raises ReadError."""
    tree = _bare(tree)
    parts = _alternatives(tree)
    inputs = [one for part in parts if (one := _input(part, scope, values)) is not None]
    timers = [flag for part in parts if (flag := _timer(part, values)) is not None]
    if inputs and len(inputs) + len(timers) == len(parts):
        if len(inputs) > 1 or len(timers) > 1:
            raise scope.fail(tree, "WAIT FOR more than one input or timer is not read")
        return _for_input(inputs[0], timers[0] if timers else None, going_on)
    if _asks_inputs(tree, scope):
        raise scope.fail(tree, "WAIT FOR such a combination of inputs is not read")
    condition = values.value(tree)

    def act(m: Machine) -> None:
        found = ar.truth(m, condition(m))
        if found is UNDECIDED:
            raise m.fail("what is waited for is not known")
        if not (found.all() if hasattr(found, "all") else found):
            raise m.fail("what is waited for never comes")
        if not going_on:
            arrive(m)

    return act


def _for_input(wanted: _Input, timer: Evaluate | None, going_on: bool) -> Callable[[Machine], None]:
    def act(m: Machine) -> None:
        if not going_on:
            arrive(m)
        name = f"$IN[{ar.one(m, wanted.place(m), 'the number of $IN')}]"
        value = float(wanted.on)
        if timer is None:
            m.emit(Kind.WAIT, signal=m.signal(name), value=value, timeout_s=math.inf)
            pass_time(m, math.nan)
            return
        key, known = timer_of(m, timer)
        if math.isnan(known["ms"]):
            raise m.fail(f"how long it waits is not known: $TIMER[{key}] has no time, or runs on")
        runs = known["runs"]
        timeout_s = max(0.0, -known["ms"] / 1000.0) if runs or known["ms"] > 0.0 else math.inf
        if math.isinf(timeout_s):
            m.emit(Kind.WAIT, signal=m.signal(name), value=value, timeout_s=math.inf)
            came = True
        else:
            came = m.wait(name, value, timeout_s)
        pass_time(m, math.nan)
        if came:
            # in time: how much of it was left is not known
            m.state["timers"][key] = {"ms": math.nan, "runs": runs, "flag": 0.0}
        else:
            m.state["timers"][key] = {"ms": 0.0, "runs": runs, "flag": 1.0}

    return act


def _bare(tree: Any) -> Any:
    while isinstance(tree, Tree) and tree.data == "bracketed":
        tree = tree.children[0]
    return tree


def _alternatives(tree: Any) -> list[Any]:
    """The operands of OR."""
    tree = _bare(tree)
    if isinstance(tree, Tree) and tree.data == "either" and str(tree.children[1]).upper() == "OR":
        return [*_alternatives(tree.children[0]), *_alternatives(tree.children[2])]
    return [tree]


def _input(tree: Any, scope: Scope, values: Expressions) -> _Input | None:
    """$IN[n], NOT $IN[n], $IN[n]==TRUE, or the same of a signal's name."""
    tree = _bare(tree)
    if not isinstance(tree, Tree):
        return None
    if tree.data == "not" and str(tree.children[0]).upper() == "NOT":
        inner = _input(tree.children[1], scope, values)
        return None if inner is None else _Input(inner.place, not inner.on)
    if tree.data == "comparison":
        left, sign, right = tree.children
        right = _bare(right)
        if not isinstance(right, Tree) or right.data != "truth" or str(sign) not in ("==", "<>"):
            return None
        inner = _input(left, scope, values)
        same = (str(right.children[0]).upper() == "TRUE") == (str(sign) == "==")
        return None if inner is None else _Input(inner.place, inner.on == same)
    if tree.data != "reference":
        return None
    name = plain_name(tree)
    if name is not None:
        signal = scope.signal(name)
        if signal is None or signal.variable != "$IN" or signal.first != signal.last:
            return None
        return _Input(lambda m: signal.first, True)
    if upper(tree.children[0]) != "$IN":
        return None
    return _Input(values.index_of(tree), True)


def _timer(tree: Any, values: Expressions) -> Evaluate | None:
    """The number of the timer in $TIMER_FLAG[n]."""
    tree = _bare(tree)
    if not isinstance(tree, Tree):
        return None
    if tree.data == "comparison":
        left, sign, right = tree.children
        is_true = described(right).upper() == "TRUE" and str(sign) == "=="
        return _timer(left, values) if is_true else None
    if tree.data != "reference" or upper(tree.children[0]) != "$TIMER_FLAG":
        return None
    return values.index_of(tree)


def _asks_inputs(tree: Any, scope: Scope) -> bool:
    if not isinstance(tree, Tree):
        return False
    if tree.data == "reference" and _is_input(tree, scope):
        return True
    return any(_asks_inputs(child, scope) for child in tree.children)


def _is_input(tree: Node, scope: Scope) -> bool:
    name = upper(tree.children[0])
    signal = scope.signal(name)
    return name == "$IN" or (signal is not None and signal.variable == "$IN")
