"""`Stimuli`: sources of changes, merged in order of cycles and packed for the instruction loop; recording and
replay.

In: sources, or an edge trace to replay. Out: pieces of changes as `Machine` takes them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from heapq import merge
from itertools import islice, takewhile

import numpy as np
import numpy.typing as npt

from servogen.edges import EdgeChunk, EdgeTrace, edge_chunk
from servogen.errors import InputError
from servogen.simulator.layout import MCLR_PIN, NEVER, PACK_CYCLE, PACK_PIN
from servogen.simulator.sources import (
    STIMULUS_PINS,
    BouncingButton,
    LevelChange,
    Levels,
    Periodic,
    Reset,
    Serial,
    SignalSource,
)
from servogen.traces import NO_INPUTS, Inputs
from servogen.units import Clock

PIECE = 4096
"""The maximum number of changes in a piece."""


@dataclass(frozen=True, slots=True)
class Stimuli:
    """All changes applied to the pins from outside. Changes in one cycle are in the order of the sources."""

    sources: Sequence[SignalSource]

    def all_changes(self, clock: Clock) -> Iterator[LevelChange]:
        """Yield every change, one by one, in order of cycles."""
        return merge(*(source.changes(clock) for source in self.sources), key=lambda change: change.cycle)

    def changes(self, clock: Clock) -> Iterator[tuple[int, npt.NDArray[np.int64]]]:
        """Yield pieces: (the cycle before which they all lie, the packed changes)."""
        merged = self.all_changes(clock)
        ordered = takewhile(lambda change: change.cycle < _END, merged)
        ahead = next(ordered, None)
        before = 0
        while ahead is not None:
            piece = [ahead, *islice(ordered, PIECE - 1)]
            ahead = next(ordered, None)
            while ahead is not None and ahead.cycle == piece[-1].cycle:  # a cycle is not divided
                piece.append(ahead)
                ahead = next(ordered, None)
            before = _check(piece, before)
            until = NEVER if ahead is None else ahead.cycle
            yield until, np.array([change.packed for change in piece], dtype=np.int64)


@dataclass(frozen=True, slots=True)
class _Chunks:
    """The changes of stimuli as chunks, restarted for each reader."""

    stimuli: Stimuli
    clock: Clock

    def __iter__(self) -> Iterator[EdgeChunk]:
        for _, packed in self.stimuli.changes(self.clock):
            pins = packed >> PACK_PIN & (1 << PACK_CYCLE - PACK_PIN) - 1
            yield edge_chunk(packed >> PACK_CYCLE, pins, packed & (1 << PACK_PIN) - 1)


def file_inputs(stimuli: Stimuli | None, clock: Clock) -> Inputs:
    """Return the changes of the stimuli in the form for edge files."""
    if stimuli is None:
        return NO_INPUTS
    pins = {pin for source in stimuli.sources for pin in _pins_in(source)}
    return Inputs(tuple(sorted(pins)), _Chunks(stimuli, clock))


def _pins_in(source: SignalSource) -> Sequence[int]:
    """Return the pins that a source may drive; all pins if it does not state them."""
    match source:
        case Levels() | Periodic() | BouncingButton() | Serial():
            return (source.pin,)
        case Reset():
            return (MCLR_PIN,)
        case _:
            return range(MCLR_PIN + 1)


def record(stimuli: Stimuli, clock: Clock, end: int) -> tuple[LevelChange, ...]:
    """Return every change before cycle `end`, for replay by `Recorded`."""
    return tuple(takewhile(lambda change: change.cycle < end, stimuli.all_changes(clock)))


@dataclass(frozen=True, slots=True)
class Recorded:
    """Recorded changes, replayed."""

    recording: Sequence[LevelChange]

    def changes(self, clock: Clock) -> Iterator[LevelChange]:
        yield from self.recording


@dataclass(frozen=True, slots=True)
class Wired:
    """Pins driven as another chip, or a capture, drove its own: `wires` maps that chip's pins to this
    one's.
    """

    trace: EdgeTrace
    wires: dict[int, int]

    def changes(self, clock: Clock) -> Iterator[LevelChange]:
        for chunk in self.trace.chunks:
            for cycle, pin, level in zip(*(column.tolist() for column in chunk), strict=True):
                if pin in self.wires:
                    yield LevelChange(cycle, self.wires[pin], level)


def _check(piece: list[LevelChange], before: int) -> int:
    for change in piece:
        if change.cycle < before or not 0 <= change.pin <= MCLR_PIN or not 0 <= change.level <= 2:
            name = STIMULUS_PINS[change.pin] if 0 <= change.pin <= MCLR_PIN else str(change.pin)
            raise InputError(
                "bad-stimulus",
                f"stimulus of {name} in cycle {change.cycle}, level {change.level}: "
                "cycles may not fall, pins are RA0 to RB7 and MCLR, levels 0, 1 and 2 (released)",
            )
        before = change.cycle
    return before


_END = NEVER >> PACK_CYCLE
"""The first cycle at which a change cannot be packed; no simulation is that long."""
