"""Writing the output folder: all of it or nothing, and never over somebody's own files.

Files are poured into a new folder beside the old one; only when all are there (and `before_move` is
content, which is where verification goes) do the two change places by renaming. The manifest lists
what was read and written, by hash: the same inputs give the same bytes.
"""

from __future__ import annotations

import hashlib
import json
import os
import secrets
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath

import drillc
from drillc.language.diagnostics import NAMED_ROWS, Report
from drillc.language.job import Job
from drillc.output.emission import OutFile

MANIFEST = "manifest.json"


def write_outputs(
    directory: Path,
    files: Iterable[OutFile],
    job: Job,
    report: Report,
    *,
    posts: Sequence[str] = (),
    verified: bool = False,
    before_move: Callable[[Path], None] | None = None,
) -> list[Path]:
    """Write `files` and the manifest as the new content of `directory`; their paths, sorted.

    `posts` wrote them; each has a folder of its own. `before_move` is called with the finished
    temporary folder; whatever it raises stops everything.
    Raises `Refused` when `directory` holds files that drillc did not write, or cannot be written.
    After any exception the directory is as it was, and the temporary folder is gone.
    """
    target = Path(os.path.realpath(directory))  # unlike resolve(), it minds no loop of links
    temporary = target.parent / f".{target.name}.drillc-{secrets.token_hex(4)}"
    try:
        _check_free(target, directory, report)
        report.stop_if_failed()
        target.parent.mkdir(parents=True, exist_ok=True)
        temporary.mkdir()
        outputs = _pour(temporary, files)
        _write_manifest(temporary, job, posts, outputs, verified)
        if before_move is not None:
            before_move(temporary)
        _swap(temporary, target, directory, report)
    except OSError as error:
        what = f" ({error.filename})" if error.filename else ""
        report.error(
            "E691",
            f"the output folder {directory} cannot be written: {error.strerror or error}{what}",
            hint="nothing was changed",
        )
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    report.stop_if_failed()
    return sorted(directory / path for path in (*outputs, MANIFEST))


# ── the folder that is already there ─────────────────────────────────────────────────────────────


def _check_free(target: Path, directory: Path, report: Report) -> None:
    """Report why `target` may not be replaced."""
    if not target.exists():
        return
    if not target.is_dir():
        report.error("E691", f"the output folder {directory} is a file", hint="name a folder")
    elif Path.cwd().is_relative_to(target):
        report.error(
            "E692",
            f"the output folder {directory} holds the current folder, which cannot be replaced",
            hint="run drillc from elsewhere, or name a folder of its own, such as -o out",
        )
    else:
        _check_strangers(target, directory, report)


def _check_strangers(folder: Path, directory: Path, report: Report) -> None:
    """Report files in `folder` that drillc did not write: they would be deleted."""
    known = _listed(folder / MANIFEST)
    strangers = sorted(_strangers(folder, known or set()))
    if not strangers:
        return
    shown = ", ".join(strangers[:NAMED_ROWS])
    more = f" and {len(strangers) - NAMED_ROWS} more" if len(strangers) > NAMED_ROWS else ""
    why = "are not in its manifest" if known is not None else "were not written by drillc"
    report.error(
        "E690",
        f"the output folder {directory} holds files that {why}: {shown}{more}",
        hint="move them elsewhere, or name another folder with -o",
    )


def _listed(manifest: Path) -> set[str] | None:
    """The files that a manifest lists, itself among them; None when it is no manifest of ours."""
    if manifest.is_symlink():
        return None
    try:
        data = json.loads(manifest.read_bytes())
    except (OSError, ValueError, RecursionError):
        return None
    if not isinstance(data, dict) or "drillc" not in data:
        return None
    outputs = data.get("outputs")
    return {MANIFEST, *outputs} if isinstance(outputs, dict) else None


def _strangers(folder: Path, known: Iterable[str]) -> Iterator[str]:
    """What stands in `folder` beside the files `known`: files, links, and folders without them."""
    files = set(known)
    folders = {str(parent) for path in files for parent in PurePosixPath(path).parents}
    for where, inner_folders, inner_files in os.walk(folder):
        for name in inner_files + inner_folders:
            path = Path(where, name)
            shown = path.relative_to(folder).as_posix()
            if path.is_symlink() or shown not in (folders if path.is_dir() else files):
                yield shown


# ── the new one ──────────────────────────────────────────────────────────────────────────────────


def _pour(folder: Path, files: Iterable[OutFile]) -> dict[str, str]:
    """Write every file, chunk by chunk; path → SHA-256."""
    hashes: dict[str, str] = {}
    folded: set[str] = {MANIFEST}
    for file in files:
        path = PurePosixPath(file.path)
        if path.is_absolute() or ".." in path.parts or str(path) != file.path:
            raise ValueError(f"{file.path!r} is no path under the output folder")
        if file.path.lower() in folded:
            raise ValueError(f"{file.path} is written twice, where upper and lower case are one")
        folded.add(file.path.lower())
        digest = hashlib.sha256()
        target = folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        with target.open("xb") as stream:
            for chunk in file.chunks:
                digest.update(chunk)
                stream.write(chunk)
        hashes[file.path] = digest.hexdigest()
    return hashes


def _write_manifest(
    folder: Path, job: Job, posts: Sequence[str], outputs: Mapping[str, str], verified: bool
) -> None:
    """No time stamp and no absolute path: the manifest too is a function of the inputs."""
    manifest = {
        "drillc": drillc.__version__,
        "inputs": {source.key: source.sha256 for source in job.inputs},
        "outputs": outputs,
        "posts": sorted(posts),
        "spec": job.inputs[0].key if job.inputs else "",
        "verified": verified,
    }
    text = json.dumps(manifest, indent=2, sort_keys=True) + "\n"
    (folder / MANIFEST).write_bytes(text.encode("utf-8"))


def _swap(temporary: Path, target: Path, directory: Path, report: Report) -> None:
    """Put `temporary` in the place of `target`; the old folder comes back if that fails."""
    if not target.exists():
        temporary.rename(target)
        return
    shutil.copymode(target, temporary)
    old = temporary.with_name(temporary.name + "-old")
    target.rename(old)
    try:
        # Once more: pouring takes time, and somebody may have put a file there meanwhile.
        _check_strangers(old, directory, report)
        if not report.failed:
            temporary.rename(target)
    finally:
        if target.exists():
            shutil.rmtree(old, ignore_errors=True)
        else:
            old.rename(target)
