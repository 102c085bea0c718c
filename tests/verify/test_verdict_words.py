"""What a verdict says: every sentence with its numbers, and every value of its JSON."""

from __future__ import annotations

from dataclasses import replace

import pytest

from servogen.edges import HIGH, LOW, PINS, Expected
from servogen.errors import Diagnostic, Location
from servogen.plan_error import PlanError
from servogen.units import Clock, Cycles
from servogen.verify.coverage import Coverage, join_coverages
from servogen.verify.verdict import (
    ChannelVerdict,
    ComparedSpan,
    Difference,
    Overlap,
    StrayPin,
    Verdict,
    Worst,
    channel_reasons,
    difference_reason,
    frame_words,
    overlap_reason,
    short_reason,
    silent_reason,
    stray_reason,
    unseen_motion_reason,
    unseen_reason,
    verdict_lines,
)

RA0, RB0, RB1 = PINS.index("RA0"), PINS.index("RB0"), PINS.index("RB1")
MHZ4 = Clock(4_000_000)
EXPECTED = Expected(MHZ4, Cycles(20_000), (), lead_in=3, loop=10, chunks=())


@pytest.mark.parametrize(
    ("frame", "lead_in", "loop", "words"),
    [
        (0, 3, 10, "frame 0 (of the lead-in)"),
        (2, 3, 10, "frame 2 (of the lead-in)"),
        (3, 3, 10, "frame 3 (frame 0 of the loop)"),
        (12, 3, 10, "frame 12 (frame 9 of the loop)"),
        (13, 3, 10, "frame 13 (frame 0 of repeat 1 of the loop)"),
        (37, 3, 10, "frame 37 (frame 4 of repeat 3 of the loop)"),
        (9, 0, 10, "frame 9"),
        (10, 0, 10, "frame 10 (frame 0 of repeat 1 of the loop)"),
        (5, 3, 0, "frame 5"),
    ],
)
def test_a_frame_is_placed_in_lead_in_or_loop(frame: int, lead_in: int, loop: int, words: str) -> None:
    assert frame_words(frame, lead_in, loop) == words


def difference(expected: int | None, observed: int | None, level: int = HIGH) -> Difference:
    at = [None if cycle is None else Cycles(cycle) for cycle in (expected, observed)]
    return Difference(RB0, "arm", 14, level, *at)


WHERE = "RB0 (arm), frame 14 (frame 1 of repeat 1 of the loop):"


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (
            difference(500, 501),
            f"first difference at cycle 500, {WHERE} should rise at cycle 500, rises at cycle 501, "
            "1 cycle late",
        ),
        (
            difference(500, 498, LOW),
            f"first difference at cycle 498, {WHERE} should fall at cycle 500, falls at cycle 498, "
            "2 cycles early",
        ),
        (
            difference(500, None, LOW),
            f"first difference at cycle 500, {WHERE} should fall at cycle 500 and does not",
        ),
        (
            difference(None, 77),
            f"first difference at cycle 77, {WHERE} rises, where the schedule has no change",
        ),
        (
            replace(difference(None, 77), channel=None, frame=None),
            "first difference at cycle 77: RB0, which the schedule does not drive, rises",
        ),
        (
            replace(difference(9, 7), frame=None),
            "first difference at cycle 7, RB0 (arm): should rise at cycle 9, rises at cycle 7, "
            "2 cycles early",
        ),
    ],
)
def test_the_first_difference_says_what_should_happen_and_what_does(given: Difference, words: str) -> None:
    assert difference_reason(given, EXPECTED) == words
    assert given.to_json() == {
        "cycle": int(words.split("cycle ")[1].split(",")[0].split(":")[0]),
        "pin": "RB0",
        "channel": given.channel,
        "frame": given.frame,
        "level": given.level,
        "expected_cycle": given.expected,
        "observed_cycle": given.observed,
    }


def test_a_channels_faults_are_counted_and_the_worst_of_each_kind_is_placed() -> None:
    wrong = ChannelVerdict(
        "arm",
        RB0,
        9,
        8,
        missing=2,
        extra=1,
        glitches=3,
        width=Worst(-1, 1, 4, Cycles(80)),
        period=Worst(7, 2, None, None),
        edge=Worst(1, 5, 1, Cycles(60)),
    )
    right = ChannelVerdict("hand", RB1, 9, 9)
    assert channel_reasons([right, wrong], EXPECTED) == [
        "RB0 (arm): 2 missing pulses, 1 extra pulse, 3 glitches, "
        "1 wrong width, worst -1 cycle in frame 4 (frame 1 of the loop), 2 wrong periods, worst +7 cycles, "
        "5 wrong edges, worst +1 cycle in frame 1 (of the lead-in)"
    ]


