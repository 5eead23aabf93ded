"""The source map says of every emitted line what a reader of the text would say of it."""

from __future__ import annotations

import csv
import io
import itertools
import random
import re
import shutil
import sys
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import jinja2
import numpy as np
import pytest
from drillc.cli import main
from drillc.language.diagnostics import Report
from drillc.language.job import Texts
from drillc.output.emission import OutFile, emit_programs
from drillc.output.numbers import Column, Text
from drillc.output.pouring import BLOCK_ROWS, Rows, StagedText
from drillc.output.source_map import (
    FOLDER,
    HOLES,
    LINES,
    REGIONS,
    Run,
    runs,
    source_map,
)
from drillc.output.staging import Stage
from drillc.planning.program import Program
from output.emitted_lines import About, about, lines_of
from output.programs import joint_rivet, named, pose_drill, with_ids
from output.test_conformance import CORPUS, NASTY, emit_for, must_accept, post_of

ROOT = Path(__file__).parents[2]
STATEMENT = named("PROGRAM", 2)
Tables = dict[str, list[dict[str, str]]]


def tables(read: Mapping[str, bytes]) -> Tables:
    return {
        name: list(csv.DictReader(io.StringIO(read[name].decode("utf-8", "surrogateescape"))))
        for name in (LINES, HOLES, REGIONS)
    }


