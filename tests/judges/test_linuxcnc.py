"""Where LinuxCNC is absent its tests say so, and where it is required they fail."""

from pathlib import Path

import pytest
from judges import linuxcnc


@pytest.fixture
def absent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(linuxcnc, "absence", lambda: "rs274 is not installed")


@pytest.mark.usefixtures("absent")
def test_absent_it_is_skipped_loudly(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DRILLC_REQUIRE_LINUXCNC", raising=False)
    with pytest.raises(pytest.skip.Exception, match="NOT JUDGED BY LINUXCNC: rs274"):
        linuxcnc.run_gcode(Path("any.ngc"))


@pytest.mark.usefixtures("absent")
def test_required_it_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DRILLC_REQUIRE_LINUXCNC", "1")
    with pytest.raises(pytest.fail.Exception, match="DRILLC_REQUIRE_LINUXCNC=1, but rs274"):
        linuxcnc.run_rs274(Path("any.ngc"))


def test_it_reports_units_as_documented(tmp_path: Path) -> None:
    """Lengths in mm and feeds in mm/min, whatever the interpreter counts in."""
    program = tmp_path / "units.ngc"
    program.write_text("G21 G90 G94\n(first)\nG1 X254 W-1 A90 F1200\nG4 P0.25\nG0 X0\nM2\n")
    judged = linuxcnc.run_gcode(program)
    feed, dwell, traverse = judged.moves
    assert judged.error is None
    assert (feed.kind, feed.comments, feed.line) == ("feed", ("first",), 3)
    assert (feed.place["X"], feed.place["W"], feed.place["A"]) == pytest.approx((254, -1, 90))
    assert feed.feed == pytest.approx(1200)
    assert (dwell.kind, dwell.seconds) == ("dwell", 0.25)
    assert (traverse.kind, traverse.place["X"], traverse.feed) == ("traverse", 0, None)
