"""Running one case in this process, and what must hold whatever the spec was."""

from __future__ import annotations

import csv
import faulthandler
import hashlib
import io
import json
import math
import os
import re
import shutil
import signal
import time
import traceback
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path

from drillc import cli
from drillc.language.diagnostics import Refused, Report
from fuzz.mutations import SAMPLES, Case, Tree

#: A case that takes longer is a failure, after a second chance: the machine has other things to do.
MOST_SECONDS = 5.0
#: When not even a signal gets through, the process is ended with a traceback.
HANGING_SECONDS = 60.0

FINE, ERRORS = 0, 1


class TooSlow(BaseException):
    """Raised by the alarm. Not an `Exception`, which the command line would report as a bug."""


@dataclass
class Tally:
    """Figures over many cases."""

    cases: int = 0
    exits: Counter[str] = field(default_factory=Counter)
    codes: Counter[str] = field(default_factory=Counter)
    seconds: float = 0.0
    slowest: tuple[float, int] = (0.0, -1)

    def add(self, case: Case, code: int, seconds: float, said: str) -> None:
        self.cases += 1
        self.exits[f"{case.command[0]} {code}"] += 1
        self.codes.update(set(re.findall(r"\b(?:error|warning) ([EW]\d{3})\b", said)))
        self.seconds += seconds
        self.slowest = max(self.slowest, (seconds, case.seed))

    def __str__(self) -> str:
        exits = ", ".join(f"{name}: {count}" for name, count in sorted(self.exits.items()))
        return (
            f"{self.cases} cases in {self.seconds:.0f} s; {exits}; slowest: seed {self.slowest[1]},"
            f" {self.slowest[0]:.2f} s; {len(self.codes)} diagnostic codes seen"
        )


class Bench:
    """A folder in which cases run one after the other, with an earlier output to be kept whole."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.inputs = folder / "in"
        self.out = folder / "result" / "out"
        self.earlier = folder / "earlier"
        self.tally = Tally()
        self._write_earlier()
        self.before = snapshot(self.earlier)
        self._restore()

    def run(self, case: Case) -> None:
        """Run a case and raise AssertionError, with its seed, when something is wrong."""
        try:
            lay_out(case.tree, self.inputs)
            code, seconds, said = self._timed(case)
            self._judge(case, code, said)
            self.tally.add(case, code, seconds, said.errors)
        except (AssertionError, Exception) as error:
            shutil.rmtree(self.folder / "result", ignore_errors=True)
            self._restore()
            trace = "" if isinstance(error, AssertionError) else traceback.format_exc()
            raise AssertionError(f"{case}\n{type(error).__name__}: {error}\n{trace}") from None

    def _timed(self, case: Case) -> tuple[int, float, Said]:
        slow = None
        for _ in range(2):
            started = time.perf_counter()
            try:
                with alarm():
                    code, said = run_cli(self._arguments(case))
                return code, time.perf_counter() - started, said
            except TooSlow as late:
                slow = late
        raise AssertionError(f"took more than {MOST_SECONDS} s, twice; it was {slow}")

    def _arguments(self, case: Case) -> list[str]:
        places = {"spec": str(self.inputs / case.tree.spec), "out": str(self.out)}
        return [argument.format(**places) for argument in case.command]

    def _judge(self, case: Case, code: int, said: Said) -> None:
        assert code in (FINE, ERRORS), f"exit code {code}\n{said.errors}"
        every = said.output + said.errors
        assert "Traceback" not in every, every
        assert "internal error" not in every, every
        assert_readable(said.errors)
        if case.command[0] == "inspect" and code == FINE:
            assert_inspection(said.output, case.command[-1])
        if "--json" in case.command:
            json.loads(said.output)
        elif code == ERRORS:
            assert re.search(r"\berror E\d{3}: \S", said.errors), f"exit 1, and why? {said.errors}"

        left = sorted(path.name for path in self.out.parent.iterdir())
        assert left == ["out"], f"left behind: {left}"
        if case.command[0] == "compile" and code == FINE:
            spec = self.inputs / case.tree.spec
            assert_complete(self.out)
            assert_clean(self.out, spec)
            self._restore()
        else:
            assert snapshot(self.out) == self.before, "the earlier output was touched"

    def _write_earlier(self) -> None:
        arguments = ["compile", str(SAMPLES / "portal.drill"), "-o", str(self.earlier)]
        code, said = run_cli(arguments)
        assert code == FINE, said.errors
        assert_complete(self.earlier)

    def _restore(self) -> None:
        shutil.rmtree(self.out, ignore_errors=True)
        self.out.parent.mkdir(parents=True, exist_ok=True)
        shutil.copytree(self.earlier, self.out)


# ── running ──────────────────────────────────────────────────────────────────────────────────────


@dataclass(frozen=True)
class Said:
    """What a run printed."""

    output: str
    errors: str


def run_cli(arguments: list[str]) -> tuple[int, Said]:
    """`drillc ARGUMENTS` in this process. An internal error comes out as what it was."""
    output, errors = io.StringIO(), io.StringIO()
    before = os.environ.get("DRILLC_TRACEBACK")
    os.environ["DRILLC_TRACEBACK"] = "1"
    try:
        with redirect_stdout(output), redirect_stderr(errors):
            code = cli.main(arguments)
    finally:
        if before is None:
            del os.environ["DRILLC_TRACEBACK"]
    return code, Said(output.getvalue(), errors.getvalue())


@contextmanager
def alarm() -> Iterator[None]:
    """Raise `TooSlow` after MOST_SECONDS; end the process when that does not help."""

    def ring(_: int, frame: object) -> None:
        where = "".join(traceback.format_stack(frame)[-3:])  # type: ignore[arg-type]
        raise TooSlow(f"at\n{where}")

    previous = signal.signal(signal.SIGALRM, ring)
    faulthandler.dump_traceback_later(HANGING_SECONDS, exit=True)
    signal.setitimer(signal.ITIMER_REAL, MOST_SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        faulthandler.cancel_dump_traceback_later()
        signal.signal(signal.SIGALRM, previous)


def lay_out(tree: Tree, folder: Path) -> None:
    """Write a tree into an empty folder."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name, data in tree.files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    for name, what in tree.others.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.exists() or path.is_symlink():
            continue
        kind, _, target = what.partition(" ")
        if kind == "link":
            path.symlink_to(Path(target).name if target == name else target)
        elif kind == "pipe":
            os.mkfifo(path)
        else:
            path.mkdir()


