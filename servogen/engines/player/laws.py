"""Laws between poses as tables of the chip.

In: a law as a function of a step's time, 0 to 1. Out: its 17 bytes, with the best piecewise linear fit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from types import MappingProxyType

import numpy as np

from servogen.engines.player.arithmetic import ENTRIES, INTERVALS
from servogen.motion.gait.footwork import bump, swing_share
from servogen.motion.laws import law
from servogen.motion.trajectory import Floats

Shape = Callable[[Floats], Floats]
"""Shares of a step's time -> shares of its path."""


def _trapezoid(u: Floats) -> Floats:
    return np.interp(u, *_fine("trapezoid"))


def _quintic(u: Floats) -> Floats:
    return np.interp(u, *_fine("quintic"))


@cache
def _fine(name: str) -> tuple[Floats, Floats]:
    """Return a law at many times, because looking it up is fast enough for a search."""
    u = np.arange(FINEST + 1) / FINEST
    return u, law(name).share(u)


def _accelerate(u: Floats) -> Floats:
    return u**2


def _decelerate(u: Floats) -> Floats:
    return 1 - (1 - u) ** 2


SHAPES: Mapping[str, Shape] = MappingProxyType(
    {
        "trapezoid": _trapezoid,
        "quintic": _quintic,
        "accelerate": _accelerate,
        "decelerate": _decelerate,
    }
)
"""The laws that a step between two poses may have, besides the straight one."""

FINEST = 4096
"""The number of samples of a law between which linear interpolation is exact to 1e-6."""

FINE = 32
"""The number of samples per interval to which a table is fitted."""

SWING = 128
"""The weight of a whole path in a swing's table, because feet first move back by up to a quarter of it."""


@cache
def table_of(name: str) -> bytes:
    """Return the table of one of `SHAPES`, in 256ths of the path from the first pose."""
    return _fitted(lambda u: 256 * SHAPES[name](u))


def swing_table(rate: float, beyond: float = 0.0) -> bytes:
    """Return the law of turning in the first half of a swing, from its middle, in 128ths of the path back.

    `rate` and `beyond` are those of `swing_share`.
    """
    return _fitted(lambda u: SWING * (1 - 2 * swing_share(u / 2, rate, beyond)))


@cache
def spot_table() -> bytes:
    """Return the law of turning in the first half of a swing on the spot, in 256ths of the whole path."""
    return _fitted(lambda u: 256 * swing_share(u / 2, 0.0))


@cache
def lift_table() -> bytes:
    """Return the law of lifting in the first half of a swing, in 255ths of the lift."""
    return _fitted(lambda u: 255 * bump(u / 2))


def _fitted(shape: Shape) -> bytes:
    """Return the bytes whose linear interpolation is closest to `shape`; the first byte is exact."""
    u = np.arange(INTERVALS * FINE + 1) / (INTERVALS * FINE)
    hats = np.maximum(0.0, 1 - np.abs(u[:, None] * INTERVALS - np.arange(ENTRIES)))
    first = shape(np.zeros(1)).item()
    # The chip rounds down, so half of a unit is added to all bytes but the first.
    wanted = shape(u) + 0.5 - hats[:, 0] * (first + 0.5)
    rest = np.linalg.lstsq(hats[:, 1:], wanted, rcond=None)[0]
    return bytes(np.clip(np.floor(np.concatenate(([first], rest)) + 0.5), 0, 255).astype(int).tolist())
