"""Damage to a spec and its files: small mutators, each a function of a tree and a random source.

A `Tree` is what lies on disk: files by path, and things that are no files. A case is a number; the
same number always gives the same tree and the same command (`case_of`).
"""

from __future__ import annotations

import posixpath
import random
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

HERE = Path(__file__).parent
SAMPLES = HERE.parents[1] / "samples"
#: A tree never grows beyond this: the fuzzer looks for wrong answers, benchmarks for slow ones.
MAX_BYTES = 400_000
#: Samples with more bytes than this are left out: parsing them 20,000 times teaches nothing new.
MAX_SEED_BYTES = 60_000


@dataclass
class Tree:
    """The files of one case. `others` are paths at which a link, folder or pipe stands."""

    spec: str
    files: dict[str, bytes]
    others: dict[str, str] = field(default_factory=dict)
    done: list[str] = field(default_factory=list)

    def text(self, name: str) -> str:
        return self.files[name].decode("utf-8", "surrogateescape")

    def put(self, name: str, text: str) -> None:
        """Write a file; lone surrogates go out as the bytes that no UTF-8 reader takes."""
        try:
            self.files[name] = text.encode("utf-8", "surrogateescape")
        except UnicodeEncodeError:
            self.files[name] = text.encode("utf-8", "surrogatepass")


@dataclass(frozen=True)
class Case:
    """One case: what lies on disk, and the command line (with `{spec}` and `{out}` to fill in)."""

    seed: int
    tree: Tree
    command: tuple[str, ...]

    def __str__(self) -> str:
        return f"seed {self.seed}: {' '.join(self.command)} [{self.tree.spec}: {self.tree.done}]"


Mutator = Callable[[Tree, random.Random], None]


def case_of(seed: int) -> Case:
    """The case with this number."""
    rng = random.Random(f"drillc {seed}")
    base = rng.choice(seeds())
    tree = Tree(base.spec, dict(base.files))
    if rng.random() < 0.5:
        tree.put(base.spec, _EXPECT.sub("", tree.text(base.spec)))
    for _ in range(rng.choice((1, 1, 1, 2, 2, 3, 5))):
        mutator = rng.choices(tuple(MUTATORS), tuple(MUTATORS.values()))[0]
        before = dict(tree.files)
        mutator(tree, rng)
        if sum(map(len, tree.files.values())) > MAX_BYTES:
            tree.files = before
        else:
            tree.done.append(mutator.__name__)
    return Case(seed, tree, _command(rng))


def _command(rng: random.Random) -> tuple[str, ...]:
    kind = rng.random()
    if kind < 0.04:
        return ("check", "{spec}")
    if kind < 0.10:
        return ("inspect", "{spec}", "--format", rng.choice(("table", "csv", "json")))
    extra: tuple[str, ...] = ()
    if rng.random() < 0.1:
        extra += ("--json",)
    if rng.random() < 0.1:
        extra += ("--post", rng.choice(("krl", "rapid", "gcode", "none such", "")))
    return ("compile", "{spec}", "-o", "{out}", *extra)


@cache
def seeds() -> tuple[Tree, ...]:
    """What is damaged: the samples, and the dense specs of `corpus` (twice as often)."""
    trees = []
    for folder, times in ((SAMPLES, 1), (HERE / "corpus", 2)):
        files = {
            str(path.relative_to(folder).as_posix()): path.read_bytes()
            for path in sorted(folder.rglob("*"))
            if path.is_file() and path.suffix in {".drill", ".cell", ".csv", ".obj"}
        }
        specs = [name for name in files if name.endswith(".drill")]
        shared = {name: data for name, data in files.items() if name not in specs}
        for spec in specs:
            used = _used(spec, {**shared, spec: files[spec]})
            if sum(map(len, used.values())) <= MAX_SEED_BYTES:
                trees += [Tree(spec, used)] * times
    return tuple(trees)


