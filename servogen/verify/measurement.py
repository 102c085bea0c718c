"""`measure`: what a HEX file does on each pin, from its edges alone, without a schedule for comparison.

In: a trace, as a stream. Out: a `Measurement`: widths, periods, kinds of frame, pauses, runs, overlaps, all
in cycles; and its lines of text. The pulses are run-length encoded while they are read, equal neighbours in
one row (first rise, pulses, width, time from rise to next rise), so that an hour of a servo program takes a
few rows; `MAX_ROWS` limits traces that never repeat.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from servogen.edges import PINS, EdgeChunk, EdgeTrace
from servogen.pulses import BEFORE_ALL, PulseReader
from servogen.units import Clock, Cycles, counted
from servogen.verify.pulses import OverlapCount
from servogen.verify.verdict import Overlap
from servogen.verify.windows import Edges, Ints, Windows, observed_edges

if TYPE_CHECKING:
    from servogen.answers import FrameKindAnswer, MeasureAnswer, PauseAnswer, PinAnswer, PulseRunAnswer


@dataclass(frozen=True, slots=True)
class PulseRun:
    """Consecutive pulses of one width, without a pause between them; the periods are those within the run."""

    first: Cycles
    pulses: int
    width: Cycles
    shortest_period: Cycles | None
    longest_period: Cycles | None

    def to_json(self) -> PulseRunAnswer:
        return {
            "first_cycle": self.first,
            "pulses": self.pulses,
            "width_cycles": self.width,
            "shortest_period_cycles": self.shortest_period,
            "longest_period_cycles": self.longest_period,
        }


@dataclass(frozen=True, slots=True)
class FrameKind:
    """The frames of one pulse width: their number and the most frequent period."""

    width: Cycles
    frames: int
    period: Cycles

    def to_json(self) -> FrameKindAnswer:
        return {"width_cycles": self.width, "frames": self.frames, "period_cycles": self.period}


@dataclass(frozen=True, slots=True)
class Pause:
    """A time without pulses longer than three periods: from a fall to the next rise."""

    begin: Cycles
    length: Cycles
    count: int = 1
    """The number of consecutive pauses of this length, with a pulse between each two."""

    def to_json(self) -> PauseAnswer:
        return {"begin_cycle": self.begin, "length_cycles": self.length, "count": self.count}


@dataclass(frozen=True, slots=True)
class PinMeasurement:
    """The pulses of one pin. A pulse that the end of the trace cuts off is not counted; it rises at
    `open_rise`.
    """

    pin: int
    pulses: int
    first: Cycles
    widths: Mapping[Cycles, int]
    """The number of pulses by width."""
    periods: Mapping[Cycles, int]
    """The number of periods (rise to rise) by length, without pauses."""
    period: Cycles | None
    """The median period."""
    kinds: tuple[FrameKind, ...]
    """The kinds of frame, one for each width that two or more frames have."""
    pauses: tuple[Pause, ...]
    runs: tuple[PulseRun, ...]
    open_rise: Cycles | None

    @property
    def frame_difference(self) -> Cycles:
        """Return by how much the kinds of frame differ in length."""
        periods = [kind.period for kind in self.kinds]
        return Cycles(max(periods) - min(periods)) if periods else Cycles(0)

    def widths_in_order(self) -> list[Cycles]:
        """Return one width per pulse, as needed for a check of the motion."""
        return [run.width for run in self.runs for _ in range(run.pulses)]

    def to_json(self) -> PinAnswer:
        return {
            "pin": PINS[self.pin],
            "pulses": self.pulses,
            "first_cycle": self.first,
            "widths": [{"cycles": width, "pulses": count} for width, count in self.widths.items()],
            "periods": [{"cycles": period, "frames": count} for period, count in self.periods.items()],
            "period_cycles": self.period,
            "frame_kinds": [kind.to_json() for kind in self.kinds],
            "frame_difference_cycles": self.frame_difference,
            "pauses": [pause.to_json() for pause in self.pauses],
            "runs": [run.to_json() for run in self.runs],
            "open_rise_cycle": self.open_rise,
        }


@dataclass(frozen=True, slots=True)
class Measurement:
    """What the pins do from reset to cycle `end`; pins that never pulse are omitted.

    `complete` is False if the pulses repeat so rarely that the measurement stopped before the end of the
    trace.
    """

    clock: Clock
    end: Cycles
    pins: tuple[PinMeasurement, ...]
    overlap: Overlap | None
    """The count, maximum time and first occurrence of two pins being high at once; None if there is none."""
    complete: bool

    def us(self, cycles: int) -> Fraction:
        return self.clock.us(cycles)

    def to_json(self) -> MeasureAnswer:
        """Return plain values for a JSON file."""
        return {
            "clock_hz": self.clock.hz,
            "end_cycle": self.end,
            "complete": self.complete,
            "pins": [pin.to_json() for pin in self.pins],
            "overlap": self.overlap.to_json() if self.overlap else None,
        }


MAX_LISTED = 12
"""The number of values or runs that are listed; the others are only counted."""


def measurement_lines(measurement: Measurement) -> list[str]:
    """Return lines without colour."""
    clock = measurement.clock
    lines = [
        f"measured {counted(measurement.end, 'cycle')} ({time_words(measurement.end, clock)}) from reset"
    ]
    if not measurement.complete:
        lines.append("stopped there: the pulses repeat too little to be kept any longer")
    if not measurement.pins:
        lines.append("no pin has a pulse")
    for pin in measurement.pins:
        lines += _pin_lines(pin, clock)
    overlap = measurement.overlap
    if overlap:
        pins = " and ".join(PINS[pin] for pin in overlap.pins)
        lines.append(
            f"two pins are high at once {counted(overlap.count, 'time')}, "
            f"first {pins} at cycle {overlap.first}, for at most {both(overlap.longest, clock)}"
        )
    return lines


def time_words(cycles: int, clock: Clock) -> str:
    """Return the exact time in µs below 10 ms, in ms below 1 s, else in s."""
    us = clock.us(cycles)
    for below, unit, size in ((10_000, "µs", 1), (1_000_000, "ms", 1000)):
        if abs(us) < below:
            return f"{float(us / size):.10g} {unit}"
    return f"{float(us / 1_000_000):.10g} s"


def both(cycles: int, clock: Clock) -> str:
    """Return cycles and time; only the time if a cycle is a microsecond."""
    time = time_words(cycles, clock)
    return time if clock.cycle_us == 1 else f"{counted(cycles, 'cycle')} ({time})"


def _pin_lines(pin: PinMeasurement, clock: Clock) -> Iterator[str]:
    yield f"{PINS[pin.pin]}: {counted(pin.pulses, 'pulse')}, the first at cycle {pin.first}"
    yield f"  widths: {_counts(pin.widths, clock)}"
    if pin.periods:
        yield f"  periods: {_counts(pin.periods, clock)}"
    if pin.frame_difference:
        kinds = ", ".join(
            f"{both(kind.period, clock)} with pulses of {both(kind.width, clock)}"
            for kind in pin.kinds[:MAX_LISTED]
        )
        yield f"  frames differ by {both(pin.frame_difference, clock)}: {kinds}{_more(len(pin.kinds))}"
    if pin.pauses:
        pauses: dict[Cycles, int] = {}
        for pause in pin.pauses:
            pauses[pause.length] = pauses.get(pause.length, 0) + pause.count
        yield f"  pauses without pulses: {_counts(pauses, clock)}"
    for run in pin.runs[:MAX_LISTED]:
        yield f"  {_run_words(run, clock)}"
    if len(pin.runs) > MAX_LISTED:
        yield f"  and {counted(len(pin.runs) - MAX_LISTED, 'further run')}"
    if pin.open_rise is not None:
        yield f"  at the end high since cycle {pin.open_rise}"


def _counts(values: Mapping[Cycles, int], clock: Clock) -> str:
    """Return the most frequent values with their counts, and the bounds of the others."""
    common = sorted(values, key=lambda value: (-values[value], value))[:MAX_LISTED]
    words = ", ".join(f"{both(value, clock)} × {values[value]}" for value in sorted(common))
    if len(values) <= MAX_LISTED:
        return words
    unlisted = len(values) - MAX_LISTED
    return f"{words} and {unlisted} more, from {both(min(values), clock)} to {both(max(values), clock)}"


def _more(number: int) -> str:
    return f" and {number - MAX_LISTED} more" if number > MAX_LISTED else ""


def _run_words(run: PulseRun, clock: Clock) -> str:
    words = f"from cycle {run.first}: {counted(run.pulses, 'pulse')} of {both(run.width, clock)}"
    if run.shortest_period is None or run.longest_period is None:
        return words
    words += f" every {both(run.shortest_period, clock)}"
    if run.longest_period != run.shortest_period:
        words += f" to {both(run.longest_period, clock)}"
    return words


MAX_ROWS = 1 << 16
LAST = -1
"""The period of the last pulse, which no other follows."""


@dataclass(frozen=True, slots=True)
class Train:
    """Rows of equal pulses in order; a pulse that the end of the trace cuts off is in none, but rises at
    `open_rise`.
    """

    first: Ints
    count: Ints
    width: Ints
    period: Ints
    open_rise: int | None


class TrainBuilder:
    """Encodes the windows of a trace, taken in order, for one pin."""

    def __init__(self, pin: int) -> None:
        self._pin = pin
        self._reader = PulseReader(BEFORE_ALL)
        self._rise: Ints = np.zeros(0, dtype=np.int64)
        self._width: Ints = np.zeros(0, dtype=np.int64)
        self._parts: list[tuple[Ints, Ints, Ints, Ints]] = []
        self.rows = 0

    def add(self, edges: Edges) -> None:
        """Add the next window. A pulse is counted when the next one rises, because only then is its period
        known.
        """
        own = edges.take(edges.pin == self._pin)
        ended = self._reader(EdgeChunk(own.cycle, own.pin, own.level))
        self._rise = np.concatenate((self._rise, ended.rise))
        self._width = np.concatenate((self._width, ended.width))
        still_open = self._reader.high_since(self._pin)
        rise = self._rise if still_open is None else np.append(self._rise, still_open)
        known = max(0, len(rise) - 1)
        self._append(rise[:known], self._width[:known], np.diff(rise))
        self._rise, self._width = self._rise[known:], self._width[known:]

    def _append(self, rise: Ints, width: Ints, period: Ints) -> None:
        if not len(rise):
            return
        changes = np.flatnonzero((np.diff(width) != 0) | (np.diff(period) != 0)) + 1
        starts = np.concatenate(([0], changes))
        count = np.diff(starts, append=len(rise))
        self._parts.append((rise[starts], count, width[starts], period[starts]))
        self.rows += len(starts)

    def finish(self) -> Train:
        """Return what was counted; the last pulse has the period `LAST`."""
        if len(self._width):
            self._append(self._rise, self._width, np.full(1, LAST, dtype=np.int64))
        still_open = self._reader.high_since(self._pin)
        if not self._parts:
            nothing = np.zeros(0, dtype=np.int64)
            return Train(first=nothing, count=nothing, width=nothing, period=nothing, open_rise=still_open)
        first, count, width, period = (np.concatenate(column) for column in zip(*self._parts, strict=True))
        return _join_rows(first, count, width, period, still_open)


def _join_rows(first: Ints, count: Ints, width: Ints, period: Ints, still_open: int | None) -> Train:
    """Return the train with equal rows joined that were divided only by the border of a window."""
    starts = np.concatenate(([0], np.flatnonzero((np.diff(width) != 0) | (np.diff(period) != 0)) + 1))
    return Train(
        first=first[starts],
        count=np.add.reduceat(count, starts),
        width=width[starts],
        period=period[starts],
        open_rise=still_open,
    )


Flags = npt.NDArray[np.bool_]

WINDOW = 1 << 22
"""The cycles that are read at a time."""

PAUSE_PERIODS = 3
"""A time from rise to rise of more than this many median periods contains a pause."""


def measure(observed: EdgeTrace) -> Measurement:
    """Return the measurement of `observed`, read to its end or until its pulses exceed the number of rows
    kept.
    """
    windows = Windows(observed_edges(chunk, 0) for chunk in observed.driven())
    builders = [TrainBuilder(pin) for pin in range(len(PINS))]
    overlaps = OverlapCount()
    now = Cycles(0)
    while now < observed.end and max(builder.rows for builder in builders) < MAX_ROWS:
        ahead = windows.first()
        now = observed.end if ahead is None else Cycles(min(max(now, ahead) + WINDOW, observed.end))
        edges = windows.until(now)
        for pin in np.flatnonzero(np.bincount(edges.pin, minlength=len(PINS))).tolist():
            builders[pin].add(edges)
        overlaps.add(edges)
    trains = [(pin, builder.finish()) for pin, builder in enumerate(builders)]
    pins = tuple(measure_pin(pin, train) for pin, train in trains if len(train.first))
    return Measurement(
        clock=observed.clock, end=now, pins=pins, overlap=overlaps.finish(now), complete=now == observed.end
    )


def measure_pin(pin: int, train: Train) -> PinMeasurement:
    """Return the measurement of one pin's pulses."""
    followed = train.period != LAST
    period = _median(train.period[followed], train.count[followed])
    paused = followed & (train.period > (PAUSE_PERIODS * period if period else 0))
    steady = followed & ~paused
    return PinMeasurement(
        pin=pin,
        pulses=int(train.count.sum()),
        first=Cycles(int(train.first[0])),
        widths=_occurrences(train.width, train.count),
        periods=_occurrences(train.period[steady], train.count[steady]),
        period=Cycles(period) if period else None,
        kinds=tuple(_kinds(train.width[steady], train.period[steady], train.count[steady])),
        pauses=tuple(_pauses(train, paused)),
        runs=tuple(_runs(train, paused)),
        open_rise=None if train.open_rise is None else Cycles(train.open_rise),
    )


