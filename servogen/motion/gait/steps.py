"""The body's way and the footholds: a walk seen from above, in the ground plane.

In: a gait, the body's motion in a cycle, and where a foot stands when nothing moves (neutral). Out: for any
times the foot in the body's frame while it stands, and the footholds between which it swings. Times are in
cycles, points are complex numbers x + iy.

A foothold is chosen so that in the middle of its stance the foot is at neutral: what the body travels in a
stance lies half before and half behind. The body begins slowly, until the last leg has lifted, so that it
is not left behind further than in the steady walk; it stops the same way. Footholds are those of the steady
walk from the first on, and a leg's last stance ends at neutral.
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
"""A foot that would step less than this stays on the ground."""

SAME_TIME = 1e-9
"""Times (in cycles) nearer than this are one: a frame falls on a landing in spite of floating point."""


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
    """How many cycles' worth of way the body has gone at a time, from standstill, and to it if it ends.

    speed  ▁▁▔▔▔▔▔▁▁    `slow` for `ramp` cycles, then `top`, and for as long `slow` again before the end
    """

    ramp: float
    slow: float
    top: float = 1.0
    cruise: float = math.inf
    """Cycles at `top`; infinite: the walk never ends."""

    @property
    def way(self) -> float:
        """Return the cycles' worth of way until the end."""
        return 2 * self.slow * self.ramp + self.top * self.cruise

    @property
    def stop(self) -> float:
        """Return the time at which the body stands still again."""
        return 2 * self.ramp + self.cruise

    def at(self, time: Floats) -> Floats:
        """Return the cycles' worth of way at `time`."""
        time = np.clip(time, 0.0, self.stop)
        begun = np.minimum(time, self.ramp)
        ending = np.maximum(time - self.ramp - self.cruise, 0.0)
        return np.asarray(self.slow * (begun + ending) + self.top * (time - begun - ending))

    def steady(self, time: Floats) -> Floats:
        """Return the same as if the body had always been at full speed."""
        return np.asarray(self.slow * self.ramp + self.top * (time - self.ramp))


def progress_of(gait: Gait, way: float | None) -> Progress:
    """Return the progress of a body that no standing foot holds back, and of which none slips.

    Until the last leg has lifted the body is so slow that its foot is left behind by no more than in the
    steady walk, half of what the body travels in a stance. The end mirrors the start; the time in between is
    a multiple of the gait's grain, so that the body changes its speed when feet lift or land.
    """
    latest, duty = float(max(lift for _, lift in gait.lifts)), float(gait.duty)
    ramp = latest if latest > duty / 2 else 0.0
    slow = duty / (2 * latest) if ramp else 1.0
    if way is None:
        return Progress(ramp, slow)
    between = way - 2 * slow * ramp
    if between > SAME_TIME:
        cruise = _up_to_grain(between, gait)
        return Progress(ramp, slow, between / cruise, cruise)
    short = _up_to_grain(way / slow, gait)
    return Progress(short / 2, way / short, way / short, 0.0)


def _up_to_grain(cycles: float, gait: Gait) -> float:
    return math.ceil(cycles * gait.grain - SAME_TIME) / gait.grain


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


def steps(
    gait: Gait, leg: str, segment: Segment, progress: Progress, neutral: complex, until: float
) -> Steps:
    """Return the steps of `leg` up to the time `until`, without those that lead nowhere."""
    first, duty = float(dict(gait.lifts)[leg]), float(gait.duty)
    lifts = np.arange(first, until + 1, 1.0)
    middle = lifts + (1 - duty) + duty / 2
    travelled = progress.steady(middle)
    if math.isfinite(progress.stop):
        # The last stance of a leg ends where the body stops, so that it need not step again.
        near = progress.way - progress.at(lifts + (1 - duty)) <= duty / 2 + SAME_TIME
        travelled[near & (lifts + 1 >= progress.stop - SAME_TIME)] = progress.way
    position, heading = segment.travelled(travelled)
    holds = np.concatenate(([neutral], position + np.exp(1j * heading) * neutral))
    moved = np.abs(np.diff(holds)) > SAME_M
    kept = np.concatenate(([True], moved))
    return Steps(segment, progress, lifts[moved], lifts[moved] + (1 - duty), holds[kept])
