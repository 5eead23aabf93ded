"""docs/verification.md is true: its commands say what is shown, its tables are the code's.

`--update-golden` writes the outputs anew.
"""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from dataclasses import fields
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from docs.fenced import DOCS, ROOT, Block, blocks, document
from docs.told import settled
from drillc.language.diagnostics import Report
from drillc.language.job import Named
from drillc.language.source import Source, Span
from drillc.verification import case, matching
from drillc.verification.difference import Change, Difference, Tolerance
from drillc.verification.gcode.text import LONGEST_LINE
from drillc.verification.krl import words as krl
from drillc.verification.rapid.lines import STRING_LENGTH
from drillc.verification.reading import Reader
from drillc.verification.registry import find_readers
from drillc.verification.verdict import CHECKS, MOST_NAMED

NAME = "verification.md"
TEXT = document(NAME)
BLOCKS = blocks(TEXT)
_SHOWN = re.compile(r"^(```text exact\n)(?:.*?\n)??(```)$", re.MULTILINE | re.DOTALL)
_PERSON = ("NAME", "EMAIL")


# ── the commands ─────────────────────────────────────────────────────────────────────────────────


class Session:
    """Runs the document's commands one after another, as somebody would who reads it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        samples = folder / "samples"
        (samples / "cells").mkdir(parents=True)
        for name in ("nacelle.drill", "cells/drilling.cell"):
            shutil.copy(ROOT / "samples" / name, samples / name)
        command = folder / "bin" / "drillc"
        command.parent.mkdir()
        command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m drillc "$@"\n')
        command.chmod(0o755)
        who = {f"GIT_{role}_{what}": "x" for role in ("AUTHOR", "COMMITTER") for what in _PERSON}
        self.environment = {
            **os.environ,
            **who,
            "PATH": os.pathsep.join([str(command.parent), os.environ["PATH"]]),
            "GIT_CONFIG_GLOBAL": os.devnull,
            "GIT_CONFIG_NOSYSTEM": "1",
            "GIT_PAGER": "cat",
        }

    def run(self, commands: str) -> str:
        """What a block of commands says, on both streams; a `cd` lasts."""
        where = self.folder / ".where"
        done = subprocess.run(
            ["sh", "-c", f'{commands}pwd > "{where}"'],
            cwd=self._here(where),
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=300,
        )
        return done.stdout

    def _here(self, where: Path) -> Path:
        return Path(where.read_text().strip()) if where.exists() else self.folder


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Session:
    if shutil.which("git") is None:
        pytest.skip("git is needed")
    return Session(tmp_path_factory.mktemp("verification"))


@pytest.fixture(scope="module")
def told(session: Session) -> list[tuple[Block, str]]:
    """Each block of output, and what its commands really said."""
    pairs = pairwise(BLOCKS)
    return [(after, session.run(block.text)) for block, after in pairs if block.language == "sh"]


def test_every_command_says_what_is_shown(
    told: list[tuple[Block, str]], pytestconfig: pytest.Config
) -> None:
    assert len(told) == sum(block.language == "sh" for block in BLOCKS) >= 8
    if pytestconfig.getoption("--update-golden"):
        outputs = iter([output for _, output in told])
        text = _SHOWN.sub(lambda match: f"{match[1]}{next(outputs)}{match[2]}", TEXT)
        (DOCS / NAME).write_text(text, encoding="utf-8")
        return
    for block, output in told:
        assert "exact" in block.words, f"line {block.line}"
        assert settled(output) == settled(block.text), f"line {block.line}"


def test_what_is_shown_is_what_the_text_speaks_of(told: list[tuple[Block, str]]) -> None:
    said = [output for _, output in told]
    assert "verified" in said[0]
    assert "P8 is never made" in said[1]
    assert "krl/NACELLE_A.src:83" in said[1]
    codes = [re.findall(r"exit code (\d)", output) for output in said]
    assert [*codes[1], *codes[2]] == ["3", "2", "3"]
    assert codes[3] == codes[4] == ["1"]


def test_noise_is_all_that_is_left_out() -> None:
    one = "  position  102  2.13e-13 mm  0.000867 mm  P1 a:24"
    two = "position 102 3e-10 mm 0.000867 mm P2 b:1"
    assert settled(one) == settled(two)
    assert settled(one) != settled(two.replace("0.000867", "0.000868"))
    assert settled(one) != settled(two.replace("3e-10", "3e-06"))


# ── the tables ───────────────────────────────────────────────────────────────────────────────────


def section(title: str) -> str:
    begin = TEXT.index(f"## {title}\n")
    end = TEXT.find("\n## ", begin + 4)
    return TEXT[begin : end if end > 0 else len(TEXT)]


def rows(text: str) -> Iterator[list[str]]:
    for line in text.splitlines():
        if line.startswith("| "):
            yield [cell.strip(" `") for cell in line.strip("|").split("|")]


def readers() -> Mapping[str, Reader]:
    nowhere = Span(Source(Path("x"), "x", ""), 1, 1)
    return find_readers([Named(name, nowhere) for name in ("krl", "rapid", "gcode")], Report())


def test_every_check_is_described_with_its_unit() -> None:
    table = {row[0]: row for row in rows(section("The checks")) if len(row) == 4}
    described = {name: row[2] for name, row in table.items() if name != "check"}
    assert list(described) == list(CHECKS)
    for name, unit in CHECKS.items():
        assert described[name] == unit


def test_half_a_digit_is_the_readers_own() -> None:
    table = {row[0]: row[1:] for row in rows(section("The checks")) if len(row) == 6}
    for name, reader in readers().items():
        lengths, angles, joints, speeds, analog = table[{"gcode": "G-code"}.get(name, name.upper())]
        has = reader.precision
        assert lengths == f"{_plain(has.length_mm)} mm"
        assert joints == f"{_plain(has.joint_mm)} mm, {_plain(math.degrees(has.joint_rad))} deg"
        assert analog == _plain(has.analog)
        if name == "krl":  # m/s, with as many digits as it takes
            assert (speeds, has.speed_mm_s) == (f"{100 * has.speed_share:g} %", 0.0)
        if name == "rapid":
            assert (speeds, has.speed_share) == (f"{_plain(has.speed_mm_s)} mm/s", 0.0)
        if name == "gcode":
            assert (speeds, has.speed_share) == (f"{_plain(60 * has.speed_mm_s)} mm/min", 0.0)
        if name == "krl":
            assert angles == f"{_plain(math.degrees(has.angle_rad))} deg"
        if name == "rapid":  # twice what half a digit of a part is
            assert angles == f"quaternions of {round(-math.log10(has.angle_rad))} decimals"


def _plain(value: float) -> str:
    return f"{value:.8f}".rstrip("0")


def _tolerances() -> list[tuple[float, str]]:
    may = Tolerance()
    return [
        (case.NOISE_MM, "comes {} mm, or"),
        (case.NOISE_RAD, "mm, or {} rad, for floating point"),
        (case.CHORD_MM, "`straight` allow {} mm more"),
        (case.CHORD_RAD, "`heading` {} rad, and"),
        (case.TRAVEL_CHORD_MM, "may bulge by {} mm"),
        (matching.NEAR_MM, "within {} mm sideways"),
        (matching.NEAR_DEEP_MM, "sideways, {} mm along"),
        (matching.NEAR_RAD, "the axis and {} rad"),
        (krl.NAME_LENGTH, "names of at most {} characters"),
        (krl.TEXT_LENGTH, "texts of {}, lines"),
        (krl.LINE_LENGTH, "lines of {}, reserved"),
        (krl.MOST_BYTES / 1e6, "files of at most {} MB"),
        (STRING_LENGTH, "texts of at most {} characters, CRLF"),
        (LONGEST_LINE, "lines of at most {} characters, ASCII"),
        (may.length_mm, "Up to {} mm"),
        (may.angle_rad, "mm, {} rad, 0.2 %"),
        (100 * may.share, "rad, {} % of a speed"),
        (may.time_s, "a value and {} s are"),
    ]


@pytest.mark.parametrize(("constant", "sentence"), _tolerances())
def test_every_constant_is_the_codes(constant: float, sentence: str) -> None:
    shown = f"{constant:.10f}".rstrip("0").rstrip(".")
    assert sentence.format(shown) in " ".join(TEXT.split())


def test_so_many_failures_are_named() -> None:
    assert MOST_NAMED == 10
    assert "the first ten are named" in " ".join(TEXT.split())


# ── JSON ─────────────────────────────────────────────────────────────────────────────────────────


def _keys(found: Any) -> set[str]:
    if isinstance(found, dict):
        return set(found).union(*map(_keys, found.values()))
    return set().union(*map(_keys, found)) if isinstance(found, list) else set()


@pytest.mark.usefixtures("told")
def test_every_key_of_the_json_is_described(session: Session) -> None:
    verify = "verify out/nacelle --spec samples/nacelle.drill"
    differ = "diff samples/nacelle.drill samples/new.drill"
    verified, differs = (
        json.loads(session.run(f"cd '{session.folder}'; drillc {each} --json 2> /dev/null\n"))
        for each in (verify, differ)
    )
    assert not verified["passed"]
    for found, title in (
        (verified, "After an edit: drillc verify"),
        (differs, "Two versions: drillc diff"),
    ):
        named = set(re.findall(r"`(\w+)`", section(title)))
        assert _keys(found) - {"line", "column"} <= named, title
    assert {field.name for field in fields(Change)} <= _keys(differs)
    assert {field.name for field in fields(Difference)} - {"before", "after"} <= _keys(differs)