def _median(values: Ints, counts: Ints) -> int:
    """Return the median of all values, the lower one of two; 0 if there are none."""
    if not len(values):
        return 0
    order = np.argsort(values, kind="stable")
    below = np.cumsum(counts[order])
    return int(values[order][np.searchsorted(below, (below[-1] + 1) // 2)])


def _occurrences(values: Ints, counts: Ints) -> dict[Cycles, int]:
    """Return how often each value occurs, by value."""
    distinct, indices = np.unique(values, return_inverse=True)
    totals = np.zeros(len(distinct), dtype=np.int64)
    np.add.at(totals, indices, counts)
    return {Cycles(value): total for value, total in zip(distinct.tolist(), totals.tolist(), strict=True)}


def _kinds(width: Ints, period: Ints, count: Ints) -> Iterator[FrameKind]:
    for value in np.unique(width).tolist():
        own = width == value
        periods = _occurrences(period[own], count[own])
        frames = sum(periods.values())
        if frames > 1:
            yield FrameKind(Cycles(value), frames, max(periods, key=lambda cycles: periods[cycles]))


def _pauses(train: Train, paused: Flags) -> Iterator[Pause]:
    for row in np.flatnonzero(paused).tolist():
        first, width, period = (int(column[row]) for column in (train.first, train.width, train.period))
        yield Pause(Cycles(first + width), Cycles(period - width), int(train.count[row]))


def _runs(train: Train, paused: Flags) -> Iterator[PulseRun]:
    """Yield adjacent rows of one width without a pause between them; single pulses with equal pauses form a
    run too.
    """
    # Several pulses, each followed by a pause, are one row; what comes before it is not of its run.
    alone = paused & (train.count > 1)
    parted = paused[:-1] | alone[1:] | (np.diff(train.width) != 0)
    bounds = [0, *(np.flatnonzero(parted) + 1).tolist(), len(train.first)]
    for begin, end in pairwise(bounds):
        yield _run(train, begin, end - 1)


def _run(train: Train, begin: int, last: int) -> PulseRun:
    periods = train.period[begin : last + 1]
    # The period after a run's last pulse leads out of the run.
    inside = periods[:-1] if train.count[last] == 1 else periods
    inside = inside[inside != LAST]
    return PulseRun(
        first=Cycles(int(train.first[begin])),
        pulses=int(train.count[begin : last + 1].sum()),
        width=Cycles(int(train.width[begin])),
        shortest_period=Cycles(int(inside.min())) if len(inside) else None,
        longest_period=Cycles(int(inside.max())) if len(inside) else None,
    )
