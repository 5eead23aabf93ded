"""Runs the `drill` blocks of a document, as docs/language.md says in "The examples"."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from docs.fenced import Block, blocks, document
from drillc.driver import Planned, check_spec
from drillc.language.diagnostics import Refused, Report, render

#: In the documents a top-level statement begins a line, and nothing else does.
_STATEMENT = re.compile(r"^(?=[a-z]+\b)", re.MULTILINE)


def drill_examples(name: str) -> list[Block]:
    """The blocks of `docs/NAME` that are compiled: not files, and not what completes fragments."""
    return [
        block
        for block in blocks(document(name))
        if block.language == "drill" and block.file is None and "given" not in block.words
    ]


def _statements(text: str) -> list[tuple[str, str]]:
    """(kind, text) of each top-level statement."""
    return [(part.split()[0], part) for part in _STATEMENT.split(text) if part.strip()]


@dataclass(frozen=True)
class Surroundings:
    """What the language's document gives to its examples: statements by kind, and files."""

    given: dict[str, str]
    files: dict[str, str]

    @staticmethod
    def of(found: Sequence[Block]) -> Surroundings:
        [given] = [block for block in found if "given" in block.words]
        files = {block.file: block.text for block in found if block.file is not None}
        return Surroundings(dict(_statements(given.text)), files)

    def whole(self, text: str) -> str:
        """A spec, completed if `text` is a fragment."""
        if text.startswith("drill 1"):
            return text
        kinds = [kind for kind, _ in _statements(text)]
        wanted = [kind for kind in ("program", "part") if kind not in kinds]
        if "emit" in kinds and not {"tool", "robot"} & set(kinds):
            wanted.append("tool")
        lacks_region = "region" not in kinds
        selects = re.search(r"\b(select|skip) skin\b", text) is not None
        if "holes" not in kinds and (lacks_region or selects):
            wanted.append("holes")
        added = [self.given[kind] for kind in wanted]
        if lacks_region:
            added.append(self._region(text, kinds))
        return "drill 1\n" + "".join(added) + text

    def _region(self, text: str, kinds: Sequence[str]) -> str:
        lines = self.given["region"].splitlines(keepends=True)
        process = re.search(r"^process (\w+)", text, re.MULTILINE)
        unwanted = [word for word in ("posture",) if re.search(r"^robot \w+ portal", text, re.M)]
        unwanted += [word for word in ("process",) if process is None]
        kept = [line for line in lines if line.split()[0] not in unwanted]
        return "".join(kept).replace("EXAMPLE_PROCESS", process[1] if process else "")


LANGUAGE = Surroundings.of(blocks(document("language.md")))


def compiled(block: Block, folder: Path) -> tuple[Planned | None, Report]:
    """Compile an example in a folder with the document's files; what it emits is checked, too."""
    for name, text in LANGUAGE.files.items():
        path = folder / "spec" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    spec = folder / "spec" / "example.drill"
    spec.write_text(LANGUAGE.whole(block.text), encoding="utf-8")
    report = Report()
    try:
        return check_spec(spec, report), report
    except Refused:
        return None, report


def check_example(block: Block, folder: Path) -> None:
    """Assert that an example does what its marks say: fine, `error=CODE` or `warning=CODE`."""
    planned, report = compiled(block, folder)
    said = "\n".join(map(render, report.diagnostics))
    codes = {diagnostic.code for diagnostic in report.diagnostics}
    if "error" in block.words:
        assert planned is None, "this example should have been refused"
        assert codes == {block.words["error"]}, said
    else:
        assert planned is not None, said
        assert codes == {block.words[key] for key in block.words.keys() & {"warning"}}, said
