"""Memory accessed through an index or a pointer, and bit-fields.

In: objects with computed addresses. Out: instructions that set FSR and go through INDF.
"""

from __future__ import annotations

from servogen.compiler.ast.constant_folding import has_effect
from servogen.compiler.ast.nodes import AddressByte, Deref, Num, Ref
from servogen.compiler.ast.types import U8, IntType, PointerType
from servogen.compiler.codegen.arithmetic import bitwise, shift_right
from servogen.compiler.codegen.generator import FunctionGenerator
from servogen.compiler.codegen.operands import is_direct, negative_possible, widen
from servogen.compiler.codegen.operators import to_w
from servogen.compiler.ir.instruction import FSR, INDF, Byte, Imm, Loc, Reg


def settled(gen: FunctionGenerator, target: Ref | Deref) -> Ref | Deref:
    """Return the same object with its address evaluated once, into a temporary."""
    if isinstance(target, Ref) and (target.index is None or isinstance(target.index, Num)):
        return target
    if isinstance(target, Deref) and is_direct(target.pointer) and not has_effect(target.pointer):
        return target
    address = gen.temp()
    address_to_w(gen, target)
    gen.store(address[0])
    assert isinstance(address[0], Byte)
    pointer = Ref(address[0].symbol, 0, None, PointerType(U8), target.place)
    return Deref(pointer, 0, target.type, target.place, target.bit, target.width)


def address_to_w(gen: FunctionGenerator, target: Ref | Deref) -> None:
    """Load the RAM address of an object into W."""
    if isinstance(target, Ref):
        base = AddressByte(gen.symbol(target.symbol), target.offset, 0)
        if target.index is None:
            gen.emit("MOVLW", k=base)
            return
        to_w(gen, target.index)
        gen.emit("ADDLW", k=base)
        return
    to_w(gen, target.pointer)
    if target.offset:
        gen.emit("ADDLW", k=target.offset)


def point_fsr(gen: FunctionGenerator, target: Ref | Deref) -> None:
    """Load the address of an object into FSR."""
    address_to_w(gen, target)
    gen.store(FSR)


def one_byte_indirect(gen: FunctionGenerator, expr: Ref | Deref) -> bool:
    """Load one byte through FSR or from flash straight into W."""
    if expr.width or (isinstance(expr, Deref) and expr.pointer.type.size > 1):
        return False
    if isinstance(expr, Ref) and expr.symbol.kind == "flash":
        gen.lower.flash_byte(gen, expr)
        return True
    point_fsr(gen, expr)
    gen.emit("MOVF", INDF, 0)
    return True


def indirect_load(gen: FunctionGenerator, expr: Ref | Deref, target: list[Loc]) -> None:
    """Store a value that is read through FSR and INDF (DS35007 section 2.5)."""
    size = min(len(target), expr.type.size)
    point_fsr(gen, expr)
    for number in range(size):
        if number:
            gen.emit("INCF", FSR, 1)
        gen.emit("MOVF", INDF, 0)
        gen.store(target[number])
    if len(target) > size:
        widen(gen, target, size, signed=negative_possible(expr))


def into_field(gen: FunctionGenerator, expr: Ref | Deref, target: list[Loc]) -> None:
    """Store the value of a bit-field: its byte, shifted and masked."""
    assert expr.bit is not None
    signed = isinstance(expr.type, IntType) and expr.type.signed
    if expr.width == 1 and not signed:
        gen.lower.boolean(gen, expr, target)
        return
    byte = field_byte(expr)
    gen.lower.into(gen, byte, target[:1])
    shift_right(gen, target[:1], list(target[:1]), expr.bit, signed=False)
    cut_to_field(gen, target[:1], expr)
    if len(target) > 1:
        widen(gen, target, 1, signed=signed)


def cut_to_field(gen: FunctionGenerator, value: list[Loc], field: Ref | Deref) -> None:
    """Reduce a value to the bits that a bit-field holds, and extend its sign."""
    bitwise(gen, "&", value, list(value), [Imm((1 << field.width) - 1)])
    if isinstance(field.type, IntType) and field.type.signed:
        # (x ^ s) - s copies the sign bit s to all bits above it
        gen.emit("MOVLW", k=1 << field.width - 1)
        gen.emit("XORWF", value[0], 1)
        gen.emit("SUBWF", value[0], 1)


def field_byte(expr: Ref | Deref) -> Ref | Deref:
    """Return the byte that holds a bit-field."""
    if isinstance(expr, Ref):
        return Ref(expr.symbol, expr.offset, expr.index, U8, expr.place)
    return Deref(expr.pointer, expr.offset, U8, expr.place)


def bit_source(gen: FunctionGenerator, loc: Loc) -> Loc:
    """Return a location where a bit can be tested. Registers of bank 1 are copied first, because no bank
    switch can follow a skip.
    """
    if isinstance(loc, Reg) and loc.address & 0x80:
        copy = gen.temp()[0]
        gen.move(copy, loc)
        return copy
    return loc
