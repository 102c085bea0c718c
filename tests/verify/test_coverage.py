"""What a capture does not show is not exact: the different frames are counted, and each must be seen."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import pytest

from servogen.edges import Expected, ExpectedChannel, ExpectedChunk, edge_chunk
from servogen.errors import InputError
from servogen.units import Cycles
from servogen.verify import CaptureVerdict, Tolerances, capture_lines, verify_capture
from tests.verify import test_capture as one
from tests.verify.test_capture import MHZ4, PERIOD, RB0, RB1, Pulse

Widths = list[int | None]
"""The width in each frame; None: a frame without a pulse."""


@dataclass(frozen=True)
class _Chunks:
    """The frames once for the lead-in and again and again for the loop."""

    lead_in: Widths
    loop: Widths

    def __iter__(self) -> Iterator[ExpectedChunk]:
        zero = None
        for frame, width in enumerate((*self.lead_in, *(self.loop * 200 if any(self.loop) else ()))):
            if width is not None:
                zero = frame * PERIOD if zero is None else zero
                edges = one.edges_of([(frame * PERIOD - zero, width, RB0)])
                chunk = edge_chunk(*zip(*edges, strict=True))
                yield ExpectedChunk(*chunk, np.full(2, frame, dtype=np.int64))


def schedule(lead_in: Widths, loop: Widths) -> Expected:
    channels = (ExpectedChannel("arm", RB0),)
    return Expected(MHZ4, Cycles(PERIOD), channels, len(lead_in), len(loop), _Chunks(lead_in, loop))


def pulses(widths: Widths) -> list[Pulse]:
    """Pulses whose time zero is the first frame's beginning."""
    return [(frame * PERIOD, width, RB0) for frame, width in enumerate(widths) if width is not None]


def look(wanted: Expected, made: list[Pulse], first: int, frames: float) -> CaptureVerdict:
    """What a capture shows that begins 2 ms before frame `first` and ends `frames` later."""
    begin, seconds = first * PERIOD - 2000, frames * PERIOD / 1e6
    return verify_capture(wanted, one.capture(one.edges_of(made), begin, seconds, pins=(RB0,)), sample=1)


LAB = [1500] * 10 + [1000] * 10 + [2000] * 10
"""Three positions, as in lab 8."""


@pytest.mark.parametrize(
    ("first", "frames", "seen"),
    [(0, 10, 1), (5, 4, 1), (5, 10, 2), (25, 10, 2), (5, 15, 2), (9, 12, 3), (19, 12, 3), (0, 30, 3)],
)
def test_each_different_frame_must_be_seen(first: int, frames: int, seen: int) -> None:
    verdict = look(schedule([], LAB), pulses(LAB * 4), first + 30, frames)
    assert verdict.agrees
    assert verdict.passed == (seen == 3)
    data = verdict.to_json()
    assert (data["different_frames"], data["different_frames_seen"]) == (3, seen)
    (headline, *lines) = capture_lines(verdict)
    if seen == 3:
        assert data["verdict"] == "agrees"
        assert headline.startswith("agrees: ")
        assert lines[1].startswith("of the loop's 3 different frames 3 were seen whole")
    else:
        assert data["verdict"] == "agrees as far as it was seen"
        assert headline.startswith(f"agrees as far as it was seen: {seen} of 3 different frames; ")
        missing = f"{3 - seen} different frame{'s were' if seen == 1 else ' was'} not seen whole"
        assert verdict.reasons == (
            missing.replace("frame", "frame", 1).replace(" w", " of the schedule w", 1),
        )
        assert not any("exact" in line for line in (headline, *lines))


def test_a_frame_that_the_capture_cuts_is_not_seen() -> None:
    """Frame 19 is the second position's last: its pulse must be in the capture from its rise to its fall."""
    whole = look(schedule([], LAB), pulses(LAB * 4), 40, 0.2)  # 2 ms of quiet, and 2 ms
    assert whole.coverage.words() == "1 of 3 different frames"
    cut = look(schedule([], LAB), pulses(LAB * 4), 40, 0.14)
    assert cut.coverage.words() == "0 of 3 different frames"