def _used(name: str, files: Mapping[str, bytes]) -> dict[str, bytes]:
    """The files that a spec reaches through its quoted names."""
    found: dict[str, bytes] = {}
    waiting = [name]
    while waiting:
        name = waiting.pop()
        if name in files and name not in found:
            found[name] = files[name]
            folder = name.rpartition("/")[0]
            for quoted in re.findall(rb'"([^"\n]+)"', files[name]):
                written = quoted.decode()
                waiting.append(posixpath.normpath(posixpath.join(folder, written)))
    return found


# ── tokens and lines ─────────────────────────────────────────────────────────────────────────────

_TOKEN = re.compile(r'"[^"\n]*"|#[^\n]*|[^\W\d]\w*|[+-]?\d[\d.]*(?:[eE][+-]?\d+)?|\s+|.', re.DOTALL)
_NUMBER = re.compile(r"(?<![\w.])[+-]?(?:\d+(?:\.(?!\.)\d*)?|\.\d+)(?:[eE][+-]?\d+)?")
_UNIT = re.compile(
    r"(?<=[\d)}] )(?:mm/rev|mm/min|mm/s|m/min|m/s|deg/s|mm|um|cm|m|inch|rpm|deg|rad)\b"
)
_WORD = re.compile(r"[A-Za-z_]\w*")
_STRING = re.compile(r'"[^"\n]*"')
_EXPECT = re.compile(r"^expect [^\n]*\n", re.MULTILINE)
_QUANTITY = re.compile(
    r"[+-]?(?:\d+(?:\.(?!\.)\d*)?|\.\d+)(?= (?:mm|um|m|deg|rpm|s|ms|N|kN|kg|rad|%)\b)"
)


def _some_file(tree: Tree, rng: random.Random, suffixes: str = "drill cell csv obj") -> str:
    """A file to damage: the spec itself half of the time."""
    names = [name for name in tree.files if name.rpartition(".")[2] in suffixes.split()]
    if not names:
        names = list(tree.files) or [tree.spec]
        tree.files.setdefault(names[0], b"")
    return tree.spec if tree.spec in names and rng.random() < 0.5 else rng.choice(names)


def _tokens(tree: Tree, name: str) -> list[str]:
    return _TOKEN.findall(tree.text(name))


def _replace(
    tree: Tree,
    rng: random.Random,
    pattern: re.Pattern[str],
    new: Callable[[str], str],
    suffixes: str,
) -> None:
    """Replace one match of `pattern`, or now and then each with a small chance."""
    name = _some_file(tree, rng, suffixes)
    text = tree.text(name)
    found = list(pattern.finditer(text))
    if not found:
        return
    chosen = rng.sample(found, min(len(found), rng.choice((1, 1, 1, 2, 4))))
    for match in sorted(chosen, key=lambda m: -m.start()):
        text = text[: match.start()] + new(match[0]) + text[match.end() :]
    tree.put(name, text)


def delete_tokens(tree: Tree, rng: random.Random) -> None:
    name = _some_file(tree, rng)
    tokens = _tokens(tree, name)
    if tokens:
        at = rng.randrange(len(tokens))
        del tokens[at : at + rng.choice((1, 1, 2, 3, 8))]
        tree.put(name, "".join(tokens))


def duplicate_token(tree: Tree, rng: random.Random) -> None:
    name = _some_file(tree, rng)
    tokens = _tokens(tree, name)
    if tokens:
        at = rng.randrange(len(tokens))
        tokens[at] = (tokens[at] + rng.choice(("", " "))) * rng.choice((2, 2, 3, 50))
        tree.put(name, "".join(tokens))


def swap_tokens(tree: Tree, rng: random.Random) -> None:
    name = _some_file(tree, rng)
    tokens = _tokens(tree, name)
    solid = [i for i, token in enumerate(tokens) if not token.isspace()]
    if len(solid) > 1:
        if rng.random() < 0.5:
            at = rng.randrange(len(solid) - 1)
            one, two = solid[at], solid[at + 1]
        else:
            one, two = rng.sample(solid, 2)
        tokens[one], tokens[two] = tokens[two], tokens[one]
        tree.put(name, "".join(tokens))


