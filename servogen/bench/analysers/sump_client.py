"""A capture by an analyser that speaks SUMP: Logic Sniffer, Bus Pirate, boards with that firmware.

In: an open port and a `SampleRequest`: rate, words, trigger. Out: `ReceivedSamples`: runs of samples, and
whether they are complete. Silence ends a capture, because an analyser does not announce how much it sends.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

from servogen.bench.analysers import sump
from servogen.bench.analysers.sump import Flag, Key, SumpCommand
from servogen.bench.ports import Port, Unplugged
from servogen.errors import Location, ToolError

BAUD = 115_200
ANSWER_S = 0.5
SILENCE_S = 0.5
MORE_S = 0.1
"""The time for which nothing may follow a complete capture."""
ATTEMPTS = 2
"""A device that is still sending an old capture answers only the second time."""

DEFAULT_MEMORY = 24 * 1024
"""Bytes of sample memory if the device does not report it: the Logic Sniffer's block RAM."""


@dataclass(frozen=True, slots=True)
class AnalyserDescription:
    """A device's description of itself."""

    name: str
    memory: int
    """Bytes."""
    fastest: int | None
    """Samples per second."""
    stated: bool
    """Whether the device reported its memory."""


@dataclass(frozen=True, slots=True)
class SampleRequest:
    """One capture: `words` of memory at `rate`, started when `channel` rises; None starts immediately."""

    rate: Fraction
    words: int
    rle: bool
    channel: int | None
    patience_s: float
    """The timeout for the first byte: for the trigger and the capture itself."""
    bits: int = sump.WORD_BITS
    """The bits of a word: eight for each group of channels that is on, from the first one on."""


@dataclass(frozen=True, slots=True)
class ReceivedSamples:
    """Samples, oldest first. `missing` is the reason why they are incomplete; those received are contiguous
    and end where the capture ends.
    """

    runs: sump.Runs
    missing: str | None = None


def identify(port: Port) -> AnalyserDescription:
    """Wake the device and return its description. Raises ToolError."""
    answer = b""
    for _ in range(ATTEMPTS):
        port.write(sump.short(SumpCommand.RESET) * sump.RESETS)
        port.read_whole(1 << 20, 0.1)
        port.clear()
        port.write(sump.short(SumpCommand.ID))
        answer = port.read_whole(4, ANSWER_S)
        if answer in sump.IDS:
            return _description(port)
    if not answer:
        raise ToolError(
            "no-answer",
            "the device does not answer",
            Location(port.path),
            "is it a SUMP analyser, is this its port, is its firmware the one for logic analysis?",
        )
    raise ToolError(
        "wrong-device", f"the device is not a SUMP analyser: it answered {answer!r}", Location(port.path)
    )


def _description(port: Port) -> AnalyserDescription:
    port.write(sump.short(SumpCommand.METADATA))
    described = metadata(_metadata_bytes(port))
    name, memory, rate = described.get(Key.NAME), described.get(Key.MEMORY), described.get(Key.RATE)
    return AnalyserDescription(
        name if isinstance(name, str) and name else "SUMP analyser",
        memory if isinstance(memory, int) and memory else DEFAULT_MEMORY,
        rate if isinstance(rate, int) and rate else None,
        bool(memory),
    )


def _metadata_bytes(port: Port) -> bytes:
    """Return what a device sends as metadata, which it need not have."""
    data = b""
    while not _is_complete(data) and (more := port.read(1 << 10, ANSWER_S / 2)):
        data += more
    return data


def _is_complete(data: bytes) -> bool:
    """Return whether metadata are complete."""
    offset = 0
    while offset < len(data) and data[offset] != Key.END:
        kind = data[offset] >> 5
        if kind > 2:
            return False
        offset = (
            (data.find(b"\0", offset + 1) + 1 or len(data)) if kind == 0 else offset + (5 if kind == 1 else 2)
        )
    return offset < len(data)


