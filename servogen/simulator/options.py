"""Properties that vary between chips, and the board around the chip."""

from __future__ import annotations

from dataclasses import dataclass

from servogen.errors import InputError, check_known
from servogen.pic.device import DEVICES, RAM_FIRST, RAM_LAST, device
from servogen.simulator.devices import OnPins
from servogen.simulator.layout import RA4, ROWS

START_VALUES = {
    "ram": 0xFF,
    **{row.start: row.undefined >> row.shift for row in ROWS if row.start},
    **{f"0x{address:02X}": 0xFF for address in range(RAM_FIRST, RAM_LAST + 1)},
}
"""Everything without a value at power-up (marked "x" in table 6-4), with its largest value: the whole RAM or
one byte of it; C, DC and Z; the latches as a word of the thirteen pins, RA0 first; the levels with which RB4
to RB7 are first compared."""


def start_value(text: str) -> tuple[str, int]:
    """Return the name and value in "NAME=VALUE". Raises InputError."""
    name, equals, number = text.partition("=")
    try:
        name = f"0x{int(name, 16):02X}" if name[:2].lower() == "0x" else name.lower()
        value = int(number, 0)
    except ValueError:
        equals = ""
        value = 0
    if not equals:
        raise InputError("bad-start-value", f"'{text}' is not NAME=VALUE", hint="as in w=0x12 or 0x20=255")
    return name, value


@dataclass(frozen=True, slots=True)
class SimulatorOptions:
    """Times in microseconds. The defaults are the data sheet's typical values."""

    device: str = DEVICES[0].name
    """The chip, which determines the duration of an EEPROM write; everything else is the same on both
    chips.
    """
    ra4_pull_up: bool = False
    """Whether RA4, an open drain, has a pull-up: with it a latch of 1 is HIGH (DS35007 section 4.1)."""
    watchdog_us: int = 18_000
    """The watchdog's period without postscaler: 7000 to 33 000 (DS35007 section 9, parameter 31)."""
    eeprom_write_us: int | None = None
    """One EEPROM write. None: typical of `device` (parameter D122: PIC16F84 10 000, at most 20 000; PIC16F84A
    4000, at most 8000)."""
    tmr0_phase: int = 0
    """The number of cycles, 0 to 3, for which TMR0 stands still after a write of OPTION_REG that changes its
    clock (T0CS, PSA, or the ratio of its prescaler); the data sheets do not specify it."""
    power_up: bool = False
    """Whether cycle counts include the power-up timer (if the configuration word has it on) and the
    oscillator start-up timer: DS35007 sections 6.5 and 6.6."""
    power_up_us: int = 72_000
    """The power-up timer: 28 000 to 132 000 (DS35007 section 9, parameter 33)."""
    oscillator_start_up: bool = True
    """Whether a wake-up from SLEEP waits 1024 oscillator periods, as all but RC oscillators do (6.11)."""
    floating: int = 0
    """The level read from an undriven pin without pull-up: 0 or 1."""
    start_seed: int | None = None
    """The seed from which values that are undefined at power-up are drawn; None: they are 0. These are RAM,
    W, FSR, C, DC and Z, TMR0, the port latches, EEDATA, EEADR, WRERR, RBIF and the levels with which RB4 to
    RB7 are first compared."""
    start: tuple[tuple[str, int], ...] = ()
    """Values at power-up, by names of `START_VALUES`, that override those; the last one of a name applies."""
    devices: tuple[OnPins, ...] = ()
    """Devices on pins, each with a resistor to the supply at its pins."""

    def __post_init__(self) -> None:
        for name, low, high in (
            ("watchdog_us", 1, 1_000_000),
            ("tmr0_phase", 0, 3),
            ("power_up_us", 0, 1_000_000),
            ("floating", 0, 1),
        ):
            if not low <= getattr(self, name) <= high:
                raise InputError(
                    "out-of-range", f"{name} = {getattr(self, name)} is not between {low} and {high}"
                )
        for name, value in self.start:
            check_known("bad-start-value", name, START_VALUES, f"there is no start value '{name}'")
            if not 0 <= value <= START_VALUES[name]:
                raise InputError(
                    "out-of-range", f"start value {name} = {value} is not between 0 and {START_VALUES[name]}"
                )
        if not 1 <= self.eeprom_us <= 1_000_000:
            raise InputError(
                "out-of-range", f"eeprom_write_us = {self.eeprom_write_us} is not between 1 and 1000000"
            )

    @property
    def device_pins(self) -> frozenset[int]:
        """Return the pins that devices are on."""
        return frozenset(pin for device in self.devices for pin in device.pins)

    @property
    def resistors(self) -> int:
        """Return the pins with a resistor to the supply, as bits."""
        return sum(1 << pin for pin in self.device_pins) | (RA4 if self.ra4_pull_up else 0)

    @property
    def eeprom_us(self) -> int:
        """Return the duration of an EEPROM write in µs. Raises InputError if the device is unknown."""
        typical = device(self.device).eeprom_write_us
        return typical if self.eeprom_write_us is None else self.eeprom_write_us
