"""Verdicts as text and as data."""

from __future__ import annotations

import json

from drillc.verification.proof import verify_program
from drillc.verification.summary import as_json, as_text
from drillc.verification.verdict import CHECKS
from output import programs
from verification.proof.made import HandReader, emit_of, job_of, run_of


def test_a_verdict_in_text_and_json() -> None:
    program = programs.pose_drill(3)
    run = run_of(program)
    for row in run.rows:
        if row["hole"] == 1 and "position_mm" in row:
            row["position_mm"] = row["position_mm"] + [0.0, 0.0, 2.0]
    verdict = verify_program(run, HandReader(), job_of(program), program, {}, emit_of())
    text = as_text(verdict)
    assert text.startswith("hand PANEL_7L: 3 holes, NOT VERIFIED\n")
    assert "hand/body.src:101: P2 is made 2.000 mm away" in text
    assert "[cell.drill:" in text
    assert max(map(len, text.splitlines())) < 160
    data = as_json(verdict)
    assert json.loads(json.dumps(data)) == data
    assert [check["name"] for check in data["checks"]] == list(CHECKS)  # type: ignore[attr-defined, index]
    assert data["passed"] is False


def test_a_good_one() -> None:
    program = programs.pose_drill(3)
    verdict = verify_program(run_of(program), HandReader(), job_of(program), program, {}, emit_of())
    assert "3 holes, verified" in as_text(verdict)
    assert as_json(verdict)["passed"] is True
