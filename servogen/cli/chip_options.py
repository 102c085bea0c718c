"""The options of the simulated chip, for the commands that run a program."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Annotated

import typer

from servogen.simulator.options import SimulatorOptions, start_value

DEFAULTS = SimulatorOptions()


@dataclass(frozen=True, slots=True)
class ChipOptions:
    """The options of the simulated chip and its board; their defaults are the simulator's."""

    ra4_pull_up: Annotated[bool, "Connect a pull-up resistor to RA4, which is an open drain."] = (
        DEFAULTS.ra4_pull_up
    )
    watchdog_us: Annotated[int, "The watchdog's period in µs; 7000 to 33000 on real chips."] = (
        DEFAULTS.watchdog_us
    )
    eeprom_write_us: Annotated[
        int | None, "Duration of an EEPROM write in µs (default: typical of the device)."
    ] = DEFAULTS.eeprom_write_us
    power_up: Annotated[bool, "Include the power-up timer and the oscillator's start-up time."] = (
        DEFAULTS.power_up
    )
    power_up_us: Annotated[int, "The power-up timer's period in µs; 28000 to 132000 on real chips."] = (
        DEFAULTS.power_up_us
    )
    oscillator_start_up: Annotated[
        bool,
        typer.Option(
            "--oscillator-start-up/--no-oscillator-start-up",
            help="Wait 1024 oscillator periods after a wake-up, unless the oscillator is RC.",
        ),
    ] = DEFAULTS.oscillator_start_up
    floating: Annotated[int, "The level read from a pin that nothing drives: 0 or 1."] = DEFAULTS.floating
    start_seed: Annotated[int | None, "Seed for everything that is undefined at power-up."] = (
        DEFAULTS.start_seed
    )
    start: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE", help="A value at power-up, such as w=0x12, 0x20=7 or ram=255 (repeatable)."
        ),
    ] = None
    tmr0_phase: Annotated[
        int, "Cycles (0 to 3) for which TMR0 pauses after OPTION_REG selects its clock."
    ] = DEFAULTS.tmr0_phase

    def on(self, device: str) -> SimulatorOptions:
        """Return the simulator's options for a device. Raises InputError."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        start = tuple(start_value(text) for text in self.start or ())
        return SimulatorOptions(device=device, **{**values, "start": start})

    @property
    def given(self) -> bool:
        """Return whether any differs from its default."""
        return replace(self, start=self.start or None) != ChipOptions()
