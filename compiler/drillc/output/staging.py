"""Staged templates: rendered once, poured for millions of holes.

A template is ordinary Jinja, written for one hole. It is rendered once with a symbolic row:

    {% call(hole) per_hole(section.rows) %}
    {{ section.cycle.name }}({{ hole.name }}, {{ hole.depth }}) ; {{ hole.id }}
    {% endcall %}

`per_hole` runs the block a single time. Every `hole.…` is a `Slot`, which can be printed and
nothing else; the text that results becomes a format string, and the columns are poured through it
in blocks of rows (`drillc.output.pouring`). So layout stays in templates and speed does not depend
on Jinja. What is poured in is never looked at again: no text from a spec can act as template code.

An arm's program has a second table, the vias that it passes between holes: `per_via` does for them
what `per_hole` does for holes.

Whatever a template does that staging could not carry out faithfully raises `StagingError`, which
names the template and the line: a test or a filter on a slot, an unknown column, a slot printed
outside its block, a number printed without the `fixed` filter. It is the template author's mistake,
never the mistake of somebody who writes a spec.
"""

from __future__ import annotations

import difflib
import functools
import re
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib import resources
from typing import Any, NoReturn

import numpy as np
from jinja2 import (
    FunctionLoader,
    StrictUndefined,
    TemplateAssertionError,
    TemplateError,
    TemplateSyntaxError,
    Undefined,
    nodes,
)
from jinja2.sandbox import ImmutableSandboxedEnvironment

from drillc.output.marks import CALL, Mark, MarkedLoops
from drillc.output.numbers import Column, fixed
from drillc.output.pouring import Body, Rows, StagedText, Table

# A sentinel is "\x01kind number\x02". Letters of both cases are in it, so that a filter that
# changes letters cannot pass unnoticed; control characters in any other text are refused (`_cut`).
_SENTINEL = re.compile("\x01(Slot|Body|Mark)([0-9]+)\x02")
_MARK = re.compile("\x01Mark[0-9]+\x02")
_CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f]")


class StagingError(Exception):
    """A template does what staging cannot carry out; the message names template and line."""


#: Where a template finds the rows of a table.
_FOUND: Mapping[Table, str] = {
    "hole": "section.rows, section.first, section.rest",
    "via": "stretch.rows, of a stretch of vias",
}


class Slot:
    """The place of one row's value in a body: it can be printed, all else is a `StagingError`."""

    __slots__ = ("_column", "_number", "_printed")

    def __init__(self, column: str, number: int, printed: list[int]) -> None:
        self._column = column  # as a template writes it: hole.depth
        self._number = number
        self._printed = printed

    def __repr__(self) -> str:
        return f"<slot {self._column}>"


def _refuse(slot: Slot, *_: object, **__: object) -> NoReturn:
    raise StagingError(
        f"{slot._column} can only be printed: its value is not known when the template is"
        " rendered; compute what depends on it in the post's columns"
    )


# Everything that Python or Jinja could ask of a value, apart from being printed.
_ASKED = (
    "str format bool len iter contains call getitem hash int float complex index round trunc "
    "eq ne lt le gt ge add radd sub rsub mul rmul truediv rtruediv floordiv rfloordiv mod rmod "
    "pow rpow divmod rdivmod neg pos abs invert and rand or ror xor rxor lshift rlshift rshift "
    "rrshift matmul rmatmul bytes next reversed"
)
for _name in _ASKED.split():
    setattr(Slot, f"__{_name}__", _refuse)


class Row:
    """The symbolic hole that a `per_hole` block is rendered with: `hole.depth` is a slot. So too
    the via of a `per_via` block."""

    def __init__(self, table: Table, columns: Sequence[str], printed: list[int]) -> None:
        self._table = table
        self._columns = columns
        self._printed = printed

    def __getattr__(self, name: str) -> Slot:
        if name.startswith(("__", "jinja_")):  # probes by Python and Jinja, not by the template
            raise AttributeError(name)
        return self[name]

    def __getitem__(self, name: str) -> Slot:
        if name not in self._columns:
            near = difflib.get_close_matches(str(name), self._columns, 1)
            known = "known: " + ", ".join(self._columns)
            mean = f"did you mean {self._table}.{near[0]}?" if near else known
            raise StagingError(f"there is no column {self._table}.{name}; {mean}")
        return Slot(f"{self._table}.{name}", self._columns.index(name), self._printed)


