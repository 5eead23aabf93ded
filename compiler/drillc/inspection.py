"""`drillc inspect`: one row a hole, as a table, CSV or JSON, written in blocks of rows."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TextIO

import numpy as np

from drillc.catalogue.model import JOINT_NAMES
from drillc.driver import Planned
from drillc.kernels.rotations import quaternion_from_matrix
from drillc.language.job import Arm, Floats, Job, Texts
from drillc.output.numbers import fixed
from drillc.planning.arm_joints import ArmSolution

#: Rows turned to text at a time.
BLOCK_ROWS = 8192
#: Decimals by the unit a column's name ends in; quaternions and margins have none.
_EXACT = {"mm": 6, "deg": 8, "": 12}
_READABLE = {"mm": 3, "deg": 3, "": 6}

Column = tuple[str, Floats | np.ndarray]


def columns(planned: Planned) -> list[Column]:
    """Names and values (n,): id, region, position, tool orientation in part coordinates with
    qw ≥ 0, and where there is a robot its joints, branch and margin."""
    holes = planned.job.holes
    regions = np.array([region.name.text for region in planned.job.regions], dtype=np.str_)
    quaternion = quaternion_from_matrix(planned.part_from_tool)
    found: list[Column] = [("id", holes.ids), ("region", regions[holes.region])]
    found += [(f"{axis}_mm", holes.position_mm[:, i]) for i, axis in enumerate("xyz")]
    found += [(name, quaternion[:, i]) for i, name in enumerate(("qw", "qx", "qy", "qz"))]
    solution = planned.solution
    if isinstance(solution, ArmSolution):
        if len(names := _stations(planned.job)) > 1:
            stations = np.array([region.station for region in planned.job.regions])
            found.append(("station", names[stations[holes.region]]))
        found.append(("heading_deg", np.degrees(solution.heading_rad)))
        for i, name in enumerate(JOINT_NAMES):
            found.append((f"{name}_deg", np.degrees(solution.joints[:, i])))
    elif solution is not None:
        for i, axis in enumerate(solution.motion.axes):
            values = solution.motion.joints[:, i]
            if axis.rotary:
                found.append((f"{axis.name}_deg", np.degrees(values)))
            else:
                found.append((f"{axis.name}_mm", values))
    if solution is not None:
        found += [("branch", solution.branch), ("margin", solution.margin)]
    return found


def _stations(job: Job) -> Texts:
    """The names of the arm's parking places."""
    stations = job.robot.stations if isinstance(job.robot, Arm) else ()
    return np.array([place.name.text if place.name else "" for place in stations], dtype=np.str_)


def write_inspection(planned: Planned, form: str, out: TextIO) -> None:
    """Write all holes in the form `table`, `csv` or `json`."""
    found = columns(planned)
    writers: dict[str, Callable[[Sequence[Column], TextIO], None]] = {
        "csv": _write_csv,
        "json": _write_json,
        "table": _write_table,
    }
    writers[form](found, out)


def _rows(
    found: Sequence[Column], decimals: Mapping[str, int] = _EXACT
) -> Iterator[list[tuple[str, ...]]]:
    count = len(found[0][1])
    for start in range(0, count, BLOCK_ROWS):
        block = [(name, values[start : start + BLOCK_ROWS]) for name, values in found]
        texts = [_texts(values, decimals[name.partition("_")[2]]) for name, values in block]
        yield list(zip(*texts, strict=True))


def _texts(values: np.ndarray, decimals: int) -> list[str]:
    if values.dtype.kind != "f":
        return [str(value) for value in values.tolist()]
    return [fixed(value, decimals) for value in values.tolist()]


def _write_csv(found: Sequence[Column], out: TextIO) -> None:
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([name for name, _ in found])
    for rows in _rows(found):
        writer.writerows(rows)


def _write_json(found: Sequence[Column], out: TextIO) -> None:
    names = [name for name, _ in found]
    numeric = {name for name, values in found if values.dtype.kind in "fi"}
    separator = "[\n"
    for rows in _rows(found):
        for row in rows:
            # The numbers' own text is kept, so that CSV and JSON agree to the last digit.
            pairs = (
                f"{json.dumps(n)}: {v if n in numeric else json.dumps(v)}"
                for n, v in zip(names, row, strict=True)
            )
            out.write(f"{separator}  {{{', '.join(pairs)}}}")
            separator = ",\n"
    out.write("[]\n" if separator == "[\n" else "\n]\n")


def _write_table(found: Sequence[Column], out: TextIO) -> None:
    """Aligned columns: the holes are gone through twice, first for the widths."""
    names = [name for name, _ in found]
    widths = [len(name) for name in names]
    for rows in _rows(found, _READABLE):
        for i, column in enumerate(zip(*rows, strict=True)):
            widths[i] = max(widths[i], *map(len, column))
    for rows in ([tuple(names)], *_rows(found, _READABLE)):
        for row in rows:
            cells = (
                cell.ljust(width) if name in {"id", "region"} else cell.rjust(width)
                for name, cell, width in zip(names, row, widths, strict=True)
            )
            out.write("  ".join(cells).rstrip() + "\n")
