"""Statements that are run in lanes, and what the lanes made of them, as events in their order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .course import Made, of_lanes
from .events import Events, blank
from .statements import At, Repeated, Statement
from .values import Lanes, Value


@dataclass(frozen=True, eq=False)
class Batch:
    """Statements `body` that are run once in each lane. `lines` (lanes, len(body)) are where they
    stand in `file`; `columns` what differs by lane."""

    body: Sequence[Statement]
    columns: Sequence[Any]
    lines: NDArray[np.int32]
    file: int

    def part(self, lanes: Lanes) -> Batch:
        """Some lanes of it."""
        columns = [of_lanes(column, lanes) for column in self.columns]
        return Batch(self.body, columns, self.lines[lanes], self.file)

    def has(self, top: int, at: At) -> bool:
        """Whether statement `top` of the body itself stands there: it has another line in each
        lane, and `at` is that of the first."""
        if not 0 <= top < len(self.body):
            return False
        statement = self.body[top]
        return not isinstance(statement, Repeated) and statement.at == at


@dataclass(frozen=True)
class Path:
    """What some lanes did together to the end of the body, or to where the program `stopped` or its
    routine `returned`."""

    lanes: Lanes
    made: Sequence[Made]
    state: Value
    stopped: bool
    returned: bool


def in_order(batch: Batch, paths: Sequence[Path], axes: int) -> Events:
    """The events of all paths, lane by lane."""
    if len(paths) == 1:
        return flat(batch, paths[0].lanes, paths[0].made, axes)
    each = np.empty(sum(len(path.lanes) for path in paths), dtype=np.intp)
    for path in paths:
        each[path.lanes] = len(path.made)
    starts = np.cumsum(each) - each
    events = blank(int(each.sum()), axes)
    for path in paths:
        rows = [starts[path.lanes] + k for k in range(len(path.made))]
        _fill_in(events, rows, batch, path.lanes, path.made)
    return events


def flat(batch: Batch, lanes: Lanes, made: Sequence[Made], axes: int) -> Events:
    """Events of some lanes: all of the first lane, all of the second, and so on."""
    each = len(made)
    events = blank(len(lanes) * each, axes)
    _fill_in(events, [slice(k, None, each) for k in range(each)], batch, lanes, made)
    return events


def _fill_in(
    events: Events,
    rows: Sequence[slice | NDArray[np.intp]],
    batch: Batch,
    lanes: Lanes,
    made: Sequence[Made],
) -> None:
    """Write what some lanes made: event k of all lanes into `rows[k]`."""
    for row, event in zip(rows, made, strict=True):
        lines = batch.lines[lanes, event.top]
        events.kind[row] = event.kind
        events.file[row] = event.at.file
        events.line[row] = lines if batch.has(event.top, event.at) else event.at.line
        events.call_file[row] = batch.file
        events.call_line[row] = lines
        for name, value in event.fields.items():
            column = getattr(events, name)
            if len(event.lanes) > len(lanes):  # they have parted since
                all_lanes = np.broadcast_to(value, (len(event.lanes), *column.shape[1:]))
                value = all_lanes[np.searchsorted(event.lanes, lanes)]
            column[row] = value
