"""Hole tables as spreadsheets, editors and other machines write them."""

from __future__ import annotations

import tempfile
from decimal import Decimal
from pathlib import Path

import pytest
from drillc.language import tables
from drillc.language.diagnostics import NAMED_ROWS
from hypothesis import given
from hypothesis import strategies as st
from language.texts import ALL_COLUMNS, codes, only, points, rows, spots, table

HEADER = "ID,X,Y,Z,I,J,K\n"
TWO = HEADER + "P1,1,2,3,0,0,1\nP2,4,5,6,0,0,-1\n"


def read(folder: Path, content: str | bytes, **options: str) -> tables.Table:
    found, report = table(folder, content, **options)
    assert found is not None, [d.message for d in report.diagnostics]
    return found


def places(found: tables.Table) -> list[tuple[int, int]]:
    holes = found.holes
    return list(zip(holes.line.tolist(), holes.column.tolist(), strict=True))


def assert_two(found: tables.Table) -> None:
    holes = found.holes
    assert holes.ids.tolist() == ["P1", "P2"]
    assert holes.position_mm.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert holes.normal.tolist() == [[0, 0, 1], [0, 0, -1]]


# ── the same table in other clothes ──────────────────────────────────────────────────────────────


@pytest.mark.parametrize(
    "content",
    [
        TWO,
        TWO.rstrip("\n"),
        TWO + "\n\n",
        TWO + ",,,,,,\n , ,,,,,\n",
        TWO.replace("\n", "\r\n"),
        TWO.replace("\n", "\r"),
        "\ufeff" + TWO,
        "\ufeff" + TWO.replace("\n", "\r\n"),
        TWO.replace(",", " , ").replace("\n", " \n"),
        TWO.replace(",", ",\t"),
        '"' + TWO.replace(",", '","').replace("\n", '"\n"')[:-1],
        TWO.replace("1,2,3", "1e0,2.,+3.0").replace("4,5,6", "400E-2,.5e1,6"),
    ],
)
def test_one_table_in_many_clothes(tmp_path: Path, content: str) -> None:
    found = read(tmp_path, content)
    assert_two(found)
    assert [line for line, _ in places(found)] == [2, 3]


@pytest.mark.parametrize(
    ("delimiter", "written"), [("\\t", "\t"), (";", ";"), ("|", "|"), (" ", " ")]
)
def test_delimiters(tmp_path: Path, delimiter: str, written: str) -> None:
    assert_two(read(tmp_path, TWO.replace(",", written), delimiter=delimiter))


@pytest.mark.parametrize("delimiter", ["", ",,", ".", "-", "0", "e", "'", "+"])
def test_a_delimiter_that_a_number_contains_is_refused(tmp_path: Path, delimiter: str) -> None:
    _, report = table(tmp_path, TWO, delimiter=delimiter)
    assert codes(report) == ["E243"]


def test_columns_in_any_order_among_others(tmp_path: Path) -> None:
    content = 'Note,K,J,I,Z,Y,X,"Fast, ID",DIA\n"a, ""b""",1,0,0,3,2,1,P1,4.8\n,-1,0,0,6,5,4,P2,\n'
    columns = 'id "Fast, ID"  x X  y Y  z Z  i I  j J  k K  diameter DIA'
    found = read(tmp_path, content, columns=columns)
    assert_two(found)
    assert found.holes.diameter_mm.tolist()[0] == 4.8
    assert str(found.holes.diameter_mm.tolist()[1]) == "nan"
    assert [str(v) for v in found.holes.stack_mm.tolist()] == ["nan", "nan"]


# ── where rows stand ─────────────────────────────────────────────────────────────────────────────


def test_ids_are_placed_without_quotes_and_blanks(tmp_path: Path) -> None:
    header = "X,Y,ID,Z,I,J,K\n"
    content = header + "1,22,P1,3,0,0,1\n\n 1, 2 ,\t P2,3,0,0,1\n"
    assert places(read(tmp_path, content)) == [(2, 6), (4, 10)]
    quoted = header + '"1",22,"P1",3,0,0,1\n\n 1, 2 ,"  P2",3,0,0,1\n1,2,P3,3,0,0,1\n'
    assert places(read(tmp_path, quoted)) == [(2, 9), (4, 11), (5, 5)]


