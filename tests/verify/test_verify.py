"""Each way in which a trace can differ from its schedule is found, named and placed."""

import json
from collections.abc import Iterator
from itertools import count

import numpy as np
import pytest

from servogen.edges import (
    HIGH,
    LOW,
    PINS,
    UNDRIVEN,
    EdgeTrace,
    Expected,
    ExpectedChannel,
    ExpectedChunk,
    edge_chunk,
)
from servogen.errors import InputError
from servogen.units import Clock, Cycles
from servogen.verify import Verdict, verdict_lines, verify, whole_motion
from servogen.verify.diagnose import PinHistory, TraceStretch, first_difference
from servogen.verify.verdict import Difference
from servogen.verify.windows import Edges
from tests.verify.pulses import Edge, edges_of

MHZ4 = Clock(4_000_000)
PERIOD = 20_000
RB0, RB1, RB7 = PINS.index("RB0"), PINS.index("RB1"), PINS.index("RB7")
START = 4321
FRAMES = 30  # lead-in 6, loop 12, two repeats
Pulse = tuple[int, int, int]  # rise, width, pin


def frame_pulses(frame: int) -> list[Pulse]:
    """RB0 sweeps up and back in the loop; RB1's pulse begins on the edge that ends it, as in lab 9."""
    width = 1000 if frame < 6 else 1000 + 10 * min((frame - 6) % 12, 12 - (frame - 6) % 12)
    return [(frame * PERIOD, width, RB0), (frame * PERIOD + width, 1250, RB1)]


def schedule(loop: int = 12, lead_in: int = 6) -> Expected:
    def chunks() -> Iterator[ExpectedChunk]:
        for frame in count() if loop else range(lead_in):
            edges = edges_of(frame_pulses(frame))
            cycle, pin, level = zip(*edges, strict=True)
            yield ExpectedChunk(*edge_chunk(cycle, pin, level), np.full(len(edges), frame, dtype=np.int64))

    channels = (ExpectedChannel("vertical", RB0), ExpectedChannel("horizontal", RB1))
    return Expected(MHZ4, Cycles(PERIOD), channels, lead_in, loop, chunks())


def trace(edges: list[Edge], end: int = FRAMES * PERIOD, start: int = START) -> EdgeTrace:
    """The edges, `start` cycles after reset, after the chip has made RB0 to RB7 outputs."""
    rows = [(3, pin, LOW) for pin in range(RB0, RB7 + 1)]
    rows += [(start + cycle, pin, level) for cycle, pin, level in sorted(edges)]
    columns = list(zip(*sorted(rows), strict=True))
    return EdgeTrace(MHZ4, (edge_chunk(*columns),), Cycles(start + end))


def pulses(frames: int = FRAMES) -> list[Pulse]:
    return [pulse for frame in range(frames) for pulse in frame_pulses(frame)]


def verdict_on(changed: list[Pulse], **options: int) -> Verdict:
    return verify(schedule(), trace(edges_of(changed), **options))


def test_the_scheduled_edges_are_proven_over_the_lead_in_and_two_repeats_wherever_they_start() -> None:
    for start in (4, 25, 72_000):
        verdict = verdict_on(pulses(), start=start)
        assert verdict.passed
        assert verdict.reasons == ()
        assert verdict.start == start
        span = verdict.span
        assert (span.compared, span.frames, span.lead_in_frames, span.loop_repeats) == (600_000, 30, 6, 2)
        assert [(channel.scheduled, channel.observed) for channel in verdict.channels] == [(30, 30), (30, 30)]
        assert verdict.worst_edge_error == 0
        assert verdict.difference is None


def test_the_order_of_two_changes_in_one_cycle_does_not_matter() -> None:
    backwards = sorted(edges_of(pulses()), key=lambda edge: (edge[0], -edge[1]))
    chunk = edge_chunk(*zip(*[(START + cycle, pin, level) for cycle, pin, level in backwards], strict=True))
    assert verify(schedule(), EdgeTrace(MHZ4, (chunk,), Cycles(700_000))).passed


def test_undriven_counts_as_low() -> None:
    rows = [
        (START + cycle, pin, level if level == HIGH else UNDRIVEN) for cycle, pin, level in edges_of(pulses())
    ]
    assert verify(
        schedule(), EdgeTrace(MHZ4, (edge_chunk(*zip(*rows, strict=True)),), Cycles(700_000))
    ).passed


