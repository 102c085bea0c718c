"""The machine's state at power-up: DS35007 section 6.4, tables 6-3 and 6-4.

In: an image, a clock, options. Out: the state vector before the first cycle.
"""

from __future__ import annotations

from random import Random

import numpy as np
import numpy.typing as npt

from servogen.pic.device import (
    CONFIG_OSCILLATOR_MASK,
    CONFIG_POWER_UP_TIMER_OFF,
    CONFIG_WATCHDOG_ON,
    EEPROM_BYTES,
    OSCILLATORS,
    RAM_FIRST,
    RAM_LAST,
    WATCHDOG_US,
)
from servogen.pic.image import Image
from servogen.simulator import layout as at
from servogen.simulator.layout import INTF, RA4, RB4_TO_7, ROWS, T0IF, UNCERTAIN
from servogen.simulator.options import SimulatorOptions
from servogen.simulator.slots import ALL_PINS, SlotFacts
from servogen.units import Clock

OST_PERIODS, PERIODS_PER_CYCLE = 1024, 4
"""Oscillator start-up timer: DS35007 section 6.6."""
START: dict[str, SlotFacts] = {row.start: row for row in ROWS if row.start}
"""The row of each start value beside the RAM."""
POSTSCALER = 128
"""The watchdog's after a reset: OPTION_REG is 0xFF."""

State = npt.NDArray[np.int64]


def power_up(image: Image, clock: Clock, options: SimulatorOptions, tracked: bool) -> State:
    """Return the state vector after a power-on reset; with `tracked`, unknown values are to be tracked."""
    config = image.chip_config
    start_up = 0 if config & CONFIG_OSCILLATOR_MASK == OSCILLATORS["RC"] else OST_PERIODS // PERIODS_PER_CYCLE
    s = np.zeros(at.SLOTS, dtype=np.int64)
    for row in ROWS:
        s[row.number] = row.power_up
    _undefined(s, options)
    s[at.LATCH_UNKNOWN] = ALL_PINS
    if tracked:
        _note_unknown(s, options)
    s[at.START_UP] = start_up if options.oscillator_start_up else 0
    s[at.RESISTORS] = options.resistors
    s[at.PINS] = s[at.FLOATING] | options.resistors
    shortest = min(options.watchdog_us, WATCHDOG_US[0])
    s[at.WDT_PERIOD] = clock.round_us(options.watchdog_us).cycles if config & CONFIG_WATCHDOG_ON else 0
    s[at.WDT_SHORTEST] = clock.round_us(shortest).cycles if config & CONFIG_WATCHDOG_ON else 0
    s[at.EE_TIME] = clock.round_us(options.eeprom_us).cycles
    s[at.T0_PHASE] = options.tmr0_phase
    s[at.EEPROM : at.EEPROM + EEPROM_BYTES] = [image.eeprom.get(each, 0xFF) for each in range(EEPROM_BYTES)]
    if options.power_up:
        timer = 0 if config & CONFIG_POWER_UP_TIMER_OFF else clock.round_us(options.power_up_us).cycles
        s[at.CYCLE] = s[at.WDT_AT] = s[at.WDT_CLEARED] = s[at.T0_AT] = timer + start_up
    if s[at.WDT_SHORTEST]:
        s[at.WDT_EARLIEST] = s[at.CYCLE] + POSTSCALER * s[at.WDT_SHORTEST]
    return s


def _undefined(s: State, options: SimulatorOptions) -> None:
    """Give a value to each location that table 6-4 marks "x", and note that it is unknown."""
    draw = None if options.start_seed is None else Random(options.start_seed)

    def any_byte() -> int:
        return 0 if draw is None else draw.randrange(0x100)

    s[RAM_FIRST : RAM_LAST + 1] = [any_byte() | at.NOT_WRITTEN for _ in range(RAM_FIRST, RAM_LAST + 1)]
    for row in ROWS:
        if row.undefined:
            width = (row.bits >> row.first_bit).bit_length()
            drawn = sum(any_byte() << place for place in range(0, width, 8)) << row.first_bit
            s[row.number] |= drawn & row.undefined
    s[at.FLOATING] = ALL_PINS if options.floating else 0
    if draw is None:
        s[at.RB_OLD] = s[at.FLOATING] & RB4_TO_7
    for name, value in options.start:
        _give(s, name, value)


def _give(s: State, name: str, value: int) -> None:
    """Set one of `options.START_VALUES`."""
    if name == "ram":
        s[RAM_FIRST : RAM_LAST + 1] = value | at.NOT_WRITTEN
    elif name.startswith("0x"):
        s[int(name, 16)] = value | at.NOT_WRITTEN
    else:
        row = START[name]
        s[row.number] = int(s[row.number]) & ~row.undefined | value << row.shift


def _note_unknown(s: State, options: SimulatorOptions) -> None:
    """Note what is unknown: everything that table 6-4 marks "x", and what depends on pins that nothing
    drives.
    """

    s[at.TRACKED] = 1
    for address in range(RAM_FIRST, RAM_LAST + 1):
        s[address] |= (0xFF | address << 8) << at.UNKNOWN_SHIFT
    for row, mask in UNCERTAIN:
        s[mask] = row.undefined | row.source << 8
    s[at.PINS_UNKNOWN] = ALL_PINS & ~options.resistors
    s[at.INTCON_UNKNOWN] |= INTF | (0 if options.resistors & RA4 else T0IF)
