"""Assignments: in place where that is safe, through a temporary where the value reads its target.

In: targets and values. Out: instructions. A port is written only once, with the final result.
"""

from __future__ import annotations

from servogen.compiler.ast.constant_folding import has_effect
from servogen.compiler.ast.nodes import Binary, Cast, Deref, Expr, Num, Ref, Unary, Update
from servogen.compiler.ast.types import IntType
from servogen.compiler.codegen.arithmetic import WITH_FILE, bitwise, shift_left
from servogen.compiler.codegen.effects import (
    calls_something,
    in_flash,
    is_condition,
    leaves_alone,
    stripped,
    touches,
    update_operand,
    updated,
)
from servogen.compiler.codegen.generator import FunctionGenerator
from servogen.compiler.codegen.indirect import bit_source, field_byte, point_fsr
from servogen.compiler.codegen.operands import is_direct, operand_ready, operands_of, preserved, ref_locs
from servogen.compiler.codegen.operators import to_w
from servogen.compiler.ir.instruction import FSR, INDF, Byte, Imm, Loc, Operand, Reg, exposed


def assign_bytes(gen: FunctionGenerator, target: Ref | Deref, value: list[Operand]) -> None:
    """Store bytes that are already evaluated; they are temporaries or constants."""
    if isinstance(target, Ref) and is_direct(target):
        gen.move_all(ref_locs(gen, target), value)
        return
    point_fsr(gen, target)
    for number, byte in enumerate(value):
        if number:
            gen.emit("INCF", FSR, 1)
        gen.move(INDF, byte)


def assign(gen: FunctionGenerator, target: Ref | Deref, value: Expr) -> None:
    """Emit target = value, for an object of any size and place."""
    if target.width:
        assign_field(gen, target, value)
        return
    size = target.type.size
    if isinstance(target, Ref) and is_direct(target):
        _assign_direct(gen, ref_locs(gen, target), target, value)
        return
    if size == 1 and isinstance(value.type, IntType):
        if not has_effect(value) and operand_ready(value):
            point_fsr(gen, target)
            gen.move(INDF, operands_of(gen, value, 1)[0])
            return
        temporary = gen.temp()[0]
        gen.lower.into(gen, value, [temporary])
        point_fsr(gen, target)
        gen.move(INDF, temporary)
        return
    operands = operands_of(gen, value, size) if value.type.scalar else _struct_value(gen, value)
    # computing the target's address must not change the value
    if has_effect(target) or calls_something(target):
        operands = preserved(gen, operands)
    assign_bytes(gen, target, operands)


def _struct_value(gen: FunctionGenerator, value: Expr) -> list[Operand]:
    """Return the bytes of a structure: its own, or copies."""
    if isinstance(value, Ref) and is_direct(value):
        return list(ref_locs(gen, value))
    copy: list[Loc] = gen.temp(value.type.size)
    gen.lower.into(gen, value, copy)
    return list(copy)


def _assign_direct(gen: FunctionGenerator, locs: list[Loc], target: Ref, value: Expr) -> None:
    """Assign to a variable: in place where that is safe, otherwise through a temporary."""
    symbol_locs: list[Loc] = [Byte(target.symbol, 0)] if isinstance(locs[0], Byte) else locs
    if _in_place(gen, value, locs) or not touches(value, symbol_locs):
        gen.lower.into(gen, value, locs)
        return
    if len(locs) == 1 and (isinstance(value.type, IntType) or value.type.scalar):
        to_w(gen, value)
        gen.store(locs[0])
        return
    temporary: list[Loc] = gen.temp(len(locs))
    gen.lower.into(gen, value, temporary)
    gen.move_all(locs, list(temporary))


