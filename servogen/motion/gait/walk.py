"""A walking robot: gait, way and posture -> joint angles at each frame, with the facts about them.

In: a `WalkingRobot`, a gait, the segments of the way, the posture. Out: `Walk`: the
trajectory; at each frame the feet, the corrections that the legs' springs must give, the stability margin.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from servogen.errors import InputError
from servogen.kinematics.protocol import Posture, WalkingRobot
from servogen.motion.gait.footwork import Frames, HeldBack, footwork, joined
from servogen.motion.gait.phases import Gait, PhaseChange
from servogen.motion.gait.stability import margin
from servogen.motion.gait.steps import SAME_M, Segment
from servogen.motion.limits import Limits, stretch
from servogen.motion.trajectory import MAX_FRAMES, Floats, JointTrajectory
from servogen.robot.model import Joint
from servogen.units import Clock, Cycles

SAME_RAD = 1e-7
"""Angles of two rounds of a loop that differ by less than this are equal: far less than a pulse can show."""


MIN_SWING = 4
"""The fewest frames of a swing; with fewer the foot would hardly leave the ground."""


MAX_GRAIN = 24
"""The largest grain, in frames, to a multiple of which a cycle is lengthened."""


MAX_FRAMES_PER_CYCLE = 3000
"""The longest cycle, a minute at 20 ms; a slower one is a mistake."""


FIRST_M = 0.001
"""A foot that has risen as much has left the ground."""


MAX_LIFTOFF_SLIDE = 3.0
"""How many times the height that it has risen a foot may have moved sideways by then."""


SAME_DIGITS = 9
"""Of metres: ways nearer than a nanometre are equal, so that the first of them is named on every machine."""


@dataclass(frozen=True, slots=True)
class Slip:
    """How far a foot is dragged in a stance without a spring; the leg and the last frame of the stance."""

    metres: float
    leg: str
    frame: int

    def text(self) -> str:
        """Return the slip as a sentence."""
        if self.metres < SAME_M:
            return "no foot would slip without its spring"
        return (
            f"without its spring a foot would slip up to {1000 * self.metres:z.2f} mm in a stance "
            f"({self.leg}, until frame {self.frame})"
        )


@dataclass(frozen=True, slots=True, eq=False)
class Walk:
    """`trajectory` has the joints `<leg>_alpha` and `<leg>_beta`, leg by leg; the arrays have a row a frame.

    `feet` (frames, legs, 3): in the body's frame, by forward kinematics; `ground` (frames, legs): standing.
    `corrections` (frames, legs, 3): what the springs give, from the foot to where it should stand; metres.
    `margins` (frames,): from the centre of mass to the nearest edge of the support polygon; metres.
    """

    trajectory: JointTrajectory
    legs: tuple[str, ...]
    feet: Floats
    ground: npt.NDArray[np.bool_]
    corrections: Floats
    margins: Floats
    frames_per_cycle: int
    centres: tuple[complex | None, ...]
    """For each segment the centre of rotation in the body's frame, x + iy; None: the body does not turn."""
    held_back: tuple[HeldBack, ...]
    """The feet that the limits of joints keep off the line from the centre of rotation."""
    liftoff_slide_m: float
    """How far a foot moves sideways until it has risen by `FIRST_M`."""
    changes: tuple[PhaseChange, ...] = ()
    """Where the frames moved the gait's phases by more than half a frame."""

    @property
    def leg_angles(self) -> Floats:
        """Return the joint angles (frames, legs, k)."""
        return self.trajectory.angles.reshape(len(self.ground), len(self.legs), -1)

    @property
    def largest_correction_m(self) -> float:
        """Return the largest correction that a leg's spring gives."""
        return float(np.linalg.norm(self.corrections, axis=2).max(initial=0.0))

    @property
    def minimum_margin_m(self) -> float:
        """Return the smallest stability margin of all frames."""
        return float(self.margins.min(initial=math.inf))

    @property
    def slip(self) -> Slip:
        """Return the longest way that a foot would be dragged in one stance if its spring did not give."""
        frames = len(self.ground)
        rows = np.concatenate((np.arange(frames), np.arange(self.trajectory.loop_start, frames)))
        standing = self.ground[rows[1:]] & self.ground[rows[:-1]]
        steps = np.linalg.norm(np.diff(self.corrections[rows], axis=0), axis=2)
        worst = Slip(0.0, self.legs[0], 0)
        for leg, stands, way in zip(self.legs, standing.T, steps.T, strict=True):
            total = np.cumsum(np.where(stands, way, 0.0))
            dragged = total - np.maximum.accumulate(np.where(stands, 0.0, total))
            last = int(np.argmax(np.round(dragged, SAME_DIGITS)))
            if dragged[last] > worst.metres + SAME_M:
                worst = Slip(float(dragged[last]), leg, int(rows[last + 1]))
        return worst

    def full_height(self) -> str | None:
        """Return a warning where the legs stand so upright that a foot is dragged before it lifts."""
        if self.liftoff_slide_m <= MAX_LIFTOFF_SLIDE * FIRST_M:
            return None
        return (
            f"the legs stand at their full height: a foot moves {1000 * self.liftoff_slide_m:z.1f} mm "
            f"sideways before it is {1000 * FIRST_M:g} mm above the ground; a lower body drags its feet less"
        )

    def centre_texts(self) -> tuple[tuple[int, str], ...]:
        """Return for each segment that turns its number, from 0, and where its centre of rotation is."""
        return tuple(
            (
                index,
                f"the body turns about ({1000 * at.real:z.1f}, {1000 * at.imag:z.1f}) mm in its own frame",
            )
            for index, at in enumerate(self.centres)
            if at is not None
        )

    @property
    def lift_m(self) -> float:
        """Return the greatest height of a foot above the ground."""
        return float(self.feet[:, :, 2].max() - self.feet[:, :, 2].min())


