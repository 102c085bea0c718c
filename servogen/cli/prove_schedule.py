"""What `prove FILE --against schedule.json` does: the proof for all inputs, and how its answer is shown."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from servogen.cli.files import keep_apart, read_program
from servogen.cli.show import as_json, status
from servogen.errors import InputError, Location
from servogen.programs import MAX_SCHEDULE_BYTES, read_schedule

if TYPE_CHECKING:
    from servogen.prove import Counterexample, Proof
    from servogen.pulse import PulseSchedule

PROVEN, NOT_PROVEN = 0, 1
EXTRA_FRAMES = 2
"""Frames after the wrong edge that a repeated counterexample shows."""


@dataclass(frozen=True, slots=True)
class Request:
    """The options of the command that belong to a schedule."""

    against: Path
    certificate: Path | None
    counterexample: Path
    inputs: bool
    tmr0_phase: bool
    max_states: int | None


def prove_schedule(file: Path, device: str | None, request: Request, json: bool) -> int:
    """Prove, show the answer, write what was asked for, and return the exit code. Raises InputError."""
    from servogen.inputs import read_input
    from servogen.prove import Quantifiers, certificate, prove_for_all
    from servogen.prove.prover import MAX_STATES
    from servogen.simulator import Options

    keep_apart([file, request.against], request.certificate, request.counterexample)
    schedule = read_schedule(request.against)
    if schedule.device is not None and device is not None and schedule.device != device:
        raise InputError(
            "conflicting-options",
            f"was built for a {schedule.device}, --device is {device}",
            Location(str(request.against)),
        )
    chip = schedule.device or device or Options().device
    program = read_program(file, chip)
    if program.clock and program.clock != schedule.clock:
        raise InputError(
            "conflicting-options",
            f"says {program.clock.hz} Hz, the schedule is for {schedule.clock.hz} Hz",
            Location(str(file)),
        )
    with status("looking for every state") as tell:
        proof = prove_for_all(
            program.image,
            schedule,
            Quantifiers(request.inputs, request.tmr0_phase),
            Options(device=chip),
            lambda done, found: tell(f"{done} of {found} states"),
            request.max_states or MAX_STATES,
        )
    if proof.proven and request.certificate is not None:
        from servogen.outputs import write_bytes

        text = read_input(request.against, MAX_SCHEDULE_BYTES)
        write_bytes(request.certificate, certificate(proof, program.image, schedule, text))
    if proof.counterexample is not None:
        _write_stimulus(proof.counterexample, schedule, request.counterexample)
    if json:
        as_json(_as_dict(proof, file, request, schedule))
    else:
        print("\n".join(_lines(proof, file, request, schedule)))
    return PROVEN if proof.proven else NOT_PROVEN


def _write_stimulus(found: Counterexample, schedule: PulseSchedule, path: Path) -> None:
    from servogen.outputs import write_text

    if found.levels:
        write_text(path, found.stimulus(schedule))


def _command(found: Counterexample, file: Path, request: Request, schedule: PulseSchedule) -> str:
    """Return the command that shows a counterexample's edges."""
    stimulus = ["--stimulus", str(request.counterexample)] if found.levels else []
    clock = [] if found.clock_hz else ["--clock-hz", str(schedule.clock.hz)]
    span = ["--cycles", str(found.cycle + EXTRA_FRAMES * schedule.period)]
    words = ["servogen", "simulate", str(file), *stimulus, *found.arguments(), *clock, *span]
    return shlex.join([*words, "--edges", "counterexample.csv"])


def _lines(proof: Proof, file: Path, request: Request, schedule: PulseSchedule) -> list[str]:
    found = proof.counterexample
    if found is not None:
        return [
            f"counterexample: {found.message}, cycle {found.cycle} from reset",
            f"  {_command(found, file, request, schedule)}",
        ]
    size = f"{proof.states} states, {proof.runs} runs of {proof.cycles} cycles together"
    if not proof.proven:
        return [f"not decided: {proof.reason}", f"  {size}"]
    over = "every power-up and chip" if proof.held else "every power-up, input and chip"
    return [
        f"proven for {over}: every edge of all pins is the schedule's",
        f"  {size}",
        "  assumed:",
        *(f"    {assumption}" for assumption in proof.assumptions),
    ]


def _as_dict(proof: Proof, file: Path, request: Request, schedule: PulseSchedule) -> dict[str, object]:
    found = proof.counterexample
    answer = "proven" if proof.proven else "counterexample" if found else "not decided"
    shown = None
    if found is not None:
        shown = {
            "message": found.message,
            "cycle": found.cycle,
            "command": _command(found, file, request, schedule),
            "stimulus": found.stimulus(schedule) if found.levels else None,
        }
    return {
        "file": str(file),
        "answer": answer,
        "reason": proof.reason,
        "states": proof.states,
        "runs": proof.runs,
        "cycles": proof.cycles,
        "assumptions": list(proof.assumptions),
        "counterexample": shown,
    }
