"""Words of the SUMP protocol: what is encoded is decoded, and single words mean what the protocol says."""

from fractions import Fraction
from typing import cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from servogen.bench.analysers import sump
from servogen.bench.analysers.sump import wired_channel, wires
from servogen.bench.analysers.sump_client import SampleRequest, capture
from servogen.bench.ports import Port
from servogen.edges import PINS
from servogen.errors import InputError

LENGTHS = st.one_of(st.integers(1, 300), st.integers(32_760, 70_000))
RUNS = st.lists(st.tuples(st.integers(0, 0x7F), LENGTHS), min_size=1, max_size=12)


def runs(pieces: list[tuple[int, int]]) -> sump.Runs:
    lengths = [length for _, length in pieces]
    start = np.concatenate(([0], np.cumsum(lengths)[:-1])).astype(np.int64)
    return sump.merge_runs(np.array([value for value, _ in pieces], dtype=np.uint32), start, sum(lengths))


@given(RUNS, st.sampled_from([8, 16, 24, 32]))
def test_rle_and_the_wire_lose_nothing(pieces: list[tuple[int, int]], bits: int) -> None:
    original = runs(pieces)
    sent = sump.to_bytes(sump.encode(original, bits), bits)
    back = sump.decode(sump.from_bytes(sent, bits), True, bits)
    assert back.value.tolist() == original.value.tolist()
    assert back.start.tolist() == original.start.tolist()
    assert back.end == original.end


def test_a_count_without_its_value_says_nothing() -> None:
    words = np.array([0x8010, 1, 0x8002, 0], dtype=np.uint32)
    found = sump.decode(words, True)
    assert (found.value.tolist(), found.start.tolist(), found.end) == ([1, 0], [0, 3], 4)


def test_a_torn_word_is_left_out() -> None:
    assert sump.from_bytes(b"\x04\x03\x02").tolist() == [0x0304]


def test_a_pin_without_a_channel_is_refused() -> None:
    with pytest.raises(InputError, match="no channel of the analyser is wired to RB1"):
        wired_channel("RB1", wires(["0=RB0"]))


def test_the_commands_are_those_of_the_protocol() -> None:
    """As the page of the SUMP analyser and that of the Logic Sniffer's metadata list them.

    The virtual analyser of the other tests knows them from the same table.
    """
    commands = [(each.name, int(each)) for each in sump.SumpCommand]
    short = [("RESET", 0x00), ("RUN", 0x01), ("ID", 0x02), ("METADATA", 0x04), ("FINISH", 0x05)]
    long = [("DIVIDER", 0x80), ("COUNTS", 0x81), ("FLAGS", 0x82)]
    trigger = [("TRIGGER_MASK", 0xC0), ("TRIGGER_VALUE", 0xC1), ("TRIGGER_CONFIG", 0xC2)]
    assert commands == short + long + trigger


class InPieces:
    """A port whose other end sends the bytes a few at a time."""

    def __init__(self, *pieces: bytes) -> None:
        self.pieces = list(pieces)

    def write(self, data: bytes) -> None:
        pass

    def read(self, most: int, seconds: float) -> bytes:
        return self.pieces.pop(0) if self.pieces else b""


def test_the_progress_of_a_capture_is_in_words_and_ends_with_all_of_them() -> None:
    """A word of 16 channels is two bytes; half a word is not counted."""
    told: list[int] = []
    port = InPieces(bytes(4), bytes(7), bytes(1), bytes(8))
    capture(cast(Port, port), SampleRequest(Fraction(1_000_000), 10, False, None, 1.0), told.append)
    assert told == [5, 6, 10]


def test_two_chips_have_32_channels_of_which_the_second_ones_begin_at_16() -> None:
    wired = wires([], pair=True)
    assert {wired[channel] + 16 for channel in range(13)} == {wired[16 + channel] for channel in range(13)}
    assert wired_channel("2.RB0", wired, pair=True) == 16 and wired_channel("1.RB0", wired, pair=True) == 0
    assert wires(["30=2.RA4"], pair=True) == {30: 16 + PINS.index("RA4")}
    for text, pair in (("31=1.RB0", True), ("0=RB0", True), ("0=2.RB0", False), ("15=RB0", False)):
        with pytest.raises(InputError):
            wires([text], pair)
