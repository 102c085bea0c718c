"""What a test sees of recorded edges, and how it acts on a chip of which only the pins are seen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from servogen.bench.inputs.adapter import BoardInput, Close, DrivePin, Send
from servogen.bench.inputs.wiring import InputWiring, input_wiring
from servogen.edges import EdgeTrace
from servogen.errors import InputError
from servogen.pic.image import Image
from servogen.simulator import LevelChange, Levels, Periodic, Serial, Stimuli
from servogen.simulator.layout import MCLR_PIN
from servogen.simulator.pin_levels import at_the_pins
from servogen.testing import seen_chip
from servogen.testing.seen_chip import BenchPlayer, ReplayPlayer, SeenChip, stimulus_inputs
from servogen.testing.signals import Signals
from servogen.testing.targets import BenchRun, BenchStart, PinCapture, SeenPins, captured
from servogen.testing.waves import wave_lines
from servogen.traces.captures import capture_writer
from servogen.units import Clock, Cycles
from tests.edges.rows import Row, chunk

MHZ4 = Clock(4_000_000)
RB0 = 5


class Skipped(Exception):
    """Raised where a user's test would be skipped, so that no test of this file is skipped unnoticed."""


@pytest.fixture(autouse=True)
def _a_skip_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def skip(reason: str) -> None:
        raise Skipped(reason)

    monkeypatch.setattr(seen_chip, "pytest", SimpleNamespace(skip=skip))


def trace(rows: Sequence[Row], end: int, clock: Clock = MHZ4) -> EdgeTrace:
    return EdgeTrace(clock, (chunk(rows),), Cycles(end))


class Shown(Signals):
    """Given pieces of a chip at 4 MHz, whose cycles are microseconds."""

    def __init__(self, *pieces: EdgeTrace) -> None:
        self.shown = pieces

    def pieces(self) -> Sequence[EdgeTrace]:
        return self.shown

    def chip_clock(self) -> Clock:
        return MHZ4


SEEN = [(0, RB0, 1), (10, RB0, 0), (20, RB0, 1), (30, RB0, 0), (40, RB0, 2), (50, RB0, 1)]


def test_edges_pulses_and_periods_are_those_seen_whole() -> None:
    """The level at time 0 is not an edge, an undriven pin is low, and the last pulse is cut off."""
    shown = Shown(trace([*SEEN, (15, 6, 1)], 60))
    assert (shown.rising("RB0"), shown.falling("rb0")) == ([20, 50], [10, 30])
    assert (shown.widths("RB0"), shown.widths("RB0", level=0)) == ([10], [10, 20])
    assert shown.periods("RB0") == [30]
    assert (shown.rising("RB1"), shown.rising("RB2")) == ([15], [])


@pytest.mark.parametrize(
    ("since", "rising", "falling", "widths"),
    [
        *((10, [20, 50], [10, 30], [10]), (11, [20, 50], [30], [10]), (20, [20, 50], [30], [10])),
        *((21, [50], [30], []), (50, [50], [], []), (51, [], [], [])),
    ],
)
def test_since_leaves_out_what_began_earlier(
    since: int, rising: list[int], falling: list[int], widths: list[int]
) -> None:
    shown = Shown(trace(SEEN, 60))
    assert shown.rising("RB0", since_us=since) == shown.rising_us("RB0", since_us=since) == rising
    assert shown.falling("RB0", since_us=since) == shown.falling_us("RB0", since_us=since) == falling
    assert shown.widths("RB0", since_us=since) == shown.widths_us("RB0", since_us=since) == widths
    assert shown.periods("RB0", since_us=since) == [late - early for early, late in pairwise(rising)]


def test_times_of_a_capture_are_its_own_and_cycles_those_of_the_chip() -> None:
    """Steps of half a microsecond; of two captures the time between is not a period."""
    piece = trace([(0, RB0, 0), (4, RB0, 1), (9, RB0, 0), (24, RB0, 1), (30, RB0, 0)], 40, Clock(8_000_000))
    shown = Shown(piece, piece)
    assert shown.rising_us("RB0") == 2 * [2.0, 12.0]
    assert shown.widths_us("RB0") == 2 * [2.5, 3.0]
    assert shown.widths_us("RB0", level=0) == 2 * [7.5]
    assert shown.periods_us("RB0") == 2 * [10.0]
    assert shown.periods("RB0") == 2 * [10]
    assert shown.falling_us("RB0") == 2 * [4.5, 15.0]


def test_everything_since_the_beginning_is_measured_by_default() -> None:
    """Edges in the first microsecond: a byte at 2.5 Mbaud begins after 0.2 µs of a chip at 20 MHz."""
    clock = Clock(20_000_000)
    rows = [(0, RB0, 1), (1, RB0, 0), (2, RB0, 1), (3, RB0, 0), (4, RB0, 1), (30, RB0, 0)]

    class Fast(Shown):
        def chip_clock(self) -> Clock:
            return clock

    shown = Fast(trace(rows, 60, clock))
    assert (shown.rising("RB0"), shown.falling("RB0")) == ([2, 4], [1, 3, 30])
    assert (shown.rising_us("RB0"), shown.falling_us("RB0")) == ([0.4, 0.8], [0.2, 0.6, 6.0])
    assert (shown.widths("RB0"), shown.widths_us("RB0")) == ([1, 26], [0.2, 5.2])
    assert (shown.periods("RB0"), shown.periods_us("RB0")) == ([2], [0.4])
    byte = Fast(trace([(0, RB0, 1), (1, RB0, 0), (3, RB0, 1)], 60, clock))
    assert byte.uart("RB0", 2_500_000) == b"\xff"


