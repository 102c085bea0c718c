"""The stream's numbers by hand or by search: slots, rates, widths, tables of the C, samples of the line."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import partial
from typing import Any

import pytest

from servogen.engines.inputs.serial import Stream
from servogen.engines.stream.layout import RoundLayout, layout
from servogen.engines.stream.protocol import (
    CommandKind,
    WidthRange,
    group_goes,
    position_command,
    query_command,
    speed_command,
    trim_command,
)
from servogen.engines.stream.settings import bit_units, first_units
from servogen.engines.stream.streaming import streaming
from servogen.errors import InputError
from servogen.job import load, plan_job
from servogen.prove.stream.samples import SampleTimes, SeenStart, StampGap
from servogen.units import Clock, Cycles
from tests.engines.stream.stream_soak import JOBS

JOB = plan_job(load(JOBS / "stream-arm.toml"))
CLOCK = Clock(4_000_000)


# the protocol's limits


def refusal(call: Any) -> tuple[str, str, str | None]:
    with pytest.raises(InputError) as error:
        call()
    return error.value.code, error.value.message, error.value.hint


def test_the_last_numbers_that_a_command_holds_and_the_first_that_it_does_not() -> None:
    assert position_command(7, 254) == bytes((0xFF, 7, 254)) and speed_command(0, 0) == bytes((0xFF, 0x40, 0))
    no_servo = ("unknown-servo", "there is no servo 8", "servos are 0 to 7")
    assert refusal(lambda: position_command(12, 0))[2] == "servos are 0 to 11"
    assert refusal(lambda: trim_command(8, 0)) == no_servo
    assert refusal(lambda: query_command(8)) == no_servo
    assert refusal(lambda: query_command(-1))[1] == "there is no servo -1"
    assert query_command(7) == bytes((0xFF, 0xF0, 7)) and query_command(7, low=True)[2] == 15
    too_large = ("bad-command", "255 cannot be the third byte of a command", "0 to 254")
    assert refusal(lambda: speed_command(0, 255)) == too_large == refusal(lambda: group_goes(255))
    assert refusal(lambda: position_command(0, -1))[1] == "-1 cannot be the third byte of a command"
    assert group_goes(1) == bytes((0xFF, 0x80, 1)) and group_goes(254)[2] == 254
    assert refusal(lambda: group_goes(0))[1] == "a group's time is at least one frame"
    for cycles in (-1, 128, -128):
        code, message, hint = refusal(partial(trim_command, 0, cycles))
        assert (code, message) == ("bad-command", f"a trim of {cycles} cycles cannot be sent")
        assert hint == "-127 to 127 cycles, but not -1"
    assert [trim_command(0, cycles)[2] for cycles in (-127, -2, 0, 127)] == [0, 125, 127, 254]
    widths = WidthRange(Cycles(1000), Cycles(2000))
    for p in (-1, 255):
        assert refusal(partial(widths.width, p)) == ("bad-command", f"{p} is not a position", "0 to 254")
    assert [kind for kind in CommandKind if not kind.of_a_servo] == [CommandKind.GROUP, CommandKind.QUERY]


# slots


def test_a_slot_holds_the_longest_pulse_and_the_frame_is_as_long_as_it_may_be() -> None:
    made = layout(JOB.servos, JOB.frame, CLOCK, 2400)
    assert made == RoundLayout(6, 13) and made.period == 6 * 13 * 256
    assert [made.rise(servo) for servo in (0, 1, 5)] == [0, 3328, 16_640]
    # 78 rounds are the most of 20 000 cycles; six slots of 13 use all of them, fewer slots are longer than
    # the 19 rounds after which commands take effect within 10 ms.
    assert 20_000 // 256 == 78 == made.slots * made.rounds
    every = [(slots * min(78 // slots, 19), -slots) for slots in range(3, 9) if 78 // slots >= 9]
    assert max(every) == (78, -6)
    # 80 rounds are five slots of 16 or eight of 10: fewer slots, so that each has more time.
    longer = replace(JOB.frame, period=CLOCK.round_us(80 * 256))
    assert layout(JOB.servos[:1] * 5, longer, CLOCK, 2400) == RoundLayout(5, 16)
    assert layout(JOB.servos[:1] * 6, longer, CLOCK, 2400) == RoundLayout(8, 10)


def test_pulses_too_short_or_too_long_are_refused_with_their_numbers() -> None:
    short = replace(JOB.servos[0], trim_us=-617.0)
    code, message, hint = refusal(lambda: layout((short,), JOB.frame, CLOCK, 2400))
    assert (code, message) == ("pulse-too-short", "base: a pulse of 383 cycles is shorter than 384")
    assert hint == "use a faster clock, or narrow the servo's limits"
    assert layout((replace(short, trim_us=-616.0),), JOB.frame, CLOCK, 2400)
    code, message, hint = refusal(lambda: layout(JOB.servos * 3, JOB.frame, CLOCK, 2400))
    # The longest pulse, 2000 cycles, a trim of 127, less 80 of the last round: 8 rounds and one; at least 9.
    assert (code, message) == (
        "frame-too-short",
        "the pulses do not fit a frame: 9 servos, one after the other, take 9 rounds of 256 cycles each, "
        "the frame has 78",
    )
    assert hint == f"period_us = {9 * 9 * 256}, or narrow the servos' limits"
    assert layout(JOB.servos[:2] * 4, JOB.frame, CLOCK, 2400) == RoundLayout(8, 9)
    code, message, hint = refusal(lambda: layout(JOB.servos, JOB.frame, CLOCK, 9600))
    # Three bytes of a fast sender are 30 * 104.17 * 0.98 = 3062 cycles; less nine rounds of C, 2 are left.
    assert (code, message) == (
        "baud-rate",
        "the longest pulse needs a slot of 9 rounds of 256 cycles; "
        "commands at 9600 baud come after as few as 2",
    )
    assert hint == "use a lower rate, or narrow the servos' limits"


# rates


@pytest.mark.parametrize(("baud", "hz", "latest"), [(4800, 4_000_000, 2171), (19_200, 20_000_000, 2651)])
def test_a_refusal_has_the_page_s_numbers(baud: int, hz: int, latest: int) -> None:
    code, message, _ = refusal(lambda: bit_units(Stream(baud), Clock(hz)))
    bit = hz / 4 / baud
    assert (code, message) == (
        "baud-rate",
        f"{baud} baud at {hz} Hz: a bit is {bit:.1f} cycles; samples are usually up to 114 cycles apart "
        "before a start bit and 129 after it, so that the stop bit of a sender 2 % off is sampled up to "
        f"{latest} cycles after the byte began, and ends after {10 * bit / 1.02:.1f}",
    )


def fits(bit: Fraction, first: int) -> bool:
    """Whether every bit of any sender is sampled within its time: the page's gaps, and the path in cycles."""
    units = round(bit / 4)
    slow, fast = bit / Fraction(98, 100), bit / Fraction(102, 100)
    for k in range(10):
        due = 4 * (first + 1 + k * units)
        # A time stamp is rounded down to 4 cycles; it is read 2 cycles after the sample of the start bit.
        earliest, latest = 2 + due - 3 + 20, 114 + 2 + due - 1 + 129 + 9 + (22 if k == 9 else 30)
        if (k and earliest < k * slow) or latest > (k + 1) * fast:
            return False
    return True


