"""Options and arguments that several commands share, each with one meaning and one help text.

An option is a parameter of a command, or a field of a group: `Annotated[type, "meaning"]`. Its name is the
parameter's, unless `typer.Option`, which states limits and parsers as well, has another one.
"""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servogen.errors import InputError, Location
from servogen.programs import PROGRAM_SUFFIXES

if TYPE_CHECKING:
    from servogen.toml.file import Table

MAX_SECONDS = 1e9
"""The longest time, thirty years, that a simulation can count."""

MAX_CYCLES = 10**16
"""The longest run: 300 years at 4 MHz, and far from the limit of 64 bits."""

CLOCK_HZ = 4_000_000
"""The clock of a motion without a job: its cycle is 1 µs, so that a period in µs is also one in cycles."""


def number(text: str) -> float:
    """Return a number from the command line. Raises BadParameter, which quotes the text."""
    try:
        return float(text)
    except ValueError:
        kind = "an option" if text.startswith("-") else "a number"
        raise typer.BadParameter(f"'{text}' is not {kind}") from None


def table_option(table: type[Table], key: str, help: str, flag: str | None = None) -> Any:
    """Return the option `--key`, or another `flag`, for a key of a file's table, with the key's range.

    Bounds that the key excludes are allowed here: the planner refuses them with the reason.
    """
    limits = {
        name: getattr(bound, name)
        for bound in table.model_fields[key].metadata
        for name in ("ge", "gt", "le", "lt")
        if hasattr(bound, name)
    }
    low, high = limits.get("ge", limits.get("gt")), limits.get("le", limits.get("lt"))
    return typer.Option(flag or f"--{key.replace('_', '-')}", min=low, max=high, help=help)


def usual(table: type[Table], key: str) -> Any:
    """Return the default of a key of a file's table."""
    return table.model_fields[key].default


def baud_option(default: str) -> Any:
    """Return the option `--baud` of a serial line; `default` says which rate it has without."""
    # The slowest rate that serial ports of computers offer.
    return typer.Option(min=50, help=f"Baud rate of the serial line (default: {default}).")


def sampling_rate_option(help: str) -> Any:
    """Return the option `--rate` of an analyser or of its recording, in whole samples per second."""
    return typer.Option("--rate", min=1, help=help)


def _not_a_program(path: Path) -> Path:
    """Return the path of a job. Raises InputError for that of a program, whose text would be no TOML."""
    if path.suffix.lower() in PROGRAM_SUFFIXES:
        raise InputError(
            "not-allowed",
            "is a program, but this command takes a job file (TOML)",
            Location(str(path)),
            "simulate, watch and verify take programs; "
            "servogen rig JOB.toml --hex FILE puts one on the simulated bench",
        )
    return path


JobFile = Annotated[
    Path, typer.Argument(help="A job file (TOML).", show_default=False, callback=_not_a_program)
]
Json = Annotated[bool, "Print the result as JSON."]
ServerPort = Annotated[
    int, typer.Option(min=0, max=65_535, help="Port of the server (default: any free one).")
]
OpensBrowser = Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")]
DeviceName = Annotated[str, "The chip: PIC16F84 or PIC16F84A."]
OwnDevice = Annotated[
    str | None,
    "The chip: PIC16F84 or PIC16F84A (default: that of the job, schedule or header, else PIC16F84).",
]


def duration(text: str) -> float:
    """Return a time in seconds from the command line, at most `MAX_SECONDS`. Raises BadParameter."""
    seconds = number(text)
    if not 0 <= seconds <= MAX_SECONDS:
        raise typer.BadParameter(f"'{text}' is not between 0 and {MAX_SECONDS:g} seconds")
    return seconds


PeriodUs = Annotated[int, typer.Option(min=1000, max=1_000_000, help="Frame period in µs.")]
Seconds = Annotated[
    float | None, typer.Option(parser=duration, metavar="SECONDS", help="Duration in simulated seconds.")
]
ClockHz = Annotated[
    int | None, typer.Option(min=1, help="The clock in Hz (default: the one stated in the C, else 4 MHz).")
]
StimulusFile = Annotated[Path | None, "A TOML file of the signals that drive the pins."]
Partial = Annotated[bool, "Also exit with 0 if all recorded frames are right but some were not recorded."]
CaptureRate = Annotated[
    int | None, sampling_rate_option("The capture's sampling rate in Hz, if its file does not state it.")
]
RecordedWires = Annotated[
    list[str] | None,
    typer.Option(
        metavar="CHANNEL=PIN",
        help="The pin of a recorded channel that is not named after one, such as D0=RB0 (repeatable); then "
        "only these are read.",
    ),
]
TimeLimit = Annotated[float, typer.Option(min=0.1, help="Stop after this many seconds of processor time.")]
MemoryLimit = Annotated[int, typer.Option(min=50, help="Stop if more memory than this is needed.")]
Output = Annotated[Path | None, typer.Option("--output", "-o", help="The file to write.")]
Plot = Annotated[Path | None, typer.Option("--plot", help="Draw a picture: .png, .svg or .pdf.")]
Animate = Annotated[Path | None, "Write an animation of the robot: .gif or .mp4 (needs ffmpeg)."]
Csv = Annotated[Path | None, "Write one row per frame."]


class Dialect(StrEnum):
    """The C dialects."""

    c2c = "c2c"
    xc8 = "xc8"
    sdcc = "sdcc"
