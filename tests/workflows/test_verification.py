"""What is compared of a recording, a capture or a program, and what a proof for all time says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from servogen.checker import Checked, Refused
from servogen.edges import PINS, UNDRIVEN, EdgeTrace, edge_chunk
from servogen.errors import Diagnostic, InputError, Location
from servogen.pic.image import Image
from servogen.pic.isa import encode
from servogen.pic.listing import Listing, ListingRow
from servogen.plan_error import PlanError
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import Channel, Pulse, Run
from servogen.simulator import NoRepeat
from servogen.traces.captures import Capture
from servogen.units import Clock, Cycles
from servogen.verify import Tolerances
from servogen.workflows import verification
from servogen.workflows.certificates import check_file
from servogen.workflows.verification import (
    Forever,
    chip_warnings,
    compared_end,
    hidden_by,
    judge_capture,
    judge_edges,
    judge_file,
    judge_forever,
    motion_cycles,
    running,
    warning_cycle,
)
from tests.edges.rows import chunk

CLOCK = Clock(4_000_000)
FRAME = 20_000
SCHEDULE = PulseSchedule(
    clock=CLOCK,
    period=Cycles(FRAME),
    channels=(Channel("arm", "RB0", "futaba-s3001"),),
    lead_in=(Run(1, (Pulse(0, 1000),)),),
    loop=(Run(2, (Pulse(0, 1500),)),),
)
"""A frame of 1000 µs, then 1500 µs; the motion has three frames."""
FIRST = 100
"""The cycle of the first pulse."""


def seen(frames: int, end: int, whole: bool = True) -> EdgeTrace:
    """Return the schedule's pulses from FIRST on, seen until `end`; the last one falls if it is `whole`."""
    rows = []
    for frame in range(frames):
        rise = FIRST + FRAME * frame
        rows += [(rise, 5, 1), (rise + (1500 if frame else 1000), 5, 0)]
    return EdgeTrace(CLOCK, (chunk(rows if whole else rows[:-1]),), Cycles(end))


MISSING = "of the motion's 3 frames the last 1 is missing in what was compared"


def test_a_recording_with_an_end_is_compared_to_its_end() -> None:
    assert motion_cycles(SCHEDULE) == 3 * FRAME
    found = judge_file(SCHEDULE, seen(3, FIRST + 3 * FRAME), tells_end=True)
    assert (found.passed, found.span.compared, found.span.frames) == (True, 3 * FRAME, 3)
    assert compared_end(found) == FIRST + 3 * FRAME
    short = judge_file(SCHEDULE, seen(3, FIRST + 3 * FRAME - 1), tells_end=True)
    assert (short.passed, short.agrees, short.reasons[-1]) == (False, True, MISSING)
    for end in (FIRST + 3 * FRAME + 1, FIRST + 3 * FRAME + 10_000):  # the fourth frame has no pulse
        longer = judge_file(SCHEDULE, seen(3, end), tells_end=True)
        assert (longer.agrees, longer.span.asked) == (False, end - FIRST)
    silent = judge_file(SCHEDULE, seen(0, 100_000), tells_end=True)
    assert silent.reasons == ("no scheduled pin ever rises; RB0 should be the first",)
    assert (silent.span.asked, compared_end(silent)) == (100_000, None)
    assert judge_file(SCHEDULE, seen(0, 1000), tells_end=True).span.asked == 3 * FRAME


@pytest.mark.parametrize(
    ("frames", "whole", "exact", "compared"),
    [
        (3, True, True, 3 * FRAME),  # up to the rise of the next frame
        (3, False, False, 2 * FRAME + 1500),  # up to the fall that is missing
        (4, True, True, 4 * FRAME),
        (4, False, False, 3 * FRAME + 1500),
        (2, True, False, 2 * FRAME),
    ],
)
def test_a_recording_without_an_end_ends_at_the_next_edge_of_the_schedule(
    frames: int, whole: bool, exact: bool, compared: int
) -> None:
    """The file ends a cycle after its last edge."""
    width = 1500 if whole else 0
    trace = seen(frames, FIRST + FRAME * (frames - 1) + width + 1, whole)
    found = judge_file(SCHEDULE, trace, tells_end=False)
    assert (found.agrees, found.passed, found.span.compared) == (True, exact, compared)


