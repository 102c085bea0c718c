"""Commands of proofs over all inputs: prove, check-certificate."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servogen.cli.files import keep_apart, read_program
from servogen.cli.options import ClockHz, Json, OwnDevice
from servogen.cli.show import as_json, status
from servogen.errors import InputError, Location
from servogen.inputs import read_input
from servogen.programs import MAX_SCHEDULE_BYTES, clock_of, read_schedule

if TYPE_CHECKING:
    from servogen.checker import Checked
    from servogen.engines.stream.streaming import Streaming
    from servogen.job import PlannedJob
    from servogen.pic.analysis.facts import Answer
    from servogen.pic.image import Image
    from servogen.programs import Program
    from servogen.prove import Counterexample, Proof, Quantifiers
    from servogen.prove.stream.proof import LineProof
    from servogen.pulse import PulseSchedule
    from servogen.workflows.certificates import Witnessed


def register(app: typer.Typer) -> None:
    """Add the commands of this module to the application."""
    app.command()(prove)
    app.command()(check_certificate)


PROVEN, NOT_PROVEN = 0, 1
"""Exit codes; NOT_PROVEN also where something was found, not decided, or not covered by the checker."""

ONE_ENGINE = "proven by one engine"
ANY_LINE = "any waveform on the line (--any-line)"

EXTRA_FRAMES = 2
"""The number of frames after the wrong edge that a repeated counterexample shows."""


class Interrupts(StrEnum):
    """Whether the time of interrupts counts."""

    INCLUDED = "included"
    EXCLUDED = "excluded"


def prove(
    file: Annotated[
        Path, typer.Argument(help="A HEX, C or assembly file, a job or its build.", show_default=False)
    ],
    against: Annotated[
        Path | None,
        typer.Option("--against", help="Prove that it follows this schedule.json, for all inputs."),
    ] = None,
    contract: Annotated[
        Path | None,
        typer.Option("--contract", help="Prove that it keeps this contract (TOML), for all inputs."),
    ] = None,
    certificate: Annotated[
        Path | None, typer.Option("--certificate", help="With --against: write the certificate of the proof.")
    ] = None,
    counterexample: Annotated[
        Path,
        typer.Option(
            "--counterexample", help="With --against: where to write the inputs of a run that goes wrong."
        ),
    ] = Path("counterexample.toml"),
    hold_inputs: Annotated[
        bool,
        typer.Option(
            "--hold-inputs", help="With --against: assume that the inputs keep the schedule's levels."
        ),
    ] = False,
    certify_held_inputs: Annotated[
        bool,
        typer.Option(
            "--certify-held-inputs",
            help="With --certificate and --hold-inputs: write the certificate although it is not about the "
            "other levels of the buttons; check-certificate needs --allow-held.",
        ),
    ] = False,
    accept_one_engine: Annotated[
        bool,
        typer.Option(
            "--accept-one-engine",
            help="With --against: exit 0 also for what the prover shows and the checker does not cover.",
        ),
    ] = False,
    plain_tmr0: Annotated[
        bool,
        typer.Option(
            "--no-tmr0-phase",
            help="With --against: assume that TMR0 counts at once after OPTION_REG is written.",
        ),
    ] = False,
    any_eeprom: Annotated[
        bool,
        typer.Option(
            "--any-eeprom",
            help="With --against: for every content of the EEPROM, whose bytes are the servos' trims; inputs "
            "keep the schedule's levels.",
        ),
    ] = False,
    any_line: Annotated[
        Path | None,
        typer.Option(
            "--any-line",
            metavar="JOB.toml",
            help="With --against: for every waveform on the serial line of this job, which says what "
            "commands mean; takes minutes.",
        ),
    ] = None,
    power_up: Annotated[
        list[str] | None,
        typer.Option(
            "--start",
            metavar="NAME=VALUE",
            help="With --against: a known value at power-up, such as ram=0 or w=0x12 (repeatable).",
        ),
    ] = None,
    no_resets: Annotated[
        bool,
        typer.Option("--no-resets", help="With --against: assume that there is no reset after power-on."),
    ] = False,
    watchdog_us: Annotated[
        int | None,
        typer.Option(
            "--watchdog-us", help="With --against: the watchdog's period in µs (default: any in its range)."
        ),
    ] = None,
    eeprom_write_us: Annotated[
        int | None,
        typer.Option(
            "--eeprom-write-us", help="With --against: the duration of an EEPROM write, instead of any."
        ),
    ] = None,
    max_states: Annotated[
        int | None,
        typer.Option("--max-states", min=1, help="With --against: give up after this many states."),
    ] = None,
    start: Annotated[
        list[str] | None,
        typer.Option(
            "--from",
            metavar="MARK",
            help="Where a measured time begins: an address (0x12A), a label, a function or a line "
            "(12 or main.c:12); repeatable, with one --to each.",
        ),
    ] = None,
    end: Annotated[
        list[str] | None,
        typer.Option("--to", metavar="MARK", help="Where that time ends, the first time that it is reached."),
    ] = None,
    interrupts: Annotated[
        Interrupts, typer.Option("--interrupts", help="Whether times between marks include interrupts.")
    ] = Interrupts.INCLUDED,
    clock_hz: ClockHz = None,
    device: OwnDevice = None,
    json: Json = False,
) -> None:
    """Show what holds for every path of a program: stack, unwritten bytes, pins, dead code, watchdog, times.

    With --against, prove that every edge is the schedule's for every power-up, input and chip, and have the
    proof checked by an independent checker.

    Exit code 0: proven and checked, or decided and nothing found; 1: something was found or could not be
    decided, or the checker does not cover it.
    """
    from servogen.prove.quantifiers import Quantifiers
    from servogen.simulator.options import start_value

    if contract is not None:
        from servogen.cli.contracts import ContractProofRequest, prove_contract_of

        if against is not None or certificate is not None or any_line is not None or start or end:
            raise InputError(
                "conflicting-options",
                "--against, --certificate, --any-line, --from and --to are not for a contract",
                Location(str(contract), key="--contract"),
            )
        over = Quantifiers(resets=not no_resets, start=tuple(start_value(text) for text in power_up or ()))
        asked = ContractProofRequest(
            file, contract, counterexample, over, clock_hz, device, max_states, accept_one_engine, json
        )
        raise typer.Exit(prove_contract_of(asked))
    if against is not None:
        if start or end or clock_hz is not None:
            raise InputError(
                "conflicting-options", "--from, --to and --clock-hz are for a program without --against"
            )
        over = Quantifiers(
            inputs=not hold_inputs,
            tmr0_phase=not plain_tmr0,
            resets=not no_resets,
            watchdog=watchdog_us is None,
            eeprom_write=eeprom_write_us is None,
            any_eeprom=any_eeprom,
            start=tuple(start_value(text) for text in power_up or ()),
        )
        times = {"watchdog_us": watchdog_us, "eeprom_write_us": eeprom_write_us}
        given = {name: value for name, value in times.items() if value is not None}
        if any_line is not None and (certificate is not None or hold_inputs or not over.complete):
            raise InputError(
                "conflicting-options",
                "--any-line is for every power-up, reset and chip: omit --certificate, --hold-inputs, "
                "--any-eeprom, --start, --no-resets, --watchdog-us, --eeprom-write-us and --no-tmr0-phase",
            )
        request = ProofRequest(
            against=against,
            certificate=certificate,
            counterexample=counterexample,
            over=over,
            times=given,
            max_states=max_states,
            any_line=any_line,
            certify_held=certify_held_inputs,
            accept_one_engine=accept_one_engine,
        )
        raise typer.Exit(prove_schedule(file, device, request, json))
    switched = hold_inputs or plain_tmr0 or any_eeprom or power_up or no_resets
    switched = switched or accept_one_engine or watchdog_us is not None or eeprom_write_us is not None
    if certificate is not None or switched or max_states is not None or any_line is not None:
        raise InputError("conflicting-options", "this option needs --against")
    from servogen.pic.analysis.facts import Facts, decided_and_fine

    marks = _marks(start or [], end or [])
    program = read_program(file, device)
    with status("following every path") as tell:
        facts = Facts(program.image, program.listing, clock_of(program, clock_hz), tell)
        answers = [
            *facts.answers(),
            *(facts.time(a, b, interrupts=interrupts is Interrupts.INCLUDED) for a, b in marks),
        ]
    if json:
        as_json({"file": str(file), "answers": [answer.to_json() for answer in answers]})
    else:
        print("\n".join(_text(answer) for answer in answers))
    if not decided_and_fine(answers):
        raise typer.Exit(NOT_PROVEN)


def _marks(starts: list[str], ends: list[str]) -> list[tuple[str, str]]:
    """Return the pairs of --from and --to. Raises InputError."""
    if len(starts) != len(ends):
        raise InputError(
            "missing-option",
            f"{len(starts)} --from and {len(ends)} --to: every time needs both",
            hint="--from MARK --to MARK",
        )
    return list(zip(starts, ends, strict=True))


def _text(answer: Answer) -> str:
    lines = [f"{answer.question}: {answer.status}", f"  {answer.text}", f"  over {answer.over}"]
    return "\n".join([*lines, *(f"  {finding}" for finding in answer.findings)])


@dataclass(frozen=True, slots=True)
class ProofRequest:
    """The options of the command that belong to a schedule."""

    against: Path
    certificate: Path | None
    counterexample: Path
    over: Quantifiers
    times: Mapping[str, Any]
    """The options of the simulated chip that are not quantified over."""
    max_states: int | None
    any_line: Path | None
    """The job whose serial line may have any waveform."""
    certify_held: bool = False
    """Whether a certificate may be about one level of each button."""
    accept_one_engine: bool = False
    """Whether the checker need not cover the proof."""

    @property
    def content(self) -> Path:
        """Return the file for the program with the EEPROM of a run that is wrong."""
        return self.counterexample.with_suffix(".hex")


def prove_schedule(file: Path, device: str | None, request: ProofRequest, json: bool) -> int:
    """Run the proof, print the answer, write the files and return the exit code. Raises InputError."""
    from servogen.outputs import write_bytes
    from servogen.prove import prove_for_all
    from servogen.prove.prover import MAX_STATES
    from servogen.simulator import SimulatorOptions
    from servogen.workflows import certificates
    from servogen.workflows.signals import device_for, program_for

    if request.certificate is not None and not request.over.complete:
        raise InputError(
            "conflicting-options",
            "a certificate covers every power-up, reset and chip: omit --start, --no-resets, "
            "--watchdog-us, --eeprom-write-us, --no-tmr0-phase and --any-eeprom",
        )
    content = request.content if request.over.any_eeprom or request.any_line is not None else None
    keep_apart([file, request.against], request.certificate, request.counterexample, content)
    schedule = read_schedule(request.against)
    chip = device_for(schedule, request.against, device)
    board = replace(SimulatorOptions(device=chip), **request.times)
    program = program_for(schedule, file, chip, read_program)
    planned = None if request.any_line is None else _line_job(request.any_line, schedule, request.against)
    with status("looking for every state") as tell:
        proof = prove_for_all(
            program.image,
            schedule,
            request.over,
            board,
            lambda explored, known: tell(f"{explored} of {known} states"),
            request.max_states or MAX_STATES,
        )
    witness = None
    if proof.proven:
        text = read_input(request.against, MAX_SCHEDULE_BYTES)
        with status("checking the proof"):
            witness = certificates.second_witness(proof, program.image, schedule, text, request.certify_held)
        certificates.keep(witness, program.image, text)
        if request.certificate is not None:
            if not witness.certificate:
                hint = "--certify-held-inputs writes it" if proof.held and not request.certify_held else ""
                raise InputError("no-certificate", witness.text, Location(str(file)), hint)
            write_bytes(request.certificate, witness.certificate)
    line = _any_line(program, *planned) if proof.proven and planned is not None else None
    shown = proof.counterexample if line is None else line.counterexample
    if shown is not None:
        _write_stimulus(shown, schedule, request.counterexample)
        if shown.eeprom is not None:
            _write_content(shown.eeprom, program.image, request.content)
    if json:
        answer = _proof_to_json(proof, witness, file, request, schedule)
        as_json(answer if line is None else answer | _line_to_json(line, proof, file, request, schedule))
    elif line is None:
        print("\n".join(_lines(proof, witness, file, request, schedule)))
    else:
        print("\n".join(_line_lines(line, proof, file, request, schedule)))
    if line is not None:
        return PROVEN if line.proven and request.accept_one_engine else NOT_PROVEN
    accepted = witness is not None and (witness.checked is not None or request.accept_one_engine)
    return PROVEN if accepted else NOT_PROVEN


def _line_job(job_file: Path, schedule: PulseSchedule, against: Path) -> tuple[PlannedJob, Streaming]:
    """Return the job whose line may have any waveform, and its streams. Raises InputError if the schedule is
    another's.
    """
    from servogen.engines.stream.engine import stream
    from servogen.job import load, plan_job

    job = plan_job(load(job_file))
    streamed = stream(job)[1]
    planned = streamed.plan.schedule
    same = ("clock", "period", "channels", "lead_in", "loop", "inputs")
    if any(getattr(planned, name) != getattr(schedule, name) for name in same):
        raise InputError("conflicting-options", f"is not the schedule of {job_file}", Location(str(against)))
    return job, streamed


def _any_line(program: Program, job: PlannedJob, streamed: Streaming) -> LineProof:
    """Return the answer for any waveform on a job's line. Raises ToolError."""
    from servogen.prove.stream.proof import prove_line

    with status("any line") as tell:
        return prove_line(program.image, program.listing, job, streamed, tell)


