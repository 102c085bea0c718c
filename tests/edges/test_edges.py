"""Traces: what is driven, what is a change, where a trace is cut; whatever the chunks."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from servogen.edges import HIGH, LOW, PINS, UNDRIVEN, Changes, EdgeChunk, EdgeTrace, edge_chunk, join
from servogen.units import Clock, Cycles

MHZ4 = Clock(4_000_000)
Row = tuple[int, int, int]

ROWS = st.lists(st.tuples(st.integers(0, 3), st.integers(0, 12), st.integers(0, 2)), max_size=80).map(
    lambda steps: [
        (sum(s for s, _, _ in steps[: n + 1]), pin, level) for n, (_, pin, level) in enumerate(steps)
    ]
)
CUTS = st.lists(st.integers(0, 80), max_size=4).map(sorted)


def chunked(rows: list[Row], cuts: list[int]) -> tuple[EdgeChunk, ...]:
    bounds = [0, *cuts, len(rows)]
    parts = [rows[a:b] for a, b in pairwise(bounds)]
    return tuple(edge_chunk(*zip(*part, strict=True)) if part else edge_chunk((), (), ()) for part in parts)


def rows_of(chunks: object) -> list[Row]:
    return list(zip(*(column.tolist() for column in join(chunks)), strict=True))  # type: ignore[arg-type]


def changes_of(rows: list[Row], start: int) -> list[Row]:
    level = [start] * len(PINS)
    kept = []
    for cycle, pin, value in rows:
        if level[pin] != value:
            kept.append((cycle, pin, value))
            level[pin] = value
    return kept


def test_the_thirteen_pins_in_order() -> None:
    assert PINS == ("RA0", "RA1", "RA2", "RA3", "RA4", "RB0", "RB1", "RB2", "RB3", "RB4", "RB5", "RB6", "RB7")


@given(rows=ROWS, cuts=CUTS)
def test_undriven_counts_as_low_and_what_changes_nothing_then_is_no_change(
    rows: list[Row], cuts: list[int]
) -> None:
    trace = EdgeTrace(MHZ4, chunked(rows, cuts), Cycles(1000))
    as_low = [(cycle, pin, HIGH if level == HIGH else LOW) for cycle, pin, level in rows]
    assert rows_of(trace.driven()) == changes_of(as_low, LOW)
    assert rows_of(trace.driven()) == rows_of(trace.driven())


@given(rows=ROWS, cuts=CUTS)
def test_changes_keeps_changes_only(rows: list[Row], cuts: list[int]) -> None:
    changes = Changes()
    assert rows_of([changes(chunk) for chunk in chunked(rows, cuts)]) == changes_of(rows, UNDRIVEN)


@given(rows=ROWS, cuts=CUTS, end=st.integers(0, 260))
def test_a_trace_is_cut_before_its_new_end_and_never_lengthened(
    rows: list[Row], cuts: list[int], end: int
) -> None:
    trace = EdgeTrace(MHZ4, chunked(rows, cuts), Cycles(250))
    cut = trace.until(end)
    assert cut.end == min(end, 250)
    assert rows_of(cut.chunks) == [row for row in rows if row[0] < end]


@given(rows=ROWS, cuts=CUTS)
def test_stored_is_the_same_trace(rows: list[Row], cuts: list[int]) -> None:
    trace = EdgeTrace(MHZ4, iter(chunked(rows, cuts)), Cycles(250)).stored()
    assert rows_of(trace.chunks) == rows_of(trace.chunks) == rows


def test_chunks_have_the_promised_types() -> None:
    for chunk in (edge_chunk([1], [2], [0]), join([]), join([edge_chunk((), (), ())])):
        assert [column.dtype for column in chunk] == [np.int64, np.uint8, np.uint8]


def test_a_trace_that_is_cut_reads_no_chunk_after_its_end() -> None:
    """A running machine's chunks never end."""

    def chunks() -> Iterator[EdgeChunk]:
        yield edge_chunk([1, 2], [5, 5], [1, 0])
        yield edge_chunk([3, 4], [5, 5], [1, 0])
        raise AssertionError

    trace = EdgeTrace(MHZ4, chunks(), Cycles(250))
    assert trace.until(250) is trace
    assert rows_of(trace.until(4).chunks) == [(1, 5, 1), (2, 5, 0), (3, 5, 1)]
