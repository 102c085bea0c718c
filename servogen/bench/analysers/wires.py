"""Which channel of an analyser is on which pin: port B on the first group, port A on the second."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from servogen.bench.analysers.sump import CHANNELS
from servogen.edges import PINS
from servogen.errors import InputError, did_you_mean

CHANNEL_PINS = (*range(5, 13), *range(5))
"""The pin's index in `PINS` of each channel, unless said otherwise: RB0 to RB7, RA0 to RA4."""


def wires(said: Iterable[str]) -> Mapping[int, int]:
    """Return the pin of each channel from texts such as `0=RB0`; by default `CHANNEL_PINS`. Raises
    InputError.
    """
    found: dict[int, int] = {}
    for text in said:
        channel, _, pin = text.partition("=")
        name = pin.strip().upper()
        if not channel.strip().isdigit() or int(channel) >= CHANNELS:
            raise InputError(
                "bad-wiring", f"'{text}' names no channel", hint=f"as 0=RB0; channels are 0 to {CHANNELS - 1}"
            )
        if name not in PINS:
            raise InputError("unknown-pin", f"'{text}' names no pin", hint=did_you_mean(name, PINS))
        if int(channel) in found or PINS.index(name) in found.values():
            raise InputError("bad-wiring", f"'{text}': channel or pin is wired twice")
        found[int(channel)] = PINS.index(name)
    return found or dict(enumerate(CHANNEL_PINS))


def channel_of(pin: str, wired: Mapping[int, int]) -> int:
    """Return the channel connected to `pin`. Raises InputError."""
    names = {PINS[number]: channel for channel, number in wired.items()}
    if pin.upper() not in names:
        raise InputError(
            "bad-wiring", f"no channel of the analyser is on {pin}", hint=did_you_mean(pin, names)
        )
    return names[pin.upper()]
