"""Commands of signals: verify, measure, plot."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from servogen.cli.chip_options import ChipOptions
from servogen.cli.contracts import ContractRequest, verify_contract
from servogen.cli.files import check_outputs, read_any_schedule, read_program
from servogen.cli.options import (
    CaptureRate,
    ClockHz,
    Json,
    OwnDevice,
    Partial,
    RecordedWires,
    Seconds,
    StimulusFile,
)
from servogen.cli.show import as_json, next_step, print_lines, status, warn_of_all
from servogen.contract import proposed_contract
from servogen.edges import EdgeTrace
from servogen.errors import InputError, Location
from servogen.outputs import write_text
from servogen.pic.image import Image
from servogen.programs import PAIR_FOLDERS, Program, chip_of, is_built_pair, read_pair
from servogen.pulse import PulseSchedule
from servogen.report.pulse_plot import pulse_plot
from servogen.simulator import SimulatorOptions
from servogen.toml.file import exact
from servogen.traces import read_edges
from servogen.traces.captures import is_capture, read_capture, sampled_at
from servogen.units import Cycles
from servogen.verify import Verdict, capture_lines, measurement_lines, verdict_lines
from servogen.verify import measure as measured
from servogen.workflows.measured_schedule import measured_schedule
from servogen.workflows.pair import judge_folder
from servogen.workflows.pair_capture import judge_pair_capture
from servogen.workflows.signals import (
    device_for,
    is_program,
    measured_warnings,
    program_for,
    refuse_chip_options,
    scheduled_edges,
    servos_named,
    unscheduled_edges,
    wires_for,
)
from servogen.workflows.verification import (
    hidden_by,
    judge_capture,
    judge_file,
    judge_forever,
    judge_image,
    motion_cycles,
    not_judged,
)

FOREVER_SECONDS = 3 * 3600.0
"""The time in which a repeated state is searched: TMR0 and a motion of 2000 frames repeat together in it."""

SignalFile = Annotated[
    Path,
    typer.Argument(
        help="A HEX, C or assembly file, a job or its build, or recorded edges: CSV, JSONL, VCD or .sr.",
        show_default=False,
    ),
]


@dataclass(frozen=True, slots=True)
class RecordingOptions:
    """How a recording is read, and how much of it counts."""

    partial: Partial = False
    rate: CaptureRate = None
    wire: RecordedWires = None


@dataclass(frozen=True, slots=True)
class ContractOptions:
    """A contract in place of a schedule, and what a schedule would state."""

    contract: Annotated[Path | None, "The contract (TOML) that it should keep, instead of a schedule."] = None
    stimulus: StimulusFile = None
    clock_hz: ClockHz = None

    def request(
        self,
        file: Path,
        chip: ChipOptions,
        seconds: float | None,
        wires: Mapping[str, str] | None,
        device: str | None,
        source: RecordingOptions,
        json: bool,
    ) -> ContractRequest:
        """Return what is to be judged by the contract."""
        assert self.contract is not None
        return ContractRequest(
            file=file,
            contract=self.contract,
            chip=chip,
            seconds=seconds,
            stimulus=self.stimulus,
            clock_hz=self.clock_hz,
            wires=wires,
            device=device,
            partial=source.partial,
            json=json,
        )


def verify(
    file: SignalFile,
    chip: ChipOptions,
    claim: ContractOptions,
    source: RecordingOptions,
    against: Annotated[Path | None, "What it should follow: a job, its build, a schedule.json."] = None,
    seconds: Seconds = None,
    forever: Annotated[
        bool, "Compare for all time from this start: run until the chip's whole state repeats."
    ] = False,
    device: OwnDevice = None,
    json: Json = False,
) -> None:
    """Compare a program's edges (default: the motion three times) or a whole recording with a schedule."""
    if against is None and claim.contract is None and is_built_pair(file):
        raise typer.Exit(_verify_pair(file, json))
    wires = wires_for(file, source.wire)
    if against is not None and is_built_pair(against):
        raise typer.Exit(_verify_pair_capture(file, against, wires, source, json))
    _one_claim(against, claim.contract, {"--stimulus": claim.stimulus, "--clock-hz": claim.clock_hz})
    if claim.contract is not None:
        _refuse_for_contract(forever, source.rate)
        raise typer.Exit(verify_contract(claim.request(file, chip, seconds, wires, device, source, json)))
    assert against is not None
    schedule = read_any_schedule(against)
    board = chip.on(device_for(schedule, against, device))
    if forever:
        raise typer.Exit(_verify_forever(file, schedule, seconds, board, json))
    if device is not None or chip.given:
        refuse_chip_options(file)
    if not is_program(file) and is_capture(file):
        if seconds is not None:
            place = Location(str(file), key="--seconds")
            raise InputError(
                "conflicting-options", "a capture is always compared to its end", place, "omit --seconds"
            )
        raise typer.Exit(_verify_capture(file, schedule, source.rate, wires, source.partial, json))
    if source.rate is not None:
        raise InputError(
            "conflicting-options", "only a capture has a sampling rate", Location(str(file), key="--rate")
        )
    span = None if seconds is None else schedule.clock.round_seconds(seconds)
    if span is not None and span < schedule.period:
        raise InputError(
            "out-of-range",
            f"--seconds {seconds:g} is less than one frame of {schedule.period} cycles: nothing is compared",
        )
    verdict, image = _verdict_on(file, schedule, span, board, wires)
    if json:
        as_json(verdict.to_json() | _run_json(schedule, image), verdict.warnings)
    else:
        print_lines((*verdict_lines(verdict), *not_judged(schedule, image)))
    raise typer.Exit(0 if verdict.accepted(source.partial) else 1)


