"""LinuxCNC's own interpreter reads the samples' G-code: every hole is where `inspect` says."""

import csv
import io
import re
from pathlib import Path

import pytest
from drillc.cli import main
from judges.linuxcnc import require_linuxcnc, run_gcode

ROOT = Path(__file__).parents[2]
LETTERS = {
    "q1_mm": "U",
    "q2_mm": "V",
    "q3_deg": "A",
    "q4_mm": "X",
    "q5_mm": "Y",
    "q6_mm": "Z",
}
#: The exam's printed answer, in mm and degrees, and what its last digit is worth.
EXAM = {"U": 46.3, "V": 4953.7, "A": 110.0, "X": 5619.9, "Y": 290.5, "Z": 2611.4}


def inspected(sample: str, capsys: pytest.CaptureFixture[str]) -> dict[str, dict[str, float]]:
    """Each hole's joints by axis letter, as a user is told them."""
    capsys.readouterr()
    assert main(["inspect", f"samples/{sample}.drill", "--format", "csv"]) == 0
    rows = csv.DictReader(io.StringIO(capsys.readouterr().out))
    return {r["id"]: {letter: float(r[q]) for q, letter in LETTERS.items()} for r in rows}


@pytest.mark.parametrize("sample", ["portal", "skin_portal"])
def test_every_hole_is_reached(
    sample: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    require_linuxcnc()
    monkeypatch.chdir(ROOT)
    assert main(["compile", f"samples/{sample}.drill", "-o", str(tmp_path / "out")]) == 0
    program = {"portal": "portal_a", "skin_portal": "skin_portal"}[sample]
    judged = run_gcode(tmp_path / "out" / "gcode" / f"{program}.ngc")
    assert judged.error is None
    expected = inspected(sample, capsys)
    if sample == "portal":
        got = expected["R1"]
        assert all(abs(got[letter] - value) <= 0.1 for letter, value in EXAM.items())

    deepest: dict[str, dict[str, float]] = {}
    hole = ""
    for move in judged.moves:
        for comment in move.comments:
            found = re.fullmatch(r"hole (\S+)", comment.strip())
            hole = found[1] if found else hole
        if move.place and move.place["Z"] >= deepest.get(hole, move.place)["Z"]:
            deepest[hole] = move.place
    assert list(deepest) == list(expected)
    for name, place in deepest.items():
        for letter, value in expected[name].items():
            assert abs(place[letter] - value) < 1e-3, f"{name}: {letter}"
