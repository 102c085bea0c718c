"""Commands that move a robot over a serial line: drive, calibrate."""

from __future__ import annotations

import math
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servogen import INTERRUPTED
from servogen.cli.options import JobFile, Json, duration
from servogen.cli.show import as_json, json_line, table, warn
from servogen.errors import Diagnostic
from servogen.units import counted

if TYPE_CHECKING:
    from servogen.drive.commands import CommandSource, Keys
    from servogen.drive.controller import ControllerChannel, ServoController
    from servogen.drive.serial_link import Opener
    from servogen.drive.session import Log, Summary
    from servogen.drive.sweep import Ask, Sweep
    from servogen.job import Job, PlannedJob
    from servogen.robot.calibration import Fit, Reading
    from servogen.robot.servo import Servo


def register(app: typer.Typer) -> None:
    """Add the commands of this module to the application."""
    app.command()(drive)
    app.command()(calibrate)


TOLERANCE_DEG, WHEEL_TOLERANCE_DEG = 5.0, 20.0
"""The allowed distance of a reading from the fitted line: an angle in °, a wheel's speed in °/s."""

KEYS_HELP = (
    "w a s d or the arrows, q e sideways, 1 to 9 poses, space stops, x ends; "
    "of a stream job: Tab selects a servo, + and - move it"
)
WALK_KEYS_HELP = "w a s d or the arrows (a robot with one button: Tab), space stops, q ends"

Port = Annotated[str | None, typer.Option("--port", "-p", help="The robot's serial port.")]
Baud = Annotated[
    int | None,
    typer.Option("--baud", min=50, help="Baud rate of the line (default: that of the job's stream table)."),
]
RangeUs = Annotated[
    str | None,
    typer.Option(
        "--range-us",
        help="The pulse widths of positions 0 and 254, such as 500,2500 (default: those of the job's "
        "stream table).",
    ),
]
First = Annotated[
    int, typer.Option("--first", min=0, max=253, help="The first servo's number on the controller.")
]


