"""Bytes that a client writes arrive on the chip's pin, bit by bit."""

import numpy as np

from servogen.bench.virtual.serial_line import LineStimulus
from servogen.edges import PINS
from servogen.simulator.layout import PACK_CYCLE, PACK_PIN
from servogen.units import Clock


def test_a_byte_is_a_start_bit_eight_bits_lowest_first_and_a_stop_bit() -> None:
    line = LineStimulus(PINS.index("RB7"), 10_000)
    pieces = line.changes(Clock(4_000_000))  # 100 cycles a bit
    assert rows(next(pieces)[1]) == [(0, 12, 1)]
    line.waiting.append(0b0000_0101)
    until, changes = next(pieces)
    assert until == 1001
    assert rows(changes) == [
        (1 + 100 * n, 12, level) for n, level in enumerate((0, 1, 0, 1, 0, 0, 0, 0, 0, 1))
    ]


def test_an_inverted_line_idles_low() -> None:
    line = LineStimulus(0, 10_000, inverted=True)
    line.waiting.append(0xFF)
    pieces = line.changes(Clock(4_000_000))
    assert rows(next(pieces)[1]) == [(0, 0, 0)]
    assert [level for _, _, level in rows(next(pieces)[1])] == [1, *[0] * 9]


def rows(packed: "np.ndarray[tuple[int], np.dtype[np.int64]]") -> list[tuple[int, int, int]]:
    return [
        (int(each) >> PACK_CYCLE, (int(each) >> PACK_PIN) & 0x3F, int(each) & 3) for each in packed.tolist()
    ]
