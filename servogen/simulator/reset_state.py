"""The machine's state at power-up: DS35007 section 6.4, tables 6-3 and 6-4.

In: an image, a clock, options. Out: the state vector in the cycle before which nothing has happened.
"""

from __future__ import annotations

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
)
from servogen.pic.image import Image
from servogen.simulator import layout as at
from servogen.simulator.options import Options
from servogen.units import Clock

UNPROGRAMMED_CONFIG = 0x3FFF
"""RC oscillator, watchdog on, power-up timer off: DS35007 section 6.1."""
OST_PERIODS, PERIODS_PER_CYCLE = 1024, 4
"""Oscillator start-up timer: DS35007 section 6.6."""
ALL_PINS, PORT_B = 0x1FFF, 0x1FE0

State = npt.NDArray[np.int64]


def power_up(image: Image, clock: Clock, options: Options) -> State:
    """The state vector after a power-on reset."""
    config = UNPROGRAMMED_CONFIG if image.config is None else image.config
    start_up = 0 if config & CONFIG_OSCILLATOR_MASK == OSCILLATORS["RC"] else OST_PERIODS // PERIODS_PER_CYCLE
    s = np.zeros(at.SLOTS, dtype=np.int64)
    s[RAM_FIRST : RAM_LAST + 1] = options.ram | at.NOT_WRITTEN
    s[at.STATUS] = 0x18
    s[at.OPTION] = 0xFF
    s[at.TRIS] = ALL_PINS
    for slot in (at.IRQ_AT, at.T0_TICK, at.EE_DONE_AT, at.STIM_KNOWN):
        s[slot] = at.NEVER
    s[at.T0_FLAGGED] = -1
    s[at.START_UP] = start_up if options.oscillator_start_up else 0
    s[at.RA4_PULLED_UP] = options.ra4_pull_up
    s[at.FLOATING] = ALL_PINS if options.floating else 0
    s[at.PINS] = (s[at.FLOATING] | (0x10 if options.ra4_pull_up else 0)) & ALL_PINS
    s[at.RB_OLD] = s[at.PINS]
    s[at.WDT_PERIOD] = clock.round_us(options.watchdog_us).cycles if config & CONFIG_WATCHDOG_ON else 0
    s[at.EE_TIME] = clock.round_us(options.eeprom_write_us).cycles
    for address in range(EEPROM_BYTES):
        s[at.EEPROM + address] = image.eeprom.get(address, 0xFF)
    if options.power_up:
        timer = 0 if config & CONFIG_POWER_UP_TIMER_OFF else clock.round_us(options.power_up_us).cycles
        s[at.CYCLE] = s[at.WDT_AT] = s[at.T0_AT] = timer + start_up
    return s
