"""Builds that are killed leave one whole build; `python -m tests.killed_builds` kills a hundred."""

import pytest

from tests import killed_builds


@pytest.mark.campaign
def test_killed_builds_leave_one_whole_build() -> None:
    seen = killed_builds.run(2, seed=3, report=lambda line: None)
    assert seen.total() == 2
