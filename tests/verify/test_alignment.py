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
from servogen.verify.capture import check
from servogen.verify.capture.alignment import (
    MAX_SLOPE_ERROR,
    FittedLine,
    PairedSignals,
    WholeFrames,
    align,
    regression,
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


def test_a_speed_that_is_not_known_to_20_ppm_is_the_nominal_one() -> None:
    s = np.array([0.0, 100.0, 1000.0, 1100.0])
    t = 50 + 2.004 * s
    spread = float(((s - s.mean()) ** 2).sum())
    # Rounding to samples is off by a twelfth of a sample squared on average, which limits the slope's error.
    limit = MAX_SLOPE_ERROR * 2.004 * (12 * spread) ** 0.5
    fine = regression(s, t, signals([[]], [[]], quantum=limit * 0.999))
    assert (fine.a, fine.b) == pytest.approx((50, 2.004))
    assert fine.b_error == pytest.approx(0.999 * MAX_SLOPE_ERROR * 2.004)
    coarse = regression(s, t, signals([[]], [[]], quantum=limit * 1.001))
    assert coarse == FittedLine(pytest.approx(t.mean() - 2 * s.mean()), 2.0, None)
    # Two edges determine a line without an error; three do.
    assert regression(s[:2], t[:2], signals([[]], [[]], quantum=1e-9)).b_error is None
    assert regression(s[:3], t[:3], signals([[]], [[]], quantum=1e-9)).b == pytest.approx(2.004)
    assert regression(s[[1, 1, 1]], t[[1, 1, 1]], signals([[]], [[]])).b_error is None


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


def test_the_longest_capture_that_is_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(check, "MAX_FRAMES", 5)
    rows = [(0, RB0, LOW), (900, RB0, HIGH), (950, RB0, LOW)]
    # Six frames are 12 000 steps, 3 % less by the fastest clock that is looked for.
    check.set_up(schedule(), capture(rows, 11_650), Tolerances(), Sampling(1.0, stated=True))
    with pytest.raises(InputError) as raised:
        check.set_up(schedule(), capture(rows, 11_651), Tolerances(), Sampling(1.0, stated=True))
    assert raised.value.message == ("the capture is 6 frames of the schedule long: at most 5 are compared")


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