def line(rows: Sequence[tuple[int, int]], end: int = 100_000) -> Shown:
    return Shown(trace([(cycle, RB0, level) for cycle, level in rows], end))


def test_a_byte_is_there_when_the_middle_of_its_stop_bit_is() -> None:
    """A bit at 2500 baud has 400 cycles; 0xFF is a start bit, then high. Nine and a half bits are 3800."""
    byte = [(0, 1), (1000, 0), (1400, 1)]
    assert line(byte, 4800).uart("RB0", 2500) == b"\xff"
    assert line(byte, 4799).uart("RB0", 2500) == b""
    assert line([*byte, (5000, 0), (5400, 1)]).uart("RB0", 2500) == b"\xff\xff"
    assert line([*byte, (4801, 0), (5201, 1)]).uart("RB0", 2500) == b"\xff\xff"
    with pytest.raises(AssertionError, match="50 % of a bit from where it belongs, 3800 µs after its start"):
        line([*byte, (4800, 0), (5200, 1)]).uart("RB0", 2500)
    assert line([(0, 0), (500, 1), *byte[1:]]).uart("RB0", 2500) == b"\xff"
    assert line([(0, 2), *byte[1:]]).uart("RB0", 2500) == b"\xff", "what nothing drives is idle"
    # A start bit that is over before its middle is a disturbance; at its middle it is not yet over.
    assert line([(0, 1), (1000, 0), (1200, 1), *byte[1:2]][:3]).uart("RB0", 2500) == b""


def test_a_line_as_fast_as_the_chip_can_be_read() -> None:
    bits = [(0, 1), *((10 + n, level) for n, level in enumerate((0, 1, 0, 1, 0, 1, 0, 1, 0, 1)))]
    assert line(bits, 100).uart("RB0", 1_000_000) == b"\x55"
    for baud in (0, -1, 1_000_001):
        with pytest.raises(InputError, match="is not between 0 and one bit in a cycle"):
            line(bits, 100).uart("RB0", baud)


def test_a_byte_without_its_stop_bit_is_described() -> None:
    """0x00 without a stop bit after an A, whose start bit is the line's shortest level."""
    bits = [0, 1, 0, 0, 0, 0, 0, 1, 0, 1]  # start, 0x41 from its lowest bit on, stop
    sent = [(0, 1), *((1000 + 400 * n, level) for n, level in enumerate(bits))]
    wrong = [*sent, (5000, 0), (9400, 1)]
    with pytest.raises(AssertionError) as error:
        line(wrong).uart("RB0", 2500)
    assert (
        str(error.value)
        == "RB0 at 2500 baud: byte 2, from 5000 µs, has no stop bit; received before it: b'A'"
    )
    with pytest.raises(AssertionError) as early:
        line([*sent, (5000, 0), (5520, 1), (5800, 0), (9000, 1)]).uart("RB0", 2500)
    assert str(early.value) == (
        "RB0 at 2500 baud: byte 2, from 5000 µs, has an edge 30 % of a bit from where it belongs, "
        "520 µs after its start; its shortest level lasts 280 µs, a bit is 400 µs "
        "(one of that length would be 3571.4 baud); received before it: b'A'"
    )


# Waves


def test_waves_begin_a_cycle_before_the_last_forty_edges() -> None:
    edges = [(100 * n, RB0, n % 2) for n in range(45)]
    lines = wave_lines(chunk(edges), 4500, MHZ4)
    # From 499 on: 4001 cycles in columns of 56, which are 72.
    assert lines[0] == "from 499 µs to 4500 µs, 56 µs per column"
    assert len(lines[1]) == len("RB0  ") + 72
    few = wave_lines(chunk(edges[:40]), 4500, MHZ4)
    assert few[0] == "from 0 µs to 4500 µs, 63 µs per column"


@pytest.mark.parametrize(("end", "column", "columns"), [(72, 1, 72), (73, 2, 37), (144, 2, 72), (145, 3, 49)])
def test_waves_have_at_most_72_columns(end: int, column: int, columns: int) -> None:
    lines = wave_lines(chunk([(0, RB0, 0), (column, RB0, 1)]), end, MHZ4)
    assert lines[0] == f"from 0 µs to {end} µs, {column} µs per column"
    assert lines[1] == f"RB0  ▁{'▔' * (columns - 1)}"


def test_the_level_at_a_pin_is_the_chips_or_else_that_of_the_world() -> None:
    driven = chunk([(5, RB0, 1), (9, RB0, 2), (9, 6, 0)])
    outside = [LevelChange(0, RB0, 0), LevelChange(5, RB0, 1), LevelChange(7, RB0, 0), LevelChange(9, 6, 1)]
    found = at_the_pins(driven, outside)
    assert list(zip(*(column.tolist() for column in found), strict=True)) == [
        (0, RB0, 0),
        (5, RB0, 1),
        (9, 6, 1),
        (9, RB0, 0),
        (9, 6, 0),
    ]
    assert len(at_the_pins(chunk([]), []).cycle) == 0


