"""`measure`: a table of what a HEX file does on each pin, from its edges alone.

In: a trace, as a stream. Out: a `Measurement`: widths, periods, kinds of frame, pauses, runs, overlaps. The
pulses are run-length encoded while they are read, so that a day of them needs little memory.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from servogen.edges import PINS, EdgeTrace
from servogen.units import Cycles
from servogen.verify.measure.measurement import FrameKind, Measurement, Pause, PinMeasurement, Run
from servogen.verify.measure.trains import LAST, MOST_ROWS, Train, TrainBuilder
from servogen.verify.overlap import OverlapCount
from servogen.verify.windows import Ints, Windows, observed_edges

Flags = npt.NDArray[np.bool_]

WINDOW = 1 << 22
"""Cycles that are read at a time."""

PAUSE_PERIODS = 3
"""A time from rise to rise of more than so many (median) periods has a pause in it."""


def measure(observed: EdgeTrace) -> Measurement:
    """Return the measurement of `observed`, read to its end or until its pulses exceed the number of rows
    kept.
    """
    windows = Windows(observed_edges(chunk, 0) for chunk in observed.driven())
    builders = [TrainBuilder(pin) for pin in range(len(PINS))]
    overlaps = OverlapCount()
    now = Cycles(0)
    while now < observed.end and max(builder.rows for builder in builders) < MOST_ROWS:
        ahead = windows.first()
        now = observed.end if ahead is None else Cycles(min(max(now, ahead) + WINDOW, observed.end))
        edges = windows.until(now)
        for pin in np.flatnonzero(np.bincount(edges.pin, minlength=len(PINS))).tolist():
            builders[pin].add(edges)
        overlaps.add(edges)
    trains = [(pin, builder.finish()) for pin, builder in enumerate(builders)]
    pins = tuple(measure_pin(pin, train) for pin, train in trains if len(train.first))
    return Measurement(observed.clock, now, pins, overlaps.finish(now), now == observed.end)


def measure_pin(pin: int, train: Train) -> PinMeasurement:
    """Return the measurement of one pin's pulses."""
    followed = train.period != LAST
    period = _median(train.period[followed], train.count[followed])
    paused = followed & (train.period > (PAUSE_PERIODS * period if period else 0))
    steady = followed & ~paused
    return PinMeasurement(
        pin,
        int(train.count.sum()),
        Cycles(int(train.first[0])),
        _counted(train.width, train.count),
        _counted(train.period[steady], train.count[steady]),
        Cycles(period) if period else None,
        tuple(_kinds(train.width[steady], train.period[steady], train.count[steady])),
        tuple(_pauses(train, paused)),
        tuple(_runs(train, paused)),
        None if train.open_rise is None else Cycles(train.open_rise),
    )


def _median(values: Ints, counts: Ints) -> int:
    """Return the median of all values, the lower one of two; 0 if there are none."""
    if not len(values):
        return 0
    order = np.argsort(values, kind="stable")
    below = np.cumsum(counts[order])
    return int(values[order][np.searchsorted(below, (below[-1] + 1) // 2)])


def _counted(values: Ints, counts: Ints) -> dict[Cycles, int]:
    """Return how often each value occurs, by value."""
    distinct, at = np.unique(values, return_inverse=True)
    totals = np.zeros(len(distinct), dtype=np.int64)
    np.add.at(totals, at, counts)
    return {Cycles(value): total for value, total in zip(distinct.tolist(), totals.tolist(), strict=True)}


def _kinds(width: Ints, period: Ints, count: Ints) -> Iterator[FrameKind]:
    for value in np.unique(width).tolist():
        own = width == value
        periods = _counted(period[own], count[own])
        frames = sum(periods.values())
        if frames > 1:
            yield FrameKind(Cycles(value), frames, max(periods, key=lambda cycles: periods[cycles]))


def _pauses(train: Train, paused: Flags) -> Iterator[Pause]:
    for row in np.flatnonzero(paused).tolist():
        first, width, period = (int(column[row]) for column in (train.first, train.width, train.period))
        yield Pause(Cycles(first + width), Cycles(period - width), int(train.count[row]))


def _runs(train: Train, paused: Flags) -> Iterator[Run]:
    """Yield adjacent rows of one width without a pause between them; single pulses with equal pauses form a
    run too.
    """
    alone = paused & (train.count > 1)
    parted = paused[:-1] | alone[1:] | (np.diff(train.width) != 0)
    bounds = [0, *(np.flatnonzero(parted) + 1).tolist(), len(train.first)]
    for begin, end in pairwise(bounds):
        yield _run(train, begin, end - 1)


def _run(train: Train, begin: int, last: int) -> Run:
    periods = train.period[begin : last + 1]
    # The period after a run's last pulse leads out of the run.
    inside = periods[:-1] if train.count[last] == 1 else periods
    inside = inside[inside != LAST]
    return Run(
        Cycles(int(train.first[begin])),
        int(train.count[begin : last + 1].sum()),
        Cycles(int(train.width[begin])),
        Cycles(int(inside.min())) if len(inside) else None,
        Cycles(int(inside.max())) if len(inside) else None,
    )
