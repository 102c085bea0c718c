"""`verify`: checks whether the observed edges are the scheduled ones.

In: the schedule's edges and a trace, both as streams. Out: a `Verdict`. The two are compared window by window
as arrays, in memory that does not grow with time; at the first difference a bounded stretch is kept and
passed to the diagnosis.
"""

from __future__ import annotations

from servogen.edges import HIGH, EdgeTrace, Expected
from servogen.errors import InputError
from servogen.units import Cycles
from servogen.verify.coverage import Coverage, compared_frames, coverage
from servogen.verify.diagnose import Diagnosis, PinHistory, TraceStretch, diagnose
from servogen.verify.start import TraceStart, channel_pins, find_start
from servogen.verify.verdict import (
    ChannelVerdict,
    ComparedSpan,
    Difference,
    StrayPin,
    Verdict,
    channel_reasons,
    difference_reason,
    overlap_reason,
    short_reason,
    silent_reason,
    stray_reason,
)
from servogen.verify.windows import Edges, Windows, concatenate, expected_edges

WINDOW = 1 << 22
"""The cycles that are compared at a time."""

DIAGNOSED_EDGES = 1 << 18
"""The edges of either side, from the first difference on, that are diagnosed."""

GLITCH = Cycles(10)
"""Shorter pulses and gaps between pulses are glitches."""


def whole_motion(expected: Expected, repeats: int = 2) -> Cycles:
    """Return the cycles of the lead-in and of `repeats` of the loop."""
    return Cycles((expected.lead_in + repeats * expected.loop) * expected.period)


def verify(
    expected: Expected, observed: EdgeTrace, checked: Cycles | None = None, glitch: Cycles = GLITCH
) -> Verdict:
    """Compare the driven edges of `observed`, from reset on, with the schedule over `checked` cycles.

    The first rising edge of a scheduled pin is the schedule's time zero. `checked` counts from there; by
    default it is the whole motion with two repeats of its loop. A trace that ends earlier is not exact.
    The verdict is on the span asked for: whether it covers the schedule is in its `coverage`.
    Reads no further than necessary, so that `observed` may be a machine that never stops.
    Raises InputError when the two count cycles of different clocks.
    """
    if observed.clock != expected.clock:
        raise InputError(
            "wrong-clock",
            f"the trace is in cycles of {observed.clock.hz} Hz, the schedule of {expected.clock.hz} Hz",
            hint="state the clock of the chip that the schedule is for",
        )
    asked = whole_motion(expected) if checked is None else checked
    observed = observed.without(expected.others)
    start = find_start(observed, channel_pins(expected))
    if start.cycle is None:
        return _silent(expected, observed, start, asked)
    reach = max(0, min(asked, observed.end - start.cycle))
    schedule = Windows(expected_edges(chunk) for chunk in expected.chunks)
    motion = schedule.ahead(whole_motion(expected, 1))
    trace = Windows(start.edges)
    seen = PinHistory.at_start()
    stretch = _compare(schedule, trace, reach, start.cycle, seen)
    fault = None if stretch is None else diagnose(stretch, expected, glitch)
    span = _span(expected, asked, reach if stretch is None else stretch.end)
    covered = coverage(motion, expected, compared_frames(motion, expected, span.compared))
    short = [] if reach >= asked else [short_reason(asked - reach, observed.end, expected.clock)]
    return _verdict(expected, start, span, seen, fault, short, covered)


def _compare(
    schedule: Windows, trace: Windows, reach: int, start: int, seen: PinHistory
) -> TraceStretch | None:
    """Return None if all edges before `reach` are equal, else the stretch of the first difference; `seen`
    tracks the equal windows.
    """
    now = 0
    while now < reach:
        limit = min(now + WINDOW, reach)
        scheduled, observed = schedule.until(limit), trace.until(limit)
        if not scheduled.same_as(observed):
            ours, theirs = [scheduled], [observed]
            while limit < reach and max(_size(ours), _size(theirs)) < DIAGNOSED_EDGES:
                limit = min(limit + WINDOW, reach)
                ours.append(schedule.until(limit))
                theirs.append(trace.until(limit))
            return TraceStretch(concatenate(ours), concatenate(theirs), now, limit, start, seen)
        seen.add(scheduled)
        now = limit
    return None


