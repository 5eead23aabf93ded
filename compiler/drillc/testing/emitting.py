"""One program of the corpus through one post, and back through its reader."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping
from dataclasses import dataclass

from drillc.driver import Planned
from drillc.language.diagnostics import Report, render
from drillc.language.job import Emit, Named
from drillc.output.emission import NAMES_FILE, PostError, emit_programs
from drillc.output.post import PostProcessor
from drillc.output.registry import find_posts
from drillc.planning.program import Program
from drillc.verification.proof import verify_folder
from drillc.verification.reading import Reader
from drillc.verification.registry import find_readers

from .corpus import emit_for, planned

Files = Mapping[str, bytes]


@dataclass(frozen=True, eq=False)
class Case:
    """A program of the corpus, and who writes and reads it."""

    post: PostProcessor
    reader: Reader
    name: str
    plan: Planned
    emit: Emit

    def files(self, programs: tuple[Program, ...] | None = None) -> Files:
        """What the post writes, of the case's own programs or of others; nothing, if it refuses
        them. Raises AssertionError for a post that fails, or that refuses without a place."""
        report = Report()
        try:
            files = emit_programs(self.post, programs or self.plan.programs, self.emit, report)
            written = {file.path: file.read() for file in files}
        except PostError as error:
            raise AssertionError(f"{self.name}: {error}") from error
        for found in report.diagnostics:
            told = render(found)
            must(re.fullmatch("[EW][0-9]{3}", found.code), f"{found.code} is no code: {told}")
            must(found.span, f"this has no place in the spec: {told}")
            must(found.message.isprintable(), f"this cannot be printed: {found.message!a}")
        wrong = "refuses it and writes files" if written else "writes nothing and says no reason"
        must(bool(written) != report.failed, f"{self.name}: {self.post.name} {wrong}")
        return written

    def failures(self, files: Files) -> list[str]:
        """What the proof finds wrong with files, in words; nothing, if they are proven."""
        found = []
        for verdict in verify_folder(
            self.plan.job,
            self.plan.programs,
            [self.emit],
            {self.post.name: self.reader},
            files,
            {self.post.name: changed_names(files)},
        ):
            for check in verdict.checks:
                for failure in check.failures:
                    place = f"{failure.file}:{failure.line}: " if failure.file else ""
                    found.append(f"{place}{check.name}: {failure.message}")
        return found


def case_of(post_name: str, program: str) -> Case:
    """Raises AssertionError if there is no such post, or no reader for it."""
    plan = planned(program)
    report = Report()
    named = [Named(post_name, plan.job.program.span)]
    posts, readers = find_posts(named, report), find_readers(named, report)
    must(not report.failed, "\n".join(map(render, report.diagnostics)))
    [post] = posts
    return Case(post, readers[post_name], program, plan, emit_for(post, program, plan))


def must(holds: object, otherwise: str) -> None:
    """Raises AssertionError with the words `otherwise`, also where Python runs without asserts."""
    if not holds:
        raise AssertionError(otherwise)


def changed_names(files: Files) -> Mapping[str, str]:
    """The names that were changed for the controller: the spec's and its own."""
    table = next((raw for path, raw in files.items() if path.endswith(f"/{NAMES_FILE}")), b"")
    return {row["spec"]: row["emitted"] for row in csv.DictReader(io.StringIO(table.decode()))}
