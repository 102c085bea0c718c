"""The proof of `servogen prove --against`: every edge of a program is the schedule's, for all inputs."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servogen.checker import Checked
from servogen.cli.files import check_outputs, read_program
from servogen.cli.show import as_json, next_step, print_lines, status
from servogen.engines.stream.engine import stream
from servogen.engines.stream.streaming import Streaming
from servogen.errors import InputError, Location
from servogen.inputs import read_input
from servogen.job import PlannedJob, load, plan_job
from servogen.outputs import write_bytes, write_text
from servogen.pic.device import EEPROM_BYTES
from servogen.pic.image import Image, to_hex
from servogen.programs import MAX_SCHEDULE_BYTES, Program, read_schedule
from servogen.prove import Counterexample, Proof, Quantifiers, prove_for_all
from servogen.prove.prover import AS_IN_THE_FILE, MAX_STATES, held_assumptions
from servogen.prove.stream.proof import LineProof, prove_line
from servogen.pulse import PulseSchedule
from servogen.simulator import SimulatorOptions
from servogen.simulator.options import start_value
from servogen.workflows import certificates
from servogen.workflows.certificates import Witnessed
from servogen.workflows.signals import device_for, program_for

if TYPE_CHECKING:
    from servogen.answers import CheckedAnswer, CounterexampleAnswer, ProofAnswer

PROVEN, NOT_PROVEN = 0, 1
"""Exit codes; NOT_PROVEN also where something was found, not decided, or not covered by the checker."""

ONE_ENGINE = "proven by one engine"
ANY_LINE = "any waveform on the line (--any-line)"

EXTRA_FRAMES = 2
"""The number of frames after the wrong edge that a repeated counterexample shows."""


@dataclass(frozen=True, slots=True)
class Claim:
    """What is to be proven of a schedule, and how the answer is written."""

    certificate: Annotated[Path | None, "With --against: write the certificate of the proof."] = None
    counterexample: Annotated[Path, "With --against: where to write the inputs of a run that goes wrong."] = (
        Path("counterexample.toml")
    )
    certify_held_inputs: Annotated[
        bool,
        "With --certificate and --hold-inputs: write the certificate although it is not about the "
        "other levels of the buttons; check-certificate needs --allow-held.",
    ] = False
    accept_one_engine: Annotated[
        bool, "With --against: exit 0 also for what the prover shows and the checker does not cover."
    ] = False
    any_line: Annotated[
        Path | None,
        typer.Option(
            metavar="JOB.toml",
            help="With --against: for every waveform on the serial line of this job, which says what "
            "commands mean; takes minutes.",
        ),
    ] = None
    max_states: Annotated[
        int | None, typer.Option(min=1, help="With --against: give up after this many states.")
    ] = None

    @property
    def content(self) -> Path:
        """Return the file for the program with the EEPROM of a run that is wrong."""
        return self.counterexample.with_suffix(".hex")


@dataclass(frozen=True, slots=True)
class Over:
    """What the proof quantifies over."""

    hold_inputs: Annotated[bool, "With --against: assume that the inputs keep the schedule's levels."] = False
    plain_tmr0: Annotated[
        bool,
        typer.Option(
            "--no-tmr0-phase",
            help="With --against: assume that TMR0 counts at once after OPTION_REG is written.",
        ),
    ] = False
    any_eeprom: Annotated[
        bool,
        "With --against: for every content of the EEPROM, whose bytes are the servos' trims; inputs "
        "keep the schedule's levels.",
    ] = False
    power_up: Annotated[
        list[str] | None,
        typer.Option(
            "--start",
            metavar="NAME=VALUE",
            help="With --against: a known value at power-up, such as ram=0 or w=0x12 (repeatable).",
        ),
    ] = None
    no_resets: Annotated[bool, "With --against: assume that there is no reset after power-on."] = False
    watchdog_us: Annotated[
        int | None, "With --against: the watchdog's period in µs (default: any in its range)."
    ] = None
    eeprom_write_us: Annotated[
        int | None, "With --against: the duration of an EEPROM write, instead of any."
    ] = None

    def quantifiers(self) -> Quantifiers:
        """Return what is quantified over. Raises InputError."""
        return Quantifiers(
            inputs=not self.hold_inputs,
            tmr0_phase=not self.plain_tmr0,
            resets=not self.no_resets,
            watchdog=self.watchdog_us is None,
            eeprom_write=self.eeprom_write_us is None,
            any_eeprom=self.any_eeprom,
            start=tuple(start_value(text) for text in self.power_up or ()),
        )

    def board(self, device: str) -> SimulatorOptions:
        """Return the chip: what is not quantified over."""
        board = SimulatorOptions(device=device, eeprom_write_us=self.eeprom_write_us)
        return board if self.watchdog_us is None else replace(board, watchdog_us=self.watchdog_us)


def prove_schedule(
    file: Path, device: str | None, against: Path, claim: Claim, over: Over, json: bool
) -> int:
    """Run the proof, print the answer, write the files and return the exit code. Raises InputError."""
    quantifiers = over.quantifiers()
    content = claim.content if over.any_eeprom or claim.any_line is not None else None
    check_outputs([file, against], claim.certificate, claim.counterexample, content)
    schedule = read_schedule(against)
    chip = device_for(schedule, against, device)
    program = program_for(schedule, file, chip, read_program)
    planned = None if claim.any_line is None else _line_job(claim.any_line, schedule, against)
    with status("looking for every state") as tell:
        proof = prove_for_all(
            program.image,
            schedule,
            quantifiers,
            over.board(chip),
            lambda explored, known: tell(f"{explored} of {known} states"),
            claim.max_states or MAX_STATES,
        )
    witness = _witness(proof, program, file, schedule, against, claim) if proof.proven else None
    line = _any_line(program, *planned) if proof.proven and planned is not None else None
    shown = proof.counterexample if line is None else line.counterexample
    if shown is not None:
        _write_stimulus(shown, schedule, claim.counterexample)
        if shown.eeprom is not None:
            _write_content(shown.eeprom, program.image, claim.content)
    if json:
        answer = _proof_to_json(proof, witness, file, claim, schedule)
        as_json(answer if line is None else answer | _line_to_json(line, proof, file, claim, schedule))
    elif line is None:
        print_lines(_lines(proof, witness, file, claim, schedule))
        if witness is not None and claim.certificate is not None:
            print(next_step("check-certificate", claim.certificate, file, "--against", against))
    else:
        print_lines(_line_lines(line, proof, file, claim, schedule))
    if line is not None:
        return PROVEN if line.proven and claim.accept_one_engine else NOT_PROVEN
    accepted = witness is not None and (witness.checked is not None or claim.accept_one_engine)
    return PROVEN if accepted else NOT_PROVEN


def check_complete(claim: Claim, over: Over) -> None:
    """Raise InputError if the proof would not cover everything that is claimed."""
    quantifiers = over.quantifiers()
    if claim.certificate is not None and not quantifiers.complete:
        raise InputError(
            "conflicting-options",
            "a certificate covers every power-up, reset and chip: omit --start, --no-resets, "
            "--watchdog-us, --eeprom-write-us, --no-tmr0-phase and --any-eeprom",
        )
    if claim.any_line is not None and (
        claim.certificate is not None or over.hold_inputs or not quantifiers.complete
    ):
        raise InputError(
            "conflicting-options",
            "--any-line is for every power-up, reset and chip: omit --certificate, --hold-inputs, "
            "--any-eeprom, --start, --no-resets, --watchdog-us, --eeprom-write-us and --no-tmr0-phase",
        )


def _witness(
    proof: Proof, program: Program, file: Path, schedule: PulseSchedule, against: Path, claim: Claim
) -> Witnessed:
    """Return what the checker says of a proof; keep, and if asked for write, its certificate."""
    text = read_input(against, MAX_SCHEDULE_BYTES)
    held = claim.certify_held_inputs
    with status("checking the proof"):
        witness = certificates.second_witness(proof, program.image, schedule, text, held)
    certificates.keep(witness, program.image, text, schedule)
    if claim.certificate is not None:
        if not witness.certificate:
            hint = "--certify-held-inputs writes it" if proof.held and not held else ""
            raise InputError("no-certificate", witness.text, Location(str(file)), hint)
        write_bytes(claim.certificate, witness.certificate)
    return witness


def _line_job(job_file: Path, schedule: PulseSchedule, against: Path) -> tuple[PlannedJob, Streaming]:
    """Return the job whose line may have any waveform, and its streams. Raises InputError if the schedule is
    another's.
    """
    job = plan_job(load(job_file))
    streamed = stream(job)[1]
    planned = streamed.plan.schedule
    same = ("clock", "period", "channels", "lead_in", "loop", "inputs")
    if any(getattr(planned, name) != getattr(schedule, name) for name in same):
        raise InputError("conflicting-options", f"is not the schedule of {job_file}", Location(str(against)))
    return job, streamed


def _any_line(program: Program, job: PlannedJob, streamed: Streaming) -> LineProof:
    """Return the answer for any waveform on a job's line. Raises ToolError."""
    with status("any line") as tell:
        return prove_line(program.image, program.listing, job, streamed, tell)


