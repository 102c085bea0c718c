"""The command `simulate`: runs a program on the simulator and shows its results."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import typer

from servogen.cli.chip_options import ChipOptions
from servogen.cli.files import check_outputs, read_program
from servogen.cli.options import MAX_CYCLES, ClockHz, Json, OwnDevice, Seconds, StimulusFile
from servogen.cli.show import as_json, next_step, progress, table, warn_of_all
from servogen.edges import EdgeChunk, EdgeTrace
from servogen.errors import InputError
from servogen.outputs import atomic_write, write_text
from servogen.pic.image import to_hex
from servogen.programs import Program, chip_of, clock_of
from servogen.simulator import Machine, MachineState, Profile, SimulatorOptions, Stimuli, load_stimuli
from servogen.simulator import profile as profiled
from servogen.simulator import trace as traced
from servogen.simulator.stimulus import file_inputs
from servogen.traces import edge_writer, recorded
from servogen.units import Clock, Cycles, counted

DEFAULT_SECONDS = 1.0
MAX_LINES = 20
"""The maximum number of the profile's source lines that are shown, those with the most cycles first."""


@dataclass(frozen=True, slots=True)
class SimulationFiles:
    """The files to write."""

    edges: Annotated[Path | None, "Write the edges of the pins: .csv, .jsonl or .vcd."] = None
    vcd: Annotated[Path | None, "Write the edges of the pins as VCD."] = None
    trace: Annotated[Path | None, "Write every executed instruction with its source line."] = None
    eeprom: Annotated[Path | None, "Write the program with the final data EEPROM (.hex)."] = None


def simulate(
    file: Annotated[
        Path, typer.Argument(help="A HEX, C or assembly file, a job or its build.", show_default=False)
    ],
    chip: ChipOptions,
    files: SimulationFiles,
    seconds: Seconds = None,
    cycles: Annotated[int | None, typer.Option(min=0, max=MAX_CYCLES, help="Duration in cycles.")] = None,
    stimulus: StimulusFile = None,
    profile: Annotated[bool, "Show where the cycles were spent."] = False,
    clock_hz: ClockHz = None,
    device: OwnDevice = None,
    json: Json = False,
) -> None:
    """Run a program from reset on the simulator (default: for one second)."""
    check_outputs(
        [path for path in (file, stimulus) if path], files.edges, files.vcd, files.trace, files.eeprom
    )
    program = read_program(file, device)
    clock = clock_of(program, clock_hz)
    span = _span(clock, seconds, cycles)
    board = chip.on(chip_of(program, device))
    stimuli = load_stimuli(stimulus, clock) if stimulus else None
    machine = Machine(program.image, clock, board, stimuli)
    paths = [path for path in (files.edges, files.vcd) if path]
    with progress("simulating", span) as tell, ExitStack() as stack:
        inputs = file_inputs(stimuli, clock)
        writers = [stack.enter_context(edge_writer(path, clock, inputs=inputs)) for path in paths]
        reported = EdgeTrace(clock, _with_progress(machine.stream(span), tell), span)
        changes = sum(len(chunk.cycle) for chunk in recorded(reported, writers).driven())
    state = machine.state()
    if files.trace:
        _write_trace(files.trace, program, clock, board, stimuli, span)
    if files.eeprom:
        _write_eeprom(files.eeprom, program, state)
    spent = _profile_run(program, clock, board, stimuli, span) if profile else None
    if json:
        shown = {**state.to_json(), "edges": changes}
        as_json({**shown, **({"profile": spent.to_json()} if spent else {})}, state.warnings)
    else:
        _print_state(state, clock, changes)
        if spent:
            _print_profile(spent)
        if paths:
            print(next_step("measure", paths[0]))
        elif files.eeprom:
            print(next_step("simulate", files.eeprom))
        elif files.trace:
            print(next_step("watch", file))
    warn_of_all(state.warnings)


def _span(clock: Clock, seconds: float | None, cycles: int | None) -> Cycles:
    if seconds is not None and cycles is not None:
        raise InputError("conflicting-options", "--seconds and --cycles exclude each other: give one")
    if cycles is not None:
        return Cycles(cycles)
    return clock.round_seconds(DEFAULT_SECONDS if seconds is None else seconds)


def _with_progress(chunks: Iterator[EdgeChunk], tell: Callable[[int], None]) -> Iterator[EdgeChunk]:
    for chunk in chunks:
        if len(chunk.cycle):
            tell(int(chunk.cycle[-1]))
        yield chunk


def _write_trace(
    path: Path, program: Program, clock: Clock, board: SimulatorOptions, stimuli: Stimuli | None, span: Cycles
) -> None:
    machine = Machine(program.image, clock, board, stimuli)
    with atomic_write(path) as file:
        file.writelines(f"{row}\n" for row in traced(machine, span, program.listing))


def _write_eeprom(path: Path, program: Program, state: MachineState) -> None:
    write_text(path, to_hex(replace(program.image, eeprom=dict(enumerate(state.eeprom)))))


def _profile_run(
    program: Program, clock: Clock, board: SimulatorOptions, stimuli: Stimuli | None, span: Cycles
) -> Profile:
    return profiled(Machine(program.image, clock, board, stimuli), span, program.listing)


def _print_state(state: MachineState, clock: Clock, edges: int) -> None:
    print(f"{state.cycles} cycles, {float(clock.seconds(state.cycles)):g} s, {edges} edges")
    print(f"PC 0x{state.pc:03X}  W 0x{state.w:02X}  STATUS 0x{state.status:02X}")
    print("  ".join(f"{name} 0x{value:02X}" for name, value in state.registers.items()))
    resets = ", ".join(f"{count} {cause}" for cause, count in state.resets.items() if count)
    print(f"resets: {resets}; deepest stack {state.deepest_stack} of 8, {state.stack_wraps} wraps")


def _print_profile(profile: Profile) -> None:
    def share(cycles: int) -> str:
        return f"{100 * cycles / max(profile.cycles, 1):.2f}"

    dearest = sorted(profile.functions.items(), key=lambda item: -item[1].cycles)
    table(
        "Functions",
        ("function", "cycles", "%"),
        [(name or "-", spent.cycles, share(spent.cycles)) for name, spent in dearest],
    )
    lines = sorted(profile.lines.items(), key=lambda item: -item[1].cycles)[:MAX_LINES]
    if lines:
        table(
            "Lines",
            ("line", "cycles", "%", "executions"),
            [
                (f"{Path(file).name}:{line}", spent.cycles, share(spent.cycles), spent.executions)
                for (file, line), spent in lines
            ],
        )
    print(f"{100 * profile.coverage:.1f} % of the program's words were executed")
    written = counted(profile.ram_high_water, "byte")
    print(f"deepest stack {profile.deepest_stack} of 8, {written} of RAM written")
    if profile.read_unwritten:
        where = ", ".join(f"0x{address:02X}" for address in profile.read_unwritten)
        print(f"read before they were written: {where}")