# A chip on the bench


@dataclass
class Bench:
    """Plays runs, and shows for each the next of the given edges; a step is 0.1 ms."""

    wiring: InputWiring | None = field(default_factory=lambda: input_wiring(["RB1=TX1", "RB0-RB4=22"]))
    serial_pin: str | None = None
    late_ms: int = 3
    shown: list[list[Row]] = field(default_factory=list)
    runs: list[BenchRun] = field(default_factory=list)

    def play(self, segment: BenchRun) -> Sequence[SeenPins]:
        self.runs.append(segment)
        rows = self.shown.pop(0) if self.shown else []
        end = round(segment.seconds * 10_000)
        return [SeenPins(trace(rows, end, Clock(40_000)), "the bench")]

    def eeprom(self) -> bytes:
        return b"\x01"


def chip_on(bench: Bench, **around: object) -> SeenChip:
    return SeenChip("bench", MHZ4, bench, **around)  # type: ignore[arg-type]


def played(bench: Bench) -> list[tuple[int, object]]:
    return [(each.at_ms, each.what) for each in bench.runs[-1].inputs]


def test_a_pin_is_looked_at_where_the_run_ended() -> None:
    """RB0 rises after 4.9 ms and falls after 5 ms."""
    for ms, level in ((4.8, 0), (4.9, 1), (4.95, 1), (5.0, 0)):
        bench = Bench(shown=[[(49, RB0, 1), (50, RB0, 0), (50, 12, 2)]])
        chip = chip_on(bench)
        chip.run_ms(ms)
        assert chip.pin("RB0") == level, ms
        assert chip.register("PORTB") == level
        assert chip.register("porta") == 0
        assert [run.seconds for run in bench.runs] == [pytest.approx(ms / 1000)]


def test_ports_are_their_pins() -> None:
    rows = [(1, pin, 1) for pin in (0, 4, 6, 12)]
    chip = chip_on(Bench(shown=[rows]))
    chip.run_ms(1)
    assert chip.register("PORTA") == 0b10001
    assert chip.register("PORTB") == 0b1000_0010


def test_without_a_run_one_of_a_millisecond_is_made_to_look() -> None:
    bench = Bench(shown=[[(1, RB0, 1)]])
    assert chip_on(bench).pin("RB0") == 1
    assert [run.seconds for run in bench.runs] == [0.001]


@pytest.mark.parametrize(
    ("run", "seconds", "ms"),
    [
        (lambda chip: chip.run_s(0.25), 0.25, 250),
        (lambda chip: chip.run_ms(2.5), 0.0025, 2.5),
        (lambda chip: chip.run_us(1500), 0.0015, 1.5),
        (lambda chip: chip.run_cycles(3000), 0.003, 3),
        (lambda chip: chip.run_us(10), 0.001, 0.01),  # no board plays less than a millisecond
    ],
)
def test_a_run_is_as_long_as_was_said(run: Callable[[SeenChip], None], seconds: float, ms: float) -> None:
    bench = Bench()
    chip = chip_on(bench)
    run(chip)
    assert chip.ms == pytest.approx(ms)
    chip.pieces()
    assert [each.seconds for each in bench.runs] == [pytest.approx(seconds)]
    assert (chip.ms, chip.us) == (pytest.approx(ms), pytest.approx(1000 * ms))
    assert chip.cycle == 1000 * ms


def test_an_edge_is_waited_for_as_long_as_was_said_and_an_input_may_be_late() -> None:
    """The run lasts 10 ms and the 3 ms by which a board may be late; an edge at its very end counts."""
    for at, level, what, found in (
        (130, 1, "RB0 rise", 13_000.0),
        (130, 1, "rb0", 13_000.0),
        (131, 1, "RB0 rise", None),
        (60, 1, "RB0 fall", None),
    ):
        bench = Bench(shown=[[(0, RB0, 0), (at, RB0, level)]])
        chip = chip_on(bench)
        if found is None:
            with pytest.raises(AssertionError, match=rf"{what}: not within 10 ms; the capture ends at 13 ms"):
                chip.run_until(what, within_ms=10)
        else:
            assert chip.run_until(what, within_ms=10) == found
            assert chip.pin("RB0") == level
        assert [run.seconds for run in bench.runs] == [0.013]


def test_the_next_edge_is_looked_for_in_the_same_capture_first() -> None:
    rows = [(10, RB0, 1), (20, RB0, 0), (30, RB0, 1), (40, RB0, 0)]
    bench = Bench(shown=[rows])
    chip = chip_on(bench)
    assert [chip.run_until("RB0 rise", within_ms=100) for _ in range(2)] == [1000, 3000]
    assert chip.run_until("RB0", within_ms=100) == 4000
    assert chip.pin("RB0") == 0
    assert len(bench.runs) == 1
    with pytest.raises(AssertionError, match="RB0: not within 90 ms"):
        chip.run_until("RB0", within_ms=90)  # up to 4 + 90 + 3 ms, which were captured
    with pytest.raises(AssertionError, match="RB0: not within 96 ms"):
        chip.run_until("RB0", within_ms=96)  # and up to the end of the capture
    assert len(bench.runs) == 1
    with pytest.raises(AssertionError, match="RB0: not within 100 ms"):
        chip.run_until("RB0", within_ms=100)
    assert len(bench.runs) == 2
    # A level that is the same again is not an edge.
    repeated = chip_on(Bench(shown=[[(10, RB0, 1), (20, RB0, 1)]]))
    assert repeated.run_until("RB0") == 1000
    with pytest.raises(AssertionError):
        repeated.run_until("RB0", within_ms=1)


