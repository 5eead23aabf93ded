"""Stretches of holes and vias, against a walk from hole to hole."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from drillc.output.pouring import Rows
from drillc.output.vias import (
    at_home,
    destinations,
    plain_kinds,
    stretches,
    via_numbers,
    vias_before,
)
from hypothesis import given
from hypothesis import strategies as st
from output.arm_programs import HOME_DEG, Way, arm_program, some_joints
from output.programs import visit_cycle

Turn = tuple[str, int]  # a kind, and the row in its table


def walked(start: int, stop: int, before: list[int], kinds: list[str], holes: int) -> list[Turn]:
    """What is done for the holes `start` … `stop`, one after another."""
    turns: list[Turn] = []
    for hole in range(start, stop + 1):
        if hole < stop or hole == holes:
            turns += [(kinds[i], i) for i, at in enumerate(before) if at == hole]
        if hole < stop:
            turns.append(("holes", hole))
    return turns


@given(st.data())
def test_every_hole_and_every_via_has_its_turn(data: st.DataObject) -> None:
    holes = data.draw(st.integers(1, 12))
    before = sorted(data.draw(st.lists(st.integers(0, holes), max_size=12)))
    kinds = [data.draw(st.sampled_from(["joints", "straight"])) for _ in before]
    cuts = sorted({0, holes, *data.draw(st.lists(st.integers(0, holes), max_size=3))})
    at, words = np.array(before, dtype=np.int32), np.array(kinds, dtype=np.str_)
    seen: list[Turn] = []
    modules = []
    for start, stop in pairwise(cuts):
        rows = Rows(start, stop)
        vias = vias_before(rows, at, holes)
        modules.append(vias)
        runs = list(stretches(rows, vias, at, words))
        assert all(len(run.rows) for run in runs)
        assert all(run.rows.table == ("hole" if run.kind == "holes" else "via") for run in runs)
        turns = [(run.kind, i) for run in runs for i in range(run.rows.start, run.rows.stop)]
        assert turns == walked(start, stop, before, kinds, holes)
        # Runs are as long as they can be: holes without vias between them are one.
        assert all(a.kind != b.kind or a.kind != "holes" for a, b in pairwise(runs))
        seen += turns
    assert seen == walked(0, holes, before, kinds, holes)
    numbers = via_numbers(modules, words)
    for vias in modules:
        for kind in ("joints", "straight"):
            own = [int(numbers[i]) for i in range(vias.start, vias.stop) if kinds[i] == kind]
            assert own == list(range(1, len(own) + 1))


def test_a_run_of_holes_is_one_stretch_however_long() -> None:
    before = np.array([0, 500_000, 1_000_000], dtype=np.int32)
    kinds = np.array(["joints"] * 3)
    rows = Rows(0, 1_000_000)
    runs = list(stretches(rows, vias_before(rows, before, 1_000_000), before, kinds))
    assert [(run.kind, len(run.rows)) for run in runs] == [
        ("joints", 1),
        ("holes", 500_000),
        ("joints", 1),
        ("holes", 500_000),
        ("joints", 1),
    ]


@pytest.mark.parametrize("home", [HOME_DEG, None])
def test_home_is_a_kind_of_its_own(home: tuple[float, ...] | None) -> None:
    away = Way(False, tuple(some_joints(2)[1]))
    program = arm_program(
        [("a", 0, 2)], [visit_cycle()], home_deg=home, ways={1: [away], 2: [away]}
    )
    arm = program.arm
    assert arm is not None
    kinds, to = plain_kinds(arm).tolist(), destinations(arm, program.holes.ids).tolist()
    if home is None:
        assert kinds == ["joints", "straight", "straight"]
        assert to == ["P1", "P2", "the end"]
        assert not at_home(arm).any()
    else:
        assert kinds == ["home", "joints", "straight", "straight", "home"]
        assert to == ["home", "P1", "P2", "the end", "home"]
