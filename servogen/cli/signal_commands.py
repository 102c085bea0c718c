"""Commands of signals: simulate, verify, measure, plot."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servogen.cli.files import read_image, read_schedule
from servogen.cli.options import ClockHz, Json
from servogen.cli.show import as_json, progress, warn

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from servogen.edges import EdgeChunk, EdgeTrace
    from servogen.pic.image import Image
    from servogen.pulse import PulseSchedule
    from servogen.simulator import State
    from servogen.units import Clock, Cycles

HEX_SUFFIXES = (".hex", ".ihx", ".h")
DEFAULT_SECONDS = 1.0
MEASURED_SECONDS = 20.0
"""Two rounds of the printed lab programs."""

Seconds = Annotated[float | None, typer.Option("--seconds", min=0, help="How long, in simulated seconds.")]


def register(app: typer.Typer) -> None:
    app.command()(simulate)
    app.command()(verify)
    app.command()(measure)
    app.command()(plot)


def simulate(
    file: Annotated[Path, typer.Argument(help="An Intel HEX file.", show_default=False)],
    seconds: Seconds = None,
    cycles: Annotated[int | None, typer.Option("--cycles", min=0, help="How long, in cycles.")] = None,
    edges: Annotated[
        Path | None, typer.Option("--edges", help="Write the pins' changes: .csv, .jsonl or .vcd.")
    ] = None,
    vcd: Annotated[Path | None, typer.Option("--vcd", help="Write the pins' changes as VCD.")] = None,
    clock_hz: ClockHz = 4_000_000,
    ra4_pull_up: Annotated[
        bool, typer.Option("--ra4-pull-up", help="RA4, an open drain, has a pull-up resistor.")
    ] = False,
    json: Json = False,
) -> None:
    """Run a HEX file from reset on the simulator (default: for one second)."""
    from servogen.edge_files import edge_writer, recorded
    from servogen.edges import EdgeTrace
    from servogen.simulator import Machine, Options
    from servogen.units import Clock

    image = read_image(file)
    clock = Clock(clock_hz)
    span = _span(clock, seconds, cycles)
    machine = Machine(image, clock, Options(ra4_pull_up=ra4_pull_up))
    paths = [path for path in (edges, vcd) if path]
    with progress("simulating", span) as tell, ExitStack() as files:
        writers = [files.enter_context(edge_writer(path, clock)) for path in paths]
        trace = EdgeTrace(clock, _told(machine.stream(span), tell), span)
        changes = sum(len(chunk.cycle) for chunk in recorded(trace, writers).driven())
    state = machine.state()
    for warning in state.warnings:
        warn(str(warning))
    if json:
        as_json(_state_as_dict(state, changes))
    else:
        _print_state(state, clock, changes)


def verify(
    file: Annotated[Path, typer.Argument(help="A HEX, VCD, CSV or JSONL file.", show_default=False)],
    against: Annotated[Path, typer.Option("--against", help="The schedule.json it should follow.")],
    seconds: Seconds = None,
    json: Json = False,
) -> None:
    """Hold every edge of a HEX or of recorded edges against a schedule (default: the motion three times)."""
    from servogen.pipeline import checked_cycles, prove
    from servogen.verify import verdict_lines

    schedule = read_schedule(against)
    span = checked_cycles(schedule) if seconds is None else schedule.clock.round_seconds(seconds)
    verdict = prove(schedule, _trace(file, schedule, span), span)
    if json:
        as_json(verdict.to_json())
    else:
        print("\n".join(verdict_lines(verdict)))
    raise typer.Exit(0 if verdict.proven else 1)


def measure(
    file: Annotated[Path, typer.Argument(help="A HEX, VCD, CSV or JSONL file.", show_default=False)],
    seconds: Seconds = None,
    servo: Annotated[
        list[str] | None,
        typer.Option("--servo", help="Judge by this model: MODEL for all pins, or PIN=MODEL."),
    ] = None,
    clock_hz: ClockHz = 4_000_000,
    json: Json = False,
) -> None:
    """Say what pulses a HEX or recorded edges make on each pin, and what is doubtful about them."""
    from servogen.edge_files import read_edges
    from servogen.pipeline.measuring import cautions, servos_named
    from servogen.units import Clock
    from servogen.verify import measure as measured
    from servogen.verify import measurement_lines

    models = servos_named(servo or [])
    clock = Clock(clock_hz)
    if file.suffix.lower() in HEX_SUFFIXES:
        trace = _run(read_image(file), clock, clock.round_seconds(seconds or MEASURED_SECONDS))
    else:
        trace = read_edges(file, clock, None if seconds is None else clock.round_seconds(seconds))
    measurement = measured(trace)
    found = cautions(measurement, models)
    if json:
        warnings = [{"code": each.code, "text": each.text} for each in found]
        as_json({**measurement.to_json(), "warnings": warnings})
        return
    print("\n".join(measurement_lines(measurement)))
    for caution in found:
        warn(str(caution))


def plot(
    file: Annotated[Path, typer.Argument(help="A HEX, VCD, CSV or JSONL file.", show_default=False)],
    against: Annotated[Path, typer.Option("--against", help="The schedule.json that names its channels.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="A .png, .svg or .pdf file.")],
    seconds: Seconds = None,
) -> None:
    """Draw the pulses of a HEX or of recorded edges (default: the motion once)."""
    from servogen.pipeline import motion_cycles
    from servogen.report.pulse_plot import pulse_plot

    schedule = read_schedule(against)
    span = motion_cycles(schedule) if seconds is None else schedule.clock.round_seconds(seconds)
    title = f"{file.name}: {float(schedule.clock.seconds(span)):g} s"
    pulse_plot(schedule, _trace(file, schedule, span), span, output, title)
    print(f"{output}: pulses of {file}")


def _trace(file: Path, schedule: PulseSchedule, span: Cycles) -> EdgeTrace:
    """The edges of a HEX file, running, or those that a file holds."""
    from servogen.edge_files import read_edges
    from servogen.pipeline import running

    if file.suffix.lower() in HEX_SUFFIXES:
        return running(schedule, read_image(file), span)
    return read_edges(file, schedule.clock)


def _run(image: Image, clock: Clock, span: Cycles) -> EdgeTrace:
    """The edges of a HEX file of which nothing is known."""
    from servogen.edges import EdgeTrace
    from servogen.simulator import Machine

    return EdgeTrace(clock, Machine(image, clock).stream(span), span)


def _span(clock: Clock, seconds: float | None, cycles: int | None) -> Cycles:
    from servogen.errors import InputError
    from servogen.units import Cycles

    if seconds is not None and cycles is not None:
        raise InputError("--seconds and --cycles say the same thing: give one")
    if cycles is not None:
        return Cycles(cycles)
    return clock.round_seconds(DEFAULT_SECONDS if seconds is None else seconds)


def _told(chunks: Iterator[EdgeChunk], tell: Callable[[int], None]) -> Iterator[EdgeChunk]:
    for chunk in chunks:
        if len(chunk.cycle):
            tell(int(chunk.cycle[-1]))
        yield chunk


def _state_as_dict(state: State, edges: int) -> dict[str, object]:
    return {
        "cycles": state.cycles,
        "pc": state.pc,
        "w": state.w,
        "status": state.status,
        "ram": list(state.ram),
        "registers": dict(state.registers),
        "eeprom": list(state.eeprom),
        "resets": dict(state.resets),
        "stack_wraps": state.stack_wraps,
        "deepest_stack": state.deepest_stack,
        "edges": edges,
        "sleeping": state.sleeping,
        "warnings": [str(warning) for warning in state.warnings],
    }


def _print_state(state: State, clock: Clock, edges: int) -> None:
    print(f"{state.cycles} cycles, {float(clock.seconds(state.cycles)):g} s, {edges} edges")
    print(f"PC 0x{state.pc:03X}  W 0x{state.w:02X}  STATUS 0x{state.status:02X}")
    print("  ".join(f"{name} 0x{value:02X}" for name, value in state.registers.items()))
    resets = ", ".join(f"{count} {cause}" for cause, count in state.resets.items() if count)
    print(f"resets: {resets}; deepest stack {state.deepest_stack} of 8, {state.stack_wraps} wraps")
