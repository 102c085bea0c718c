"""The levels at the pins: what the chip drives and, where it drives nothing, what the world does.

In: changes by the chip and from outside. Out: the changes that a probe at each pin would see.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import takewhile

from servogen.edges import UNDRIVEN, EdgeChunk, EdgeTrace, edge_chunk, join
from servogen.pic.image import Image
from servogen.simulator.machine import Machine
from servogen.simulator.options import SimulatorOptions
from servogen.simulator.sources import STIMULUS_PINS, LevelChange
from servogen.simulator.stimulus import Stimuli
from servogen.units import Clock, Cycles


def at_the_pins(driven: EdgeChunk, outside: Iterable[LevelChange]) -> EdgeChunk:
    """Return the levels at the pins: what the chip drives or, at its inputs, what drives those."""
    columns = (column.tolist() for column in driven)
    rows = [
        *((cycle, 1, pin, level) for cycle, pin, level in zip(*columns, strict=True)),
        *((change.cycle, 0, change.pin, change.level) for change in outside),
    ]
    chip, world = ([UNDRIVEN] * len(STIMULUS_PINS) for _ in range(2))
    seen = [UNDRIVEN] * len(STIMULUS_PINS)
    changes = []
    for cycle, by_chip, pin, level in sorted(rows, key=lambda row: row[:2]):
        (chip if by_chip else world)[pin] = level
        now = world[pin] if chip[pin] == UNDRIVEN else chip[pin]
        if now != seen[pin]:
            seen[pin] = now
            changes.append((cycle, pin, now))
    return edge_chunk(*zip(*changes, strict=True)) if changes else edge_chunk((), (), ())


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
