"""Commands of the bench: flash, capture, rig."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servogen.cli.capture_command import capture
from servogen.cli.files import read_image
from servogen.cli.options import Json
from servogen.cli.show import as_json, status, warn
from servogen.errors import Diagnostic
from servogen.programs import read_schedule

if TYPE_CHECKING:
    from contextlib import ExitStack

    from servogen.build import Planned
    from servogen.pic.image import Image
    from servogen.pulse import PulseSchedule


def register(app: typer.Typer) -> None:
    app.command()(flash)
    app.command()(capture)
    app.command()(rig)


def flash(
    file: Annotated[Path, typer.Argument(help="The HEX file.", show_default=False)],
    programmer: Annotated[
        str | None,
        typer.Option("--programmer", help="picpro, pk2cmd, ipecmd, pickit3, usbpicprog, picprog, or a path."),
    ] = None,
    port: Annotated[str | None, typer.Option("--port", "-p", help="The programmer's serial port.")] = None,
    device: Annotated[
        str | None,
        typer.Option("--device", help="PIC16F84 or PIC16F84A (default: what the program was built for)."),
    ] = None,
    against: Annotated[
        Path | None,
        typer.Option(
            "--against", help="The schedule that it must be proven for (default: the one beside it)."
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Program it whatever speaks against it.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Show the command and do nothing.")] = False,
    timeout: Annotated[float, typer.Option("--timeout", min=1, help="Seconds to wait for the chip.")] = 120.0,
    json: Json = False,
) -> None:
    """Program a chip, after proving its pulses, and believe only what shows that it worked."""
    import shlex

    from servogen.bench.programmers.flash import command_of, objections, remarks
    from servogen.bench.programmers.flash import flash as flashed
    from servogen.bench.programmers.table import Order, find
    from servogen.errors import InputError, Location
    from servogen.pic.device import device as device_named

    image = read_image(file)
    path = against or _beside(file)
    schedule = read_schedule(path) if path else None
    chip, wrong_chip = _chip(file, device, schedule)
    order = Order(file, device_named(chip), port)
    found = find(programmer)
    command = shlex.join(command_of(found, order))
    against_it = (*objections(image), *wrong_chip, *_unproven(image, path, schedule))
    if against_it and not force:
        raise InputError.of(replace(each, location=Location(str(file)), hint=FORCE) for each in against_it)
    for each in (*against_it, *remarks(image, order.device)):
        warn(replace(each, severity="warning", location=Location(str(file))))
    if dry_run:
        if json:
            as_json({"command": list(command_of(found, order)), "programmer": found.programmer.name})
        else:
            print(command)
        return
    with status(f"programming with {found.programmer.name}"):
        done = flashed(found, order, image, timeout)
    if done.compared:
        how = f"read back and compared: {', '.join(done.compared)}"
    elif found.programmer.verifies:
        how = "verified by the programmer, not read back"
    else:
        how = "programmed; this programmer does not show that it compared: capture and verify"
    if json:
        as_json({"programmer": found.programmer.name, "words": image.words, "compared": list(done.compared)})
        return
    print(f"{file}: {image.words} words on the {order.device.name}, {how}")


FORCE = "--force programs it all the same"


def _beside(file: Path) -> Path | None:
    """The schedule that a build left beside the image."""
    path = file.parent / "schedule.json"
    return path if path.exists() else None


def _chip(
    file: Path, asked: str | None, schedule: PulseSchedule | None
) -> tuple[str, tuple[Diagnostic, ...]]:
    """Return the device's name, and what speaks against it. Raises InputError where nothing names one."""
    from servogen.errors import InputError, Location
    from servogen.pic.device import device

    built = schedule.device if schedule else None
    if asked is None and built is None:
        raise InputError(
            "missing-option",
            "nothing says which chip it is for",
            Location(str(file)),
            "add --device PIC16F84 or --device PIC16F84A; a schedule.json that servogen built names it",
        )
    if asked is None or built is None or device(asked) == device(built):
        return asked or built or "", ()
    text = f"it was built for a {device(built).name}, --device is {device(asked).name}"
    return asked, (Diagnostic("error", "wrong-chip", text),)


