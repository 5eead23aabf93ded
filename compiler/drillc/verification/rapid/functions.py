"""The controller's own functions: arithmetic, and the geometry of positions."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import repeat
from typing import Any

import numpy as np

from ..machine import UNDECIDED, Machine
from .arguments import Arguments
from .quaternions import about, inverse, plain, product, rotation, turned
from .state import joints_now, target_now
from .types import (
    BOOL,
    JOINTTARGET,
    NUM,
    ORIENT,
    POS,
    POSE,
    ROBTARGET,
    STRING,
    TOOLDATA,
    WOBJDATA,
    Type,
    Value,
    shaped,
)
from .variables import Typed


@dataclass(frozen=True)
class Function:
    """What a function takes in order, what by name, and what it gives. `apply` has the values in
    that order; an option that is not given is None."""

    takes: tuple[Type, ...]
    gives: Type
    apply: Callable[..., Value]
    options: Mapping[str, Type] | None = None


def call(function: Function, arguments: Arguments) -> Typed:
    """The value of a call. Raises ReadError."""
    options = function.options or {}
    arguments.count(len(function.takes))
    arguments.only(*options)
    parts = [arguments.of_type(i, kind) for i, kind in enumerate(function.takes)]
    named = [arguments.option(name, kind) for name, kind in options.items()]
    fixed = all(part.fixed for part in (*parts, *named) if part is not None)

    def value(m: Machine) -> Value:
        return function.apply(
            *(part.get(m) for part in parts),
            *(None if part is None else part.get(m) for part in named),
        )

    return Typed(function.gives, value, fixed)


def asks_machine(name: str, arguments: Arguments) -> Typed | None:
    """Functions whose value hangs on what the machine did; None: it is none of them."""
    scope = arguments.scope
    match name:
        case "cjointt":
            scope.program.asks = True
            arguments.count(0)
            arguments.only("taskname")
            return Typed(JOINTTARGET, joints_now)
        case "crobt" | "cpos":
            scope.program.asks = True
            arguments.count(0)
            arguments.only("tool", "wobj")
            from .motion import frame_numbers

            numbers = frame_numbers(arguments)
            if name == "crobt":
                return Typed(ROBTARGET, lambda m: target_now(m, *numbers(m)))
            return Typed(POS, lambda m: target_now(m, *numbers(m))[0])
        case "calcjointt" | "calcrobt":  # no kinematics here: nobody knows where that is
            kinds = (ROBTARGET, JOINTTARGET) if name == "calcjointt" else (JOINTTARGET, ROBTARGET)
            arguments.count(2)
            arguments.only("wobj")
            arguments.of_type(0, kinds[0])
            scope.named(arguments.given[1], TOOLDATA)
            if "wobj" in arguments.options:
                scope.named(arguments.options["wobj"], WOBJDATA)
            nowhere = shaped(kinds[1], repeat(math.nan))
            return Typed(kinds[1], lambda m: nowhere)
        case "doutput" | "testdi" | "dinput" | "aoutput" | "ainput":
            arguments.count(1)
            arguments.only()
            scope.signal(arguments.given[0])
            if name == "testdi":
                return Typed(BOOL, lambda m: UNDECIDED)
            return Typed(NUM, lambda m: math.nan)
        case "present":
            arguments.count(1)
            arguments.only()
            variable = str(arguments.given[0].children[0]).upper()
            if variable not in scope.variables:
                raise arguments.error("Present asks for a parameter")
            return Typed(BOOL, lambda m: m.locals[variable] is not None)
    return None


# ── what they do ─────────────────────────────────────────────────────────────────────────────────


def _of_number(function: Callable[[Any], Any]) -> Function:
    return Function((NUM,), NUM, lambda x: plain(function(x)))


def _of_angle(function: Callable[[Any], Any]) -> Function:
    return _of_number(lambda x: function(np.radians(x)))


def _angle_of(function: Callable[[Any], Any]) -> Function:
    return _of_number(lambda x: np.degrees(function(x)))


def _round(x: Value, decimals: Value) -> Value:
    """Halves go away from zero."""
    factor = 10.0 ** (decimals or 0.0)
    return plain(np.copysign(np.floor(np.abs(x) * factor + 0.5), x) / factor)


def _trunc(x: Value, decimals: Value) -> Value:
    factor = 10.0 ** (decimals or 0.0)
    return plain(np.trunc(np.asarray(x) * factor) / factor)


def _moved(position: Value, shift: Value) -> Value:
    return [a + b for a, b in zip(position, shift, strict=True)]


def offs(target: Value, x: Value, y: Value, z: Value) -> Value:
    """Shifted along the axes of the work object."""
    return [_moved(target[0], [x, y, z]), *target[1:]]


def rel_tool(target: Value, x: Value, y: Value, z: Value, rx: Value, ry: Value, rz: Value) -> Value:
    """Shifted along the axes of the tool, then turned about its x, its new y and its new z."""
    position = _moved(target[0], turned(target[1], [x, y, z]))
    orient = target[1]
    for axis, degrees in enumerate((rx, ry, rz)):
        if degrees is not None:
            orient = product(orient, about(axis, degrees))
    return [position, orient, *target[2:]]


def _pose_mult(one: Value, two: Value) -> Value:
    return [_moved(one[0], turned(one[1], two[0])), product(one[1], two[1])]


def _pose_inv(pose: Value) -> Value:
    orient = inverse(pose[1])
    return [[-part for part in turned(orient, pose[0])], orient]


def _orient_zyx(z: Value, y: Value, x: Value) -> Value:
    return product(product(about(2, z), about(1, y)), about(0, x))


def _euler_zyx(orient: Value, x: Value, y: Value, z: Value) -> Value:
    """The angle about one axis, of a turn about z, the new y and the new x."""
    r = rotation(orient)
    if x:
        angle = np.arctan2(r[:, 2, 1], r[:, 2, 2])
    elif y:
        angle = np.arctan2(-r[:, 2, 0], np.hypot(r[:, 0, 0], r[:, 1, 0]))
    else:
        angle = np.arctan2(r[:, 1, 0], r[:, 0, 0])
    degrees = np.degrees(angle)
    return degrees if any(isinstance(part, np.ndarray) for part in orient) else float(degrees[0])


def _magnitude(v: Value) -> Value:
    return plain(np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]))


def _normalised(orient: Value) -> Value:
    return inverse(inverse(orient))


#: A text made of a number is for the operator; what it says has no part in what happens.
_TEXT = Function((NUM, NUM), STRING, lambda value, decimals: "")

FUNCTIONS: Mapping[str, Function] = {
    "abs": _of_number(np.abs),
    "sqrt": _of_number(np.sqrt),
    "exp": _of_number(np.exp),
    "sin": _of_angle(np.sin),
    "cos": _of_angle(np.cos),
    "tan": _of_angle(np.tan),
    "asin": _angle_of(np.arcsin),
    "acos": _angle_of(np.arccos),
    "atan": _angle_of(np.arctan),
    "atan2": Function((NUM, NUM), NUM, lambda y, x: plain(np.degrees(np.arctan2(y, x)))),
    "pow": Function((NUM, NUM), NUM, lambda x, y: plain(np.power(x, y))),
    "round": Function((NUM,), NUM, _round, {"dec": NUM}),
    "trunc": Function((NUM,), NUM, _trunc, {"dec": NUM}),
    "numtostr": _TEXT,
    "offs": Function((ROBTARGET, NUM, NUM, NUM), ROBTARGET, offs),
    "reltool": Function(
        (ROBTARGET, NUM, NUM, NUM), ROBTARGET, rel_tool, {"rx": NUM, "ry": NUM, "rz": NUM}
    ),
    # programs that set a displacement of positions are not read, so none is there to be taken off
    "orobt": Function(
        (ROBTARGET,), ROBTARGET, lambda target, p, e: target, {"inpdisp": BOOL, "ineoffs": BOOL}
    ),
    "posemult": Function((POSE, POSE), POSE, _pose_mult),
    "poseinv": Function((POSE,), POSE, _pose_inv),
    "posevect": Function((POSE, POS), POS, lambda p, v: _moved(p[0], turned(p[1], v))),
    "orientzyx": Function((NUM, NUM, NUM), ORIENT, _orient_zyx),
    "eulerzyx": Function((ORIENT,), NUM, _euler_zyx, {"x": BOOL, "y": BOOL, "z": BOOL}),
    "norient": Function((ORIENT,), ORIENT, _normalised),
    "distance": Function(
        (POS, POS), NUM, lambda a, b: _magnitude([p - q for p, q in zip(a, b, strict=True)])
    ),
    "vectmagn": Function((POS,), NUM, _magnitude),
    "dotprod": Function((POS, POS), NUM, lambda a, b: a[0] * b[0] + a[1] * b[1] + a[2] * b[2]),
}
