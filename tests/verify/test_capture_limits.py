"""A capture is judged at its tolerances exactly, and its verdict says every number."""

from __future__ import annotations

from dataclasses import replace
from random import Random

import pytest

from servogen.edges import PINS, Expected, ExpectedChannel
from servogen.errors import Diagnostic
from servogen.units import Clock, Cycles
from servogen.verify.capture.alignment import FittedLine, PairedSignals
from servogen.verify.capture.judge import Judged, TimeScale, judge
from servogen.verify.capture.verdict import (
    CapturedChannel,
    CapturePiece,
    CaptureVerdict,
    Mismatch,
    Spread,
    Tolerances,
    capture_lines,
    with_reasons,
)
from servogen.verify.coverage import Coverage
from servogen.verify.pulses import CutPulses
from servogen.verify.verdict import StrayPin
from tests.verify.pulses import pulses

RA0, RB0, RB1 = PINS.index("RA0"), PINS.index("RB0"), PINS.index("RB1")
PERIOD = 1000


CHANNEL = ExpectedChannel("arm", RB0)
EXPECTED = Expected(Clock(4_000_000), Cycles(PERIOD), (CHANNEL,), 2, 4, ())
SCHEDULED = [(PERIOD * frame, PERIOD * frame + 100 + 10 * frame) for frame in range(6)]
BEFORE = 300  # the schedule's zero is at step 300 of the capture
END = 5700
CLOSE = Tolerances(width_us=3.0, period_us=5.0, edge_us=9.0)


def judged(
    captured: list[tuple[int, int]],
    allowed: Tolerances = CLOSE,
    end: int = END,
    cut: CutPulses = CutPulses(False, None, None),  # noqa: B008 - frozen
    quantum: float = 2.0,
    line: FittedLine = FittedLine(float(BEFORE), 1.0, None),  # noqa: B008 - frozen
) -> Judged:
    """A step is a cycle of 1 µs, a sample two; so the limits are 5, 7 and 11 µs."""
    signals = PairedSignals(
        captured=(pulses(*captured),),
        scheduled=(pulses(*SCHEDULED),),
        nominal=1.0,
        quantum=quantum,
        period=PERIOD,
        cap=50.0,
        candidates=6 * PERIOD,
        cut=(cut,),
        length=end,
    )
    return judge(signals, TimeScale(line, quantum, 1.0, 1.0, end), 0, CHANNEL, allowed, EXPECTED)


def captured(changes: dict[int, tuple[int, int]] | None = None, frames: int = 6) -> list[tuple[int, int]]:
    """The scheduled pulses in the capture, some with other bounds by so many steps."""
    moved = changes or {}
    return [
        (BEFORE + rise + moved.get(frame, (0, 0))[0], BEFORE + fall + moved.get(frame, (0, 0))[1])
        for frame, (rise, fall) in enumerate(SCHEDULED[:frames])
    ]


def text(found: Judged) -> str:
    return found.mismatches[0].diagnostic.message


def test_what_is_as_scheduled_has_no_error() -> None:
    found = judged(captured())
    assert found.mismatches == ()
    assert (found.frames, found.paired) == ((0, 5), 6)
    assert found.channel == CapturedChannel(
        "arm", RB0, True, scheduled=6, captured=6, mean_period_us=1000.0, jitter_us=0.0
    )


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_width_may_differ_by_a_sample_and_the_tolerance(sign: int) -> None:
    assert judged(captured({3: (0, 5 * sign)})).mismatches == ()
    found = judged(captured({2: (0, 4 * sign), 3: (0, 6 * sign), 4: (0, -8 * sign)}))
    assert found.channel.width == Spread(-8 * sign, 2 * sign / 6, 2)
    mismatch = found.mismatches[0]
    assert len(found.mismatches) == 1
    assert (mismatch.time_us, mismatch.pin, mismatch.channel, mismatch.frame) == (3300, RB0, "arm", 3)
    assert mismatch.diagnostic.code == "wrong-pulse"
    assert text(found) == (
        "RB0 (arm), frame 3 (frame 1 of the loop): "
        f"a pulse of {130 + 6 * sign}.00 µs where 130.00 µs are scheduled "
        f"({6 * sign:+}.00 µs, allowed ±5.00 µs)"
    )


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_period_may_differ_by_a_sample_and_the_tolerance(sign: int) -> None:
    shifted = dict.fromkeys(range(3, 6), (7 * sign, 7 * sign))
    assert judged(captured(shifted)).mismatches == ()
    late = dict.fromkeys(range(1, 6), (8 * sign, 8 * sign))
    found = judged(captured(late))
    assert found.channel.period == Spread(8 * sign, 8 * sign / 5, 1)
    assert (found.mismatches[0].time_us, found.mismatches[0].frame) == (1300 + 8 * sign, 1)
    assert text(found) == (
        f"RB0 (arm), frame 1 (of the lead-in): {1000 + 8 * sign}.00 µs from the rise before "
        f"where 1000.00 µs are scheduled ({8 * sign:+}.00 µs, allowed ±7.00 µs)"
    )


