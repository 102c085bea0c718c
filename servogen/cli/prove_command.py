"""`servogen prove`: what holds for every path of a program, and for every input."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from servogen.cli.contracts import ContractProofRequest, run_contract_proof
from servogen.cli.files import read_program
from servogen.cli.options import ClockHz, Json, OwnDevice
from servogen.cli.schedule_proof import NOT_PROVEN, PROVEN, Claim, Over, check_complete, prove_schedule
from servogen.cli.show import as_json, print_lines, status
from servogen.errors import InputError, Location
from servogen.job import load, plan_job
from servogen.pic.analysis.facts import Answer, Facts, decided_and_fine
from servogen.programs import clock_of, is_built_pair, is_job, pair_texts, read_pair
from servogen.prove.prover import MAX_STATES
from servogen.workflows.pair import planned_pair
from servogen.workflows.pair_proof import prove_pair


class Interrupts(StrEnum):
    """Whether the time of interrupts counts."""

    INCLUDED = "included"
    EXCLUDED = "excluded"


@dataclass(frozen=True, slots=True)
class TimeOptions:
    """The times to measure."""

    start: Annotated[
        list[str] | None,
        typer.Option(
            "--from",
            metavar="MARK",
            help="Where a measured time begins: an address (0x12A), a label, a function or a line "
            "(12 or main.c:12); repeatable, with one --to each.",
        ),
    ] = None
    end: Annotated[
        list[str] | None,
        typer.Option("--to", metavar="MARK", help="Where that time ends, the first time that it is reached."),
    ] = None
    interrupts: Annotated[Interrupts, "Whether times between marks include interrupts."] = Interrupts.INCLUDED
    clock_hz: ClockHz = None


def prove(
    file: Annotated[
        Path, typer.Argument(help="A HEX, C or assembly file, a job or its build.", show_default=False)
    ],
    claim: Claim,
    over: Over,
    times: TimeOptions,
    against: Annotated[Path | None, "Prove that it follows this schedule.json, for all inputs."] = None,
    contract: Annotated[Path | None, "Prove that it keeps this contract (TOML), for all inputs."] = None,
    device: OwnDevice = None,
    json: Json = False,
) -> None:
    """Show what holds for every path of a program: stack, unwritten bytes, pins, dead code, watchdog, times.

    With --against, or of the job or build of two chips, prove that every edge is the schedule's for every
    power-up, input and chip, and have the proof checked by an independent checker.

    Exit code 0: proven and checked, or decided and nothing found; 1: something was found or could not be
    decided, or the checker does not cover it.
    """
    if contract is not None:
        raise typer.Exit(_prove_contract(file, contract, against, claim, over, times, device, json))
    if against is not None:
        if times.start or times.end or times.clock_hz is not None:
            raise InputError(
                "conflicting-options", "--from, --to and --clock-hz are for a program without --against"
            )
        check_complete(claim, over)
        raise typer.Exit(prove_schedule(file, device, against, claim, over, json))
    if is_built_pair(file) or (is_job(file) and load(file).chips):
        raise typer.Exit(_prove_pair(file, claim, over, times, json))
    if claim != Claim(counterexample=claim.counterexample) or over != Over():
        raise InputError("conflicting-options", "this option needs --against")
    marks = _marks(times.start or [], times.end or [])
    program = read_program(file, device)
    with status("following every path") as tell:
        facts = Facts(program.image, program.listing, clock_of(program, times.clock_hz), tell)
        answers = [
            *facts.answers(),
            *(facts.time(a, b, interrupts=times.interrupts is Interrupts.INCLUDED) for a, b in marks),
        ]
    if json:
        as_json({"file": str(file), "answers": [answer.to_json() for answer in answers]})
    else:
        print_lines(line for answer in answers for line in _text(answer).splitlines())
    if not decided_and_fine(answers):
        raise typer.Exit(NOT_PROVEN)


def _prove_contract(
    file: Path,
    contract: Path,
    against: Path | None,
    claim: Claim,
    over: Over,
    times: TimeOptions,
    device: str | None,
    json: bool,
) -> int:
    """Prove that a program keeps a contract, and return the exit code. Raises InputError."""
    certified = claim.certificate is not None or claim.any_line is not None or claim.certify_held_inputs
    scheduled = against is not None or over.hold_inputs or over.any_eeprom
    if scheduled or certified or times.start or times.end:
        raise InputError(
            "conflicting-options",
            "--against, --certificate, --any-line, --certify-held-inputs, --hold-inputs, --any-eeprom, "
            "--from and --to are not for a contract",
            Location(str(contract), key="--contract"),
        )
    asked = ContractProofRequest(
        file=file,
        contract=contract,
        counterexample=claim.counterexample,
        over=over,
        clock_hz=times.clock_hz,
        device=device,
        max_states=claim.max_states,
        accept_one_engine=claim.accept_one_engine,
        json=json,
    )
    return run_contract_proof(asked)


def _prove_pair(file: Path, claim: Claim, over: Over, times: TimeOptions, json: bool) -> int:
    """Prove both programs of a pair's job or build, print the answer and return the exit code."""
    given = Claim(
        counterexample=claim.counterexample,
        accept_one_engine=claim.accept_one_engine,
        max_states=claim.max_states,
    )
    if claim != given or over != Over() or times != TimeOptions():
        raise InputError(
            "conflicting-options",
            "of two chips together, only --accept-one-engine, --max-states and --json",
            Location(str(file)),
            "for one of them, name its HEX file and --against its schedule.json",
        )
    with status("two chips: looking for every state, and checking"):
        if file.is_dir():
            schedules, images = read_pair(file)
            texts = pair_texts(file)
        else:
            pair = planned_pair(plan_job(load(file)))
            schedules, images, texts = pair.schedules, pair.images(), None
        proof = prove_pair(schedules, images, texts, claim.max_states or MAX_STATES)
    if json:
        as_json({"file": str(file), **proof.to_json()})
    else:
        print_lines(proof.lines())
    return PROVEN if proof.checked or (proof.proven and claim.accept_one_engine) else NOT_PROVEN


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
