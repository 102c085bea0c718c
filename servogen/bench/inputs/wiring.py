"""How the input board's pins are wired to the chip: one text each, such as `RB0=2`.

RB0=2         pin 2 of the board drives RB0, through 1 kΩ
RB0-RB4=22    pin 22 of the board closes a contact between RB0 and RB4 when it is high
RA1=TX1       the board's serial port 1 sends to RA1
MCLR=14       pin 14 of the board resets the chip, through a diode
MARK=15       pin 15 of the board is on the analyser's channel 13; its rising edge starts a capture
VDD=17        pin 17 of the board switches the chip's supply
RB3=-         RB3 is not wired
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from servogen.edges import PINS
from servogen.errors import InputError, check_known

MARK_CHANNEL = 13
"""The analyser's channel on which the board says when a run begins; 0 to 12 are the chip's pins."""

MCLR, MARK, VDD = "MCLR", "MARK", "VDD"
SPECIAL = (MCLR, MARK, VDD)
DEFAULT = (
    *(f"RB{bit}={2 + bit}" for bit in range(8)),
    *(f"RA{bit}={10 + bit}" for bit in range(4)),
    *("MCLR=14", "MARK=15", "RA4=16"),
)
"""An Arduino's pins 2 to 16: on the Uno 14 to 16 are A0 to A2."""

MAX_BOARD_PIN = 127
MAX_PORT = 7

Contact = frozenset[str]
"""The two pins that a contact connects."""

_TEXT = re.compile(
    r"(?P<name>\w+)(?:-(?P<other>\w+))?=(?:TX(?P<port>\d+)|(?P<pin>\d+)|(?P<none>-))",
    re.IGNORECASE | re.ASCII,
)


@dataclass(frozen=True, slots=True)
class InputWiring:
    """The board's pin, or port, of each of the chip's pins, contacts and lines."""

    pins: Mapping[str, int] = field(default_factory=dict)
    """The board's pin for each pin of the chip, and for `SPECIAL`."""
    contacts: Mapping[Contact, int] = field(default_factory=dict)
    lines: Mapping[str, int] = field(default_factory=dict)
    """The board's serial port that sends to each pin."""

    @property
    def outputs(self) -> frozenset[int]:
        """Return the board's pins that are wired."""
        return frozenset((*self.pins.values(), *self.contacts.values()))


def input_wiring(texts: Iterable[str] = ()) -> InputWiring:
    """Return the default wiring, changed by `texts`. Raises InputError."""
    pins: dict[str, int] = {}
    contacts: dict[Contact, int] = {}
    lines: dict[str, int] = {}
    for text in (*DEFAULT, *texts):
        match = _TEXT.fullmatch(text.strip())
        if match is None:
            raise InputError(
                "bad-option",
                f"'{text}' is not the wiring of an input",
                hint="RB0=2, RB0-RB4=22 for a contact, RA1=TX1 for a serial line, RB3=- for none",
            )
        name, other, port = _name(match["name"]), match["other"], match["port"]
        number = int(match["pin"] or port or 0)
        if number > (MAX_PORT if port else MAX_BOARD_PIN):
            raise InputError("out-of-range", f"'{text}': {number} is not a pin or port of a Firmata board")
        if other is not None:
            pair = frozenset((name, _name(other)))
            if len(pair) < 2 or pair & set(SPECIAL) or port:
                raise InputError("bad-option", f"'{text}' is not a contact between two of the chip's pins")
            contacts[pair] = number
            if match["none"]:
                del contacts[pair]
        elif port:
            if name in SPECIAL:
                raise InputError("bad-option", f"'{text}': a serial line goes to a pin of a port")
            lines[name] = number
        else:
            pins[name] = number
            if match["none"]:
                del pins[name]
    _check_once([*pins.values(), *contacts.values()])
    if MARK not in pins:
        raise InputError("bad-option", "MARK must be wired: it tells the analyser when a run begins")
    return InputWiring(pins, contacts, lines)


def _name(text: str) -> str:
    name = text.upper()
    check_known("unknown-pin", name, (*PINS, *SPECIAL), f"the chip has no '{text}'")
    return name


def _check_once(pins: list[int]) -> None:
    twice = next((pin for pin in pins if pins.count(pin) > 1), None)
    if twice is not None:
        raise InputError(
            "bad-option",
            f"pin {twice} of the input board is wired twice",
            hint="the default uses 2 to 16; NAME=- frees a pin",
        )
