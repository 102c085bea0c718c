"""The pulses of the page: numbers in µs of the chip, against schedules made by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from servogen.edges import HIGH, LOW, PINS, EdgeTrace, edge_chunk
from servogen.pulse import Channel, Pulse, PulseSchedule, Run
from servogen.report import signals
from servogen.units import Clock, Cycles

CHANNELS = (Channel("arm", "RB0", ""), Channel("leg", "RB1", ""), Channel("foot", "RB2", ""))


def pulse(rise: int, width: int) -> Pulse:
    return Pulse(Cycles(rise), Cycles(width))


def schedule(hz: int = 4_000_000, lead_in: tuple[Run, ...] = ()) -> PulseSchedule:
    """Frames of 20,000 cycles: arm and leg together, the foot when both are over."""
    first = Run(2, (pulse(0, 1000), pulse(0, 1500), pulse(2000, 1000)))
    second = Run(1, (pulse(0, 2000), None, pulse(2000, 1000)))
    return PulseSchedule(Clock(hz), Cycles(20_000), CHANNELS, lead_in, (first, second))


@pytest.mark.parametrize(("hz", "us"), [(4_000_000, 1.0), (8_000_000, 0.5)])
def test_a_view_has_the_pulses_of_its_frame_with_room_around_them(hz: int, us: float) -> None:
    """The last edge is at 3000 cycles: 6 % of it stay free behind it, and 4 % of all that before."""
    one, two = signals.frames_to_show(schedule(hz))
    end = 1.06 * 3000
    before = 0.04 * end
    assert (one.title, two.title) == ("from 0 s", f"from {0.04 * us:g} s")
    assert (two.start_us, two.end_us) == pytest.approx(((40_000 - before) * us, (40_000 + end) * us))


def test_a_frame_without_pulses_is_not_shown() -> None:
    """The motion begins after two silent frames."""
    one, two = signals.frames_to_show(schedule(lead_in=(Run(2, (None, None, None)),)))
    assert (one.title, two.title) == ("from 0.04 s", "from 0.08 s")


def test_planned_pulses_are_at_their_frames() -> None:
    arm, leg, foot = signals.planned(schedule())
    assert (arm.rise, arm.width) == ((0, 20_000, 40_000), (1000, 1000, 2000))
    assert (leg.rise, leg.width) == ((0, 20_000), (1500, 1500))
    assert (foot.rise, foot.width) == ((2000, 22_000, 42_000), (1000, 1000, 1000))
    assert [each.kind for each in (arm, leg, foot)] == ["planned"] * 3


def test_times_are_tenths_of_a_microsecond_at_most() -> None:
    """A quarter of a microsecond per cycle at 16 MHz: 0.25 and 1000.75 µs."""
    one = PulseSchedule(Clock(16_000_000), Cycles(80_000), CHANNELS[:1], (), (Run(1, (pulse(1, 4003),)),))
    (arm,) = signals.planned(one)
    assert (arm.rise, arm.width) == ((0.2,), (1000.8,))


def test_the_first_edge_is_that_of_the_first_frame_with_a_pulse() -> None:
    rest = Run(5, (None, None, None))
    late = Run(1, (None, None, pulse(2000, 1000)))
    assert signals.first_edge(schedule()) == 0
    assert signals.first_edge(schedule(lead_in=(rest,))) == 100_000
    assert signals.first_edge(schedule(lead_in=(rest, late))) == 102_000
    assert signals.first_edge(PulseSchedule(Clock(4_000_000), Cycles(20_000), CHANNELS, (), (rest,))) == 0


def test_what_was_simulated_begins_where_the_schedule_has_its_first_edge() -> None:
    """The program begins its pulses 700 cycles after reset; a cycle is half a microsecond."""
    late = schedule(8_000_000, lead_in=(Run(1, (None, None, None)),))
    found = signals.simulated(late, trace(700, 8_000_000))
    assert [each.rise for each in found] == [(10_000, 20_000), (10_000,), (11_000,)]
    assert [each.width for each in found] == [(500, 500), (750,), (500,)]
    assert [each.kind for each in found] == ["simulated"] * 3


def trace(start: int, hz: int = 4_000_000) -> EdgeTrace:
    """Two pulses of the arm, one of the leg and the foot each."""
    rises = {0: ((0, 1000), (20_000, 1000)), 1: ((0, 1500),), 2: ((2000, 1000),)}
    edges = sorted(
        (start + rise + late, PINS.index(CHANNELS[number].pin), level)
        for number, pulses in rises.items()
        for rise, width in pulses
        for late, level in ((0, HIGH), (width, LOW))
    )
    chunk = edge_chunk(*zip(*edges, strict=True))
    return EdgeTrace(Clock(hz), [chunk], Cycles(start + 30_000))


def test_what_was_captured_is_in_the_chips_time_and_at_its_frame() -> None:
    """A crystal 100 ppm fast by the analyser's clock, captured from the schedule's second frame on."""
    verdict: Any = SimpleNamespace(ppm=100.0, first_frame=1)
    arm, leg, foot = signals.captured(schedule(), trace(300), verdict)
    assert arm.rise == (20_000, 40_002)
    assert arm.width == (1000.1, 1000.1)
    assert (leg.rise, foot.rise) == ((20_000,), (22_000.2,))
    unknown: Any = SimpleNamespace(ppm=None, first_frame=None)
    assert signals.captured(schedule(), trace(300), unknown)[0].rise == (300, 20_300)
    later: Any = SimpleNamespace(
        ppm=100.0, first_frame=2
    )  # of another run; what follows is the loop's beginning
    assert signals.captured(schedule(), trace(300), later)[0].rise == (2, 40_000)


def test_times_beyond_what_is_drawn_are_left_out_and_a_long_motion_is_cut() -> None:
    """2000 frames of 20 ms are drawn; the lead-in counts, and a pulse may end with the last frame."""
    many = schedule(lead_in=(Run(1999, (None, None, None)),))
    assert signals.shown_us(many) == 40_000_000
    assert signals.shown_us(schedule(lead_in=(Run(1996, (None, None, None)),))) == 39_980_000
    assert signals.shown_us(schedule(8_000_000)) == 30_000
    assert [each.rise for each in signals.planned(many)] == [(39_980_000,), (39_980_000,), (39_982_000,)]
    full = Run(3, (pulse(19_000, 1000), None, None))
    (arm, *_) = signals.planned(PulseSchedule(Clock(4_000_000), Cycles(20_000), CHANNELS, (), (full,)))
    assert arm.rise == (19_000, 39_000, 59_000)


def test_a_trace_without_pulses_has_none_on_any_channel() -> None:
    empty = EdgeTrace(Clock(4_000_000), [], Cycles(30_000))
    unknown: Any = SimpleNamespace(ppm=None, first_frame=None)
    for found in (signals.simulated(schedule(), empty), signals.captured(schedule(), empty, unknown)):
        assert [(each.rise, each.width) for each in found] == [((), ())] * 3
        assert [each.channel for each in found] == ["arm", "leg", "foot"]
    known: Any = SimpleNamespace(ppm=0.0, first_frame=1)
    assert [each.rise for each in signals.captured(schedule(), empty, known)] == [()] * 3


def test_a_pin_that_is_high_at_first_has_no_pulse_until_it_rises() -> None:
    """RB0 is high from before the beginning, falls at 400 and has one whole pulse; the last has no end."""
    edges = [(0, HIGH), (400, LOW), (5000, HIGH), (6000, LOW), (25_000, HIGH)]
    chunk = edge_chunk(*zip(*((cycle, PINS.index("RB0"), level) for cycle, level in edges), strict=True))
    found = signals.simulated(schedule(), EdgeTrace(Clock(4_000_000), [chunk], Cycles(30_000)))
    assert [(each.rise, each.width) for each in found] == [((0,), (1000,)), ((), ()), ((), ())]


def test_a_capture_goes_around_the_loop_once() -> None:
    """The loop is three frames; of five that were captured two lie on what is drawn already."""
    rises = [300 + 20_000 * frame for frame in range(5)]
    marks = ((0, HIGH), (1000, LOW))
    edges = [(rise + late, PINS.index("RB0"), level) for rise in rises for late, level in marks]
    found = EdgeTrace(Clock(4_000_000), [edge_chunk(*zip(*edges, strict=True))], Cycles(100_000))
    for first, expected in ((0, (0, 20_000, 40_000)), (2, (0, 20_000, 40_000))):
        verdict: Any = SimpleNamespace(ppm=0.0, first_frame=first)
        assert signals.captured(schedule(), found, verdict)[0].rise == expected
    before = schedule(lead_in=(Run(2, (pulse(0, 1000), None, None)),))
    verdict = SimpleNamespace(ppm=0.0, first_frame=1)
    captured = signals.captured(before, found, verdict)[0]
    assert captured.rise == (20_000, 40_000, 60_000)  # the lead-in's second frame, then the loop's first two


def motion(count: int, each: int = 1) -> PulseSchedule:
    """`count` distinct frames, `each` of them in a row."""
    runs = tuple(Run(each, (pulse(0, 1000 + number),)) for number in range(count))
    return PulseSchedule(Clock(4_000_000), Cycles(20_000), CHANNELS[:1], (), runs)


def shown(found: tuple[signals.FrameView, ...]) -> list[int]:
    """The frames that views begin with."""
    return [round(float(view.title.split()[1]) / 0.02) for view in found]


def test_six_distinct_frames_are_shown_besides_those_of_the_poses() -> None:
    """More are spread from the first on; a frame like an earlier one counts as that one."""
    assert shown(signals.frames_to_show(motion(6))) == [0, 1, 2, 3, 4, 5]
    assert shown(signals.frames_to_show(motion(7))) == [0, 1, 2, 3, 4, 5]
    assert shown(signals.frames_to_show(motion(12, each=2))) == [0, 4, 8, 12, 16, 20]
    assert shown(signals.frames_to_show(motion(12), [11])) == [0, 2, 4, 6, 8, 11]  # five of the other eleven
    assert shown(signals.frames_to_show(motion(12, each=3), [35, 34, 4])) == [
        0,
        3,
        9,
        18,
        24,
        33,
    ]  # four of ten
    assert shown(signals.frames_to_show(motion(12), range(8))) == [*range(8)]  # poses are never left out
    assert shown(signals.frames_to_show(motion(7), range(6))) == [*range(6)]


def test_a_pose_is_found_at_its_first_frame() -> None:
    """The nearest by the servo that is farthest off; frames and poses without pulses have no place."""
    angles = np.radians([[0.0, 0], [np.nan, 10], [10, 0], [10, 10], [10, 10.0000000001], [5, 5]])
    poses = [(10, 10), (5, 6), (0, 0), (np.nan, 0), (9, 1)]
    job: Any = SimpleNamespace(
        trajectory=SimpleNamespace(angles=angles),
        poses=[SimpleNamespace(angles=np.radians(pose)) for pose in poses],
    )
    assert signals.pose_frames(job) == (3, 5, 0, 2)