@pytest.mark.parametrize("wrong", [0, 7, 30, 55])
@pytest.mark.parametrize("first", [0, 13, 41])
@pytest.mark.parametrize("frames", [2, 9, 30, 59])
def test_a_program_whose_unseen_frame_is_wrong_is_never_called_proven(
    wrong: int, first: int, frames: int
) -> None:
    """Every frame of that schedule is different from the others; one pulse is 90 µs too long each time."""
    changed = [
        (rise, width + 90 * (rise // PERIOD % one.LOOP == wrong and pin == RB0), pin)
        for rise, width, pin in one.pulses()
    ]
    begin_us = (one.LOOP + first) * PERIOD - 2000.0
    verdict = one.verdict_on(changed, begin_us=begin_us, seconds=(frames + 0.9) * PERIOD / 1e6)
    assert not verdict.passed
    seen = wrong in {(first + number) % one.LOOP for number in range(frames + 1)}
    assert verdict.agrees == (not seen)


def test_more_frames_than_the_loop_has_are_needed_when_the_order_of_the_looks_is_unlucky() -> None:
    """Frames of one kind, however many, are one; how much of the loop was seen is said as well."""
    loop: Widths = [1500, *[1000] * 50, 2000, *[1000] * 50]
    verdict = look(schedule([], loop), pulses(loop * 3), 0, 53)
    assert verdict.passed
    assert len(verdict.coverage.loop_seen) == 53
    assert "of the loop's 3 different frames 3 were seen whole, in 53 of its 102 frames" in capture_lines(
        verdict
    )


def test_quiet_frames_at_the_ends_of_a_capture_are_seen() -> None:
    loop: Widths = [1500, 1600, 1500, None, None]
    wanted = schedule([], loop)
    after = look(wanted, pulses(loop * 9), 10, 4.2)  # the fourth frame is quiet from end to end
    assert after.passed
    assert look(wanted, pulses(loop * 9), 10, 3.9).coverage.words() == "2 of 3 different frames"


def test_quiet_before_a_pulse_is_a_pause_where_the_schedule_has_one_there() -> None:
    loop: Widths = [1500, 1600, None, None, 1700]
    wanted = schedule([], loop)
    assert look(wanted, pulses(loop * 9), 8, 4).passed  # from the second quiet frame on
    # Before the first pulse of all the chip may not have been on: quiet there is no pause.
    loop = [1500, 1600, None, None]
    assert look(schedule([], loop), pulses(loop * 9), 7, 3).coverage.words() == "2 of 3 different frames"


def test_a_motion_that_runs_once_is_not_proven_by_its_rest() -> None:
    """All of the motion is in the lead-in; the loop holds the last position."""
    motion: Widths = [1000, 1200, 1400, 1600, 1800]
    wanted, made = schedule(motion, [2000]), pulses([*motion, *[2000] * 30])
    rest = look(wanted, made, 6, 8.5)
    assert (rest.agrees, rest.passed, rest.coverage.words()) == (True, False, "1 of 6 different frames")
    whole = look(wanted, made, 0, 8.5)
    assert whole.passed
    assert "of the schedule's 6 different frames 6 were seen whole" in capture_lines(whole)


def test_a_motion_that_ends_without_pulses_shows_its_end_by_a_quiet_frame() -> None:
    motion: Widths = [1000, 1500, 2000]
    wanted = schedule(motion, [None])
    assert look(wanted, pulses(motion), 0, 4.5).passed
    assert not look(wanted, pulses(motion), 0, 2.9).passed  # 0.1 of a frame of quiet
    assert not look(wanted, pulses([*motion, 2000]), 0, 4.5).agrees


def test_a_lead_in_that_was_not_seen_is_named_beside_the_verdict_on_the_loop() -> None:
    wanted, made = schedule([1100, 1200], [1500, 1600]), pulses([1100, 1200, *[1500, 1600] * 20])
    loop_only = look(wanted, made, 6, 8.5)
    assert loop_only.passed
    words = "of the 2 different frames that only the lead-in has, 0: the verdict is on the loop"
    assert any(line.endswith(words) for line in capture_lines(loop_only))
    data = loop_only.to_json()
    assert (data["lead_in_only_frames"], data["lead_in_only_frames_seen"]) == (2, 0)
    from_power_up = look(wanted, made, 0, 8.5).to_json()
    assert from_power_up["lead_in_only_frames_seen"] == 2


def test_frames_before_the_first_edge_count_nowhere() -> None:
    """Time zero is the first edge: how long the chip waits before it is not judged."""
    wanted = schedule([None, None, None], [1500])
    verdict = look(wanted, pulses([1500] * 9), 0, 6.5)
    assert verdict.passed
    assert len(verdict.coverage.different) == 1


def test_something_wrong_outweighs_something_unseen() -> None:
    verdict = look(schedule([], LAB), pulses([1550] * 20), 2, 8.5)
    assert not verdict.agrees
    assert verdict.unseen == ()
    assert capture_lines(verdict)[0].startswith("does NOT agree: ")


def test_a_capture_that_is_not_whole_does_not_even_agree() -> None:
    verdict = look(schedule([], LAB), pulses(LAB * 4), 30, 30.4).but("the analyser disappeared")
    assert not (verdict.passed or verdict.agrees)
    assert not replace(verdict, reasons=(), unseen=("x",)).agrees


def test_two_pins_make_a_frame_different_by_either() -> None:
    """RB1's width alone changes every three frames: 56 with pulses, and the pause."""
    widths = {(rise % PERIOD, width, pin, rise // PERIOD) for rise, width, pin in one.pulses(one.LOOP)}
    frames = {tuple(sorted(each[:3] for each in widths if each[3] == frame)) for frame in range(one.LOOP)}
    verdict = one.verdict_on(one.pulses(), begin_us=-500.0, seconds=1.3)
    assert len(verdict.coverage.different) == len(frames) == 57
    assert RB1 in {pin for _, _, pin, _ in widths}


@pytest.mark.parametrize("by", [-300, -4, 0, 4, 300])
@pytest.mark.parametrize("end", ["begin", "end"])
def test_the_one_edge_of_a_pulse_that_the_capture_cuts_must_be_where_it_is_scheduled(
    by: int, end: str
) -> None:
    """A capture from the middle of frame 41's pulse to the middle of frame 71's; one edge of either moves."""
    changed = []
    for frame, (rise, width, pin) in enumerate(pulses(LAB * 4)):
        if (end, frame) == ("begin", 41):
            width += by
        if (end, frame) == ("end", 71):
            rise, width = rise + by, width - by
        changed.append((rise, width, pin))
    trace = one.capture(one.edges_of(changed), 41 * PERIOD + 500, 30 * PERIOD / 1e6, pins=(RB0,))
    verdict = verify_capture(schedule([], LAB), trace, sample=1)
    assert verdict.passed == (by == 0)
    if by:
        what = "ends" if end == "begin" else "begins"
        assert f"a pulse {what} where none is scheduled to" in verdict.reasons[0]


@pytest.mark.parametrize(("frame", "where"), [(41, "beginning"), (71, "end")])
def test_a_pulse_that_the_capture_would_cut_must_be_there(frame: int, where: str) -> None:
    made = [pulse for pulse in pulses(LAB * 4) if pulse[0] != frame * PERIOD]
    trace = one.capture(one.edges_of(made), 41 * PERIOD + 500, 30 * PERIOD / 1e6, pins=(RB0,))
    verdict = verify_capture(schedule([], LAB), trace, sample=1)
    assert not verdict.agrees
    assert f"at the capture's {where}: a pulse that it cuts is missing" in verdict.reasons[0]


@pytest.mark.parametrize("first", range(30, 60))
def test_a_capture_that_cuts_pulses_is_never_blamed_for_it(first: int) -> None:
    """Where whole pulses fit at many phases, as within a hold, the cut ones say which frames they are."""
    for frames in (3, 9, 31):
        begin = first * PERIOD + 700
        trace = one.capture(one.edges_of(pulses(LAB * 4)), begin, frames * PERIOD / 1e6, pins=(RB0,))
        assert verify_capture(schedule([], LAB), trace, sample=1).agrees


def test_edges_on_a_coarse_grid_prove_nothing_where_nobody_says_how_often_was_sampled() -> None:
    flat = schedule([], [1500])
    trace = one.capture(one.edges_of(pulses([1500] * 40)), -500.0, 0.6, pins=(RB0,))
    assert verify_capture(flat, trace).passed, "each edge is where it should be, to the file's step"
    verdict = verify_capture(schedule([], [1667]), trace)
    assert not (verdict.passed or verdict.agrees)
    assert "on a grid of every 500 µs (2 kHz): at least 100 kHz is needed" in verdict.reasons[0]
    assert verify_capture(flat, trace, sample=1).passed
    with pytest.raises(InputError, match="sampled every 500 µs"):
        verify_capture(flat, trace, sample=500)
    slack = Tolerances(glitch_us=500)
    assert verify_capture(flat, trace, slack, sample=500).passed
