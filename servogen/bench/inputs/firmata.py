"""Firmata, the protocol of boards whose pins a host drives: messages as bytes, and bytes as messages.

In: pins, levels, delays. Out: bytes to the board; from its bytes, `Message`s. Source: the Firmata protocol
2.8 (github.com/firmata/protocol: protocol.md, scheduler.md, serial-1.0.md).

    0x90 + port · 7 bits · 1 bit         levels of eight pins
    0xF4 · pin · mode, 0xF5 · pin · level
    0xF0 · command · data … · 0xF7       all else; the bytes between have seven bits
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import IntEnum

BAUDS = (57_600, 115_200)
"""The rates of StandardFirmata and of ConfigurableFirmata."""

MAX_SYSEX_DATA = 64
"""The bytes of a command that an Arduino keeps, its number included."""


class MessageKind(IntEnum):
    """The first byte of a message; in the first three its low four bits are a port or a channel."""

    DIGITAL = 0x90
    REPORT_ANALOG = 0xC0
    REPORT_DIGITAL = 0xD0
    ANALOG = 0xE0
    SYSEX = 0xF0
    PIN_MODE = 0xF4
    PIN_VALUE = 0xF5
    END_SYSEX = 0xF7
    VERSION = 0xF9
    RESET = 0xFF


class FirmataCommand(IntEnum):
    SERIAL = 0x60
    ANALOG_MAPPING_QUERY = 0x69
    ANALOG_MAPPING = 0x6A
    CAPABILITY_QUERY = 0x6B
    CAPABILITIES = 0x6C
    PIN_STATE_QUERY = 0x6D
    PIN_STATE = 0x6E
    EXTENDED_ANALOG = 0x6F
    TEXT = 0x71
    FIRMWARE = 0x79
    SAMPLING_INTERVAL = 0x7A
    SCHEDULER = 0x7B


class SchedulerCommand(IntEnum):
    """The second byte of a scheduler's command."""

    CREATE = 0
    DELETE = 1
    ADD = 2
    DELAY = 3
    SCHEDULE = 4
    QUERY_ALL = 5
    QUERY = 6
    RESET = 7
    ERROR = 8
    ALL = 9
    STATE = 10


class Mode(IntEnum):
    INPUT = 0
    OUTPUT = 1
    ANALOG = 2
    SERIAL = 10
    PULL_UP = 11


SERIAL_CONFIG, SERIAL_WRITE, SERIAL_CLOSE = 0x10, 0x20, 0x50
"""A serial line's commands; the low four bits are the board's port."""
NO_MORE_MODES = 0x7F
"""Ends the modes of each pin in the answer to `CAPABILITY_QUERY`."""


def pin_mode(pin: int, mode: Mode) -> bytes:
    return bytes((MessageKind.PIN_MODE, pin, mode))


def pin_value(pin: int, level: int) -> bytes:
    return bytes((MessageKind.PIN_VALUE, pin, level))


def sysex(command: FirmataCommand, data: bytes = b"") -> bytes:
    return bytes((MessageKind.SYSEX, command, *data, MessageKind.END_SYSEX))


def serial_config(port: int, baud: int) -> bytes:
    rate = bytes((baud & 0x7F, baud >> 7 & 0x7F, baud >> 14 & 0x7F))
    return sysex(FirmataCommand.SERIAL, bytes((SERIAL_CONFIG | port,)) + rate)


def serial_write(port: int, data: bytes) -> bytes:
    """Return the messages that send bytes on a serial port of the board."""
    most = (MAX_SYSEX_DATA - 2) // 2
    pieces = [data[first : first + most] for first in range(0, len(data), most)]
    return b"".join(
        sysex(FirmataCommand.SERIAL, bytes((SERIAL_WRITE | port,)) + split_bytes(piece)) for piece in pieces
    )


def serial_close(port: int) -> bytes:
    return sysex(FirmataCommand.SERIAL, bytes((SERIAL_CLOSE | port,)))


def task(kind: SchedulerCommand, data: bytes = b"") -> bytes:
    return sysex(FirmataCommand.SCHEDULER, bytes((kind,)) + data)