def _line_lines(line: LineProof, idle: Proof, file: Path, claim: Claim, schedule: PulseSchedule) -> list[str]:
    """Return the answer for any line as text; `idle` is the one for an idle line."""
    if not line.proven:
        shown = line.counterexample
        answer = [f"not decided for any line: {line.reason}"]
        return [
            *(_counterexample_lines(shown, file, claim, schedule) if shown else answer),
            *([f"  {line.reason}"] if shown and line.reason != shown.message else []),
            f"  with an idle line every edge is the schedule's: {_size(idle)}",
        ]
    return [
        f"{ONE_ENGINE}: the checker does not cover {ANY_LINE}",
        "  for every power-up, chip, content of the EEPROM and waveform on the line: every pulse begins "
        "at its slot's cycle and is as wide as complete commands say",
        *(f"  {finding}" for finding in line.findings),
        "  with an idle line and the EEPROM of the file, every edge is the schedule's:",
        f"  {_size(idle)}",
        "  assumed:",
        *(f"    {assumption}" for assumption in _of_any_line(line, idle, schedule)),
    ]


def _of_any_line(line: LineProof, idle: Proof, schedule: PulseSchedule) -> list[str]:
    """Return the assumptions: of those of the proof with an idle line, the ones that concern every line."""
    of_idle = {AS_IN_THE_FILE, *held_assumptions(idle.held, schedule)}
    return [*(assumption for assumption in idle.assumptions if assumption not in of_idle), *line.assumptions]


