"""The pulses of a file: those of a program on the simulator, or recorded edges.

In: a file, optionally the schedule that it is compared with, the simulator's options. Out: an `EdgeTrace`;
for measured pulses, the warnings that planned pulses would get from the servos' models.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from servogen.edges import PINS, EdgeTrace
from servogen.errors import Diagnostic, InputError, Location, did_you_mean
from servogen.pic.device import DEVICES, Device
from servogen.pic.device import device as device_named
from servogen.programs import PROGRAM_SUFFIXES, Program, clock_of, is_job
from servogen.pulse import PulseSchedule
from servogen.pulse.lint import check_measured, check_periods, check_unknown
from servogen.robot.servo import ServoModel, servo
from servogen.robot.servo_models import servo_model
from servogen.simulator import Machine, SimulatorOptions, load_stimuli
from servogen.traces import SUFFIXES
from servogen.traces.captures import SUFFIXES as CAPTURE_SUFFIXES
from servogen.traces.captures import read_recording
from servogen.traces.channels import parse_wires
from servogen.units import Cycles
from servogen.verify import Measurement, PinMeasurement
from servogen.workflows.job_program import read_program
from servogen.workflows.verification import running

MEASURED_SECONDS = 20.0
"""The default time that a program runs: two rounds of the printed lab programs."""

Read = Callable[[Path, str | None], Program]
"""Reads a program for a device; `read_program` unless the caller shows the remarks about the file."""


def is_program(file: Path) -> bool:
    """Return True for a file that can be run (a program, a job or the folder of a build), False for one that
    holds edges. Raises InputError for another suffix.
    """
    suffix = file.suffix.lower()
    if suffix in PROGRAM_SUFFIXES or file.is_dir() or is_job(file):
        return True
    known = tuple(dict.fromkeys((*SUFFIXES, *CAPTURE_SUFFIXES)))
    if suffix not in known:
        raise InputError(
            "unknown-suffix",
            f"'{file.suffix}' is not the suffix of a program, a job or edges",
            Location(str(file)),
            ", ".join((*PROGRAM_SUFFIXES, *known)),
        )
    return False


def device_for(schedule: PulseSchedule, against: Path, asked: str | None) -> str:
    """Return the name of the chip that a schedule was built for, or else the requested one, or else the first
    one that is fast enough.

    Raises InputError if they differ, or if the chip is not made for the schedule's clock.
    """
    try:
        built = None if schedule.device is None else device_named(schedule.device)
    except InputError as error:
        raise error.at(Location(str(against), key="device")) from error
    hz = schedule.clock.hz
    chip = chosen_device(built, against, asked)
    if built is None and asked is None and hz > chip.max_clock_hz:
        chip = max(DEVICES, key=lambda device: device.max_clock_hz)
    if hz > chip.max_clock_hz:
        largest = ", ".join(f"{device.name} {device.max_clock_hz} Hz" for device in DEVICES)
        raise InputError(
            "wrong-clock",
            f"is for {hz} Hz, the chip runs at no more than {chip.max_clock_hz} Hz",
            Location(str(against)),
            f"the largest clocks: {largest}",
        )
    return chip.name


def chosen_device(built: Device | None, file: Path, asked: str | None) -> Device:
    """Return the chip that the schedule or job in `file` was built for, or else the requested one.

    Raises InputError if they differ.
    """
    chip = built or DEVICES[0] if asked is None else device_named(asked)
    if built is not None and chip != built:
        raise InputError(
            "wrong-chip", f"was built for a {built.name}, --device is {chip.name}", Location(str(file))
        )
    return chip


def program_for(schedule: PulseSchedule, file: Path, device: str, read: Read = read_program) -> Program:
    """Return the program in `file`. Raises InputError if it names another clock than the schedule's."""
    program = read(file, device)
    if program.clock and program.clock != schedule.clock:
        raise InputError(
            "wrong-clock",
            f"states {program.clock.hz} Hz, the schedule is for {schedule.clock.hz} Hz",
            Location(str(file)),
        )
    return program


