"""A schedule as a program of port writes and delays.

In: a `PulseSchedule` and the `Overheads` of a compiler. Out: a `Sequence` with every delay computed.

The paths back to the same frame and on to the next step differ in cycles; a position's `gap` ends `MARGIN`
before the shorter one, and `again` and the step's own wait make up the rest of each. A run longer than a byte
counts is a loop of calls, whose path back has its own wait (`turn`). Frames that differ one by one are
rows of a table (`tables`).
"""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

from servogen.engines.sequence.programs import (
    START,
    DelayPath,
    Edge,
    FrameEdges,
    FrameFunction,
    Hold,
    Move,
    Overheads,
    RowFunction,
    Sequence,
    SilentStep,
    Step,
    TableDelay,
    WidthTable,
)
from servogen.engines.sequence.tables import FIXED, SchedulePart, in_tables, pulsed
from servogen.errors import InputError
from servogen.pulse import PulseSchedule, Run
from servogen.units import Cycles, counted

MARGIN = Cycles(64)
"""A number of cycles larger than any compiler's loop, return and call take between two frames."""

MAX_COUNTED = 255
"""The maximum count of frames or calls: one byte, so that the cycles do not depend on its value."""

FEW_FRAMES_A_CALL = 100
"""The smallest number of frames per call of a long run, if it can be divided into equal calls."""


def sequence(schedule: PulseSchedule, overheads: Overheads) -> Sequence:
    """Return the program of a schedule. Raises InputError if the schedule leaves a delay no time."""
    lead_in, loop = in_tables(schedule, _split(schedule.lead_in), _split(schedule.loop))
    parts = (*lead_in, *loop)
    owners = _owners(parts)
    if not any(owners):
        raise InputError("no-pulses", "the schedule has no pulse")
    frames = [
        _frame(schedule, part, owner, overheads) if owner else None
        for part, owner in zip(parts, owners, strict=True)
    ]
    exits = _exits(schedule, frames, len(lead_in))
    functions = {
        owner: _function(
            schedule,
            owner,
            [step for step, other in enumerate(owners) if other == owner],
            parts,
            frames,
            exits,
            overheads,
        )
        for owner in dict.fromkeys(owners)
        if owner and owner.owner > 0
    }
    steps = tuple(
        SilentStep(part.run.frames, Cycles(part.run.frames * schedule.period))
        if frame is None or owner is None
        else _step(schedule, step, part, frame, functions.get(owner), exits[step], overheads)
        for step, (part, owner, frame) in enumerate(zip(parts, owners, frames, strict=True))
    )
    start = _delay(schedule.period, START, overheads, "from reset to the first edge")
    return Sequence(
        schedule,
        start,
        tuple(each for each in functions.values() if isinstance(each, FrameFunction)),
        tuple(each for each in functions.values() if isinstance(each, RowFunction)),
        steps[: len(lead_in)],
        steps[len(lead_in) :],
    )


def _owners(parts: tuple[SchedulePart, ...]) -> list[DelayPath | None]:
    """Return the path inside the frames of each part: of a table, of a position (from 1) that is repeated or
    comes back, or of a frame of its own (the number of its step, negative); None without pulses.
    """
    own = [part.run for part in parts if pulsed(part.run) and not part.table]
    often = Counter(run.pulses for run in own)
    shared = dict.fromkeys(run.pulses for run in own if run.frames > 1 or often[run.pulses] > 1)
    numbers = {pulses: number for number, pulses in enumerate(shared, 1)}
    return [
        DelayPath("row", part.table.number)
        if part.table
        else DelayPath("in", numbers.get(part.run.pulses, -step))
        if pulsed(part.run)
        else None
        for step, part in enumerate(parts)
    ]


def _split(runs: tuple[Run, ...]) -> tuple[SchedulePart, ...]:
    """Return the same frames in parts whose frames and turns are counted in one byte each."""
    parts: list[SchedulePart] = []
    for run in runs:
        if not pulsed(run):
            parts.append(SchedulePart(run))
            continue
        left = run.frames
        while left > MAX_COUNTED:
            size, turns = _equal_calls(left)
            parts.append(SchedulePart(Run(size, run.pulses), turns))
            left -= size * turns
        parts += [SchedulePart(Run(left, run.pulses))] if left else []
    return tuple(parts)