def test_a_recording_of_a_motion_that_ends_is_compared_for_whole_frames() -> None:
    """After its only pulse the schedule has no edge any more."""
    once = replace(SCHEDULE, loop=(Run(1, (None,)),))
    found = judge_file(once, seen(1, FIRST + 1001), tells_end=False)
    assert (found.passed, found.span.compared) == (True, 2 * FRAME)


def test_what_follows_an_asked_span_is_named_as_not_compared() -> None:
    end = FIRST + 3 * FRAME
    rest = "the recording continues for {} s, which were not compared"
    for span, until, reasons in (
        (3 * FRAME, end, ()),
        (3 * FRAME, end + 1, (rest.format("1e-06"),)),
        (2 * FRAME, end, (MISSING, rest.format("0.02"))),
        (FRAME, end, (MISSING.replace("last 1 is", "last 2 are"), rest.format("0.04"))),
    ):
        found = judge_file(SCHEDULE, seen(3, until), True, Cycles(span))
        assert (found.agrees, found.passed, found.reasons) == (True, not reasons, reasons)
    silent = judge_file(SCHEDULE, seen(0, end), True, Cycles(FRAME))
    assert silent.reasons == ("no scheduled pin ever rises; RB0 should be the first",)


def vcd(folder: Path, timescale: str = "1 us", pins: Sequence[str] = PINS) -> Path:
    wires = "".join(f"$var wire 1 {chr(33 + n)} {pin} $end\n" for n, pin in enumerate(pins))
    file = folder / "seen.vcd"
    file.write_text(
        f"$version servogen $end\n$timescale {timescale} $end\n{wires}$enddefinitions $end\n#0\n#9\n"
    )
    return file


def test_a_file_hides_pins_without_a_wire_and_what_is_between_its_steps(tmp_path: Path) -> None:
    """A cycle at 4 MHz takes 1 µs, at 20 MHz 0.2 µs."""
    assert hidden_by(vcd(tmp_path), CLOCK) == hidden_by(vcd(tmp_path, "100 ns"), CLOCK) == ()
    assert hidden_by(tmp_path / "edges.csv", CLOCK) == ()
    assert hidden_by(vcd(tmp_path, pins=PINS[:-2]), CLOCK) == ("the file has no wire for RB6, RB7",)
    coarse = ("the file's times are whole steps of 1 µs, 5 cycles each",)
    assert hidden_by(vcd(tmp_path), Clock(20_000_000)) == coarse
    found = judge_file(SCHEDULE, seen(3, FIRST + 3 * FRAME), tells_end=True, hidden=coarse)
    assert (found.agrees, found.passed, found.reasons) == (True, False, coarse)


@pytest.mark.parametrize("at", [FIRST + 1000, FIRST + FRAME + 1500])
def test_a_scheduled_pin_that_is_not_driven_is_not_proven_to_be_low(at: int) -> None:
    """Instead of the fall the recording says that RB0 is not driven any more."""
    whole = seen(3, FIRST + 3 * FRAME)
    (edges,) = whole.chunks
    lost = edges._replace(level=np.where(edges.cycle == at, UNDRIVEN, edges.level).astype(np.uint8))
    found = judge_file(SCHEDULE, replace(whole, chunks=(lost,)), tells_end=True)
    reason = f"RB0 is not driven after {at / 1e6:g} s, which counts as low"
    assert (found.agrees, found.passed, found.reasons) == (True, False, (reason,))
    before = edge_chunk([0, *edges.cycle], [5, *edges.pin], [UNDRIVEN, *edges.level])
    assert judge_file(SCHEDULE, replace(whole, chunks=(before,)), tells_end=True).passed
    capture = Capture(replace(whole, chunks=(lost,)), 1.0)
    assert reason in judge_capture(SCHEDULE, capture).reasons
    assert reason not in judge_capture(SCHEDULE, replace(capture, trace=whole)).reasons
    for pieces, is_seen in (([(0, at), (at + 1, whole.end)], False), ([(0, at + 1)], True)):
        verdict = judge_capture(SCHEDULE, replace(capture, pieces=tuple(pieces)))
        assert any(reason in each for each in verdict.reasons) == is_seen