def wires_for(file: Path, texts: Sequence[str] | None) -> dict[str, str] | None:
    """Return the pins of a recording's channels. Raises InputError if channels of a program are named."""
    wires = parse_wires(texts or ())
    if wires and is_program(file):
        raise InputError(
            "conflicting-options", "only a recording has wires", Location(str(file), key="--wire")
        )
    return wires


def refuse_chip_options(file: Path) -> None:
    """Raise InputError if options of the simulated chip are given for a recording."""
    if not is_program(file):
        raise InputError(
            "conflicting-options",
            "is a recording: --device and the simulator's options are for programs",
            Location(str(file)),
        )


def refuse_for_recording(file: Path, key: str, given: object) -> None:
    """Raise InputError if an option states what a recording states itself."""
    if given is not None:
        raise InputError(
            "conflicting-options",
            "a recording holds what was, from its beginning to its end",
            Location(str(file), key=key),
            f"omit {key}",
        )


def scheduled_edges(
    file: Path,
    schedule: PulseSchedule,
    span: Cycles,
    options: SimulatorOptions,
    read: Read = read_program,
    wires: Mapping[str, str] | None = None,
) -> EdgeTrace:
    """Return the edges of a program that runs for `span`, or those in a file, by the schedule's clock."""
    if is_program(file):
        program = program_for(schedule, file, options.device, read)
        return running(schedule, program.image, span, options)
    return read_recording(file, schedule.clock, wires=wires)


def unscheduled_edges(
    file: Path,
    program: Program | None,
    seconds: float | None,
    clock_hz: int | None,
    options: SimulatorOptions,
    wires: Mapping[str, str] | None = None,
    stimulus: Path | None = None,
) -> EdgeTrace:
    """Return edges that no schedule is about: of the program in a file, with what drives its inputs, for
    `MEASURED_SECONDS` unless `seconds` says otherwise; or those in a recording, up to its end.
    """
    clock = clock_of(program, clock_hz)
    if program is not None:
        span = clock.round_seconds(MEASURED_SECONDS if seconds is None else seconds)
        driven = load_stimuli(stimulus, clock) if stimulus else None
        return EdgeTrace(clock, Machine(program.image, clock, options, driven).stream(span), span)
    refuse_for_recording(file, "--stimulus", stimulus)
    end = None if seconds is None else clock.round_seconds(seconds)
    return read_recording(file, clock, end, wires).stored()


def servos_named(texts: Sequence[str]) -> dict[str, ServoModel]:
    """Return the servo models by pin: "RB0=futaba-s3001" names that of a pin, "futaba-s3001" that of every
    pin.

    Raises InputError.
    """
    models: dict[str, ServoModel] = {}
    for text in texts:
        pin, _, name = text.rpartition("=")
        if pin and pin not in PINS:
            raise InputError(
                "unknown-pin", f"unknown pin '{pin}'", Location(key="--servo"), did_you_mean(pin, PINS)
            )
        model = servo_model(name, place=Location(key="--servo"))
        models |= dict.fromkeys((pin,) if pin else PINS, model)
    return models


def measured_warnings(measurement: Measurement, models: Mapping[str, ServoModel]) -> tuple[Diagnostic, ...]:
    """Return the warnings; a pin without a model is judged by the widths that every servo accepts."""
    warnings: list[Diagnostic] = []
    for pin in measurement.pins:
        model = models.get(PINS[pin.pin])
        warnings += _of_pin(measurement, pin, model)
    return tuple(warnings)


def _of_pin(
    measurement: Measurement, pin: PinMeasurement, model: ServoModel | None
) -> tuple[Diagnostic, ...]:
    name = PINS[pin.pin]
    periods = [float(measurement.us(period)) for period in _periods(pin)]
    if model is None:
        widths = [float(measurement.us(width)) for width in pin.widths]
        return (*check_unknown(name, widths), *check_periods(periods, name))
    widths = [float(measurement.us(width)) for width in pin.widths_in_order()]
    return check_measured(servo(name, name, model), widths, periods)


def _periods(pin: PinMeasurement) -> list[int]:
    """Return the period of each kind of frame, without the transitions from one kind to the next.

    If a pin has only one or two pulses, which do not make a kind of frame, return all its periods.
    """
    return [kind.period for kind in pin.kinds] or list(pin.periods)