def test_rows_behind_cells_of_many_lines(tmp_path: Path) -> None:
    content = (
        'Note,ID,X,Y,Z,I,J,K\n"one\ntwo, ""2""\n",P1,1,2,3,0,0,1\n,P2,4,5,6,0,0,-1\n'
        '"\n\n","\n P3",1,1,1,0,0,1\n,P4,x,1,1,0,0,1\n'
    )
    found = read(tmp_path, content.replace(",x,", ",9,"))
    assert found.holes.ids.tolist() == ["P1", "P2", "P3", "P4"]
    assert places(found) == [(4, 3), (5, 2), (9, 2), (10, 2)]
    _, report = table(tmp_path, content)
    assert spots(report) == [("E315", 10, 5)]
    assert "row 10, column X" in only(report).message


CELLS = st.text(st.sampled_from('a,"\n ;é'), max_size=6)


@given(st.lists(st.tuples(CELLS, st.integers(0, 99)), min_size=1, max_size=5))
def test_any_quoted_cell_may_come_first(some: list[tuple[str, int]]) -> None:
    """What stands before an id, quoted as the RFC says, does not move the place at which it is
    found."""
    text, wanted = "Note,ID,X,Y,Z,I,J,K\n", []
    for note, number in some:
        text += '"' + note.replace('"', '""') + '",'
        wanted.append((text.count("\n") + 1, len(text) - text.rfind("\n")))
        text += f"N{number},1,2,3,0,0,1\n"
    with tempfile.TemporaryDirectory() as folder:
        found = read(Path(folder), text)
    assert places(found) == wanted
    assert found.holes.ids.tolist() == [f"N{number}" for _, number in some]


@pytest.mark.parametrize(
    ("row", "code", "column"),
    [
        ("P2,4,,6,0,0,1", "E315", 6),
        ("P2,4,five,6,0,0,1", "E315", 6),
        ("P2,4,0x10,6,0,0,1", "E315", 6),
        ("P2,4,1_0,6,0,0,1", "E315", 6),
        ("P2,4,1 0,6,0,0,1", "E315", 6),
        ("P2,4,٣,6,0,0,1", "E315", 6),
        ('P2,4,"5,5",6,0,0,1', "E316", 7),
        ("P2,4,#REF!,6,0,0,1", "E317", 6),
        ("P2,4,#N/A,6,0,0,1", "E317", 6),
        ("P2,4,nan,6,0,0,1", "E318", 6),
        ("P2,4,5,6,0,-Infinity,1", "E318", 12),
        ("P2,4,5,6,0,0", "E313", 1),
        ("P2,4,5,6,0,0,1,", "E313", 1),
        ("P2", "E313", 1),
    ],
)
def test_bad_cells(tmp_path: Path, row: str, code: str, column: int) -> None:
    _, report = table(tmp_path, HEADER + "P1,1,2,3,0,0,1\n" + row + "\nP3,1,2,3,0,0,1\n")
    assert spots(report) == [(code, 3, column)]


def test_all_bad_cells_are_reported_by_kind(tmp_path: Path) -> None:
    bad = [("P", "x", "nan", "3", 0, 0, 1)] * 1000
    _, report = table(tmp_path, rows(*bad, ("P", 1)))
    found = codes(report)
    assert found.count("E315") == found.count("E318") == NAMED_ROWS + 1
    assert found.count("E313") == 1
    assert "990 more" in [d.message for d in report.diagnostics if d.code == "E315"][-1]


# ── headers ──────────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("content", ["", "\n", "\n\n \n", "\ufeff", ",,,\n"])
def test_an_empty_file(tmp_path: Path, content: str) -> None:
    found, report = table(tmp_path, content)
    assert found is None
    assert codes(report) == ["E311"]


