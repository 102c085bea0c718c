"""A recording of another program -> the poses and laws of a job, and how far the job's pulses are from it.

In: a `RecordedMotion`, the job whose servos make it. Out: the text of [motion] poses; `Deviation`s, one for
each servo and each foot or tool, from the recording to the schedule of the job's engine.

    recording  ●──●──●──●      in the file's units, at its own times
    frames     ·┆·┆·┆·┆·┆      angles of the servos, once in each period
    poses      ●━━━━━━━●━━●    the fewest bytes within half of max_error_us; the rest is the engine's
"""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from servogen.engines.firmware import ResourceError
from servogen.engines.inputs import given
from servogen.engines.inputs.tape import Tape
from servogen.engines.player.playing import DATA_BYTES, ideal_widths
from servogen.engines.player.poses import reduce_to_moves
from servogen.engines.player.script import MAX_BYTES
from servogen.errors import InputError, Location, ServogenError, did_you_mean
from servogen.job import Job, PlannedJob, plan_job
from servogen.job.reader import loads
from servogen.job.schema import SECTIONS
from servogen.motion import JointTrajectory
from servogen.motion.trajectory import Floats
from servogen.recordings import RecordedMotion
from servogen.report.tracks import made_angles
from servogen.robot.binding import Binding
from servogen.robot.servo import Servo
from servogen.robot.servo_models import servo_model
from servogen.toml.edit import set_in_table
from servogen.toml.file import parse
from servogen.units import counted
from servogen.workflows.engines import PlayedJob, planned

if TYPE_CHECKING:
    from servogen.answers import DeviationPlace, EndDeviation, ServoDeviation

LAWS = {"quintic": "quintic", "trapezoid": "trapezoid", "straight": "linear"}
"""The player's laws that a job may name, and their names there."""

MAX_FRAMES = 20_000
"""The longest recording in frames: its reduction takes minutes."""

FINER = 3
"""How often poses are reduced, each time within half the tolerance, until the pulses are close enough."""

SCRIPT_BYTES, SHARES = 2, (1.0, 0.75, 0.5, 0.25)
"""Bytes of a pose beside its angles; the shares of the poses that usually fit that are tried."""

TAPE_SHARE = 16
"""The part of a cycle within which the poses of a tape are."""

US_PER_UNIT = {"us": 1.0, "pca9685": 20_000 / 4096}
"""The µs in a unit of pulse widths; a PCA9685 counts 4096 steps in a frame of 50 Hz."""

PINS = (*(f"RB{bit}" for bit in range(8)), *(f"RA{bit}" for bit in range(4)))
"""The pins of a new job's servos."""


Named = tuple[Mapping[str, str], str | None]
"""The servos or joints of tracks of other names; the unit of tracks whose file states none."""


def in_servos(recording: RecordedMotion, job: Job, named: Named) -> RecordedMotion:
    """Return the recording as angles of all the job's servos in radians; one without a track stays neutral.

    Raises InputError.
    """
    names, unit = named
    tracks = _tracks_of_servos(recording, job, names)
    angles = np.tile([servo.neutral for servo in job.servos], (len(recording.times), 1))
    speeds, accelerations = (
        None if part is None else np.zeros_like(angles)
        for part in (recording.speeds, recording.accelerations)
    )
    for column, servo in enumerate(job.servos):
        if servo.name not in tracks:
            continue
        track, binding = tracks[servo.name]
        its_unit = recording.units[track] or unit
        if its_unit is None:
            raise _without_unit(recording)
        zero, scale = _affine(servo, binding, its_unit, recording.of_joints)
        values = recording.values[:, track]
        if its_unit in US_PER_UNIT:
            angles[:, column] = [servo.angle(width) for width in (values * US_PER_UNIT[its_unit]).tolist()]
        else:
            angles[:, column] = zero + scale * values
        for whole, part in ((speeds, recording.speeds), (accelerations, recording.accelerations)):
            if whole is not None and part is not None:
                whole[:, column] = scale * part[:, track]
        for at in (int(np.argmin(angles[:, column])), int(np.argmax(angles[:, column]))):
            servo.check(float(angles[at, column]), recording.places[at])
    return replace(
        recording,
        names=tuple(servo.name for servo in job.servos),
        units=("rad",) * len(job.servos),
        values=angles,
        speeds=speeds,
        accelerations=accelerations,
    )