def _in_place(gen: FunctionGenerator, value: Expr, locs: list[Loc]) -> bool:
    """Return whether `into` may write the target even though the value reads it: x = x + y, x = -x, x = x <<
    3.
    """
    inner = stripped(value)
    symbols: list[Loc] = [loc if isinstance(loc, Reg) else Byte(loc.symbol, 0) for loc in locs]
    # a value that is extended, or registers side by side, are written in more than one step
    if inner.type.size < len(locs) or (len(locs) > 1 and isinstance(locs[0], Reg)):
        return False
    if is_direct(inner):
        return True
    if isinstance(inner, Binary) and exposed(locs[0]) and _is_identity(inner, len(locs)):
        return False  # in place nothing would be left of it, but a volatile object is read and written
    if isinstance(inner, Unary) and inner.op in "-~" and isinstance(locs[0], Byte):
        return same_bytes(gen, inner.operand, locs)
    if isinstance(inner, Binary) and inner.op in ("+", "-", "&", "|", "^"):
        if same_bytes(gen, inner.left, locs) and not touches(inner.right, symbols):
            return not calls_something(inner.right) and not has_effect(inner.right)
        return (
            inner.op != "-"
            and same_bytes(gen, inner.right, locs)
            and not touches(inner.left, symbols)
            and not calls_something(inner.left)
            and not has_effect(inner.left)
        )
    if isinstance(inner, Binary) and inner.op in ("<<", ">>") and isinstance(locs[0], Byte):
        return same_bytes(gen, inner.left, locs) and isinstance(inner.right, Num)
    return False


def same_bytes(gen: FunctionGenerator, expr: Expr, locs: list[Loc]) -> bool:
    """Return whether an expression is the variable that lies at `locs`."""
    inner = stripped(expr)
    return is_direct(inner) and ref_locs(gen, inner)[: len(locs)] == locs  # type: ignore[arg-type]


def update(gen: FunctionGenerator, expr: Update, target: Ref | Deref) -> None:
    """Generate target = target op value."""
    kind = target.type
    if expr.op == "^" and isinstance(expr.value, Num) and _toggled(gen, target, expr.value.value):
        return
    whole = updated(expr, target)
    plain = not target.width and not (isinstance(kind, IntType) and kind.is_bool)
    behind = plain and kind.size == 1 and not (isinstance(target, Ref) and is_direct(target))
    if behind and _update_indirect(gen, expr.op, target, update_operand(expr)):
        return
    assign(gen, target, whole)


def _toggled(gen: FunctionGenerator, target: Ref | Deref, value: int) -> bool:
    """Toggle a bit in place; return whether the target is a single bit."""
    if target.width != 1 or target.bit is None or not isinstance(target, Ref) or target.index is not None:
        return False
    if value & 1:
        gen.emit("MOVLW", k=1 << target.bit)
        gen.emit("XORWF", gen.loc(target.symbol, target.offset), 1)
    return True


def _update_indirect(gen: FunctionGenerator, op: str, target: Ref | Deref, right: Expr) -> bool:
    """Update one byte behind FSR in place; return whether that was possible."""
    mnemonic = WITH_FILE.get(op)
    if mnemonic is None:
        return False
    if isinstance(right, Num) and op in "+-" and right.value & 0xFF in (1, 0xFF):
        point_fsr(gen, target)
        # INCF and DECF need no operand in W
        up = (right.value & 0xFF == 1) == (op == "+")
        gen.emit("INCF" if up else "DECF", INDF, 1)
        return True
    if operand_ready(right):
        point_fsr(gen, target)
        gen.load(operands_of(gen, right, 1)[0])
    else:
        operand = gen.temp()[0]
        gen.lower.into(gen, right, [operand])
        point_fsr(gen, target)
        gen.load(operand)
    gen.emit(mnemonic, INDF, 1)
    return True


