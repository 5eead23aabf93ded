"""Staging: what it pours is what a plain Jinja loop would print; what it cannot do it refuses."""

import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import jinja2
import numpy as np
import pytest
from drillc.output.numbers import Column, Fixed, Text, Whole, fixed
from drillc.output.pouring import BLOCK_ROWS, Rows, StagedText
from drillc.output.staging import Stage, StagingError

N = 3 * BLOCK_ROWS + 17


def body(text: str) -> str:
    """A template with one body."""
    return "{% call(hole) per_hole(rows) %}\n" + text + "\n{% endcall %}\n"


def columns(n: int = 5) -> dict[str, Column]:
    i = np.arange(n)
    return {
        "id": Text(np.array([f"P{k}" for k in i] or [""])[:n]),
        "x": Fixed(1.5 * i - 3.0, 3),
        "depth": Fixed(12.0 + i % 3, 4),
    }


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A package `stagetemplates` for templates, importable only during the test."""
    folder = tmp_path / "stagetemplates"
    folder.mkdir()
    (folder / "__init__.py").touch()
    monkeypatch.syspath_prepend(tmp_path)
    yield folder
    sys.modules.pop("stagetemplates", None)


def render(
    package: Path,
    template: str,
    data: Mapping[str, Column] | None = None,
    newline: str = "\n",
    **context: object,
) -> StagedText:
    (package / "t.j2").write_text(template, encoding="utf-8", newline="")
    stage = Stage("stagetemplates", columns() if data is None else data)
    return stage.render("t.j2", {"rows": Rows(0, 5), **context}, newline)


def text_of(staged: StagedText) -> str:
    return b"".join(staged).decode("ascii")


def test_a_body_is_poured_for_every_row(package: Path) -> None:
    staged = render(
        package,
        "head\n{% call(hole) per_hole(rows) %}\n{{ hole.id }}: {{ hole.x }}, {{ hole.x }}"
        " {{ hole['depth'] }}\n{% endcall %}\ntail\n",
        rows=Rows(1, 3),
    )
    assert text_of(staged) == ("head\nP1: -1.500, -1.500 13.0000\nP2: 0.000, 0.000 14.0000\ntail\n")


@pytest.mark.parametrize("stretch", [(0, N), (7, 7 + BLOCK_ROWS), (N - 1, N), (3, 3)])
def test_the_same_text_as_a_plain_jinja_loop(package: Path, stretch: tuple[int, int]) -> None:
    data = columns(N)
    staged = render(
        package,
        "{% for part in parts %}\n>{{ loop.index }}\n{% call(hole) per_hole(part) %}\n"
        "  LIN {{ hole.id }} 100% %s %% {{ hole.x }} {% if big %}{{ hole.depth }}{% endif %} \\\n"
        "{% endcall %}\n{% endfor %}\n",
        data,
        parts=[Rows(*stretch), Rows(0, 2)],
        big=True,
    )
    texts = {name: [c.conversion % v for v in c.cells(0, N)] for name, c in data.items()}
    plain = jinja2.Environment(trim_blocks=True, keep_trailing_newline=True).from_string(
        "{% for part in parts %}\n>{{ loop.index }}\n{% for i in range(*part) %}\n"
        "  LIN {{ id[i] }} 100% %s %% {{ x[i] }} {{ depth[i] }} \\\n"
        "{% endfor %}\n{% endfor %}\n"
    )
    assert text_of(staged) == plain.render(parts=[stretch, (0, 2)], **texts)


def test_it_streams_in_chunks_and_can_be_read_again(package: Path) -> None:
    staged = render(
        package,
        body("{{ hole.id }} {{ 'x' * 200 }} {{ hole.x }}"),
        columns(N),
        rows=Rows(0, N),
    )
    chunks = list(staged)
    assert len(chunks) > 3
    assert max(map(len, chunks)) < 1 << 20
    assert b"".join(chunks) == b"".join(staged)
    assert b"".join(chunks).count(b"\n") == N


def test_no_rows_print_nothing(package: Path) -> None:
    staged = render(
        package,
        "a\n{% call(hole) per_hole(rows) %}\n{{ hole.id }}\n{% endcall %}\nb\n",
        rows=Rows(2, 2),
    )
    assert text_of(staged) == "a\nb\n"


def test_rows_tell_whether_there_are_any(package: Path) -> None:
    staged = render(
        package, "{% if rows %}yes{% endif %}{% if none %}no{% endif %}", none=Rows(4, 4)
    )
    assert text_of(staged) == "yes"


def test_every_line_ends_as_the_post_says(package: Path) -> None:
    template = body("{{ hole.id }}\n") + "end\n"
    for source in (
        template,
        template.replace("\n", "\r\n"),
    ):  # a template that git checked out with CRLF
        text = text_of(render(package, source, newline="\r\n", rows=Rows(0, 2)))
        assert text == "P0\r\n\r\nP1\r\n\r\nend\r\n"


def test_poured_text_is_never_template_code(package: Path) -> None:
    nasty = ["{{ 7*7 }}", "%s%(x)d%", "{% raw %}", "\\x01", "}}"]
    data: dict[str, Column] = {"id": Text(np.array(nasty))}
    staged = render(package, "{% call(h) per_hole(rows) %}\n{{ h.id }}\n{% endcall %}\n", data)
    assert text_of(staged).splitlines() == nasty


def test_macros_and_includes_work_inside_a_body(package: Path) -> None:
    (package / "point.j2").write_text("<{{ hole.x }}>", encoding="utf-8")
    staged = render(
        package,
        "{% macro point(h) %}({{ h.id }} {{ h.x }}){% endmacro %}\n"
        + body("{{ point(hole) }}{% set y = hole.depth %} {{ y }} {{ y }}"),
        rows=Rows(2, 3),
    )
    assert text_of(staged) == "(P2 0.000) 14.0000 14.0000\n"


@pytest.mark.parametrize(
    "use",
    [
        "{% if hole.x %}a{% endif %}",
        "{% if hole.x > 0 %}a{% endif %}",
        "{% if hole.id == 'P1' %}a{% endif %}",
        "{% if hole.id in ['P1'] %}a{% endif %}",
        "{% if 'P' in hole.id %}a{% endif %}",
        "{% if hole.x is defined %}a{% endif %}",
        "{% if hole.x is none %}a{% endif %}",
        "{% if not hole.x %}a{% endif %}",
        "{{ hole.x + 1 }}",
        "{{ 1 - hole.x }}",
        "{{ -hole.x }}",
        "{{ hole.x * 2 }}",
        "{{ 2 / hole.x }}",
        "{{ hole.x ~ 'a' }}",
        "{{ 'a' ~ hole.id }}",
        "{{ '%s' % hole.id }}",
        "{{ '%8.3f' | format(hole.x) }}",
        "{{ hole.x | fixed(3) }}",
        "{{ hole.x | round(1) }}",
        "{{ hole.x | int }}",
        "{{ hole.x | float }}",
        "{{ hole.id | upper }}",
        "{{ hole.id | length }}",
        "{{ hole.id | string }}",
        "{{ hole.id | default('x') }}",
        "{{ hole.id | center(20) }}",
        "{{ hole.id | trim }}",
        "{{ [hole.id] | join(',') }}",
        "{{ [hole.id, hole.x] | sort }}",
        "{{ hole.id[0] }}",
        "{{ hole.id.upper() }}",
        "{{ hole.id() }}",
        "{{ range(hole.x) }}",
        "{{ {hole.id: 1} }}",
        "{% for c in hole.id %}{{ c }}{% endfor %}",
    ],
)
def test_a_slot_can_only_be_printed(package: Path, use: str) -> None:
    with pytest.raises(StagingError, match=r"t\.j2:2: .*(only be printed|not known)"):
        render(package, body(use))


@pytest.mark.parametrize(
    "use",
    [
        "{% macro m() %}{{ hole.id }}{% endmacro %}{{ m() | upper }}",
        "{% macro m() %}{{ hole.id }}{% endmacro %}{{ m() | length }}",
        "{% macro m() %}{{ hole.id }}{% endmacro %}{% if m() == 'P1' %}a{% endif %}",
        "{% macro m() %}{{ hole.id }}{% endmacro %}{% set a = m() %}{{ a }}{{ a }}",
        "{% set t %}{{ hole.id }}{% endset %}{{ t }}",
        "{% filter upper %}{{ hole.id }}{% endfilter %}",
        "{{ per_hole(rows, caller=none) }}",
        "{% call(h) per_hole(rows) %}{{ h.id }}{% endcall %}",
        "{{ hole }}",
        "{{ hole.id.__class__ }}",
        "{{ hole.id._number }}",
        "{{ hole.nothing }}",
    ],
)
def test_no_way_around_it(package: Path, use: str) -> None:
    with pytest.raises(StagingError, match=r"t\.j2:[123]: "):
        render(package, body(use))


def test_an_unknown_column_has_a_suggestion(package: Path) -> None:
    with pytest.raises(
        StagingError, match=r"t\.j2:2: there is no column hole\.dept; did you mean hole\.depth"
    ):
        render(package, body("{{ hole.dept }}"))
    with pytest.raises(StagingError, match="known: id, x, depth"):
        render(package, body("{{ hole.qqq }}"))


@pytest.mark.parametrize(
    ("template", "message"),
    [
        ("{% set ns = namespace(s=0) %}{% call(h) per_hole(rows) %}{% set ns.s = h.x %}"
         "{% endcall %}{{ ns.s }}", "outside of its per_hole"),
        ("{% set t %}{% call(h) per_hole(rows) %}{{ h.x }}{% endcall %}{% endset %}",
         "kept, dropped"),
        ("{% set t %}{% call(h) per_hole(rows) %}{{ h.x }}{% endcall %}{% endset %}{{ t }}{{ t }}",
         "kept, dropped"),
        ("{{ per_hole(rows) }}", "write {% call"),
        ("{% call(h) per_hole(5) %}{{ h.x }}{% endcall %}", "takes rows"),
        ("{{ 0.5 }}", r"0\.5 is printed as it is; write | fixed"),
        ("{{ number }}", "printed as it is"),
        ("{{ none }}", "None cannot be printed"),
        ("{{ true }}", "True cannot be printed"),
        ("{{ rows }}", "cannot be printed"),
        ("{{ missing }}", "'missing' is undefined"),
        ("{{ ''.__class__.__mro__ }}", "unsafe"),
        ("{{ 'ä' }}", "plain ASCII"),
        ("ü", "plain ASCII"),
        ("{{ bell }}", "control character"),
        ("{% if %}", "Expected an expression"),
        ("{% include 'nowhere.j2' %}", "nowhere.j2"),
        ("{{ nan | fixed(3) }}", "nan cannot be written"),
    ],
)  # fmt: skip
def test_mistakes_of_a_template_name_the_template(
    package: Path, template: str, message: str
) -> None:
    with pytest.raises(StagingError, match=r"t\.j2:.*" + message):
        render(package, template, number=np.float64(1.5), bell="a\x07b", nan=float("nan"))


def test_a_mistake_in_an_included_template_is_placed_there(package: Path) -> None:
    (package / "inner.j2").write_text("one\n{{ 1.5 }}\n", encoding="utf-8")
    with pytest.raises(StagingError, match=r"^inner\.j2:2: "):
        render(package, "a\nb\nc\n{% include 'inner.j2' %}\n")


def test_a_template_cannot_reach_out_of_its_package(package: Path) -> None:
    (package.parent / "secret.j2").write_text("secret", encoding="utf-8")
    for name in ("../secret.j2", "a/../../secret.j2"):
        with pytest.raises(StagingError):
            render(package, f"{{% include '{name}' %}}")


def test_the_formatter_is_the_filter(package: Path) -> None:
    assert text_of(render(package, "{{ -0.0001 | fixed(3) }} {{ 5 }} {{ '%' }}")) == "0.000 5 %"
    assert fixed(-0.0001, 3) == "0.000"


def test_renderings_share_nothing(package: Path) -> None:
    (package / "t.j2").write_text(body("{{ hole.id }}"), encoding="utf-8")
    stage = Stage("stagetemplates", columns())
    first = stage.render("t.j2", {"rows": Rows(0, 1)})
    second = stage.render("t.j2", {"rows": Rows(1, 2)})
    assert (text_of(first), text_of(second)) == ("P0\n", "P1\n")
    assert not re.search(rb"[\x00-\x08]", b"".join(first))


# ── a second table ───────────────────────────────────────────────────────────────────────────────


def with_vias(package: Path, source: str) -> str:
    """Rendered and poured with two vias beside the five holes."""
    (package / "t.j2").write_text(source, encoding="utf-8")
    vias = {"number": Whole(np.array([7, 8])), "x": Fixed(np.array([0.5, -1.5]), 1)}
    stage = Stage("stagetemplates", columns(), via_columns=vias)
    context = {"holes": Rows(0, 2), "vias": Rows(0, 2, "via")}
    return text_of(stage.render("t.j2", context))


def test_vias_are_poured_from_their_own_columns(package: Path) -> None:
    text = with_vias(
        package,
        "{% call(v) per_via(vias) %}\n{{ v.number }}: {{ v.x }}\n{% endcall %}\n"
        "{% call(hole) per_hole(holes) %}\n{{ hole.x }}\n{% endcall %}\n",
    )
    assert text.splitlines()[:2] == ["7: 0.5", "8: -1.5"]
    assert len(text.splitlines()) == 4


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("{% call(v) per_via(holes) %}{{ v.x }}{% endcall %}", "rows of vias, not of holes"),
        ("{% call(h) per_hole(vias) %}{{ h.x }}{% endcall %}", "rows of holes, not of vias"),
        ("{% call(v) per_via(vias) %}{{ v.depth }}{% endcall %}", "no column via.depth; known: n"),
        ("{% call(v) per_via(vias) %}{{ v.nunber }}{% endcall %}", "did you mean via.number"),
        ("{% call(v) per_via(vias) %}{{ v.x + 1 }}{% endcall %}", "via.x can only be printed"),
        ("{{ per_via(vias) }}", r"write {% call\(via\) per_via"),
        ("{% call(v) per_via(vias) %}{% call(h) per_hole(holes) %}{{ h.x }}{{ v.x }}{% endcall %}"
         "{% endcall %}", "cannot stand inside another"),
    ],
)  # fmt: skip
def test_the_tables_are_kept_apart(package: Path, source: str, message: str) -> None:
    with pytest.raises(StagingError, match=message):
        with_vias(package, source)
