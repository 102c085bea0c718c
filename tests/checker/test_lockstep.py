"""The checker's chip contains the simulator's: random programs, start values, levels at the pins, and phases.

More of them: SERVOGEN_LOCKSTEP_PROGRAMS=300.
"""

from __future__ import annotations

import os

import numpy as np

from servogen.checker import chip
from tests.checker.certify import image_of
from tests.checker.lockstep import NO_EDGES, compare, power_up, program

PROGRAMS = int(os.environ.get("SERVOGEN_LOCKSTEP_PROGRAMS", "12"))


def test_every_state_of_the_simulator_is_within_the_checkers() -> None:
    found = [compare(program(seed), seed, cycles=1200) for seed in range(PROGRAMS)]
    assert sum(each.instructions for each in found) > 500 * PROGRAMS
    assert sum(each.asked for each in found) > 5 * PROGRAMS
    assert sum(each.phased for each in found) > PROGRAMS // 6
    refused = {each.reason for each in found} - {chip.TOO_LONG}
    assert chip.WRONG_EDGE not in refused
    assert chip.MISSING not in refused


POLL = """ list p=16f84
 radix dec
 __config 0x3ff1
 org 0
 bsf 3,5
 movlw 0xc4
 movwf 1
 bcf 3,5
 clrf 1
 movlw 200
 movwf 0x22
wait movf 1,w
 xorwf 0x22,w
 btfss 3,2
 goto wait
 clrf 0x20
 movlw 3
 movwf 0x21
turn goto $+1
 nop
 decfsz 0x20,f
 goto $+2
 decfsz 0x21,f
 goto turn
 goto 0
"""


def test_turns_are_skipped_and_nothing_else_changes() -> None:
    """A wait for TMR0 = 200 at 1:32, then 3 · 256 turns of 8 cycles: in one go, and cycle by cycle."""
    code = chip.program_code(image_of(POLL), frozenset())
    parameters = np.zeros(chip.PARAMETERS, dtype=np.int64)
    parameters[chip.PERIOD] = chip.NEVER
    at_once, stepped = power_up(), power_up()
    for limit in (3000, 6000, 6499, 7500, 12_000, 40_000):
        parameters[chip.LIMIT] = limit
        assert chip.run(at_once, code, parameters, NO_EDGES, NO_EDGES) == chip.TOO_LONG
        while stepped[chip.CYCLE] < at_once[chip.CYCLE]:
            parameters[chip.LIMIT] = stepped[chip.CYCLE] + 1
            chip.run(stepped, code, parameters, NO_EDGES, NO_EDGES)
        different = np.flatnonzero(at_once != stepped).tolist()
        assert different in ([], [chip.STEPS]), (limit, different)
    assert at_once[chip.STEPS] < stepped[chip.STEPS] / 3