def graft_tokens(tree: Tree, rng: random.Random) -> None:
    """Tokens from elsewhere, put in or put in the place of others."""
    name, other = _some_file(tree, rng), _some_file(rng.choice(seeds()), rng)
    tokens = _tokens(tree, name)
    donor = rng.choice(seeds())
    grafts = _tokens(donor, other) if other in donor.files else tokens
    if tokens and grafts:
        at, start = rng.randrange(len(tokens)), rng.randrange(len(grafts))
        gone = rng.choice((0, 1, 1))
        tokens[at : at + gone] = grafts[start : start + rng.choice((1, 1, 3, 20, 100))]
        tree.put(name, "".join(tokens))


def damage_lines(tree: Tree, rng: random.Random) -> None:
    name = _some_file(tree, rng)
    lines = tree.text(name).splitlines(keepends=True)
    if not lines:
        return
    at, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    match rng.randrange(4):
        case 0:
            del lines[at]
        case 1:
            lines.insert(other, lines[at])
        case 2:
            lines[at], lines[other] = lines[other], lines[at]
        case _:
            lines[at] = lines[at] * rng.choice((2, 3, 200))
    tree.put(name, "".join(lines))


# ── numbers, units, words ────────────────────────────────────────────────────────────────────────

NASTY_NUMBERS = """
    0 -0 -0.0 +0 0.0000001 -0.0004 -0.00000001 1 -1 1e308 -1e308 1.7976931348623157e308 1e309
    1e-320 5e-324 1e-400 nan NaN -nan inf -inf Infinity 1e999999999 1e-999999999 -1e999999999
    1e99999999999999999999 0e99999999999999999999 1,5 1.5.5 1..2 .5 5. . 0x10 1_000 1e 1e+ ++1
    --1 00012 9007199254740993 999999 1000000 1000000.0000001 0.9999999999999999 360 180 90
    -90 1e6 1e9 1e-9 1e-3 0.0005 0.00049999 ١٢ ² ½ 1²
""".split()  # noqa: SIM905 (a table of words)
UNITS = """
    mm um cm m inch rad deg s ms min mm/s m/s mm/min m/min rpm mm/rev deg/s rad/s N kN kg %
""".split()  # noqa: SIM905 (a table of words)
#: Names that some controller, or drillc itself, could take amiss.
NASTY_NAMES = """
    nan inf None self hole region x X _ __class__ DEF END def M2 O100 o100 main PROC MODULE
    ENDMODULE visit Visit program krl HOLE POS E6POS robtarget tool0 wobj0 IN $IN A1 q1 e1
    com1 CON aux NUL manifest names drillc
""".split()  # noqa: SIM905 (a table of words)


def nasty_number(tree: Tree, rng: random.Random) -> None:
    def new(_: str) -> str:
        if rng.random() < 0.05:
            digits = "".join(rng.choices("0123456789", k=rng.choice((20, 400, 5000))))
            return rng.choice((digits, "0." + digits, "0" * 20 + digits, digits + "e-30"))
        return rng.choice(NASTY_NUMBERS)

    _replace(tree, rng, _NUMBER, new, "drill cell csv obj")


def other_number(tree: Tree, rng: random.Random) -> None:
    """A number of the kind that people write: most of these specs compile."""

    def new(old: str) -> str:
        match rng.randrange(4):
            case 0:
                return f"{rng.uniform(-3, 3):.{rng.randrange(7)}f}"
            case 1:
                return str(rng.randrange(0, 6000))
            case 2:
                try:
                    return repr(float(old) * rng.choice((0.1, 0.5, 0.999, 1.001, 2, 10, -1)))
                except (ValueError, OverflowError):
                    return "3"
            case _:
                return old + rng.choice(("0", "1", "5", "e1", "e-1"))

    _replace(tree, rng, _NUMBER, new, "drill cell csv obj")


