"""Commands of the bench: flash, capture, rig."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servogen.cli.files import read_image
from servogen.cli.options import JobFile, Json
from servogen.cli.show import as_json, progress, status, warn
from servogen.errors import Diagnostic, InputError, Location
from servogen.programs import is_job, program_file, read_schedule
from servogen.units import counted

if TYPE_CHECKING:
    from contextlib import ExitStack

    from servogen.pic.image import Image
    from servogen.workflows import PlayedJob
    from servogen.workflows.capture import Captured


DEFAULT_RATE = 1_000_000


def register(app: typer.Typer) -> None:
    """Add the commands of this module to the application."""
    app.command()(flash)
    app.command()(capture)
    app.command()(rig)


def flash(
    file: Annotated[
        Path, typer.Argument(help="The HEX file to program, or the folder of a build.", show_default=False)
    ],
    programmer: Annotated[
        str | None,
        typer.Option(
            "--programmer",
            help="picpro, pk2cmd, ipecmd, pickit3, usbpicprog, picprog or a path (default: the first found).",
        ),
    ] = None,
    port: Annotated[str | None, typer.Option("--port", "-p", help="The programmer's serial port.")] = None,
    device: Annotated[
        str | None,
        typer.Option(
            "--device", help="The chip: PIC16F84 or PIC16F84A (default: what the program was built for)."
        ),
    ] = None,
    against: Annotated[
        Path | None,
        typer.Option("--against", help="The schedule to compare it with (default: the one beside it)."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Program the chip even if the checks fail.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print the command without running it.")] = False,
    timeout: Annotated[float, typer.Option("--timeout", min=1, help="Seconds to wait for the chip.")] = 120.0,
    json: Json = False,
) -> None:
    """Compare a program's pulses with their schedule, program a chip, and check that it was programmed."""
    from servogen.bench.programmers.flash import command_of
    from servogen.bench.programmers.flash import flash as flashed
    from servogen.bench.programmers.table import ProgrammingRequest, find
    from servogen.workflows.flashing import check, schedule_beside

    if is_job(file):
        hint = f"build it, then flash its folder: servogen build {file}"
        raise InputError(
            "no-program", "is a job, and a programmer takes a HEX file", Location(str(file)), hint
        )
    file = program_file(file)
    image = read_image(file)
    path = against or schedule_beside(file)
    checked = check(file, image, device, path, read_schedule(path) if path else None)
    order = ProgrammingRequest(file, checked.device, port)
    installed = find(programmer)
    command = command_of(installed, order)
    for warning in checked.warnings(force):
        warn(warning)
    if dry_run:
        if json:
            as_json({"command": list(command), "programmer": installed.programmer.name})
        else:
            print(shlex.join(command))
        return
    with status(f"programming with {installed.programmer.name}"):
        outcome = flashed(installed, order, image, timeout)
    if outcome.compared:
        how = f"read back and compared: {', '.join(outcome.compared)}"
    elif installed.programmer.verifies:
        how = "verified by the programmer, not read back"
    else:
        how = "programmed; this programmer does not show that it compared: capture and verify"
    if json:
        as_json(
            {
                "programmer": installed.programmer.name,
                "words": image.words,
                "compared": list(outcome.compared),
            }
        )
        return
    print(f"{file}: {image.words} words on the {order.device.name}, {how}")


