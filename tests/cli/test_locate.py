"""`drillc locate`: both ways, and what it says when it cannot."""

from __future__ import annotations

import json
import shlex
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from docs.fenced import blocks, document
from drillc.cli import main
from drillc.locating import Emitted, locate
from drillc.output.source_map import FOLDER, HOLES, LINES

ROOT = Path(__file__).parents[2]
SPECS = ("nacelle", "panel", "skin_portal")
NACELLE = "out/nacelle/krl/NACELLE_A"
P7 = (
    "hole P7 (nacelle.drill:53), region lower (nacelle.drill:48), process drill6 (nacelle.drill:23)"
)

Ask = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with samples/ and out/."""
    folder = tmp_path_factory.mktemp("locate")
    shutil.copytree(ROOT / "samples", folder / "samples", ignore=shutil.ignore_patterns("fus*"))
    for name in SPECS:
        spec, out = folder / f"samples/{name}.drill", folder / f"out/{name}"
        assert main(["compile", str(spec), "-o", str(out), "--no-verify"]) == 0
    return folder


@pytest.fixture
def there(compiled: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The same, to be read only."""
    monkeypatch.chdir(compiled)
    return compiled


@pytest.fixture
def own(compiled: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of it, to be spoilt."""
    shutil.copytree(compiled, tmp_path / "own")
    monkeypatch.chdir(tmp_path / "own")
    return tmp_path / "own"


@pytest.fixture
def ask(capsys: pytest.CaptureFixture[str]) -> Ask:
    """Exit code, output, error output."""

    def run(*arguments: str) -> tuple[int, str, str]:
        capsys.readouterr()
        code = main(["locate", *arguments])
        return code, *capsys.readouterr()

    return run


# ── answers ──────────────────────────────────────────────────────────────────────────────────────


def test_what_the_document_shows_is_what_is_said(there: Path, ask: Ask) -> None:
    found = blocks(document("source-maps.md"))
    commands = [block for block in found if block.language == "sh"]
    answers = [block for block in found if block.language == "text"]
    assert len(commands) == len(answers) == 4
    for command, answer in zip(commands, answers, strict=True):
        program, verb, *arguments = shlex.split(command.text)
        assert (program, verb) == ("drillc", "locate")
        assert ask(*arguments) == (0, answer.text, "")


def test_the_document_lists_the_files(there: Path) -> None:
    files = sorted(path.as_posix() for path in Path("out/nacelle").rglob("*") if path.is_file())
    assert "\n".join(files) in document("source-maps.md")
    for table in (LINES, HOLES):
        head = (Path("out/nacelle") / table).read_text().splitlines()[0]
        assert all(f"`{column}`" in document("source-maps.md") for column in head.split(","))


def test_a_line_of_a_table(there: Path, ask: Ask) -> None:
    table = Path("samples/panel.csv").read_text().splitlines()
    line = next(i for i, row in enumerate(table, 1) if row.startswith("S0102;"))
    code, out, err = ask(f"samples/panel.csv:{line}")
    assert (code, err) == (0, "")
    for said in out.splitlines():
        place, _, _ = said.partition(": ")
        file, _, number = place.rpartition(":")
        assert f"hole S0102 (panel.csv:{line})" in said
        first, _, last = number.partition("-")
        for text in Path(file).read_text().splitlines()[int(first) - 1 : int(last or first)]:
            assert "S0102" in text
    assert {said.split("/")[2] for said in out.splitlines()} == {"krl", "rapid"}


def test_a_routine_is_about_its_process(there: Path, ask: Ask) -> None:
    lines = Path(f"{NACELLE}.src").read_text().splitlines()
    peck = next(i for i, line in enumerate(lines, 1) if "ENDWHILE" in line)
    code, out, _ = ask(f"{NACELLE}.src:{peck}")
    assert (code, out.split(": ", 1)[1]) == (0, "process drill6 (nacelle.drill:23)\n")


def test_json(there: Path, ask: Ask) -> None:
    code, out, err = ask("--json", f"{NACELLE}.src:36")
    assert (code, err) == (0, "")
    place = {"spec": "nacelle.drill"}
    assert json.loads(out) == {
        "found": [
            {
                "file": f"{NACELLE}.src",
                "first": 36,
                "last": 36,
                "about": {"what": "hole", "name": "P7", **place, "line": 53},
                "region": {"what": "region", "name": "lower", **place, "line": 48},
                "process": {"what": "process", "name": "drill6", **place, "line": 23},
            }
        ],
        "notes": [],
    }
    code, out, err = ask("--json", "P77")
    assert (code, json.loads(out), err) == (1, {"found": [], "notes": []}, "")


@pytest.mark.parametrize("name", SPECS)
def test_there_and_back(name: str, there: Path) -> None:
    """What a line is about leads back to that line; in a large file, of every 97th."""
    seen = set()
    for path in sorted(Path("out", name).rglob("*")):
        if not path.is_file() or path.name == "manifest.json" or path.parent.name == FOLDER:
            continue
        count = len(path.read_bytes().splitlines())
        for line in range(1, count + 1, 97 if count > 200 else 1):
            [found] = locate(f"{path}:{line}", None).found
            assert found.file == path.as_posix()
            assert found.first <= line <= found.last
            seen.add(found.about.what)
            back = _cached(f"samples/{found.about.spec}:{found.about.line}", Path("out", name))
            assert any(
                each.file == found.file and each.first <= line <= each.last for each in back
            ), found
    assert {"hole", "process", "program"} <= seen
    assert name != "nacelle" or {"region", "via"} <= seen


_BACK: dict[tuple[str, Path], tuple[Emitted, ...]] = {}


def _cached(question: str, out: Path) -> tuple[Emitted, ...]:
    if (question, out) not in _BACK:
        _BACK[question, out] = locate(question, out).found
    return _BACK[question, out]


def test_back_and_there(there: Path) -> None:
    """Every line that a line of the spec leads to leads back to it."""
    found = 0
    for line in range(1, len(Path("samples/nacelle.drill").read_text().splitlines()) + 1):
        for each in locate(f"samples/nacelle.drill:{line}", None).found:
            for emitted in range(each.first, each.last + 1):
                [back] = locate(f"{each.file}:{emitted}", None).found
                stated = [s for s in (back.about, back.region) if s is not None]
                assert ("nacelle.drill", line) in [(s.spec, s.line) for s in stated]
                found += 1
    assert found > 100


def test_a_folder_is_shown_as_it_was_named(there: Path, ask: Ask) -> None:
    assert ask(str(there / f"{NACELLE}.src:36"))[1] == f"{there}/{NACELLE}.src:36: {P7}\n"
    assert ask("P7", "-o", "samples/../out/nacelle")[1].startswith("samples/../out/nacelle/krl/")
    assert ask("./samples/nacelle.drill:53", "-o", "out/nacelle")[1].count("hole P7") == 4


# ── files that have changed ──────────────────────────────────────────────────────────────────────


def test_an_edited_program_is_said_to_be_one(own: Path, ask: Ask) -> None:
    path = Path(f"{NACELLE}.src")
    path.write_bytes(path.read_bytes().replace(b"drill6(P7,12.000)", b"drill6(P7,13.000)"))
    code, out, err = ask(f"{NACELLE}.src:36")
    assert (code, out) == (0, f"{NACELLE}.src:36: {P7}\n")
    assert err == (
        f"note: {NACELLE}.src was changed after drillc wrote it: its lines may have moved\n"
    )
    assert json.loads(ask("--json", f"{NACELLE}.src:36")[1])["notes"]


def test_an_edited_spec_is_said_to_be_one(own: Path, ask: Ask) -> None:
    with Path("samples/nacelle.drill").open("a") as spec:
        spec.write("# more\n")
    code, out, err = ask("samples/nacelle.drill:53")
    assert (code, out.count("hole P7")) == (0, 4)
    assert err == (
        "note: samples/nacelle.drill was changed after out/nacelle was written from it:"
        " its lines may have moved\n"
    )


def test_a_spec_that_has_gone_can_still_be_asked_for(own: Path, ask: Ask) -> None:
    Path("samples/nacelle.drill").unlink()
    code, out, err = ask("samples/nacelle.drill:53")
    assert (code, out.count("hole P7"), err) == (0, 4, "")


def test_of_two_files_of_a_name_the_one_that_was_read(own: Path, ask: Ask) -> None:
    """Both keys end the path; the content says which is meant."""
    (own / "spec/spec").mkdir(parents=True)
    spec = (
        "drill 1\nprogram TWO\npart p { up +Z  normals into  frame 1 }\n"
        "tool t { number 1  tcp (0, 0, 200) mm }\nprocess d { approach 9 mm  retract 9 mm }\n"
    )
    for n, table in ((1, "t.csv"), (2, "spec/t.csv")):
        (own / "spec" / table).write_text(f"ID,X,Y,Z,I,J,K\nP{n},{50 * n},0,0,0,0,-1\n")
        spec += f'holes h{n} from "{table}" {{ units mm  columns {{ id ID  x X  y Y  z Z  i I  j J'
        spec += f"  k K }} }}\nregion r{n} {{ select h{n}  posture x toward +X  process d }}\n"
    (own / "spec/a.drill").write_text(spec + "emit krl\n")
    assert main(["compile", "spec/a.drill", "-o", "out/two", "--no-verify"]) == 0
    for n, path in ((1, "spec/t.csv:2"), (2, "spec/spec/t.csv:2")):
        names = {each.about.name for each in locate(path, Path("out/two")).found}
        assert names == {f"P{n}"}


@pytest.mark.parametrize("damage", ["changed", "gone"])
def test_a_map_that_was_changed_is_not_read(own: Path, ask: Ask, damage: str) -> None:
    table = Path("out/nacelle", LINES)
    table.write_text(table.read_text() + "\n") if damage == "changed" else table.unlink()
    code, out, err = ask(f"{NACELLE}.src:36")
    assert (code, out) == (2, "")
    assert err == f"drillc locate: {table} is not as drillc wrote it; compile again\n"


# ── nothing there, and wrong questions ───────────────────────────────────────────────────────────


@pytest.mark.parametrize(
    "question", [f"{NACELLE}.src:0", f"{NACELLE}.src:103", "samples/nacelle.drill:1", "P77", "P"]
)
def test_nothing_there(there: Path, ask: Ask, question: str) -> None:
    assert ask(question) == (1, "", f"nothing at {question}\n")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nothing.drill:3"], "there is no file nothing.drill"),
        (["P7", "-o", "samples"], "samples is no output folder of drillc with a source map"),
        (["P7", "-o", "nowhere"], "nowhere is no output folder of drillc with a source map"),
        (
            ["samples/make_panels.py:3", "-o", "out/panel"],
            "samples/make_panels.py was neither written to out/panel nor read for it;"
            " name the output folder with -o",
        ),
        (["a\x1b[31m.drill:3"], "there is no file a\ufffd[31m.drill"),
    ],
)
def test_wrong_questions(there: Path, ask: Ask, arguments: list[str], said: str) -> None:
    assert ask(*arguments) == (2, "", f"drillc locate: {said}\n")


def test_no_output_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ask: Ask) -> None:
    monkeypatch.chdir(tmp_path)
    for manifest in (None, "{", "[]", "{}", '{"drillc": "1", "outputs": {}}', '{"drillc": "1"}'):
        if manifest is not None:
            (tmp_path / "out/a").mkdir(parents=True, exist_ok=True)
            (tmp_path / "out/a/manifest.json").write_text(manifest)
        assert ask("P7") == (
            2, "", "drillc locate: there is no output folder below out; name one with -o\n",
        )  # fmt: skip


def test_no_question(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["locate"])
    assert stopped.value.code == 2