def delay_ms(ms: int) -> bytes:
    """Return the message in a task that waits before the next one."""
    return task(SchedulerCommand.DELAY, packed(ms.to_bytes(4, "little")))


def load_task(number: int, messages: bytes) -> bytes:
    """Return the messages that store others on the board as a task."""
    most = (MAX_SYSEX_DATA - 3) * 7 // 8
    pieces = [messages[first : first + most] for first in range(0, len(messages), most)]
    size = bytes((number, len(messages) & 0x7F, len(messages) >> 7))
    return task(SchedulerCommand.CREATE, size) + b"".join(
        task(SchedulerCommand.ADD, bytes((number,)) + packed(piece)) for piece in pieces
    )


def schedule_task(number: int, ms: int) -> bytes:
    return task(SchedulerCommand.SCHEDULE, bytes((number,)) + packed(ms.to_bytes(4, "little")))


def split_bytes(data: bytes) -> bytes:
    """Return two bytes for each: its low seven bits, its highest bit."""
    return bytes(part for byte in data for part in (byte & 0x7F, byte >> 7))


def joined_bytes(data: bytes) -> bytes:
    """Return the bytes of which `split_bytes` made pairs."""
    return bytes(low | (high & 1) << 7 for low, high in zip(data[::2], data[1::2], strict=False))


def packed(data: bytes) -> bytes:
    """Return the same bits, seven in a byte, the lowest first."""
    number = int.from_bytes(data, "little")
    return bytes(number >> 7 * place & 0x7F for place in range(-(-8 * len(data) // 7)))


def unpacked(data: bytes) -> bytes:
    """Return the whole bytes of which `packed` made these."""
    number = sum(byte << 7 * place for place, byte in enumerate(data))
    size = 7 * len(data) // 8
    return (number & (1 << 8 * size) - 1).to_bytes(size, "little")


@dataclass(frozen=True, slots=True)
class Message:
    """One message: of a command (`MessageKind.SYSEX`) `data` begins with its number."""

    kind: int
    data: bytes

    def is_command(self, command: FirmataCommand) -> bool:
        return self.kind == MessageKind.SYSEX and self.data[:1] == bytes((command,))


SIZES: Mapping[int, int] = {
    MessageKind.DIGITAL: 2,
    MessageKind.ANALOG: 2,
    MessageKind.REPORT_ANALOG: 1,
    MessageKind.REPORT_DIGITAL: 1,
    MessageKind.PIN_MODE: 2,
    MessageKind.PIN_VALUE: 2,
    MessageKind.VERSION: 2,
    MessageKind.RESET: 0,
}
"""The number of bytes that follow the first one."""


@dataclass(slots=True)
class MessageReader:
    """Splits bytes into messages; what belongs to none is dropped."""

    asks_version: bool = False
    """Whether the sender is the host, whose request for the version has no data."""
    _kind: int | None = None
    _data: bytearray = field(default_factory=bytearray)

    def read(self, data: bytes) -> Iterator[Message]:
        """Yield the messages that end in `data`."""
        for byte in data:
            if byte >= 0x80 and not (byte == MessageKind.END_SYSEX and self._kind == MessageKind.SYSEX):
                known = byte == MessageKind.SYSEX or _without_channel(byte) in SIZES
                self._kind = byte if known else None
                self._data.clear()
            elif self._kind is None:
                continue
            elif byte != MessageKind.END_SYSEX:
                self._data.append(byte)
            if self._kind is not None and self._whole(byte):
                yield Message(self._kind, bytes(self._data))
                self._kind = None

    def _whole(self, last: int) -> bool:
        assert self._kind is not None
        if self._kind == MessageKind.SYSEX:
            return last == MessageKind.END_SYSEX
        if self._kind == MessageKind.VERSION and self.asks_version:
            return True
        return len(self._data) == SIZES[_without_channel(self._kind)]


def _without_channel(kind: int) -> int:
    return kind if kind >= 0xF0 else kind & 0xF0
