"""Text → syntax tree, with every syntax error of the file reported at once.

Lark parses with `grammars/drill.lark`. An LALR parser stops at its first error; to find the others,
the broken statement is blanked out (positions stay) and the rest is parsed again. Bounds keep a
hostile file from taking the machine: each has a name, and the message gives it.
"""

from __future__ import annotations

import difflib
import functools
import re
from importlib.resources import files

from lark import Lark, UnexpectedCharacters, UnexpectedInput, UnexpectedToken
from lark.lexer import PatternRE, PatternStr, TerminalDef

from drillc.language.ast import SpecFile
from drillc.language.build import Builder
from drillc.language.diagnostics import Report
from drillc.language.source import Source
from drillc.language.units import UNITS

#: Characters of a spec outside its points blocks.
MAX_STRUCTURE_CHARACTERS = 512 * 1024
#: Depth of brackets within brackets.
MAX_NESTING = 32
#: Syntax errors reported for one file.
MAX_SYNTAX_ERRORS = 20

_BRACKETS = re.compile(r'#[^\n]*|"[^"\n]*"|[(){}]')
# Possessive: a block that is not closed is given up at once, instead of after every way to cut it.
_POINTS_BLOCK = re.compile(r"\bpoints\b\s*+(?:[\w/%]++\s*+)?\{(?:[^{}#]++|#[^\n]*+)*+\}")
_STATEMENT_START = re.compile(
    r"^[ \t]*(?:program|use|part|tool|robot|fixture|io|process|holes|region|skip|sequence|expect|emit)"
    r"(?![A-Za-z0-9_])",
    re.MULTILINE,
)
_WORD = re.compile(r"[A-Za-z_][A-Za-z0-9_/]*|[^\s]")

#: Words of the language's design that this version does not know yet, said so by name.
_NOT_YET = frozenset(
    "align avoid turning mesh surface model base best_fit nominal measured stations".split()
)

_SAID_TERMINALS = {
    "NAME": "a name",
    "HOLE_ID": "a hole id",
    "STRING": 'a text in "quotes"',
    "NUMBER": "a number",
    "UNIT": "a unit",
    "POINTS": "a block of points in { }",
    "AXIS": "x, y or z",
    "SIGNED_AXIS": "a signed axis such as -Y",
    "COMPARE": "a comparison",
    "$END": "the end of the file",
}


def parse(source: Source, report: Report) -> SpecFile | None:
    """Parse one file; on any syntax error report them all and return None."""
    if not _within_bounds(source, report):
        return None
    parser = _parser()
    text, found = source.text, 0
    while True:
        try:
            tree = parser.parse(text)
        except UnexpectedInput as error:
            found += 1
            at = _report_syntax(source, text, error, report)
            if found == MAX_SYNTAX_ERRORS:
                return None
            blanked = _blank_statement(text, at)
            if blanked is None:
                return None
            text = blanked
            continue
        return None if found else Builder(source).spec(tree)


@functools.cache
def _parser() -> Lark:
    grammar = files("drillc.grammars").joinpath("drill.lark").read_text(encoding="utf-8")
    return Lark(grammar, parser="lalr", propagate_positions=True, edit_terminals=_whole_words)


def _whole_words(terminal: TerminalDef) -> None:
    """Keywords match whole words only; Lark itself would read "depth" as "d" and "epth"."""
    word = terminal.pattern.value
    if isinstance(terminal.pattern, PatternStr) and word.isidentifier():
        terminal.pattern = PatternRE(rf"{word}(?![A-Za-z0-9_])")
        terminal.priority = 4


def _within_bounds(source: Source, report: Report) -> bool:
    text = source.text
    bulk = sum(m.end() - m.start() for m in _POINTS_BLOCK.finditer(text))
    if len(text) - bulk > MAX_STRUCTURE_CHARACTERS:
        report.error(
            "E102",
            f"the file has {len(text) - bulk:,} characters outside its points blocks; the limit "
            f"(MAX_STRUCTURE_CHARACTERS) is {MAX_STRUCTURE_CHARACTERS:,}",
            source.span(0, 1),
            hint="put the holes into points blocks or a CSV table",
        )
        return False
    depth = 0
    for match in _BRACKETS.finditer(_POINTS_BLOCK.sub(_spaces, text)):
        if match[0] in "({":
            depth += 1
            if depth > MAX_NESTING:
                report.error(
                    "E103",
                    f"brackets are nested {depth} deep; the limit (MAX_NESTING) is {MAX_NESTING}",
                    source.span(match.start(), match.end()),
                )
                return False
        elif match[0] in ")}":
            depth -= 1
    return True