def _tracks_of_servos(
    recording: RecordedMotion, job: Job, names: Mapping[str, str]
) -> dict[str, tuple[int, Binding | None]]:
    """Return by servo the index of its track, and the joint that it turns if the track is told by joints.

    `names` are those of servos or joints, by track. Raises InputError.
    """
    unknown = next((name for name in names if name not in recording.names), None)
    if unknown is not None:
        raise InputError(
            "unknown-name",
            f"{recording.file} has no track '{unknown}'",
            Location("--map"),
            did_you_mean(unknown, recording.names),
        )
    servos = {servo.name: servo for servo in job.servos}
    by_joint = {binding.joint: binding for binding in job.bindings}
    by_servo = {binding.servo: binding for binding in job.bindings}
    tracks: dict[str, tuple[int, Binding | None]] = {}
    for track, name in enumerate(recording.names):
        wanted = names.get(name, cleaned(name))
        binding = by_servo.get(wanted) if recording.of_joints else None
        if wanted in by_joint and (recording.of_joints or wanted not in servos):
            binding = by_joint[wanted]
            wanted = binding.servo
        servo = servos.get(wanted)
        if servo is None or servo.model.continuous or wanted in tracks:
            why = "no servo" if servo is None else "a wheel" if servo.model.continuous else "a second track"
            raise InputError(
                "unknown-servo",
                f"the track '{name}' is that of {why} of {job.name}: '{wanted}'",
                recording.places[0],
                f"--map '{name}'=SERVO, one of {', '.join(servos)}",
            )
        tracks[wanted] = track, binding
    return tracks


def _affine(servo: Servo, binding: Binding | None, unit: str, of_joints: bool) -> tuple[float, float]:
    """Return the servo's angle at 0 and its radians per unit of the track.

    A joint that the job's robot does not have is at 0 where its servo is neutral.
    """
    scale = math.radians(1) if unit == "deg" else 1.0
    if binding is not None:
        return binding.zero, binding.ratio * scale
    return (servo.neutral if of_joints else 0.0), scale


def _without_unit(recording: RecordedMotion) -> InputError:
    low, high = float(recording.values.min()), float(recording.values.max())
    likely = "deg" if high <= 180 else "pca9685" if high <= 700 else "us"
    return InputError(
        "missing-option",
        f"{recording.file} does not state the unit of its values, {low:g} to {high:g}",
        Location("--unit"),
        f"--unit deg, rad, us or pca9685 (4096ths of 20 ms); probably --unit {likely}",
    )


def cleaned(name: str) -> str:
    """Return the name of a track as the name of a servo."""
    kept = re.sub(r"[^A-Za-z0-9_-]+", "_", name).strip("_")
    return kept if kept[:1].isalpha() else f"servo{kept}"


def poses_text(motion: RecordedMotion, job: Job, tolerance_us: float) -> list[str]:
    """Return the poses of a recording of the job's servos as elements of TOML, within the tolerance."""
    angles = frame_angles(motion, job)
    trajectory = JointTrajectory(
        joints=motion.names, clock=job.clock, period=job.frame.period.cycles, angles=angles, loop_start=0
    )
    rows, far = ideal_widths(trajectory, job.servos, job.clock), tolerance_us / float(job.clock.cycle_us)
    moves = [_Move(0, 0, "linear", hold=1)]
    for first, end, law in reduce_to_moves(rows, far, ("quintic", "trapezoid")):
        if law != "stay":
            moves.append(_Move(end, end - first, LAWS[law]))
            continue
        if np.abs(rows[first] - rows[moves[-1].pose]).max() > far:
            moves.append(_Move(first, 1, "linear"))
        leaves = np.abs(rows[end] - rows[first]).max() > far
        moves[-1].hold += end - first - int(leaves)
    period_s = job.clock.seconds(job.frame.period.cycles)
    return list(_elements(moves, np.degrees(angles), motion.names, period_s))