def test_a_header_only(tmp_path: Path) -> None:
    holes = read(tmp_path, HEADER).holes
    assert len(holes.ids) == 0
    assert holes.position_mm.shape == holes.normal.shape == (0, 3)


@pytest.mark.parametrize("content", ["ID,X,X,Y,Z,I,J,K\n", "ID,X,Y,Z,I,J,K, X \n"])
def test_a_title_twice(tmp_path: Path, content: str) -> None:
    found, report = table(tmp_path, content + "P,1,2,3,4,5,6,7\n")
    assert found is None
    assert codes(report) == ["E314"]


def test_a_title_twice_that_nobody_asks_for(tmp_path: Path) -> None:
    assert len(read(tmp_path, "N,N,ID,X,Y,Z,I,J,K\n,,P,1,2,3,0,0,1\n").holes.ids) == 1


def test_all_missing_titles_at_once(tmp_path: Path) -> None:
    found, report = table(tmp_path, "ID,X,Y,Z,I\nP,1,2,3,0\n")
    assert found is None
    assert codes(report) == ["E314", "E314"]


@pytest.mark.parametrize("content", [HEADER + '"P1,1,2\n', HEADER + 'P1,"1"2,3,4,0,0,1\n'])
def test_quotes_that_do_not_match(tmp_path: Path, content: str) -> None:
    found, report = table(tmp_path, content)
    assert found is None
    assert spots(report) == [("E312", 2, 1)]


# ── numbers ──────────────────────────────────────────────────────────────────────────────────────

DECIMALS = st.decimals(
    Decimal(-(10**6)), Decimal(10**6), allow_nan=False, allow_infinity=False, places=7
)


@given(
    st.lists(st.tuples(*[DECIMALS] * 3), min_size=1, max_size=5),
    st.sampled_from(["f", "E"]),
)
def test_metres_and_millimetres_bit_for_bit(
    places_mm: list[tuple[Decimal, ...]], form: str
) -> None:
    """A table in m, one in mm and inline points in both: the same doubles."""
    found = []
    for unit, power in (("mm", 0), ("m", -3)):
        written = [[format(v.scaleb(power), form) for v in place] for place in places_mm]
        with tempfile.TemporaryDirectory() as folder:
            content = rows(*(("P", *place, 0, 0, 1) for place in written))
            found.append(read(Path(folder), content, units=unit).holes.position_mm)
        inside = "\n".join(f"P ({', '.join(place)}) normal (0, 0, 1)" for place in written)
        found.append(points(inside, unit)[0].position_mm)
    wanted = [[float(v).hex() for v in place] for place in places_mm]
    for position in found:
        assert [[v.hex() for v in place] for place in position.tolist()] == wanted


def test_units_hold_for_lengths_not_for_normals(tmp_path: Path) -> None:
    content = "ID,X,Y,Z,I,J,K,D,S\nP,0.29,-1,2e-3,0,0,1,0.0048,0.0065\n"
    columns = ALL_COLUMNS + "  diameter D  stack S"
    holes = read(tmp_path, content, units="m", columns=columns).holes
    assert holes.position_mm.tolist() == [[290.0, -1000.0, 2.0]]
    assert holes.normal.tolist() == [[0, 0, 1]]
    assert (holes.diameter_mm.tolist(), holes.stack_mm.tolist()) == ([4.8], [6.5])


def test_blocks_of_rows_are_joined(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    content = rows(*((f"P{i}", i, 0, 0, 0, 0, 1) for i in range(10)))
    whole = read(tmp_path, content)
    monkeypatch.setattr(tables, "BLOCK_ROWS", 3)
    pieces = read(tmp_path, content)
    assert pieces.holes.ids.tolist() == whole.holes.ids.tolist()
    assert pieces.holes.position_mm.tolist() == whole.holes.position_mm.tolist()
    assert places(pieces) == places(whole) == [(i + 2, 1) for i in range(10)]
