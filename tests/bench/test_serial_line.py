"""Bytes that a client writes arrive on the chip's pin, bit by bit, and what the chip sends comes back."""

from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction

import numpy as np
import pytest
import serial
from hypothesis import given, settings
from hypothesis import strategies as st

from servogen.bench.virtual.rig import RigOptions, rig
from servogen.bench.virtual.serial_line import LineReceiver, LineStimulus
from servogen.compiler import Options, Source, compile_sources
from servogen.edges import PINS
from servogen.pic.device import device
from servogen.simulator import SimulatorOptions
from servogen.simulator.layout import PACK_CYCLE, PACK_PIN
from servogen.units import Clock
from tests.bench.conftest import ROOT, served

CLOCK = Clock(4_000_000)
BIT = 100
"""Cycles of a bit at 10 000 baud."""


def test_a_byte_is_a_start_bit_eight_bits_lowest_first_and_a_stop_bit() -> None:
    line = LineStimulus(PINS.index("RB7"), 10_000)
    pieces = line.changes(CLOCK)
    assert rows(next(pieces)[1]) == [(0, 12, 1)]
    line.waiting.append(0b0000_0101)
    until, changes = next(pieces)
    assert until == 1001
    assert rows(changes) == [
        (1 + BIT * n, 12, level) for n, level in enumerate((0, 1, 0, 1, 0, 0, 0, 0, 0, 1))
    ]


def test_an_inverted_line_idles_low() -> None:
    line = LineStimulus(0, 10_000, inverted=True)
    line.waiting.append(0xFF)
    pieces = line.changes(CLOCK)
    assert rows(next(pieces)[1]) == [(0, 0, 0)]
    assert [level for _, _, level in rows(next(pieces)[1])] == [1, *[0] * 9]


def test_pins_that_the_board_holds_are_held_from_power_up_on() -> None:
    pieces = LineStimulus(0, 10_000, held={4: 0, 9: 1}).changes(CLOCK)
    assert sorted(rows(next(pieces)[1])) == [(0, 0, 1), (0, 4, 0), (0, 9, 1)]


def rows(packed: "np.ndarray[tuple[int], np.dtype[np.int64]]") -> list[tuple[int, int, int]]:
    return [
        (int(each) >> PACK_CYCLE, (int(each) >> PACK_PIN) & 0x3F, int(each) & 3) for each in packed.tolist()
    ]


# What the chip sends.


def frames(data: bytes, gap: int, stop: int = 1) -> list[tuple[int, int]]:
    """(cycle, level) of the line, idle high from cycle 500 on."""
    changes, at = [(500, 1)], 2000
    for byte in data:
        bits = [0, *(byte >> n & 1 for n in range(8)), stop]
        changes += [(at + BIT * n, bit) for n, bit in enumerate(bits)]
        at += 10 * BIT + gap
        changes.append((at - gap // 2 if gap else at, 1))
    return changes


def heard(changes: list[tuple[int, int]], cuts: list[int], inverted: bool = False) -> bytes:
    """What a receiver on RB1 makes of the line, given to it in pieces that end at `cuts`."""
    receiver = LineReceiver(6, Fraction(BIT), inverted)
    word = [(at, ((level != inverted) << 6) | 1) for at, level in [(0, 0), *changes]]
    received, begin = b"", 0
    for cut in [*sorted(cuts), changes[-1][0] + 20 * BIT]:
        before = max((each for each in word if each[0] <= begin), key=lambda each: each[0])[1]
        inside = [(begin, before), *(each for each in word if begin < each[0] < cut)]
        cycle, level = zip(*inside, strict=True)
        levels = np.array(cycle, dtype=np.int64), np.array(level, dtype=np.uint32)
        received += receiver.add(levels, cut)
        begin = cut
    return received


@settings(max_examples=30)
@given(st.binary(max_size=6), st.sampled_from([0, 30, 5000]), st.lists(st.integers(1, 9000), max_size=5))
def test_every_byte_is_heard_however_the_time_is_cut(data: bytes, gap: int, cuts: list[int]) -> None:
    assert heard(frames(data, gap), cuts) == data


def test_an_inverted_line_is_heard() -> None:
    assert heard(frames(b"Hi", 0), [], inverted=True) == b"Hi"


def test_a_byte_whose_stop_bit_is_wrong_is_left_out() -> None:
    assert heard(frames(b"\x00", 400, stop=0), []) == b""


def test_a_line_that_is_low_before_the_chip_drives_it_is_no_start_bit() -> None:
    assert heard([(500, 0), (900, 1)], []) == b""


# Through the chip: a lab program that says hello and sends back capitals.


@contextmanager
def chatting(baud: int = 9600, **options: object) -> Iterator[serial.Serial]:
    file = ROOT / "tests" / "labs_c2c" / "serial_hello.c"
    source = Source(file.read_text(), file.name)
    image = compile_sources([source], Options(dialect="c2c", device=device("16F84A"))).image
    board = RigOptions(
        serial_pin=PINS.index("RB0"),
        serial_out=PINS.index("RB1"),
        baud=baud,
        **options,  # type: ignore[arg-type]
    )
    with (
        rig(image, CLOCK, SimulatorOptions(), board) as terminals,
        served(terminals),
        serial.Serial(terminals.paths["serial"], timeout=60) as port,
    ):
        if baud == 9600:
            listening(port)
        yield port


def listening(port: serial.Serial) -> None:
    """Wait until the chip has sent its greeting and answers: a digit that it hears meanwhile is lost."""
    port.timeout, patience = 1, port.timeout
    assert any(
        port.write(digit) and digit in port.read_until(digit) for digit in (b"%d" % n for n in range(10))
    )
    port.timeout = patience


@pytest.mark.parametrize("real_time", [False, True])
def test_bytes_go_into_the_chip_and_come_out_of_it(real_time: bool) -> None:
    """The chip hears nothing while it sends: a client that waits for each answer loses none."""
    with chatting(real_time=real_time) as port:
        for letter in b"az{Q":
            port.write(bytes([letter]))
            assert port.read(1) == bytes([letter]).upper()


def test_another_baud_rate_is_not_understood() -> None:
    with chatting(baud=4800) as port:
        port.timeout = 0.5
        port.write(b"a")
        assert b"A" not in port.read(20)
