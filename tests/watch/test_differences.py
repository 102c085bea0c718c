"""Where edges differ from their schedule: for looking at, and as `verify` counts them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from servogen.edges import PINS, EdgeChunk, EdgeTrace
from servogen.engines.board import machine_of
from servogen.programs import read_program, read_schedule
from servogen.pulse.expected import expected
from servogen.units import Cycles
from servogen.watch.differences import ScheduledEdges, differences, differing, place_schedule, spans

FOLDER = Path(__file__).parent.parent.parent / "firmware" / "hexapod-tripod"
SCHEDULE = read_schedule(FOLDER / "schedule.json")
IMAGE = read_program(FOLDER / "main.hex").image
END = Cycles(9_000_000)


def trace() -> EdgeTrace:
    return EdgeTrace(SCHEDULE.clock, machine_of(SCHEDULE, IMAGE).stream(END), END).stored()


def moved(made: EdgeTrace, index: int, cycles: int) -> EdgeTrace:
    """The trace with one edge that comes later."""
    chunk = next(iter(made.chunks))
    cycle = chunk.cycle.copy()
    cycle[index] += cycles
    order = np.argsort(cycle, kind="stable")
    return EdgeTrace(made.clock, (EdgeChunk(cycle[order], chunk.pin[order], chunk.level[order]),), made.end)


def test_the_edges_of_a_window_are_those_that_verify_expects() -> None:
    every = []
    for chunk in expected(SCHEDULE).chunks:
        every += list(zip(*(column.tolist() for column in chunk[:3]), strict=True))
        if every[-1][0] > END:
            break
    first = min(pulse.rise for pulse in ScheduledEdges(SCHEDULE, 0).run_at(0).pulses if pulse)
    wanted = ScheduledEdges(SCHEDULE, 1000 - first)
    for begin, end in ((0, 400_000), (1_234_567, 1_300_001), (8_000_000, 8_500_000)):
        asked = [(cycle + 1000, pin, level) for cycle, pin, level in every if begin <= cycle + 1000 < end]
        assert wanted.edges(begin, end) == sorted(asked)
    assert wanted.edges(0, 1000) == []


def test_a_proven_program_differs_nowhere() -> None:
    made = trace()
    wanted = place_schedule(SCHEDULE, made)
    assert wanted is not None
    assert next(differences(wanted, made, END), None) is None


def test_the_first_difference_is_the_edge_that_was_moved() -> None:
    made = trace()
    wanted = place_schedule(SCHEDULE, made)
    assert wanted is not None
    chunk = next(iter(made.chunks))
    index = len(chunk.cycle) // 2
    cycle = int(chunk.cycle[index])
    late = moved(made, index, 1)
    assert next(differences(wanted, late, END), None) == cycle
    assert next(differences(wanted, late, cycle), None) is None
    found = differing(wanted, next(iter(late.chunks)), cycle - 10, cycle + 10)
    assert [(edge[0] - cycle, PINS[edge[1]]) for edge in found] == [
        (0, PINS[chunk.pin[index]]),
        (1, PINS[chunk.pin[index]]),
    ]


def test_pulses_that_stop_are_a_difference() -> None:
    made = trace()
    wanted = place_schedule(SCHEDULE, made)
    assert wanted is not None
    chunk = next(iter(made.chunks))
    half = int(np.searchsorted(chunk.cycle, 4_000_000))
    stopped = EdgeTrace(made.clock, (EdgeChunk(*(column[:half] for column in chunk)),), END)
    found = next(differences(wanted, stopped, END), None)
    assert found is not None and 4_000_000 <= found < 4_000_000 + SCHEDULE.period


def test_a_trace_without_pulses_has_no_beginning() -> None:
    chunk = EdgeChunk(np.zeros(0, np.int64), np.zeros(0, np.uint8), np.zeros(0, np.uint8))
    assert place_schedule(SCHEDULE, EdgeTrace(SCHEDULE.clock, (chunk,), END)) is None


def test_differences_in_neighbouring_frames_are_one_span() -> None:
    assert spans([5, 7, 20_007, 90_000], 30_000) == ((5, 20_007), (90_000, 90_000))
    assert spans([], 30_000) == ()
    assert len(spans(range(0, 10_000_000, 10), 5)) == 400, "no slider has room for more"
