"""Bad input that no folder of this repository could hold: odd bytes, links, and sizes."""

from __future__ import annotations

import io
import os
import re
import zipfile
from pathlib import Path

import pytest
from diagnostics.running import FINE, TOOL, Bench, files_of
from drillc.geometry import threemf
from drillc.language import loading, mesh_files, parser
from drillc.language.loading import MAX_USE_DEPTH, Limit
from drillc.language.parser import MAX_NESTING, MAX_STRUCTURE_CHARACTERS

HEAD = "drill 1\nprogram A\npart p { up +Z  normals into }\n"
TABLE = """holes skin from "holes.csv" { units mm  columns { id ID x X y Y z Z i I j J k K } }
region r { posture x toward +X  select skin }
"""
CSV = "ID,X,Y,Z,I,J,K\nF1,5,0,0,0,0,-1\nF2,6.5,0,0,0,0,-1\n"


def said(bench: Bench, *arguments: str) -> str:
    """What is said of spec.drill in this folder, without the count behind it."""
    text = bench.refused(*arguments)
    assert text.endswith("; nothing was written\n")
    return text[: text.rindex("\n", 0, -1) + 1]


# ── bytes ────────────────────────────────────────────────────────────────────────────────────────


def test_a_spec_in_latin_1(bench: Bench) -> None:
    bench.write({"spec.drill": "drill 1\nprogram A  # für später\n".encode("latin-1")})
    assert said(bench) == (
        "spec.drill:2:15: error E123: byte 0xFC is not UTF-8\n"
        "  2 | program A  # f\N{REPLACEMENT CHARACTER}r sp\N{REPLACEMENT CHARACTER}ter\n"
        "    |               ^\n"
        "  hint: save it as UTF-8 (a spreadsheet calls it “CSV UTF-8”)\n"
    )


def test_a_table_in_windows_1252(bench: Bench) -> None:
    bench.write(
        {"spec.drill": HEAD + TABLE, "holes.csv": "ID,Größe\r\nF1,5\r\nF2,6 €\r\n".encode("cp1252")}
    )
    assert said(bench) == (
        "holes.csv:1:6: error E123: byte 0xF6 is not UTF-8\n"
        "  1 | ID,Gr\N{REPLACEMENT CHARACTER}\N{REPLACEMENT CHARACTER}e\n"
        "    |      ^\n"
        "  spec.drill:4:17: read because of this\n"
        f"  4 | {TABLE.splitlines()[0]}\n"
        "    |                 ^^^^^^^^^^^\n"
        "  hint: save it as UTF-8 (a spreadsheet calls it “CSV UTF-8”)\n"
    )


@pytest.mark.parametrize("lead", ["", "\ufeff"], ids=["plain", "after a byte-order mark"])
def test_the_place_of_a_bad_byte_behind_letters_of_many_bytes(bench: Bench, lead: str) -> None:
    text = (lead + "ID,é€\r\nF1,ü").encode() + b"\xff,1\r\n"
    bench.write({"spec.drill": HEAD + TABLE, "holes.csv": text})
    assert said(bench).startswith("holes.csv:2:5: error E123: byte 0xFF is not UTF-8\n")


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_utf_16_is_named(bench: Bench, encoding: str) -> None:
    mark = "\ufeff".encode(encoding)
    bench.write({"spec.drill": HEAD + TABLE, "holes.csv": mark + CSV.encode(encoding)})
    text = said(bench)
    assert "error E123: byte 0xF" in text
    assert "hint: it is UTF-16; save it as UTF-8" in text


def test_a_zero_byte(bench: Bench) -> None:
    bench.write({"spec.drill": HEAD.encode() + b"region r {\n  \x00 }\n"})
    assert said(bench) == (
        "spec.drill:5:3: error E123: a zero byte: this is no text file\n"
        "  5 |   \N{REPLACEMENT CHARACTER} }\n"
        "    |   ^\n"
    )


