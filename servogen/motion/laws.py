"""Laws of motion along a path: the share of the path as a function of the share of the time.

In: the name of a law and, for two of them, the shape of its ramps. Out: `Law`, the share s(u) of the path at
the share u of the time, both from 0 to 1, with its derivatives and their peaks.

    linear    speed ▔▔▔▔▔▔▔      s = u: the speed jumps at the ends
    cubic     speed ╱‾╲          s = 3u² - 2u³: the acceleration jumps at the ends
    quintic   speed _╱‾╲_        s = 10u³ - 15u⁴ + 6u⁵: nothing jumps but the jerk
    trapezoid speed ╱▔▔▔╲        constant acceleration for the share `ramp` of the time at each end
    s-curve   speed _╱▔▔╲_       the same; acceleration rises and falls for the share `bend` of a ramp
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from servogen.errors import InputError, did_you_mean
from servogen.motion.trajectory import Floats

NAMES = ("linear", "cubic", "quintic", "trapezoid", "s-curve")

RAMP = 0.25
"""The share of the time that a ramp takes when no acceleration is stated."""

BEND = 0.5
"""The share of a ramp in which its acceleration rises, and in which it falls, when no jerk is stated."""


@dataclass(frozen=True, slots=True)
class Law:
    """A piecewise polynomial: from `times[i]` on, s = Σ `coefficients[i][k]` (u - times[i])^k."""

    name: str
    times: tuple[float, ...]
    coefficients: tuple[tuple[float, ...], ...]

    def share(self, u: ArrayLike) -> Floats:
        """Return the share of the path at the share `u` of the time; at rest before 0 and after 1."""
        return self._value(np.clip(np.asarray(u, float), 0.0, 1.0), 0)

    def derivative(self, u: ArrayLike, order: int) -> Floats:
        """Return the derivative of `share` by u of that order, 0 outside 0 to 1."""
        u = np.asarray(u, float)
        inside = (u >= 0) & (u <= 1)
        return np.where(inside, self._value(np.clip(u, 0.0, 1.0), order), 0.0)

    def peak(self, order: int) -> float:
        """Return the maximum absolute derivative of an order (1 speed, 2 acceleration, 3 jerk)."""
        worst = 0.0
        for (start, end), row in zip(pairwise((*self.times, 1.0)), self.coefficients, strict=True):
            wanted = np.polynomial.Polynomial(row).deriv(order)
            turns = wanted.deriv().roots() if wanted.degree() > 0 else np.empty(0)
            real = turns[np.isreal(turns)].real
            places = (0.0, end - start, *(t for t in real.tolist() if 0 < t < end - start))
            worst = max(worst, *(abs(float(wanted(place))) for place in places))
        return worst

    def _value(self, u: Floats, order: int) -> Floats:
        piece = np.searchsorted(self.times, u, side="right") - 1
        out = np.zeros_like(u)
        for index, (start, row) in enumerate(zip(self.times, self.coefficients, strict=True)):
            mine = piece == index
            out[mine] = np.polynomial.Polynomial(row).deriv(order)(u[mine] - start)
        return out


def law(name: str, ramp: float = RAMP, bend: float = BEND) -> Law:
    """Return the law of that name. Raises InputError for an unknown name and for an invalid ramp or bend."""
    if name == "linear":
        return Law(name, (0.0,), ((0.0, 1.0),))
    if name == "cubic":
        return Law(name, (0.0,), ((0.0, 0.0, 3.0, -2.0),))
    if name == "quintic":
        return Law(name, (0.0,), ((0.0, 0.0, 0.0, 10.0, -15.0, 6.0),))
    if not (0 < ramp <= 0.5 and 0 < bend <= 0.5):
        raise InputError(
            "out-of-range", f"ramp and bend are more than 0 and at most 0.5, not {ramp:g} and {bend:g}"
        )
    if name == "trapezoid":
        return _integrate(name, ((ramp, (1.0,)), (1 - 2 * ramp, (0.0,)), (ramp, (-1.0,))))
    if name == "s-curve":
        rise, level = bend * ramp, (1 - 2 * bend) * ramp
        up, down = (0.0, 1 / rise), (1.0, -1 / rise)
        back, home = (0.0, -1 / rise), (-1.0, 1 / rise)
        ramps = ((rise, up), (level, (1.0,)), (rise, down), (1 - 2 * ramp, (0.0,)))
        return _integrate(name, (*ramps, (rise, back), (level, (-1.0,)), (rise, home)))
    raise InputError("unknown-name", f"unknown law of motion '{name}'", hint=did_you_mean(name, NAMES))


def _integrate(name: str, pieces: tuple[tuple[float, tuple[float, ...]], ...]) -> Law:
    """Return the law whose acceleration has the shape of `pieces` (length, polynomial), scaled to end at
    1.
    """
    times: list[float] = []
    rows: list[np.polynomial.Polynomial] = []
    elapsed = distance = speed = 0.0
    for length, acceleration in pieces:
        if length <= 0:
            continue
        # Each piece continues at the position and speed with which the one before ends.
        row = np.polynomial.Polynomial(acceleration).integ(2, k=[speed, distance])
        times.append(elapsed)
        rows.append(row)
        elapsed, distance, speed = elapsed + length, float(row(length)), float(row.deriv()(length))
    return Law(name, tuple(times), tuple(tuple((row / distance).coef.tolist()) for row in rows))