@pytest.mark.parametrize("sign", [-1, 1])
def test_an_edge_may_be_away_by_a_sample_and_the_tolerance(sign: int) -> None:
    assert judged(captured(dict.fromkeys(range(6), (11 * sign, 11 * sign)))).mismatches == ()
    found = judged(captured(dict.fromkeys(range(6), (12 * sign, 12 * sign))))
    assert found.channel.edge == Spread(12 * sign, 12 * sign, 12)
    assert found.channel.jitter_us == 0
    assert text(found) == (
        "RB0 (arm), frame 0 (of the lead-in): an edge that is not where it is scheduled "
        f"({12 * sign:+}.00 µs, allowed ±11.00 µs)"
    )


def test_jitter_is_the_deviation_of_the_rises() -> None:
    found = judged(captured({0: (2, 2), 1: (-2, -2), 2: (2, 2), 3: (-2, -2), 4: (2, 2), 5: (-2, -2)}))
    assert found.channel.jitter_us == 2
    assert found.channel.mean_period_us == pytest.approx(1000 - 4 / 5)


def test_a_missing_and_an_extra_pulse_are_placed() -> None:
    found = judged([*captured()[:3], *captured()[4:]])
    assert (found.channel.scheduled, found.channel.captured, found.channel.missing) == (6, 5, 1)
    assert text(found) == "RB0 (arm), frame 3 (frame 1 of the loop): a pulse is missing"
    assert found.mismatches[0].diagnostic.code == "missing-pulse"
    assert found.mismatches[0].time_us == 3300
    assert found.channel.mean_period_us == 1000  # the two frames together are not a period
    extra = judged(sorted([*captured(), (4800, 4825), (4900, 4930)]))
    assert (extra.channel.scheduled, extra.channel.captured, extra.channel.extra) == (6, 8, 2)
    assert text(extra) == "RB0 (arm): a pulse of 25.00 µs that is not scheduled"
    first = extra.mismatches[0]
    assert (first.time_us, first.frame, first.diagnostic.code) == (4800, None, "extra-pulse")


def test_a_pulse_is_due_if_it_is_more_than_two_samples_from_the_ends() -> None:
    # The last one falls at 300 + 5150 = 5450, and two samples are four steps.
    assert judged(captured(frames=5), end=5454).channel.missing == 0
    assert judged(captured(frames=5), end=5455).channel.missing == 1
    # The first rises at step 5, then at step 4.
    early = [(rise - 295, fall - 295) for rise, fall in captured()[1:]]
    assert judged(early, line=FittedLine(5.0, 1.0, None)).channel.missing == 1
    early = [(rise - 296, fall - 296) for rise, fall in captured()[1:]]
    assert judged(early, line=FittedLine(4.0, 1.0, None)).channel.missing == 0
    # Edges that are late by 3 make the margin longer by 3.
    late = captured({4: (3, 3)}, frames=5)
    assert judged(late, end=5457).channel.missing == 0
    assert judged(late, end=5458).channel.missing == 1


def test_a_verdict_does_not_depend_on_the_lengths_of_steps_and_cycles() -> None:
    """Four steps in place of one, and two cycles in place of one; the microseconds are the same."""
    random = Random(4)
    seen = set()
    for _ in range(60):
        moved = {frame: (random.choice((-9, 0, 0, 12)), random.choice((-8, 0, 0, 5))) for frame in range(6)}
        shown = captured(moved, frames=random.choice((5, 6)))
        if random.random() < 0.3:
            del shown[random.randrange(5)]
        if random.random() < 0.3:
            shown = sorted([*shown, (1800, 1830)])
        end = random.choice((5310, 5380, 5440, 5470, 5700))
        cut = CutPulses(random.random() < 0.5, random.choice((None, 30, 360)), random.choice((None, 5290)))
        b_error = random.choice((None, 0.001))
        line = FittedLine(float(BEFORE), 1.0, b_error)
        found = judged(shown, end=end, cut=cut, line=line)
        signals = PairedSignals(
            captured=(pulses(*[(4 * rise, 4 * fall) for rise, fall in shown]),),
            scheduled=(pulses(*[(2 * rise, 2 * fall) for rise, fall in SCHEDULED]),),
            nominal=2.0,
            quantum=8.0,
            period=2 * PERIOD,
            cap=100.0,
            candidates=12 * PERIOD,
            cut=(CutPulses(cut.high, *(None if edge is None else 4 * edge for edge in cut[1:])),),
            length=4 * end,
        )
        line = FittedLine(4.0 * BEFORE, 2.0, b_error and 2 * b_error)
        scale = TimeScale(line, 8.0, 0.25, 0.5, 4 * end)
        assert judge(signals, scale, 0, CHANNEL, CLOSE, EXPECTED) == found
        seen |= {mismatch.diagnostic.message.split(": ")[1].split(" (")[0] for mismatch in found.mismatches}
    assert len(seen) > 10


