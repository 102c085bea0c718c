"""The pulses that a capture's beginning and end cut: only one edge of each was seen, or none.

        begin                                    end
    ┌─────┊───┐          ┌───────┐          ┌─────┊───┐
    │     ┊   │          │       │          │     ┊   │
    ┘     ┊   └──────────┘       └──────────┘     ┊   └──
              first fall                    last rise

In: a channel's pulses, and the position of the capture in the schedule. Out: the deviation of those edges, or
of\nthe level at the capture's ends, from the schedule.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from servogen.verify.pulses import CutPulses, Pulses, nearest

Floats = npt.NDArray[np.float64]


def end_errors(
    cut: CutPulses, wanted: Pulses, begin: Floats, slope: float, length: int
) -> tuple[Floats, Floats]:
    """Return the errors at the beginning and at the end, in cycles, for each time at which it may `begin`.

    `begin` is in cycles of the schedule; the capture has `length` steps, `slope` a cycle.
    """
    nothing = np.zeros(len(begin))
    if not len(wanted.rise) or (cut.high and cut.first_fall is None):
        return nothing, nothing
    end = begin + length / slope
    if cut.first_fall is not None:
        fall = begin + cut.first_fall / slope
        first = np.abs(wanted.fall[nearest(fall, wanted.fall)] - fall)
    else:
        first = _inside(wanted, begin)
    if cut.last_rise is not None:
        rise = begin + cut.last_rise / slope
        return first, np.abs(wanted.rise[nearest(rise, wanted.rise)] - rise)
    return first, _inside(wanted, end)


def _inside(wanted: Pulses, time: Floats) -> Floats:
    """Return how far inside a pulse each time lies; 0 outside pulses."""
    row = np.searchsorted(wanted.rise, time, side="right") - 1
    known = row.clip(min=0)
    inside = np.minimum(time - wanted.rise[known], wanted.fall[known] - time)
    return np.where(row < 0, 0.0, np.maximum(inside, 0.0))
