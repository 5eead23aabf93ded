"""docs/robots.md lists the catalogue as it is."""

from __future__ import annotations

import re
from pathlib import Path

from drillc.catalogue import models, reach_mm

PAGE = (Path(__file__).parents[2] / "docs" / "robots.md").read_text(encoding="utf-8")


def test_the_table_of_models() -> None:
    rows = re.findall(r"^\| `(\w+)` \| (.*?) \| (\d+) \| (\S+): `(\w+)` \|$", PAGE, re.MULTILINE)
    listed = [
        (m.name, m.title, f"{reach_mm(m):.0f}", *re.split(r": |/(?=urdf)", m.source)[:2])
        for m in models().values()
    ]
    assert rows == listed
