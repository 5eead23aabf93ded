"""`drillc verify`: programs on disk against their spec, also after an edit, and when the spec has
moved on."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from drillc.driver import Progress, plan_spec, prove, quiet, wanted_emits
from drillc.language.diagnostics import Report
from drillc.verification import summary
from drillc.verification.verdict import Verdict

MANIFEST = "manifest.json"


class NotVerifiable(Exception):  # noqa: N818 (an answer, no error of the program)
    """There is nothing to verify, or no spec to verify it against; the text says why."""


@dataclass(frozen=True)
class Verified:
    """What the programs in a folder come to. `edited`, `missing` and `added` are files that are not
    as drillc wrote them, `changed` inputs of the spec that are not as they were."""

    spec: Path
    verdicts: tuple[Verdict, ...]
    edited: tuple[str, ...]
    missing: tuple[str, ...]
    added: tuple[str, ...]
    changed: tuple[str, ...]

    @property
    def passed(self) -> bool:
        """Whether every program does what the spec says."""
        return all(verdict.passed for verdict in self.verdicts)


def verify_directory(
    directory: Path,
    spec: Path | None,
    root: Path | None,
    report: Report,
    progress: Progress = quiet,
) -> Verified:
    """Plan the spec anew and prove the programs in `directory` against it.

    Without `spec`, one is looked for whose content is that which the manifest lists. Raises
    `NotVerifiable`, and `Refused` for a spec with errors.
    """
    manifest = read_manifest(directory)
    path = spec or _find_spec(directory, manifest)
    if root is None and spec is None:
        root = _root_of(path, manifest)
    planned = plan_spec(path, root, report, progress)
    posts = sorted({PurePosixPath(name).parts[0] for name in manifest["posts"]})
    emits = wanted_emits(planned.job, posts, report)
    verdicts = prove(planned, emits, directory, report, progress)
    known = {source.key: source.sha256 for source in planned.job.inputs}
    before: dict[str, str] = manifest["inputs"]
    return Verified(
        spec=path,
        verdicts=tuple(verdicts),
        edited=tuple(_edited(directory, manifest)),
        missing=tuple(name for name in manifest["outputs"] if not (directory / name).is_file()),
        added=tuple(_added(directory, posts, manifest)),
        changed=tuple(
            sorted(key for key in {*before, *known} if before.get(key) != known.get(key))
        ),
    )


def read_manifest(directory: Path) -> dict[str, Any]:
    """The manifest of an output folder. Raises NotVerifiable."""
    path = directory / MANIFEST
    try:
        manifest = json.loads(path.read_bytes())
    except FileNotFoundError:
        raise NotVerifiable(f"{directory} has no {MANIFEST}: drillc did not write it") from None
    except (OSError, ValueError, RecursionError) as error:
        raise NotVerifiable(f"{path} cannot be read: {error}") from None
    needed = {"inputs": dict, "outputs": dict, "posts": list, "spec": str}
    if not isinstance(manifest, dict) or not all(
        isinstance(manifest.get(key), kind) for key, kind in needed.items()
    ):
        raise NotVerifiable(f"{path} is no manifest of this version of drillc: compile again")
    return manifest


def _find_spec(directory: Path, manifest: dict[str, Any]) -> Path:
    """The spec with the content that the manifest lists, near the folder or the current one."""
    key = PurePosixPath(manifest["spec"])
    path = spec_of(directory, manifest)
    if path is not None:
        return path
    other = next((p for place in _near(directory) if (p := place / key).is_file()), None)
    why = "is not found near it" if other is None else f"has changed since ({other})"
    raise NotVerifiable(f"the spec of {directory}, {key}, {why}: name the spec with --spec")


def spec_of(directory: Path, manifest: dict[str, Any]) -> Path | None:
    """The same, or None."""
    key = PurePosixPath(manifest["spec"])
    wanted = manifest["inputs"].get(manifest["spec"])
    for place in _near(directory):
        path = place / key
        if path.is_file() and hashlib.sha256(path.read_bytes()).hexdigest() == wanted:
            return path
    return None


def _near(directory: Path) -> Iterator[Path]:
    """The current folder and those in it, and those that hold the output folder (`out/NAME`)."""
    yield Path()
    yield from sorted(inner for inner in Path().iterdir() if inner.is_dir())
    yield from directory.absolute().parents[:2]


def _root_of(spec: Path, manifest: dict[str, Any]) -> Path | None:
    """The folder that keys of the manifest count from, for a spec that lies deeper in it."""
    depth = len(PurePosixPath(manifest["spec"]).parts) - 1
    return spec.absolute().parents[depth] if depth else None


def _edited(directory: Path, manifest: dict[str, Any]) -> Iterator[str]:
    for name, digest in manifest["outputs"].items():
        path = directory / name
        if path.is_file() and hashlib.sha256(path.read_bytes()).hexdigest() != digest:
            yield name


def _added(directory: Path, posts: Sequence[str], manifest: dict[str, Any]) -> Iterator[str]:
    for post in posts:
        for path in sorted((directory / post).rglob("*")):
            name = path.relative_to(directory).as_posix()
            if path.is_file() and name not in manifest["outputs"]:
                yield name


# ── telling ──────────────────────────────────────────────────────────────────────────────────────


def as_text(found: Verified) -> str:
    """For a person: what is not as it was, then the verdicts."""
    lines = [f"against {found.spec}"]
    for what, names in (
        ("edited since drillc wrote it", found.edited),
        ("missing", found.missing),
        ("not written by drillc", found.added),
        ("the spec has moved on: changed since", found.changed),
    ):
        lines += [f"note: {name} ({what})" for name in names]
    return "\n".join(lines) + "\n" + "".join(map(summary.as_text, found.verdicts))


def as_json(found: Verified) -> str:
    """The same as JSON, every figure."""
    data = {
        "spec": str(found.spec),
        "passed": found.passed,
        "edited": found.edited,
        "missing": found.missing,
        "added": found.added,
        "changed": found.changed,
        "programs": [summary.as_json(verdict) for verdict in found.verdicts],
    }
    return json.dumps(data, indent=2) + "\n"
