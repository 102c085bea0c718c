"""`exact` if, and only if, the driven edges from reset to the end of the check are the schedule's."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from hypothesis import assume, event, given, settings
from hypothesis import strategies as st

from servogen.edges import HIGH, LOW, PINS, EdgeTrace, Expected, ExpectedChannel, ExpectedChunk, edge_chunk
from servogen.units import Clock, Cycles
from servogen.verify import compare, verify

MHZ4 = Clock(4_000_000)
PERIOD = 400
PINS_USED = (5, 6, 9)
Edge = tuple[int, int, int]

WIDTHS = st.lists(
    st.tuples(*[st.one_of(st.none(), st.integers(1, 150)) for _ in PINS_USED]), min_size=1, max_size=8
)


def edges_of(widths: list[tuple[int | None, ...]]) -> tuple[list[Edge], list[int]]:
    """Edges and their frames; the pulses of a frame follow one another at 0, 120 and 240, or overlap."""
    rows = []
    for frame, row in enumerate(widths):
        for slot, width in enumerate(row):
            if width is not None:
                rise = frame * PERIOD + 120 * slot
                rows += [(rise, PINS_USED[slot], HIGH, frame), (rise + width, PINS_USED[slot], LOW, frame)]
    rows.sort()
    zero = rows[0][0]
    return [(cycle - zero, pin, level) for cycle, pin, level, _ in rows], [row[3] for row in rows]


def expected_of(edges: list[Edge], frames: list[int], lead_in: int, size: int) -> Expected:
    def chunks() -> Iterator[ExpectedChunk]:
        for start in range(0, len(edges), size):
            columns = zip(*edges[start : start + size], strict=True)
            yield ExpectedChunk(*edge_chunk(*columns), np.array(frames[start : start + size], dtype=np.int64))

    channels = tuple(ExpectedChannel(PINS[pin], pin) for pin in PINS_USED)
    return Expected(MHZ4, Cycles(PERIOD), channels, lead_in, 0, chunks())


@st.composite
def mutation(draw: st.DrawFn, edges: list[Edge]) -> list[Edge]:
    """Edges with up to three random changes: moved, dropped, added, given to another pin."""
    changed = list(edges)
    for _ in range(draw(st.integers(0, 3))):
        if not changed:
            break
        at = draw(st.integers(0, len(changed) - 1))
        cycle, pin, level = changed[at]
        kind = draw(st.sampled_from(["move", "drop", "drop two", "add", "pin", "shift"]))
        if kind == "move":
            changed[at] = (max(0, cycle + draw(st.integers(-3, 3))), pin, level)
        elif kind == "drop":
            del changed[at]
        elif kind == "drop two":
            del changed[at : at + 2]
        elif kind == "add":
            other = draw(st.integers(0, 12))
            width = draw(st.integers(0, 30))
            changed += [(cycle + 5, other, HIGH), (cycle + 5 + width, other, LOW)]
        elif kind == "pin":
            changed[at] = (cycle, draw(st.integers(0, 12)), level)
        else:
            by = draw(st.integers(0, 2))
            changed[at:] = [(cycle + by, pin, level) for cycle, pin, level in changed[at:]]
    return sorted(changed, key=lambda edge: (edge[0], edge[1]))


def driven(edges: list[Edge]) -> list[Edge]:
    level = dict.fromkeys(range(13), LOW)
    kept = []
    for cycle, pin, value in edges:
        if level[pin] != value:
            kept.append((cycle, pin, value))
            level[pin] = value
    return kept


def same(scheduled: list[Edge], observed: list[Edge], end: int, checked: int) -> bool:
    """The law, in plain Python."""
    rises = [cycle for cycle, pin, level in driven(observed) if pin in PINS_USED and level == HIGH]
    if not rises or rises[0] + checked > end:
        return False
    seen = sorted((cycle - rises[0], pin, level) for cycle, pin, level in driven(observed))
    return [e for e in seen if e[0] < checked] == sorted(e for e in scheduled if e[0] < checked)


@settings(max_examples=120)
@given(data=st.data(), widths=WIDTHS, start=st.integers(0, 5000), size=st.integers(1, 9))
def test_proven_exactly_when_the_edges_are_the_same(
    data: st.DataObject, widths: list[tuple[int | None, ...]], start: int, size: int
) -> None:
    assume(any(width is not None for row in widths for width in row))
    scheduled, frames = edges_of(widths)
    # A pulse of one pin may touch its next only where the schedule itself is sound.
    observed = data.draw(mutation(scheduled))
    observed = [(start + cycle, pin, level) for cycle, pin, level in observed]
    checked = data.draw(st.integers(1, len(widths) * PERIOD))
    end = start + data.draw(st.sampled_from([len(widths) * PERIOD, checked, checked - 1]))
    inside = [edge for edge in observed if edge[0] < end]
    cuts = sorted(data.draw(st.lists(st.integers(0, len(inside)), max_size=3)))
    parts = [inside[a:b] for a, b in pairwise([0, *cuts, len(inside)]) if b > a]
    trace = EdgeTrace(MHZ4, tuple(edge_chunk(*zip(*part, strict=True)) for part in parts), Cycles(end))
    verdict = verify(expected_of(scheduled, frames, len(widths), size), trace, Cycles(checked))
    should = same(scheduled, inside, end, checked)
    event(f"exact: {should}")
    assert verdict.passed == should
    assert verdict.passed == (verdict.reasons == ())
    if verdict.passed:
        assert verdict.difference is None
        assert all(channel.observed == channel.scheduled for channel in verdict.channels)


@settings(max_examples=30)
@given(data=st.data(), widths=WIDTHS, window=st.integers(20, 900))
def test_the_length_of_the_windows_changes_no_number(
    data: st.DataObject, widths: list[tuple[int | None, ...]], window: int
) -> None:
    assume(any(width is not None for row in widths for width in row))
    scheduled, frames = edges_of(widths)
    observed = data.draw(mutation(scheduled))
    assume(observed)
    # A pin that changes twice in one cycle has no width: where it is counted may depend on the window.
    assume(len({(cycle, pin) for cycle, pin, _ in observed}) == len(observed))
    trace = EdgeTrace(MHZ4, (edge_chunk(*zip(*observed, strict=True)),), Cycles(len(widths) * PERIOD + 99))
    whole = verify(expected_of(scheduled, frames, len(widths), 7), trace)
    before = compare.WINDOW
    compare.WINDOW = window
    try:
        assert verify(expected_of(scheduled, frames, len(widths), 7), trace).to_json() == whole.to_json()
    finally:
        compare.WINDOW = before
