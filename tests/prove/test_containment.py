"""A chip in an abstract state is still in it n cycles later; in full: `tests.prove.containment`."""

from __future__ import annotations

import pytest

from servogen.prove.chip import FIELD, AbstractChip, ChipState
from servogen.simulator import SimulatorOptions
from tests.prove import containment
from tests.prove.containment import CLOCK, COUNTED, End, Follower, counters, every_pair, postscaler


@pytest.mark.parametrize("case", COUNTED, ids=lambda case: case.name)
def test_what_counts_by_itself_stays_within_its_unknown_bits(case: containment.Counting) -> None:
    """Every value of a byte, with every set of unknown bits (a sample of these pairs), for some cycles."""
    assert counters(case, [*every_pair(4099, 7), (0xFF, 0x01), (0x7F, 0x80), (0x01, 0x02)]) == []


def test_no_watchdog_times_out_before_the_abstract_one_may() -> None:
    assert postscaler([*every_pair(997, 3), (0xFE, 0x01), (0x03, 0x04)]) == []


@pytest.mark.parametrize("seed", range(6))
def test_every_chip_stays_in_one_of_the_states_of_a_random_program(seed: int) -> None:
    follower = Follower(containment.program(seed), seed, cycles=800, chips=8)
    follower.follow()
    assert follower.wrong == []
    assert follower.counts["compared"] > 8


def test_a_state_that_is_wrong_in_one_bit_is_found() -> None:
    """Of the bits that the law compares, each that is known and then is the other one is missed by a chip."""
    case = COUNTED[1]
    chip = AbstractChip(case.image, CLOCK, SimulatorOptions())
    state = case.state(chip, 0x40, 0)
    outcome = chip.run(state, frozenset(), 5)
    right, truth = outcome.state(state), case.truth()[0x40, case.times.index(5)]
    assert End(outcome, right).holds(truth)
    for name, bit in (("TMR0", 0), ("PC", 3), ("OPTION", 7), ("TRIS", 12), ("PCLATH", 1)):
        rest = [*right.rest]
        rest[FIELD[name]] ^= 1 << bit
        assert not End(outcome, ChipState(right.ram, tuple(rest))).holds(truth)
