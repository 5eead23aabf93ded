"""What holds for every post's files, whatever the language."""

from __future__ import annotations

import re

from drillc.output.emission import NAMES_FILE
from drillc.output.post import PostProcessor

from .emitting import Files, must

_PATH = re.compile(r"[a-z][a-z0-9_]*/[A-Za-z0-9_]+(\.[A-Za-z0-9]+)?")
_STRANGE = re.compile(rb"[^\x20-\x7e]")
#: RAPID's word for an axis that is not there.
_NO_AXIS = re.compile(r"\b9E\+?0?9\b")
_WRONG_NUMBERS = {
    "a minus before zero": re.compile(r"(?<![\w.])-0+(\.0*)?(?![\w.])"),
    "a number with an exponent": re.compile(r"(?<!\w)[0-9]+\.?[0-9]*[eE][+-]?[0-9]+"),
    "no number": re.compile(r"(?i)(?<!\w)[+-]?(nan|inf|infinity|none|true_|undefined)(?!\w)"),
    "what a template left": re.compile(r"<[a-z]+ object|\{\{|\{%|%\}"),
}


def programs_of(files: Files) -> Files:
    """The files that a controller reads."""
    return {path: raw for path, raw in files.items() if not path.endswith(f"/{NAMES_FILE}")}


def check_text(post: PostProcessor, files: Files) -> None:
    """Raises AssertionError unless all files are plain text, with plain numbers."""
    newline = post.newline.encode()
    for path in files:
        must(path.startswith(f"{post.name}/") and _PATH.fullmatch(path), f"{path} is no plain path")
    for path, raw in programs_of(files).items():
        must(raw.endswith(newline), f"{path}: the last line does not end in {post.newline!a}")
        if strange := _STRANGE.search(raw.replace(newline, b"")):
            near = raw.replace(newline, b"")[max(0, strange.start() - 30) : strange.end() + 10]
            raise AssertionError(f"{path}: {strange[0]!a} is no printable ASCII, after {near!a}")
        text = _NO_AXIS.sub("0", raw.decode("ascii"))
        for what, pattern in _WRONG_NUMBERS.items():
            if found := pattern.search(text):
                around = text[max(0, found.start() - 40) : found.end() + 40]
                raise AssertionError(f"{path}: {what}: {around!r}")
