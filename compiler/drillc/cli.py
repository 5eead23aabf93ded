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
    from drillc.verification.verdict import Verdict

EXIT_FINE = 0
EXIT_ERRORS = 1
EXIT_USAGE = 2
EXIT_UNPROVEN = 3
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

    compile_ = commands.add_parser(
        "compile", help="compile a spec, read the programs back, prove them, write them"
    )
    _spec_arguments(compile_)
    compile_.add_argument(
        "-o", "--out", type=Path, metavar="DIR", help="output folder (default: out/NAME_OF_SPEC)"
    )
    compile_.add_argument(
        "--post", action="append", default=[], metavar="NAME", help="emit for this post only"
    )
    compile_.add_argument(
        "--no-verify",
        action="store_true",
        help="write the programs without proof; the manifest says so",
    )
    compile_.set_defaults(run=_compile)

    verify = commands.add_parser("verify", help="prove programs on disk against their spec")
    verify.add_argument("directory", type=Path, metavar="DIR", help="a folder drillc has written")
    verify.add_argument(
        "--spec", type=Path, metavar="SPEC", help="the spec (default: found by the manifest)"
    )
    verify.add_argument(
        "--root", type=Path, metavar="DIR", help="folder that a spec's paths may not leave"
    )
    verify.add_argument("--json", action="store_true", help="the verdict as JSON, every figure")
    verify.set_defaults(run=_verify)

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

    diff = commands.add_parser("diff", help="compare specs and programs by what they make")
    diff.add_argument(
        "operands",
        nargs="+",
        metavar="A B",
        help="two of: a spec, a folder drillc has written, a file in one",
    )
    diff.add_argument(
        "--spec", type=Path, metavar="SPEC", help="the spec of a folder (default: by its manifest)"
    )
    diff.add_argument(
        "--root", type=Path, metavar="DIR", help="folder that a spec's paths may not leave"
    )
    diff.add_argument("--json", action="store_true", help="every difference as JSON")
    diff.add_argument(
        "--git", action="store_true", help="take the arguments of git's external diff driver"
    )
    diff.set_defaults(run=_diff)

    locate = commands.add_parser(
        "locate", help="from a line of an emitted file to the spec, and back"
    )
    locate.add_argument(
        "place",
        metavar="FILE:LINE",
        help="a line of an emitted file, of a spec or of a table; or a hole's id",
    )
    locate.add_argument(
        "-o", "--out", type=Path, metavar="DIR", help="output folder (default: all below out/)"
    )
    locate.add_argument("--json", action="store_true", help="the answer as JSON")
    locate.set_defaults(run=_locate)

    posts = commands.add_parser("posts", help="list the post-processors and where they come from")
    posts.set_defaults(run=_posts)

    robots = commands.add_parser("robots", help="list the arms that a spec can name")
    robots.add_argument("--json", action="store_true", help="the list as JSON, every figure")
    robots.set_defaults(run=_robots)

    new_post = commands.add_parser(
        "new-post", help="write a working package for a post of your own"
    )
    new_post.add_argument("name", metavar="NAME", help="what `emit` will call it")
    new_post.add_argument(
        "-o", "--out", type=Path, metavar="DIR", help="folder of the package (default: NAME)"
    )
    new_post.set_defaults(run=_new_post)
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
    from drillc.driver import NotProven, compile_spec
    from drillc.language.diagnostics import Refused, Report

    report = Report()
    out = options.out or Path("out") / options.spec.stem
    try:
        with _progress_line() as progress:
            compiled = compile_spec(
                options.spec,
                out,
                report,
                root=options.root,
                posts=tuple(options.post),
                verify=not options.no_verify,
                progress=progress,
            )
    except Refused:
        return _refused(report.diagnostics, options.json)
    except NotProven as unproven:
        return _unproven(unproven.verdicts, report.diagnostics, options.json)
    _say(report.diagnostics, options.json)
    if not options.json:
        for note in report.notes:
            print(note, file=sys.stderr)
        for path in compiled.paths:
            print(path)
        _summarise(compiled.verdicts)
        if options.no_verify:
            print("not verified, as asked for", file=sys.stderr)
    return EXIT_FINE