def test_overlaps_stray_pins_and_short_traces_are_said_with_their_numbers() -> None:
    assert overlap_reason(Overlap(1, Cycles(30), Cycles(700), (RB0, RB1))) == (
        "pulses overlap where the schedule has none together: 1 time, first at cycle 700 (RB0 and RB1), "
        "for at most 30 cycles"
    )
    assert stray_reason(StrayPin(RA0, 2, Cycles(9))) == (
        "RA0, which the schedule does not drive, changes 2 times, first at cycle 9"
    )
    assert short_reason(2_500_000, 4321, MHZ4) == (
        "the trace ends at cycle 4321, 2500000 cycles (2.5 s) before the end of the check"
    )
    assert silent_reason(RB1) == "no scheduled pin ever rises; RB1 should be the first"
    assert unseen_motion_reason(29, 30) == (
        "of the motion's 30 frames the last 1 is missing in what was compared"
    )
    assert (
        unseen_motion_reason(0, 2) == "of the motion's 2 frames the last 2 are missing in what was compared"
    )
    some = Coverage(different=frozenset({0, 1, 2}), seen=frozenset({1}))
    assert unseen_reason(some) == "2 different frames of the schedule were not seen whole"
    assert unseen_reason(replace(some, seen=frozenset({1, 2}))) == (
        "1 different frame of the schedule was not seen whole"
    )


def test_what_was_covered_is_counted_and_joined() -> None:
    first = Coverage(
        different=frozenset({3, 4, 5}),
        seen=frozenset({3}),
        lead_in=frozenset({0, 1}),
        lead_in_seen=frozenset({0}),
        loop_frames=7,
        loop_seen=frozenset({0, 2}),
    )
    other = replace(first, seen=frozenset({5}), lead_in_seen=frozenset(), loop_seen=frozenset({2, 6}))
    assert first.words() == "1 of 3 different frames"
    assert replace(first, different=frozenset({3})).words() == "1 of 1 different frame"
    together = join_coverages([first, other])
    assert together == replace(first, seen=frozenset({3, 5}), loop_seen=frozenset({0, 2, 6}))
    assert not together.complete
    assert join_coverages([together, replace(first, seen=frozenset({4}))]).complete
    assert together.to_json() == {
        "different_frames": 3,
        "different_frames_seen": 2,
        "lead_in_only_frames": 2,
        "lead_in_only_frames_seen": 1,
        "loop_frames": 7,
        "loop_frames_seen": 3,
    }


RIGHT = Verdict(
    passed=True,
    reasons=(),
    clock=Clock(8_000_000),
    start=Cycles(25),
    span=ComparedSpan(Cycles(600), Cycles(600), 30, 6, 2),
    channels=(ChannelVerdict("arm", RB0, 30, 30),),
)
WARNING = Diagnostic("warning", "unset-ram", "reads RAM that was never written", Location("walk.c", 7))
OTHER = Diagnostic("warning", "slow-start", "starts late")


def test_the_first_line_says_the_verdict_and_what_was_compared() -> None:
    # A cycle of 8 MHz is half a microsecond: 600 cycles are 300 µs, and 25 are 12.5 µs.
    assert verdict_lines(RIGHT) == [
        "exact: compared 600 cycles (0.0003 s), 30 frames (lead-in of 6, 2 repeats of the loop), on all 13 "
        "pins; 0 cycles from the schedule; no plan to compare with",
        "first edge 25 cycles (12.5 µs) after reset",
        "RB0 arm: 30 pulses; worst errors in cycles: width 0, period 0, edge 0",
    ]
    shorter = replace(RIGHT, span=ComparedSpan(Cycles(600), Cycles(1), 1, 0, 1), start=None, channels=())
    assert verdict_lines(shorter)[0].startswith(
        "exact: compared 1 cycle (5e-07 s), 1 frame (1 repeat of the loop), on all 13 pins; "
    )
    neither = replace(shorter, span=ComparedSpan(Cycles(2), Cycles(0), 0, 0, 0))
    assert verdict_lines(neither)[0].startswith("exact: compared 0 cycles (0 s), 0 frames, on all 13 pins; ")
    assert len(verdict_lines(neither)) == 1
    assert RIGHT.span.whole
    assert not neither.span.whole


def test_a_wrong_verdict_lists_its_reasons_and_the_errors_with_their_signs() -> None:
    channel = ChannelVerdict(
        "arm", RB0, 30, 29, missing=1, width=Worst(2, 1), period=Worst(-3, 1), edge=Worst(-4, 1)
    )
    other = replace(channel, edge=Worst(3, 1))
    wrong = replace(RIGHT, passed=False, reasons=("RB0 is late",), channels=(other, channel))
    lines = verdict_lines(wrong)
    assert lines[0].startswith("NOT exact: compared 600 cycles")
    assert lines[0].endswith("on all 13 pins; no plan to compare with")
    assert lines[3:] == [
        "RB0 arm: 29 pulses of 30; worst errors in cycles: width +2, period -3, edge -4",
        "- RB0 is late",
    ]
    assert wrong.worst_edge_error == 4
    assert RIGHT.worst_edge_error == 0
    assert replace(RIGHT, channels=()).worst_edge_error == 0
    assert repr(wrong) == "<Verdict: not exact>"


