"""Text → syntax tree, with every syntax error of the file reported at once.

Lark parses with `grammars/drill.lark`. An LALR parser stops at its first error; to find the others,
everything up to the end of the broken statement is blanked out (positions stay) and the rest is
parsed again. Bounds keep a hostile file from taking the machine: each has a name, and the message
gives it.
"""

from __future__ import annotations

import difflib
import functools
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from importlib.resources import files

from lark import Lark, UnexpectedCharacters, UnexpectedInput, UnexpectedToken
from lark.lexer import PatternRE, PatternStr, TerminalDef

from drillc.language.ast import SpecFile
from drillc.language.build import Builder
from drillc.language.characters import is_strange, meant, said_character
from drillc.language.diagnostics import Label, Report
from drillc.language.source import Source
from drillc.language.units import UNITS

#: The version of the language that this drillc knows.
VERSION = "1"
#: Characters of a spec outside its points blocks.
MAX_STRUCTURE_CHARACTERS = 512 * 1024
#: Depth of brackets within brackets.
MAX_NESTING = 32
#: Syntax errors reported for one file.
MAX_SYNTAX_ERRORS = 20

_VERSION = re.compile(r"(?:[ \t\n]++|#[^\n]*+)*+(drill\b)?[ \t]*([^\s#]*)")
#: Comments, texts (also unclosed ones), words and brackets: what the file's structure is made of.
_TOKEN = re.compile(r'#[^\n]*+|"[^"\n]*+"?|[A-Za-z_][A-Za-z0-9_]*+|[(){}]')
_POINTS = re.compile(r"\{(?:[^{}#]++|#[^\n]*+)*+\}")
_STATEMENTS = frozenset(
    {"program", "use", "part", "tool", "robot", "fixture", "io", "process", "holes", "region"}
    | {"skip", "sequence", "expect", "emit"}
)
#: `process NAME {` begins a statement; `process NAME` is an item of a region.
_PROCESS_STATEMENT = re.compile(r"process[ \t]++\w++\s*+\{")

#: What a message calls the thing that is in the way: a word with its unit-like slashes, a number,
#: a text, or one character.
_WORD = re.compile(r'[^\W\d]\w*+(?:/\w++)?+|[+-]?[0-9][0-9.]*+|"[^"\n]*+"|\S')

#: Words of the language's design that this version does not know yet, said so by name.
_NOT_YET = frozenset({"align", "best_fit", "nominal", "measured"})
#: What people write for a unit that the language calls otherwise.
_ALSO_UNITS = {
    "in": "inch",
    "inches": "inch",
    "millimeter": "mm",
    "millimetre": "mm",
    "meter": "m",
    "metre": "m",
    "degree": "deg",
    "degrees": "deg",
    "sec": "s",
    "mm/sec": "mm/s",
    "mm/U": "mm/rev",
    "ipm": "m/min",
}
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
    version = _VERSION.match(source.text)
    if version is None or not _known_version(source, version, report):
        return None
    structure = _within_bounds(source, report)
    if structure is None:
        return None
    text, parsed_to, found = source.text, version.end(), 0
    while True:
        try:
            tree = _parser().parse(text)
        except UnexpectedInput as error:
            found += 1
            at = _report_syntax(source, text, structure, error, report)
            resume = next((s for s in structure.starts if s >= at and s > parsed_to), None)
            if resume is None or found == MAX_SYNTAX_ERRORS:
                return None
            text = text[:parsed_to] + " " * (resume - parsed_to) + text[resume:]
            parsed_to = resume
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


def _known_version(source: Source, version: re.Match[str], report: Report) -> bool:
    """Whether the file begins with `drill 1`: before anything else, since another version of the
    language may well look like a heap of mistakes in this one."""
    keyword, number = version.groups()
    if keyword and number == VERSION:
        return True
    message = "the file does not begin with its language version"
    if keyword and number:
        message = f'language version "{number[:20]}" is not known; this drillc knows {VERSION}'
    start = version.start(1) if keyword else version.start(2)
    span = source.span(start, max(start + 1, version.end()))
    report.error("E104", message, span, hint=f"begin the file with: drill {VERSION}")
    return False


# ── the file's structure, without parsing it ─────────────────────────────────────────────────────


