"""A contract held against a program on the simulator, or against what was recorded on a bench.

In: a contract and a program with its stimulus, or the file of a recording. Out: a `ContractVerdict`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from servogen.contract import Contract, ContractVerdict, judge_contract
from servogen.errors import InputError, Location
from servogen.programs import Program, clock_of
from servogen.simulator import SimulatorOptions, Stimuli
from servogen.simulator.pin_levels import pin_trace
from servogen.traces.captures import is_capture, read_capture, read_recording
from servogen.units import Clock

RUN_SECONDS = 20.0
"""The time for which a program runs unless another one is given."""


def contract_clock(contract: Contract, program: Program | None, clock_hz: int | None) -> Clock:
    """Return the clock: the one that was given, that of the contract, or that of the program, else 4 MHz."""
    return clock_of(program, clock_hz if clock_hz is not None else contract.clock_hz)


def judge_program(
    contract: Contract,
    program: Program,
    clock: Clock,
    seconds: float | None,
    options: SimulatorOptions,
    stimulus: Stimuli | None = None,
) -> ContractVerdict:
    """Return the verdict on one run from power-up."""
    cycles = clock.round_seconds(RUN_SECONDS if seconds is None else seconds)
    trace = pin_trace(program.image, clock, cycles, options, stimulus)
    return judge_contract(contract.clauses(clock), trace, from_reset=True)


def judge_recording(
    contract: Contract, file: Path, clock: Clock, wires: Mapping[str, str] | None = None
) -> ContractVerdict:
    """Return the verdict on a recording: edges in cycles of a chip from its reset on, or a capture.

    A capture's times are those of its samples. Raises InputError.
    """
    clauses = contract.clauses(clock)
    if not is_capture(file):
        return judge_contract(clauses, read_recording(file, clock, None, wires), from_reset=True)
    capture = read_capture(file, wires)
    if len(capture.pieces) > 1:
        raise InputError(
            "conflicting-options",
            "is stitched from several captures, between which nothing is known",
            Location(str(file)),
            "capture the contract's whole time at once",
        )
    trace = read_recording(file, clock, None, wires)
    verdict = judge_contract(clauses, trace, from_reset=False, capture=True)
    if capture.missing is None:
        return verdict
    return replace(verdict, unseen=(f"the capture is incomplete: {capture.missing}",))
