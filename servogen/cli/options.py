"""Options and arguments that several commands share, each with one meaning and one help text."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

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
Ra4PullUp = Annotated[bool, typer.Option("--ra4-pull-up", help="RA4, an open drain, has a pull-up resistor.")]
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
Output = Annotated[Path | None, typer.Option("--output", "-o", help="The file to write.")]


class Dialect(StrEnum):
    """The C dialects."""

    c2c = "c2c"
    xc8 = "xc8"
    sdcc = "sdcc"
