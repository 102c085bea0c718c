"""A stimulus as a TOML file, with times in microseconds since reset.

[[level]]       pin = "RB0"   at_us = [0, 500, 900]   level = [1, 0, 1]        # or "free": nobody drives it
[[periodic]]    pin = "RA4"   period_us = 100   high_us = 50   from_us = 0   times = 10
[[button]]      pin = "RB1"   pressed_us = 10_000   released_us = 90_000   bounces = 5   bounce_us = 5000
[[serial]]      pin = "RB2"   baud = 9600   text = "go"   from_us = 0   baud_error_percent = 1.5
                inverted = false
[[reset]]       pressed_us = 1000   released_us = 2000
"""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from servogen.edges import HIGH, LOW
from servogen.errors import InputError
from servogen.simulator.sources import (
    RELEASED,
    BouncingButton,
    Levels,
    Periodic,
    Reset,
    Serial,
    SignalSource,
    pin_number,
)
from servogen.simulator.stimulus import Stimuli
from servogen.toml.file import Document, Table, exact, parse, read, shown, validate
from servogen.units import Clock

MAX_US = 10**15
"""Thirty years."""

MAX_BOUNCES = 1000
"""The maximum number of a button's bounces, whose random moments are drawn at once."""

Number = int | float
Time = Annotated[Number, Field(ge=0, le=MAX_US)]
Length = Annotated[Number, Field(gt=0, le=MAX_US)]


class _Level(Table):
    pin: str
    at_us: tuple[Time, ...]
    level: tuple[Literal[0, 1, "free"], ...]


class _Periodic(Table):
    pin: str
    period_us: Length
    high_us: Length
    from_us: Time = 0
    times: Annotated[int, Field(ge=1)] | None = None


class _Button(Table):
    pin: str
    pressed_us: Time
    released_us: Time
    bounces: Annotated[int, Field(ge=0, le=MAX_BOUNCES)] = 5
    bounce_us: Time = 5000
    seed: int = 1
    pressed_level: Literal[0, 1] = 0


class _Serial(Table):
    pin: str
    baud: Length
    text: str | None = None
    data: tuple[Annotated[int, Field(ge=0, le=255)], ...] | None = None
    from_us: Time = 0
    baud_error_percent: Annotated[Number, Field(gt=-50, lt=50)] = 0
    inverted: bool = False
    stop_bits: Annotated[int, Field(ge=1, le=2)] = 1
    gap_us: Time = 0


class _Reset(Table):
    pressed_us: Time
    released_us: Time


class _File(Table):
    level: tuple[_Level, ...] = ()
    periodic: tuple[_Periodic, ...] = ()
    button: tuple[_Button, ...] = ()
    serial: tuple[_Serial, ...] = ()
    reset: tuple[_Reset, ...] = ()


def load_stimuli(path: str | Path, clock: Clock) -> Stimuli:
    """Return the stimuli in a file, for a chip with that clock. Raises InputError with the location in the
    file.
    """
    return _stimuli(read(path), clock)


def parse_stimuli(text: str, file: str, clock: Clock) -> Stimuli:
    """Return the stimuli in a file's text."""
    return _stimuli(parse(text, file), clock)


def _stimuli(document: Document, clock: Clock) -> Stimuli:
    file = validate(document, _File)
    sources: list[SignalSource] = []
    for n, level in enumerate(file.level):
        sources.append(_levels(document, n, level, clock))
    for n, periodic in enumerate(file.periodic):
        if periodic.high_us >= periodic.period_us:
            raise document.error("bad-stimulus", ("periodic", n, "high_us"), "is not shorter than period_us")
        if exact(periodic.period_us) < clock.cycle_us:
            raise document.error(
                "bad-stimulus",
                ("periodic", n, "period_us"),
                f"{shown(periodic.period_us)} is shorter than an instruction cycle",
                f"at least {float(clock.cycle_us):g}",
            )
        pin = _pin(document, ("periodic", n, "pin"), periodic.pin)
        period, high, start = (
            _exactly(us, clock) for us in (periodic.period_us, periodic.high_us, periodic.from_us)
        )
        sources.append(Periodic(pin=pin, period=period, high=high, start=start, times=periodic.times))
    for n, button in enumerate(file.button):
        pressed, released = _span(document, ("button", n), button.pressed_us, button.released_us, clock)
        pin = _pin(document, ("button", n, "pin"), button.pin)
        bounce = _cycles(button.bounce_us, clock)
        sources.append(
            BouncingButton(
                pin=pin,
                pressed=pressed,
                released=released,
                bounces=button.bounces,
                bounce=bounce,
                seed=button.seed,
                active=button.pressed_level,
            )
        )
    for n, serial in enumerate(file.serial):
        sources.append(_serial(document, n, serial, clock))
    for n, reset in enumerate(file.reset):
        sources.append(Reset(*_span(document, ("reset", n), reset.pressed_us, reset.released_us, clock)))
    return Stimuli(tuple(sources))


def _levels(document: Document, n: int, table: _Level, clock: Clock) -> Levels:
    if len(table.at_us) != len(table.level):
        message = f"has {len(table.level)} values for the {len(table.at_us)} times of at_us"
        raise document.error("bad-stimulus", ("level", n, "level"), message)
    cycles = [_cycles(at_us, clock) for at_us in table.at_us]
    for i in range(1, len(cycles)):
        if cycles[i] < cycles[i - 1]:
            raise document.error(
                "bad-stimulus", ("level", n, "at_us", i), f"{table.at_us[i]} is before {table.at_us[i - 1]}"
            )
    levels = [RELEASED if level == "free" else (LOW, HIGH)[level] for level in table.level]
    pin = _pin(document, ("level", n, "pin"), table.pin)
    return Levels(pin, tuple(zip(cycles, levels, strict=True)))


def _serial(document: Document, n: int, table: _Serial, clock: Clock) -> Serial:
    if (table.text is None) == (table.data is None):
        raise document.error("bad-stimulus", ("serial", n), "needs either text or data")
    if exact(table.baud) > clock.cycles_per_second:
        raise document.error(
            "bad-stimulus",
            ("serial", n, "baud"),
            f"{shown(table.baud)} is more than one bit per instruction cycle",
            f"at most {float(clock.cycles_per_second):g}",
        )
    return Serial(
        pin=_pin(document, ("serial", n, "pin"), table.pin),
        data=bytes(table.data or ()) if table.text is None else table.text.encode(),
        baud=exact(table.baud),
        start=_cycles(table.from_us, clock),
        baud_error=exact(table.baud_error_percent) / 100,
        inverted=table.inverted,
        stop_bits=table.stop_bits,
        gap=_cycles(table.gap_us, clock),
    )


def _span(
    document: Document, key: tuple[str, int], pressed: Number, released: Number, clock: Clock
) -> tuple[int, int]:
    if released <= pressed:
        raise document.error(
            "bad-stimulus", (*key, "released_us"), f"{released} is not after pressed_us = {pressed}"
        )
    return _cycles(pressed, clock), _cycles(released, clock)


def _pin(document: Document, key: tuple[str | int, ...], name: str) -> int:
    try:
        return pin_number(name)
    except InputError as error:
        raise error.at(document.place(*key)) from error


def _exactly(us: Number, clock: Clock) -> Fraction:
    return exact(us) / clock.cycle_us


def _cycles(us: Number, clock: Clock) -> int:
    return clock.round_us(exact(us)).cycles
