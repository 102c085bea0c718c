"""The horns of a job's servos: which part of its travel each one's motion uses, and the zero that centres it.

In: a job, also one that is refused because a servo cannot go where its joint should. Out: `Horn`s; the job
and its file with other zeros. A horn goes on another tooth of its spline, in steps of 360° / teeth, which
moves the servo's angles and the limits of the mechanics by the same angle.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from servogen.errors import InputError, ServogenError
from servogen.job import Job, PlannedJob, plan_job
from servogen.job.reader import changed
from servogen.toml.edit import set_in_table
from servogen.toml.locations import Key

if TYPE_CHECKING:
    from servogen.answers import HornAnswer

USUAL_TEETH = 25
"""The teeth of a spline whose servo's file states none: those of most servos of the standard size."""
MIDDLE_US, SPAN_US = 5000.0, 4800.0
"""The widths of a servo that may turn as far as a file can say: it is planned, but never gets a pulse."""
ROUNDING = 1e-6
"""What zeros in degrees with four digits are exact to, in radians."""


@dataclass(frozen=True, slots=True)
class Horn:
    """Angles in radians, of the mounted servo: `used` by the motion, `whole`, what travel and calibration
    allow, and `zero`, where the joint is at 0. `key` is the zero's in the file, `table` that of its servo.
    A servo that poses command by its own angle is `fixed`: its horn would move what they mean. `teeth` are
    those of its spline.
    """

    servo: str
    used: tuple[float, float]
    whole: tuple[float, float]
    zero: float
    key: Key
    table: Key
    teeth: int = USUAL_TEETH
    fixed: bool = False

    @property
    def away(self) -> float:
        """Return by how much the horn has to turn for the motion to be in the middle of the travel."""
        return (sum(self.whole) - sum(self.used)) / 2

    @property
    def steps(self) -> int:
        """Return on which tooth the motion is nearest to the middle, counted from where the horn is."""
        return 0 if self.fixed else round(self.away * self.teeth / math.tau)

    @property
    def turn(self) -> float:
        """Return by how much the horn turns to get there."""
        return self.steps * math.tau / self.teeth

    @property
    def between(self) -> bool:
        """Return whether a horn between two teeth would do, but none on a tooth."""
        return not self.fixed and 0 <= self.spare < abs(self.away - self.turn) - ROUNDING

    @property
    def spare(self) -> float:
        """Return how far the motion stays from the ends of the travel once it is centred; negative: it is too
        long.
        """
        return (self.whole[1] - self.whole[0] - self.used[1] + self.used[0]) / 2

    def to_json(self) -> HornAnswer:
        return {
            "servo": self.servo,
            "used_deg": [math.degrees(end) for end in self.used],
            "whole_deg": [math.degrees(end) for end in self.whole],
            "zero_deg": math.degrees(self.zero),
            "spline_teeth": self.teeth,
            "centred_zero_deg": math.degrees(self.zero + self.turn),
            "off_centre_deg": math.degrees(self.away - self.turn),
        }


def job_horns(planned: PlannedJob, job: Job | None = None) -> tuple[Horn, ...]:
    """Return the horns of the servos that turn joints; the servos' travels are those of `job`."""
    servos = {servo.name: servo for servo in (job or planned).servos}
    columns = [servo.name for servo in planned.servos]
    poses = planned.document.data.get("motion", {}).get("poses", ())
    stated = {key for pose in poses for key in pose}
    commanded = {name for name in columns if not stated.isdisjoint((f"{name}_deg", f"{name}_us"))}
    angles = np.concatenate([planned.trajectory.angles, *(way.angles for way in planned.directions)])
    found = []
    for binding in planned.bindings:
        servo, column = servos[binding.servo], angles[:, columns.index(binding.servo)]
        if servo.model.continuous or np.isnan(column).all():
            continue
        used = float(np.nanmin(column)), float(np.nanmax(column))
        table: Key = ("servo", columns.index(servo.name))
        leg = "leg" in planned.document.data
        key: Key = ("leg", f"{binding.joint}_zero_deg") if leg else (*table, "zero_deg")
        fixed = servo.name in commanded
        teeth = servo.model.spline_teeth or USUAL_TEETH
        found.append(Horn(servo.name, used, servo.whole, binding.zero, key, table, teeth, fixed))
    return tuple(found)


