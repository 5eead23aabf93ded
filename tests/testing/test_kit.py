"""drillc's own posts pass the kit, and the kit fails for posts and readers that are wrong."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from drillc.language.diagnostics import Report
from drillc.new_post import write_skeleton
from drillc.output.registry import list_posts
from drillc.testing import PROGRAMS, accepted, check_post
from drillc.testing.emitting import Case, case_of
from drillc.testing.kit import check_case

POSTS = [post.name for post in list_posts(Report())]


@pytest.mark.parametrize("program", PROGRAMS)
@pytest.mark.parametrize("post", POSTS)
def test_built_in_posts(post: str, program: str) -> None:
    check_post(post, program)


def test_what_each_post_takes() -> None:
    """So that a post which refuses everything does not pass for one that conforms."""
    taken = {post: set(accepted(post)) for post in ("krl", "rapid", "gcode")}
    poses = {name for name in PROGRAMS if name.startswith("poses")}
    rivets = {"portal_rivet", "portal_modules"}
    assert taken["krl"] == poses | rivets | {"arm_kuka", "arm_modules"}
    assert taken["rapid"] == poses - {"poses_peck"} | rivets | {"arm_abb"}
    assert taken["gcode"] == set(PROGRAMS) - poses


def test_the_corpus_is_small() -> None:
    assert len(PROGRAMS) >= 15
    assert all(len(case_of("krl", name).plan.job.holes) <= 12 for name in PROGRAMS)


# ── posts and readers that are wrong ─────────────────────────────────────────────────────────────

Edit = tuple[str, str, str]  # file of the skeleton, text, what stands there instead
Made = Callable[..., Case]


@pytest.fixture
def made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Made:
    """A skeleton's post and reader, some lines of it changed, over one program of the corpus."""
    name = f"wrong{tmp_path.name.replace('-', '_')[-20:]}".lower()
    package = f"drillc_{name}"

    def make(program: str, *edits: Edit) -> Case:
        write_skeleton(name, tmp_path / name)
        for file, text, instead in edits:
            path = tmp_path / name / package / file
            whole = path.read_text()
            assert whole.count(text) >= 1, text
            path.write_text(whole.replace(text, instead))
        monkeypatch.syspath_prepend(str(tmp_path / name))
        importlib.invalidate_caches()
        post, reader = (importlib.import_module(f"{package}.{p}") for p in ("post", "reader"))
        for loaded in (package, post.__name__, reader.__name__):
            monkeypatch.delitem(sys.modules, loaded)
        words = "".join(part.capitalize() for part in name.split("_"))
        plain = case_of("krl", program)
        named = replace(plain.emit, post=replace(plain.emit.post, text=name), settings=())
        made = getattr(post, f"{words}Post")(), getattr(reader, f"{words}Reader")()
        return Case(*made, program, plain.plan, named)

    return make


def test_the_skeleton_itself_is_right(made: Made) -> None:
    assert check_case(made("poses_regions"))


def test_a_post_may_refuse(made: Made) -> None:
    assert not check_case(made("portal_rivet"))


#: What is wrong, the program it is shown on, what is changed, and what the kit says.
WRONG: dict[str, tuple[str, list[Edit], str]] = {
    "the post drops the first hole of each section": (
        "poses_modules",
        [("program.j2", "per_hole(section.rows) %}\ndo", "per_hole(section.rest) %}\ndo")],
        "coverage",
    ),
    "the post swaps two axes": (
        "poses_one",
        [("program.j2", "hole.x }} {{ hole.y", "hole.y }} {{ hole.x")],
        "not proven",
    ),
    "the post counts the feed in mm/min": (
        "poses_one",
        [("program.j2", "step.feed_mm_s)", "step.feed_mm_s * 60)")],
        "speed",
    ),
    "the post has no way out of a wait": (
        "poses_rivet",
        [("program.j2", "  stop\nend", "end")],
        "handshake",
    ),
    "the post writes other bytes each time": (
        "poses_one",
        [
            ("post.py", "LENGTH, TURN", "COUNT = iter(range(100, 200))\nLENGTH, TURN"),
            ("post.py", '"base_text": base', '"base_text": f"{base} ; {next(COUNT)}"'),
        ],
        "other bytes",
    ),
    "the post writes a minus before zero": (
        "poses_one",
        [("program.j2", "\nmain\n", "\nmain ; -0.000\n")],
        "minus before zero",
    ),
    "the post writes what is not ASCII": (
        "poses_one",
        [("program.j2", "region {{ section.region }}", "r\x0begion")],
        "failed",
    ),
    "the post refuses without a place": (
        "poses_one",
        [
            ("post.py", "if program.tool is None:", "if True:"),
            ("post.py", ", span, hint", ", hint"),
        ],
        "no place",
    ),
    "the post refuses and gives no code": (
        "poses_one",
        [("post.py", "if program.tool is None:", "if True:"), ("post.py", "E901", "E9")],
        "no code",
    ),
    "the reader reads over what it does not know": (
        "poses_regions",
        [
            (
                "reader.py",
                """        raise self.wrong(f"{' '.join(words)} is not understood here")

    def value""",
                "        return Do(at, lambda m: None)\n\n    def value",
            ),
            (
                "reader.py",
                """raise self.wrong(f"{' '.join(words)} is not understood here")

    def point""",
                "continue\n\n    def point",
            ),
        ],
        "reads over",
    ),
    "the reader does not see speeds": (
        "poses_one",
        [("reader.py", "speed_mm_s=mm_s", "speed_mm_s=50.0")],
        "not proven",
    ),
    "the reader does not see time-outs": (
        "poses_rivet",
        [("reader.py", "m.wait(name, 1.0, timeout_s)", "m.wait(name, 1.0, 3.0)")],
        "handshake",
    ),
    "the reader takes the spec's tool for granted": (
        "poses_one",
        [("reader.py", "ToolFrame(number, *self.pose(place))", "ToolFrame('1')")],
        "frames|lets pass",
    ),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_the_kit_sees(made: Made, wrong: str) -> None:
    program, edits, said = WRONG[wrong]
    with pytest.raises(AssertionError, match=said):
        check_case(made(program, *edits))


def test_the_kit_sees_a_reader_that_accepts_everything(made: Made) -> None:
    """It tells of the right program, whatever it is given."""
    case = made("poses_regions")
    right, reader = case.files(), type(case.reader)

    class Blind(reader):  # type: ignore[misc, valid-type]
        def read(self, files: object) -> object:
            return super().read(right)

    with pytest.raises(AssertionError, match=r"reads over|lets it pass"):
        check_case(replace(case, reader=Blind()))


def test_the_kit_sees_a_reader_that_looks_at_nothing_but_words(made: Made) -> None:
    """It refuses what it does not know, and yet tells of the right program only."""
    case = made("poses_regions")
    right, reader = case.files(), type(case.reader)

    class Blind(reader):  # type: ignore[misc, valid-type]
        def read(self, files: object) -> object:
            super().read(files)
            return super().read(right)

    with pytest.raises(AssertionError, match="lets it pass"):
        check_case(replace(case, reader=Blind()))


def test_a_post_without_a_reader_is_said_to_have_none() -> None:
    with pytest.raises(AssertionError, match="E601"):
        check_post("nobodys", "poses_one")
    with pytest.raises(KeyError):
        check_post("krl", "no_such_program")
