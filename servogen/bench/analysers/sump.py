"""The SUMP protocol as data, and as words: what both ends of the line, client and virtual analyser, share.

Source: "Logic Analyzer: serial port protocol" (sump.org), and its extension by the Logic Sniffer (Dangerous
Prototypes: metadata, RLE modes). A command is one byte; from 0x80 on four bytes of data follow, lowest first.

    memory, as it is filled:   value  count  value  count …      top bit of a word set: a count
    as it is sent:             the last word first, each word its lowest byte first
    meaning:                   a count says how many more samples the value before it lasted

Unless the user says otherwise, port B is on the first group of channels, port A on the second.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from enum import IntEnum, IntFlag
from fractions import Fraction
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from servogen.edges import OTHER_PINS, PAIR_NAMES, PIN_NAMES
from servogen.errors import InputError, check_known, did_you_mean
from servogen.inputs import count_in

BASE_HZ = 100_000_000
"""The clock that is divided by the divider plus one."""

WORD_BITS = 16
"""Bits per word of the captures made here: two groups of eight channels are on, so counts have 15 bits."""

CHANNELS = WORD_BITS - 1
"""The number of usable channels: with RLE the top one marks counts."""

WIDE_BITS = 32
"""Bits per word of a capture of two chips: all four groups are on."""

MAX_READ_WORDS = 4 << 16
"""The maximum number of words that the 16-bit read count, in units of four, can request."""

RESETS = 5
"""The resets that are sent, because a device may be waiting for up to four bytes of a long command."""

IDS = (b"1SLO", b"1ALS")

Words = npt.NDArray[np.uint32]
Ints = npt.NDArray[np.int64]


class SumpCommand(IntEnum):
    """The commands that are used here."""

    RESET = 0x00
    RUN = 0x01
    ID = 0x02
    METADATA = 0x04
    FINISH = 0x05
    DIVIDER = 0x80
    COUNTS = 0x81
    FLAGS = 0x82
    TRIGGER_MASK = 0xC0
    TRIGGER_VALUE = 0xC1
    TRIGGER_CONFIG = 0xC2


STAGES = 4
"""The number of trigger stages; the commands of each are four above those of the stage before."""
LONG = 0x80
TRIGGER_START = 1 << 27
TRIGGER_LEVEL = 16
"""Bit 27 of a stage's configuration starts the capture; bits 16 and 17 are the level at which it is armed."""


class Flag(IntFlag):
    """The bits of the flags command; the bit of a group disables it."""

    DEMUX = 1 << 0
    FILTER = 1 << 1
    NO_GROUP_1 = 1 << 2
    NO_GROUP_2 = 1 << 3
    NO_GROUP_3 = 1 << 4
    NO_GROUP_4 = 1 << 5
    RLE = 1 << 8
    COUNTS_EXCLUSIVE = 1 << 14


GROUP_FLAGS = (Flag.NO_GROUP_1, Flag.NO_GROUP_2, Flag.NO_GROUP_3, Flag.NO_GROUP_4)


class Key(IntEnum):
    """Keys of metadata; the upper three bits select a text, a 32-bit number (high byte first) or a byte."""

    END = 0x00
    NAME = 0x01
    VERSION = 0x02
    CHANNELS_LONG = 0x20
    MEMORY = 0x21
    RATE = 0x23
    CHANNELS_SHORT = 0x40


class Runs(NamedTuple):
    """Runs of equal samples: `value` uint32 from sample `start` (int64) on; `end` is after the last."""

    value: Words
    start: Ints
    end: int


def short(command: SumpCommand) -> bytes:
    return bytes([command])


def long(command: int, data: int) -> bytes:
    """Return a command and its four bytes of data."""
    return bytes([command]) + data.to_bytes(4, "little")


def divider(rate: Fraction) -> int:
    """Return the argument of DIVIDER for `rate` samples per second, which must divide 100 MHz."""
    return int(BASE_HZ / rate) - 1


def longest_count(bits: int = WORD_BITS) -> int:
    """Return the largest count; the bit above it marks a word as a count."""
    return (1 << (bits - 1)) - 1


