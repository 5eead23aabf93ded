"""`drillc inspect`: one row a hole, as a table, CSV or JSON, written in blocks of rows."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterator, Sequence
from typing import TextIO

import numpy as np

from drillc.driver import Planned
from drillc.kernels.rotations import quaternion_from_matrix
from drillc.language.job import Floats
from drillc.output.numbers import fixed

#: Rows turned to text at a time.
BLOCK_ROWS = 8192
#: Decimals by the unit a column's name ends in; quaternions and margins are plain numbers.
_DECIMALS = {"mm": 6, "deg": 8}
_PLAIN_DECIMALS = 12

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
    if solution is not None:
        for i, axis in enumerate(solution.motion.axes):
            values = solution.motion.joints[:, i]
            if axis.rotary:
                found.append((f"{axis.name}_deg", np.degrees(values)))
            else:
                found.append((f"{axis.name}_mm", values))
        found += [("branch", solution.branch), ("margin", solution.margin)]
    return found


def write_inspection(planned: Planned, form: str, out: TextIO) -> None:
    """Write all holes in the form `table`, `csv` or `json`."""
    found = columns(planned)
    writers: dict[str, Callable[[Sequence[Column], TextIO], None]] = {
        "csv": _write_csv,
        "json": _write_json,
        "table": _write_table,
    }
    writers[form](found, out)


def _rows(found: Sequence[Column]) -> Iterator[list[tuple[str, ...]]]:
    count = len(found[0][1])
    for start in range(0, count, BLOCK_ROWS):
        texts = [_texts(name, values[start : start + BLOCK_ROWS]) for name, values in found]
        yield list(zip(*texts, strict=True))


def _texts(name: str, values: np.ndarray) -> list[str]:
    if values.dtype.kind != "f":
        return [str(value) for value in values.tolist()]
    decimals = _DECIMALS.get(name.rsplit("_", 1)[-1], _PLAIN_DECIMALS)
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
    names = [name for name, _ in found]
    left = {"id", "region"}
    blocks = ([tuple(names)], *_rows(found))
    rows = [row for block in blocks for row in block]
    short = [tuple(_short(n, cell) for n, cell in zip(names, row, strict=True)) for row in rows]
    widths = [max(len(row[i]) for row in short) for i in range(len(names))]
    for row in short:
        cells = (
            cell.ljust(w) if n in left else cell.rjust(w)
            for n, cell, w in zip(names, row, widths, strict=True)
        )
        out.write("  ".join(cells).rstrip() + "\n")


def _short(name: str, cell: str) -> str:
    """A table is for reading: three to six decimals are enough."""
    if "." not in cell or name in {"id", "region"}:
        return cell
    keep = 3 if name.endswith(("_mm", "_deg")) else 6
    return fixed(float(cell), keep)
