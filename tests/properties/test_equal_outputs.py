"""Specs that say the same in other words give the same program, to the last byte."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from properties.specs import (
    SEPARATOR,
    PortalCase,
    PoseCase,
    Spec,
    emitted,
    planned,
    portal_cases,
    pose_cases,
)

#: Each example is compiled two or three times for two or three posts, a tenth of a second each.
few = settings(max_examples=10)
UNITS = st.sampled_from(("m", "cm", "um"))


@few
@given(pose_cases(), UNITS)
def test_the_unit_of_poses(case: PoseCase, unit: str) -> None:
    wanted = emitted(case.spec)
    assert wanted.keys() >= {"krl/POSES.src", "krl/POSES.dat"}
    assert emitted(replace(case.spec, unit=unit)) == wanted
    assert emitted(replace(case.spec, unit=unit, table=True)) == wanted


@few
@given(portal_cases(), UNITS)
def test_the_unit_of_the_portals_holes(case: PortalCase, unit: str) -> None:
    wanted = emitted(case.spec)
    assert emitted(replace(case.spec, unit=unit)) == wanted
    assert emitted(replace(case.spec, unit=unit, table=True)) == wanted


@given(st.decimals("-9000", "9000", places=9), st.integers(0, 6))
def test_every_decimal_is_the_same_float_in_every_unit(value: Decimal, digits: int) -> None:
    """Were a unit applied in binary, one decimal in some ten would differ in its last bit."""
    from drillc.language.columns import numbers
    from drillc.language.units import UNITS, convert

    value = round(value, digits + 3)
    for unit, shift in (("m", -3), ("um", 3), ("cm", -1), ("mm", 0)):
        text = format(value.scaleb(shift), "f")
        assert convert(text, UNITS[unit]) == float(value)
        assert numbers([text], UNITS[unit]).values.tolist() == [float(value)]


@few
@given(pose_cases(), st.data())
def test_the_order_of_declarations(case: PoseCase, data: st.DataObject) -> None:
    """Regions are made in the order in which they stand; all else may stand anywhere."""
    assert emitted(_reordered(case.spec, data)) == emitted(case.spec)


@few
@given(portal_cases(), st.data())
def test_the_order_of_the_portals_declarations(case: PortalCase, data: st.DataObject) -> None:
    assert emitted(_reordered(case.spec, data)) == emitted(case.spec)


def _reordered(spec: Spec, data: st.DataObject) -> dict[str, str]:
    """The spec's files with its declarations shuffled, before, between and behind the regions."""
    files = spec.files()
    first, *rest = [text for text in spec.files()["spec.drill"].split(SEPARATOR) if text.strip()]
    regions = [text for text in rest if text.startswith("region ")]
    others = data.draw(st.permutations([text for text in rest if text not in regions]))
    places = sorted(data.draw(st.integers(0, len(regions))) for _ in others)
    statements = [first]
    for index in range(len(regions) + 1):
        statements += [text for text, place in zip(others, places, strict=True) if place == index]
        statements += regions[index : index + 1]
    files["spec.drill"] = SEPARATOR.join([*statements, ""])
    return files


@few
@given(pose_cases(), st.data())
def test_declarations_in_a_cell_file(case: PoseCase, data: st.DataObject) -> None:
    """What a cell may declare gives the same program from a cell."""
    files = case.spec.files()
    movable = [t for t in case.spec.texts if t.split()[0] in {"tool", "io", "process"}]
    moved = data.draw(st.lists(st.sampled_from(movable), min_size=1, unique=True))
    files["shared.cell"] = "\n".join(["drill 1", *moved, ""])
    for text in moved:
        files["spec.drill"] = files["spec.drill"].replace(text + SEPARATOR, "")
    files["spec.drill"] += 'use "shared.cell"\n'
    assert emitted(files) == emitted(case.spec)


@few
@given(pose_cases())
def test_a_table_and_inline_points_are_one_program(case: PoseCase) -> None:
    inline, table = planned(case.spec), planned(replace(case.spec, table=True))
    for column in ("ids", "position_mm", "feed", "region"):
        one, two = getattr(inline.job.holes, column), getattr(table.job.holes, column)
        np.testing.assert_array_equal(one, two)
    np.testing.assert_array_equal(inline.part_from_tool, table.part_from_tool)


@few
@given(pose_cases(), st.sampled_from(("krl", "rapid")))
def test_a_post_alone_writes_what_it_writes_beside_another(case: PoseCase, post: str) -> None:
    both = emitted(case.spec)
    texts = tuple(
        t for t in case.spec.texts if not t.startswith("emit ") or f"emit {post} " in f"{t} "
    )
    alone = emitted(replace(case.spec, texts=texts))
    assert alone == {name: data for name, data in both.items() if name.startswith(f"{post}/")}
