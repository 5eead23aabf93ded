"""The kit itself: one post, one program, everything that must hold."""

from __future__ import annotations

from random import Random

from .behaviour import does_the_same
from .corpus import PROGRAMS
from .emitting import Case, Files, case_of, must
from .mutants import EDITS, edited, other_programs
from .rules import check_text, programs_of

#: So many edits of each kind, and so many other programs, are tried on each program.
_EDITS, _OTHERS = 4, 8


def accepted(post_name: str) -> list[str]:
    """The programs of the corpus that a post takes. A post that takes none says nothing of itself,
    so its tests should ask for one at least. Raises AssertionError as `check_post` does."""
    return [program for program in PROGRAMS if case_of(post_name, program).files()]


def check_post(post_name: str, program: str) -> bool:
    """Raises AssertionError, in words, unless an installed post does what every post must, for one
    program of `PROGRAMS`; returns whether the post takes it.

    A program is refused at a place in its spec, or it is written: as plain text, the same each
    time, which the post's own reader reads, and which does what the spec asks for, hole by hole.
    Faults that are put into the text must be found, unless the text then does the same; so must be
    the text of a program that differs in one figure.
    """
    return check_case(case_of(post_name, program))


def check_case(case: Case) -> bool:
    """The same for a post and a reader that need not be installed."""
    files, post = case.files(), case.post
    if not files:
        return False
    check_text(post, files)
    must(files == case.files(), f"{case.name}: {post.name} writes other bytes the second time")
    wrong = _list(case.failures(files))
    must(not wrong, f"{case.name}: what {post.name} writes is not proven:\n{wrong}")
    _check_edits(case, files)
    _check_others(case, files)
    return True


def _check_edits(case: Case, files: Files) -> None:
    """No fault in the text passes."""
    rng = Random(f"{case.post.name} {case.name}")
    programs = programs_of(files)
    for kind in EDITS:
        for _ in range(_EDITS):
            mutant = edited(programs, case.post.newline, kind, rng)
            if mutant is None:
                continue
            try:
                refused = bool(case.failures(mutant.files))
            except Exception as error:
                what = f"the reader or the proof fails on {mutant.what}"
                raise AssertionError(f"{case.name}: {what}: {type(error).__name__}") from error
            if refused:
                continue
            if not does_the_same(case, programs, mutant.files):
                raise AssertionError(f"{case.name}: the proof lets pass {mutant.what}")
            if kind == "a line of nonsense":
                raise AssertionError(f"{case.name}: the reader reads over {mutant.what}")


def _check_others(case: Case, files: Files) -> None:
    """The text of no other program passes for this one's."""
    rng = Random(f"others {case.post.name} {case.name}")
    first, *rest = case.plan.programs
    others = list(other_programs(first))
    for other in rng.sample(others, min(_OTHERS, len(others))):
        written = case.files((other.program, *rest))
        if not written or written == files or case.failures(written):
            continue
        same = does_the_same(case, programs_of(files), programs_of(written))
        if other.always_felt or not same:
            raise AssertionError(
                f"{case.name}: with {other.what} changed, {case.post.name} writes another text, and"
                " the proof lets it pass"
            )


def _list(failures: list[str]) -> str:
    shown = "\n".join(f"  {failure}" for failure in failures[:10])
    return shown if len(failures) <= 10 else f"{shown}\n  and {len(failures) - 10} more"
