"""What the files of analysers have in common: which wire is which pin, and how long a time step is.

A wire, channel or column belongs to the first pin whose name it contains (`RB0`, `RB0_arm`, `PORTB[0]`), or
to the one that the caller names.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from typing import TypeVar

from servogen.edges import PAIR_NAMES, PINS
from servogen.errors import InputError, Location, check_known, did_you_mean
from servogen.units import OSCILLATOR_PERIODS_PER_CYCLE, Clock

Key = TypeVar("Key")

_PIN = re.compile(r"(?<![A-Za-z0-9])(?:R|PORT)([AB])_?\[?([0-7])\]?(?![0-9A-Za-z])", re.IGNORECASE)
_HINT = "name the pin of each wire: --wire CHANNEL=PIN"


def parse_wires(texts: Iterable[str]) -> dict[str, str] | None:
    """Return the pin of each channel from texts such as `Channel 0=RB0`; None if there are none.

    Raises InputError for a text that does not assign a pin, and for a channel that has two.
    """
    wired: dict[str, str] = {}
    for text in texts:
        channel, _, pin = (part.strip() for part in text.rpartition("="))
        if not channel or pin.upper() not in (*PINS, *PAIR_NAMES.values()):
            hint = did_you_mean(pin.upper(), PINS) if channel else "such as D0=RB0"
            raise InputError("bad-wiring", f"'{text}' does not assign a channel to a pin", hint=hint)
        if wired.setdefault(channel, pin.upper()) != pin.upper():
            raise InputError(
                "bad-wiring", f"'{channel}' is both {wired[channel]} and {pin.upper()}", hint=_HINT
            )
    return wired or None


def assign_pins(
    wires: Sequence[tuple[str, Key]], chosen: Mapping[str, str] | None, place: Location
) -> dict[Key, int]:
    """Return, by key, the pin number of each of `wires` (name, key) that belongs to a pin.

    `chosen` maps names to pins, as in {"D0": "RB0"}; then only these are used. Raises InputError if no wire
    belongs to a pin, two belong to the same pin, or a chosen name or pin does not exist.
    """
    known = [name for name, _ in wires]
    named = _by_name(wires) if chosen is None else _as_chosen(wires, chosen, place)
    if not named:
        shown = ", ".join(known[:20]) or "none"
        hint = f"its 1-bit wires: {shown}; {_HINT}"
        if known:
            hint += f", such as --wire '{known[0]}=RB0'"
        raise InputError("bad-wiring", "has no wire that is named by a pin (RA0 … RB7)", place, hint)
    first: dict[int, tuple[str, Key]] = {}
    for name, key, pin in named:
        other, other_key = first.setdefault(pin, (name, key))
        if other_key != key:
            raise InputError("bad-wiring", f"wires '{other}' and '{name}' are both {PINS[pin]}", place, _HINT)
    return {key: pin for _, key, pin in named}


def _by_name(wires: Sequence[tuple[str, Key]]) -> list[tuple[str, Key, int]]:
    pins = ((name, key, pin_in(name)) for name, key in wires)
    return [(name, key, pin) for name, key, pin in pins if pin is not None]


def _as_chosen(
    wires: Sequence[tuple[str, Key]], chosen: Mapping[str, str], place: Location
) -> list[tuple[str, Key, int]]:
    keys = dict(wires)
    named = []
    for name, pin in chosen.items():
        check_known("unknown-pin", pin, PINS, f"'{pin}' is not a pin", place)
        check_known("bad-wiring", name, keys, f"has no 1-bit wire '{name}'", place)
        named.append((name, keys[name], PINS.index(pin)))
    return named


def pin_in(name: str) -> int | None:
    """Return the first pin in a wire's name; after it may come the name of a servo that resembles another
    pin.
    """
    pins = (f"R{port.upper()}{bit}" for port, bit in _PIN.findall(name))
    return next((PINS.index(pin) for pin in pins if pin in PINS), None)


_RATE = re.compile(r"\s*\+?(\d{1,18}|(?=\.))(\.\d{1,18}(?= ))? *([kmg]?)(?:hz)?", re.ASCII | re.IGNORECASE)
_FACTOR = {"": 1, "k": 10**3, "m": 10**6, "g": 10**9}


def parse_rate(text: str, place: Location) -> int:
    """Return the sampling rate in hertz that is the whole `text`: `200 kHz`, `1.5 MHz`, `1 M`, `1000000`.

    Source: libsigrok's `sr_parse_sizestring`: a number, spaces, k, M or G in either case, `Hz` or nothing.
    It loses the letter directly after a fraction (1.5MHz is 1 Hz) and fractions of a hertz: neither is a rate
    here. Raises InputError, which quotes the text.
    """
    stated = _RATE.fullmatch(text)
    rate = Fraction(stated[1] + (stated[2] or "")) * _FACTOR[stated[3].lower()] if stated else Fraction(0)
    if rate <= 0 or rate.denominator != 1:
        message = f"sampling rate '{text[:40]}' is not understood"
        raise InputError("bad-rate", message, place, "such as 200 kHz, 1.5 MHz or 1000000")
    return int(rate)


def step_clock(steps_per_second: Fraction, place: Location) -> Clock:
    """Return the clock whose instruction cycle is one time step. Raises InputError if none exists."""
    hz = steps_per_second * OSCILLATOR_PERIODS_PER_CYCLE
    if hz <= 0 or hz.denominator != 1:
        raise InputError(
            "bad-rate", f"{float(steps_per_second):g} time steps per second are not a whole number", place
        )
    return Clock(int(hz))
