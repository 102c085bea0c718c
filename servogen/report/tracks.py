"""From pulses back: where a job's feet, tool or base are, as planned and with pulses of whole cycles.

In: a planned job and its `PulseSchedule`. Out: one `Track` for each end: its points frame by frame as
planned, as made (by forward kinematics), and the difference to first order (by the Jacobian). Of each track
an `EndError`: the largest and the rms error, and in which frame it is largest.

    angle asked ──▶ forward kinematics ──────────────────────────▶ planned
      │ whole cycles
    angle made ───▶ forward kinematics ──────────────────────────▶ made
    made - asked ─▶ J ───────────────────────────────────────────▶ shift, made - planned to first order
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from servogen.job import PlannedJob
from servogen.job.ends import End
from servogen.job.schema import WalkTable
from servogen.job.walks import read_posture
from servogen.kinematics.protocol import DrivingRobot, Posture
from servogen.kinematics.stance import level_centre, tilt
from servogen.motion.drive import positions
from servogen.motion.trajectory import Floats
from servogen.pulse import PulseSchedule
from servogen.robot.servo import Servo

if TYPE_CHECKING:
    from servogen.answers import EndErrorAnswer

ERROR_COLUMNS = ("end", "worst_mm", "rms_mm", "frame", "time_s", "jacobian_worst_mm", "jacobian_rms_mm")

SAME_DIGITS = 9
"""Decimals of metres; errors within a nanometre are equal, so that all machines name the same frame."""

Kind = Literal["foot", "tool", "base"]


def standing_feet(job: PlannedJob, angles: Floats) -> tuple[Floats, tuple[float, float]]:
    """Return the feet (n, legs, 3) in the body's level frame, and the centre of mass over the ground."""
    posture = read_posture(job.section) if isinstance(job.section, WalkTable) else Posture()
    feet = np.stack([end.points(angles) for end in job.ends], axis=1)
    centre = getattr(job.robot, "centre_of_mass", (0.0, 0.0, 0.0))
    return np.asarray(feet @ tilt(posture).T), level_centre(posture, centre)


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """`planned`, `made` and `shift`, (frames, 3) each, metres; NaN where a servo has no pulse.

    Of the base (`kind` "base") the points are x, y and 0, from where it begins.
    """

    name: str
    kind: Kind
    planned: Floats
    made: Floats
    shift: Floats

    @property
    def error(self) -> Floats:
        """Return the distance (frames,) from the planned points, by forward kinematics."""
        return np.asarray(np.linalg.norm(self.made - self.planned, axis=1))

    @property
    def first_order(self) -> Floats:
        """Return the same distance by the Jacobian."""
        return np.asarray(np.linalg.norm(self.shift, axis=1))


def end_tracks(job: PlannedJob, schedule: PulseSchedule) -> tuple[Track, ...]:
    """Return the tracks of all ends of the job; a driving robot has one, its base's."""
    asked = job.trajectory.angles
    ends = job.ends
    if not ends and not job.wheels:
        return ()
    achieved = made_angles(schedule, job.servos)
    if job.base is not None:
        wheels = job.wheel_columns
        frame_s = float(schedule.clock.seconds(schedule.period))
        return (_base(job.base, asked[:, wheels], achieved[:, wheels], frame_s),)
    return tuple(_track(end, asked, achieved) for end in ends)


def made_angles(schedule: PulseSchedule, servos: Sequence[Servo]) -> Floats:
    """Return the angles (frames, servos) of the schedule's whole cycles; NaN without a pulse."""
    runs = (*schedule.lead_in, *schedule.loop)
    rows = [[pulse.width if pulse else 0 for pulse in run.pulses] for run in runs]
    cycles = np.repeat(np.array(rows, np.int64), [run.frames for run in runs], axis=0)
    angles = np.empty(cycles.shape)
    for index, servo in enumerate(servos):
        widths, back = np.unique(cycles[:, index], return_inverse=True)
        of_width = [
            servo.angle(float(schedule.clock.us(width))) if width else np.nan for width in widths.tolist()
        ]
        angles[:, index] = np.array(of_width)[back]
    return angles


