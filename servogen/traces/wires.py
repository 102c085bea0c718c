"""Maps the wires, channels or columns of a file to pins: by name, or as the caller specifies.

A wire belongs to the first pin whose name it contains: `RB0`, `RB0_arm`, `PORTB[0]`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TypeVar

from servogen.edges import PINS
from servogen.errors import InputError, Location, did_you_mean

Key = TypeVar("Key")

_PIN = re.compile(r"(?<![A-Za-z0-9])(?:R|PORT)([AB])_?\[?([0-7])\]?(?![0-9A-Za-z])", re.IGNORECASE)
_HINT = "say which wire is which pin"


def pins_of(
    wires: Sequence[tuple[str, Key]], chosen: Mapping[str, str] | None, place: Location
) -> dict[Key, int]:
    """Return, by key, the pin number of each of `wires` (name, key) that belongs to a pin.

    `chosen` maps names to pins, as in {"D0": "RB0"}; then only these are used.
    """
    known = [name for name, _ in wires]
    named = _by_name(wires) if chosen is None else _as_chosen(wires, chosen, place)
    if not named:
        shown = ", ".join(known[:20]) or "none"
        hint = f"its 1-bit wires: {shown}; {_HINT}"
        raise InputError("bad-wiring", "has no wire that is named by a pin (RA0 … RB7)", place, hint)
    first: dict[int, tuple[str, Key]] = {}
    for name, key, pin in named:
        other, other_key = first.setdefault(pin, (name, key))
        if other_key != key:
            raise InputError("bad-wiring", f"wires '{other}' and '{name}' are both {PINS[pin]}", place, _HINT)
    return {key: pin for _, key, pin in named}


def _by_name(wires: Sequence[tuple[str, Key]]) -> list[tuple[str, Key, int]]:
    pins = ((name, key, _pin_in(name)) for name, key in wires)
    return [(name, key, pin) for name, key, pin in pins if pin is not None]


def _as_chosen(
    wires: Sequence[tuple[str, Key]], chosen: Mapping[str, str], place: Location
) -> list[tuple[str, Key, int]]:
    keys = dict(wires)
    named = []
    for name, pin in chosen.items():
        if pin not in PINS:
            raise InputError("unknown-pin", f"'{pin}' is not a pin", place, did_you_mean(pin, PINS))
        if name not in keys:
            raise InputError("bad-wiring", f"has no 1-bit wire '{name}'", place, did_you_mean(name, keys))
        named.append((name, keys[name], PINS.index(pin)))
    return named


def _pin_in(name: str) -> int | None:
    """Return the first pin in a wire's name; after it may come the name of a servo that resembles another
    pin.
    """
    pins = (f"R{port.upper()}{bit}" for port, bit in _PIN.findall(name))
    return next((PINS.index(pin) for pin in pins if pin in PINS), None)
