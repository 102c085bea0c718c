"""The command `watch`: a job, a program or a capture in a browser."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from servogen.cli.options import (
    ChipOptions,
    ClockHz,
    OpensBrowser,
    OwnDevice,
    RecordedWires,
    ServerPort,
    StimulusFile,
    takes_chip_options,
)
from servogen.cli.page_server import require_server, serve_until_ctrl_c
from servogen.cli.show import warn
from servogen.errors import Diagnostic, InputError, Location

MAX_BEGIN = 48 * 3600 * 5_000_000
"""The maximum of --at-cycle: two days at 20 MHz."""


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command()(takes_chip_options(watch))


def watch(
    file: Annotated[
        Path,
        typer.Argument(help="A job (.toml), a program (.hex, .c, .asm) or a capture.", show_default=False),
    ],
    chip: ChipOptions,
    against: Annotated[
        Path | None,
        typer.Option(
            "--against",
            help="The schedule.json or the job (.toml) to compare a program or a capture with; with "
            "a job, the page also shows the robot.",
        ),
    ] = None,
    at_cycle: Annotated[
        int,
        typer.Option(
            "--at-cycle",
            min=0,
            max=MAX_BEGIN,
            help="The moment to start at, in instruction cycles since power-up.",
        ),
    ] = 0,
    stimulus: StimulusFile = None,
    robot: Annotated[
        str | None,
        typer.Option(
            "--robot", help="The serial port of a real robot, which the sliders of a stream job move too."
        ),
    ] = None,
    port: ServerPort = 0,
    browser: OpensBrowser = True,
    clock_hz: ClockHz = None,
    wire: RecordedWires = None,
    device: OwnDevice = None,
) -> None:
    """Show a job, a program or a capture in the browser: robot, chip and waves, forwards and backwards.

    It prints the address of the page, which only this machine can open, and runs until Ctrl-C.
    """
    require_server()
    from servogen.drive.serial_link import port_opener
    from servogen.job import load
    from servogen.programs import DEFAULT_DEVICE, is_job, program_file, read_schedule
    from servogen.traces.captures import SUFFIXES as CAPTURE_SUFFIXES
    from servogen.watch.editing import Editor
    from servogen.watch.live_line import LiveLine
    from servogen.watch.server import Room, WatchServer
    from servogen.watch.subject import Setting, check, load_subject
    from servogen.workflows.signals import chosen_device, device_for, wires_for

    check(file)
    watches_job = is_job(file)
    if against is not None and watches_job:
        raise InputError(
            "conflicting-options",
            "a job is compared with its own schedule",
            Location(str(file), key="--against"),
        )
    by_job = against is not None and is_job(against)
    schedule = read_schedule(against) if against and not by_job else None
    if schedule is not None and against is not None:
        device_for(schedule, against, device)
    job_file = file if watches_job else against if by_job else None
    job = None if job_file is None else load(job_file)
    if job is not None and job_file is not None:
        chosen_device(job.device, job_file, device)
    setting = Setting(
        options=chip.on(device or DEFAULT_DEVICE),
        clock_hz=clock_hz,
        stimulus=stimulus,
        schedule=schedule,
        job=against if by_job else None,
        at_cycle=at_cycle,
        device=device,
        wires=wires_for(file, wire),
    )
    stream = job.stream if job is not None and watches_job else None
    if robot is not None and stream is None:
        raise InputError(
            "conflicting-options",
            "only a job with [stream] moves a robot live",
            Location(str(file), key="--robot"),
        )

    if job is not None and job.sensors and program_file(file).suffix.lower() not in CAPTURE_SUFFIXES:
        pins = ", ".join(sensor.pin for sensor in job.sensors)
        text = f"the job's sensors are not connected to the chip of the page, which reads {pins} as open pins"
        hint = "drive the pins on the page; servogen twin connects the sensors to the bodies"
        warn(Diagnostic("note", "sensors-open", text, Location(str(job_file)), hint))
    with ExitStack() as open_until_the_end:
        live = None
        if robot is not None and stream is not None:
            live = LiveLine(open_until_the_end.enter_context(port_opener(robot, stream.baud)()))
            open_until_the_end.callback(live.close)
        room = Room(
            lambda progress: load_subject(file, setting, progress),
            Editor(file, setting) if watches_job else None,
            live,
        )
        serve_until_ctrl_c(WatchServer({"": room}), file.name, port, browser)
