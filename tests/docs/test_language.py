"""docs/language.md is right: every example compiles, or fails as it says; nothing is left out."""

from __future__ import annotations

import importlib
import pkgutil
import re
from collections.abc import Iterator
from importlib.metadata import EntryPoint, entry_points
from importlib.resources import files
from pathlib import Path

import drillc
import pytest
from docs.fenced import Block, blocks, code, document
from drillc.driver import Planned, check_spec
from drillc.language.diagnostics import Refused, Report, render
from drillc.language.machine import SIGNAL_ROLES
from drillc.language.parser import _parser
from drillc.language.units import UNITS
from drillc.output.emission import options_of
from drillc.output.post import PostProcessor

TEXT = document("language.md")
BLOCKS = blocks(TEXT)
CODE = code(TEXT)
GRAMMAR = files("drillc.grammars").joinpath("drill.lark").read_text(encoding="utf-8")
EXAMPLES = [
    block
    for block in BLOCKS
    if block.language == "drill" and block.file is None and "given" not in block.words
]
RUNNABLE = [block for block in EXAMPLES if not block.words.keys() & {"error"}]

_STATEMENT = re.compile(r"^(?=[a-z]+\b)", re.MULTILINE)
_KEYWORD = re.compile(r'"([A-Za-z_]+)"')


# ── making a fragment whole ──────────────────────────────────────────────────────────────────────


def statements(text: str) -> list[tuple[str, str]]:
    """(kind, text) of each top-level statement: in the documents these begin a line."""
    return [(part.split()[0], part) for part in _STATEMENT.split(text) if part.strip()]


def whole(text: str) -> str:
    """`text`, completed from the document's `given` block as the document says."""
    if text.startswith("drill 1"):
        return text
    [given_block] = [block for block in BLOCKS if "given" in block.words]
    given = dict(statements(given_block.text))
    kinds = [kind for kind, _ in statements(text)]
    wanted = [kind for kind in ("program", "part") if kind not in kinds]
    if "emit" in kinds and not {"tool", "robot"} & set(kinds):
        wanted.append("tool")
    lacks_region = "region" not in kinds
    if "holes" not in kinds and (lacks_region or re.search(r"\b(select|skip) skin\b", text)):
        wanted.append("holes")
    added = [given[kind] for kind in wanted]
    if lacks_region:
        added.append(_given_region(given["region"], text, kinds))
    return "drill 1\n" + "".join(added) + text


def _given_region(region: str, text: str, kinds: list[str]) -> str:
    process = re.search(r"^process (\w+)", text, re.MULTILINE)
    lines = region.splitlines(keepends=True)
    if "robot" in kinds:
        lines = [line for line in lines if "posture" not in line]
    if process is None:
        lines = [line for line in lines if "process" not in line]
        return "".join(lines)
    return "".join(lines).replace("EXAMPLE_PROCESS", process[1])


def run(block: Block, folder: Path) -> tuple[Planned | None, Report]:
    """Compile an example in a folder with the document's files; what it asks to emit is checked."""
    for other in BLOCKS:
        if other.file is not None:
            path = folder / "spec" / other.file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(other.text, encoding="utf-8")
    spec = folder / "spec" / "example.drill"
    spec.write_text(whole(block.text), encoding="utf-8")
    report = Report()
    try:
        return check_spec(spec, report), report
    except Refused:
        return None, report


def _place(block: Block) -> str:
    return f"line {block.line}"


# ── the examples ─────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("block", EXAMPLES, ids=_place)
def test_example(block: Block, tmp_path: Path) -> None:
    planned, report = run(block, tmp_path)
    said = "\n".join(map(render, report.diagnostics))
    codes = {diagnostic.code for diagnostic in report.diagnostics}
    if "error" in block.words:
        assert planned is None, "this example should have been refused"
        assert codes == {block.words["error"]}, said
    else:
        assert planned is not None, said
        assert codes == {block.words[key] for key in block.words.keys() & {"warning"}}, said


def test_a_wrong_example_would_be_noticed(tmp_path: Path) -> None:
    wrong = Block("drill", {}, "tool ee { number 1   tcp (0, 0, 310) }\n", 0)
    planned, report = run(wrong, tmp_path)
    assert planned is None
    assert [diagnostic.code for diagnostic in report.diagnostics] == ["E203"]


# ── completeness ─────────────────────────────────────────────────────────────────────────────────


def _occurs(word: str, text: str) -> bool:
    return re.search(rf"(?<![\w/]){re.escape(word)}(?![\w/])", text) is not None


def grammar_rules() -> set[str]:
    """The rules and aliases that a parse tree can hold: `?rule` is always inlined."""
    rules = set(re.findall(r"^([a-z_]+):", GRAMMAR, re.MULTILINE))
    return rules | set(re.findall(r"-> ([a-z_]+)", GRAMMAR))


