"""The drive of a robot that walks, or plays segments of its motion, on command: by keys, buttons or codes."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from contextlib import ExitStack

import typer

from servogen import INTERRUPTED
from servogen.cli.drive_line import WALK_KEYS_HELP, WireOptions, command_source, was_interrupted
from servogen.cli.show import as_json, json_line
from servogen.drive.commands import WALK_KEYS, Keys, segment_keys
from servogen.drive.on_command import CommandedDrive, CommandedFrame, Twin, line_baud
from servogen.drive.serial_link import SerialLink, Time, VirtualTime, port_opener
from servogen.engines.inputs.commands import CommandButton, CommandLine
from servogen.errors import InputError, Location
from servogen.job import PlannedJob


def drive_on_command(job: PlannedJob, wire: WireOptions, seconds: float | None, json: bool) -> None:
    """Steer a robot on command: the chip at the wire's port, or a simulated one."""
    if wire.port is not None and not isinstance(job.commands, CommandLine):
        raise InputError(
            "conflicting-options",
            "--port: the robot is commanded by buttons, not by codes",
            Location(job.file),
            "without --port, a simulated chip is steered",
        )
    single = sys.stdin.isatty() and not wire.dry_run
    port = None if wire.dry_run else wire.port
    time = Time() if single or port is not None else VirtualTime().time()
    rate = wire.baud or line_baud(job)
    with ExitStack() as stack:
        link = None
        if port is not None:
            link = stack.enter_context(SerialLink(port_opener(port, rate), rate, time, 0))
        if not json:
            where = f"{port}, {rate} baud" if link else "a simulated chip"
            widths = ", ".join(servo.name for servo in job.servos)
            print(f"{job.name}: {where}; widths of {widths}", flush=True)
        source = stack.enter_context(command_source(True, wire.dry_run, *_keys(job)))
        twin = Twin(job)
        drive = CommandedDrive(
            twin=twin, source=source, time=time, tell=_printer(single, json), link=link, single_keys=single
        )
        interrupted = was_interrupted(lambda: drive.run(math.inf if seconds is None else seconds))
    if single and not json:
        print()
    if json:
        as_json({"seconds": twin.seconds, "commands": drive.sent})
    else:
        print(f"{twin.seconds:.2f} s, {drive.sent} commands")
    if interrupted:
        raise typer.Exit(INTERRUPTED)


def _keys(job: PlannedJob) -> tuple[Keys, str]:
    """Return the keys of the directions or segments, and what to say of them."""
    names = [direction.name for direction in job.directions]
    if isinstance(job.commands, CommandButton) or all(name in WALK_KEYS for name in names):
        return WALK_KEYS, WALK_KEYS_HELP
    digits = ", ".join(f"{number} {name}" for number, name in enumerate(names, 1))
    return segment_keys(names), f"{digits}, space stops, q ends"


def _printer(single: bool, json: bool) -> Callable[[CommandedFrame], None]:
    """Return a function that shows a frame: each on one line where keys are typed, else what is new."""
    shown: tuple[object, ...] | None = None

    def tell(state: CommandedFrame) -> None:
        nonlocal shown
        new, shown = shown != (state.direction, state.part), (state.direction, state.part)
        if json and new:
            json_line(state.to_json())
        elif single and not json:
            print(f"\r{state.text()}", end="", flush=True)
        elif new and not json:
            print(state.text(), flush=True)

    return tell
