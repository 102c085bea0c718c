"""`servogen drive`: a robot moved live over a serial line."""

from __future__ import annotations

import math
import signal
import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servogen.cli.options import Json, duration
from servogen.cli.show import as_json, json_line, warn
from servogen.errors import Diagnostic

if TYPE_CHECKING:
    from servogen.drive.commands import CommandSource
    from servogen.drive.controller import ServoController
    from servogen.drive.serial_link import Opener
    from servogen.drive.session import Log, Summary
    from servogen.job import PlannedJob

INTERRUPTED = 130
KEYS_HELP = "w a s d or the arrows, q e sideways, 1 to 9 poses, space stops, x ends"

Port = Annotated[str | None, typer.Option("--port", "-p", help="The robot's serial port.")]
Baud = Annotated[
    int | None, typer.Option("--baud", min=50, help="Of the line (default: the job's stream table's).")
]
RangeUs = Annotated[
    str | None,
    typer.Option(
        "--range-us",
        help="The widths of positions 0 and 254, as 500,2500 (default: those of the job's stream table).",
    ),
]
First = Annotated[
    int, typer.Option("--first", min=0, max=253, help="The number of the first servo at the controller.")
]


def register(app: typer.Typer) -> None:
    app.command()(drive)


def drive(
    job: Annotated[Path, typer.Argument(help="A job file (TOML).", show_default=False)],
    port: Port = None,
    pose: Annotated[
        str | None, typer.Option("--pose", help="One pose: its number or name, or arm=90,hand=45 in degrees.")
    ] = None,
    steer: Annotated[
        bool, typer.Option("--keys", help=f"Steer: {KEYS_HELP}; without a terminal, one command per line.")
    ] = False,
    seconds: Annotated[
        float | None,
        typer.Option(
            "--seconds",
            parser=duration,
            metavar="SECONDS",
            help="How long (default: until Ctrl-C; a pose is only sent, unless the fail-safe would end it).",
        ),
    ] = None,
    stop: Annotated[
        str | None,
        typer.Option(
            "--stop", help="How it ends: hold, neutral, off, or a pose (default: wheels stand, others hold)."
        ),
    ] = None,
    way_mm: Annotated[
        float | None, typer.Option("--way-mm", min=1, help="--keys: a step's way; a base's, in a second.")
    ] = None,
    turn_deg: Annotated[
        float | None,
        typer.Option("--turn-deg", min=0.1, help="--keys: a step's turn; a base's, in a second."),
    ] = None,
    arrive_s: Annotated[
        float,
        typer.Option(
            "--arrive-s", min=0, max=4, help="A stream engine's way to the first pose, all servos together."
        ),
    ] = 1.0,
    baud: Baud = None,
    range_us: RangeUs = None,
    first: First = 0,
    patience: Annotated[
        float, typer.Option("--patience", min=0, help="Seconds to wait for a port that went away.")
    ] = 60.0,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Show the bytes and send nothing.")] = False,
    json: Json = False,
) -> None:
    """Move a robot live over a serial line (Mini SSC): its job's motion, a pose, or by keys."""
    from servogen.drive.controller import controller_of
    from servogen.drive.request import Request, course_of
    from servogen.drive.serial_link import SerialLink, Time, VirtualTime
    from servogen.drive.session import Session
    from servogen.drive.steering import Rates
    from servogen.job import load, plan_job

    loaded = plan_job(load(job))
    speed, controller = controller_of(loaded, baud, range_us, first)
    request = Request(
        pose=pose,
        steer=steer,
        single_keys=sys.stdin.isatty() and not dry_run,
        rates=Rates(way_mm, turn_deg),
        seconds=seconds,
        stop=stop,
        rehearsal=dry_run,
    )
    course = course_of(loaded, request)
    time = VirtualTime().time() if dry_run else Time()
    interrupted = False
    opener = _opener(port, speed, dry_run)
    with SerialLink(opener, speed, time, patience) as line, _source(steer, dry_run) as source:
        if not json:
            _tell(loaded, controller, speed, line.byte_s)
            if pose is not None and math.isinf(course.seconds):
                print("the pose is kept until Ctrl-C (or --seconds)")
        session = Session(
            controller, line, time, _log(json, dry_run), course.stop, source, course.on_command, arrive_s
        )
        try:
            with _ended_by_signals():
                session.run(course.motion)
        except KeyboardInterrupt:
            interrupted = True
    _show(session.summary, course.stop is not None, json)
    if interrupted:
        raise typer.Exit(INTERRUPTED)


