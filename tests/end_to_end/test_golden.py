"""The samples' programs, byte for byte: a golden proves that nothing changed, not that it is right.

`pytest tests/end_to_end --update-golden` writes them anew; read the difference line by line. The
small samples are kept whole; of the large ones every file's hash, first and last lines are kept.
"""

import hashlib
import shutil
from pathlib import Path

import pytest
from drillc.cli import main

ROOT = Path(__file__).parents[2]
GOLDEN = ROOT / "tests" / "golden"
WHOLE = ("nacelle", "portal")
LARGE = ("panel", "skin_portal")
LINES = 60


def compiled(sample: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(ROOT)
    out = tmp_path / sample
    assert main(["compile", f"samples/{sample}.drill", "-o", str(out)]) == 0
    return out


def files(folder: Path) -> dict[str, bytes]:
    found = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in found}


def summary(content: bytes) -> bytes:
    lines = content.splitlines(keepends=True)
    head = f"sha256 {hashlib.sha256(content).hexdigest()}, {len(lines)} lines\n".encode()
    if len(lines) <= 2 * LINES:
        return head + content
    return head + b"".join([*lines[:LINES], b"[...]\n", *lines[-LINES:]])


@pytest.mark.parametrize("sample", [*WHOLE, *LARGE])
def test_nothing_changed(
    sample: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    request: pytest.FixtureRequest,
) -> None:
    got = files(compiled(sample, tmp_path, monkeypatch))
    if sample in LARGE:
        got = {f"{name}.summary": summary(content) for name, content in got.items()}
    folder = GOLDEN / sample
    if request.config.getoption("--update-golden"):
        shutil.rmtree(folder, ignore_errors=True)
        for name, content in got.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(content)
    assert got == files(folder)
