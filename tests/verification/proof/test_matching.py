"""Holes found again by place and order."""

from __future__ import annotations

import numpy as np
import pytest
from drillc.verification.matching import Marks, Matcher

N = 40
RNG = np.random.default_rng(5)
AXIS = RNG.normal(size=(N, 3))
AXIS /= np.linalg.norm(AXIS, axis=1)[:, None]
WANTED = Marks(np.stack([20.0 * np.arange(N), RNG.normal(size=N), RNG.normal(size=N)], 1), AXIS)


def rows(order: list[int], moved: dict[int, float] | None = None, first: int = 0) -> list[int]:
    found = WANTED.take(np.array(order, dtype=np.intp))
    for k, by in (moved or {}).items():
        found.bottom_mm[k] += [0.0, by, 0.0]
    matched: list[int] = Matcher(WANTED).match(found, first).tolist()
    return matched


@pytest.mark.parametrize(
    "order",
    [
        list(range(N)),
        list(range(5, 20)),
        [0, 1, 3, 4],
        [0, 2, 1, 3],
        [3, 2, 1, 0],
        [0, 1, 1, 2],
        [7],
        [],
        RNG.permutation(N).tolist(),
    ],
)
def test_exact_ones_are_found_in_any_order(order: list[int]) -> None:
    assert rows(order) == order
    assert rows(order, first=17) == order


def test_a_moved_one_is_the_one_between_its_neighbours() -> None:
    assert rows([0, 1, 2, 3, 4], {2: 300.0}) == [0, 1, 2, 3, 4]
    assert rows([0, 1, 2, 3, 4], {2: 3.0, 3: 5.0}) == [0, 1, 2, 3, 4]


def test_one_too_many_is_none() -> None:
    assert rows([0, 1, 1, 2], {2: 7.0}) == [0, 1, -1, 2]


def test_the_nearest_is_taken_where_some_are_missing() -> None:
    assert rows([0, 3, 5], {1: 4.0}) == [0, 3, 5]


def test_too_deep_is_the_same_hole() -> None:
    found = WANTED.take(np.arange(N))
    found = Marks(found.bottom_mm + 4.0 * found.axis, found.axis)
    assert Matcher(WANTED).match(found, 0).tolist() == list(range(N))


def test_nothing_matches_nothing() -> None:
    none = WANTED.take(slice(0, 0))
    assert Matcher(none).match(WANTED.take(slice(0, 2)), 0).tolist() == [-1, -1]
