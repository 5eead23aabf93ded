"""What holds for every post, drillc's own or a plug-in's, over one corpus of programs.

A post's author runs it against an installed plug-in with `pytest tests/output/test_conformance.py`.
Each program is either emitted, and then every rule below holds, or refused with located errors.
"""

import hashlib
import os
import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drillc.language.diagnostics import Report, render
from drillc.language.job import Emit
from drillc.output.acceptance import mapped_joints
from drillc.output.emission import NAMES_FILE, emit_files
from drillc.output.names import NameRules, map_names
from drillc.output.post import PostProcessor
from drillc.output.registry import find_posts, list_posts
from drillc.planning.program import Program
from output.arm_programs import Way, arm_program, shifted, some_joints
from output.programs import (
    drill_cycle,
    emit_of,
    joint_drill,
    joint_program,
    joint_rivet,
    mixed,
    named,
    pose_drill,
    pose_program,
    rivet_cycle,
    visit_cycle,
    with_ids,
)

POSTS = [post.name for post in list_posts(Report())]

#: Posts that do not say so themselves: the line with which a hole's turn comes.
HOLE_LINES = {
    "krl": r"\s*(?:drill6|rivet|visit)\((\w+)[,)].*",
    "rapid": r"\s*(?:drill6|rivet|visit) (\w+)[,;].*",
}
#: What a post cannot do without.
SETTINGS: Mapping[str, Mapping[str, str]] = {
    "rapid": {"tooldata": "tDrill", "wobjdata": "wPart"},
}


def _near_zero(program: Program) -> Program:
    """Numbers that a careless formatter prints as -0.000 or with an exponent."""
    tiny = np.resize([-1e-9, 1e-9, -4e-4, -0.0, 0.0], program.holes.position_mm.shape)
    program = replace(program, holes=replace(program.holes, position_mm=tiny))
    if program.motion is None:
        turned = np.tile(np.eye(3), (len(program.holes), 1, 1))
        turned[:, 0, 1] = -1e-17
        return replace(program, part_from_tool=turned)
    joints = np.resize([-1e-9, 1e-9, -1e-12, -0.0], program.motion.joints.shape)
    motion = replace(program.motion, joints=joints, withdraw_mm=np.full(len(joints), -1e-7))
    return replace(program, motion=motion)


def _far(program: Program) -> Program:
    program.holes.position_mm[:] = [99_999.0, -99_999.0, 12_345.6785]
    if program.motion is not None:
        program.motion.joints[:, 3:] = -99_999.0
    return program


def _with_ways(maker: str) -> Program:
    """Three sections, and vias of both kinds before them, between their holes and at the end."""
    rows = some_joints(12, maker)
    rows[6][5] += 360.0  # there the straight way from the hole before ends
    away = [Way(False, tuple(shifted(maker, row, -150.0))) for row in rows]
    aside = [Way(True, tuple(row)) for row in rows]
    return arm_program(
        [("upper", 0, 4), ("lower", 1, 3), ("rim", 0, 5)],
        [drill_cycle(peck_mm=3.0), rivet_cycle()],
        maker=maker,
        joints_deg=rows,
        ways={
            0: aside[:1],
            2: [away[1], aside[2], away[2]],
            4: aside[5:6],
            9: [away[8], aside[9]],
            12: [away[11]],
        },
    )


CORPUS: dict[str, Program] = {
    "poses: drill": pose_drill(5),
    "poses: one hole": pose_drill(1),
    "poses: peck and clamp": pose_drill(4, peck_mm=3.0, clamp=True),
    "poses: rivet": pose_program([("skin", 0, 3)], [rivet_cycle()]),
    "poses: visit": pose_program([("skin", 0, 2)], [visit_cycle()]),
    "poses: sections": mixed(counts=(4, 3, 5)),
    "poses: three processes": pose_program(
        [("a", 0, 2), ("b", 1, 2), ("c", 2, 2)], [drill_cycle(), rivet_cycle(), visit_cycle()]
    ),
    "poses: many holes": pose_drill(5000),
    "poses: near zero": _near_zero(pose_drill(6)),
    "poses: far out": _far(pose_drill(3)),
    "poses: ids that are no names": with_ids(pose_drill(4), ["1", "F-12.3/4", "a" * 64, "_"]),
    "a kuka: drill": arm_program([("skin", 0, 5)], [drill_cycle(peck_mm=3.0, clamp=True)]),
    "an abb: drill": arm_program([("skin", 0, 5)], [drill_cycle()], maker="abb"),
    "another arm: without home": arm_program(
        [("skin", 0, 3)], [rivet_cycle()], maker="other", home_deg=None
    ),
    "a kuka: sections and vias": _with_ways("kuka"),
    "an abb: sections and vias": _with_ways("abb"),
    "another arm: sections and vias": _with_ways("other"),
    "a kuka: ids that are no names": with_ids(
        arm_program([("skin", 0, 4)], [drill_cycle()]), ["1", "F-12.3/4", "a" * 64, "_"]
    ),
    "joints: rivet": joint_rivet(5),
    "joints: rivet the other way": joint_rivet(5, feed_sign=-1),
    "joints: drill": joint_drill(5),
    "joints: peck and clamp": joint_drill(4, peck_mm=3.0, clamp=True),
    "joints: visit": joint_program([("skin", 0, 2)], [visit_cycle()]),
    "joints: sections": mixed(joint_program, (4, 3, 5)),
    "joints: many holes": joint_rivet(5000),
    "joints: near zero": _near_zero(joint_rivet(6)),
    "joints: far out": _far(joint_rivet(3)),
    "joints: ids that are no names": with_ids(joint_rivet(4), ["1", "F-12.3/4", "a" * 64, "_"]),
}

