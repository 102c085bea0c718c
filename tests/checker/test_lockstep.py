"""The checker's chip contains the simulator's: random programs, start values, levels at the pins, and phases.

More of them: SERVOGEN_LOCKSTEP_PROGRAMS=300.
"""

from __future__ import annotations

import os

import numpy as np
import pytest

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


def test_a_state_that_is_not_run_ends_as_if_it_were() -> None:
    """Random programs from states that differ in a few bytes of RAM: together, and each by itself.

    Some bytes decide and some do not, and some are unknown. The sums of cycles tell whether any were saved.
    """
    saved = 0
    begins = np.array([0, 0])
    for seed in range(PROGRAMS):
        rng = np.random.default_rng(seed)
        code = chip.program_code(program(seed), frozenset())
        parameters = np.zeros(chip.PARAMETERS, dtype=np.int64)
        parameters[chip.PERIOD], parameters[chip.LIMIT] = chip.NEVER, 400
        together = np.stack([power_up()] * 60)
        together[:, chip.RAM : chip.RAM_END] = rng.integers(256, size=chip.RAM_END - chip.RAM)
        for row in together:
            some = rng.integers(chip.RAM, chip.RAM_END, size=4)
            row[some] = rng.choice([chip.UNKNOWN, 0, 1, 255], size=4)
        alone = together.copy()
        reasons = np.zeros(len(together), dtype=np.int64)
        cycles = chip.run_all(together, code, parameters, begins, NO_EDGES, NO_EDGES, reasons)
        for row, expected, reason in zip(together, alone, reasons, strict=True):
            used = np.zeros(chip.SLOTS, dtype=np.int64)
            assert chip.run(expected, code, parameters, used, NO_EDGES, NO_EDGES) == reason, seed
            assert np.array_equal(row, expected), seed
            saved += int(expected[chip.CYCLE])
        saved -= cycles
    assert saved > 1000 * PROGRAMS


@pytest.mark.parametrize(
    ("decides", "runs"),
    [
        ("movf 0x20,w", 3),  # read: each of the three values is run
        ("clrf 0x20\n movf 0x20,w", 1),  # overwritten first
        ("movlw 0x20\n movwf 4\n movf 0,w", 3),  # read through the pointer
        ("btfsc 0x20,0", 3),
        ("incf 0x20,f", 3),
        ("movf 0x21,w", 1),  # another byte
    ],
)
def test_only_states_that_agree_in_what_is_read_share_a_run(decides: str, runs: int) -> None:
    code = chip.program_code(image_of(f" list p=16f84\n org 0\n {decides}\n goto $\n"), frozenset())
    parameters = np.zeros(chip.PARAMETERS, dtype=np.int64)
    parameters[chip.PERIOD], parameters[chip.LIMIT] = chip.NEVER, 100
    rows = np.stack([power_up()] * 6)
    rows[:, [0x20, 0x21]] = [[5, 1], [7, 1], [5, 1], [9, 1], [7, 1], [5, 1]]
    reasons = np.zeros(6, dtype=np.int64)
    cycles = chip.run_all(rows, code, parameters, np.array([0, 0]), NO_EDGES, NO_EDGES, reasons)
    assert reasons.tolist() == [chip.TOO_LONG] * 6
    assert cycles // 100 == runs