def encode(runs: Runs, bits: int = WORD_BITS) -> Words:
    """Return the RLE words of `runs`: each value, then the number of its repetitions, omitted if 0.

    A run that is longer than the largest count is repeated: value and count once more.
    """
    longest = longest_count(bits)
    length = np.diff(np.append(runs.start, runs.end))
    pieces = np.maximum(1, -(-length // (longest + 1)))
    value = np.repeat(runs.value, pieces)
    count = np.full(len(value), longest, dtype=np.int64)
    count[np.cumsum(pieces) - 1] = length - (pieces - 1) * (longest + 1) - 1
    pairs = np.stack((value & np.uint32(longest), (count | (longest + 1)).astype(np.uint32)), axis=1)
    keep = np.stack((np.ones(len(count), dtype=bool), count > 0), axis=1)
    words: Words = pairs[keep]
    return words


def decode(words: Words, rle: bool, bits: int = WORD_BITS) -> Runs:
    """Return the samples in `words`, oldest first; a count without a value before it is ignored."""
    if not rle:
        return merge_runs(words, np.arange(len(words), dtype=np.int64), len(words))
    longest = longest_count(bits)
    # Before the first value there may be a count whose value was overwritten.
    is_count = words > longest
    first = len(words) if is_count.all() else int(np.argmin(is_count))
    words, is_count = words[first:], is_count[first:]
    lasting = np.where(is_count, words & longest, 1).astype(np.int64)
    ends = np.cumsum(lasting)
    is_sample = ~is_count
    return merge_runs(words[is_sample], (ends - lasting)[is_sample], int(ends[-1]) if len(ends) else 0)


def merge_runs(value: Words, start: Ints, end: int) -> Runs:
    """Return runs in which neighbours differ."""
    keep = np.ones(len(value), dtype=bool)
    keep[1:] = value[1:] != value[:-1]
    return Runs(value[keep], start[keep], end)


def to_bytes(words: Words, bits: int = WORD_BITS) -> bytes:
    """Return words in transmission order: the newest first, the lowest byte of each first."""
    columns = words[::-1].astype("<u4").view(np.uint8).reshape(-1, 4)
    return columns[:, : bits // 8].tobytes()


def from_bytes(data: bytes, bits: int = WORD_BITS) -> Words:
    """Return the received words, the oldest first; an incomplete word at the end is dropped."""
    size = bits // 8
    columns = np.zeros((len(data) // size, 4), dtype=np.uint8)
    columns[:, :size] = np.frombuffer(data[: len(columns) * size], dtype=np.uint8).reshape(-1, size)
    words: Words = columns.view("<u4").reshape(-1)[::-1].astype(np.uint32)
    return words


CHANNEL_PINS = (*range(5, 13), *range(5))
"""The default wiring: the index in `PINS` of each channel's pin, RB0 to RB7, RA0 to RA4."""


PAIR_WIRES = {
    channel + begin: pin + begin for begin in (0, OTHER_PINS) for channel, pin in enumerate(CHANNEL_PINS)
}
"""The default wiring of two chips: the second one's pins are on the third and fourth group of channels, in
the same order.
"""


def wires(texts: Iterable[str], pair: bool = False) -> Mapping[int, int]:
    """Return the number of each channel's pin from texts such as `0=RB0`, of two chips `16=2.RB0`; by default
    `CHANNEL_PINS` or `PAIR_WIRES`. Raises InputError.
    """
    names = {name: number for number, name in (PAIR_NAMES if pair else PIN_NAMES).items()}
    channels = WIDE_BITS - 1 if pair else CHANNELS
    wired: dict[int, int] = {}
    for text in texts:
        digits, _, pin = text.partition("=")
        channel, name = count_in(digits), pin.strip().upper()
        if channel is None or channel >= channels:
            raise InputError(
                "bad-wiring",
                f"'{text}' is not a channel",
                hint=f"such as 0=RB0; channels are 0 to {channels - 1}",
            )
        check_known("unknown-pin", name, names, f"'{text}' is not a pin")
        if channel in wired or names[name] in wired.values():
            raise InputError("bad-wiring", f"'{text}': channel or pin is wired twice")
        wired[channel] = names[name]
    return wired or (PAIR_WIRES if pair else dict(enumerate(CHANNEL_PINS)))


def wired_channel(pin: str, wired: Mapping[int, int], pair: bool = False) -> int:
    """Return the channel connected to `pin`, of two chips `1.RB0`. Raises InputError."""
    known = PAIR_NAMES if pair else PIN_NAMES
    names = {known[number]: channel for channel, number in wired.items()}
    if pin.upper() not in names:
        raise InputError(
            "bad-wiring", f"no channel of the analyser is wired to {pin}", hint=did_you_mean(pin, names)
        )
    return names[pin.upper()]
