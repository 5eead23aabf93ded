"""The same inputs give the same bytes, whatever the hash seed, the folder or what was there."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

SAMPLES = Path(__file__).parents[2] / "samples"
SPECS = sorted(path.name for path in SAMPLES.glob("*.drill"))


def tree(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def compiled(spec: Path, out: Path, seed: str, cwd: Path) -> dict[str, bytes]:
    done = subprocess.run(
        [sys.executable, "-m", "drillc", "compile", str(spec), "-o", str(out)],
        cwd=cwd,
        env={**os.environ, "PYTHONHASHSEED": seed},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return tree(out)


@pytest.mark.parametrize("name", SPECS)
def test_equal_bytes_in_another_folder_under_another_hash_seed(name: str, tmp_path: Path) -> None:
    first = compiled(SAMPLES / name, tmp_path / "one", "1", tmp_path)
    elsewhere = tmp_path / "else where" / "deep"
    shutil.copytree(SAMPLES, elsewhere)
    second = compiled(Path(name), tmp_path / "two", "4242", elsewhere)
    assert len(first) >= 3
    assert first == second
    # And over what is already there.
    assert compiled(SAMPLES / name, tmp_path / "one", "7", tmp_path) == first
