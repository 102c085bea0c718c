"""`JointTrajectory` -> what the player plays: poses, a script, and the resulting schedule.

In: a trajectory whose joints are the servos, the servos that belong to legs, and the frame. Out: `Playing`.
Its schedule is what the chip does, cycle by cycle; its plan states the distance from the trajectory.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from servogen.engines.firmware import ResourceError
from servogen.engines.inputs.wire import FrameWire
from servogen.engines.player.arithmetic import Whole
from servogen.engines.player.balance import balance
from servogen.engines.player.encoding import Encoded, scale_of
from servogen.engines.player.knees import Knees, knees_of
from servogen.engines.player.layout import SlotLayout, Used, layout
from servogen.engines.player.legs import legs_encoder
from servogen.engines.player.poses import poses_encoded
from servogen.engines.player.script import DirectionPlaces
from servogen.errors import Diagnostic, InputError
from servogen.motion.trajectory import Floats, JointTrajectory
from servogen.plan_error import PlanError
from servogen.pulse.lint import check_calibration, check_motion, check_period
from servogen.pulse.plan import PulsePlan, schedule_of
from servogen.pulse.quantise import NO_PULSE, PARTS, Quantised, channel_error, largest
from servogen.pulse.slots import Frame
from servogen.robot.binding import Binding
from servogen.robot.servo import Servo
from servogen.units import Clock, Cycles

FAR = (0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.8)
"""Shares of the error limit by which a step's law may deviate from the motion, the smallest first."""

NEAR = (0.3, 0.5, 0.7, 0.9, 1.1, 1.4, 1.7, 2.2)
"""Steps by which poses may differ from the row that they share, the smallest first."""

USUAL = tuple(zip(FAR, NEAR, strict=True))
MORE = (
    (0.65, 1.8),
    (0.7, 1.9),
    (0.75, 2.0),
    (0.9, 1.0),
    (1.0, 1.4),
    (1.0, 2.2),
    (1.2, 1.4),
    (1.3, 2.2),
    (1.6, 2.2),
)
"""Also tried where poses lie in two tables, for which flash has just room. A law that may deviate by more
than the limit often deviates by less.
"""

BALANCED = tuple((far, near) for far in (0.8, 1.0, 1.2, 1.4, 1.6) for near in (0.1, 0.3, 0.5, 0.9))
"""The same of rows that are balanced, which takes off up to half; both are shares of the error limit."""

DATA_BYTES, BUTTONS_BYTES, COMMANDS_BYTES, KNEES_BYTES = 328, 50, 60, 50
"""The size of tables, in bytes, that fits beside the program; what buttons, commands for a walk, and knees
of calibrations subtract from it.

Larger motions are encoded more coarsely; whether they fit the chip is known once the program is compiled.
"""


@dataclass(frozen=True, slots=True)
class Playing:
    """A motion as the player plays it: `trajectory` has the frames of the plan's schedule."""

    trajectory: JointTrajectory
    plan: PulsePlan
    layout: SlotLayout
    encoded: Encoded
    chain: DirectionPlaces | None = None
    """The directions of a walk on command; the trajectory is then the lead-in, the stance, and one direction
    after the other.
    """

    @property
    def order(self) -> tuple[int, ...]:
        """Return the channels in the order of the C: slot by slot, or turn and lift of one leg after the
        other.
        """
        legs = self.encoded.legs
        if legs is None:
            return self.layout.order
        return tuple(channel for pair in zip(legs.turns, legs.lifts, strict=True) for channel in pair)


def playing(
    trajectory: JointTrajectory,
    servos: Sequence[Servo],
    frame: Frame,
    *,
    bindings: Sequence[Binding] = (),
    soft: Sequence[int] = (),
    max_error_us: float = 10.0,
    max_bytes: int = DATA_BYTES,
    bends: bool = True,
    halves: bool = False,
    balanced: bool = False,
    wire: FrameWire | None = None,
) -> Playing:
    """Return how the player plays `trajectory`; `servos` are its joints, in its order.

    `bindings` tell which servos belong to legs; `soft` are the frames at which the parts of the soft start
    end. The distance from the plan is as small as tables of `max_bytes` allow; it may exceed `max_error_us`,
    which the caller checks. A walk that exceeds it is encoded more closely, if `bends` allows it with the
    knees of bent calibrations. Poses may lie in two tables of `halves` of rows; `balanced` are those with the
    fewest bytes within `max_error_us`. The program may follow the `wire` of another chip. Raises InputError.
    """
    clock = trajectory.clock
    rows = ideal_widths(trajectory, servos, clock)
    if np.isnan(rows).all():
        raise InputError("no-pulses", "the motion has no pulse")
    pairs = leg_channels(servos, bindings)
    loop_start = trajectory.loop_start
    if balanced:
        encoded = _balanced_motion(rows, loop_start, soft, max_error_us / float(clock.cycle_us))
    else:
        encoded = encoded_motion(rows, loop_start, soft, pairs, max_error_us, clock, max_bytes, halves=halves)
    played = _played(trajectory, servos, frame, rows, encoded, wire=wire)
    for turns in ((), [turn for turn, _ in pairs] if bends else ()):
        if not encoded.legs or played.plan.schedule.plan_error_us <= max_error_us:
            break
        knees = knees_of(servos, turns, rows, clock)
        room = max_bytes - (KNEES_BYTES if knees.bends.any() else 0)
        try:
            closer = encoded_motion(rows, loop_start, soft, pairs, max_error_us, clock, room, knees=knees)
            other = _played(trajectory, servos, frame, rows, closer, wire=wire)
        except InputError:  # no time, or no room, for knees
            break
        played = min(played, other, key=lambda each: each.plan.schedule.plan_error_us)
    warnings = warnings_of(played.trajectory, servos, frame, played.layout)
    return replace(played, plan=replace(played.plan, warnings=warnings))


