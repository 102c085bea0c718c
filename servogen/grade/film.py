"""`Film`: the pulses of a failed program around the moment that is wrong, and the source line that runs then.

In: what was watched, the moment. Out: plain values, small enough to be sent from the process that ran it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from servogen.grade.watch import Watched

BEFORE_S, AFTER_S = 5.0, 10.0
"""The time before and after the moment that is kept."""
MAX_PULSES = 4000
"""The maximum number of pulses of a pin; a program that toggles a pin fast has more."""
LINES = 12
"""The number of source lines before and after the line."""


@dataclass(frozen=True, slots=True)
class FilmRow:
    """The pulses of one pin, in µs since reset."""

    pin: int
    rise_us: tuple[float, ...]
    width_us: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class FilmSource:
    """Some lines of a source file; `first` is the number of the first one, `line` of the one that runs."""

    file: str
    line: int
    first: int
    lines: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Film:
    """From `begin_us` to `end_us` since reset; what is wrong is at `moment_us`."""

    begin_us: float
    moment_us: float
    end_us: float
    rows: tuple[FilmRow, ...]
    source: FilmSource | None = None


def make_film(watched: Watched, pins: Sequence[int], moment: int | None, source: FilmSource | None) -> Film:
    """Return the film of the pulses on `pins` around a moment; None: from the first pulse on."""
    clock = watched.clock
    first = min((int(watched.pins[pin].rise[0]) for pin in pins if pin in watched.pins), default=0)
    shown_moment = first if moment is None else moment
    begin = max(0, shown_moment - clock.round_seconds(BEFORE_S))
    end = min(watched.end, shown_moment + clock.round_seconds(AFTER_S))
    us = float(clock.cycle_us)
    rows = []
    for pin in pins:
        pulses = watched.pins.get(pin)
        kept = (
            []
            if pulses is None
            else [
                (rise * us, (fall - rise) * us)
                for rise, fall in zip(pulses.rise.tolist(), pulses.fall.tolist(), strict=True)
                if rise >= begin and fall < end
            ]
        )
        kept = [(round(rise, 1), round(width, 1)) for rise, width in kept[:MAX_PULSES]]
        rows.append(FilmRow(pin, tuple(rise for rise, _ in kept), tuple(width for _, width in kept)))
    return Film(
        begin_us=begin * us, moment_us=shown_moment * us, end_us=end * us, rows=tuple(rows), source=source
    )


def lines_around(file: str, text: str, line: int) -> FilmSource:
    """Return the lines of a source around one of them."""
    lines = text.splitlines()
    first = max(1, line - LINES)
    return FilmSource(file, line, first, tuple(text[:200] for text in lines[first - 1 : line + LINES]))