def test_by_default_a_motion_is_compared_with_its_loop_three_times() -> None:
    found = judge_edges(SCHEDULE, seen(7, FIRST + 7 * FRAME))
    assert (found.passed, found.span.compared) == (True, 7 * FRAME)
    assert not judge_edges(SCHEDULE, seen(6, FIRST + 6 * FRAME)).passed


def test_a_program_has_fifty_frames_until_its_first_pulse() -> None:
    for span in (0, 3 * FRAME):
        assert running(SCHEDULE, Image({0: 0x2800}, 0x3FF1), Cycles(span)).end == span + 50 * FRAME


def machine(*warnings: Diagnostic) -> Any:
    return SimpleNamespace(state=lambda: SimpleNamespace(warnings=warnings))


def test_warnings_of_a_chip_get_the_lines_of_their_addresses_and_end_with_what_is_compared() -> None:
    placed = [Location(cycle=cycle, address=address) for cycle, address in ((9, 0), (10, 1), (11, 7))]
    warnings = [Diagnostic("warning", "w", "odd", place) for place in (*placed, None)]
    listing = Listing((ListingRow(0, 0, "NOP", "1", "a.c", 12), ListingRow(1, 0, "NOP", "1", "a.c", 13)))
    chip = machine(*warnings)
    assert chip_warnings(chip) == tuple(warnings)
    assert chip_warnings(chip, Cycles(10)) == (warnings[0], warnings[3]), "without a cycle it is of the start"
    assert warning_cycle(warnings[3]) == 0
    found = [str(each.location or "") for each in chip_warnings(chip, None, listing)]
    assert found == [
        "a.c:12: cycle 9, address 0x000",
        "a.c:13: cycle 10, address 0x001",
        "cycle 11, address 0x007",
        "",
    ]


def test_a_capture_is_judged_by_its_samples_and_never_proven_if_it_is_incomplete() -> None:
    """Samples of 1 µs; a glitch of 10 µs may not hide between two, which an asked limit changes."""
    capture = Capture(file="a.vcd", trace=seen(3, FIRST + 3 * FRAME), sample=1)
    whole = judge_capture(SCHEDULE, capture)
    assert whole.passed
    torn = judge_capture(SCHEDULE, replace(capture, missing="it was unplugged"))
    assert (torn.passed, torn.reasons[-1]) == (False, "the capture is incomplete: it was unplugged")
    with pytest.raises(InputError, match=r"a\.vcd: error: .*too slow to show anything"):
        judge_capture(SCHEDULE, capture, Tolerances(glitch_us=0.5))


def verdict(**around: Any) -> Any:
    facts = {"passed": True, "plan_error": PlanError(0.5), "clock": CLOCK, "to_json": lambda: {"frames": 3}}
    return SimpleNamespace(**{**facts, **around})


def test_a_proof_for_all_time_says_what_it_covers_or_why_there_is_none() -> None:
    plan = "the schedule is within 0.5 µs of the plan"
    found = Forever(verdict(), 1, 6)
    assert found.passed
    assert found.text() == (
        "exact for all time from this start: lead-in 1 frame, loop 6 frames; "
        f"0 cycles from the schedule; {plan}"
    )
    other = Forever(verdict(passed=False), 1, 6)
    assert not other.passed
    assert other.text() == f"NOT exact for all time from this start: the edges are not the schedule's; {plan}"
    endless = Forever(verdict(span=SimpleNamespace(compared=250_000)), 0, 0, "nothing repeats")
    assert not endless.passed
    assert (
        endless.text() == f"NOT exact for all time from this start: nothing repeats; covered 0.25 s; {plan}"
    )
    assert endless.to_json() == {
        "exact_for_all_time": False,
        "reason": "nothing repeats",
        "lead_in_frames": 0,
        "loop_frames": 0,
        "verdict": {"frames": 3},
    }


