import sys
from collections.abc import Iterator
from importlib.metadata import Distribution, EntryPoint
from pathlib import Path
from typing import ClassVar

import pytest
from drillc.language.diagnostics import Report
from drillc.output.names import NameRules
from drillc.output.post import Accepts, PostProcessor
from drillc.output.registry import GROUP, find_posts, list_posts
from output.programs import named


class Lathe(PostProcessor):
    name = "lathe"
    title = "an invented lathe"
    accepts: ClassVar[Accepts] = Accepts(joints=True)
    names: ClassVar[NameRules] = NameRules(8)
    files: ClassVar[dict[str, str]] = {"{program}.txt": "lathe.j2"}


class Nameless(PostProcessor):
    name = "nameless"


NOT_A_POST = 42


class _Distribution(Distribution):
    """A distribution that exists only in this test."""

    def __init__(self, name: str) -> None:
        self._name = name

    def read_text(self, filename: str) -> str | None:
        return f"Name: {self._name}\nVersion: 2.0\n" if filename == "METADATA" else None

    def locate_file(self, path: object) -> Path:
        return Path(str(path))


def entry(name: str, value: str, distribution: str = "some-posts") -> EntryPoint:
    made = EntryPoint(name, value, GROUP)
    vars(made)["dist"] = _Distribution(distribution)
    return made


@pytest.fixture
def here() -> str:
    """This module's import name, as an entry point would write it."""
    return Lathe.__module__


@pytest.fixture
def broken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    (tmp_path / "brokenpost.py").write_text("import a_module_that_is_not_there\n")
    (tmp_path / "exitingpost.py").write_text("raise SystemExit(3)\n")
    monkeypatch.syspath_prepend(tmp_path)
    yield
    for name in ("brokenpost", "exitingpost"):
        sys.modules.pop(name, None)


def test_drillcs_own_posts_are_there() -> None:
    report = Report()
    listed = {post.name: post for post in list_posts(report)}
    assert not report.diagnostics
    assert {"gcode", "krl", "rapid"} <= listed.keys()
    assert listed["gcode"].origin.startswith("drillc ")
    [post] = find_posts([named("gcode")], report)
    assert type(post).__name__ == "GcodePost"


def test_posts_come_in_the_order_asked_for(here: str) -> None:
    report = Report()
    found = find_posts(
        [named("lathe"), named("gcode")],
        report,
        [entry("gcode", "drillc.postprocessors.gcode:GcodePost"), entry("lathe", f"{here}:Lathe")],
    )
    assert [post.name for post in found] == ["lathe", "gcode"]
    assert not report.diagnostics


def test_an_unknown_post_has_a_suggestion(here: str) -> None:
    report = Report()
    assert find_posts([named("lahte")], report, [entry("lathe", f"{here}:Lathe")]) == []
    [error] = report.diagnostics
    assert (error.code, error.span, error.hint) == (
        "E601",
        named("lahte").span,
        'did you mean "lathe"?',
    )


def test_two_posts_with_one_name_are_an_error(here: str) -> None:
    report = Report()
    twice = [entry("lathe", f"{here}:Lathe", "one"), entry("lathe", f"{here}:Lathe", "two")]
    assert find_posts([named("lathe")], report, twice) == []
    [error] = report.diagnostics
    assert error.code == "E602"
    assert "one 2.0 and two 2.0" in error.message
    assert list_posts(Report(), twice) == []


@pytest.mark.usefixtures("broken")
@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("brokenpost:Post", "ModuleNotFoundError: No module named 'a_module_that_is_not_there'"),
        ("exitingpost:Post", "SystemExit: 3"),
        ("nowhere_at_all:Post", "ModuleNotFoundError"),
        ("drillc.postprocessors.gcode:Nothing", "AttributeError"),
    ],
)
def test_a_plug_in_that_cannot_be_imported_says_so(value: str, said: str) -> None:
    report = Report()
    assert find_posts([named("lathe")], report, [entry("lathe", value)]) == []
    [error] = report.diagnostics
    assert error.code == "E603"
    assert said in error.message
    assert "some-posts 2.0" in error.message
    assert error.span == named("lathe").span


@pytest.mark.usefixtures("broken")
def test_a_broken_plug_in_does_not_disturb_the_others() -> None:
    installed = [
        entry("lathe", "brokenpost:Post"),
        entry("gcode", "drillc.postprocessors.gcode:GcodePost"),
    ]
    report = Report()
    assert len(find_posts([named("gcode")], report, installed)) == 1
    assert not report.diagnostics
    assert "brokenpost" not in sys.modules  # not even imported
    assert [post.name for post in list_posts(report, installed)] == ["gcode"]
    assert [d.code for d in report.diagnostics] == ["E603"]  # but never left out in silence


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("lathe", "NOT_A_POST", "not a class derived from"),
        ("lathe", "NameRulesAlias", "not a class derived from"),
        ("other", "Lathe", "calls itself lathe"),
        ("nameless", "Nameless", "does not declare title, accepts, names, files"),
    ],
)
def test_what_is_no_post(here: str, name: str, value: str, said: str) -> None:
    report = Report()
    assert find_posts([named(name)], report, [entry(name, f"{here}:{value}")]) == []
    [error] = report.diagnostics
    assert error.code == "E604"
    assert said in error.message


class NameRulesAlias:
    """Some class that is not a post."""


def test_one_post_cannot_be_emitted_twice(here: str) -> None:
    report = Report()
    find_posts([named("lathe", 5), named("lathe", 9)], report, [entry("lathe", f"{here}:Lathe")])
    [error] = report.diagnostics
    assert (error.code, error.span, error.labels[0].span) == (
        "E605",
        named("lathe", 9).span,
        named("lathe", 5).span,
    )
