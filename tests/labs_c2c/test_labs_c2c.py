"""Programs as a lab wrote them for C2C: each does on its pins what it says."""

from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import pytest

from servogen.edges import HIGH, LOW
from servogen.simulator.sources import BouncingButton, LevelChange, Levels, Reset, Serial
from servogen.units import Clock
from tests.campaigns import sampled
from tests.lab_bench import (
    MS,
    PORT_A,
    PORT_B,
    SECOND,
    SEGMENTS,
    US,
    Display,
    Keypad,
    Pins,
    pressed,
    run,
    serial_bytes,
)

HERE = Path(__file__).parent


def lab(name: str, cycles: int, *outside: object) -> Pins:
    return run(HERE / name, "c2c", cycles, *outside)  # type: ignore[arg-type]


def steps(found: list[tuple[int, int]]) -> list[int]:
    """The times between changes."""
    return [later - earlier for (earlier, _), (later, _) in pairwise(found)]


def test_one_light_runs_to_the_left_and_back() -> None:
    shown = lab("chaser.c", 3 * SECOND).numbers(PORT_B)
    if shown[0][1] == 0:
        shown = shown[1:]
    way = [1 << bit for bit in (*range(8), *range(6, 0, -1))]
    assert [value for _, value in shown[:28]] == way * 2
    assert all(100 * MS <= step < 101 * MS for step in steps(shown))


def test_the_digit_counts_from_0_to_9_and_again() -> None:
    shown = lab("seven_segment.c", 6 * SECOND).numbers(PORT_B)
    digits = [SEGMENTS[value] for _, value in shown if value]
    assert digits[:23] == [*range(10), *range(10), 0, 1, 2]
    assert all(250 * MS <= step < 251 * MS for step in steps(shown[1:]))


def test_each_press_toggles_the_light_once_however_it_bounces() -> None:
    presses = [(100, 300), (500, 620), (900, 1400), (1600, 1800), (2000, 2200)]
    buttons = [
        BouncingButton(pressed("RA0"), down * MS, up * MS, bounces=7, bounce=8 * MS, seed=n)
        for n, (down, up) in enumerate(presses)
    ]
    light = lab("button.c", int(2.5 * SECOND), Together(buttons)).edges("RB0")
    assert [level for _, level in light] == [LOW, HIGH, LOW, HIGH, LOW, HIGH]
    for (cycle, _), (down, _) in zip(light[1:], presses, strict=True):
        assert 20 * MS <= cycle - down * MS < 35 * MS


def test_a_glitch_is_no_press() -> None:
    glitch = Levels(pressed("RA0"), [(0, 1), (50 * MS, 0), (55 * MS, 1)])
    assert lab("button.c", 200 * MS, glitch).edges("RB0") == lab(
        "button.c", 200 * MS, Levels(pressed("RA0"), [(0, 1)])
    ).edges("RB0")


def test_falling_edges_of_rb0_are_counted_by_the_interrupt() -> None:
    falls = [10 * MS + n * 700 * US for n in range(21)]
    line = Levels(
        pressed("RB0"), [(0, 1), *((c, v) for fall in falls for c, v in ((fall, 0), (fall + 300, 1)))]
    )
    shown = lab("rb0_interrupt.c", 40 * MS, line).numbers(PORT_A)
    assert [value for _, value in shown] == [n % 16 for n in range(22)]
    assert all(cycle - fall < 40 for (cycle, _), fall in zip(shown[1:], falls, strict=True))


def test_switches_on_rb4_to_rb7_are_followed_by_port_a() -> None:
    moments = [0, 5 * MS, 9 * MS, 12 * MS, 20 * MS]
    patterns = [0b0000, 0b0001, 0b1001, 0b1111, 0b0110]
    switches = [
        Levels(
            pressed(f"RB{4 + bit}"),
            [(moment, pattern >> bit & 1) for moment, pattern in zip(moments, patterns, strict=True)],
        )
        for bit in range(4)
    ]
    pins = lab("port_change.c", 30 * MS, *switches)
    for moment, pattern in zip(moments, patterns, strict=True):
        assert pins.number(PORT_A, moment + 100) == pattern
    assert len(pins.edges("RB0")) == 5  # driven low, then a change each time