@pytest.mark.parametrize(
    ("before", "after"),
    [("\n", "\r\n"), ("\n", "\r"), ("", "\ufeff")],
    ids=["CRLF", "CR", "byte-order mark"],
)
def test_line_ends_and_byte_order_marks_change_no_byte_of_the_programs(
    bench: Bench, before: str, after: str
) -> None:
    table = 'holes skin from "holes.csv" {'
    texts = {
        "spec.drill": FINE.replace("region r", TABLE.splitlines()[0] + "\nregion r").replace(
            "emit krl", TABLE.splitlines()[1].replace("region r", "region s") + "\nemit krl"
        ),
        "holes.csv": CSV,
        "tool.cell": TOOL,
    }
    assert table in texts["spec.drill"]

    def written(name: str, change: bool) -> dict[str, bytes]:
        for file, text in texts.items():
            changed = text.replace(before, after) if before else after + text
            (bench.folder / file).write_bytes((changed if change else text).encode())
        ran = bench.run("compile", "spec.drill", "-o", name)
        assert ran.code == 0
        assert "warning" not in ran.err
        files = files_of(bench.folder / name)
        assert len(files) > 3
        del files["manifest.json"]  # it holds the hashes of what was read
        return files

    assert written("one", change=False) == written("two", change=True)


def test_control_characters_reach_no_terminal(bench: Bench) -> None:
    red = "\x1b[31m"
    bench.write(
        {
            "spec.drill": f'{HEAD}holes skin from "holes.csv" {{ units mm  columns {{ id "{red}ID" '
            f"x X y Y z Z i I j J k K }} }}\nregion r {{ posture x toward +X  select skin where "
            f'id < "{red}" }}\nuse "{red}.cell"\n',
            "holes.csv": f"ID,X,Y,Z,I,J,K,{red}\n{red}F1,5,0,0,0,0,1,\n",
        }
    )
    text = bench.refused()
    assert "\x1b" not in text
    assert "E124" in text
    bench.write({"spec.drill": f"{HEAD}region r {{ {red} }}\n"})
    text = said(bench)
    assert "\x1b" not in text
    assert "E110: a character that the language does not know: U+001B" in text


# ── links and folders ────────────────────────────────────────────────────────────────────────────


def test_a_link_out_of_the_root(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "secret.csv").write_text(CSV)
    (bench.folder / "holes.csv").symlink_to(tmp_path / "secret.csv")
    bench.write({"spec.drill": HEAD + TABLE})
    text = said(bench)
    assert text.startswith(
        'spec.drill:4:17: error E125: "holes.csv" leads through a link out of the spec\'s folder\n'
    )
    assert "--root DIR" in text
    ran = bench.run("check", "spec.drill", "--root", "..")
    assert (ran.code, ran.err) == (0, "")


def test_a_linked_folder_out_of_the_root(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "cells").mkdir()
    (tmp_path / "cells" / "robot.cell").write_text("drill 1\n")
    (bench.folder / "cells").symlink_to(tmp_path / "cells", target_is_directory=True)
    bench.write({"spec.drill": HEAD + 'use "cells/robot.cell"\n'})
    assert "error E125: " in said(bench)


def test_a_link_inside_the_root(bench: Bench) -> None:
    bench.write({"spec.drill": HEAD + TABLE, "tables/real.csv": CSV})
    (bench.folder / "holes.csv").symlink_to("tables/real.csv")
    assert bench.run("check", "spec.drill").code == 0


def test_a_loop_of_links(bench: Bench) -> None:
    bench.write({"spec.drill": HEAD + TABLE})
    (bench.folder / "holes.csv").symlink_to("other.csv")
    (bench.folder / "other.csv").symlink_to("holes.csv")
    assert "error E121: " in said(bench)


def test_a_path_up_and_down_again_is_inside(bench: Bench) -> None:
    bench.write({"spec.drill": HEAD + TABLE.replace("holes.csv", "a/../holes.csv")})
    bench.write({"holes.csv": CSV, "a/x": ""})
    assert bench.run("check", "spec.drill").code == 0