def centre_horns(job: Job) -> tuple[tuple[Horn, ...], PlannedJob]:
    """Return the horns of a job, and the job planned with each of them on the tooth that centres it best.

    A job whose servos cannot go far enough is first planned as if they could. Raises the job's own error if
    something else is wrong with it, or if centred horns do not help.
    """
    try:
        horns = job_horns(plan_job(job))
    except ServogenError as error:
        try:
            horns = job_horns(plan_job(changed(job, dict(_widest_limits(job)))), job)
        except ServogenError:
            raise error from None
        if between := [horn for horn in horns if horn.between]:
            raise InputError(
                error.first.code, error.first.message, error.first.location, _beside(between)
            ) from None
        try:
            return horns, plan_job(changed(job, edits(job, horns)))
        except ServogenError:
            raise error from None
    return horns, plan_job(changed(job, edits(job, horns)))


def edits(job: Job, horns: tuple[Horn, ...]) -> dict[Key, float]:
    """Return the values of the job's file with which the horns are centred, in degrees."""
    found: dict[Key, float] = {}
    for horn in horns:
        if not horn.turn:
            continue
        found[horn.key] = round(math.degrees(horn.zero + horn.turn), 4)
        row = job.document.data["servo"][horn.table[1]]
        low, high = (math.degrees(end) for end in horn.whole)
        for key in ("min_deg", "max_deg"):  # the mechanics turn with the horn
            if row.get(key) is not None:
                found[*horn.table, key] = round(min(max(row[key] + math.degrees(horn.turn), low), high), 4)
    return found


def rewritten(text: str, values: Mapping[Key, float]) -> str:
    """Return a job's text with other values, its comments and its layout kept."""
    for (*table, name), value in values.items():
        text = set_in_table(text, tuple(table), str(name), f"{value:.10g}")
    return text


def with_horn_advice(error: ServogenError, horns: tuple[Horn, ...]) -> ServogenError:
    """Return the error of a job that its horns alone make impossible, with what to change."""

    def zeros(horn: Horn) -> str:
        return f"{math.degrees(horn.zero + horn.turn):.4g} (now {math.degrees(horn.zero):.4g})"

    turned = [f"{horn.servo} zero_deg = {zeros(horn)}" for horn in horns if horn.turn]
    hint = f"put the horns on other teeth: {', '.join(turned)}; `servogen plan --fit` writes it into the job"
    return InputError(error.first.code, error.first.message, error.first.location, hint)


def _beside(horns: list[Horn]) -> str:
    """Return what to do about horns that would have to sit between two teeth."""

    def needs(horn: Horn) -> str:
        low, high = (math.degrees(horn.zero + horn.away + side * horn.spare) for side in (-1, 1))
        tooth = math.degrees(horn.zero + horn.turn)
        nearest = f"its nearest tooth of {horn.teeth} is at {tooth:.4g}"
        return f"{horn.servo} needs zero_deg {low:.4g} to {high:.4g}, {nearest}"

    said = "; ".join(needs(horn) for horn in horns)
    return f"{said}: turn its bracket, or measure zero_deg once the horn is on"


def _widest_limits(job: Job) -> Iterator[tuple[Key, object]]:
    """Yield edits with which servos that turn joints go as far as a file can say, about the same middle."""
    turning = {binding.servo for binding in job.bindings}
    for index, servo in enumerate(job.servos):
        if servo.name not in turning or servo.model.continuous:
            continue
        table: Key = ("servo", index)
        middle, half = (
            math.degrees(sum(servo.model.travel) / 2),
            math.degrees(SPAN_US * servo.calibration.per_us),
        )
        first, last = servo.calibration.points[0], servo.calibration.points[-1]
        rising = SPAN_US if last.width_us > first.width_us else -SPAN_US
        yield (*table, "travel_deg"), (middle - half, middle + half)
        ends = ((middle - half, MIDDLE_US - rising), (middle + half, MIDDLE_US + rising))
        yield (*table, "points"), tuple({"angle_deg": angle, "width_us": width} for angle, width in ends)
        for key in ("min_deg", "max_deg", "calibration"):
            yield (*table, key), None
