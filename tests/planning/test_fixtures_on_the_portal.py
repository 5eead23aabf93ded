"""On the portal the tool does not travel straight in part coordinates: its real path is what must
keep out of a fixture."""

from contextlib import suppress
from pathlib import Path

import pytest
from drillc.driver import plan_spec
from drillc.language.diagnostics import Refused, Report

SPEC = """drill 1
program P
part skin {{ normals outward }}
robot riveter portal {{
  D 10 m  H 5 m  d 0.75 m
  height centre
  side below
  limits {{ q3 -180 deg .. 180 deg   q5 -3 m .. 3 m }}
}}
fixture clip {{ box {box} mm }}
process rivet5 {{ approach 100 mm  rivet timeout 5 s  retract 100 mm }}
region plate {{
  process rivet5
  points mm {{
    R1 (4000, 0, 1000) normal (0, 0, 1)
    R2 (4400, 0, 1000) normal (0, 0, 1)
  }}
}}
"""


def codes(tmp_path: Path, box: str) -> list[str]:
    spec = tmp_path / "spec.drill"
    spec.write_text(SPEC.format(box=box))
    report = Report()
    with suppress(Refused):
        plan_spec(spec, None, report)
    return [d.code for d in report.diagnostics]


# A level plate: the tool withdraws to 100 mm under it and travels there.
@pytest.mark.parametrize(
    ("box", "expected"),
    [
        ("(4150, -50, 850) (4250, 50, 950)", ["E361"]),  # its way at z = 900 goes through
        ("(4150, -50, 910) (4250, 50, 990)", []),  # between that way and the plate
        ("(4150, -50, 700) (4250, 50, 890)", []),  # below it
        ("(4390, -50, 920) (4410, 50, 980)", ["E360"]),  # in the tool's way up to R2
    ],
)
def test_the_travel_is_examined_where_it_runs(
    tmp_path: Path, box: str, expected: list[str]
) -> None:
    assert codes(tmp_path, box) == expected
