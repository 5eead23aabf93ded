"""The installed posts: drillc's own and everybody's, by entry point.

A distribution registers a post under `drillc.postprocessors`, `name = "package.module:Class"`. Only
the posts that a spec asks for are imported. Nothing is skipped in silence: two posts with one name,
or one that cannot be imported, are errors that name the distribution to mend.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points

from drillc.language.diagnostics import Label, Report
from drillc.language.fields import did_you_mean
from drillc.language.job import Named
from drillc.language.source import Span
from drillc.output.post import PostProcessor

GROUP = "drillc.postprocessors"
_NAME = re.compile(r"[a-z][a-z0-9_]*")
_DECLARED = ("name", "title", "accepts", "names", "files")


@dataclass(frozen=True)
class ListedPost:
    """One line of `drillc posts`: `origin` is the distribution that brings the post."""

    name: str
    title: str
    origin: str


def find_posts(
    wanted: Sequence[Named], report: Report, installed: Iterable[EntryPoint] | None = None
) -> list[PostProcessor]:
    """The posts asked for, in order. Reports every mistake; then the list is not complete.

    `installed` stands in for the entry points of the running Python.
    """
    by_name = _by_name(installed)
    posts: list[PostProcessor] = []
    first: dict[str, Span] = {}
    for name in wanted:
        if name.text in first:
            report.error(
                "E605",
                f"{name.text} is emitted twice; both would write the same files",
                name.span,
                labels=[Label(first[name.text], "first asked for here")],
                hint="put everything into one emit",
            )
            continue
        first[name.text] = name.span
        if name.text not in by_name:
            report.error(
                "E601",
                f"there is no post {name.text}",
                name.span,
                hint=did_you_mean(name.text, by_name),
            )
        elif (post := _load(by_name[name.text], name.span, report)) is not None:
            posts.append(post)
    return posts


def list_posts(report: Report, installed: Iterable[EntryPoint] | None = None) -> list[ListedPost]:
    """Every installed post that works, by name; the others are reported."""
    listed = []
    for _, entries in sorted(_by_name(installed).items()):
        if (post := _load(entries, None, report)) is not None:
            listed.append(ListedPost(post.name, post.title, _origin(entries[0])))
    return listed


def _by_name(installed: Iterable[EntryPoint] | None) -> Mapping[str, list[EntryPoint]]:
    by_name: dict[str, list[EntryPoint]] = defaultdict(list)
    for entry in entry_points(group=GROUP) if installed is None else installed:
        by_name[entry.name].append(entry)
    return dict(by_name)


def _load(entries: Sequence[EntryPoint], span: Span | None, report: Report) -> PostProcessor | None:
    entry = entries[0]
    if len(entries) > 1:
        origins = " and ".join(sorted(_origin(e) for e in entries))
        report.error(
            "E602",
            f"there are {len(entries)} posts called {entry.name}: from {origins}",
            span,
            hint="uninstall all of these distributions but one",
        )
        return None
    try:
        loaded = entry.load()
        post = loaded() if isinstance(loaded, type) else None
    except (Exception, SystemExit) as error:
        report.error(
            "E603",
            f"the post {entry.name} ({entry.value}, from {_origin(entry)}) cannot be loaded:"
            f" {type(error).__name__}: {error}",
            span,
            hint=f"update or uninstall {_origin(entry)}",
        )
        return None
    if wrong := _wrong(post, entry.name):
        report.error(
            "E604",
            f"{entry.value}, from {_origin(entry)}, is no post called {entry.name}: {wrong}",
            span,
            hint=f"update or uninstall {_origin(entry)}",
        )
        return None
    assert isinstance(post, PostProcessor)
    return post


def _wrong(post: object, name: str) -> str | None:
    """What keeps an object from being the post of that name."""
    if not isinstance(post, PostProcessor):
        return "it is not a class derived from drillc.output.post.PostProcessor"
    missing = [field for field in _DECLARED if not hasattr(post, field)]
    if missing:
        return f"it does not declare {', '.join(missing)}"
    if post.name != name:
        return f"the class calls itself {post.name}"
    if not _NAME.fullmatch(name):
        return "a post's name has lower-case letters, digits and _"
    return None


def _origin(entry: EntryPoint) -> str:
    return f"{entry.dist.name} {entry.dist.version}" if entry.dist else entry.value
