"""The bench on which cases run."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from drillc.cli import main

from diagnostics.running import FINE, Bench


@pytest.fixture(scope="session")
def earlier_output(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What an earlier, successful run wrote."""
    folder = tmp_path_factory.mktemp("earlier")
    (folder / "fine.drill").write_text(FINE, encoding="utf-8")
    assert main(["compile", str(folder / "fine.drill"), "-o", str(folder / "out")]) == 0
    assert len(list((folder / "out").iterdir())) > 1
    return folder / "out"


@pytest.fixture
def bench(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    earlier_output: Path,
) -> Iterator[Bench]:
    folder = tmp_path / "job"
    folder.mkdir()
    monkeypatch.chdir(folder)
    yield Bench(folder, capsys, earlier_output)