@dataclass(frozen=True)
class _Structure:
    """Offsets: where statements begin; `unclosed`, the innermost brace still open there, where
    there is one; and the one still open at the end."""

    starts: list[int]
    unclosed: dict[int, int]
    open_at_end: int | None


def _within_bounds(source: Source, report: Report) -> _Structure | None:
    """One walk over words and brackets: the structure, or None after reporting a bound."""
    text = source.text
    open_: list[tuple[int, str]] = []
    starts: list[int] = []
    unclosed: dict[int, int] = {}
    bulk = 0
    for begin, token in _tokens(text):
        if len(token) > 1 and token[0] == "{":
            bulk += len(token)
        elif token in "({":
            open_.append((begin, token))
            if len(open_) > MAX_NESTING:
                report.error(
                    "E103",
                    f"brackets are nested {len(open_)} deep; the limit (MAX_NESTING) is "
                    f"{MAX_NESTING}",
                    source.span(begin, begin + 1),
                )
                return None
        elif token in ")}":
            if open_:
                open_.pop()
        elif _begins_statement(text, begin, token, bool(open_)):
            if open_:
                unclosed[begin] = next((at for at, what in reversed(open_) if what == "{"), -1)
                open_.clear()
            starts.append(begin)
    if len(text) - bulk > MAX_STRUCTURE_CHARACTERS:
        report.error(
            "E102",
            f"the file has {len(text) - bulk:,} characters outside its points blocks; the limit "
            f"(MAX_STRUCTURE_CHARACTERS) is {MAX_STRUCTURE_CHARACTERS:,}",
            source.span(0, 1),
            hint="put the holes into points blocks or a CSV table",
        )
        return None
    braces = [at for at, what in open_ if what == "{"]
    return _Structure(starts, unclosed, braces[-1] if braces else None)


def _tokens(text: str) -> Iterator[tuple[int, str]]:
    """Offset and text of every word and bracket outside comments and texts; a whole points block is
    one token."""
    at, since_points = 0, 9
    while match := _TOKEN.search(text, at):
        token, begin = match[0], match.start()
        at = match.end()
        if token[0] in '#"':
            continue
        since_points = 0 if token == "points" else since_points + 1
        # `points {`, or `points mm {`
        if token == "{" and since_points <= 2 and (block := _POINTS.match(text, begin)):
            token, at = block[0], block.end()
        yield begin, token


def _begins_statement(text: str, at: int, word: str, inside: bool) -> bool:
    """Whether a statement begins here: a statement's word at the start of a line; indented only
    outside every bracket, so that an unclosed block ends where the next line begins at its left."""
    if word not in _STATEMENTS or (word == "process" and not _PROCESS_STATEMENT.match(text, at)):
        return False
    line = at
    while line > 0 and text[line - 1] in " \t":
        line -= 1
    return (line == 0 or text[line - 1] == "\n") and (line == at or not inside)


# ── saying what is wrong ─────────────────────────────────────────────────────────────────────────


def _report_syntax(
    source: Source, text: str, structure: _Structure, error: UnexpectedInput, report: Report
) -> int:
    """Report one syntax error in `text`, the source or what is left of it; its offset."""
    at = len(text)
    if isinstance(error, UnexpectedCharacters):
        at = error.pos_in_stream or 0
    elif isinstance(error, UnexpectedToken) and error.token.type != "$END":
        at = error.token.start_pos or 0
    expected = _acceptable(text[:at])
    if not (
        _report_unclosed(source, structure, at, expected, report)
        or _report_characters(source, at, expected, report)
    ):
        _report_word(source, at, expected, report)
    return at


def _acceptable(text: str) -> set[str]:
    """The terminals that may follow `text`. (What Lark's own error lists is what may follow once it
    has made up its mind about `text`: no unit behind a number any more.)"""
    parser = _parser().parse_interactive(text)
    parser.exhaust_lexer()
    return set(parser.accepts())  # type: ignore[no-untyped-call]


def _report_unclosed(
    source: Source, structure: _Structure, at: int, expected: set[str], report: Report
) -> bool:
    """A block that is still open where the next statement or the end of the file stands."""
    brace, end = None, "at the end of the file"
    if "POINTS" in expected and source.text[at : at + 1] == "{":
        brace, end = at, "before another brace, or the end of the file"
    elif "RBRACE" in expected and at in structure.unclosed:
        word = _TOKEN.match(source.text, at)
        brace, end = structure.unclosed[at], f'before "{word[0] if word else ""}" begins'
    elif "RBRACE" in expected and at == len(source.text):
        brace = structure.open_at_end
    if brace is None or brace < 0:
        return False
    until = [Label(source.span(at, at + 1), "open until here")]
    report.error(
        "E105",
        f"this block is not closed {end}",
        source.span(brace, brace + 1),
        labels=until if brace < at < len(source.text) else [],
        hint="close it: }",
    )
    return True


