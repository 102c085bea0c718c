"""Memory behind an index or a pointer, and bit-fields.

In: objects whose address is computed. Out: instructions that set FSR and go through INDF.
"""

from __future__ import annotations

from servogen.compiler.ctypes import IntType
from servogen.compiler.fold import has_effect
from servogen.compiler.machine import FSR, INDF, Byte, Imm, Loc, Reg
from servogen.compiler.shifting import Shifts
from servogen.compiler.tree import (
    AddressByte,
    Deref,
    Num,
    Ref,
)


class Indirect(Shifts):
    """Adds FSR and fields."""

    def settled(self, target: Ref | Deref) -> Ref | Deref:
        """The same object with its address computed once, into a temporary."""
        from servogen.compiler.ctypes import U8, PointerType

        if isinstance(target, Ref) and (target.index is None or isinstance(target.index, Num)):
            return target
        if isinstance(target, Deref) and self.direct(target.pointer) and not has_effect(target.pointer):
            return target
        held = self.temp()
        self.address_to_w(target)
        self.store(held[0])
        assert isinstance(held[0], Byte)
        pointer = Ref(held[0].symbol, 0, None, PointerType(U8), target.place)
        return Deref(pointer, 0, target.type, target.place, target.bit, target.width)

    def address_to_w(self, target: Ref | Deref) -> None:
        """W = the RAM address of an object."""
        if isinstance(target, Ref):
            base = AddressByte(self.symbol(target.symbol), target.offset, 0)
            if target.index is None:
                self.emit("MOVLW", k=base)
                return
            self.to_w(target.index)
            self.emit("ADDLW", k=base)
            return
        self.to_w(target.pointer)
        if target.offset:
            self.emit("ADDLW", k=target.offset)

    def point(self, target: Ref | Deref) -> None:
        """FSR = the address of an object."""
        self.address_to_w(target)
        self.store(FSR)

    def one_byte_indirect(self, expr: Ref | Deref) -> bool:
        """Load one byte through FSR or from flash straight into W."""
        if expr.width or (isinstance(expr, Deref) and expr.pointer.type.size > 1):
            return False
        if isinstance(expr, Ref) and expr.symbol.kind == "flash":
            self.flash_byte(expr)
            return True
        self.point(expr)
        self.emit("MOVF", INDF, 0)
        return True

    def _indirect_load(self, expr: Ref | Deref, target: list[Loc]) -> None:
        size = min(len(target), expr.type.size)
        self.point(expr)
        for number in range(size):
            if number:
                self.emit("INCF", FSR, 1)
            self.emit("MOVF", INDF, 0)
            self.store(target[number])
        if len(target) > size:
            self.widen(target, size, signed=self.negative_possible(expr))

    def _into_field(self, expr: Ref | Deref, target: list[Loc]) -> None:
        assert expr.bit is not None
        signed = isinstance(expr.type, IntType) and expr.type.signed
        if expr.width == 1 and not signed:
            self.boolean(expr, target)
            return
        byte = self.field_byte(expr)
        self.into(byte, target[:1])
        self.shift_right(target[:1], list(target[:1]), expr.bit, signed=False)
        self.cut_to_field(target[:1], expr)
        if len(target) > 1:
            self.widen(target, 1, signed=signed)

    def cut_to_field(self, value: list[Loc], field: Ref | Deref) -> None:
        """Keep the bits of a value that a bit-field has, with their sign."""
        self.bitwise("&", value, list(value), [Imm((1 << field.width) - 1)])
        if isinstance(field.type, IntType) and field.type.signed:
            self.emit("MOVLW", k=1 << field.width - 1)
            self.emit("XORWF", value[0], 1)
            self.emit("SUBWF", value[0], 1)

    def field_byte(self, expr: Ref | Deref) -> Ref | Deref:
        """The byte that holds a bit-field."""
        from servogen.compiler.ctypes import U8

        if isinstance(expr, Ref):
            return Ref(expr.symbol, expr.offset, expr.index, U8, expr.place)
        return Deref(expr.pointer, expr.offset, U8, expr.place)

    def bit_source(self, loc: Loc) -> Loc:
        """Where a bit can be tested: registers of bank 1 are copied first, no switch can follow a skip."""
        if isinstance(loc, Reg) and loc.address & 0x80:
            held = self.temp()[0]
            self.move(held, loc)
            return held
        return loc