@pytest.mark.parametrize(
    ("lead_in", "loop", "frames"),
    [(0, 1, (1, 2)), (4, 3, (4, 6)), (1, 2, (1, 2))],  # the longer lead-in, the common multiple of the loops
)
def test_a_repetition_is_compared_with_a_common_multiple_of_both_loops(
    monkeypatch: pytest.MonkeyPatch, lead_in: int, loop: int, frames: tuple[int, int]
) -> None:
    asked: list[tuple[object, ...]] = []

    def find_repeat(image: object, clock: object, **given: Any) -> Any:
        asked.append((given["pin"], given["limit"], given["period"]))
        return SimpleNamespace(lead_in_frames=lead_in, loop_frames=loop)

    monkeypatch.setattr(verification, "find_repeat", find_repeat)
    monkeypatch.setattr(verification, "judge_image", lambda schedule, image, span, *more: ("verdict", span))
    found = judge_forever(SCHEDULE, Image({}), Cycles(99))
    assert asked == [(5, 99, FRAME)]
    assert (found.lead_in, found.loop, found.reason) == (*frames, "")
    assert found.verdict == cast(Any, ("verdict", sum(frames) * FRAME))


@pytest.mark.parametrize(("covered", "span"), [(5, FRAME), (FRAME + 1, FRAME + 1)])
def test_without_a_repetition_what_was_searched_is_compared_and_at_least_a_frame(
    monkeypatch: pytest.MonkeyPatch, covered: int, span: int
) -> None:
    monkeypatch.setattr(
        verification, "find_repeat", lambda *given, **more: NoRepeat("no end", Cycles(covered))
    )
    monkeypatch.setattr(verification, "judge_image", lambda schedule, image, span, *more: ("verdict", span))
    found = judge_forever(SCHEDULE, Image({}), Cycles(99))
    assert found == Forever(cast(Any, ("verdict", span)), 0, 0, "no end")


def test_a_schedule_without_a_pulse_has_no_frames_to_repeat() -> None:
    silent = replace(SCHEDULE, lead_in=(), loop=(Run(2, (None,)),))
    found = judge_forever(silent, Image({0: encode("GOTO", k=0)}), Cycles(99))
    assert (found.lead_in, found.loop, found.passed) == (0, 0, False)
    assert found.reason == "the schedule has no pulse, with which frames would begin"


def test_a_certificate_is_missing_refused_or_valid(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "main.cert.xz"
    missing = check_file(file, Image({}), SCHEDULE)
    assert (missing.text, missing.valid, missing.missing) == ("no certificate", False, True)
    file.write_bytes(b"x")
    refused: list[str] = []

    def check_certificate(claim: Any, *given: object, tape: bytes) -> Checked:
        if refused:
            raise Refused(refused[0])
        return Checked(1, 2, 3, 4, ("every input",), tuple(claim.held))

    monkeypatch.setattr("servogen.workflows.certificates.check_certificate", check_certificate)
    for held, text in (((), "proven, checked"), (("RB0", "RA4"), "proven, checked, with RB0 and RA4 held")):
        claim = SimpleNamespace(held=held)
        monkeypatch.setattr(
            "servogen.workflows.certificates.read_certificate", lambda *given, claim=claim: claim
        )
        found = check_file(file, Image({}), SCHEDULE)
        assert (found.text, found.valid, found.missing) == (text, True, False)
    refused.append("it is of another program")
    found = check_file(file, Image({}), SCHEDULE)
    assert (found.text, found.valid, found.missing) == ("refused: it is of another program", False, False)
    file.write_bytes(bytes((4 << 20) + 1))
    with pytest.raises(InputError, match="is larger than 4 MiB"):
        check_file(file, Image({}), SCHEDULE)