@pytest.mark.parametrize(("b_error", "drift"), [(None, 300e-6 * END), (1e-3, 4e-3 * END)])
def test_a_cut_edge_may_be_away_by_a_sample_the_tolerance_and_the_clocks_drift(
    b_error: float | None, drift: float
) -> None:
    """The drift is four standard errors of the clock, or what a crystal may be off, over the capture."""
    # The last rise is that of frame 5's pulse, in which the capture ends.
    shown, at, rise = captured(frames=5), FittedLine(float(BEFORE), 1.0, b_error), BEFORE + 5000
    end = rise + 60
    limit = int(2 + 9 + drift / END * end)
    assert judged(shown, end=end, cut=CutPulses(False, None, rise - limit), line=at).mismatches == ()
    wrong = judged(shown, end=end, cut=CutPulses(False, None, rise - limit - 1), line=at)
    assert text(wrong) == "RB0 (arm), at the capture's end: a pulse begins where none is scheduled to"
    assert wrong.mismatches[0].time_us == rise - limit - 1
    missing = judged(shown, end=end, line=at)
    assert (text(missing), missing.mismatches[0].time_us) == (
        "RB0 (arm), at the capture's end: a pulse that it cuts is missing",
        end,
    )
    # And at the beginning: frame 1's pulse is cut 60 cycles after its rise, 50 before its fall.
    begun = FittedLine(-1060.0, 1.0, b_error)
    rest = [(rise - 1060, fall - 1060) for rise, fall in SCHEDULED[2:]]
    limit = int(2 + 9 + drift / END * 4500)
    assert judged(rest, end=4500, cut=CutPulses(True, 50 + limit, None), line=begun).mismatches == ()
    late = judged(rest, end=4500, cut=CutPulses(True, 51 + limit, None), line=begun)
    assert text(late) == "RB0 (arm), at the capture's beginning: a pulse ends where none is scheduled to"
    assert late.mismatches[0].time_us == 51 + limit
    low = judged(rest, end=4500, line=begun)
    assert text(low) == "RB0 (arm), at the capture's beginning: a pulse that it cuts is missing"
    assert low.mismatches[0].time_us == 0


PIECE = CapturePiece(0.0, 2e6, 0, 5, 100.0, 1.0, 5)
RIGHT = CaptureVerdict(
    passed=True,
    reasons=(),
    tolerances=Tolerances(),
    sample_us=0.5,
    duration_us=2_500_000.0,
    ppm=100.0,
    ppm_error=2.0,
    first_frame=3,
    frames=12,
    channels=(CapturedChannel("arm", RB0, True, scheduled=12, captured=12, mean_period_us=20_000.0),),
    paired=2,
    coverage=Coverage(different=frozenset({0, 1}), seen=frozenset({0, 1}), loop_frames=2),
)


def reasons(**changes: object) -> list[str]:
    verdict = with_reasons(replace(RIGHT, **changes))  # type: ignore[arg-type]
    assert verdict.passed == (not verdict.reasons)
    return list(verdict.reasons)


def test_two_pulses_suffice_and_the_crystal_may_be_off_by_its_tolerance_and_two_standard_errors() -> None:
    assert reasons() == []
    assert reasons(paired=1) == ["the capture holds too few of the schedule's pulses to be judged"]
    for sign in (-1, 1):
        assert reasons(ppm=sign * 304.0) == []
        assert reasons(ppm=sign * 304.25) == [
            f"the chip's clock is off by {sign * 304.2:+.1f} ppm, allowed ±300 ppm"
        ]
    assert reasons(ppm=900.0, ppm_error=None) == []
    assert reasons(ppm=None) == []