#: Ids that try to end a comment or a string, to begin a line, or to be template or format code.
NASTY = [
    "a) G0 Z0 (b",
    "x ; HALT",
    'q" r',
    "l' m",
    "{{ 7*7 }}",
    "{% raw %}",
    "%s %(x)d %",
    "back\\slash",
    "! n",
    "*/ /* //",
    "#>`$",
    "<&gt;>",
    "MSG,hello",
    "END",
    "ENDPROC",
]


def post_of(name: str) -> PostProcessor:
    report = Report()
    [post] = find_posts([named(name)], report)
    assert not report.diagnostics
    return post


def emit_for(post: PostProcessor, program: Program, **settings: Any) -> Emit:
    joints = mapped_joints(program, post.accepts)
    axes = dict(zip(joints, post.accepts.axes[-len(joints) :], strict=True)) if joints else None
    given = dict(SETTINGS.get(post.name, {})) if program.motion is None else {}
    return emit_of(post.name, axes, **given, **settings)


def emitted(name: str, program: Program, **settings: Any) -> dict[str, bytes]:
    """The files; empty when the post refuses the program, as it may if it says where and why."""
    post = post_of(name)
    report = Report()
    files = emit_files(post, program, emit_for(post, program, **settings), report)
    for diagnostic in report.diagnostics:
        assert re.fullmatch("[EW][0-9]{3}", diagnostic.code)
        assert diagnostic.span is not None, render(diagnostic)
        assert diagnostic.message.isprintable()
    assert bool(files) != report.failed
    return {file.path: file.read() for file in files}


def must_accept(name: str, program: Program) -> bool:
    """Whether the post has declared that it takes such a program."""
    accepts = post_of(name).accepts
    if program.arm is not None:
        return program.arm.arm.model.maker in accepts.arms
    if program.motion is None:
        return accepts.poses
    drills = any(c.process.drill for c in program.cycles)
    return accepts.joints and (accepts.joint_feed or not drills)


def programs_of(files: Mapping[str, bytes]) -> dict[str, bytes]:
    return {path: data for path, data in files.items() if not path.endswith("/" + NAMES_FILE)}


def holes_in_order(post: PostProcessor, files: Mapping[str, bytes]) -> list[str]:
    """The holes whose turn comes, file after file."""
    pattern = re.compile(post.hole_line or HOLE_LINES[post.name])
    lines = "".join(data.decode("ascii") for data in programs_of(files).values()).splitlines()
    return [match[1] for line in lines if (match := pattern.fullmatch(line))]