def test_one_width_longer_by_one_cycle_is_one_wrong_width_with_cycle_pin_and_frame() -> None:
    changed = pulses()
    changed[2 * 17] = (17 * PERIOD, 1010 + 1, RB0)  # frame 17 is frame 11 of the loop: 1010 µs
    verdict = verdict_on(changed)
    assert not verdict.passed
    difference = verdict.difference
    assert difference is not None
    fall = START + 17 * PERIOD + 1010
    assert (difference.cycle, difference.pin, difference.channel, difference.frame) == (
        fall,
        RB0,
        "vertical",
        17,
    )
    assert (difference.expected, difference.observed, difference.level) == (fall, fall + 1, LOW)
    vertical, horizontal = verdict.channels
    assert (vertical.width.error, vertical.width.count, vertical.width.frame) == (1, 1, 17)
    assert (vertical.period.count, vertical.missing, vertical.extra, vertical.glitches) == (0, 0, 0, 0)
    assert (horizontal.width.count, horizontal.edge.count) == (0, 0)
    assert verdict.overlap is not None
    assert (verdict.overlap.count, verdict.overlap.longest, verdict.overlap.first) == (1, 1, fall)
    assert verdict.overlap.pins == (RB0, RB1)
    assert verdict.reasons[0] == (
        f"first difference at cycle {fall}, RB0 (vertical), frame 17 (frame 11 of the loop): "
        f"should fall at cycle {fall}, falls at cycle {fall + 1}, 1 cycle late"
    )


def test_one_delay_longer_by_one_cycle_is_one_wrong_width_and_one_wrong_period_and_shifts_the_rest() -> None:
    late = [
        (rise + (rise > 10 * PERIOD), width + (rise == 10 * PERIOD), pin) for rise, width, pin in pulses()
    ]
    vertical, horizontal = verdict_on(late).channels
    assert (vertical.width.error, vertical.width.count, vertical.width.frame) == (1, 1, 10)
    assert (vertical.period.error, vertical.period.count, vertical.period.frame) == (1, 1, 11)
    assert (horizontal.width.count, horizontal.period.count, horizontal.edge.error) == (0, 1, 1)


def test_a_dropped_pulse_is_one_missing_pulse() -> None:
    changed = [pulse for pulse in pulses() if pulse[:1] != (20 * PERIOD,)]
    verdict = verdict_on(changed)
    vertical, horizontal = verdict.channels
    assert (vertical.missing, vertical.extra, vertical.scheduled, vertical.observed) == (1, 0, 30, 29)
    assert (vertical.width.count, vertical.period.count, vertical.edge.count) == (0, 0, 0)
    assert (horizontal.missing, horizontal.observed) == (0, 30)
    assert verdict.difference is not None
    assert (verdict.difference.frame, verdict.difference.expected) == (20, START + 20 * PERIOD)
    assert verdict.difference.observed == START + 21 * PERIOD


def test_an_extra_pulse_is_one_extra_pulse_in_its_frame() -> None:
    verdict = verdict_on([*pulses(), (9 * PERIOD + 8000, 1500, RB1)])
    assert [channel.extra for channel in verdict.channels] == [0, 1]
    assert [channel.edge.count for channel in verdict.channels] == [0, 0]
    assert verdict.difference is not None
    assert (verdict.difference.cycle, verdict.difference.pin) == (START + 9 * PERIOD + 8000, RB1)
    assert verdict.difference.frame == 9


def test_a_pulse_and_a_gap_of_a_few_cycles_are_glitches() -> None:
    pulse = verdict_on([*pulses(), (9 * PERIOD + 8000, 9, RB1)])
    assert [channel.glitches for channel in pulse.channels] == [0, 1]
    assert [channel.extra for channel in pulse.channels] == [0, 0]
    broken = [(3 * PERIOD, 400, RB0), (3 * PERIOD + 404, 596, RB0)]
    gap = verdict_on([*(p for p in pulses() if p[0] != 3 * PERIOD), *broken])
    assert [channel.glitches for channel in gap.channels] == [1, 0]
    assert [channel.width.count for channel in gap.channels] == [0, 0]
    assert not gap.passed
    assert not pulse.passed


