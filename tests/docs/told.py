"""What a command says, compared with what a document shows."""

from __future__ import annotations

import re

#: A figure that is floating point's alone differs from machine to machine, and so does its place.
_NOISE = re.compile(r"^(\w+ [\d,]+) [\d.]+e-(?:09|1\d) (\w+ [\d.e-]+ \w+) .*$")


def settled(text: str) -> list[str]:
    """Lines without what differs from machine to machine: columns, and floating point's noise."""
    lines = [" ".join(line.split()) for line in text.splitlines()]
    return [_NOISE.sub(r"\1 noise \2", line) for line in lines]
