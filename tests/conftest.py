"""What all tests share: options of the command line, and how hypothesis behaves."""

from __future__ import annotations

import os

import pytest
from hypothesis import settings

# The same examples on every run; HYPOTHESIS_PROFILE=search looks for new ones.
settings.register_profile("steady", derandomize=True, deadline=None)
settings.register_profile("search", deadline=None, max_examples=1000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "steady"))


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--fuzz-seed", type=int, help="run this one case of tests/fuzz")
    parser.addoption(
        "--update-diagnostics",
        action="store_true",
        help="write tests/diagnostics/cases/*/expected.txt anew instead of comparing",
    )
    parser.addoption(
        "--update-golden", action="store_true", help="write tests/golden anew instead of comparing"
    )
