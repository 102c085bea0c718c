"""`EEPROM24`: the serial EEPROMs 24LC32 to 24LC512, by Microchip's data sheets.

In: the part, its content, its address pins. Out: a device on two pins, SCL and SDA (`devices`).

The data sheets are DS20001203 (24AA256, 24LC256), DS20001189 (24LC64), DS20001191 (24LC128) and DS20001754
(24LC512); sections and parameters below are those of DS20001203.

    start │ 1 0 1 0 A2 A1 A0 0 │a│ address, high │a│ address, low │a│ data │a│ … │ stop       writing
    start │ 1 0 1 0 A2 A1 A0 0 │a│ address, high │a│ address, low │a│
    start │ 1 0 1 0 A2 A1 A0 1 │a│ data │m│ data │m│ … │ data │ │ stop                         reading

a: the EEPROM's acknowledge, a low SDA in the ninth clock; m: that of the reader. Bits are taken at SCL's
rise; SDA changes at its fall. A start or a stop, SDA changing while SCL is high, ends whatever was going on.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum, auto
from fractions import Fraction
from types import MappingProxyType
from typing import Any, NamedTuple

from servogen.errors import Diagnostic, InputError, Location
from servogen.units import Clock

ERASED = 0xFF
CONTROL, READ = 0b1010, 1
"""The upper four bits of the control byte, and its lowest bit of a reading (section 5.0)."""
SCL, SDA = 1, 2
"""The lines, as bits."""
WRITE_S = Fraction(5, 1000)
"""TWC, parameter 17: the maximum time of a write of a byte or a page."""


class MemorySize(NamedTuple):
    """The bytes of a part and of its page."""

    size: int
    page: int


PARTS: Mapping[str, MemorySize] = MappingProxyType(
    {
        "24LC32": MemorySize(4096, 32),
        "24LC64": MemorySize(8192, 32),
        "24LC128": MemorySize(16384, 64),
        "24LC256": MemorySize(32768, 64),
        "24LC512": MemorySize(65536, 128),
    }
)


class Limit(NamedTuple):
    """A minimum time of the data sheet's table 1-2, from 2.5 V on."""

    name: str
    words: str
    ns: int


HIGH_TIME = Limit("THIGH", "SCL is high", 600)
LOW_TIME = Limit("TLOW", "SCL is low", 1300)
START_HOLD = Limit("THD:STA", "a start comes before SCL's fall", 600)
START_SETUP = Limit("TSU:STA", "SCL is high before a start", 600)
DATA_SETUP = Limit("TSU:DAT", "SDA is ready before SCL's rise", 100)
STOP_SETUP = Limit("TSU:STO", "SCL is high before a stop", 600)
FREE_TIME = Limit("TBUF", "the bus is free before a start", 1300)


class Phase(Enum):
    """What an EEPROM takes next, or does."""

    STANDBY = auto()
    CONTROL = auto()
    HIGH = auto()
    LOW = auto()
    WRITING = auto()
    READING = auto()


@dataclass(frozen=True, slots=True)
class EEPROM24:
    """A serial EEPROM as it is before its power is on. Raises InputError for what no such part is."""

    content: bytes = b""
    """Its bytes from address 0 on; the others are erased."""
    part: str = "24LC256"
    address: int = 0
    """The levels of its pins A2, A1 and A0."""
    protected: bool = False
    """Whether its pin WP is high: writes are acknowledged and have no effect (section 6.3)."""

    def __post_init__(self) -> None:
        if self.part not in PARTS:
            raise InputError("unknown-name", f"'{self.part}' is no such EEPROM", hint=", ".join(PARTS))
        if not 0 <= self.address <= 7:
            raise InputError("out-of-range", f"address = {self.address} is not between 0 and 7")
        if len(self.content) > PARTS[self.part].size:
            raise InputError(
                "does-not-fit",
                f"{len(self.content)} bytes do not fit the {PARTS[self.part].size} of a {self.part}",
            )

    @property
    def lines(self) -> tuple[str, ...]:
        return "scl", "sda"

    def power_up(self, clock: Clock) -> RunningEEPROM:
        return RunningEEPROM(self, clock)


