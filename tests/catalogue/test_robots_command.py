"""`drillc robots`: an aligned table for people, and every figure as JSON."""

from __future__ import annotations

import json
import re

import pytest
from drillc.catalogue import models
from drillc.cli import main


def listed(capsys: pytest.CaptureFixture[str], *options: str) -> str:
    assert main(["robots", *options]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    return out


def test_the_table(capsys: pytest.CaptureFixture[str]) -> None:
    lines = listed(capsys).splitlines()
    rows = [re.split(r" {2,}", line) for line in lines]
    assert rows[0] == ["name", "title", "reach_mm", *(f"A{i}_deg" for i in range(1, 7))]
    assert [row[0] for row in rows[1:]] == list(models())
    (row,) = (row for row in rows if row[0] == "kuka_kr210_r3100_2")
    assert row[1:] == [
        *("KUKA KR 210 R3100-2", "3100"),
        *("-185..185", "-140..-5", "-120..168", "-350..350", "-122.5..122.5", "-350..350"),
    ]


def test_the_columns_are_aligned(capsys: pytest.CaptureFixture[str]) -> None:
    lines = listed(capsys).splitlines()
    assert len({len(line) for line in lines}) == 1
    assert not any(line != line.rstrip() for line in lines)
    title = lines[0].index("title")
    assert all(line[title - 2 : title] == "  " and line[title] != " " for line in lines)


def test_json(capsys: pytest.CaptureFixture[str]) -> None:
    arms = {arm["name"]: arm for arm in json.loads(listed(capsys, "--json"))}
    assert list(arms) == list(models())
    assert arms["abb_irb6640_185_280"] == {
        "name": "abb_irb6640_185_280",
        "title": "ABB IRB 6640-185/2.8",
        "maker": "abb",
        "reach_mm": pytest.approx(2797.0, abs=1.0),
        "limits_deg": {
            "A1": [-170, 170],
            "A2": [-65, 85],
            "A3": [-180, 70],
            "A4": [-300, 300],
            "A5": [-120, 120],
            "A6": [-360, 360],
        },
        "speeds_deg_s": {"A1": 100, "A2": 90, "A3": 90, "A4": 170, "A5": 140, "A6": 190},
        "dimensions_mm": {
            "a1": 320,
            "a2": -200,
            "b": 0,
            "c1": 780,
            "c2": 1075,
            "c3": 1392,
            "c4": 200,
        },
        "source": "ros-industrial/abb: abb_irb6640_support/urdf/irb6640_185_280_macro.xacro",
    }


def test_equal_bytes(capsys: pytest.CaptureFixture[str]) -> None:
    for options in ([], ["--json"]):
        assert listed(capsys, *options) == listed(capsys, *options)