def drive(
    job: JobFile,
    port: Port = None,
    pose: Annotated[
        str | None,
        typer.Option(
            "--pose",
            help="Move to one pose: its number or name, or angles in degrees such as arm=90,hand=45.",
        ),
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
            help="Duration (default: until Ctrl-C; a pose is sent once, unless the fail-safe would end it).",
        ),
    ] = None,
    stop: Annotated[
        str | None,
        typer.Option(
            "--stop",
            help="What to do at the end: hold, neutral, off or a pose (default: stop wheels, hold "
            "other servos).",
        ),
    ] = None,
    step_mm: Annotated[
        float | None,
        typer.Option("--step-mm", min=1, help="With --keys: distance of one step; of a base, per second."),
    ] = None,
    turn_deg: Annotated[
        float | None,
        typer.Option("--turn-deg", min=0.1, help="With --keys: turn of one step; of a base, per second."),
    ] = None,
    arrive_s: Annotated[
        float,
        typer.Option(
            "--arrive-s",
            min=0,
            max=4,
            help="How long a stream engine takes to move all servos to the first pose.",
        ),
    ] = 1.0,
    baud: Baud = None,
    range_us: RangeUs = None,
    first: First = 0,
    patience: Annotated[
        float,
        typer.Option("--patience", min=0, help="How many seconds to wait for a port that has disappeared."),
    ] = 60.0,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print the bytes without sending them.")] = False,
    json: Json = False,
) -> None:
    """Move a robot live over a serial line (Mini SSC): play its job's motion, go to a pose or steer it."""
    from servogen.drive.controller import controller_of
    from servogen.drive.request import DriveRequest, course_of
    from servogen.drive.serial_link import SerialLink, Time, VirtualTime
    from servogen.drive.session import DriveSession
    from servogen.drive.steering import Rates
    from servogen.job import load, plan_job

    loaded = plan_job(load(job))
    if loaded.directions:
        others = {
            "--pose": pose,
            "--stop": stop,
            "--step-mm": step_mm,
            "--turn-deg": turn_deg,
            "--range-us": range_us,
        }
        _check_walk_on_command(loaded, steer, [name for name, value in others.items() if value is not None])
        _walk_on_command(loaded, port, baud, seconds, dry_run, json)
        return
    speed, controller = controller_of(loaded, baud, range_us, first)
    request = DriveRequest(
        pose=pose,
        steer=steer,
        single_keys=sys.stdin.isatty() and not dry_run,
        rates=Rates(step_mm, turn_deg),
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
            _show_robot(loaded, controller, speed, line.byte_s)
            if pose is not None and math.isinf(course.seconds):
                print("the pose is kept until Ctrl-C (or --seconds)")

        def on_command(command: str) -> None:
            course.on_command(command)
            if course.state is not None and not json:
                print(course.state(), file=sys.stderr, flush=True)

        session = DriveSession(
            controller=controller,
            line=line,
            time=time,
            log=_log(json, dry_run),
            stop=course.stop,
            source=source,
            on_command=on_command,
            arrive_s=arrive_s,
        )
        try:
            with _ended_by_signals():
                session.run(course.motion)
        except KeyboardInterrupt:
            interrupted = True
    _show_drive(session.summary, course.stop is not None, json)
    if interrupted:
        raise typer.Exit(INTERRUPTED)


def _check_walk_on_command(job: PlannedJob, steer: bool, others: list[str]) -> None:
    """Raise InputError for options that do not steer a walk on command."""
    from servogen.errors import InputError, Location

    if others:
        raise InputError(
            "conflicting-options",
            f"{others[0]} is for other jobs: this robot walks on command",
            Location(job.file),
        )
    if not steer:
        raise InputError("missing-option", "the robot walks on command", Location(job.file), "add --keys")


def _walk_on_command(
    job: PlannedJob, port: str | None, baud: int | None, seconds: float | None, dry_run: bool, json: bool
) -> None:
    """Steer a walk on command: the chip at `port`, or a simulated one."""
    from contextlib import ExitStack

    from servogen.drive.commands import WALK_KEYS
    from servogen.drive.on_command import CommandedDrive, CommandedFrame, Twin, line_baud
    from servogen.drive.serial_link import SerialLink, Time, VirtualTime, port_opener
    from servogen.engines.inputs.commands import CommandLine
    from servogen.errors import InputError, Location

    if port is not None and not isinstance(job.commands, CommandLine):
        raise InputError(
            "conflicting-options",
            "--port: the robot is commanded by buttons, not by codes",
            Location(job.file),
            "without --port, a simulated chip is steered",
        )
    single = sys.stdin.isatty() and not dry_run
    real = single or (port is not None and not dry_run)
    time = Time() if real else VirtualTime().time()
    rate = baud or line_baud(job)
    interrupted = False
    with ExitStack() as stack:
        link = None
        if port is not None and not dry_run:
            link = stack.enter_context(SerialLink(port_opener(port, rate), rate, time, 0))
        twin = Twin(job)
        if not json:
            where = f"{port}, {rate} baud" if link else "a simulated chip"
            print(
                f"{job.name}: {where}; widths of {', '.join(servo.name for servo in job.servos)}", flush=True
            )
        source = stack.enter_context(_source(True, dry_run, WALK_KEYS, WALK_KEYS_HELP))
        last: CommandedFrame | None = None

        def tell(state: CommandedFrame) -> None:
            nonlocal last
            new = last is None or (state.direction, state.part) != (last.direction, last.part)
            last = state
            if json and new:
                json_line(state.to_json())
            elif single and not json:
                print(f"\r{state.text()}", end="", flush=True)
            elif new and not json:
                print(state.text(), flush=True)

        drive = CommandedDrive(twin=twin, source=source, time=time, tell=tell, link=link, single_keys=single)
        try:
            with _ended_by_signals():
                drive.run(math.inf if seconds is None else seconds)
        except KeyboardInterrupt:
            interrupted = True
    if single and not json:
        print()
    if json:
        as_json({"seconds": twin.seconds, "commands": drive.sent})
    else:
        print(f"{twin.seconds:.2f} s, {drive.sent} commands")
    if interrupted:
        raise typer.Exit(INTERRUPTED)


def _opener(port: str | None, baud: int, dry_run: bool) -> Opener:
    from servogen.drive.serial_link import NullWire, port_opener
    from servogen.errors import InputError

    if dry_run:
        return lambda: nullcontext(NullWire())
    if port is None:
        raise InputError(
            "missing-option", "no serial port is given", hint="--port /dev/ttyUSB0, or --dry-run"
        )
    return port_opener(port, baud)


def _source(
    steer: bool, dry_run: bool, keys: Keys | None = None, keys_help: str = KEYS_HELP
) -> AbstractContextManager[CommandSource]:
    """Return the source of commands: single keys, lines, or none."""
    from servogen.drive.commands import KEYS, LineCommands, NoCommands, script, terminal_keys

    if not steer:
        return nullcontext(NoCommands())
    if dry_run:
        return nullcontext(script(sys.stdin.read()))
    if sys.stdin.isatty():
        print(keys_help, file=sys.stderr)
        return terminal_keys(sys.stdin.fileno(), KEYS if keys is None else keys)
    return nullcontext(LineCommands(sys.stdin.fileno()))


@contextmanager
def _ended_by_signals() -> Iterator[None]:
    """End the drive at SIGTERM or a closed terminal as Ctrl-C does: the robot is stopped."""
    numbers = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {number: signal.signal(number, signal.default_int_handler) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _show_robot(job: PlannedJob, controller: ServoController, baud: int, byte_s: float) -> None:
    """Print how many poses per second the line can carry."""
    from servogen.engines.stream.protocol import BYTES

    count = len(controller.channels)
    position_ms = 1000 * BYTES * byte_s
    print(
        f"{job.name}, {baud} baud: a position takes {position_ms:g} ms, a pose of "
        f"{f'all {count} servos' if count > 1 else 'the servo'} {count * position_ms:g} ms, "
        f"{1000 / (count * position_ms):.1f} a second"
    )


def _log(json: bool, dry_run: bool) -> Log:
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
    from servogen.errors import ToolError

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


def calibrate(
    job: JobFile,
    servo: Annotated[
        str | None, typer.Option("--servo", help="The servo to calibrate (default: the job's only one).")
    ] = None,
    port: Port = None,
    from_us: Annotated[
        float | None, typer.Option("--from-us", help="The shortest pulse, µs (default: the servo's limit).")
    ] = None,
    to_us: Annotated[
        float | None, typer.Option("--to-us", help="The longest pulse, µs (default: the servo's limit).")
    ] = None,
    points: Annotated[int, typer.Option("--points", min=3, max=100, help="Number of pulse widths.")] = 7,
    angles: Annotated[
        str | None,
        typer.Option(
            "--angles-deg", help="The angles seen, such as 0,45,90, instead of asking for them (wheels: °/s)."
        ),
    ] = None,
    readings: Annotated[
        Path | None,
        typer.Option(
            "--readings", help="A CSV file of readings, width_us,angle_deg, instead of moving the servo."
        ),
    ] = None,
    tolerance_deg: Annotated[
        float | None,
        typer.Option(
            "--tolerance-deg",
            min=0.1,
            help="How far a reading may be from the line (default: 5; wheels: 20).",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="The file to write (default: SERVO.calibration.toml)."),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option("--plot", help="Draw a picture of the fit: .png, .svg or .pdf.")
    ] = None,
    baud: Baud = None,
    range_us: RangeUs = None,
    first: First = 0,
    json: Json = False,
) -> None:
    """Move one servo through its range, fit a line to the angles that you read, and write its calibration."""
    from servogen.drive.sweep import refusals, servo_index
    from servogen.errors import InputError
    from servogen.job import load
    from servogen.robot.calibration import calibration_text, fit, read_csv, write_calibration

    loaded = load(job)
    index = servo_index(loaded, servo)
    chosen = loaded.servos[index]
    target = output or job.parent / f"{chosen.name}.calibration.toml"
    if readings is not None:
        if angles is not None:
            raise InputError("conflicting-options", "--readings has the angles already: take one of the two")
        taken = read_csv(readings, chosen.model.continuous)
    else:
        taken = _taken(loaded, index, (from_us, to_us, points), angles, port, (baud, range_us, first))
    usual = WHEEL_TOLERANCE_DEG if chosen.model.continuous else TOLERANCE_DEG
    fitted = fit(taken, math.radians(tolerance_deg or usual), chosen.model.continuous)
    previous = write_calibration(target, calibration_text(fitted, chosen))
    if plot is not None:
        from servogen.report.calibration_plot import calibration_plot

        calibration_plot(fitted, chosen, plot)
    refused = refusals(loaded, chosen.name, target)
    _show_calibration(job, chosen, fitted, (target, previous), refused, json)
    if refused:
        raise typer.Exit(1)


def _taken(
    job: Job,
    index: int,
    span: tuple[float | None, float | None, int],
    angles: str | None,
    port: str | None,
    settings: tuple[int | None, str | None, int],
) -> Sequence[Reading]:
    """Move the servo and return the angles that were read; without a port, show only the widths."""
    from servogen.drive.controller import controller_of
    from servogen.drive.serial_link import NullWire, SerialLink, Time, VirtualTime, port_opener
    from servogen.drive.sweep import ask_from, positions, sweep_readings
    from servogen.errors import InputError
    from servogen.robot.calibration import angles_of

    if port is None and angles is None:
        raise InputError(
            "missing-option",
            "no serial port is given",
            hint="--port /dev/ttyUSB0, or --readings FILE.csv",
        )
    speed, controller = controller_of(job, *settings)
    channel = controller.channels[index]
    stops = positions(channel, *span)
    ask = _asking(channel, len(stops)) if angles is None else ask_from(angles_of(angles), stops)
    time = VirtualTime().time() if port is None else Time()
    opener = (lambda: nullcontext(NullWire())) if port is None else port_opener(port, speed)
    with SerialLink(opener, speed, time, 0.0) as line:
        return sweep_readings(controller, index, stops, line, time, ask)


def _asking(channel: ControllerChannel, count: int) -> Ask:
    """Return a function that asks on the terminal until it gets a number."""
    from servogen.drive.commands import QUIT, LineCommands
    from servogen.errors import InputError
    from servogen.robot.calibration import angle_of

    lines = LineCommands(sys.stdin.fileno())
    answers: list[str] = []
    unit = channel.servo.model.unit

    def next_answer() -> str | None:
        answers.extend(lines.since(0.0))
        return answers.pop(0) if answers else None

    def ask(sweep: Sweep, point: int) -> float:
        while True:
            width = channel.widths_us[sweep.at]
            print(f"{point + 1} of {count}, {width:z.1f} µs: what do you see, {unit}? ", end="", flush=True)
            text = sweep.wait_for(next_answer)
            if text == QUIT:
                raise InputError(
                    "bad-readings", f"ended after {point} of {count} readings: nothing is written"
                )
            try:
                return angle_of(text)
            except InputError as error:
                print(f"{error.message}; '{QUIT}' ends the calibration", file=sys.stderr)

    return ask


def _show_calibration(
    job: Path,
    servo: Servo,
    fitted: Fit,
    files: tuple[Path, Path | None],
    refused: tuple[Diagnostic, ...],
    json: bool,
) -> None:
    """Print the fit, the file written, the file kept, and why the job cannot use the calibration."""
    (target, previous), unit = files, servo.model.unit
    slope = fitted.us_per_rad * math.radians(1)
    rms, worst = math.degrees(fitted.rms), math.degrees(fitted.residuals[fitted.worst])
    if json:
        as_json(
            {
                "file": str(target),
                "kept": None if previous is None else str(previous),
                "zero_us": fitted.zero_us,
                "us_per_deg": slope,
                "rms_deg": rms,
                "worst_deg": worst,
                "residuals_deg": [math.degrees(residual) for residual in fitted.residuals],
                "taken_by_job": not refused,
            },
            refused,
        )
        return
    rows = [
        (f"{r.width_us:z.1f}", f"{math.degrees(r.angle):z.1f}", f"{math.degrees(off):+z.2f}")
        for r, off in zip(fitted.readings, fitted.residuals, strict=True)
    ]
    table(f"{servo.name}, {servo.model.title}", ("width µs", f"seen {unit}", f"off the line {unit}"), rows)
    print(
        f"width = {fitted.zero_us:.1f} µs {slope:+z.4f} µs/{unit}; "
        f"rms {rms:.2f}{unit}, worst {worst:+z.2f}{unit}"
    )
    print(f"{target}: written" + (f"; {previous} is the file that was there" if previous else ""))
    if refused:
        print("with this calibration the job's motion is not possible:", file=sys.stderr)
        for warning in refused:
            warn(warning)
        return
    beside = target.resolve().parent == job.resolve().parent
    print(f'add to the servo in the job: calibration = "{target.name if beside else target.resolve()}"')