@dataclass(slots=True)
class _Move:
    """To the pose of frame `pose`, in a number of frames, and how many frames it then stays."""

    pose: int
    frames: int
    law: str
    hold: int = 0


def _elements(
    moves: Sequence[_Move], degrees: Floats, names: Sequence[str], period_s: Fraction
) -> Iterator[str]:
    """Yield each move as an inline table, which names the servos whose angle changes."""
    before: dict[str, str] = {}
    for index, move in enumerate(moves):
        here = {
            name: f"{angle:z.3f}".rstrip("0").rstrip(".")
            for name, angle in zip(names, degrees[move.pose].tolist(), strict=True)
        }
        pairs = [f"{name}_deg = {angle}" for name, angle in here.items() if before.get(name) != angle]
        pairs += [f"move_s = {_seconds(move.frames * period_s)}"] if move.frames or not index else []
        pairs += [f'law = "{move.law}"'] if index else []
        pairs += [f"hold_s = {_seconds(move.hold * period_s)}"] if move.hold else []
        yield f"{{ {', '.join(pairs)} }}"
        before = here


def _seconds(time: Fraction) -> str:
    return f"{float(time):.9g}"


def frame_angles(motion: RecordedMotion, job: Job) -> Floats:
    """Return the angles (frames, servos) of a recording of the job's servos, once in each period.

    Raises InputError for more than MAX_FRAMES.
    """
    times = _frame_times(motion, job)
    if len(times) > MAX_FRAMES:
        longest_s = float(MAX_FRAMES * job.clock.seconds(job.frame.period.cycles))
        raise InputError(
            "too-many-frames",
            f"lasts {motion.duration:g} s, more than {MAX_FRAMES} frames, {longest_s:g} s",
            Location(motion.file),
            f"--to-s {longest_s:g} imports the beginning",
        )
    return motion.at(np.minimum(times, motion.duration))


def _frame_times(motion: RecordedMotion, job: Job) -> Floats:
    period_s = float(job.clock.seconds(job.frame.period.cycles))
    return np.arange(math.ceil(motion.duration / period_s - 1e-9) + 1, dtype=float) * period_s


def with_poses(text: str, poses: Sequence[str], repeat: bool, file: str) -> str:
    """Return the text of a job whose [motion] has these poses. Raises InputError if it moves otherwise."""
    document = parse(text, file)
    other = next((name for name in SECTIONS if name != "motion" and name in document.data), None)
    if other is not None:
        raise document.error(
            "job-sections", (other,), f"[{other}] moves the servos", "a recording becomes [motion]: remove it"
        )
    if "motion" not in document.data:
        text = text.rstrip("\n") + "\n\n[motion]\n"
    value = "[\n" + "".join(f"    {pose},\n" for pose in poses) + "]"
    if "motion" not in document.data:
        return f"{text}repeat = {str(repeat).lower()}\nposes = {value}\n"
    text = set_in_table(text, ("motion",), "poses", value)
    return set_in_table(text, ("motion",), "repeat", str(repeat).lower())


