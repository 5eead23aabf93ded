"""The command line: a thin face on the driver. Loads the compiler only when a command needs it.

Exit codes: 0 fine, 1 the spec has errors, 2 usage, 3 the emitted program failed verification,
70 a bug in drillc.
"""

from __future__ import annotations

import argparse
import gc
import io
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from drillc import __version__

if TYPE_CHECKING:
    from drillc.language.diagnostics import Diagnostic

EXIT_FINE = 0
EXIT_ERRORS = 1
EXIT_USAGE = 2
EXIT_BUG = 70

#: A terminal gets at most so many messages, errors first; `--json` gives all.
MOST_SHOWN = 100


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    options = _parser().parse_args(arguments)
    # Rows of a table are read by the million and none of them holds a cycle: with Python's own
    # thresholds a quarter of a long run is spent on looking for some.
    gc.set_threshold(50_000, 20, 100)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # file names can hold anything
    code = EXIT_FINE
    try:
        code = int(options.run(options))
        sys.stdout.flush()
    except BrokenPipeError:
        # The reader has gone (`drillc inspect … | head`): not an error, and nothing more to say.
        _silence()
    except KeyboardInterrupt:
        print("drillc: interrupted; no output was touched", file=sys.stderr)
        return 130
    except MemoryError:
        print("drillc: the machine's memory is not enough for this spec", file=sys.stderr)
        return EXIT_ERRORS
    except Exception as error:
        return _bug(error)
    return code


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="drillc",
        description="Compile hole specs (.drill) into robot programs: KRL, RAPID, G-code.",
    )
    parser.add_argument("--version", action="version", version=f"drillc {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    compile_ = commands.add_parser("compile", help="compile a spec and write the programs")
    _spec_arguments(compile_)
    compile_.add_argument(
        "-o", "--out", type=Path, metavar="DIR", help="output folder (default: out/NAME_OF_SPEC)"
    )
    compile_.add_argument(
        "--post", action="append", default=[], metavar="NAME", help="emit for this post only"
    )
    compile_.set_defaults(run=_compile)

    check = commands.add_parser("check", help="check a spec, write nothing")
    _spec_arguments(check)
    check.set_defaults(run=_check)

    inspect = commands.add_parser("inspect", help="show every hole's pose and joints")
    _spec_arguments(inspect)
    inspect.add_argument("--format", choices=("table", "csv", "json"), default="table")
    inspect.set_defaults(run=_inspect)

    explain = commands.add_parser(
        "explain", help="show what is in an arm's way at a hole, heading by heading"
    )
    _spec_arguments(explain, "the explanation as JSON")
    explain.add_argument("hole", metavar="HOLE", help="the hole's id")
    explain.set_defaults(run=_explain)

    posts = commands.add_parser("posts", help="list the post-processors and where they come from")
    posts.set_defaults(run=_posts)

    robots = commands.add_parser("robots", help="list the arms that a spec can name")
    robots.add_argument("--json", action="store_true", help="the list as JSON, every figure")
    robots.set_defaults(run=_robots)
    return parser


def _spec_arguments(
    parser: argparse.ArgumentParser, json_help: str = "diagnostics as JSON, for editors"
) -> None:
    parser.add_argument("spec", type=Path, metavar="SPEC", help="the .drill file")
    parser.add_argument(
        "--root", type=Path, metavar="DIR", help="folder that a spec's paths may not leave"
    )
    parser.add_argument("--json", action="store_true", help=json_help)


# ── commands ─────────────────────────────────────────────────────────────────────────────────────


def _compile(options: argparse.Namespace) -> int:
    from drillc.driver import compile_spec
    from drillc.language.diagnostics import Refused, Report

    report = Report()
    out = options.out or Path("out") / options.spec.stem
    try:
        with _progress_line() as progress:
            written = compile_spec(
                options.spec,
                out,
                report,
                root=options.root,
                posts=tuple(options.post),
                progress=progress,
            )
    except Refused:
        return _refused(report.diagnostics, options.json)
    _say(report.diagnostics, options.json)
    if not options.json:
        for note in report.notes:
            print(note, file=sys.stderr)
        for path in written:
            print(path)
    return EXIT_FINE


def _check(options: argparse.Namespace) -> int:
    from drillc.driver import check_spec
    from drillc.language.diagnostics import Refused, Report

    report = Report()
    try:
        planned = check_spec(options.spec, report, root=options.root)
    except Refused:
        return _refused(report.diagnostics, options.json)
    _say(report.diagnostics, options.json)
    if not options.json:
        job = planned.job
        holes, regions = len(job.holes), len(job.regions)
        for note in report.notes:
            print(note)
        print(
            f"{options.spec}: {holes:,} hole{'s' * (holes != 1)} in "
            f"{regions} region{'s' * (regions != 1)}, no errors"
        )
    return EXIT_FINE


def _inspect(options: argparse.Namespace) -> int:
    from drillc.driver import plan_spec
    from drillc.inspection import write_inspection
    from drillc.language.diagnostics import Refused, Report

    report = Report()
    try:
        planned = plan_spec(options.spec, options.root, report)
    except Refused:
        return _refused(report.diagnostics, options.json)
    _say(report.diagnostics, options.json, json_to=sys.stderr)
    for note in () if options.json else report.notes:
        print(note, file=sys.stderr)
    write_inspection(planned, options.format, sys.stdout)
    return EXIT_FINE


def _explain(options: argparse.Namespace) -> int:
    from drillc.explaining import NotExplained, explain_hole, write_explanation
    from drillc.language.diagnostics import Refused, Report

    report = Report()
    try:
        with _progress_line() as progress:
            found = explain_hole(options.spec, options.root, options.hole, report, progress)
    except Refused:
        return _refused(report.diagnostics, options.json)
    except NotExplained as wrong:
        print(f"drillc explain: {wrong}", file=sys.stderr)
        return EXIT_USAGE
    write_explanation(found, "json" if options.json else "text", sys.stdout)
    return EXIT_FINE


def _posts(options: argparse.Namespace) -> int:
    from drillc.language.diagnostics import Report
    from drillc.output.registry import list_posts

    del options
    report = Report()
    listed = list_posts(report)
    width = max((len(post.name) for post in listed), default=0)
    for post in listed:
        print(f"{post.name.ljust(width)}  {post.title}  ({post.origin})")
    _say(report.diagnostics, as_json=False)
    return EXIT_ERRORS if report.failed else EXIT_FINE


def _robots(options: argparse.Namespace) -> int:
    from drillc.catalogue import models
    from drillc.catalogue.listing import as_json, as_table

    listed = models().values()
    print(as_json(listed) if options.json else as_table(listed), end="")
    return EXIT_FINE


@contextmanager
def _progress_line() -> Iterator[Callable[[str], None]]:
    """One line on the error stream that says what is being done; none where nobody is looking."""
    if not sys.stderr.isatty():
        yield lambda doing: None
        return

    def show(doing: str) -> None:
        print(f"\r\x1b[K{doing[:78]}", end="", file=sys.stderr, flush=True)

    try:
        yield show
    finally:
        print("\r\x1b[K", end="", file=sys.stderr, flush=True)


# ── saying ───────────────────────────────────────────────────────────────────────────────────────


def _refused(diagnostics: Sequence[Diagnostic], as_json: bool) -> int:
    """Say why; the exit code is that of a refused spec even when nobody reads it to the end."""
    try:
        _say(diagnostics, as_json)
        if not as_json:
            errors = sum(d.severity == "error" for d in diagnostics)
            print(f"{errors} error{'s' * (errors != 1)}; nothing was written", file=sys.stderr)
        sys.stdout.flush()
    except BrokenPipeError:
        _silence()
    return EXIT_ERRORS


def _silence() -> None:
    """Send what is still buffered nowhere, so that Python does not fail on it when it exits."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
    os.dup2(nowhere, sys.stderr.fileno())


def _say(diagnostics: Sequence[Diagnostic], as_json: bool, json_to: TextIO | None = None) -> None:
    """Diagnostics to the error stream, or as one JSON array to the output stream."""
    from drillc.language.diagnostics import as_json as to_json
    from drillc.language.diagnostics import in_order, render

    diagnostics = in_order(diagnostics)
    if as_json:
        import json

        print(json.dumps([to_json(d) for d in diagnostics], indent=2), file=json_to or sys.stdout)
        return
    errors = [d for d in diagnostics if d.severity == "error"]
    shown = diagnostics if len(diagnostics) <= MOST_SHOWN else (errors or diagnostics)[:MOST_SHOWN]
    for diagnostic in shown:
        print(render(diagnostic), file=sys.stderr)
    if len(shown) < len(diagnostics):
        print(f"… and {len(diagnostics) - len(shown):,} more messages", file=sys.stderr)


def _bug(error: Exception) -> int:
    """A bug in drillc or in a plug-in: say so without a traceback, unless one is asked for."""
    if os.environ.get("DRILLC_TRACEBACK"):
        raise error
    from drillc.language.diagnostics import printable

    said = printable(" ".join(str(error).split()))
    print(f"drillc: internal error: {type(error).__name__}: {said}", file=sys.stderr)
    print(
        "This is a bug, not a mistake in the spec; no output was touched. "
        "DRILLC_TRACEBACK=1 shows where.",
        file=sys.stderr,
    )
    return EXIT_BUG