class RunningEEPROM:
    """A serial EEPROM under power; after power-up it waits for a start."""

    def __init__(self, device: EEPROM24, clock: Clock) -> None:
        self._device = device
        self.size, self.page = PARTS[device.part]
        self.memory = device.content.ljust(self.size, bytes([ERASED]))
        """The content now; a written page is in it from the stop on."""
        self._control = CONTROL << 3 | device.address
        self._protected = device.protected
        self._write_cycles = math.ceil(WRITE_S * clock.cycles_per_second)
        self._clock = clock
        limits = (HIGH_TIME, LOW_TIME, START_HOLD, START_SETUP, DATA_SETUP, STOP_SETUP, FREE_TIME)
        cycles = [math.ceil(Fraction(limit.ns, 10**9) * clock.cycles_per_second) for limit in limits]
        self._high, self._low, self._hold, self._setup, self._data, self._stop, self._free = cycles
        self._noted: dict[str, tuple[int, Diagnostic]] = {}
        """The first breach of each limit."""
        self._levels = SCL | SDA
        self._pulls = 0
        self._phase = Phase.STANDBY
        self._bits = 0
        """The clocks of the current byte so far, nine with its acknowledge."""
        self._shift = 0
        self._pointer = 0
        """The address counter (section 8.1); its value at power-up is not specified, here 0."""
        self._received: tuple[tuple[int, int], ...] = ()
        """The bytes to be written, with their addresses."""
        self._busy_until = 0
        self._scl_at = self._sda_at = self._start_at = self._stop_at = -(1 << 40)
        """The cycles of the last changes, of the last start and of the last stop."""

    def off(self) -> EEPROM24:
        return replace(self._device, content=self.memory)

    @property
    def clocks(self) -> int | None:
        """Return the clocks of the current byte so far, 0 to 8; None where it waits for a start."""
        return None if self._phase is Phase.STANDBY else self._bits % 9

    def snapshot(self) -> Any:
        return (
            self.memory, tuple(self._noted.items()), self._levels, self._pulls, self._phase, self._bits,
            self._shift, self._pointer, self._received, self._busy_until, self._scl_at, self._sda_at,
            self._start_at, self._stop_at,
        )  # fmt: skip

    def restore(self, state: Any) -> None:
        (
            self.memory, noted, self._levels, self._pulls, self._phase, self._bits, self._shift,
            self._pointer, self._received, self._busy_until, self._scl_at, self._sda_at, self._start_at,
            self._stop_at,
        ) = state  # fmt: skip
        self._noted = dict(noted)

    def relative(self, cycle: int) -> Any:
        """Return a snapshot, with nothing noted, as if `cycle` were 0; what is long ago is all the same."""
        memory, _, *state, busy, scl, sda, start, stop = self.snapshot()
        longest = self._low + self._free
        times = (max(at - cycle, -longest) for at in (scl, sda, start, stop))
        return memory, (), *state, max(0, busy - cycle), *times

    @property
    def remarks(self) -> tuple[tuple[int, Diagnostic], ...]:
        return tuple(self._noted.values())

    def react(self, cycle: int, levels: int) -> int:
        changed = levels ^ self._levels
        self._levels = levels
        if changed & SCL:
            if levels & SCL:
                self._rise(cycle, levels, changed)
            else:
                self._fall(cycle)
            self._scl_at = cycle
        elif changed and levels & SCL:
            if levels & SDA:
                self._stopped(cycle)
            else:
                self._started(cycle)
        if changed & SDA:
            self._sda_at = cycle
        return self._pulls

    def _rise(self, cycle: int, levels: int, changed: int) -> None:
        """Take a bit, or the reader's acknowledge."""
        if cycle - self._scl_at < self._low:
            self._remark(cycle, LOW_TIME, cycle - self._scl_at)
        if self._phase is Phase.STANDBY:
            return
        if changed & SDA or cycle - self._sda_at < self._data:
            self._remark(cycle, DATA_SETUP, 0)
        self._bits += 1
        if self._phase is Phase.READING:
            if self._bits == 9 and levels & SDA:  # no acknowledge: the reader wants no more (section 8.0)
                self._phase = Phase.STANDBY
        elif self._bits <= 8:
            self._shift = self._shift << 1 & 0xFF | levels >> 1

    def _fall(self, cycle: int) -> None:
        """Let go of SDA, acknowledge, or give the next bit."""
        if cycle - self._scl_at < self._high:
            self._remark(cycle, HIGH_TIME, cycle - self._scl_at)
        if cycle - self._start_at < self._hold:
            self._remark(cycle, START_HOLD, cycle - self._start_at)
        self._pulls = 0
        if self._phase is Phase.STANDBY:
            return
        if self._bits == 9:
            self._bits = 0
        if self._phase is Phase.READING:
            self._give()
        elif self._bits == 8:
            self._take(cycle)

    def _give(self) -> None:
        """Put the next bit of the byte at the pointer on SDA; the ninth is the reader's."""
        if self._bits == 0:
            self._shift = self.memory[self._pointer]
            self._pointer = (self._pointer + 1) % self.size  # rolls over (section 8.3)
        if self._bits < 8:
            self._pulls = 0 if self._shift >> 7 - self._bits & 1 else SDA

    def _take(self, cycle: int) -> None:
        """Act on a byte that has arrived, and acknowledge it."""
        byte, phase = self._shift, self._phase
        if phase is Phase.CONTROL:
            if byte >> 1 != self._control or cycle < self._busy_until:  # section 7.0: no acknowledge yet
                self._phase = Phase.STANDBY
                return
            self._phase = Phase.READING if byte & READ else Phase.HIGH
        elif phase is Phase.HIGH:
            self._pointer = byte << 8 & self.size - 1
            self._phase = Phase.LOW
        elif phase is Phase.LOW:
            self._pointer = self._pointer | byte
            self._phase = Phase.WRITING
        else:
            self._received = (*self._received, (self._pointer, byte))
            first = self._pointer & -self.page  # the address wraps within the page (section 6.2)
            self._pointer = first | (self._pointer + 1) % self.page
        self._pulls = SDA

    def _started(self, cycle: int) -> None:
        """Begin anew, also in the midst of a byte; what was to be written is forgotten."""
        if cycle - self._scl_at < self._setup:
            self._remark(cycle, START_SETUP, cycle - self._scl_at)
        if cycle - self._stop_at < self._free:
            self._remark(cycle, FREE_TIME, cycle - self._stop_at)
        self._phase, self._bits, self._received = Phase.CONTROL, 0, ()
        self._pulls, self._start_at = 0, cycle

    def _stopped(self, cycle: int) -> None:
        """Write what was received, if the stop comes after an acknowledge: its byte is complete."""
        if cycle - self._scl_at < self._stop:
            self._remark(cycle, STOP_SETUP, cycle - self._scl_at)
        if self._phase is Phase.WRITING and self._received and self._bits == 1 and not self._protected:
            memory = bytearray(self.memory)
            for address, byte in self._received:
                memory[address] = byte
            self.memory = bytes(memory)
            self._busy_until = cycle + self._write_cycles
        self._phase, self._bits, self._received = Phase.STANDBY, 0, ()
        self._pulls, self._stop_at = 0, cycle

    def _remark(self, cycle: int, limit: Limit, cycles: int) -> None:
        if limit.name in self._noted:
            return
        ns = float(Fraction(cycles * 10**9) / self._clock.cycles_per_second)
        text = f"{limit.name}: {limit.words} for {ns:g} ns, and the EEPROM needs {limit.ns}"
        remark = Diagnostic("warning", "device-timing", text, Location(cycle=cycle))
        self._noted[limit.name] = cycle, remark
