"""`servogen calibrate`: fits a servo's line to the angles that are read."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from servogen.cli.drive_line import Baud, First, Port, RangeUs
from servogen.cli.options import JobFile, Json
from servogen.cli.show import as_json, next_step, print_lines, table, warn
from servogen.drive.commands import QUIT, LineCommands
from servogen.drive.controller import ControllerChannel, job_controller
from servogen.drive.serial_link import NullWire, SerialLink, Time, VirtualTime, port_opener
from servogen.drive.sweep import Ask, Sweep, ask_from, positions, refusals, servo_index, sweep_readings
from servogen.errors import Diagnostic, InputError
from servogen.job import Job, load
from servogen.report.calibration_plot import calibration_plot
from servogen.robot.calibration import (
    Fit,
    Reading,
    angle_of,
    angles_of,
    calibration_text,
    fit,
    read_csv,
    write_calibration,
)
from servogen.robot.servo import Servo

TOLERANCE_DEG, WHEEL_TOLERANCE_DEG = 5.0, 20.0
"""The allowed distance of a reading from the fitted line: an angle in °, a wheel's speed in °/s."""


@dataclass(frozen=True, slots=True)
class SweepOptions:
    """How the servo is moved, and where the angles come from."""

    servo: Annotated[str | None, "The servo to calibrate (default: the job's only one)."] = None
    port: Port = None
    from_us: Annotated[float | None, "The shortest pulse, µs (default: the servo's limit)."] = None
    to_us: Annotated[float | None, "The longest pulse, µs (default: the servo's limit)."] = None
    points: Annotated[int, typer.Option(min=3, max=100, help="Number of pulse widths.")] = 7
    angles: Annotated[
        str | None,
        typer.Option(
            "--angles-deg", help="The angles seen, such as 0,45,90, instead of asking for them (wheels: °/s)."
        ),
    ] = None
    readings: Annotated[
        Path | None, "A CSV file of readings, width_us,angle_deg, instead of moving the servo."
    ] = None
    baud: Baud = None
    range_us: RangeUs = None
    first: First = 0


def calibrate(
    job: JobFile,
    sweep: SweepOptions,
    tolerance_deg: Annotated[
        float | None,
        typer.Option(min=0.1, help="How far a reading may be from the line (default: 5; wheels: 20)."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="The file to write (default: SERVO.calibration.toml)."),
    ] = None,
    plot: Annotated[Path | None, "Draw a picture of the fit: .png, .svg or .pdf."] = None,
    json: Json = False,
) -> None:
    """Move one servo through its range, fit a line, or one with a bend, to what you read, and write it."""
    loaded = load(job)
    index = servo_index(loaded, sweep.servo)
    chosen = loaded.servos[index]
    target = output or job.parent / f"{chosen.name}.calibration.toml"
    if sweep.readings is not None:
        if sweep.angles is not None:
            raise InputError("conflicting-options", "--readings has the angles already: take one of the two")
        readings = read_csv(sweep.readings, chosen.model.continuous)
    else:
        readings = _sweep_readings(
            loaded,
            index,
            (sweep.from_us, sweep.to_us, sweep.points),
            sweep.angles,
            sweep.port,
            (sweep.baud, sweep.range_us, sweep.first),
        )
    usual = WHEEL_TOLERANCE_DEG if chosen.model.continuous else TOLERANCE_DEG
    fitted = fit(readings, math.radians(tolerance_deg or usual), chosen.model.continuous)
    previous = write_calibration(target, calibration_text(fitted, chosen))
    if plot is not None:
        calibration_plot(fitted, chosen, plot)
    refused = refusals(loaded, chosen.name, target)
    _show_calibration(job, chosen, fitted, (target, previous), refused, json)
    if refused:
        raise typer.Exit(1)


def _sweep_readings(
    job: Job,
    index: int,
    span: tuple[float | None, float | None, int],
    angles: str | None,
    port: str | None,
    settings: tuple[int | None, str | None, int],
) -> Sequence[Reading]:
    """Move the servo and return the angles that were read; without a port, show only the widths."""
    if port is None and angles is None:
        raise InputError(
            "missing-option",
            "no serial port is given",
            hint="--port /dev/ttyUSB0, or --readings FILE.csv",
        )
    speed, controller = job_controller(job, *settings)
    channel = controller.channels[index]
    stops = positions(channel, *span)
    ask = angle_question(channel, len(stops)) if angles is None else ask_from(angles_of(angles), stops)
    time = VirtualTime().time() if port is None else Time()
    opener = (lambda: nullcontext(NullWire())) if port is None else port_opener(port, speed)
    with SerialLink(opener, speed, time, 0.0) as line:
        return sweep_readings(controller, index, stops, line, time, ask)


def angle_question(channel: ControllerChannel, count: int) -> Ask:
    """Return a function that asks on the terminal until it gets a number."""
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
                "bend_us": fitted.bent.bend_us if fitted.bent else 0.0,
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
    table(f"{servo.name}, {servo.model.title}", ("width µs", f"seen {unit}", f"off the fit {unit}"), rows)
    print(
        f"width = {fitted.zero_us:.1f} µs {slope:+z.4f} µs/{unit}; "
        f"rms {rms:.2f}{unit}, worst {worst:+z.2f}{unit}"
    )
    if fitted.bent is not None:
        middle = fitted.bent.points[1]
        print_lines(
            [
                f"the readings bend at {middle.width_us:.1f} µs, {math.degrees(middle.angle):z.1f}{unit}, "
                f"{fitted.bent.bend_us:.1f} µs off a straight line: the file has three points"
            ]
        )
    print(f"{target}: written" + (f"; {previous} is the file that was there" if previous else ""))
    if refused:
        print("with this calibration the job's motion is not possible:", file=sys.stderr)
        for warning in refused:
            warn(warning)
        return
    beside = target.resolve().parent == job.resolve().parent
    print(f'add to the servo in the job: calibration = "{target.name if beside else target.resolve()}"')
    print(next_step("check", job))
