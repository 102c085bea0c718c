"""One battery or power supply for all servos: its voltage under load.

In: the bridges' duties u and the motors' speeds ω. Out: voltage and current at one moment. With A = Σ u²/R
and B = Σ u Ke ω/R the servos draw I = n·idle + A Vs - B, and the supply gives Vs = V0 - Rs I, so that

    Vs = (V0 - Rs (n·idle - B)) / (1 + Rs A)       or, where that is more than its limit Imax,
    Vs = (Imax - n·idle + B) / A                   I = Imax: a supply that limits its current gives in
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Supply:
    """`volts` without load, inner `resistance` in ohms, a limit in amperes or none.

    `feeds_chip`: the chip runs on the same voltage, and is out of its range below `chip_minimum_v`.
    """

    volts: float
    resistance: float = 0.0
    limit_a: float | None = None
    feeds_chip: bool = True
    chip_minimum_v: float = 4.0

    def under(self, idle: float, a: float, b: float) -> tuple[float, float]:
        """Return voltage and current where the servos draw `idle` + `a` · voltage - `b` amperes."""
        voltage = (self.volts - self.resistance * (idle - b)) / (1 + self.resistance * a)
        current = idle + a * voltage - b
        if current < 0:  # motors that are turned back give nothing back to the supply
            return self.volts, 0.0
        if self.limit_a is not None and current > self.limit_a and a > 0:
            return max((self.limit_a - idle + b) / a, 0.0), self.limit_a
        return voltage, current
