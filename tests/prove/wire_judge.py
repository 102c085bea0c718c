"""What a wire's second chip may do, judged by the levels of the wire and the edges of one run.

A judge of its own: it knows nothing of what a program reads, only of what there was to read.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

from servogen.pulse import PulseSchedule

Levels = Sequence[tuple[int, int]]
"""(cycle, level from then on)."""
AROUND = 8
"""Cycles for which a regular wire is low before a rise, and high from it on."""
LOOKED = 80
"""The cycles between two looks at a quiet wire, at most."""


def level_at(wire: Levels, cycle: int) -> int:
    """The level in a cycle; low before the first change."""
    place = bisect_right(wire, cycle, key=lambda change: change[0])
    return wire[place - 1][1] if place else 0


def has_risen(wire: Levels, cycle: int) -> bool:
    """Whether the wire is low in the cycle before, and high in this one and the next."""
    return [level_at(wire, cycle + each) for each in (-1, 0, 1)] == [0, 1, 1]


def due_edges(schedule: PulseSchedule, frame: int) -> list[tuple[int, int, int]]:
    """(cycle in the frame, channel, level) of a frame, counted from the first one."""
    runs = [run for run in (*schedule.lead_in, *schedule.loop) for _ in range(run.frames)]
    begin = schedule.lead_in_frames
    pulses = runs[frame if frame < begin else begin + (frame - begin) % schedule.loop_frames].pulses
    found = []
    for channel, pulse in enumerate(pulses):
        if pulse is not None:
            found += [(int(pulse.rise), channel, 1), (int(pulse.rise + pulse.width), channel, 0)]
    return sorted(found)


def fault(
    schedule: PulseSchedule, wire: Levels, edges: Sequence[tuple[int, int, int]], start: int, end: int
) -> str:
    """What is wrong with the edges (cycle, channel, level) of a chip that is powered up or reset at `start`,
    and again at `end`; empty if nothing is.
    """
    rule, period = schedule.wire, int(schedule.period)
    assert rule is not None
    left = [edge for edge in edges if start <= edge[0] < end]
    silent = start
    while True:
        begin = left[0][0] - due_edges(schedule, 0)[0][0] if left else end
        missing = _awaited(schedule, wire, silent, end)
        if missing is not None and missing != begin > missing - rule.frames * period - int(rule.cycles):
            return f"pulses begin in cycle {begin}, not in {missing}"
        frame = 0
        while (at := begin + frame * period) < end and has_risen(wire, at - int(rule.cycles)):
            for cycle, channel, level in due_edges(schedule, frame):
                wanted = at + cycle, channel, level
                if wanted[0] < end and left[:1] != [wanted]:
                    return f"{left[:1]} instead of {wanted} in frame {frame} from {begin}"
                del left[: wanted[0] < end]
            frame += 1
        if begin < end and not frame:
            return f"pulses begin in cycle {begin} without the wire's rise"
        if begin < end and not _was_quiet(schedule, wire, silent, begin):
            return f"pulses begin in cycle {begin}, and the wire was not quiet {rule.frames} frames before"
        if at >= end:
            return ""
        silent = at - int(rule.cycles) + 2


def _awaited(schedule: PulseSchedule, wire: Levels, silent: int, end: int) -> int | None:
    """The cycle in which the frames of a chip without pulses since `silent` have to begin; None if in none.

    The wire is low for as long as it needs whatever it did before, and then rises once a frame.
    """
    rule, period = schedule.wire, int(schedule.period)
    assert rule is not None
    quiet = int(rule.quiet) + (rule.frames + 3) * period
    low = silent
    for cycle, level in wire:
        if not level:
            low = max(cycle, silent)
            continue
        begin = cycle + rule.frames * period + int(rule.cycles)
        if cycle - low >= quiet and begin < end and _is_regular(wire, cycle, period, rule.frames):
            return begin
    return None


def _was_quiet(schedule: PulseSchedule, wire: Levels, silent: int, begin: int) -> bool:
    """Whether the wire was quiet before the rise with which the chip found its cycle."""
    rule = schedule.wire
    assert rule is not None
    rise = begin - int(rule.cycles) - rule.frames * int(schedule.period)
    since = rise - int(rule.quiet)
    high = [
        min(later, rise - AROUND) - max(cycle, since)
        for (cycle, level), (later, _) in zip(wire, [*wire[1:], (begin, 0)], strict=True)
        if level
    ]
    return since >= silent - AROUND and max(high, default=0) <= LOOKED


def _is_regular(wire: Levels, first: int, period: int, frames: int) -> bool:
    rises = [first + frame * period for frame in range(frames + 1)]
    around = [(rise + each, int(each >= 0)) for rise in rises for each in range(-AROUND, AROUND)]
    return all(level_at(wire, cycle) == level for cycle, level in around)
