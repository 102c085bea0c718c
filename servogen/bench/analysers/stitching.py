"""Several captures of one motion, where one is too short: each is cut to whole frames of the schedule.

In: a way to look once more, and the schedule's edges. Out: the captures, of which each is a record of its
own: what the pins did between two is not known. A capture in which something is wrong stays as it is, uncut.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from servogen.bench.analysers.memory import Plan
from servogen.bench.analysers.request import Record, cut, edges
from servogen.bench.analysers.sump_client import Seen
from servogen.edges import EdgeTrace, Expected
from servogen.errors import ToolError
from servogen.units import OSCILLATOR_PERIODS_PER_CYCLE, Clock, Cycles
from servogen.verify import CaptureVerdict, verify_capture

MOST_TURNS = 4
"""So many times the looks that are needed are made, and no more, until each of the loop's frames is seen."""

STAGGER = 3
"""Looks of so many lengths take turns: a loop that is as long as some looks shows all of itself, too."""


@dataclass(frozen=True, slots=True)
class Stitched:
    """`missing` is the reason why the last capture is incomplete; `unseen` counts the frames of the loop that
    were not captured.
    """

    records: tuple[Record, ...]
    missing: str | None
    unseen: int


def stitch(
    look: Callable[[Plan, int], Seen],
    planned: Plan,
    frames: int,
    whole_loop: bool,
    expected: Expected,
    wired: Mapping[int, int],
) -> Stitched:
    """Capture until there are `frames` whole frames and, for the `whole_loop`, each different one has been
    seen.

    `look` takes a plan and the number of the look, from 1 on. `expected.chunks` is read anew for each.
    Where a look fails, those before it are kept.
    """
    records: list[Record] = []
    seen: frozenset[int] = frozenset()
    different: frozenset[int] = frozenset()
    whole = 0
    most = MOST_TURNS * -(-frames // planned.frames)
    while len(records) < most and (whole < frames or (whole_loop and different - seen)):
        number = len(records)
        try:
            found = look(planned.shorter(number % STAGGER), number + 1)
        except ToolError as error:
            if not records:
                raise
            return Stitched(tuple(records), error.message, len(different - seen))
        record = Record(edges(found.runs, wired), found.runs.end)
        if found.missing is not None:
            return Stitched((*records, record), found.missing, len(different - seen))
        verdict = _verdict(record, planned, expected)
        seen, different = seen | verdict.coverage.seen, verdict.coverage.different
        whole += verdict.whole.count if verdict.whole else planned.frames
        records.append(_cut(record, verdict))
    return Stitched(tuple(records), None, len(different - seen))


def _verdict(record: Record, planned: Plan, expected: Expected) -> CaptureVerdict:
    clock = Clock(int(planned.rate * OSCILLATOR_PERIODS_PER_CYCLE))
    trace = EdgeTrace(clock, (record.chunk,), Cycles(record.end))
    return verify_capture(expected, trace, sample=1, pieces=((0, record.end),))


def _cut(record: Record, verdict: CaptureVerdict) -> Record:
    if not verdict.agrees or verdict.whole is None:
        return record
    return cut(record, verdict.whole.begin, verdict.whole.end)