def _line_to_json(
    line: LineProof, idle: Proof, file: Path, claim: Claim, schedule: PulseSchedule
) -> dict[str, object]:
    """Return the answer for any line as values of JSON."""
    shown = line.counterexample
    return {
        "answer": ONE_ENGINE if line.proven else "counterexample" if shown else "not decided",
        "reason": line.reason,
        "checked": None,
        "not_covered": ANY_LINE if line.proven else "",
        "any_line": list(line.findings),
        "assumptions": _of_any_line(line, idle, schedule),
        "counterexample": _counterexample_to_json(shown, file, claim, schedule) if shown else None,
    }


def _write_stimulus(counterexample: Counterexample, schedule: PulseSchedule, path: Path) -> None:
    if counterexample.stimulus(schedule.clock):
        write_text(path, counterexample.stimulus(schedule.clock))


def _write_content(content: dict[int, int], image: Image, path: Path) -> None:
    write_text(path, to_hex(replace(image, eeprom={**dict.fromkeys(range(EEPROM_BYTES), 0xFF), **content})))


def _command(counterexample: Counterexample, file: Path, claim: Claim, schedule: PulseSchedule) -> str:
    """Return the command that shows a counterexample's edges."""
    stimulus = ["--stimulus", str(claim.counterexample)] if counterexample.stimulus(schedule.clock) else []
    clock = [] if counterexample.clock_hz else ["--clock-hz", str(schedule.clock.hz)]
    span = ["--cycles", str(counterexample.cycle + EXTRA_FRAMES * schedule.period)]
    program = file if counterexample.eeprom is None else claim.content
    words = ["servogen", "simulate", str(program), *stimulus, *counterexample.arguments(), *clock, *span]
    return shlex.join([*words, "--edges", "counterexample.csv"])


