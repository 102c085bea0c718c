"""Sources of changes at their limits: rounding, bounces, bits, gaps; and what a file may say."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest

from servogen.edges import HIGH, LOW, PINS, UNDRIVEN, EdgeTrace, edge_chunk
from servogen.errors import InputError
from servogen.simulator import (
    BouncingButton,
    LevelChange,
    Levels,
    Machine,
    Periodic,
    Recorded,
    Reset,
    Serial,
    Stimuli,
    Wired,
    parse_stimuli,
    record,
)
from servogen.simulator.layout import NEVER
from servogen.simulator.sources import SignalSource, pin_number, whole
from servogen.simulator.stimulus import PIECE, file_inputs
from servogen.units import Clock, Cycles
from tests.simulator.helpers import CLOCK, image

RB0, MCLR = PINS.index("RB0"), 13


def changes(source: SignalSource) -> list[tuple[int, int, int]]:
    return [tuple(change) for change in source.changes(CLOCK)]


@pytest.mark.parametrize(
    ("cycles", "nearest"),
    [(Fraction(7, 2), 4), (Fraction(349, 100), 3), (Fraction(5, 2), 3), (Fraction(0), 0), (Fraction(1, 3), 0),
     (Fraction(2, 3), 1), (Fraction(12), 12)],
)  # fmt: skip
def test_a_moment_is_rounded_to_the_nearest_cycle_and_a_half_up(cycles: Fraction, nearest: int) -> None:
    assert whole(cycles) == nearest


def test_pins_are_found_by_name_in_any_case() -> None:
    assert [pin_number(name) for name in ("RA0", "ra4", "RB0", "rb7", "MCLR", "mclr")] == [
        0, 4, 5, 12, 13, 13,
    ]  # fmt: skip
    with pytest.raises(InputError, match="there is no pin 'RB8'") as refused:
        pin_number("RB8")
    assert refused.value.code == "unknown-pin"
    assert refused.value.hint is not None


def test_a_change_travels_as_cycle_pin_and_level() -> None:
    """Cycle << 8 | pin << 2 | level: `Stimulus.changes`."""
    assert LevelChange(3, 13, 2).packed == 3 << 8 | 13 << 2 | 2
    assert LevelChange(0, 0, 1).packed == 1


def test_a_periodic_signal_is_low_before_it_begins() -> None:
    signal = Periodic(RB0, Fraction(10), Fraction(4), Fraction(3), times=2)
    assert changes(signal) == [(0, RB0, 0), (3, RB0, 1), (7, RB0, 0), (13, RB0, 1), (17, RB0, 0)]
    assert changes(Periodic(RB0, Fraction(10), Fraction(4), times=1)) == [(0, RB0, 1), (4, RB0, 0)]
    halves = Periodic(RB0, Fraction(5, 2), Fraction(1), Fraction(1, 2), times=3)
    assert [cycle for cycle, _, _ in changes(halves)] == [0, 1, 2, 3, 4, 6, 7]


@pytest.mark.parametrize("active", [LOW, HIGH])
def test_a_button_rests_bounces_and_comes_to_rest_at_both_ends(active: int) -> None:
    other = 1 - active
    for seed in range(30):
        button = BouncingButton(RB0, 100, 300, bounces=3, bounce=20, seed=seed, active=active)
        found = changes(button)
        assert found[0] == (0, RB0, other)
        assert found[1] == (100, RB0, active)
        assert found[8] == (300, RB0, other)
        assert len(found) == 2 + 6 + 1 + 6
        for level, part in ((active, found[1:8]), (other, found[8:])):
            assert [each[2] for each in part] == [level, 1 - level] * 3 + [level]
            first = part[0][0]
            assert all(0 < each[0] - first <= 20 for each in part[1:])
        assert all(one[0] < next_[0] for one, next_ in pairwise(found))
    offsets = {each[0] - 100 for seed in range(60) for each in
               changes(BouncingButton(RB0, 100, 300, bounces=3, bounce=20, seed=seed))[2:8]}  # fmt: skip
    assert offsets == set(range(1, 21))


def test_a_short_press_bounces_within_itself() -> None:
    """There is an even number of flips, in what cycles there are before the release."""
    for length in range(1, 12):
        found = changes(BouncingButton(RB0, 50, 50 + length, bounces=5, bounce=5000))
        press = [each for each in found if 50 <= each[0] < 50 + length]
        assert len(press) == 1 + (length - 1) // 2 * 2
        assert press[-1][2] == LOW
    # docs/simulator.md has these numbers: 5 bounces within 5000 µs at each end
    assert len(changes(BouncingButton(RB0, 10_000, 90_000))) == 1 + 2 * (1 + 2 * 5)
    assert changes(BouncingButton(RB0, 0, 9, bounces=0)) == [(0, RB0, LOW), (9, RB0, HIGH)]
    assert len(changes(BouncingButton(RB0, 0, 9, bounces=2, bounce=1))) == 2  # no room for two flips


def test_a_serial_line_with_two_stop_bits_and_a_gap() -> None:
    """100 cycles a bit: two bytes of 11 bits, and 30 cycles between them; FFh has one low bit, the start."""
    sent = Serial(RB0, b"\xff\x00", Fraction(10_000), start=50, stop_bits=2, gap=30)
    begin = 50 + 1100 + 30
    assert changes(sent) == [(0, RB0, 1), (50, RB0, 0), (150, RB0, 1), (begin, RB0, 0), (begin + 900, RB0, 1)]
    assert changes(Serial(RB0, b"", Fraction(10_000), inverted=True)) == [(0, RB0, 0)]
    slow = Serial(RB0, b"\x00", Fraction(10_000), baud_error=Fraction(-1, 11))
    assert changes(slow)[-1] == (990, RB0, 1)


def test_a_reset_is_low_from_its_press_to_its_release() -> None:
    assert changes(Reset(40, 50)) == [(40, MCLR, LOW), (50, MCLR, HIGH)]


# Stimuli --------------------------------------------------------------------------------------------------


def test_changes_come_in_pieces_that_do_not_divide_a_cycle() -> None:
    rows = (
        [(n, 0) for n in range(PIECE - 1)] + [(PIECE - 1, level) for level in (1, 0, 2, 1)] + [(PIECE + 5, 0)]
    )
    pieces = list(Stimuli([Levels(RB0, rows)]).changes(CLOCK))
    assert [len(piece) for _, piece in pieces] == [PIECE + 3, 1]
    assert [until for until, _ in pieces] == [PIECE + 5, NEVER]
    assert pieces[1][1].tolist() == [(PIECE + 5) << 8 | RB0 << 2]
    assert list(Stimuli([]).changes(CLOCK)) == []
    (one,) = Stimuli([Levels(RB0, rows[:PIECE])]).changes(CLOCK)
    assert (one[0], len(one[1])) == (NEVER, PIECE)


def test_changes_in_one_cycle_are_in_the_order_of_the_sources() -> None:
    both = Stimuli([Levels(7, [(3, 1), (5, 1)]), Levels(6, [(3, 0), (4, 2)])])
    assert [tuple(each) for each in both.all_changes(CLOCK)] == [(3, 7, 1), (3, 6, 0), (4, 6, 2), (5, 7, 1)]
    assert [each.cycle for each in record(both, CLOCK, 5)] == [3, 3, 4]
    assert [each.cycle for each in record(both, CLOCK, 6)] == [3, 3, 4, 5]


@pytest.mark.parametrize(
    ("change", "said"),
    [((5, 14, 0), "stimulus of 14 in cycle 5, level 0"), ((5, -1, 0), "stimulus of -1 in cycle 5"),
     ((5, 13, 3), "stimulus of MCLR in cycle 5, level 3"),
     ((5, 0, -1), "stimulus of RA0 in cycle 5, level -1"),
     ((-1, 0, 0), "stimulus of RA0 in cycle -1")],
)  # fmt: skip
def test_a_change_that_is_none_is_refused(change: tuple[int, int, int], said: str) -> None:
    with pytest.raises(InputError, match=said):
        list(Stimuli([Recorded([LevelChange(*change)])]).changes(CLOCK))
    for good in ((0, 0, 0), (5, 13, 2)):
        assert len(list(Stimuli([Recorded([LevelChange(*good)])]).changes(CLOCK))) == 1


def test_the_inputs_of_an_edge_file_are_the_changes_of_the_stimuli() -> None:
    sources = [Levels(9, [(4, 2), (70, 1)]), Reset(30, 40), Periodic(4, Fraction(9), Fraction(3), times=1)]
    inputs = file_inputs(Stimuli(sources), CLOCK)
    assert inputs.pins == (4, 9, 13)
    columns = [np.concatenate(column).tolist() for column in zip(*inputs.chunks, strict=True)]
    rows = list(zip(*columns, strict=True))
    assert rows == [(0, 4, 1), (3, 4, 0), (4, 9, 2), (30, 13, 0), (40, 13, 1), (70, 9, 1)]
    assert file_inputs(None, CLOCK).pins == ()
    unknown = file_inputs(Stimuli([Recorded([LevelChange(1, 2, 1)])]), CLOCK)
    assert unknown.pins == tuple(range(14))  # a recording does not say which it has


def test_wired_pins_follow_the_other_chips() -> None:
    chunk = edge_chunk([1, 2, 2, 9], [5, 6, 7, 5], [1, 0, 1, UNDRIVEN])
    wired = Wired(EdgeTrace(CLOCK, (chunk,), Cycles(10)), {5: 4, 7: 12})
    assert changes(wired) == [(1, 4, 1), (2, 12, 1), (9, 4, 2)]


# Files ----------------------------------------------------------------------------------------------------


def source(text: str, clock: Clock = CLOCK) -> SignalSource:
    (found,) = parse_stimuli(text, "s.toml", clock).sources
    return found


def test_what_a_table_leaves_out() -> None:
    assert source('[[periodic]]\npin="RB0"\nperiod_us=10\nhigh_us=4') == Periodic(
        RB0, Fraction(10), Fraction(4), Fraction(0), None
    )
    assert source('[[button]]\npin="RB0"\npressed_us=10\nreleased_us=40') == BouncingButton(
        RB0, 10, 40, bounces=5, bounce=5000, seed=1, active=LOW
    )
    assert source('[[serial]]\npin="RB0"\nbaud=9600\ndata=[0, 255]') == Serial(
        RB0, b"\x00\xff", Fraction(9600), start=0, baud_error=Fraction(0), inverted=False, stop_bits=1, gap=0
    )


def test_what_a_table_says() -> None:
    text = '[[button]]\npin="RB0"\npressed_us=10\nreleased_us=40\nbounces=2\nbounce_us=7\n'
    assert source(text + "seed=9\npressed_level=1") == BouncingButton(
        RB0, 10, 40, bounces=2, bounce=7, seed=9, active=HIGH
    )
    text = '[[serial]]\npin="RB0"\nbaud=300.5\ntext="µ"\nfrom_us=7\nbaud_error_percent=-2.5\ninverted=true\n'
    assert source(text + "stop_bits=2\ngap_us=11") == Serial(
        RB0, "µ".encode(), Fraction(601, 2), 7, Fraction(-25, 1000), True, 2, 11
    )


@pytest.mark.parametrize(
    ("good", "bad"),
    [
        ("period_us=10\nhigh_us=9.9", "period_us=10\nhigh_us=10"),
        ("period_us=1\nhigh_us=0.5", "period_us=0.99\nhigh_us=0.5"),
        ("period_us=10\nhigh_us=4\ntimes=1", "period_us=10\nhigh_us=4\ntimes=0"),
        ("period_us=10\nhigh_us=4\nfrom_us=0", "period_us=10\nhigh_us=4\nfrom_us=-1"),
        ("period_us=1e15\nhigh_us=4", "period_us=1.1e15\nhigh_us=4"),
        ("period_us=10\nhigh_us=0.1", "period_us=10\nhigh_us=0"),
    ],
)
def test_a_periodic_signal_within_and_beyond_its_limits(good: str, bad: str) -> None:
    source(f'[[periodic]]\npin="RB0"\n{good}')
    with pytest.raises(InputError):
        source(f'[[periodic]]\npin="RB0"\n{bad}')


@pytest.mark.parametrize(
    ("table", "good", "bad"),
    [
        ("button", "pressed_us=0\nreleased_us=1", "pressed_us=1\nreleased_us=1"),
        ("button", "pressed_us=0\nreleased_us=1\nbounces=1000", "pressed_us=0\nreleased_us=1\nbounces=1001"),
        ("button", "pressed_us=0\nreleased_us=1\nbounces=0", "pressed_us=0\nreleased_us=1\nbounces=-1"),
        (
            "button",
            "pressed_us=0\nreleased_us=1\npressed_level=1",
            "pressed_us=0\nreleased_us=1\npressed_level=2",
        ),
        ("serial", 'baud=1000000\ntext=""', 'baud=1000000.5\ntext=""'),
        ("serial", "baud=1\ndata=[255]", "baud=1\ndata=[256]"),
        ("serial", "baud=1\ndata=[0]", "baud=1\ndata=[-1]"),
        ("serial", 'baud=1\ntext=""\nstop_bits=2', 'baud=1\ntext=""\nstop_bits=3'),
        ("serial", 'baud=1\ntext=""\nstop_bits=1', 'baud=1\ntext=""\nstop_bits=0'),
        ("serial", 'baud=1\ntext=""\nbaud_error_percent=49.9', 'baud=1\ntext=""\nbaud_error_percent=50'),
        ("serial", 'baud=1\ntext=""\nbaud_error_percent=-49.9', 'baud=1\ntext=""\nbaud_error_percent=-50'),
        ("serial", 'baud=1\ntext=""\ngap_us=0', 'baud=1\ntext=""\ngap_us=-1'),
        ("level", "at_us=[5, 5]\nlevel=[1, 0]", "at_us=[5, 4]\nlevel=[1, 0]"),
        ("level", "at_us=[5]\nlevel=[1]", "at_us=[5]\nlevel=[2]"),
        ("level", "at_us=[]\nlevel=[]", "at_us=[]\nlevel=[1]"),
    ],
)
def test_other_tables_within_and_beyond_their_limits(table: str, good: str, bad: str) -> None:
    source(f'[[{table}]]\npin="RB0"\n{good}')
    with pytest.raises(InputError) as refused:
        source(f'[[{table}]]\npin="RB0"\n{bad}')
    assert refused.value.location is not None
    assert refused.value.location.line is not None


def test_a_machine_takes_its_changes_in_their_cycles() -> None:
    """The level of RB0 as the program reads it, one instruction per cycle."""
    levels = Levels(RB0, [(3, 1), (4, 0), (7, 1)])
    chip = Machine(image(" movf PORTB, w\n" * 12), CLOCK, stimulus=Stimuli([levels]))
    read = []
    for _ in range(10):
        chip.step()
        read.append(chip.state().w & 1)
    assert read == [0, 0, 0, 1, 0, 0, 0, 1, 1, 1]
