"""A motion cut into parts: what repeats is stored once.

In: the ideal widths, one row per frame. Out: successive `Stretch`es: a number of frames, and how often they
are played.

    start │ cycle │ cycle │ cycle │ stop        becomes        start, 3 × cycle, stop
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from servogen.errors import InputError
from servogen.motion.trajectory import Floats
from servogen.pic.device import PROGRAM_WORDS

ALIKE = 0.01
"""Widths that differ by less than this, in cycles, are equal."""

WORTH = 12
"""Frames that a repetition must save, since a part costs words too."""

MAX_COUNT = 250
"""Repetitions and their frames are counted in bytes."""

MAX_FRAMES_PER_PART = 256
"""Frames at which what does not repeat is cut: 0 in a byte, and a multiple of every keyframe distance."""


MAX_PARTS = PROGRAM_WORDS // 5
"""More do not fit: each part takes a word in each of five tables."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """`repeats` times the `frames` frames from `first` on; `silent`: without pulses."""

    first: int
    frames: int
    repeats: int
    silent: bool


def stretches(rows: Floats, following: Floats) -> tuple[Stretch, ...]:
    """Return the parts of `rows` (frames, channels); `following` is the row of the frame after them.

    Raises InputError for more than `MAX_PARTS`.
    """
    silent = np.asarray(np.isnan(rows).all(axis=1))
    found_parts: list[Stretch] = []
    bounds = [0, *(np.flatnonzero(silent[1:] != silent[:-1]) + 1).tolist(), len(rows)]
    for first, end in pairwise(bounds):
        after = rows[end] if end < len(rows) else following
        if first == end:
            continue
        parts = (
            _held(first, end - first, silent=True)
            if silent[first]
            else _cut(np.vstack((rows[first:end], after)), first)
        )
        for part in parts:
            found_parts.append(part)
            if len(found_parts) > MAX_PARTS:
                raise InputError(
                    "does-not-fit",
                    f"the motion has more than {MAX_PARTS} parts, which no program can hold",
                    hint="shorten the motion, or let more of it repeat",
                )
    return tuple(found_parts)


def _cut(rows: Floats, offset: int) -> Iterator[Stretch]:
    """Yield the parts of all rows but the last, which is the frame after them."""
    frames = len(rows) - 1
    if frames <= 0:
        return
    saved, period, start, times = _repetition(rows)
    if saved < WORTH:
        for first in range(0, frames, MAX_FRAMES_PER_PART):
            yield Stretch(offset + first, min(MAX_FRAMES_PER_PART, frames - first), 1, silent=False)
        return
    yield from _cut(rows[: start + 1], offset)
    if period == 1:
        yield from _held(offset + start, times, silent=False)
    else:
        for first in range(0, times, MAX_COUNT):
            yield Stretch(offset + start, period, min(MAX_COUNT, times - first), silent=False)
    end = start + period * times
    yield from _cut(rows[end:], offset + end)


def _held(first: int, frames: int, *, silent: bool) -> Iterator[Stretch]:
    whole, rest = divmod(frames, MAX_COUNT)
    for done in range(0, whole, MAX_COUNT):
        yield Stretch(first + done * MAX_COUNT, MAX_COUNT, min(MAX_COUNT, whole - done), silent)
    if rest:
        yield Stretch(first + whole * MAX_COUNT, rest, 1, silent)


def _repetition(rows: Floats) -> tuple[int, int, int, int]:
    """Return what saves most: (frames saved, period, first frame, times), all 0 if nothing repeats."""
    best = (0, 0, 0, 0)
    for period in range(1, min(MAX_COUNT, (len(rows) - 1) // 2) + 1):
        same = (np.abs(rows[period:] - rows[:-period]) < ALIKE).all(axis=1)
        edges = np.flatnonzero(np.diff(np.concatenate(([0], same.view(np.int8), [0]))))
        for start, end in edges.reshape(-1, 2).tolist():
            # The row after the last repetition is alike too: the last keyframe leads to it.
            times = (end - start + period - 1) // period
            if (times - 1) * period <= best[0]:
                continue
            times = _alike(rows[start : start + times * period].reshape(times, period, -1))
            saved = (times - 1) * period
            if times >= 2 and saved > best[0]:
                best = (saved, period, start, times)
    return best


def _alike(rounds: Floats) -> int:
    """Return how many `rounds` from the first on are like the first; each is like the next, but may drift."""
    far = np.flatnonzero((np.abs(rounds - rounds[0]) >= ALIKE).any(axis=(1, 2)))
    return int(far[0]) if len(far) else len(rounds)
