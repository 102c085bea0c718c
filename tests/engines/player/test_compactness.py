"""The keyframes of the kept jobs: the table in docs/firmware.md is measured, and the bound is a bound."""

import pytest

from tests.engines.player.compactness import JOBS, compactness
from tests.engines.player.player_jobs import ROOT


@pytest.mark.parametrize("name", JOBS)
def test_the_table_in_the_docs_is_what_is_measured(name: str) -> None:
    found = compactness(name)
    docs = (ROOT / "docs" / "firmware.md").read_text()
    assert found.row() in docs
    assert found.stored <= min(256, found.unshared)
    # No cycle can have fewer keyframes than straight pieces; twelve servos share two tracks.
    assert found.pieces <= found.tracks * found.keyframes
    assert found.tracks in (0, 2)