def test_every_rule_of_the_grammar_has_an_example() -> None:
    used: set[str] = set()
    for block in RUNNABLE:
        tree = _parser().parse(whole(block.text))
        used.update(str(subtree.data) for subtree in tree.iter_subtrees())
    assert sorted(grammar_rules() - used) == []


def test_every_keyword_has_an_example() -> None:
    text = "\n".join(block.text for block in RUNNABLE)
    words = sorted(set(_KEYWORD.findall(GRAMMAR)))
    assert [word for word in words if not _occurs(word, text)] == []


def test_every_unit_has_an_example() -> None:
    text = "\n".join(re.sub(r"#.*|\"[^\"]*\"", "", block.text) for block in RUNNABLE)
    table = TEXT[TEXT.index("## Units") : TEXT.index("## Frames")]
    assert [unit for unit in UNITS if f"`{unit}`" not in table] == []
    missing = [u for u in UNITS if not re.search(rf"(?<![\w/%]){re.escape(u)}(?![\w/])", text)]
    assert missing == []


def test_every_statement_has_a_section() -> None:
    [kinds] = re.findall(r"^\?statement: ((?:[^\n]|\n +\|)+)", GRAMMAR, re.MULTILINE)
    for kind in re.findall(r"[a-z]+", kinds):
        assert f"\n## {kind}\n" in TEXT


def test_every_signal_role_is_described() -> None:
    for role, kind in SIGNAL_ROLES.items():
        assert re.search(rf"^\| `{role}` \| `{kind}` \|", TEXT, re.MULTILINE), role


def built_in_posts() -> list[EntryPoint]:
    entries = entry_points(group="drillc.postprocessors")
    return [entry for entry in entries if entry.value.startswith("drillc.")]


@pytest.mark.parametrize("entry", built_in_posts(), ids=lambda entry: entry.name)
def test_every_post_and_its_settings_are_described(entry: EntryPoint) -> None:
    post: type[PostProcessor] = entry.load()
    section = TEXT[TEXT.index("## emit") : TEXT.index("## What happens at a hole")]
    rows = {row[0].strip(" `"): row for row in _table_rows(section)}
    assert post.name in rows
    settings = _settings_of(post.name, section)
    for option in options_of(post):
        row = settings[option.name]
        default = row[3]
        if option.default is None:
            continue
        if option.dimension == "share":
            assert f"{float(option.default) * 100:g} %" in default
            assert f"{option.low * 100:g} … {option.high * 100:g} %" in row[4]
        elif option.kind in ("count", "number"):
            assert f"{option.default:g}" in default
        else:
            assert f"`{option.default}`" in default
        for word in option.words:
            assert f"`{word}`" in row[2] + row[4]
    assert settings.keys() == {option.name for option in options_of(post)}


def _table_rows(text: str) -> Iterator[list[str]]:
    for line in text.splitlines():
        if line.startswith("| ") and not line.startswith("|-"):
            yield [cell.strip() for cell in line.strip("|").split("|")]


def _settings_of(post: str, section: str) -> dict[str, list[str]]:
    """Rows of the table of settings that belong to `post`: an empty first cell continues."""
    found: dict[str, list[str]] = {}
    current = ""
    for row in _table_rows(section):
        if len(row) != 5 or row[1] == "setting":
            continue
        current = row[0].strip("`") or current
        if current == post and row[1].startswith("`"):
            found[row[1].split("`")[1]] = row
    return found


def limits() -> dict[str, int | float]:
    """Every constant of drillc that is called MAX_…"""
    found: dict[str, int | float] = {}
    for module in pkgutil.walk_packages(drillc.__path__, "drillc."):
        if module.name == "drillc.__main__":
            continue
        names = vars(importlib.import_module(module.name))
        found.update({name: value for name, value in names.items() if name.startswith("MAX_")})
    return found


def test_every_limit_is_described() -> None:
    section = TEXT[TEXT.index("## Limits") :]
    rows = {row[0].strip("`"): row[1] for row in _table_rows(section)}
    for name, value in limits().items():
        assert name in rows
        digits = re.match(r"\d+(?: \d{3})*", rows[name])
        assert digits is not None
        factor = 2**20 if "MiB" in rows[name] else 2**30 if "GiB" in rows[name] else 1
        assert float(digits[0].replace(" ", "")) * factor == value, name


def test_links_lead_somewhere() -> None:
    headings = re.findall(r"^#+ (.+)$", TEXT, re.MULTILINE)
    anchors = {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}
    for target in re.findall(r"\]\(#([^)]+)\)", TEXT):
        assert target in anchors