def test_the_time_of_the_first_sample_is_the_middle_of_what_is_possible() -> None:
    possible = 0
    for cycles in range(330, 900, 29):
        bit = Fraction(cycles)
        right = [first for first in range(224) if fits(bit, first)]
        if right:
            possible += 1
            assert first_units(bit) == (right[0] + right[-1]) // 2, cycles
    assert possible > 10


# a stream's plan


def planned(**changes: Any) -> Any:
    line = replace(
        JOB.stream, **{key: changes.pop(key) for key in ("silence_s", "fail_safe") if key in changes}
    )
    soft = changes.pop("soft_start_s", Fraction(1))
    return streaming(JOB.servos, JOB.frame, CLOCK, line, soft)


def test_silence_is_counted_in_5_to_254_frames() -> None:
    frame_s = Fraction(19_968, 1_000_000)
    for frames in (5, 254):
        assert planned(silence_s=frames * frame_s).silence_frames == frames
        assert planned(silence_s=(frames + Fraction(49, 100)) * frame_s).silence_frames == frames
    for frames in (4, 255):
        code, message, hint = refusal(partial(planned, silence_s=frames * frame_s))
        shown = f"{float(frames * frame_s):g}"
        assert (code, message) == ("out-of-range", f"a silence of {shown} s is {frames} frames")
        assert hint == "5 to 254 frames are counted, 0.1 to 5.1 s"


# samples


def times(starts: set[tuple[int, int, int]], waits: set[tuple[int, int]]) -> SampleTimes:
    return SampleTimes(
        frozenset(SeenStart(*start) for start in starts), frozenset(StampGap(*wait) for wait in waits)
    )


def latest(one: SampleTimes, k: int, first: int, bit: int) -> int:
    """By trying each pair of time stamps, of which the second is the first one at the due cycle or later."""
    found = 0
    for stamp, since, gap in one.starts:
        due = 4 * (stamp // 4 + first + 1 + k * bit)
        after = 22 if k == 9 else 30
        late = 0
        for before, wait in one.waits:
            for round_ in range(-2, 40):
                begin = before + 256 * round_
                if begin < due <= begin + wait:
                    late = max(late, begin + wait - due)
        found = max(found, gap + since + due - stamp + late + after)
    return found


def test_the_latest_sample_of_a_bit_is_that_of_the_worst_pair_of_looks() -> None:
    one = times({(10, 2, 100), (131, 2, 90)}, {(5, 120), (133, 128), (100, 60)})
    for k in range(10):
        for first, bit in ((15, 104), (3, 64), (20, 65)):
            assert one.latest(k, first, bit) == latest(one, k, first, bit), (k, first, bit)
    assert (one.start_gap, one.bit_gap) == (100, 128)


def test_the_earliest_sample_is_20_cycles_after_the_time_at_which_it_is_due() -> None:
    one = times({(10, 2, 100), (131, 5, 90)}, {(5, 120)})
    for k in (0, 5, 9):
        # Time stamps are rounded down to 4 cycles: 10 to 8, and 131 to 128.
        due = [4 * (stamp // 4 + 16 + k * 104) - stamp + since for stamp, since in ((10, 2), (131, 5))]
        assert one.earliest(k, 15, 104) == 20 + min(due)
