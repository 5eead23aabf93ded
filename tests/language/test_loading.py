"""Which files a spec may read, and under which names they go into the manifest."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path

import pytest
from drillc.cli import main
from drillc.language.diagnostics import Report
from drillc.language.loading import MAX_USE_DEPTH, Limit, Loaded, Loader, load
from language.texts import ONE_HOLE, PART, codes, only, spots

CELL = "drill 1\nio { clamp output 1 }\n"


def write(folder: Path, **files: str) -> Path:
    """Files by name, __ for a folder, and a suffix where one is missing; the spec's path."""
    for name, text in files.items():
        path = folder / (name.replace("__", "/") + ("" if "." in name else ".cell"))
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return folder / "spec.drill"


def loaded(path: Path, root: Path | None = None) -> tuple[Loader, Loaded | None, Report]:
    report = Report()
    loader, found = load(path, root, report)
    return loader, found, report


def spec_using(folder: Path, *paths: str) -> Path:
    uses = "".join(f'use "{path}"\n' for path in paths)
    (folder / "spec.drill").write_text(f"drill 1\n{uses}", encoding="utf-8")
    return folder / "spec.drill"


def keys(loader: Loader) -> list[str]:
    return [source.key for source in loader.inputs]


@pytest.fixture
def inside(tmp_path: Path) -> Path:
    """A spec's folder, beside which lies a file that it must not read."""
    write(tmp_path, outside=CELL)
    folder = tmp_path / "specs"
    write(folder, sub__cell=CELL)
    return folder


# ── the root ─────────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize(
    ("path", "code"),
    [
        ("../outside.cell", "E125"),
        ("sub/../../outside.cell", "E125"),
        ("../specs/../outside.cell", "E125"),
        ("/etc/passwd", "E124"),
        ("//server/share/x", "E124"),
        ("C:/x.cell", "E124"),
        ("c:x.cell", "E124"),
        ("sub\\\\cell.cell", "E124"),
        ("sub\\cell.cell", "E124"),
        ("\\\\server\\share\\x", "E124"),
        ("", "E124"),
        ("  ", "E124"),
        ("a\tb", "E124"),
        ("a\x7fb", "E124"),
        ("sub", "E121"),
        (".", "E121"),
        ("..", "E125"),
        ("sub/missing.cell", "E120"),
        ("~/x.cell", "E120"),
        ("x" * 5000, "E121"),
    ],
)
def test_what_may_not_be_read(inside: Path, path: str, code: str) -> None:
    loader, _, report = loaded(spec_using(inside, path))
    assert spots(report) == [(code, 2, 5)]
    assert keys(loader) == ["spec.drill"]


@pytest.mark.parametrize(
    "path", ["sub/cell.cell", "./sub/cell.cell", "sub/../sub/cell.cell", "../specs/sub/cell.cell"]
)
def test_ways_to_a_file_inside(inside: Path, path: str) -> None:
    loader, _, report = loaded(spec_using(inside, path))
    assert codes(report) == []
    assert keys(loader) == ["spec.drill", "sub/cell.cell"]


def test_a_wider_root(inside: Path) -> None:
    spec = spec_using(inside, "../outside.cell")
    loader, _, report = loaded(spec, inside.parent)
    assert codes(report) == []
    assert keys(loader) == ["specs/spec.drill", "outside.cell"]
    _, _, report = loaded(spec, inside)
    assert codes(report) == ["E125"]


def test_a_root_elsewhere_or_nowhere(inside: Path) -> None:
    spec = spec_using(inside, "sub/cell.cell")
    (inside / "other").mkdir()
    loader, _, report = loaded(spec, inside / "other")
    assert codes(report) == ["E125"]
    assert keys(loader) == ["spec.drill"]  # named by the user, not by a file
    for root in (inside / "nowhere", spec):
        _, found, report = loaded(spec, root)
        assert found is None
        assert codes(report) == ["E121"]


