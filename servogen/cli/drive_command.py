"""`servogen drive`: moves a robot live over a serial line."""

from __future__ import annotations

import math
import sys
from contextlib import nullcontext
from dataclasses import dataclass
from typing import Annotated

import typer

from servogen import INTERRUPTED
from servogen.cli.drive_line import KEYS_HELP, WireOptions, command_source, was_interrupted
from servogen.cli.options import JobFile, Json, duration
from servogen.cli.show import as_json, json_line, warn
from servogen.drive.controller import ServoController, job_controller
from servogen.drive.request import DriveRequest, plan_course
from servogen.drive.serial_link import NullWire, Opener, SerialLink, Time, VirtualTime, port_opener
from servogen.drive.session import ARRIVE_S, DriveSession, Log, Summary
from servogen.drive.steering import Rates
from servogen.engines.stream.protocol import BYTES
from servogen.errors import Diagnostic, InputError, Location, ToolError
from servogen.job import PlannedJob, load, plan_job
from servogen.units import counted


@dataclass(frozen=True, slots=True)
class DriveOptions:
    """What the robot is to do."""

    pose: Annotated[
        str | None, "Move to one pose: its number or name, or angles in degrees such as arm=90,hand=45."
    ] = None
    steer: Annotated[
        bool, typer.Option("--keys", help=f"Steer: {KEYS_HELP}; without a terminal, one command per line.")
    ] = False
    seconds: Annotated[
        float | None,
        typer.Option(
            parser=duration,
            metavar="SECONDS",
            help="Duration (default: until Ctrl-C; a pose is sent once, unless the fail-safe would end it).",
        ),
    ] = None
    stop: Annotated[
        str | None,
        "What to do at the end: hold, neutral, off or a pose (default: stop wheels, hold other servos).",
    ] = None
    step_mm: Annotated[
        float | None, typer.Option(min=1, help="With --keys: distance of one step; of a base, per second.")
    ] = None
    turn_deg: Annotated[
        float | None, typer.Option(min=0.1, help="With --keys: turn of one step; of a base, per second.")
    ] = None
    arrive_s: Annotated[
        float,
        typer.Option(
            min=0, max=4, help="How long a stream engine takes to move all servos to the first pose."
        ),
    ] = ARRIVE_S

    def of_terminal(self, wire: WireOptions) -> DriveRequest:
        """Return the request, of single keys where somebody types them."""
        return DriveRequest(
            pose=self.pose,
            steer=self.steer,
            single_keys=sys.stdin.isatty() and not wire.dry_run,
            rates=Rates(self.step_mm, self.turn_deg),
            seconds=self.seconds,
            stop=self.stop,
            rehearsal=wire.dry_run,
        )


def drive(job: JobFile, wire: WireOptions, request: DriveOptions, json: Json = False) -> None:
    """Move a robot live over a serial line (Mini SSC): play its job's motion, go to a pose or steer it."""
    loaded = plan_job(load(job))
    if loaded.directions:
        _check_walk_on_command(loaded, wire, request)
        from servogen.cli.drive_on_command import drive_on_command  # loads the compiler: for these jobs only

        drive_on_command(loaded, wire, request.seconds, json)
        return
    speed, controller = job_controller(loaded, wire.baud, wire.range_us, wire.first)
    course = plan_course(loaded, request.of_terminal(wire))
    time = VirtualTime().time() if wire.dry_run else Time()
    with (
        SerialLink(_opener(wire, speed), speed, time, wire.patience) as line,
        command_source(request.steer, wire.dry_run) as source,
    ):
        if not json:
            _show_robot(loaded, controller, speed, line.byte_s)
            if request.pose is not None and math.isinf(course.seconds):
                print("the pose is kept until Ctrl-C (or --seconds)")

        def on_command(command: str) -> None:
            course.on_command(command)
            if course.state is not None and not json:
                print(course.state(), file=sys.stderr, flush=True)

        session = DriveSession(
            controller=controller,
            line=line,
            time=time,
            log=entry_log(json, wire.dry_run),
            stop=course.stop,
            source=source,
            on_command=on_command,
            arrive_s=request.arrive_s,
        )
        interrupted = was_interrupted(lambda: session.run(course.motion))
    _show_drive(session.summary, course.stop is not None, json)
    if interrupted:
        raise typer.Exit(INTERRUPTED)


def _check_walk_on_command(job: PlannedJob, wire: WireOptions, request: DriveOptions) -> None:
    """Raise InputError for options that do not steer a walk on command."""
    others = {
        "--pose": request.pose,
        "--stop": request.stop,
        "--step-mm": request.step_mm,
        "--turn-deg": request.turn_deg,
        "--range-us": wire.range_us,
    }
    given = [name for name, value in others.items() if value is not None]
    if given:
        raise InputError(
            "conflicting-options",
            f"{given[0]} is for other jobs: this robot walks on command",
            Location(job.file),
        )
    if not request.steer:
        raise InputError("missing-option", "the robot walks on command", Location(job.file), "add --keys")


def _opener(wire: WireOptions, baud: int) -> Opener:
    if wire.dry_run:
        return lambda: nullcontext(NullWire())
    if wire.port is None:
        raise InputError(
            "missing-option", "no serial port is given", hint="--port /dev/ttyUSB0, or --dry-run"
        )
    return port_opener(wire.port, baud)


def _show_robot(job: PlannedJob, controller: ServoController, baud: int, byte_s: float) -> None:
    """Print how many poses per second the line can carry."""
    count = len(controller.channels)
    position_ms = 1000 * BYTES * byte_s
    print(
        f"{job.name}, {baud} baud: a position takes {position_ms:g} ms, a pose of "
        f"{f'all {count} servos' if count > 1 else 'the servo'} {count * position_ms:g} ms, "
        f"{1000 / (count * position_ms):.1f} a second"
    )


def entry_log(json: bool, dry_run: bool) -> Log:
    """Return a function that shows a drive's entries: as JSON, one per line, or the events of the line and,
    in a dry run, the bytes. Each is flushed, so that a pipe shows it at once.
    """

    def log(entry: dict[str, object]) -> None:
        show(entry)
        sys.stdout.flush()

    def show(entry: dict[str, object]) -> None:
        if json:
            json_line(entry)
        elif "bytes" in entry and dry_run:
            sent = f"{entry['servo']} {entry['width_us']} µs" if "servo" in entry else "group"
            print(f"{entry['s']:>9} s  {entry['bytes']}  {sent}")
        elif "event" in entry and entry["event"] != "stopped":
            text = f"{entry['event']}: {entry.get('text', '')}".rstrip(": ")
            warn(Diagnostic("warning", "drive-event", text))

    return log


def _show_drive(summary: Summary, wanted: bool, json: bool) -> None:
    """Print the summary. Raises ToolError if the robot was to be stopped and could not be."""
    if json:
        as_json(summary.to_json())
    else:
        text = (
            f"{summary.seconds:.2f} s, {counted(summary.commands, 'position')}, "
            f"{counted(summary.rounds, 'pose')} ({summary.poses_per_second:.1f} a second, "
            f"the slowest {1000 * summary.slowest_s:.1f} ms)"
        )
        if summary.outages:
            text += f", away {counted(summary.outages, 'time')} for {summary.away_s:.1f} s"
        print(text)
    if wanted and not summary.stopped:
        raise ToolError(
            "not-stopped", "the robot was NOT stopped: the line is gone", hint="switch its servos off"
        )