def other_quantity(tree: Tree, rng: random.Random) -> None:
    """A number with a unit, larger or smaller: a spec that reaches the posts, with odd values."""

    def new(old: str) -> str:
        factor = rng.choice((0.001, 0.01, 0.1, 0.5, 0.9, 1.0001, 1.5, 3, 10, 100, 10_000, -1))
        if rng.random() < 0.2:
            return rng.choice(
                ("1e-7", "0.0004", "0.0005", "1e-12", "0.001", "99999", "1e6", "0.05")
            )
        return f"{float(old) * factor:.10g}"

    _replace(tree, rng, _QUANTITY, new, "drill cell")


#: Words that may stand in each other's place.
_FAMILIES = (
    ("kuka", "abb", "other"), ("A1", "A2", "A3", "A4", "A5", "A6"), ("left", "right", "jig"),
    ("box", "capsule", "cylinder", "mesh"), ("given", "shortest", "shortest within region"),
    ("deviation", "travel", "margin"), ("into", "outward", "from surface"),
    ("below", "above"), ("centre", "widest_margin", "least_travel"), ("into", "outward"),
    ("x", "y"), ("+X", "-X", "+Y", "-Y", "+Z", "-Z"), ("krl", "rapid", "gcode"),
    ("output", "input", "analog"), ("q1", "q2", "q3", "q4", "q5", "q6"),
    ("U", "V", "W", "X", "Y", "Z", "A", "B", "C", "E1", "A6", "eax_a"), ("and", "or"),
    ("<", "<=", ">", ">=", "==", "!="), ("spindle_running", "released", "clamp_force"),
    ("dwell 1 s", "peck 2 mm", "clamp timeout 1 s", "rivet timeout 1 s", "clearance 1 mm", ""),
    ("euler xyz", "euler zyx", "euler zyz"),
    ("drill48", "spot", "touch", "csk", "rivet5", "visit"),
)  # fmt: skip


def other_choice(tree: Tree, rng: random.Random) -> None:
    """A word exchanged for another of its family: mostly a spec that makes sense."""
    name = _some_file(tree, rng, "drill cell")
    text = tree.text(name)
    family = rng.choice(_FAMILIES)
    words = "|".join(rf"(?<![\w+-]){re.escape(word)}(?![\w])" for word in family if word)
    found = list(re.finditer(words, text))
    if found:
        match = rng.choice(found)
        tree.put(name, text[: match.start()] + rng.choice(family) + text[match.end() :])


def other_unit(tree: Tree, rng: random.Random) -> None:
    nonsense = ("", "mms", "MM", "feet", "°", "mm mm", "mm/", "mm / s", "grad")

    def new(_: str) -> str:
        return rng.choice(UNITS) if rng.random() < 0.8 else rng.choice(nonsense)

    _replace(tree, rng, _UNIT, new, "drill cell")


def other_word(tree: Tree, rng: random.Random) -> None:
    """A keyword or name: misspelt, exchanged for another, or for one that is hard to emit."""
    name = _some_file(tree, rng, "drill cell")
    words = _WORD.findall(tree.text(name)) or ["drill"]

    def new(old: str) -> str:
        match rng.randrange(5):
            case 0:
                at = rng.randrange(len(old))
                return (
                    old[:at]
                    + rng.choice(("", "x", old[at] * 2, old[at].swapcase()))
                    + old[at + 1 :]
                )
            case 1:
                return rng.choice(NASTY_NAMES)
            case 2:
                return old * rng.choice((2, 10, 40, 1000, 20_000))
            case _:
                return rng.choice(words)

    _replace(tree, rng, _WORD, new, "drill cell")