def assign_field(gen: FunctionGenerator, target: Ref | Deref, value: Expr) -> None:
    """Assign to a bit or bit-field."""
    assert target.bit is not None
    byte: Loc
    if isinstance(target, Ref) and target.index is None:
        byte = gen.loc(target.symbol, target.offset)
        pointed = False
    else:
        pointed = True
        byte = INDF
    if target.width == 1 and not (isinstance(target.type, IntType) and target.type.signed):
        _assign_bit(gen, target, byte, value, pointed=pointed)
        return
    mask = (1 << target.width) - 1
    if isinstance(value, Num):
        if pointed:
            point_fsr(gen, field_byte(target))
        gen.emit("MOVF", byte, 0)
        gen.emit("ANDLW", k=~(mask << target.bit))
        if value.value & mask:
            gen.emit("IORLW", k=(value.value & mask) << target.bit)
        gen.store(byte)
        return
    field = gen.temp()
    gen.lower.into(gen, value, field)
    shift_left(gen, field, list(field), target.bit)
    bitwise(gen, "&", field, list(field), [Imm(mask << target.bit & 0xFF)])
    if pointed:
        point_fsr(gen, field_byte(target))
    # the byte is read once and written once, so that no pin of a port changes in between
    gen.emit("MOVF", byte, 0)
    gen.emit("ANDLW", k=~(mask << target.bit))
    gen.emit("IORWF", field[0], 0)
    gen.store(byte)


def _assign_bit(
    gen: FunctionGenerator, target: Ref | Deref, byte: Loc, value: Expr, *, pointed: bool
) -> None:
    """Emit the assignment of a truth value to one bit, which is in `byte`, or behind FSR if `pointed`."""
    bit = target.bit or 0
    turned = _negated(value)
    if isinstance(target, Ref) and isinstance(turned, Ref) and turned.width == 1:
        same = (turned.symbol, turned.offset, turned.bit) == (target.symbol, target.offset, target.bit)
        if same and turned.index is None and _toggled(gen, target, 1):
            return
    low_bit_only = isinstance(value, Cast) and isinstance(value.type, IntType) and value.type.is_bit
    if isinstance(value, Num):
        if pointed:
            point_fsr(gen, field_byte(target))
        gen.emit("BSF" if value.value & 1 else "BCF", byte, b=bit)
        return
    if low_bit_only:
        assert isinstance(value, Cast)
        value = value.operand if is_condition(value.operand) else value
    if pointed:
        temporary = gen.temp()[0]
        gen.lower.into(gen, value, [temporary])
        point_fsr(gen, field_byte(target))
        source: Loc = temporary
        source_bit = 0
    else:
        inner = value
        if isinstance(inner, Cast) and isinstance(inner.type, IntType) and inner.type.is_bit:
            inner = inner.operand
        if not (isinstance(inner, Ref) and inner.width == 1 and inner.index is None) or in_flash(inner):
            _set_by_jumps(gen, byte, bit, value)
            return
        source = bit_source(gen, gen.loc(inner.symbol, inner.offset))
        source_bit = inner.bit or 0
        if source == byte and source_bit == bit and not exposed(source):
            return
        if exposed(source) or source == byte:  # what may change is read once
            _set_by_jumps(gen, byte, bit, inner)
            return
    # two skips take as long for 0 as for 1, and the bit is written once
    gen.skip_if(source_bit, False, source)
    gen.emit("BSF", byte, b=bit)
    gen.skip_if(source_bit, True, source)
    gen.emit("BCF", byte, b=bit)


def _set_by_jumps(gen: FunctionGenerator, byte: Loc, bit: int, value: Expr) -> None:
    """Set or clear a bit by the truth of a value; each path writes it once."""
    no, end = gen.new_label(), gen.new_label()
    gen.lower.jump(gen, value, False, no)
    gen.emit("BSF", byte, b=bit)
    gen.goto(end)
    gen.label(no)
    gen.emit("BCF", byte, b=bit)
    gen.label(end)


def _is_identity(expr: Binary, size: int) -> bool:
    """Return whether the low `size` bytes of a value are those of its variable operand."""
    if isinstance(expr.right, Num):
        return leaves_alone(expr.op, expr.right.value, size)
    return isinstance(expr.left, Num) and expr.op in "+&|^" and leaves_alone(expr.op, expr.left.value, size)


def _negated(value: Expr) -> Expr | None:
    """Return the x of !x, through any conversions; None for other expressions."""
    while isinstance(value, Cast) and isinstance(value.type, IntType):
        value = value.operand
    return value.operand if isinstance(value, Unary) and value.op == "!" else None