@pytest.mark.parametrize("program", CORPUS.values(), ids=CORPUS.keys())
@pytest.mark.parametrize("name", POSTS)
class TestEveryProgram:
    def test_it_is_emitted_or_refused(self, name: str, program: Program) -> None:
        files = emitted(name, program)
        assert bool(files) == must_accept(name, program)
        for path in files:
            assert re.fullmatch(rf"{name}/[A-Za-z0-9_]+(\.[A-Za-z0-9]+)?", path)

    def test_only_plain_text_with_one_kind_of_line_end(self, name: str, program: Program) -> None:
        newline = post_of(name).newline.encode()
        for path, data in programs_of(emitted(name, program)).items():
            assert data.endswith(newline), path
            assert not re.search(rb"[^\x20-\x7e]", data.replace(newline, b"")), path

    def test_numbers_are_plain(self, name: str, program: Program) -> None:
        for path, data in programs_of(emitted(name, program)).items():
            text = re.sub(r"\b9E\+?0?9\b", "0", data.decode("ascii"))  # RAPID: no such axis
            for wrong in (
                r"(?<![\w.])-0+(\.0*)?(?![\w.])",  # minus zero
                r"(?<!\w)[0-9]+\.?[0-9]*[eE][+-]?[0-9]+",  # an exponent
                r"(?i)(?<!\w)[+-]?(nan|inf|infinity|none|true_|undefined)(?!\w)",
                r"<[a-z]+ object|\{\{|\}\}|\{%|[\x00-\x08]",  # left by a template
            ):
                found = re.search(wrong, text)
                assert found is None, f"{path}: {text[found.start() - 40 : found.end() + 40]!r}"

    def test_each_hole_has_its_turn_once_in_order(self, name: str, program: Program) -> None:
        files = emitted(name, program)
        if not files:
            return
        post = post_of(name)
        report = Report()
        names = map_names(
            program, post.names, post.named, 1, emit_for(post, program).post.span, report
        )
        wanted = program.holes.ids if names.holes is None else names.holes
        assert holes_in_order(post, files) == wanted.tolist()

    def test_the_same_bytes_each_time(self, name: str, program: Program) -> None:
        assert emitted(name, program) == emitted(name, program)


@pytest.mark.parametrize("kind", ["poses", "joints", "arm"])
@pytest.mark.parametrize("size", [1, 2, 5, 11, 12, 13])
@pytest.mark.parametrize("name", POSTS)
def test_splitting_loses_and_doubles_no_hole(name: str, size: int, kind: str) -> None:
    if kind == "arm":
        program = CORPUS["another arm: sections and vias"]
    else:
        program = mixed(joint_program if kind == "joints" else pose_program, (4, 3, 5))
    post = post_of(name)
    if not must_accept(name, program) or not post.split_files:
        return
    files = emitted(name, program, holes_per_module=float(size))
    assert holes_in_order(post, files) == program.holes.ids.tolist()


@pytest.mark.parametrize("joints", [False, True])
@pytest.mark.parametrize("nasty", NASTY)
@pytest.mark.parametrize("name", POSTS)
def test_no_id_breaks_out(name: str, nasty: str, joints: bool) -> None:
    """A nasty id changes the lines that bear it and nothing else, and adds no line."""
    plain = joint_rivet(3) if joints else pose_drill(3)
    ids = plain.holes.ids.tolist()
    if not must_accept(name, plain):
        return
    post = post_of(name)
    files = emitted(name, with_ids(plain, [ids[0], nasty, ids[2]]))
    if not files:  # then it is a word of the language
        words = {post.names.fold(word) for word in post.names.keywords | post.names.reserved}
        assert post.names.fold(nasty) in words
        return
    told = programs_of(emitted(name, plain))
    assert list(programs_of(files)) == list(told)
    [mapped] = post.names.mapped([nasty], "hole")
    for path in told:
        got, want = (f[path].decode("ascii").splitlines() for f in (files, told))
        assert len(got) == len(want), path
        for one, other in zip(got, want, strict=True):
            assert one == other or mapped in one or post.comment(nasty) in one, (one, other)
            if one != other:
                swapped = one.replace(post.comment(nasty), ids[1]).replace(mapped, ids[1])
                assert swapped == other


@pytest.mark.parametrize("bad", ["P\n1", "P\r1", "P\x001", "Ä1", "\x1b[2J"])
@pytest.mark.parametrize("name", POSTS)
def test_what_no_controller_reads_is_refused(name: str, bad: str) -> None:
    for program in (joint_rivet(3), pose_drill(3)):
        assert emitted(name, with_ids(program, ["P1", bad, "P3"])) == {}


@pytest.mark.parametrize("name", POSTS)
def test_names_keep_the_rules(name: str) -> None:
    rules = post_of(name).names
    assert isinstance(rules, NameRules)
    assert rules.max_length >= 8
    assert all(word.isascii() for word in rules.keywords | rules.reserved)


def _digest() -> str:
    digest = hashlib.sha256()
    for name in POSTS:
        for program in CORPUS.values():
            for path, data in sorted(emitted(name, program).items()):
                digest.update(path.encode() + b"\0" + data)
    return digest.hexdigest()


def test_another_process_emits_the_same_bytes() -> None:
    """Nothing depends on hash seeds, on the time, or on the place."""
    tests = str(Path(__file__).parents[1])
    path = os.pathsep.join(filter(None, [tests, os.environ.get("PYTHONPATH")]))
    script = "from output.test_conformance import _digest; print(_digest())"
    done = subprocess.run(
        [sys.executable, "-c", script],
        env={**os.environ, "PYTHONHASHSEED": "12345", "TZ": "Asia/Tokyo", "PYTHONPATH": path},
        cwd="/",
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == _digest()