def test_ten_cycles_are_no_glitch_unless_the_caller_says_so() -> None:
    changed = edges_of([*pulses(), (9 * PERIOD + 8000, 10, RB1)])
    assert verify(schedule(), trace(changed)).channels[1].extra == 1
    assert verify(schedule(), trace(changed), glitch=Cycles(11)).channels[1].glitches == 1


@pytest.mark.parametrize("at", [-1000, -1, 5000])
def test_an_edge_on_a_pin_that_is_not_scheduled_is_not_proven_even_before_the_first_pulse(at: int) -> None:
    verdict = verify(schedule(), trace([*edges_of(pulses()), (at, RB7, HIGH), (at + 400, RB7, LOW)]))
    assert not verdict.passed
    assert verdict.difference is not None
    assert (verdict.difference.cycle, verdict.difference.pin) == (START + at, RB7)
    assert [(stray.pin, stray.edges, stray.first) for stray in verdict.stray] == [(RB7, 2, START + at)]
    assert [(channel.width.count, channel.edge.count) for channel in verdict.channels] == [(0, 0), (0, 0)]


def test_the_first_pulse_of_a_channel_has_no_period_before_it() -> None:
    changed = pulses()
    changed[1] = (1000 + 2, 1250, RB1)
    horizontal = verdict_on(changed).channels[1]
    assert (horizontal.period.count, horizontal.period.error, horizontal.period.frame) == (1, -2, 1)
    assert (horizontal.edge.count, horizontal.width.count) == (2, 0)


@pytest.mark.parametrize(
    ("frame", "late", "lost"),
    [(8, 10_000, 0), (8, 10_001, 1), (29, 10_000, 0), (29, 10_001, 1), (29, 15_000, 1)],
)
def test_a_pulse_belongs_to_a_scheduled_one_up_to_half_a_period_away(
    frame: int, late: int, lost: int
) -> None:
    changed = [pulse for pulse in pulses() if pulse[2] == RB1 or pulse[0] != frame * PERIOD]
    vertical = verdict_on([*changed, (frame * PERIOD + late, 1000, RB0)], end=31 * PERIOD).channels[0]
    assert (vertical.missing, vertical.extra) == (lost, lost)


