"""What the head of every engine's C says: the channels, the ports, numbers as people write them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

from servogen.pulse import PulseSchedule


@dataclass(frozen=True, slots=True)
class ChannelText:
    """A channel of the C file's head."""

    name: str
    pin: str
    widths_us: str


@dataclass(frozen=True, slots=True)
class PortText:
    """A port in use and the value of its TRIS register."""

    name: str
    tris: str


def ports_of(schedule: PulseSchedule) -> Iterator[PortText]:
    """The ports in use; their other pins stay inputs, as reset leaves them."""
    for port, inputs in (("A", 0x1F), ("B", 0xFF)):
        pins = [int(channel.pin[2]) for channel in schedule.channels if channel.pin[1] == port]
        if pins:
            yield PortText(port, f"0x{inputs & ~sum(1 << pin for pin in pins):02X}")


def decimal(value: Fraction) -> str:
    """A number as people write it: whole, or with the decimals it needs, three at most."""
    return f"{float(value):.3f}".rstrip("0").rstrip(".")
