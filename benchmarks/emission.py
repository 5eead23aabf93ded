"""How fast programs are poured: staged bodies against a plain Jinja loop over the same rows.

    python benchmarks/emission.py [HOLES]

Prints figures of one run on one machine; only their ratio means something elsewhere. Both sides
print the same KRL-like line of six numbers, a name and an id; the texts are compared first. (The
plain loop is given the best case: it does not mind -0.000, NaN or an exponent.)
"""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from drillc.output.numbers import Column, Fixed, Text
from drillc.output.pouring import Rows
from drillc.output.staging import Stage
from jinja2 import Environment

LETTERS = "xyzabc"
NUMBERS = ",".join(f"{letter.upper()} {{}}" for letter in LETTERS)
STAGED = (
    "{% call(hole) per_hole(rows) %}\nDECL E6POS {{ hole.name }}={"
    + NUMBERS.format(*(f"{{{{ hole.{letter} }}}}" for letter in LETTERS))
    + "} ; {{ hole.id }}\n{% endcall %}\n"
)
PLAIN = (
    "{% for hole in holes %}\nDECL E6POS {{ hole.name }}={"
    + NUMBERS.format(*(f"{{{{ '%.3f' | format(hole.{letter}) }}}}" for letter in LETTERS))
    + "} ; {{ hole.id }}\n{% endfor %}\n"
)


def columns_of(count: int) -> dict[str, Column]:
    """Random places and angles, seeded; names as a fastener table has them."""
    values = np.random.default_rng(1).uniform(-5000.0, 5000.0, (6, count))
    names = np.array([f"F{i:07d}" for i in range(count)])
    numbers = {letter: Fixed(values[i], 3) for i, letter in enumerate(LETTERS)}
    return {**numbers, "name": Text(names), "id": Text(names)}


def staged(columns: dict[str, Column], count: int) -> Iterator[bytes]:
    with TemporaryDirectory() as folder:
        package = Path(folder) / "benchmarktemplates"
        package.mkdir()
        (package / "__init__.py").touch()
        (package / "t.j2").write_text(STAGED)
        sys.path.insert(0, folder)
        try:
            text = Stage("benchmarktemplates", columns).render("t.j2", {"rows": Rows(0, count)})
        finally:
            sys.path.remove(folder)
            sys.modules.pop("benchmarktemplates", None)
    return iter(text)


def plain(columns: dict[str, Column], count: int) -> Iterator[bytes]:
    environment = Environment(trim_blocks=True, keep_trailing_newline=True)
    cells = {name: column.cells(0, count) for name, column in columns.items()}
    rows = (dict(zip(cells, row, strict=True)) for row in zip(*cells.values(), strict=True))
    for text in environment.from_string(PLAIN).generate(holes=rows):
        yield text.encode("ascii")


def timed(
    make: Callable[[dict[str, Column], int], Iterator[bytes]],
    columns: dict[str, Column],
    count: int,
) -> tuple[float, int]:
    """Seconds and bytes of one run."""
    start = time.perf_counter()
    size = sum(map(len, make(columns, count)))
    return time.perf_counter() - start, size


def main(count: int) -> float:
    """Print the figures; the ratio of the two times."""
    columns = columns_of(count)
    sample = columns_of(1000)
    if b"".join(staged(sample, 1000)) != b"".join(plain(sample, 1000)):
        raise SystemExit("the two texts differ")
    fast, size = min(timed(staged, columns, count) for _ in range(3))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    few = max(1, count // 10)  # the plain loop is slow, and its rate does not depend on the count
    slow = min(timed(plain, columns_of(few), few) for _ in range(3))[0] * count / few
    print(f"{count:,} holes, {size / 1e6:,.0f} MB")
    print(f"staged {count / fast:12,.0f} holes/s   {fast:8.2f} s   peak memory {peak:,.0f} MB")
    print(f"plain  {count / slow:12,.0f} holes/s   {slow:8.2f} s (from {few:,} holes)")
    print(f"ratio  {slow / fast:12.1f}")
    return slow / fast


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 300_000)