def new_job(
    recording: RecordedMotion, servo: str, robot: str | None, target: Path, named: Named, stream: bool
) -> str:
    """Return a job file without a motion: a servo for each track, on one pin after the other.

    With a robot's name or file the tracks are its joints, and where 0 at the middle of a servo's travel does
    not suffice, the middle of the recorded angles is there. Raises InputError.
    """
    if len(recording.names) > len(PINS):
        raise InputError(
            "too-many-servos",
            f"has {len(recording.names)} tracks, one chip drives {len(PINS)}",
            Location(recording.file),
            "--job JOB with some of the servos, and a file of their tracks",
        )
    lines = [
        f"# Imported from {Path(recording.file).name} by `servogen import`; the pins are yours to choose.",
        *("", "[chip]", 'device = "PIC16F84"', "clock_hz = 4_000_000"),
    ]
    if robot is not None:
        inside = Path(os.path.relpath(robot, target.parent)).as_posix() if Path(robot).suffix else robot
        lines += ["", "[robot]", f"name = {json.dumps(inside)}"]
    names, unit = named
    model = servo_model(servo)
    name = Path(os.path.relpath(servo, target.parent)).as_posix() if servo.endswith(".toml") else servo
    for track, (pin, joint) in enumerate(
        zip(PINS, (names.get(name, name) for name in recording.names), strict=False)
    ):
        lines += [
            "",
            "[[servo]]",
            f'name = "{cleaned(joint)}"',
            f'pin = "{pin}"',
            f"model = {json.dumps(name)}",
        ]
        its_unit = recording.units[track] or unit
        if robot is not None and its_unit in ("deg", "rad"):
            values = recording.values[:, track] * (1 if its_unit == "deg" else math.degrees(1))
            low, high = (math.degrees(end) for end in model.travel)
            zero = (low + high) / 2
            if zero + values.min() < low or zero + values.max() > high:
                zero = round(zero - (values.min() + values.max()) / 2, 1)
            lines += [f"joint = {json.dumps(joint)}", f"zero_deg = {zero:g}"]
    lines += ["", "[frame]", f"period_us = {'19_968 # whole slots' if stream else '20_000'}"]
    return "\n".join(lines) + "\n" + ("\n[stream]\n" if stream else "")


@dataclass(frozen=True, slots=True)
class Deviation:
    """How far a servo is from the recording at worst: radians, µs of its pulse, when; of a foot or tool
    metres alone.
    """

    name: str
    time_s: float
    place: Location
    angle: float = 0.0
    width_us: float = 0.0
    distance_m: float | None = None

    def to_json(self) -> ServoDeviation | EndDeviation:
        """Return the difference as a value that JSON can hold."""
        place: DeviationPlace = {
            "time_s": self.time_s,
            "file": self.place.file,
            "line": self.place.line,
            "key": self.place.key,
        }
        if self.distance_m is not None:
            return {"end": self.name, "error_mm": 1000 * self.distance_m, **place}
        return {"servo": self.name, "error_deg": math.degrees(self.angle), "error_us": self.width_us, **place}


def deviations(motion: RecordedMotion, asked: PlannedJob, played: PlayedJob | None) -> tuple[Deviation, ...]:
    """Return the deviations of a job's pulses from a recording of its servos; without `played` those of its
    plan. They are compared at every sample and at every frame; between frames a servo is on its way from one
    to the next.
    """
    angles = asked.trajectory.angles
    if played is not None:
        made = made_angles(played.plan.schedule, asked.servos)
        angles = made[len(played.job.trajectory.angles) - len(angles) :]
    period_s = float(asked.clock.seconds(asked.trajectory.period))
    frame_times = _frame_times(motion, asked)
    # After the last sample nothing is known: the last frame, up to a period later, is compared with it.
    times = np.union1d(motion.times[motion.times <= frame_times[-1] - period_s], frame_times)
    at = np.minimum(times / period_s, len(angles) - 1)
    before = np.minimum(at.astype(int), len(angles) - 1)
    after = np.minimum(before + 1, len(angles) - 1)
    there = angles[before] + (at - before)[:, None] * (angles[after] - angles[before])
    wanted = motion.at(np.minimum(times, motion.duration))

    def place(index: int) -> Location:
        return motion.places[int(np.abs(motion.times - times[index]).argmin())]

    found = []
    for servo, off in zip(asked.servos, np.abs(there - wanted).T, strict=True):
        off = np.where(np.isnan(off), np.inf, off)
        worst = int(np.argmax(off))
        us = float(off[worst]) / servo.calibration.per_us
        found.append(Deviation(servo.name, float(times[worst]), place(worst), float(off[worst]), us))
    for end in asked.ends:
        away = np.linalg.norm(end.points(there) - end.points(wanted), axis=1)
        worst = int(np.argmax(np.where(np.isnan(away), np.inf, away)))
        found.append(Deviation(end.name, float(times[worst]), place(worst), distance_m=float(away[worst])))
    return tuple(found)


