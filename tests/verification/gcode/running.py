"""Helpers: read and run G-code with drillc's reader, and beside it with LinuxCNC."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from drillc.verification.events import Alternative, Events, Kind, joined, no_events
from drillc.verification.gcode.reader import GcodeReader
from drillc.verification.reading import Finding, Run
from judges.linuxcnc import Judged, run_gcode

LETTERS = "XYZABCUVW"


@dataclass(frozen=True)
class Ran:
    run: Run
    events: Events
    others: list[Alternative]

    @property
    def findings(self) -> list[Finding]:
        return list(self.run.findings())

    def kinds(self) -> list[str]:
        return [Kind(kind).name for kind in self.events.kind.tolist()]

    def said(self) -> list[str]:
        """Signals, pauses and the like, in words."""
        names = {number: name for name, number in self.run.signals.items()}
        e = self.events
        words = []
        for kind, signal, value in zip(e.kind, e.signal, e.value, strict=True):
            if kind != Kind.STRAIGHT:
                name = f" {names[int(signal)]}" if signal >= 0 else ""
                words.append(f"{Kind(kind).name}{name} {value:g}")
        return words


def run(files: Mapping[str, bytes] | str) -> Ran:
    """Run the only program of some files, or of one text."""
    if isinstance(files, str):
        files = {"p.ngc": files.encode()}
    (program,) = GcodeReader().read(files)
    steps = list(program.steps())
    events = [step for step in steps if isinstance(step, Events)]
    return Ran(
        program,
        joined([no_events(len(LETTERS)), *events]),
        [step for step in steps if isinstance(step, Alternative)],
    )


def text_of(*lines: str) -> str:
    """A program around some lines."""
    return "\n".join(["G21 G90 G94 G17 G40 G49 G80 G54 G61", *lines, "M2", ""])


def assert_agrees(folder: Path, files: Mapping[str, bytes] | str, *, feeds: bool = False) -> Ran:
    """LinuxCNC and the reader come to the same places, with the same pauses; `feeds`: at the same
    feeds, where they are all in mm (or degrees) a minute."""
    if isinstance(files, str):
        files = {"p.ngc": files.encode()}
    ran = run(files)
    for name, data in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    judged = run_gcode(folder / ran.run.files[0])
    assert judged.error is None
    theirs, ours = _of_linuxcnc(judged, feeds), _of_reader(ran.events, feeds)
    assert len(theirs) == len(ours)
    if len(ours):
        off = np.abs(theirs - ours)
        assert np.nanmax(off, initial=0.0) < 1e-6, np.argwhere(off >= 1e-6)[:5]
        assert (np.isnan(theirs) == np.isnan(ours)).all()
    return ran


def _of_linuxcnc(judged: Judged, feeds: bool = False) -> np.ndarray:
    """Rows of nine places, a pause and a feed; moves that lead nowhere are left out."""
    rows = []
    place = [0.0] * 9
    for move in judged.moves:
        if move.seconds is not None:
            rows.append([np.nan] * 9 + [move.seconds, np.nan])
            continue
        there = [move.place[letter] for letter in LETTERS]
        if np.abs(np.subtract(there, place)).max() > 1e-7:
            feed = move.feed if feeds and move.feed is not None else np.nan
            rows.append([*there, np.nan, feed])
        place = there
    return np.array(rows).reshape(-1, 11)


def _of_reader(events: Events, feeds: bool = False) -> np.ndarray:
    rows = []
    place = np.zeros(9)
    columns = (events.kind, events.joints, events.value, events.speed_mm_s * 60.0)
    for kind, joints, value, feed in zip(*columns, strict=True):
        if kind == Kind.PAUSE and np.isfinite(value):
            rows.append([*[np.nan] * 9, value, np.nan])
        if kind == Kind.STRAIGHT:
            there = np.nan_to_num(joints)  # LinuxCNC's preview begins at 0
            if np.abs(there - place).max() > 1e-7:
                rows.append([*there, np.nan, feed if feeds else np.nan])
            place = there
    return np.array(rows).reshape(-1, 11)