def _verify_pair(folder: Path, json: bool) -> int:
    """Judge both chips of a built pair in one time and return the exit code."""
    with status("comparing every edge of both chips"):
        verdict = judge_folder(folder)
    if json:
        as_json(verdict.to_json())
    else:
        print_lines(verdict.lines())
    return 0 if verdict.exact else 1


def _verify_pair_capture(
    file: Path, folder: Path, wires: Mapping[str, str] | None, source: RecordingOptions, json: bool
) -> int:
    """Judge a recording of both chips by a built pair and return the exit code."""
    if is_program(file):
        hint = " or ".join(f"--against {folder / name}" for name in PAIR_FOLDERS)
        raise InputError(
            "chip-pair", "is one program, and the schedules are those of two chips", Location(str(file)), hint
        )
    with status("comparing every edge of both chips"):
        verdict = judge_pair_capture(read_pair(folder)[0], file, wires, source.rate)
    if json:
        as_json(verdict.to_json())
    else:
        print_lines(verdict.lines())
    return 0 if verdict.accepted(source.partial) else 1


def _refuse_for_contract(forever: bool, rate: int | None) -> None:
    """Raise InputError for what only a comparison with a schedule has."""
    for key, given in (("--forever", forever), ("--rate", rate is not None)):
        if given:
            message = "is for a comparison with a schedule"
            raise InputError("conflicting-options", message, Location(key=key), f"omit {key}")


def _verdict_on(
    file: Path,
    schedule: PulseSchedule,
    span: Cycles | None,
    board: SimulatorOptions,
    wires: Mapping[str, str] | None,
) -> tuple[Verdict, Image | None]:
    """Return the verdict on a program, with its image, or on recorded edges."""
    with status("comparing every edge"):
        if is_program(file):
            program = program_for(schedule, file, board.device, read_program)
            return judge_image(schedule, program.image, span, program.listing, board), program.image
        trace = read_edges(file, schedule.clock, wires=wires)
        hidden = hidden_by(file, schedule.clock, wires)
        return judge_file(schedule, trace, file.suffix.lower() == ".vcd", span, hidden), None


def _one_claim(against: Path | None, contract: Path | None, of_contract: Mapping[str, object]) -> None:
    """Raise InputError unless one of the two is given, and nothing that only the other one needs."""
    what = "--against SCHEDULE.json or --contract CONTRACT.toml"
    if against is not None and contract is not None:
        raise InputError("conflicting-options", f"give {what}, not both")
    if against is None and contract is None:
        makes = "`servogen measure` writes both of a program that is right"
        raise InputError("missing-option", f"what is right is missing: give {what}", hint=makes)
    for key, given in of_contract.items():
        if against is not None and given is not None:
            raise InputError(
                "conflicting-options",
                "a schedule states its clock and its inputs",
                Location(key=key),
                f"omit {key}, or use --contract",
            )


def _verify_forever(
    file: Path, schedule: PulseSchedule, seconds: float | None, board: SimulatorOptions, json: bool
) -> int:
    if not is_program(file):
        raise InputError(
            "conflicting-options",
            "only a program has a state that repeats for all time, not edges",
            Location(str(file)),
        )
    limit = schedule.clock.round_seconds(FOREVER_SECONDS if seconds is None else seconds)
    program = program_for(schedule, file, board.device, read_program)
    with status("looking for a repeat of the chip's state"):
        forever = judge_forever(schedule, program.image, limit, program.listing, board)
    if json:
        as_json(forever.to_json() | _run_json(schedule, program.image), forever.verdict.warnings)
    else:
        print_lines((forever.text(), *verdict_lines(forever.verdict), *not_judged(schedule, program.image)))
    return 0 if forever.passed else 1


def _run_json(schedule: PulseSchedule, image: Image | None) -> dict[str, object]:
    """Return the levels at which a program's inputs were held, and what was not judged."""
    held = {source.pin: source.level for source in schedule.inputs} if image is not None else {}
    return {"held": held, "not_judged": list(not_judged(schedule, image))}


def _verify_capture(
    file: Path,
    schedule: PulseSchedule,
    rate: int | None,
    wires: Mapping[str, str] | None,
    partial: bool,
    json: bool,
) -> int:
    """Judge what a logic analyser saw and return the exit code.

    The analyser's own clock, the crystal's error and the samples' grid are allowed for.
    """
    capture = read_capture(file, wires)
    if rate is not None:
        capture = sampled_at(capture, rate)
    with status("comparing every edge"):
        verdict = judge_capture(schedule, capture)
    if json:
        as_json(verdict.to_json() | _run_json(schedule, None))
    else:
        print_lines((*capture_lines(verdict), *not_judged(schedule)))
    return 0 if verdict.accepted(partial) else 1


