"""Characters that the language does not know, but that word processors and PDFs put into text."""

from __future__ import annotations

import unicodedata

_MEANT = {
    "\N{MINUS SIGN}": "-",
    "\N{EN DASH}": "-",
    "\N{EM DASH}": "-",
    "\N{HYPHEN}": "-",
    "\N{NON-BREAKING HYPHEN}": "-",
    "\N{NO-BREAK SPACE}": " ",
    "\N{NARROW NO-BREAK SPACE}": " ",
    "\N{ZERO WIDTH SPACE}": "",
    "\N{SOFT HYPHEN}": "",
    "\N{LEFT DOUBLE QUOTATION MARK}": '"',
    "\N{RIGHT DOUBLE QUOTATION MARK}": '"',
    "\N{DOUBLE LOW-9 QUOTATION MARK}": '"',
    "\N{RIGHT SINGLE QUOTATION MARK}": "'",
    "\N{FULLWIDTH COMMA}": ",",
    "\N{HORIZONTAL ELLIPSIS}": "..",
    "\N{DEGREE SIGN}": " deg",
    "\N{MICRO SIGN}": "u",
    "\N{GREEK SMALL LETTER MU}": "u",
}


def is_strange(character: str) -> bool:
    """Whether a character can stand nowhere but in a comment or a quoted text."""
    return not character.isascii() or not (character.isprintable() or character in "\t\n")


def said_character(character: str) -> str:
    """A character by its code and name, also where a terminal could not show it."""
    name = unicodedata.name(character, "a control character")
    return f"U+{ord(character):04X}, {name}"


def meant(character: str) -> str | None:
    """A hint for a character that only looks like what the language wants; None for others."""
    plain = _MEANT.get(character)
    if plain is None:
        return None
    return f'write "{plain}" instead' if plain.strip() else "type a plain space, or remove it"
