"""`servogen drive`: a robot moved live over a serial line."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servogen.cli.options import Json, duration
from servogen.cli.show import as_json, warn

if TYPE_CHECKING:
    from servogen.drive.commands import Rates, Words
    from servogen.drive.controller import Controller
    from servogen.drive.motions import Motion
    from servogen.drive.serial_link import Opener
    from servogen.drive.session import Log, Summary
    from servogen.job import PlannedJob
    from servogen.motion.trajectory import Floats

INTERRUPTED = 130
HOLD, NEUTRAL, OFF = "hold", "neutral", "off"
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
        bool, typer.Option("--keys", help=f"Steer: {KEYS_HELP}; without a terminal, a word a line.")
    ] = False,
    seconds: Annotated[
        float | None,
        typer.Option(
            "--seconds",
            parser=duration,
            metavar="SECONDS",
            help="How long (default: for ever; a pose is sent and left, unless the fail-safe would end it).",
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
    from servogen.drive.commands import Rates
    from servogen.drive.controller import controller_of
    from servogen.drive.serial_link import Line, Time, VirtualTime
    from servogen.drive.session import Session
    from servogen.job import load, plan_job

    loaded = plan_job(load(job))
    speed, controller = controller_of(loaded, baud, range_us, first)
    end = _stop_pose(loaded, stop)
    motion, order = _driven(loaded, pose, steer, seconds, Rates(way_mm, turn_deg), dry_run)
    time = VirtualTime().time() if dry_run else Time()
    interrupted = False
    with Line(_opener(port, speed, dry_run), speed, time, patience) as line, _orders(steer, dry_run) as words:
        if not json:
            _tell(loaded, controller, speed, line.byte_s)
            if pose is not None and math.isinf(_pose_s(loaded, seconds, dry_run)):
                print("the pose is kept until Ctrl-C (or --seconds)", flush=True)
        session = Session(controller, line, time, _log(json, dry_run), end, words, order, arrive_s)
        try:
            with _ended_by_signals():
                session.run(motion)
        except KeyboardInterrupt:
            interrupted = True
    _show(session.summary, end is not None, json)
    if interrupted:
        raise typer.Exit(INTERRUPTED)


def _driven(
    job: PlannedJob, pose: str | None, steer: bool, seconds: float | None, rates: Rates, dry_run: bool
) -> tuple[Motion, Callable[[str], None]]:
    """The motion, and what its orders go to."""
    from servogen.drive.motions import Limited, Played, Still, pose_of
    from servogen.drive.steering import steering_of
    from servogen.errors import InputError

    if pose is not None and steer:
        raise InputError("conflicting-options", "--pose is one pose, --keys is many: take one of the two")
    if pose is not None:
        return Limited(Still(pose_of(job, pose)), _pose_s(job, seconds, dry_run)), lambda word: None
    if not steer:
        made = job.trajectory
        once = float(made.clock.seconds(made.period) * len(made.angles))
        last = once if dry_run and seconds is None else seconds
        return Limited(Played(made), math.inf if last is None else last), lambda word: None
    steering = steering_of(job, rates)
    limited = Limited(steering, math.inf if seconds is None else seconds)
    if sys.stdin.isatty() and not dry_run:  # keys that mean nothing to this robot are not mistakes
        return limited, lambda word: steering.order(word) if word in steering.words else None
    return limited, steering.order


def _pose_s(job: PlannedJob, seconds: float | None, dry_run: bool) -> float:
    """A pose is sent and left, but not wheels that turn, nor to a chip that would take its fail-safe."""
    if seconds is not None:
        return seconds
    turns = any(servo.model.continuous for servo in job.servos)
    leaves = job.stream is not None and job.stream.fail_safe != HOLD
    return math.inf if (turns or leaves) and not dry_run else 0.0


def _stop_pose(job: PlannedJob, text: str | None) -> Floats | None:
    """The pose that ends the drive; None: the servos hold what they were sent last."""
    import numpy as np

    from servogen.drive.motions import pose_of
    from servogen.errors import InputError, Location

    neutral = np.array([servo.neutral for servo in job.servos])
    wheels = [servo.model.continuous for servo in job.servos]
    if text is None and any(wheels):
        return np.where(wheels, neutral, np.nan)
    if text == OFF and (job.stream is None or job.stream.fail_safe != OFF):
        raise InputError(
            "drive-unsupported",
            "Mini SSC cannot switch pulses off: only the stream engine's fail-safe does",
            Location(job.file),
            'write fail_safe = "off" in [stream]',
        )
    if text is None or text in (HOLD, OFF):
        return None
    return neutral if text == NEUTRAL else pose_of(job, text)


def _opener(port: str | None, baud: int, dry_run: bool) -> Opener:
    from servogen.drive.serial_link import Nowhere, port_opener
    from servogen.errors import InputError

    if dry_run:
        return lambda: nullcontext(Nowhere())
    if port is None:
        raise InputError(
            "missing-option", "there is no line to send on", hint="--port /dev/ttyUSB0, or --dry-run"
        )
    return port_opener(port, baud)


def _orders(steer: bool, dry_run: bool) -> AbstractContextManager[Words]:
    """Where orders come from: single keys, lines, or nowhere."""
    from servogen.drive.commands import Lines, Silence, keys, script

    if not steer:
        return nullcontext(Silence())
    if dry_run:
        return nullcontext(script(sys.stdin.read()))
    if sys.stdin.isatty():
        print(KEYS_HELP, file=sys.stderr)
        return keys(sys.stdin.fileno())
    return nullcontext(Lines(sys.stdin.fileno()))


@contextmanager
def _ended_by_signals() -> Iterator[None]:
    """SIGTERM and a terminal that is closed end the drive as Ctrl-C does: the robot is stopped."""
    import signal

    numbers = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {number: signal.signal(number, signal.default_int_handler) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _tell(job: PlannedJob, controller: Controller, baud: int, byte_s: float) -> None:
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
    """JSON: every entry a line. Otherwise what happens to the line, and in a dry run the bytes."""

    def log(entry: dict[str, object]) -> None:
        if json:
            as_json(entry)
        elif "bytes" in entry and dry_run:
            said = f"{entry['servo']} {entry['width_us']} µs" if "servo" in entry else "group"
            print(f"{entry['s']:>9} s  {entry['bytes']}  {said}")
        elif "event" in entry and entry["event"] != "stopped":
            warn(f"{entry['event']}: {entry.get('text', '')}".rstrip(": "))

    return log


def _show(summary: Summary, wanted: bool, json: bool) -> None:
    """Raises ToolError where the robot was to be stopped and could not be."""
    from servogen.errors import ToolError

    if json:
        as_json(summary.as_dict())
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