def _summarise(verdicts: Sequence[Verdict]) -> None:
    """What was proven, to the error stream: the output stream lists files."""
    from drillc.verification.summary import as_text

    sys.stdout.flush()
    for verdict in verdicts:
        print(as_text(verdict), end="", file=sys.stderr)


def _unproven(verdicts: Sequence[Verdict], diagnostics: Sequence[Diagnostic], json: bool) -> int:
    """A program was emitted that does not do what the spec says: a bug in a post or a template."""
    _say(diagnostics, json)
    _summarise(verdicts)
    print("the programs do not do what the spec says; nothing was written", file=sys.stderr)
    return EXIT_UNPROVEN


def _verify(options: argparse.Namespace) -> int:
    from drillc.language.diagnostics import Refused, Report, printable
    from drillc.verifying import NotVerifiable, as_json, as_text, verify_directory

    report = Report()
    try:
        with _progress_line() as progress:
            found = verify_directory(
                options.directory, options.spec, options.root, report, progress
            )
    except Refused:
        return _refused(report.diagnostics, options.json)
    except NotVerifiable as wrong:
        print(printable(f"drillc verify: {wrong}"), file=sys.stderr)
        return EXIT_USAGE
    _say(report.diagnostics, options.json, json_to=sys.stderr)
    print(as_json(found) if options.json else as_text(found), end="")
    return EXIT_FINE if found.passed else EXIT_UNPROVEN


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


def _diff(options: argparse.Namespace) -> int:
    """0 the same, 1 different, 2 trouble, as diff has it; for git always 0, which it asks for."""
    from drillc.diffing import NotComparable, as_json, as_text, compare, git_diff, side_of
    from drillc.language.diagnostics import Refused, Report, printable

    report = Report()
    if options.git and len(options.operands) in (7, 9):
        print(git_diff(options.operands, report), end="")
        return EXIT_FINE
    if options.git or len(options.operands) != 2:
        print("drillc diff: name two specs or programs (see drillc diff --help)", file=sys.stderr)
        return EXIT_USAGE
    try:
        one, two = (
            side_of(Path(operand), options.spec, options.root, report)
            for operand in options.operands
        )
        found = compare(one, two)
    except Refused:
        _say(report.diagnostics, as_json=False)
        return EXIT_USAGE
    except NotComparable as wrong:
        print(printable(f"drillc diff: {wrong}"), file=sys.stderr)
        return EXIT_USAGE
    if options.json:
        import json

        print(json.dumps(as_json(found), indent=2))
    else:
        print(as_text(found), end="")
    return EXIT_FINE if found.same else EXIT_ERRORS


def _locate(options: argparse.Namespace) -> int:
    from drillc.language.diagnostics import printable
    from drillc.locating import NotLocated, locate, write_answer

    try:
        answer = locate(options.place, options.out)
    except NotLocated as wrong:
        print(printable(f"drillc locate: {wrong}"), file=sys.stderr)
        return EXIT_USAGE
    for note in answer.notes:
        print(printable(f"note: {note}"), file=sys.stderr)
    write_answer(answer, options.json, sys.stdout)
    if not answer.found and not options.json:
        print(printable(f"nothing at {options.place}"), file=sys.stderr)
    return EXIT_FINE if answer.found else EXIT_ERRORS


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


def _new_post(options: argparse.Namespace) -> int:
    from drillc.new_post import write_skeleton, wrong_name

    if wrong := wrong_name(options.name):
        print(f"drillc new-post: {wrong}", file=sys.stderr)
        return EXIT_USAGE
    folder = options.out or Path(options.name)
    try:
        written = write_skeleton(options.name, folder)
    except FileExistsError:
        print(f"drillc new-post: {folder} is there already; nothing was written", file=sys.stderr)
        return EXIT_ERRORS
    except OSError as error:
        print(f"drillc new-post: {folder}: {error.strerror or error}", file=sys.stderr)
        return EXIT_ERRORS
    for path in written:
        print(path)
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
