"""Assignments: to variables of the program, to signals and timers, to the controller's data."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from lark import Tree

from drillc.verification.machine import Machine

from . import arithmetic as ar
from . import system
from .expressions import Expressions, described
from .references import Evaluate, fitted
from .scope import Scope
from .tree import Node, plain_name, upper

Act = Callable[[Machine], None]

#: Functions of the inline forms that choose a tool or base by its number or its point's data.
_TOOLS, _BASES = frozenset({"STOOL", "STOOL2"}), frozenset({"SBASE"})


class Assignments:
    """Lowers the assignments of one routine."""

    def __init__(self, scope: Scope, values: Expressions) -> None:
        self.scope, self.values = scope, values
        self.notes = scope.files.notes

    def act(self, tree: Node) -> Act:
        """What the assignment does. Raises ReadError."""
        target, value = tree.children
        assert isinstance(target, Tree)
        name_tree, *suffixes = target.children
        name = upper(name_tree)
        if not self.scope.is_known(name):
            special = self._special(target, name, "".join(described(s) for s in suffixes), value)
            if special is not None:
                return special
        reference = self.values.reference(target)
        write = reference.write
        if write is None:
            raise self.scope.fail(target, f"{reference.name} cannot be written")
        if isinstance(value, Tree) and value.data == "aggregate":
            read = self.values.aggregate(value, reference.type)
        else:
            read = self.values.value(value)
        return lambda m: write(m, read(m))

    def _special(self, target: Node, name: str, suffix: str, value: Any) -> Act | None:
        """What is kept by the controller, if it is."""
        signal = self.scope.signal(name)
        if signal is not None:
            if signal.first != signal.last:
                raise self.scope.fail(target, f"{name} is a group of signals, which is not read")
            return self._signal(target, signal.variable, lambda m: signal.first, value)
        match name:
            case "$OUT" | "$ANOUT" | "$IN" | "$ANIN":
                return self._signal(target, name, self.values.index_of(target), value)
            case "$TIMER" | "$TIMER_STOP":
                index, read = self.values.index_of(target), self.values.value(value)
                return system.timer_written(name, index, read, self.notes)
            case "TOOL_DATA" | "BASE_DATA":
                index, frame = self.values.index_of(target), self._frame(value)
                return system.data_written(name, index, frame)
            case "LOAD_DATA":
                index = self.values.index_of(target)
                if isinstance(value, Tree) and value.data == "aggregate":
                    return system.data_written(name, index, self.values.aggregate(value, "LOAD"))
                return system.data_written(name, index, lambda m: None)
            case "$TOOL" | "$BASE" if not suffix:
                return self._frame_chosen(name, value)
            case "$H_POS":
                return self._home(value)
            case "$OV_PRO":
                read = self.values.value(value)
                return lambda m: system.override(m, read(m))
            case "$ADVANCE":
                read = self.values.value(value)
                return lambda m: m.state.update(advance=ar.one(m, read(m), "$ADVANCE"))
            case "$VEL":
                return self._speed(target, suffix, value)
            case "$VEL_AXIS":
                index, read = self.values.index_of(target), self.values.value(value)
                return lambda m: system.axis_speed(m, read(m), ar.one(m, index(m), "the axis"))
            case "$ORI_TYPE":
                read = self.values.value(value)
                return lambda m: m.state.update(turning=read(m))
            case "$IPO_MODE":
                return self._path_mode(target, value)
        if name in system.WITHOUT_EFFECT or name == "$FLAG":
            return self._kept(target, value, name)
        return None

    def _kept(self, target: Node, value: Any, name: str) -> Act:
        """A variable that may be read again, and changes nothing here."""
        if isinstance(value, Tree) and value.data in ("call", "aggregate"):
            return _nothing  # SACC_JOINT(PDEFAULT) and so on
        read = self.values.value(value)
        label = described(target).upper()

        def act(m: Machine) -> None:
            m.state["system"][label] = read(m)

        # of an index that is computed, the label says too little
        return act if "$FLAG" not in name or described(target)[-2:-1].isdigit() else _nothing

    def _signal(self, target: Node, variable: str, place: Evaluate, value: Any) -> Act:
        if variable in ("$IN", "$ANIN"):
            raise self.scope.fail(target, f"{described(target)} is an input: it cannot be set")
        read = self.values.value(value)
        return system.signal_written(variable, place, read, self.notes, self.values.going_on)

    def _frame(self, value: Any) -> Evaluate:
        """A frame, complete or as far as it is given."""
        if isinstance(value, Tree) and value.data == "aggregate":
            return self.values.aggregate(value, "FRAME")
        read = self.values.value(value)
        return lambda m: fitted(m, read(m), "FRAME", "the frame")

    def _frame_chosen(self, name: str, value: Any) -> Act:
        what, table = name[1:].lower(), f"{name[1:]}_DATA"
        notes = self.notes
        if isinstance(value, Tree) and value.data == "reference":
            base = upper(value.children[0])
            if base == table:
                index = self.values.index_of(value)
                return lambda m: system.choose(m, notes, what, ar.one(m, index(m), what))
            if base == ("$NULLFRAME" if what == "tool" else "$WORLD"):
                return lambda m: system.choose(m, notes, what, 0)
        if isinstance(value, Tree) and value.data == "call":
            function = upper(value.children[0])
            if function in (_TOOLS if what == "tool" else _BASES):
                return self._chosen_by(what, value)
        read = self._frame(value)
        return lambda m: system.activate(m, notes, what, name, read(m), None)

    def _chosen_by(self, what: str, call: Node) -> Act:
        """STOOL2(FP1), STOOL(1) or SBASE(FP1.BASE_NO)."""
        arguments = call.children[1]
        argument = arguments.children[0].children[0] if isinstance(arguments, Tree) else None
        read = self.values.value(argument)
        notes = self.notes

        def act(m: Machine) -> None:
            given = read(m)
            if isinstance(given, dict):
                given = given.get(f"{what.upper()}_NO")
            system.choose(m, notes, what, ar.one(m, given, f"the number of the {what}"))

        return act

    def _home(self, value: Any) -> Act:
        name = plain_name(value)
        if name == "XHOME" and not self.scope.is_known(name):
            return lambda m: m.state.update(home={})
        if isinstance(value, Tree) and value.data == "aggregate":
            read = self.values.aggregate(value, "E6AXIS")
        else:
            read = self.values.value(value)
        return lambda m: m.state.update(home=fitted(m, read(m), "E6AXIS", "$H_POS"))

    def _speed(self, target: Node, suffix: str, value: Any) -> Act | None:
        if suffix in (".ORI1", ".ORI2"):
            return self._kept(target, value, "$VEL")
        if suffix == ".CP":
            read = self.values.value(value)
            return lambda m: system.speed(m, read(m))
        if not suffix and isinstance(value, Tree) and value.data == "aggregate":
            parts = self.values.aggregate(value, "CP")
            return lambda m: system.speed(m, parts(m).get("CP"))
        raise self.scope.fail(target, f"{described(target)} is not read")

    def _path_mode(self, target: Node, value: Any) -> Act:
        """#BASE: the tool is moved. #TCP: the tool stands, and the part is moved by the robot."""
        if described(value).upper() == "#BASE" or (
            isinstance(value, Tree) and value.data == "call"
        ):
            return _nothing
        raise self.scope.fail(target, "$IPO_MODE other than #BASE is not read")


def _nothing(m: Machine) -> None:
    """Nothing that can be seen."""
