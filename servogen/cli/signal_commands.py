"""Commands of signals: verify, measure, plot."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servogen.cli.files import clock_of, keep_apart, read_program
from servogen.cli.options import (
    DEFAULT_POWER_UP_US,
    DEFAULT_WATCHDOG_US,
    CaptureRate,
    ClockHz,
    EepromWriteUs,
    Floating,
    Json,
    OscillatorStartUp,
    Partial,
    PowerUp,
    PowerUpUs,
    Ra4PullUp,
    Seconds,
    StartRam,
    StartSeed,
    Tmr0Phase,
    WatchdogUs,
    machine_options,
)
from servogen.cli.show import as_json, status, warn_of_all
from servogen.errors import InputError, Location
from servogen.programs import PROGRAM_SUFFIXES, read_schedule

if TYPE_CHECKING:
    from servogen.edges import EdgeTrace
    from servogen.pic.image import Image
    from servogen.programs import Program
    from servogen.pulse import PulseSchedule
    from servogen.simulator import Options
    from servogen.units import Clock, Cycles

MEASURED_SECONDS = 20.0
"""Two rounds of the printed lab programs."""

FOREVER_SECONDS = 3 * 3600.0
"""How far a repeat is looked for: TMR0 and a motion of 2000 frames come round together in it."""

SignalFile = Annotated[
    Path, typer.Argument(help="A HEX, C or assembly file, or edges: CSV, JSONL, VCD.", show_default=False)
]


def register(app: typer.Typer) -> None:
    app.command()(verify)
    app.command()(measure)
    app.command()(plot)


def verify(
    file: SignalFile,
    against: Annotated[Path, typer.Option("--against", help="The schedule.json it should follow.")],
    seconds: Seconds = None,
    forever: Annotated[
        bool, typer.Option("--forever", help="Prove it for all time, by a repeat of the chip's whole state.")
    ] = False,
    partial: Partial = False,
    rate: CaptureRate = None,
    device: Annotated[
        str | None,
        typer.Option("--device", help="PIC16F84 or PIC16F84A (default: the schedule's, else PIC16F84)."),
    ] = None,
    ra4_pull_up: Ra4PullUp = False,
    watchdog_us: WatchdogUs = DEFAULT_WATCHDOG_US,
    eeprom_write_us: EepromWriteUs = None,
    power_up: PowerUp = False,
    power_up_us: PowerUpUs = DEFAULT_POWER_UP_US,
    oscillator_start_up: OscillatorStartUp = True,
    ram: StartRam = 0,
    floating: Floating = 0,
    start_seed: StartSeed = None,
    tmr0_phase: Tmr0Phase = 0,
    json: Json = False,
) -> None:
    """Hold a program (default: the motion, three times) or a file, to its end, against a schedule."""
    from servogen.build import checked_cycles, prove_file, prove_image
    from servogen.simulator import Options
    from servogen.traces.captures import is_capture
    from servogen.verify import verdict_lines

    schedule = read_schedule(against)
    board = machine_options(
        _device_for(schedule, against, device),
        ra4_pull_up=ra4_pull_up,
        watchdog_us=watchdog_us,
        eeprom_write_us=eeprom_write_us,
        power_up=power_up,
        power_up_us=power_up_us,
        oscillator_start_up=oscillator_start_up,
        ram=ram,
        floating=floating,
        start_seed=start_seed,
        tmr0_phase=tmr0_phase,
    )
    if forever:
        raise typer.Exit(_verify_forever(file, schedule, seconds, board, json))
    if not _is_program(file) and (device is not None or board != Options(device=board.device)):
        raise InputError(
            "conflicting-options",
            "is a recording: --device and the simulator's options are for programs",
            Location(str(file)),
        )
    if not _is_program(file) and is_capture(file):
        if seconds is not None:
            place = Location(str(file), key="--seconds")
            raise InputError(
                "conflicting-options", "a capture is checked to its end", place, "leave --seconds out"
            )
        raise typer.Exit(_verify_capture(file, schedule, rate, partial, json))
    if rate is not None:
        raise InputError(
            "conflicting-options", "only a capture has a sampling rate", Location(str(file), key="--rate")
        )
    span = None if seconds is None else schedule.clock.round_seconds(seconds)
    if span is not None and span < schedule.period:
        raise InputError(
            "span-too-short",
            f"--seconds {seconds:g} is less than one frame of {schedule.period} cycles: it proves nothing",
        )
    with status("comparing every edge"):
        if _is_program(file):
            program = _program_for(schedule, file, board.device)
            verdict = prove_image(schedule, program.image, span, program.listing, board)
        else:
            trace = _trace(file, schedule, span or checked_cycles(schedule))
            verdict = prove_file(schedule, trace, file.suffix.lower() == ".vcd", span)
    if json:
        as_json(verdict.to_json())
    else:
        print("\n".join(verdict_lines(verdict)))
    raise typer.Exit(0 if verdict.proven or (partial and verdict.agrees) else 1)


def _device_for(schedule: PulseSchedule, against: Path, asked: str | None) -> str:
    """Return the chip to simulate. Raises InputError where schedule and `--device` differ."""
    from servogen.pic.device import DEVICES
    from servogen.pic.device import device as device_named

    try:
        built = None if schedule.device is None else device_named(schedule.device)
    except InputError as error:
        raise error.at(Location(str(against), key="device")) from error
    chip = built or DEVICES[0] if asked is None else device_named(asked)
    if built is not None and chip != built:
        raise InputError(
            "wrong-chip", f"was built for a {built.name}, --device is {chip.name}", Location(str(against))
        )
    return chip.name


def _verify_forever(
    file: Path, schedule: PulseSchedule, seconds: float | None, board: Options, json: bool
) -> int:
    from servogen.build.recurrence import prove_forever
    from servogen.verify import verdict_lines

    if not _is_program(file):
        raise InputError(
            "conflicting-options", "only a program can be proven for all time, not edges", Location(str(file))
        )
    limit = schedule.clock.round_seconds(FOREVER_SECONDS if seconds is None else seconds)
    program = _program_for(schedule, file, board.device)
    with status("looking for a repeat of the chip's state"):
        found = prove_forever(schedule, program.image, limit, program.listing, board)
    if json:
        as_json(found.to_json())
    else:
        print(found.text())
        print("\n".join(verdict_lines(found.verdict)))
    return 0 if found.proven else 1


def _verify_capture(file: Path, schedule: PulseSchedule, rate: int | None, partial: bool, json: bool) -> int:
    """Judge what a logic analyser saw and return the exit code.

    The analyser's own clock, the crystal's error and the samples' grid are allowed for.
    """
    from servogen.build.proof_of_capture import prove_capture
    from servogen.traces.captures import read_capture, sampled_at
    from servogen.verify import capture_lines

    capture = read_capture(file) if rate is None else sampled_at(read_capture(file), rate)
    with status("comparing every edge"):
        verdict = prove_capture(schedule, capture)
    if json:
        as_json(verdict.to_json())
    else:
        print("\n".join(capture_lines(verdict)))
    return 0 if verdict.proven or (partial and verdict.agrees) else 1


def measure(
    file: SignalFile,
    seconds: Seconds = None,
    servo: Annotated[
        list[str] | None,
        typer.Option("--servo", help="Judge by this model (a name or a .toml file): MODEL, or PIN=MODEL."),
    ] = None,
    clock_hz: ClockHz = None,
    ra4_pull_up: Ra4PullUp = False,
    json: Json = False,
) -> None:
    """Say what pulses a program makes in 20 s, or recorded edges, and what is doubtful about them."""
    from servogen.build.measuring import cautions, servos_named
    from servogen.verify import measure as measured
    from servogen.verify import measurement_lines

    models = servos_named(servo or [])
    trace, _ = _unknown(file, seconds, clock_hz, ra4_pull_up)
    with status("measuring"):
        measurement = measured(trace)
    found = cautions(measurement, models)
    if json:
        warnings = [{"code": each.code, "text": each.text} for each in found]
        as_json({**measurement.to_json(), "warnings": warnings})
        return
    print("\n".join(measurement_lines(measurement)))
    warn_of_all(found)


def plot(
    file: SignalFile,
    output: Annotated[Path, typer.Option("--output", "-o", help="A .png, .svg or .pdf file.")],
    against: Annotated[
        Path | None, typer.Option("--against", help="The schedule.json that names its channels.")
    ] = None,
    seconds: Seconds = None,
    clock_hz: ClockHz = None,
) -> None:
    """Draw the pulses of a program or of recorded edges (default: the motion once, else 20 s)."""
    from servogen.build import motion_cycles
    from servogen.report.pulse_plot import pulse_plot

    keep_apart([path for path in (file, against) if path], output)
    schedule = read_schedule(against) if against else None
    if schedule is None:
        trace, span = _unknown(file, seconds, clock_hz)
    elif clock_hz is not None:
        raise InputError(
            "conflicting-options",
            "the schedule says the clock",
            Location(key="--clock-hz"),
            "give one of the two",
        )
    else:
        span = motion_cycles(schedule) if seconds is None else schedule.clock.round_seconds(seconds)
        trace = _trace(file, schedule, span)
    title = f"{Path(file.parent.name, file.name)}: pulses from the first edge on"
    with status("drawing"):
        pulse_plot(trace, span, output, title, schedule)
    print(f"{output}: pulses of {file}")


def _is_program(file: Path) -> bool:
    """Whether `file` is to be run, by its ending; else it holds edges. Raises InputError for another."""
    from servogen.traces import SUFFIXES
    from servogen.traces.captures import SUFFIXES as CAPTURE_SUFFIXES

    suffix = file.suffix.lower()
    if suffix in PROGRAM_SUFFIXES:
        return True
    known = tuple(dict.fromkeys((*SUFFIXES, *CAPTURE_SUFFIXES)))
    if suffix not in known:
        everything = ", ".join((*PROGRAM_SUFFIXES, *known))
        raise InputError(
            "unknown-suffix",
            f"'{file.suffix}' is not the ending of a program or of edges",
            Location(str(file)),
            everything,
        )
    return False


def _trace(file: Path, schedule: PulseSchedule, span: Cycles) -> EdgeTrace:
    """The edges of a program, running, or those that a file holds."""
    from servogen.build import running
    from servogen.pic.device import DEVICES
    from servogen.traces import read_edges

    if _is_program(file):
        return running(schedule, _program_for(schedule, file, schedule.device or DEVICES[0].name).image, span)
    return read_edges(file, schedule.clock)


def _program_for(schedule: PulseSchedule, file: Path, device: str) -> Program:
    """Return the program in `file`. Raises InputError where it says another clock than the schedule."""
    program = read_program(file, device)
    if program.clock and program.clock != schedule.clock:
        raise InputError(
            "wrong-clock",
            f"says {program.clock.hz} Hz, the schedule is for {schedule.clock.hz} Hz",
            Location(str(file)),
        )
    return program


def _unknown(
    file: Path, seconds: float | None, clock_hz: int | None, ra4_pull_up: bool = False
) -> tuple[EdgeTrace, Cycles]:
    """The edges of a program or a file of which nothing is known, and for how long it is looked at."""
    from servogen.traces import read_edges

    if _is_program(file):
        program = read_program(file)
        clock = clock_of(program, clock_hz)
        span = clock.round_seconds(MEASURED_SECONDS if seconds is None else seconds)
        return _running(program.image, clock, span, ra4_pull_up), span
    clock = clock_of(None, clock_hz)
    trace = read_edges(file, clock, None if seconds is None else clock.round_seconds(seconds)).stored()
    return trace, trace.end


def _running(image: Image, clock: Clock, span: Cycles, ra4_pull_up: bool) -> EdgeTrace:
    """The edges of a program of which nothing is known."""
    from servogen.edges import EdgeTrace
    from servogen.simulator import Machine, Options

    machine = Machine(image, clock, Options(ra4_pull_up=ra4_pull_up))
    return EdgeTrace(clock, machine.stream(span), span)