def walk(
    robot: WalkingRobot,
    gait: Gait,
    segments: Sequence[Segment],
    posture: Posture,
    period: Cycles,
    clock: Clock,
    *,
    frames_per_cycle: int | None = None,
    limits: Limits | None = None,
    spring_m: float | None = None,
    allow_falling: bool = False,
    others: Sequence[Segment] = (),
) -> Walk:
    """Return the walk along `segments`, each from standstill to standstill; only the last may have no end.

    A cycle takes at least `frames_per_cycle` frames; None: as few as `limits` (of a servo) allow. It is a
    multiple of the gait's grain if that is small; otherwise the gait's phases are moved to frames. A walk
    without an end loops over one cycle, others over the whole way. `spring_m` is the greatest correction that
    a leg's spring can give.
    `others` are segments of other walks that the same robot may continue with: its legs stand so that they
    suit those too.

    Raises InputError for a posture that the legs cannot take, a step beyond their limits, a correction that
    is too large and, unless `allow_falling`, for a robot that would fall over.
    """
    if not segments:
        raise InputError("no-pulses", "a walk needs at least one segment")
    if any(segment.cycles is None for segment in segments[:-1]):
        raise InputError("endless-motion", "only the last segment of a walk can be without an end")
    limits = limits or Limits()
    if frames_per_cycle is None and math.isinf(limits.speed):
        raise InputError(
            "no-speed", "the speed of the cycle is not known", hint="give its time, or a speed limit"
        )
    plan = footwork(robot, gait, posture, (*segments, *others))
    names = plan.legs
    joints = {name: joint for leg in robot.limbs for name, joint in leg.joints.items()}
    minimum = math.ceil(MIN_SWING / gait.swing)
    if frames_per_cycle is not None and frames_per_cycle < minimum:
        raise InputError(
            "cycle-time",
            f"a cycle of {frames_per_cycle} frames is too short for the gait '{gait.name}'",
            hint=f"at least {minimum} frames: each swing takes {MIN_SWING} or more",
        )
    count = _whole(gait, frames_per_cycle or minimum)
    cycles = sum(1 if segment.cycles is None else segment.cycles for segment in segments)
    while True:
        if not count * cycles <= MAX_FRAMES:
            raise InputError(
                "too-many-frames",
                f"the walk is more than {MAX_FRAMES} frames long",
                hint="walk fewer cycles, or faster ones",
            )
        rounded = gait.on_frames(count)
        parts = replace(plan, gait=rounded).frames_of_route(segments, count)
        frames = joined(parts)
        loop_start = len(frames.angles) - count if segments[-1].cycles is None else 0
        angles = frames.angles.reshape(len(frames.angles), -1)
        _check_limits(joints, angles)
        around = np.concatenate((angles, angles[loop_start : loop_start + 3]))
        slower = stretch(around, float(clock.seconds(period)), [limits] * angles.shape[1])
        if frames_per_cycle is not None or slower <= 1:
            break
        count = _whole(gait, max(count + 1, math.ceil(count * min(slower, 2.0))))
        if count > MAX_FRAMES_PER_CYCLE:
            raise InputError(
                "cycle-time",
                "the limits of the servos ask for a cycle of more than a minute",
                hint="shorten the stride, or raise the limits",
            )
    trajectory = JointTrajectory(
        joints=tuple(joints), clock=clock, period=period, angles=angles, loop_start=loop_start
    )
    margins = _margins(robot, frames)
    changes = rounded.changes_from(gait, count)
    result = Walk(
        trajectory=trajectory,
        legs=names,
        feet=frames.feet,
        ground=frames.ground,
        corrections=frames.corrections,
        margins=margins,
        frames_per_cycle=count,
        centres=tuple(plan.motion(segment).centre for segment in segments),
        held_back=tuple(plan.held_back(segments)),
        liftoff_slide_m=plan.liftoff_slide_m(FIRST_M),
        changes=changes,
    )
    _refuse(result, spring_m, allow_falling)
    return result


