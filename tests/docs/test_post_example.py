"""docs/post-processors.md is right: its example emits what is shown; its tables are complete."""

from __future__ import annotations

import inspect
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import fields
from itertools import pairwise
from pathlib import Path
from typing import get_args

import pytest
from docs.fenced import DOCS, ROOT, Block, blocks, code, document
from drillc.language.job import Signal
from drillc.output.emission import CycleView, ModuleView, ProgramView, SectionView, context_of
from drillc.output.names import NameRules
from drillc.output.post import Accepts, Option, PostProcessor, Task
from drillc.output.vias import Stretch
from drillc.planning.program import ArmMotion, JointMotion, Program, Step, Vias

TEXT = document("post-processors.md")
BLOCKS = blocks(TEXT)
CODE = code(TEXT)


# ── the example ──────────────────────────────────────────────────────────────────────────────────


class Session:
    """Runs the document's commands as somebody would who has followed it."""

    def __init__(self, folder: Path) -> None:
        self.source, self.site = folder / "source", folder / "site"
        self.work = folder / "work"
        self.work.mkdir(parents=True)
        for name in ("samples", "tests"):
            (self.work / name).symlink_to(ROOT / name)
        for block in BLOCKS:
            if block.file is not None:
                at = self.work if block.file.endswith(".drill") else self.source
                path = at / block.file
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(block.text, encoding="utf-8")

    def run(self, command: str) -> str:
        """What a command says, on both streams."""
        program, *arguments = shlex.split(command)
        folder = self.work
        if program == "pip":
            folder = self.source
            offline = ["--no-index", "--no-build-isolation", "--no-deps", "--target", self.site]
            quiet = ["--quiet", "--disable-pip-version-check"]
            arguments = [*arguments, *map(str, offline), *quiet]
        if program == "pytest":
            arguments += ["-p", "no:cacheprovider"]
        module = {"pip": "pip", "drillc": "drillc", "pytest": "pytest"}[program]
        path = os.pathsep.join([str(self.site), str(ROOT / "tests")])
        done = subprocess.run(
            [sys.executable, "-m", module, *arguments],
            env={**os.environ, "PYTHONPATH": path},
            cwd=folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=300,
        )
        if program in ("pip", "pytest"):
            assert done.returncode == 0, done.stdout
        return done.stdout


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> tuple[Session, list[tuple[Block, str]]]:
    """The session after all commands, and what each command block said, by the block after it."""
    session = Session(tmp_path_factory.mktemp("post"))
    said = []
    for block, after in pairwise(BLOCKS):
        if block.language == "sh":
            output = "".join(session.run(line) for line in block.text.splitlines())
            said.append((after, output))
    return session, said


def test_every_command_says_what_is_shown(told: tuple[Session, list[tuple[Block, str]]]) -> None:
    compared = 0
    for block, output in told[1]:
        if "exact" in block.words:
            assert output == block.text, f"line {block.line}"
            compared += 1
        elif "part" in block.words:
            lines = [" ".join(line.split()) for line in output.splitlines()]
            wanted = [" ".join(line.split()) for line in block.text.splitlines()]
            assert set(wanted) <= set(lines), output
            compared += 1
    assert compared == len([b for b in BLOCKS if b.words.keys() & {"exact", "part"}])


def test_what_is_emitted_is_what_is_shown(
    told: tuple[Session, list[tuple[Block, str]]], pytestconfig: pytest.Config
) -> None:
    [block] = [block for block in BLOCKS if "output" in block.words]
    emitted = (told[0].work / "out" / "plate" / block.words["output"]).read_text("ascii")
    if pytestconfig.getoption("--update-golden"):
        (DOCS / "post-processors.md").write_text(TEXT.replace(block.text, emitted), "utf-8")
    else:
        assert emitted == block.text, "to show the new text: pytest tests/docs --update-golden"


def test_the_suite_really_ran(told: tuple[Session, list[tuple[Block, str]]]) -> None:
    [output] = [said for _, said in told[1] if "passed" in said]
    assert int(output.split(" passed")[0].split()[-1]) > 100


# ── completeness ─────────────────────────────────────────────────────────────────────────────────


def _section(title: str) -> str:
    begin = TEXT.index(f"# {title}\n")
    ends = [at for mark in ("\n## ", "\n### ") if (at := TEXT.find(mark, begin + 4)) > 0]
    return TEXT[begin : min(ends, default=len(TEXT))]


def _own(kind: type) -> Iterator[str]:
    names = {*vars(kind), *inspect.get_annotations(kind)}
    return (name for name in sorted(names) if not name.startswith("_"))


@pytest.mark.parametrize(
    ("section", "kind"),
    [("Accepts", Accepts), ("Option", Option), ("NameRules", NameRules), ("Steps", Signal)],
)
def test_every_field_is_described(section: str, kind: type) -> None:
    text = _section(section)
    skipped = {"span"} if kind is Signal else set()
    for field in fields(kind):
        assert f"`{field.name}`" in text or field.name in skipped


def test_every_attribute_of_a_post_is_described() -> None:
    text = _section("The class")
    for name in _own(PostProcessor):
        assert f"`{name}`" in text or f"`{name}(" in text, name


def test_the_program_and_the_task_are_described() -> None:
    text = _section("Columns")
    for field in fields(Program):
        assert f"`{field.name}`" in text, field.name
    for field in fields(JointMotion):
        assert f"`motion.{field.name}`" in text, field.name
    for field in fields(Task):
        assert f"`task.{field.name}" in CODE or f"task.{field.name}" in CODE, field.name


def test_what_a_program_for_an_arm_adds_is_described() -> None:
    text = _section("Programs for arms")
    assert {field.name for field in fields(ArmMotion)} - {"vias"} <= set(
        re.findall(r"`(\w+)`", text)
    )
    for field in fields(Vias):
        assert f"`vias.{field.name}`" in text, field.name
    for field in fields(Stretch):
        assert f"`{field.name}`" in text, field.name


def test_every_step_is_described() -> None:
    text = _section("Steps")
    for step in get_args(Step):
        kind = step.kind
        [row] = [line for line in text.splitlines() if line.startswith(f"| `{kind}` |")]
        for field in fields(step):
            assert field.name == "kind" or f"`{field.name}`" in row


def test_what_templates_see_is_described() -> None:
    text = _section("Templates")
    for view, name in (
        (ProgramView, "program"),
        (ModuleView, "module"),
        (SectionView, "module.sections"),
        (CycleView, "cycles"),
    ):
        [row] = [line for line in text.splitlines() if line.startswith(f"| `{name}` |")]
        for attribute in _own(view):
            assert f"`{attribute}`" in row, attribute
    source = inspect.getsource(context_of)
    for name in ("program", "modules", "cycles", "frame", "tool", "signals", "settings", "axes"):
        assert f'"{name}":' in source
        assert f"`{name}`" in text