def rename_everywhere(tree: Tree, rng: random.Random) -> None:
    """One word exchanged wherever it stands, so that the spec still holds together."""
    words = sorted({w for n in tree.files for w in _WORD.findall(tree.text(n)) if len(w) > 1})
    if not words:
        return
    old = rng.choice(words)
    new = rng.choice(
        (rng.choice(NASTY_NAMES), old + "_" * 30, old * 9, rng.choice(words), old.upper())
    )
    for name in tree.files:
        tree.put(name, re.sub(rf"\b{old}\b", lambda _: new, tree.text(name)))


# ── characters and bytes ─────────────────────────────────────────────────────────────────────────

_STRANGE = (
    *"\0\x01\x02\x07\x08\x0b\x0c\x1a\x1b\x1c\x7f\x85\xa0!;%)(}{\"'`\\$\t\r\n,.-+/*#", "\r\n",
    "\n\n", "é", "α", "…", "\u2028", "\u2029", "\u202e", "\u200b", "\ufeff", "\ufffd",
    "\U0001f916", "\ud800", "\udcff", "\udcc3\udc28", "\udcff\udcfe", "\x1b[31m", "{{ 1 }}",
    "{% x %}", "{#", "%s", "%(a)s", "%d%n", "${x}", "\x01Slot0\x02", "\x01Body0\x02", "%%", ");",
    "; HALT", "!x",
)  # fmt: skip


def insert_strange(tree: Tree, rng: random.Random) -> None:
    name = _some_file(tree, rng)
    text = tree.text(name)
    strange = rng.choice(_STRANGE)
    where = [m.start() + 1 for m in _STRING.finditer(text)] if rng.random() < 0.3 else []
    at = rng.choice(where) if where else rng.randrange(len(text) + 1)
    tree.put(name, text[:at] + strange + text[at:])


def flip_bytes(tree: Tree, rng: random.Random) -> None:
    name = _some_file(tree, rng)
    data = bytearray(tree.files[name])
    for _ in range(rng.choice((1, 1, 2, 10))):
        if data:
            data[rng.randrange(len(data))] = rng.randrange(256)
    tree.files[name] = bytes(data)


def truncate(tree: Tree, rng: random.Random) -> None:
    name = _some_file(tree, rng)
    data = tree.files[name]
    at = rng.randrange(len(data) + 1)
    tree.files[name] = data[:at] if rng.random() < 0.8 else data[at:]


def line_ends(tree: Tree, rng: random.Random) -> None:
    name = _some_file(tree, rng)
    ends = (b"\r\n", b"\r", b"\n\r", b"\r\r\n")
    if rng.random() < 0.5:
        tree.files[name] = tree.files[name].replace(b"\n", rng.choice(ends))
    else:
        lines = tree.files[name].split(b"\n")
        tree.files[name] = b"".join(line + rng.choice((*ends, b"\n")) for line in lines)
    if rng.random() < 0.3:
        tree.files[name] = b"\xef\xbb\xbf" + tree.files[name]


def other_encoding(tree: Tree, rng: random.Random) -> None:
    name = _some_file(tree, rng)
    encoding = rng.choice(("utf-16", "utf-32", "latin-1", "cp1252", "utf-16-le", "utf-7"))
    text = tree.text(name).replace("mm", rng.choice(("mm", "é", "µm")))
    tree.files[name] = text.encode(encoding, "replace")


# ── size and depth ───────────────────────────────────────────────────────────────────────────────


def nest(tree: Tree, rng: random.Random) -> None:
    """Brackets within brackets, opened, closed, or both."""
    name = _some_file(tree, rng)
    tokens = _tokens(tree, name) or [" "]
    at, depth = rng.randrange(len(tokens)), rng.choice((1, 2, 31, 32, 33, 500, 20_000))
    opening, closing = rng.choice(("()", "{}", "((", "))", "{{", "}}", "({", '""', "[]"))
    tokens[at] = opening * depth + tokens[at] + closing * depth
    tree.put(name, "".join(tokens))


