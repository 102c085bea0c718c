"""The body's path and the footholds: a walk seen from above, in the ground plane.

In: a gait, the body's motion in a cycle, and the position of a foot when nothing moves (neutral). Out: at any
time the position of a standing foot in the body's frame, and the footholds between which it swings. Times are
in cycles, points are complex numbers x + iy.

A foothold is chosen so that the foot is at neutral in the middle of its stance: half of the distance that the
body travels in a stance lies in front and half behind. The body moves at constant speed from the first moment
to the last, because its feet have previously stepped, on the spot, to their places in the steady walk.
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
"""A foot stays on the ground if its step would be shorter than this (metres)."""

SAME_TIME = 1e-9
"""Times (in cycles) closer than this are equal, so that frames coincide with landings despite rounding."""


@dataclass(frozen=True, slots=True)
class Segment:
    """The body's motion per cycle: metres forward and to the left, radians counter-clockwise.

    `cycles` is the number of cycles; None: endless.
    """

    forward: float = 0.0
    left: float = 0.0
    turn: float = 0.0
    cycles: float | None = None

    def travelled(self, cycles: Floats) -> tuple[Points, Floats]:
        """Return position and heading after a number of cycles at full speed, in the frame of the start."""
        heading = np.asarray(self.turn * cycles, float)
        step = complex(self.forward, self.left)
        if self.turn == 0:
            return np.asarray(step * cycles, complex), heading
        # The integral of a step that turns with the body.
        return np.asarray(step * (np.exp(1j * heading) - 1) / (1j * self.turn), complex), heading


@dataclass(frozen=True, slots=True)
class Cruise:
    """The body's progress over time, in cycles of motion: at `speed` from time 0 to `stop`."""

    speed: float = 1.0
    stop: float = math.inf

    def at(self, time: Floats) -> Floats:
        """Return the progress at `time`, in cycles of motion."""
        return np.asarray(self.speed * np.clip(time, 0.0, self.stop))

    def steady(self, time: Floats) -> Floats:
        """Return the progress as if the body had always moved."""
        return np.asarray(self.speed * time)


def cruise_of(gait: Gait, cycles: float | None) -> Cruise:
    """Return the cruise of a body that moves by `cycles` cycles of motion; None: endlessly.

    Its duration is a multiple of the gait's grain, so that it ends when feet lift or land.
    """
    if cycles is None:
        return Cruise()
    stop = math.ceil(cycles * gait.grain - SAME_TIME) / gait.grain
    return Cruise(cycles / stop, stop)


@dataclass(frozen=True, slots=True, eq=False)
class Steps:
    """One leg's walk: the times at which it lifts and lands, and its footholds in the frame of the start.

    `holds[k]` is left at `lifts[k]`; `holds[k + 1]` is reached at `lands[k]`. The first swing may have begun
    before the body starts, the last one may end after it stops.
    """

    segment: Segment
    cruise: Cruise
    lifts: Floats
    lands: Floats
    holds: Points

    def swing_at(self, time: Floats) -> npt.NDArray[np.int64]:
        """Return the index of the swing at `time`, -1 on the ground."""
        if not len(self.lifts):
            return np.full(time.shape, -1)
        index = np.searchsorted(self.lifts, time - SAME_TIME, side="left") - 1
        flying = (index >= 0) & (time < self.lands[np.maximum(index, 0)] - SAME_TIME)
        return np.where(flying, index, -1)

    def standing(self, time: Floats) -> Points:
        """Return the foot in the body's frame at times on the ground: the foothold, seen from the body."""
        landed = np.searchsorted(self.lands, time + SAME_TIME, side="right")
        return self._in_body_frame(self.holds[landed], self.cruise.at(time))

    def ends(self, number: int) -> tuple[Points, Points]:
        """Return where a swing begins and ends, in the frame of a body that always moves."""
        first, last = (
            self._in_body_frame(self.holds[hold : hold + 1], self.cruise.steady(phase[number : number + 1]))
            for hold, phase in ((number, self.lifts), (number + 1, self.lands))
        )
        return first, last

    def cut(self, number: int, time: Floats) -> npt.NDArray[np.bool_]:
        """Return the times at which the foot stands where a swing was when the body started or stopped."""
        before = (self.lifts[number] < -SAME_TIME) & (time <= self.lifts[number] + SAME_TIME)
        after = (self.lands[number] > self.cruise.stop + SAME_TIME) & (time >= self.lands[number] - SAME_TIME)
        return np.asarray(before | after)

    def _in_body_frame(self, foothold: Points, progress: Floats) -> Points:
        position, heading = self.segment.travelled(progress)
        return np.asarray((foothold - position) * np.exp(-1j * heading))


def steps(gait: Gait, leg: str, segment: Segment, cruise: Cruise, neutral: complex) -> Steps:
    """Return the steps of `leg`, for one cycle if the body never stops; empty if they lead nowhere."""
    first, duty, swing = float(dict(gait.lifts)[leg]), float(gait.duty), float(gait.swing)
    if first - 1 + swing > SAME_TIME:
        first -= 1  # the leg is in the air at the start
    end = 1.0 if math.isinf(cruise.stop) else cruise.stop
    lifts = np.arange(first, end - SAME_TIME)
    # A foot is at neutral in the middle of its stance: of the one before the first lift, and of one after
    # each landing.
    middles = np.concatenate(([first - duty / 2], lifts + swing + duty / 2))
    position, heading = segment.travelled(cruise.steady(middles))
    holds = position + np.exp(1j * heading) * neutral
    if not (np.abs(np.diff(holds)) > SAME_M).all():
        return Steps(segment=segment, cruise=cruise, lifts=np.zeros(0), lands=np.zeros(0), holds=holds[:1])
    return Steps(segment=segment, cruise=cruise, lifts=lifts, lands=lifts + swing, holds=holds)