@dataclass(frozen=True, slots=True)
class Imported:
    """The text of a job that plays a recording, how many poses it has, and its deviations."""

    text: str
    poses: int
    job: PlannedJob
    played: PlayedJob | None
    deviations: tuple[Deviation, ...]

    @property
    def passed(self) -> bool:
        """Return whether every pulse is as close to the recording as the job asks for."""
        return within(self.deviations, self.job)


def within(found: Sequence[Deviation], job: Job) -> bool:
    """Return whether no pulse is farther from a recording than the job's max_error_us."""
    return all(each.width_us <= job.firmware.max_error_us for each in found)


def imported(
    recording: RecordedMotion,
    named: Named,
    text: str,
    file: str,
    repeat: bool,
    progress: Callable[[str], None],
) -> Imported:
    """Return the job of `text` with a recording as its motion.

    Raises InputError; ResourceError if the chip does not hold the motion, with the seconds that fit.
    """
    job = loads(with_poses(text, ["{ hold_s = 1 }"], False, file), file)
    motion = in_servos(recording, job, named)
    tape = given(job.inputs, Tape) is not None
    # A tape holds every frame: only the rounding to cycles is left.
    tolerance_us = float(job.clock.cycle_us) / TAPE_SHARE if tape else job.firmware.max_error_us / 2
    for _ in range(FINER):
        progress("reducing")
        poses = poses_text(motion, job, tolerance_us)
        made = with_poses(text, poses, repeat, file)
        if job.stream is None and not tape and len(poses) * len(job.servos) > 2 * MAX_BYTES:
            raise _too_long(motion, text, poses, file, "its poses are more than any engine holds", progress)
        asked = plan_job(loads(made, file))
        try:
            progress(f"planning {counted(len(poses), 'pose')}")
            played = None if asked.stream is not None else _compile(asked)
        except ResourceError as error:
            raise _too_long(motion, text, poses, file, error.message, progress) from error
        result = Imported(made, len(poses), asked, played, deviations(motion, asked, played))
        if result.passed:
            break
        tolerance_us /= 2
    return result


def _compile(asked: PlannedJob) -> PlayedJob:
    """Return a job as its engine plays it, compiled. Raises ResourceError if the chip does not hold it."""
    played = planned(asked)
    played.make(asked.firmware.dialect)
    return played


def _too_long(
    motion: RecordedMotion,
    text: str,
    poses: Sequence[str],
    file: str,
    why: str,
    progress: Callable[[str], None],
) -> ResourceError:
    """Return the error about a motion that the chip does not hold, with how many seconds fit."""
    usual = DATA_BYTES // (len(motion.names) + SCRIPT_BYTES)
    fits, end_s = 0, 0.0
    for share in SHARES:
        count = min(int(usual * share), len(poses) - 1)
        progress(f"trying {counted(count, 'pose')}")
        try:
            asked = plan_job(loads(with_poses(text, poses[:count], False, file), file))
            _compile(replace(asked, firmware=replace(asked.firmware, engine="player", precise=False)))
        except ServogenError:
            continue
        # The first frame is at 0 s, and the last one repeats the pose before it.
        trajectory, fits = asked.trajectory, count
        end_s = float((len(trajectory.angles) - 2) * trajectory.clock.seconds(trajectory.period))
        break
    cut = f"--to-s {end_s:g} imports these; " if fits else ""
    return ResourceError(
        "does-not-fit",
        f"the chip holds the first {end_s:g} s of {motion.duration:g} s, {fits} of {len(poses)} poses: {why}",
        Location(motion.file),
        f"{cut}--stream: a computer plays all of it over a serial line (`servogen drive`)",
    )
