"""Options and arguments that several commands share, each with one meaning and one help text."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from servogen.simulator import Options

NEGATIVE_NUMBERS = {"ignore_unknown_options": True}
"""Context settings of a command whose arguments may be negative numbers: -5 is no option."""

LONGEST_SECONDS = 1e9
"""Thirty years."""

LONGEST_CYCLES = 10**16

DEFAULT_CLOCK_HZ = 4_000_000


def number(text: str) -> float:
    """A number of the command line; the error names what was typed."""
    try:
        return float(text)
    except ValueError:
        kind = "option" if text.startswith("-") else "number"
        raise typer.BadParameter(f"'{text}' is no {kind}") from None


Json = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]
DeviceName = Annotated[str, typer.Option("--device", help="PIC16F84 or PIC16F84A.")]


def duration(text: str) -> float:
    """Seconds of the command line: not negative, and not beyond what a simulation can count."""
    seconds = number(text)
    if not 0 <= seconds <= LONGEST_SECONDS:
        raise typer.BadParameter(f"'{text}' is not between 0 and {LONGEST_SECONDS:g} seconds")
    return seconds


Seconds = Annotated[
    float | None,
    typer.Option("--seconds", parser=duration, metavar="SECONDS", help="How long, in simulated seconds."),
]
ClockHz = Annotated[
    int | None, typer.Option("--clock-hz", min=1, help="Default: what the C says, else 4 MHz.")
]
Partial = Annotated[
    bool,
    typer.Option(
        "--partial",
        help="Exit with 0 as well where all that was seen is right, but not every frame was seen.",
    ),
]
CaptureRate = Annotated[
    int | None,
    typer.Option("--rate", min=1, help="A capture's samples a second, where its file does not tell."),
]
Ra4PullUp = Annotated[bool, typer.Option("--ra4-pull-up", help="RA4, an open drain, has a pull-up resistor.")]
WatchdogUs = Annotated[
    int, typer.Option("--watchdog-us", help="The watchdog's period; of real chips 7000 to 33000.")
]
EepromWriteUs = Annotated[
    int | None, typer.Option("--eeprom-write-us", help="One EEPROM write (default: typical of the device).")
]
PowerUp = Annotated[
    bool, typer.Option("--power-up", help="Count the power-up and the oscillator's start-up time.")
]
PowerUpUs = Annotated[
    int, typer.Option("--power-up-us", help="The power-up timer; of real chips 28000 to 132000.")
]
OscillatorStartUp = Annotated[
    bool,
    typer.Option(
        "--oscillator-start-up/--no-oscillator-start-up",
        help="A wake-up waits 1024 oscillator periods, unless the oscillator is RC.",
    ),
]
StartRam = Annotated[int, typer.Option("--ram", help="The byte that RAM holds at power-up, 0 to 255.")]
Floating = Annotated[int, typer.Option("--floating", help="How a pin reads that nothing drives: 0 or 1.")]
StartSeed = Annotated[
    int | None,
    typer.Option("--start-seed", help="Draw from this seed all that has no value at power-up."),
]
Tmr0Phase = Annotated[
    int,
    typer.Option(
        "--tmr0-phase", help="Cycles, 0 to 3, that TMR0 stands still after its clock is chosen by OPTION_REG."
    ),
]
DEFAULT_WATCHDOG_US, DEFAULT_POWER_UP_US = 18_000, 72_000


def machine_options(
    device: str,
    *,
    ra4_pull_up: bool,
    watchdog_us: int,
    eeprom_write_us: int | None,
    power_up: bool,
    power_up_us: int,
    oscillator_start_up: bool,
    ram: int,
    floating: int,
    start_seed: int | None,
    tmr0_phase: int,
) -> Options:
    """Return the simulator's options as the command line gives them. Raises InputError."""
    from servogen.simulator import Options

    return Options(
        device=device,
        ra4_pull_up=ra4_pull_up,
        watchdog_us=watchdog_us,
        eeprom_write_us=eeprom_write_us,
        power_up=power_up,
        power_up_us=power_up_us,
        oscillator_start_up=oscillator_start_up,
        ram=ram,
        floating=floating,
        start_seed=start_seed,
        tmr0_phase=tmr0_phase,
    )


Output = Annotated[Path | None, typer.Option("--output", "-o", help="The file to write.")]


class Dialect(StrEnum):
    """The C dialects."""

    c2c = "c2c"
    xc8 = "xc8"
    sdcc = "sdcc"
