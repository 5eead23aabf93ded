"""How lanes hand values on: guesses, and what they come to."""

from __future__ import annotations

import numpy as np
from drillc.verification.values import carried, passed_on
from hypothesis import given
from hypothesis import strategies as st

#: Per lane: what it writes, or None where it leaves the value alone.
WRITES = st.lists(st.none() | st.sampled_from([0.0, 1.0, 2.0]), min_size=2, max_size=30)


def ends_of(begin: np.ndarray, writes: list[float | None]) -> np.ndarray:
    return np.array([b if w is None else w for b, w in zip(begin.tolist(), writes, strict=True)])


@given(WRITES, st.sampled_from([0.0, 1.0]))
def test_guesses_come_to_what_happens(writes: list[float | None], first: float) -> None:
    """However long a value passes through lanes that leave it alone, and few as its values are."""
    count = len(writes)
    begin = np.full(count, first)
    wrote = None
    for _ in range(5):
        ends = ends_of(begin, writes)
        if (passed_on({"x": first}, {"x": ends}, count)["x"] == begin).all():
            break
        guess, wrote = carried({"x": first}, {"x": begin}, {"x": ends}, wrote, count)
        begin = guess["x"]
    else:
        raise AssertionError("no guess was consistent")
    value = first
    for b, w in zip(begin.tolist(), writes, strict=True):
        assert b == value
        value = value if w is None else w