def test_each_piece_has_pulses_and_the_clock_of_all_within_five_ppm_and_four_standard_errors() -> None:
    near, far = replace(PIECE, ppm=109.0, begin_us=3e6), replace(PIECE, ppm=109.25, begin_us=3e6)
    assert reasons(pieces=(PIECE, near), paired=0) == []
    assert reasons(pieces=(PIECE, far)) == [
        "by piece 2 alone the chip's clock is off by +109.2 ppm, by all +100.0 ppm: "
        "its periods are not those of the others"
    ]
    assert len(reasons(pieces=(replace(far, ppm=90.75), PIECE))) == 1
    unknown = replace(far, ppm_error=None), replace(far, ppm=None)
    assert reasons(pieces=unknown) == []
    assert reasons(pieces=(PIECE, replace(PIECE, paired=0))) == [
        "piece 2 holds none of the schedule's pulses"
    ]


def test_the_first_mismatch_is_placed_in_its_piece() -> None:
    mismatch = Mismatch(3_000_000.0, RB0, "arm", 4, Diagnostic("error", "wrong-pulse", "RB0 (arm): wrong"))
    assert reasons(first_mismatch=mismatch) == ["first at 3.000000 s, RB0 (arm): wrong"]
    pieces = (PIECE, replace(PIECE, begin_us=3e6), replace(PIECE, begin_us=4e6))
    assert reasons(first_mismatch=mismatch, pieces=pieces) == [
        "first at 3.000000 s (piece 2), RB0 (arm): wrong"
    ]
    assert mismatch.to_json() == {
        "time_us": 3e6,
        "pin": "RB0",
        "channel": "arm",
        "frame": 4,
        **Diagnostic("error", "wrong-pulse", "RB0 (arm): wrong").to_json(),
    }


def test_each_channels_faults_are_counted_and_wrong_edges_only_if_nothing_else_is_wrong() -> None:
    arm = RIGHT.channels[0]
    wrong = Spread(-1.25, 0.1, 3)
    assert reasons(channels=(replace(arm, missing=1, extra=2, glitches=3, width=wrong, edge=wrong),)) == [
        "RB0 (arm): 1 missing pulse, 2 extra pulses, 3 glitches, 3 wrong widths, worst -1.25 µs"
    ]
    assert reasons(channels=(replace(arm, period=replace(wrong, wrong=1), edge=wrong),)) == [
        "RB0 (arm): 1 wrong period, worst -1.25 µs"
    ]
    assert reasons(channels=(replace(arm, edge=replace(wrong, worst_us=2.0)),)) == [
        "RB0 (arm): 3 wrong edges, worst +2.00 µs"
    ]
    assert reasons(channels=(replace(arm, connected=False, missing=4),)) == [
        "RB0 (arm) was not captured: no wire of the capture is RB0"
    ]
    assert reasons(overlap_us=12.25) == [
        "pulses overlap where the schedule has none together, for at most 12.25 µs"
    ]
    assert reasons(stray=(StrayPin(RA0, 1, Cycles(5)),)) == [
        "RA0, which the schedule does not drive, changes 1 time"
    ]


def test_what_was_not_seen_counts_only_if_nothing_is_wrong() -> None:
    half = Coverage(different=frozenset({0, 1}), seen=frozenset({0}))
    partly = with_reasons(replace(RIGHT, coverage=half))
    assert partly.reasons == partly.unseen == ("1 different frame of the schedule was not seen whole",)
    assert not partly.passed
    both = with_reasons(replace(RIGHT, coverage=half, paired=0))
    assert len(both.reasons) == 1
    assert both.unseen == ()
    slow = RIGHT.but("sampled too slowly")
    assert (slow.passed, slow.reasons) == (False, ("sampled too slowly",))
    assert partly.but("sampled too slowly").reasons[1:] == partly.reasons


def test_the_lines_of_a_capture_that_agrees() -> None:
    width, period = Spread(0.5, -0.25), Spread(-1.5)
    channel = replace(RIGHT.channels[0], captured=11, width=width, period=period, jitter_us=0.125 + 0.0001)
    missing = CapturedChannel("hand", RB1, False)
    lines = capture_lines(replace(RIGHT, channels=(channel, missing)))
    assert lines == [
        "agrees: 2 of 2 different frames; 12 frames from frame 3 on in 2.5 s, a sample every 0.5 µs; "
        "within a sample and 0.1 µs of width, 0.1 µs of period and 0.5 µs of edge; no plan to compare with",
        "the chip's clock is 100.0 ± 2.0 ppm fast; what follows is corrected for it",
        "of the loop's 2 different frames 2 were seen whole, in 0 of its 2 frames",
        "RB0 arm: 11 pulses of 12; width error +0.50 µs at most, -0.25 µs on average; jitter 0.13 µs; "
        "period 20000.00 µs, -1.50 µs at most",
    ]
    slow = capture_lines(replace(RIGHT, ppm=-1.0, first_frame=None, frames=1))
    assert slow[0].startswith("agrees: 2 of 2 different frames; 1 frame in 2.5 s")
    assert slow[1].startswith("the chip's clock is 1.0 ± 2.0 ppm slow;")
    assert capture_lines(replace(RIGHT, ppm=0.0))[1].startswith("the chip's clock is 0.0 ± 2.0 ppm fast;")
    none = capture_lines(replace(RIGHT, ppm=None, channels=(replace(channel, mean_period_us=None),)))
    assert none[1] == (
        "the capture is too short to measure the chip's clock: its nominal frequency is assumed"
    )
    assert none[3].endswith("jitter 0.13 µs")
    stitched = capture_lines(replace(RIGHT, pieces=(PIECE, PIECE)))
    assert stitched[2].startswith("stitched from 2 captures: ")
    wrong = capture_lines(replace(RIGHT, passed=False, reasons=("too slow",)))
    assert wrong[0].startswith("does NOT agree: 12 frames")
    assert [line for line in wrong if line.startswith("of the")] == []
    assert wrong[-1] == "- too slow"


