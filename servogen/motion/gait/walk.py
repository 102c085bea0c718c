"""A walking robot: gait, route and posture -> joint angles at each frame, with facts about them.

In: a `WalkingRobot`, a gait, the segments of the route, the posture. Out: `Walk`: the trajectory and, for
each frame, the feet, the corrections that the legs' springs must yield, and the stability margin.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from servogen.errors import InputError
from servogen.kinematics.protocol import Posture, WalkingRobot
from servogen.kinematics.stance import tilt
from servogen.motion.gait.collisions import GAP_M, nearest_collision
from servogen.motion.gait.footwork import MAX_BEYOND, Footwork, Frames, HeldBack, footwork, join_frames
from servogen.motion.gait.phases import Gait, PhaseChange
from servogen.motion.gait.stability import margin
from servogen.motion.gait.steps import SAME_M, Segment
from servogen.motion.limits import JointLimits, Tightest, tightest
from servogen.motion.trajectory import MAX_FRAMES, Floats, JointTrajectory
from servogen.robot.model import Joint
from servogen.units import Clock, Cycles

SAME_RAD = 1e-7
"""The tolerance (radians) between angles of two rounds of a loop, far below the resolution of a pulse."""


MIN_SWING = 4
"""The minimum number of frames of a swing; with fewer, the foot would hardly leave the ground."""


MAX_GRAIN = 24
"""The largest grain, in frames, for which cycles are lengthened to a multiple of it."""


MAX_STRETCH = 0.03
"""A cycle that is lengthened by a larger share, to whole frames of its gait, is said."""

MAX_FRAMES_PER_CYCLE = 3000
"""The longest cycle, in frames: a minute at 20 ms; a slower one must be a mistake."""


FIRST_M = 0.001
"""The height (metres) at which a foot has certainly left the ground."""


MAX_LIFTOFF_SLIDE = 3.0
"""The maximum sideways movement of a foot up to that moment, in multiples of its height."""


MAX_LEAN_SLIP = 0.1
"""The largest correction, as a share of a step, that legs of two joints may need while the body leans."""

NO_LIMITS = JointLimits()

SAME_DIGITS = 9
"""Digits of metres to which distances are compared, so that every machine names the same frame."""


@dataclass(frozen=True, slots=True)
class Slip:
    """The distance by which the foot of a rigid leg is dragged in a stance; its leg, the stance's last
    frame.
    """

    metres: float
    leg: str
    frame: int

    def text(self) -> str:
        """Return the slip in words."""
        if self.metres < SAME_M:
            return "with rigid legs no foot would slip"
        return (
            f"with rigid legs a foot would slip up to {1000 * self.metres:z.2f} mm in a stance "
            f"({self.leg}, until frame {self.frame})"
        )


@dataclass(frozen=True, slots=True, eq=False)
class Walk:
    """`trajectory` has the joints `<leg>_alpha` and `<leg>_beta`, leg by leg; arrays have one row per frame.

    `feet` (frames, legs, 3): in the body's frame, by forward kinematics; `ground` (frames, legs): standing.
    `corrections` (frames, legs, 3): how the springs yield, from the foot to where it should stand, metres.
    `margins` (frames,): from the centre of mass to the nearest edge of the support polygon, metres: the
    minimum during each frame.
    """

    trajectory: JointTrajectory
    begins: tuple[int, ...]
    """The frame at which each segment begins, with its steps on the spot."""
    legs: tuple[str, ...]
    feet: Floats
    ground: npt.NDArray[np.bool_]
    corrections: Floats
    margins: Floats
    frames_per_cycle: int
    centres: tuple[complex | None, ...]
    """The centre of rotation of each segment in the body's frame, x + iy; None if the body does not turn."""
    held_back: tuple[HeldBack, ...]
    """The feet that joint limits keep off the line from the centre of rotation."""
    liftoff_slide_m: float
    """The distance that a foot moves sideways until it has risen by `FIRST_M`."""
    centre: complex = 0j
    """The centre of mass over the ground, x + iy from the body's origin."""
    level: Floats = field(default_factory=lambda: np.eye(3))
    """The rotation (3, 3) from the body's frame to its level one, in which the feet are."""
    beyond: float = 0.0
    """The share of its way by which a swing goes farther beyond its foothold to take up `lost`."""
    lost: float = 0.0
    """The angle that the servos lose when a joint turns round, radians; 0: not compensated."""
    changes: tuple[PhaseChange, ...] = ()
    """Phases of the gait that rounding to frames has moved by more than half a frame."""
    needed_frames: int = 0
    """The frames of a cycle that were asked for, or that the limits need; the gait rounds them up."""
    tightest: tuple[str, Tightest] | None = None
    """The limit that the walk comes nearest to, with its joint; None without limits."""
    least_frames: int = 0
    """The frames of a cycle whose swings take `MIN_SWING` frames, the fewest."""

    @property
    def leg_angles(self) -> Floats:
        """Return the joint angles (frames, legs, k)."""
        return self.trajectory.angles.reshape(len(self.ground), len(self.legs), -1)

    @property
    def largest_correction_m(self) -> float:
        """Return the largest correction by a leg's spring, in metres."""
        return float(np.linalg.norm(self.corrections, axis=2).max(initial=0.0))

    @property
    def minimum_margin_m(self) -> float:
        """Return the minimum stability margin of all frames, in metres."""
        return float(self.margins.min(initial=math.inf))

    @property
    def slip(self) -> Slip:
        """Return the longest distance that a foot would be dragged in one stance if its spring did not
        yield.
        """
        frames = len(self.ground)
        rows = np.concatenate((np.arange(frames), np.arange(self.trajectory.loop_start, frames)))
        standing = self.ground[rows[1:]] & self.ground[rows[:-1]]
        steps = np.linalg.norm(np.diff(self.corrections[rows], axis=0), axis=2)
        worst = Slip(0.0, self.legs[0], 0)
        for leg, stands, step in zip(self.legs, standing.T, steps.T, strict=True):
            total = np.cumsum(np.where(stands, step, 0.0))
            dragged = total - np.maximum.accumulate(np.where(stands, 0.0, total))
            last = int(np.argmax(np.round(dragged, SAME_DIGITS)))
            if dragged[last] > worst.metres + SAME_M:
                worst = Slip(float(dragged[last]), leg, int(rows[last + 1]))
        return worst

    def stretched_text(self) -> str:
        """Return in words by how much a cycle is longer than asked for; empty for a few per cent."""
        longer = self.frames_per_cycle / self.needed_frames - 1 if self.needed_frames else 0.0
        if longer <= MAX_STRETCH:
            return ""
        return (
            f", {100 * longer:.0f} % more than the {self.needed_frames} frames that were asked for or that "
            "the servos need, so that every foot lifts and lands on a frame"
        )

    def full_height(self) -> str | None:
        """Return a warning if the legs stand so upright that a foot is dragged before it lifts, else None."""
        if self.liftoff_slide_m <= MAX_LIFTOFF_SLIDE * FIRST_M:
            return None
        return (
            f"the legs stand at their full height: a foot moves {1000 * self.liftoff_slide_m:z.1f} mm "
            f"sideways before it is {1000 * FIRST_M:g} mm above the ground; a lower body drags its feet less"
        )

    def centre_texts(self) -> tuple[tuple[int, str], ...]:
        """Return the number (from 0) of each segment that turns, and its centre of rotation in words."""
        return tuple(
            (
                index,
                f"the body turns about ({1000 * centre.real:z.1f}, {1000 * centre.imag:z.1f}) mm "
                "in its own frame",
            )
            for index, centre in enumerate(self.centres)
            if centre is not None
        )

    def lost_motion_text(self) -> str | None:
        """Return in words how the swings take up the servos' lost motion.

        None if that is not compensated, or no foot ever leaves the ground.
        """
        if self.lost <= 0 or self.ground.all():
            return None
        lost = f"lost motion of {math.degrees(self.lost):.2f}°"
        if self.beyond <= 0:
            return f"the swings take up the servos' {lost} before the feet land"
        most = self.beyond >= MAX_BEYOND
        owners = "part of the servos'" if most else "the servos'"
        rest = "; a longer stride loses a smaller share of itself to the rest" if most else ""
        return (
            f"the swings overshoot their footholds by a further {100 * self.beyond:.1f} % of their length, "
            f"so that {owners} {lost} is taken up before the feet land{rest}"
        )

    @property
    def lift_m(self) -> float:
        """Return the maximum height of a foot above the ground, in metres."""
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
    limits: JointLimits | Sequence[JointLimits] = NO_LIMITS,
    spring_m: float | None = None,
    allow_falling: bool = False,
    others: Sequence[Segment] = (),
    lost: float = 0.0,
    gap: float = GAP_M,
) -> Walk:
    """Return the walk along `segments`, each from standstill to standstill; only the last may be endless.

    A cycle takes at least `frames_per_cycle` frames; None: as few as `limits`, of all joints or of each in
    turn, allow. It is a multiple of the gait's grain if that is small; otherwise the gait's phases are moved
    to frames. An endless walk loops over one cycle, others over the whole route. `spring_m` is the maximum
    correction of a leg's spring. `others` are segments of other walks with which the same robot may continue:
    its stance suits these too. `lost` is the angle (radians) that the servos lose when a joint reverses:
    swings overshoot their footholds so that it is taken up before the feet land. `gap` is the least distance
    (metres) between the centre lines of two legs, or a leg and the body.

    Raises InputError for a posture that the legs cannot take, a step beyond their limits, legs that meet, a
    correction that is too large and, unless `allow_falling`, for a robot that would fall over.
    """
    if not segments:
        raise InputError("no-pulses", "a walk needs at least one segment")
    if any(segment.cycles is None for segment in segments[:-1]):
        raise InputError("endless-motion", "only the last segment of a walk can be endless")
    plan = footwork(robot, gait, posture, (*segments, *others))
    joints = {name: joint for leg in robot.limbs for name, joint in leg.joints.items()}
    each = [limits] * len(joints) if isinstance(limits, JointLimits) else limits
    minimum = _least_frames(gait, frames_per_cycle, each)

    def timed(count: int) -> _Timed:
        return _time_walk(plan, gait, segments, others, count, lost, float(clock.seconds(period)), each)

    made = timed(_whole(gait, frames_per_cycle)) if frames_per_cycle else _shortest(gait, timed, minimum)
    _check_limits(joints, made.angles)
    if frames_per_cycle is None and made.tight.factor > 1:
        raise InputError(
            "cycle-time",
            "the limits of the servos require a cycle of more than a minute",
            hint="shorten the stride, or raise the limits",
        )
    plan, frames = made.plan, made.frames
    result = Walk(
        trajectory=JointTrajectory(tuple(joints), clock, period, made.angles, made.loop_start),
        begins=made.begins,
        legs=plan.legs,
        feet=frames.feet,
        ground=frames.ground,
        corrections=frames.corrections,
        margins=_margins(plan.centre, frames, made.loop_start),
        frames_per_cycle=made.count,
        centres=tuple(plan.motion(segment).centre for segment in segments),
        held_back=tuple(plan.held_back(segments)),
        liftoff_slide_m=plan.liftoff_slide_m(FIRST_M),
        centre=plan.centre,
        level=tilt(posture),
        beyond=plan.beyond,
        lost=lost,
        changes=plan.gait.changes_from(gait, made.count),
        needed_frames=frames_per_cycle or made.count,
        tightest=None if made.tight.factor == 0 else (tuple(joints)[made.tight.joint], made.tight),
        least_frames=_whole(gait, minimum),
    )
    _refuse(result, spring_m, allow_falling)
    if plan.margin is not None and not plan.stance.free and spring_m is None:
        _refuse_lean(result, segments)
    _refuse_meeting(robot, result, gap)
    return result


