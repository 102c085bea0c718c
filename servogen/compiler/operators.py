"""Arithmetic and bitwise operators, through W where one byte is wanted.

In: typed expressions. Out: instructions. Sums, differences and bitwise operations are done in as many bytes
as the result has; the low bytes of a sum depend on the low bytes of its operands only.
"""

from __future__ import annotations

from servogen.compiler.effects import changes, is_condition, stripped
from servogen.compiler.machine import Byte, Imm, Loc, Operand
from servogen.compiler.operands import Operands
from servogen.compiler.tree import (
    AddressByte,
    Binary,
    Builtin,
    Call,
    Deref,
    Expr,
    Num,
    Ref,
    Unary,
)


class Operators(Operands):
    """Adds binary operators and `to_w`."""

    def _simple(self, expr: Binary, target: list[Loc]) -> None:
        size = len(target)
        if size == 1 and self._through_w(expr, target[0]):
            return
        a, b = self.pair(expr.left, expr.right, size)
        a, b = self.apart(target, a), self.apart(target, b)
        self._apply(expr.op, target, a, b)

    def _apply(self, op: str, target: list[Loc], a: list[Operand], b: list[Operand]) -> None:
        if op == "+":
            self.add(target, a, b)
        elif op == "-":
            self.subtract(target, a, b)
        else:
            self.bitwise(op, target, a, b)

    def _through_w(self, expr: Binary, target: Loc) -> bool:
        """One byte: compute in W, store once. True when it was done that way."""
        left, right = expr.left, expr.right
        if self._simple_operand(left) and self.value(left, 1)[0] == target:
            return False
        if expr.op != "-" and self._simple_operand(right) and self.value(right, 1)[0] == target:
            return False
        self.binary_w(expr)
        self.store(target)
        return True

    def binary_w(self, expr: Binary) -> None:
        """W = the low byte of a sum, difference or bitwise operation."""
        left, right, op = expr.left, expr.right, expr.op
        if (op != "-" and self._simple_operand(left) and not self._simple_operand(right)) or (
            op != "-" and self._constant(left)
        ):
            left, right = right, left
        if self._constant(right):
            value = self.value(right, 1)[0]
            assert isinstance(value, Imm)
            if op == "-":
                if isinstance(value.value, int):
                    self.to_w(left)
                    self._w_constant("+", -value.value & 0xFF)
                    return
            else:
                self.to_w(left)
                self._w_constant(op, value.value)
                return
        if op == "-" and self._constant(left):
            self.to_w(right)
            value = self.value(left, 1)[0]
            assert isinstance(value, Imm)
            self.emit("SUBLW", k=value.value)
            return
        mnemonic = {"+": "ADDWF", "-": "SUBWF", "&": "ANDWF", "|": "IORWF", "^": "XORWF"}[op]
        if op == "-":
            # f - W: the left operand must be in memory, the right one in W
            if self._simple_operand(left) and not changes(right):
                self.to_w(right)
                self.emit(mnemonic, self.value(left, 1)[0], 0)  # type: ignore[arg-type]
                return
            held = self.temp()[0]
            self.into(left, [held])
            self.to_w(right)
            self.emit(mnemonic, held, 0)
            return
        if self._simple_operand(right) and not changes(left):
            self.to_w(left)
            self.emit(mnemonic, self.value(right, 1)[0], 0)  # type: ignore[arg-type]
            return
        held = self.temp()[0]
        self.into(left, [held])
        self.to_w(right)
        self.emit(mnemonic, held, 0)

    def _w_constant(self, op: str, value: int | AddressByte) -> None:
        mnemonic = {"+": "ADDLW", "&": "ANDLW", "|": "IORLW", "^": "XORLW"}[op]
        neutral = 0xFF if op == "&" else 0
        if value != neutral:
            self.emit(mnemonic, k=value)

    def to_w(self, expr: Expr) -> None:
        """W = the low byte of a value."""
        inner = stripped(expr)
        if isinstance(inner, Num) or self.direct(inner):
            self.load(self.value(inner, 1)[0])
        elif isinstance(inner, Binary) and inner.op in ("+", "-", "&", "|", "^"):
            self.binary_w(inner)
        elif isinstance(inner, Unary) and inner.op in ("-", "~"):
            self._unary_w(inner)
        elif isinstance(inner, Call):
            code = self.call(inner)
            if not code.returns_w:
                assert code.result is not None
                self.load(Byte(code.result, 0))
        elif isinstance(inner, Builtin):
            self.builtin(inner)
        elif isinstance(inner, (Ref, Deref)) and self.one_byte_indirect(inner):
            return
        elif is_condition(inner):
            self.condition_to_w(inner)
        else:
            self.load(self.value(inner, 1)[0])

    def _unary_w(self, expr: Unary) -> None:
        operand = stripped(expr.operand)
        if expr.op == "~":
            if self.direct(operand):
                self.emit("COMF", self.value(operand, 1)[0], 0)  # type: ignore[arg-type]
            else:
                self.to_w(operand)
                self.emit("XORLW", k=0xFF)
        else:
            self.to_w(operand)
            self.emit("SUBLW", k=0)
