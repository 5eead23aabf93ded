"""The nacelle's program, walked from home to home."""

import re
from pathlib import Path

import pytest
from walk.emitted import Spec, check_frames, check_walk, compiled, read
from walk.walking import WalkError

SAMPLE = Path(__file__).parents[2] / "samples" / "nacelle.drill"


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    return compiled(SAMPLE, tmp_path_factory.mktemp("nacelle") / "out")


def test_the_whole_program_is_walked_and_nothing_happens(files):
    spec = Spec(SAMPLE)
    scene, emitted = spec.scene(), read(files, "NACELLE_A")
    check_frames(spec, scene, emitted)
    assert len(emitted.holes) == 6
    went = check_walk(scene, emitted, spec.home)
    assert abs(went.stops[-1] - spec.home).max() < 1e-4
    assert sum(map(len, went.joints)) > 6000


def test_the_walk_meets_a_fixture_that_was_moved_behind_the_compilers_back(files, tmp_path):
    """And so would meet one that the compiler had overlooked."""
    path = tmp_path / "nacelle.drill"
    text = SAMPLE.read_text("utf-8").replace(
        'use "cells/', f'use "{SAMPLE.parent.as_posix()}/cells/'
    )
    path.write_text(text.replace("(400, 1500, 500) (700", "(400, 1500, 470) (700"), "utf-8")
    spec = Spec(path)
    with pytest.raises(AssertionError, match=r"steps, at first \(\d+, 'tool \d', 'jig'\)"):
        check_walk(spec.scene(), read(files, "NACELLE_A"), spec.home)


@pytest.mark.parametrize(
    ("falsify", "said"),
    [
        (lambda t: t.replace("Y 1730.000,Z 392.000", "Y 1730.000,Z 442.000"), "'jig'"),
        (lambda t: re.sub(r"(VIA_PTP\[2\]=.*),S 2", r"\1,S 3", t), "mean 0 places"),
        (lambda t: re.sub(r"(DECL E6POS P7=.*,T )\d+", r"\g<1>10", t), "S and T"),
        (lambda t: t.replace("A1 0.00000,A2 -90.00000", "A1 0.00000,A2 -150.00000"), "limits"),
    ],
)
def test_the_walk_notices_what_is_false(files, falsify, said):
    spec = Spec(SAMPLE)
    false = read(files, "NACELLE_A", falsify)
    with pytest.raises((AssertionError, WalkError), match=said):
        check_walk(spec.scene(), false, spec.home)
