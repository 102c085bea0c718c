"""Code for conditions: bit tests and skips, comparisons by flags, short circuit.

In: an expression and where to jump when it is true (or false). Out: instructions that jump or fall through.
"""

from __future__ import annotations

from servogen.compiler.ctypes import IntType
from servogen.compiler.effects import stripped, width_of
from servogen.compiler.fold import COMPARISONS, interval
from servogen.compiler.generate import Generator
from servogen.compiler.machine import INDF, Byte, C, Imm, Operand, Reg, Z
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

_MIRRORED = {"<": ">", ">": "<", "<=": ">=", ">=": "<=", "==": "==", "!=": "!="}


class Conditions(Generator):
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
                self._comparison(expr, sense, label)
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
                not target.width and isinstance(target, Ref) and self.direct(target)
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
            if expr.op == "+" or isinstance(loc, Reg):
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

    # comparisons

    def _comparison(self, expr: Binary, sense: bool, label: str) -> None:
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
