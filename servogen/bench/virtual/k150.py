"""`VirtualProgrammer`: a K150 with a chip in its socket, which speaks P18A.

In: bytes of the client. Out: bytes of the programmer, and another image on the virtual chip, which runs from
reset when the programming voltage is switched off. Source: the protocol of the Kitsrus programmers K128,
K149, K150, K182 ("P18A"), of which the commands for 14-bit chips are implemented.

    idle ──'P'──▶ jump table ──a command's number──▶ its data and answers ──▶ jump table
                       └──────1──▶ 'Q', idle

A client resets a real K150 by DTR, which a pseudo-terminal does not have. Instead, the programmer is idle
again when a client opens its port (`terminals`) or, where nothing tells of that, after a silence, even in the
middle of a command.
"""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, field

from servogen.bench.virtual.chip import SecondChip, VirtualChip
from servogen.pic.device import EEPROM_BYTES, ERASED_WORD, ID_WORDS, PROGRAM_WORDS
from servogen.pic.image import Image
from servogen.pic.isa import WORD_MASK

Talk = Generator[int, bytes, None]
"""Yields the number of bytes it waits for, and is sent these bytes."""

BLOCK = 32
"""The bytes of program memory in one block."""

FIRMWARE = 3  # a K150
PROTOCOL = b"P18A"
NO_DEVICE_ID = ERASED_WORD  # the plain PIC16F84 has none: its place reads as erased
ERASED_BYTE = 0xFF
ID_BITS = 0x7F  # DS35007 section 6.13: the low four bits are meant; seven are programmed

SILENCE_S = 1.0
"""The silence after which the programmer is idle again, where nothing tells that its port was opened."""

MAX_UNREAD = 4096
"""The bytes kept for a client that does not read; older ones are lost, as on a real line."""

QUIT, ECHO, VARIABLES, POWER_ON, POWER_OFF, POWER_CYCLE = range(1, 7)
PROGRAM_ROM, PROGRAM_EEPROM, PROGRAM_FUSES = 7, 8, 9
READ_ROM, READ_EEPROM, READ_CONFIG, ERASE = 11, 12, 13, 14
ROM_BLANK, EEPROM_BLANK, CHIP_IN, CHIP_OUT, VERSION, GET_PROTOCOL = 15, 16, 18, 19, 20, 21


@dataclass(frozen=True, slots=True)
class ProgrammerOptions:
    """The faults of the programmer."""

    silent: bool = False
    garbage: bool = False
    no_chip: bool = False
    """The socket is empty."""
    wrong_bit_at: int | None = None
    """The program address at which the lowest bit is programmed wrongly."""
    wrong_eeprom_at: int | None = None
    """The same for the data EEPROM."""
    wrong_config: bool = False
    """The lowest bit of the configuration word is programmed wrongly."""
    unplug_after: int | None = None
    """Bytes from the client after which it disappears."""


