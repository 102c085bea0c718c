"""Determines which of a schedule's different frames were seen completely.

    frame      0    1    2    3    4    5    6    7   …        two frames are the same when their edges are
    edges      A    A    A    B    B    A    A    C            at the same times of the frame: A, B, C
    seen            └────────────────┘                         2 of the 3 different frames, 4 of the 8 frames

A different frame is named by the number of the first frame that looks like it. The loop's different frames
count. A loop that consists of a single frame is the rest after a motion that runs once; there, the different
frames of the lead-in count as well. Frames before the first edge never count, because time zero is that edge.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from servogen.edges import Expected
from servogen.verify.windows import Edges, Ints

if TYPE_CHECKING:
    from servogen.answers import CoverageAnswer


@dataclass(frozen=True, slots=True)
class Coverage:
    """The frames of a schedule (`different`, `lead_in`, `loop_frames`) and which of them were seen
    completely.
    """

    different: frozenset[int] = frozenset()
    seen: frozenset[int] = frozenset()
    lead_in: frozenset[int] = frozenset()
    """Different frames that only the lead-in has, where they do not count."""
    lead_in_seen: frozenset[int] = frozenset()
    loop_frames: int = 0
    loop_seen: frozenset[int] = frozenset()
    """Places in the loop, from 0 on, whose frame was seen."""
    once: bool = False
    """Whether the motion runs once, so that the lead-in counts as well."""

    @property
    def complete(self) -> bool:
        """Return whether every different frame that counts was seen."""
        return self.different <= self.seen

    def words(self) -> str:
        """Return `2 of 3 different frames`."""
        total = len(self.different)
        return f"{len(self.seen)} of {total} different frame{'' if total == 1 else 's'}"

    def to_json(self) -> CoverageAnswer:
        return {
            "different_frames": len(self.different),
            "different_frames_seen": len(self.seen),
            "lead_in_only_frames": len(self.lead_in),
            "lead_in_only_frames_seen": len(self.lead_in_seen),
            "loop_frames": self.loop_frames,
            "loop_frames_seen": len(self.loop_seen),
        }


def coverage(scheduled: Edges, expected: Expected, frames: range) -> Coverage:
    """Return what the complete `frames` show of the schedule; `scheduled` holds the edges of the whole
    motion.
    """
    same = same_frames(scheduled, expected)
    loop = frozenset(same[expected.lead_in :].tolist()) - {-1}
    before = frozenset(same[: expected.lead_in].tolist()) - loop - {-1}
    once = len(loop) <= 1 and bool(before)
    counted, aside = (loop | before, frozenset[int]()) if once else (loop, before)
    compared = np.zeros(len(same), dtype=np.bool_)
    compared[frames.start : min(frames.stop, expected.lead_in)] = True
    late = np.arange(max(frames.start, expected.lead_in), frames.stop)[: expected.loop]
    compared[expected.lead_in + (late - expected.lead_in) % max(expected.loop, 1)] = True
    seen = frozenset(same[compared].tolist())
    return Coverage(
        different=counted,
        seen=seen & counted,
        lead_in=aside,
        lead_in_seen=seen & aside,
        loop_frames=expected.loop,
        loop_seen=frozenset(np.flatnonzero(compared[expected.lead_in :]).tolist()),
        once=once,
    )


def compared_frames(scheduled: Edges, expected: Expected, compared: int) -> range:
    """Return the frames all of whose edges are before time `compared`, at which the next may have begun."""
    if not len(scheduled.cycle):
        return range(0)
    first = int(scheduled.frame[0])
    late = int(np.searchsorted(scheduled.cycle, compared))
    after_last_edge = int(scheduled.frame[late - 1]) + 1 if late else first
    elapsed = first + compared // expected.period
    if late == len(scheduled.cycle):
        return range(first, max(after_last_edge, elapsed))
    unfinished = int(scheduled.frame[late])
    return range(first, min(unfinished, max(after_last_edge, elapsed)))


def join_coverages(parts: Iterable[Coverage]) -> Coverage:
    """Return what several captures of one schedule show together."""
    first, *others = parts
    for other in others:
        first = replace(
            first,
            seen=first.seen | other.seen,
            lead_in_seen=first.lead_in_seen | other.lead_in_seen,
            loop_seen=first.loop_seen | other.loop_seen,
        )
    return first


def same_frames(scheduled: Edges, expected: Expected) -> Ints:
    """Return, for each frame of lead-in and loop, the first one with the same edges, preferring those of the
    loop.

    The value is -1 for the frames before the first edge.
    """
    total = expected.lead_in + expected.loop
    inside = scheduled.take(scheduled.frame < total)
    order = np.argsort(inside.frame, kind="stable")
    cycle, pin, level, frame = (column[order] for column in inside)
    since = cycle - frame * int(expected.period)
    starts = np.searchsorted(frame, np.arange(total + 1))
    known: dict[bytes, int] = {}
    numbers = np.full(total, -1, dtype=np.int64)
    first = int(frame[0]) if len(frame) else total
    # The loop first, so that a frame that occurs in both has the number that counts.
    for number in (*range(expected.lead_in, total), *range(expected.lead_in)):
        if number < first:
            continue
        rows = slice(starts[number], starts[number + 1])
        edges = since[rows].tobytes() + pin[rows].tobytes() + level[rows].tobytes()
        numbers[number] = known.setdefault(edges, number)
    return numbers
