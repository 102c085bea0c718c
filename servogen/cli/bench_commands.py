"""Commands of the bench: flash, capture, rig."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servogen.cli.files import read_image, read_schedule
from servogen.cli.options import DeviceName, Json
from servogen.cli.show import as_json, progress, status, warn

if TYPE_CHECKING:
    from servogen.bench.planning import Plan, Wanted
    from servogen.bench.ports import Port as Line
    from servogen.bench.sump_client import Analyser, Seen
    from servogen.pic.image import Image
    from servogen.pulse import PulseSchedule

RATE = 1_000_000
SECONDS = 1.0
SLACK = 1.25
PATIENCE_S = 5.0
"""Beyond the time that the capture itself takes."""

Against = Annotated[
    Path | None,
    typer.Option("--against", help="The schedule.json: what is to be seen, and the servos' names."),
]


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
    device: DeviceName = "PIC16F84A",
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

    from servogen.bench.flash_checks import objections, remarks
    from servogen.bench.flashing import command_of
    from servogen.bench.flashing import flash as flashed
    from servogen.bench.programmers import Order, find
    from servogen.errors import InputError, Place
    from servogen.pic.device import device as device_named

    image = read_image(file)
    order = Order(file, device_named(device), port)
    found = find(programmer)
    command = shlex.join(command_of(found, order))
    against_it = (*objections(image), *_unproven(image, file, against))
    if against_it and not force:
        raise InputError("; ".join(against_it), Place(str(file)), "--force programs it all the same")
    for text in (*against_it, *remarks(image, order.device)):
        warn(text)
    if dry_run:
        if json:
            as_json({"command": list(command_of(found, order)), "programmer": found.programmer.name})
        else:
            print(command)
        return
    with status(f"programming with {found.programmer.name}"):
        done = flashed(found, order, image, timeout)
    how = "read back and compared" if done.compared else "verified by the programmer"
    if not done.compared and not found.programmer.verifies:
        how = "programmed; this programmer does not show that it compared: capture and verify"
    if json:
        as_json({"programmer": found.programmer.name, "words": image.words, "compared": done.compared})
        return
    print(f"{file}: {image.words} words on the {order.device.name}, {how}")


def _unproven(image: Image, file: Path, against: Path | None) -> tuple[str, ...]:
    """Why the image is not the schedule's; nothing where there is no schedule to hold it against."""
    from servogen.pipeline import checked_cycles, prove, running

    beside = file.parent / "schedule.json"
    path = against or (beside if beside.exists() else None)
    if path is None:
        return ()
    schedule = read_schedule(path)
    span = checked_cycles(schedule)
    verdict = prove(schedule, running(schedule, image, span), span)
    return () if verdict.proven else (f"its pulses are not those of {path}: {verdict.reasons[0]}",)