def _line_lines(
    line: LineProof, idle: Proof, file: Path, request: ProofRequest, schedule: PulseSchedule
) -> list[str]:
    """Return the answer for any line as text; `idle` is the one for an idle line."""
    if not line.proven:
        shown = line.counterexample
        answer = [f"not decided for any line: {line.reason}"]
        return [
            *(_counterexample_lines(shown, file, request, schedule) if shown else answer),
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
    from servogen.prove.prover import AS_IN_THE_FILE, held_assumptions

    of_idle = {AS_IN_THE_FILE, *held_assumptions(idle.held, schedule)}
    return [*(assumption for assumption in idle.assumptions if assumption not in of_idle), *line.assumptions]


def _line_to_json(
    line: LineProof, idle: Proof, file: Path, request: ProofRequest, schedule: PulseSchedule
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
        "counterexample": _counterexample_to_json(shown, file, request, schedule) if shown else None,
    }


def _write_stimulus(counterexample: Counterexample, schedule: PulseSchedule, path: Path) -> None:
    from servogen.outputs import write_text

    if counterexample.stimulus(schedule.clock):
        write_text(path, counterexample.stimulus(schedule.clock))


def _write_content(content: dict[int, int], image: Image, path: Path) -> None:
    from servogen.outputs import write_text
    from servogen.pic.device import EEPROM_BYTES
    from servogen.pic.image import to_hex

    write_text(path, to_hex(replace(image, eeprom={**dict.fromkeys(range(EEPROM_BYTES), 0xFF), **content})))


def _command(
    counterexample: Counterexample, file: Path, request: ProofRequest, schedule: PulseSchedule
) -> str:
    """Return the command that shows a counterexample's edges."""
    stimulus = ["--stimulus", str(request.counterexample)] if counterexample.stimulus(schedule.clock) else []
    clock = [] if counterexample.clock_hz else ["--clock-hz", str(schedule.clock.hz)]
    span = ["--cycles", str(counterexample.cycle + EXTRA_FRAMES * schedule.period)]
    program = file if counterexample.eeprom is None else request.content
    words = ["servogen", "simulate", str(program), *stimulus, *counterexample.arguments(), *clock, *span]
    return shlex.join([*words, "--edges", "counterexample.csv"])


def _lines(
    proof: Proof, witness: Witnessed | None, file: Path, request: ProofRequest, schedule: PulseSchedule
) -> list[str]:
    """Return the answer as text; `witness` is what the checker says of a proof."""
    counterexample = proof.counterexample
    if counterexample is not None:
        return _counterexample_lines(counterexample, file, request, schedule)
    if witness is None:
        return [f"not decided: {proof.reason}", f"  {_size(proof)}"]
    return [
        witness.text,
        f"  for {_over(proof)}: every edge of all pins is the schedule's",
        f"  {_size(proof)}",
        *(_checked_lines(witness.checked) if witness.checked else []),
        "  assumed:",
        *(f"    {assumption}" for assumption in proof.assumptions),
    ]


def _counterexample_lines(
    counterexample: Counterexample, file: Path, request: ProofRequest, schedule: PulseSchedule
) -> list[str]:
    return [
        f"counterexample: {counterexample.message}, cycle {counterexample.cycle} from reset",
        f"  {_command(counterexample, file, request, schedule)}",
    ]


def _counterexample_to_json(
    counterexample: Counterexample, file: Path, request: ProofRequest, schedule: PulseSchedule
) -> dict[str, object]:
    return {
        "message": counterexample.message,
        "cycle": counterexample.cycle,
        "command": _command(counterexample, file, request, schedule),
        "stimulus": counterexample.stimulus(schedule.clock) or None,
        "eeprom": counterexample.eeprom,
    }


def _size(proof: Proof) -> str:
    """Return how much was searched."""
    return f"{proof.states} states, {proof.runs} runs of {proof.cycles} cycles together"


def _over(proof: Proof) -> str:
    """Return what a proof is quantified over; everything else is among its assumptions."""
    over = proof.quantifiers
    parts = ["power-up"] if over.resets and not over.start else []
    parts += [] if proof.held else ["input"]
    parts += ["chip"] if over.watchdog and over.tmr0_phase and over.eeprom_write else []
    if not parts:
        return "one power-up, the inputs and the chip that are assumed"
    return "every " + " and ".join(part for part in (", ".join(parts[:-1]), parts[-1]) if part)


def _proof_to_json(
    proof: Proof, witness: Witnessed | None, file: Path, request: ProofRequest, schedule: PulseSchedule
) -> dict[str, object]:
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
        "checked": asdict(witness.checked) if witness and witness.checked else None,
        "not_covered": witness.not_covered if witness else "",
        "assumptions": list(proof.assumptions),
        "counterexample": _counterexample_to_json(counterexample, file, request, schedule)
        if counterexample
        else None,
    }