def test_a_run_that_was_captured_already_is_not_made_again() -> None:
    bench = Bench(shown=[[(10, RB0, 1), (40, RB0, 0)]])
    chip = chip_on(bench)
    chip.run_until("RB0 rise", within_ms=7)  # 10 ms are captured, and 1 ms is over
    chip.run_ms(2.9)
    assert chip.pin("RB0") == 1
    chip.run_ms(0.1)
    assert chip.pin("RB0") == 0
    chip.run_ms(6)
    assert len(bench.runs) == 1
    chip.run_ms(0.1)
    chip.pieces()
    assert len(bench.runs) == 2


def test_levels_and_contacts_stay_for_later_runs() -> None:
    bench = Bench()
    chip = chip_on(bench, inputs={"ra0": 1})
    chip.run_ms(2)
    chip.drive("RB0", 1)
    chip.tie("RB0", "RB4")
    chip.run_ms(3)
    chip.drive("RB0", None)
    chip.run_ms(1)
    chip.pieces()
    contact = frozenset({"RB0", "RB4"})
    first = bench.runs[0]
    assert (first.levels, first.contacts, first.seconds) == ({"RA0": 1}, {}, 0.006)
    assert played(bench) == [(2, DrivePin("RB0", 1)), (2, Close(contact, True)), (5, DrivePin("RB0", None))]
    chip.untie("RB4", "RB0")
    chip.pieces()
    assert (bench.runs[1].levels, bench.runs[1].contacts) == ({"RA0": 1, "RB0": None}, {contact: True})
    assert (played(bench), bench.runs[1].seconds) == ([(0, Close(contact, False))], 0.001)


def test_a_button_is_pressed_for_its_time_and_bounces_as_on_the_simulated_chip() -> None:
    bench = Bench()
    chip = chip_on(bench)
    chip.press("RB0", hold_ms=60)
    chip.run_ms(100)
    chip.pieces()
    assert played(bench) == [(0, DrivePin("RB0", 0)), (60, DrivePin("RB0", 1))]
    chip.press("RB0", active=1)
    chip.run_ms(5)
    chip.release("RB0", active=1)
    chip.run_ms(1)
    chip.pieces()
    assert played(bench) == [(0, DrivePin("RB0", 1)), (5, DrivePin("RB0", 0))]
    chip.press("RB0", bounce_ms=8, bounces=3)
    chip.run_ms(20)
    chip.pieces()
    times, levels = zip(*((at, what.level) for at, what in played(bench)), strict=True)  # type: ignore[attr-defined]
    assert list(levels) == [0, 1, 0, 1, 0, 1, 0]
    assert list(times) == sorted(times)
    assert (times[0], times[-1] <= 8) == (0, True)


def test_bytes_are_sent_after_a_frame_of_idle_line_and_the_chip_runs_until_they_are_over() -> None:
    """At 2400 baud a frame is 4.17 ms: it begins after 5 ms, and two bytes last 9 ms."""
    bench = Bench()
    chip = chip_on(bench)
    chip.run_ms(7)
    chip.send("rb1", "AB", 2400)
    assert chip.ms == 7 + 5 + 9
    chip.pieces()
    assert played(bench) == [(12, Send("RB1", b"AB", 2400))]
    chip.send("RB1", b"\xff", 1000, baud_error_percent=2)
    chip.pieces()
    assert played(bench)[0][1] == Send("RB1", b"\xff", 1020)
    adapter = Bench(serial_pin="RB6")
    chip_on(adapter).send("RB6", b"A", 9600)


def test_a_reset_holds_mclr_low_and_the_first_run_begins_with_one() -> None:
    bench = Bench(wiring=input_wiring(["VDD=17"]))
    chip = chip_on(bench)
    chip.run_ms(3)
    chip.reset(hold_ms=1.2)
    assert chip.ms == 5
    chip.reset(hold_ms=0)
    assert chip.ms == 6
    chip.pieces()
    assert played(bench) == [
        (3, DrivePin("MCLR", 0)),
        (5, DrivePin("MCLR", 1)),
        (5, DrivePin("MCLR", 0)),
        (6, DrivePin("MCLR", 1)),
    ]
    chip.run_ms(1)
    chip.power_cycle()
    assert chip.ms == 0
    chip.run_ms(1)
    assert len(chip.pieces()) == 1
    assert [run.start for run in bench.runs] == [BenchStart.RESET, BenchStart.CONTINUE, BenchStart.POWER_UP]
    assert [run.repeatable for run in bench.runs] == [True, False, True]
    free = Bench(wiring=input_wiring(["MCLR=-"]))
    chip_on(free).pin("RB0")
    assert (free.runs[0].start, free.runs[0].repeatable) == (BenchStart.CONTINUE, False)


