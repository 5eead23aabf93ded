"""The command line: exit codes, JSON for editors, what `inspect` prints, what is not loaded."""

from __future__ import annotations

import csv
import io
import json
import os
import subprocess
import sys
from pathlib import Path

import drillc
import pytest
from drillc.cli import main
from language.texts import ONE_HOLE, PART

ROOT = Path(__file__).parents[2]
PORTAL = ROOT / "samples" / "portal.drill"
NACELLE = ROOT / "samples" / "nacelle.drill"
TOOL = "tool t { number 1  tcp (0, 0, 1) mm }\n"
FINE = f"drill 1\n{PART}{TOOL}{ONE_HOLE}emit krl\n".replace("into }", "into  frame 1 }")
WARNS = FINE.replace("emit krl", "sequence { order given  heading_jump max 1 deg }\nemit krl")
WARNS = WARNS.replace("x toward", "x horizontal toward").replace(
    "P1 (1, 2, 3) normal (0, 0, -1)",
    "P1 (1, 2, 3) normal (0, 0.6, -0.8)  P2 (9, 2, 3) normal (0.48, 0.36, -0.8)",
)
POSE = ["id", "region", "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"]
JOINTS = ["q1_mm", "q2_mm", "q3_deg", "q4_mm", "q5_mm", "q6_mm", "branch", "margin"]
ARM_JOINTS = ["heading_deg", *(f"A{i}_deg" for i in range(1, 7)), "branch", "margin"]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def spec(text: str) -> str:
    Path("spec.drill").write_text(text, encoding="utf-8")
    return "spec.drill"


