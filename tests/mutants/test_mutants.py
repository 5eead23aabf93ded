"""Faults put into emitted programs are found: all of them, but for those that change nothing."""

from __future__ import annotations

from collections import Counter

import pytest
from mutants.faults import LANGUAGES
from mutants.judging import EQUIVALENT, Tally, judge, mutants, unexplained

#: Mutants of a language in a normal run, and in a long one; in chunks, each with a seed of its own.
CHUNK, CHUNKS, LONG_CHUNK, LONG_CHUNKS = 100, 4, 420, 8
#: Kinds of fault that a language has at least, and that a normal run comes by.
KINDS = 40


def _judged(language: str, seed: int, count: int) -> Tally:
    tally = judge(language, seed, count)
    left = unexplained(tally.survivors)
    assert not left, f"{len(left)} of {tally.count} faults pass:\n" + "\n".join(left)
    return tally


@pytest.mark.parametrize("seed", range(CHUNKS))
@pytest.mark.parametrize("language", LANGUAGES)
def test_faults_are_found(language: str, seed: int) -> None:
    assert _judged(language, seed, CHUNK).count == CHUNK


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1000, 1000 + LONG_CHUNKS))
@pytest.mark.parametrize("language", LANGUAGES)
def test_many_faults_are_found(language: str, seed: int) -> None:
    assert _judged(language, seed, LONG_CHUNK).count == LONG_CHUNK


def test_there_are_many_kinds() -> None:
    assert all(len(kinds) >= KINDS for kinds, _ in LANGUAGES.values())
    assert LONG_CHUNK * LONG_CHUNKS * len(LANGUAGES) >= 10_000


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_run_comes_by_many_kinds(language: str) -> None:
    """Those that it draws: proving is for the others."""
    drawn: Counter[str] = Counter()
    for seed in range(CHUNKS):
        stream = mutants(language, seed)
        drawn.update(next(stream)[1].kind for _ in range(CHUNK))
    assert len(drawn) >= KINDS


def test_every_reason_is_of_a_kind_that_there_is() -> None:
    kinds = {kind for table, _ in LANGUAGES.values() for kind in table}
    for reason in EQUIVALENT:
        assert any(part in kinds or "(" in part for part in reason.kind.split("|")), reason
