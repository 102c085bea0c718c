"""What is to be said of a player's pulses: each servo's extremes and its worst frame, and what is doubtful.

In: the widths that the chip makes and those that were planned. Out: rows of the rounding report, warnings.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction

import numpy as np

from servogen.engines.player.interpolation import Whole
from servogen.engines.player.layout import Layout
from servogen.errors import Caution
from servogen.motion.trajectory import Floats, JointTrajectory
from servogen.pulse.lint import check_calibration, check_motion, check_period
from servogen.pulse.quantise import PARTS, Quantised
from servogen.pulse.slots import Frame
from servogen.robot.servo import Servo
from servogen.units import Clock, Cycles


def rows_of(servos: Sequence[Servo], made: Whole, ideal: Floats, clock: Clock) -> Iterator[Quantised]:
    """Of each servo the first pulse, the shortest, the longest, and the one furthest from what was planned.

    `made` and `ideal`: cycles, (frames, servos); NaN in `ideal` is a frame without pulses.
    """
    for index, servo in enumerate(servos):
        pulsed = np.flatnonzero(~np.isnan(ideal[:, index]))
        widths, planned = made[pulsed, index], ideal[pulsed, index]
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
) -> tuple[Caution, ...]:
    """Of the period, the servos' calibrations and how fast they are asked to turn."""
    clock = trajectory.clock
    found = [*check_period(frame.period, frame.place)]
    if slots.period != frame.period.cycles:
        found.append(
            Caution(
                "period-rounded",
                f"the player's period is {slots.period} cycles, a multiple of {slots.tick}: "
                f"{float(clock.us(slots.period)):g} µs, {slots.period - frame.period.cycles:+d} cycles",
                frame.place,
            )
        )
    for index, servo in enumerate(servos):
        found += check_calibration(servo)
        found += check_motion(
            servo, trajectory.angles[:, index], trajectory.loop_start, float(clock.seconds(slots.period))
        )
    return tuple(found)