def capture(
    output: Annotated[Path, typer.Option("--output", "-o", help="The capture, a .vcd file.")],
    port: Annotated[
        str | None, typer.Option("--port", "-p", help="The analyser's port, as /dev/ttyACM0.")
    ] = None,
    sigrok: Annotated[
        str | None,
        typer.Option(
            "--sigrok", help="Look through sigrok-cli with this driver, as fx2lafw; -o is a .sr file."
        ),
    ] = None,
    against: Against = None,
    seconds: Annotated[
        float | None,
        typer.Option("--seconds", min=0.001, help="How long (default: the loop of --against once, or 1 s)."),
    ] = None,
    rate: Annotated[int, typer.Option("--rate", min=1, help="Samples a second.")] = RATE,
    rle: Annotated[bool, typer.Option("--rle/--no-rle", help="Let the analyser count equal samples.")] = True,
    memory: Annotated[
        int | None, typer.Option("--memory", min=8, help="Its bytes of memory, if it does not say them.")
    ] = None,
    trigger: Annotated[
        str | None, typer.Option("--trigger", help="Begin when this pin rises (default: the first servo's).")
    ] = None,
    wire: Annotated[
        list[str] | None,
        typer.Option(
            "--wire", help="CHANNEL=PIN, as 0=RB3 (default: 0 to 7 RB0 to RB7, 8 to 12 RA0 to RA4)."
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Look at the chip's pins with a logic analyser that speaks SUMP (Logic Sniffer, Bus Pirate, …)."""
    from servogen.bench.looking import check_name, edges, write_capture
    from servogen.bench.planning import plan
    from servogen.bench.ports import open_port
    from servogen.bench.sump_client import BAUD, identify
    from servogen.bench.wires import channel_of, wires
    from servogen.errors import InputError, Place, ToolError

    schedule = None if against is None else read_schedule(against)
    wanted = _wanted(schedule, seconds)
    if sigrok is not None:
        _look_by_sigrok(sigrok, rate, wanted, wire or [], rle, output, against)
        return
    if port is None:
        raise InputError("there is no analyser to look with", hint="--port /dev/ttyACM0, or --sigrok fx2lafw")
    check_name(output)
    wired = wires(wire or ())
    pin = trigger or (schedule.channels[0].pin if schedule else "RB0")
    channel = channel_of(pin, wired)
    with open_port(port, BAUD) as line:
        device = identify(line)
        planned = plan(memory or device.memory, min(rate, device.fastest or rate), rle, wanted)
        seen = _look(line, planned, channel)
    servos = {each.pin: each.name for each in schedule.channels} if schedule else {}
    chunk = edges(seen.runs, wired)
    path = write_capture(output, int(planned.rate), chunk, seen.runs.end, servos, seen.missing)
    if seen.missing is not None:
        raise ToolError(seen.missing, Place(port), f"what came is kept, marked as not whole, in {path}")
    _tell(device, planned, seen, output, against, json)


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
    serial_pin: Annotated[str, typer.Option("--serial-pin", help="Where the serial line ends.")] = "RB7",
    baud: Annotated[int, typer.Option("--baud", min=50, help="Of the serial line.")] = 2400,
    inverted: Annotated[bool, typer.Option("--inverted", help="The serial line idles low.")] = False,
    json: Json = False,
) -> None:
    """Be a bench: programmer, analyser and serial line on pseudo-terminals, around the simulated chip."""
    import signal
    import threading
    from fractions import Fraction

    from servogen.bench.virtual.analyser import AnalyserOptions
    from servogen.bench.virtual.rig import RigOptions, with_fault
    from servogen.bench.virtual.rig import rig as opened
    from servogen.job import load
    from servogen.pipeline.proof import board_of
    from servogen.pulse.plan import plan
    from servogen.simulator.sources import pin_number

    options = RigOptions(
        Fraction(crystal_ppm),
        real_time,
        pin_number(serial_pin),
        baud,
        inverted,
        AnalyserOptions(memory=memory, fastest=fastest, glitches_per_s=glitches),
    )
    for text in fault or ():
        options = with_fault(options, text)
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())
    loaded = load(job)
    schedule = plan(loaded.trajectory, loaded.servos, loaded.frame).schedule
    if hex_file is None:
        from servogen.pipeline import build as built

        with status(f"{loaded.name}: planning") as tell:
            image = built(loaded, lambda step: tell(f"{loaded.name}: {step}")).programs[0].image
    else:
        image = read_image(hex_file)
    with opened(image, loaded.clock, board_of(schedule), options) as terminals:
        if json:
            as_json(terminals.paths)
        else:
            for name, path in terminals.paths.items():
                print(f"{name}: {path}")
            print("end it with Ctrl-C")
        sys.stdout.flush()
        terminals.serve(ended.is_set)


def _wanted(schedule: PulseSchedule | None, seconds: float | None) -> Wanted:
    """What is to be seen: by default the whole loop of the schedule."""
    from fractions import Fraction
    from math import ceil

    from servogen.bench.planning import FEWEST_EDGES, USUAL_EDGES, USUAL_PERIOD_S, Wanted

    if schedule is None:
        frames = ceil(Fraction(seconds or SECONDS) / USUAL_PERIOD_S)
        return Wanted(USUAL_PERIOD_S, Fraction(USUAL_EDGES), frames, Fraction(FEWEST_EDGES), USUAL_EDGES)
    period = schedule.clock.seconds(schedule.period)
    moments = [
        (
            run.frames,
            len({time for each in run.pulses if each for time in (each.rise, each.rise + each.width)}),
        )
        for run in schedule.loop
    ]
    most = max(1, *(edges for _, edges in moments))
    mean = max(
        Fraction(1, 10), Fraction(sum(frames * edges for frames, edges in moments), schedule.loop_frames)
    )
    if seconds is None:
        return Wanted(period, mean, schedule.loop_frames, mean, most)
    return Wanted(period, Fraction(most), ceil(Fraction(seconds) / period), mean, most)


def _look_by_sigrok(
    driver: str, rate: int, wanted: Wanted, wire: list[str], rle: bool, output: Path, against: Path | None
) -> None:
    """A frame more than is wanted: sigrok begins anywhere."""
    from math import ceil

    from servogen.bench.sigrok import SigrokLook, sigrok_wires
    from servogen.bench.sigrok import capture as captured

    samples = ceil(rate * (wanted.frames + 1) * wanted.period_s)
    counts = rle and driver.partition(":")[0] == "ols"  # the one driver that has it
    look = SigrokLook(driver, rate, samples, sigrok_wires(wire), counts)
    with status("sigrok-cli is looking"):
        captured(look, output)
    print(f"{output}: {samples / rate:g} s at {rate} samples a second")
    if against is not None:
        print(f"next: servogen verify {output} --against {against}")


def _look(line: Line, planned: Plan, channel: int) -> Seen:
    from servogen.bench.sump_client import Look
    from servogen.bench.sump_client import capture as captured

    patience = SLACK * float(planned.seconds) + PATIENCE_S
    look = Look(planned.rate, planned.words, planned.rle, channel, patience)
    with progress("capture", planned.words) as done:
        return captured(line, look, done)


def _tell(
    device: Analyser, planned: Plan, seen: Seen, output: Path, against: Path | None, json: bool
) -> None:
    seconds = seen.runs.end / float(planned.rate)
    if json:
        as_json(
            {
                "file": str(output),
                "analyser": device.name,
                "memory_bytes": device.memory,
                "samples_per_second": int(planned.rate),
                "rle": planned.rle,
                "seconds": seconds,
            }
        )
        return
    print(f"{output}: {seconds:g} s at {int(planned.rate)} samples a second from {device.name}")
    if against is not None:
        print(f"next: servogen verify {output} --against {against}")
