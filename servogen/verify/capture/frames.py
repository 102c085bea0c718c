"""Determines which frames of the schedule a capture contains completely.

     frame 6              frame 7                       frame 8
    ──┌─┐──┌┐───────┊────┌─┐──┌┐───────────────┊───────┌─┐
                  begin                       end          of frame 7, in the quiet before and after it

In: the scheduled edges and the line that joins their times with the capture's steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, floor

import numpy as np

from servogen.verify.capture.alignment import Line
from servogen.verify.windows import Edges, Ints

MARGIN = 2
"""Samples between a whole frame's edges and the ends of the capture."""


@dataclass(frozen=True, slots=True)
class WholeFrames:
    """`count` frames from `first` on, and the steps of the capture between which they can be cut out."""

    first: int
    count: int
    begin: int
    end: int

    @property
    def frames(self) -> range:
        return range(self.first, self.first + self.count)


def whole_frames(scheduled: Edges, line: Line, quantum: float, end: int, period: int) -> WholeFrames | None:
    """Return the frames all of whose edges are in a capture of `end` steps; None if there are none.

    Frames without edges at either end are included if the capture contains their whole `period`.
    """
    frames, first, last = _extents(scheduled)
    rise, fall = line.steps(first), line.steps(last)
    rows = np.flatnonzero((rise > MARGIN * quantum) & (fall < end - MARGIN * quantum))
    if not len(rows):
        return None
    one, other = int(rows[0]), int(rows[-1])
    # A frame without edges begins at the time of the earliest edge of the other frames.
    zero = int((first - frames * period).min())
    inside = (line.cycles(np.array([0.0, float(end)])) - zero) / period
    begin_frame = max(ceil(float(inside[0])), int(frames[one - 1]) + 1 if one else 0)
    end_frame = floor(float(inside[1]))
    if other + 1 < len(frames):
        end_frame = min(end_frame, int(frames[other + 1]))
    from_frame = min(int(frames[one]), begin_frame)
    to_frame = max(int(frames[other]) + 1, end_frame)
    before = float(fall[one - 1]) if one else 0.0
    after = float(rise[other + 1]) if other + 1 < len(rise) else float(end)
    begin = line.steps(from_frame * period + zero) if from_frame < frames[one] else rise[one]
    until = line.steps(to_frame * period + zero) if to_frame > frames[other] + 1 else fall[other]
    return WholeFrames(
        from_frame,
        to_frame - from_frame,
        int((before + float(begin)) / 2) if before > 0 else 0,
        ceil((float(until) + after) / 2) if after < end else end,
    )


def _extents(scheduled: Edges) -> tuple[Ints, Ints, Ints]:
    """Return each frame that has edges, and the cycles of its first and its last."""
    order = np.argsort(scheduled.frame, kind="stable")
    frames, starts = np.unique(scheduled.frame[order], return_index=True)
    cycle = scheduled.cycle[order]
    ends = np.append(starts[1:], len(cycle)) - 1
    return frames, cycle[starts], cycle[ends]
