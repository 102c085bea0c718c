"""What drives the pins from outside, from Python and from files."""

from __future__ import annotations

from fractions import Fraction
from itertools import islice

import pytest

from servogen.edges import HIGH, LOW, PINS, UNDRIVEN
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
    simulate,
)
from servogen.simulator.layout import NEVER
from servogen.simulator.sources import SignalSource
from servogen.units import Clock
from tests.simulator.helpers import CLOCK, image, ram

RB0, RB1, RA4 = PINS.index("RB0"), PINS.index("RB1"), PINS.index("RA4")


def changes(source: SignalSource, count: int = 1000) -> list[tuple[int, int, int]]:
    return [tuple(change) for change in islice(source.changes(CLOCK), count)]


def test_levels_come_as_given() -> None:
    assert changes(Levels(RB0, ((5, HIGH), (9, UNDRIVEN)))) == [(5, RB0, HIGH), (9, RB0, UNDRIVEN)]


def test_a_periodic_signal_never_drifts() -> None:
    signal = Periodic(RA4, Fraction(10, 3), Fraction(5, 3), Fraction(0))
    rises = [cycle for cycle, _, level in changes(signal, 6000) if level == HIGH]
    assert rises[3] == 10
    assert rises[2997] == 9990
    assert changes(Periodic(RA4, Fraction(10), Fraction(4), Fraction(2), times=1)) == [
        (0, RA4, LOW),
        (2, RA4, HIGH),
        (6, RA4, LOW),
    ]


def test_a_button_bounces_within_its_time_and_comes_to_rest() -> None:
    button = BouncingButton(RB1, pressed=10_000, released=60_000, bounces=4, bounce=3000)
    found = changes(button)
    assert found[0] == (0, RB1, HIGH)
    presses = [change for change in found if 10_000 <= change[0] < 60_000]
    assert len(presses) == 1 + 2 * 4
    assert presses[0][2] == presses[-1][2] == LOW
    assert all(cycle <= 13_000 for cycle, _, _ in presses)
    assert [level for _, _, level in presses] == [LOW, HIGH] * 4 + [LOW]
    assert found[-1][2] == HIGH
    assert found == changes(button)
    assert [cycle for cycle, _, _ in found] == sorted(cycle for cycle, _, _ in found)


def test_serial_bytes_are_a_start_bit_eight_data_bits_lowest_first_and_a_stop_bit() -> None:
    sent = Serial(RB0, b"\x55", Fraction(10_000), start=1000)  # 100 cycles a bit
    assert changes(sent) == [(0, RB0, HIGH), *((1000 + 100 * n, RB0, n % 2) for n in range(10))]
    inverted = Serial(RB0, b"\x55", Fraction(10_000), start=1000, inverted=True)
    assert [level for _, _, level in changes(inverted)] == [LOW, *((n + 1) % 2 for n in range(10))]
    fast = Serial(RB0, b"\x55", Fraction(10_000), start=0, baud_error=Fraction(1, 100))
    assert changes(fast)[-1][0] == round(900 / 1.01)


RECEIVER = """
        org     0               ; 9600 baud at 4 MHz: 104 cycles a bit
        clrf    0x20
start   btfsc   PORTB, 0
        goto    start
        movlw   49              ; to the middle of the first data bit
        movwf   0x21
first   decfsz  0x21, f
        goto    first
        movlw   8
        movwf   0x22
bit     bcf     STATUS, C
        btfsc   PORTB, 0
        bsf     STATUS, C
        rrf     0x20, f
        movlw   31
        movwf   0x21
next    decfsz  0x21, f
        goto    next
        nop
        nop
        decfsz  0x22, f
        goto    bit
        goto    $
"""


@pytest.mark.parametrize("error", [Fraction(0), Fraction(3, 100), Fraction(-3, 100)])
def test_a_program_receives_serial_bytes_with_some_baud_error(error: Fraction) -> None:
    sent = Serial(RB0, b"K", Fraction(9600), start=500, baud_error=error)
    chip = Machine(image(RECEIVER), CLOCK, stimulus=Stimuli([sent]))
    chip.run(3000)
    assert ram(chip, 0x20) == ord("K")


def test_sources_are_merged_in_order_and_in_pieces_without_an_end() -> None:
    both = Stimuli([Periodic(RA4, Fraction(7), Fraction(3)), Periodic(RB0, Fraction(5), Fraction(2))])
    pieces = list(islice(both.changes(CLOCK), 3))
    cycles = [int(packed) >> 8 for _, piece in pieces for packed in piece]
    assert cycles == sorted(cycles)
    for until, piece in pieces:
        assert int(piece[-1]) >> 8 < until


def test_an_endless_signal_is_counted_by_tmr0() -> None:
    source = " bsf STATUS, RP0\n movlw 0xEF\n movwf OPTION_REG\n bcf STATUS, RP0\n goto $\n"
    signal = Periodic(RA4, Fraction(10), Fraction(5))
    chip = Machine(image(source), CLOCK, stimulus=Stimuli([signal]))
    chip.run(1_000_000)
    assert chip.state().registers["TMR0"] == 100_000 % 256 - 1  # the first edge is before OPTION is written


