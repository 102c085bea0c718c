"""Waves as text: what the pins did shortly before a test failed.

In: changes of pins, the chip's own and those from outside. Out: a line for each pin that changed.

    RB0  ▁▁▁▁▔▔▔▔▁▁▁▁▔▔▔▔▁▁▁▁      low and high
    RA4  ········▁▁▁▁▁▁▁▁▁▁▁▁      nothing drives it, then low
    RB7  ▁▁▒▒▒▒▒▒▁▁▁▁▁▁▁▁▁▁▁▁      several edges in each column
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from servogen.edges import UNDRIVEN, EdgeChunk
from servogen.simulator.sources import STIMULUS_PINS
from servogen.units import Clock
from servogen.verify.measurement import time_words

COLUMNS = 72
EDGES = 40
"""The number of edges shown, unless other reasons make the window longer."""
SIGNS = "▁▔·"
WORDS = dict(zip(SIGNS, ("low throughout", "high throughout", "not driven"), strict=True))
SEVERAL = "▒"


def wave_lines(levels: EdgeChunk, end: int, clock: Clock) -> list[str]:
    """Return the waves of the last edges up to cycle `end`."""
    if not len(levels.cycle):
        return [f"no pin changed until {time_words(end, clock)}"]
    begin = max(0, int(levels.cycle[-EDGES:][0]) - 1)
    column = -(-max(1, end - begin) // COLUMNS)
    width = -(-max(1, end - begin) // column)
    lines = [
        f"from {time_words(begin, clock)} to {time_words(end, clock)}, {time_words(column, clock)} per column"
    ]
    constant: dict[str, list[str]] = {}
    for pin in np.unique(levels.pin).tolist():
        own = levels.pin == pin
        wave = _wave(levels.cycle[own], levels.level[own], [begin + n * column for n in range(width + 1)])
        if len(set(wave)) > 1 or wave[0] == SEVERAL:
            lines.append(f"{STIMULUS_PINS[pin]:<4} {wave}")
        else:
            constant.setdefault(wave[0], []).append(STIMULUS_PINS[pin])
    return [*lines, *(f"{WORDS[sign]}: {', '.join(pins)}" for sign, pins in constant.items())]


def _wave(cycle: Sequence[int], level: Sequence[int], borders: Sequence[int]) -> str:
    """Return a sign for each column, between two borders: its last level, or that it has several edges."""
    places = np.searchsorted(cycle, borders)
    signs = []
    for before, after in zip(places[:-1].tolist(), places[1:].tolist(), strict=True):
        sign = SIGNS[int(level[after - 1]) if after else UNDRIVEN]
        signs.append(SEVERAL if after - before > 1 else sign)
    return "".join(signs)


def _rows(edges: EdgeChunk) -> Iterable[tuple[int, int, int]]:
    return zip(*(column.tolist() for column in edges), strict=True)
