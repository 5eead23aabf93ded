"""Packages installed for real, into a folder of their own, and used in subprocesses."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path


def install(source: Path, folder: Path) -> Path:
    """Install a package without network; returns the folder in which it then is."""
    copy, site = folder / "source", folder / "site"
    shutil.copytree(source, copy)  # a build leaves its traces beside the sources
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "install", "--quiet"]
    offline = ["--no-index", "--no-build-isolation", "--no-deps", "--target", str(site)]
    done = subprocess.run([*pip, *offline, str(copy)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return site


def python(
    *arguments: str, cwd: Path, site: Path | None = None
) -> subprocess.CompletedProcess[str]:
    """Run Python; it knows what is installed in `site`."""
    path = [] if site is None else [str(site)]
    return subprocess.run(
        [sys.executable, *arguments],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(path)},
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=500,
    )
