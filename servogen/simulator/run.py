"""`simulate`: runs a program for a given time in one call."""

from __future__ import annotations

from dataclasses import dataclass

from servogen.edges import PINS, EdgeTrace, join
from servogen.errors import Diagnostic
from servogen.notebooks import table_html
from servogen.pic.image import Image
from servogen.simulator.machine import Machine, Stimulus
from servogen.simulator.options import SimulatorOptions
from servogen.simulator.state import MachineState
from servogen.units import Clock, Cycles


@dataclass(frozen=True, slots=True)
class Simulation:
    """The result of a run: the edges (in memory), the machine's state at the end, the warnings."""

    edges: EdgeTrace
    state: MachineState
    warnings: tuple[Diagnostic, ...]

    def __repr__(self) -> str:
        return f"<Simulation {_seconds(self.edges)}: {len(self.warnings)} warnings, PC 0x{self.state.pc:03X}>"

    def _repr_html_(self) -> str:
        changes = join(self.edges.chunks)
        rows = [(name, count) for pin, name in enumerate(PINS) if (count := int((changes.pin == pin).sum()))]
        title = f"{_seconds(self.edges)} on the simulator, {len(self.warnings)} warnings"
        return table_html(title, ("pin", "changes"), rows)


def _seconds(edges: EdgeTrace) -> str:
    return f"{float(edges.clock.seconds(edges.end)):g} s"


def simulate(
    image: Image,
    clock: Clock,
    cycles: int,
    options: SimulatorOptions = SimulatorOptions(),  # noqa: B008 - frozen
    stimulus: Stimulus | None = None,
) -> Simulation:
    """Run `image` from power-up for `cycles` instruction cycles."""
    machine = Machine(image, clock, options, stimulus)
    chunk = machine.run(cycles)
    state = machine.state()
    return Simulation(EdgeTrace(clock, (chunk,), Cycles(cycles)), state, state.warnings)