@dataclass(frozen=True, slots=True)
class MeasuredFiles:
    """The files to write."""

    schedule: Annotated[
        Path | None, "Write the pulses as a schedule.json, for `verify` and `prove --against`."
    ] = None
    contract: Annotated[
        Path | None, "Write what was seen as a contract (.toml), for `verify` and `prove --contract`."
    ] = None
    margin_percent: Annotated[
        float,
        typer.Option(min=0, max=50, help="By how much the contract's bounds are wider than what was seen."),
    ] = 0.5

    @property
    def wanted(self) -> bool:
        return self.schedule is not None or self.contract is not None

    def write(
        self,
        trace: EdgeTrace,
        file: Path,
        program: Program | None,
        servos: Mapping[str, str],
        device: str | None,
    ) -> None:
        """Write what was measured in a program or a recording."""
        if self.contract is not None:
            part, from_reset = exact(self.margin_percent) / 100, program is not None or not is_capture(file)
            write_text(self.contract, proposed_contract(trace, file.name, part, from_reset=from_reset))
        if self.schedule is not None:
            built_for = device or (program.device if program else None)
            write_text(self.schedule, measured_schedule(trace, str(file), servos, built_for).json_text())

    def next_steps(self, file: Path, stimulus: Path | None) -> Iterator[str]:
        """Yield what can be done with them."""
        if self.schedule is not None:
            yield next_step("prove" if is_program(file) else "verify", file, "--against", self.schedule)
        if self.contract is not None:
            driven = ("--stimulus", stimulus) if stimulus else ()
            yield next_step("verify", file, "--contract", self.contract, *driven)


def measure(
    file: SignalFile,
    chip: ChipOptions,
    files: MeasuredFiles,
    seconds: Seconds = None,
    servo: Annotated[
        list[str] | None, "Check against this servo model (a name or a .toml file): MODEL or PIN=MODEL."
    ] = None,
    clock_hz: ClockHz = None,
    wire: RecordedWires = None,
    stimulus: StimulusFile = None,
    device: OwnDevice = None,
    json: Json = False,
) -> None:
    """Measure the pulses of a program (default: for 20 s) or of recorded edges, and warn about
    suspicious ones.
    """
    check_outputs([path for path in (file, stimulus) if path], files.schedule, files.contract)
    models = servos_named(servo or [])
    if device is not None or chip.given:
        refuse_chip_options(file)
    program = read_program(file, device) if is_program(file) else None
    board = chip.on(chip_of(program, device))
    trace = unscheduled_edges(file, program, seconds, clock_hz, board, wires_for(file, wire), stimulus)
    if files.wanted:
        trace = trace.stored()
        files.write(trace, file, program, {pin: model.name for pin, model in models.items()}, device)
    with status("measuring"):
        measurement = measured(trace)
    # What a contract is proposed for need not be a servo's.
    warnings = measured_warnings(measurement, models) if models or not files.contract else ()
    if json:
        as_json(measurement.to_json(), warnings)
        return
    print_lines(measurement_lines(measurement))
    for line in files.next_steps(file, stimulus):
        print(line)
    warn_of_all(warnings)


def plot(
    file: SignalFile,
    chip: ChipOptions,
    output: Annotated[Path, typer.Option("--output", "-o", help="The picture: .png, .svg or .pdf.")],
    against: Annotated[Path | None, "The job, build or schedule.json that names channels."] = None,
    seconds: Seconds = None,
    clock_hz: ClockHz = None,
    wire: RecordedWires = None,
    device: OwnDevice = None,
) -> None:
    """Draw the pulses of a program or of recorded edges (default: the motion once, else 20 s)."""
    check_outputs([path for path in (file, against) if path], output)
    schedule = read_any_schedule(against) if against else None
    wires = wires_for(file, wire)
    if device is not None or chip.given:
        refuse_chip_options(file)
    if schedule is None or against is None:
        program = read_program(file, device) if is_program(file) else None
        board = chip.on(chip_of(program, device))
        trace = unscheduled_edges(file, program, seconds, clock_hz, board, wires)
        span = trace.end
    elif clock_hz is not None:
        raise InputError(
            "conflicting-options",
            "the clock is that of the schedule",
            Location(key="--clock-hz"),
            "give one of the two",
        )
    else:
        span = motion_cycles(schedule) if seconds is None else schedule.clock.round_seconds(seconds)
        board = chip.on(device_for(schedule, against, device))
        trace = scheduled_edges(file, schedule, span, board, read_program, wires)
    title = f"{Path(file.parent.name, file.name)}: pulses from the first edge on"
    with status("drawing"):
        pulse_plot(trace, span, output, title, schedule)
    print(f"{output}: pulses of {file}")
    print(next_step("verify", file, "--against", against) if against else next_step("measure", file))
