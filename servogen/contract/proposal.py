"""A contract that a run or a recording keeps: what was seen, with margins, as text to read and correct.

In: an `EdgeTrace`. Out: the TOML of `[[pulse]]`, `[[every]]`, `[[order]]` and `[[never]]` clauses. What one
run does not show is not stated: an answer to an input, a serial line's rate, a pin that nobody recorded.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import ceil, floor

import numpy as np
import numpy.typing as npt

from servogen.edges import HIGH, PINS, EdgeTrace
from servogen.errors import InputError, Location
from servogen.pulses import Pulses, pulses
from servogen.units import Clock

LEAST_MARGIN_US = 2
"""The margin of short times: an edge at a sample before or after."""


@dataclass(frozen=True, slots=True)
class Margin:
    """By how much bounds are wider than what was seen: a part of each, and at least `LEAST_MARGIN_US`."""

    part: Fraction
    clock: Clock

    def bounds_us(self, cycles: Sequence[int]) -> tuple[int, int]:
        """Return whole microseconds, the least and the most, around times in cycles."""
        low, high = (self.clock.us(end) for end in (min(cycles), max(cycles)))
        return max(0, floor(low - self._of(low))), ceil(high + self._of(high))

    def _of(self, us: Fraction) -> Fraction:
        return max(us * self.part, Fraction(LEAST_MARGIN_US))


def proposed_contract(trace: EdgeTrace, file: str, part: Fraction, *, from_reset: bool) -> str:
    """Return a contract's text; `from_reset`: whether cycle 0 is that after a reset, as in a run.

    Raises InputError if no pin has a whole pulse.
    """
    trace, margin = trace.stored(), Margin(part, trace.clock)
    found = pulses(trace)
    pins = [pin for pin in range(len(PINS)) if found.of(pin).complete.any()]
    if not pins:
        raise InputError("no-contract", "no pin has a whole pulse", Location(file))
    seconds = float(trace.clock.seconds(trace.end))
    head = [
        f"# Seen in {seconds:g} s of {file}; bounds are {float(100 * part):g} % wider, and at least by "
        f"{LEAST_MARGIN_US} µs.",
        "# One run shows no answer to an input: add [[response]] clauses; correct what should be otherwise.",
        f"clock_hz = {trace.clock.hz}",
    ]
    tables = [
        *(table for pin in pins for table in _pulse(found.of(pin), PINS[pin], int(trace.end), margin)),
        *(_first(found.of(pin), PINS[pin], margin) for pin in pins if from_reset),
        *_order(found, pins),
        *(_idle(pin) for pin in _pins_driven_low(trace) if from_reset),
    ]
    return "\n".join([*head, *("\n" + table for table in tables)]) + "\n"


def _pulse(train: Pulses, pin: str, end: int, margin: Margin) -> Iterator[str]:
    """Yield the clause about a pin's pulses; how long the last one has lasted at the end is a bound, too."""
    whole = train.whole()
    cut = train.take(~train.complete & (train.rise > 0))
    high = margin.bounds_us([*whole.width.tolist(), *_above(whole.width, cut.width)])
    lines = ["[[pulse]]", f'pin = "{pin}"', f"high_us = [{high[0]}, {high[1]}]"]
    rises = train.take(train.rise > 0).rise
    if len(rises) > 1:
        gaps = np.diff(rises)
        period = margin.bounds_us([*gaps.tolist(), *_above(gaps, np.array([end - int(rises[-1])]))])
        lines.append(f"period_us = [{period[0]}, {period[1]}]")
    yield "\n".join(lines)


def _above(seen: npt.NDArray[np.int64], cut: npt.NDArray[np.int64]) -> list[int]:
    """Return the times that the end cut off, where they are longer than all others."""
    return [each for each in cut.tolist() if each > seen.max()]


def _first(train: Pulses, pin: str, margin: Margin) -> str:
    least, most = margin.bounds_us([int(train.rise.min())])
    return f'[[every]]\nevent = "{pin} rises"\nfirst_us = [{least}, {most}]'


def _order(found: Pulses, pins: Sequence[int]) -> Iterator[str]:
    """Yield the clause that the pins' pulses begin in turn, if they do, each alone."""
    seen = found.take(found.rise > 0)
    rows = np.argsort(seen.rise, kind="stable")
    turn, rise = seen.pin[rows].tolist(), seen.rise[rows]
    if len(pins) > 1 and len(turn) > len(pins) and (np.diff(rise) > 0).all():
        first = turn[: len(pins)]
        if len({*first}) == len(pins) and all(pin == first[at % len(pins)] for at, pin in enumerate(turn)):
            events = ", ".join(f'"{PINS[pin]} rises"' for pin in first)
            yield f"[[order]]\nevents = [{events}]"


def _pins_driven_low(trace: EdgeTrace) -> list[str]:
    """Return the pins that the program drives, and never high."""
    (chunk,) = trace.chunks
    high = set(chunk.pin[chunk.level == HIGH].tolist())
    return [PINS[pin] for pin in sorted(set(chunk.pin.tolist()) - high)]


def _idle(pin: str) -> str:
    return f'[[never]]\ncondition = "{pin} high"'
