"""`servogen calibrate`: a servo's own line of pulse width over angle."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servogen.cli.drive_commands import Baud, First, Port, RangeUs
from servogen.cli.options import Json
from servogen.cli.show import as_json, table, warn
from servogen.errors import Diagnostic

if TYPE_CHECKING:
    from servogen.drive.controller import Channel
    from servogen.drive.sweep import Ask, Sweep
    from servogen.job import Job
    from servogen.robot.calibration import Fit, Reading
    from servogen.robot.servo import Servo

TOLERANCE_DEG, WHEEL_TOLERANCE_DEG = 5.0, 20.0
"""How far a reading may be off the line: of an angle, of a speed in a second."""


def register(app: typer.Typer) -> None:
    app.command()(calibrate)


def calibrate(
    job: Annotated[Path, typer.Argument(help="A job file (TOML).", show_default=False)],
    servo: Annotated[
        str | None, typer.Option("--servo", help="Which servo of the job (default: its only one).")
    ] = None,
    port: Port = None,
    from_us: Annotated[
        float | None, typer.Option("--from-us", help="The shortest pulse, µs (default: the servo's limit).")
    ] = None,
    to_us: Annotated[
        float | None, typer.Option("--to-us", help="The longest pulse, µs (default: the servo's limit).")
    ] = None,
    points: Annotated[int, typer.Option("--points", min=3, max=100, help="How many pulses.")] = 7,
    angles: Annotated[
        str | None,
        typer.Option("--angles-deg", help="What was seen, as 0,45,90, in place of asking (wheels: °/s)."),
    ] = None,
    readings: Annotated[
        Path | None,
        typer.Option("--readings", help="A CSV of readings, width_us,angle_deg, in place of moving it."),
    ] = None,
    tolerance_deg: Annotated[
        float | None,
        typer.Option(
            "--tolerance-deg", min=0.1, help="How far a reading may be off the line (default: 5; wheels: 20)."
        ),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="The file (default: SERVO.calibration.toml).")
    ] = None,
    plot: Annotated[Path | None, typer.Option("--plot", help="A picture of it: .png, .svg or .pdf.")] = None,
    baud: Baud = None,
    range_us: RangeUs = None,
    first: First = 0,
    json: Json = False,
) -> None:
    """Move one servo through its pulses, fit a line to the angles that you see, and write its calibration."""
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
    made = fit(taken, math.radians(tolerance_deg or usual), chosen.model.continuous)
    kept = write_calibration(target, calibration_text(made, chosen))
    if plot is not None:
        from servogen.report.calibration_plot import calibration_plot

        calibration_plot(made, chosen, plot)
    refused = refusals(loaded, chosen.name, target)
    _show(job, chosen, made, (target, kept), refused, json)
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
    """Moves the servo and reads its angles; without a port only says what the widths would have been."""
    from servogen.drive.controller import controller_of
    from servogen.drive.serial_link import NullWire, SerialLink, Time, VirtualTime, port_opener
    from servogen.drive.sweep import ask_from, positions, sweep_readings
    from servogen.errors import InputError
    from servogen.robot.calibration import angles_of

    if port is None and angles is None:
        raise InputError(
            "missing-option",
            "there is no line to move it on",
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


def _asking(channel: Channel, count: int) -> Ask:
    """Asks on the terminal until there is a number."""
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


def _show(
    job: Path,
    servo: Servo,
    made: Fit,
    files: tuple[Path, Path | None],
    refused: tuple[Diagnostic, ...],
    json: bool,
) -> None:
    """What was found, where it is written, which file was kept, and why the job does not take it."""
    (target, kept), unit = files, servo.model.unit
    slope = made.us_per_rad * math.radians(1)
    rms, worst = math.degrees(made.rms), math.degrees(made.residuals[made.worst])
    if json:
        as_json(
            {
                "file": str(target),
                "kept": None if kept is None else str(kept),
                "zero_us": made.zero_us,
                "us_per_deg": slope,
                "rms_deg": rms,
                "worst_deg": worst,
                "residuals_deg": [math.degrees(each) for each in made.residuals],
                "taken_by_job": not refused,
            },
            refused,
        )
        return
    rows = [
        (f"{r.width_us:z.1f}", f"{math.degrees(r.angle):z.1f}", f"{math.degrees(off):+z.2f}")
        for r, off in zip(made.readings, made.residuals, strict=True)
    ]
    table(f"{servo.name}, {servo.model.title}", ("width µs", f"seen {unit}", f"off the line {unit}"), rows)
    print(
        f"width = {made.zero_us:.1f} µs {slope:+z.4f} µs/{unit}; "
        f"rms {rms:.2f}{unit}, worst {worst:+z.2f}{unit}"
    )
    print(f"{target}: written" + (f"; {kept} is the file that was there" if kept else ""))
    if refused:
        print("the job cannot do its motion with it:", file=sys.stderr)
        for each in refused:
            warn(each)
        return
    beside = target.resolve().parent == job.resolve().parent
    print(f'the job takes it with calibration = "{target.name if beside else target.resolve()}"')
