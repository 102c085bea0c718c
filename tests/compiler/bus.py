"""A watcher of the chip's data bus: runs a program and records each access to chosen addresses.

In: an image, addresses, what loads of inputs give. Out: the accesses in order. It is a second implementation
of the instructions (DS35007B table 7-2), made for this alone: no timers, no interrupts, no power-up values.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from servogen.pic.image import Image

_PCL, _STATUS, _FSR, _PCLATH = 2, 3, 4, 10
_BOTH_BANKS = (2, 3, 4, 10, 11)
_RAM = range(0x0C, 0x50)


class Access(NamedTuple):
    """A store, or a load without one; an instruction that changes a byte in place is both, the load first."""

    kind: str
    address: int
    value: int


class Bus:
    """The program up to its last instruction, a jump to itself.

    `inputs` are the values that loads of an address give, one after the other; they start anew with each
    store to the address `mark`.
    """

    def __init__(
        self, image: Image, watched: Iterable[int], inputs: Mapping[int, Sequence[int]], mark: int
    ) -> None:
        self.words = image.program
        self.watched = set(watched)
        self.inputs = inputs
        self.mark = mark
        self.loaded = dict.fromkeys(inputs, 0)
        self.memory = [0] * 256
        self.w, self.pc = 0, 0
        self.stack: list[int] = []
        self.seen: list[Access] = []

    def run(self, limit: int = 20_000) -> list[Access]:
        for _ in range(limit):
            at = self.pc
            self._step()
            if self.pc == at:
                return self.seen
        raise AssertionError(f"the program has not ended after {limit} instructions")

    def _where(self, field: int) -> int:
        field = self.memory[_FSR] if field == 0 else field | (self.memory[_STATUS] & 0x20) << 2
        low = field & 0x7F
        return low if low in _BOTH_BANKS or low in _RAM else field

    def _load(self, address: int) -> int:
        value = self.memory[address]
        if address in self.inputs:
            value = self.inputs[address][self.loaded[address]]
            self.loaded[address] += 1
        if address == _PCL:
            value = self.pc & 0xFF
        if address in self.watched:
            self.seen.append(Access("load", address, value))
        return value

    def _store(self, address: int, value: int) -> None:
        self.memory[address] = value
        if address == self.mark:
            self.loaded = dict.fromkeys(self.inputs, 0)
        if address in self.watched:
            self.seen.append(Access("store", address, value))
        if address == _PCL:
            self.pc = self.memory[_PCLATH] << 8 & 0x1F00 | value

    def _flag(self, bit: int, value: object) -> None:
        self.memory[_STATUS] = self.memory[_STATUS] & ~(1 << bit) | bool(value) << bit

    def _sum(self, left: int, right: int, carry: int = 0) -> int:
        total = left + right + carry
        self._flag(0, total > 0xFF)
        self._flag(1, (left & 15) + (right & 15) + carry > 15)
        return total & 0xFF

    def _step(self) -> None:
        word = self.words.get(self.pc, 0)
        self.pc += 1
        match word >> 12:
            case 0:
                self._byte_oriented(word)
            case 1:
                self._bit_oriented(word)
            case 2:
                if word & 0x800 == 0:
                    self.stack.append(self.pc)
                self.pc = word & 0x7FF
            case _:
                self._literal(word)

    def _byte_oriented(self, word: int) -> None:
        code, to_file, field = word >> 8, word >> 7 & 1, word & 0x7F
        if code == 0 and not to_file:
            if word == 0x008:
                self.pc = self.stack.pop()
            assert word in (0x008, 0x000, 0x064), f"{word:#x} is not for this test"
            return
        address = self._where(field)
        zero: bool = code not in (0x0, 0xB, 0xC, 0xD, 0xE, 0xF)
        carry = self.memory[_STATUS] & 1
        old = 0 if code in (0, 1) else self._load(address)
        match code:
            case 0x0:
                new = self.w
            case 0x1:
                new = 0
            case 0x2:
                new = self._sum(old, self.w ^ 0xFF, 1)
            case 0x3 | 0xB:
                new = old - 1 & 0xFF
            case 0x4:
                new = old | self.w
            case 0x5:
                new = old & self.w
            case 0x6:
                new = old ^ self.w
            case 0x7:
                new = self._sum(old, self.w)
            case 0x8:
                new = old
            case 0x9:
                new = old ^ 0xFF
            case 0xA | 0xF:
                new = old + 1 & 0xFF
            case 0xC:
                new = old >> 1 | carry << 7
                self._flag(0, old & 1)
            case 0xD:
                new = old << 1 & 0xFF | carry
                self._flag(0, old >> 7)
            case _:
                new = old >> 4 | old << 4 & 0xF0
        if zero:
            self._flag(2, new == 0)
        if code in (0xB, 0xF) and new == 0:
            self.pc += 1
        if to_file:
            self._store(address, new)
        else:
            self.w = new

    def _bit_oriented(self, word: int) -> None:
        code, bit, address = word >> 10 & 3, word >> 7 & 7, self._where(word & 0x7F)
        old = self._load(address)
        if code < 2:
            self._store(address, old & ~(1 << bit) | code << bit)
        elif old >> bit & 1 == code - 2:
            self.pc += 1

    def _literal(self, word: int) -> None:
        k = word & 0xFF
        match word >> 8 & 15:
            case 0 | 1 | 2 | 3:
                self.w = k
                return
            case 4 | 5 | 6 | 7:
                self.w, self.pc = k, self.stack.pop()
                return
            case 8:
                self.w |= k
            case 9:
                self.w &= k
            case 10:
                self.w ^= k
            case 12 | 13:
                self.w = self._sum(k, self.w ^ 0xFF, 1)
            case 14 | 15:
                self.w = self._sum(self.w, k)
        self._flag(2, self.w == 0)