def test_a_recording_plays_again_as_it_was() -> None:
    both = Stimuli(
        [BouncingButton(RB0, 1000, 5000), Periodic(RA4, Fraction(70), Fraction(30)), Reset(2000, 2100)]
    )
    recording = record(both, CLOCK, 50_000)
    assert list(recording) == sorted(recording, key=lambda change: change.cycle)
    source = image(" clrf 0x20\nl movf PORTB, w\n addwf 0x20, f\n movf PORTA, w\n addwf 0x20, f\n goto l\n")
    live = simulate(source, CLOCK, 50_000, stimulus=both).state
    again = simulate(source, CLOCK, 50_000, stimulus=Stimuli([Recorded(recording)])).state
    assert live == again


def test_one_chips_pins_can_drive_anothers() -> None:
    sender = " clrf PORTB\n bsf STATUS, RP0\n clrf TRISB\n bcf STATUS, RP0\n"
    sender += "l bsf PORTB, 3\n bcf PORTB, 3\n goto l\n"
    trace = simulate(image(sender), CLOCK, 1000).edges
    receiver = image(" bsf STATUS, RP0\n movlw 0xEF\n movwf OPTION_REG\n bcf STATUS, RP0\n goto $\n")
    wired = Stimuli([Wired(trace, {PINS.index("RB3"): RA4})])
    state = simulate(receiver, CLOCK, 1000, stimulus=wired).state
    assert state.registers["TMR0"] in ((1000 - 4) // 4 - 1, (1000 - 4) // 4)


def test_changes_that_go_back_in_time_are_refused() -> None:
    with pytest.raises(InputError, match="cycles may not fall"):
        Machine(
            image(" goto $\n"),
            CLOCK,
            stimulus=Stimuli([Recorded([LevelChange(9, 0, 1), LevelChange(3, 0, 0)])]),
        ).run(10)


FILE = """
[[level]]
pin = "RB7"
at_us = [0, 500, 900]
level = [1, 0, "free"]

[[periodic]]
pin = "RA4"
period_us = 100
high_us = 50.5
from_us = 10
times = 2

[[button]]
pin = "RB1"
pressed_us = 1000
released_us = 9000
bounces = 0

[[serial]]
pin = "RB2"
baud = 9600
text = "go"
baud_error_percent = 1.5

[[reset]]
pressed_us = 40
released_us = 50
"""


def test_a_file_says_the_same_in_microseconds() -> None:
    at_8_mhz = parse_stimuli(FILE, "stimulus.toml", Clock(8_000_000))
    level, periodic, button, serial, reset = at_8_mhz.sources
    assert level == Levels(PINS.index("RB7"), ((0, HIGH), (1000, LOW), (1800, UNDRIVEN)))
    assert periodic == Periodic(RA4, Fraction(200), Fraction(101), Fraction(20), 2)
    assert button == BouncingButton(RB1, 2000, 18_000, 0, 10_000)
    assert serial == Serial(PINS.index("RB2"), b"go", Fraction(9600), 0, Fraction(15, 1000))
    assert reset == Reset(80, 100)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[[level]]\npin = "RC0"\nat_us = [0]\nlevel = [1]\n', "no pin 'RC0'"),
        ('[[level]]\npin = "RB0"\nat_us = [0, 1]\nlevel = [1]\n', "1 values for the 2 times"),
        ('[[level]]\npin = "RB0"\nat_us = [5, 1]\nlevel = [1, 0]\n', "1 is before 5"),
        ('[[periodic]]\npin = "RB0"\nperiod_us = 5\nhigh_us = 9\n', "not shorter than period_us"),
        ('[[button]]\npin = "RB0"\npressed_us = 9\nreleased_us = 5\n', "not after pressed_us"),
        ('[[serial]]\npin = "RB0"\nbaud = 9600\n', "either text or data"),
        ('[[serial]]\npin = "RB0"\nbaud = 9600\ntext = "a"\ndata = [1]\n', "either text or data"),
        ('[[button]]\npin = "RB0"\npressed = 9\nreleased_us = 5\n', "has no unit"),
        ("[[resett]]\n", "did you mean 'reset'"),
        ("[[level]\n", "TOML syntax"),
    ],
)
def test_mistakes_in_a_file_are_told_with_their_place(text: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        parse_stimuli(text, "stimulus.toml", CLOCK)
    assert caught.value.location is not None
    assert caught.value.location.file == "stimulus.toml"
    assert caught.value.location.line is not None


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('[[periodic]]\npin="RB0"\nperiod_us=1e-9\nhigh_us=1e-10', "shorter than an instruction cycle"),
        ('[[serial]]\npin="RB0"\nbaud=1e300\ntext="x"', "less than or|at most"),
        ('[[serial]]\npin="RB0"\nbaud=1_000_001\ntext="x"', "more than one bit per instruction cycle"),
        ('[[button]]\npin="RB0"\npressed_us=0\nreleased_us=9\nbounces=1001', "at most 1000"),
        ('[[level]]\npin="RB0"\nat_us=[1e16]\nlevel=[1]', "at most 1e\\+15"),
    ],
)
def test_a_stimulus_that_would_take_for_ever_is_refused(text: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        parse_stimuli(text, "s.toml", Clock(4_000_000))


def test_changes_beyond_all_simulations_are_never_made() -> None:
    text = '[[periodic]]\npin="RB0"\nperiod_us=1e15\nhigh_us=1\n[[level]]\npin="RB1"\nat_us=[1e15]\nlevel=[1]'
    pieces = list(parse_stimuli(text, "s.toml", Clock(4_000_000)).changes(Clock(4_000_000)))
    assert pieces[-1][0] == NEVER
    assert all(change >= 0 for _, piece in pieces for change in piece.tolist())
