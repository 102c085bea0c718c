"""Values as operands: bytes of variables, constants, temporaries; widened, kept, kept apart.

In: typed expressions. Out: operands of the number of bytes that is asked for. What needs more than naming its
bytes is left to the classes that build on this one; they fill in the methods that are only promised here.
"""

from __future__ import annotations

from servogen.compiler.adding import imms
from servogen.compiler.arith import Arithmetic
from servogen.compiler.ctypes import IntType, VoidType
from servogen.compiler.effects import calls_something, stripped, width_of
from servogen.compiler.emitter import Code
from servogen.compiler.fold import has_effect, interval
from servogen.compiler.machine import Byte, Imm, Loc, Operand
from servogen.compiler.tree import (
    AddressByte,
    AddressOf,
    Binary,
    Builtin,
    Call,
    Cast,
    Deref,
    Expr,
    Num,
    Ref,
)


class Operands(Arithmetic):
    """Adds operands. The methods up to `value` are promises of the classes above."""

    def into(self, expr: Expr, target: list[Loc]) -> None:
        """Store the low len(target) bytes of a value, widened where it has fewer."""
        raise NotImplementedError

    def effect(self, expr: Expr) -> None:
        """Evaluate for what it does."""
        raise NotImplementedError

    def jump(self, expr: Expr, sense: bool, label: str) -> None:
        """Go to `label` when the truth of `expr` is `sense`, else fall through."""
        raise NotImplementedError

    def call(self, expr: Call) -> Code:
        """Call a function; its result is in W or in its result bytes."""
        raise NotImplementedError

    def builtin(self, expr: Builtin) -> None:
        """An operation of the chip or the library; a result is in W."""
        raise NotImplementedError

    def multiply(self, expr: Binary, target: list[Loc]) -> None:
        raise NotImplementedError

    def divide(self, expr: Binary, target: list[Loc]) -> None:
        raise NotImplementedError

    def flash_byte(self, expr: Ref) -> None:
        """W = one byte of a table."""
        raise NotImplementedError

    def one_byte_indirect(self, expr: Ref | Deref) -> bool:
        """Load one byte through FSR or from flash straight into W, where that is possible."""
        raise NotImplementedError

    def boolean(self, expr: Expr, target: list[Loc]) -> None:
        """Store 0 or 1 by a condition."""
        raise NotImplementedError

    def condition_to_w(self, expr: Expr) -> None:
        """W = 0 or 1 by a condition."""
        raise NotImplementedError

    def value(self, expr: Expr, size: int) -> list[Operand]:
        """Operands of the low `size` bytes; they stay good until something is assigned or called."""
        match expr:
            case Num(value):
                return imms(value, size)
            case AddressOf(target) if target.index is None:
                return self._address_operands(target, expr.type.size, size)
            case Ref() if self.direct(expr):
                return self.extended(list(self.ref_locs(expr)), expr, size)
            case Cast(operand) if isinstance(expr.type, IntType) and not expr.type.is_bool:
                if expr.type.size >= size and operand.type.scalar:
                    return self.value(operand, size)
                inner = self.value(operand, expr.type.size)
                return self.extended(inner, expr, size)
            case Cast(operand) if not isinstance(expr.type, (IntType, VoidType)) and operand.type.scalar:
                return self.extended(self._pointer_cast(expr), expr, size)
        need = min(size, expr.type.size, width_of(*interval(expr))[0])
        held: list[Loc] = self.temp(need)
        self.into(expr, held)
        return self.extended(list(held), expr, size)

    def _pointer_cast(self, expr: Cast) -> list[Operand]:
        operand, size = expr.operand, expr.type.size
        return self.value(operand, size)

    def _address_operands(self, target: Ref, have: int, size: int) -> list[Operand]:
        symbol = self.symbol(target.symbol)
        found: list[Operand] = [
            Imm(AddressByte(symbol, target.offset, part)) for part in range(min(have, size))
        ]
        return found + imms(0, size - len(found))

    def extended(self, operands: list[Operand], expr: Expr, size: int) -> list[Operand]:
        """The bytes of a value, widened by its sign or zeros, or cut."""
        if len(operands) >= size:
            return operands[:size]
        missing = size - len(operands)
        if not self.negative_possible(expr):
            return operands + imms(0, missing)
        operands = [*operands[:-1], self.steady(operands[-1])]
        sign = self.sign_byte(operands[-1])
        return operands + [sign] * missing

    def widen(self, target: list[Loc], size: int, *, signed: bool) -> None:
        """Fill the bytes above `size` with the sign or zeros."""
        fill: Operand = Imm(0)
        if signed:
            top = target[size]
            self.emit("CLRF", top)
            self.skip_if(7, False, target[size - 1])
            self.emit("COMF", top, 1)
            self.move_all(target[size + 1 :], [top] * (len(target) - size - 1))
            return
        self.move_all(target[size:], [fill] * (len(target) - size))

    def _widen_result(self, expr: Expr, target: list[Loc], size: int) -> None:
        if len(target) > size:
            self.widen(target, size, signed=self.negative_possible(expr))

    def negative_possible(self, expr: Expr) -> bool:
        return isinstance(expr.type, IntType) and expr.type.signed and interval(expr)[0] < 0

    def direct(self, expr: Expr) -> bool:
        """A whole variable, or a part of one at a known offset."""
        return isinstance(expr, Ref) and expr.index is None and not expr.width and expr.symbol.kind != "flash"

    def ref_locs(self, expr: Ref) -> list[Loc]:
        return self.locs(expr.symbol, expr.offset, expr.type.size)

    def pair(self, left: Expr, right: Expr, size: int) -> tuple[list[Operand], list[Operand]]:
        """Operands of two values; the first survives the evaluation of the second."""
        if not has_effect(right) and not calls_something(right):
            a = self.value(left, size)
            return a, self.value(right, size)
        b_first = not has_effect(left) and not calls_something(left)
        if b_first:
            b = self.kept(self.value(right, size))
            return self.value(left, size), b
        a = self.kept(self.value(left, size))
        return a, self.value(right, size)

    def kept(self, operands: list[Operand]) -> list[Operand]:
        """Copies of the operands that are variables, so that nothing can change them."""
        variables = [each for each in operands if not isinstance(each, Imm) and not self._is_temp(each)]
        if not variables:
            return operands
        held: list[Loc] = self.temp(len(operands))
        self.move_all(held, operands)
        return list(held)

    def _is_temp(self, operand: Operand) -> bool:
        return isinstance(operand, Byte) and operand.symbol.kind == "temp"

    def apart(self, target: list[Loc], operands: list[Operand]) -> list[Operand]:
        """Operands of which no byte is a target byte of another position."""
        for number, each in enumerate(operands):
            if any(each == t and at != number for at, t in enumerate(target)):
                held: list[Loc] = self.temp(len(operands))
                self.move_all(held, operands)
                return list(held)
        return operands

    def _constant(self, expr: Expr) -> bool:
        return isinstance(stripped(expr), Num) or (
            isinstance(stripped(expr), AddressOf) and stripped(expr).target.index is None  # type: ignore[union-attr]
        )

    def _simple_operand(self, expr: Expr) -> bool:
        """Its low byte is a byte of memory already."""
        return self.direct(stripped(expr))

    def _operand_ready(self, value: Expr) -> bool:
        return self._constant(value) or self._simple_operand(value)
