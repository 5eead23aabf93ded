"""No text of a spec reaches a program as anything but a name or a comment.

Whatever has a line break, a quote or a comment's end in it is refused, or comes out without it. Ids
from a CSV matter most: they are other people's data, and a cell may hold any character.
"""

from __future__ import annotations

import csv
import io
import re
from pathlib import Path

import pytest
from drillc.cli import EXIT_ERRORS, EXIT_FINE
from fuzz.judging import assert_complete, run_cli, snapshot
from hypothesis import given, settings
from hypothesis import strategies as st

PAYLOAD = "PWNED"
#: What ends a line, a comment, a text, or begins something in KRL, RAPID, G-code, XML or Jinja.
BREAKERS = (
    "\n", "\r", "\r\n", "\v", "\f", "\x1c", "\x85", "\u2028", "\u2029", "\0", "\x01", "\x02",
    "\t", ";", "!", ")", "(", '"', "'", "`", "\\", "%", "%s", "%n", "%%", "{{ 1 }}", "{% raw %}",
    "{#", "}}", "<", ">", "&", "]]>", "-->", "|", "$", "#", "*", "?", "=", ",", "\x1b[2J",
    "\u202e", "é", "\ufeff", "\x01Slot0\x02", "\x01Body0\x02", "[", "]", "{", "}", "@", "^", "~",
    "\x7f", "\xa0", "\u200b",
)  # fmt: skip

POSES = """\
drill 1
program {program}
part p {{ up +Z normals into frame 1 at (1, 2, 3) mm }}
tool {tool} {{ number 1 tcp (0, 0, 100) mm mass 1 kg cog (0, 0, 1) mm }}
io {{ clamp output 1 as "{alias}" clamped input 2 }}
process {process} {{ approach 9 mm retract 9 mm clamp timeout 1 s }}
holes t from "{file}" {{ units mm columns {{ id "{title}" x X y Y z Z i I j J k K }} }}
region {region} {{ select t where id like "*" process {process} posture x horizontal }}
region inline {{ posture x horizontal points mm {{ {hole} (1, 2, 3) normal (0, 1, 0) }} }}
emit krl
emit rapid {{ tooldata {setting} wobjdata "{text}" }}
"""
JOINTS = """\
drill 1
program {program}
part p {{ normals outward }}
robot {tool} portal {{ D 10 m H 5 m d 0.75 m height widest_margin side below
  limits {{ q3 -180 deg .. 180 deg q5 -9 m .. 9 m }} }}
io {{ clamp output 1 as "{alias}" clamped input 2 }}
process {process} {{ approach 9 mm retract 9 mm clamp timeout 1 s }}
holes t from "{file}" {{ units mm columns {{ id "{title}" x X y Y z Z i I j J k K }} }}
region {region} {{ select t where id like "*" process {process} }}
region inline {{ points mm {{ {hole} (5000, 100, 3) normal (0, 0, 1) }} }}
emit gcode {{ axes {{ q1 U q2 V q3 A q4 X q5 Y q6 Z }} }}
"""
ARM = """\
drill 1
program {program}
part p {{ up +Z normals outward frame 1 }}
tool {tool} {{ number 1 tcp (0, 0, 200) mm body {{ mesh "{mesh}" mm }} }}
robot {robot} arm {{
  model kuka_kr210_r3100_2
  station {station} at (4000, 1500, -1500) mm rotate z -90 deg
  home {{ A1 0 deg A2 -90 deg A3 90 deg A4 0 deg A5 30 deg A6 0 deg }}
}}
process {process} {{ approach 9 mm retract 9 mm }}
holes t from "{file}" {{ units mm columns {{ id "{title}" x X y Y z Z i I j J k K }} }}
region {region} {{ station {station} posture x horizontal process {process} select t }}
emit krl
"""
#: A closed mesh whose parts have names.
MESH = (
    f"mtllib {PAYLOAD}.mtl\no {PAYLOAD}\nv 0 0 0\nv 9 0 0\nv 0 9 0\nv 0 0 9\n"
    f"g {PAYLOAD}\nusemtl {PAYLOAD}\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
)
PLACES = {
    "program": "PROG", "tool": "ee", "alias": "doClamp", "process": "touch", "file": "t.csv",
    "title": "ID", "region": "reg", "hole": "P1", "setting": "tTool", "text": "wPart",
    "robot": "kr", "station": "left", "mesh": "body.obj",
}  # fmt: skip


def compiled(
    folder: Path,
    template: str,
    places: dict[str, str],
    ids: list[str],
    must_compile: bool = False,
) -> dict[str, bytes] | None:
    """The output of a spec, None where it is refused. Nothing else may happen."""
    folder.mkdir(parents=True, exist_ok=True)
    table = io.StringIO()
    writer = csv.writer(table)
    writer.writerow([places["title"], *"XYZIJK"])
    writer.writerows([name, 4000 + row, 0, 0, 0, 0.6, 0.8] for row, name in enumerate(ids))
    for place, text in (("file", table.getvalue()), ("mesh", MESH)):
        try:
            (folder / places[place]).write_text(text, "utf-8", "surrogatepass", "")
        except (OSError, ValueError):
            (folder / PLACES[place]).write_text(text, "utf-8", "surrogatepass", "")
    spec = folder / "spec.drill"
    spec.write_text(template.format(**places), "utf-8", "surrogatepass", "")
    out = folder / "out"
    code, said = run_cli(["compile", str(spec), "-o", str(out)])
    if code == EXIT_ERRORS:
        assert not out.exists()
        assert not must_compile, said.errors
        return None
    assert code == EXIT_FINE, said.errors
    assert_complete(out)
    return snapshot(out)


