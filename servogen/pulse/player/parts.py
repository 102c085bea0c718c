"""A motion cut into parts: what is repeated is kept once.

In: the ideal widths, one row a frame. Out: `Stretch`es that follow one another: a number of frames, and how
often they are played.

    start │ cycle │ cycle │ cycle │ stop        becomes        start, 3 × cycle, stop
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from servogen.motion.trajectory import Floats

ALIKE = 0.01
"""Widths, in cycles, that are nearer than this are the same."""

WORTH = 12
"""Frames that a repetition must save: a part of its own costs words too."""

MOST = 250
"""Repetitions and their frames are counted in bytes."""

LONGEST = 256
"""What does not repeat is cut here: in a byte 0, and whole keyframes however far they are apart."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """`repeats` times the `frames` frames from `first` on; `silent`: without pulses."""

    first: int
    frames: int
    repeats: int
    silent: bool


def stretches(rows: Floats, following: Floats) -> tuple[Stretch, ...]:
    """The parts of `rows` (frames, channels); `following` is the row of the frame after them."""
    silent = np.asarray(np.isnan(rows).all(axis=1))
    found: list[Stretch] = []
    bounds = [0, *(np.flatnonzero(silent[1:] != silent[:-1]) + 1).tolist(), len(rows)]
    for first, end in pairwise(bounds):
        after = rows[end] if end < len(rows) else following
        if first < end and silent[first]:
            found += _held(first, end - first, silent=True)
        elif first < end:
            found += _cut(np.vstack((rows[first:end], after)), first)
    return tuple(found)


def _cut(rows: Floats, offset: int) -> Iterator[Stretch]:
    """The parts of all rows but the last, which is the frame after them."""
    frames = len(rows) - 1
    if frames <= 0:
        return
    saved, period, start, times = _repetition(rows)
    if saved < WORTH:
        for first in range(0, frames, LONGEST):
            yield Stretch(offset + first, min(LONGEST, frames - first), 1, silent=False)
        return
    yield from _cut(rows[: start + 1], offset)
    if period == 1:
        yield from _held(offset + start, times, silent=False)
    else:
        for first in range(0, times, MOST):
            yield Stretch(offset + start, period, min(MOST, times - first), silent=False)
    end = start + period * times
    yield from _cut(rows[end:], offset + end)


def _held(first: int, frames: int, *, silent: bool) -> Iterator[Stretch]:
    whole, rest = divmod(frames, MOST)
    for done in range(0, whole, MOST):
        yield Stretch(first + done * MOST, MOST, min(MOST, whole - done), silent)
    if rest:
        yield Stretch(first + whole * MOST, rest, 1, silent)


def _repetition(rows: Floats) -> tuple[int, int, int, int]:
    """What saves most: (frames saved, period, first frame, times), all 0 where nothing repeats."""
    best = (0, 0, 0, 0)
    for period in range(1, min(MOST, (len(rows) - 1) // 2) + 1):
        same = (np.abs(rows[period:] - rows[:-period]) < ALIKE).all(axis=1)
        edges = np.flatnonzero(np.diff(np.concatenate(([0], same.view(np.int8), [0]))))
        for start, end in edges.reshape(-1, 2).tolist():
            # The row after the last repetition is alike too: the last keyframe leads to it.
            times = (end - start + period - 1) // period
            saved = (times - 1) * period
            if times >= 2 and saved > best[0]:
                best = (saved, period, start, times)
    return best
