"""`servogen import`: a motion that another program wrote becomes that of a job, or is compared with one."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import typer

from servogen.cli.files import check_outputs
from servogen.cli.options import Json
from servogen.cli.show import as_json, next_step, status, table, warn_of_all
from servogen.errors import Diagnostic, InputError, Location
from servogen.job import PlannedJob, load, plan_job
from servogen.outputs import write_text
from servogen.recordings import RecordedMotion, read
from servogen.recordings.recording import UNITS
from servogen.robot.servo_models import catalogued_as
from servogen.toml.file import read_text
from servogen.workflows.engines import planned
from servogen.workflows.importing import Deviation, Named, deviations, imported, in_servos, new_job, within

SERVO = "futaba-s3001"


@dataclass(frozen=True, slots=True)
class TrackOptions:
    """What the tracks of a file mean, and how much of it is read."""

    unit: Annotated[str | None, f"The unit of values that state none: {', '.join(UNITS)}."] = None
    names: Annotated[
        list[str] | None,
        typer.Option(
            "--map", metavar="TRACK=NAME", help="The servo or joint of a track of another name (repeatable)."
        ),
    ] = None
    joints: Annotated[bool, "The angles are those of joints, as in ROS files and with --robot."] = False
    to_s: Annotated[float | None, typer.Option(min=0, help="Import only the beginning, up to this time.")] = (
        None
    )

    @property
    def named(self) -> Named:
        """Return the names and the unit for a workflow. Raises InputError."""
        if self.unit is not None and self.unit not in UNITS:
            units = f"one of {', '.join(UNITS)}"
            raise InputError("bad-option", f"'{self.unit}' is no unit", Location("--unit"), units)
        return dict(_pair(text) for text in self.names or ()), self.unit

    def read(self, file: Path, of_joints: bool) -> RecordedMotion:
        """Return the recording in a file. Raises InputError."""
        found = read(file)
        if self.to_s is not None:
            found = found.until(self.to_s)
        return replace(found, of_joints=True) if self.joints or of_joints else found


@dataclass(frozen=True, slots=True)
class TargetOptions:
    """The job that is written."""

    job: Annotated[Path | None, "The job whose servos move; its text is kept, its poses are replaced."] = None
    robot: Annotated[str | None, "Without --job: the robot, or its file, whose joints are recorded."] = None
    servo: Annotated[str | None, f"Without --job: the model of every servo ({SERVO})."] = None
    stream: Annotated[bool, "A job that a computer plays over a serial line: of any length."] = False
    repeat: Annotated[bool, "The motion repeats endlessly."] = False
    output: Annotated[Path | None, typer.Option("--output", "-o", help="The job file to write.")] = None
    force: Annotated[bool, "Overwrite an existing file."] = False

    def path(self, file: Path) -> Path:
        """Return the file to write. Raises InputError."""
        if self.job is not None and (self.robot or self.servo):
            raise InputError(
                "conflicting-options", "the servos and the robot are those of --job", Location("--job")
            )
        if self.output is None:
            hint = "-o job.toml, or --against a job"
            raise InputError("missing-option", "the job to write is not given", Location("-o"), hint)
        check_outputs([file], self.output)
        if self.output.exists() and not self.force:
            hint = "give another name, or --force"
            raise InputError("output-exists", "exists already", Location(str(self.output)), hint)
        return self.output

    def text(self, recorded: RecordedMotion, named: Named, path: Path) -> str:
        """Return the text of the job, whose motion is to be replaced. Raises InputError."""
        if self.job is None:
            return new_job(recorded, catalogued_as(self.servo or SERVO), self.robot, path, named, self.stream)
        more = "\n[stream]\n" if self.stream and load(self.job).stream is None else ""
        return read_text(self.job) + more


def import_(
    file: Annotated[
        Path,
        typer.Argument(
            help="CSV, a ROS JointTrajectory (.yaml, .json), or an export of Blender (.json, .h)."
        ),
    ],
    tracks: TrackOptions,
    target: TargetOptions,
    against: Annotated[Path | None, "Write nothing: compare the recording with this job's motion."] = None,
    json: Json = False,
) -> None:
    """Turn a motion of another program into poses of a job, and say how far its pulses are from it."""
    named = tracks.named
    if against is not None:
        if target != TargetOptions():
            raise InputError("conflicting-options", "--against writes no job", Location("--against"))
        with status("comparing"):
            asked = plan_job(load(against))
            motion = in_servos(tracks.read(file, False), asked, named)
            found = deviations(motion, asked, None if asked.stream else planned(asked))
        _show(found, asked, file, json, {})
        raise typer.Exit(0 if within(found, asked) else 1)
    path = target.path(file)
    recorded = tracks.read(file, target.robot is not None)
    text = target.text(recorded, named, path)
    with status("reading") as step:
        made = imported(recorded, named, text, str(path), target.repeat, step)
    write_text(path, made.text)
    facts = {"file": str(path), "poses": made.poses, "duration_s": recorded.duration}
    _show(made.deviations, made.job, file, json, facts)
    raise typer.Exit(0 if made.passed else 1)


def _pair(text: str) -> tuple[str, str]:
    """Return the track and the name of --map."""
    track, equals, servo = text.partition("=")
    if not (track and equals and servo):
        raise InputError("bad-option", f"'{text}' is not a track and a name", Location("--map"), "0=arm")
    return track, servo


def _show(
    found: tuple[Deviation, ...], job: PlannedJob, file: Path, json: bool, facts: dict[str, object]
) -> None:
    """Show the deviations, which one is too large, and, of a job that was written, its name."""
    limit, servos = job.firmware.max_error_us, [each for each in found if each.distance_m is None]
    worst = max(servos, key=lambda each: each.width_us)
    beyond = []
    if worst.width_us > limit:
        text = (
            f"{worst.name} is {math.degrees(worst.angle):.3g}°, {worst.width_us:.3g} µs, off the recording "
            f"at {worst.time_s:g} s: max_error_us allows {limit:g} µs"
        )
        beyond.append(Diagnostic("warning", "off-the-recording", text, worst.place))
    warnings = (*beyond, *job.warnings)
    if json:
        rows = [each.to_json() for each in found]
        as_json({**facts, "within_max_error": not beyond, "deviations": rows}, warnings)
        return
    table(
        f"Differences from {file}",
        ("servo", "°", "µs", "at s"),
        [
            (each.name, f"{math.degrees(each.angle):.3f}", f"{each.width_us:.2f}", f"{each.time_s:.3f}")
            for each in servos
        ],
    )
    for each in found:
        if each.distance_m is not None:
            print(f"{each.name}: at worst {1000 * each.distance_m:.3f} mm, at {each.time_s:.3f} s")
    if job.stream is not None:
        print("of the plan: a computer plays it, in the steps of the serial line's positions")
    if facts:
        print(f"{facts['file']}: {facts['poses']} poses, {facts['duration_s']:g} s")
    warn_of_all(warnings)
    if facts:
        print(next_step("drive" if job.stream else "build", facts["file"]))
