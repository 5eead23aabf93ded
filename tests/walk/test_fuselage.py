"""The fuselage's programs, one a parking place, walked from home to home.

The panel's own skin is no fixture of the spec, and is not looked at.
"""

from pathlib import Path

import numpy as np
import pytest
from walk.dense import Cycle, Dense
from walk.emitted import Spec, check_frames, check_walk, compiled, read
from walk.walking import ROUNDING_MM, WalkError

SAMPLE = Path(__file__).parents[2] / "samples" / "fuselage_arm.drill"
#: How many holes each program makes.
PROGRAMS = {"aft": 801, "forward": 881}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    return compiled(SAMPLE, tmp_path_factory.mktemp("fuselage") / "out")


def walked(files, station):
    spec = Spec(SAMPLE)
    scene, emitted = spec.scene(station), read(files, f"FUSELAGE_P_{station}")
    check_frames(spec, scene, emitted)
    assert len(emitted.holes) == PROGRAMS[station]
    went = check_walk(scene, emitted, spec.home)
    assert np.abs(went.stops[-1] - spec.home).max() < 1e-4
    assert sum(map(len, went.joints)) > 100 * PROGRAMS[station]


@pytest.mark.parametrize("station", ["aft", pytest.param("forward", marks=pytest.mark.slow)])
def test_every_motion_is_walked_and_nothing_happens(files, station):
    walked(files, station)


def turns(emitted):
    """How far the program turns the tool from its rule, x toward +X: (n,) in degrees."""
    tools = np.array([hole.pose[:3, :3] for hole in emitted.holes])
    rule = np.array([1.0, 0.0, 0.0]) - tools[:, :1, 2] * tools[:, :, 2]
    along = (tools[:, :, 0] * rule).sum(axis=1)
    return np.degrees(np.arctan2(-(tools[:, :, 1] * rule).sum(axis=1), along))


def test_the_fixtures_are_in_the_way_of_a_good_part_of_the_holes(files):
    """Where the tool is turned by much, the rule's heading cannot be had. At every heading that is
    chosen, tool and arm keep their clearance, but for the rounding of the emitted text."""
    spec = Spec(SAMPLE)
    turned = []
    for station in PROGRAMS:
        emitted = read(files, f"FUSELAGE_P_{station}")
        judge = Dense(spec.scene(station), spec.flange_from_tool, singular_deg=5.0)
        turn = turns(emitted)
        turned += (np.abs(turn) > 0.01).tolist()
        for hole, away_deg in zip(emitted.holes, turn.tolist(), strict=True):
            kept = {"boards": 10.0 - ROUNDING_MM, "bars": 10.0 - ROUNDING_MM}
            cycle = Cycle(hole.pose, 60.0, hole.depth_mm, kept)
            assert judge.works(cycle, 0.0)
            if abs(away_deg) > 50.0:
                assert not judge.works(cycle, -away_deg)
    assert 0.15 < np.mean(turned) < 0.4


@pytest.mark.slow
@pytest.mark.parametrize(
    ("falsify", "said"),
    [
        # Holes beside a board are moved nearer to it.
        (lambda t: t.replace("X -697.910,", "X -767.910,"), "'boards'"),
        (lambda t: t.replace("Z -60.000,", "Z -10.000,"), "'boards'|'bars'"),
    ],
)
def test_the_walk_notices_what_is_false(files, falsify, said):
    spec = Spec(SAMPLE)
    false = read(files, "FUSELAGE_P_aft", falsify)
    with pytest.raises((AssertionError, WalkError), match=said):
        check_walk(spec.scene("aft"), false, spec.home)