class Stage:
    """Renders the templates of one package against one set of columns.

    `columns` are the per-hole values, all of the same length; `via_columns` the per-via values.
    `filters` are a post's own filters beside `fixed`. `subject_of` says what the text of a loop is
    about, given an item that it runs over: a subject for `Mark`, or None. Holds no state between
    renderings but Jinja's cache of compiled templates.
    """

    def __init__(
        self,
        package: str,
        columns: Mapping[str, Column],
        filters: Mapping[str, Callable[..., Any]] | None = None,
        via_columns: Mapping[str, Column] | None = None,
        subject_of: Callable[[object], object] = lambda item: None,
    ) -> None:
        self._package = package
        self._tables: dict[Table, Mapping[str, Column]] = {
            "hole": columns,
            "via": via_columns or {},
        }
        self._subject_of = subject_of
        self._templates: dict[str, str] = {}  # file → template, to say where a mistake is
        self._environment = ImmutableSandboxedEnvironment(
            loader=FunctionLoader(self._load),
            undefined=StrictUndefined,
            finalize=_printed,
            autoescape=False,
            trim_blocks=True,
            lstrip_blocks=True,
            keep_trailing_newline=True,
            extensions=[MarkedLoops],
        )
        self._environment.filters.update({"fixed": fixed, **(filters or {})})
        tables: tuple[Any, ...] = (self._environment.filters, self._environment.tests)
        for table in tables:
            table.update({name: _slotless(function) for name, function in table.items()})

    def render(
        self, template: str, context: Mapping[str, object], newline: str = "\n"
    ) -> StagedText:
        """Render `template` once. Raises `StagingError` for every mistake in the template."""
        bodies = _Bodies(self._tables, self._subject_of)
        blocks = {"per_hole": bodies.per_hole, "per_via": bodies.per_via, CALL: bodies.about}
        try:
            compiled = self._environment.get_template(template)
            text = compiled.render({**context, **blocks})
            parts = bodies.split(text, newline)
        except Exception as error:  # also a filter's or a macro's own failure
            raise StagingError(_said(error, template, self._templates)) from error
        return StagedText(parts, self._tables)

    def _load(self, name: str) -> tuple[str, str, Callable[[], bool]] | None:
        file = resources.files(self._package).joinpath(name)
        if ".." in name.split("/") or not file.is_file():
            return None
        source = file.read_text(encoding="utf-8")
        self._templates[str(file)] = name
        _check_blocks(self._environment.parse(source, name, str(file)))
        return source, str(file), lambda: True


class _Bodies:
    """The bodies and the marks of one rendering."""

    def __init__(
        self,
        tables: Mapping[Table, Mapping[str, Column]],
        subject_of: Callable[[object], object],
    ) -> None:
        self._tables = tables
        self._subject_of = subject_of
        self._bodies: list[Body] = []
        self._marks: list[Mark] = []
        self._inside = False

    def per_hole(self, rows: Rows, caller: Callable[[Row], str] | None = None) -> str:
        """What templates call as `{% call(hole) per_hole(section.rows) %} … {% endcall %}`."""
        return self._staged("hole", rows, caller)

    def per_via(self, rows: Rows, caller: Callable[[Row], str] | None = None) -> str:
        """What templates call as `{% call(via) per_via(stretch.rows) %} … {% endcall %}`."""
        return self._staged("via", rows, caller)

    def about(self, item: object, begins: bool) -> str:
        """What every loop calls; see `drillc.output.marks`."""
        subject = None if self._inside else self._subject_of(item)
        if subject is None:
            return ""
        self._marks.append(Mark(subject, begins))
        return f"\x01Mark{len(self._marks) - 1}\x02"

    def _staged(self, table: Table, rows: Rows, caller: Callable[[Row], str] | None) -> str:
        block = f"per_{table}"
        if caller is None:
            raise StagingError(f"write {{% call({table}) {block}(rows) %}} … {{% endcall %}}")
        if not isinstance(rows, Rows):
            raise StagingError(f"{block} takes rows: {_FOUND[table]}")
        if rows.table != table:
            raise StagingError(f"{block} takes rows of {table}s, not of {rows.table}s")
        if self._inside:
            raise StagingError("a per_hole or per_via block cannot stand inside another")
        self._inside = True
        printed: list[int] = []
        text = caller(Row(table, tuple(self._tables[table]), printed))
        self._inside = False
        self._bodies.append(self._body(text, printed, rows))
        return f"\x01Body{len(self._bodies) - 1}\x02"

    def _body(self, text: str, printed: list[int], rows: Rows) -> Body:
        literals, kinds, numbers = _cut(_MARK.sub("", text))
        if "Body" in kinds or sorted(numbers) != sorted(printed):
            raise StagingError(
                f"a value of the {rows.table} was kept, tested or dropped instead of printed where"
                f" it stands; print {{{{ {rows.table}.… }}}} straight"
            )
        columns = self._tables[rows.table]
        every = tuple(columns)
        names = tuple(every[number] for number in numbers)
        escaped = [literal.replace("%", "%%") for literal in literals]
        conversions = [columns[name].conversion for name in names]
        format_ = escaped[0] + "".join(map("".join, zip(conversions, escaped[1:], strict=True)))
        return Body(format_, names, rows)

    def split(self, text: str, newline: str) -> tuple[str | Body | Mark, ...]:
        """The rendered text as literals, bodies and marks, in order, with `newline` ending every
        line."""
        literals, kinds, numbers = _cut(text)
        if "Slot" in kinds:
            raise StagingError(
                "a value of a row was printed outside of its per_hole or per_via block"
            )
        pieces = list(zip(kinds, numbers, strict=True))
        if [number for kind, number in pieces if kind == "Body"] != list(range(len(self._bodies))):
            raise StagingError("the text of a per_hole or per_via block was kept, dropped or moved")
        literals = [literal.replace("\n", newline) for literal in literals]
        parts: list[str | Body | Mark] = [literals[0]]
        for (kind, number), literal in zip(pieces, literals[1:], strict=True):
            if kind == "Mark":
                parts.append(self._marks[number])
            else:
                body = self._bodies[number]
                parts.append(replace(body, format=body.format.replace("\n", newline)))
            parts.append(literal)
        return tuple(part for part in parts if part)