def check_certificate(
    certificate: Annotated[
        Path, typer.Argument(help="The certificate that servogen prove wrote.", show_default=False)
    ],
    hex_file: Annotated[Path, typer.Argument(metavar="HEX", help="The program.", show_default=False)],
    against: Annotated[Path, typer.Option(help="The schedule.json of the proof.", show_default=False)],
    allow_held: Annotated[
        list[str] | None,
        typer.Option(
            "--allow-held",
            metavar="PIN",
            help="Accept a certificate that is about one level of this button or line only (repeatable).",
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Check a certificate of `prove` with an independent checker.

    Exit code 0: the certificate proves that every edge is the schedule's; 1: refused, or outside what the
    checker covers, with the reason; 2: a file is not valid.
    """
    from servogen import checker
    from servogen.pic.image import read_hex
    from servogen.programs import MAX_SCHEDULE_BYTES, program_file, read_source
    from servogen.workflows.certificates import MAX_CERTIFICATE_BYTES

    claim = checker.read_certificate(read_input(certificate, MAX_CERTIFICATE_BYTES), str(certificate))
    hex_file = program_file(hex_file)
    image = read_hex(read_source(hex_file), str(hex_file)).image
    try:
        with status(f"{hex_file.name}: checking {claim.count} states"):
            schedule = read_input(against, MAX_SCHEDULE_BYTES)
            checked = checker.check_certificate(claim, image, schedule, str(against), allow_held or ())
    except checker.Refused as refused:
        covered = not isinstance(refused, checker.NotCovered)
        if json:
            as_json({"valid": False, "covered": covered, "reason": str(refused), "held": claim.held})
        else:
            print(f"{certificate}: {'refused' if covered else 'not covered'}: {refused}")
        raise typer.Exit(NOT_PROVEN) from None
    if json:
        as_json({"valid": True, "held": claim.held} | asdict(checked))
        return
    print(f"{certificate}: valid{''.join(f', with {text}' for text in checked.restrictions)}")
    print("\n".join(_checked_lines(checked)))


def _checked_lines(checked: Checked) -> list[str]:
    """Return what the checker's theorem is over, and how much it ran."""
    counts = (
        f"{checked.states} states, {checked.frames} frames, {checked.cycles} cycles, {checked.forks} splits"
    )
    return [*(f"  over {text}" for text in checked.over), f"  checked: {counts}"]
