"""`verify --contract`, `prove --contract`: what a run or a recording shows of a contract, what is proven."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from servogen.cli.chip_options import ChipOptions
from servogen.cli.files import check_outputs, read_program
from servogen.cli.schedule_proof import NOT_PROVEN, PROVEN, Over
from servogen.cli.show import as_json, print_lines, status
from servogen.contract import Contract, ContractVerdict, load_contract, parse_contract
from servogen.outputs import write_text
from servogen.programs import chip_of
from servogen.prove.contract import MAX_STATES, ContractProof, prove_contract
from servogen.prove.counterexample import Counterexample
from servogen.simulator import load_stimuli
from servogen.toml.file import read_text
from servogen.units import Clock, counted
from servogen.workflows.certificates import Witnessed, contract_witness
from servogen.workflows.contracts import contract_clock, judge_program, judge_recording
from servogen.workflows.signals import is_program, refuse_chip_options, refuse_for_recording

if TYPE_CHECKING:
    from servogen.answers import ContractProofAnswer

EXTRA_CYCLES = 1000
"""Cycles that a counterexample is shown beyond its breach."""


@dataclass(frozen=True, slots=True)
class ContractRequest:
    """What was typed."""

    file: Path
    contract: Path
    chip: ChipOptions
    seconds: float | None
    stimulus: Path | None
    clock_hz: int | None
    wires: Mapping[str, str] | None
    device: str | None
    partial: bool
    json: bool


def verify_contract(request: ContractRequest) -> int:
    """Judge, print, and return the exit code."""
    contract = load_contract(request.contract)
    with status("judging every edge"):
        judged = _judge_program if is_program(request.file) else _judge_recording
        verdict = judged(request, contract)
    if request.json:
        as_json({"file": str(request.file), "contract": contract.document.file} | verdict.to_json())
    else:
        print_lines(verdict.lines())
    return 0 if verdict.accepted(request.partial) else 1


def _judge_program(request: ContractRequest, contract: Contract) -> ContractVerdict:
    program = read_program(request.file, request.device)
    board = request.chip.on(chip_of(program, request.device))
    clock = contract_clock(contract, program, request.clock_hz)
    stimulus = load_stimuli(request.stimulus, clock) if request.stimulus else None
    return judge_program(contract, program, clock, request.seconds, board, stimulus)


def _judge_recording(request: ContractRequest, contract: Contract) -> ContractVerdict:
    if request.device is not None or request.chip.given:
        refuse_chip_options(request.file)
    for key, given in (("--stimulus", request.stimulus), ("--seconds", request.seconds)):
        refuse_for_recording(request.file, key, given)
    clock = contract_clock(contract, None, request.clock_hz)
    return judge_recording(contract, request.file, clock, request.wires)


@dataclass(frozen=True, slots=True)
class ContractProofRequest:
    """What was typed."""

    file: Path
    contract: Path
    counterexample: Path
    over: Over
    clock_hz: int | None
    device: str | None
    max_states: int | None
    accept_one_engine: bool
    json: bool


def run_contract_proof(request: ContractProofRequest) -> int:
    """Prove, check, print, write the inputs of a counterexample, and return the exit code."""
    check_outputs([request.file, request.contract], request.counterexample)
    text = read_text(request.contract)
    contract = parse_contract(text, str(request.contract))
    program = read_program(request.file, request.device)
    board = request.over.board(chip_of(program, request.device))
    clock = contract_clock(contract, program, request.clock_hz)
    with status("following every path") as tell:
        proof = prove_contract(
            program.image,
            contract.clauses(clock),
            clock,
            request.over.quantifiers(),
            board,
            lambda explored, known: tell(f"{explored} of {known} states"),
            request.max_states or MAX_STATES,
        )
    witness = Witnessed()
    if proof.proven:
        with status("checking the proof"):
            witness = contract_witness(proof, program.image, text, clock, request.over.quantifiers())
    shown = proof.counterexample
    if shown is not None and shown.stimulus(clock):
        write_text(request.counterexample, shown.stimulus(clock))
    if request.json:
        as_json(_proof_json(proof, witness, request, clock))
    else:
        print_lines(_proof_lines(proof, witness, request, clock))
    return PROVEN if witness.checked or (proof.proven and request.accept_one_engine) else NOT_PROVEN


def _proof_lines(
    proof: ContractProof, witness: Witnessed, request: ContractProofRequest, clock: Clock
) -> list[str]:
    size = (
        f"  {counted(proof.states, 'state')}, {counted(proof.runs, 'run')}, {proof.cycles} cycles simulated"
    )
    shown = proof.counterexample
    if shown is not None:
        return [
            f"counterexample: {shown.message}, cycle {shown.cycle} from power-on",
            f"  {_replay(shown, request, clock)}",
        ]
    if not proof.proven:
        return [f"not decided: {proof.reason}", size]
    ran = witness.checked
    return [
        witness.text,
        f"  for {request.over.quantifiers().text(held=False)}: every clause is kept",
        size,
        *([f"  checked: {ran.states} states, {ran.cycles} cycles, {ran.forks} splits"] if ran else []),
        "  assumed:",
        *(f"    {assumption}" for assumption in proof.assumptions),
    ]


def _replay(shown: Counterexample, request: ContractProofRequest, clock: Clock) -> str:
    """Return the command that shows a counterexample."""
    stimulus = ["--stimulus", str(request.counterexample)] if shown.stimulus(clock) else []
    seconds = float(clock.seconds(shown.cycle + EXTRA_CYCLES))
    words = ["servogen", "verify", str(request.file), "--contract", str(request.contract), *stimulus]
    span = ["--clock-hz", str(clock.hz), "--seconds", f"{seconds:g}"]
    return shlex.join([*words, *shown.arguments(), *span])


def _proof_json(
    proof: ContractProof, witness: Witnessed, request: ContractProofRequest, clock: Clock
) -> ContractProofAnswer:
    shown = proof.counterexample
    return {
        "file": str(request.file),
        "contract": str(request.contract),
        "proven": proof.proven,
        "checked": witness.checked is not None,
        "reason": proof.reason or (witness.text if proof.proven and not witness.checked else ""),
        "counterexample": None
        if shown is None
        else {
            "message": shown.message,
            "cycle": shown.cycle,
            "command": _replay(shown, request, clock),
            "stimulus": shown.stimulus(clock) or None,
        },
        "states": proof.states,
        "runs": proof.runs,
        "simulated_cycles": proof.cycles,
        "assumptions": list(proof.assumptions),
    }
