"""Which frames of the schedule a capture holds whole, and which of the loop's different frames these are.

     frame 6              frame 7                       frame 8
    ──┌─┐──┌┐───────┊────┌─┐──┌┐───────────────┊───────┌─┐
                  begin                       end          of frame 7, in the quiet before and after it

In: the scheduled edges and the line that joins their times with the capture's steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from servogen.edges import Expected
from servogen.verify.capture_align import Line
from servogen.verify.windows import Edges, Ints

MARGIN = 2
"""Samples between a whole frame's edges and the ends of the capture."""


@dataclass(frozen=True, slots=True)
class WholeFrames:
    """`count` frames from `first` on, and the steps of the capture at which they may be cut out."""

    first: int
    count: int
    begin: int
    end: int


def whole_frames(scheduled: Edges, line: Line, quantum: float, end: int) -> WholeFrames | None:
    """The frames whose every edge is in a capture of `end` steps; None where there is none."""
    frames, first, last = _extents(scheduled)
    rise, fall = line.steps(first), line.steps(last)
    rows = np.flatnonzero((rise > MARGIN * quantum) & (fall < end - MARGIN * quantum))
    if not len(rows):
        return None
    one, other = int(rows[0]), int(rows[-1])
    before = max(0.0, float(fall[one - 1])) if one else 0.0
    after = min(float(end), float(rise[other + 1])) if other + 1 < len(rise) else float(end)
    return WholeFrames(
        int(frames[one]),
        int(frames[other] - frames[one]) + 1,
        int((before + rise[one]) / 2),
        -int(-(fall[other] + after) // 2),
    )


def different_frames(scheduled: Edges, expected: Expected) -> npt.NDArray[np.int64]:
    """For each frame of lead-in and loop the loop's first one with the same edges, or -1."""
    total = expected.lead_in + expected.loop
    inside = scheduled.take(scheduled.frame < total)
    order = np.argsort(inside.frame, kind="stable")
    cycle, pin, level, frame = (column[order] for column in inside)
    since = cycle - frame * int(expected.period)
    starts = np.searchsorted(frame, np.arange(total + 1))
    known: dict[bytes, int] = {}
    found = np.full(total, -1, dtype=np.int64)
    for number in (*range(expected.lead_in, total), *range(expected.lead_in)):
        rows = slice(starts[number], starts[number + 1])
        edges = since[rows].tobytes() + pin[rows].tobytes() + level[rows].tobytes()
        if number >= expected.lead_in:
            known.setdefault(edges, number)
        found[number] = known.get(edges, -1)
    return found


def seen_of(different: Ints, whole: WholeFrames | None, expected: Expected) -> frozenset[int]:
    """Those of the loop's different frames, by the first of each, that are among the whole ones."""
    if whole is None:
        return frozenset()
    frames = np.arange(whole.first, whole.first + whole.count)
    if expected.loop:
        late = frames >= expected.lead_in
        frames[late] = expected.lead_in + (frames[late] - expected.lead_in) % expected.loop
    return frozenset(different[frames[frames < len(different)]].tolist()) - {-1}


def _extents(scheduled: Edges) -> tuple[Ints, Ints, Ints]:
    """Each frame that has edges, and the cycles of its first and its last."""
    order = np.argsort(scheduled.frame, kind="stable")
    frames, starts = np.unique(scheduled.frame[order], return_index=True)
    cycle = scheduled.cycle[order]
    ends = np.append(starts[1:], len(cycle)) - 1
    return frames, cycle[starts], cycle[ends]
