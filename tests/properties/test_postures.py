"""Postures end to end: a spec's text in, part_from_tool out."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal

import numpy as np
import pytest
from drillc.language.diagnostics import Refused
from hypothesis import assume, given
from hypothesis import strategies as st
from properties.specs import (
    CONE_RAD,
    Hole,
    PoseCase,
    Rule,
    Spec,
    axis_vector,
    clearance_rad,
    planned,
    pose_cases,
    sense,
)
from scipy.spatial.transform import Rotation


def feeds(case: PoseCase) -> np.ndarray:
    """Feed directions (n, 3) in the order of the regions."""
    normals = [hole.normal for holes in case.spec.holes.values() for hole in holes]
    feed = np.array(normals)
    feed /= np.linalg.norm(feed, axis=1)[:, None]
    return feed if case.into else -feed


def rules(case: PoseCase) -> list[Rule]:
    """The rule of each hole."""
    counts = [len(holes) for holes in case.spec.holes.values()]
    return [rule for rule, count in zip(case.rules, counts, strict=True) for _ in range(count)]


@given(pose_cases())
def test_every_hole_gets_its_posture(case: PoseCase) -> None:
    rotation = planned(case.spec).part_from_tool
    identity = rotation @ np.swapaxes(rotation, 1, 2)
    np.testing.assert_allclose(identity, np.broadcast_to(np.eye(3), identity.shape), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(rotation), 1.0, atol=1e-12)
    np.testing.assert_allclose(rotation[:, :, 2], feeds(case), atol=1e-12)
    for rule, turned in zip(rules(case), rotation, strict=True):
        held = turned[:, rule.axis]
        if rule.horizontal:
            assert abs(held @ axis_vector(case.up)) < 1e-12
            if rule.toward:
                assert held @ axis_vector(rule.toward) > 0
            else:  # the article's: up × feed
                assert held @ np.cross(axis_vector(case.up), turned[:, 2]) > 0
        else:
            # As near to `toward` as the tangent plane lets it: no turn about z brings it nearer.
            wanted = axis_vector(rule.toward)
            best = np.linalg.norm(wanted - (wanted @ turned[:, 2]) * turned[:, 2])
            assert held @ wanted == pytest.approx(best, abs=1e-12)


@given(pose_cases(singular=True))
def test_where_a_rule_decides_nothing_the_spec_is_refused(case: PoseCase) -> None:
    each = list(zip(rules(case), feeds(case), strict=True))
    clear = np.array([clearance_rad(rule, case.up, feed) for rule, feed in each])
    chosen = np.abs([sense(rule, case.up, feed) for rule, feed in each])
    assume((np.abs(clear - CONE_RAD) > 1e-6).all())
    assume(((chosen < 0.9e-6) | (chosen > 1.1e-6)).all())
    bad = (clear < CONE_RAD) | (chosen < 1e-6)
    try:
        planned(case.spec)
    except Refused as refused:
        codes = {diagnostic.code for diagnostic in refused.report.diagnostics}
        assert codes <= {"E351", "E352", "E353"}
        assert bad.any()
    else:
        assert not bad.any()


def moved(hole: Hole, turn: np.ndarray, shift: np.ndarray) -> Hole:
    place = turn @ np.array([float(v) for v in hole.position_mm]) + shift
    return replace(
        hole,
        position_mm=tuple(Decimal(v) for v in place.tolist()),
        normal=tuple((turn @ np.array(hole.normal)).tolist()),
    )


@given(pose_cases(), st.integers(0, 2**32 - 1), st.tuples(*[st.floats(-1e4, 1e4)] * 3))
def test_a_rigid_move_of_everything_moves_the_tool_alike(
    case: PoseCase, seed: int, shift: tuple[float, float, float]
) -> None:
    turn = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()

    def direction(axis: str) -> str:
        return f"({', '.join(map(repr, (turn @ axis_vector(axis)).tolist()))})"

    spec = case.spec
    texts = [text.replace(f"up {case.up}", f"up {direction(case.up)}") for text in spec.texts]
    regions = {
        name: rest.replace(f"toward {rule.toward}", f"toward {direction(rule.toward)}")
        if rule.toward
        else rest
        for (name, rest), rule in zip(spec.regions.items(), case.rules, strict=True)
    }
    holes = {
        name: [moved(hole, turn, np.array(shift)) for hole in found]
        for name, found in spec.holes.items()
    }
    after = planned(replace(spec, texts=tuple(texts), regions=regions, holes=holes))
    before = planned(spec)
    np.testing.assert_allclose(after.part_from_tool, turn @ before.part_from_tool, atol=1e-9)


@given(pose_cases(), st.data())
def test_the_length_of_a_normal_does_not_matter(case: PoseCase, data: st.DataObject) -> None:
    lengths = st.floats(0.91, 1.09)

    def stretched(hole: Hole) -> Hole:
        length = data.draw(lengths)
        return replace(hole, normal=tuple(v * length for v in hole.normal))

    tolerant = tuple(text.replace("up ", "unit_tolerance 0.1 up ", 1) for text in case.spec.texts)
    spec = replace(case.spec, texts=tolerant)
    longer = {name: [stretched(h) for h in holes] for name, holes in spec.holes.items()}
    before, after = planned(spec), planned(replace(spec, holes=longer))
    np.testing.assert_allclose(after.part_from_tool, before.part_from_tool, atol=1e-12)


def test_a_normal_beyond_the_tolerance_is_refused() -> None:
    hole = Hole("P1", (Decimal(1), Decimal(2), Decimal(3)), (0.8, 0.0, 0.0))
    part = "part p { up +Z normals into unit_tolerance 0.1 }"
    spec = Spec(("program P", part, "emit krl"), {"r": "posture x horizontal"}, {"r": [hole]})
    with pytest.raises(Refused, match=r"has length 0\.8"):
        planned(spec)
