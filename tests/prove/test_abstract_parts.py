"""The parts of the abstract chip, each by itself: what is assumed for one instruction and undone after it,
which interrupts are in doubt, how a state is made relative to now, and the edges of many chips at once.
"""

from __future__ import annotations

import numpy as np
import pytest

from servogen.prove.chip import FIELD, AbstractChip, AssumedBits, ChipState, Reason
from servogen.simulator import SimulatorOptions
from tests.prove.test_abstract import chip_of
from tests.simulator.helpers import CLOCK, image

# What is assumed for one instruction ---------------------------------------------------------------------


def test_tmr0_after_an_instruction_with_an_assumed_count() -> None:
    """CLRF writes it; MOVF does not, so that after it nothing is known of the count."""
    for instruction, known in (("movf TMR0, w", False), ("clrf TMR0", True), ("movwf TMR0", True)):
        options = SimulatorOptions(start=(("w", 9),))
        chip = AbstractChip(image(f" {instruction}\n nop\n"), CLOCK, options, held={4: 0})
        first = chip.power_on()
        state = chip.run(first, frozenset([1]), 1, (AssumedBits("TMR0", 0xFF, 0x40),)).state(first)
        assert state["TMR0_UNKNOWN"] == (0 if known else 0xFF)
        assert state["W"] == (0x40 if not known else 9)
        assert state["TMR0"] == (9 if "movwf" in instruction else 0)


# Flags and interrupts in doubt ----------------------------------------------------------------------------


# States relative to now -----------------------------------------------------------------------------------


# Runs -----------------------------------------------------------------------------------------------------


def test_a_sleeping_chip_is_run_for_the_assumed_instruction_only() -> None:
    chip = chip_of(" sleep\n nop\n")
    first = chip.power_on()
    outcome = chip.run(first, frozenset(), 50, (AssumedBits("TMR0_PHASE", 0, 0),))
    assert (outcome.cycles, outcome.rest[FIELD["SLEEPING"]], outcome.reason) == (1, 1, Reason.STOP)


# Many chips at once ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("body", "fit"), [("movf 0x30, w\n movwf EEDATA", False), ("movf EEDATA, w\n movwf 0x21", True)]
)
def test_a_chip_that_writes_an_unknown_byte_to_an_unknown_eedata_does_not_fit(body: str, fit: bool) -> None:
    chip = chip_of(f" {body}\n nop\n")
    values = np.array([[1], [2]], dtype=np.int64)
    lanes = chip.run_lanes(chip.power_on(), (0x20 - 0x0C,), values, frozenset([2]), 50)
    assert lanes.fit.tolist() == [fit, fit]


def test_chips_that_end_alike_have_the_state_of_the_first() -> None:
    """They differ in time only, by the turns of the loop; one chip has its own state."""
    chip = chip_of("loop decfsz 0x20, f\n goto loop\n nop\n", start=(("w", 1), ("flags", 0)))
    first = chip.power_on()
    place, stops = 0x20 - 0x0C, frozenset([2])
    for turns in ((5,), (9,), (9, 5), (5, 9, 2)):
        values = np.array([[count] for count in turns], dtype=np.int64)
        ram = (*first.ram[:place], turns[0], *first.ram[place + 1 :])
        alone = chip.run(ChipState(ram, first.rest), stops, 100)
        lanes = chip.run_lanes(first, (place,), values, stops, 100)
        assert {rest: rows.tolist() for rest, rows in lanes.rests.items()} == {
            alone.rest: [*range(len(turns))]
        }
