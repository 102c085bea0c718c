"""Options and arguments that several commands share, each with one meaning and one help text."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import Field, dataclass, fields
from enum import StrEnum
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from servogen.simulator.options import SimulatorOptions, start_value

NEGATIVE_NUMBERS = {"ignore_unknown_options": True}
"""Context settings of a command whose arguments may be negative numbers: -5 is not an option."""

MAX_SECONDS = 1e9
"""The longest time, thirty years, that a simulation can count."""

MAX_CYCLES = 10**16


def number(text: str) -> float:
    """Return a number from the command line. Raises BadParameter, which quotes the text."""
    try:
        return float(text)
    except ValueError:
        kind = "an option" if text.startswith("-") else "a number"
        raise typer.BadParameter(f"'{text}' is not {kind}") from None


JobFile = Annotated[Path, typer.Argument(help="A job file (TOML).", show_default=False)]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
ServerPort = Annotated[
    int, typer.Option("--port", min=0, max=65_535, help="Port of the server (default: any free one).")
]
OpensBrowser = Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")]
DeviceName = Annotated[str, typer.Option("--device", help="The chip: PIC16F84 or PIC16F84A.")]
OwnDevice = Annotated[
    str | None,
    typer.Option(
        "--device",
        help="The chip: PIC16F84 or PIC16F84A (default: that of the job, schedule or header, else PIC16F84).",
    ),
]


def duration(text: str) -> float:
    """Return a time in seconds from the command line, at most `MAX_SECONDS`. Raises BadParameter."""
    seconds = number(text)
    if not 0 <= seconds <= MAX_SECONDS:
        raise typer.BadParameter(f"'{text}' is not between 0 and {MAX_SECONDS:g} seconds")
    return seconds


Seconds = Annotated[
    float | None,
    typer.Option("--seconds", parser=duration, metavar="SECONDS", help="Duration in simulated seconds."),
]
ClockHz = Annotated[
    int | None,
    typer.Option("--clock-hz", min=1, help="The clock in Hz (default: the one stated in the C, else 4 MHz)."),
]
StimulusFile = Annotated[
    Path | None, typer.Option("--stimulus", help="A TOML file of the signals that drive the pins.")
]
Partial = Annotated[
    bool,
    typer.Option(
        "--partial",
        help="Also exit with 0 if all recorded frames are right but some were not recorded.",
    ),
]
CaptureRate = Annotated[
    int | None,
    typer.Option("--rate", min=1, help="The capture's sampling rate in Hz, if its file does not state it."),
]
RecordedWires = Annotated[
    list[str] | None,
    typer.Option(
        "--wire",
        metavar="CHANNEL=PIN",
        help="The pin of a recorded channel that is not named after one, such as D0=RB0 (repeatable); then "
        "only these are read.",
    ),
]
CHIP_OPTIONS: Mapping[str, tuple[object, Any]] = {
    # name of the simulator's option: its type and how the command line spells it
    "ra4_pull_up": (
        bool,
        typer.Option("--ra4-pull-up", help="Connect a pull-up resistor to RA4, which is an open drain."),
    ),
    "watchdog_us": (
        int,
        typer.Option("--watchdog-us", help="The watchdog's period in µs; 7000 to 33000 on real chips."),
    ),
    "eeprom_write_us": (
        int | None,
        typer.Option(
            "--eeprom-write-us", help="Duration of an EEPROM write in µs (default: typical of the device)."
        ),
    ),
    "power_up": (
        bool,
        typer.Option("--power-up", help="Include the power-up timer and the oscillator's start-up time."),
    ),
    "power_up_us": (
        int,
        typer.Option(
            "--power-up-us", help="The power-up timer's period in µs; 28000 to 132000 on real chips."
        ),
    ),
    "oscillator_start_up": (
        bool,
        typer.Option(
            "--oscillator-start-up/--no-oscillator-start-up",
            help="Wait 1024 oscillator periods after a wake-up, unless the oscillator is RC.",
        ),
    ),
    "floating": (
        int,
        typer.Option("--floating", help="The level read from a pin that nothing drives: 0 or 1."),
    ),
    "start_seed": (
        int | None,
        typer.Option("--start-seed", help="Seed for everything that is undefined at power-up."),
    ),
    "start": (
        list[str],
        typer.Option(
            "--start",
            metavar="NAME=VALUE",
            help="A value at power-up, such as w=0x12, 0x20=7 or ram=255 (repeatable).",
        ),
    ),
    "tmr0_phase": (
        int,
        typer.Option(
            "--tmr0-phase",
            help="Cycles (0 to 3) for which TMR0 pauses after OPTION_REG selects its clock.",
        ),
    ),
}
"""The options of the simulated chip and its board; their defaults are the simulator's."""


@dataclass(frozen=True, slots=True)
class ChipOptions:
    """The options of the simulated chip as a command line gives them."""

    values: Mapping[str, Any]

    def on(self, device: str) -> SimulatorOptions:
        """Return the simulator's options for a device. Raises InputError."""
        start = tuple(start_value(text) for text in self.values["start"])
        return SimulatorOptions(device=device, **{**self.values, "start": start})

    @property
    def given(self) -> bool:
        """Return whether any differs from its default."""
        return any(
            self.values[option.name] != option.default
            for option in fields(SimulatorOptions)
            if option.name != "device"
        )


def takes_chip_options(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of the simulated chip, in place of its parameter `chip`."""
    signature, hints = inspect.signature(command), get_type_hints(command, include_extras=True)
    own = [
        parameter.replace(annotation=hints[name])
        for name, parameter in signature.parameters.items()
        if name != "chip"
    ]
    chips = [_chip_parameter(option) for option in fields(SimulatorOptions) if option.name != "device"]
    where = next((index for index, parameter in enumerate(own) if parameter.name == "json"), len(own))

    @wraps(command)
    def with_chip(**values: Any) -> None:
        given = {name: values.pop(name) for name in CHIP_OPTIONS}
        chip = ChipOptions({**given, "start": tuple(given["start"] or ())})
        command(**values, chip=chip)

    with_chip.__signature__ = signature.replace(parameters=[*own[:where], *chips, *own[where:]])  # type: ignore[attr-defined]
    return with_chip


def _chip_parameter(field: Field[Any]) -> inspect.Parameter:
    kind, option = CHIP_OPTIONS[field.name]
    annotation = Annotated[kind, option]  # type: ignore[valid-type]
    return inspect.Parameter(
        field.name, inspect.Parameter.POSITIONAL_OR_KEYWORD, default=field.default, annotation=annotation
    )


TimeLimit = Annotated[float, typer.Option("--timeout", min=0.1, help="Stop after this many seconds.")]
MemoryLimit = Annotated[
    int, typer.Option("--memory-mb", min=50, help="Stop if more memory than this is needed.")
]
Output = Annotated[Path | None, typer.Option("--output", "-o", help="The file to write.")]
Plot = Annotated[Path | None, typer.Option("--plot", help="Draw a picture: .png, .svg or .pdf.")]
Animate = Annotated[
    Path | None,
    typer.Option("--animate", help="Write an animation of the robot: .gif or .mp4 (needs ffmpeg)."),
]
Csv = Annotated[Path | None, typer.Option("--csv", help="Write one row per frame.")]


class Dialect(StrEnum):
    """The C dialects."""

    c2c = "c2c"
    xc8 = "xc8"
    sdcc = "sdcc"
