"""The chip that a test runs, acts upon and looks into: what each helper does, and what it says when it fails.

Programs are assembly, so that times follow from the data sheet's cycles, which are counted by hand.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace
from typing import cast

import pytest

from servogen.bench.inputs.adapter import DrivePin
from servogen.bench.inputs.wiring import input_wiring
from servogen.bench.virtual.connections import ShortCircuit, Wiring
from servogen.edges import EdgeTrace, edge_chunk
from servogen.errors import InputError
from servogen.pic.assembler import assemble
from servogen.pic.image import Image
from servogen.simulator import BouncingButton, Serial, SimulatorOptions, Stimuli
from servogen.testing import chip as chip_module
from servogen.testing.chip import Board, Chip, after_option_writes, check_time, contact_changes
from servogen.testing.seen_chip import Player, SeenChip
from servogen.testing.signals import Signals
from servogen.testing.targets import BenchRun, SeenPins
from servogen.testing.waves import wave_lines
from servogen.units import Clock, Cycles
from servogen.verify.measurement import time_words
from tests.simulator.helpers import CLOCK, HEAD, WATCHDOG_OFF

OUTPUTS = " bsf STATUS, RP0\n clrf TRISB\n bcf STATUS, RP0\n"
"""Three cycles: port B drives from cycle 1 on."""
COUNTER = """
 bsf STATUS, RP0
 movlw 0x28
 movwf OPTION_REG
 bcf STATUS, RP0
 clrf TMR0
wait goto wait
"""
"""TMR0 counts the rising edges of RA4; no prescaler; pull-ups on."""


def chip_of(source: str, clock: Clock = CLOCK, **around: object) -> Chip:
    made = assemble(f"{HEAD}{WATCHDOG_OFF}{source}\n        end\n", "test.asm")
    return Chip(Board("test.asm", made.image, clock, made.listing, **around))  # type: ignore[arg-type]


def blinker(pause: int = 0) -> str:
    """High for 1 + pause cycles of every 4 + pause: BSF, pause, BCF, GOTO (2)."""
    return f"{OUTPUTS}loop bsf PORTB, 0\n" + pause * " nop\n" + " bcf PORTB, 0\n goto loop\n"


# Measuring


def test_widths_and_periods_are_exact_to_the_cycle() -> None:
    for pause in (0, 6, 7):  # one NOP more is one cycle more
        chip = chip_of(blinker(pause))
        chip.run_cycles(100)
        assert set(chip.widths("RB0")) == {1 + pause}
        assert set(chip.periods("RB0")) == {4 + pause}
        assert set(chip.widths("RB0", level=0)) == {3}
        assert chip.rising("RB0")[:2] == [3, 7 + pause]
        assert chip.falling("RB0")[0] == 4 + pause
        assert chip.rising("RB1") == chip.widths("RB1") == []


def test_microseconds_are_those_of_the_clock() -> None:
    chip = chip_of(blinker(1), Clock(10_000_000))  # 0.4 µs a cycle
    chip.run_us(40)
    assert chip.cycle in (100, 101) and chip.us == pytest.approx(chip.cycle * 0.4)
    assert set(chip.widths_us("RB0")) == {0.8}
    assert set(chip.periods_us("RB0")) == {2.0}
    assert chip.rising_us("RB0")[:2] == [1.2, 3.2]
    assert chip.falling_us("RB0")[0] == 2.0
    assert (set(chip.widths("RB0")), set(chip.periods("RB0"))) == ({2}, {5})
    assert (chip.rising("RB0")[:2], chip.falling("RB0")[0]) == ([3, 8], 5)


def test_a_pulse_that_is_cut_off_or_began_earlier_is_left_out() -> None:
    chip = chip_of(blinker(9))  # rises at 3, 16, 29; falls at 13, 26
    chip.run_cycles(32)
    assert chip.widths("RB0") == [10, 10]
    assert chip.widths("RB0", since_us=4) == [10]
    assert chip.widths("RB0", since_us=16) == [10]
    assert chip.rising("RB0", since_us=16) == [16, 29]
    assert chip.periods("RB0", since_us=4) == [13]


def test_a_pin_that_becomes_an_output_at_low_has_no_falling_edge() -> None:
    chip = chip_of(blinker(9))
    chip.run_until("RB0 fall", within_ms=1)
    assert chip.falling("RB0") == [13]
    assert not chip_of("wait goto wait").rising("RB0")


class Line(Signals):
    """Edges that a sender makes, which is the simulator's own."""

    def __init__(self, source: Serial | Sequence[tuple[int, int]], end: int) -> None:
        if isinstance(source, Serial):
            source = [(change.cycle, change.level) for change in source.changes(CLOCK)]
        cycles, levels = zip(*source, strict=True)
        self.trace = EdgeTrace(CLOCK, (edge_chunk(cycles, [10] * len(cycles), levels),), Cycles(end))

    def pieces(self) -> Sequence[EdgeTrace]:
        return (self.trace,)

    def chip_clock(self) -> Clock:
        return CLOCK


def test_bytes_are_what_was_sent() -> None:
    data = bytes(range(256))
    for inverted in (False, True):
        line = Line(Serial(10, data, Fraction(2400), 1000, inverted=inverted), 2_000_000)
        assert line.uart("RB5", 2400, inverted=inverted) == data
    fast = Line(Serial(10, b"U\x00\xff", Fraction(2400), 1000, Fraction(2, 100)), 100_000)
    assert fast.uart("rb5", 2400) == b"U\x00\xff"