def mapped(tables: Tables, files: Mapping[str, bytes]) -> dict[tuple[str, int], tuple[str, str]]:
    """What the map says of each line; each has one row, and no row is about a line too many."""
    holes = [hole["id"] for hole in tables[HOLES]]
    found: dict[tuple[str, int], tuple[str, str]] = {}
    counts = {path: len(lines_of(text)) for path, text in files.items()}
    ends = dict.fromkeys(files, 0)
    for row in tables[LINES]:
        path, first, last = row["file"], int(row["first"]), int(row["last"])
        assert first == ends[path] + 1
        assert last >= first
        ends[path] = last
        for line in range(first, last + 1):
            name = row["name"]
            if row["what"] == "hole":
                name = holes[int(row["row"]) - 2 + (line - first) // int(row["each"])]
            elif row["what"] == "via":
                assert name == holes[int(row["row"]) - 2]
            found[path, line] = row["what"], name
    assert ends == counts
    return found


def agree(said: About, got: Mapping[tuple[str, int], tuple[str, str]]) -> None:
    """Where the text says that a way leads home, or to the end, the map says what follows."""
    assert said
    for place, expected in said.items():
        if expected in (("via", "home"), ("via", "the end")):
            assert got[place][0] in ("via", "program")
        else:
            assert got[place] == expected, place
    for place, (what, _) in got.items():
        assert what in ("region", "process", "program") or place in said, place


# ── samples ──────────────────────────────────────────────────────────────────────────────────────

SAMPLES = {
    "nacelle": "emit krl",
    "nacelle in parts": "emit krl { holes_per_module 4 }",
    "nacelle for LinuxCNC": "emit gcode { axes { A1 U A2 V A3 W A4 A A5 B A6 C } }",
    "panel": "emit krl\nemit rapid",
    "panel in parts": "emit krl { holes_per_module 700 }\nemit rapid { holes_per_module 333 }",
    "portal": None,
    "skin_portal": None,
    "skin_portal in parts": "{ holes_per_module 700 ",
}


def spec_of(sample: str, folder: Path) -> Path:
    """The sample, in a folder of its own, with other emit statements."""
    emits = SAMPLES[sample]
    shutil.copytree(ROOT / "samples", folder, ignore=shutil.ignore_patterns("fuselage*"))
    spec = folder / f"{sample.split()[0]}.drill"
    text = spec.read_text("utf-8")
    if emits is not None and emits.startswith("{"):
        text = re.sub(r"holes_per_module \d+", "", text)
        text = re.sub(r"^(emit \w+) \{", rf"\1 {emits}", text, flags=re.MULTILINE)
    elif emits is not None:
        text = re.sub(r"^emit .*\n?", "", text, flags=re.MULTILINE) + emits + "\n"
    spec.write_text(text, "utf-8")
    return spec


@pytest.mark.parametrize("sample", SAMPLES)
def test_samples(sample: str, tmp_path: Path) -> None:
    spec = spec_of(sample, tmp_path / "in")
    assert main(["compile", str(spec), "-o", str(tmp_path / "out"), "--no-verify"]) == 0
    read = {
        path.relative_to(tmp_path / "out").as_posix(): path.read_bytes()
        for path in (tmp_path / "out").rglob("*")
        if path.is_file() and path.name != "manifest.json"
    }
    made = tables(read)
    read = {path: text for path, text in read.items() if not path.startswith(FOLDER)}
    got = mapped(made, read)
    said: About = {}
    for post in sorted({path.split("/")[0] for path in read}):
        said |= about(post, {k: v for k, v in read.items() if k.startswith(post)})
    agree(said, got)
    assert {name for what, name in said.values() if what == "hole"} == {
        hole["id"] for hole in made[HOLES]
    }
    check_places(made, tmp_path / "in")


def check_places(made: Tables, folder: Path) -> None:
    """What is said to stand on a line of a spec or table stands there."""
    lines = {
        path.relative_to(folder).as_posix(): ["", *path.read_text("utf-8").splitlines()]
        for pattern in ("*.drill", "*.csv", "*.cell")
        for path in folder.rglob(pattern)
    }
    for hole in made[HOLES]:
        text = lines[hole["spec"]][int(hole["line"])]
        assert re.search(rf"(^|[\s{{]){hole['id']}[\s;,(]", text), hole
    for row in made[LINES]:
        if row["what"] in ("region", "process", "program"):
            text = lines[row["spec"]][int(row["line"])]
            assert re.match(rf"{row['what']} {row['name']}\b", text), row
    for row in made[REGIONS]:
        text = lines[row["spec"]][int(row["line"])]
        assert re.match(rf"region {row['region']}\b", text), row
        text = lines[row["process_spec"]][int(row["process_line"])]
        assert re.match(rf"process {row['process']}\b", text), row


# ── programs ─────────────────────────────────────────────────────────────────────────────────────


def emitted(post: str, *programs: Program, **settings: object) -> list[OutFile]:
    chosen = post_of(post)
    report = Report()
    emit = emit_for(chosen, programs[0], **settings)
    files = emit_programs(chosen, programs, emit, report)
    assert bool(files) != report.failed
    return files


def read_all(files: list[OutFile]) -> dict[str, bytes]:
    return {file.path: file.read() for file in files}


TAKEN = [
    (post, key)
    for post in ("krl", "rapid", "gcode")
    for key, program in CORPUS.items()
    if must_accept(post, program)
]


@pytest.mark.parametrize("in_parts", [False, True], ids=["whole", "in parts"])
@pytest.mark.parametrize(("post", "key"), TAKEN)
def test_programs(post: str, key: str, in_parts: bool) -> None:
    program = CORPUS[key]
    size = max(2, len(program.holes) // 2)
    files = emitted(post, program, **({"holes_per_module": size} if in_parts else {}))
    made = tables(read_all(source_map(files, STATEMENT)))
    read = read_all(files)
    agree(about(post, read), mapped(made, read))
    rows = itertools.count(2)
    for region, section in zip(
        made[REGIONS], [s for s in program.sections if s.stop > s.start], strict=True
    ):
        expected = [str(next(rows)) for _ in range(section.stop - section.start)]
        assert (region["first_row"], region["last_row"]) == (expected[0], expected[-1])
        assert (region["region"], region["process"]) == (
            section.region,
            program.cycles[section.cycle].process.name,
        )


def test_the_programs_of_two_stations_share_the_tables() -> None:
    program = CORPUS["a kuka: drill"]
    other = replace(with_ids(program, [f"Q{i}" for i in range(5)]), name="OTHER")
    files = emitted("krl", program, other)
    made = tables(read_all(source_map(files, STATEMENT)))
    assert [hole["id"] for hole in made[HOLES]] == [*program.holes.ids, *other.holes.ids]
    read = read_all(files)
    agree(about("krl", read), mapped(made, read))
    # Another post's files of the same programs add no holes.
    more = tables(read_all(source_map([*files, *emitted("gcode", program, other)], STATEMENT)))
    assert more[HOLES] == made[HOLES]
    assert len(more[LINES]) > len(made[LINES])


def test_the_table_of_names_is_about_the_program() -> None:
    program = CORPUS["poses: ids that are no names"]
    files = emitted("krl", program)
    [table] = [file for file in files if file.path.endswith("names.csv")]
    made = tables(read_all(source_map(files, STATEMENT)))
    [row] = [row for row in made[LINES] if row["file"] == table.path]
    assert (row["first"], row["last"]) == ("1", str(table.read().count(b"\n")))
    assert [row[c] for c in ("what", "name", "line")] == ["program", "PROGRAM", "2"]


def test_a_process_that_nobody_states_leaves_its_lines_to_the_program() -> None:
    program = pose_drill(2)
    [cycle] = program.cycles
    cycle = replace(cycle, process=replace(cycle.process, span=None))
    made = tables(
        read_all(source_map(emitted("krl", replace(program, cycles=(cycle,))), STATEMENT))
    )
    assert {row["what"] for row in made[LINES]} == {"program", "region", "hole"}
    assert {row["process_spec"] for row in made[REGIONS]} == {""}


def test_nothing_in_a_spec_breaks_the_format() -> None:
    ids = [
        *NASTY,
        'a,"b"',
        'it\'s, "so"',
        "=1+1",
        " padded ",
    ]
    program = with_ids(joint_rivet(len(ids)), ids)
    source = replace(program.holes.sources[0], key='odd, "name"\n\udce9.csv')
    program = replace(program, holes=replace(program.holes, sources=(source,)))
    read = read_all(source_map(emitted("gcode", program), STATEMENT))
    assert read[HOLES].count(b"\n") == len(ids) + 1
    made = tables(read)
    assert [hole["id"] for hole in made[HOLES]] == ids
    assert {hole["spec"] for hole in made[HOLES]} == {'odd, "name"\ufffd\ufffd.csv'}
    assert [int(hole["line"]) for hole in made[HOLES]] == program.holes.line.tolist()


# ── lines of a staged text, against each character's own part ────────────────────────────────────


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A package `maptemplates` for templates, importable only during the test."""
    folder = tmp_path / "maptemplates"
    folder.mkdir()
    (folder / "__init__.py").touch()
    monkeypatch.syspath_prepend(tmp_path)
    yield folder
    sys.modules.pop("maptemplates", None)


class Part(str):
    """What a loop of a template runs over: the text inside is about it."""


def rendered(
    package: Path, template: str, columns: Mapping[str, Column], **context: object
) -> StagedText:
    (package / "t.j2").write_text(template, encoding="utf-8", newline="")
    stage = Stage(
        "maptemplates",
        columns,
        subject_of=lambda item: item if isinstance(item, Part) else None,
    )
    return stage.render("t.j2", context)


def of_lines(text: StagedText) -> list[object]:
    """Line by line: the subject, or the row's number."""
    found: list[object] = []
    for run in runs(text):
        if run.rows is None:
            found += [run.subject] * run.lines
        else:
            assert run.lines == len(run.rows) * run.each
            for row in range(run.rows.start, run.rows.stop):
                found += [row] * run.each
    return found


def beginnings(pieces: list[tuple[str, object]]) -> list[object]:
    """For each line of the pieces' text, whose its first character is."""
    found, fresh = [], True
    for text, owner in pieces:
        for character in text:
            if fresh:
                found.append(owner)
            fresh = character == "\n"
    return found


@pytest.mark.parametrize("seed", range(60))
def test_a_line_belongs_to_where_it_begins(package: Path, seed: int) -> None:
    rng = random.Random(seed)
    n = rng.choice([0, 1, 3, BLOCK_ROWS, 2 * BLOCK_ROWS + 5])
    cells = rng.choice([["x"], [""], ["x", ""], ["", "x\n", "\n", "x\ny", "x\n\n"], ["\n"]])
    values: Texts = np.array([rng.choice(cells) for _ in range(n)] or [""])[:n]
    template, pieces = "", []
    for _ in range(rng.randint(1, 4)):
        literal = "".join(rng.choice(["a", "b\n", "\n", ""]) for _ in range(rng.randint(0, 3)))
        before, after = (rng.choice(["", "p", "p\n", "\n", "\np"]) for _ in range(2))
        start = rng.randint(0, n)
        body = f"{before}{{{{ hole.v }}}}{after}"
        template += literal + f"{{% call(hole) per_hole(parts[{start}]) -%}}"
        template += f"{{{{ '' }}}}{body}{{{{ '' }}}}{{%- endcall %}}{{{{ '' }}}}"
        pieces.append((literal, None))
        pieces += [(before + str(values[row]) + after, row) for row in range(start, n)]
    parts = [Rows(start, n) for start in range(n + 1)]
    text = rendered(package, template, {"v": Text(values)}, parts=parts)
    if rng.random() < 0.5:
        b"".join(text)  # poured before, or not
    assert b"".join(text).decode() == "".join(piece for piece, _ in pieces)
    assert of_lines(text) == beginnings(pieces)


def test_runs_do_not_grow_with_the_holes(package: Path) -> None:
    template = "a\n{% call(hole) per_hole(rows) %}\n{{ hole.v }}\nb\n{% endcall %}\nc"
    columns = {"v": Text(np.full(5 * BLOCK_ROWS, "x"))}
    text = rendered(package, template, columns, rows=Rows(7, 5 * BLOCK_ROWS))
    count = 5 * BLOCK_ROWS - 7
    rows = Rows(7, 5 * BLOCK_ROWS)
    assert list(runs(text)) == [Run(1, None), Run(2 * count, None, rows, 2), Run(1, None)]


def test_what_was_poured_is_not_poured_again(package: Path) -> None:
    asked = []

    class Watched(Text):
        def cells(self, start: int, stop: int) -> list[str]:
            asked.append(start)
            return super().cells(start, stop)

    values = np.array(["x", "x\ny"] * BLOCK_ROWS)
    template = "{% call(hole) per_hole(rows) %}\n{{ hole.v }}\n{% endcall %}\n"
    text = rendered(package, template, {"v": Watched(values)}, rows=Rows(0, len(values)))
    first = list(runs(text))  # not poured yet
    assert asked == [0, BLOCK_ROWS]
    b"".join(text)
    assert list(runs(text)) == first
    assert asked == [0, BLOCK_ROWS] * 2


def test_loops_say_what_the_text_is_about(package: Path) -> None:
    template = (
        "head\n{% for part in parts %}\n{{ part }}\n{% for step in [1, 2] %}\n{{ step }}\n"
        "{% endfor %}\n{% for inner in inners %}\n{{ inner }}\n{% endfor %}\nend {{ part }}\n"
        "{% else %}\nnone\n{% endfor %}\n"
        "{% for part in nothing %}\n{% else %}\nempty\n{% endfor %}\n"
        "{% if parts %}\ntail\n{% else %}\n{% endif %}\n"
    )
    parts, inner = [Part("A"), Part("B")], Part("C")
    text = rendered(package, template, {}, parts=parts, inners=[inner], nothing=[])
    whole = b"".join(text).decode()
    assert whole == "head\nA\n1\n2\nC\nend A\nB\n1\n2\nC\nend B\nempty\ntail\n"
    a, b = parts
    assert of_lines(text) == [None, a, a, a, inner, a, b, b, b, inner, b, None, None]


MARKED = {
    "captured": "{% set x %}{% for p in parts %}{{ p }}{% endfor %}{% endset %}{{ x | length }}",
    "filtered": "{% filter upper %}{% for p in parts %}{{ p }}{% endfor %}{% endfilter %}",
    "a macro": "{% macro m() %}{% for p in parts %}{{ p }}\n{% endfor %}{% endmacro %}{{ m() }}",
    "imported": '{% import "m.j2" as m %}{{ m.list(parts) }}',
    "imported with context": '{% import "m.j2" as m with context %}{{ m.list(parts) }}',
    "spaces": "{% for p in parts -%}  \n {{ p }} {%- if p %} {% endif -%}\n {%- endfor -%}\n",
    "some items": "{% for p in parts if p != 'A' %}{{ loop.index }}{{ p }}{% else %}-{% endfor %}",
    "two variables": "{% for p, q in pairs %}{{ p }}{{ q }}{% endfor %}",
    "a value": "{% set x = 1 %}{% for p in parts %}{{ p }}{{ x }}{% endfor %}{{ x }}",
}


@pytest.mark.parametrize("template", MARKED.values(), ids=MARKED.keys())
def test_marks_are_not_to_be_seen(package: Path, template: str) -> None:
    other = "{% macro list(parts) %}{% for p in parts %}<{{ p }}>{% endfor %}{% endmacro %}"
    (package / "m.j2").write_text(other)
    parts = [Part("A"), Part("B")]
    context = {"parts": parts, "pairs": [("c", "d")]}
    plain = jinja2.Environment(
        loader=jinja2.DictLoader({"t": template, "m.j2": other}),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    text = rendered(package, template, {}, **context)
    assert b"".join(text).decode() == plain.get_template("t").render(context)