SKIPPED: list[tuple[Callable[[SeenChip], object], str]] = [
    (lambda chip: chip.reset(), "chip.reset; MCLR is not wired to an input board"),
    (lambda chip: chip.power_cycle(), "chip.power_cycle; the supply is not wired"),
    (lambda chip: chip.drive("RB0", 1), "chip.drive; nothing drives the chip's inputs here"),
    (lambda chip: chip.press("RB0"), "chip.press; nothing drives the chip's inputs here"),
    (lambda chip: chip.release("RB0"), "chip.release; nothing drives the chip's inputs here"),
    (lambda chip: chip.bounce("RB0", ms=1), "chip.bounce; nothing drives the chip's inputs here"),
    (lambda chip: chip.tie("RB0", "RB1"), "chip.switch; the input board has no contact RB0-RB1"),
    (lambda chip: chip.keypad(["RB0"], ["RB1"], "1"), "chip.switch; the input board has no contact RB0-RB1"),
    (lambda chip: chip.send("RB0", b"A", 9600), "chip.send; no serial line goes to RB0"),
    (lambda chip: chip.run_until("0x10"), "only edges of pins are seen on a bench"),
    (lambda chip: chip.register("TMR0"), "only PORTA and PORTB, the levels at the pins, are seen"),
    (lambda chip: chip.interrupts, "it is inside the chip, and on the bench only the pins are seen"),
]


@pytest.mark.parametrize(("use", "why"), SKIPPED)
def test_what_a_bench_cannot_do_skips_the_test_with_the_reason(
    use: Callable[[SeenChip], object], why: str
) -> None:
    with pytest.raises(Skipped) as skipped:
        use(chip_on(Bench(wiring=None)))
    assert str(skipped.value).startswith("needs the simulated chip: chip.")
    assert why in str(skipped.value)


def test_what_does_not_exist_is_an_error_and_not_skipped() -> None:
    chip = chip_on(Bench())
    for name in ("presss", "_inside", "_power_up"):
        with pytest.raises(AttributeError, match=f"a chip has no '{name}'"):
            getattr(chip, name)
    for use in (
        lambda: chip.pin("RC0"),
        lambda: chip.send("RC0", b"A", 9600),
        lambda: chip_on(Bench(wiring=None), inputs={"RC0": 1}),
    ):
        with pytest.raises(InputError, match="there is no pin 'RC0'"):
            use()
    with pytest.raises(Skipped, match="MCLR is not wired"):
        chip_on(Bench(wiring=input_wiring(["MCLR=-"]))).reset()
    with pytest.raises(Skipped, match="the supply is not wired"):
        chip.power_cycle()
    with pytest.raises(Skipped, match="RA0 is not wired"):
        chip_on(Bench(wiring=input_wiring(["RA0=-"]))).drive("RA0", 1)
    with pytest.raises(Skipped, match="serial lines idle high"):
        chip.send("RB1", b"A", 9600, inverted=True)


def test_a_report_shows_the_last_capture() -> None:
    chip = chip_on(Bench(shown=[[(5, RB0, 1)]]))
    assert chip.report() == ["nothing was captured"]
    chip.run_ms(1)
    chip.pieces()
    assert chip.report() == ["from 400 µs to 1000 µs, 100 µs per column", "RB0  ·▔▔▔▔▔"]
    for ms in (2, 3):
        chip.run_ms(ms)
        chip.pieces()
    assert chip.report() == ["no pin changed until 3000 µs"]


def test_a_stimulus_is_played_in_whole_milliseconds() -> None:
    """2.4 ms and 2.6 ms become 2 and 3; of a chip at 4 MHz a cycle is a microsecond."""
    stimuli = Stimuli((Levels(RB0, ((0, 1), (2400, 0), (2600, 2))),))
    assert stimulus_inputs(stimuli, MHZ4) == [
        BoardInput(0, DrivePin("RB0", 1)),
        BoardInput(2, DrivePin("RB0", 0)),
        BoardInput(3, DrivePin("RB0", None)),
    ]
    # Ten bits at 1000 baud are 10 ms, and 5000 cycles lie between two bytes.
    serial = Serial(6, b"AB", Fraction(1000), 1000, gap=5000)
    assert stimulus_inputs(Stimuli((serial,)), MHZ4) == [
        BoardInput(1, Send("RB1", b"A", 1000)),
        BoardInput(16, Send("RB1", b"B", 1000)),
    ]
    begun = chip_on(bench := Bench(), stimuli=Stimuli((Serial(6, b"A", Fraction(1000)),)))
    begun.pin("RB0")
    assert (played(bench), bench.runs[0].levels) == ([(0, Send("RB1", b"A", 1000))], {})
    two = Serial(6, b"AB", Fraction(1000), stop_bits=2)
    assert [each.at_ms for each in stimulus_inputs(Stimuli((two,)), MHZ4)] == [0, 11]
    fast = Serial(6, b"A", Fraction(1000), 1000, Fraction(2, 100))
    assert stimulus_inputs(Stimuli((fast,)), MHZ4)[0].what == Send("RB1", b"A", 1020)
    for source in (Serial(6, b"A", Fraction(1000), inverted=True), Periodic(6, 0, 10, 20)):
        with pytest.raises(Skipped, match="needs the simulated chip"):
            stimulus_inputs(Stimuli((source,)), MHZ4)


