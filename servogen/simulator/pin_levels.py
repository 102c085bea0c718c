"""The levels at the pins: what the chip drives and, where it drives nothing, what the world does.

In: changes by the chip and from outside. Out: the changes that a probe at each pin would see.
"""

from __future__ import annotations

from collections.abc import Iterable

from servogen.edges import UNDRIVEN, EdgeChunk, edge_chunk
from servogen.simulator.sources import STIMULUS_PINS, LevelChange


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