def _unproven(image: Image, path: Path | None, schedule: PulseSchedule | None) -> tuple[Diagnostic, ...]:
    """Return why nothing shows that the image's pulses are the schedule's; empty where they are."""
    from servogen.build import prove_image

    if schedule is None:
        text = "there is no schedule.json beside it: nothing shows what its pulses are (--against)"
        return (Diagnostic("error", "not-proven", text),)
    verdict = prove_image(schedule, image)
    if verdict.proven:
        return ()
    text = f"its pulses are not proven to be those of {path}: {verdict.reasons[0]}"
    return (Diagnostic("error", "not-proven", text),)


def rig(
    job: Annotated[Path, typer.Argument(help="A job file (TOML).", show_default=False)],
    hex_file: Annotated[
        Path | None, typer.Option("--hex", help="Start with this program on the chip, not with the job's.")
    ] = None,
    crystal_ppm: Annotated[
        float, typer.Option("--crystal-ppm", help="By how much the chip's crystal is too fast.")
    ] = 0.0,
    memory: Annotated[int, typer.Option("--memory", min=16, help="The analyser's bytes.")] = 24 * 1024,
    fastest: Annotated[int, typer.Option("--rate", min=1, help="The analyser's most samples a second.")] = 10
    ** 8,
    glitches: Annotated[float, typer.Option("--noise", min=0, help="Wrong samples a second.")] = 0.0,
    fault: Annotated[
        list[str] | None, typer.Option("--fault", help="As analyser:unplug-after=500 or programmer:silent.")
    ] = None,
    real_time: Annotated[
        bool, typer.Option("--real-time", help="The chip's time is the clock's, not as fast as it can.")
    ] = False,
    serial_pin: Annotated[
        str | None,
        typer.Option("--serial-pin", help="Where the serial line ends (default: the job's, or RB7)."),
    ] = None,
    serial_out: Annotated[
        str | None,
        typer.Option("--serial-out", help="The pin on which the chip sends (default: the job's, or none)."),
    ] = None,
    baud: Annotated[
        int | None, typer.Option("--baud", min=50, help="Of the serial line (default: the job's, or 2400).")
    ] = None,
    inverted: Annotated[bool, typer.Option("--inverted", help="The serial line idles low.")] = False,
    json: Json = False,
) -> None:
    """Be a bench: programmer, analyser and serial line on pseudo-terminals, around the simulated chip."""
    import signal
    import threading
    from contextlib import ExitStack
    from fractions import Fraction

    from servogen.bench.virtual.analyser import AnalyserOptions
    from servogen.bench.virtual.rig import RigOptions, with_fault
    from servogen.bench.virtual.rig import rig as opened
    from servogen.build import planned
    from servogen.engines.board import board_of
    from servogen.engines.stream.settings import Stream
    from servogen.job import load, plan_job
    from servogen.simulator.sources import pin_number

    loaded = plan_job(load(job))
    line = loaded.stream or Stream(receive_pin="RB7")
    out = serial_out or line.transmit_pin
    options = RigOptions(
        Fraction(str(crystal_ppm)),
        real_time,
        pin_number(serial_pin or line.receive_pin),
        pin_number(out) if out else None,
        baud or line.baud,
        inverted,
        AnalyserOptions(memory=memory, fastest=fastest, glitches_per_s=glitches),
    )
    for text in fault or ():
        options = with_fault(options, text)
    with status(f"{loaded.name}: planning and compiling"):
        found = planned(loaded)
        image = read_image(hex_file) if hex_file else _image(found)
    schedule = found.plan.schedule
    held = {pin_number(each.pin): each.level for each in schedule.inputs}
    ended = threading.Event()
    with ExitStack() as stack:
        terminals = stack.enter_context(opened(image, loaded.clock, board_of(schedule), options, held))
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, lambda *_: ended.set())
        if json:
            as_json(terminals.paths)
        else:
            for name, path in terminals.paths.items():
                print(f"{name}: {path}")
            _tell_sigrok(stack, terminals.paths["analyser"])
            print("end it with Ctrl-C")
        sys.stdout.flush()
        terminals.serve(ended.is_set)


def _image(found: Planned) -> Image:
    return found.make(found.job.firmware.dialect).compilation.image


def _tell_sigrok(stack: ExitStack, port: str) -> None:
    """How sigrok-cli, where it is installed, is called on the analyser, for as long as the bench is there."""
    import shutil

    from servogen.bench.analysers.sigrok import PROGRAM
    from servogen.bench.ports import compiler, library

    if shutil.which(PROGRAM) and compiler():
        lines = stack.enter_context(library())
        print(f"sigrok: LD_PRELOAD={lines} {PROGRAM} --driver ols:conn={port}")
