import csv
import io
import re
from dataclasses import replace

import numpy as np
import pytest
from drillc.language.diagnostics import Diagnostic, Report, render
from drillc.output.names import Kind, NameRules, Names, map_names, names_csv
from drillc.planning.program import Program
from hypothesis import given
from hypothesis import strategies as st
from output.programs import SOURCE, drill_cycle, joint_program, pose_drill, span, with_ids

ALL: tuple[Kind, ...] = ("program", "module", "process", "region", "hole")
USUAL: tuple[Kind, ...] = ("program", "module", "process", "hole")
RULES = NameRules(24, keywords=frozenset({"LIN", "Enddat"}), reserved=frozenset({"depth"}))
ascii_text = st.text(st.characters(min_codepoint=0x20, max_codepoint=0x7E), min_size=1, max_size=64)


def mapped(
    program: Program,
    rules: NameRules = RULES,
    kinds: tuple[Kind, ...] = USUAL,
    modules: int = 1,
) -> tuple[Names, list[Diagnostic]]:
    report = Report()
    return map_names(program, rules, kinds, modules, span(90), report), report.diagnostics


# ── the mapping ──────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize(
    ("spec", "emitted"),
    [
        ("P1", "P1"),
        ("p_1", "p_1"),
        ("a" * 24, "a" * 24),
        ("F-12.3/4", "F_12_3_4"),
        ("7", "H7"),
        ("_x", "H_x"),
        ("-1", "H_1"),
        ("RIVET_ROW_0000000000000123", "RIVET_ROW_0_000000000123"),
    ],
)
def test_known_names(spec: str, emitted: str) -> None:
    assert RULES.mapped([spec], "hole") == [emitted]


def test_each_kind_has_its_letter() -> None:
    letters = [RULES.mapped(["1"], kind)[0][0] for kind in ALL]
    assert letters == ["P", "M", "R", "G", "H"]


@given(ascii_text, st.integers(8, 40), st.booleans())
def test_every_mapped_name_is_legal(text: str, length: int, lower: bool) -> None:
    rules = NameRules(length, lower=lower)
    [name] = rules.mapped([text], "hole")
    assert re.fullmatch("[A-Za-z][A-Za-z0-9_]*", name)
    assert len(name) <= length
    assert not lower or name == name.lower()
    assert rules.mapped([name], "hole") == [name]  # what is legal stays


@given(st.lists(ascii_text, min_size=1, max_size=8))
def test_a_name_does_not_depend_on_its_neighbours(texts: list[str]) -> None:
    rules = NameRules(12)
    assert rules.mapped(texts, "hole") == [rules.mapped([t], "hole")[0] for t in texts]


def test_legal_names_are_kept_and_nothing_is_listed() -> None:
    names, found = mapped(pose_drill(3))
    assert found == []
    assert names.holes is not None
    assert names.holes.tolist() == ["P1", "P2", "P3"]
    assert (names.program, names.modules, names.processes) == (
        "PANEL_7L",
        ("PANEL_7L",),
        ("drill6",),
    )
    assert names.changed == []
    assert not names.changed


def test_modules_are_numbered_and_kept_short() -> None:
    names, found = mapped(replace(pose_drill(3), name="A" * 24), modules=12)
    assert found == []
    assert names.modules[0] == "A" * 11 + "_" + "A" * 10 + "_1"
    assert names.modules[11] == "A" * 11 + "_" + "A" * 9 + "_12"
    assert max(map(len, names.modules)) == 24


def test_changed_names_are_listed() -> None:
    program = with_ids(replace(pose_drill(3), name="7L"), ["P1", 'a"b,c', "12"])
    names, found = mapped(program)
    assert found == []
    rows = list(csv.reader(io.StringIO(names_csv(names.changed).decode())))
    assert rows == [
        ["kind", "spec", "emitted"],
        ["program", "7L", "P7L"],
        ["hole", 'a"b,c', "a_b_c"],
        ["hole", "12", "H12"],
    ]


def test_holes_that_are_not_named_are_not_mapped() -> None:
    names, found = mapped(with_ids(pose_drill(2), ["LIN", "lin"]), kinds=("program", "process"))
    assert (names.holes, found, names.changed) == (None, [], [])


def test_no_holes() -> None:
    names, found = mapped(pose_drill(0))
    assert names.holes is not None
    assert (len(names.holes), found) == (0, [])


# ── what is refused ──────────────────────────────────────────────────────────────────────────────


