"""docs/language.md is right: every example compiles, or fails as it says; nothing is left out."""

from __future__ import annotations

import importlib
import math
import pkgutil
import re
from collections.abc import Iterator
from importlib.metadata import EntryPoint, entry_points
from importlib.resources import files
from pathlib import Path

import drillc
import pytest
from docs.examples import LANGUAGE, check_example, compiled, drill_examples
from docs.fenced import Block, blocks, document
from drillc.language.arm import DEFAULT_SINGULAR_RAD, MOST_TURNED_RAD
from drillc.language.consistency import SAME_PLACE_MM
from drillc.language.fields import AXES_TOLERANCE
from drillc.language.headings import DEFAULT_CONE_RAD
from drillc.language.holes import SAME_POSITION_MM, SCALE_RATIO
from drillc.language.job import Weights
from drillc.language.loading import CELL_STATEMENTS, Limit
from drillc.language.machine import (
    DEFAULT_UNIT_TOLERANCE,
    SIGNAL_ROLES,
    SURFACE_WITHIN_MM,
    SURFACE_WITHIN_RAD,
)
from drillc.language.mesh_files import LIKELY_MM
from drillc.language.operations import (
    APPROACH_MM_S,
    CLEARANCE_MM,
    SMALLEST,
    TRAVEL_MM_S,
    VISIT_STANDOFF_MM,
)
from drillc.language.parser import _parser
from drillc.language.tables import KEYS, REQUIRED
from drillc.language.units import UNITS
from drillc.output.emission import options_of
from drillc.output.post import PostProcessor
from drillc.planning.cycles import PECK_GAP_MM, SPINDLE_TIMEOUT_S

TEXT = document("language.md")
GRAMMAR = files("drillc.grammars").joinpath("drill.lark").read_text(encoding="utf-8")
EXAMPLES = drill_examples("language.md")
#: What is compiled without an error: examples, and the cell files that some of them use.
FINE = [block for block in EXAMPLES if "error" not in block.words] + [
    block for block in blocks(TEXT) if block.file is not None and block.file.endswith(".cell")
]

_KEYWORD = re.compile(r'"([A-Za-z_]+)"')


# ── the examples ─────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("block", EXAMPLES, ids=lambda block: f"line {block.line}")
def test_example(block: Block, tmp_path: Path) -> None:
    check_example(block, tmp_path)


def test_a_wrong_example_would_be_noticed(tmp_path: Path) -> None:
    wrong = Block("drill", {}, "tool ee { number 1   tcp (0, 0, 310) }\n", 0)
    planned, report = compiled(wrong, tmp_path)
    assert planned is None
    assert [diagnostic.code for diagnostic in report.diagnostics] == ["E203"]
    with pytest.raises(AssertionError):
        check_example(wrong, tmp_path)


# ── completeness ─────────────────────────────────────────────────────────────────────────────────


def _occurs(word: str, text: str) -> bool:
    return re.search(rf"(?<![\w/]){re.escape(word)}(?![\w/])", text) is not None


def grammar_rules() -> set[str]:
    """The rules and aliases that a parse tree can hold: `?rule` is always inlined."""
    rules = set(re.findall(r"^([a-z_]+):", GRAMMAR, re.MULTILINE))
    return rules | set(re.findall(r"-> ([a-z_]+)", GRAMMAR))


def test_every_rule_of_the_grammar_has_an_example() -> None:
    used: set[str] = set()
    for block in FINE:
        tree = _parser().parse(LANGUAGE.whole(block.text))
        used.update(str(subtree.data) for subtree in tree.iter_subtrees())
    assert sorted(grammar_rules() - used) == []


def test_every_keyword_has_an_example() -> None:
    text = "\n".join(block.text for block in FINE)
    words = sorted(set(_KEYWORD.findall(GRAMMAR)))
    assert [word for word in words if not _occurs(word, text)] == []


