"""The bench on which cases run."""

from __future__ import annotations

from pathlib import Path

import pytest
from diagnostics.running import FINE, TOOL, Bench
from drillc.cli import main


@pytest.fixture(scope="session")
def earlier_output(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What an earlier, successful run wrote."""
    folder = tmp_path_factory.mktemp("earlier")
    (folder / "fine.drill").write_text(FINE, encoding="utf-8")
    (folder / "tool.cell").write_text(TOOL, encoding="utf-8")
    assert main(["compile", str(folder / "fine.drill"), "-o", str(folder / "out")]) == 0
    assert len(list((folder / "out").iterdir())) > 1
    return folder / "out"


@pytest.fixture
def bench(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    earlier_output: Path,
) -> Bench:
    folder = tmp_path / "job"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return Bench(folder, capsys, earlier_output)
