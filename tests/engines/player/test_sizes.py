"""The table of the player's tables in docs/firmware.md is measured."""

import pytest

from tests.engines.player.player_jobs import ROOT
from tests.engines.player.sizes import JOBS, row


@pytest.mark.parametrize("name", JOBS)
def test_the_table_in_the_docs_is_what_is_measured(name: str) -> None:
    assert row(name) in (ROOT / "docs" / "firmware.md").read_text()
