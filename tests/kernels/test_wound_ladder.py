"""Poses in several windings: against every choice there is, and against the plain recurrence."""

from dataclasses import replace
from math import inf, pi

import numpy as np
import pytest
from drillc.kernels import wound_ladder
from drillc.kernels.ladder import best_ladder, ladder_cost
from drillc.kernels.wound_ladder import best_wound_ladder
from kernels.test_ladder import brute_force, random_ladder, recurrence

#: Of the joints 3 and 5, as of an arm's A4 and A6.
REACH_RAD = np.radians(350.0)


def wound(rng, ladder, dear):
    """The ladder and its poses' numbers, with every pose in the windings that joints 3 and 5 reach;
    `dear`: what the cost of a winding may differ by."""
    turns = [(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)]
    of, joints = [], []
    for i, pose in enumerate(ladder.joints):
        for a, b in turns:
            turned = pose + 2 * pi * np.array([0, 0, 0, a, 0, b])
            if (np.abs(turned[[3, 5]]) <= REACH_RAD).all() or np.isnan(turned).any():
                of.append(i)
                joints.append(turned)
    of = np.array(of)
    return replace(
        ladder,
        joints=np.array(joints),
        start=np.searchsorted(of, ladder.start),
        cost=ladder.cost[of] + dear * rng.random(len(of)),
        heading_rad=ladder.heading_rad[of],
        group=ladder.group[of],
    ), of


@pytest.fixture
def sizes(monkeypatch):
    """How many candidates the ladders have that are solved."""
    sizes = []

    def counting(ladder):
        sizes.append(len(ladder.cost))
        return best_ladder(ladder)

    monkeypatch.setattr(wound_ladder, "best_ladder", counting)
    return sizes


def keeps_its_limits(ladder, index):
    turn = ladder.jump_rad + np.diff(ladder.heading_rad[index])
    return (np.abs(pi - np.mod(pi - turn, 2 * pi)) <= ladder.jump_limit_rad + 1e-9).all()


CASES = {
    "free": {},
    "jump limits": {"limits": (0.4, 1.2, 2.5, inf)},
    "groups": {"groups": 3},
    "all at once": {"limits": (1.0, 2.0, 3.0), "groups": 2, "forbidden": 0.2},
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("dear", [0.0, 3.0])
def test_it_is_the_best_of_all_choices(case, dear, sizes):
    """Where the windings cost the same it is found without looking at all of them, as a rule; where
    they do not, it often is not."""
    rng = np.random.default_rng(5)
    ways = {2: 0, 3: 0}
    for _ in range(40):
        poses = random_ladder(rng, rng.integers(1, 3, rng.integers(1, 5)), **CASES[case])
        ladder, pose = wound(rng, poses, dear)
        total, _ = brute_force(ladder)
        sizes.clear()
        choice = best_wound_ladder(ladder, pose)
        assert (choice.blocked is None) == (total < inf)
        if total < inf:
            ways[len(sizes)] += 1
            assert choice.total == pytest.approx(total, abs=1e-9)
            assert ladder_cost(ladder, choice.index) == pytest.approx(total, abs=1e-9)
            assert keeps_its_limits(ladder, choice.index)
    assert ways[2] >= 5
    assert ways[3] >= 5 * (dear > 0.0)


@pytest.mark.parametrize("case", CASES)
def test_it_is_the_recurrences(case, sizes):
    """More holes; and where it is blocked, as far as it is not."""
    rng = np.random.default_rng(6)
    for _ in range(6):
        poses = random_ladder(rng, rng.integers(1, 60, 9), **CASES[case])
        ladder, pose = wound(rng, poses, 0.3)
        total, _, blocked = recurrence(ladder)
        choice = best_wound_ladder(ladder, pose)
        plain = best_ladder(ladder)
        assert (choice.blocked, plain.blocked) == (blocked, blocked)
        assert choice.total == pytest.approx(total, abs=1e-9)
        assert len(choice.index) == len(plain.index)
        best = ladder_cost(ladder, plain.index)
        assert ladder_cost(ladder, choice.index) == pytest.approx(best, abs=1e-9)


def test_a_joint_that_must_wind_back():
    """It turns on past its limit, where the shorter way around is not to be had."""
    rng = np.random.default_rng(7)
    poses = random_ladder(rng, [1] * 30)
    joints = np.zeros((30, 6))
    joints[:, 5] = np.radians(40.0) * np.arange(30)
    joints[:, 5] -= 2 * pi * np.rint(joints[:, 5] / (2 * pi))
    ladder, pose = wound(rng, replace(poses, joints=joints), 0.0)
    choice = best_wound_ladder(ladder, pose)
    assert choice.total == pytest.approx(recurrence(ladder)[0], abs=1e-9)
    step = np.abs(np.diff(np.degrees(ladder.joints[choice.index, 5])))
    # It begins at 0 and reaches 320 on either side: 29 steps take it back three times.
    assert np.rint(np.sort(step)).tolist() == [40] * 26 + [320] * 3
    assert ladder_cost(replace(ladder, endless=(5,)), choice.index) < choice.total


def test_where_it_is_blocked():
    rng = np.random.default_rng(10)
    ladder, pose = wound(rng, random_ladder(rng, [2, 3, 2, 3]), 1.0)
    for rung in (0, 2):
        cost = ladder.cost.copy()
        cost[ladder.start[rung] : ladder.start[rung + 1]] = inf
        closed = replace(ladder, cost=cost)
        choice, plain = best_wound_ladder(closed, pose), best_ladder(closed)
        assert (choice.blocked, choice.total) == (rung, inf)
        assert choice.index.tolist() == plain.index.tolist()


def test_poses_in_one_winding_are_a_plain_ladder(sizes):
    rng = np.random.default_rng(8)
    ladder = random_ladder(rng, [3, 4, 3], groups=2)
    choice = best_wound_ladder(ladder, np.arange(10))
    assert sizes == [10]
    assert choice.index.tolist() == best_ladder(ladder).index.tolist()
    # The same number in two rungs is not the same pose.
    one = random_ladder(rng, [1, 1, 1])
    assert best_wound_ladder(one, np.zeros(3)).index.tolist() == [0, 1, 2]
    none = replace(
        one, start=np.zeros(1, dtype=np.int64), jump_rad=np.empty(0), jump_limit_rad=np.empty(0)
    )
    assert best_wound_ladder(none, np.zeros(3)).total == 0.0


def test_what_is_refused():
    rng = np.random.default_rng(9)
    ladder, pose = wound(rng, random_ladder(rng, [2, 2]), 1.0)
    joints = ladder.joints.copy()
    joints[int(ladder.cost.argmax())] = np.nan
    with pytest.raises(ValueError, match="joint"):
        best_wound_ladder(replace(ladder, joints=joints), pose)