#: Files that name the spec's own files, as data.
NO_PROGRAMS = ("manifest.json", *(f"source-map/{x}.csv" for x in ("holes", "lines", "regions")))


@pytest.mark.parametrize("template", [POSES, JOINTS, ARM], ids=["poses", "joints", "arm"])
def test_the_specs_compile_when_nothing_is_wrong_with_them(template: str, tmp_path: Path) -> None:
    assert compiled(tmp_path, template, PLACES, ["A1", "A2"], must_compile=True)


#: What stands in a spec for an arm only.
ARMS_PLACES = ("robot", "station", "mesh")
TRIED = [
    *((POSES, place) for place in [*PLACES, "id"] if place not in ARMS_PLACES),
    *((JOINTS, place) for place in [*PLACES, "id"] if f"{{{place}}}" in JOINTS or place == "id"),
    *((ARM, place) for place in ARMS_PLACES),
]
_CALLED = {POSES: "poses", JOINTS: "joints", ARM: "arm"}


@pytest.mark.parametrize(
    ("template", "place"), TRIED, ids=[f"{_CALLED[text]}-{place}" for text, place in TRIED]
)
def test_nothing_breaks_out_of_a_name(template: str, place: str, tmp_path: Path) -> None:
    for number, breaker in enumerate(BREAKERS):
        evil = f"A{breaker}{PAYLOAD}" + (".obj" if place == "mesh" else "")
        places = PLACES if place == "id" else {**PLACES, place: evil}
        ids = ["A1", evil if place == "id" else "A2"]
        files = compiled(tmp_path / str(number), template, places, ids)
        for name, data in (files or {}).items():
            raw = evil.encode("utf-8", "surrogatepass")
            assert raw not in data or name in NO_PROGRAMS, f"{breaker!r} in {name}"
            for line in re.split(rb"[\r\n]+", data):
                assert not line.lstrip().startswith(PAYLOAD.encode()), f"{breaker!r} in {name}"


@settings(max_examples=150)
@given(ids=st.lists(st.text(min_size=1, max_size=20), min_size=1, max_size=3))
def test_any_text_as_an_id_in_a_table(
    ids: list[str], tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Ids of every character there is: refused, unless they are what the language takes as ids."""
    folder = tmp_path_factory.mktemp("ids")
    files = compiled(folder, POSES, PLACES, ids)
    if files is not None:
        for name in ids:
            assert re.fullmatch(r"[A-Za-z0-9_][A-Za-z0-9_.:/-]*", name.strip())


ID = st.from_regex(r"[A-Za-z0-9_][A-Za-z0-9_.:/-]{0,40}", fullmatch=True)
NAME = st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,40}", fullmatch=True)
#: A line of program without its comment.
CODE = {
    "krl": re.compile(rb"^(?P<code>[^;]*)"),
    "rapid": re.compile(rb"^(?P<code>[^!]*)"),
    "gcode": re.compile(rb"^(?P<code>[^(]*)"),
}
PLAIN = re.compile(rb"[\x20-\x7e]*")


@settings(max_examples=60)
@given(template=st.sampled_from((POSES, JOINTS)), data=st.data())
def test_every_legal_name_leaves_the_program_as_it_is(
    template: str, data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """With other names, each file has the same lines: only words in them differ."""
    folder = tmp_path_factory.mktemp("names")
    plain = compiled(folder / "plain", template, PLACES, ["A1", "A2"])
    assert plain is not None
    named = [name for name in ("program", "tool", "process", "region") if data.draw(st.booleans())]
    places = {**PLACES, **{name: data.draw(NAME) for name in named}, "hole": data.draw(ID)}
    files = compiled(folder / "other", template, places, [data.draw(ID), data.draw(ID)])
    if files is None:  # two names that the controller cannot tell apart, or one of its own words
        return
    for (name, lines), (other, others) in zip(
        _programs(plain).items(), _programs(files).items(), strict=True
    ):
        assert name.partition("/")[0] == other.partition("/")[0]
        assert len(lines) == len(others), f"{name} and {other}"
        for line, one in zip(lines, others, strict=True):
            assert PLAIN.fullmatch(one), one
            assert _shape(name, line) == _shape(name, one)


def _programs(files: dict[str, bytes]) -> dict[str, list[bytes]]:
    """The lines of every program file, in an order that does not depend on its name."""
    programs = {
        name: data.splitlines()
        for name, data in files.items()
        if name not in NO_PROGRAMS and not name.endswith("names.csv")
    }
    return dict(
        sorted(programs.items(), key=lambda item: (item[0].partition("/")[0], item[0][-4:]))
    )


def _shape(name: str, line: bytes) -> bytes:
    """The signs of a line's code: its words and numbers taken out."""
    code = CODE[name.partition("/")[0]].match(line)
    assert code is not None
    return re.sub(rb"\"[^\"]*\"|[A-Za-z0-9_$.]+", b"w", code["code"]).strip()