def test_a_byte_with_another_bit_is_another_byte() -> None:
    for bit in range(8):
        line = Line(Serial(10, bytes([0x41 ^ 1 << bit]), Fraction(2400), 1000), 10_000)
        assert line.uart("RB5", 2400) == bytes([0x41 ^ 1 << bit]) != b"A"


def test_a_line_may_be_as_slow_as_a_bit_in_a_second_and_begin_at_once() -> None:
    """0xFE at 1 baud: a start bit and one low bit from the first cycle on."""
    assert Line([(0, 1), (1, 0), (2_000_001, 1)], 10_000_000).uart("RB5", 1) == b"\xfe"
    with pytest.raises(InputError, match="baud = 0 is not between 0 and one bit in a cycle"):
        Line([(0, 1)], 100).uart("RB5", 0)


@pytest.mark.parametrize("late", [-100, 100])
def test_an_edge_may_be_a_quarter_of_a_bit_off_and_no_more(late: int) -> None:
    """A bit at 2500 baud is 400 cycles; 0xFE has one edge, 800 cycles after that of the start bit."""
    further = late + (1 if late > 0 else -1)
    assert Line([(0, 1), (1000, 0), (1800 + late, 1)], 10_000).uart("RB5", 2500) == b"\xfe"
    with pytest.raises(AssertionError, match="25 % of a bit from where it belongs"):
        Line([(0, 1), (1000, 0), (1800 + further, 1)], 10_000).uart("RB5", 2500)
    with pytest.raises(AssertionError, match=" 49 % of a bit from where it belongs"):  # 197 of 400 cycles
        Line([(0, 1), (1000, 0), (1800 + 197 * late // 100, 1)], 10_000).uart("RB5", 2500)
    with pytest.raises(AssertionError, match=" 30 % of a bit from where it belongs, 3480 µs"):
        Line([(0, 1), (1000, 0), (1400, 1), (4480, 0), (4560, 1)], 10_000).uart("RB5", 2500)


def test_a_start_bit_that_ends_early_is_a_disturbance_and_a_byte_that_is_cut_off_is_left_out() -> None:
    glitch = [(0, 1), (200, 0), (400, 1)]
    sent = [(c.cycle, c.level) for c in Serial(10, b"AB", Fraction(2400), 1000).changes(CLOCK)][1:]
    assert Line([*glitch, *sent], 10_000).uart("RB5", 2400) == b"AB"
    assert Line([*glitch, *sent], 1000 + 18 * 416).uart("RB5", 2400) == b"A"
    assert Line([*glitch, *sent], 10_000).uart("RB5", 2400, since_us=5100) == b"B"


@pytest.mark.parametrize(
    ("source", "message"),
    [
        (
            Serial(10, b"AU", Fraction(2400), 1000, Fraction(4, 100)),
            r"byte 1, from 1000 µs, has an edge 27 % of a bit from where it belongs, 2804 µs after its start",
        ),
        (Serial(10, b"\x55", Fraction(4800), 1000), r"one of that length would be 4\d\d\d\.?\d* baud"),
        ([(0, 1), (1000, 0), (9000, 1)], r"byte 1, from 1000 µs, has no stop bit; received before it: b''"),
    ],
)
def test_a_line_that_is_not_as_said_fails_with_what_is_there(
    source: Serial | Sequence[tuple[int, int]], message: str
) -> None:
    with pytest.raises(AssertionError, match=message):
        Line(source, 100_000).uart("RB5", 2400)


def test_measurements_name_what_is_allowed() -> None:
    chip = chip_of(blinker())
    with pytest.raises(InputError, match=r"no pin 'RB8'.*\n.*did you mean 'RB"):
        chip.widths("RB8")
    with pytest.raises(InputError, match=r"at most 1e\+06 with this clock"):
        chip.uart("RB0", 2_000_000)


# Running


def test_it_runs_until_an_edge_a_cycle_an_address_a_label_a_line_or_a_condition() -> None:
    source = (
        f"{OUTPUTS} movlw 5\n movwf 0x20\nagain bsf PORTB, 3\n decfsz 0x20, f\n goto again\ndone goto done\n"
    )
    assert chip_of(source).run_until("RB3 rise") == 6  # after the instruction of cycle 5
    assert chip_of(source).run_until("RB3") == 6
    assert chip_of(source).run_until("cycle 4") == 4
    assert chip_of(source).run_until("0x006") == 6
    assert chip_of(source).run_until("done()") == 5 + 4 * 4 + 3
    assert chip_of(source).run_until("0x20 == 3") == 5 + 4 + 2
    assert chip_of(source).run_until(lambda chip: chip.variable("0x20") == 3) == 5 + 4 + 2
    chip = chip_of(source)
    line = chip_line(chip, "decfsz")
    assert chip.run_until(f"line {line}") == chip.us == 6
    assert chip.line is not None and chip.line.text == "decfsz 0x20, f"
    assert chip.run_until(f"test.asm:{line}") == 10  # again: the next time
    assert chip.run_until("0x20 > 1") == 10  # at once: it holds


def chip_line(chip: Chip, text: str) -> int:
    assert chip.board.listing is not None
    lines = chip.board.listing.sources[0][1].splitlines()
    return 1 + next(number for number, line in enumerate(lines) if text in line)


@pytest.mark.parametrize(
    ("what", "message"),
    [
        (
            "RB7 rise",
            "RB7 rise: not within 2 ms, at 2000 µs\n  test.asm:.*\n  RB7 is an output: bit 7 of TRISB is 0.",
        ),
        ("RA0 fall", "RA0 is an input: bit 0 of TRISA is 1, as it is after every reset"),
        ("0x20 > 5", "0x20 > 5: not within 2 ms, at 2000 µs\n.*\n  it is 0"),
        ("cycle 3000", "cycle 3000: not within 2 ms, at 2000 µs"),
    ],
)
def test_what_does_not_come_fails_in_time_and_says_why(what: str, message: str) -> None:
    chip = chip_of(f"{OUTPUTS} clrf 0x20\nwait goto wait\n")
    with pytest.raises(AssertionError, match=message):
        chip.run_until(what, within_ms=2)
    assert 2000 <= chip.cycle < 2003


def test_a_function_of_the_chip_that_stays_false_fails_in_time_even_asleep() -> None:
    chip = chip_of(" sleep\n")

    def awake(chip: Chip) -> bool:
        return not chip.asleep and chip.cycle > 10

    with pytest.raises(AssertionError, match=r"awake: not within 0.1 ms, at 100 µs(.|\n)*the chip sleeps"):
        chip.run_until(awake, within_ms=0.1)


@pytest.mark.parametrize("value", [-1, float("nan"), float("inf"), 3_600_000.1])
def test_a_time_is_bounded(value: float) -> None:
    with pytest.raises(InputError, match=r"ms = .* is not between 0 and 3.6e\+06"):
        chip_of(blinker()).run_ms(value)


def test_every_time_is_at_most_an_hour() -> None:
    """Of a chip at 10 MHz, whose hour has 9e9 cycles."""
    chip = chip_of(blinker(), Clock(10_000_000))
    calls: dict[str, Callable[[], object]] = {
        "cycles = -1 is not between 0 and 9e+09": lambda: chip.run_cycles(-1),
        "us = -1 is not between 0 and 3.6e+09": lambda: chip.run_us(-1),
        "ms = -1 is not between 0 and 3.6e+06": lambda: chip.run_ms(-1),
        "s = -1 is not between 0 and 3600": lambda: chip.run_s(-1),
        "within_ms = -1 is not between 0 and 3.6e+06": lambda: chip.run_until("RB0", within_ms=-1),
        "hold_ms = -1 is not between 0 and 3.6e+06": lambda: chip.reset(hold_ms=-1),
        "hold_ms = -2 is not between 0 and 3.6e+06": lambda: chip.press("RB1", hold_ms=-2),
        "bounce_ms = -1 is not between 0 and 3.6e+06": lambda: chip.press("RB1", bounce_ms=-1),
        "bounces = -1 is not between 0 and 1000": lambda: chip.press("RB1", bounces=-1),
        "bounces = 1001 is not between 0 and 1000": lambda: chip.press("RB1", bounces=1001),
    }
    for message, call in calls.items():
        with pytest.raises(InputError) as error:
            call()
        assert error.value.message == message
    check_time("s", 3600, Fraction(1))
    check_time("s", 0, Fraction(1))


def test_it_runs_for_whole_cycles_of_every_unit() -> None:
    """NOPs of one cycle each, behind them 2 cycles of GOTO and so on: no instruction is cut in two."""
    chip = chip_of(500 * " nop\n" + "wait goto wait\n")
    for run, cycle in (
        (lambda: chip.run_cycles(0), 0),
        (lambda: chip.run_cycles(10), 10),
        (lambda: chip.run_us(20), 30),
        (lambda: chip.run_ms(0.03), 60),
        (lambda: chip.run_ms(100), 100_060),
        (lambda: chip.run_s(2), 2_100_060),
    ):
        run()
        assert (chip.cycle, chip.us, chip.ms) == (cycle, cycle, cycle / 1000)
    with pytest.raises(AssertionError, match="0x20 > 5: not within 1000 ms"):
        chip.run_until("0x20 > 5")
    assert chip.cycle == 3_100_060


def test_a_contact_flips_within_its_time_and_ends_at_its_level() -> None:
    for bounces in (0, 1, 1000):
        for seed, level in ((1, 0), (2, 1), (3, 0)):
            cycles, levels = zip(*contact_changes(CLOCK, 50, level, 1000, bounces, seed), strict=True)
            assert cycles[0] == 50 and max(cycles) <= 1_000_050
            assert list(levels) == [level, *((1 - level, level) * bounces)]
            assert sorted(set(cycles)) == list(cycles)


def test_an_edge_of_another_pin_is_not_the_one_that_is_waited_for() -> None:
    """RB7 rises in cycle 4, the connected RB0 rises in 6 and falls in 7, and RB7 falls in 9."""
    source = f"{OUTPUTS} movlw 0x80\n movwf PORTB\n nop\n bsf PORTB, 0\n bcf PORTB, 0\n nop\n clrf PORTB\n"
    chip = chip_of(f"{source}wait goto wait\n")
    chip.tie("RB0", "RA0")
    assert [chip.run_until(f"RB7 {way}") for way in ("rise", "fall")] == [5, 10]


def test_an_address_where_the_chip_sleeps_is_not_reached() -> None:
    """The chip sleeps before the instruction at `after`, while a button bounces on a connected pin."""
    chip = chip_of(" sleep\nafter goto after\n")
    chip.tie("RB0", "RA0")
    chip.press("RB0", bounce_ms=0.5)
    with pytest.raises(AssertionError, match="the chip sleeps, or is held in reset"):
        chip.run_until("after()", within_ms=1)


def test_a_function_of_the_chip_sees_what_is_connected() -> None:
    """RB0 rises in cycle 3, and the next instruction sees RA4 high; a button releases RA4 after 100 µs."""
    chip = chip_of(blinker(30))
    chip.tie("RB0", "RA4")
    assert chip.run_until(lambda chip: bool(chip.pin("RA4"))) == 5
    button = chip_of(COUNTER)
    button.run_cycles(10)
    button.tie("RB0", "RA4")
    button.press("RB0", hold_ms=0.1)
    button.run_cycles(4)
    assert button.pin("RA4") == 0
    assert 110 <= button.run_until(lambda chip: bool(chip.pin("RA4")), within_ms=1) <= 113


def test_a_condition_that_cannot_be_read_says_which_are_allowed() -> None:
    with pytest.raises(InputError, match=r"line 12, 0x01F, show\(\), RB0 rise"):
        chip_of(blinker()).run_until("RB0 rises")


def test_more_edges_than_a_test_can_look_at_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chip_module, "MAX_EDGES", 100)
    chip = chip_of(blinker())
    chip.run_cycles(1000)
    with pytest.raises(InputError, match=r"the pins have \d+ edges since power-up, more than 100") as refused:
        chip.widths("RB0")
    monkeypatch.setattr(chip_module, "MAX_EDGES", int(str(refused.value).split(" edges")[0].split()[-1]))
    assert set(chip.widths("RB0")) == {1}


# Acting


def test_a_press_and_a_release_bounce_as_often_as_said() -> None:
    """Each flip back is a rising edge, which TMR0 counts: 5 of the press, 1 and 5 of the release."""
    chip = chip_of(COUNTER, inputs={"RA4": 1})
    chip.run_cycles(10)
    chip.press("RA4", bounce_ms=5)
    chip.run_ms(5.01)
    assert chip.pin("RA4") == 0 and chip.register("TMR0") == 5
    chip.release("RA4", bounce_ms=5)
    chip.run_ms(5.01)
    assert chip.pin("RA4") == 1 and chip.register("TMR0") == 11
    chip.bounce("RA4", ms=2, bounces=3)
    chip.run_ms(2.01)
    assert chip.pin("RA4") == 1 and chip.register("TMR0") == 14
    chip.press("RA4", hold_ms=10)
    chip.run_ms(9.9)
    assert chip.pin("RA4") == 0
    chip.run_ms(0.2)
    assert chip.pin("RA4") == 1 and chip.register("TMR0") == 15
    chip.press("RA4", active=1)
    chip.run_cycles(3)
    assert chip.pin("RA4") == 1


@pytest.mark.parametrize("hold_ms", [0, 4.9, 5])
def test_a_button_is_not_released_while_it_still_bounces(hold_ms: float) -> None:
    board = cast(Player, SimpleNamespace(wiring=input_wiring(["RA4=17"])))
    for chip in (chip_of(COUNTER, inputs={"RA4": 1}), SeenChip("bench", Clock(4_000_000), board)):
        with pytest.raises(InputError, match=f"hold_ms = {hold_ms:g} is not longer than bounce_ms = 5"):
            chip.press("RA4", bounce_ms=5, hold_ms=hold_ms)
        chip.press("RA4", bounce_ms=5, hold_ms=5.1)


def test_the_time_of_a_chip_on_the_bench_is_that_of_its_runs() -> None:
    player = SimpleNamespace(wiring=input_wiring(["RA4=17"]), play=lambda run: [])
    chip = SeenChip("bench", Clock(4_000_000), cast(Player, player))
    assert (chip.ms, chip.us) == (0, 0)
    chip.run_ms(40)
    chip.pieces()
    chip.run_ms(2)
    assert (chip.ms, chip.us) == (42, 42_000), "a run that was seen, and one that is being prepared"


def test_what_is_due_after_a_run_on_the_bench_is_played_in_a_later_one() -> None:
    """Pressed at 0 ms and released at 30 ms, while the test looks after 10 ms and after 15 ms."""
    played: list[BenchRun] = []

    def play(segment: BenchRun) -> list[SeenPins]:
        played.append(segment)
        return []

    board = cast(Player, SimpleNamespace(wiring=input_wiring(["RA4=17"]), play=play))
    chip = SeenChip("bench", Clock(4_000_000), board)
    chip.press("RA4", hold_ms=30)
    for ms in (10, 5, 20):
        chip.run_ms(ms)
        assert list(chip.pieces()) == []
    assert [segment.seconds for segment in played] == [0.01, 0.005, 0.02]
    assert [[(each.at_ms, each.what) for each in segment.inputs] for segment in played] == [
        [(0, DrivePin("RA4", 0))],
        [],
        [(15, DrivePin("RA4", 1))],
    ]
    assert [segment.levels for segment in played] == [{}, {"RA4": 0}, {"RA4": 0}]
    assert chip.ms == 35


def test_bounces_are_over_when_they_should_be() -> None:
    chip = chip_of(COUNTER, inputs={"RA4": 1})
    chip.press("RA4", bounce_ms=5, bounces=50)
    chip.run_ms(5.01)
    before = chip.register("TMR0")
    chip.run_ms(50)
    assert chip.register("TMR0") == before == 50


def test_a_contact_bounces_five_times_by_default_and_not_at_all_without_a_time() -> None:
    """Each opening of RA4's contact to RB1, which is low, is a rising edge at RA4, as is each bounce."""
    source = COUNTER.replace(" bcf STATUS", " bcf TRISB, 1\n bcf STATUS")
    chip = chip_of(source, inputs={"RA4": 1})
    chip.run_cycles(20)
    chip.bounce("RA4", ms=1)
    chip.run_ms(1.01)
    assert chip.register("TMR0") == 5
    chip.switch("RA4", "RB1", True, bounce_ms=1)
    chip.run_ms(1.01)
    assert (chip.pin("RA4"), chip.register("TMR0")) == (0, 10)
    chip.switch("RA4", "RB1", False)
    chip.switch("RA4", "RB1", True)  # nothing is under way
    chip.switch("RA4", "RB1", False)
    chip.run_cycles(4)
    assert (chip.pin("RA4"), chip.register("TMR0")) == (1, 11)
    keypad = chip.keypad(["RB1"], ["RA4"], "a")
    keypad.press("a", bounce_ms=1)
    chip.run_ms(1.01)
    keypad.release("a", bounce_ms=1)
    chip.run_ms(1.01)
    assert (chip.pin("RA4"), chip.register("TMR0")) == (1, 11 + 5 + 1 + 5)
    keypad.press("a")
    keypad.release("a")
    chip.press("RA4")
    chip.release("RA4")
    chip.press("RA4", hold_ms=100)
    chip.run_ms(99.97)
    assert chip.pin("RA4") == 0
    chip.run_ms(0.06)
    assert chip.pin("RA4") == 1


def test_a_contact_bounces_at_the_same_moments_on_the_bench() -> None:
    """In simulation to the cycle, on the bench to the millisecond of the board."""
    wiring = input_wiring(["RB0-RB4=22", "RA4=17"])
    for act, level, seed in (
        (lambda chip: chip.press("RB0", bounce_ms=60), 0, 1),
        (lambda chip: chip.release("RB0", bounce_ms=60), 1, 1),
        (lambda chip: chip.bounce("RB0", ms=60), 1, 1),
        (lambda chip: chip.press("RB0", bounce_ms=60, hold_ms=70), 0, 1),
        (lambda chip: chip.switch("RB0", "RB4", True, bounce_ms=60), 1, 1),
        (lambda chip: chip.keypad(["RB0"], ["RB4"], "a").press("a", bounce_ms=60), 1, 1),
        (lambda chip: chip.keypad(["RB0"], ["RB4"], "a").press("a", bounce_ms=60, seed=9), 1, 9),
    ):
        changes = contact_changes(CLOCK, 0, level, 60, 5, seed)
        played: list[BenchRun] = []
        player = SimpleNamespace(wiring=wiring, play=lambda run, played=played: played.append(run) or [])
        bench = SeenChip("bench", CLOCK, cast(Player, player), inputs={"RB0": 1})
        act(bench)
        bench.run_ms(200)
        bench.pieces()
        found = [
            (each.at_ms, int(getattr(each.what, "level", getattr(each.what, "closed", 2))))
            for each in played[0].inputs
        ]
        assert found[: len(changes)] == [(round(cycle / 1000), now) for cycle, now in changes]
        chip = chip_of("wait goto wait\n", inputs={"RB0": 1, "RB4": 0})
        act(chip)
        if len(found) > len(changes):
            changes = contact_changes(CLOCK, 70_000, 1 - level, 60, 5, seed + 1)
            assert found[-len(changes) :] == [(round(cycle / 1000), now) for cycle, now in changes]
        until = re.escape(time_words(changes[-1][0], CLOCK))
        with pytest.raises(InputError, match=f"still changes from outside until {until}, and it is 0 µs now"):
            act(chip)


def test_what_is_under_way_is_not_interrupted() -> None:
    chip = chip_of(COUNTER)
    chip.press("RA4", bounce_ms=5)
    until = contact_changes(CLOCK, 0, 0, 5, 5, 1)[-1][0]
    message = rf"RA4 still changes from outside until {until} µs, and it is 0 µs now"
    with pytest.raises(InputError, match=message):
        chip.release("RA4")
    with pytest.raises(InputError, match=r"run until then first"):
        chip.tie("RA4", "RB0")
    chip.run_ms(6)
    chip.release("RA4")
    chip.switch("RB1", "RB0", True, bounce_ms=1)
    with pytest.raises(InputError, match="RB0 to RB1 still changes from outside until"):
        chip.switch("RB0", "RB1", False)
    chip.run_ms(1)
    chip.drive("RB2", 1)
    chip.drive("RB2", 0)  # in the same cycle: that is over at once
    chip.run_cycles(3)
    assert chip.pin("RB2") == 0


def test_a_pin_is_driven_until_it_is_let_go() -> None:
    chip = chip_of(COUNTER, inputs={"RB1": 0})
    chip.run_cycles(10)
    assert [chip.pin("RB0"), chip.pin("RB1"), chip.drives("RB0")] == [1, 0, False]  # the pull-ups are on
    chip.drive("RB0", 0)
    chip.drive("RB1", None)
    chip.run_cycles(2)
    assert [chip.pin("RB0"), chip.pin("RB1")] == [0, 1]
    with pytest.raises(InputError, match=r"a level of RB0 is 0 or 1, not 2"):
        chip.drive("RB0", 2)


def test_bytes_are_sent_in_their_time() -> None:
    """0x55 has five rising edges, its stop bit's among them; a byte's time of idle line comes before."""
    chip = chip_of(COUNTER, inputs={"RA4": 1})
    chip.run_cycles(10)
    chip.send("RA4", b"\x55", 2400)
    assert chip.register("TMR0") == 5
    assert chip.us - 10 == pytest.approx(20 * 1e6 / 2400, abs=3)
    begin = chip.us
    chip.send("RA4", "UU", 2400, baud_error_percent=10)
    assert chip.register("TMR0") == 15
    assert chip.us - begin == pytest.approx(30 * 1e6 / 2640, abs=3)
    for baud, error in ((0, 0), (1_000_001, 0), (2400, -50), (2400, 50)):
        with pytest.raises(
            InputError, match=r"is shorter than a cycle.*\n.*at most 1e\+06, an error within 50 %"
        ):
            chip.send("RA4", b"x", baud, baud_error_percent=error)
    for baud, error in ((1_000_000, 0), (2400, -49), (2400, 49)):
        chip.send("RA4", b"x", baud, baud_error_percent=error)
    slow = chip_of(COUNTER, Clock(4))  # a cycle in a second
    slow.send("RA4", b"", 1)
    assert slow.cycle in (10, 11), "the idle line alone"


def test_a_stimulus_acts_and_its_pin_cannot_be_connected_as_well() -> None:
    chip = chip_of(COUNTER, stimuli=Stimuli([BouncingButton(4, 1000, 5000, bounces=3, bounce=500)]))
    chip.run_ms(3)
    assert chip.register("TMR0") == 3
    with pytest.raises(InputError, match=r"RA4 is driven by the stimulus"):
        chip.tie("RA4", "RB0")
    with pytest.raises(InputError, match=r"RA4 is driven by the stimulus"):
        chip.keypad(["RB0"], ["RB1", "RA4"], "ab")


# Wires


def test_a_wire_is_seen_by_the_next_instruction() -> None:
    """RB0 drives RB1, an input, which is copied into RAM right after RB0 rises and right after it falls."""
    source = """
 bsf STATUS, RP0
 movlw 0xFE
 movwf TRISB
 bcf STATUS, RP0
 bsf PORTB, 0
 movf PORTB, w
 movwf 0x20
 bcf PORTB, 0
 movf PORTB, w
 movwf 0x21
wait goto wait
"""
    chip = chip_of(source)
    chip.tie("RB0", "RB1")
    chip.run_cycles(20)
    assert [chip.variable("0x20") & 2, chip.variable("0x21") & 2] == [2, 0]
    open_ = chip_of(source)
    open_.run_cycles(20)
    assert open_.variable("0x20") & 2 == 0


def test_a_counter_counts_the_pulses_of_another_pin_that_it_is_tied_to() -> None:
    blink = " nop\n nop\n nop\nloop bsf PORTB, 0\n nop\n nop\n bcf PORTB, 0\n nop\n goto loop\n"
    source = (
        COUNTER.replace("wait goto wait\n", "").replace(" bcf STATUS", " clrf TRISB\n bcf STATUS") + blink
    )
    chip = chip_of(source)
    chip.tie("RB0", "RA3", "RA4")
    chip.run_cycles(9 + 14 * 7)  # to the end of the 14th loop
    pulses = len(chip.rising("RB0"))
    assert chip.register("TMR0") == pulses == 14
    chip.untie("RB0", "RA4")
    chip.run_cycles(70)
    assert chip.register("TMR0") == pulses and len(chip.rising("RB0")) > pulses


def test_a_button_on_a_connected_pin_is_seen_at_the_other_one_also_after_power_up() -> None:
    """RB0 has the chip's pull-up, and the button's contact opens five times."""
    chip = chip_of(COUNTER)
    chip.tie("RB0", "RA4")
    for _ in range(2):
        chip.run_cycles(20)
        assert chip.pin("RA4") == 1
        chip.press("RB0", bounce_ms=2)
        before = chip.register("TMR0")
        chip.run_ms(2.01)
        assert chip.pin("RA4") == 0 and chip.register("TMR0") - before == 5
        chip.drive("RB0", None)
        chip.run_cycles(2)
        assert chip.pin("RA4") == 1
        chip.power_cycle()


def test_pull_ups_reach_what_is_connected_at_once() -> None:
    """RA4 is copied into RAM two instructions after the pull-up of RB0, its neighbour, was switched on."""
    switch = " bsf STATUS, RP0\n bcf OPTION_REG, 7\n bcf STATUS, RP0\n"
    chip = chip_of(f"{switch} movf PORTA, w\n movwf 0x20\nwait goto wait\n")
    chip.tie("RB0", "RA4")
    chip.run_cycles(10)
    assert chip.variable("0x20") & 0x10


def test_what_is_connected_has_its_level_before_the_first_instruction() -> None:
    """The second instruction after power-up copies port A into RAM; RA4 has the level of RB0."""
    chip = chip_of(" nop\n movf PORTA, w\n movwf 0x20\nwait goto wait\n", inputs={"RB0": 1})
    chip.tie("RB0", "RA4")
    for level in (1, 0):
        chip.drive("RB0", level)
        chip.power_cycle()
        chip.run_cycles(5)
        assert chip.variable("0x20") >> 4 & 1 == level


def test_the_pull_ups_may_change_after_every_write_of_option_reg() -> None:
    """Words of DS35007, table 7-2; OPTION_REG is 0x81, and INDF (0x80) may stand for it."""
    words = {
        0: 0x0081,  # MOVWF 0x01
        1: 0x0062,  # OPTION
        2: 0x0080,  # MOVWF INDF
        3: 0x0801,  # MOVF 0x01, W
        4: 0x0881,  # MOVF 0x01, F
        5: 0x1381,  # BCF 0x01, 7
        6: 0x1B81,  # BTFSC 0x01, 7
        7: 0x0082,  # MOVWF PCL
        8: 0x0001,  # no instruction
        9: 0x0181,  # CLRF 0x01
        10: 0x0064,  # CLRWDT
    }
    assert after_option_writes(Image(words)) == {1, 2, 3, 5, 6, 10}


def test_two_outputs_that_differ_are_a_short_circuit() -> None:
    chip = chip_of(f"{OUTPUTS} movlw 3\n movwf PORTB\n bcf PORTB, 1\nwait goto wait\n")
    chip.tie("RB0", "RB1")
    message = (
        r"RB0 drives 1 and RB1 drives 0, and they are connected: a short circuit, at 6 µs\n  test.asm:\d+: "
    )
    with pytest.raises(ShortCircuit, match=message):
        chip.run_ms(1)


def test_what_an_edge_stops_at_is_not_lost_to_a_wire_at_the_same_instruction() -> None:
    chip = chip_of(f"{OUTPUTS} nop\n movlw 0x81\n movwf PORTB\nstop goto stop\n")
    chip.tie("RB0", "RA0")
    assert chip.run_until("RB7 rise") == 6
    chip = chip_of(f"{OUTPUTS} nop\n movlw 0x81\n movwf PORTB\nstop goto stop\n")
    chip.tie("RB0", "RA0")
    assert chip.run_until("stop()") == 6  # the wire's edge is in the instruction before


def test_wires_join_into_nets() -> None:
    wiring = Wiring()
    for wire in ((0, 1), (2, 3), (1, 2), (5, 6)):
        wiring.connect(frozenset(wire))
    assert sorted(map(sorted, wiring.nets())) == [[0, 1, 2, 3], [5, 6]]
    wiring.disconnect(frozenset((1, 2)))
    assert sorted(map(sorted, wiring.nets())) == [[0, 1], [2, 3], [5, 6]]


@pytest.mark.parametrize(
    ("driven", "held", "pull_ups", "level"),
    [
        ({5: 1}, {}, False, 1),
        ({5: 0}, {6: 1}, True, 0),
        ({}, {6: 1}, False, 1),
        ({}, {4: 0, 6: 1}, True, 0),
        ({}, {}, True, 1),
        ({}, {}, False, 2),
        ({4: 1}, {}, False, 1),
        ({4: 1, 5: 0}, {}, False, 0),
    ],
)
def test_who_decides_a_level(
    driven: dict[int, int], held: dict[int, int], pull_ups: bool, level: int
) -> None:
    """Of RA4, an open drain whose 1 is weak, RB0 and RB1: an output, what is held, a pull-up, nothing."""
    wiring = Wiring(held, {frozenset((4, 5)), frozenset((5, 6))})
    found = wiring.levels(tuple(driven.get(pin, 2) for pin in range(13)), pull_ups)
    assert found[6] == level
    assert found[5] == (2 if 5 in driven else level)


def test_a_switch_is_closed_and_opened_once() -> None:
    chip = chip_of(COUNTER)
    with pytest.raises(InputError, match=r"RB0 and RB1 are not connected"):
        chip.untie("RB0", "RB1")
    chip.tie("RB0", "RB1")
    with pytest.raises(InputError, match=r"RB0 and RB1 are connected already"):
        chip.tie("RB0", "RB1")
    with pytest.raises(InputError, match=r"RB0 cannot be connected to itself"):
        chip.tie("RB0", "rb0")
    with pytest.raises(InputError, match=r"RB2 cannot be connected to itself"):
        chip.tie("RB2")


def test_a_keypads_contacts_bounce() -> None:
    """RB1, low, is the row and RA4 the column, with a pull-up of its own: each opening is a rising edge."""
    source = COUNTER.replace(" bcf STATUS", " bcf TRISB, 1\n bcf STATUS")
    chip = chip_of(source, inputs={"RA4": 1})
    keypad = chip.keypad(rows=["RB1"], columns=["RA3", "RA4"], keys="ab")
    chip.run_cycles(20)
    keypad.press("b", bounce_ms=2, bounces=4)
    chip.run_ms(2.01)
    assert chip.pin("RA4") == 0 and chip.register("TMR0") == 4
    keypad.release("b", bounce_ms=2, bounces=4)
    chip.run_ms(2.01)
    assert chip.pin("RA4") == 1 and chip.register("TMR0") == 4 + 1 + 4
    with pytest.raises(InputError, match=r"there is no key 'c'.*\n.*keys: ab"):
        keypad.press("c")
    with pytest.raises(InputError, match=r"does not name each of the 2 keys once"):
        chip.keypad(rows=["RB1"], columns=["RA3", "RA4"], keys="aa")


# Inside


def test_memory_is_read_by_address_and_register() -> None:
    chip = chip_of(" movlw 0xFE\n movwf 0x20\n movlw 3\n movwf EEADR\nwait goto wait\n")
    chip.run_cycles(10)
    assert chip.variable("0x20") == 254 and chip.variable("0x20", signed=True) == -2
    assert chip.register("eeadr") == 3
    assert chip.eeprom == b"\xff" * 64
    assert chip.interrupts == 0 and chip.warnings == ()
    interrupted = chip_of(" bsf INTCON, GIE\n bsf INTCON, INTE\n bsf INTCON, INTF\nwait goto wait\n")
    interrupted.run_cycles(8)
    assert interrupted.interrupts == 1
    with pytest.raises(InputError, match=r"there is no register 'EEADRESS'.*\n.*did you mean 'EEADR'"):
        chip.register("EEADRESS")


def test_arrays_have_items() -> None:
    chip = chip_of(" movlw 0xFE\n movwf 0x20\n movwf 0x22\n movlw 1\n movwf 0x21\nwait goto wait\n")
    assert chip.board.listing is not None
    variables = ((0x20, "words", 6), (0x20, "big", 5), (0x20, "long", 4))
    chip.board = replace(chip.board, listing=replace(chip.board.listing, variables=variables))
    chip.run_cycles(10)
    assert chip.array("words") == [254, 1, 254, 0, 0, 0]
    assert chip.array("words", item_bytes=2) == [0x1FE, 0xFE, 0]
    assert chip.array("words", signed=True)[0] == -2
    with pytest.raises(InputError, match=r"'big' has 5 bytes, too many for a number.*\n.*array"):
        chip.variable("big")
    with pytest.raises(InputError, match=r"the 6 bytes of 'words' are not a number of items of 4"):
        chip.array("words", item_bytes=4)
    with pytest.raises(InputError, match=r"the 6 bytes of 'words' are not a number of items of 0"):
        chip.array("words", item_bytes=0)
    assert chip.variable("long") == 0x00FE01FE


def test_a_reset_keeps_ram_and_switching_off_keeps_the_eeprom_only() -> None:
    chip = chip_of(" incf 0x20, f\nwait goto wait\n", inputs={"RB3": 1})
    chip.run_ms(1)
    for _ in range(2):
        chip.reset(hold_ms=0.1)
        chip.run_ms(1)
    assert chip.variable("0x20") == 3 and chip.resets["mclr"] == 2
    before = chip.cycle
    chip.reset()
    assert chip.cycle == before + 1001, "a millisecond, and the next instruction"
    chip.reset(hold_ms=0)
    assert (chip.cycle, chip.resets["mclr"]) == (before + 1003, 4), "at least a cycle"
    chip.power_cycle()
    assert chip.cycle == 0 and chip.resets["mclr"] == 0
    chip.run_ms(1)
    assert chip.variable("0x20") == 1 and chip.pin("RB3") == 1


def test_options_are_the_simulators() -> None:
    chip = chip_of(COUNTER, options=SimulatorOptions(ra4_pull_up=True))
    chip.run_cycles(10)
    assert chip.pin("RA4") == 1


def test_its_repr_is_short() -> None:
    chip = chip_of(blinker())
    chip.run_until("RB0 rise")
    assert repr(chip) == f"<Chip test.asm at 4 µs, test.asm:{chip_line(chip, ' bcf PORTB')}: bcf PORTB, 0>"


# Waves


def test_waves_show_levels_edges_in_a_column_and_who_drives() -> None:
    edges = [(0, 5, 2), (10, 5, 1), (40, 5, 0), (44, 6, 1), (50, 5, 1), (51, 5, 0), (60, 4, 1)]
    lines = wave_lines(edge_chunk(*zip(*edges, strict=True)), 72, CLOCK)
    assert lines[0] == "from 0 µs to 72 µs, 1 µs per column"
    assert lines[1] == f"RA4  {'·' * 60}{'▔' * 12}"
    assert lines[2] == f"RB0  {'·' * 10}{'▔' * 30}{'▁' * 10}▔{'▁' * 21}"
    assert lines[3] == f"RB1  {'·' * 44}{'▔' * 28}"
    two_a_column = wave_lines(edge_chunk(*zip(*edges, strict=True)), 144, CLOCK)
    assert two_a_column[2] == f"RB0  {'·' * 5}{'▔' * 15}{'▁' * 5}▒{'▁' * 46}"
    constant = wave_lines(edge_chunk([0, 3], [12, 11], [0, 2]), 10, CLOCK)
    assert constant[1:] == ["not driven: RB6", "low throughout: RB7"]
    assert wave_lines(edge_chunk((), (), ()), 10, CLOCK) == ["no pin changed until 10 µs"]


def test_a_report_names_the_lines_that_made_the_last_edges() -> None:
    chip = chip_of(blinker(), inputs={"RA0": 1})
    chip.run_cycles(12)
    here = chip.cycle
    report = chip.report()
    number = chip_line(chip, "bsf PORTB")
    assert f"         11 µs  RB0 = 1     test.asm:{number}: loop bsf PORTB, 0" in [
        line[2:] for line in report
    ]
    assert [line for line in report if line.startswith("test.asm at 12 µs: test.asm:")]
    assert "high throughout: RA0" in report
    assert chip.cycle == here
    assert sum(line.startswith("  ") for line in report) == 6, "of the 13 since power-up"


def test_a_report_ends_with_where_the_chip_is_and_what_is_warned_about() -> None:
    chip = chip_of(
        " movf 0x20, w\n movwf 0x21\n incf 0x21, f\n btfsc STATUS, Z\n nop\n sleep\ndone goto done\n"
    )
    chip.drive("RA1", 1)
    assert chip.report()[0] == "no pin changed until 0 µs"
    chip.run_cycles(100)
    chip.drive("RA2", 1)  # from now on, which is not over yet
    report = chip.report()
    assert "last edges:" not in report
    assert report[1] == "high throughout: RA1"
    assert report[2].startswith("test.asm at 100 µs (asleep): test.asm:")
    assert report[3:] == []
    bare = Chip(replace(chip.board, listing=None))
    bare.run_cycles(3)
    assert bare.report()[1] == "test.asm at 3 µs: address 0x003"
    blinking = Chip(replace(chip_of(blinker()).board, listing=None))
    blinking.run_cycles(4)
    assert "            3 µs  RB0 = 1     address 0x003" in blinking.report()
    (warning,) = blinking.warnings
    assert blinking.report()[-1] == f"warning: {warning}"