# ── what must hold ───────────────────────────────────────────────────────────────────────────────


def snapshot(folder: Path) -> dict[str, bytes]:
    """Every file below a folder, and its bytes."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def assert_readable(errors: str) -> None:
    """What a terminal gets: no control characters, no line of monstrous length."""
    strange = sorted({c for c in errors if not c.isprintable()} - {"\n"})
    assert not strange, f"the messages hold {strange}: {errors[:2000]!r}"
    longest = max(map(len, errors.splitlines()), default=0)
    assert longest <= 2000, f"a message has {longest} characters: {errors[:600]!r}"
    assert errors.count("\n") <= 2000, f"{errors.count(chr(10))} lines of messages"


def assert_inspection(output: str, form: str) -> None:
    """Finite numbers in every column but the names; the table is for eyes only."""
    rows: list[dict[str, object]] = []
    if form == "json":
        rows = json.loads(output)
    elif form == "csv":
        rows = list(csv.DictReader(io.StringIO(output)))
    for row in rows:
        for column, value in row.items():
            if column not in ("id", "region"):
                assert math.isfinite(float(str(value))), f"{column} is {value} in {row}"


def assert_complete(out: Path) -> None:
    """The manifest lists exactly the files that are there, by their hashes."""
    files = snapshot(out)
    manifest = json.loads(files.pop("manifest.json"))
    hashes = {name: hashlib.sha256(data).hexdigest() for name, data in files.items()}
    assert manifest["outputs"] == hashes, "the manifest does not fit the files"
    assert hashes, "nothing was emitted"


_NOT_A_NUMBER = re.compile(r"(?<![\w.$])[+-]?(?:nan|inf|infinity)(?![\w.(])", re.IGNORECASE)
_MINUS_ZERO = re.compile(r"(?<![\w.])-0(?:\.0*)?(?![\d.\w])")
_BAD_CONTROL = re.compile(rb"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\xff]")
#: Feeds, speeds and times that came out as zero: the machine would stand still, or wait for ever.
_VANISHED = {
    "krl": re.compile(r"\$VEL\.CP=0\.0*\s|\$TIMER\[\d+\]=-0\b|BOTTOM=BOTTOM\+0\.0*\s"),
    "rapid": re.compile(r"\\V:=0(?:\.0*)?[,\s]|MaxTime:=0(?:\.0*)?\\|bottom:=bottom\+0\.0*;"),
    "gcode": re.compile(r"\bF0(?:\.0*)?\s|\bM66 .*Q0(?:\.0*)?\s|<bottom> = \[#<bottom> \+ 0\.0*\]"),
}
#: The longest line, and the longest text in quotes, that a controller reads.
_LONGEST = {"krl": (1000, 1000), "rapid": (1000, 80), "gcode": (252, 252)}
_LONE_END = {"krl": rb"(?<!\r)\n|\r(?!\n)", "rapid": rb"(?<!\r)\n|\r(?!\n)", "gcode": rb"\r"}


def assert_clean(out: Path, spec: Path) -> None:
    """ASCII, the controller's line ends, and no number that is none."""
    for name, data in snapshot(out).items():
        if name == "manifest.json" or name.endswith(".csv"):
            assert not re.search(rb"[^\x20-\x7e\n]", data), f"{name} is not plain ASCII"
            continue
        assert not (bad := _BAD_CONTROL.search(data)), f"{name} holds {bad[0]!r}"
        post = name.partition("/")[0]
        assert not re.search(_LONE_END[post], data), f"{name} mixes line ends"
        text = data.decode("ascii")
        assert not (bad := _VANISHED[post].search(text)), f"{name} holds {bad[0]!r}"
        line, quoted = _LONGEST[post]
        assert max(map(len, text.splitlines())) <= line, f"{name} has a line too long"
        texts = re.findall(r'"([^"\n]*)"', text)
        assert max(map(len, texts), default=0) <= quoted, f"{name} has a text too long"
        for pattern in (_NOT_A_NUMBER, _MINUS_ZERO):
            if pattern.search(text):
                for word in _names(spec):
                    text = text.replace(word, "")
                assert not (bad := pattern.search(text)), f"{name} holds {bad[0]!r}"


def _names(spec: Path) -> list[str]:
    """Every name of a spec that may stand in its output, the longest first."""
    from drillc.driver import plan_spec

    report = Report()
    try:
        planned = plan_spec(spec, None, report)
    except Refused as refused:
        raise AssertionError("a spec that compiled is refused now") from refused
    job = planned.job
    names = {job.program.text, *job.holes.ids.tolist()}
    names |= {region.name.text for region in job.regions}
    names |= {process.name for process in job.processes}
    names |= {signal.alias for signal in job.signals.values() if signal.alias}
    return sorted(names, key=len, reverse=True)