def test_links_are_followed_before_they_are_judged(inside: Path) -> None:
    (inside / "in.cell").symlink_to("sub/cell.cell")
    (inside / "folder").symlink_to(inside / "sub")
    (inside / "out.cell").symlink_to("../outside.cell")
    (inside / "up").symlink_to("..")
    (inside / "a.cell").symlink_to("b.cell")
    (inside / "b.cell").symlink_to("a.cell")
    (inside / "gone.cell").symlink_to("nothing.cell")
    for path, found in (
        ("in.cell", []),
        ("folder/cell.cell", []),
        ("out.cell", ["E125"]),
        ("up/outside.cell", ["E125"]),
        ("up/specs/sub/cell.cell", []),
        ("a.cell", ["E121"]),
        ("gone.cell", ["E120"]),
    ):
        loader, _, report = loaded(spec_using(inside, path))
        assert codes(report) == found, path
        if not found:
            assert keys(loader) == ["spec.drill", "sub/cell.cell"]  # whichever way it was reached


def test_paths_are_relative_to_the_file_that_holds_them(inside: Path) -> None:
    write(inside, sub__deep__a='drill 1\nuse "../b.cell"\n', sub__b='drill 1\nuse "cell.cell"\n')
    loader, found, report = loaded(spec_using(inside, "sub/deep/a.cell"))
    assert codes(report) == []
    assert keys(loader) == ["spec.drill", "sub/deep/a.cell", "sub/b.cell", "sub/cell.cell"]
    assert found is not None
    assert [s.kind for s in found.statements] == ["io"]


def test_a_root_does_not_hold_what_only_begins_like_it(tmp_path: Path) -> None:
    write(tmp_path, specs__a=CELL, specs2__b=CELL)
    _, _, report = loaded(spec_using(tmp_path / "specs", "../specs2/b.cell"))
    assert codes(report) == ["E125"]


# ── use of use ───────────────────────────────────────────────────────────────────────────────────


def test_what_is_used_twice_is_read_once(tmp_path: Path) -> None:
    write(
        tmp_path,
        left='drill 1\nuse "base.cell"\n',
        right='drill 1\nuse "./base.cell"\n',
        base=CELL,
    )
    (tmp_path / "again.cell").symlink_to("base.cell")
    spec = spec_using(tmp_path, "left.cell", "right.cell", "again.cell", "left.cell")
    loader, found, report = loaded(spec)
    assert codes(report) == []
    assert keys(loader) == ["spec.drill", "left.cell", "base.cell", "right.cell"]
    assert found is not None
    assert [s.kind for s in found.statements] == ["io"]


@pytest.mark.parametrize(
    ("files", "where"),
    [
        ({"spec.drill": 'drill 1\nuse "spec.drill"\n'}, ("spec.drill", 2, 5)),
        (
            {"spec.drill": 'drill 1\nuse "a.cell"\n', "a": 'drill 1\n\nuse "spec.drill"\n'},
            ("a.cell", 3, 5),
        ),
        (
            {
                "spec.drill": 'drill 1\nuse "a.cell"\n',
                "a": 'drill 1\nuse "b.cell"\n',
                "b": 'drill 1\n use "./a.cell"\n',
            },
            ("b.cell", 2, 6),
        ),
    ],
)
def test_use_in_a_circle(
    tmp_path: Path, files: dict[str, str], where: tuple[str, int, int]
) -> None:
    _, _, report = loaded(write(tmp_path, **files))
    found = only(report)
    assert found.code == "E126"
    assert found.span is not None
    assert (found.span.source.path.name, found.span.line, found.span.column) == where


def test_use_is_not_nested_without_end(tmp_path: Path) -> None:
    def chain(length: int) -> Report:
        for i in range(length):
            following = f'use "c{i + 1}.cell"\n' if i + 1 < length else ""
            write(tmp_path, **{f"c{i}": f"drill 1\n{following}"})
        return loaded(spec_using(tmp_path, "c0.cell"))[2]

    assert codes(chain(MAX_USE_DEPTH)) == []
    report = chain(MAX_USE_DEPTH + 1)
    assert codes(report) == ["E127"]
    assert "MAX_USE_DEPTH" in only(report).message


