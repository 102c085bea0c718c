"""Levels applied to a chip's pins from outside, to be written beside the edges of the chip.

In: the pins and their changes. Out: the rows of a file, merged with those of the edges in order of cycles.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from servogen.edges import PINS, UNDRIVEN, EdgeChunk, edge_chunk, join, part

INPUT_PINS = (*PINS, "MCLR")
"""Pins that something outside can drive; a pin's index is its number in `Inputs`."""

Ints = npt.NDArray[np.int64]
Rows = tuple[Ints, Ints]
"""(cycle, number of the row's text) of each row."""


@dataclass(frozen=True, slots=True)
class Inputs:
    """`pins` are the numbers of all pins that are ever driven, `chunks` their changes in order, restarted for
    each reader.

    A level is LOW, HIGH or, when a pin is released, UNDRIVEN.
    """

    pins: tuple[int, ...]
    chunks: Iterable[EdgeChunk]


NO_INPUTS = Inputs((), ())


class InputRows:
    """Returns the changes of inputs as rows up to where a writer has come; rows without a change are omitted.

    The text of a row has index 3 n + level for the n-th of the pins.
    """

    def __init__(self, inputs: Inputs) -> None:
        self._numbers = {pin: number for number, pin in enumerate(inputs.pins)}
        self._rest: Iterator[EdgeChunk] = iter(inputs.chunks)
        self._ahead = edge_chunk((), (), ())
        self._ended = False
        self._level = dict.fromkeys(inputs.pins, UNDRIVEN)

    def until(self, cycle: int) -> Rows:
        """Return the rows of all changes before `cycle` that have not been returned yet."""
        parts = [self._ahead]
        while not self._ended and (not len(parts[-1].cycle) or parts[-1].cycle[-1] < cycle):
            more = next(self._rest, None)
            self._ended = more is None
            parts += [] if more is None else [more]
        known = join(parts)
        size = int(np.searchsorted(known.cycle, cycle))
        self._ahead = part(known, slice(size, None))
        cycles, numbers = [], []
        for time, pin, level in zip(*(column[:size].tolist() for column in known), strict=True):
            if level != self._level[pin]:
                self._level[pin] = level
                cycles.append(time)
                numbers.append(3 * self._numbers[pin] + level)
        return np.array(cycles, dtype=np.int64), np.array(numbers, dtype=np.int64)


def merge_inputs(inputs: Rows, edges: Rows) -> Rows:
    """Return both in order of cycles; within one cycle, changes from outside come first."""
    cycles, numbers = (np.concatenate(pair) for pair in zip(inputs, edges, strict=True))
    order = np.argsort(cycles, kind="stable")
    return cycles[order], numbers[order]