@pytest.mark.parametrize(
    ("covered", "words"),
    [
        (
            Coverage(frozenset({2}), frozenset({2}), loop_frames=3, loop_seen=frozenset({0, 1, 2})),
            "of the loop's 1 different frame 1 was seen whole",
        ),
        (
            Coverage(frozenset({2, 3}), frozenset(), frozenset({0}), loop_frames=1),
            "of the loop's 2 different frames 0 were seen whole, in 0 of its 1 frame; "
            "of the 1 different frame that only the lead-in has, 0: the verdict is on the loop",
        ),
        (
            Coverage(frozenset({0, 1}), frozenset({0, 1}), loop_frames=1, once=True),
            "of the schedule's 2 different frames 2 were seen whole",
        ),
        (
            Coverage(
                frozenset({2, 3}),
                frozenset({2, 3}),
                frozenset({0, 1}),
                frozenset({1}),
                5,
                frozenset({0, 1}),
            ),
            "of the loop's 2 different frames 2 were seen whole, in 2 of its 5 frames; "
            "of the 2 different frames that only the lead-in has, 1: the verdict is on the loop",
        ),
    ],
)
def test_how_much_of_the_schedule_was_seen(covered: Coverage, words: str) -> None:
    assert capture_lines(replace(RIGHT, coverage=covered))[2] == words


def test_the_json_has_every_number_under_its_name() -> None:
    arm = CapturedChannel(
        "arm", RB0, True, 1, 2, 3, 4, 5, Spread(6.0, 7.0, 8), Spread(9.0), Spread(0.0, 0.0, 1), 10.0, 11.0
    )
    piece = CapturePiece(1.0, 2.0, 3, 4, 5.0, 6.0, 7)
    found = replace(
        RIGHT,
        channels=(arm,),
        pieces=(piece,),
        stray=(StrayPin(RA0, 2, Cycles(3)),),
        tolerances=Tolerances(1.0, 2.0, 3.0, 4.0, 5.0),
    ).to_json()
    assert found == {
        "agrees": True,
        "verdict": "agrees",
        "reasons": [],
        "tolerances": {
            "width_us": 1.0,
            "period_us": 2.0,
            "edge_us": 3.0,
            "crystal_ppm": 4.0,
            "glitch_us": 5.0,
        },
        "sample_us": 0.5,
        "duration_us": 2.5e6,
        "crystal_ppm": 100.0,
        "crystal_error_ppm": 2.0,
        "first_frame": 3,
        "frames": 12,
        **RIGHT.coverage.to_json(),
        "pieces": [
            {
                "begin_us": 1.0,
                "duration_us": 2.0,
                "first_frame": 3,
                "frames": 4,
                "crystal_ppm": 5.0,
                "crystal_error_ppm": 6.0,
            }
        ],
        "channels": [
            {
                "name": "arm",
                "pin": "RB0",
                "connected": True,
                "scheduled_pulses": 1,
                "captured_pulses": 2,
                "missing_pulses": 3,
                "extra_pulses": 4,
                "glitches": 5,
                "width_error": {"worst_us": 6.0, "mean_us": 7.0, "not_allowed": 8},
                "period_error": {"worst_us": 9.0, "mean_us": 0.0, "not_allowed": 0},
                "edge_error": {"worst_us": 0.0, "mean_us": 0.0, "not_allowed": 1},
                "mean_period_us": 10.0,
                "jitter_us": 11.0,
            }
        ],
        "first_mismatch": None,
        "stray_pins": ["RA0"],
        "plan_error": None,
    }
