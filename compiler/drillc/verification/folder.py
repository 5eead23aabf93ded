"""The files of an output folder, read when they are asked for."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

#: The table of names that were changed for the controller, in a post's folder.
NAMES_FILE = "names.csv"
#: What a renamed thing must be for its name to matter here: holes are known by what is done.
_KINDS = ("program", "signal")


@dataclass(frozen=True)
class Folder(Mapping[str, bytes]):
    """Path under `root`, with /, → bytes. Nothing is kept, so a large program is not either."""

    root: Path
    paths: Sequence[str]

    def __getitem__(self, path: str) -> bytes:
        if path not in self.paths:
            raise KeyError(path)
        return (self.root / PurePosixPath(path)).read_bytes()

    def __iter__(self) -> Iterator[str]:
        return iter(self.paths)

    def __len__(self) -> int:
        return len(self.paths)


def program_files(root: Path, posts: Sequence[str]) -> Folder:
    """The programs of some posts; not the tables that stand beside them."""
    found = [
        path.relative_to(root).as_posix()
        for post in posts
        for path in sorted((root / post).rglob("*"))
        if path.is_file() and path.name != NAMES_FILE
    ]
    return Folder(root, found)


def renamed_in(root: Path, posts: Sequence[str]) -> dict[str, dict[str, str]]:
    """For each post the names in the spec → those on the controller, as its table has them."""
    renamed: dict[str, dict[str, str]] = {}
    for post in posts:
        table = root / post / NAMES_FILE
        rows = csv.reader(io.StringIO(table.read_text("utf-8"))) if table.is_file() else iter(())
        renamed[post] = {row[1]: row[2] for row in rows if len(row) == 3 and row[0] in _KINDS}
    return renamed
