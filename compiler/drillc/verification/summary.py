"""Verdicts as a person reads them on one screen, and as a program reads them."""

from __future__ import annotations

from .verdict import Check, Failure, Verdict


def as_text(verdict: Verdict) -> str:
    """A table of one program's checks, and what fails."""
    word = "verified" if verdict.passed else "NOT VERIFIED"
    lines = [f"{verdict.post} {verdict.program}: {_holes(verdict.holes)}, {word}", ""]
    rows = [("check", "compared", "worst", "limit", "where")]
    rows += [_row(check) for check in verdict.checks if check.compared or check.failed]
    widths = [max(len(row[k]) for row in rows) for k in range(5)]
    for row in rows:
        cells = [row[0].ljust(widths[0]), *(row[k].rjust(widths[k]) for k in (1, 2, 3)), row[4]]
        lines.append(("  " + "  ".join(cells)).rstrip())
    for check in verdict.checks:
        if not check.failed:
            continue
        lines += ["", f"{check.name}: {_times(check.failed)}"]
        told = 0
        for failure in check.failures:
            lines.append(f"  {failure_text(failure)}")
            told += 1 + failure.alike
        if check.failed > told:
            lines.append(f"  and {check.failed - told:,} more")
    return "\n".join(lines) + "\n"


def _holes(count: int) -> str:
    return f"{count:,} hole{'s' * (count != 1)}"


def failure_text(failure: Failure) -> str:
    """One failure in one line: where, what, and where the spec says otherwise."""
    where = "" if failure.file is None else f"{failure.file}:{failure.line}: "
    more = f" (and {failure.alike:,} more like it)" if failure.alike else ""
    span = failure.span
    spec = "" if span is None else f" [{span.source.shown}:{span.line}:{span.column}]"
    return f"{where}{failure.message}{more}{spec}"


def as_json(verdict: Verdict) -> dict[str, object]:
    """The same as plain data."""
    return {
        "program": verdict.program,
        "post": verdict.post,
        "holes": verdict.holes,
        "passed": verdict.passed,
        "checks": [_as_json(check) for check in verdict.checks],
    }


def _as_json(check: Check) -> dict[str, object]:
    return {
        "name": check.name,
        "compared": check.compared,
        "worst": check.worst,
        "limit": check.limit,
        "unit": check.unit,
        "hole": check.hole,
        "file": check.file,
        "line": check.line,
        "failed": check.failed,
        "failures": [
            {
                "message": failure.message,
                "hole": failure.hole,
                "file": failure.file,
                "line": failure.line,
                "alike": failure.alike,
                "spec": None
                if failure.span is None
                else {
                    "file": failure.span.source.shown,
                    "line": failure.span.line,
                    "column": failure.span.column,
                },
            }
            for failure in check.failures
        ],
    }


def _row(check: Check) -> tuple[str, str, str, str, str]:
    failed = f"{check.failed:,} failed" if check.failed else ""
    worst, limit = _figure(check.worst, check.unit), _figure(check.limit, check.unit)
    where = "" if check.hole is None else f"{check.hole} {check.file}:{check.line}"
    return check.name, f"{check.compared:,}", worst, limit, f"{where}  {failed}".strip()


def _figure(value: float | None, unit: str) -> str:
    """With digits enough for what a controller prints, and none for what is noise."""
    if value is None:
        return ""
    text = f"{value:.6f}".rstrip("0").rstrip(".")
    return f"{text} {unit}".rstrip()


def _times(count: int) -> str:
    return f"{count:,} failure{'' if count == 1 else 's'}"
