"""Edges of pins -> what the servos receive: pulses with their own widths, at steps of the physics.

In: chunks of edges, in order, cut anywhere. Out: for each pulse the servo, the first physics step at or after
its falling edge, and its width in microseconds. The cut does not matter: a pulse belongs to the step of its
falling edge.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

from servogen.edges import HIGH, PINS, EdgeChunk
from servogen.units import Clock


class ReceivedPulse(NamedTuple):
    """A pulse of servo number `servo`, which takes effect at `step`."""

    step: int
    servo: int
    width_us: float


@dataclass(slots=True)
class _Wire:
    servo: int
    rise: int | None = None


class PulseReceiver:
    """The pins of the servos, listening."""

    def __init__(self, pins: Sequence[str], clock: Clock, step_s: Fraction) -> None:
        self._wires = {PINS.index(pin): _Wire(servo) for servo, pin in enumerate(pins)}
        self._cycles_per_step = clock.cycles_per_second * step_s
        self._us = float(1_000_000 / Fraction(clock.cycles_per_second))

    def cycle_of(self, step: int) -> int:
        """Return the first cycle at or after the beginning of a step."""
        return -(-step * self._cycles_per_step.numerator // self._cycles_per_step.denominator)

    def step_of(self, cycle: int) -> int:
        """Return the last step that begins at or before a cycle."""
        return cycle * self._cycles_per_step.denominator // self._cycles_per_step.numerator

    def snapshot(self) -> tuple[int | None, ...]:
        """Return since when each wire is high."""
        return tuple(wire.rise for wire in self._wires.values())

    def restore(self, snapshot: tuple[int | None, ...]) -> None:
        """Let each wire be high since when it was at a snapshot of this receiver."""
        for wire, rise in zip(self._wires.values(), snapshot, strict=True):
            wire.rise = rise

    def pulses(self, chunk: EdgeChunk) -> list[ReceivedPulse]:
        """Return the pulses that end in a chunk of edges, in order."""
        pulses = []
        per = self._cycles_per_step
        for cycle, pin, level in zip(*(column.tolist() for column in chunk), strict=True):
            wire = self._wires.get(pin)
            if wire is None:
                continue
            if level == HIGH:
                if wire.rise is None:
                    wire.rise = cycle
            elif wire.rise is not None:
                step = -(-cycle * per.denominator // per.numerator)
                pulses.append(ReceivedPulse(step, wire.servo, (cycle - wire.rise) * self._us))
                wire.rise = None
        return pulses
