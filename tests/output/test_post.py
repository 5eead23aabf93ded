"""The base of all posts: what every post refuses, what templates see, how files are split."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from drillc.language.diagnostics import Diagnostic, Report, render
from drillc.language.job import Emit, Signal
from drillc.output.emission import OutFile, PostError, emit_files, options_of
from drillc.output.names import NameRules
from drillc.output.numbers import Column, Fixed
from drillc.output.post import Accepts, Option, PostProcessor, Task
from drillc.planning.program import Program
from output.programs import (
    PORTAL_AXES,
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
    span,
    visit_cycle,
    with_ids,
    without_signal,
)

MAIN = """\
{{ program.name }} {{ program.title }} {{ program.holes }}
{% for cycle in cycles %}
routine {{ cycle.name }} {{ cycle.title }}{% for step in cycle.steps %} {{ step.kind }}{% endfor %}

{% endfor %}
{% for m in modules %}
use {{ m.name }} {{ m.index }}
{% endfor %}
"""
PART = """\
{{ module.name }}
{% for section in module.sections %}
region {{ section.name }} {{ section.region }} {{ section.cycle.name }}
{% call(hole) per_hole(section.first) %}
first {{ hole.name }} {{ hole.depth }} {{ hole.id }}
{% endcall %}
{% call(hole) per_hole(section.rest) %}
then {{ hole.name }} {{ hole.depth }} {{ hole.id }}
{% endcall %}
{% endfor %}
"""


class PlainPost(PostProcessor):
    """As small as a post can be; the tests bend its declarations."""

    name = "plain"
    title = "for tests"
    accepts: ClassVar[Accepts] = Accepts(poses=True, joints=True, axes=("A1", "A2", "E1"))
    names: ClassVar[NameRules] = NameRules(24)
    files: ClassVar[Mapping[str, str]] = {"{program}.txt": "part.j2"}
    split_files: ClassVar[Mapping[str, str]] = {
        "{program}.txt": "main.j2",
        "{module}.txt": "part.j2",
    }
    newline = "\n"
    template_package = "plaintemplates"
    options = (
        Option("velocity", "number", 0.5, "share", low=0.01, high=1.0),
        Option("depth", "number", None, "length", low=0.0),
        Option("ratio", "number", 1.0),
        Option("style", "word", "short", words=("short", "long")),
        Option("tool_name", "name", "tDrill"),
        Option("tries", "count", 3, low=1, high=9),
    )


def post_with(**changes: Any) -> PostProcessor:
    post: PostProcessor = type("Bent", (PlainPost,), changes)()
    return post


@pytest.fixture(autouse=True)
def templates(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "plaintemplates"
    folder.mkdir()
    (folder / "__init__.py").touch()
    (folder / "main.j2").write_text(MAIN)
    (folder / "part.j2").write_text(PART)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(__import__("sys").modules, "plaintemplates", raising=False)
    return folder


def refused(post: PostProcessor, program: Program, emit: Emit) -> list[Diagnostic]:
    report = Report()
    assert emit_files(post, program, emit, report) == [] or not report.failed
    return report.diagnostics


def emitted(
    program: Program, post: PostProcessor | None = None, **settings: float | str | tuple[float, str]
) -> dict[str, str]:
    report = Report()
    post = post or PlainPost()
    files = emit_files(post, program, emit_of(post.name, **settings), report)
    assert not report.failed, [render(d) for d in report.diagnostics]
    return {file.path: file.read().decode("ascii") for file in files}


def codes(found: list[Diagnostic]) -> list[str]:
    return [d.code for d in found]


# ── what templates see, how files are split ──────────────────────────────────────────────────────


def test_a_program_of_one_module_is_one_file() -> None:
    assert emitted(mixed(counts=(2, 1, 1))) == {
        "plain/PANEL_7L.txt": "PANEL_7L\n"
        "region upper upper drill6\nfirst P1 12.000 P1\nthen P2 12.250 P2\n"
        "region lower lower rivet\nfirst P3 12.500 P3\n"
        "region rim rim drill6\nfirst P4 12.750 P4\n"
    }


def test_a_split_goes_through_sections() -> None:
    files = emitted(mixed(counts=(2, 1, 2)), holes_per_module=2.0)
    assert list(files) == ["plain/PANEL_7L.txt"] + [f"plain/PANEL_7L_{i}.txt" for i in (1, 2, 3)]
    assert files["plain/PANEL_7L.txt"] == (
        "PANEL_7L PANEL_7L 5\n"
        "routine drill6 drill6 start_spindle move plunge dwell move move stop_spindle\n"
        "routine rivet rivet move analog output wait output wait output output wait move\n"
        "use PANEL_7L_1 1\nuse PANEL_7L_2 2\nuse PANEL_7L_3 3\n"
    )
    assert files["plain/PANEL_7L_2.txt"] == (
        "PANEL_7L_2\nregion lower lower rivet\nfirst P3 12.500 P3\n"
        "region rim rim drill6\nfirst P4 12.750 P4\n"
    )
    assert files["plain/PANEL_7L_3.txt"] == (
        "PANEL_7L_3\nregion rim rim drill6\nfirst P5 12.000 P5\n"
    )


@pytest.mark.parametrize("size", [1, 2, 3, 4, 7, 11, 12, 13, 100])
def test_each_hole_is_called_once_in_order_however_it_is_split(size: int) -> None:
    files = emitted(mixed(counts=(4, 3, 5)), holes_per_module=float(size))
    parts = [t for p, t in files.items() if len(files) == 1 or p != "plain/PANEL_7L.txt"]
    lines = "".join(parts).splitlines()
    calls = [line.split()[1] for line in lines if line.startswith(("first", "then"))]
    assert calls == [f"P{i}" for i in range(1, 13)]


def test_a_post_that_does_not_split_has_no_such_setting() -> None:
    post = post_with(split_files={}, holes_per_module=2)
    assert list(emitted(mixed(), post)) == ["plain/PANEL_7L.txt"]
    assert "holes_per_module" not in [o.name for o in options_of(post)]
    found = refused(post, mixed(), emit_of("plain", holes_per_module=3.0))
    assert codes(found) == ["E630"]


def test_only_routines_in_use_are_listed() -> None:
    program = pose_program(
        [("a", 1, 2), ("b", 1, 1)], [drill_cycle(), rivet_cycle(), visit_cycle()]
    )
    text = emitted(program, holes_per_module=1.0)["plain/PANEL_7L.txt"]
    assert [line.split()[1] for line in text.splitlines() if "routine" in line] == ["rivet"]


def test_regions_without_holes_leave_no_trace() -> None:
    sections = [("a", 0, 2), ("empty", 1, 0), ("b", 0, 1), ("none", 1, 0)]
    files = emitted(pose_program(sections, [drill_cycle(), rivet_cycle()]), holes_per_module=2.0)
    text = "".join(files.values())
    assert "empty" not in text
    assert "none" not in text
    assert "rivet" not in text
    assert text.count("region ") == 2


def test_no_holes_at_all() -> None:
    assert emitted(pose_drill(0)) == {"plain/PANEL_7L.txt": "PANEL_7L\n"}


def test_changed_names_are_listed_beside_the_program() -> None:
    files = emitted(with_ids(pose_drill(2), ["1", "P2"]))
    assert files["plain/names.csv"] == "kind,spec,emitted\nhole,1,H1\n"
    assert "first H1 12.000 1\n" in files["plain/PANEL_7L.txt"]


def test_comments_cannot_be_broken_out_of() -> None:
    post = post_with(comment_forbidden="();", comment_length=6)
    program = with_ids(pose_drill(2), ["a);b(c", "x" * 30])
    lines = emitted(program, post)["plain/PANEL_7L.txt"].splitlines()
    assert lines[2:] == ["first a__b_c 12.000 a__b_c", f"then {'x' * 11}_{'x' * 12} 12.250 xxxxxx"]


def test_line_ends() -> None:
    text = emitted(pose_drill(2), post_with(newline="\r\n"))["plain/PANEL_7L.txt"]
    assert text.count("\r\n") == text.count("\n") == 4


def test_columns_and_context_of_a_post(templates: Path) -> None:
    (templates / "part.j2").write_text(
        "{{ greeting }} {{ settings.velocity | fixed(2) }} {{ tool.number }} {{ frame.number }}"
        " {{ signals.clamp.number }} {{ axes | length }} {{ 3 | twice }}\n"
        "{% call(h) per_hole(module.rows) %}\n{{ h.x }}\n{% endcall %}\n"
    )

    class Post(PlainPost):
        filters: ClassVar[Mapping[str, Any]] = {"twice": lambda n: 2 * n}

        def columns(self, task: Task) -> dict[str, Column]:
            return {"x": Fixed(task.program.holes.position_mm[:, 0], 1)}

        def context(self, task: Task) -> dict[str, object]:
            return {"greeting": f"for {task.names.program}"}

    text = emitted(pose_drill(2), Post())["plain/PANEL_7L.txt"]
    assert text == "for PANEL_7L 0.50 3 2 13 0 6\n240.0\n276.5\n"


def test_the_same_bytes_each_time() -> None:
    assert emitted(mixed()) == emitted(mixed())


# ── what is refused ──────────────────────────────────────────────────────────────────────────────


def test_a_program_in_poses_is_refused_at_the_emit() -> None:
    post = post_with(accepts=Accepts(joints=True))
    [error] = refused(post, pose_drill(), emit_of("plain"))
    assert (error.code, error.span) == ("E610", named("plain").span)


def test_a_program_in_joints_is_refused_at_the_emit() -> None:
    post = post_with(accepts=Accepts(poses=True))
    [error] = refused(post, joint_rivet(), emit_of("plain", PORTAL_AXES))
    assert (error.code, error.span) == ("E611", named("plain").span)


def test_drilling_needs_a_feed_where_joints_have_none() -> None:
    accepts = Accepts(joints=True, joint_feed=False, axes=tuple("XYZABCUVW"))
    post = post_with(accepts=accepts)
    [error] = refused(post, joint_drill(), emit_of("plain", PORTAL_AXES))
    assert (error.code, error.labels[0].span) == ("E618", span(40))
    assert refused(post, joint_rivet(), emit_of("plain", PORTAL_AXES)) == []


JOINT_POST = {"accepts": Accepts(joints=True, axes=("X", "Y", "Z", "A", "U", "V"))}


@pytest.mark.parametrize(
    ("axes", "expected"),
    [
        (None, ["E612"]),
        ({**PORTAL_AXES, "q7": "W"}, ["E613", "E615"]),
        ({k: v for k, v in PORTAL_AXES.items() if k not in ("q2", "q5")}, ["E616"]),
        ({**PORTAL_AXES, "q6": "Q"}, ["E615"]),
        ({**PORTAL_AXES, "q6": "x"}, ["E614"]),
        ({"Q1": "X"}, ["E613", "E616"]),
    ],
)
def test_axis_maps_that_are_refused(axes: dict[str, str] | None, expected: list[str]) -> None:
    found = refused(post_with(**JOINT_POST), joint_rivet(), emit_of("plain", axes))
    assert codes(found) == expected
    assert all(d.span is not None and (d.hint or d.labels) for d in found)


def test_an_axis_map_with_one_joint_twice() -> None:
    emit = emit_of("plain", PORTAL_AXES)
    emit = replace(emit, axes=(*emit.axes, (named("q1", 115), named("w", 115))))
    found = refused(
        post_with(accepts=Accepts(joints=True, axes=tuple("XYZAUVW"))), joint_rivet(), emit
    )
    assert codes(found) == ["E614"]
    assert found[0].labels[0].span.line == 110


def test_axes_may_be_written_in_any_case() -> None:
    seen: list[tuple[str, ...]] = []

    class Post(PlainPost):
        accepts: ClassVar[Accepts] = Accepts(joints=True, axes=("E1", "E2", "E3", "E4", "A1", "A2"))

        def context(self, task: Task) -> dict[str, object]:
            seen.append(task.axes)
            return {}

    axes = {"q6": "e1", "q5": "E2", "q4": "e3", "q3": "a1", "q2": "A2", "q1": "e4"}
    assert refused(Post(), joint_rivet(), emit_of("plain", axes)) == []
    assert seen == [("E4", "A2", "A1", "E3", "E2", "E1")]


def test_an_axis_map_that_nothing_uses() -> None:
    [error] = refused(PlainPost(), pose_drill(), emit_of("plain", {"q1": "A1"}))
    assert (error.code, error.span) == ("E617", named("q1", 110).span)


@pytest.mark.parametrize("role", ["clamp", "clamped", "clamp_force", "spindle_on"])
def test_a_signal_that_io_does_not_give(role: str) -> None:
    program = without_signal(pose_drill(clamp=True), role)
    [error] = refused(PlainPost(), program, emit_of("plain"))
    assert (error.code, error.span) == ("E619", span(40))
    assert role in error.message


def test_a_signal_of_another_kind() -> None:
    program = pose_drill(clamp=True)
    program.signals["clamped"] = replace(program.signals["clamped"], kind="output")
    assert codes(refused(PlainPost(), program, emit_of("plain"))) == ["E619"]


def test_a_native_spindle_needs_no_signals() -> None:
    post = post_with(accepts=Accepts(poses=True, spindle="native"))
    program = without_signal(without_signal(pose_drill(), "spindle_on"), "spindle_speed")
    assert refused(post, program, emit_of("plain")) == []


def test_a_spindle_without_a_speed_signal_is_pointed_out() -> None:
    found = refused(PlainPost(), without_signal(pose_drill(), "spindle_speed"), emit_of("plain"))
    assert codes(found) == ["W622"]


@pytest.mark.parametrize("role", ["clamp", "clamped", "clamp_force", "spindle_running"])
def test_signal_numbers_beyond_the_controller(role: str) -> None:
    accepts = Accepts(poses=True, inputs=range(12), outputs=range(12), analogs=range(1, 2))
    post = post_with(accepts=accepts)
    program = pose_drill(clamp=True)
    found = [d for d in refused(post, program, emit_of("plain")) if f"{role} is " in d.message]
    assert codes(found) == ["E620"]
    assert found[0].span == program.signals[role].span


def test_a_signal_that_no_process_uses_may_have_any_number() -> None:
    program = pose_drill()
    program.signals["set"] = Signal("set", "output", 9999, None, None, span(30))
    assert refused(PlainPost(), program, emit_of("plain")) == []


@pytest.mark.parametrize("n", [1, 15])
def test_places_too_far_out(n: int) -> None:
    program = pose_drill(20)
    program.holes.position_mm[-n:, 1] = -100_001.0
    found = refused(PlainPost(), program, emit_of("plain"))
    assert codes(found) == ["E621"] * min(n, 11)
    assert found[0].span == program.holes.span(20 - n)


def test_joints_too_far_out() -> None:
    program = joint_rivet(3)
    assert program.motion is not None
    program.motion.joints[1, 0] = 1e6
    program.motion.withdraw_mm[2] = -1e6
    found = refused(post_with(**JOINT_POST), program, emit_of("plain", PORTAL_AXES))
    assert codes(found) == ["E621", "E621"]


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({"velocity": (0.2, "%")}, []),
        ({"velocity": (1.5, "%")}, ["E633"]),
        ({"velocity": (0.001, "%")}, ["E633"]),
        ({"velocity": 0.5}, ["E632"]),
        ({"velocity": (0.5, "mm")}, ["E632"]),
        ({"velocity": "fast"}, ["E632"]),
        ({"depth": (-1.0, "mm")}, ["E633"]),
        ({"depth": (1.0, "cm")}, []),
        ({"ratio": 2.5}, []),
        ({"ratio": (2.5, "s")}, ["E632"]),
        ({"ratio": float("nan")}, ["E632"]),
        ({"ratio": float("inf")}, ["E632"]),
        ({"style": "long"}, []),
        ({"style": "middling"}, ["E633"]),
        ({"style": 3.0}, ["E632"]),
        ({"tool_name": "tNose"}, []),
        ({"tool_name": "t nose; HALT"}, ["E633"]),
        ({"tool_name": "n" * 25}, ["E633"]),
        ({"tool_name": 2.0}, ["E632"]),
        ({"tries": 4.0}, []),
        ({"tries": 4.5}, ["E632"]),
        ({"tries": 10.0}, ["E633"]),
        ({"tries": float("inf")}, ["E632"]),
        ({"holes_per_module": 0.0}, ["E633"]),
        ({"veloctiy": 1.0}, ["E630"]),
    ],
)
def test_settings(settings: dict[str, Any], expected: list[str]) -> None:
    found = refused(PlainPost(), pose_drill(), emit_of("plain", **settings))
    assert codes(found) == expected
    assert all(d.span is not None and d.hint for d in found)


def test_settings_reach_the_post_in_base_units() -> None:
    seen: list[Mapping[str, Any]] = []

    class Post(PlainPost):
        def context(self, task: Task) -> dict[str, object]:
            seen.append(task.settings)
            return {}

    refused(Post(), pose_drill(), emit_of("plain", tries=4.0, velocity=(0.25, "%")))
    assert seen == [
        {
            "holes_per_module": 1000,
            "velocity": 0.25,
            "depth": None,
            "ratio": 1.0,
            "style": "short",
            "tool_name": "tDrill",
            "tries": 4,
        }
    ]


def test_messages_about_settings_use_the_unit_that_was_written() -> None:
    [error] = refused(PlainPost(), pose_drill(), emit_of("plain", velocity=(2.0, "%")))
    assert error.message == "velocity is 200 %, out of its range"
    assert error.hint == "a share (%) from 1 % to 100 %"
    [error] = refused(PlainPost(), pose_drill(), emit_of("plain", veloctiy=1.0))
    assert error.hint == 'did you mean "velocity"?'


def test_a_setting_twice() -> None:
    emit = emit_of("plain", tries=4.0)
    [error] = refused(PlainPost(), pose_drill(), replace(emit, settings=emit.settings * 2))
    assert error.code == "E631"


def test_all_mistakes_are_said_at_once() -> None:
    program = without_signal(with_ids(pose_drill(3, clamp=True), ["A-1", "A_1", "P3"]), "clamp")
    found = refused(PlainPost(), program, emit_of("plain", {"q1": "A1"}, veloctiy=1.0))
    assert codes(found) == ["E630", "E619", "E617", "E641"]


def test_a_posts_own_check_joins_in() -> None:
    class Post(PlainPost):
        def check(self, task: Task, report: Report) -> None:
            report.error("E699", "never on a Friday", task.emit.post.span)

    found = refused(Post(), pose_drill(), emit_of("plain", veloctiy=1.0))
    assert codes(found) == ["E630", "E699"]
    found = refused(
        post_with(accepts=Accepts(joints=True), check=Post.check), pose_drill(), emit_of("plain")
    )
    assert codes(found) == ["E610"]  # a check need not understand what is not accepted


def test_a_warning_does_not_stop_it() -> None:
    class Post(PlainPost):
        def check(self, task: Task, report: Report) -> None:
            report.warn("W699", "mind the gap")

    report = Report()
    assert emit_files(Post(), pose_drill(), emit_of("plain"), report)
    assert codes(report.diagnostics) == ["W699"]


# ── faults of a post, and of the planner, are bugs ───────────────────────────────────────────────


def test_faults_of_a_post_are_no_mistakes_of_a_spec(templates: Path) -> None:
    class Short(PlainPost):
        def columns(self, task: Task) -> dict[str, Column]:
            return {"x": Fixed(np.zeros(1), 1)}

    with pytest.raises(PostError, match="the post plain failed: ValueError: column x has 1 cells"):
        emit_files(Short(), pose_drill(3), emit_of("plain"), Report())
    (templates / "part.j2").write_text("{{ 0.1 }}")
    with pytest.raises(PostError, match=r"the post plain failed: part\.j2:1: "):
        emit_files(PlainPost(), pose_drill(3), emit_of("plain"), Report())


def test_a_number_that_is_none_is_never_written() -> None:
    program = pose_drill(3)
    program.depth_mm[1] = np.nan
    with pytest.raises(PostError, match=r"row 1: .*nan"):
        emit_files(PlainPost(), program, emit_of("plain"), Report())


@pytest.mark.parametrize("cut", [(0, 2), (1, 3), (0, 4)])
def test_sections_must_hold_each_hole_once(cut: tuple[int, int]) -> None:
    program = pose_drill(3)
    [section] = program.sections
    program = replace(program, sections=(replace(section, start=cut[0], stop=cut[1]),))
    with pytest.raises(ValueError, match="section"):
        emit_files(PlainPost(), program, emit_of("plain"), Report())


def test_an_out_file_can_be_read_twice() -> None:
    [file] = emit_files(PlainPost(), pose_drill(3), emit_of("plain"), Report())
    assert isinstance(file, OutFile)
    assert file.read() == file.read() != b""


def test_joint_programs_reach_templates_too() -> None:
    program = joint_program([("a", 0, 2)], [visit_cycle()], ids=["J1", "J2"])
    report = Report()
    [file] = emit_files(post_with(**JOINT_POST), program, emit_of("plain", PORTAL_AXES), report)
    assert b"then J2 12.250 J2" in file.read()