def _report_characters(source: Source, at: int, expected: set[str], report: Report) -> bool:
    """Characters that cannot stand here whatever is meant: a comma in a number, a lonely quote, a
    letter that is not ASCII."""
    text = source.text
    character, before, after = text[at : at + 1], text[max(0, at - 1) : at], text[at + 1 : at + 2]
    end = text.find("\n", at)
    end = len(text) if end < 0 else end
    if character == "," and before.isdigit() and after.isdigit():
        report.error(
            "E106",
            "a decimal comma; numbers are written with a point",
            source.span(at, at + 1),
            hint='write "1.5", not "1,5"',
        )
    elif character == '"' and text.find('"', at + 1, end) < 0:
        report.error(
            "E108",
            "this text has no closing quote on its line",
            source.span(at, end),
            hint='close it with "',
        )
    elif character and is_strange(character):
        report.error(
            "E110",
            f"a character that the language does not know: {said_character(character)}",
            source.span(at, at + 1),
            hint=meant(character) or "names are made of the ASCII letters, digits and _",
        )
    else:
        return False
    return True


def _report_word(source: Source, at: int, expected: set[str], report: Report) -> None:
    match = _WORD.match(source.text, at)
    word = match[0] if match else ""
    keywords = sorted(_keywords()[name] for name in expected if name in _keywords())
    if not word:
        # At the end of the file the last thing written is what can be shown.
        end = len(source.text.rstrip())
        last = max(source.text.rfind(blank, 0, end) for blank in " \t\n") + 1
        message = f"the file ends where {_said(expected)} should stand"
        report.error("E101", message, source.span(last, end))
        return
    span = source.span(at, at + len(word))
    near = difflib.get_close_matches(word, keywords, 1)
    if word in _NOT_YET:
        report.error(
            "E107",
            f'"{word}" is not part of language version {VERSION}',
            span,
            hint=f"leave it out; what can stand here: {_said(expected)}",
        )
    elif "UNIT" in expected and not near and (word[0].isalpha() or word == "%"):
        report.error("E109", f'"{word}" is not a unit', span, hint=_near_unit(word))
    else:
        report.error(
            "E101",
            f'"{word[:40]}" is not expected here; expected {_said(expected)}',
            span,
            hint=f'did you mean "{near[0]}"?' if near else None,
        )


def _near_unit(word: str) -> str:
    folded = {unit.lower(): unit for unit in UNITS}
    near = _ALSO_UNITS.get(word) or folded.get(word.lower())
    if near is None:
        near = next(iter(difflib.get_close_matches(word, UNITS, 1, 0.7)), None)
    return f'did you mean "{near}"?' if near else f"units are {', '.join(UNITS)}"


def _said(terminals: Iterable[str]) -> str:
    """Terminals in words: `a number, "(" or depth`."""
    wanted = set(terminals)
    wanted = wanted - {"$END"} or wanted
    kinds = [said for name, said in _SAID_TERMINALS.items() if name in wanted]
    words = sorted(_keywords()[name] for name in wanted if name in _keywords())
    signs = sorted(f'"{_signs()[name]}"' for name in wanted if name in _signs())
    *most, last = [*kinds, *words, *signs] or ["something else"]
    return f"{', '.join(most)} or {last}" if most else last


@functools.cache
def _keywords() -> dict[str, str]:
    """Terminal → the word that it matches, for the terminals that are one word."""
    words = {t.name: t.pattern.value.removesuffix("(?![A-Za-z0-9_])") for t in _parser().terminals}
    return {n: w for n, w in words.items() if w.isidentifier() and n not in _SAID_TERMINALS}


@functools.cache
def _signs() -> dict[str, str]:
    """Terminal → the sign that it matches, for brackets and the like."""
    return {
        t.name: t.pattern.value
        for t in _parser().terminals
        if isinstance(t.pattern, PatternStr) and t.name not in _keywords()
    }