_THINGS = (
    " ", "\n", "\t \n", "#", "# note\n", "a", "A.", "9", "0", "-", "- ", "not ", "(", "x ", ", ",
    ",", ";", "1 mm ", "rotate z 1 deg ", "or id == \"F1\" ", "and x > 1 mm ", "(1,2,3) ",
    "P (1,2,3) ", "normal ", '"" ', '"', "}", "{ ", "points mm { } ", "emit krl ", "a a ", "é",
    "1 (", "p(1,1,1)normal",
)  # fmt: skip


def long_stretch(tree: Tree, rng: random.Random) -> None:
    """One thing written very often: blanks, a comment, an id, words of a condition."""
    name = _some_file(tree, rng)
    tokens = _tokens(tree, name) or [" "]
    at, times = rng.randrange(len(tokens)), rng.choice((10, 300, 3000, 30_000))
    thing = rng.choice(_THINGS)
    tokens.insert(at, thing * times)
    tree.put(name, "".join(tokens))


def long_condition(tree: Tree, rng: random.Random) -> None:
    """A `where` of many terms, or nested deeply."""
    times = rng.choice((10, 100, 500, 5000))
    test = rng.choice(('id == "F1"', "x > 1 mm", "in upper", 'id like "*F*1*"', "not y < 3 m"))
    joined = {
        "chain": rng.choice((" or ", " and ")).join([test] * times),
        "not": "not " * times + test,
        "nested": "(" * min(times, 100) + test + ")" * min(times, 100),
    }[rng.choice(("chain", "not", "nested"))]
    name = _some_file(tree, rng, "drill")
    tree.put(name, re.sub(r"where [^\n]*", lambda _: f"where {joined}", tree.text(name), count=1))


def many_holes(tree: Tree, rng: random.Random) -> None:
    """Rows or points repeated with new ids and positions."""
    name = _some_file(tree, rng)
    lines = tree.text(name).split("\n")
    rows = [i for i, line in enumerate(lines) if re.match(r"\s*\w+ ?[;,(]", line)]
    if not rows:
        return
    at = rng.choice(rows)
    times = rng.choice((2, 10, 300))
    copies = []
    for k in range(times):
        line = re.sub(r"^(\s*\w+)", rf"\g<1>_{k}", lines[at])
        copies.append(re.sub(r"(\d+)(?=[;,])", rf"\g<1>{k:03d}"[: 6 + k % 6], line, count=1))
    lines[at + 1 : at + 1] = copies
    tree.put(name, "\n".join(lines))


# ── tables ───────────────────────────────────────────────────────────────────────────────────────

_CELLS = (
    "", " ", "#REF!", "#DIV/0!", "1,5", "1.234,5", "nan", "NaN", "inf", "-inf", "1e308", "1e-320",
    "1e999", "1e999999999", "=1+1", "=cmd|' /C calc'!A0", '"', '""', '"a', 'a"b', "'1", "1 mm",
    "\t1", "1\xa0", "0", "-0", "F1", "F.1", "F 1", "F/1", "-F", "é", "\u0661", "+1", "1_0",
    "TRUE", "1;2", "1\n2", '"1\n2"', "x" * 70, "9" * 400, "9" * 200_000, "F1\x00", "F1\x1b[2J",
    "1e", "0x1p3", "--1", "1-2", "{{ 7*7 }}",
)  # fmt: skip


def damage_cells(tree: Tree, rng: random.Random) -> None:
    name = _some_file(tree, rng, "csv")
    if not name.endswith(".csv"):
        return
    lines = tree.text(name).split("\n")
    mark = ";" if ";" in lines[0] else ","
    for _ in range(rng.choice((1, 1, 3))):
        at = rng.randrange(len(lines))
        cells = lines[at].split(mark)
        column = rng.randrange(len(cells))
        match rng.randrange(6):
            case 0:
                del cells[column]
            case 1:
                cells.insert(column, rng.choice(_CELLS))
            case 2:
                rng.shuffle(cells)
            case _:
                cells[column] = rng.choice(_CELLS)
        lines[at] = mark.join(cells)
    tree.put(name, "\n".join(lines))