def _least_frames(gait: Gait, frames_per_cycle: int | None, limits: Sequence[JointLimits]) -> int:
    """Return the fewest frames of a cycle. Raises InputError if fewer are asked for, or if nothing says how
    long a cycle is.
    """
    if frames_per_cycle is None and any(math.isinf(limit.speed) for limit in limits):
        raise InputError(
            "no-speed", "the speed of the cycle is not known", hint="state its time, or a speed limit"
        )
    minimum = math.ceil(MIN_SWING / gait.swing)
    if frames_per_cycle is not None and frames_per_cycle < minimum:
        raise InputError(
            "cycle-time",
            f"a cycle of {frames_per_cycle} frames is too short for the gait '{gait.name}'",
            hint=f"at least {minimum} frames: each swing takes {MIN_SWING} or more",
        )
    return minimum


@dataclass(frozen=True, slots=True, eq=False)
class _Timed:
    """A route in cycles of `count` frames, and the limit that it comes nearest to."""

    count: int
    plan: Footwork
    begins: tuple[int, ...]
    frames: Frames
    angles: Floats
    loop_start: int
    tight: Tightest


def _time_walk(
    plan: Footwork,
    gait: Gait,
    segments: Sequence[Segment],
    others: Sequence[Segment],
    count: int,
    lost: float,
    frame_s: float,
    limits: Sequence[JointLimits],
) -> _Timed:
    """Return the route in cycles of `count` frames. Raises InputError if it is too long."""
    cycles = sum(1 if segment.cycles is None else segment.cycles for segment in segments)
    if not count * cycles <= MAX_FRAMES:
        raise InputError(
            "too-many-frames",
            f"the walk is more than {MAX_FRAMES} frames long",
            hint="walk fewer cycles, or faster ones",
        )
    # Phases, footholds and the overshoot depend on the number of frames: with another number all is planned
    # again.
    plan = replace(plan, gait=gait.on_frames(count))
    plan = replace(plan, beyond=plan.reach_beyond((*segments, *others), count, lost))
    parts, begins = plan.frames_of_route(segments, count)
    frames = join_frames(parts)
    loop_start = len(frames.angles) - count if segments[-1].cycles is None else 0
    angles = frames.angles.reshape(len(frames.angles), -1)
    # It stands before its first frame. Three more frames show the speed, acceleration and jerk across the end
    # of the loop, which a walk that is not endless begins and ends standing.
    around = np.concatenate((angles[:1], angles, angles[loop_start : loop_start + 3]))
    tight = tightest(around, frame_s, limits)
    return _Timed(count, plan, begins, frames, angles, loop_start, tight)


