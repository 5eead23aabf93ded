"""Generated specs, compiled, and their programs run: by the mini controllers of tests/readers, and
by LinuxCNC's own interpreter. What they do is what the spec says, event by event."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from drillc.driver import Planned
from drillc.planning.program import Program
from hypothesis import given, settings
from judges.linuxcnc import run_gcode
from properties.specs import PortalCase, PoseCase, emitted, planned, portal_cases, pose_cases
from readers import krl, rapid
from readers.events import Analog, Await, Event, Output, World, compare, expected

#: What rounding to the printed digits may cost.
MM, DEG = 0.0009, 1e-3

few = settings(max_examples=15)


def in_roles(
    program: Program, events: Sequence[Event], role: Callable[[str, str], str], rapid_units: bool
) -> list[Event]:
    """Signals by their roles, analog values in rev/s and N."""

    def value(name: str, written: float) -> float:
        if rapid_units:  # rpm and N
            return written / 60.0 if name == "spindle_speed" else written
        return written * (program.signals[name].full_scale or 0.0)

    said: list[Event] = []
    for event in events:
        match event:
            case Output(signal, on):
                said.append(Output(role("output", signal), on))
            case Analog(signal, written):
                name = role("analog", signal)
                said.append(Analog(name, value(name, written)))
            case Await(signal, timeout_s, came):
                said.append(Await(role("input", signal), timeout_s, came))
            case _:
                said.append(event)
    return said


def krl_events(program: Program, files: dict[str, bytes]) -> list[Event]:
    roles = {f"{s.kind} {s.number}": s.role for s in program.signals.values()}

    def role(kind: str, shown: str) -> str:
        number = re.search(r"\d+", shown)
        assert number
        return roles[f"{kind} {number[0]}"]

    main = {name: data for name, data in files.items() if name.startswith("krl/")}
    run = krl.run(krl.load(main), program.name, World())
    return in_roles(program, run.events, role, rapid_units=False)


def rapid_events(program: Program, files: dict[str, bytes]) -> list[Event]:
    signals = program.signals.values()
    roles = {(signal.alias or signal.role).lower(): signal.role for signal in signals}
    main = {name: data for name, data in files.items() if name.startswith("rapid/")}
    known = ("tool0", "wobj0", "wSkin")
    run = rapid.run(rapid.load(main), World(), list(roles), known)
    return in_roles(program, run.events, lambda _, shown: roles[shown.lower()], rapid_units=True)


@few
@given(pose_cases())
def test_krl_and_rapid_do_what_the_spec_says(case: PoseCase) -> None:
    files, program = emitted(case.spec), planned(case.spec).programs[0]
    compare(krl_events(program, files), expected(program, home=True), mm=MM, deg=DEG)
    compare(rapid_events(program, files), expected(program, home=False), mm=MM, deg=DEG)


@few
@given(pose_cases())
def test_they_do_it_in_parts_too(case: PoseCase) -> None:
    """Split into modules of two holes, each goes home (KRL) or on (RAPID) and loses no hole."""
    texts = [
        re.sub(r"^emit (\w+)( \{)?", r"emit \1 { holes_per_module 2", text)
        + ("" if "{" in text or not text.startswith("emit") else " }")
        for text in case.spec.texts
    ]
    spec = replace(case.spec, texts=tuple(texts))
    files, program = emitted(spec), planned(spec).programs[0]
    count = len(program.holes)
    parts = [range(i, min(i + 2, count)) for i in range(0, count, 2)]
    wanted = expected(program, parts=parts, home=True)
    compare(krl_events(program, files), wanted, mm=MM, deg=DEG)
    wanted = expected(program, parts=parts, home=False)
    compare(rapid_events(program, files), wanted, mm=MM, deg=DEG)


@few
@given(portal_cases())
def test_linuxcnc_puts_every_hole_where_the_joints_are(case: PortalCase) -> None:
    files, result = emitted(case.spec), planned(case.spec)
    with tempfile.TemporaryDirectory() as folder:
        for name, data in files.items():
            path = Path(folder) / name
            path.parent.mkdir(exist_ok=True)
            path.write_bytes(data)
        judged = run_gcode(Path(folder) / "gcode" / f"{result.programs[0].name.lower()}.ngc")
    assert judged.error is None
    places: dict[str, list[dict[str, float]]] = {}
    hole = ""
    for move in judged.moves:
        if "out of reach of every hole" in move.comments:
            break  # the tool withdraws at the end
        for comment in move.comments:
            found = re.fullmatch(r"hole (\S+)", comment.strip())
            hole = found[1] if found else hole
        if move.place:
            places.setdefault(hole, []).append(move.place)
    ids = result.job.holes.ids.tolist()
    assert list(places) == ids
    for row, name in enumerate(ids):
        assert_hole(result, row, places[name])


def assert_hole(result: Planned, row: int, places: list[dict[str, float]]) -> None:
    """One hole's moves: withdrawn first, then turned and carried, then along Z alone and out."""
    program = result.programs[0]
    motion = program.motion
    assert motion is not None
    [process] = [
        program.cycles[section.cycle].process
        for section in program.sections
        if section.start <= row < section.stop
    ]
    q = dict(zip("UVAXYZ", motion.joints[row].tolist(), strict=True))
    q["A"] = float(np.degrees(q["A"]))
    sign = motion.feed_sign
    assert abs(places[0]["Z"] - motion.withdraw_mm[row]) < 1e-3
    assert abs(places[1]["Z"] - motion.withdraw_mm[row]) < 1e-3
    for place in places[1:]:
        for letter in "UVAXY":
            assert abs(place[letter] - q[letter]) < 1e-3
    depths = [sign * (place["Z"] - q["Z"]) for place in places[2:]]
    assert abs(depths[0] + process.approach_mm) < 1e-3
    assert abs(max(depths) - program.depth_mm[row]) < 1e-3
    assert abs(depths[-1] + process.retract_mm) < 1e-3