@pytest.mark.parametrize(("at", "frame"), [(499, 0), (500, 1), (999, 1)])
def test_an_edge_too_many_is_in_the_frame_around_it(at: int, frame: int) -> None:
    """If the next scheduled edge of its pin is more than half a period away, it is not that edge."""

    def side(rows: list[Edge]) -> Edges:
        columns = edge_chunk(*zip(*sorted(rows), strict=True))
        return Edges(*columns, columns[0] // 1000)

    scheduled = edges_of([(1000 * number, 100, RB0) for number in range(3)])
    stretch = TraceStretch(
        side(scheduled), side([*scheduled, (at, RB0, HIGH)]), 0, 3000, 70, PinHistory.at_start()
    )
    expected = Expected(MHZ4, Cycles(1000), (ExpectedChannel("arm", RB0),), 0, 3, ())
    assert first_difference(stretch, expected) == Difference(
        RB0, "arm", frame, HIGH, Cycles(1070), Cycles(at + 70)
    )


def test_a_schedule_without_pulses_is_proven_by_silence() -> None:
    def silent() -> Expected:
        return Expected(MHZ4, Cycles(PERIOD), (ExpectedChannel("arm", RB0),), 0, 2, ())

    right = verify(silent(), trace([], end=4 * PERIOD, start=0))
    assert (right.passed, right.reasons, right.start) == (True, (), None)
    assert (right.span.compared, right.span.frames) == (80_000, 4)
    assert [(channel.scheduled, channel.observed) for channel in right.channels] == [(0, 0)]
    short = verify(silent(), trace([], end=4 * PERIOD - 1, start=0))
    assert (short.passed, short.reasons) == (
        False,
        ("the trace ends at cycle 79999, 1 cycle (1e-06 s) before the end of the check",),
    )
    stray = verify(silent(), trace(edges_of([(100, 50, RB7)]), end=3 * PERIOD, start=0))
    assert stray.reasons == ("RB7, which the schedule does not drive, changes 2 times, first at cycle 100",)
    assert stray.difference == Difference(RB7, None, None, HIGH, None, Cycles(100))


def test_a_schedule_whose_pulses_never_come_was_not_compared() -> None:
    silent = verify(schedule(), trace([], end=4 * PERIOD))
    assert silent.reasons == ("no scheduled pin ever rises; RB0 should be the first",)
    assert (silent.span.compared, silent.span.frames, silent.start) == (0, 0, None)
    assert [(channel.scheduled, channel.observed) for channel in silent.channels] == [(0, 0), (0, 0)]


def test_a_drift_of_one_cycle_a_frame_is_a_wrong_period_in_every_frame_and_no_missing_pulse() -> None:
    drifting = [(rise + rise // PERIOD, width, pin) for rise, width, pin in pulses()]
    for channel in verdict_on(drifting).channels:
        assert (channel.period.error, channel.period.count) == (1, 29)
        assert (channel.width.count, channel.missing, channel.extra) == (0, 0, 0)
        assert channel.edge.error == 29


def test_every_reason_is_given_once_in_this_order() -> None:
    changed = pulses(25)
    changed[20] = (10 * PERIOD, 1040 + 5, RB0)
    changed.remove((12 * PERIOD + 1060, 1250, RB1))
    changed.append((14 * PERIOD + 9000, 100, RB7))
    verdict = verdict_on(changed, end=25 * PERIOD)
    fall, frame = START + 10 * PERIOD + 1040, "frame 10 (frame 4 of the loop)"
    assert verdict.reasons == (
        f"first difference at cycle {fall}, RB0 (vertical), {frame}: "
        f"should fall at cycle {fall}, falls at cycle {fall + 5}, 5 cycles late",
        f"RB0 (vertical): 1 wrong width, worst +5 cycles in {frame}, "
        f"1 wrong edge, worst +5 cycles in {frame}",
        "RB1 (horizontal): 1 missing pulse",
        "pulses overlap where the schedule has none together: "
        f"1 time, first at cycle {fall} (RB0 and RB1), for at most 5 cycles",
        "RB7, which the schedule does not drive, changes 2 times, "
        f"first at cycle {START + 14 * PERIOD + 9000}",
        f"the trace ends at cycle {START + 25 * PERIOD}, 100000 cycles (0.1 s) before the end of the check",
    )
    assert verdict.unseen == ()


def test_changes_of_a_stray_pin_before_and_after_the_first_pulse_are_one_count() -> None:
    verdict = verdict_on([*pulses(), (-200, 100, RB7), (3 * PERIOD + 5000, 100, RB7)])
    assert verdict.reasons == (
        f"first difference at cycle {START - 200}: RB7, which the schedule does not drive, rises",
        f"RB7, which the schedule does not drive, changes 4 times, first at cycle {START - 200}",
    )
    assert [(pin.pin, pin.edges, pin.first) for pin in verdict.stray] == [(RB7, 4, START - 200)]


def test_two_pulses_that_overlap_are_counted_where_the_schedule_has_none_together() -> None:
    early = [
        (rise - 100 if pin == RB1 and rise < 5 * PERIOD else rise, width, pin)
        for rise, width, pin in pulses()
    ]
    overlap = verdict_on(early).overlap
    assert overlap is not None
    assert (overlap.count, overlap.longest, overlap.first, overlap.pins) == (5, 100, START + 900, (RB0, RB1))


def test_channels_in_the_wrong_order_are_a_difference() -> None:
    swapped = [(rise, width, RB0 + RB1 - pin) for rise, width, pin in pulses()]
    verdict = verdict_on(swapped)
    assert not verdict.passed
    assert verdict.difference is not None
    assert (verdict.difference.cycle, verdict.difference.pin, verdict.difference.frame) == (START, RB0, 0)


def test_a_trace_that_ends_early_is_proven_only_for_the_shorter_time_that_the_caller_states() -> None:
    short = 10 * PERIOD
    edges = edges_of(pulses(10))
    verdict = verify(schedule(), trace(edges, end=short))
    assert not verdict.passed
    assert verdict.reasons == (
        f"the trace ends at cycle {START + short}, 400000 cycles (0.4 s) before the end of the check",
    )
    assert verdict.difference is None
    assert verify(schedule(), trace(edges, end=short), checked=Cycles(short)).passed
    assert not verify(schedule(), trace(edges, end=short - 1), checked=Cycles(short)).passed


def test_what_comes_after_the_checked_time_is_not_judged() -> None:
    edges = [*edges_of(pulses(10)), (10 * PERIOD + 77, RB7, HIGH)]
    assert verify(schedule(), trace(edges), checked=Cycles(10 * PERIOD + 1)).difference is not None
    assert verify(schedule(), trace(edges), checked=Cycles(10 * PERIOD)).passed


def test_a_motion_that_does_not_repeat_ends_in_silence() -> None:
    assert verify(schedule(0), trace(edges_of(pulses(6))), checked=Cycles(FRAMES * PERIOD)).passed
    assert whole_motion(schedule(0)) == 6 * PERIOD
    verdict = verify(schedule(0), trace(edges_of(pulses(7))), checked=Cycles(FRAMES * PERIOD))
    assert [channel.extra for channel in verdict.channels] == [1, 1]


def test_no_pulse_at_all_is_said() -> None:
    verdict = verify(schedule(), trace([(50, RB7, HIGH)]))
    assert not verdict.passed
    assert verdict.start is None
    assert verdict.reasons[0] == "no scheduled pin ever rises; RB0 should be the first"
    assert [stray.pin for stray in verdict.stray] == [RB7]


def test_a_program_that_stops_is_missing_pulses() -> None:
    verdict = verdict_on(pulses(8))
    assert [channel.missing for channel in verdict.channels] == [22, 22]
    assert verdict.difference is not None
    assert (verdict.difference.expected, verdict.difference.observed) == (START + 8 * PERIOD, None)


def test_a_pin_that_stays_high_is_a_wrong_width() -> None:
    stuck = [edge for edge in edges_of(pulses()) if edge[1] == RB1 or edge[0] <= 5 * PERIOD]
    vertical, horizontal = verify(schedule(), trace(stuck)).channels
    assert (vertical.observed, vertical.missing) == (6, 24)
    assert vertical.width.error == 25 * PERIOD - 1000
    assert horizontal.edge.count == 0


def test_cycles_of_different_clocks_are_not_compared() -> None:
    other = EdgeTrace(Clock(8_000_000), (), Cycles(1))
    with pytest.raises(InputError, match="8000000 Hz, the schedule of 4000000 Hz"):
        verify(schedule(), other)


def test_a_machine_that_runs_for_ever_is_read_only_as_far_as_needed() -> None:
    taken = []

    def machine() -> Iterator[object]:
        for frame in count():
            taken.append(frame)
            rows = [(START + cycle, pin, level) for cycle, pin, level in edges_of(frame_pulses(frame))]
            yield edge_chunk(*zip(*rows, strict=True))

    endless = EdgeTrace(MHZ4, machine(), Cycles(10**15))  # type: ignore[arg-type]
    assert verify(schedule(), endless).passed
    assert len(taken) <= FRAMES + 2


def test_after_a_difference_the_work_is_bounded() -> None:
    taken = []

    def machine() -> Iterator[object]:
        yield edge_chunk([START], [RB0], [HIGH])
        for block in count():
            taken.append(block)
            cycle = START + 100 + 100_000 * block + np.arange(0, 100_000, 4)
            yield edge_chunk(cycle, np.full(25_000, RB7), np.arange(25_000) % 2 ^ 1)

    verdict = verify(schedule(), EdgeTrace(MHZ4, machine(), Cycles(10**12)), checked=Cycles(10**11))  # type: ignore[arg-type]
    assert not verdict.passed
    assert verdict.span.compared < 10**8
    assert len(taken) < 1000


def test_the_json_is_plain_and_the_lines_say_the_same() -> None:
    changed = pulses()
    changed[2 * 17] = (17 * PERIOD, 1011, RB0)
    verdict = verdict_on(changed)
    data = json.loads(json.dumps(verdict.to_json()))
    assert data["exact"] is False
    assert data["first_difference"]["pin"] == "RB0"
    assert data["first_difference"]["frame"] == 17
    assert data["channels"][0]["worst_width"]["error_cycles"] == 1
    lines = verdict_lines(verdict)
    assert lines[0].startswith(
        "NOT exact: compared 600000 cycles (0.6 s), 30 frames (lead-in of 6, 2 repeats"
    )
    assert lines[1] == f"first edge {START} cycles (4321 µs) after reset"
    assert lines[2] == "RB0 vertical: 30 pulses; worst errors in cycles: width +1, period 0, edge +1"
    assert verdict_lines(verdict_on(pulses()))[0].startswith("exact: ")
