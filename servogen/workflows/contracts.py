"""A contract held against a program on the simulator, or against what was recorded on a bench.

In: a contract and a program with its stimulus, or the file of a recording. Out: a `ContractVerdict`.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import takewhile
from pathlib import Path

from servogen.contract import Contract, ContractVerdict, judge_contract
from servogen.contract.judge import not_judged
from servogen.edges import EdgeTrace, join
from servogen.errors import InputError, Location
from servogen.pic.image import Image
from servogen.programs import Program, clock_of
from servogen.simulator import Machine, SimulatorOptions, Stimuli
from servogen.simulator.pin_levels import at_the_pins
from servogen.traces.captures import is_capture, read_capture, read_recording
from servogen.units import Clock, Cycles

RUN_SECONDS = 20.0
"""The time for which a program runs unless another one is given."""


def contract_clock(contract: Contract, program: Program | None, clock_hz: int | None) -> Clock:
    """Return the clock: the one that was given, that of the contract, or that of the program, else 4 MHz."""
    return clock_of(program, clock_hz if clock_hz is not None else contract.clock_hz)


def pin_trace(
    image: Image, clock: Clock, cycles: Cycles, options: SimulatorOptions, stimulus: Stimuli | None
) -> EdgeTrace:
    """Return the levels at all pins from power-up on: the chip's own, and the stimulus's at its inputs."""
    machine = Machine(image, clock, options, stimulus)
    driven = join(machine.stream(cycles))
    if stimulus is None:
        return EdgeTrace(clock, (driven,), cycles)
    outside = takewhile(lambda change: change.cycle < cycles, stimulus.all_changes(clock))
    return EdgeTrace(clock, (at_the_pins(driven, outside),), cycles)


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

    A capture's times are those of its samples: an edge lies up to a sample away, so a range is kept as it
    is, and the sample is stated. Raises InputError.
    """
    captured = is_capture(file)
    trace = read_recording(file, clock, None, wires).stored()
    verdict = judge_contract(contract.clauses(clock), trace, from_reset=not captured, capture=captured)
    if not captured:
        return verdict
    capture = read_capture(file, wires)
    if capture.missing is not None:
        return not_judged(verdict, f"the capture is incomplete: {capture.missing}")
    if len(capture.pieces) > 1:
        raise InputError(
            "conflicting-options",
            "is stitched from several captures, between which nothing is known",
            Location(str(file)),
            "capture the contract's whole time at once",
        )
    return verdict
