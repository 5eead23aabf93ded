"""The conformance kit: what any post must do, shown over one corpus of specs.

    import pytest
    from drillc.testing import PROGRAMS, accepted, check_post

    @pytest.mark.parametrize("program", PROGRAMS)
    def test_it_is_proven_or_refused(program: str) -> None:
        check_post("urscript", program)

    def test_some_programs_are_accepted() -> None:
        assert accepted("urscript")

The post and its reader are found by their entry points, so both must be installed.
"""

from .corpus import PROGRAMS
from .kit import accepted, check_post

__all__ = ["PROGRAMS", "accepted", "check_post"]