def _shortest(gait: Gait, timed: Callable[[int], _Timed], minimum: int) -> _Timed:
    """Return the walk in the fewest frames of a cycle that keep the limits; if they require more than a
    minute, the last one that was tried.
    """
    grain, failed = _whole(gait, 1), 0
    made = timed(_whole(gait, minimum))
    while made.tight.factor > 1:
        failed = made.count
        # A slower walk may need less than the factor says, so it is at most doubled each time.
        count = _whole(gait, max(failed + 1, math.ceil(failed * min(made.tight.factor, 2.0))))
        if count > MAX_FRAMES_PER_CYCLE:
            return made
        made = timed(count)
    while made.count - failed > grain and failed:
        middle = timed(_whole(gait, (failed + made.count) // 2))
        made, failed = (made, middle.count) if middle.tight.factor > 1 else (middle, failed)
    return made


def _whole(gait: Gait, frames: int) -> int:
    """Return a number of at least `frames`, a multiple of the gait's grain if that is small."""
    return -(-frames // gait.grain) * gait.grain if gait.grain <= MAX_GRAIN else frames


def _margins(over: complex, frames: Frames, loop_start: int) -> Floats:
    """Return the minimum stability margin during each frame, inf for one or two legs, which something else
    supports.

    The feet that stand at its beginning stand up to its end. As they move in a straight line under the body,
    the margin is smallest at one of the two: at the end, where a foot lands only then.
    """
    if frames.ground.shape[1] < 3:
        return np.full(len(frames.angles), math.inf)
    centre = np.array([over.real, over.imag])
    following = np.append(np.arange(1, len(frames.angles)), loop_start)
    stays = (frames.ground & frames.ground[following])[:, :, None]
    begin = (frames.feet + frames.corrections)[:, :, :2]
    lifted = (frames.feet[following] + frames.corrections)[:, :, :2]
    end = np.where(stays, begin[following], lifted)
    return np.array(
        [
            min(margin(feet[down], centre) for feet in both)
            for *both, down in zip(begin, end, frames.ground, strict=True)
        ]
    )


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


def _refuse_lean(walk: Walk, segments: Sequence[Segment]) -> None:
    """Raise InputError where legs of two joints cannot follow a body that leans, so that it would lose its
    way.
    """
    far = float(np.abs(walk.feet[0, :, 0] + 1j * walk.feet[0, :, 1]).max())
    steps = [abs(complex(each.forward, each.left)) + abs(each.turn) * far for each in segments]
    step = min((each for each in steps if each), default=0.0)
    worst = walk.largest_correction_m
    if step and worst > MAX_LEAN_SLIP * step:
        raise InputError(
            "servo-limit",
            f"legs of two joints cannot follow the body while it leans: a foot would slip by "
            f"{1000 * worst:.1f} mm in steps of {1000 * step:.0f} mm",
            hint="a smaller margin_mm (0: no leaning), feet farther apart along the body, longer steps, or "
            "legs of three joints; spring_mm, if the legs yield",
        )


def _refuse_meeting(robot: WalkingRobot, walk: Walk, gap: float) -> None:
    """Raise InputError where two legs, or a leg and the body, come nearer to each other than `gap`."""
    meeting = nearest_collision(robot, walk.leg_angles, gap)
    if meeting is not None:
        raise InputError(
            "legs-collide",
            f"{meeting.text()}, less than the gap of {1000 * gap:g} mm",
            hint="shorten the stride or the turn, mount the legs farther apart or let them point apart "
            "(heading_deg); if yours are thinner, state the gap (gap_mm, --gap-mm)",
        )


def _refuse(walk: Walk, spring_m: float | None, allow_falling: bool) -> None:
    """Raise InputError for too large a correction and, unless allowed, for a fall."""
    worst = walk.largest_correction_m
    if spring_m is not None and worst > spring_m:
        raise InputError(
            "servo-limit",
            f"the springs would have to yield {1000 * worst:.2f} mm, "
            f"but yield {1000 * spring_m:g} mm at most",
            hint="shorten the stride or the turn: two joints follow a straight line only roughly",
        )
    if walk.minimum_margin_m < 0 and not allow_falling:
        frame = int(np.argmin(walk.margins))
        feet = ", ".join(leg for leg, down in zip(walk.legs, walk.ground[frame], strict=True) if down)
        outside = f"its centre of mass is {-1000 * walk.minimum_margin_m:z.1f} mm outside the feet {feet}"
        raise InputError(
            "falls-over",
            f"the robot falls over in frame {frame}: {outside if feet else 'no foot is on the ground'}",
            hint="use a gait with more feet on the ground or a shorter stride, or allow falling "
            "(allow_falling = true in a job, --allow-falling)",
        )
