import hashlib
import json
import os
from collections.abc import Iterator
from pathlib import Path

import drillc
import pytest
from drillc.language.diagnostics import Refused, Report
from drillc.language.job import HoleTable, Job, Part, Weights
from drillc.language.source import Source
from drillc.output.emission import OutFile
from drillc.output.writing import write_outputs
from output.programs import named

SPEC_SHA256 = hashlib.sha256(b"drill 1\n").hexdigest()
FILES = [OutFile("krl/A.src", [b"DEF ", b"A()\r\n"]), OutFile("gcode/a.ngc", [b"M2\n"])]


@pytest.fixture
def job(tmp_path: Path) -> Job:
    (tmp_path / "in").mkdir()
    spec = tmp_path / "in" / "a.drill"
    part = Part(named("skin"), None, True, 1e-3, None)
    return Job(
        program=named("A"),
        part=part,
        tool=None,
        robot=None,
        fixtures=(),
        signals={},
        processes=(),
        regions=(),
        holes=HoleTable.__new__(HoleTable),
        heading_jump_max_rad=None,
        order_shortest=False,
        weights=Weights(),
        expects=(),
        emits=(),
        inputs=(Source(spec, "a.drill", "drill 1\n", "a.drill", sha256=SPEC_SHA256),),
    )


def tree(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def refusal(out: Path, job: Job, files: list[OutFile] = FILES) -> str:
    """The code of the one error; nothing may have changed, in the folder or beside it."""
    before = tree(out.parent)
    report = Report()
    with pytest.raises(Refused):
        write_outputs(out, files, job, report)
    assert tree(out.parent) == before
    [error] = report.diagnostics
    return f"{error.code} {error.message}"


def test_files_and_manifest(tmp_path: Path, job: Job) -> None:
    out = tmp_path / "deep" / "out"
    written = write_outputs(out, FILES, job, Report())
    assert written == [out / "gcode/a.ngc", out / "krl/A.src", out / "manifest.json"]
    files = tree(out)
    assert files["krl/A.src"] == b"DEF A()\r\n"
    assert json.loads(files["manifest.json"]) == {
        "drillc": drillc.__version__,
        "inputs": {"a.drill": SPEC_SHA256},
        "outputs": {
            "gcode/a.ngc": hashlib.sha256(b"M2\n").hexdigest(),
            "krl/A.src": hashlib.sha256(b"DEF A()\r\n").hexdigest(),
        },
        "posts": [],
        "spec": "a.drill",
        "verified": False,
    }
    assert list((tmp_path / "deep").iterdir()) == [out]  # no temporary folder is left


def test_the_same_inputs_give_the_same_bytes_anywhere(tmp_path: Path, job: Job) -> None:
    for name in ("one", "two"):
        write_outputs(tmp_path / name, FILES, job, Report())
    write_outputs(tmp_path / "two", FILES[::-1], job, Report())
    assert tree(tmp_path / "one") == tree(tmp_path / "two")
    assert str(tmp_path).encode() not in b"".join(tree(tmp_path / "one").values())


def test_what_is_no_longer_emitted_goes_away(tmp_path: Path, job: Job) -> None:
    out = tmp_path / "out"
    write_outputs(out, FILES, job, Report())
    write_outputs(out, FILES[:1], job, Report())
    assert list(tree(out)) == ["krl/A.src", "manifest.json"]
    assert not (out / "gcode").exists()


def test_an_empty_folder_is_taken(tmp_path: Path, job: Job) -> None:
    out = tmp_path / "out"
    out.mkdir(mode=0o750)
    write_outputs(out, FILES, job, Report())
    assert len(tree(out)) == 3
    assert out.stat().st_mode & 0o777 == 0o750


def test_a_link_to_a_folder_stays_a_link(tmp_path: Path, job: Job) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to("real")
    write_outputs(tmp_path / "link", FILES, job, Report())
    assert (tmp_path / "link").is_symlink()
    assert len(tree(tmp_path / "real")) == 3


# ── somebody's own files ─────────────────────────────────────────────────────────────────────────


def test_a_folder_that_drillc_did_not_write(tmp_path: Path, job: Job) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "thesis.txt").write_text("years of work")
    said = refusal(out, job)
    assert said.startswith("E690")
    assert "thesis.txt" in said


@pytest.mark.parametrize("place", ["notes.txt", "krl/notes.txt", "mine/notes.txt", ".hidden"])
def test_a_file_that_the_manifest_does_not_list(tmp_path: Path, job: Job, place: str) -> None:
    out = tmp_path / "out"
    write_outputs(out, FILES, job, Report())
    (out / place).parent.mkdir(exist_ok=True)
    (out / place).write_text("mine")
    assert place in refusal(out, job)


def test_links_and_folders_of_the_user(tmp_path: Path, job: Job) -> None:
    out = tmp_path / "out"
    write_outputs(out, FILES, job, Report())
    (out / "empty").mkdir()
    assert "E690" in refusal(out, job)
    (out / "empty").rmdir()
    elsewhere = tmp_path / "elsewhere"
    (out / "krl").rename(elsewhere)
    (out / "krl").symlink_to(elsewhere)
    assert "E690" in refusal(out, job)
    assert (elsewhere / "A.src").exists()


