"""What is connected to the chip's pins: other pins, keys of a keypad, and levels from outside.

In: wires between pins, the levels that a test drives, what the chip drives. Out: the level that each
connected pin has from outside: the first that there is of an output of the chip, a level that the test drives
(0 before 1, as a button against its resistor), and a pull-up of port B; else the pins float.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from servogen.edges import HIGH, LOW, PINS, UNDRIVEN
from servogen.pic.device import OPEN_DRAIN_PIN

RA4 = PINS.index(OPEN_DRAIN_PIN)
FIRST_OF_PORT_B = PINS.index("RB0")


class ShortCircuit(AssertionError):
    """Two outputs that are connected drive different levels."""


@dataclass(slots=True)
class Wiring:
    """Wires, each between two pins, and the levels that the test drives, by the pins' numbers."""

    held: dict[int, int] = field(default_factory=dict)
    wires: set[frozenset[int]] = field(default_factory=set)

    def connect(self, wire: frozenset[int]) -> None:
        self.wires.add(wire)

    def disconnect(self, wire: frozenset[int]) -> None:
        self.wires.discard(wire)

    @property
    def connected(self) -> frozenset[int]:
        """Return the pins that have a wire."""
        return frozenset(pin for wire in self.wires for pin in wire)

    def nets(self) -> list[set[int]]:
        """Return the groups of pins that are connected, directly or through others."""
        nets: list[set[int]] = []
        for wire in self.wires:
            touched = [net for net in nets if net & wire]
            nets = [net for net in nets if not net & wire] + [set(wire).union(*touched)]
        return nets

    def levels(self, driven: tuple[int, ...], pull_ups: bool) -> Mapping[int, int]:
        """Return the level of each connected pin from outside, where the chip drives its pins to `driven`.

        Raises ShortCircuit.
        """
        levels: dict[int, int] = {}
        for net in self.nets():
            level = self._level(net, driven, pull_ups)
            for pin in net:  # an output needs nothing from outside
                open_drain = pin == RA4 and driven[pin] == HIGH
                levels[pin] = level if driven[pin] == UNDRIVEN or open_drain else UNDRIVEN
        return levels

    def _level(self, net: set[int], driven: tuple[int, ...], pull_ups: bool) -> int:
        outputs = {pin: driven[pin] for pin in sorted(net) if driven[pin] != UNDRIVEN}
        weak = outputs.get(RA4) == HIGH  # an open drain's 1 is its pull-up's
        strong = {pin: level for pin, level in outputs.items() if not (weak and pin == RA4)}
        levels = set(strong.values())
        if len(levels) > 1:
            high, low = (next(PINS[pin] for pin in strong if strong[pin] == level) for level in (HIGH, LOW))
            raise ShortCircuit(f"{high} drives 1 and {low} drives 0, and they are connected: a short circuit")
        held = {self.held[pin] for pin in net if pin in self.held}
        if levels or held:
            return min(levels or held)
        return HIGH if weak or (pull_ups and max(net) >= FIRST_OF_PORT_B) else UNDRIVEN
