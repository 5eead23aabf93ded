"""What goes wrong while drillc works leaves the earlier output as it was, and nothing beside it.

Every failure is a real one where that can be had: a disk that is full for this process, a signal.
"""

from __future__ import annotations

import errno
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from drillc import cli
from drillc.output import writing
from drillc.output.pouring import StagedText

SAMPLES = Path(__file__).parents[2] / "samples"


def tree(folder: Path) -> dict[str, bytes | None]:
    """Everything below a folder: files with their bytes, folders as None."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() if path.is_file() else None
        for path in sorted(folder.rglob("*"))
    }


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A folder with samples, and the output `out` of an earlier run in `results`."""
    shutil.copytree(SAMPLES, tmp_path / "specs")
    (tmp_path / "results").mkdir()
    arguments = ["compile", str(tmp_path / "specs/nacelle.drill"), "-o", str(out(tmp_path))]
    assert cli.main(arguments) == cli.EXIT_FINE
    return tmp_path


def out(place: Path) -> Path:
    return place / "results" / "out"


def run(place: Path, sample: str = "portal", **options: Any) -> subprocess.CompletedProcess[str]:
    """`drillc compile` in a process of its own, over the earlier output."""
    spec = place / "specs" / f"{sample}.drill"
    return subprocess.run(
        [sys.executable, "-m", "drillc", "compile", str(spec), "-o", str(out(place))],
        capture_output=True,
        text=True,
        timeout=60,
        **options,
    )


def untouched(place: Path, act: Callable[[], int], code: int) -> None:
    before = tree(place / "results")
    assert act() == code
    assert tree(place / "results") == before


def compile_here(place: Path) -> int:
    return cli.main(["compile", str(place / "specs/portal.drill"), "-o", str(out(place))])


def test_nothing_goes_wrong(place: Path) -> None:
    """The other tests would pass if nothing were ever written."""
    before = tree(place / "results")
    assert run(place).returncode == cli.EXIT_FINE
    after = tree(place / "results")
    assert after != before
    assert {name.split("/")[0] for name in after} == {"out"}


# ── a full disk ──────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("limit", [0, 1, 500, 1500])
def test_a_disk_that_is_full(place: Path, limit: int) -> None:
    """No file may grow beyond `limit` bytes: the system itself refuses to write on."""

    def full() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    before = tree(place / "results")
    done = run(place, "panel", preexec_fn=full)
    assert done.returncode == cli.EXIT_ERRORS, done.stderr
    assert "error E691" in done.stderr
    assert "Traceback" not in done.stderr
    assert tree(place / "results") == before


@pytest.mark.parametrize("call", ["mkdir", "rename", "open", "write_bytes"])
@pytest.mark.parametrize("which", [1, 2])
def test_any_call_that_fails(
    place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    call: str, which: int,
) -> None:  # fmt: skip
    real, calls = getattr(Path, call), []

    def failing(path: Path, *arguments: Any, **options: Any) -> Any:
        if ".drillc-" in str(path) or path == out(place):
            calls.append(path)
            if len(calls) == which:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
        return real(path, *arguments, **options)

    monkeypatch.setattr(Path, call, failing)
    before = tree(place / "results")
    code = compile_here(place)
    monkeypatch.undo()
    if len(calls) < which:
        pytest.skip(f"{call} is called {len(calls)} times")
    assert code == cli.EXIT_ERRORS
    assert "No space left on device" in capsys.readouterr().err
    assert tree(place / "results") == before


# ── somebody stops it, or something breaks ───────────────────────────────────────────────────────


def break_while_pouring(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    """Let the second file break in its middle."""
    begun: list[object] = []

    def broken(text: StagedText) -> Iterator[bytes]:
        begun.append(text)
        yield b"; half of a program\r\n"
        if len(begun) == 1:
            raise error

    monkeypatch.setattr(StagedText, "__iter__", broken)


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (KeyboardInterrupt(), 130, "interrupted; no output was touched"),
        (MemoryError(), cli.EXIT_ERRORS, "memory"),
        (ValueError("a post is wrong"), cli.EXIT_BUG, "a bug, not a mistake in the spec"),
        (OSError(errno.EIO, "Input/output error"), cli.EXIT_ERRORS, "E691"),
    ],
)
def test_it_breaks_in_the_middle_of_a_file(
    place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    error: BaseException, code: int, said: str,
) -> None:  # fmt: skip
    monkeypatch.delenv("DRILLC_TRACEBACK", raising=False)
    break_while_pouring(monkeypatch, error)
    untouched(place, lambda: compile_here(place), code)
    errors = capsys.readouterr().err
    assert said in errors
    assert "Traceback" not in errors


