"""Poses that one table cannot hold lie in two, halves of rows in each; the pulses are those of the plan."""

from __future__ import annotations

import random

import pytest

from servogen.engines.player.encoding import row_table, stride_of
from servogen.engines.player.script import MAX_BYTES
from servogen.errors import ServogenError
from tests.engines.player.player_jobs import built_text, job_text, poses


def wandering(servos: int, count: int) -> str:
    """A job of `count` poses that have nothing in common."""
    dice = random.Random(servos)
    rows = [[dice.uniform(40, 120) for _ in range(servos)] for _ in range(count)]
    return job_text(servos, poses(rows, 0.8), firmware="soft_start_s = 0.32")


@pytest.mark.campaign
@pytest.mark.parametrize("servos", [11, 12])
def test_more_poses_than_one_table_holds_are_played_exactly(servos: int) -> None:
    """An odd number of servos leaves a byte of the second table unused."""
    count = MAX_BYTES // servos + 5
    made = built_text(wandering(servos, count))
    assert made.exact
    assert made.plan.schedule.plan_error_us <= 10
    for program in made.programs:
        assert "REST[next]" in program.firmware.text


def test_a_table_of_rows_is_divided_only_where_one_cannot_hold_it() -> None:
    rows = [[0] * 12 for _ in range(21)]
    assert (stride_of(21, 12), len(row_table(rows))) == (12, 252)
    assert (stride_of(22, 12), stride_of(22, 13), stride_of(42, 12)) == (6, 7, 6)
    rows.append([0] * 12)
    assert len(row_table(rows, halves=True)) == 264
    with pytest.raises(ServogenError, match="have 264 bytes: their table holds 256"):
        row_table(rows)
    with pytest.raises(ServogenError, match="have 516 bytes: their two tables hold 512"):
        row_table([[0] * 12] * 43, halves=True)
