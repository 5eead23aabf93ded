"""rapidchecker as a judge: a grammar of all of RAPID, written by others (PyPI, AGPL).

    from judges import rapidchecker

    rapidchecker.require()  # skips, and says so, where it is not installed
    assert rapidchecker.complaints(text) == []

It is run as a program and never imported or shipped. `RAPIDCHECKER_PYTHON` names the Python that
has it (default: the one that runs the tests); with DRILLC_REQUIRE_RAPIDCHECKER=1 its absence fails.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

import pytest


def _python() -> str:
    return os.environ.get("RAPIDCHECKER_PYTHON", sys.executable)


@cache
def absence() -> str | None:
    """Why rapidchecker cannot judge here; None when it can."""
    probe = [
        _python(),
        "-c",
        "import importlib.util as u, sys; sys.exit(not u.find_spec(sys.argv[1]))",
    ]
    found = subprocess.run([*probe, "rapidchecker"], capture_output=True)
    if found.returncode == 0:
        return None
    return f"{_python()} has no rapidchecker (in a Python of its own: pip install rapidchecker)"


def require() -> None:
    """Skip the test, loudly, when the judge is absent; fail it where it must be there."""
    why = absence()
    if why and os.environ.get("DRILLC_REQUIRE_RAPIDCHECKER") == "1":
        pytest.fail(why)
    if why:
        pytest.skip(f"NOT JUDGED: {why}")


def complaints(module: bytes) -> list[str]:
    """What rapidchecker says of one module: lines such as `12:5 Expected ';', found 'x'`."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "module.mod"
        file.write_bytes(module)
        # away from any rapidchecker.toml: its defaults are what drillc's layout follows
        command = [_python(), "-m", "rapidchecker", file.name]
        judged = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120)
    if judged.returncode == 0 and "No RAPID format errors found" in judged.stdout:
        return []
    said = [line.strip() for line in (judged.stdout + judged.stderr).splitlines()]
    return [line for line in said if line and line != file.name] or ["failed without a word"]
