"""Lines for a stream program: waveforms, commands, right pulses, and the states of chip and receiver.

Times are those of jobs/stream-arm.toml: at 4 MHz a cycle is 1 µs, a bit of 2400 baud 1250/3 cycles, a slot 13
rounds of 256 cycles, and a frame six slots.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import islice, pairwise
from typing import Any

import pytest

from servogen.edges import PINS
from servogen.engines.stream.engine import stream
from servogen.engines.stream.protocol import (
    CommandKind,
    StreamCommand,
    position_command,
    query_command,
    speed_command,
    trim_command,
)
from servogen.engines.stream.streaming import Streaming
from servogen.job import load, plan_job
from servogen.prove.specification import Edge
from servogen.prove.stream import counterexample
from servogen.prove.stream.bits import FALSE, TRUE, Bits, Truth, byte
from servogen.prove.stream.chip import NOTHING, ReceiverState, StreamChip
from servogen.prove.stream.counterexample import Sender, Sent, wrong_pulse
from tests.engines.stream import chip_model
from tests.engines.stream.stream_soak import JOBS

ARM = stream(plan_job(load(JOBS / "stream-arm.toml")))[1]
BIT = Fraction(1_000_000, 2400)
SLOT, FRAME = 13 * 256, 6 * 13 * 256
RB0, RB1, RB2 = (PINS.index(pin) for pin in ("RB0", "RB1", "RB2"))


class Dice(random.Random):
    """Dice that never make a pause, and whose integers are given."""

    def __init__(self, *integers: int, low: float = 0.5) -> None:
        super().__init__(1)
        self.integers = list(integers)
        self.low = low

    def random(self) -> float:
        return self.low

    def randint(self, a: int, b: int) -> int:
        value = self.integers.pop(0) if self.integers else 0
        return min(max(value, a), b)


def sender(*integers: int, low: float = 0.5) -> Sender:
    return Sender(ARM, Dice(*integers, low=low))


def level_at(levels: Sequence[tuple[int, int]], cycle: float) -> int:
    return [level for at, level in levels if at <= cycle][-1]


def decoded(levels: Sequence[tuple[int, int]], begin: Fraction, bit: Fraction) -> tuple[int, list[int]]:
    """The byte that a receiver reads in the middles of its bits, and the levels of start and stop bit."""
    bits = [level_at(levels, float(begin + (n + Fraction(1, 2)) * bit)) for n in range(10)]
    return sum(level << n for n, level in enumerate(bits[1:9])), [bits[0], bits[9]]


@pytest.mark.parametrize("value", [0x00, 0xFF, 0xA5, 0x01, 0x80])
@pytest.mark.parametrize("rate", [Fraction(1), Fraction(10_000, 10_190), Fraction(10_000, 9810)])
def test_a_byte_is_ten_bits_the_lowest_first(value: int, rate: Fraction) -> None:
    one = sender()
    one.wait(1000)
    one.byte(value, rate)
    assert decoded(one.levels, Fraction(1000), BIT * rate) == (value, [0, 1])
    assert one.now == 1000 + 10 * BIT * rate
    assert one.levels[:2] == [(0, 1), (1000, 0)]
    # Every change is at a bit's beginning, rounded down.
    begins = {int(1000 + n * BIT * rate) for n in range(10)}
    assert {at for at, _ in one.levels[1:]} <= begins
    assert all(level != before for (_, before), (_, level) in pairwise(one.levels))


def test_a_byte_without_its_stop_bit_is_low_there_and_then_high_for_a_byte() -> None:
    one = sender()
    one.byte(0x55, stop=False)
    assert decoded(one.levels, Fraction(0), BIT) == (0x55, [0, 0])
    assert one.levels[-1] == (int(10 * BIT), 1)
    assert one.now == 10 * BIT + int(10 * BIT)


def sent_by(*values: int | None) -> list[tuple[int, int]]:
    """The commands of bytes; None is one without its stop bit."""
    one = sender()
    for value in values:
        one.byte(value or 0, stop=value is not None)
    return [(command.second, command.third) for command in one.sent]


def test_a_command_is_a_begin_and_two_bytes_that_are_none() -> None:
    assert sent_by(0xFF, 0x01, 0x40) == [(1, 0x40)]
    assert sent_by(0x01, 0x40, 0x02) == [], "nothing has begun"
    assert sent_by(0xFF, 0x01, 0xFF, 0x02, 0x03) == [(2, 3)], "a new begin voids the one before"
    assert sent_by(0xFF, 0xFF, 0x02, 0x03, 0x04) == [(2, 3)], "and after a command nothing is begun"
    assert sent_by(0xFF, 0x01, None, 0x02, 0x03) == [], "a byte without its stop bit voids it, too"
    assert sent_by(0xFF, None, 0xFF, 0x05, 0x00, 0xFF, 0x06, 0xFE) == [(5, 0), (6, 0xFE)]


def test_a_command_counts_from_its_last_stop_bit_on() -> None:
    one = sender()
    one.wait(500)
    for value in position_command(2, 77):
        one.byte(value)
    (command,) = one.sent
    # The third byte begins after 20 bits; its stop bit is the tenth of it.
    assert command == Sent(int(500 + 29 * BIT), int(500 + 30 * BIT) + 1, 2, 77)
    assert str(command) == "FF 02 4D"
    assert one.now == 500 + 30 * BIT, "no pause after a position"


@pytest.mark.parametrize(
    ("data", "pause_ms"),
    [
        (trim_command(0, 5), 30),
        (trim_command(7, 5), 30),
        (bytes((0xFF, 0xC8, 0)), 0),
        (bytes((0xFF, 0xBF, 0)), 0),
        (query_command(0), 25),
        (bytes((0xFF, 0xF7, 0)), 25),
        (bytes((0xFF, 0xF8, 0)), 0),
        (bytes((0xFF, 0xEF, 0)), 0),
        (speed_command(0, 5), 0),
    ],
)
def test_the_line_is_left_alone_after_a_trim_and_a_query(data: bytes, pause_ms: int) -> None:
    """At least the 25 ms and 20 ms of docs/firmware.md."""
    one = sender()
    for value in data:
        one.byte(value)
    assert one.now == 30 * BIT + 1000 * pause_ms


def test_a_sender_is_less_than_two_per_cent_off() -> None:
    for off in (190, -190):
        one = sender(off)
        one.send(position_command(1, 2))
        bit = BIT / (1 + Fraction(off, 10_000))
        assert one.now == 30 * bit
        assert [decoded(one.levels, n * 10 * bit, bit)[0] for n in range(3)] == [0xFF, 1, 2]
    asked = []

    class Asked(Dice):
        def randint(self, a: int, b: int) -> int:
            asked.append((a, b))
            return 0

    Sender(ARM, Asked()).send(b"\0")
    assert asked == [(-190, 190)]


def test_pauses_between_bytes_are_up_to_three_bits() -> None:
    one = sender(low=0.24)
    one.send(b"\1\2")
    pause = int(Fraction(0.24 * 3) * BIT)
    assert one.now == pytest.approx(2 * (pause + 10 * BIT), abs=2)
    one = sender(low=0.25)
    one.send(b"\1\2")
    assert one.now == 20 * BIT


def test_times_are_rounded_down_and_frames_are_the_layout_s() -> None:
    one = sender()
    one.wait(Fraction(19, 2))
    assert one.now == 9
    one.frames(2)
    assert one.now == 9 + 2 * FRAME
    one.frames(0.5)
    assert one.now == 9 + 2 * FRAME + FRAME // 2
    assert one.bit == BIT and one.servos == 3
    one.level(0)
    assert one.levels == [(0, 1), (int(one.now), 0)]


def test_a_glitch_is_shorter_than_a_start_bit_and_alone() -> None:
    one = sender(10**6)
    one.glitch()
    # The first sample comes 15 units of 4 cycles after the time stamp.
    assert one.levels == [(0, 1), (int(10 * BIT), 0), (int(10 * BIT) + 60, 1)]
    assert one.now == int(10 * BIT) + 60 + int(10 * BIT)
    one = sender(-5)
    one.glitch()
    assert one.levels[-1][0] - one.levels[-2][0] == 1
    assert not one.sent


def test_noise_lasts_as_long_as_asked_and_commands_nothing() -> None:
    one = sender(0, *([10**6] * 9), 0)
    one.noise(12)
    commands = [(command.second, command.third) for command in one.sent]
    assert commands == [(NOTHING, 0)] * 2, "the commands that change nothing, before and after"
    before = 30 * BIT  # of the first of them
    changes = [at for at, _ in one.levels if before <= at <= before + 12 * BIT + 1200]
    assert {later - sooner for sooner, later in pairwise(changes)} == {600}
    assert level_at(one.levels, float(before) + 300) == 0
    assert level_at(one.levels, float(before) + 900) == 1
    # 12 bits are 5000 cycles: nine changes of 600, then high for two bytes, then the second command.
    assert one.levels[-1][1] == 1
    second = one.sent[1]
    assert second.begins == int(int(before) % 1 + before + 9 * 600 + int(20 * BIT) + 29 * BIT)


# judging


def chip_with(**changes: Any) -> StreamChip:
    chip = StreamChip.after_reset(ARM, [byte(0xFF)] * 3)
    return replace(chip, **changes)


def pulses(widths: Sequence[Sequence[int | None]], begin: int = 700) -> list[Edge]:
    """The edges of frames; servo n is in slot n."""
    edges = []
    for number, frame in enumerate(widths):
        for n, width in enumerate(frame):
            if width:
                rise = begin + number * FRAME + n * SLOT
                edges += [(rise, RB0 + n, 1), (rise + int(width), RB0 + n, 0)]
    return edges


NEUTRAL = (1500, 1500, 1500)
ERASED = (0xFF,) * 3


def judged(
    edges: Sequence[Edge],
    sent: Sequence[Sent] = (),
    trims: Sequence[int] = ERASED,
    frames: int = 4,
    streamed: Streaming = ARM,
) -> tuple[str, int] | None:
    wrong = wrong_pulse(streamed, edges, sent, trims, 700 + frames * FRAME)
    return None if wrong is None else (wrong.message, wrong.cycle)


def test_an_idle_line_is_the_neutral_pose_with_its_trims() -> None:
    assert judged(pulses([NEUTRAL] * 4)) is None
    assert judged(pulses([(1505, 1500, 1372)] * 4), trims=(5, 0xFF, 0x80)) is None
    # Edges after the last whole slot are not looked at.
    assert judged([*pulses([NEUTRAL] * 4), (700 + 4 * FRAME, RB1, 1)]) is None
    # What the chip sends is not a pulse.
    answer = [(800, PINS.index("RA3"), 1), (5000, PINS.index("RA3"), 0)]
    assert judged(sorted([*pulses([NEUTRAL] * 4), *answer])) is None


@pytest.mark.parametrize(
    ("change", "message", "cycle"),
    [
        (((1500, 1500, 1500), (1500, 1501, 1500)), "is 1501 cycles on RB1, not 1500 cycles on RB1", 1500),
        (((1500, 1500, 1500), (1500, 1499, 1500)), "is 1499 cycles on RB1, not 1500 cycles on RB1", 1499),
        (((1500, 1500, 1500), (1500, None, 1500)), "is absent, not 1500 cycles on RB1", 0),
    ],
)
def test_a_pulse_of_another_width_is_named(
    change: tuple[Sequence[int | None], ...], message: str, cycle: int
) -> None:
    rise = 700 + FRAME + SLOT
    edges = pulses([*change, NEUTRAL, NEUTRAL])
    assert judged(edges) == (f"shoulder's pulse at cycle {rise} {message}", rise + cycle)


def test_no_pulse_a_late_first_one_and_edges_in_an_empty_slot_are_named() -> None:
    assert judged([]) == ("no pulse comes", 700 + 4 * FRAME)
    # Of ten cycles at most, none is a pulse (docs/proof.md).
    assert judged([(50, RB0, 1), (60, RB0, 0)]) == ("no pulse comes", 700 + 4 * FRAME)
    late = 50 * FRAME
    assert wrong_pulse(ARM, pulses([NEUTRAL], late), (), ERASED, late + FRAME) is None
    wrong = wrong_pulse(ARM, pulses([NEUTRAL], late + 1), (), ERASED, late + 1 + FRAME)
    assert wrong is not None
    assert (wrong.message, wrong.cycle) == ("the first pulse comes late", late + 1)
    empty = 700 + 4 * SLOT
    edges = sorted([*pulses([NEUTRAL] * 4), (empty + 9, RB2, 1), (empty + 20, RB2, 0)])
    text = f"a slot without a servo at cycle {empty} is RB2 rises 9 later, RB2 falls 20 later, not absent"
    assert judged(edges) == (text, empty + 9)


def position(cycle: int, servo: int = 0, value: int = 254, ends: int | None = None) -> Sent:
    return Sent(cycle, cycle if ends is None else ends, servo, value)


@pytest.mark.parametrize("servo", [0, 1, 2])
def test_a_command_takes_effect_after_the_time_that_the_page_says_and_not_earlier(servo: int) -> None:
    """In every pulse that begins 6912 µs, two slots and a round, after it; at the earliest in one that is
    prepared after it: a slot before.
    """
    top = [2000, 1889, 1750][servo]
    third = 700 + 2 * FRAME + servo * SLOT
    moved = tuple(top if n == servo else 1500 for n in range(3))
    in_time = pulses([NEUTRAL, NEUTRAL, moved, moved])
    too_late = pulses([NEUTRAL, NEUTRAL, NEUTRAL, moved])
    assert judged(in_time, [position(third - 6912, servo)]) is None
    assert judged(too_late, [position(third - 6912, servo)]) is not None
    assert judged(too_late, [position(third - 6912 + 1, servo)]) is None
    assert judged(in_time, [position(third - 6912 + 1, servo)]) is None
    assert judged(in_time, [position(third - SLOT, servo)]) is None
    assert judged(in_time, [position(third - SLOT + 1, servo)]) is not None
    # While its stop bit lasts, either is right.
    lasting = position(third - SLOT, servo, ends=third)
    assert judged(in_time, [lasting]) is None and judged(too_late, [lasting]) is None
    # And a frame earlier or later neither is.
    assert judged(pulses([NEUTRAL, moved, moved, moved]), [position(third - 6912, servo)]) is not None
    assert judged(pulses([NEUTRAL] * 4), [position(third - 6912, servo)]) is not None


def test_commands_are_executed_in_their_order() -> None:
    at = 700 + 2000
    moved = [NEUTRAL, (1500, 1500, 1500), (1250, 1889, 1500), (1250, 1889, 1500)]
    low = ARM.travels[0].nearest(1250)
    width = int(ARM.travels[0].width(low))
    frames = [tuple(width if n == 0 and w == 1250 else w for n, w in enumerate(frame)) for frame in moved]
    frames[1] = (width, 1889, 1500)
    sent = [position(at, 0, 254), position(at + 1, 1, 254), position(at + 2, 0, low)]
    assert judged(pulses(frames), sent) is None
    assert judged(pulses(frames), sent[::-1]) is not None


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("fail_safe", ["neutral", "off", "hold"])
def test_a_long_line_is_judged_as_the_second_model_has_it(seed: int, fail_safe: str) -> None:
    dice = random.Random(seed)
    streamed = replace(ARM, stream=replace(ARM.stream, fail_safe=fail_safe), silence_frames=6, soft_frames=4)
    commands: list[tuple[int, StreamCommand]] = []
    now = 1000
    while now < 50 * FRAME:
        kind = dice.choices([*CommandKind], (6, 1, 2, 1, 1))[0]
        servo = dice.randrange(3) if kind.of_a_servo else 0
        value = dice.choice((0, 1, 3, 127, 254, dice.randrange(255)))
        # In the middle between two requests: at which one it is executed is not open.
        now += SLOT * dice.choice((2, 3, 4, 3, 4, 3, 60))
        commands.append((now // SLOT * SLOT + SLOT // 2, StreamCommand(kind, servo, value)))
    frames = list(islice(chip_model.widths(streamed, commands), 60))
    edges = pulses(frames)
    sent = [
        Sent(700 + at, 700 + at, command.kind.value + command.servo, command.value)
        for at, command in commands
    ]
    assert judged(edges, sent, frames=60, streamed=streamed) is None
    assert len({width for frame in frames for width in frame}) > 5
    place = max(n for n, edge in enumerate(edges) if edge[0] < 55 * FRAME)
    cycle, pin, level = edges[place]
    wrong = [*edges[:place], (cycle + 1, pin, level), *edges[place + 1 :]]
    found = judged(wrong, sent, frames=60, streamed=streamed)
    assert found is not None and found[1] == cycle


def test_a_run_with_too_many_possible_chips_is_not_judged(monkeypatch: pytest.MonkeyPatch) -> None:
    lasting = position(700 + FRAME + SLOT, 0, ends=700 + FRAME + 2 * SLOT)
    wrong = pulses([NEUTRAL, NEUTRAL, NEUTRAL, NEUTRAL])
    for most, noticed in ((2, True), (1, False)):
        monkeypatch.setattr(counterexample, "MAX_CHIPS", most)
        assert (judged(wrong, [lasting]) is not None) == noticed


# the variables of a chip


def test_widths_and_goals_are_valid_within_the_travel_and_its_trim() -> None:
    for trim, cycles in ((0xFF, 0), (5, 5), (0x80, -128), (0x7F, 127)):
        for n, travel in enumerate(ARM.travels):
            for name in ("widths", "goals"):
                for width, right in (
                    (travel.minimum - 1, False),
                    (travel.minimum, True),
                    (travel.maximum, True),
                    (travel.maximum + 1, False),
                ):
                    chip = StreamChip.after_reset(ARM, [byte(trim)] * 3)
                    assert chip.valid().known is True
                    getattr(chip, name)[n] = Bits(16, int(width) + cycles)
                    assert chip.valid().known is right, (n, name, width, trim)


def test_a_group_has_frames_left_and_silence_ends() -> None:
    assert chip_with(group=[FALSE, TRUE, FALSE], frames_left=byte(1)).valid().known is True
    assert chip_with(group=[FALSE, TRUE, FALSE], frames_left=byte(0)).valid().known is False
    for fail_safe, most in (("neutral", 51), ("off", 50), ("hold", 255)):
        streamed = replace(ARM, stream=replace(ARM.stream, fail_safe=fail_safe))
        assert chip_with(streamed=streamed, silence=byte(most)).valid().known is True
        assert chip_with(streamed=streamed, silence=byte(min(most + 1, 255))).valid().known is (
            fail_safe == "hold"
        )


def test_servos_that_are_off_have_neither_a_width_nor_a_goal() -> None:
    off = replace(ARM, stream=replace(ARM.stream, fail_safe="off"))
    zero = Bits(16, 0)
    for streamed, right in ((off, True), (ARM, False)):
        chip = chip_with(streamed=streamed)
        chip.widths[1] = chip.goals[1] = zero
        assert chip.valid().known is right
    for name in ("widths", "goals"):
        chip = chip_with(streamed=off)
        assert chip.valid().known is True
        getattr(chip, name)[1] = zero
        assert chip.valid().known is False
    # A trim could make a width of 0 one of the range: no chip has it.
    chip = chip_with(streamed=off)
    wide = replace(off, travels=(replace(ARM.travels[0], minimum=0), *ARM.travels[1:]))
    chip = replace(chip, streamed=wide)
    chip.widths[0] = zero
    assert chip.valid().known is False


def test_a_copy_of_a_chip_is_its_own() -> None:
    chip = StreamChip.after_reset(ARM, [byte(0xFF)] * 3)
    other = chip.copy()
    for second, third in ((0x00, 3), (0x41, 9), (0xC2, 200), (0x80, 0), (0x00, 9), (0x80, 5)):
        other.execute(second, byte(third))
    other.begin_frame()
    other.prepare(0)
    fresh = StreamChip.after_reset(ARM, [byte(0xFF)] * 3)
    for name in ("widths", "goals", "speeds", "trims"):
        values = [bits.value for bits in getattr(chip, name)]
        assert values == [bits.value for bits in getattr(fresh, name)]
    for name in ("group", "waiting"):
        assert [truth.known for truth in getattr(chip, name)] == [False] * 3
    assert chip.frames_left.value == 0 and chip.gathering.known is False


def test_a_query_is_answered_by_the_byte_that_it_asks_for() -> None:
    chip = StreamChip.after_reset(ARM, [byte(0xFF)] * 3)
    chip.widths = [Bits(16, 0x0512), Bits(16, 0x0634), Bits(16, 0x0756)]
    for third, answer in ((0, 0x05), (1, 0x06), (2, 0x07), (8, 0x12), (9, 0x34), (10, 0x56)):
        chip.execute(0xF0, byte(third))
        assert chip.answer is not None and chip.answer.value == answer
    mute = replace(ARM, stream=replace(ARM.stream, transmit_pin=None))
    silent = StreamChip.after_reset(mute, [byte(0xFF)] * 3)
    silent.silence = byte(9)
    silent.execute(0xF0, byte(0))
    assert silent.answer is None and silent.silence.value == 9, "without a pin it is not a command"
    for second in (0x03, 0x3F, 0x43, 0x81, 0xC3, 0xFE):
        silent.execute(second, byte(1))
        assert silent.silence.value == 9, f"{second:02X} is not a command of three servos"


# the receiver


def receiver(bits: int, **changes: Any) -> ReceiverState:
    values = {"left": 3, "last": 0, "byte": 0, "command": NOTHING, "todo": NOTHING, "value": 0}
    numbers = {name: byte(value) for name, value in (values | changes).items()}
    return ReceiverState(ARM, byte(bits), **numbers)


def test_a_bit_is_taken_once_more_units_have_passed_than_are_left() -> None:
    for last, now, due in ((0, 3, False), (0, 4, True), (62, 1, False), (62, 2, True)):
        one = receiver(9, last=last)
        one.look(byte(now), TRUE)
        assert one.due.known is due
        passed = (now - last) % 64
        # 104 units of 4 cycles are a bit.
        assert one.left.value == (3 - passed + (104 if due else 0)) % 256
        assert (one.bits.value, one.last.value) == (8 if due else 9, now)
        assert one.byte.value == (0x80 if due else 0)
        assert one.level is None


def test_a_start_bit_that_is_high_was_noise() -> None:
    for line, bits in ((TRUE, 0), (FALSE, 9)):
        one = receiver(10)
        one.look(byte(9), line)
        assert (one.bits.value, one.byte.value) == (bits, 0)
    idle = receiver(0)
    idle.hunt(byte(7), TRUE)
    assert (idle.bits.value, idle.left.value, idle.last.value) == (0, 3, 0)
    idle.hunt(byte(7), FALSE)
    assert (idle.bits.value, idle.left.value, idle.last.value) == (10, 15, 7)


@pytest.mark.parametrize("bits", range(2, 10))
def test_data_bits_come_in_from_above(bits: int) -> None:
    for line, value in ((TRUE, 0xC1), (FALSE, 0x41)):
        one = receiver(bits, byte=0x83)
        one.look(byte(9), line)
        assert (one.bits.value, one.byte.value) == (bits - 1, value)


def test_a_stop_bit_ends_a_byte_of_a_command() -> None:
    # (command, byte, line) → (command, todo, value, bits)
    for command, value, line, wanted in (
        (NOTHING, 0xFF, TRUE, (0xFF, NOTHING, 0, 0)),
        (NOTHING, 0x01, TRUE, (NOTHING, NOTHING, 0, 0)),
        (0xFF, 0x41, TRUE, (0x41, NOTHING, 0, 0)),
        (0xFF, 0xFF, TRUE, (0xFF, NOTHING, 0, 0)),
        (0x41, 0x09, TRUE, (NOTHING, 0x41, 9, 0)),
        (0x41, 0xFF, TRUE, (0xFF, NOTHING, 0, 0)),
        (0x41, 0x09, FALSE, (NOTHING, NOTHING, 0, 0x80)),
        (0xFF, 0x41, FALSE, (NOTHING, NOTHING, 0, 0x80)),
    ):
        one = receiver(1, command=command, byte=value)
        one.look(byte(9), line)
        seen = (one.command.value, one.todo.value, one.value.value, one.bits.value)
        assert seen == wanted, (command, value, line)
    broken = receiver(0x80)
    for line, bits in ((FALSE, 0x80), (TRUE, 0)):
        broken.look(byte(9), line)
        assert (broken.bits.value, broken.last.value, broken.left.value) == (bits, 0, 3)


def test_an_answer_is_sent_with_its_start_and_stop_bit() -> None:
    one = receiver(0x40 | 10, byte=0xA5, left=0)
    levels, now = [], 0
    while one.bits.value:
        now = (now + 52) % 64
        one.look(byte(now), Truth(False))
        assert one.level is not None
        if one.due.known:
            levels.append(one.level.known)
        assert len(levels) <= 10
    # Start, the bits of 0xA5 from the lowest on, stop.
    assert [int(bool(level)) for level in levels] == [0, 1, 0, 1, 0, 0, 1, 0, 1, 1]
    # Without a pin to send on, bit 6 is part of a count that no chip has.
    mute = replace(ARM, stream=replace(ARM.stream, transmit_pin=None))
    other = replace(receiver(0x40 | 9), streamed=mute)
    other.look(byte(9), TRUE)
    assert other.level is None
    first = receiver(0x40 | 10, left=0)
    first.look(byte(5), TRUE)
    assert first.left.value == 104, "the start bit is sent for a whole bit"