def rig(
    job: JobFile,
    hex_file: Annotated[
        Path | None, typer.Option("--hex", help="The program on the chip at the start (default: the job's).")
    ] = None,
    crystal_ppm: Annotated[
        float,
        typer.Option("--crystal-ppm", help="Error of the chip's crystal in ppm; positive if it is fast."),
    ] = 0.0,
    memory: Annotated[int, typer.Option("--memory", min=16, help="The analyser's memory in bytes.")] = 24
    * 1024,
    fastest: Annotated[
        int, typer.Option("--rate", min=1, help="The analyser's maximum sampling rate in Hz.")
    ] = 10**8,
    glitches: Annotated[float, typer.Option("--noise", min=0, help="Wrong samples per second.")] = 0.0,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            "--fault", help="A fault, such as analyser:unplug-after=500 or programmer:silent (repeatable)."
        ),
    ] = None,
    real_time: Annotated[
        bool, typer.Option("--real-time", help="Run the chip in real time, not as fast as possible.")
    ] = False,
    serial_pin: Annotated[
        str | None,
        typer.Option(
            "--serial-pin", help="The pin that receives the serial line (default: the job's, or RB7)."
        ),
    ] = None,
    serial_out: Annotated[
        str | None,
        typer.Option("--serial-out", help="The pin on which the chip sends (default: the job's, or none)."),
    ] = None,
    baud: Annotated[
        int | None,
        typer.Option("--baud", min=50, help="Baud rate of the serial line (default: the job's, or 2400)."),
    ] = None,
    inverted: Annotated[bool, typer.Option("--inverted", help="The serial line idles low.")] = False,
    inputs: Annotated[
        list[str] | None,
        typer.Option(
            "--input",
            help="How the input board is wired, such as RB0=2, RB0-RB4=22 or RA1=TX1 (repeatable).",
        ),
    ] = None,
    scheduler: Annotated[
        bool,
        typer.Option(
            "--scheduler/--no-scheduler",
            help="Whether the input board runs ConfigurableFirmata, with its scheduler, or StandardFirmata.",
        ),
    ] = True,
    json: Json = False,
) -> None:
    """Simulate a bench: a chip with programmer, analyser, input board and serial line on pseudo-terminals."""
    import signal
    import threading
    from contextlib import ExitStack
    from fractions import Fraction

    from servogen.bench.inputs.wiring import input_wiring
    from servogen.bench.virtual.analyser import AnalyserOptions
    from servogen.bench.virtual.board import BoardOptions
    from servogen.bench.virtual.rig import RigOptions, with_fault
    from servogen.bench.virtual.rig import rig as opened
    from servogen.drive.on_command import line_baud
    from servogen.engines.board import board_of
    from servogen.engines.inputs.commands import CommandLine
    from servogen.engines.inputs.serial import Stream
    from servogen.job import load, plan_job
    from servogen.simulator.sources import pin_number
    from servogen.workflows import planned

    loaded = plan_job(load(job))
    line = loaded.stream or Stream(receive_pin="RB7")
    if isinstance(loaded.commands, CommandLine):
        line = Stream(line_baud(loaded), loaded.commands.pin)
    out = serial_out or line.transmit_pin
    options = RigOptions(
        ppm=Fraction(str(crystal_ppm)),
        real_time=real_time,
        serial_pin=pin_number(serial_pin or line.receive_pin),
        serial_out=pin_number(out) if out else None,
        baud=baud or line.baud,
        inverted=inverted,
        analyser=AnalyserOptions(memory=memory, fastest=fastest, glitches_per_s=glitches),
        board=BoardOptions(scheduler),
        inputs=input_wiring(inputs or ()),
    )
    for text in fault or ():
        options = with_fault(options, text)
    with status(f"{loaded.name}: planning and compiling"):
        played = planned(loaded)
        image = read_image(hex_file) if hex_file else _image(played)
    schedule = played.plan.schedule
    levels = {pin_number(source.pin): source.level for source in schedule.inputs}
    levels.pop(options.serial_pin, None)
    ended = threading.Event()
    with ExitStack() as stack:
        terminals = stack.enter_context(opened(image, loaded.clock, board_of(schedule), options, levels))
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


def _image(played: PlayedJob) -> Image:
    return played.make(played.job.firmware.dialect).compilation.image


def _tell_sigrok(stack: ExitStack, port: str) -> None:
    """Print how to run sigrok-cli, if installed, on the analyser; keep its library while the bench runs."""
    import shutil

    from servogen.bench.analysers.sigrok import PROGRAM, c_compiler, modem_lines_library

    if shutil.which(PROGRAM) and c_compiler():
        lines = stack.enter_context(modem_lines_library())
        print(f"sigrok: LD_PRELOAD={lines} {PROGRAM} --driver ols:conn={port}")


