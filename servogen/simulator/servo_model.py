"""A model of a servo at a pin, from pulses to the angle of the shaft, which shows the real motion of a job.

    width ──▶ commanded angle (straight lines between the calibration's points, the travel's ends beyond them)
                    │
    angle ──────────┴── moves towards it at no more than the servo's speed

Current, torque and overshoot are not modelled. A servo without pulses stays where it is.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from servogen.edges import EdgeChunk
from servogen.errors import InputError
from servogen.pulses import PulseReader
from servogen.units import Clock, Cycles


class ServoPosition(NamedTuple):
    """The commanded angle and the shaft's angle at the end of a pulse, in radians."""

    cycle: Cycles
    width: Cycles
    commanded: float
    angle: float


@dataclass(frozen=True, slots=True)
class ServoLoad:
    """A servo with its calibration and its speed limit."""

    widths_us: tuple[float, ...]
    """At least two pulse widths, rising."""
    angles: tuple[float, ...]
    """The angle for each width, in radians."""
    speed: float
    """The maximum speed in radians per second."""
    start: float = 0.0
    """The angle at reset in radians."""

    def __post_init__(self) -> None:
        rising = all(a < b for a, b in zip(self.widths_us, self.widths_us[1:], strict=False))
        if len(self.widths_us) < 2 or len(self.widths_us) != len(self.angles) or not rising:
            raise InputError(
                "bad-calibration", "a servo load needs two or more rising pulse widths and an angle for each"
            )
        if self.speed <= 0:
            raise InputError("out-of-range", f"a servo's speed is {self.speed} rad/s; it must be more than 0")

    def positions(self, chunks: Iterable[EdgeChunk], clock: Clock, pin: int) -> Iterator[ServoPosition]:
        """Yield the shaft's position at the end of every pulse on `pin` (its index in `PINS`).

        The command of a pulse is valid from its end to the end of the next one.
        """
        per_cycle = self.speed * float(clock.cycle_us) * 1e-6
        angle = commanded = self.start
        since = 0
        for ended in map(PulseReader(), chunks):
            mine = ended.of(pin).whole()
            for fall, width in zip(mine.fall.tolist(), mine.width.tolist(), strict=True):
                reach = (fall - since) * per_cycle
                angle += max(-reach, min(reach, commanded - angle))
                commanded = float(np.interp(float(clock.us(width)), self.widths_us, self.angles))
                since = fall
                yield ServoPosition(Cycles(fall), Cycles(width), commanded, angle)
