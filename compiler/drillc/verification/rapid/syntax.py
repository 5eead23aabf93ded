"""The syntax tree of a module. A stretch of alike lines is parsed once, for its shape."""

from __future__ import annotations

import functools
import re
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.resources import files

from lark import Lark, Token, Tree, UnexpectedCharacters, UnexpectedInput, UnexpectedToken
from lark.lexer import PatternRE, PatternStr, TerminalDef

from ..alike import NAME_SLOT, Stretch, stretches, without
from ..reading import ReadError
from .shapes import shapes

Node = Tree[Token]

#: Around the number of a stretch, where it is left out of the text.
MARK = "\x03"
KEYWORDS = frozenset(
    """
    ALIAS AND BACKWARD CASE CONNECT CONST DEFAULT DIV DO ELSE ELSEIF ENDFOR ENDFUNC ENDIF ENDMODULE
    ENDPROC ENDRECORD ENDTEST ENDTRAP ENDWHILE ERROR EXIT FALSE FOR FROM FUNC GOTO IF INOUT LOCAL
    MOD MODULE NOSTEPIN NOT NOVIEW OR PERS PROC RAISE READONLY RECORD RETRY RETURN STEP SYSMODULE
    TASK TEST THEN TO TRAP TRUE TRYNEXT UNDO VAR VIEWONLY WHILE WITH XOR
    """.split()  # noqa: SIM905 (a table of words)
)
#: What begins and ends the bodies of routines, where data is not that of the module.
_ROUTINE = re.compile(r"\s*(?:(?:LOCAL|TASK)\s+)?(?:(PROC|FUNC|TRAP)|END(?:PROC|FUNC|TRAP))\b")
_BLOCKS = ("if_block", "while", "for", "test")
_POSITION = re.compile(r"TARGET\s+([A-Z]\w*)")


@dataclass(frozen=True)
class Bulk:
    """A stretch and the tree of its shape; `data`: declarations, else statements."""

    stretch: Stretch
    tree: Node
    data: bool


@dataclass(frozen=True)
class Parsed:
    """A module's tree; a `stretch` node in it has the number of one of `bulk`."""

    tree: Node
    bulk: Sequence[Bulk]
    code: Sequence[str]


def parsed(file: int, code: Sequence[str], in_bulk: bool = True) -> Parsed:
    """Parse the lines of a module. Raises ReadError."""
    bulk = list(_in_bulk(code)) if in_bulk else []
    text = without(code, [b.stretch for b in bulk], lambda index: f"{MARK}{index}{MARK}")
    return Parsed(parse(file, text, "module"), bulk, code)


def _in_bulk(code: Sequence[str]) -> Iterator[Bulk]:
    capitals = "\n".join(code).upper()
    found = stretches(code, shapes(set(_POSITION.findall(capitals)) - KEYWORDS))
    if not found:
        return
    starts, inside = _routines(capitals.split("\n"))
    for stretch in found:
        within = inside[bisect_right(starts, stretch.first) - 1]
        tree = _tree_of(stretch, "statements" if within else "items")
        if tree is not None:
            yield Bulk(stretch, tree, tree.data == "items")


def singly(file: int, stretch: Stretch, code: Sequence[str]) -> Sequence[Node]:
    """The statements of a stretch, each line for itself, where it can not be read as a whole."""
    first = stretch.first - 1
    lines = code[first : first + stretch.count * len(stretch.text)]
    return subtrees(parse(file, "\n" * first + "\n".join(lines), "statements"))


def _tree_of(stretch: Stretch, start: str) -> Node | None:
    """The tree of a shape; None where its lines must be read singly."""
    try:
        tree = _parser().parse("\n".join(stretch.text), start=start)
    except UnexpectedInput:
        return None
    return None if any(map(_needs_lines, tree.iter_subtrees())) else tree


def _needs_lines(node: Node) -> bool:
    """Whether each line assigns to something else, or a block has statements in lines of their own:
    the machine knows the lines of the outermost ones only."""
    if node.data == "assignment":
        return str(subtrees(node)[0].children[0]).startswith(NAME_SLOT)
    return node.data in _BLOCKS and node.meta.line != node.meta.end_line


def subtrees(tree: Node) -> list[Node]:
    """The children that are trees."""
    return [child for child in tree.children if isinstance(child, Tree)]


def _routines(capitals: Sequence[str]) -> tuple[list[int], list[bool]]:
    """From which lines on it is inside of a routine, and from which outside."""
    starts, inside = [0], [False]
    for number, line in enumerate(capitals, 1):
        if ("PROC" in line or "FUNC" in line or "TRAP" in line) and (match := _ROUTINE.match(line)):
            starts.append(number)
            inside.append(match.group(1) is not None)
    return starts, inside


# ── Lark ─────────────────────────────────────────────────────────────────────────────────────────


def parse(file: int, text: str, start: str) -> Node:
    """Raises ReadError in the words of the language."""
    try:
        return _parser().parse(text, start=start)
    except UnexpectedToken as error:
        raise ReadError(file, *_place(error, text), _unexpected(error)) from None
    except UnexpectedCharacters as error:
        char = text[error.pos_in_stream] if error.pos_in_stream is not None else ""
        raise ReadError(file, error.line, error.column, _strange(char)) from None


@functools.cache
def _parser() -> Lark:
    grammar = files("drillc.grammars").joinpath("rapid.lark").read_text(encoding="utf-8")
    return Lark(
        grammar,
        parser="lalr",
        start=["module", "items", "statements"],
        propagate_positions=True,
        maybe_placeholders=True,
        edit_terminals=_whole_words,
    )


def _whole_words(terminal: TerminalDef) -> None:
    """Keywords match whole words only, and names are no keywords."""
    word = terminal.pattern.value
    if isinstance(terminal.pattern, PatternStr) and word.isidentifier():
        terminal.pattern = PatternRE(rf"{word}(?![A-Za-z0-9_])", terminal.pattern.flags)
        terminal.priority = 4
    if terminal.name == "NAME":
        words = "|".join(sorted(KEYWORDS))
        pattern = rf"(?!(?:{words})(?![A-Za-z0-9_]))(?:{word})"
        terminal.pattern = PatternRE(pattern, ("i",))


def _place(error: UnexpectedToken, text: str) -> tuple[int, int]:
    if error.token.type == "$END":
        return text.rstrip().count("\n") + 1, 1
    return error.line, error.column


def _unexpected(error: UnexpectedToken) -> str:
    wanted = error.accepts or error.expected
    ends = sorted(word for word in wanted if word.startswith("END") and word != "$END")
    if error.token.type == "$END":
        return f"the file ends before {' or '.join(ends) or 'the statement does'}"
    found = str(error.token)
    if found.upper().startswith("END") and ends:
        return f"{found} stands where {' or '.join(ends)} was expected"
    if "SEMICOLON" in wanted and "NAME" not in wanted:
        return f"{found} stands where the statement should end with ;"
    if found.upper() in KEYWORDS:
        return f"{found} is a word of the language and is not expected here"
    return f"{found} is not expected here"


def _strange(char: str) -> str:
    if char == '"':
        return "the text does not end in its line"
    return f"{char!r} is no character of RAPID here"
