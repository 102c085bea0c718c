"""The checker's chip contains the simulator's: random programs, start values, levels at the pins, and phases.

More of them: SERVOGEN_LOCKSTEP_PROGRAMS=300.
"""

from __future__ import annotations

import os

import numpy as np
import pytest

from servogen.checker import chip, layout
from servogen.simulator.layout import ROWS
from tests.checker.certify import image_of
from tests.checker.lockstep import NO_EDGES, board, bus_program, compare, memory, power_up, program

PROGRAMS = int(os.environ.get("SERVOGEN_LOCKSTEP_PROGRAMS", "12"))
TAPE = b"\xa5\x00\x3c\xff\x00"


def test_every_register_of_the_simulator_has_its_slot() -> None:
    slots = chip.slot_table()
    held = [register for row in ROWS for register in row.registers]
    assert [each.name for each in held if slots[each.address] == layout.NOWHERE] == []
    assert slots[0x07] == slots[0x87] == layout.NOWHERE  # unimplemented: DS35007 figure 2-2


def test_every_state_of_the_simulator_is_within_the_checkers() -> None:
    found = [compare(program(seed), seed, cycles=1200) for seed in range(PROGRAMS)]
    assert sum(each.instructions for each in found) > 500 * PROGRAMS
    assert sum(each.asked for each in found) > 5 * PROGRAMS
    assert sum(each.phased for each in found) > PROGRAMS // 6
    refused = {each.reason for each in found} - {layout.TOO_LONG}
    assert layout.WRONG_EDGE not in refused
    assert layout.MISSING not in refused


def test_an_interrupt_tells_what_tmr0_is_where_it_was_not_known() -> None:
    """As beside a contract: OPTION_REG, TMR0 and T0IF may be written while the overflow comes."""
    found = [compare(program(seed, True), seed, cycles=1200, watches=True) for seed in range(PROGRAMS)]
    assert sum(each.timed for each in found) >= PROGRAMS // 2
    assert {each.reason for each in found} <= {layout.TOO_LONG, layout.REGISTER}


def test_whatever_is_said_on_a_tapes_bus_the_checkers_eeprom_may_do_what_the_simulators_does() -> None:
    found = [compare(bus_program(seed), seed, cycles=2000, tape=TAPE) for seed in range(PROGRAMS)]
    assert {each.reason for each in found} == {layout.TOO_LONG}
    assert all(each.asked for each in found)  # nothing is known of it after a reset
    assert sum(each.told for each in found) > 2 * PROGRAMS


def test_a_run_depends_on_no_byte_of_ram_but_those_that_it_reads_first() -> None:
    """Random programs from states that differ in the other bytes: all ends are alike, but for bytes that are
    neither read nor written.
    """
    compared = 0
    for seed in range(PROGRAMS):
        rng = np.random.default_rng(seed)
        held = memory(program(seed))
        ram = slice(layout.RAM, layout.RAM_END)
        first = power_up()
        first[ram] = rng.integers(256, size=68)
        first[rng.integers(layout.RAM, layout.RAM_END, size=4)] = layout.UNKNOWN
        start, used = first.copy(), np.zeros(layout.SLOTS, dtype=np.int64)
        reason = chip.run(first, used, NO_EDGES, NO_EDGES, held, board(400))
        for value in (0, 1, 255, layout.UNKNOWN):
            other = start.copy()
            other[ram] = np.where(used[ram] & layout.READ, start[ram], value)
            before = other[ram].copy()
            used_now = np.zeros(layout.SLOTS, dtype=np.int64)
            assert chip.run(other, used_now, NO_EDGES, NO_EDGES, held, board(400)) == reason, seed
            assert np.array_equal(used, used_now), seed
            assert np.array_equal(other[ram], np.where(used[ram] & layout.CHANGED, first[ram], before)), seed
            other[ram] = first[ram]
            assert np.array_equal(other, first), seed
            compared += int((used[ram] == 0).sum())
    assert compared > 100 * PROGRAMS


@pytest.mark.parametrize(
    ("decides", "read"),
    [
        ("movf 0x20,w", True),
        ("clrf 0x20\n movf 0x20,w", False),  # overwritten first
        ("movlw 0x20\n movwf 4\n movf 0,w", True),  # read through the pointer
        ("btfsc 0x20,0", True),
        ("incf 0x20,f", True),
        ("movf 0x21,w", False),  # another byte
    ],
)
def test_only_what_is_read_before_it_is_written_decides(decides: str, read: bool) -> None:
    image = image_of(f" list p=16f84\n org 0\n {decides}\n goto $\n")
    s, used = power_up(), np.zeros(layout.SLOTS, dtype=np.int64)
    s[0x20] = 5
    chip.run(s, used, NO_EDGES, NO_EDGES, memory(image), board(100))
    assert bool(used[0x20] & layout.READ) is read
