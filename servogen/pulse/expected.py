"""The edges of a schedule, endless, in chunks of arrays.

In: a `PulseSchedule`. Out: `edges.Expected`, whose chunks are computed as they are read: a day of edges needs
no more memory than a second.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from servogen.edges import HIGH, LOW, PINS, Expected, ExpectedChannel, ExpectedChunk
from servogen.pulse.schedule import PulseSchedule, Run
from servogen.units import Cycles

CHUNK_EDGES = 1 << 16
"""The approximate number of edges per chunk."""


def expected(schedule: PulseSchedule) -> Expected:
    """Return the edges of `schedule`; time zero is the first edge. They end only if the loop has no pulse."""
    tape = schedule.tape
    return Expected(
        clock=schedule.clock,
        period=schedule.period,
        channels=tuple(
            ExpectedChannel(channel.name, PINS.index(channel.pin)) for channel in schedule.channels
        ),
        lead_in=schedule.lead_in_frames,
        loop=schedule.loop_frames,
        chunks=_Chunks(schedule),
        plan_error=schedule.plan_error,
        others=tuple(PINS.index(pin) for pin in (tape.scl, tape.sda)) if tape else (),
    )


@dataclass(frozen=True, slots=True)
class _Chunks:
    """The chunks from the first edge on; every iteration starts again."""

    schedule: PulseSchedule

    def __iter__(self) -> Iterator[ExpectedChunk]:
        zero: np.int64 | None = None
        for chunk in _from_frame_zero(self.schedule):
            if len(chunk.cycle):
                zero = chunk.cycle[0] if zero is None else zero
                yield chunk._replace(cycle=chunk.cycle - zero)


def _from_frame_zero(schedule: PulseSchedule) -> Iterator[ExpectedChunk]:
    """Yield the chunks with time zero at the beginning of the first frame."""
    yield from _once(schedule, schedule.lead_in, 0)
    frames, first = schedule.loop_frames, schedule.lead_in_frames
    edges = sum(run.frames * len(_edges(schedule, run).cycle) for run in schedule.loop)
    if edges == 0:
        return
    if edges > CHUNK_EDGES:
        while True:
            yield from _once(schedule, schedule.loop, first)
            first += frames
    # A short loop is computed once and repeated within each chunk.
    parts = list(_once(schedule, schedule.loop, 0))
    turn = ExpectedChunk(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
    turns = max(1, CHUNK_EDGES // edges)
    block = _repeat(turn, turns, frames, schedule.period)
    while True:
        yield _shift(block, first, schedule.period)
        first += turns * frames


def _once(schedule: PulseSchedule, runs: tuple[Run, ...], first: int) -> Iterator[ExpectedChunk]:
    """Yield the edges of `runs`, the first of whose frames is frame `first`."""
    for run in runs:
        frame = _edges(schedule, run)
        block = max(1, CHUNK_EDGES // max(1, len(frame.cycle)))
        for start in range(0, run.frames, block) if len(frame.cycle) else ():
            frames = min(block, run.frames - start)
            yield _shift(_repeat(frame, frames, 1, schedule.period), first + start, schedule.period)
        first += run.frames


def _edges(schedule: PulseSchedule, run: Run) -> ExpectedChunk:
    """Return the edges of one frame of `run`, in order of time, then of pin."""
    edges = sorted(
        (cycle, PINS.index(channel.pin), level)
        for channel, pulse in zip(schedule.channels, run.pulses, strict=True)
        if pulse
        for cycle, level in ((pulse.rise, HIGH), (pulse.rise + pulse.width, LOW))
    )
    table = np.array(edges, dtype=np.int64).reshape(-1, 3)
    return ExpectedChunk(
        table[:, 0],
        table[:, 1].astype(np.uint8),
        table[:, 2].astype(np.uint8),
        np.zeros(len(table), np.int64),
    )


def _repeat(chunk: ExpectedChunk, times: int, frames: int, period: Cycles) -> ExpectedChunk:
    """Return `chunk`, which fills `frames` frames, `times` times in a row."""
    shift = np.repeat(np.arange(times, dtype=np.int64) * frames, len(chunk.cycle))
    return ExpectedChunk(
        np.tile(chunk.cycle, times) + shift * period,
        np.tile(chunk.pin, times),
        np.tile(chunk.level, times),
        np.tile(chunk.frame, times) + shift,
    )


def _shift(chunk: ExpectedChunk, frames: int, period: Cycles) -> ExpectedChunk:
    """Return a chunk moved by `frames` frames."""
    return chunk._replace(cycle=chunk.cycle + frames * period, frame=chunk.frame + frames)