def test_the_stimulus_of_a_chip_is_there_from_the_beginning() -> None:
    bench = Bench()
    stimuli = Stimuli((Levels(RB0, ((0, 1), (2000, 0))),))
    chip = chip_on(bench, stimuli=stimuli)
    chip.run_ms(3)
    chip.pieces()
    assert bench.runs[0].levels == {"RB0": 1}
    assert played(bench) == [(2, DrivePin("RB0", 0))]
    with pytest.raises(Skipped, match="nothing drives the chip's inputs here"):
        chip_on(Bench(wiring=None), stimuli=stimuli)
    with pytest.raises(InputError, match="a level of RA0 is 0 or 1, not 2"):
        chip_on(Bench(), inputs={"RA0": 2})


def test_a_stimulus_that_the_bench_cannot_play_skips_the_test_with_what_is_missing() -> None:
    """MCLR needs an input board, of whatever wiring; bytes need a serial line to their pin."""
    reset = Stimuli((Levels(MCLR_PIN, ((0, 1), (2000, 0))),))
    with pytest.raises(Skipped, match=r"chip\.stimulus; nothing drives the chip's inputs here$"):
        chip_on(Bench(wiring=None), stimuli=reset)
    chip = chip_on(board := Bench(), stimuli=reset)
    chip.run_ms(3)
    chip.pieces()
    assert (2, DrivePin("MCLR", 0)) in played(board)
    sent = Stimuli((Serial(RB0 + 1, b"A", Fraction(1000)),))
    why = r"chip\.stimulus; no serial line goes to RB1: --servogen-input=RB1=TX1$"
    for without in (Bench(wiring=None), Bench(wiring=input_wiring(["RB2=TX1"])), Bench(None, "RB2")):
        with pytest.raises(Skipped, match=why):
            chip_on(without, stimuli=sent)
    for having in (Bench(wiring=input_wiring(["RB1=TX1"])), Bench(None, "RB1")):
        chip_on(having, stimuli=sent).pin("RB0")
        assert played(having)[-1] == (0, Send("RB1", b"A", 1000))


@pytest.mark.parametrize(
    ("run", "text"),
    [
        (lambda chip: chip.run_s(-1), "s = -1 is not between 0 and 3600"),
        (lambda chip: chip.run_ms(-1), "ms = -1 is not between 0 and 3.6e+06"),
        (lambda chip: chip.run_us(-1), "us = -1 is not between 0 and 3.6e+09"),
        (lambda chip: chip.run_until("RB0", within_ms=-1), "within_ms = -1 is not between 0 and 3.6e+06"),
        (lambda chip: chip.reset(hold_ms=-1), "hold_ms = -1 is not between 0 and 3.6e+06"),
        (lambda chip: chip.press("RB0", hold_ms=-1), "hold_ms = -1 is not between 0 and 3.6e+06"),
        (
            lambda chip: chip.press("RB0", hold_ms=5, bounce_ms=-1),
            "bounce_ms = -1 is not between 0 and 3.6e+06",
        ),
        (lambda chip: chip.press("RB0", bounces=1001), "bounces = 1001 is not between 0 and 1000"),
    ],
)
def test_a_time_that_no_chip_can_run_is_refused(run: Callable[[SeenChip], None], text: str) -> None:
    with pytest.raises(InputError) as error:
        run(chip_on(Bench()))
    assert error.value.message == text


def test_without_a_time_an_edge_comes_within_a_second_and_a_reset_takes_a_millisecond() -> None:
    bench = Bench()
    chip = chip_on(bench)
    chip.reset()
    assert chip.ms == 1
    chip.pieces()
    with pytest.raises(AssertionError, match="RB0: not within 1000 ms"):
        chip.run_until("RB0")
    assert [run.seconds for run in bench.runs] == [0.001, 1.003]


def test_a_disturbance_ends_at_the_level_that_the_pin_has() -> None:
    """The one that the board drives, or else the one that is seen: RB1 is high when it is looked at."""
    bench = Bench(shown=[[], [(1, 6, 1)]])
    chip = chip_on(bench, inputs={"RB0": 1, "RB2": 0})
    for pin, level in (("RB0", 1), ("rb2", 0), ("RB1", 1)):
        chip.bounce(pin, ms=10, bounces=1)
        chip.run_ms(20)
        chip.pieces()
        assert [what.level for _, what in played(bench)] == [level, 1 - level, level]  # type: ignore[attr-defined]
    assert [run.seconds for run in bench.runs] == 3 * [0.02]


def test_a_key_closes_its_contact_and_what_sends_is_no_longer_driven() -> None:
    bench = Bench()
    chip = chip_on(bench, inputs={"RB1": 1})
    keypad = chip.keypad(["RB0"], ["RB4"], "a")
    keypad.press("a")
    chip.run_ms(5)
    keypad.release("a")
    chip.send("RB1", b"A", 10_000)
    chip.run_ms(1)
    chip.pieces()
    contact = frozenset({"RB0", "RB4"})
    sent = Send("RB1", b"A", 10_000)
    assert played(bench) == [(0, Close(contact, True)), (5, Close(contact, False)), (6, sent)]
    assert bench.runs[0].levels == {"RB1": 1}
    chip.run_ms(1)
    chip.pieces()
    assert (bench.runs[1].levels, bench.runs[1].contacts) == ({}, {contact: False})


