"""Posts whose programs cannot be read back: what is said of each, and that nothing is written."""

from __future__ import annotations

from importlib.metadata import Distribution, EntryPoint
from pathlib import Path

import pytest
from diagnostics.running import FINE, TOOL, Bench, files_of
from drillc.verification import registry
from drillc.verification.krl.reader import KrlReader
from drillc.verification.reading import Reader

DOCUMENT = Path(__file__).parents[2] / "docs" / "diagnostics.md"
SPEC = FINE.replace("emit krl\nemit rapid\n", "emit krl\n")
AT = "  6 | emit krl\n    |      ^^^\n"


class _Distribution(Distribution):
    """A distribution that exists only in this test."""

    def __init__(self, name: str) -> None:
        self._name = name

    def read_text(self, filename: str) -> str | None:
        return f"Name: {self._name}\nVersion: 2.0\n" if filename == "METADATA" else None

    def locate_file(self, path: object) -> Path:
        return Path(str(path))


def entry(value: str, distribution: str) -> EntryPoint:
    """A reader for KRL that a distribution brings."""
    made = EntryPoint("krl", value, registry.GROUP)
    vars(made)["dist"] = _Distribution(distribution)
    return made


KRL = "drillc.verification.krl.reader:KrlReader"


@pytest.fixture
def installed(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> list[EntryPoint]:
    """The readers of this Python, to be filled in; spec.drill emits KRL."""
    bench.write({"spec.drill": SPEC, "tool.cell": TOOL})
    found: list[EntryPoint] = []
    monkeypatch.setattr(registry, "entry_points", lambda group: found)
    return found


def shown(code: str) -> str:
    """The example that the documentation gives."""
    entry = DOCUMENT.read_text(encoding="utf-8").split(f"\n### {code} ")[1]
    return entry.split("```text\n")[1].split("```")[0]


@pytest.mark.usefixtures("installed")
def test_a_post_without_a_reader(bench: Bench) -> None:
    said = (
        "spec.drill:6:6: error E701: the post krl has no reader, so its programs cannot be"
        f" verified\n{AT}"
        "  hint: --no-verify writes them unverified, and the manifest says so\n"
    )
    assert bench.refused() == f"{said}1 error; nothing was written\n"
    assert shown("E701") == said


@pytest.mark.usefixtures("installed")
def test_such_a_post_is_used_without_proof(bench: Bench) -> None:
    ran = bench.run("compile", "spec.drill", "-o", "out/spec", "--no-verify")
    assert (ran.code, ran.err) == (0, "not verified, as asked for\n")
    assert b'"verified": false' in files_of(bench.folder / "out/spec")["manifest.json"]
    ran = bench.run("verify", "out/spec")
    assert (ran.code, ran.out) == (1, "")
    assert ran.err.startswith("spec.drill:6:6: error E701: ")


def test_two_readers_of_one_post(bench: Bench, installed: list[EntryPoint]) -> None:
    installed += [entry(KRL, "drillc"), entry(KRL, "other-readers")]
    said = (
        "spec.drill:6:6: error E702: there are 2 readers for the post krl: from drillc 2.0 and"
        f" other-readers 2.0\n{AT}"
        "  hint: uninstall all of these distributions but one\n"
    )
    assert bench.refused() == f"{said}1 error; nothing was written\n"
    assert shown("E702").replace("drillc 0.1.0", "drillc 2.0") == said


class OfAnother(KrlReader):
    """A reader that is registered under a name that is not its own."""

    name = "other"


@pytest.mark.parametrize(
    ("value", "why"),
    [
        ("boreas_reader:R", "ModuleNotFoundError: No module named 'boreas_reader'"),
        (f"{__name__}:Nothing", f"AttributeError: module '{__name__}' has no attribute 'Nothing'"),
        *(
            (
                value,
                "it is no class derived from drillc.verification.reading.Reader named krl",
            )
            for value in (
                f"{__name__}:OfAnother",
                f"{__name__}:KRL",
                "drillc.verification.reading:Reader",
            )
        ),
    ],
)
def test_a_reader_that_cannot_be_loaded(
    bench: Bench, installed: list[EntryPoint], value: str, why: str
) -> None:
    installed.append(entry(value, "boreas-post"))
    said = (
        f"spec.drill:6:6: error E703: the reader for the post krl ({value}, from boreas-post 2.0)"
        f" cannot be loaded: {why}\n{AT}"
        "  hint: update or uninstall boreas-post 2.0\n"
    )
    assert bench.refused() == f"{said}1 error; nothing was written\n"
    if value == "boreas_reader:R":
        assert shown("E703") == said


def test_one_reader_that_works(bench: Bench, installed: list[EntryPoint]) -> None:
    installed.append(entry(KRL, "drillc"))
    ran = bench.run("compile", "spec.drill", "-o", "out/spec")
    assert ran.code == 0, ran.err
    assert "krl BEFORE: 1 hole, verified" in ran.err
    assert issubclass(KrlReader, Reader)
