"""Assignments: in place where that is safe, through a temporary where the value reads its target.

In: targets and values. Out: instructions. A port is written once, with the result.
"""

from __future__ import annotations

from servogen.compiler.ctypes import CType, IntType
from servogen.compiler.effects import calls_something, in_flash, is_condition, stripped, touches
from servogen.compiler.fold import has_effect
from servogen.compiler.indirect import Indirect
from servogen.compiler.machine import FSR, INDF, Byte, Imm, Loc, Operand, Reg, exposed
from servogen.compiler.tree import (
    Binary,
    Cast,
    Deref,
    Expr,
    Num,
    Ref,
    Unary,
    Update,
)


class Assignments(Indirect):
    """Adds `=`, `op=`, `++` and `--`."""

    def assign_bytes(self, target: Ref | Deref, value: list[Operand]) -> None:
        """Store bytes that are ready; they are temporaries or constants."""
        if isinstance(target, Ref) and self.direct(target):
            self.move_all(self.ref_locs(target), value)
            return
        self.point(target)
        for number, each in enumerate(value):
            if number:
                self.emit("INCF", FSR, 1)
            self.move(INDF, each)

    def _assign(self, target: Ref | Deref, value: Expr) -> None:
        if target.width:
            self.assign_field(target, value)
            return
        size = target.type.size
        if isinstance(target, Ref) and self.direct(target):
            self._assign_direct(self.ref_locs(target), target, value)
            return
        if size == 1 and isinstance(value.type, IntType):
            if not has_effect(value) and self._operand_ready(value):
                self.point(target)
                self.move(INDF, self.value(value, 1)[0])
                return
            held = self.temp()[0]
            self.into(value, [held])
            self.point(target)
            self.move(INDF, held)
            return
        operands = self.value(value, size) if value.type.scalar else self._struct_value(value)
        if has_effect(target) or calls_something(target):
            operands = self.kept(operands)
        self.assign_bytes(target, operands)

    def _struct_value(self, value: Expr) -> list[Operand]:
        if isinstance(value, Ref) and self.direct(value):
            return list(self.ref_locs(value))
        held: list[Loc] = self.temp(value.type.size)
        self.into(value, held)
        return list(held)

    def _assign_direct(self, locs: list[Loc], target: Ref, value: Expr) -> None:
        """A variable: in place where that is safe, else through a temporary."""
        symbol_locs: list[Loc] = [Byte(target.symbol, 0)] if isinstance(locs[0], Byte) else locs
        if self._in_place(value, locs) or not touches(value, symbol_locs):
            self.into(value, locs)
            return
        if len(locs) == 1 and (isinstance(value.type, IntType) or value.type.scalar):
            self.to_w(value)
            self.store(locs[0])
            return
        held: list[Loc] = self.temp(len(locs))
        self.into(value, held)
        self.move_all(locs, list(held))

    def _in_place(self, value: Expr, locs: list[Loc]) -> bool:
        """Whether `into` may write the target although the value reads it: x = x + y, x = -x, x = x << 3."""
        inner = stripped(value)
        symbols: list[Loc] = [each if isinstance(each, Reg) else Byte(each.symbol, 0) for each in locs]
        if inner.type.size < len(locs) or (len(locs) > 1 and isinstance(locs[0], Reg)):
            return False
        if self.direct(inner):
            return True
        if isinstance(inner, Unary) and inner.op in "-~" and isinstance(locs[0], Byte):
            return self._same_bytes(inner.operand, locs)
        if isinstance(inner, Binary) and inner.op in ("+", "-", "&", "|", "^"):
            if self._same_bytes(inner.left, locs) and not touches(inner.right, symbols):
                return not calls_something(inner.right) and not has_effect(inner.right)
            return (
                inner.op != "-"
                and self._same_bytes(inner.right, locs)
                and not touches(inner.left, symbols)
                and not calls_something(inner.left)
                and not has_effect(inner.left)
            )
        if isinstance(inner, Binary) and inner.op in ("<<", ">>") and isinstance(locs[0], Byte):
            return self._same_bytes(inner.left, locs) and isinstance(inner.right, Num)
        return False

    def _same_bytes(self, expr: Expr, locs: list[Loc]) -> bool:
        inner = stripped(expr)
        return self.direct(inner) and self.ref_locs(inner)[: len(locs)] == locs  # type: ignore[arg-type]

    def _update(self, expr: Update, target: Ref | Deref) -> None:
        """target = target op value"""
        kind = target.type
        if expr.op == "^" and isinstance(expr.value, Num) and self._toggled(target, expr.value.value):
            return
        whole = self.updated(expr, target)
        plain = not target.width and not (isinstance(kind, IntType) and kind.is_bool)
        behind = plain and kind.size == 1 and not (isinstance(target, Ref) and self.direct(target))
        if behind and self._update_indirect(expr.op, target, _operand(expr)):
            return
        self._assign(target, whole)

    def updated(self, expr: Update, old: Ref | Deref) -> Expr:
        """Return what `op=` stores, from the value that the object has had."""
        kind, right = old.type, _operand(expr)
        left: Expr = old if kind.plain() == expr.work else Cast(old, expr.work, expr.place)
        same = isinstance(right, Num) and _leaves_alone(expr.op, right.value, kind)
        whole = left if same else Binary(expr.op, left, right, expr.work, expr.place)
        if isinstance(kind, IntType) and kind.plain() != expr.work:
            return Cast(whole, kind.plain(), expr.place)
        return whole

    def _toggled(self, target: Ref | Deref, value: int) -> bool:
        """Turn one bit over where it lies. True when it was done."""
        if target.width != 1 or target.bit is None or not isinstance(target, Ref) or target.index is not None:
            return False
        if value & 1:
            self.emit("MOVLW", k=1 << target.bit)
            self.emit("XORWF", self.loc(target.symbol, target.offset), 1)
        return True

    def _update_indirect(self, op: str, target: Ref | Deref, right: Expr) -> bool:
        """One byte behind FSR, changed where it lies."""
        mnemonic = {"+": "ADDWF", "-": "SUBWF", "&": "ANDWF", "|": "IORWF", "^": "XORWF"}.get(op)
        if mnemonic is None:
            return False
        if isinstance(right, Num) and op in "+-" and right.value & 0xFF in (1, 0xFF):
            self.point(target)
            up = (right.value & 0xFF == 1) == (op == "+")
            self.emit("INCF" if up else "DECF", INDF, 1)
            return True
        if self._operand_ready(right):
            self.point(target)
            self.load(self.value(right, 1)[0])
        else:
            held = self.temp()[0]
            self.into(right, [held])
            self.point(target)
            self.load(held)
        self.emit(mnemonic, INDF, 1)
        return True

    def assign_field(self, target: Ref | Deref, value: Expr) -> None:
        """A bit or bit-field."""
        assert target.bit is not None
        byte: Loc
        if isinstance(target, Ref) and target.index is None:
            byte = self.loc(target.symbol, target.offset)
            pointed = False
        else:
            pointed = True
            byte = INDF
        if target.width == 1 and not (isinstance(target.type, IntType) and target.type.signed):
            self._assign_bit(target, byte, value, pointed=pointed)
            return
        mask = (1 << target.width) - 1
        if isinstance(value, Num):
            if pointed:
                self.point(self.field_byte(target))
            self.emit("MOVF", byte, 0)
            self.emit("ANDLW", k=~(mask << target.bit))
            if value.value & mask:
                self.emit("IORLW", k=(value.value & mask) << target.bit)
            self.store(byte)
            return
        held = self.temp()
        self.into(value, held)
        self.shift_left(held, list(held), target.bit)
        self.bitwise("&", held, list(held), [Imm(mask << target.bit & 0xFF)])
        if pointed:
            self.point(self.field_byte(target))
        self.emit("MOVF", byte, 0)
        self.emit("ANDLW", k=~(mask << target.bit))
        self.emit("IORWF", held[0], 0)
        self.store(byte)

    def _assign_bit(self, target: Ref | Deref, byte: Loc, value: Expr, *, pointed: bool) -> None:
        bit = target.bit or 0
        turned = _negated(value)
        if isinstance(target, Ref) and isinstance(turned, Ref) and turned.width == 1:
            same = (turned.symbol, turned.offset, turned.bit) == (target.symbol, target.offset, target.bit)
            if same and turned.index is None and self._toggled(target, 1):
                return
        low_bit_only = isinstance(value, Cast) and isinstance(value.type, IntType) and value.type.is_bit
        if isinstance(value, Num):
            if pointed:
                self.point(self.field_byte(target))
            self.emit("BSF" if value.value & 1 else "BCF", byte, b=bit)
            return
        if low_bit_only:
            assert isinstance(value, Cast)
            value = value.operand if is_condition(value.operand) else value
        if pointed:
            held = self.temp()[0]
            self.into(value, [held])
            self.point(self.field_byte(target))
            source: Loc = held
            source_bit = 0
        else:
            inner = value
            if isinstance(inner, Cast) and isinstance(inner.type, IntType) and inner.type.is_bit:
                inner = inner.operand
            if not (isinstance(inner, Ref) and inner.width == 1 and inner.index is None) or in_flash(inner):
                self._set_by_jumps(byte, bit, value)
                return
            source = self.bit_source(self.loc(inner.symbol, inner.offset))
            source_bit = inner.bit or 0
            if source == byte and source_bit == bit:
                return
            if exposed(source) or source == byte:  # what may change is read once
                self._set_by_jumps(byte, bit, inner)
                return
        self.skip_if(source_bit, False, source)
        self.emit("BSF", byte, b=bit)
        self.skip_if(source_bit, True, source)
        self.emit("BCF", byte, b=bit)

    def _set_by_jumps(self, byte: Loc, bit: int, value: Expr) -> None:
        no, end = self.new_label(), self.new_label()
        self.jump(value, False, no)
        self.emit("BSF", byte, b=bit)
        self.goto(end)
        self.label(no)
        self.emit("BCF", byte, b=bit)
        self.label(end)


def _operand(expr: Update) -> Expr:
    """Return the right operand of `op=` in the type in which it is computed; a shift's count stays."""
    right = expr.value
    if expr.op in ("<<", ">>") or right.type.plain() == expr.work:
        return right
    if isinstance(right, Num):
        return Num(right.value, expr.work, expr.place)
    return Cast(right, expr.work, expr.place)


def _leaves_alone(op: str, value: int, kind: CType) -> bool:
    """Return whether `op= value` keeps every value of a type."""
    if isinstance(kind, IntType) and kind.is_bool:
        return False
    mask = (1 << 8 * kind.size) - 1
    match op:
        case "+" | "-" | "|" | "^":
            return value & mask == 0
        case "&":
            return value & mask == mask
        case "<<" | ">>":
            return value == 0
        case "*" | "/":
            return value == 1
    return False


def _negated(value: Expr) -> Expr | None:
    """x of !x, whatever it is converted to."""
    while isinstance(value, Cast) and isinstance(value.type, IntType):
        value = value.operand
    return value.operand if isinstance(value, Unary) and value.op == "!" else None
