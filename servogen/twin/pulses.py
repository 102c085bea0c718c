"""Edges of pins -> what the servos receive: pulses with their own widths, at steps of the physics.

In: chunks of edges, in order, cut anywhere. Out: for each pulse the servo, the first physics step at or after
its falling edge, and its width in microseconds. The cut does not matter: a pulse belongs to the step of its
falling edge.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from fractions import Fraction
from typing import NamedTuple

from servogen.edges import EdgeChunk
from servogen.pulses import PulseReader
from servogen.units import Clock


class ReceivedPulse(NamedTuple):
    """A pulse of servo number `servo`, which takes effect at `step`."""

    step: int
    servo: int
    width_us: float


class PulseReceiver:
    """The pins of the servos, by their numbers in a trace, listening."""

    def __init__(self, pins: Sequence[int], clock: Clock, step_s: Fraction) -> None:
        self._servos = {pin: servo for servo, pin in enumerate(pins)}
        self._reader = PulseReader()
        self._cycles_per_step = clock.cycles_per_second * step_s
        self._us = float(1_000_000 / Fraction(clock.cycles_per_second))

    def first_cycle(self, step: int) -> int:
        """Return the first cycle at or after the beginning of a step."""
        return -(-step * self._cycles_per_step.numerator // self._cycles_per_step.denominator)

    def step_at(self, cycle: int) -> int:
        """Return the last step that begins at or before a cycle."""
        return cycle * self._cycles_per_step.denominator // self._cycles_per_step.numerator

    def snapshot(self) -> PulseReader:
        """Return which wires are high, and since when."""
        return copy(self._reader)

    def restore(self, snapshot: PulseReader) -> None:
        """Let each wire be high since when it was at a snapshot of this receiver."""
        self._reader = copy(snapshot)

    def pulses(self, chunk: EdgeChunk) -> list[ReceivedPulse]:
        """Return the pulses that end in a chunk of edges, in order."""
        per = self._cycles_per_step
        ended = self._reader(chunk).whole()
        return [
            ReceivedPulse(-(-fall * per.denominator // per.numerator), self._servos[pin], width * self._us)
            for pin, fall, width in zip(
                *(row.tolist() for row in (ended.pin, ended.fall, ended.width)), strict=True
            )
            if pin in self._servos
        ]