def _equal_calls(frames: int) -> tuple[int, int]:
    """Return (frames per call, calls) for all of `frames`, or for as many as possible."""
    # Equal calls are one loop; a remainder would need a call of its own.
    for size in range(MAX_COUNTED, FEW_FRAMES_A_CALL, -1):
        if frames % size == 0 and frames // size <= MAX_COUNTED:
            return size, frames // size
    return MAX_COUNTED, min(frames // MAX_COUNTED, MAX_COUNTED)


def _frame(schedule: PulseSchedule, part: SchedulePart, inner: DelayPath, overheads: Overheads) -> FrameEdges:
    """Return the port writes of one frame and the delays between them."""
    changes: dict[int, list[tuple[int, int]]] = {}
    for channel, pulse in enumerate(part.run.pulses):
        if pulse:
            changes.setdefault(pulse.rise, []).append((channel, 1))
            moves = part.table and channel in part.table.channels
            width = part.table.longest(channel) if part.table and moves else pulse.width
            changes.setdefault(pulse.rise + width, []).append((channel, 0))
    times = sorted(changes)
    ports = {"A": 0, "B": 0}
    edges = []
    for index, cycle in enumerate(times):
        touched = {schedule.channels[channel].pin[1] for channel, _ in changes[cycle]}
        if len(touched) > 1:
            raise InputError(
                "edges-too-close",
                f"edges of both ports fall on cycle {cycle} of a frame",
                hint="one write reaches one port: move one servo to the other's port or to another slot",
            )
        (port,) = touched
        for channel, level in changes[cycle]:
            mask = 1 << int(schedule.channels[channel].pin[2])
            ports[port] = ports[port] | mask if level else ports[port] & ~mask
        wait, table = Cycles(0), _table_delay(part.table, changes[cycle])
        if index + 1 < len(times):
            free = FIXED if table and table.sign > 0 else times[index + 1] - cycle
            path = DelayPath(inner.kind, inner.owner, index)
            wait = _delay(free, path, overheads, f"after cycle {cycle} of a frame")
        edges.append(Edge(Cycles(cycle), port, ports[port], tuple(changes[cycle]), wait, table))
    return FrameEdges(tuple(edges), part.run)


def _table_delay(table: WidthTable | None, changes: list[tuple[int, int]]) -> TableDelay | None:
    """Return the delay after an edge whose channel moves: the width, or what is left of the longest one."""
    for channel, level in changes:
        if table and channel in table.channels:
            return (
                TableDelay(channel, 1, -FIXED) if level else TableDelay(channel, -1, table.longest(channel))
            )
    return None


def _exits(
    schedule: PulseSchedule, frames: list[FrameEdges | None], lead_in: int
) -> dict[int, Cycles | None]:
    """Return for each step with pulses the cycles from its last edge to the next step's first, without
    pauses.

    None if no pulse follows.
    """
    order = [step for step, frame in enumerate(frames) if frame]
    following = dict(pairwise(order))
    around = [step for step in order if step >= lead_in]
    if around:
        following[order[-1]] = around[0]
    exits: dict[int, Cycles | None] = dict.fromkeys(order)
    for step, after in following.items():
        here, there = frames[step], frames[after]
        if here and there:
            exits[step] = Cycles(schedule.period - here.last + there.first)
    return exits


def _function(
    schedule: PulseSchedule,
    inner: DelayPath,
    mine: list[int],
    parts: tuple[SchedulePart, ...],
    frames: list[FrameEdges | None],
    exits: dict[int, Cycles | None],
    overheads: Overheads,
) -> FrameFunction | RowFunction:
    """Return the function that the steps `mine` call."""
    frame, table = next(frame for step in mine if (frame := frames[step])), parts[mine[0]].table
    around = _around(schedule, frame)
    margin = MARGIN + (FIXED if table else 0)
    gap = _checked(
        min([around, *(leave for step in mine if (leave := exits[step]))]) - margin, "between frames"
    )
    path = DelayPath("next" if table else "again", inner.owner)
    again = _delay(around - gap, path, overheads, "between frames")
    return RowFunction(table, frame, gap, again) if table else FrameFunction(inner.owner, frame, gap, again)


def _around(schedule: PulseSchedule, frame: FrameEdges) -> Cycles:
    """Return the cycles from a frame's last edge to the first edge of the same frame repeated."""
    return Cycles(schedule.period - frame.last + frame.first)


def _step(
    schedule: PulseSchedule,
    step: int,
    part: SchedulePart,
    frame: FrameEdges,
    function: FrameFunction | RowFunction | None,
    leave: Cycles | None,
    overheads: Overheads,
) -> Step:
    gap = function.gap if function else 0
    turn = after = Cycles(0)
    if part.turns > 1:
        turn = _delay(_around(schedule, frame) - gap, DelayPath("turn", step), overheads, "between frames")
    if leave is not None:
        after = _delay(leave - gap, DelayPath("after", step), overheads, "between frames")
    if isinstance(function, RowFunction):
        return Move(step, function, part.first, part.run.frames, after)
    return Hold(step, frame, function, part.run.frames, part.turns, turn, after)


def _delay(cycles: int, path: DelayPath, overheads: Overheads, where: str) -> Cycles:
    return _checked(cycles - overheads.of(path), where)


def _checked(cycles: int, where: str) -> Cycles:
    if cycles < 0:
        raise InputError(
            "edges-too-close",
            f"two edges are too close {where}: "
            f"the statements between them take {counted(-cycles, 'cycle')} too many",
            hint="lengthen the period, or give the servos slots that are further apart",
        )
    return Cycles(cycles)
