"""What a reader of a controller's language is: it reads program text and runs it.

A reader shares no code with the post that emits its language. It is registered under the post's
name in the entry-point group `drillc.readers`, so a plug-in brings its own.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from drillc.language.job import Signal

from .events import Step, ToolFrame


class ReadError(Exception):
    """The text is not what the controller, or the reader, understands. `file` is an index into the
    program's files, or -1; `line` and `column` count from 1."""

    def __init__(self, file: int, line: int, column: int, message: str) -> None:
        super().__init__(message)
        self.file, self.line, self.column, self.message = file, line, column, message


@dataclass(frozen=True)
class Finding:
    """A rule of the controller that the text breaks, although it can be run: a name that is too
    long, a position that is declared and never used. `check` is the check it counts for."""

    check: str
    file: int
    line: int
    column: int
    message: str


@dataclass(frozen=True)
class Precision:
    """Half of the last digit that the controller's programs are printed with. A speed may be off by
    `speed_mm_s`, and by `speed_share` of itself where its digits are counted from the first."""

    length_mm: float
    angle_rad: float  # of Euler angles, or twice that of a quaternion's part
    joint_mm: float
    joint_rad: float
    speed_share: float = 0.0
    speed_mm_s: float = 0.0
    analog: float = 0.0  # of an analog value, as the controller counts it


class Run(ABC):
    """One program that was read and can be run. `files` are its paths under the output folder, in
    the order that file indices mean; `axes` names the columns of `Events.joints`."""

    name: str
    files: Sequence[str]
    axes: tuple[str, ...]
    signals: Mapping[str, int]  # name → number, complete once the run is over
    frames: Sequence[ToolFrame]

    @abstractmethod
    def steps(self) -> Iterator[Step]:
        """Run it. Raises ReadError where it cannot go on."""

    @abstractmethod
    def findings(self) -> Sequence[Finding]:
        """Rules that the text breaks; to be asked once the run is over."""

    def name_of(self, file: int, line: int) -> str | None:
        """What the program calls the position that is used in this line of its body, if anything:
        for messages only."""
        return None


class Reader(ABC):
    """Base of all readers. A subclass is made without arguments and keeps no state."""

    #: The name of the post whose programs it reads.
    name: ClassVar[str]
    precision: ClassVar[Precision]
    #: Whether the language has its own words for the spindle (`Kind.SPINDLE`).
    native_spindle: ClassVar[bool] = False
    #: Whether its programs state a tool's mass and centre of gravity.
    states_loads: ClassVar[bool] = False

    @abstractmethod
    def read(self, files: Mapping[str, bytes]) -> Sequence[Run]:
        """The programs in `files` (path → bytes; all files of the post's folder), by name. Raises
        ReadError."""

    @abstractmethod
    def signal_name(self, signal: Signal, renamed: Mapping[str, str]) -> str:
        """What the reader's events call a signal of the spec; `renamed`: the names that names.csv
        says were changed for the controller."""

    @abstractmethod
    def analog_value(self, signal: Signal, value: float) -> float:
        """What an analog output of `value` (rev/s, N) is set to, as the controller counts it."""