def damage_columns(tree: Tree, rng: random.Random) -> None:
    name = _some_file(tree, rng, "csv")
    if not name.endswith(".csv"):
        return
    text = tree.text(name)
    mark = ";" if ";" in text.split("\n")[0] else ","
    rows = [line.split(mark) for line in text.split("\n")]
    column = rng.randrange(len(rows[0]))
    match rng.randrange(4):
        case 0:
            rows = [row[:column] + row[column + 1 :] for row in rows]
        case 1:
            rows = [[*row, *row[column : column + 1]] for row in rows]
        case 2:
            mark = rng.choice(",;\t| :\"'.")
        case _:
            rows = [[cell.strip() and f'"{cell}"' for cell in row] for row in rows]
    tree.put(name, "\n".join(mark.join(row) for row in rows))


# ── paths ────────────────────────────────────────────────────────────────────────────────────────

_PATHS = (
    "", " ", ".", "..", "/", "../x.csv", "../../../../etc/passwd", "/etc/passwd", "/dev/null",
    "/dev/zero", "/dev/stdin", "/proc/self/mem", "~", "~/x", "a/../../b", "./{spec}", "{spec}",
    "//x", "\\\\host\\x", "C:\\x.csv", "C:x", "c:/x", "link", "loop", "folder", "folder/", "pipe",
    "none.csv", "none/none", "x\t", "a" * 300, "a/" * 3000, "é.csv", "con", "file:///etc/passwd",
    "http://127.0.0.1/x", "*", "?", "$HOME", "cells", "cells/.", "link/passwd", "dangling",
    "out/manifest.json", "unreadable", "x;y", "%s", ".\u202e",
)  # fmt: skip


def nasty_path(tree: Tree, rng: random.Random) -> None:
    """A path in the spec exchanged for one that is hostile, missing or no file."""
    tree.others |= {"link": "link /etc", "loop": "link loop", "dangling": "link nowhere"}
    tree.others |= {"folder": "folder", "pipe": "pipe"}
    written = rng.choice(_PATHS).replace("{spec}", tree.spec)
    paths = re.compile(r'"[^"\n]*\.(?:csv|cell|obj)"')
    _replace(tree, rng, paths, lambda _: f'"{written}"', "drill cell")


def lose_file(tree: Tree, rng: random.Random) -> None:
    """A file is missing, empty, or something else stands in its place."""
    name = _some_file(tree, rng)
    del tree.files[name]
    match rng.randrange(6):
        case 0:
            tree.files[name] = b""
        case 1:
            tree.files[name] = rng.choice(
                (b"\n", b"\xef\xbb\xbf", b"\0", b"drill 1", b"drill", b"#")
            )
        case 2:
            tree.others[name] = rng.choice(("folder", "pipe", f"link {name}", "link /dev/zero"))
        case 3:
            tree.files[name] = rng.choice(tuple(rng.choice(seeds()).files.values()))
        case _:
            pass


MUTATORS: dict[Mutator, float] = {
    delete_tokens: 5,
    duplicate_token: 3,
    swap_tokens: 5,
    graft_tokens: 5,
    damage_lines: 6,
    nasty_number: 12,
    other_number: 16,
    other_quantity: 26,
    other_choice: 16,
    other_unit: 6,
    other_word: 6,
    rename_everywhere: 8,
    insert_strange: 6,
    flip_bytes: 2,
    truncate: 2,
    line_ends: 2,
    other_encoding: 1,
    nest: 2,
    long_stretch: 3,
    long_condition: 2,
    many_holes: 4,
    damage_cells: 8,
    damage_columns: 3,
    nasty_path: 3,
    lose_file: 2,
}
