"""The command `watch`: a job, a program or a capture in a browser."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from servogen.cli.chip_options import ChipOptions
from servogen.cli.options import ClockHz, OpensBrowser, OwnDevice, RecordedWires, ServerPort, StimulusFile
from servogen.cli.page_server import require_server, serve_until_ctrl_c
from servogen.cli.show import warn
from servogen.drive.serial_link import port_opener
from servogen.errors import Diagnostic, InputError, Location
from servogen.job import Job, load
from servogen.programs import DEFAULT_DEVICE, is_job, program_file, read_schedule
from servogen.pulse import PulseSchedule
from servogen.traces.captures import SUFFIXES as CAPTURE_SUFFIXES
from servogen.watch.editing import Editor
from servogen.watch.live_line import LiveLine
from servogen.watch.server import Room, WatchServer
from servogen.watch.subject import Setting, check, load_subject
from servogen.workflows.signals import chosen_device, device_for, wires_for

MAX_BEGIN = 48 * 3600 * 5_000_000
"""The maximum of --at-cycle: two days at 20 MHz."""


@dataclass(frozen=True, slots=True)
class PageOptions:
    """What the page shows, and where it is."""

    at_cycle: Annotated[
        int,
        typer.Option(
            min=0, max=MAX_BEGIN, help="The moment to start at, in instruction cycles since power-up."
        ),
    ] = 0
    stimulus: StimulusFile = None
    robot: Annotated[
        str | None, "The serial port of a real robot, which the sliders of a stream job move too."
    ] = None
    port: ServerPort = 0
    browser: OpensBrowser = True


def watch(
    file: Annotated[
        Path,
        typer.Argument(help="A job (.toml), a program (.hex, .c, .asm) or a capture.", show_default=False),
    ],
    chip: ChipOptions,
    page: PageOptions,
    against: Annotated[
        Path | None,
        "The schedule.json or the job (.toml) to compare a program or a capture with; with "
        "a job, the page also shows the robot.",
    ] = None,
    clock_hz: ClockHz = None,
    wire: RecordedWires = None,
    device: OwnDevice = None,
) -> None:
    """Show a job, a program or a capture in the browser: robot, chip and waves, forwards and backwards.

    It prints the address of the page, which only this machine can open, and runs until Ctrl-C.
    """
    require_server()
    check(file)
    subject = _Subject.of(file, against, device)
    wires = wires_for(file, wire)
    setting = Setting(
        options=chip.on(device or DEFAULT_DEVICE),
        clock_hz=clock_hz,
        stimulus=page.stimulus,
        schedule=subject.schedule,
        job=against if subject.schedule is None else None,
        at_cycle=page.at_cycle,
        device=device,
        wires=wires,
    )
    stream = subject.job.stream if subject.job is not None and is_job(file) else None
    if page.robot is not None and stream is None:
        raise InputError(
            "conflicting-options",
            "only a job with [stream] moves a robot live",
            Location(str(file), key="--robot"),
        )
    subject.warn_of_sensors(file)
    with ExitStack() as open_until_the_end:
        live = None
        if page.robot is not None and stream is not None:
            live = LiveLine(open_until_the_end.enter_context(port_opener(page.robot, stream.baud)()))
            open_until_the_end.callback(live.close)
        room = Room(
            lambda progress: load_subject(file, setting, progress),
            Editor(file, setting) if is_job(file) else None,
            live,
        )
        serve_until_ctrl_c(WatchServer({"": room}), file.name, page.port, page.browser)


@dataclass(frozen=True, slots=True)
class _Subject:
    """What a file is watched with: the job that it is or is compared with, or a schedule."""

    job_file: Path | None
    job: Job | None
    schedule: PulseSchedule | None

    @staticmethod
    def of(file: Path, against: Path | None, device: str | None) -> _Subject:
        """Return what is watched. Raises InputError if it is for another chip, or compared with another."""
        if against is not None and is_job(file):
            raise InputError(
                "conflicting-options",
                "a job is compared with its own schedule",
                Location(str(file), key="--against"),
            )
        if against is not None and not is_job(against):
            schedule = read_schedule(against)
            device_for(schedule, against, device)
            return _Subject(None, None, schedule)
        job_file = file if is_job(file) else against
        job = None if job_file is None else load(job_file)
        if job is not None and job_file is not None:
            chosen_device(job.device, job_file, device)
        return _Subject(job_file, job, None)

    def warn_of_sensors(self, file: Path) -> None:
        """Say that nothing drives the sensors of the job whose program runs."""
        if self.job is None or not self.job.sensors or program_file(file).suffix.lower() in CAPTURE_SUFFIXES:
            return
        pins = ", ".join(sensor.pin for sensor in self.job.sensors)
        text = f"the job's sensors are not connected to the chip of the page, which reads {pins} as open pins"
        hint = "drive the pins on the page; servogen twin connects the sensors to the bodies"
        warn(Diagnostic("note", "sensors-open", text, Location(str(self.job_file)), hint))