def _cut(text: str) -> tuple[list[str], list[str], list[int]]:
    """`text` cut at its sentinels: the literals, and each sentinel's kind and number."""
    pieces = _SENTINEL.split(text)
    for literal in pieces[0::3]:
        if found := _CONTROL.search(literal):
            raise StagingError(
                f"a filter changed the value of a hole, or a text holds the control character"
                f" {found[0]!r}"
            )
        if not literal.isascii():
            strange = next(c for c in literal if not c.isascii())
            raise StagingError(f"the template prints {strange!r}; controllers read plain ASCII")
    return pieces[0::3], pieces[1::3], [int(number) for number in pieces[2::3]]


def _printed(value: object) -> object:
    """What `{{ … }}` prints: texts, whole numbers and slots. Everything else is a mistake."""
    if isinstance(value, Slot):
        value._printed.append(value._number)
        return f"\x01Slot{value._number}\x02"
    if isinstance(value, str | Undefined) or type(value) is int or isinstance(value, np.integer):
        return value
    if isinstance(value, float | np.floating):
        raise StagingError(f"the number {value!r} is printed as it is; write | fixed(decimals)")
    raise StagingError(f"{value!r} cannot be printed: neither a text nor a number")


def _slotless(function: Callable[..., Any]) -> Callable[..., Any]:
    """A filter or test that refuses slots, also where it would not have looked at its argument."""

    @functools.wraps(function)
    def guarded(*arguments: Any, **options: Any) -> Any:
        for argument in arguments:
            if isinstance(argument, Slot):
                _refuse(argument)
        return function(*arguments, **options)

    return guarded


def _check_blocks(template: nodes.Template) -> None:
    """No capturing inside per_hole: `{% set %}…{% endset %}` and `{% filter %}` see sentinels."""
    for block in template.find_all(nodes.CallBlock):
        called = block.call.node
        if isinstance(called, nodes.Name) and called.name in ("per_hole", "per_via"):
            for inner in block.find_all((nodes.AssignBlock, nodes.FilterBlock)):
                raise TemplateAssertionError(
                    "a block {% set %} or {% filter %} cannot stand inside per_hole: the values of"
                    " the hole are not known there",
                    inner.lineno,
                )


def _said(error: Exception, template: str, loaded: Mapping[str, str]) -> str:
    """`error` as one sentence, with the template (which may be an included one) and the line."""
    message = str(error)
    place = template
    if isinstance(error, TemplateSyntaxError):
        message = error.message or message
        place = f"{error.name or template}:{error.lineno}"
    elif not isinstance(error, TemplateError | StagingError):
        message = f"{type(error).__name__}: {message}"
    for frame in traceback.extract_tb(error.__traceback__):
        if frame.filename in loaded:
            place = f"{loaded[frame.filename]}:{frame.lineno}"
    return f"{place}: {message}"
