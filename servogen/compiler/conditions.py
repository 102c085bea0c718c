"""Code for conditions: bit tests and skips, short circuit, counters.

In: an expression and where to jump when it is true (or false). Out: instructions that jump or fall through.
"""

from __future__ import annotations

from servogen.compiler.comparisons import Comparisons
from servogen.compiler.ctypes import IntType
from servogen.compiler.effects import in_flash, stripped, width_of
from servogen.compiler.fold import COMPARISONS, has_effect, interval
from servogen.compiler.machine import INDF, Imm, Reg, Z, exposed
from servogen.compiler.tree import (
    AddressOf,
    Assign,
    Binary,
    Cast,
    Choice,
    Comma,
    Deref,
    Expr,
    Logic,
    Num,
    Ref,
    Unary,
    Update,
)


class Conditions(Comparisons):
    """Adds `jump`."""

    def jump(self, expr: Expr, sense: bool, label: str) -> None:
        """Go to `label` when the truth of `expr` is `sense`, else fall through."""
        match expr:
            case Num(value):
                if bool(value) == sense:
                    self.goto(label)
            case AddressOf():
                if sense:
                    self.goto(label)
            case Unary("!", operand):
                self.jump(operand, not sense, label)
            case Logic(op, left, right):
                self._logic_jump(op == "||", left, right, sense, label)
            case Comma(first, second):
                self.effect(first)
                self.jump(second, sense, label)
            case Choice(condition, yes, no):
                other, end = self.new_label(), self.new_label()
                self.jump(condition, False, other)
                self.jump(yes, sense, label)
                self.goto(end)
                self.label(other)
                self.jump(no, sense, label)
                self.label(end)
            case Binary(op) if op in COMPARISONS:
                self.comparison(expr, sense, label)
            case Binary("&") if self._bit_test(expr, sense, label):
                pass
            case Cast(operand) if isinstance(expr.type, IntType) and self._same_truth(expr):
                self.jump(operand, sense, label)
            case Cast(operand) if isinstance(expr.type, IntType) and expr.type.is_bit:
                self._lowest_bit(operand, sense, label)
            case Ref() | Deref() if expr.width == 1:
                self._bit(expr, sense, label)
            case Update() if self._counted(expr, sense, label):
                pass
            case Assign(target, value) if (
                not target.width
                and isinstance(target, Ref)
                and self.direct(target)
                and not has_effect(target)
            ):
                self.effect(expr)
                self.zero_test(list(self.ref_locs(target)))
                self.goto_if(Z, not sense, label)
            case _:
                self._nonzero(expr, sense, label)

    def _lowest_bit(self, operand: Expr, sense: bool, label: str) -> None:
        """A conversion to `bit` keeps the lowest bit alone."""
        byte = self.value(operand, 1)[0]
        if isinstance(byte, Imm):
            held = self.temp()[0]
            self.move_all([held], [byte])
            byte = held
        self.goto_if(0, sense, label, self.bit_source(byte))

    def _same_truth(self, expr: Cast) -> bool:
        """A conversion that keeps the value keeps its truth."""
        assert isinstance(expr.type, IntType)
        if expr.type.is_bool and not expr.type.is_bit:
            return True
        if not isinstance(expr.operand.type, IntType):
            return False
        low, high = interval(expr.operand)
        return expr.type.low <= low and high <= expr.type.high

    def _logic_jump(self, either: bool, left: Expr, right: Expr, sense: bool, label: str) -> None:
        if either == sense:
            self.jump(left, sense, label)
            self.jump(right, sense, label)
            return
        end = self.new_label()
        self.jump(left, not sense, end)
        self.jump(right, sense, label)
        self.label(end)

    def _bit(self, expr: Ref | Deref, sense: bool, label: str) -> None:
        assert expr.bit is not None
        if in_flash(expr):
            self.to_w(self.field_byte(expr))
            self.emit("ANDLW", k=1 << expr.bit)
            self.goto_if(Z, not sense, label)
            return
        if isinstance(expr, Ref) and expr.index is None:
            self.goto_if(expr.bit, sense, label, self.bit_source(self.loc(expr.symbol, expr.offset)))
            return
        self.point(self.field_byte(expr))
        self.goto_if(expr.bit, sense, label, INDF)

    def _bit_test(self, expr: Binary, sense: bool, label: str) -> bool:
        """`x & 0x10` as a test of one bit."""
        left, right = stripped(expr.left), expr.right
        if isinstance(expr.left, Num):
            left, right = stripped(expr.right), expr.left
        if not isinstance(right, Num) or not self.direct(left) or not isinstance(left, Ref):
            return False
        mask = right.value & (1 << 8 * expr.type.size) - 1
        if mask.bit_count() != 1:
            return False
        bit = mask.bit_length() - 1
        if bit >= 8 * left.type.size:
            return False
        self.goto_if(bit % 8, sense, label, self.bit_source(self.loc(left.symbol, left.offset + bit // 8)))
        return True

    def _counted(self, expr: Update, sense: bool, label: str) -> bool:
        """`--n`, `n--` and `++n` of one byte by the instructions made for it."""
        target = expr.target
        if not (isinstance(target, Ref) and self.direct(target) and target.type.size == 1):
            return False
        if expr.op not in "+-" or not isinstance(expr.value, Num) or expr.value.value != 1:
            return False
        if isinstance(target.type, IntType) and target.type.is_bool:
            return False
        loc = self.ref_locs(target)[0]
        if isinstance(loc, Reg) and loc.address & 0x80:
            return False
        if expr.post:
            if expr.op == "+" or exposed(loc):
                return False
            self.emit("DECF", loc, 1)
            if sense:
                self.emit("INCFSZ", loc, 0)
                self.goto(label)
            else:
                self.emit("INCF", loc, 0)
                self.goto_if(Z, True, label)
            return True
        if sense:
            self.emit("DECFSZ" if expr.op == "-" else "INCFSZ", loc, 1)
            self.goto(label)
        else:
            self.emit("DECF" if expr.op == "-" else "INCF", loc, 1)
            self.goto_if(Z, True, label)
        return True

    def _nonzero(self, expr: Expr, sense: bool, label: str) -> None:
        size = expr.type.size
        if isinstance(expr.type, IntType):
            size = min(size, width_of(*interval(expr))[0])
        if size == 1:
            self.to_w_with_zero(expr)
        else:
            self.zero_test(self.value(expr, size))
        self.goto_if(Z, not sense, label)
