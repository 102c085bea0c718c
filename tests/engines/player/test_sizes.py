"""The table of the player's tables in docs/firmware.md is measured."""

import pytest

from tests.campaigns import sampled
from tests.engines.player.player_jobs import ROOT
from tests.engines.player.sizes import JOBS, flash, row


@pytest.mark.parametrize("name", sampled(JOBS, 2))
def test_the_table_in_the_docs_is_what_is_measured(name: str) -> None:
    assert row(name) in (ROOT / "docs" / "firmware.md").read_text()


def test_the_map_of_the_flash_in_the_docs_is_what_is_measured() -> None:
    text = (ROOT / "docs" / "firmware.md").read_text()
    assert f"| flash, words of `{JOBS[0]}` |" in text
    for part, words in flash(JOBS[0]).items():
        assert f"\n| {words} | {part}" in text