def test_the_eeprom_is_read_after_what_was_to_be_done_and_the_next_look_is_a_new_run() -> None:
    bench = Bench(shown=[[], [(1, RB0, 1)]])
    chip = chip_on(bench)
    chip.run_ms(5)
    assert chip.eeprom == b"\x01"
    assert [run.seconds for run in bench.runs] == [0.005]
    assert chip.pin("RB0") == 1
    assert len(bench.runs) == 2


def test_an_input_at_the_end_of_a_run_is_played_in_it_once() -> None:
    bench = Bench()
    chip = chip_on(bench)
    chip.press("RB0", hold_ms=60)
    for ms in (60, 10):
        chip.run_ms(ms)
        chip.pieces()
    assert [[each.at_ms for each in run.inputs] for run in bench.runs] == [[0, 60], []]


def test_what_is_still_to_come_needs_a_run_even_if_the_time_was_captured() -> None:
    """RB0 rises after 1 of the 10 ms that were captured, and an input follows after 40 ms more."""
    for at_us, runs in ((50_000, 2), (9_000, 1)):
        bench = Bench(shown=[[(10, RB0, 1)]])
        chip = chip_on(bench, stimuli=Stimuli((Levels(6, ((0, 1), (at_us, 0))),)))
        assert chip.run_until("RB0 rise", within_ms=7) == 1000
        chip.run_ms(2)
        chip.pin("RB0")
        assert len(bench.runs) == runs
    early = Bench()
    chip = chip_on(early, stimuli=Stimuli((Levels(6, ((0, 1), (1000, 0))),)))
    assert (list(chip.pieces()), early.runs) == ([], []), "nothing is due at 0 ms"


def test_a_run_from_a_start_may_be_repeated_unless_the_program_writes_its_eeprom() -> None:
    """DS35007, table 2-1: EECON2, which every write needs, is 0x89."""
    for word, repeatable in ((0x0089, False), (0x0088, True)):  # MOVWF 0x09, MOVWF 0x08
        bench = Bench()
        chip_on(bench, image=Image({0: word})).pin("RB0")
        assert (bench.runs[0].start, bench.runs[0].repeatable) == (BenchStart.RESET, repeatable)


def test_the_time_goes_on_within_a_capture() -> None:
    chip = chip_on(Bench(shown=[[(10, RB0, 1)]]))
    chip.run_until("RB0", within_ms=7)
    assert chip.ms == 10
    chip.run_ms(2)
    assert chip.ms == 12


def test_by_default_a_contact_bounces_five_times_if_it_does() -> None:
    for act in (
        lambda chip: chip.press("RB0", bounce_ms=100),
        lambda chip: chip.release("RB0", bounce_ms=100),
        lambda chip: chip.bounce("RB0", ms=100),
        lambda chip: chip.switch("RB0", "RB4", True, bounce_ms=100),
    ):
        bench = Bench()
        chip = chip_on(bench)
        act(chip)
        chip.run_ms(200)
        chip.pieces()
        assert len(bench.runs[-1].inputs) == 1 + 2 * 5


def recorded(source: str, capture: object = None) -> SeenPins:
    return SeenPins(trace([(10, RB0, 1)], 20), source, cast(Any, capture))


def run_of(start: BenchStart = BenchStart.CONTINUE) -> BenchRun:
    return BenchRun(MHZ4, 0.01, start=start)


def test_recordings_of_a_bench_are_shown_one_for_each_run() -> None:
    captures = [recorded(name, SimpleNamespace(missing=None)) for name in ("a", "b")]
    player = ReplayPlayer(captures)
    assert [player.play(run_of())[0].source for _ in captures] == ["a", "b"]
    with pytest.raises(InputError, match="there are 2 recordings, and the test has more runs") as error:
        player.play(run_of())
    assert error.value.code == "unreadable-file"
    again = ReplayPlayer(captures)
    assert again.play(run_of(BenchStart.POWER_UP))[0].source == "a"
    torn = ReplayPlayer([recorded("a.vcd", SimpleNamespace(missing="it stopped"))])
    with pytest.raises(InputError, match=r"a\.vcd is incomplete: it stopped") as incomplete:
        torn.play(run_of())
    assert incomplete.value.code == "capture-failed"
    assert (player.late_ms, player.serial_pin) == (50, None)


def test_a_recording_of_the_simulated_chip_shows_all_of_its_runs() -> None:
    player = ReplayPlayer([recorded("simulated")])
    assert [seen.source for seen in player.play(run_of())] == ["simulated"]
    assert list(player.play(run_of())) == []
    with pytest.raises(Skipped, match="only what followed the last power-up is recorded"):
        player.play(run_of(BenchStart.POWER_UP))
    with pytest.raises(Skipped, match="a recording shows only the pins"):
        player.eeprom()
    chip = chip_on(cast(Bench, ReplayPlayer([recorded("simulated")])))
    chip.drive("RA3", 1)
    chip.tie("RA0", "RB7")
    chip.send("RB6", b"A", 9600)
    chip.reset()
    chip.power_cycle()


