"""Properties that vary between chips, and the board around the chip."""

from __future__ import annotations

from dataclasses import dataclass

from servogen.errors import InputError
from servogen.pic.device import DEVICES, device


@dataclass(frozen=True, slots=True)
class Options:
    """Times in microseconds. The defaults are the data sheet's typical values."""

    device: str = DEVICES[0].name
    """The chip, which says how long an EEPROM write takes; all else that is simulated is the same on both."""
    ra4_pull_up: bool = False
    """Whether RA4, an open drain, has a pull-up: with it a latch of 1 is HIGH (DS35007 section 4.1)."""
    watchdog_us: int = 18_000
    """The watchdog's period without postscaler: 7000 to 33 000 (DS35007 section 9, parameter 31)."""
    eeprom_write_us: int | None = None
    """One EEPROM write. None: typical of `device` (parameter D122: PIC16F84 10 000, at most 20 000; PIC16F84A
    4000, at most 8000)."""
    tmr0_phase: int = 0
    """For how many cycles, 0 to 3, TMR0 stands still after a write of OPTION_REG that changes its clock
    (T0CS, PSA, or the ratio of its prescaler); the data sheets do not say."""
    power_up: bool = False
    """Whether cycle counts include the power-up timer (if the configuration word has it on) and the
    oscillator start-up timer: DS35007 sections 6.5 and 6.6."""
    power_up_us: int = 72_000
    """The power-up timer: 28 000 to 132 000 (DS35007 section 9, parameter 33)."""
    oscillator_start_up: bool = True
    """Whether a wake-up from SLEEP waits 1024 oscillator periods, as all but RC oscillators do (6.11)."""
    floating: int = 0
    """How an undriven pin without pull-up reads: 0 or 1."""
    ram: int = 0
    """The byte that RAM holds at power-up; on the chip it is unknown, so reads of it are noted."""
    start_seed: int | None = None
    """Draws from this seed, in place of `ram` and of zeros, what has no value at power-up: RAM, W, FSR, C, DC
    and Z, TMR0, the port latches, EEDATA, EEADR, WRERR, RBIF and what RB4 to RB7 are first compared with."""

    def __post_init__(self) -> None:
        for name, low, high in (
            ("watchdog_us", 1, 1_000_000),
            ("tmr0_phase", 0, 3),
            ("power_up_us", 0, 1_000_000),
            ("floating", 0, 1),
            ("ram", 0, 255),
        ):
            if not low <= getattr(self, name) <= high:
                raise InputError(
                    "out-of-range", f"{name} = {getattr(self, name)} is not between {low} and {high}"
                )
        if not 1 <= self.eeprom_us <= 1_000_000:
            raise InputError(
                "out-of-range", f"eeprom_write_us = {self.eeprom_write_us} is not between 1 and 1000000"
            )

    @property
    def eeprom_us(self) -> int:
        """Return the duration of an EEPROM write in µs. Raises InputError if the device is unknown."""
        typical = device(self.device).eeprom_write_us
        return typical if self.eeprom_write_us is None else self.eeprom_write_us
