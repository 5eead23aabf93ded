"""The ladder against every choice there is, and against the plain recurrence.

The oracles add in the order of the definition and know neither grids nor bounds. Costs on a coarse
binary grid make their sums exact too, so that ties can be compared; there ties abound.
"""

from dataclasses import replace
from itertools import product
from math import inf, pi

import numpy as np
import pytest
from drillc.kernels import recurrence as recurrence_
from drillc.kernels.ladder import Ladder, best_ladder, ladder_cost
from hypothesis import given
from hypothesis import strategies as st

DEGREES = pi / 180


def random_ladder(
    rng, widths, grid=None, limits=(inf,), groups=1, forbidden=0.0, weight=None, endless=()
):
    """Anything goes; with a grid, all costs are multiples of it (but whole turns are not)."""
    start = np.concatenate([[0], np.cumsum(widths)])
    n, m = len(widths), int(start[-1])
    joints, cost = rng.uniform(-3, 3, (m, 6)), rng.uniform(0, 4, m)
    weight = rng.uniform(0.2, 2.0, 6) if weight is None else weight
    group_cost = float(rng.uniform(0, 2))
    if grid:
        joints, cost = np.rint(joints / grid) * grid, np.rint(cost / grid) * grid
        weight, group_cost = 2.0 ** rng.integers(-1, 2, 6), grid * int(rng.integers(0, 4))
    cost[rng.random(m) < forbidden] = inf
    joints[cost == inf] = np.nan
    return Ladder(
        joints=joints,
        start=start,
        cost=cost,
        # Whole multiples of 5 degrees, so that many jumps are exactly at their limits.
        heading_rad=rng.integers(-36, 36, m) * 5 * DEGREES,
        jump_rad=rng.integers(-36, 37, n - 1) * 5 * DEGREES,
        jump_limit_rad=rng.choice(limits, n - 1),
        weight=weight,
        group=rng.integers(0, groups, m),
        group_cost=group_cost,
        endless=endless,
    )