def _played(
    trajectory: JointTrajectory,
    servos: Sequence[Servo],
    frame: Frame,
    rows: Floats,
    encoded: Encoded,
    *,
    wire: FrameWire | None,
) -> Playing:
    """Return the trajectory, whose widths are `rows` in cycles, as the chip plays it. Raises InputError."""
    clock = trajectory.clock
    # A walk's loop begins at an event of its gait, possibly some frames later than the trajectory's.
    loop = len(rows) - trajectory.loop_start
    order = np.arange(len(encoded.frames))
    order = np.where(order < len(rows), order, order - loop)
    motion = replace(trajectory, angles=trajectory.angles[order], loop_start=encoded.lead)
    ideal = rows[order]
    pulsed = encoded.widths[~encoded.silent]
    used = [Used(Cycles(int(channel.min())), Cycles(int(channel.max()))) for channel in pulsed.T]
    legs = encoded.legs is not None
    slots = layout(servos, used, frame, clock, encoded.scale.doublings, legs=legs, wire=wire)
    rises = [slots.rise(channel) for channel in range(len(servos))]
    pulses = np.where(encoded.silent[:, None], NO_PULSE, encoded.widths)
    error = plan_error_of(motion, servos, encoded.widths, ideal, clock)
    schedule = schedule_of(motion, servos, slots.period, pulses, rises, error)
    plan = PulsePlan(schedule, tuple(rows_of(servos, encoded.widths, ideal, clock)), ())
    return Playing(motion, plan, slots, encoded)


def leg_channels(servos: Sequence[Servo], bindings: Sequence[Binding]) -> list[tuple[int, int]]:
    """Return the channels that turn and lift each leg, in the order of the legs."""
    names = [servo.name for servo in servos]
    joints = {binding.joint: names.index(binding.servo) for binding in bindings}
    return [
        (joints[joint], joints[lift])
        for joint in joints
        for turns, lifts in LEG_JOINTS
        if joint.endswith(turns)
        for lift in [joint.removesuffix(turns) + lifts]
        if lift in joints
    ]


LEG_JOINTS = (("_alpha", "_beta"), ("_hip", "_lift"))
"""The joints that turn and that lift a leg of two, behind the leg's name."""


def encoded_motion(
    rows: Floats,
    loop_start: int,
    soft: Sequence[int],
    pairs: Sequence[tuple[int, int]],
    max_error_us: float,
    clock: Clock,
    max_bytes: int,
    *,
    knees: Knees | None = None,
    limited: bool = True,
    halves: bool = False,
) -> Encoded:
    """Return the first encoding that has at most `max_bytes`, or the smallest one, trying that of a walk by
    its legs first.

    With the `knees` of bent calibrations only by its legs. Raises ResourceError if the tables are `limited`
    and cannot hold it.
    """
    by_legs = legs_encoder(rows, loop_start, soft, pairs, knees=knees, limited=limited) if pairs else None
    if by_legs is None and knees is not None:
        raise ResourceError("does-not-fit", "the motion is no walk whose servos can have knees")
    limit = max_error_us / float(clock.cycle_us)
    marks = (*soft, loop_start)
    refused: ResourceError | None = None
    smallest: Encoded | None = None
    # From the closest encoding to the coarsest: the first that fits is the best.
    for far, near in sorted((*USUAL, *MORE)) if halves else USUAL:
        try:
            encoded = (
                by_legs(near)
                if by_legs
                else poses_encoded(rows, marks, loop_start, far * limit, near, limited=limited, halves=halves)
            )
        except ResourceError as error:
            refused = error
            continue
        if encoded.size <= max_bytes:
            return encoded
        if smallest is None or encoded.size < smallest.size:
            smallest = encoded
    if smallest is None:
        assert refused is not None
        raise refused
    return smallest


