"""What is said on a serial line and on an I²C bus, live and in the waves of any moment."""

from __future__ import annotations

import random
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from servogen.edges import HIGH, LOW, PINS, UNDRIVEN, EdgeTrace, edge_chunk, join, part
from servogen.engines.board import board_of, machine_of
from servogen.simulator import EEPROM24, Machine, Serial, SimulatorOptions, on_pins
from servogen.units import Clock, Cycles
from servogen.watch.listeners import BusListener, SerialListener, byte_clocks
from servogen.watch.session import WatchSession
from servogen.watch.subject import Subject
from tests.engines.tape.tape_jobs import made, tape_of
from tests.simulator.helpers import CLOCK
from tests.simulator.i2c import program
from tests.watch.test_session import answer


@pytest.mark.parametrize("baud", [1200, 9600, 115_200])
def test_bytes_are_heard_as_they_were_sent(baud: int) -> None:
    """By a sender that is 2 % too fast; in pieces of any length; a byte without its stop bit is none."""
    clock, data = Clock(4_000_000), bytes([0xFF, 0x00, 0x55, 0xA3, 0x7F])
    changes = list(Serial(4, data, Fraction(baud), start=3000, baud_error=Fraction(2, 100)).changes(clock))
    heard = SerialListener(4, Fraction(baud), clock)
    heard.restart([1] * len(PINS))
    dice, begin, end = np.random.default_rng(baud), 0, changes[-1].cycle + 20 * 10**6 // baud
    while begin < end:
        until = begin + int(dice.integers(1, 12 * 10**6 // baud))
        some = [change for change in changes if begin <= change.cycle < until]
        columns = [[change.cycle for change in some], [4] * len(some), [change.level for change in some]]
        heard.add(edge_chunk(*columns), until)
        begin = until
    said = heard.taken()
    assert [int(byte.text, 16) for byte in said] == list(data) and heard.taken() == []
    assert all(9 <= (byte.end - byte.begin) * baud / 10**6 <= 10 for byte in said)
    heard.add(edge_chunk([begin], [4], [0]), begin + 20 * 10**6 // baud)  # the line stays low
    assert heard.taken() == []


def test_a_bus_is_heard_as_the_program_speaks() -> None:
    """DS20001203 sections 6 and 8: written and read back; the EEPROM is busy in the 5 ms after the stop."""
    read = ("start", 0xA0, 0x12, 0x34, "start", 0xA1, "take", "yes", "take", "no", "stop")
    image = program((*read, "start", 0xA0, 0x00, 0x07, 0x5C, "stop", "start", 0xA0, "stop"))
    eeprom = on_pins(EEPROM24(bytes(0x1234) + b"\x81\x7e"), scl="RA0", sda="RA1")
    edges = Machine(image, CLOCK, SimulatorOptions(devices=(eeprom,))).run(4000)
    heard = BusListener(0, 1)
    heard.add(edges, 4000)
    said = heard.taken()
    words = ["S 50 W A", "12 A", "34 A", "S 50 R A", "81 A", "7E N", "P"]
    assert [each.text for each in said] == [*words, "S 50 W A", "00 A", "07 A", "5C A", "P", "S 50 W N", "P"]
    assert all(one.begin <= one.end <= other.begin for one, other in pairwise(said))


def test_the_waves_of_any_moment_say_what_is_read_from_a_tape() -> None:
    """Also from the midst of a byte on, of which only the end is seen, after a jump, and in a recording."""
    played, image = made()
    schedule, data = played.plan.schedule, tape_of().content.data
    session = WatchSession(
        Subject(Path("main.hex"), schedule.clock, board_of(schedule), image, schedule=schedule)
    )
    span = Cycles(12 * schedule.period)
    trace = EdgeTrace(schedule.clock, (machine_of(schedule, image).run(span),), span)
    recorded = WatchSession(Subject(Path("main.vcd"), schedule.clock, trace=trace, schedule=schedule))
    sda, frame = PINS.index("RA4"), int(schedule.period)
    answer(session, do="seek", cycle=12 * frame)

    def said(begin: int, end: int, shown: WatchSession = session) -> list[tuple[int, int, str]]:
        return answer(shown, do="waves", begin=begin, end=end)["said"][sda]

    every = said(0, 12 * frame)
    assert [text for _, _, text in every[:4]] == ["S 50 W A", "00 A", "00 A", "S 50 R A"]
    assert bytes(int(text[:2], 16) for _, _, text in every[4:]) == data[: len(every) - 4] and len(every) > 30
    dice = random.Random(5)
    for _ in range(20):
        begin = dice.randrange(every[3].end, every[-1].begin)
        seen = said(begin, 12 * frame)
        assert seen == said(begin, 12 * frame, recorded) == [word for word in every if word[0] >= begin]


def test_of_a_bus_that_was_not_seen_for_a_while_nothing_is_said_before_a_start() -> None:
    """Between two pieces of a capture no pin has a level: a clock in it may be any of a byte's nine."""
    image = program(("start", 0xA0, 0x12, 0x34))
    eeprom = on_pins(EEPROM24(), scl="RA0", sda="RA1")
    edges = Machine(image, CLOCK, SimulatorOptions(devices=(eeprom,))).run(1500)
    heard = BusListener(0, 1)
    heard.add(edges, 1500)
    first, second, third = heard.taken()
    gap = edge_chunk([second.begin - 2, second.begin - 1], [0, 0], [UNDRIVEN, LOW])
    kept = (edges.cycle < second.begin - 2) | (edges.cycle >= second.begin)
    broken = join((gap, part(edges, kept)))
    broken = part(broken, np.argsort(broken.cycle, kind="stable"))
    heard = BusListener(0, 1)
    heard.add(broken, 1500)
    assert heard.taken() == [first]
    assert byte_clocks(broken, 0, 1) is None and byte_clocks(edges, 0, 1) == 0
    before = part(edges, edges.cycle <= third.begin)
    assert byte_clocks(before, 0, 1) == 1


@pytest.mark.parametrize("before", [LOW, UNDRIVEN])
def test_sda_that_changes_as_scl_becomes_high_is_no_start(before: int) -> None:
    """DS20001203 section 4.2: a start is a fall of SDA while SCL is high; a capture may go on with both."""
    fall = edge_chunk([0, 0, 10, 10], [0, 1, 0, 1], [before, before or HIGH, HIGH, LOW])
    clocks = edge_chunk(range(20, 38), [0] * 18, [LOW, HIGH] * 9)
    heard = BusListener(0, 1)
    heard.add(join((fall, clocks)), 40)
    assert heard.taken() == [] and byte_clocks(join((fall, clocks)), 0, 1) is None
