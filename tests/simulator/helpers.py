"""Short ways to say: this assembly, run so long, what came of it."""

from __future__ import annotations

from collections.abc import Sequence

from servogen.edges import PINS
from servogen.pic.assembler import assemble
from servogen.pic.image import Image
from servogen.simulator import LevelChange, Machine, Recorded, SimulatorOptions, Stimuli
from servogen.simulator.sources import pin_number
from servogen.units import Clock

CLOCK = Clock(4_000_000)
HEAD = """
        list p=16f84a, r=dec
        include <p16f84a.inc>
        errorlevel -302
"""
WATCHDOG_OFF = "        __config _XT_OSC & _WDT_OFF & _PWRTE_OFF\n"


def image(source: str, config: str = WATCHDOG_OFF) -> Image:
    """The image of assembly lines; labels stand in the first column."""
    return assemble(f"{HEAD}{config}{source}\n        end\n", "test.asm").image


def machine(
    source: str | Image,
    options: SimulatorOptions = SimulatorOptions(device="PIC16F84A"),  # noqa: B008 - frozen
    changes: Sequence[tuple[int, str, int]] = (),
    config: str = WATCHDOG_OFF,
) -> Machine:
    """A machine before cycle 0; `changes` are (cycle, pin, level) from outside."""
    program = source if isinstance(source, Image) else image(source, config)
    recording = [LevelChange(cycle, pin_number(pin), level) for cycle, pin, level in changes]
    return Machine(program, CLOCK, options, Stimuli([Recorded(recording)]) if changes else None)


def edges(chip: Machine, cycles: int, pin: str | None = None) -> list[tuple[int, str, int]]:
    """Run on for `cycles`: (cycle, pin, level) of every edge, or of one pin's."""
    columns = (column.tolist() for column in chip.run(cycles))
    named = [(cycle, PINS[number], level) for cycle, number, level in zip(*columns, strict=True)]
    return [edge for edge in named if pin is None or edge[1] == pin]


def steps(chip: Machine, count: int) -> Machine:
    """Execute `count` instructions."""
    for _ in range(count):
        chip.step()
    return chip


def ram(chip: Machine, address: int) -> int:
    return chip.state().ram[address - 0x0C]
