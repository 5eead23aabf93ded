"""Marks in a rendered template: which stretch of its text is about a process, or about a region.

A template says so by its loops: `{% for cycle in cycles %}` writes routine after routine. When a
template is parsed, each loop over one variable is given a call of `_about` where a turn begins and
one where it ends; what they print is for `drillc.output.staging` to take out again. Text that a
template captures, `{% set x %}…{% endset %}` and `{% filter %}`, gets no marks: it may be measured.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from jinja2.ext import Extension
from jinja2.lexer import Token, TokenStream

#: What the loops call, if the context has it: `_about(item, begins)`. Not so in a template that was
#: imported without its importer's context.
CALL = "_about"


@dataclass(frozen=True, eq=False)
class Mark:
    """From here on, or up to here, the text is about `subject`, within what it was about before."""

    subject: object
    begins: bool


class MarkedLoops(Extension):
    """Writes the calls into a template's tokens, before it is parsed."""

    def filter_stream(self, stream: TokenStream) -> Iterator[Token]:
        captured = 0
        # The variable of each open loop; empty for an `if`, and where the marks have ended.
        open_: list[str] = []
        for tag in _tags(stream):
            word = tag[1].value if tag[0].type == "block_begin" else ""
            if word in ("endfor", "endif", "else") and open_:
                yield from self._call(open_.pop(), "false", tag[0])
            yield from tag
            if word in ("for", "if", "else"):
                open_.append(_variable(tag) if not captured else "")
                yield from self._call(open_[-1], "true", tag[-1])
            elif word == "filter" or (word == "set" and all(t.type != "assign" for t in tag)):
                captured += 1
            elif word in ("endfilter", "endset"):
                captured -= 1

    def _call(self, variable: str, begins: str, beside: Token) -> Iterator[Token]:
        if not variable:
            return
        text = f'{{{{ {CALL}({variable}, {begins}) if {CALL} is defined else "" }}}}'
        for token in self.environment.lexer.tokenize(text):
            yield Token(beside.lineno, token.type, token.value)


def _tags(stream: TokenStream) -> Iterator[list[Token]]:
    """The tokens of each `{% … %}` together, all others one by one."""
    tag: list[Token] = []
    for token in stream:
        tag.append(token)
        if tag[0].type != "block_begin" or token.type == "block_end":
            yield tag
            tag = []
    if tag:
        yield tag


def _variable(tag: list[Token]) -> str:
    """What `{% for x in … %}` calls its item; empty for all else."""
    values = [token.value for token in tag[1:4]]
    return values[1] if values[:1] == ["for"] and values[2:] == ["in"] else ""