def metadata(data: bytes) -> dict[int, int | str]:
    """Return a device's metadata by key; incomplete or unknown items are dropped."""
    described: dict[int, int | str] = {}
    offset = 0
    while offset < len(data) and data[offset] != Key.END:
        key = data[offset]
        kind = key >> 5
        if kind == 0:
            end = data.find(b"\0", offset + 1)
            if end < 0:
                break
            described[key] = data[offset + 1 : end].decode("latin-1")
            offset = end + 1
        elif kind in (1, 2):
            size = 4 if kind == 1 else 1
            value = data[offset + 1 : offset + 1 + size]
            if len(value) < size:
                break
            described[key] = int.from_bytes(value, "big")
            offset += 1 + size
        else:
            break
    return described


def capture(
    port: Port,
    look: SampleRequest,
    progress: Callable[[int], None] = lambda words: None,
    armed: Callable[[], None] = lambda: None,
) -> ReceivedSamples:
    """Arm the analyser, call `armed`, and return the samples it sends.

    Raises ToolError if it sends nothing.
    """
    port.write(_settings(look))
    port.write(sump.short(SumpCommand.RUN))
    armed()
    size = look.bits // 8
    wanted = size * look.words
    data = bytearray()
    missing = None
    try:
        data += port.read(wanted, look.patience_s)
        if not data:
            port.write(sump.short(SumpCommand.RESET) * sump.RESETS)
            raise _never(port, look)
        while len(data) < wanted:
            more = port.read(wanted - len(data), SILENCE_S)
            if not more:
                missing = f"the analyser stopped sending after {len(data)} of {wanted} bytes"
                break
            data += more
            progress(len(data) // size)
        # A device that counts its words otherwise would have shifted all samples.
        if missing is None and port.read(1, MORE_S):
            raise ToolError(
                "wrong-device",
                f"the analyser sent more than the {wanted} bytes requested",
                Location(port.path),
            )
    except Unplugged:
        if not data:
            raise
        missing = f"the analyser disappeared after {len(data)} of {wanted} bytes"
    words = sump.from_bytes(bytes(data), look.bits)
    return ReceivedSamples(sump.decode(words, look.rle, look.bits), missing)


def _never(port: Port, look: SampleRequest) -> ToolError:
    waited = f"{look.patience_s:g} s"
    if look.channel is None:
        return ToolError("no-answer", f"the analyser sent nothing for {waited}", Location(port.path))
    return ToolError(
        "no-answer",
        f"nothing rose on channel {look.channel} for {waited}, or too little followed to fill the memory",
        Location(port.path),
        "does the chip run, is that channel's wire on its pin, is ground connected?",
    )


def _settings(look: SampleRequest) -> bytes:
    """Return the commands that configure a capture: trigger, divider, counts, flags."""
    # The protocol counts in fours, less one; both counts are equal, so that all samples follow the trigger.
    fours = look.words // 4 - 1
    flags = Flag.FILTER
    for off in sump.GROUP_FLAGS[look.bits // 8 :]:
        flags |= off
    if look.rle:
        flags |= Flag.RLE | Flag.COUNTS_EXCLUSIVE
    return b"".join(
        (
            _trigger(look.channel),
            sump.long(SumpCommand.DIVIDER, sump.divider(look.rate)),
            sump.long(SumpCommand.COUNTS, fours | fours << 16),
            sump.long(SumpCommand.FLAGS, flags),
        )
    )


def _trigger(channel: int | None) -> bytes:
    """Return the two trigger stages that form an edge from two levels: low arms the second, high starts."""
    if channel is None:
        return _stage(0, 0, 0, sump.TRIGGER_START)
    mask = 1 << channel
    return _stage(0, mask, 0, 0) + _stage(1, mask, mask, 1 << sump.TRIGGER_LEVEL | sump.TRIGGER_START)


def _stage(number: int, mask: int, value: int, configuration: int) -> bytes:
    first = sump.STAGES * number
    return b"".join(
        sump.long(command + first, data)
        for command, data in (
            (SumpCommand.TRIGGER_MASK, mask),
            (SumpCommand.TRIGGER_VALUE, value),
            (SumpCommand.TRIGGER_CONFIG, configuration),
        )
    )