@pytest.mark.parametrize(
    "ask",
    [
        lambda chip: chip.rising("RB7"),
        lambda chip: chip.widths("RB7"),
        lambda chip: chip.uart("RB7", 9600),
        lambda chip: chip.pin("RB7"),
        lambda chip: chip.register("PORTB"),
        lambda chip: chip.run_until("RB7 rise", within_ms=1),
    ],
)
def test_a_pin_that_no_channel_saw_is_an_error_and_not_low(ask: Callable[[SeenChip], Any]) -> None:
    player = cast(Bench, ReplayPlayer([recorded("cap.vcd", SimpleNamespace(missing=None))]))
    chip = chip_on(player)
    chip.run_ms(1)
    with pytest.raises(InputError, match=r"RB[17] is not among the pins of cap\.vcd") as error:
        ask(chip)
    assert error.value.code == "bad-wiring"
    simulated = chip_on(cast(Bench, ReplayPlayer([recorded("simulated")])))
    assert simulated.rising("RB7") == [], "the simulated chip's pins are all seen"


def test_an_analysers_capture_has_no_edges_to_ask_for_of_a_pin_that_it_did_not_see(tmp_path: Path) -> None:
    path = tmp_path / "cap.vcd"
    with capture_writer(path, 1_000_000) as writer:
        writer.add(chunk([(0, RB0, 0), (10, RB0, 1)]))
        writer.finish(Cycles(20))
    seen = PinCapture(captured(path, "the capture"), MHZ4, [])
    assert seen.rising("RB0") == [10]
    with pytest.raises(InputError, match="RB7 is not among the pins of the capture"):
        seen.rising("RB7")


@dataclass
class Adapted:
    """A bench as its players see it."""

    inputs: Any = None
    programmer: Any = None
    board: Any = None
    runs: list[BenchRun] = field(default_factory=list)

    def adapter(self) -> Any:
        return self.board

    def play(self, segment: BenchRun) -> SeenPins:
        self.runs.append(segment)
        return recorded("bench")

    def eeprom(self) -> bytes:
        return b"\x42"


def test_a_bench_plays_with_the_wiring_that_it_has() -> None:
    def player(**given: Any) -> BenchPlayer:
        return BenchPlayer(cast(Any, Adapted(**given)))

    bare = player()
    assert (bare.wiring, bare.serial_pin, bare.late_ms) == (None, None, 0)
    with pytest.raises(Skipped, match="no programmer reads it"):
        bare.eeprom()
    wiring = input_wiring()
    board = SimpleNamespace(wiring=wiring, serial_pin="RB6", serial=Path("/dev/ttyS9"))
    wired = player(
        inputs=board, programmer="picpro", board=SimpleNamespace(board=SimpleNamespace(scheduler=True))
    )
    assert (wired.wiring, wired.serial_pin, wired.late_ms) == (wiring, "RB6", 3)
    assert wired.eeprom() == b"\x42"
    silent = player(
        inputs=SimpleNamespace(wiring=wiring, serial_pin="RB6", serial=None),
        board=SimpleNamespace(board=SimpleNamespace(scheduler=False)),
    )
    assert (silent.serial_pin, silent.late_ms) == (None, 50)
    assert [seen.source for seen in wired.play(run_of())] == ["bench"]


def test_constant_pins_are_named_together_below_the_waves() -> None:
    levels = [(0, 0, 1), (0, 1, 1), (0, 2, 0), (0, 3, 2), (2, RB0, 1), (3, RB0, 0)]
    assert wave_lines(chunk(levels), 8, MHZ4)[1:] == [
        "RB0  ··▔▁▁▁▁▁",
        "high throughout: RA0, RA1",
        "low throughout: RA2",
        "not driven: RA3",
    ]
    # A pin with several edges in its only column is not constant.
    busy = wave_lines(chunk([(0, RB0, 1), (0, 6, 1), (0, RB0, 0)]), 1, MHZ4)
    assert busy == ["from 0 µs to 1 µs, 1 µs per column", "RB0  ▒", "high throughout: RB1"]


def test_nothing_is_measured_across_the_seam_of_a_recording_of_several_captures(tmp_path: Path) -> None:
    """The time between two is not known, and what the pin did there neither."""
    path = tmp_path / "stitched.vcd"
    first = ([0, 100, 200, 1100, 1200, 1500], [0, 1, 0, 1, 0, 2])
    second = ([2000, 2100, 2250, 3100, 3200], [1, 0, 1, 0, 1])
    with capture_writer(path, 1_000_000, pieces=((0, 1500), (2000, 3500))) as writer:
        for cycles, levels in (first, second):
            writer.add(chunk([(cycle, RB0, level) for cycle, level in zip(cycles, levels, strict=True)]))
        writer.finish(Cycles(3500))
    seen = PinCapture(captured(path, "the capture"), MHZ4, [])
    assert seen.periods_us("RB0") == [1000, 950]
    assert seen.widths_us("RB0") == [100, 100, 850]
    assert seen.rising_us("RB0") == [100, 1100, 250, 1200], "from the beginning of each"
