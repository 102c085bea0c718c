"""`JointTrajectory` -> the player's data: parts, keyframes, and the schedule that follows from them.

In: a trajectory whose joints are the servos, and the frame. Out: `Playing`. Its schedule is what the chip
does, cycle for cycle; its distance from the trajectory is in the rows of its plan.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from servogen.engines.player.fitting import Part, Whole, fitting, pooled, scale_of, sections
from servogen.engines.player.layout import Layout, Used, layout
from servogen.errors import Diagnostic, InputError
from servogen.motion.trajectory import Floats, JointTrajectory
from servogen.plan_error import PlanError
from servogen.pulse.lint import check_calibration, check_motion, check_period
from servogen.pulse.plan import PulsePlan
from servogen.pulse.plan_errors import channel_error, largest
from servogen.pulse.quantise import PARTS, Quantised
from servogen.pulse.schedule import Channel, Pulse, PulseSchedule, Run
from servogen.pulse.slots import Frame
from servogen.robot.servo import Servo
from servogen.units import Clock, Cycles


@dataclass(frozen=True, slots=True)
class Playing:
    """The player's data; `bases`, `signs` and a part's tracks are in order of the servos.

    A width is base + sign · (value between keyframes) · 2**shift.
    """

    plan: PulsePlan
    layout: Layout
    bases: tuple[int, ...]
    signs: tuple[int, ...]
    shift: int
    data: bytes
    parts: tuple[Part, ...]
    loop_part: int


def playing(
    trajectory: JointTrajectory,
    servos: Sequence[Servo],
    frame: Frame,
    soft_frames: int = 0,
) -> Playing:
    """Return the player's parts of `trajectory`, whose joints are `servos`, in its order. Raises InputError.

    Its first `soft_frames` frames are parts of their own.
    """
    clock = trajectory.clock
    rows = ideal_widths(trajectory, servos, clock)
    pulsed = rows[~np.isnan(rows).any(axis=1)]
    if not len(pulsed):
        raise InputError("no-pulses", "the motion has no pulse")
    start = trajectory.loop_start
    lead = [
        *sections(rows[:soft_frames], rows[soft_frames]),
        *sections(rows[soft_frames:start], rows[start]),
    ]
    loop = sections(rows[start:], rows[start])
    scale = scale_of(pulsed, [*lead, *loop])
    fitted = fitting((*lead, *loop), scale, clock, len(lead))
    pool, parts = pooled(fitted)
    every = np.concatenate([np.tile(each.widths, (each.stretch.repeats, 1)) for each in fitted])
    heard = np.concatenate(
        [np.full(each.stretch.frames * each.stretch.repeats, not each.stretch.silent) for each in fitted]
    )
    first_loop = sum(each.stretch.frames * each.stretch.repeats for each in fitted[: len(lead)])
    used = [Used(Cycles(int(each.min())), Cycles(int(each.max()))) for each in every[heard].T]
    slots = layout(servos, used, frame, clock, scale.shift)
    channels = tuple(Channel(servo.name, servo.pin, servo.model.name) for servo in servos)
    rises = [slots.rise(channel) for channel in range(len(servos))]
    schedule = PulseSchedule(
        clock,
        slots.period,
        channels,
        tuple(_runs(every[:first_loop], heard[:first_loop], rises)),
        tuple(_runs(every[first_loop:], heard[first_loop:], rises)),
        plan_error=_plan_error(trajectory, servos, every, rows, clock),
    )
    return Playing(
        PulsePlan(
            schedule,
            tuple(rows_of(servos, every, rows, clock)),
            warnings_of(trajectory, servos, frame, slots),
        ),
        slots,
        tuple(scale.bases().tolist()),
        tuple(scale.signs.tolist()),
        scale.shift,
        pool.data,
        parts,
        len(lead),
    )


def ideal_widths(trajectory: JointTrajectory, servos: Sequence[Servo], clock: Clock) -> Floats:
    """Return the planned widths in cycles, (frames, servos); NaN for no pulse."""
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


def _plan_error(
    trajectory: JointTrajectory, servos: Sequence[Servo], achieved: Whole, ideal: Floats, clock: Clock
) -> PlanError:
    """Return the largest distance between the widths `achieved` and `ideal`, cycles of each
    frame and servo.
    """
    cycle_us = float(clock.cycle_us)
    errors = []
    for index, servo in enumerate(servos):
        pulsed = ~np.isnan(ideal[:, index])
        widths = [cycle_us * each[pulsed, index] for each in (ideal, achieved)]
        errors.append(channel_error(servo, trajectory.angles[pulsed, index], *widths))
    return largest(errors)


def _runs(widths: Whole, heard: np.ndarray, rises: Sequence[Cycles]) -> Iterator[Run]:
    """Return the frames with equal successive ones joined to runs."""
    if not len(widths):
        return
    table = np.where(heard[:, None], widths, 0)
    changes = (np.flatnonzero((table[1:] != table[:-1]).any(axis=1)) + 1).tolist()
    for first, end in zip([0, *changes], [*changes, len(table)], strict=True):
        pulses = tuple(
            Pulse(rise, Cycles(width)) if width else None
            for rise, width in zip(rises, table[first].tolist(), strict=True)
        )
        yield Run(end - first, pulses)


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
    trajectory: JointTrajectory, servos: Sequence[Servo], frame: Frame, slots: Layout
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
