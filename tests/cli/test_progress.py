"""Progress is shown to a person who is looking, and to nobody else."""

import os
import pty
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def command(out: Path) -> list[str]:
    spec = str(ROOT / "samples" / "portal.drill")
    return [sys.executable, "-m", "drillc", "compile", spec, "-o", str(out)]


def test_nothing_in_a_pipe(tmp_path: Path) -> None:
    done = subprocess.run(command(tmp_path / "out"), capture_output=True, text=True, check=True)
    assert done.stderr.startswith("gcode PORTAL_A: 1 hole, verified\n")
    assert "\x1b" not in done.stderr
    assert "solving" not in done.stderr
    assert all((tmp_path / line).is_file() for line in done.stdout.splitlines())


def test_a_line_on_a_terminal_that_is_gone_at_the_end(tmp_path: Path) -> None:
    master, slave = pty.openpty()
    done = subprocess.run(command(tmp_path / "out"), stdout=subprocess.PIPE, stderr=slave)
    os.close(slave)
    said = os.read(master, 65536).decode()
    os.close(master)
    assert done.returncode == 0
    assert "solving 1 hole" in said
    assert "writing gcode/portal_a.ngc" in said
    assert said.rpartition("\r\x1b[K")[2].startswith("gcode PORTAL_A: 1 hole, verified")