def drillc_process(*arguments: str, **options: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(  # type: ignore[call-overload, no-any-return]
        [sys.executable, "-m", "drillc", *arguments], text=True, check=False, **options
    )


# ── exit codes ───────────────────────────────────────────────────────────────────────────────────


def test_fine(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for command in ("check", "inspect", "compile"):
        assert main([command, spec(FINE)]) == 0
        out, err = capsys.readouterr()
        assert out
        assert "warning" not in err
        assert "error" not in err
    assert "out/spec/manifest.json" in out.splitlines()
    assert all((here / line).is_file() for line in out.splitlines())


def test_warnings_are_fine(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for command in ("check", "inspect", "compile"):
        assert main([command, spec(WARNS)]) == 0
        assert "warning W350" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["check", "inspect", "compile"])
def test_errors_in_the_spec(here: Path, capsys: pytest.CaptureFixture[str], command: str) -> None:
    assert main([command, spec(FINE.replace("program P", "program 7"))]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("spec.drill:2:9: error E101: ")
    assert err.endswith("1 error; nothing was written\n")
    assert not (here / "out").exists()
    assert main([command, "missing.drill"]) == 1
    assert "E120" in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments",
    [[], ["bogus"], ["check"], ["compile"], ["compile", "a", "b"], ["--bogus"],
     ["inspect", "a", "--format", "xml"]],
)  # fmt: skip
def test_usage(capsys: pytest.CaptureFixture[str], arguments: list[str]) -> None:
    with pytest.raises(SystemExit) as exit_:
        main(arguments)
    assert exit_.value.code == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("usage: drillc")


@pytest.mark.parametrize(
    "broken",
    [
        "drillc.language.parser.parse",
        "drillc.language.resolve.resolve",
        "drillc.planning.depths.plunge_depths",
        "drillc.planning.plan.plan",
        "drillc.output.emission.emit_programs",
        "drillc.output.writing.write_outputs",
    ],
)
def test_a_bug_is_no_traceback_and_no_output(
    here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, broken: str
) -> None:
    def breaks(*_: object, **__: object) -> None:
        raise RuntimeError("a bug\x1b[31m")

    if broken.endswith(".parse"):
        broken = "drillc.language.loading.parse"
    monkeypatch.setattr(broken, breaks)
    monkeypatch.delenv("DRILLC_TRACEBACK", raising=False)
    assert main(["compile", spec(FINE)]) == 70
    out, err = capsys.readouterr()
    assert out == ""
    assert "internal error: RuntimeError" in err
    assert "Traceback" not in err
    assert 'File "' not in err
    assert "\x1b" not in err
    assert not (here / "out").exists()
    monkeypatch.setenv("DRILLC_TRACEBACK", "1")
    with pytest.raises(RuntimeError, match="a bug"):
        main(["compile", spec(FINE)])


@pytest.mark.parametrize(("error", "code"), [(MemoryError, 1), (KeyboardInterrupt, 130)])
def test_no_memory_and_no_patience(
    here: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    error: type[BaseException],
    code: int,
) -> None:
    def breaks(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("drillc.planning.plan.plan", breaks)
    assert main(["compile", spec(FINE)]) == code
    assert "Traceback" not in capsys.readouterr().err
    assert not (here / "out").exists()


# ── --json ───────────────────────────────────────────────────────────────────────────────────────

PLACE = {"file": str, "line": int, "column": int, "end_column": int}
FIELDS = {"severity": str, "code": str, "message": str, **PLACE, "labels": list}


def assert_schema(found: list[dict[str, object]]) -> None:
    for entry in found:
        assert set(entry) == {*FIELDS, "hint"}
        assert all(isinstance(entry[name], kind) for name, kind in FIELDS.items())
        assert entry["hint"] is None or isinstance(entry["hint"], str)
        labels = entry["labels"]
        assert isinstance(labels, list)
        for label in labels:
            assert set(label) == {"text", *PLACE}
            assert all(isinstance(label[name], kind) for name, kind in PLACE.items())


@pytest.mark.parametrize("command", ["check", "compile", "inspect"])
def test_errors_as_json(here: Path, capsys: pytest.CaptureFixture[str], command: str) -> None:
    text = FINE.replace("tool t", "tool t { number 1  tcp (0, 0, 1) mm }\ntool t")
    text = text.replace("toward +X", "toward +X cone 1 mm")
    assert main([command, "--json", spec(text)]) == 1
    out, err = capsys.readouterr()
    assert err == ""
    found = json.loads(out)
    assert_schema(found)
    assert [(e["severity"], e["code"], e["line"], e["column"], e["end_column"]) for e in found] == [
        ("error", "E215", 5, 6, 7),
        ("error", "E204", 6, 37, 41),
    ]
    assert [(label["line"], label["column"]) for label in found[0]["labels"]] == [(4, 6)]
    assert found[1]["labels"] == []
    assert {e["file"] for e in found} == {"spec.drill"}


def test_warnings_as_json(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for command in ("check", "compile"):
        assert main([command, "--json", spec(WARNS)]) == 0
        out, err = capsys.readouterr()
        assert err == ""
        found = json.loads(out)
        assert_schema(found)
        assert [(e["severity"], e["code"]) for e in found] == [("warning", "W350")]
    assert main(["inspect", "--json", "--format", "json", spec(WARNS)]) == 0
    out, err = capsys.readouterr()
    assert_schema(json.loads(err))
    assert [row["id"] for row in json.loads(out)] == ["P1", "P2"]


def test_nothing_to_say_as_json(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "--json", spec(FINE)]) == 0
    assert json.loads(capsys.readouterr().out) == []


def test_what_has_no_place_as_json(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "--json", "missing.drill"]) == 1
    [entry] = json.loads(capsys.readouterr().out)
    assert entry["code"] == "E120"
    assert all(entry[name] is None for name in PLACE)


def test_json_gives_all_and_a_terminal_the_first(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = FINE + "".join(f"process p{i} {{ travel 1 mm }}\n" for i in range(60))
    assert main(["check", "--json", spec(text)]) == 1
    count = len(json.loads(capsys.readouterr().out))
    assert count > 100
    assert main(["check", "spec.drill"]) == 1
    err = capsys.readouterr().err
    assert err.count("spec.drill:") >= 100
    assert f"and {count - 100} more messages" in err
    assert f"{count} errors; nothing was written" in err


def test_names_cannot_steer_a_terminal(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "\x1b[31mred\n.drill"]) == 1
    err = capsys.readouterr().err
    assert "\x1b" not in err
    assert "\n.drill" not in err


# ── inspect ──────────────────────────────────────────────────────────────────────────────────────


def inspected(path: Path, form: str, capsys: pytest.CaptureFixture[str]) -> str:
    assert main(["inspect", str(path), "--format", form]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize(
    ("path", "header"), [(NACELLE, POSE + ARM_JOINTS), (PORTAL, POSE + JOINTS)]
)
def test_csv_columns(path: Path, header: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    out = inspected(path, "csv", capsys)
    assert out.splitlines()[0] == ",".join(header)
    assert "\r" not in out
    assert all(len(row) == len(header) for row in csv.reader(io.StringIO(out)))


@pytest.mark.parametrize("path", [NACELLE, PORTAL])
def test_json_and_csv_agree(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from_csv = list(csv.DictReader(io.StringIO(inspected(path, "csv", capsys))))
    from_json = json.loads(inspected(path, "json", capsys), parse_float=str, parse_int=str)
    assert from_json == from_csv
    typed = json.loads(inspected(path, "json", capsys))
    assert {type(row[name]) for row in typed for name in row if name not in {"id", "region"}} <= {
        float,
        int,
    }


def test_the_exams_numbers(capsys: pytest.CaptureFixture[str]) -> None:
    [row] = csv.DictReader(io.StringIO(inspected(PORTAL, "csv", capsys)))
    assert (row["id"], row["region"], row["branch"]) == ("R1", "plate", "1")
    place = [float(row[name]) for name in ("x_mm", "y_mm", "z_mm")]
    assert place == [5500, -300, -200]
    joints = [float(row[name]) for name in JOINTS[:6]]
    wanted = [46.3, 4953.7, 110.0, 5619.9, 290.5, 2611.4]
    assert joints == pytest.approx(wanted, abs=0.06)
    # The nearest limit is q1's lower end, 46.3 of 5000 mm.
    assert float(row["margin"]) == pytest.approx(0.0463 / 5, abs=1e-5)


def test_quaternions_are_unit_with_a_positive_part(capsys: pytest.CaptureFixture[str]) -> None:
    found = list(csv.DictReader(io.StringIO(inspected(NACELLE, "csv", capsys))))
    assert [row["id"] for row in found] == ["P1", "P2", "P4", "P5", "P7", "P8"]
    for row in found:
        w, x, y, z = (float(row[name]) for name in ("qw", "qx", "qy", "qz"))
        assert w >= 0
        assert not row["qw"].startswith("-")
        assert w * w + x * x + y * y + z * z == pytest.approx(1, abs=1e-11)
    # P1's feed, the rotation's third column, is the normal as written, made unit.
    w, x, y, z = (float(found[0][name]) for name in ("qw", "qx", "qy", "qz"))
    feed = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]
    length = (0.233**2 + 0.012**2 + 0.972**2) ** 0.5
    assert feed == pytest.approx([-0.233 / length, -0.012 / length, 0.972 / length], abs=1e-11)


def test_ids_that_csv_must_quote_cannot_be_but_long_ones_can(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    spec(FINE.replace("P1", "A.1:b/c-" + "x" * 50))
    [row] = csv.DictReader(io.StringIO(inspected(Path("spec.drill"), "csv", capsys)))
    assert row["id"] == "A.1:b/c-" + "x" * 50


@pytest.mark.parametrize("path", [NACELLE, PORTAL])
def test_the_table_is_aligned(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = inspected(path, "table", capsys).splitlines()
    names = lines[0].split()
    cells = [line.split() for line in lines]
    assert all(len(row) == len(names) for row in cells)
    for i, name in enumerate(names):
        ends, starts = set(), set()
        for line, row in zip(lines, cells, strict=True):
            at = 0
            for cell in row[: i + 1]:
                start = line.index(cell, at)
                at = start + len(cell)
            starts.add(start)
            ends.add(at)
        assert len(starts if name in {"id", "region"} else ends) == 1, name


def test_the_reader_may_leave() -> None:
    """`drillc inspect … | head -1`: no traceback, exit code 0."""
    with subprocess.Popen(
        [sys.executable, "-m", "drillc", "inspect", str(ROOT / "samples" / "skin_portal.drill")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.readline().split()[0] == b"id"
        process.stdout.close()
        assert process.stderr.read() == b""
        assert process.wait(60) == 0


def test_the_reader_of_messages_may_leave(here: Path) -> None:
    text = "drill 1\n" + "".join(f"process p{i} {{ travel 1 mm }}\n" for i in range(3000))
    with subprocess.Popen(
        [sys.executable, "-m", "drillc", "check", "--json", spec(text)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.readline()
        process.stdout.close()
        assert process.stderr.read() == b""
        assert process.wait(60) == 1


# ── what is not loaded ───────────────────────────────────────────────────────────────────────────

HEAVY = ("numpy", "scipy", "trimesh", "lark", "jinja2")


@pytest.mark.parametrize("arguments", [["--version"], ["--help"], ["compile", "--help"], ["bogus"]])
def test_light_commands_load_nothing_heavy(arguments: list[str]) -> None:
    script = (
        "import sys\nfrom drillc.cli import main\n"
        f"try:\n    main({arguments!r})\nexcept SystemExit:\n    pass\n"
        f"print([m for m in {HEAVY!r} if m in sys.modules], file=sys.stderr)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert done.stderr.splitlines()[-1] == "[]"


def test_the_version() -> None:
    done = drillc_process("--version", capture_output=True)
    assert (done.returncode, done.stdout) == (0, f"drillc {drillc.__version__}\n")


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_any_terminal_will_do(here: Path, encoding: str) -> None:
    """Messages have α and “ in them."""
    done = subprocess.run(
        [sys.executable, "-m", "drillc", "check", spec("drill 1\nprogram “α”\n")],
        capture_output=True,
        env={**os.environ, "PYTHONIOENCODING": encoding, "PYTHONUTF8": "0"},
        check=False,
    )
    assert done.returncode == 1
    assert b"E110" in done.stderr
    assert b"Traceback" not in done.stderr
