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
from servogen.simulator.layout import (
    INTF,
    RBIF,
    SOURCE_EEADR,
    SOURCE_EEDATA,
    SOURCE_FLAGS,
    SOURCE_FSR,
    SOURCE_TMR0,
    SOURCE_W,
    T0IF,
)
from servogen.simulator.options import SimulatorOptions
from servogen.units import Clock

UNPROGRAMMED_CONFIG = 0x3FFF
"""RC oscillator, watchdog on, power-up timer off: DS35007 section 6.1."""
OST_PERIODS, PERIODS_PER_CYCLE = 1024, 4
"""Oscillator start-up timer: DS35007 section 6.6."""
ALL_PINS, RA4, RB4_TO_7 = 0x1FFF, 1 << 4, 0xF0 << 5
POSTSCALER = 128
"""The watchdog's after a reset: OPTION_REG is 0xFF."""
WRERR = 0x08  # of EECON1

State = npt.NDArray[np.int64]

BITS_OF = {
    "w": (at.W, 0xFF, 0),
    "fsr": (at.FSR, 0xFF, 0),
    "flags": (at.STATUS, 0x07, 0),
    "tmr0": (at.T0_VALUE, 0xFF, 0),
    "latches": (at.LATCH, ALL_PINS, 0),
    "eedata": (at.EEDATA, 0xFF, 0),
    "eeadr": (at.EEADR, 0xFF, 0),
    "wrerr": (at.EECON1, WRERR, 3),
    "rbif": (at.INTCON, RBIF, 0),
    "rb-old": (at.RB_OLD, RB4_TO_7, 9),
}
"""Slot, bits and shift of each start value beside the RAM."""


def power_up(image: Image, clock: Clock, options: SimulatorOptions, tracked: bool) -> State:
    """Return the state vector after a power-on reset; with `tracked`, unknown values are to be tracked."""
    config = UNPROGRAMMED_CONFIG if image.config is None else image.config
    start_up = 0 if config & CONFIG_OSCILLATOR_MASK == OSCILLATORS["RC"] else OST_PERIODS // PERIODS_PER_CYCLE
    s = np.zeros(at.SLOTS, dtype=np.int64)
    _undefined(s, options)
    s[at.LATCH_UNKNOWN] = ALL_PINS
    if tracked:
        _note_unknown(s, options)
    s[at.OPTION] = 0xFF
    s[at.TRIS] = ALL_PINS
    for slot in (at.IRQ_AT, at.T0_TICK, at.EE_DONE_AT, at.STIM_KNOWN):
        s[slot] = at.NEVER
    s[at.T0_FLAGGED] = -1
    s[at.START_UP] = start_up if options.oscillator_start_up else 0
    s[at.RA4_PULLED_UP] = options.ra4_pull_up
    s[at.PINS] = (s[at.FLOATING] | (0x10 if options.ra4_pull_up else 0)) & ALL_PINS
    shortest = min(options.watchdog_us, WATCHDOG_US[0])
    s[at.WDT_PERIOD] = clock.round_us(options.watchdog_us).cycles if config & CONFIG_WATCHDOG_ON else 0
    s[at.WDT_SHORTEST] = clock.round_us(shortest).cycles if config & CONFIG_WATCHDOG_ON else 0
    s[at.EE_TIME] = clock.round_us(options.eeprom_us).cycles
    s[at.T0_PHASE] = options.tmr0_phase
    for address in range(EEPROM_BYTES):
        s[at.EEPROM + address] = image.eeprom.get(address, 0xFF)
    if options.power_up:
        timer = 0 if config & CONFIG_POWER_UP_TIMER_OFF else clock.round_us(options.power_up_us).cycles
        s[at.CYCLE] = s[at.WDT_AT] = s[at.WDT_CLEARED] = s[at.T0_AT] = timer + start_up
    s[at.WDT_EARLIEST] = at.NEVER
    if s[at.WDT_SHORTEST]:
        s[at.WDT_EARLIEST] = s[at.CYCLE] + POSTSCALER * s[at.WDT_SHORTEST]
    return s


def _undefined(s: State, options: SimulatorOptions) -> None:
    """Give a value to each location that table 6-4 marks "x", and note that it is unknown."""
    draw = None if options.start_seed is None else Random(options.start_seed)

    def any_byte(default: int = 0) -> int:
        return default if draw is None else draw.randrange(0x100)

    for address in range(RAM_FIRST, RAM_LAST + 1):
        s[address] = any_byte() | at.NOT_WRITTEN
    s[at.W] = any_byte()
    s[at.STATUS] = 0x18 | any_byte() & 7
    s[at.FSR] = any_byte()
    s[at.T0_VALUE] = any_byte()
    s[at.EEDATA] = any_byte()
    s[at.EEADR] = any_byte()
    s[at.EECON1] = any_byte() & WRERR
    s[at.INTCON] = any_byte() & RBIF
    s[at.LATCH] = any_byte() | (any_byte() & 0x1F) << 8
    s[at.FLOATING] = ALL_PINS if options.floating else 0
    s[at.RB_OLD] = any_byte(int(s[at.FLOATING]) >> 5) << 5
    for name, value in options.start:
        _give(s, name, value)


def _give(s: State, name: str, value: int) -> None:
    """Set one of `options.START_VALUES`."""
    if name == "ram":
        s[RAM_FIRST : RAM_LAST + 1] = value | at.NOT_WRITTEN
    elif name.startswith("0x"):
        s[int(name, 16)] = value | at.NOT_WRITTEN
    else:
        slot, mask, shift = BITS_OF[name]
        s[slot] = int(s[slot]) & ~mask | value << shift


def _note_unknown(s: State, options: SimulatorOptions) -> None:
    """Note what is unknown: everything that table 6-4 marks "x", and what depends on pins that nothing
    drives.
    """

    def unknown(slot: int, source: int) -> None:
        s[slot] = 0xFF | source << 8

    s[at.TRACKED] = 1
    for address in range(RAM_FIRST, RAM_LAST + 1):
        s[address] |= (0xFF | address << 8) << at.UNKNOWN_SHIFT
    unknown(at.W_UNKNOWN, SOURCE_W)
    unknown(at.FSR_UNKNOWN, SOURCE_FSR)
    unknown(at.T0_UNKNOWN, SOURCE_TMR0)
    unknown(at.EEDATA_UNKNOWN, SOURCE_EEDATA)
    unknown(at.EEADR_UNKNOWN, SOURCE_EEADR)
    s[at.STATUS_UNKNOWN] = 7 | SOURCE_FLAGS << 8
    s[at.EECON1_UNKNOWN] = WRERR
    s[at.RB_OLD_UNKNOWN] = RB4_TO_7
    s[at.PINS_UNKNOWN] = ALL_PINS & ~(RA4 if options.ra4_pull_up else 0)
    s[at.INTCON_UNKNOWN] = RBIF | INTF | (0 if options.ra4_pull_up else T0IF)