def _opener(port: str | None, baud: int, dry_run: bool) -> Opener:
    from servogen.drive.serial_link import NullWire, port_opener
    from servogen.errors import InputError

    if dry_run:
        return lambda: nullcontext(NullWire())
    if port is None:
        raise InputError(
            "missing-option", "there is no line to send on", hint="--port /dev/ttyUSB0, or --dry-run"
        )
    return port_opener(port, baud)


def _source(steer: bool, dry_run: bool) -> AbstractContextManager[CommandSource]:
    """Return where commands come from: single keys, lines, or nowhere."""
    from servogen.drive.commands import LineCommands, NoCommands, script, terminal_keys

    if not steer:
        return nullcontext(NoCommands())
    if dry_run:
        return nullcontext(script(sys.stdin.read()))
    if sys.stdin.isatty():
        print(KEYS_HELP, file=sys.stderr)
        return terminal_keys(sys.stdin.fileno())
    return nullcontext(LineCommands(sys.stdin.fileno()))


@contextmanager
def _ended_by_signals() -> Iterator[None]:
    """SIGTERM and a terminal that is closed end the drive as Ctrl-C does: the robot is stopped."""
    numbers = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {number: signal.signal(number, signal.default_int_handler) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _tell(job: PlannedJob, controller: ServoController, baud: int, byte_s: float) -> None:
    """What the line can carry."""
    from servogen.engines.stream.protocol import BYTES

    count = len(controller.channels)
    position_ms = 1000 * BYTES * byte_s
    print(
        f"{job.name}, {baud} baud: a position takes {position_ms:g} ms, a pose of "
        f"{f'all {count} servos' if count > 1 else 'the servo'} {count * position_ms:g} ms, "
        f"{1000 / (count * position_ms):.1f} a second"
    )


def _log(json: bool, dry_run: bool) -> Log:
    """Return what shows a drive's entries: as JSON, one per line; else what happens to the line, and in a
    dry run the bytes. Each is shown at once, also to a pipe.
    """

    def log(entry: dict[str, object]) -> None:
        show(entry)
        sys.stdout.flush()

    def show(entry: dict[str, object]) -> None:
        if json:
            json_line(entry)
        elif "bytes" in entry and dry_run:
            said = f"{entry['servo']} {entry['width_us']} µs" if "servo" in entry else "group"
            print(f"{entry['s']:>9} s  {entry['bytes']}  {said}")
        elif "event" in entry and entry["event"] != "stopped":
            text = f"{entry['event']}: {entry.get('text', '')}".rstrip(": ")
            warn(Diagnostic("warning", "drive-event", text))

    return log


def _show(summary: Summary, wanted: bool, json: bool) -> None:
    """Raises ToolError where the robot was to be stopped and could not be."""
    from servogen.errors import ToolError

    if json:
        as_json(summary.to_json())
    else:
        away = f", {summary.outages} times away for {summary.away_s:.1f} s" if summary.outages else ""
        print(
            f"{summary.seconds:.2f} s, {summary.commands} positions, {summary.rounds} poses "
            f"({summary.poses_per_second:.1f} a second, the slowest {1000 * summary.slowest_s:.1f} ms){away}"
        )
    if wanted and not summary.stopped:
        raise ToolError(
            "not-stopped", "the robot was NOT stopped: the line is gone", hint="switch its servos off"
        )