def test_a_cell_names_paths_from_where_it_lies(bench: Bench) -> None:
    """A cell in a folder may use its neighbour, and what is above it inside the root; no more."""
    bench.write(
        {
            "spec.drill": FINE.replace("tool.cell", "c/a.cell"),
            "c/a.cell": 'drill 1\nuse "b.cell"\nuse "../top.cell"\n',
            "c/b.cell": TOOL,
            "top.cell": "drill 1\n",
        }
    )
    assert bench.run("check", "spec.drill").code == 0
    bench.write({"c/a.cell": 'drill 1\nuse "b.cell"\nuse "../../top.cell"\n'})
    assert said(bench).startswith("c/a.cell:3:5: error E125: ")


def test_a_root_that_is_no_folder(bench: Bench) -> None:
    bench.write({"spec.drill": FINE})
    assert said(bench, "--root", "nowhere").startswith(
        "error E121: the root nowhere is not a folder\n"
    )


def test_no_such_spec(bench: Bench) -> None:
    bench.write({"specs.drill": FINE})
    assert said(bench) == (
        'error E120: there is no file spec.drill\n  hint: did you mean "specs.drill"?\n'
    )


def test_a_spec_that_is_a_folder_or_a_pipe(bench: Bench) -> None:
    (bench.folder / "spec.drill").mkdir()
    assert said(bench).startswith("error E121: spec.drill is a folder\n")
    (bench.folder / "spec.drill").rmdir()
    os.mkfifo(bench.folder / "spec.drill")
    assert said(bench).startswith("error E121: spec.drill is no regular file\n")