def _size(parts: list[Edges]) -> int:
    return sum(len(part.cycle) for part in parts)


def _verdict(
    expected: Expected,
    start: TraceStart,
    span: ComparedSpan,
    seen: PinHistory,
    fault: Diagnosis | None,
    short: list[str],
    covered: Coverage,
) -> Verdict:
    """Return the verdict on a trace in which a scheduled pin rises; `short` says what the trace lacks."""
    stray = _merge_strays(start.stray, fault.stray if fault else ())
    early = _first(start.stray)
    difference = early or (fault.difference if fault else None)
    channels = fault.channels if fault else _exact(expected, seen)
    why = [difference_reason(difference, expected)] if difference else []
    why += channel_reasons(channels, expected)
    if fault and fault.overlap:
        why.append(overlap_reason(fault.overlap))
    why += [stray_reason(pin) for pin in stray]
    unseen = () if why else tuple(short)
    why += short
    overlap = fault.overlap if fault else None
    cycle = None if start.cycle is None else Cycles(start.cycle)
    return Verdict(
        passed=not why,
        reasons=tuple(why),
        clock=expected.clock,
        start=cycle,
        span=span,
        channels=channels,
        difference=difference,
        overlap=overlap,
        stray=stray,
        plan_error=expected.plan_error,
        coverage=covered,
        unseen=unseen,
    )


def _exact(expected: Expected, seen: PinHistory) -> tuple[ChannelVerdict, ...]:
    rises = [int(seen.rises[channel.pin]) for channel in expected.channels]
    return tuple(
        ChannelVerdict(channel.name, channel.pin, count, count)
        for channel, count in zip(expected.channels, rises, strict=True)
    )


def _silent(expected: Expected, observed: EdgeTrace, start: TraceStart, asked: Cycles) -> Verdict:
    """Return the verdict on a trace in which no scheduled pin rises, which is right only for a schedule
    without pulses.
    """
    first = Windows(expected_edges(chunk) for chunk in expected.chunks).until(1)
    why = [silent_reason(int(first.pin[0]))] if len(first.cycle) else []
    why += [stray_reason(pin) for pin in start.stray]
    compared = 0 if len(first.cycle) else min(asked, observed.end)
    span = _span(expected, asked, compared)
    if not why and not span.whole:
        why.append(short_reason(asked - compared, observed.end, expected.clock))
    channels = tuple(ChannelVerdict(channel.name, channel.pin, 0, 0) for channel in expected.channels)
    difference = _first(start.stray)
    return Verdict(
        passed=not why,
        reasons=tuple(why),
        clock=expected.clock,
        start=None,
        span=span,
        channels=channels,
        difference=difference,
        overlap=None,
        stray=start.stray,
        plan_error=expected.plan_error,
    )


def _span(expected: Expected, asked: Cycles, compared: int) -> ComparedSpan:
    frames = compared // expected.period
    lead_in = min(frames, expected.lead_in)
    repeats = (frames - lead_in) // expected.loop if expected.loop else 0
    return ComparedSpan(asked, Cycles(compared), frames, lead_in, repeats, expected.others)


def _first(stray: tuple[StrayPin, ...]) -> Difference | None:
    """Return the first change of a pin that is not scheduled; since the pin starts low, this is a rise."""
    if not stray:
        return None
    first = min(stray, key=lambda pin: (pin.first, pin.pin))
    return Difference(
        pin=first.pin, channel=None, frame=None, level=HIGH, expected=None, observed=first.first
    )


def _merge_strays(before: tuple[StrayPin, ...], after: tuple[StrayPin, ...]) -> tuple[StrayPin, ...]:
    merged = {stray.pin: stray for stray in after}
    for stray in before:
        later = merged.get(stray.pin)
        merged[stray.pin] = StrayPin(stray.pin, stray.edges + (later.edges if later else 0), stray.first)
    return tuple(merged[pin] for pin in sorted(merged))