def only(found: list[Diagnostic]) -> Diagnostic:
    assert len(found) == 1, [render(d) for d in found]
    return found[0]


@pytest.mark.parametrize(("one", "two"), [("A-1", "A_1"), ("a1", "A1"), ("x" * 30, "x" * 31)])
def test_two_holes_with_one_name(one: str, two: str) -> None:
    _, found = mapped(with_ids(pose_drill(3), [one, "P2", two]))
    error = only(found)
    assert error.code == "E641"
    assert error.span is not None
    assert (error.span.line, error.labels[0].span.line) == (102, 100)
    assert one in error.message
    assert two in error.message


def test_case_matters_where_the_controller_minds_it() -> None:
    program = with_ids(pose_drill(3), ["a1", "A1", "lin"])
    assert mapped(program, replace(RULES, case_sensitive=True))[1] == []


def test_a_hole_and_a_process_share_one_name_space() -> None:
    error = only(mapped(with_ids(pose_drill(3), ["P1", "DRILL6", "P3"]))[1])
    assert error.code == "E641"
    assert (error.span.line, error.labels[0].span.line) == (101, 40)  # type: ignore[union-attr]


def test_program_process_and_module() -> None:
    error = only(mapped(replace(pose_drill(3), name="Drill6"))[1])
    assert (error.code, error.span) == ("E641", span(40))
    error = only(mapped(with_ids(pose_drill(3), ["P1", "panel_7l_2", "P3"]), modules=2)[1])
    assert error.code == "E641"
    assert "module PANEL_7L_2" in error.message


def test_regions_count_only_where_they_are_named() -> None:
    program = pose_drill(3, name="upper")  # region and process are both called upper
    assert mapped(program)[1] == []
    assert only(mapped(program, kinds=ALL)[1]).code == "E641"


@pytest.mark.parametrize("name", ["LIN", "lin", "ENDDAT", "Depth", "DEPTH"])
def test_words_of_the_language_and_of_the_templates(name: str) -> None:
    error = only(mapped(with_ids(pose_drill(3), ["P1", name, "P3"]))[1])
    assert error.code == "E642"
    assert error.span == pose_drill(3).holes.span(1).__class__(SOURCE, 101, 5, len(name))
    assert only(mapped(pose_drill(3, name=name))[1]).code == "E642"


@pytest.mark.parametrize("name", ["CON", "nul", "Com1"])
def test_names_that_windows_keeps(name: str) -> None:
    assert only(mapped(replace(pose_drill(3), name=name))[1]).code == "E642"
    assert mapped(with_ids(pose_drill(3), ["P1", name, "P3"]))[1] == []


@pytest.mark.parametrize("bad", ["P\n1", "P\r1", "P\t1", "P\x001x", "Pä", "\x7f", "P\u2028"])
def test_unprintable_ids(bad: str) -> None:
    error = only(mapped(with_ids(pose_drill(3), ["P1", bad, "P3"]))[1])
    assert (error.code, error.span.line) == ("E640", 101)  # type: ignore[union-attr]
    assert error.message.isprintable()


def test_an_empty_id() -> None:
    error = only(mapped(with_ids(pose_drill(3), ["P1", "", "P3"]))[1])
    assert (error.code, error.message) == ("E640", "the hole id is empty")


def test_unprintable_names_elsewhere() -> None:
    _, found = mapped(
        joint_program([("re\ngion", 0, 2)], [drill_cycle("dr\nill")], name="pro\ngram")
    )
    assert [d.code for d in found] == ["E640"] * 3


def test_many_mistakes_are_counted() -> None:
    ids = [f"A-{i}" for i in range(40)] + [f"A_{i}" for i in range(40)]
    _, found = mapped(with_ids(pose_drill(80), ids))
    assert [d.code for d in found] == ["E641"] * 11
    assert found[-1].message.startswith("30 more")


def test_all_kinds_of_mistakes_at_once() -> None:
    _, found = mapped(with_ids(pose_drill(4), ["A-1", "A_1", "LIN", "drill6"]))
    assert sorted(d.code for d in found) == ["E641", "E641", "E642"]


def test_bulk_and_single_agree() -> None:
    rng = np.random.default_rng(1)
    ids = ["".join(rng.choice(list("aZ09_-. /"), size=rng.integers(1, 30))) for _ in range(2000)]
    rules = NameRules(16)
    assert rules.mapped(ids, "hole") == [rules.mapped([i], "hole")[0] for i in ids]