def _lines(
    proof: Proof, witness: Witnessed | None, file: Path, claim: Claim, schedule: PulseSchedule
) -> list[str]:
    """Return the answer as text; `witness` is what the checker says of a proof."""
    counterexample = proof.counterexample
    if counterexample is not None:
        return _counterexample_lines(counterexample, file, claim, schedule)
    if witness is None:
        return [f"not decided: {proof.reason}", f"  {_size(proof)}"]
    chips = proof.quantifiers.text(held=bool(proof.held))
    return [
        witness.text,
        f"  for {chips}: every edge of {judged_pins(schedule)} is the schedule's",
        f"  {_size(proof)}",
        *(checked_lines(witness.checked) if witness.checked else []),
        "  assumed:",
        *(f"    {assumption}" for assumption in proof.assumptions),
    ]


def judged_pins(schedule: PulseSchedule) -> str:
    """Return in words which pins the theorem is about."""
    tape = schedule.tape
    return f"all pins but {tape.scl} and {tape.sda}, a tape's bus," if tape else "all pins"


def _counterexample_lines(
    counterexample: Counterexample, file: Path, claim: Claim, schedule: PulseSchedule
) -> list[str]:
    return [
        f"counterexample: {counterexample.message}, cycle {counterexample.cycle} from reset",
        f"  {_command(counterexample, file, claim, schedule)}",
    ]


def _counterexample_to_json(
    counterexample: Counterexample, file: Path, claim: Claim, schedule: PulseSchedule
) -> CounterexampleAnswer:
    content = counterexample.eeprom
    return {
        "message": counterexample.message,
        "cycle": counterexample.cycle,
        "command": _command(counterexample, file, claim, schedule),
        "stimulus": counterexample.stimulus(schedule.clock) or None,
        "eeprom": None if content is None else {str(cell): byte for cell, byte in content.items()},
    }


def _size(proof: Proof) -> str:
    """Return how much was searched."""
    return f"{proof.states} states, {proof.runs} runs of {proof.cycles} cycles together"


def _proof_to_json(
    proof: Proof, witness: Witnessed | None, file: Path, claim: Claim, schedule: PulseSchedule
) -> ProofAnswer:
    counterexample = proof.counterexample
    answer = "counterexample" if counterexample else "not decided"
    if witness is not None:
        answer = "proven" if witness.checked else ONE_ENGINE
    return {
        "file": str(file),
        "answer": answer,
        "reason": proof.reason,
        "states": proof.states,
        "runs": proof.runs,
        "cycles": proof.cycles,
        "checked": checked_to_json(witness.checked) if witness and witness.checked else None,
        "not_covered": witness.not_covered if witness else "",
        "assumptions": list(proof.assumptions),
        "counterexample": _counterexample_to_json(counterexample, file, claim, schedule)
        if counterexample
        else None,
    }


def checked_lines(checked: Checked) -> list[str]:
    """Return what the checker's theorem quantifies over, and how much the checker ran."""
    counts = (
        f"{checked.states} states, {checked.frames} frames, {checked.cycles} cycles, {checked.forks} splits"
    )
    return [*(f"  over {text}" for text in checked.over), f"  checked: {counts}"]


def checked_to_json(checked: Checked) -> CheckedAnswer:
    """Return what `checked_lines` says as values of JSON."""
    return {
        "states": checked.states,
        "frames": checked.frames,
        "cycles": checked.cycles,
        "forks": checked.forks,
        "over": list(checked.over),
        "restrictions": list(checked.restrictions),
    }