def test_what_was_not_seen_leaves_a_run_exact_as_far_as_it_was_seen_only_where_nothing_is_wrong() -> None:
    covered = replace(RIGHT, coverage=Coverage(different=frozenset({0, 1}), seen=frozenset({0})))
    partly = covered.not_all("one frame was not seen").not_all("nor its end")
    assert not partly.passed
    assert partly.agrees
    assert partly.edges_agree
    assert partly.reasons == partly.unseen == ("one frame was not seen", "nor its end")
    assert verdict_lines(partly)[0].startswith(
        "exact as far as it was seen: 1 of 2 different frames; compared 600 cycles"
    )
    assert "0 cycles from the schedule; " in verdict_lines(partly)[0]
    wrong = replace(covered, passed=False, reasons=("RB0 is late",)).not_all("one frame was not seen")
    assert wrong.reasons == ("RB0 is late", "one frame was not seen")
    assert wrong.unseen == ()
    assert not wrong.edges_agree


def test_a_warning_refutes_a_proof_only_if_it_depends_on_the_chip() -> None:
    shown = RIGHT.with_warnings((WARNING, OTHER))
    assert shown.passed
    assert verdict_lines(shown)[-2:] == [
        "warning: walk.c:7: reads RAM that was never written",
        "warning: starts late",
    ]
    refuted = RIGHT.with_warnings((WARNING, OTHER), frozenset({"unset-ram"}))
    assert not refuted.passed
    assert refuted.edges_agree
    assert not refuted.agrees
    assert refuted.reasons == (
        "other chips may make other edges: walk.c:7: reads RAM that was never written",
    )
    assert refuted.chip_dependent == (WARNING,)
    assert verdict_lines(refuted)[-2:] == [f"- {refuted.reasons[0]}", "warning: starts late"]
    listed = refuted.to_json()["warnings"]
    assert isinstance(listed, list)
    assert [(each["code"], each["chip_dependent"]) for each in listed] == [
        ("unset-ram", True),
        ("slow-start", False),
    ]
    # What is wrong already stays wrong.
    assert not replace(RIGHT, passed=False).with_warnings((OTHER,)).passed


def test_the_json_has_every_number_under_its_name() -> None:
    verdict = replace(
        RIGHT,
        passed=False,
        reasons=("RB0 is late",),
        channels=(
            ChannelVerdict("arm", RB0, 1, 2, 3, 4, 5, Worst(6, 7, 8, Cycles(9)), Worst(10), Worst(0, 11)),
        ),
        difference=difference(500, 501),
        overlap=Overlap(2, Cycles(30), Cycles(700), (RB0, RB1)),
        stray=(StrayPin(RA0, 12, Cycles(13)),),
        plan_error=PlanError(0.5),
    )
    nothing = {"error_cycles": 0, "count": 0, "frame": None, "cycle": None}
    assert verdict.to_json() == {
        "exact": False,
        "verdict": "not exact",
        "reasons": ["RB0 is late"],
        "clock_hz": 8_000_000,
        "start_cycle": 25,
        "span": {
            "asked_cycles": 600,
            "compared_cycles": 600,
            "frames": 30,
            "lead_in_frames": 6,
            "loop_repeats": 2,
        },
        **Coverage().to_json(),
        "channels": [
            {
                "name": "arm",
                "pin": "RB0",
                "scheduled_pulses": 1,
                "observed_pulses": 2,
                "missing_pulses": 3,
                "extra_pulses": 4,
                "glitches": 5,
                "worst_width": {"error_cycles": 6, "count": 7, "frame": 8, "cycle": 9},
                "worst_period": {**nothing, "error_cycles": 10},
                "worst_edge": {**nothing, "count": 11},
            }
        ],
        "first_difference": difference(500, 501).to_json(),
        "overlap": {"count": 2, "longest_cycles": 30, "first_cycle": 700, "pins": ["RB0", "RB1"]},
        "stray_pins": [{"pin": "RA0", "edges": 12, "first_cycle": 13}],
        "warnings": [],
        "plan_error": PlanError(0.5).to_json(),
    }
    plain = RIGHT.to_json()
    assert (plain["first_difference"], plain["overlap"], plain["plan_error"]) == (None, None, None)
    assert ChannelVerdict("arm", RB0, 1, 1).to_json() == {
        "name": "arm",
        "pin": "RB0",
        "scheduled_pulses": 1,
        "observed_pulses": 1,
        "missing_pulses": 0,
        "extra_pulses": 0,
        "glitches": 0,
        "worst_width": nothing,
        "worst_period": nothing,
        "worst_edge": nothing,
    }