def test_a_file_that_may_not_be_read(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    def denied(path: Path) -> bytes:
        raise PermissionError(13, "Permission denied", str(path))

    bench.write({"spec.drill": FINE})
    monkeypatch.setattr(Path, "read_bytes", denied)
    ran = bench.run("check", "spec.drill")
    assert ran.code == 1
    assert ran.err.startswith("error E121: spec.drill cannot be read: Permission denied\n")


# ── sizes ────────────────────────────────────────────────────────────────────────────────────────


def test_a_spec_beyond_its_bytes(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loading, "SPEC_LIMIT", Limit("MAX_SPEC_BYTES", 1000))
    bench.write({"spec.drill": FINE + "#" * 1000, "tool.cell": TOOL})
    size = (bench.folder / "spec.drill").stat().st_size
    assert said(bench) == (
        f"error E122: spec.drill has {size:,} bytes; the limit (MAX_SPEC_BYTES) is 1,000\n"
    )


def test_a_huge_file_is_refused_unread(bench: Bench) -> None:
    bench.write({"spec.drill": HEAD + TABLE})
    with (bench.folder / "holes.csv").open("wb") as file:
        file.truncate(loading.TABLE_LIMIT.size + 1)  # a hole in the disk, not five gigabytes
    text = said(bench)
    assert text.startswith("spec.drill:4:17: error E122: holes.csv has 4,294,967,297 bytes;")
    assert "(MAX_TABLE_BYTES)" in text


MESH = HEAD + 'fixture jig { mesh "jig.stl" mm }\n' + FINE.splitlines()[4] + "\n"
FACET = "facet normal 0 0 1\nouter loop\nvertex {0} 0 0\nvertex {1} 0 0\nvertex {0} 1 0\n"


def test_a_huge_mesh_is_refused_unread(bench: Bench) -> None:
    bench.write({"spec.drill": MESH})
    with (bench.folder / "jig.stl").open("wb") as file:
        file.truncate(loading.MESH_LIMIT.size + 1)
    assert said(bench) == (
        "spec.drill:4:20: error E122: jig.stl has 268,435,457 bytes; the limit (MAX_MESH_BYTES) is "
        "268,435,456\n"
        '  4 | fixture jig { mesh "jig.stl" mm }\n'
        "    |                    ^^^^^^^^^\n"
    )


def test_a_mesh_of_too_many_triangles(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mesh_files, "MAX_MESH_TRIANGLES", 1999)
    facets = "".join(FACET.format(i, i + 1) + "endloop\nendfacet\n" for i in range(2000))
    bench.write({"spec.drill": MESH, "jig.stl": f"solid jig\n{facets}endsolid jig\n"})
    assert said(bench) == (
        'spec.drill:4:20: error E133: "jig.stl" has 2,000 triangles; the limit '
        "(MAX_MESH_TRIANGLES) is 1,999\n"
        '  4 | fixture jig { mesh "jig.stl" mm }\n'
        "    |                    ^^^^^^^^^\n"
        "  hint: export it more coarsely; 0.1 mm of deviation is plenty\n"
    )


def test_a_mesh_that_claims_more_than_it_has(bench: Bench) -> None:
    """Four billion triangles in a hundred bytes."""
    bench.write({"spec.drill": MESH, "jig.stl": bytes(80) + b"\xff\xff\xff\xff" + bytes(50)})
    text = said(bench)
    assert text.startswith('spec.drill:4:20: error E131: "jig.stl" cannot be used: its length ')


def test_an_archive_that_unpacks_to_much_more(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("3D/3dmodel.model", b"<model>" + b" " * 20_000_000)
    assert len(packed.getvalue()) < 50_000
    monkeypatch.setattr(threemf, "MOST_XML_BYTES", 10_000_000)
    spec = MESH.replace("jig.stl", "jig.3mf")
    bench.write({"spec.drill": spec, "jig.3mf": packed.getvalue()})
    text = said(bench)
    assert text.startswith('spec.drill:4:20: error E131: "jig.3mf" cannot be used: ')
    assert "10,000,000" in text


def test_too_much_structure(bench: Bench) -> None:
    line = "process unused { approach 5 mm  retract 5 mm }\n"
    bench.write({"spec.drill": FINE + line * (MAX_STRUCTURE_CHARACTERS // len(line) + 1)})
    text = said(bench)
    assert text.startswith("spec.drill:1:1: error E102: the file has ")
    assert f"(MAX_STRUCTURE_CHARACTERS) is {MAX_STRUCTURE_CHARACTERS:,}" in text


def test_many_points_are_no_structure(bench: Bench) -> None:
    points = "".join(f"P{i} ({i}, 2, 3) normal (0, 0, -1) # }}\n" for i in range(15_000))
    spec = FINE.replace("P1 (1, 2, 3) normal (0, 0, -1)", points)
    bench.write({"spec.drill": spec, "tool.cell": TOOL})
    assert len(points) > MAX_STRUCTURE_CHARACTERS
    assert bench.run("check", "spec.drill").code == 0


@pytest.mark.parametrize("bracket", ["(", "{"])
def test_deep_nesting(bench: Bench, bracket: str) -> None:
    bench.write({"spec.drill": f"{HEAD}region r {{ select t where {bracket * 100_000}"})
    text = said(bench)
    assert text.startswith(
        f"spec.drill:4:{26 + MAX_NESTING}: error E103: brackets are nested 33 deep"
    )
    assert f"(MAX_NESTING) is {MAX_NESTING}" in text


def test_the_deepest_nesting_that_is_allowed(bench: Bench) -> None:
    deep = MAX_NESTING - 1  # the region's own brace counts
    condition = "not " * 50_001 + "(" * deep + 'id == "F1"' + ")" * deep
    spec = HEAD + TABLE.replace("select skin", f"select skin where {condition}")
    spec += 'region s { posture x toward +X select skin where id == "F1" }\n'
    bench.write({"spec.drill": spec, "holes.csv": CSV})
    ran = bench.run("check", "spec.drill")
    assert (ran.code, ran.err) == (0, "")


def test_a_long_chain_of_or(bench: Bench) -> None:
    chain = " or ".join(f'id == "F{i}"' for i in range(5000))
    spec = f"{HEAD}{TABLE.replace('select skin', f'select skin where {chain}')}"
    bench.write({"spec.drill": spec, "holes.csv": CSV})
    assert bench.run("check", "spec.drill").code == 0


def test_a_long_chain_of_regions(bench: Bench) -> None:
    """Each region takes some of what the one before it takes: two thousand deep, and no more than
    a mistake in the spec."""
    chain = ["region q0 { posture x toward +X  select skin where x > 0 mm }"]
    chain += [
        f"region q{i} {{ posture x toward +X  select skin in q{i - 1} where x > {i / 1000} mm }}"
        for i in range(1, 2000)
    ]
    bench.write({"holes.csv": CSV})
    bench.write({"spec.drill": "\n".join([HEAD + TABLE.splitlines()[0], *chain])})
    assert set(re.findall(r"error (\w+)", said(bench))) == {"E333"}


def test_deep_use(bench: Bench) -> None:
    bench.write({"spec.drill": HEAD + 'use "c0.cell"\n'})
    for i in range(MAX_USE_DEPTH + 5):
        bench.write({f"c{i}.cell": f'drill 1\nuse "c{i + 1}.cell"\n'})
    text = said(bench)
    assert "error E127: `use` is nested 17 deep; the limit (MAX_USE_DEPTH) is 16" in text
    assert text.startswith(f"c{MAX_USE_DEPTH - 1}.cell:2:5: ")


def test_use_of_the_same_file_from_two_sides_is_no_cycle(bench: Bench) -> None:
    bench.write(
        {
            "spec.drill": FINE.replace('use "tool', 'use "a.cell"\nuse "b.cell"\nuse "tool'),
            "a.cell": 'drill 1\nuse "tool.cell"\n',
            "b.cell": 'drill 1\nuse "tool.cell"\n',
            "tool.cell": TOOL,
        }
    )
    ran = bench.run("check", "spec.drill")
    assert ran.code == 0, ran.err


def test_a_cell_with_a_mistake_is_told_once(bench: Bench) -> None:
    bench.write({"spec.drill": HEAD + 'use "a.cell"\nuse "a.cell"\n', "a.cell": "drill 1\ntoll\n"})
    assert said(bench).count("error") == 1


def test_no_more_syntax_errors_than_one_reads(bench: Bench) -> None:
    bench.write({"spec.drill": HEAD + "tool t { nmber 1 }\n" * 50})
    text = bench.refused()
    assert text.count("error E101") == parser.MAX_SYNTAX_ERRORS


def test_an_endless_cell_of_a_table(bench: Bench) -> None:
    bench.write({"spec.drill": HEAD + TABLE, "holes.csv": CSV + '"' + "F" * 200_000})
    text = said(bench)
    assert text.startswith("holes.csv:4:1: error E312: this row cannot be read: field larger than")


def test_one_endless_id_does_not_widen_every_row(bench: Bench) -> None:
    rows = "".join(f"F{i},{i},0,0,0,0,-1\n" for i in range(20_000))
    bench.write({"spec.drill": HEAD + TABLE, "holes.csv": CSV.splitlines()[0] + "\n" + rows})
    with (bench.folder / "holes.csv").open("a") as file:
        file.write("F" * 100_000 + ",-5,0,0,0,0,-1\n")
    assert "error E323: this hole's id is too long; the limit (MAX_ID_LENGTH)" in said(bench)


def test_digits_without_end(bench: Bench) -> None:
    bench.write({"spec.drill": FINE, "tool.cell": TOOL.replace("r 1 ", f"r {'0' * 6000}1 ")})
    assert bench.run("check", "spec.drill").code == 0
    bench.write({"tool.cell": TOOL.replace("number 1", "number " + "9" * 6000)})
    assert "the tool's number is 99999999999999999999…; it must be" in said(bench)
    bench.write({"tool.cell": TOOL.replace("(0, 0, 100)", f"(0, 0, {'9' * 6000})")})
    assert "error E205: tcp's z is 99999999999999999999… mm" in said(bench)
