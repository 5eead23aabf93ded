"""Mutants of emitted programs, read back and proven: which are caught, which survive, and why."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from random import Random

from drillc.testing.emitting import Case, case_of

from mutants.editing import Mutant, mutate
from mutants.faults import LANGUAGES

#: Programs of the corpus that a language's faults are put into: poses, joints, arms; pecks, clamps,
#: dwells, rivets; one file and several.
PROGRAMS = {
    "krl": ("arm_kuka", "poses_peck", "poses_regions", "poses_modules", "portal_drill"),
    "rapid": ("arm_abb", "poses_peck", "poses_regions", "poses_modules", "portal_rivet"),
    "gcode": ("arm_kuka", "portal_drill", "portal_rivet", "portal_modules"),
}


@dataclass
class Tally:
    """`caught` by kind; `survivors` as they came."""

    caught: dict[str, int] = field(default_factory=dict)
    survivors: list[Mutant] = field(default_factory=list)

    @property
    def count(self) -> int:
        return sum(self.caught.values()) + len(self.survivors)


def mutants(language: str, seed: int) -> Iterator[tuple[Case, Mutant]]:
    """Endless: a program, a kind of fault and a place, each at random. Kinds that a program has no
    place for are passed over."""
    rng = Random(f"{language} {seed}")
    kinds, code = LANGUAGES[language]
    cases = [case_of(language, name) for name in PROGRAMS[language]]
    emitted = [case.files() for case in cases]
    while True:
        kind = rng.choice(list(kinds))
        for index in rng.sample(range(len(cases)), len(cases)):
            mutant = mutate(kind, kinds[kind], emitted[index], code, rng)
            if mutant is not None:
                yield cases[index], mutant
                break


def judge(language: str, seed: int, count: int) -> Tally:
    """Prove `count` mutants."""
    tally = Tally()
    for case, mutant in mutants(language, seed):
        if tally.count >= count:
            break
        if case.failures(mutant.files):
            tally.caught[mutant.kind] = tally.caught.get(mutant.kind, 0) + 1
        else:
            tally.survivors.append(mutant)
    return tally


# ── survivors ────────────────────────────────────────────────────────────────────────────────────


@dataclass(frozen=True)
class Equivalent:
    """A fault that changes nothing that the machine does: of a kind, in a line, for a reason."""

    kind: str
    line: str
    why: str

    def explains(self, mutant: Mutant) -> bool:
        return bool(
            re.fullmatch(self.kind, mutant.kind)
            and re.search(self.line, f"{mutant.before} -> {mutant.after}")
        )


EQUIVALENT: tuple[Equivalent, ...] = ()


def unexplained(survivors: list[Mutant]) -> list[str]:
    """Survivors that nobody has explained."""
    return [
        str(mutant)
        for mutant in survivors
        if not any(reason.explains(mutant) for reason in EQUIVALENT)
    ]