@dataclass(slots=True)
class VirtualProgrammer:
    chip: VirtualChip | SecondChip
    options: ProgrammerOptions = ProgrammerOptions()
    outgoing: bytearray = field(default_factory=bytearray)
    gone: bool = False
    reset: bool = False
    taken: int = 0
    """Bytes received since it was plugged in."""
    erased: int = 0
    """The number of times it erased a chip."""
    now: Callable[[], float] = time.monotonic
    """Seconds."""
    told: bool = False
    _rom: list[int] = field(default_factory=lambda: [ERASED_WORD] * PROGRAM_WORDS)
    _eeprom: list[int] = field(default_factory=lambda: [ERASED_BYTE] * EEPROM_BYTES)
    _ids: list[int] = field(default_factory=lambda: [ID_BITS] * ID_WORDS)
    _config: int = ERASED_WORD
    _powered: bool = False
    _waiting: bytearray = field(default_factory=bytearray)
    _talk: Talk | None = None
    _needs: int = 1
    _heard_at: float | None = None
    _dice: random.Random = field(default_factory=lambda: random.Random(1))

    @property
    def working(self) -> bool:
        return False

    def work(self) -> None:
        """Do nothing, because the programmer acts only on commands."""

    def received(self, data: bytes) -> None:
        """Take bytes of the client and continue the conversation as far as they go."""
        self.taken += len(data)
        if self.options.unplug_after is not None and self.taken >= self.options.unplug_after:
            self.gone = True
        if self.options.silent or self.gone:
            return
        if self.options.garbage:
            self.outgoing += self._dice.randbytes(len(data))
            return
        now = self.now()
        if self._heard_at is not None and now > self._heard_at + SILENCE_S and not self.told:
            self.restarted()
        self._heard_at = now
        self._waiting += data
        if self._talk is None:
            self._talk = self._conversation()
            self._needs = next(self._talk)
        while len(self._waiting) >= self._needs:
            piece = bytes(self._waiting[: self._needs])
            del self._waiting[: self._needs]
            self._needs = self._talk.send(piece)
            del self.outgoing[:-MAX_UNREAD]

    def restarted(self) -> None:
        """Discard the current command and unread output, and switch off the programming voltage."""
        self._talk = None
        self._waiting.clear()
        self.outgoing.clear()
        self.reset = True
        if self._powered:
            self._power_off()

    def _conversation(self) -> Talk:
        commands: Mapping[int, Callable[[], Talk]] = {
            ECHO: self._echo,
            VARIABLES: self._variables,
            PROGRAM_ROM: self._program_rom,
            PROGRAM_EEPROM: self._program_eeprom,
            PROGRAM_FUSES: self._program_fuses,
            ROM_BLANK: self._rom_blank,
        }
        answers: Mapping[int, Callable[[], bytes]] = {
            POWER_ON: self._power_on,
            POWER_OFF: self._power_off,
            POWER_CYCLE: lambda: b"V",
            READ_ROM: lambda: b"".join(word.to_bytes(2, "big") for word in self._rom),
            READ_EEPROM: lambda: bytes(self._eeprom),
            READ_CONFIG: self._read_config,
            ERASE: self._erase,
            EEPROM_BLANK: lambda: b"Y" if set(self._eeprom) == {ERASED_BYTE} else b"N",
            CHIP_IN: lambda: b"A" if self.options.no_chip else b"AY",
            CHIP_OUT: lambda: b"AY" if self.options.no_chip else b"A",
            VERSION: lambda: bytes([FIRMWARE]),
            GET_PROTOCOL: lambda: PROTOCOL,
        }
        while True:
            start = yield 1
            if start == b"P":
                self.outgoing += b"P"
                while (command := (yield 1)[0]) != QUIT:
                    if command in commands:
                        yield from commands[command]()
                    elif command in answers:
                        self.outgoing += answers[command]()
                self.outgoing += b"Q"
            elif start[0] == QUIT:
                self.outgoing += b"Q"

    def _echo(self) -> Talk:
        self.outgoing += yield 1

    def _variables(self) -> Talk:
        """Read sizes, core type, flags and delays: 11 bytes."""
        yield 11
        self.outgoing += b"I"

    def _program_rom(self) -> Talk:
        words = int.from_bytes((yield 2), "big")
        if words > PROGRAM_WORDS:
            self.outgoing += b"N"
            return
        self.outgoing += b"Y"
        for first in range(0, words, BLOCK // 2):
            data = yield BLOCK
            for n in range(BLOCK // 2):
                self._rom[(first + n) % PROGRAM_WORDS] = (
                    int.from_bytes(data[2 * n : 2 * n + 2], "big") & WORD_MASK
                )
            self.outgoing += b"Y"
        if self.options.wrong_bit_at is not None:
            self._rom[self.options.wrong_bit_at % PROGRAM_WORDS] ^= 1
        self.outgoing += b"P"

    def _program_eeprom(self) -> Talk:
        count = int.from_bytes((yield 2), "big")
        if count > EEPROM_BYTES:
            self.outgoing += b"N"
            return
        self.outgoing += b"Y"
        for first in range(0, count, 2):
            self._eeprom[first : first + 2] = yield 2
            self.outgoing += b"Y"
        yield 2
        if self.options.wrong_eeprom_at is not None:
            self._eeprom[self.options.wrong_eeprom_at % EEPROM_BYTES] ^= 1
        self.outgoing += b"P"

    def _program_fuses(self) -> Talk:
        """Program the fuses from '00', four ID bytes, 'FFFF', and seven fuse words, low byte first, of which
        the first is used.
        """
        data = yield 24
        self._ids = [byte & ID_BITS for byte in data[2:6]]
        self._config = int.from_bytes(data[10:12], "little") & WORD_MASK ^ self.options.wrong_config
        self.outgoing += b"Y"

    def _rom_blank(self) -> Talk:
        yield 1
        self.outgoing += b"Y" if set(self._rom) == {ERASED_WORD} else b"N"

    def _read_config(self) -> bytes:
        """Return the device ID, the ID bytes, seven fuse words and a calibration word."""
        ids = bytes(self._ids) + bytes(8 - ID_WORDS)
        words = (self._config, *[WORD_MASK] * 7)
        return (
            b"C" + NO_DEVICE_ID.to_bytes(2, "little") + ids + b"".join(w.to_bytes(2, "little") for w in words)
        )

    def _erase(self) -> bytes:
        self.erased += 1
        self._rom = [ERASED_WORD] * PROGRAM_WORDS
        self._eeprom = [ERASED_BYTE] * EEPROM_BYTES
        self._ids = [ID_BITS] * ID_WORDS
        self._config = ERASED_WORD
        return b"Y"

    def _power_on(self) -> bytes:
        if not self._powered:
            image = self.chip.contents()
            self._rom = image.flash()
            self._eeprom = [image.eeprom.get(n, ERASED_BYTE) for n in range(EEPROM_BYTES)]
            self._ids = [image.ids.get(n, ID_BITS) for n in range(ID_WORDS)]
            self._config = image.chip_config
            self._powered = True
        return b"V"

    def _power_off(self) -> bytes:
        """Restart the chip with its current contents."""
        if not self._powered:
            return b"v"
        self._powered = False
        self.chip.load(
            Image(
                {n: word for n, word in enumerate(self._rom) if word != ERASED_WORD},
                self._config,
                {n: byte for n, byte in enumerate(self._eeprom) if byte != ERASED_BYTE},
                dict(enumerate(self._ids)),
            )
        )
        return b"v"