@pytest.mark.parametrize("moment", ["_write_manifest", "_swap", "_check_free"])
def test_it_is_interrupted_at_every_stage_of_writing(
    place: Path, monkeypatch: pytest.MonkeyPatch, moment: str
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(writing, moment, interrupted)
    untouched(place, lambda: compile_here(place), 130)


def test_an_interrupt_between_the_two_renames_brings_the_earlier_output_back(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real, renamed = Path.rename, []

    def rename(path: Path, target: Path) -> Path:
        renamed.append(path)
        if len(renamed) == 2:
            raise KeyboardInterrupt
        return real(path, target)

    monkeypatch.setattr(Path, "rename", rename)
    untouched(place, lambda: compile_here(place), 130)
    assert len(renamed) >= 2


def test_control_c_from_outside(place: Path) -> None:
    """A real signal, at some moment of a real run: the output is the old one or the new one."""
    old = tree(place / "results")
    assert run(place, "panel").returncode == cli.EXIT_FINE
    new = tree(place / "results")
    spec = place / "specs" / "panel.drill"
    outcomes = set()
    for wait_s in (0.05, 0.2, 0.4, 0.6, 0.8, 1.0):
        shutil.rmtree(out(place))
        for name, data in old.items():
            path = place / "results" / name
            path.mkdir(parents=True) if data is None else path.write_bytes(data)
        process = subprocess.Popen(
            [sys.executable, "-m", "drillc", "compile", str(spec), "-o", str(out(place))],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        )
        time.sleep(wait_s)
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
        left = tree(place / "results")
        assert left in (old, new)
        outcomes.add(left == new)
    assert False in outcomes


# ── the output folder ────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("stranger", ["notes.txt", "krl/mine.src", "deep/er/x"])
def test_files_of_somebody_else_are_never_deleted(
    place: Path, capsys: pytest.CaptureFixture[str], stranger: str
) -> None:
    path = out(place) / stranger
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("mine")
    untouched(place, lambda: compile_here(place), cli.EXIT_ERRORS)
    assert "E690" in capsys.readouterr().err


def test_a_folder_of_somebody_else(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.rmtree(out(place))
    shutil.copytree(SAMPLES / "cells", out(place))
    untouched(place, lambda: compile_here(place), cli.EXIT_ERRORS)
    assert "E690" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["", ".", "/", "..", "results/out/krl/NACELLE_A.src"])
def test_no_folder_to_write_into(place: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """The current folder, its parents, the root, and a file are no output folders."""
    monkeypatch.chdir(place / "results")
    target = str(place / name) if name.startswith("results") else name
    spec = str(place / "specs/portal.drill")
    untouched(place, lambda: cli.main(["compile", spec, "-o", target]), cli.EXIT_ERRORS)


def test_the_spec_itself_is_never_deleted(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = tree(place / "specs")
    spec = str(place / "specs/portal.drill")
    assert cli.main(["compile", spec, "-o", str(place / "specs")]) == cli.EXIT_ERRORS
    assert "E690" in capsys.readouterr().err
    assert tree(place / "specs") == before


def test_what_a_killed_run_left_behind_is_no_obstacle(place: Path) -> None:
    """Nobody can clean up after kill -9; the next run must not mind."""
    (place / "results" / ".out.drillc-0123abcd").mkdir()
    assert compile_here(place) == cli.EXIT_FINE


def test_two_runs_at_once_leave_one_whole_output(place: Path) -> None:
    spec = place / "specs" / "portal.drill"
    command = [sys.executable, "-m", "drillc", "compile", str(spec), "-o", str(out(place))]
    both = [
        subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    said = [process.communicate(timeout=60)[1] for process in both]
    assert not any("Traceback" in text or "internal error" in text for text in said), said
    assert cli.EXIT_FINE in [process.returncode for process in both], said
    left = tree(place / "results")
    assert [name for name in left if "/" not in name] == ["out"]
    assert compile_here(place) == cli.EXIT_FINE
    assert tree(place / "results") == left
