"""Code for comparisons: by the flags of a subtraction or an exclusive or, and tests for zero.

In: two operands and where to jump. Out: instructions that jump or fall through.
"""

from __future__ import annotations

from servogen.compiler.ctypes import IntType
from servogen.compiler.effects import stripped, width_of
from servogen.compiler.fold import interval
from servogen.compiler.generate import Generator
from servogen.compiler.machine import Byte, C, Imm, Operand, Reg, Z
from servogen.compiler.tree import (
    Binary,
    Expr,
    Num,
)

_MIRRORED = {"<": ">", ">": "<", "<=": ">=", ">=": "<=", "==": "==", "!=": "!="}


class Comparisons(Generator):
    """Adds `comparison` and tests for zero."""

    def comparison(self, expr: Binary, sense: bool, label: str) -> None:
        left, right, op = expr.left, expr.right, expr.op
        if isinstance(left, Num) and not isinstance(right, Num):
            left, right, op = right, left, _MIRRORED[op]
        size, signed = self._width(left, right)
        if op in ("==", "!="):
            self._equality(left, right, size, sense == (op == "=="), label)
            return
        if isinstance(right, Num):
            bound, op = right.value, op
            if op == ">":
                bound, op = bound + 1, ">="
            elif op == "<=":
                bound, op = bound + 1, "<"
            self._against_constant(left, bound, size, signed, sense == (op == ">="), label)
            return
        # left < right or left >= right, by turning the others around
        if op in (">", "<="):
            left, right, op = right, left, _MIRRORED[op]
        a, b = self.pair(left, right, size)
        if signed:
            a, b = self.biased(a), self.biased(b)
        self.compare_less(a, b)
        self.goto_if(C, sense == (op == ">="), label)

    def _width(self, left: Expr, right: Expr) -> tuple[int, bool]:
        if not isinstance(left.type, IntType) or not isinstance(right.type, IntType):
            return max(left.type.size, right.type.size), False
        (a, b), (c, d) = interval(left), interval(right)
        return width_of(min(a, c), max(b, d))

    def _against_constant(
        self, left: Expr, bound: int, size: int, signed: bool, at_least: bool, label: str
    ) -> None:
        """Jump when (left >= bound) is `at_least`."""
        low, high = interval(left)
        if not isinstance(left.type, IntType):
            low, high = 0, (1 << 8 * size) - 1
        if bound > high or bound <= low:  # decided by the range of the type
            self.effect(left)
            if (bound <= low) == at_least:
                self.goto(label)
            return
        size, signed = width_of(min(low, bound), max(high, bound))
        if signed and bound == 0:
            top = self.value(left, size)[-1]
            if isinstance(top, (Byte, Reg)):
                self.goto_if(7, not at_least, label, self.bit_source(top))
                return
        if size == 1:
            if signed:
                self.to_w(left)
                self.emit("XORLW", k=0x80)
                self.emit("ADDLW", k=0x100 - (bound + 0x80))
            elif bound == 1:
                self.to_w_with_zero(left)
                self.goto_if(Z, not at_least, label)
                return
            elif bound == 0x80 and self.direct(stripped(left)):
                top = self.value(left, 1)[0]
                assert not isinstance(top, Imm)
                self.goto_if(7, at_least, label, self.bit_source(top))
                return
            elif self.direct(stripped(left)):
                operand = self.value(left, 1)[0]
                assert not isinstance(operand, Imm)
                self.emit("MOVLW", k=bound)
                self.emit("SUBWF", operand, 0)
            else:
                self.to_w(left)
                self.emit("ADDLW", k=0x100 - bound)
            self.goto_if(C, at_least, label)
            return
        operands = self.value(left, size)
        if signed:
            operands = self.biased(operands)
            bound += 1 << 8 * size - 1
        self.compare_less(operands, [Imm(bound >> 8 * each & 0xFF) for each in range(size)])
        self.goto_if(C, at_least, label)

    def _equality(self, left: Expr, right: Expr, size: int, equal: bool, label: str) -> None:
        """Jump when (left == right) is `equal`."""
        if isinstance(right, Num):
            value = right.value & (1 << 8 * size) - 1
            low, high = interval(left)
            if isinstance(left.type, IntType) and not low <= right.value <= high:
                self.effect(left)
                if not equal:
                    self.goto(label)
                return
            if size == 1 and value:
                self.to_w(left)
                self.emit("XORLW", k=value)
                self.goto_if(Z, equal, label)
                return
            if value == 0:
                self.jump(left, not equal, label)
                return
        if size == 1:
            self.binary_w(Binary("^", left, right, left.type, left.place))
            self.goto_if(Z, equal, label)
            return
        a, b = self.pair(left, right, size)
        other = self.new_label()
        for number, (one, two) in enumerate(zip(a, b, strict=True)):
            self._differ(one, two)
            if number == size - 1:
                self.goto_if(Z, equal, label)
            else:
                self.goto_if(Z, False, other if equal else label)
        if equal:
            self.label(other)

    def _differ(self, one: Operand, two: Operand) -> None:
        """Z = the bytes are equal."""
        if isinstance(one, Imm):
            one, two = two, one
        if two == Imm(0) and not isinstance(one, Imm):
            self.emit("MOVF", one, 0)
        elif isinstance(one, Imm):
            self.load(one)
            self.emit("XORLW", k=two.value if isinstance(two, Imm) else 0)
        elif isinstance(two, Imm):
            self.load(one)
            self.emit("XORLW", k=two.value)
        else:
            self.load(two)
            self.emit("XORWF", one, 0)

    # zero

    def to_w_with_zero(self, expr: Expr) -> None:
        """W = a one-byte value and Z = whether it is zero."""
        self.to_w(expr)
        last = self.code.ins[-1]
        sets_zero = last.op in _SETS_Z and last.d == 0 and last.writes_w
        if sets_zero and not self._skipped_last():
            return
        self.emit("IORLW", k=0)

    def _skipped_last(self) -> bool:
        """Whether the last instruction may have been skipped or jumped over."""
        return len(self.code.ins) > 1 and self.code.ins[-2].op in ("BTFSC", "BTFSS", "INCFSZ", "DECFSZ")

    def zero_test(self, operands: list[Operand]) -> None:
        """Z = all bytes are zero."""
        variables = [each for each in operands if each != Imm(0)]
        if not variables:
            self.emit("MOVLW", k=0)
            self.emit("IORLW", k=0)
            return
        self.load(variables[0])
        if isinstance(variables[0], Imm):
            self.emit("IORLW", k=0)
        for each in variables[1:]:
            if isinstance(each, Imm):
                self.emit("IORLW", k=each.value)
            else:
                self.emit("IORWF", each, 0)


_SETS_Z = frozenset(
    [
        "ADDLW",
        "ANDLW",
        "IORLW",
        "XORLW",
        "SUBLW",
        "ADDWF",
        "ANDWF",
        "IORWF",
        "XORWF",
        "SUBWF",
        "MOVF",
        "COMF",
        "INCF",
        "DECF",
    ]
)
