"""Links between the documents lead to files and headings that are there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from docs.fenced import DOCS, ROOT

#: A target with a scheme is on the web, and not looked at.
_LINK = re.compile(r"\]\((?![a-z]+:)([^)#\s]*)(?:#([^)\s]+))?\)")
DOCUMENTS = (
    "architecture.md",
    "departures.md",
    "diagnostics.md",
    "language.md",
    "post-processors.md",
    "source-maps.md",
    "verification.md",
)
_FENCED = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)


def anchors(document: Path) -> set[str]:
    """The anchors that a forge makes of a document's headings."""
    text = _FENCED.sub("", document.read_text(encoding="utf-8"))
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("name", DOCUMENTS)
def test_every_link_leads_somewhere(name: str) -> None:
    links = _LINK.findall(_FENCED.sub("", (DOCS / name).read_text(encoding="utf-8")))
    assert links
    for file, anchor in links:
        target = DOCS / (file or name)
        assert target.exists(), file
        assert not anchor or anchor in anchors(target), f"{file}#{anchor}"


@pytest.mark.parametrize("name", DOCUMENTS)
def test_every_path_that_is_named_is_there(name: str) -> None:
    text = _FENCED.sub("", (DOCS / name).read_text(encoding="utf-8"))
    named = re.findall(
        r"`((?:compiler|docs|grammars|postprocessors|samples|templates|tests)/[\w./-]+)`", text
    )
    assert [path for path in named if "NAME" not in path and not (ROOT / path).exists()] == []