def _whole(gait: Gait, frames: int) -> int:
    """Return at least `frames`, and a multiple of the gait's grain where that is small."""
    return -(-frames // gait.grain) * gait.grain if gait.grain <= MAX_GRAIN else frames


def _margins(robot: WalkingRobot, frames: Frames) -> Floats:
    """Return the stability margin of each frame, inf for one or two legs, which something else holds."""
    if len(robot.limbs) < 3:
        return np.full(len(frames.angles), math.inf)
    centre = np.array(robot.centre_of_mass[:2])
    stand = (frames.feet + frames.corrections)[:, :, :2]
    return np.array([margin(feet[down], centre) for feet, down in zip(stand, frames.ground, strict=True)])


def _check_limits(joints: Mapping[str, Joint], angles: Floats) -> None:
    """Raise InputError for the first joint that would have to turn beyond its limits."""
    for (name, joint), column in zip(joints.items(), angles.T, strict=True):
        low, high = float(column.min()), float(column.max())
        if low < joint.lower or high > joint.upper:
            shown, allowed = (
                " to ".join(f"{math.degrees(end):z.1f}°" for end in pair)
                for pair in ((low, high), (joint.lower, joint.upper))
            )
            raise InputError(
                "servo-limit",
                f"{name} would have to turn from {shown}: its limits are {allowed}",
                hint="shorten the stride, or lift the feet less",
            )


def _refuse(walk: Walk, spring_m: float | None, allow_falling: bool) -> None:
    worst = walk.largest_correction_m
    if spring_m is not None and worst > spring_m:
        raise InputError(
            "servo-limit",
            f"the springs would have to give {1000 * worst:.2f} mm: they give {1000 * spring_m:g} mm at most",
            hint="shorten the stride or the turn: two joints follow a straight line only roughly",
        )
    if walk.minimum_margin_m < 0 and not allow_falling:
        frame = int(np.argmin(walk.margins))
        feet = ", ".join(leg for leg, down in zip(walk.legs, walk.ground[frame], strict=True) if down)
        outside = f"its centre of mass is {-1000 * walk.minimum_margin_m:z.1f} mm outside the feet {feet}"
        raise InputError(
            "falls-over",
            f"the robot falls over in frame {frame}: {outside if feet else 'no foot is on the ground'}",
            hint="take a gait with more feet on the ground or a shorter stride, or allow falling "
            "(allow_falling = true in a job, --allow-falling)",
        )