def _spaces(match: re.Match[str]) -> str:
    return " " * (match.end() - match.start())


def _report_syntax(source: Source, text: str, error: UnexpectedInput, report: Report) -> int:
    """Report one syntax error and return its offset."""
    at, expected = len(text), set[str]()
    if isinstance(error, UnexpectedToken):
        expected = set(error.accepts or error.expected)
        if error.token.type != "$END" and error.token.start_pos is not None:
            at = error.token.start_pos
    elif isinstance(error, UnexpectedCharacters):
        at, expected = error.pos_in_stream or 0, set(error.allowed or ())
    match = _WORD.match(text, at)
    word = match[0] if match else ""
    message, hint = _said_syntax(text, at, word, expected)
    # At the end of the file the last thing written is what can be shown.
    shown = at if word else max(0, len(text.rstrip()) - 1)
    report.error("E101", message, source.span(shown, shown + max(1, len(word))), hint=hint)
    return at


def _said_syntax(text: str, at: int, word: str, expected: set[str]) -> tuple[str, str | None]:
    keywords = sorted(word for name in expected if (word := _keyword(name)) is not None)
    kinds = [_SAID_TERMINALS[name] for name in _SAID_TERMINALS if name in expected]
    signs = sorted(sign for name in expected if (sign := _sign(name)) is not None)
    said = ", ".join([*kinds, *keywords, *signs]) or "something else"
    before = text[:at].rstrip(" \t")
    if word == "," and before[-1:].isdigit() and text[at + 1 : at + 2].isdigit():
        return "a decimal comma; numbers are written with a point", 'write "1.5", not "1,5"'
    if not word:
        return f"the file ends where {said} should stand", None
    if word in _NOT_YET:
        return f'"{word}" is not part of the language yet', f"expected {said}"
    if word == '"':
        return "this text has no closing quote on its line", None
    if word == "{" and "POINTS" in expected:
        return "this points block is not closed, or holds another brace", "close it with }"
    if "UNIT" in expected and before[-1:].isdigit() and word[0].isalpha():
        near = difflib.get_close_matches(word, UNITS, 1)
        hint = f'did you mean "{near[0]}"?' if near else f"units are {', '.join(UNITS)}"
        if not difflib.get_close_matches(word, keywords, 1):
            return f'"{word}" is not a unit', hint
    near = difflib.get_close_matches(word, keywords, 1)
    hint = f'did you mean "{near[0]}"?' if near else None
    return f'"{word}" is not expected here; expected {said}', hint


def _keyword(terminal: str) -> str | None:
    """The word of a keyword terminal; None for other terminals."""
    if terminal in _SAID_TERMINALS:
        return None
    word = _pattern(terminal).removesuffix("(?![A-Za-z0-9_])")
    return word if word.isidentifier() else None


def _sign(terminal: str) -> str | None:
    if terminal in _SAID_TERMINALS or _keyword(terminal):
        return None
    value = _pattern(terminal)
    return f'"{value}"' if len(value) <= 2 else None


def _pattern(terminal: str) -> str:
    return next((str(t.pattern.value) for t in _parser().terminals if t.name == terminal), "")


def _blank_statement(text: str, at: int) -> str | None:
    """`text` with the top-level statement around offset `at` turned to spaces, or None when there
    is no statement to take out (then nothing more can be found)."""
    starts = [m.start() for m in _STATEMENT_START.finditer(text) if _depth_zero(text, m.start())]
    begin = max((s for s in starts if s <= at), default=None)
    end = min((s for s in starts if s > at), default=len(text))
    if begin is None or not text[begin:end].strip():
        return None
    blank = re.sub(r"[^\n]", " ", text[begin:end])
    return text[:begin] + blank + text[end:]


def _depth_zero(text: str, at: int) -> bool:
    """Whether a statement can begin at `at`: at the line's start, or outside every brace."""
    if at == 0 or not text[at : at + 1].isspace():
        return True
    depth = 0
    for match in _BRACKETS.finditer(text, 0, at):
        depth += {"{": 1, "}": -1}.get(match[0], 0)
    return depth <= 0
