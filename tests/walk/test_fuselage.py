"""The fuselage's programs, one a parking place, walked from home to home."""

from pathlib import Path

import numpy as np
import pytest
from walk.emitted import Spec, check_frames, check_walk, compiled, read

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
