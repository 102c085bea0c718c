"""Flags that pins, an unknown TMR0 and the end of an EEPROM write set at any time: whatever the simulator
does, one of the checker's ways contains it.

More programs: SERVOGEN_LOCKSTEP_PROGRAMS=300.
"""

from __future__ import annotations

import os
import random
from collections import Counter
from typing import NamedTuple

import numpy as np
import pytest

from servogen.checker import chip, layout
from servogen.pic.image import Image
from servogen.pic.isa import encode
from servogen.simulator import Machine, MachineState, SimulatorOptions
from tests.campaigns import sampled
from tests.checker import lockstep
from tests.simulator import programs

PROGRAMS = int(os.environ.get("SERVOGEN_LOCKSTEP_PROGRAMS", "4"))
CYCLES, STATES, WRITE_US = 250, 100, 60
UNDECIDED = "the checker gives up, or has more ways than are followed here"
BY_ITSELF = {layout.MAY_INTERRUPT: "interrupt", layout.MAY_BE_WRITTEN: "write"}


def program(seed: int) -> Image:
    """Interrupts by INT, port B, TMR0 (whose count is unknown in half of them) and the end of a write."""
    rng = random.Random(seed)
    clear = [encode("BCF", f=0x0B, b=b) for b in (0, 1, 2)]
    routine = [encode("BCF", f=3, b=5), encode("MOVF", f=6, d=0), *clear, encode("INCF", f=0x20, d=1)]
    over = [encode("BSF", f=3, b=5), encode("BCF", f=8, b=4), encode("BCF", f=3, b=5)]
    words = [encode("GOTO", k=24), *[encode("NOP")] * 3, *routine, *over, encode("RETFIE")]
    words += [encode("NOP")] * (24 - len(words))
    words += [encode("CLRF", f=5), encode("CLRF", f=6), encode("BSF", f=3, b=5)]
    for register, value in ((6, rng.choice((0xF1, 0xFF))), (1, rng.choice((0xC0, 0xC2, 0xC8)))):
        words += [encode("MOVLW", k=value), encode("MOVWF", f=register)]
    words += [encode("BCF", f=3, b=5)]
    if rng.random() < 0.5:
        words += [encode("MOVLW", k=rng.randrange(200, 256)), encode("MOVWF", f=1)]
    enabled = rng.choice((0x90, 0x88, 0x98, 0xA0, 0xC0, 0xF8))
    words += [encode("MOVLW", k=enabled), encode("MOVWF", f=0x0B)]
    main = len(words)
    while len(words) < main + 30:
        piece = rng.choice((programs.literal, programs.bit, programs.subroutine, programs.eeprom))
        words += piece(rng, len(words))
    return Image(dict(enumerate([*words, encode("GOTO", k=main)])), 0x3FF1)


class Followed(NamedTuple):
    cycles: int
    asked: Counter[str]
    end: str
    """Why no state contains the simulator's: "" if one does to the end; or `UNDECIDED`."""


def follow(seed: int, but: int = 0, forget: int = 0) -> Followed:
    """Run the simulator, and every way of the checker that contains it; the ways `but` are left out, and the
    flags `forget` are taken for known ones after each instruction.
    """
    image = program(seed)
    options = SimulatorOptions(start_seed=seed, floating=True, ra4_pull_up=False, eeprom_write_us=WRITE_US)
    runs = [Machine(image, lockstep.CLOCK, options, lockstep.noise(random.Random(seed), CYCLES))
            for _ in range(2)]  # fmt: skip
    expected, held = lockstep.outputs(runs[0], CYCLES), lockstep.memory(image)
    machine, states, asked = runs[1], [lockstep.power_up()], Counter[str]()
    while machine.cycles < CYCLES:
        before = machine.state()
        machine.step()
        after, kept, waiting = machine.state(), list[chip.Ints](), states
        while waiting:
            s = waiting.pop()
            if s[layout.CYCLE] >= machine.cycles:
                if s[layout.CYCLE] > machine.cycles or within(s, after, seed):
                    kept.append(s)
                continue
            around = lockstep.board(machine.cycles)._replace(longest_write=WRITE_US + 40)
            why = chip.run(s, np.zeros(layout.SLOTS, dtype=np.int64), *expected, held, around)
            s[layout.INTCON] &= ~(forget << 8)
            if why == layout.FORK:
                lockstep.give(s, before, image)
                waiting.append(s)
            elif why in BY_ITSELF:
                asked[BY_ITSELF[why]] += 1
                for way in (1 << bit for bit in range(10) if s[layout.ASKED_BITS] & ~but & 1 << bit):
                    waiting.append(s.copy())
                    waiting[-1][layout.WAY] = way
            elif why in (layout.TOO_LONG, layout.LAST_EDGE):
                waiting.append(s)
            else:
                return Followed(machine.cycles, asked, UNDECIDED)
        if not kept:
            return Followed(machine.cycles, asked, f"seed {seed}: no way contains it")
        for s in kept:
            s[[layout.ASKED, layout.ASKED_BITS]] = 0
        unique = {s.tobytes(): s for s in kept}
        if len(unique) > STATES:
            return Followed(machine.cycles, asked, UNDECIDED)
        states = [*unique.values()]
    return Followed(machine.cycles, asked, "")


def within(s: chip.Ints, state: MachineState, seed: int) -> bool:
    """Return whether a state of the simulator is within one of the checker's."""
    if state.pc & 0x3FF != s[layout.PC]:
        return False
    try:
        lockstep.contained(s, state, -1, seed)
    except AssertionError:
        return False
    return True


def test_one_of_the_ways_contains_whatever_interrupts_and_whenever_a_write_ends() -> None:
    found = [follow(seed) for seed in range(PROGRAMS)]
    assert {each.end for each in found} <= {"", UNDECIDED}
    asked = sum((each.asked for each in found), Counter[str]())
    assert min(asked["interrupt"], asked["write"]) > 20 * PROGRAMS
    assert sum(each.end == "" for each in found) > PROGRAMS // 2


@pytest.mark.parametrize(
    ("seed", "but", "forget"),
    sampled(
        [
            (1, layout.INTF << layout.IS_NOP | layout.INTF, 0),
            (3, layout.RBIF << layout.IS_NOP | layout.RBIF, 0),
            (26, layout.WRITE_OVER << layout.IS_NOP | layout.WRITE_OVER, 0),
            (11, layout.T0IF << layout.IS_NOP | layout.T0IF, 0),
            (1, layout.NOTHING, 0),
            (1, 0, layout.INTF),
            (0, 0, layout.RBIF),
        ],
        4,
    ),
)
def test_without_a_way_or_with_a_flag_that_is_taken_for_known_none_does(
    seed: int, but: int, forget: int
) -> None:
    assert follow(seed).end == ""
    assert "no way contains it" in follow(seed, but, forget).end
