"""Pulses and their edges as the tests write them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from servogen.edges import HIGH, LOW
from servogen.verify.pulses import FramedPulses

PinPulse = tuple[int, int, int]
"""Rise, width and pin."""
Edge = tuple[int, int, int]
"""Cycle, pin and level."""


def edges_of(pulses: Iterable[PinPulse]) -> list[Edge]:
    """Return the edges of pulses, in order."""
    edges = [(rise, pin, HIGH) for rise, _, pin in pulses]
    edges += [(rise + width, pin, LOW) for rise, width, pin in pulses]
    return sorted(edges)


def pulses(*bounds: tuple[int, int]) -> FramedPulses:
    """Return pulses from their (rise, fall)."""
    rise, fall = (np.array([each[side] for each in bounds], dtype=np.int64) for side in (0, 1))
    return FramedPulses(rise, fall, np.arange(len(bounds), dtype=np.int64))
