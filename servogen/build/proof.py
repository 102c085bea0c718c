"""Runs an image and holds its edges against a schedule.

In: a `PulseSchedule` and an `Image`, or a trace from elsewhere. Out: the `Verdict`, over a stated span.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from servogen.edges import EdgeTrace, Expected
from servogen.engines.board import machine_of
from servogen.errors import Diagnostic, Location
from servogen.pic.image import Image
from servogen.pic.listing import Listing
from servogen.pulse import PulseSchedule
from servogen.pulse.expected import expected
from servogen.simulator import CHIP_DEPENDENT, Machine, Options
from servogen.units import Cycles
from servogen.verify import Verdict, channel_pins, find_start, verify, whole_motion
from servogen.verify.verdict import unseen_motion_reason

LOOPS_CHECKED = 3
"""The whole motion and two repeats of it."""

START_FRAMES = 50
"""How long an image may take from reset to its first pulse before it counts as silent."""


def checked_cycles(schedule: PulseSchedule) -> Cycles:
    """The lead-in and `LOOPS_CHECKED` loops."""
    return whole_motion(expected(schedule), LOOPS_CHECKED)


def motion_cycles(schedule: PulseSchedule) -> Cycles:
    """The lead-in and one loop."""
    return whole_motion(expected(schedule), 1)


def running(
    schedule: PulseSchedule,
    image: Image,
    span: Cycles,
    options: Options = Options(),  # noqa: B008 - frozen
) -> EdgeTrace:
    """Return the edges of `image` while it runs on the simulator, for `span` cycles and the time to the first
    pulse.
    """
    limit = Cycles(span + START_FRAMES * schedule.period)
    return EdgeTrace(schedule.clock, machine_of(schedule, image, options).stream(limit), limit)


def prove_file(
    schedule: PulseSchedule, trace: EdgeTrace, tells_end: bool, span: Cycles | None = None
) -> Verdict:
    """Return the verdict on a recorded trace, which is checked to its end.

    It must hold the whole motion and, where a format does not tell when the recording ended (not `tells_end`:
    CSV, JSONL), the last frame of which it holds an edge; such a recording ends where the schedule has its
    next edge. Where the caller asks for a shorter `span`, what follows is not compared, and the verdict says
    so.
    """
    stored = trace.stored()
    if span is not None:
        verdict = prove(schedule, stored, span)
        after = 0 if verdict.start is None else stored.end - verdict.start - span
        return verdict.not_all(_rest(schedule, after)) if after > 0 else verdict
    wanted = expected(schedule)
    first = find_start(stored, channel_pins(wanted)).cycle
    if first is None:
        return prove(schedule, stored, Cycles(max(stored.end, motion_cycles(schedule))))
    known = Cycles(stored.end - first)
    if tells_end:
        return prove(schedule, stored, Cycles(max(known, motion_cycles(schedule))))
    frames = -(-known // schedule.period)
    whole = Cycles(max(frames * schedule.period, motion_cycles(schedule)))
    end = Cycles(first + min(whole, _next_edge(wanted, known, whole)))
    return prove(schedule, EdgeTrace(stored.clock, stored.chunks, end), whole)


def _rest(schedule: PulseSchedule, cycles: int) -> str:
    seconds = float(schedule.clock.seconds(cycles))
    return f"the recording goes on for {seconds:g} s, which were not compared"


def _next_edge(wanted: Expected, time: Cycles, otherwise: Cycles) -> int:
    """Return the time of the schedule's first edge from `time` on, or what to take where there is none."""
    for chunk in wanted.chunks:
        row = int(np.searchsorted(chunk.cycle, time))
        if row < len(chunk.cycle):
            return int(chunk.cycle[row])
    return otherwise


def prove(schedule: PulseSchedule, trace: EdgeTrace, span: Cycles | None = None) -> Verdict:
    """Return the verdict on `trace` over `span` cycles from its first pulse (default: `checked_cycles`).

    Less than the whole motion, even where no more was asked for, is not proven.
    """
    verdict = verify(expected(schedule), trace, checked_cycles(schedule) if span is None else span)
    if verdict.agrees and verdict.span.compared < motion_cycles(schedule):
        whole = schedule.lead_in_frames + schedule.loop_frames
        return verdict.not_all(unseen_motion_reason(verdict.span.frames, whole))
    return verdict


def prove_image(
    schedule: PulseSchedule,
    image: Image,
    span: Cycles | None = None,
    listing: Listing | None = None,
    options: Options = Options(),  # noqa: B008 - frozen
) -> Verdict:
    """Run `image` and return the verdict on its edges over `span` cycles (default: `checked_cycles`).

    It is not proven where the edges are the schedule's but depend on what no chip promises.
    """
    span = checked_cycles(schedule) if span is None else span
    machine = machine_of(schedule, image, options, tracked=True)
    limit = Cycles(span + START_FRAMES * schedule.period)
    verdict = prove(schedule, EdgeTrace(schedule.clock, machine.stream(limit), limit), span)
    return verdict.with_warnings(chip_warnings(machine, end_of(verdict), listing), CHIP_DEPENDENT)


def end_of(verdict: Verdict) -> Cycles | None:
    """Return the cycle since reset up to which a verdict compared; None where no scheduled pin rises."""
    return None if verdict.start is None else Cycles(verdict.start + verdict.span.compared)


def cycle_of(warning: Diagnostic) -> int:
    """Return the cycle since reset in which a chip did what is warned of."""
    return (warning.location.cycle if warning.location else None) or 0


def chip_warnings(
    machine: Machine, end: Cycles | None = None, listing: Listing | None = None
) -> tuple[Diagnostic, ...]:
    """Return what `machine` warns of before cycle `end`, with source lines where a listing has them."""
    rows = {row.address: row for row in listing.rows} if listing else {}
    found = []
    for warning in machine.state().warnings:
        if end is not None and cycle_of(warning) >= end:
            continue
        where = warning.location or Location()
        row = rows.get(where.address) if where.address is not None else None
        if row is not None:
            warning = replace(warning, location=replace(where, file=row.file, line=row.line))
        found.append(warning)
    return tuple(found)
