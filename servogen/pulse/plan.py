"""`JointTrajectory` -> `PulseSchedule`, with the rounding report and the warnings.

In: a trajectory whose joints are the servos, by name, and the frame. Out: `PulsePlan`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from servogen.errors import Diagnostic
from servogen.motion.trajectory import JointTrajectory
from servogen.plan_error import PlanError
from servogen.pulse.lint import check_calibration, check_motion, check_period
from servogen.pulse.quantise import NO_PULSE, Quantised, error_of_rows, largest, quantise
from servogen.pulse.schedule import Channel, Pulse, PulseSchedule, Run
from servogen.pulse.slots import Frame, rises
from servogen.robot.servo import Servo
from servogen.units import Cycles


@dataclass(frozen=True, slots=True)
class PulsePlan:
    """The schedule, one row for each distinct width of each channel, and the warnings."""

    schedule: PulseSchedule
    widths: tuple[Quantised, ...]
    warnings: tuple[Diagnostic, ...]


def plan(trajectory: JointTrajectory, servos: Sequence[Servo], frame: Frame) -> PulsePlan:
    """Return the pulses of `trajectory`, whose joints are `servos`, in its order. Raises InputError."""
    clock = trajectory.clock
    starts = rises(servos, frame, clock)
    columns = []
    rows: list[Quantised] = []
    errors: list[PlanError] = []
    warnings = [*check_period(frame.period, frame.place)]
    for index, servo in enumerate(servos):
        angles = trajectory.angles[:, index]
        cycles, widths = quantise(servo, angles, clock)
        columns.append(cycles)
        rows += widths
        errors.append(error_of_rows(servo, widths))
        warnings += check_calibration(servo)
        warnings += check_motion(
            servo, angles, trajectory.loop_start, float(clock.seconds(trajectory.period))
        )
    schedule = schedule_of(
        trajectory, servos, trajectory.period, np.stack(columns, axis=1), starts, largest(errors)
    )
    return PulsePlan(schedule, tuple(rows), tuple(warnings))


def schedule_of(
    trajectory: JointTrajectory,
    servos: Sequence[Servo],
    period: Cycles,
    cycles: npt.NDArray[np.int64],
    starts: Sequence[Cycles],
    error: PlanError,
) -> PulseSchedule:
    """Return the schedule of `trajectory` with frames of `period`, and the pulses as in `joined_runs`."""
    return PulseSchedule(
        clock=trajectory.clock,
        period=period,
        channels=tuple(Channel(servo.name, servo.pin, servo.model.name) for servo in servos),
        lead_in=joined_runs(cycles[: trajectory.loop_start], starts),
        loop=joined_runs(cycles[trajectory.loop_start :], starts),
        plan_error=error,
    )


def joined_runs(cycles: npt.NDArray[np.int64], starts: Sequence[Cycles]) -> tuple[Run, ...]:
    """Return the frames with equal successive ones joined to runs.

    `cycles` is (frames, channels): the width of each pulse, or `NO_PULSE`; `starts`: their rises in a frame.
    """
    if not len(cycles):
        return ()
    changes = np.flatnonzero((cycles[1:] != cycles[:-1]).any(axis=1)) + 1
    bounds = [0, *changes.tolist(), len(cycles)]
    return tuple(
        Run(
            end - first,
            tuple(
                Pulse(start, Cycles(width)) if width != NO_PULSE else None
                for start, width in zip(starts, cycles[first].tolist(), strict=True)
            ),
        )
        for first, end in pairwise(bounds)
    )
