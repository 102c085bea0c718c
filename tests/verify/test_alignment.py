"""The alignment of a capture agrees with a slow second formulation of each of its steps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from random import Random

import numpy as np
import pytest

from servogen.edges import HIGH, LOW, PINS, EdgeTrace, Expected, ExpectedChannel, ExpectedChunk, edge_chunk
from servogen.errors import InputError
from servogen.units import Clock, Cycles
from servogen.verify.capture import alignment, check
from servogen.verify.capture.alignment import (
    MAX_SLOPE_ERROR,
    FittedLine,
    PairedSignals,
    WholeFrames,
    _cost,
    _regression,
    _slope,
    align,
    whole_frames,
)
from servogen.verify.capture.verdict import Tolerances
from servogen.verify.pulses import CutPulses
from servogen.verify.sampling import Sampling
from servogen.verify.windows import Edges
from tests.verify.pulses import edges_of, pulses

RB0, RB1 = PINS.index("RB0"), PINS.index("RB1")
UNCUT = CutPulses(False, None, None)
Bounds = list[tuple[int, int]]


def signals(captured: list[Bounds], scheduled: list[Bounds], **changes: object) -> PairedSignals:
    given = PairedSignals(
        captured=tuple(pulses(*channel) for channel in captured),
        scheduled=tuple(pulses(*channel) for channel in scheduled),
        nominal=2.0,
        quantum=3.0,
        period=1000,
        cap=50.0,
        candidates=10_000,
        cut=(UNCUT,) * len(captured),
        length=20_000,
    )
    return replace(given, **changes)  # type: ignore[arg-type]


def slow_cost(given: PairedSignals, anchor: int, slope: float, phase: float, look: int) -> float:
    """The errors of the first pulses of each channel, one by one, with the anchor at time `phase`."""
    total = 0.0
    sample = given.quantum / slope
    for wanted, got in zip(given.scheduled, given.captured, strict=True):
        rises, widths = wanted.rise.tolist(), wanted.width.tolist()
        seen = list(zip(got.rise.tolist(), got.width.tolist(), strict=True))[:look]
        if not rises:
            total += given.cap * len(seen)
            continue
        begin = end = phase - anchor / slope + given.period / 4
        fitting = 0
        for rise, width in seen:
            away = (rise - anchor) / slope
            row = min(range(len(rises)), key=lambda each: (abs(rises[each] - phase - away), each))
            late = abs(rises[row] - phase - away)
            end = phase + away + given.period / 4
            if late >= given.period / 4:
                total += given.cap
                continue
            fitting += 1
            wrong = max(abs(widths[row] - width / slope) - sample, 0)
            total += min(wrong + max(late - sample - abs(away) / 1000, 0), given.cap)
        due = sum(begin <= rise < end for rise in rises)
        total += given.cap * max(due - fitting, 0)
    return total


def drawn(random: Random, count: int, steps: float) -> Bounds:
    """FramedPulses in about every frame, some of them late, wide or missing, in steps per cycle."""
    found = []
    for frame in range(count):
        rise = 1000 * frame + random.choice((0, 0, 2, 40, 249, 250, 251, 400))
        if random.random() < 0.8:
            width = 100 + random.choice((0, 1, 2, 30, 300))
            found.append((round(steps * rise), round(steps * (rise + width))))
    return found


@pytest.mark.parametrize("cells", [alignment.MAX_CELLS, 7])
def test_the_cost_of_a_phase_is_the_sum_over_its_pulses(cells: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(alignment, "MAX_CELLS", cells)
    random = Random(7)
    for _ in range(12):
        captured = [drawn(random, random.randint(0, 6), 2.0) for _ in range(2)]
        scheduled = [drawn(random, random.randint(0, 9), 1.0) for _ in range(2)]
        given = signals(captured, scheduled)
        phases = np.array([0.0, 2.0, 1000.0, 1040.0, 3001.5, 7000.0])
        for look in (1, 3, 48):
            anchor, slope = random.choice((0, 80, 2500)), random.choice((2.0, 2.01))
            wanted = [slow_cost(given, anchor, slope, phase, look) for phase in phases.tolist()]
            found = _cost(given, anchor, slope, phases, look)
            assert found.tolist() == pytest.approx(wanted, abs=2e-6)


def test_the_speed_is_estimated_from_short_gaps_unless_it_is_absurd() -> None:
    def slope(rises: list[float], other: tuple[float, ...] = ()) -> float:
        bounds = [[(round(rise), round(rise) + 10) for rise in channel] for channel in (rises, other)]
        return _slope(signals(bounds, bounds))

    # A frame of 1000 cycles takes 2000 steps by the nominal clock: here two of them take 4040, 1 % more.
    assert slope([0, 2020, 4040]) == pytest.approx(2.02)
    # Over both channels: 1 + 2 frames in 2020 + 4000 steps.
    assert slope([0, 2020], (100, 4100)) == pytest.approx(2 * 6020 / 6000)
    # Gaps of 20 frames and more may be counted wrong; the others count.
    assert slope([0, 2020, 2020 + 39_999]) == pytest.approx(2 * (2020 + 39_999) / (21 * 2000))
    assert slope([0, 2020, 2020 + 40_000]) == pytest.approx(2.02)
    # A clock that is off by 2 % or more is a wrong period; one pulse tells nothing.
    assert slope([0, 2039]) == pytest.approx(2.039)
    assert slope([0, 1961]) == pytest.approx(1.961)
    assert slope([0, 2040]) == slope([0, 1960]) == slope([0, 900]) == slope([5]) == slope([]) == 2.0


def test_the_line_and_its_error_are_those_of_least_squares() -> None:
    random = Random(3)
    s = np.array([1e6 * frame + at for frame in range(12) for at in (0, 150)])
    t = 777 + 2.0004 * s + np.array([random.choice((-3, -1, 0, 2, 4)) for _ in s])
    (b, a), covariance = np.polyfit(s, t, 1, cov=True)
    line = _regression(s, t, signals([[]], [[]], quantum=1e-6))
    assert (line.a, line.b) == pytest.approx((a, b), rel=1e-9)
    assert line.b_error == pytest.approx(covariance[0, 0] ** 0.5, rel=1e-6)


def test_a_speed_that_is_not_known_to_20_ppm_is_the_nominal_one() -> None:
    s = np.array([0.0, 100.0, 1000.0, 1100.0])
    t = 50 + 2.004 * s
    spread = float(((s - s.mean()) ** 2).sum())
    # Rounding to samples is off by a twelfth of a sample squared on average, which limits the slope's error.
    limit = MAX_SLOPE_ERROR * 2.004 * (12 * spread) ** 0.5
    fine = _regression(s, t, signals([[]], [[]], quantum=limit * 0.999))
    assert (fine.a, fine.b) == pytest.approx((50, 2.004))
    assert fine.b_error == pytest.approx(0.999 * MAX_SLOPE_ERROR * 2.004)
    coarse = _regression(s, t, signals([[]], [[]], quantum=limit * 1.001))
    assert coarse == FittedLine(pytest.approx(t.mean() - 2 * s.mean()), 2.0, None)
    # Two edges determine a line without an error; three do.
    assert _regression(s[:2], t[:2], signals([[]], [[]], quantum=1e-9)).b_error is None
    assert _regression(s[:3], t[:3], signals([[]], [[]], quantum=1e-9)).b == pytest.approx(2.004)
    assert _regression(s[[1, 1, 1]], t[[1, 1, 1]], signals([[]], [[]])).b_error is None


WIDTHS = Random(5).choices(range(100, 400), k=300)
SCHEDULED: Bounds = [(1000 * frame, 1000 * frame + WIDTHS[frame]) for frame in range(300)]


@pytest.mark.parametrize("slope", [2.0, 2.03])
def test_pulses_that_are_far_from_the_anchor_are_paired_by_the_fitted_speed(slope: float) -> None:
    """Within the first 250 frames a clock that is off by 1.5 % has lost more than three."""
    first = 40
    captured = [
        (round(slope * (rise - 39_000)), round(slope * (fall - 39_000))) for rise, fall in SCHEDULED[first:]
    ]
    line = align(signals([captured], [SCHEDULED], candidates=60_000, length=captured[-1][1] + 500))
    assert line is not None
    assert line.b == pytest.approx(slope, rel=1e-6)
    assert line.steps(39_000) == pytest.approx(0, abs=1)


def test_pulses_with_long_pauses_between_them_are_paired_in_a_second_step() -> None:
    """Pauses tell nothing about the clock: at first it is taken as nominal, which is right for 100 frames."""
    scheduled = [SCHEDULED[frame] for frame in range(0, 300, 25)]
    captured = [(round(2.009 * rise + 50), round(2.009 * fall + 50)) for rise, fall in scheduled]
    given = signals([captured], [scheduled], candidates=1000, length=captured[-1][1] + 500)
    assert _slope(given) == 2.0
    line = align(given)
    assert line is not None
    times = np.array(scheduled).ravel()
    # The sample of three steps, not the rounding, limits how well the slope is known: by all edges.
    assert line.b_error == pytest.approx((9 / 12 / ((times - times.mean()) ** 2).sum()) ** 0.5)
    assert line.b == pytest.approx(2.009, rel=1e-5)


@pytest.mark.parametrize(("candidates", "found"), [(10_000, False), (10_001, True)])
def test_a_capture_begins_before_the_last_candidate(candidates: int, found: bool) -> None:
    captured = [(2 * rise - 19_900, 2 * fall - 19_900) for rise, fall in SCHEDULED[10:30]]
    line = align(signals([captured], [SCHEDULED], candidates=candidates, length=captured[-1][1] + 100))
    assert line is not None
    assert (line.a == pytest.approx(-19_900)) is found


def test_one_wrong_pulse_does_not_move_the_line() -> None:
    captured = [(2 * rise + 99, 2 * fall + 99) for rise, fall in SCHEDULED[:20]]
    captured[7] = (captured[7][0], captured[7][1] + 60)
    line = align(signals([captured], [SCHEDULED], length=captured[-1][1] + 100))
    assert line is not None
    assert (line.a, line.b) == pytest.approx((99, 2.0), abs=1e-6)


def test_the_first_pulses_may_be_glitches() -> None:
    """The first three pulses are tried as the anchor."""
    right = [(2 * rise + 2500, 2 * fall + 2500) for rise, fall in SCHEDULED[:20]]
    for glitches in ([], [(1000, 1003)], [(1000, 1003), (1500, 1502)]):
        line = align(signals([glitches + right], [SCHEDULED], length=right[-1][1] + 100))
        assert line is not None
        assert (line.a, line.b) == pytest.approx((2500, 2.0), abs=1e-6)


def slow_whole_frames(
    rows: dict[int, tuple[int, int]], line: FittedLine, quantum: float, end: int, period: int
) -> WholeFrames | None:
    """Frame by frame; `rows` has the first and the last edge of each frame with edges."""
    zero = min(first - period * frame for frame, (first, _) in rows.items())
    at = {frame: [float(line.steps(edge)) for edge in bounds] for frame, bounds in rows.items()}

    def begins(frame: int) -> float:
        return at[frame][0] if frame in at else float(line.steps(frame * period + zero))

    def ends(frame: int) -> float:
        return at[frame][1] if frame in at else float(line.steps((frame + 1) * period + zero))

    def whole(frame: int) -> bool:
        margin = 2 * quantum if frame in at else -1e-9
        inside = frame not in at or end - ends(frame) > margin
        return frame >= 0 and begins(frame) > margin and (inside and ends(frame) <= end + 1e-9)

    shown = [frame for frame in sorted(at) if whole(frame)]
    if not shown:
        return None
    first, last = shown[0], shown[-1]
    while first - 1 not in at and whole(first - 1):
        first -= 1
    while last + 1 not in at and whole(last + 1):
        last += 1
    before = [at[frame][1] for frame in at if frame < first]
    after = [at[frame][0] for frame in at if frame > last]
    begin = int((before[-1] + begins(first)) / 2) if before and before[-1] > 0 else 0
    until = -int(-(ends(last) + after[0]) / 2 // 1) if after and after[0] < end else end
    return WholeFrames(first, last - first + 1, begin, until)


def test_whole_frames_are_those_of_looking_at_each() -> None:
    random = Random(11)
    for _ in range(150):
        frames = sorted(random.sample(range(9), random.randint(1, 7)))
        rows = {}
        for frame in frames:
            first = 100 * frame + random.choice((0, 0, 10, 20))
            rows[frame] = (first, first + random.choice((10, 60)))
        columns = edge_chunk(
            *zip(
                *[
                    (cycle, RB0, level)
                    for bounds in rows.values()
                    for cycle, level in zip(bounds, (HIGH, LOW), strict=True)
                ],
                strict=True,
            )
        )
        shown = Edges(*columns, np.repeat(np.array(frames, dtype=np.int64), 2))
        line = FittedLine(random.choice((-450.0, -201.0, -200.0, 3.0, 41.0, 77.0)), 2.0, None)
        end = random.choice((400, 801, 1000, 1603, 1800))
        quantum = random.choice((1.0, 20.0))
        found = whole_frames(shown, line, quantum, end, 100)
        assert found == slow_whole_frames(rows, line, quantum, end, 100), (rows, line, quantum, end)


def schedule(frames: int = 6, lead_in: int = 2, loop: int = 3) -> Expected:
    """Pulses of RB0 in each frame and of RB1 in none, on a chip of 8 MHz: a cycle is half a microsecond."""

    def chunks() -> Iterator[ExpectedChunk]:
        for frame in range(frames):
            columns = edge_chunk(*zip(*edges_of([(1000 * frame, 100 + frame, RB0)]), strict=True))
            yield ExpectedChunk(*columns, np.full(2, frame, dtype=np.int64))

    channels = (ExpectedChannel("arm", RB0), ExpectedChannel("leg", RB1))
    return Expected(Clock(8_000_000), Cycles(1000), channels, lead_in, loop, chunks())


def capture(rows: list[tuple[int, int, int]], end: int) -> EdgeTrace:
    """A capture of 4 million steps a second."""
    return EdgeTrace(Clock(16_000_000), (edge_chunk(*zip(*rows, strict=True)),), Cycles(end))


def test_both_sides_are_converted_to_one_form() -> None:
    rows = [(0, RB0, HIGH), (0, RB1, LOW), (150, RB0, LOW), (1800, RB0, HIGH), (1838, RB0, LOW)]
    rows += [(2100, RB0, HIGH), (2139, RB0, LOW), (3800, RB0, HIGH)]
    made = check._set_up(
        schedule(), capture(rows, 4000), Tolerances(glitch_us=9.5), Sampling(0.75, stated=True)
    )
    assert (made.end, made.step_us, made.cycle_us) == (4000, 0.25, 0.5)
    assert (made.connected, made.level[RB0], made.level[RB1]) == ({RB0, RB1}, HIGH, LOW)
    given = made.signals
    assert (given.nominal, given.quantum, given.period, given.length) == (2.0, 3.0, 1000, 4000)
    # An error of at most 50 µs counts for a pulse; it may begin in the lead-in or two loops.
    assert (given.cap, given.candidates) == (100.0, 8000)
    # A pulse of 38 steps is no glitch, one of 9.5 µs or 38 steps is the shortest that counts.
    assert given.captured[0].rise.tolist() == [1800, 2100]
    assert (given.captured[0].width.tolist(), made.glitches) == ([38, 39], (0, 0))
    assert given.cut == (CutPulses(True, 150, 3800), UNCUT)
    longer = check._set_up(
        schedule(), capture(rows, 4000), Tolerances(glitch_us=9.75), Sampling(0.75, stated=True)
    )
    assert (longer.signals.captured[0].rise.tolist(), longer.glitches) == ([2100], (1, 0))
    # A sample that was only guessed is a microsecond at most, and no sample is shorter than a step.
    for sample_us, stated, quantum in (
        (2.0, False, 4.0),
        (2.0, True, 8.0),
        (0.1, True, 1.0),
        (0.5, False, 2.0),
    ):
        made = check._set_up(schedule(), capture(rows, 4000), Tolerances(), Sampling(sample_us, stated))
        assert made.signals.quantum == quantum


def test_a_capture_is_compared_with_the_schedule_three_per_cent_beyond_its_length() -> None:
    """It may begin at the end of the second loop, here at cycle 8000; 1000 steps are 500 cycles."""
    rows = [(0, RB0, LOW), (900, RB0, HIGH), (950, RB0, LOW)]
    # The tenth pulse rises at 9000: 1000.6 and 1001.2 cycles beyond the last beginning.
    for end, frames in ((1943, 9), (1944, 10)):
        made = check._set_up(
            schedule(frames=20), capture(rows, end), Tolerances(), Sampling(1.0, stated=True)
        )
        assert len(made.signals.scheduled[0].rise) == frames
    # A pulse that is not over by then ends there.
    made = check._set_up(schedule(frames=20), capture(rows, 2039), Tolerances(), Sampling(1.0, stated=True))
    assert made.signals.scheduled[0].fall[-2:].tolist() == [8108, 9050]


def test_the_longest_capture_that_is_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(check, "MAX_FRAMES", 5)
    rows = [(0, RB0, LOW), (900, RB0, HIGH), (950, RB0, LOW)]
    # Six frames are 12 000 steps, 3 % less by the fastest clock that is looked for.
    check._set_up(schedule(), capture(rows, 11_650), Tolerances(), Sampling(1.0, stated=True))
    with pytest.raises(InputError) as raised:
        check._set_up(schedule(), capture(rows, 11_651), Tolerances(), Sampling(1.0, stated=True))
    assert raised.value.message == ("the capture is 6 frames of the schedule long: at most 5 are compared")


@pytest.mark.parametrize(("steps", "overlap_us"), [(4, 0.0), (5, 1.25)])
def test_an_overlap_may_be_as_long_as_a_sample_and_the_tolerance(steps: int, overlap_us: float) -> None:
    """Samples of 0.75 µs and a tolerance of 0.25 µs: together four steps of 0.25 µs."""
    rows = [(0, RB0, LOW), (0, RB1, LOW), (100, RB0, HIGH), (300, RB1, HIGH), (300 + steps, RB0, LOW)]
    trace = capture([*rows, (400, RB1, LOW)], 500)
    made = check._set_up(schedule(), trace, Tolerances(width_us=0.25), Sampling(0.75, stated=True))
    assert check._overlap_us(made, FittedLine(0.0, 2.0, None)) == overlap_us
    assert check._overlap_us(made, None) == 0.0


def test_what_a_capture_shows_is_in_its_own_units() -> None:
    """Frames 5 to 8 of the schedule at 2000 steps each; RB1 never moves."""
    rows = [(0, RB0, LOW), (0, RB1, LOW)]
    rows += [
        (500 + 2 * cycle, pin, level)
        for cycle, pin, level in edges_of([(1000 * frame, 105 + frame, RB0) for frame in range(4)])
    ]
    found = check.verify_capture(schedule(frames=20, lead_in=1, loop=7), capture(rows, 8400), sample=1.5)
    assert (found.first_frame, found.frames, found.paired) == (5, 4, 4)
    assert (found.duration_us, found.sample_us) == (2100.0, 0.375)
    assert [(channel.captured, channel.scheduled) for channel in found.channels] == [(4, 4), (0, 0)]
    nothing = check.verify_capture(schedule(), capture(rows[:2], 8000), sample=1.5)
    assert (nothing.first_frame, nothing.frames, nothing.line) == (None, 0, None)
    assert nothing.first_mismatch is None
    stray = check.verify_capture(
        schedule(frames=20, lead_in=1, loop=7),
        capture([*rows, (7900, 0, HIGH), (8000, 0, LOW)], 8400),
        sample=1.5,
    )
    assert stray.first_mismatch is not None
    assert (stray.first_mismatch.time_us, stray.first_mismatch.pin) == (1975.0, 0)
    assert [(pin.pin, pin.edges) for pin in stray.stray] == [(0, 2)]