def _balanced_motion(rows: Floats, loop_start: int, soft: Sequence[int], limit: float) -> Encoded:
    """Return the smallest encoding with balanced rows in two tables that is within `limit` cycles of the
    motion. Raises ResourceError if there is none.
    """
    step = 1 << int(scale_of(rows[~np.isnan(rows).any(axis=1)]).shifts.max())
    found, refused = [], None
    for far, near in BALANCED:
        try:
            found.append(
                poses_encoded(
                    rows, (*soft, loop_start), loop_start, far * limit, near * limit / step, halves=True
                )
            )
        except ResourceError as error:
            refused = error
    for encoded in sorted(found, key=lambda each: each.size):
        closer = balance(encoded, rows)
        if np.abs(closer.widths - rows)[~closer.silent].max() <= limit:
            return closer
    raise refused or ResourceError("does-not-fit", "no poses are close enough to the motion")


def ideal_widths(trajectory: JointTrajectory, servos: Sequence[Servo], clock: Clock) -> Floats:
    """Return the planned widths in cycles, (frames, servos); NaN without a pulse."""
    angles = trajectory.angles
    silent = np.isnan(angles)
    if (silent.any(axis=1) & ~silent.all(axis=1)).any():
        number = int(np.argmax(silent.any(axis=1) & ~silent.all(axis=1)))
        raise InputError(
            "engine-unsupported",
            f"in frame {number} some servos have pulses and some have none",
            hint='the player rests all servos together: engine = "sequence", or the same pauses for all',
        )
    rows = np.full(angles.shape, np.nan)
    for index, servo in enumerate(servos):
        distinct, back = np.unique(angles[:, index], return_inverse=True)
        us = [np.nan if np.isnan(angle) else servo.width_us(angle) for angle in distinct.tolist()]
        rows[:, index] = np.array(us)[back] / float(clock.cycle_us)
    return rows


def plan_error_of(
    trajectory: JointTrajectory, servos: Sequence[Servo], achieved: Whole, ideal: Floats, clock: Clock
) -> PlanError:
    """Return the largest distance between the widths `achieved` and `ideal`, cycles of (frames, servos)."""
    cycle_us = float(clock.cycle_us)
    errors = []
    for index, servo in enumerate(servos):
        pulsed = ~np.isnan(ideal[:, index])
        widths = [cycle_us * cycles[pulsed, index] for cycles in (ideal, achieved)]
        errors.append(channel_error(servo, trajectory.angles[pulsed, index], *widths))
    return largest(errors)


def rows_of(servos: Sequence[Servo], achieved: Whole, ideal: Floats, clock: Clock) -> Iterator[Quantised]:
    """Yield for each servo the first pulse, the shortest, the longest, and the one farthest from the plan.

    `achieved` and `ideal` are cycles, (frames, servos); NaN in `ideal` is a frame without pulses.
    """
    for index, servo in enumerate(servos):
        pulsed = np.flatnonzero(~np.isnan(ideal[:, index]))
        widths, planned = achieved[pulsed, index], ideal[pulsed, index]
        frames = {
            "first": 0,
            "shortest": int(np.argmin(widths)),
            "longest": int(np.argmax(widths)),
            "worst": int(np.argmax(np.abs(widths - planned))),
        }
        for which, frame in frames.items():
            asked = Fraction(round(planned[frame] * float(clock.cycle_us) * PARTS), PARTS)
            cycles = Cycles(int(widths[frame]))
            often = int((widths == cycles).sum())
            angle = servo.angle(float(asked))
            yield Quantised(servo.name, angle, asked, cycles, clock.us(cycles), often, which)


def warnings_of(
    trajectory: JointTrajectory, servos: Sequence[Servo], frame: Frame, slots: SlotLayout
) -> tuple[Diagnostic, ...]:
    """Return the warnings about the period, the servos' calibrations and their speeds."""
    clock = trajectory.clock
    warnings = [*check_period(frame.period, frame.place)]
    if slots.period != frame.period.cycles:
        warnings.append(
            Diagnostic(
                "warning",
                "period-rounded",
                f"the player's period is {slots.period} cycles, a multiple of {slots.tick}: "
                f"{float(clock.us(slots.period)):g} µs, {slots.period - frame.period.cycles:+d} cycles",
                frame.place,
            )
        )
    for index, servo in enumerate(servos):
        warnings += check_calibration(servo)
        warnings += check_motion(
            servo, trajectory.angles[:, index], trajectory.loop_start, float(clock.seconds(slots.period))
        )
    return tuple(warnings)