def test_every_unit_has_an_example() -> None:
    text = "\n".join(re.sub(r"#.*|\"[^\"]*\"", "", block.text) for block in FINE)
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


def test_the_numbers_of_signals_are_the_posts() -> None:
    section = TEXT[TEXT.index("## emit") : TEXT.index("## What happens at a hole")]
    rows = {r[0].strip("`"): r[4] for r in _table_rows(section) if r[1].startswith("in ")}
    for entry in built_in_posts():
        accepts = entry.load().accepts
        if rows[entry.name] != "by name":
            for numbers in (accepts.inputs, accepts.outputs, accepts.analogs):
                assert f"{numbers[0]} … {numbers[-1]}" in rows[entry.name]


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
        for name, value in vars(importlib.import_module(module.name)).items():
            if isinstance(value, Limit):
                found[value.name] = value.size
            elif name.startswith("MAX_"):
                found[name] = value
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


@pytest.mark.parametrize(
    ("constant", "sentence"),
    [
        (DEFAULT_UNIT_TOLERANCE, "normal's length may be from 1 | {:g} |"),
        (math.degrees(DEFAULT_CONE_RAD), "the rule is not applied | {:g} deg |"),
        (CLEARANCE_MM, "| {:g} mm when drilling"),
        (APPROACH_MM_S, "to the clearance | length must be given; {:g} mm/s |"),
        (APPROACH_MM_S, "speed of withdrawing | length must be given; {:g} mm/s |"),
        (TRAVEL_MM_S, "| the speed between holes | {:g} mm/s |"),
        (SMALLEST, "of a process is at least {:g} in mm"),
        (VISIT_STANDOFF_MM, "to the hole's position from {:g} mm, at"),
        (APPROACH_MM_S, "at {:g} mm/s, and back"),
        (SPINDLE_TIMEOUT_S, "awaited for at most {:g} s"),
        (PECK_GAP_MM, "returns to {:g} mm before the last bottom"),
        (SAME_POSITION_MM, "double (within {:g} mm)"),
        (AXES_TOLERANCE, "lengths and products may be off by {:g}, and"),
        (SURFACE_WITHIN_MM, "the surface's own (`E346`) | none; {:g} mm,"),
        (math.degrees(SURFACE_WITHIN_RAD), "| none; 0.5 mm, {:g} deg |"),
        (math.degrees(DEFAULT_SINGULAR_RAD), "A6 are one line | {:g} deg |"),
        (math.degrees(MOST_TURNED_RAD), "limits within {:g} deg either way"),
        (LIKELY_MM[0], "A mesh smaller than {:g} mm or larger"),
        (LIKELY_MM[1] / 1000, "or larger than {:g} m is questioned"),
        (SAME_PLACE_MM, "agree within {:g} mm and 0.000001 rad"),
        (Weights().deviation, "leaves the rule's | {:g} |"),
        (Weights().travel, "joint by joint | {:g} |"),
        (Weights().margin, "margin is used up | {:g} |"),
        (SCALE_RATIO, "a hole {:g} times farther"),
    ],
)
def test_every_constant_is_the_codes(constant: float, sentence: str) -> None:
    assert sentence.format(constant) in " ".join(TEXT.split())


def test_what_a_cell_file_and_a_table_may_hold() -> None:
    section = TEXT[TEXT.index("## use") : TEXT.index("## part")]
    [sentence] = re.findall(r"and may hold\s+([^.]*), nothing else", section)
    assert set(re.findall(r"`(\w+)`", sentence)) == CELL_STATEMENTS - {"version"}
    section = TEXT[TEXT.index("## holes") : TEXT.index("## region")]
    rows = [row for row in _table_rows(section) if len(row) == 3 and row[0].startswith("`")]
    assert [key for row in rows for key in row[0].replace("`", "").split()] == list(KEYS)
    needed = [
        key for row in rows if row[2].startswith("yes") for key in row[0].replace("`", "").split()
    ]
    assert needed == list(REQUIRED)
