"""`drillc new-post`: a working package for a new post, to be changed file by file."""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterator
from importlib.metadata import entry_points
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from drillc.output.registry import GROUP

#: What the skeleton is called in its own files.
_PLACEHOLDER = "newpost"
_ENDING = ".in"  # so that nobody takes the skeleton's files for modules of drillc
_NAME = re.compile(r"[a-z][a-z0-9_]*")
_LONGEST = 30


def wrong_name(name: str) -> str | None:
    """What keeps a post from being called so, in words."""
    if not _NAME.fullmatch(name):
        return "a post's name has lower-case letters, digits and _, and begins with a letter"
    if len(name) > _LONGEST:
        return f"a post's name has at most {_LONGEST} characters"
    if keyword.iskeyword(name):
        return f"{name} is a word of Python"
    if name in entry_points(group=GROUP).names:
        return f"there is a post {name} already; drillc posts lists them"
    return None


def write_skeleton(name: str, folder: Path) -> list[Path]:
    """Write the package of the post `name` to a folder that does not exist yet; returns its files.
    Raises OSError, FileExistsError among them."""
    folder.mkdir(parents=True)
    written = []
    for path, text in _skeleton(files("drillc.testing") / "skeleton", ()):
        target = folder.joinpath(*(_renamed(part, name) for part in path))
        target.parent.mkdir(exist_ok=True)
        target.write_text(_renamed(text, name), encoding="utf-8", newline="\n")
        written.append(target)
    return sorted(written)


def _skeleton(
    folder: Traversable, within: tuple[str, ...]
) -> Iterator[tuple[tuple[str, ...], str]]:
    """Every file: its path without the ending, and its text."""
    for item in folder.iterdir():
        if item.is_dir():
            yield from _skeleton(item, (*within, item.name))
        elif item.name.endswith(_ENDING):
            path = (*within, item.name.removesuffix(_ENDING))
            yield path, item.read_text(encoding="utf-8")


def _renamed(text: str, name: str) -> str:
    words = "".join(part.capitalize() for part in name.split("_"))
    return text.replace(_PLACEHOLDER, name).replace(_PLACEHOLDER.capitalize(), words)
