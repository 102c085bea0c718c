"""Constants in flash, and the operations of the chip and the library.

In: typed references to flash, built-in operations. Out: instructions.
"""

from __future__ import annotations

from servogen.compiler.adding import imms
from servogen.compiler.calls import Calls
from servogen.compiler.emitter import ISR_SUFFIX
from servogen.compiler.machine import Imm, Ins, Loc, Operand
from servogen.compiler.tables import table_name
from servogen.compiler.tree import (
    AddressByte,
    Binary,
    Builtin,
    Deref,
    Num,
    Ref,
    Symbol,
)


class Flash(Calls):
    """Adds tables and built-ins."""

    def flash_byte(self, expr: Ref) -> None:
        """W = one byte of a table."""
        held = self._flash_index(expr)
        self._flash_call(expr.symbol, held, 0)

    def _flash_index(self, expr: Ref) -> list[Operand]:
        """The byte's number in its table: one byte, or two for large tables."""
        size = 1 if expr.symbol.size <= 256 else 2
        if expr.index is None:
            return [Imm(expr.offset >> 8 * each & 0xFF) for each in range(size)]
        index = expr.index
        if expr.offset:
            kind = index.type
            index = Binary("+", index, Num(expr.offset, kind, expr.place), kind, expr.place)
        return self.value(index, size)

    def _flash_call(self, symbol: Symbol, index: list[Operand], step: int) -> None:
        """W = byte index + step of a flash object."""
        if len(index) == 1:
            self.load(index[0])
            if step:
                self.emit("ADDLW", k=step)
            self.emit("CALL", target=table_name(symbol) + (ISR_SUFFIX if self.isr else ""))
            self.code.ins[-1].table = symbol
            return
        pointer: list[Loc] = self.temp(2)
        self.add(pointer, index, [Imm(AddressByte(symbol, step, 0)), Imm(AddressByte(symbol, step, 1))])
        self._read_pointer(pointer)

    def _read_pointer(self, pointer: list[Loc]) -> None:
        code = self.library("flash", ())
        self.library_call(code, [[pointer[1]], [pointer[0]]])

    def _from_flash(self, expr: Ref, target: list[Loc]) -> None:
        size = min(len(target), expr.type.size)
        index = self._flash_index(expr)
        if size > 1:
            index = self.kept(index)
        for number in range(size):
            self._flash_call(expr.symbol, index, number)
            self.store(target[number])
        if len(target) > size:
            self.widen(target, size, signed=self.negative_possible(expr))

    def _wide_load(self, expr: Deref, target: list[Loc]) -> None:
        size = min(len(target), expr.type.size)
        pointer: list[Loc] = self.temp(2)
        self.into(expr.pointer, pointer)
        if expr.offset:
            self.add(pointer, list(pointer), imms(expr.offset, 2))
        for number in range(size):
            if number:
                self._count_up(pointer)
            self._read_pointer(pointer)
            self.store(target[number])
        if len(target) > size:
            self.widen(target, size, signed=self.negative_possible(expr))

    def builtin(self, expr: Builtin) -> None:
        self.place = expr.place if expr.place.line else self.place
        match expr.name:
            case "instruction":
                self.code.ins.append(Ins(str(expr.data), place=self.place, fixed=True))
            case "delay":
                assert isinstance(expr.data, int)
                self.delay(expr.data)
            case "delay_variable":
                assert isinstance(expr.data, int)
                code = self.library("delay", (expr.data,))
                self.load(self.value(expr.arguments[0], 1)[0])
                self.code.ins[-1].fixed = True  # the load is part of the time
                self.emit("CALL", target=code.name)
            case "eeprom_read":
                code = self.library("eeprom_read", ())
                self.to_w(expr.arguments[0])
                self.emit("CALL", target=code.name)
            case "eeprom_write" | "putchar" | "getchar":
                data = expr.data if isinstance(expr.data, tuple) else ()
                code = self.library(expr.name, tuple(int(each) for each in data))
                operands = [self.value(each, 1) for each in expr.arguments]
                self.library_call(code, operands)
