"""A measurement as plain lines: for each pin its widths, periods, kinds of frame, pauses and runs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from servogen.edges import PINS
from servogen.units import Clock, Cycles, counted
from servogen.verify.measure.measurement import Measurement, PinMeasurement, Run

MOST_LISTED = 12
"""So many values or runs are written out; of the rest, how many there are."""


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
            for kind in pin.kinds[:MOST_LISTED]
        )
        yield f"  frames differ by {both(pin.frame_difference, clock)}: {kinds}{_more(len(pin.kinds))}"
    if pin.pauses:
        pauses: dict[Cycles, int] = {}
        for pause in pin.pauses:
            pauses[pause.length] = pauses.get(pause.length, 0) + pause.count
        yield f"  pauses without pulses: {_counts(pauses, clock)}"
    for run in pin.runs[:MOST_LISTED]:
        yield f"  {_run_words(run, clock)}"
    if len(pin.runs) > MOST_LISTED:
        yield f"  and {counted(len(pin.runs) - MOST_LISTED, 'further run')}"
    if pin.open_rise is not None:
        yield f"  at the end high since cycle {pin.open_rise}"


def _counts(values: Mapping[Cycles, int], clock: Clock) -> str:
    """Return the most frequent values with their counts, and the bounds of the others."""
    common = sorted(values, key=lambda value: (-values[value], value))[:MOST_LISTED]
    words = ", ".join(f"{both(value, clock)} × {values[value]}" for value in sorted(common))
    if len(values) <= MOST_LISTED:
        return words
    others = len(values) - MOST_LISTED
    return f"{words} and {others} more, from {both(min(values), clock)} to {both(max(values), clock)}"


def _more(number: int) -> str:
    return f" and {number - MOST_LISTED} more" if number > MOST_LISTED else ""


def _run_words(run: Run, clock: Clock) -> str:
    words = f"from cycle {run.first}: {counted(run.pulses, 'pulse')} of {both(run.width, clock)}"
    if run.shortest_period is None or run.longest_period is None:
        return words
    words += f" every {both(run.shortest_period, clock)}"
    if run.longest_period != run.shortest_period:
        words += f" to {both(run.longest_period, clock)}"
    return words
