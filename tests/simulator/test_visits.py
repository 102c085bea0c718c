"""What is noted at breakpoints in passing is what a run that stops there sees."""

from __future__ import annotations

import numpy as np
import pytest

from servogen.edges import join
from servogen.simulator import layout as at
from tests.campaigns import sampled
from tests.simulator.test_exact import CYCLES, cases, rows, seen, timed_cases

NAMES = {"CYCLE": "cycles", "PC": "pc", "W": "w", "STATUS": "status"}


@pytest.mark.parametrize(
    ("few", "count", "least"), sampled([(True, 5, 250), (True, 10, 500), (False, 1, 250), (False, 6, 500)], 2)
)
def test_a_visit_is_the_state_at_a_stop(few: bool, count: int, least: int) -> None:
    found = 0
    for case in [*cases(0)[:count], *timed_cases()[:count]]:
        stopping, passing = case.machine(), case.machine()
        addresses = sorted(case.image.program)
        stopping.breakpoints = passing.breakpoints = set(addresses[1 :: 9 if few else 1])
        chunks, visits = zip(*passing.visits(CYCLES), strict=True)
        edges, stops = [], []
        while stopping.cycles < CYCLES:
            edges += rows(stopping.run(CYCLES - stopping.cycles))
            if stopping.cycles < CYCLES:
                stops.append(stopping.state())
        noted = np.concatenate(visits)
        assert rows(join(iter(chunks))) == edges
        assert seen(passing) == seen(stopping)
        assert len(noted) == len(stops)
        for row, state in zip(noted, stops, strict=True):
            assert [row[getattr(at, slot)] for slot in NAMES] == [getattr(state, n) for n in NAMES.values()]
            assert (row[0x0C:0x50] & 0xFF).tolist() == list(state.ram)
            assert row[at.TMR0] == state.registers["TMR0"]
        found += len(stops)
    assert found > least