def _track(end: End, asked: Floats, achieved: Floats) -> Track:
    """Return the track of a foot or tool, calculating each distinct pose once: a job may rest for hours."""
    mine = list(end.columns)
    pulsed = ~np.isnan(asked[:, mine]).any(axis=1)
    _, first, back = np.unique(asked[pulsed][:, mine], axis=0, return_index=True, return_inverse=True)
    before, after = asked[pulsed][first], achieved[pulsed][first]
    paths = [np.full((len(asked), 3), np.nan) for _ in range(3)]
    points = end.points(before), end.points(after), end.shift(before, after - before)
    for whole, part in zip(paths, points, strict=True):
        whole[pulsed] = part[back.reshape(-1)]
    return Track(end.name, end.kind, *paths)


def _base(base: DrivingRobot, asked: Floats, achieved: Floats, period_s: float) -> Track:
    """Return the base after each frame; a wheel without a pulse stands. Its shift assumes heading 0."""
    asked, achieved = np.nan_to_num(asked), np.nan_to_num(achieved)
    planned, driven = (positions(base, speeds, period_s)[1:] for speeds in (asked, achieved))
    vx, vy, _ = np.moveaxis(base.body_speed(asked), -1, 0) * period_s
    dx, dy, turn = np.moveaxis(base.body_speed(achieved - asked), -1, 0) * period_s
    heading = np.cumsum(turn) - turn / 2
    moved = np.cumsum(np.stack([dx - heading * vy, dy + heading * vx], axis=1), axis=0)
    flat = [np.column_stack([part[:, :2], np.zeros(len(part))]) for part in (planned, driven, moved)]
    return Track("base", "base", *flat)


@dataclass(frozen=True, slots=True)
class EndError:
    """The error of a foot, tool or base in metres, where it is largest, and the same by the Jacobian."""

    name: str
    kind: Kind
    worst_m: float
    rms_m: float
    frame: int
    first_order_worst_m: float
    first_order_rms_m: float

    def to_json(self) -> EndErrorAnswer:
        """Return the error without the name of the end."""
        return {
            "worst_m": self.worst_m,
            "rms_m": self.rms_m,
            "frame": self.frame,
            "jacobian_worst_m": self.first_order_worst_m,
            "jacobian_rms_m": self.first_order_rms_m,
        }


def end_errors(tracks: Sequence[Track]) -> tuple[EndError, ...]:
    """Return the errors in the order of the tracks, without tracks that have no pulse."""
    return tuple(_error(track) for track in tracks if not np.isnan(track.error).all())


def largest_error(errors: Sequence[EndError]) -> EndError:
    """Return the end with the largest error."""
    return max(errors, key=lambda error: round(error.worst_m, SAME_DIGITS))


def _error(track: Track) -> EndError:
    direct, slope = track.error, track.first_order
    return EndError(
        name=track.name,
        kind=track.kind,
        worst_m=float(np.nanmax(direct)),
        rms_m=_rms(direct),
        frame=int(np.nanargmax(np.round(direct, SAME_DIGITS))),
        first_order_worst_m=float(np.nanmax(slope)),
        first_order_rms_m=_rms(slope),
    )


def _rms(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def error_rows(errors: Sequence[EndError], frame_s: float) -> Iterator[tuple[str, ...]]:
    """Yield the cells of `ERROR_COLUMNS` for each end."""
    for error in errors:
        yield (
            error.name,
            f"{1000 * error.worst_m:z.4f}",
            f"{1000 * error.rms_m:z.4f}",
            str(error.frame),
            f"{error.frame * frame_s:.6g}",
            f"{1000 * error.first_order_worst_m:z.4f}",
            f"{1000 * error.first_order_rms_m:z.4f}",
        )