def capture(
    output: Annotated[Path, typer.Option("--output", "-o", help="The capture to write (.vcd).")],
    port: Annotated[
        str | None, typer.Option("--port", "-p", help="The analyser's serial port, such as /dev/ttyACM0.")
    ] = None,
    sigrok: Annotated[
        str | None,
        typer.Option(
            "--sigrok", help="Capture through sigrok-cli with this driver, such as fx2lafw, to a .sr file."
        ),
    ] = None,
    against: Annotated[
        Path | None,
        typer.Option(
            "--against",
            help="The schedule.json that the program follows: it names the servos and sets the duration.",
        ),
    ] = None,
    seconds: Annotated[
        float | None,
        typer.Option("--seconds", min=0.001, help="Duration (default: one loop of --against, or 1 s)."),
    ] = None,
    rate: Annotated[
        int | None,
        typer.Option(
            "--rate", min=1, help="Sampling rate in Hz (default: 1 MHz; with --sigrok less if it has to fit)."
        ),
    ] = None,
    rle: Annotated[
        bool,
        typer.Option("--rle/--no-rle", help="Let the analyser compress equal samples (run-length encoding)."),
    ] = True,
    memory: Annotated[
        int | None,
        typer.Option("--memory", min=8, help="The analyser's memory in bytes, if it does not report it."),
    ] = None,
    trigger: Annotated[
        str | None, typer.Option("--trigger", help="Start when this pin rises (default: the first servo's).")
    ] = None,
    wire: Annotated[
        list[str] | None,
        typer.Option(
            "--wire",
            help="CHANNEL=PIN, such as 0=RB3 (default: 0 to 7 are RB0 to RB7, 8 to 12 are RA0 to RA4).",
        ),
    ] = None,
    stitch: Annotated[
        bool,
        typer.Option(
            "--stitch/--no-stitch",
            help="With --against: join several captures of whole frames if one is too short.",
        ),
    ] = True,
    json: Json = False,
) -> None:
    """Record the chip's pins with a logic analyser that speaks SUMP (Logic Sniffer, Bus Pirate, …)."""
    from servogen.workflows.capture import CaptureSettings, capture_by_sigrok
    from servogen.workflows.capture import capture as captured

    schedule = None if against is None else read_schedule(against)
    looking = CaptureSettings(
        rate=rate or DEFAULT_RATE,
        fixed_rate=rate is not None,
        rle=rle,
        memory=memory,
        trigger=trigger,
        wire=wire or (),
        stitch=stitch,
    )
    if sigrok is not None:
        with status("capturing with sigrok-cli"):
            seen = capture_by_sigrok(output, sigrok, schedule, seconds, looking)
        if seen.shortage is not None:
            hint = "an analyser with more memory, fewer channels or a lower --rate"
            warn(Diagnostic("warning", "short-capture", seen.shortage, Location(str(output)), hint))
        if json:
            as_json(seen.to_json())
            return
        print(f"{output}: {seen.seconds:g} s at {int(seen.rate)} samples a second")
        _suggest_verify(output, against)
        return
    if port is None:
        raise InputError(
            "missing-option",
            "no analyser is given",
            hint="--port /dev/ttyACM0, or --sigrok fx2lafw",
        )
    recorded = captured(output, port, schedule, seconds, looking, progress)
    if recorded.seen.unseen and seconds is None:
        looks = len(recorded.seen.records)
        text = (
            f"{recorded.seen.unseen} of the loop's different frames were not seen whole in {looks} captures"
        )
        warn(Diagnostic("warning", "frames-unseen", text, Location(str(output))))
    _show_capture(recorded, output, against, json)


def _show_capture(recorded: Captured, output: Path, against: Path | None, json: bool) -> None:
    if json:
        as_json(recorded.to_json())
        return
    print(
        f"{output}: {recorded.seconds:g} s at {int(recorded.plan.rate)} samples a second "
        f"from {recorded.analyser.name}"
    )
    if recorded.captures > 1:
        print(
            f"stitched from {recorded.captures} captures, because one holds "
            f"{counted(recorded.plan.frames, 'frame')}; the time between two is not known"
        )
    _suggest_verify(output, against)


def _suggest_verify(output: Path, against: Path | None) -> None:
    if against is not None:
        print(f"next: servogen verify {output} --against {against}")
