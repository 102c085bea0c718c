"""What the chip itself tells of a program: resets, inputs, a missing configuration. Out: sentences."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from servogen.edges import PINS
from servogen.grade.lab import Lab
from servogen.grade.watch import Watched

TURN_OFF = "turn it off (C2C: #pragma _CONFIG, XC8: #pragma config WDTE = OFF, assembly: __CONFIG _WDT_OFF)"


@dataclass(frozen=True, slots=True)
class ChipFacts:
    """The machine at the end of the watch."""

    inputs: frozenset[int] = frozenset()
    """Pins that are inputs at the end."""
    watchdog_resets: int = 0
    configured: bool = True
    """Whether the program says its configuration word."""
    sleeping: bool = False
    lost: bool = False
    """Whether it ran into memory that holds no program."""
    stack_wraps: int = 0
    written_for_hz: int | None = None
    """The crystal that the source names."""
    repeats: bool = False
    """Whether the machine's whole state was seen to repeat."""


def cause(lab: Lab, watched: Watched, chip: ChipFacts) -> str | None:
    """The one cause beside which all else that is wrong is a consequence."""
    seconds = float(watched.clock.seconds(watched.end))
    if chip.watchdog_resets:
        why = "" if chip.configured else "the program has no configuration word, so the watchdog is on; "
        times = f"{chip.watchdog_resets} times" if chip.watchdog_resets > 1 else "once"
        return (
            f"the watchdog resets the chip {times} in {seconds:.3g} s: {why}{TURN_OFF}, or clear it in time"
        )
    if watched.too_fast:
        pin = max(watched.pins, key=lambda pin: len(watched.pins[pin].rise))
        edges = 2 * len(watched.pins[pin].rise)
        return f"{PINS[pin]} changes {edges} times in {seconds:.3g} s: these are not pulses for a servo"
    return None


def silent_reasons(lab: Lab, watched: Watched, chip: ChipFacts) -> Iterator[str]:
    """Why servos that the task needs get no pulses."""
    for each in lab.servos:
        numbers = [PINS.index(pin) for pin in each.pins]
        if any(number in watched.pins for number in numbers):
            continue
        yield _silent_reason(lab, watched, chip, each.servo.name, numbers)


def _silent_reason(lab: Lab, watched: Watched, chip: ChipFacts, servo: str, pins: list[int]) -> str:
    own, what = PINS[pins[0]], f"there are no pulses for the servo '{servo}' on {PINS[pins[0]]}"
    stuck = next((pin for pin in pins if pin in watched.high_since), None)
    if stuck is not None:
        since = float(watched.clock.us(watched.high_since[stuck])) / 1000
        return f"{PINS[stuck]} goes high {since:.4g} ms after the start and stays high: a pulse must end"
    lab_pins = {PINS.index(each.pins[0]) for each in lab.servos}
    elsewhere = [PINS[pin] for pin in sorted(watched.pins) if pin not in lab_pins]
    if elsewhere:
        drain = ", which is an open drain and needs a pull-up resistor" if elsewhere == ["RA4"] else ""
        return f"{what}: the pulses are on {' and '.join(elsewhere)}{drain}"
    if pins[0] in chip.inputs:
        register = f"TRIS{own[1]}"
        return f"{what}: the pin is still an input; its bit in {register} (bank 1) must be 0"
    if chip.sleeping:
        return f"{what}: the chip sleeps"
    if chip.lost:
        return f"{what}: the program runs on past its end; it needs an endless loop"
    if chip.stack_wraps:
        return f"{what}: calls are nested deeper than the chip's 8 levels"
    hangs = "" if watched.pins else "; the program hangs before that"
    return f"{what}: the pin is an output, but never goes high and low again{hangs}"


def clock_words(lab: Lab, chip: ChipFacts) -> str | None:
    """What is wrong when the source is written for another crystal."""
    if chip.written_for_hz in (None, lab.clock.hz):
        return None
    asked, board = (f"{(hz or 0) / 1e6:g} MHz" for hz in (chip.written_for_hz, lab.clock.hz))
    return f"the program is written for a crystal of {asked}, the board has {board}: all its times are wrong"