@pytest.mark.parametrize(
    "manifest", ["", "{", "[]", "{}", '{"drillc": "1"}', '{"outputs": {}}', "[" * 100_000]
)
def test_a_manifest_of_something_else(tmp_path: Path, job: Job, manifest: str) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "manifest.json").write_text(manifest)
    assert "manifest.json" in refusal(out, job)


def test_many_foreign_files_are_counted(tmp_path: Path, job: Job) -> None:
    out = tmp_path / "out"
    out.mkdir()
    for i in range(30):
        (out / f"f{i:02d}").touch()
    assert "f09 and 20 more" in refusal(out, job)


def test_a_file_that_appears_while_writing_is_kept(tmp_path: Path, job: Job) -> None:
    out = tmp_path / "out"
    write_outputs(out, FILES, job, Report())

    def meanwhile(_: Path) -> None:
        (out / "notes.txt").write_text("mine")

    with pytest.raises(Refused):
        write_outputs(out, FILES[:1], job, Report(), before_move=meanwhile)
    assert list(tree(out)) == ["gcode/a.ngc", "krl/A.src", "manifest.json", "notes.txt"]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["in", "out"]


def test_the_output_folder_is_a_file(tmp_path: Path, job: Job) -> None:
    (tmp_path / "out").write_text("a file")
    assert "E691" in refusal(tmp_path / "out", job)
    assert "E691" in refusal(tmp_path / "out" / "inner", job)


def test_the_current_folder_is_not_pulled_away(
    tmp_path: Path, job: Job, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    write_outputs(out, FILES, job, Report())
    monkeypatch.chdir(out / "krl")
    assert "E692" in refusal(out, job)
    assert "E692" in refusal(Path(".."), job)


# ── failures on the way ──────────────────────────────────────────────────────────────────────────


def failing(error: BaseException) -> Iterator[bytes]:
    yield b"half a pro"
    raise error


@pytest.mark.parametrize("there", [True, False])
@pytest.mark.parametrize("error", [RuntimeError("no"), KeyboardInterrupt(), MemoryError()])
def test_a_failure_while_pouring_changes_nothing(
    tmp_path: Path, job: Job, error: BaseException, there: bool
) -> None:
    out = tmp_path / "out"
    if there:
        write_outputs(out, FILES, job, Report())
    before = tree(tmp_path)
    with pytest.raises(type(error)):
        write_outputs(out, [FILES[0], OutFile("b", failing(error))], job, Report())
    assert tree(tmp_path) == before
    assert sorted(p.name for p in tmp_path.iterdir()) == (["in", "out"] if there else ["in"])


def test_verification_sees_everything_and_can_stop_it(tmp_path: Path, job: Job) -> None:
    out = tmp_path / "out"
    write_outputs(out, FILES[:1], job, Report())
    before = tree(tmp_path)
    seen: list[dict[str, bytes]] = []

    def verify(folder: Path) -> None:
        seen.append(tree(folder))
        raise ValueError("it does not do what the spec says")

    with pytest.raises(ValueError, match="spec says"):
        write_outputs(out, FILES, job, Report(), verified=True, before_move=verify)
    assert list(seen[0]) == ["gcode/a.ngc", "krl/A.src", "manifest.json"]
    assert json.loads(seen[0]["manifest.json"])["verified"] is True
    assert tree(tmp_path) == before


@pytest.mark.parametrize("fails", [1, 2])
def test_a_failing_rename_is_undone(
    tmp_path: Path, job: Job, monkeypatch: pytest.MonkeyPatch, fails: int
) -> None:
    out = tmp_path / "out"
    write_outputs(out, FILES[:1], job, Report())
    before = tree(out)
    calls = 0
    rename = Path.rename

    def stubborn(self: Path, target: Path) -> Path:
        nonlocal calls
        calls += 1
        if calls == fails:
            raise OSError(18, "Invalid cross-device link")
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", stubborn)
    report = Report()
    with pytest.raises(Refused):
        write_outputs(out, FILES, job, report)
    assert report.diagnostics[0].code == "E691"
    assert tree(out) == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["in", "out"]


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_permission(tmp_path: Path, job: Job) -> None:
    (tmp_path / "closed").mkdir(mode=0o500)
    assert "E691" in refusal(tmp_path / "closed" / "out", job)


@pytest.mark.parametrize("path", ["/etc/x", "../x", "a/../../x", "./a", "a//b", ""])
def test_paths_stay_inside(tmp_path: Path, job: Job, path: str) -> None:
    with pytest.raises(ValueError, match="no path under"):
        write_outputs(tmp_path / "out", [OutFile(path, [b"x"])], job, Report())
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "paths", [("a", "a"), ("A/b", "a/B"), ("manifest.json",), ("MANIFEST.json",)]
)
def test_no_file_is_written_over_another(tmp_path: Path, job: Job, paths: tuple[str, ...]) -> None:
    files = [OutFile(path, [b"x"]) for path in paths]
    with pytest.raises(ValueError, match="twice"):
        write_outputs(tmp_path / "out", files, job, Report())
