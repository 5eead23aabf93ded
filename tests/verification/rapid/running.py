"""RAPID programs in tests: read, run, and shown as rows that are easy to compare."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from drillc.verification.events import Alternative, Events, Kind, joined, no_events
from drillc.verification.rapid.reader import RapidReader, RapidRun
from drillc.verification.rapid.state import AXES


@dataclass(frozen=True, eq=False)
class Done:
    """What a run did."""

    run: RapidRun
    events: Events
    others: Sequence[Alternative]

    def kinds(self, events: Events | None = None) -> list[str]:
        """What happened, in short: the kind, and the signal with its value."""
        names = {number: name for name, number in self.run.signals.items()}
        events = self.events if events is None else events
        return [
            Kind(kind).name.lower()
            + (f" {names[signal]}" if signal >= 0 else "")
            + (f" {value:g}" if value == value else "")
            for kind, signal, value in zip(
                events.kind.tolist(), events.signal.tolist(), events.value.tolist(), strict=True
            )
        ]


def module(body: str, data: str = "", *, name: str = "T", more: str = "") -> bytes:
    """A module with a procedure main, its lines ended as the controller wants."""
    text = f"MODULE {name}\n{data}\nPROC main()\n{body}\nENDPROC\n{more}\nENDMODULE\n"
    return text.replace("\n", "\r\n").encode("latin-1")


def done(files: Mapping[str, bytes] | bytes) -> Done:
    """Read and run one program; a single module is the file T.mod."""
    if isinstance(files, bytes):
        files = {"T.mod": files}
    [run] = RapidReader().read(files)
    assert isinstance(run, RapidRun)
    steps = list(run.steps())
    events = [step for step in steps if isinstance(step, Events)]
    others = [step for step in steps if isinstance(step, Alternative)]
    return Done(run, joined([no_events(len(AXES)), *events]), others)


def pose(events: Events, row: int) -> np.ndarray:
    """(4, 4)"""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = events.rotation[row], events.position_mm[row]
    return matrix
