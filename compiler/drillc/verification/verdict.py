"""What a proof comes to: for each check how much was compared, the worst figure, and what fails."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from drillc.language.source import Span

from .events import Floats

Rows = NDArray[np.intp]

#: Every check, in the order in which they are told, and the unit of its figure.
CHECKS = {
    "reads": "",
    "rules": "",
    "used": "",
    "coverage": "",
    "order": "",
    "position": "mm",
    "axis": "deg",
    "heading": "deg",
    "depth": "mm",
    "straight": "mm",
    "standoffs": "mm",
    "ways": "mm",
    "process": "",
    "handshake": "s",
    "speed": "%",
    "joints": "of limit",
    "configuration": "",
    "frames": "",
    "signals": "",
    "quaternions": "",
}
#: Figures are told to so many decimals of mm, radians, seconds and shares.
_TOLD_DECIMALS = 8
#: So many failures of a check are named, the others are counted.
MOST_NAMED = 10


@dataclass(frozen=True)
class Failure:
    """`message` is a sentence that names the hole. `file` (under the output folder) and `line` are
    where it is done, `span` what the spec says; `alike` counts others that fail by the same line.
    """

    message: str
    hole: str | None = None
    file: str | None = None
    line: int = 0
    span: Span | None = None
    alike: int = 0


@dataclass(frozen=True)
class Check:
    """`worst` and `limit` in `unit` where the check has a figure: that which comes nearest to its
    limit, and where. `failed` counts failures, of which the first few are named."""

    name: str
    compared: int
    unit: str = ""
    worst: float | None = None
    limit: float | None = None
    hole: str | None = None
    file: str | None = None
    line: int = 0
    failed: int = 0
    failures: tuple[Failure, ...] = ()


@dataclass(frozen=True)
class Verdict:
    """What one program comes to; `checks` are all of `CHECKS`, in their order."""

    program: str
    post: str
    holes: int
    checks: tuple[Check, ...]

    @property
    def passed(self) -> bool:
        """Whether nothing fails."""
        return not any(check.failed for check in self.checks)

    def check(self, name: str) -> Check:
        """One of the checks."""
        return self.checks[list(CHECKS).index(name)]


@dataclass(eq=False)
class _Count:
    compared: int = 0
    share: float = -1.0
    worst: float | None = None
    limit: float | None = None
    hole: str | None = None
    file: str | None = None
    line: int = 0
    failed: int = 0
    failures: list[Failure] = field(default_factory=list)


@dataclass(eq=False)
class Tally:
    """Counts a verdict together. `files` are the program's, as file indices mean them."""

    files: Sequence[str]
    _counts: dict[str, _Count] = field(default_factory=lambda: {name: _Count() for name in CHECKS})

    def compared(self, check: str, count: int) -> None:
        """So many were compared, and no figure stands for them."""
        self._counts[check].compared += count

    def failed(self, check: str) -> int:
        """How many failures a check has so far."""
        return self._counts[check].failed

    def full(self, check: str) -> bool:
        """Whether so many failures are named that more are only counted."""
        return len(self._counts[check].failures) >= MOST_NAMED

    def more(self, check: str, count: int) -> None:
        """Failures that are not named."""
        self._counts[check].failed += count

    def fail(
        self,
        check: str,
        message: str,
        *,
        hole: str | None = None,
        file: int = -1,
        line: int = 0,
        span: Span | None = None,
        alike: int = 0,
    ) -> None:
        """A failure, or with `alike` several by the same line."""
        count = self._counts[check]
        count.failed += 1 + alike
        if len(count.failures) < MOST_NAMED:
            count.failures.append(Failure(message, hole, self._file(file), line, span, alike))

    def figures(
        self,
        check: str,
        errors: Floats,
        limits: Floats | float,
        place: Callable[[int], tuple[str | None, int, int]],
    ) -> Rows:
        """Compare errors (k,) with limits; `place` gives hole, file and line of one of them.
        Returns those that are beyond, NaN among them; they are not failures yet."""
        count = self._counts[check]
        count.compared += len(errors)
        if not len(errors):
            return np.empty(0, dtype=np.intp)
        known = np.where(np.isnan(errors), np.inf, errors)
        # What is noise is told as zero, and of equals the first: the same on every processor.
        told = np.round(known, _TOLD_DECIMALS)
        share = told / limits
        worst = int(np.argmax(share))
        if share[worst] > count.share and np.isfinite(share[worst]):
            count.share = float(share[worst])
            count.worst = float(told[worst])
            count.limit = float(np.broadcast_to(limits, known.shape)[worst])
            count.hole, file, count.line = place(worst)
            count.file = self._file(file)
        return np.flatnonzero(~(known <= limits))

    def verdict(self, program: str, post: str, holes: int) -> Verdict:
        """All that was counted."""
        checks = tuple(
            Check(
                name,
                one.compared,
                CHECKS[name],
                _shown(one.worst, CHECKS[name]),
                _shown(one.limit, CHECKS[name]),
                one.hole,
                one.file,
                one.line,
                one.failed,
                tuple(one.failures),
            )
            for name, one in self._counts.items()
        )
        return Verdict(program, post, holes, checks)

    def _file(self, index: int) -> str | None:
        return self.files[index] if 0 <= index < len(self.files) else None


def _shown(value: float | None, unit: str) -> float | None:
    """Figures are kept in rad and as shares, and told in degrees and percent."""
    if value is None:
        return None
    return {"deg": float(np.degrees(value)), "%": 100.0 * value}.get(unit, value)
