"""Arguments of a call, sorted into those in order and those by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from lark import Token, Tree

from ..reading import ReadError
from .expressions import Scope
from .types import BOOL, Type
from .variables import Typed


@dataclass(frozen=True)
class Arguments:
    """`given` in order; `options` by their names in small letters, with None where a switch is only
    set. `at`: the name of what is called."""

    scope: Scope
    at: Token
    given: Sequence[Any]
    options: Mapping[str, Any]

    def count(self, number: int) -> None:
        """Raises ReadError where it is another number of arguments in order."""
        if len(self.given) != number:
            word = "argument" if number == 1 else "arguments"
            raise self.error(f"{self.at} takes {number} {word}, not {len(self.given)}")

    def only(self, *names: str) -> None:
        """Raises ReadError for an option that is none of these."""
        for name in self.options:
            if name not in names:
                raise self.error(f"\\{name} of {self.at} is not read")

    def error(self, message: str) -> ReadError:
        return self.scope.error(self.at, message)

    def of_type(self, place: int, kind: Type) -> Typed:
        return self.scope.of_type(self.given[place], kind)

    def option(self, name: str, kind: Type) -> Typed | None:
        """The value of an option, if it is given."""
        if name not in self.options:
            return None
        value = self.options[name]
        if value is None:
            if kind == BOOL:
                return Typed(BOOL, lambda m: True, True)
            raise self.error(f"\\{name} of {self.at} needs a value")
        return self.scope.of_type(value, kind)


def sorted_arguments(scope: Scope, at: Token, tree: Any) -> Arguments:
    """Raises ReadError where an option is given twice."""
    given, options = [], dict[str, Any]()
    for child in tree.children if isinstance(tree, Tree) else ():
        if child.data == "conditional":
            raise scope.error(child, "arguments that are passed on (\\x?y) are not read")
        if child.data != "option":
            given.append(child)
            continue
        name, value = child.children
        if str(name).lower() in options:
            raise scope.error(name, f"\\{name} is given twice")
        options[str(name).lower()] = value
    return Arguments(scope, at, given, options)
