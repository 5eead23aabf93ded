"""The installed readers, by entry point: drillc's own, and those that plug-ins bring.

A distribution registers a reader under `drillc.readers`, by the name of the post whose programs it
reads. A post without a reader is refused, not trusted.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Sequence
from importlib.metadata import EntryPoint, entry_points

from drillc.language.diagnostics import Report
from drillc.language.job import Named
from drillc.verification.reading import Reader

GROUP = "drillc.readers"


def find_readers(
    posts: Sequence[Named], report: Report, installed: Iterable[EntryPoint] | None = None
) -> dict[str, Reader]:
    """A reader for each post, by its name. Reports every post that has none that works; then the
    result is not complete. `installed` stands in for the entry points of the running Python."""
    entries = list(entry_points(group=GROUP) if installed is None else installed)
    readers: dict[str, Reader] = {}
    for post in posts:
        reader = _reader(post, [entry for entry in entries if entry.name == post.text], report)
        if reader is not None:
            readers[post.text] = reader
    return readers


def _reader(post: Named, entries: Sequence[EntryPoint], report: Report) -> Reader | None:
    if not entries:
        report.error(
            "E701",
            f"the post {post.text} has no reader, so its programs cannot be verified",
            post.span,
            hint="--no-verify writes them unverified, and the manifest says so",
        )
        return None
    if len(entries) > 1:
        origins = " and ".join(sorted(_origin(entry) for entry in entries))
        report.error(
            "E702",
            f"there are {len(entries)} readers for the post {post.text}: from {origins}",
            post.span,
            hint="uninstall all of these distributions but one",
        )
        return None
    entry = entries[0]
    try:
        loaded = entry.load()
    except (Exception, SystemExit) as error:
        why = f"{type(error).__name__}: {error}"
    else:
        if _is_reader(loaded, post.text):
            reader: Reader = loaded()
            return reader
        why = f"it is no class derived from drillc.verification.reading.Reader named {post.text}"
    report.error(
        "E703",
        f"the reader for the post {post.text} ({entry.value}, from {_origin(entry)}) cannot be"
        f" loaded: {why}",
        post.span,
        hint=f"update or uninstall {_origin(entry)}",
    )
    return None


def _is_reader(loaded: object, name: str) -> bool:
    return (
        isinstance(loaded, type)
        and issubclass(loaded, Reader)
        and not inspect.isabstract(loaded)
        and getattr(loaded, "name", None) == name
    )


def _origin(entry: EntryPoint) -> str:
    return f"{entry.dist.name} {entry.dist.version}" if entry.dist else entry.value