def test_the_clock_counts_seconds() -> None:
    pins = lab("timer_clock.c", 12 * SECOND)
    shown = pins.numbers(PORT_A)
    assert [value for _, value in shown] == [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 0, 1]
    assert all(abs(step - SECOND) < SECOND // 100 for step in steps(shown))
    assert [cycle for cycle, _ in pins.edges("RB0")[1:]] and all(
        0 <= tick - second < 20
        for (second, _), (tick, _) in zip(shown[1:], pins.edges("RB0")[1:], strict=True)
    )


def test_it_says_hello_and_answers_in_capitals() -> None:
    heard = Serial(pressed("RB0"), b"az!Q{m", Fraction(9600), start=30 * MS, gap=2500)
    pins = lab("serial_hello.c", 60 * MS, heard)
    assert serial_bytes(pins, "RB1", 9600) == b"Hello\r\n" + b"AZ!Q{M"


def test_a_sender_that_is_two_per_cent_off_is_still_understood() -> None:
    for error in (Fraction(-2, 100), Fraction(2, 100)):
        heard = Serial(pressed("RB0"), b"UZ", Fraction(9600), start=30 * MS, gap=2500, baud_error=error)
        assert serial_bytes(lab("serial_hello.c", 60 * MS, heard), "RB1", 9600)[7:] == b"UZ"


def test_starts_are_counted_over_resets() -> None:
    resets = [Reset(n * 50 * MS, n * 50 * MS + 5 * MS) for n in (1, 2, 3)]
    pins = lab("eeprom_counter.c", 200 * MS, *resets)
    assert [pins.number(PORT_B, n * 50 * MS - MS) for n in (1, 2, 3, 4)] == [1, 2, 3, 4]
    assert pins.state.eeprom[5] == 4


def test_the_display_shows_both_lines() -> None:
    assert Display(lab("lcd.c", 200 * MS)).lines() == ("PIC16F84", "T=237")


def test_the_servo_follows_the_button() -> None:
    button = Levels(pressed("RA2"), [(0, 1), (100 * MS, 0), (200 * MS, 1)])
    pulses = lab("servo_button.c", 300 * MS, button).pulses("RB0")
    assert [1000 + 1000 * (100 * MS <= rise < 200 * MS) for rise, _ in pulses] == [
        round(length, -2) for _, length in pulses
    ]
    assert all(abs(step - 20 * MS) < 30 for step in steps(pulses))


@pytest.mark.parametrize("key", sampled(range(1, 13), 3))
def test_the_keypad_tells_which_key_is_down(key: int) -> None:
    held = Keypad(f"RB{(key - 1) % 3}", f"RB{4 + (key - 1) // 3}")
    assert lab("keypad.c", 15 * MS, held).number(PORT_A, 14 * MS) == key


def test_the_keypad_tells_that_no_key_is_down() -> None:
    assert lab("keypad.c", 15 * MS).number(PORT_A, 14 * MS) == 0


def test_the_stepper_makes_half_steps_there_and_back() -> None:
    ring = [0b0001, 0b0011, 0b0010, 0b0110, 0b0100, 0b1100, 0b1000, 0b1001]
    coils = tuple(f"RB{bit}" for bit in range(4, 8))
    shown = [value for _, value in lab("stepper.c", 330 * MS).numbers(coils)]
    there = [ring[n % 8] for n in range(1, 25)]
    back = [ring[n % 8] for n in range(23, -1, -1)]
    assert shown[: 1 + 24 + 1 + 24 + 1] == [0, *there, 0, *back, 0]


class Together:
    """Several presses of one button: each rests at the released level from the one before."""

    def __init__(self, buttons: list[BouncingButton]) -> None:
        self.buttons = buttons

    def changes(self, clock: Clock):  # type: ignore[no-untyped-def]
        yield LevelChange(0, self.buttons[0].pin, 1)
        for each in self.buttons:
            yield from (change for change in each.changes(clock) if change.cycle)
