"""A capture of the schedule is exact whatever its phase, crystal and analyser; no other is."""

import json
import re
from collections.abc import Callable, Iterator
from fractions import Fraction
from itertools import count

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from servogen.edges import HIGH, LOW, PINS, EdgeTrace, Expected, ExpectedChannel, ExpectedChunk, edge_chunk
from servogen.errors import InputError
from servogen.units import Clock, Cycles
from servogen.verify import CaptureVerdict, Tolerances, capture_lines, verify_capture
from tests.verify.pulses import edges_of

MHZ4 = Clock(4_000_000)
PERIOD = 20_000
RB0, RB1, RB7 = PINS.index("RB0"), PINS.index("RB1"), PINS.index("RB7")
LOOP = 60
Pulse = tuple[int, int, int]  # rise, width, pin
Edge = tuple[int, int, int]


def frame_pulses(frame: int) -> list[Pulse]:
    """Three positions of RB0 with moves between them and a pause of four frames; RB1 follows RB0's fall."""
    inside = frame % LOOP
    if inside >= LOOP - 4:
        return []
    width = (1167, 1500, 1667)[inside // 20] + (inside % 20) * 3
    return [(frame * PERIOD, width, RB0), (frame * PERIOD + width, 1250 + inside // 3, RB1)]


def schedule() -> Expected:
    def chunks() -> Iterator[ExpectedChunk]:
        for frame in count():
            edges = edges_of(frame_pulses(frame))
            if edges:
                cycle, pin, level = zip(*edges, strict=True)
                yield ExpectedChunk(
                    *edge_chunk(cycle, pin, level), np.full(len(edges), frame, dtype=np.int64)
                )

    channels = (ExpectedChannel("arm", RB0), ExpectedChannel("leg", RB1))
    return Expected(MHZ4, Cycles(PERIOD), channels, 0, LOOP, chunks())


def pulses(frames: int = 3 * LOOP) -> list[Pulse]:
    return [pulse for frame in range(frames) for pulse in frame_pulses(frame)]


def capture(
    edges: list[Edge],
    begin_us: float = -12_345.6,
    seconds: float = 2.0,
    ppm: float = 0.0,
    rate: int = 1_000_000,
    pins: tuple[int, ...] = (RB0, RB1),
) -> EdgeTrace:
    """What an analyser of `rate` samples a second sees from `begin_us` of the chip's time zero on."""
    end = int(seconds * rate)
    per_us = Fraction(rate, 1_000_000)
    level = dict.fromkeys(pins, LOW)
    rows = []
    for cycle, pin, value in sorted(edges):
        if pin not in pins:
            continue
        true_us = Fraction(cycle) / (1 + Fraction(ppm) / 1_000_000) - Fraction(begin_us)
        sample = -((-true_us * per_us) // 1)  # the first sample not before the edge
        if sample <= 0:
            level[pin] = value
        elif sample < end:
            rows.append((int(sample), pin, value))
    rows = [(0, pin, value) for pin, value in level.items()] + rows
    return EdgeTrace(Clock(4 * rate), (edge_chunk(*zip(*rows, strict=True)),), Cycles(end))


def verdict_on(changed: list[Pulse], **options: object) -> CaptureVerdict:
    return verify_capture(schedule(), capture(edges_of(changed), **options))  # type: ignore[arg-type]


def without(frame: int, pin: int = RB0) -> list[Pulse]:
    return [pulse for pulse in pulses() if (pulse[0] // PERIOD, pulse[2]) != (frame, pin)]


def wider(frame: int, by: int) -> list[Pulse]:
    """As of a program that waits `by` cycles too long in one pulse of RB0: all that follows is late."""
    at = frame * PERIOD
    return [
        (rise + by * (rise > at), width + by * (rise == at and pin == RB0), pin)
        for rise, width, pin in pulses()
    ]


@pytest.mark.parametrize("ppm", [0.0, 180.0, -95.5])
@pytest.mark.parametrize("begin_us", [-50_000.25, 0.3, 700.0, 411_111.1, 1_300_000.7])
@pytest.mark.parametrize("rate", [1_000_000, 500_000, 24_000_000])
def test_the_scheduled_pulses_are_proven_and_the_clock_is_found_within_2_ppm(
    ppm: float, begin_us: float, rate: int
) -> None:
    verdict = verdict_on(pulses(), begin_us=begin_us, ppm=ppm, rate=rate)
    assert verdict.reasons == ()
    assert verdict.passed
    assert verdict.ppm == pytest.approx(ppm, abs=2)
    assert verdict.first_frame is not None
    first = next(rise for rise, _, _ in pulses() if rise > begin_us * (1 + ppm / 1e6))
    assert verdict.first_frame == first // PERIOD % LOOP
    for channel in verdict.channels:
        assert abs(channel.width.worst_us) < 1e6 / rate + 0.01
        assert (channel.missing, channel.extra, channel.glitches) == (0, 0, 0)
        assert channel.scheduled == channel.captured > 80


@pytest.mark.parametrize("frame", [5, 21, 44])
@pytest.mark.parametrize("ppm", [0.0, 180.0])
def test_one_pulse_that_is_2_us_too_wide_is_caught_at_1_mhz_with_its_frame(frame: int, ppm: float) -> None:
    verdict = verdict_on(wider(frame, 2), ppm=ppm, seconds=1.1)
    assert not verdict.passed
    arm, leg = verdict.channels
    assert (arm.width.wrong, leg.width.wrong) == (1, 0)
    assert 1 < arm.width.worst_us < 3
    assert verdict.first_mismatch is not None
    assert (verdict.first_mismatch.pin, verdict.first_mismatch.frame) == (RB0, frame)


def test_a_constant_that_is_2_us_off_in_every_repeat_is_caught() -> None:
    changed = [(rise, width + 2 * (pin == RB1), pin) for rise, width, pin in pulses()]
    verdict = verdict_on(changed, ppm=180)
    assert verdict.channels[0].width.wrong == 0
    assert verdict.channels[1].width.wrong > 80


def test_a_servos_pin_that_stays_high_is_caught_where_the_loop_has_no_pulses_of_it() -> None:
    def chunks() -> Iterator[ExpectedChunk]:
        """The leg gets pulses in the first three frames only, at the same time as the arm."""
        for frame in range(100):
            rise, width = frame * PERIOD, (1900, 1910, 1920)[frame] if frame < 3 else 1003 + 101 * (frame % 5)
            edges = edges_of([(rise, width, RB0), *([(rise, 1500, RB1)] if frame < 3 else [])])
            cycle, pin, level = zip(*edges, strict=True)
            yield ExpectedChunk(*edge_chunk(cycle, pin, level), np.full(len(edges), frame, dtype=np.int64))

    channels = (ExpectedChannel("arm", RB0), ExpectedChannel("leg", RB1))
    shown = [
        (int(cycle), int(pin), int(level))
        for chunk in chunks()
        for cycle, pin, level in zip(*chunk[:3], strict=True)
    ]
    looked = capture(shown, begin_us=200_000, seconds=0.5, pins=(RB0, RB1))
    (edges,) = looked.chunks
    text = "RB1 (leg), at the capture's beginning: it is high where no pulse is scheduled"
    for level, reasons in ((LOW, ()), (HIGH, (f"first at 0.000000 s, {text}",))):
        levels = np.where(edges.pin == RB1, level, edges.level)
        held = EdgeTrace(looked.clock, (edge_chunk(edges.cycle, edges.pin, levels),), looked.end)
        expected = Expected(MHZ4, Cycles(PERIOD), channels, 3, 5, tuple(chunks()))
        assert verify_capture(expected, held, sample=1.0).reasons == reasons


def test_a_missing_an_extra_pulse_and_a_glitch_are_counted_and_placed() -> None:
    missing = verdict_on(without(30))
    assert [channel.missing for channel in missing.channels] == [1, 0]
    assert missing.first_mismatch is not None
    assert (missing.first_mismatch.frame, missing.first_mismatch.pin) == (30, RB0)
    assert missing.first_mismatch.time_us == pytest.approx(30 * PERIOD + 12_345.6, abs=2)
    extra = verdict_on([*pulses(), (30 * PERIOD + 9000, 1500, RB1)])
    assert [channel.extra for channel in extra.channels] == [0, 1]
    glitch = verdict_on([*pulses(), (30 * PERIOD + 9000, 4, RB1)])
    assert [channel.glitches for channel in glitch.channels] == [0, 1]
    assert not (missing.passed or extra.passed or glitch.passed)


def test_a_servo_that_is_shifted_in_every_frame_has_wrong_edges_and_no_missing_pulse() -> None:
    """A capture that begins with the rise of a pulse that is scheduled 400 µs later."""
    shifted = [(rise - 400 * (pin == RB0), width, pin) for rise, width, pin in pulses()]
    verdict = verdict_on(shifted, begin_us=-400.0)
    arm, leg = verdict.channels
    assert (arm.missing, leg.missing) == (0, 0)
    assert any("wrong edges, worst" in reason for reason in verdict.reasons)
    assert verdict.first_mismatch is not None
    assert "an edge that is not where it is scheduled" in verdict.first_mismatch.diagnostic.message


def test_a_wrong_first_pulse_does_not_mislead_the_search() -> None:
    verdict = verdict_on([(-9000, 1900, RB0), *pulses()])
    assert [channel.extra for channel in verdict.channels] == [1, 0]
    assert verdict.first_frame == 0


def test_a_wait_that_is_a_little_too_long_in_each_repeat_is_a_wrong_period() -> None:
    late = [(rise + 40 * (rise // PERIOD // LOOP), width, pin) for rise, width, pin in pulses()]
    verdict = verdict_on(late, seconds=3.0)
    assert not verdict.passed
    assert verdict.channels[0].period.wrong >= 2
    assert verdict.channels[0].width.wrong == 0


def test_a_crystal_that_is_off_by_more_than_allowed_is_said() -> None:
    verdict = verdict_on(pulses(), ppm=450)
    (reason,) = verdict.reasons
    assert re.fullmatch(r"the chip's clock is off by \+4(49|50)\.\d ppm, allowed ±300 ppm", reason)
    allowed = Tolerances(crystal_ppm=500)
    assert verify_capture(schedule(), capture(edges_of(pulses()), ppm=450), allowed).passed


def test_a_pin_that_was_not_connected_is_not_proven() -> None:
    verdict = verdict_on(pulses(), pins=(RB0,))
    assert verdict.reasons == ("RB1 (leg) was not captured: no wire of the capture is RB1",)


def test_changes_of_a_pin_that_is_not_scheduled_are_not_proven() -> None:
    edges = [*edges_of(pulses()), (50_000, RB7, HIGH), (60_000, RB7, LOW)]
    verdict = verify_capture(schedule(), capture(edges, pins=(RB0, RB1, RB7)))
    assert [stray.pin for stray in verdict.stray] == [RB7]
    assert not verdict.passed
    assert verify_capture(schedule(), capture(edges_of(pulses()), pins=(RB0, RB1, RB7))).passed


def test_pulses_that_overlap_by_more_than_a_sample_are_not_proven() -> None:
    early = [(rise - 3 * (pin == RB1), width + 3 * (pin == RB1), pin) for rise, width, pin in pulses()]
    verdict = verdict_on(early)
    assert any("overlap" in reason for reason in verdict.reasons)


@pytest.mark.parametrize("seconds", [0.001, 0.019])
def test_a_capture_without_a_whole_pulse_is_not_proven(seconds: float) -> None:
    verdict = verdict_on(pulses(), begin_us=1167, seconds=seconds, pins=(RB0, RB1))
    if seconds < 0.01:
        assert verdict.reasons == ("the capture holds too few of the schedule's pulses to be judged",)
    assert not verdict.passed


def test_one_frame_is_judged_by_the_nominal_clock() -> None:
    verdict = verdict_on(pulses(), begin_us=21 * PERIOD - 500, seconds=0.019)
    assert verdict.agrees
    assert not verdict.passed
    assert (verdict.ppm, verdict.frames, verdict.first_frame) == (None, 1, 21)


def test_another_motion_is_not_proven() -> None:
    other = [(rise, 1500, pin) for rise, width, pin in pulses()]
    assert not verdict_on(other).passed


def test_steps_finer_than_samples_are_no_finer_measurement() -> None:
    coarse = capture(edges_of(pulses()), ppm=180)
    chunk = next(iter(coarse.chunks))
    fine = EdgeTrace(
        Clock(4_000_000_000), (chunk._replace(cycle=chunk.cycle * 1000),), Cycles(coarse.end * 1000)
    )
    verdict = verify_capture(schedule(), fine)
    assert verdict.passed
    assert verdict.sample_us == 1.0
    assert verify_capture(schedule(), fine, sample=1000).to_json() == verdict.to_json()


def test_a_stated_rate_that_the_edges_contradict_gives_no_wider_tolerance() -> None:
    """A comment says 200 kHz, and edges lie on a grid of 1 µs: 3 µs are then seen."""
    right, wrong = capture(edges_of(pulses())), capture(edges_of(wider(3, 3)))
    found = verify_capture(schedule(), right, sample=5)
    assert found.passed and found.sample_us == 1.0
    assert not verify_capture(schedule(), wrong, sample=5).passed


def test_a_stated_rate_on_whose_grid_all_edges_lie_is_believed() -> None:
    coarse = capture(edges_of(pulses()), rate=500_000)
    chunk = next(iter(coarse.chunks))
    shifted = chunk.cycle * 2000 + 700 * (
        chunk.cycle > 0
    )  # the first sample is not on the grid of the others
    fine = EdgeTrace(Clock(4_000_000_000), (chunk._replace(cycle=shifted),), Cycles(coarse.end * 2000))
    assert verify_capture(schedule(), fine, sample=2000).sample_us == 2.0


def test_times_that_happen_to_be_round_hide_no_error() -> None:
    # Every edge at a multiple of 500 µs, but for one that is 3 µs late: samples are not 500 µs apart.
    edges = [(frame * PERIOD, 1500 + 3 * (frame == 30), RB0) for frame in range(100)]
    flat = Expected(
        MHZ4,
        Cycles(PERIOD),
        (ExpectedChannel("arm", RB0),),
        0,
        1,
        (
            ExpectedChunk(*edge_chunk([f * PERIOD + at], [RB0], [level]), np.array([f], dtype=np.int64))
            for f in range(100_000)
            for at, level in ((0, HIGH), (1500, LOW))
        ),
    )
    assert not verify_capture(flat, capture(edges_of(edges), begin_us=-500, pins=(RB0,))).passed


@pytest.mark.parametrize("change", [lambda p: p, lambda p: wider(9, 2)])
def test_the_json_is_plain(change: Callable[[list[Pulse]], list[Pulse]]) -> None:
    verdict = verdict_on(change(pulses()))
    data = json.loads(json.dumps(verdict.to_json()))
    assert data["agrees"] == verdict.passed
    assert data["channels"][0]["pin"] == "RB0"
    assert len(data["reasons"]) == len(verdict.reasons)


def test_the_lines_say_what_was_found() -> None:
    lines = capture_lines(verdict_on(pulses(), ppm=180))
    assert lines[0].startswith(
        "agrees: 57 of 57 different frames; 100 frames from frame 0 on in 2 s, a sample every 1 µs; "
        "within a sample and 0.1 µs of width, 0.1 µs of period and 0.5 µs of edge; "
    )
    assert re.match(r"the chip's clock is 1(79|80)\.\d ± 0\.\d ppm fast", lines[1])
    assert lines[2] == "of the loop's 57 different frames 57 were seen whole"  # 56 with pulses, and the pause
    assert lines[3].startswith("RB0 arm: 96 pulses; width error ")
    wrong = capture_lines(verdict_on(without(30), seconds=1.0))
    assert wrong[0].startswith("does NOT agree: ")
    assert any(line.startswith("- RB0 (arm): 1 missing pulse") for line in wrong)


ROWS = st.lists(st.tuples(st.integers(0, 30_000), st.integers(0, 12), st.integers(0, 2)), max_size=60)


@settings(max_examples=50)
@given(steps=ROWS, hz=st.sampled_from([4_000_000, 400_000, 4_000_000_000]), tail=st.integers(1, 10**5))
def test_whatever_was_captured_gets_a_verdict(steps: list[Edge], hz: int, tail: int) -> None:
    now, rows = 0, []
    for step, pin, level in steps:
        now += step
        rows.append((now, pin, level))
    chunks = (edge_chunk(*zip(*rows, strict=True)),) if rows else ()
    verdict = verify_capture(schedule(), EdgeTrace(Clock(hz), chunks, Cycles(now + tail)))
    assert verdict.passed == (verdict.reasons == ())
    assert not verdict.passed
    assert capture_lines(verdict)


def test_a_capture_of_days_is_refused_before_its_schedule_fills_the_memory() -> None:
    edges = edge_chunk([0, 100], [RB0, RB0], [HIGH, LOW])
    days = EdgeTrace(Clock(4_000_000), (edges,), Cycles(PERIOD * 10**8))
    with pytest.raises(InputError, match=r"frames of the schedule long: at most 1000000 are compared"):
        verify_capture(schedule(), days)


def at_clock(mhz: int) -> Expected:
    """The schedule for a chip with another crystal: the same microseconds, in its cycles of 4 / MHz µs."""
    slow = schedule()
    chunks = (chunk._replace(cycle=chunk.cycle * (mhz // 4)) for chunk in slow.chunks)
    return Expected(
        Clock(mhz * 1_000_000), Cycles(PERIOD * (mhz // 4)), slow.channels, slow.lead_in, slow.loop, chunks
    )


@pytest.mark.parametrize("mhz", [4, 8, 20])
def test_errors_are_microseconds_whatever_the_chips_clock(mhz: int) -> None:
    """A pulse 30 µs too wide, by a 1 MHz analyser: 1167 µs + 5 · 3 µs are scheduled in frame 5."""
    right = verify_capture(at_clock(mhz), capture(edges_of(pulses())))
    assert right.passed, right.reasons
    for channel in right.channels:
        assert abs(channel.width.worst_us) < 1.01
        assert channel.jitter_us < 1
    assert right.channels[0].mean_period_us == pytest.approx(20_000, abs=0.1)
    one_wider = [
        (rise, width + 30 * ((rise, pin) == (5 * PERIOD, RB0)), pin) for rise, width, pin in pulses()
    ]
    wrong = verify_capture(at_clock(mhz), capture(edges_of(one_wider)))
    arm, leg = wrong.channels
    assert (arm.width.wrong, leg.width.wrong, arm.period.wrong) == (1, 0, 0)
    assert arm.width.worst_us == pytest.approx(30, abs=1.01)
    assert arm.edge.worst_us == pytest.approx(30, abs=2)
    assert wrong.first_mismatch is not None
    assert wrong.first_mismatch.frame == 5
    assert wrong.first_mismatch.time_us == pytest.approx(5 * PERIOD + 12_345.6, abs=2)
    found = re.search(
        r"a pulse of ([\d.]+) µs where ([\d.]+) µs are scheduled", wrong.first_mismatch.diagnostic.message
    )
    assert found is not None
    assert float(found[1]) == pytest.approx(1212, abs=1.5)
    assert float(found[2]) == 1182
