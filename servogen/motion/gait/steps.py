"""The body's way and the footholds: a walk seen from above, in the ground plane.

In: a gait, the body's motion in a cycle, and where a foot stands when nothing moves (neutral). Out: for any
times the foot in the body's frame while it stands, and the footholds between which it swings. Times are in
cycles, points are complex numbers x + iy.

A foothold is chosen so that in the middle of its stance the foot is at neutral: what the body travels in a
stance lies half before and half behind. The body's speed rises evenly at the start, for so long that the last
leg to lift is not left behind further than in the steady walk; it falls the same way at a stop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from servogen.motion.gait.phases import Gait
from servogen.motion.trajectory import Floats

Points = npt.NDArray[np.complex128]

SAME_M = 1e-9
"""A foot whose step would be shorter than this stays on the ground."""


@dataclass(frozen=True, slots=True)
class Segment:
    """The body's motion per cycle: metres forward and to the left, radians counter-clockwise.

    `cycles` is the number of cycles; None: without an end.
    """

    forward: float = 0.0
    left: float = 0.0
    turn: float = 0.0
    cycles: float | None = None

    def travelled(self, cycles: Floats) -> tuple[Points, Floats]:
        """Return position and heading after so many cycles at full speed, in the frame of the start."""
        heading = np.asarray(self.turn * cycles, float)
        step = complex(self.forward, self.left)
        if self.turn == 0:
            return np.asarray(step * cycles, complex), heading
        return np.asarray(step * (np.exp(1j * heading) - 1) / (1j * self.turn), complex), heading


@dataclass(frozen=True, slots=True)
class Progress:
    """The cycles that the body has travelled at a time, from standstill, and to standstill if the way ends.

    speed  ╱▔▔▔▔▔▔╲    `ramp` cycles up, and as many down
    """

    ramp: float
    distance: float | None
    """In cycles; None: without an end."""

    @property
    def top(self) -> float:
        """Return the greatest speed as a share of the full speed, which a short way does not reach."""
        return 1.0 if self.distance is None else min(1.0, self.distance / self.ramp)

    @property
    def stop(self) -> float:
        """Return the time at which the body stands again."""
        return math.inf if self.distance is None else self.distance / self.top + self.ramp

    def at(self, time: Floats) -> Floats:
        """Return the cycles travelled at `time`."""
        time = np.clip(time, 0.0, self.stop)
        up = np.minimum(time, self.ramp) ** 2 / (2 * self.ramp) + np.maximum(time - self.ramp, 0.0)
        if self.distance is None:
            return up
        left = np.minimum(self.stop - time, self.ramp)
        return self.top * (up - (self.ramp - left) ** 2 / (2 * self.ramp))


def start_ramp(gait: Gait) -> float:
    """Return the cycles in which the speed rises, so that no foot is left behind by more than duty / 2 of a
    stride.

    A leg that first lifts at t has seen t² / (2 ramp) of a stride by then (t ≤ ramp).
    """
    latest = float(max(lift for _, lift in gait.lifts))
    return max(latest, latest**2 / float(gait.duty), float(gait.duty) / 2)


@dataclass(frozen=True, slots=True, eq=False)
class Steps:
    """One leg's walk: the times it lifts and lands, and its footholds in the frame of the start.

    `holds[k]` is left at `lifts[k]`; `holds[k + 1]` is reached at `lands[k]`.
    """

    segment: Segment
    progress: Progress
    lifts: Floats
    lands: Floats
    holds: Points

    def swing_at(self, time: Floats) -> npt.NDArray[np.int64]:
        """Return the number of the swing at `time`, -1 on the ground."""
        if not len(self.lifts):
            return np.full(time.shape, -1)
        index = np.searchsorted(self.lifts, time - SAME_TIME, side="left") - 1
        flying = (index >= 0) & (time < self.lands[np.maximum(index, 0)] - SAME_TIME)
        return np.where(flying, index, -1)

    def standing(self, time: Floats) -> Points:
        """Return the foot in the body frame at times on the ground: the foothold seen from the
        moving body.
        """
        landed = np.searchsorted(self.lands, time + SAME_TIME, side="right")
        return self.seen(self.holds[landed], time)

    def seen(self, foothold: Points | complex, time: Floats) -> Points:
        """Return a foothold in the body frame at `time`."""
        position, heading = self.segment.travelled(self.progress.at(time))
        return np.asarray((foothold - position) * np.exp(-1j * heading))


SAME_TIME = 1e-9
"""Times (in cycles) closer than this are equal, so that rounding does not move a landing off its frame."""


def steps(
    gait: Gait, leg: str, segment: Segment, progress: Progress, neutral: complex, until: float
) -> Steps:
    """Return the steps of `leg` up to the time `until`, without those that lead nowhere."""
    first, duty = float(dict(gait.lifts)[leg]), float(gait.duty)
    lifts = np.arange(first, until + 1, 1.0)
    middle = lifts + (1 - duty) + duty / 2
    position, heading = segment.travelled(progress.at(middle))
    holds = np.concatenate(([neutral], position + np.exp(1j * heading) * neutral))
    moved = np.abs(np.diff(holds)) > SAME_M
    kept = np.concatenate(([True], moved))
    return Steps(segment, progress, lifts[moved], lifts[moved] + (1 - duty), holds[kept])