def test_mistakes_of_all_files_are_reported_together(tmp_path: Path) -> None:
    write(tmp_path, a="drill 1\nprogram P\n", b="drill 1\ntool 1\nrobot 2\n")
    _, _, report = loaded(spec_using(tmp_path, "a.cell", "b.cell", "c.cell"))
    found = [(d.code, d.span.source.path.name) for d in report.diagnostics if d.span]
    assert found == [
        ("E128", "a.cell"),
        ("E101", "b.cell"),
        ("E101", "b.cell"),
        ("E120", "spec.drill"),
    ]


# ── bytes ────────────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize(
    ("raw", "line", "column"),
    [
        (b"drill 1\r\n# caf\xe9\r\n", 2, 6),
        ("drill 1\n# é ".encode() + b"\xff\n", 2, 5),
        (b"drill 1\nprogram \0\n", 2, 9),
        (b"\xff\xfed\0r\0i\0l\0l\0", 1, 1),
    ],
)
def test_what_is_no_text(tmp_path: Path, raw: bytes, line: int, column: int) -> None:
    (tmp_path / "spec.drill").write_bytes(raw)
    _, found, report = loaded(tmp_path / "spec.drill")
    assert found is None
    assert spots(report) == [("E123", line, column)]


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_line_ends_and_marks(tmp_path: Path, end: str, mark: str) -> None:
    raw = (mark + "drill 1\n\nprogram 1\n".replace("\n", end)).encode()
    (tmp_path / "spec.drill").write_bytes(raw)
    loader, _, report = loaded(tmp_path / "spec.drill")
    assert spots(report) == [("E101", 3, 9)]
    assert loader.inputs[0].sha256 == hashlib.sha256(raw).hexdigest()


def test_a_file_beyond_its_limit(tmp_path: Path) -> None:
    path, report = tmp_path / "x", Report()
    path.write_bytes(b"12345")
    loader = Loader(tmp_path.resolve(), report)
    assert loader.read(path, Limit("MAX_X", 5), None) is not None
    assert loader.read(path, Limit("MAX_X", 4), None) is None
    assert codes(report) == ["E122"]
    assert "MAX_X" in only(report).message


def test_what_is_no_plain_file(tmp_path: Path) -> None:
    """A pipe would never end."""
    os.mkfifo(tmp_path / "pipe.cell")
    _, _, report = loaded(spec_using(tmp_path, "pipe.cell", "../../../dev/zero"))
    assert codes(report) == ["E121", "E125"]


# ── the manifest ─────────────────────────────────────────────────────────────────────────────────


def test_the_manifest_does_not_depend_on_where_one_stands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    cell = "drill 1\ntool t { number 1  tcp (0, 0, 1) mm }\n"
    text = f'drill 1\nuse "cells/../cells/t.cell"\n{PART}{ONE_HOLE}emit krl\n'
    found = []
    for tree, cwd, spec, root in (
        ("one", "one", "spec.drill", ()),
        ("one", ".", "one/spec.drill", ()),
        ("one", "one/cells", "../spec.drill", ()),
        ("one", "one", str(tmp_path / "one" / "spec.drill"), ()),
        ("one", "one", "./cells/../spec.drill", ("--root", ".")),
        ("two/deeper", "two", "deeper/spec.drill", ()),
    ):
        write(tmp_path / tree, **{"spec.drill": text, "cells__t": cell})
        monkeypatch.chdir(tmp_path / cwd)
        out = tmp_path / f"out{len(found)}"
        assert main(["compile", spec, "-o", str(out), *root]) == 0, capsys.readouterr().err
        found.append((out / "manifest.json").read_bytes())
    assert len(set(found)) == 1
    manifest = json.loads(found[0])
    said = json.dumps(manifest)
    for key, content in (("spec.drill", text), ("cells/t.cell", cell)):
        assert key in said
        assert hashlib.sha256(content.encode()).hexdigest() in said
    assert str(tmp_path) not in said