def swept_ladder(rng, n, headings, branches, deviation, limit, group_cost=0.0):
    """Smooth joint curves over the headings, as an arm has them, that drift from hole to hole."""
    heading = (np.arange(headings) - headings // 2) * (2 * pi / headings)
    joints = np.empty((n, headings, branches, 6))
    size, phase, base = (rng.normal(size=(6, branches)) for _ in range(3))
    for k in range(n):
        turn = heading[:, None, None] + 0.01 * k
        joints[k] = base.T + size.T * np.sin(turn + phase.T) + 0.02 * k * size.T
    joints[..., 5] += heading[:, None]
    every = np.broadcast_to(heading[:, None], (n, headings, branches)).ravel()
    cost = deviation * np.abs(every)
    cost[rng.random(len(cost)) < 0.2] = inf
    return Ladder(
        joints=joints.reshape(-1, 6),
        start=np.arange(n + 1) * headings * branches,
        cost=cost,
        heading_rad=every.copy(),
        jump_rad=rng.normal(0, 0.2, n - 1),
        jump_limit_rad=np.full(n - 1, limit),
        weight=rng.uniform(0.2, 0.7, 6),
        group=np.tile(np.arange(branches), n * headings),
        group_cost=group_cost,
    )


def step(ladder, k, i, j):
    turn = ladder.jump_rad[k] + ladder.heading_rad[j] - ladder.heading_rad[i]
    wrapped = pi - np.mod(pi - turn, 2 * pi)
    way = np.abs(ladder.joints[j] - ladder.joints[i])
    for joint in ladder.endless:
        way[..., joint] = np.abs(way[..., joint, None] - 2 * pi * np.arange(4)).min(axis=-1)
    cost = (ladder.weight * way).sum(axis=-1)
    cost = cost + ladder.group_cost * (ladder.group[i] != ladder.group[j])
    return np.where(np.abs(wrapped) <= ladder.jump_limit_rad[k] + 1e-12, cost, inf)


def rung(ladder, k):
    return np.arange(ladder.start[k], ladder.start[k + 1])


def brute_force(ladder):
    """(total, choice) of the best of all choices; of equals the lowest, the last deciding first."""
    n = len(ladder.start) - 1
    best = (inf, ())
    for backwards in product(*[rung(ladder, k) for k in reversed(range(n))]):
        choice = backwards[::-1]
        total = ladder.cost[choice[0]]
        for k in range(n - 1):
            if total == inf or ladder.cost[choice[k + 1]] == inf:
                total = inf
                break
            total = total + step(ladder, k, choice[k], choice[k + 1]) + ladder.cost[choice[k + 1]]
        if total < best[0]:
            best = (total, choice)
    return best


def recurrence(ladder):
    """(total, choice, blocked) by the plain recurrence."""
    reach, before, came_from = ladder.cost[rung(ladder, 0)], None, []
    for k in range(len(ladder.start) - 1):
        here = rung(ladder, k)
        if k:
            total = reach[:, None] + step(ladder, k - 1, before[:, None], here[None])
            total[np.isnan(total)] = inf
            came_from.append(total.argmin(axis=0) if total.size else None)
            reach = (total.min(axis=0) if total.size else inf) + ladder.cost[here]
        if not (reach < inf).any():
            return inf, None, k
        before = here
    choice = [int(reach.argmin())]
    for pointers in reversed(came_from):
        choice.append(int(pointers[choice[-1]]))
    return reach.min(), ladder.start[:-1] + choice[::-1], None


def is_the_optimum(ladder):
    """Compare with the recurrence; returns the choice."""
    total, _, blocked = recurrence(ladder)
    choice = best_ladder(ladder)
    assert choice.blocked == blocked
    if blocked is not None:
        assert choice.total == inf
        assert len(choice.index) == blocked
        return choice
    assert choice.total == pytest.approx(total, rel=1e-12, abs=1e-12)
    on_their_rungs = (choice.index >= ladder.start[:-1]) & (choice.index < ladder.start[1:])
    assert on_their_rungs.all()
    return choice


CASES = {
    "free": {},
    "jump limits": {"limits": (0.4, 1.2, 2.5, inf)},
    "tight jump limits": {"limits": (0.0, 10 * DEGREES, 45 * DEGREES)},
    "groups": {"groups": 3},
    "holes in the ladder": {"forbidden": 0.4},
    "all at once": {"limits": (0.5, 1.5, 3.0), "groups": 2, "forbidden": 0.2},
    "whole turns for nothing": {"limits": (1.5, inf), "groups": 2, "endless": (3, 5)},
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("grid", [None, 0.5])
def test_it_is_the_best_of_all_choices(case, grid):
    rng = np.random.default_rng(3)
    feasible = 0
    for _ in range(40):
        widths = rng.integers(1, 6, rng.integers(1, 6))
        ladder = random_ladder(rng, widths, grid, **CASES[case])
        total, best = brute_force(ladder)
        choice = best_ladder(ladder)
        assert choice.total == pytest.approx(total, rel=1e-12)
        assert (choice.blocked is None) == (total < inf)
        feasible += total < inf
        if grid and total < inf and not ladder.endless:
            assert choice.index.tolist() == list(best)
    assert feasible >= 5
    assert feasible < 40 or "limits" not in CASES[case] or case == "jump limits"


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("grid", [None, 0.5])
@pytest.mark.parametrize(
    ("low", "high", "n"), [(1, 9, 150), (1, 40, 40), (1, 400, 12), (129, 300, 6)]
)
def test_it_is_the_recurrences(case, grid, low, high, n):
    """Narrow rungs, wide ones, and both in turn. On the grid even the choice is the same."""
    rng = np.random.default_rng(high)
    for _ in range(4):
        widths = rng.integers(low, high, n)
        ladder = random_ladder(rng, widths, grid, **CASES[case])
        choice = is_the_optimum(ladder)
        if grid and choice.blocked is None and not ladder.endless:
            np.testing.assert_array_equal(choice.index, recurrence(ladder)[1])


def detour_ladder(rng, n, limit, deviation=1.0, grid=None):
    """Joint curves over a wide rung's headings; here and there a fixture has them leave heading 0
    farther than one jump goes."""
    ladder = swept_ladder(rng, n, 36, 4, deviation, limit, 0.5)
    hole = np.repeat(np.arange(n), 36 * 4)
    cost = ladder.cost.copy()
    for first in rng.integers(0, n, 3):
        inside = (hole >= first) & (hole < first + 3)
        cost[inside & (np.abs(ladder.heading_rad) < rng.uniform(0.3, 1.2))] = inf
    joints, weight, jump_rad = ladder.joints, ladder.weight, np.zeros(n - 1)
    if grid:
        joints, cost = np.rint(joints / grid) * grid, np.rint(cost / grid) * grid
        weight = 2.0 ** rng.integers(-1, 2, 6)
    return replace(ladder, joints=joints, cost=cost, weight=weight, jump_rad=jump_rad)


@pytest.mark.parametrize("grid", [None, 1 / 64])
@pytest.mark.parametrize("deviation", [0.0, 0.1, 4.0])
def test_limits_that_bind_in_a_few_places(grid, deviation, monkeypatch):
    """The optimum of the recurrence, though few limits are looked at."""
    taken, asked = [], []
    again, few = recurrence_._forward_again, recurrence_._few_limits

    def forward_again(rungs, changed, reach):
        asked.append(np.isfinite(rungs.jump_limit_rad).mean())
        return again(rungs, changed, reach)

    def few_limits(rungs):
        taken.append(few(rungs))
        return taken[-1]

    monkeypatch.setattr(recurrence_, "_forward_again", forward_again)
    monkeypatch.setattr(recurrence_, "_few_limits", few_limits)
    rng = np.random.default_rng(17)
    for _ in range(8):
        ladder = detour_ladder(rng, 50, rng.uniform(0.2, 0.5), deviation, grid)
        choice = is_the_optimum(ladder)
        if grid and choice.blocked is None:
            np.testing.assert_array_equal(choice.index, recurrence(ladder)[1])
    assert sum(index is not None for index in taken) >= 5
    assert deviation == 0.0 or (len(asked) >= 4 and min(asked) < 0.7)


@pytest.mark.parametrize("rounds", [1, 2])
def test_limits_that_bind_in_too_many_places(rounds, monkeypatch):
    """Then all of them are looked at."""
    monkeypatch.setattr(recurrence_, "_ROUNDS", rounds)
    monkeypatch.setattr(recurrence_, "_AROUND", 0)
    rng = np.random.default_rng(18)
    for _ in range(6):
        ladder = detour_ladder(rng, 40, 0.25)
        assert is_the_optimum(ladder).blocked is None


def test_limits_that_block_after_limits_were_left_out():
    rng = np.random.default_rng(19)
    ladder = detour_ladder(rng, 30, 0.25)
    jump_rad = ladder.jump_rad.copy()
    jump_rad[11] = pi / 36  # between headings, and nobody reaches the next
    limit_rad = ladder.jump_limit_rad.copy()
    limit_rad[11] = 0.01
    assert (
        is_the_optimum(replace(ladder, jump_rad=jump_rad, jump_limit_rad=limit_rad)).blocked == 12
    )


@pytest.mark.parametrize("deviation", [0.0, 0.3, 3.0])
@pytest.mark.parametrize("limit", [inf, 0.02, 0.3, 1.5, 3.1, pi])
@pytest.mark.parametrize("group_cost", [0.0, 0.7])
def test_smooth_joint_curves(deviation, limit, group_cost):
    rng = np.random.default_rng(int(10 * deviation) + 1)
    ladder = swept_ladder(rng, 6, 72, 4, deviation, limit, group_cost)
    choice = is_the_optimum(ladder)
    assert limit < 0.3 or choice.blocked is None


def test_more_transitions_than_are_listed():
    rng = np.random.default_rng(9)
    is_the_optimum(swept_ladder(rng, 4, 90, 8, 0.0, 1.5))
    is_the_optimum(random_ladder(rng, [700, 900, 500], limits=(1.0, 2.0), groups=3))


def test_every_candidate_is_reached_at_its_least_cost():
    """Also those that no optimum needs: a last rung of one candidate asks for a group each."""
    rng = np.random.default_rng(12)
    for limit in (inf, 2.5):
        ladder = random_ladder(rng, [300, 280, 1], None, (limit,), 120, weight=np.full(6, 1e-3))
        for last_group in range(0, 120, 3):
            group = ladder.group.copy()
            group[-1] = last_group
            is_the_optimum(replace(ladder, group=group, group_cost=3.0))


def test_where_it_is_blocked():
    rng = np.random.default_rng(4)
    ladder = random_ladder(rng, [3, 4, 2, 5, 3])
    closed = ladder.cost.copy()
    closed[7:9] = inf  # all of rung 2
    choice = best_ladder(replace(ladder, cost=closed))
    assert (choice.blocked, choice.total) == (2, inf)
    two = replace(ladder, start=ladder.start[:3])
    np.testing.assert_array_equal(choice.index, best_ladder(two).index)
    # A jump that nobody can make, before the closed rung.
    turned = replace(
        ladder,
        cost=closed,
        heading_rad=np.zeros(17),
        jump_rad=np.array([0.5, 0.0, 0.0, 0.0]),
        jump_limit_rad=np.full(4, 0.4),
    )
    assert best_ladder(turned).blocked == 1
    assert best_ladder(replace(turned, jump_limit_rad=np.full(4, 0.5))).blocked == 2
    assert best_ladder(replace(ladder, cost=np.full(17, inf))).blocked == 0


@pytest.mark.parametrize("width", [2, 9, 200])
def test_a_jump_exactly_at_its_limit_is_allowed(width):
    """Also across ±180 degrees."""
    for before, after, jump in ((170, -145, 0), (10, 55, 0), (-170, 100, -45 + 360), (0, 0, 45)):
        ladder = Ladder(
            joints=np.zeros((2 * width, 6)),
            start=np.array([0, width, 2 * width]),
            cost=np.zeros(2 * width),
            heading_rad=np.repeat([before, after], width) * DEGREES,
            jump_rad=np.array([jump]) * DEGREES,
            jump_limit_rad=np.array([(45 if jump != 315 else 135) * DEGREES]),
            weight=np.ones(6),
            group=np.zeros(2 * width, dtype=np.int64),
            group_cost=0.0,
        )
        assert best_ladder(ladder).blocked is None
        tight = replace(ladder, jump_limit_rad=ladder.jump_limit_rad - 1e-9)
        assert best_ladder(tight).blocked == 1


def test_of_equals_the_lowest():
    for width in (3, 20, 150):
        ladder = random_ladder(np.random.default_rng(0), [width] * 4, limits=(3.0,), groups=2)
        m = 4 * width
        flat = replace(ladder, joints=np.ones((m, 6)), cost=np.ones(m), heading_rad=np.zeros(m))
        flat = replace(flat, jump_rad=np.zeros(3), group=np.zeros(m, dtype=np.int64))
        assert best_ladder(flat).index.tolist() == [0, width, 2 * width, 3 * width]


SEEDS = st.integers(0, 2**32 - 1)
SHAPES = st.lists(st.sampled_from([1, 2, 5, 8, 9, 30, 140]), min_size=1, max_size=6)


@given(seed=SEEDS, widths=SHAPES, scale=st.sampled_from([1e-3, 0.3, 7.0, 1e4]))
def test_scaling_every_cost_scales_the_total(seed, widths, scale):
    ladder = random_ladder(np.random.default_rng(seed), widths, limits=(0.8, 2.0, inf), groups=2)
    scaled = replace(
        ladder,
        cost=scale * ladder.cost,
        weight=scale * ladder.weight,
        group_cost=scale * ladder.group_cost,
    )
    one, other = best_ladder(ladder), best_ladder(scaled)
    assert other.blocked == one.blocked
    assert other.total == pytest.approx(scale * one.total, rel=1e-12)


@given(seed=SEEDS, widths=SHAPES, constant=st.floats(-1e3, 1e3))
def test_a_constant_on_a_rung_shifts_the_total(seed, widths, constant):
    rng = np.random.default_rng(seed)
    ladder = random_ladder(rng, widths, limits=(1.0, inf), groups=2, forbidden=0.1)
    k = int(rng.integers(len(widths)))
    cost = ladder.cost.copy()
    cost[rung(ladder, k)] += constant
    one, other = best_ladder(ladder), best_ladder(replace(ladder, cost=cost))
    assert other.blocked == one.blocked
    np.testing.assert_array_equal(other.index, one.index)
    assert other.total == pytest.approx(one.total + constant, rel=1e-12, abs=1e-9)


@given(seed=SEEDS, widths=SHAPES)
def test_backwards_costs_the_same(seed, widths):
    ladder = random_ladder(np.random.default_rng(seed), widths, limits=(0.6, 2.0), groups=2)
    widths = np.diff(ladder.start)
    reverse = replace(
        ladder,
        joints=ladder.joints[::-1],
        start=np.concatenate([[0], np.cumsum(widths[::-1])]),
        cost=ladder.cost[::-1],
        heading_rad=ladder.heading_rad[::-1],
        jump_rad=-ladder.jump_rad[::-1],
        jump_limit_rad=ladder.jump_limit_rad[::-1],
        group=ladder.group[::-1],
    )
    one, other = best_ladder(ladder), best_ladder(reverse)
    assert (one.blocked is None) == (other.blocked is None)
    assert other.total == pytest.approx(one.total, rel=1e-12)


def test_the_cost_of_a_choice_by_hand():
    ladder = Ladder(
        joints=np.array([[0.0] * 6, [1.0, -2.0, 0, 0, 0, 0], [1.0, 0, 0, 0, 0, 0.5]]),
        start=np.arange(4),
        cost=np.array([0.25, 0.5, 1.0]),
        heading_rad=np.zeros(3),
        jump_rad=np.zeros(2),
        jump_limit_rad=np.full(2, inf),
        weight=np.array([1.0, 10.0, 1.0, 1.0, 1.0, 100.0]),
        group=np.array([4, 4, -1]),
        group_cost=1000.0,
    )
    choice = best_ladder(ladder)
    assert choice.total == 1.75 + (1.0 + 20.0) + (20.0 + 50.0) + 1000.0
    assert ladder_cost(ladder, choice.index[:2]) == 0.75 + 21.0
    nothing = replace(
        ladder, start=np.zeros(1, dtype=np.int64), jump_rad=np.empty(0), jump_limit_rad=np.empty(0)
    )
    assert (best_ladder(nothing).total, best_ladder(nothing).blocked) == (0.0, None)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"weight": np.array([1.0, 1, 1, -1, 1, 1])}, "weights"),
        ({"group_cost": inf}, "weights"),
        ({"jump_limit_rad": np.array([np.nan])}, "jump limit"),
        ({"cost": np.array([0.0, np.nan, 0.0, 0.0])}, "cost"),
        ({"cost": np.array([0.0, -inf, 0.0, 0.0])}, "cost"),
        ({"joints": np.full((4, 6), np.nan)}, "joint"),
    ],
)
def test_what_is_refused(change, message):
    ladder = random_ladder(np.random.default_rng(0), [2, 2])
    with pytest.raises(ValueError, match=message):
        best_ladder(replace(ladder, **change))
