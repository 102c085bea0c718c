"""What the built-in functions are made of: registers, bits, times.

In: names and nodes. Out: typed expressions; whole cycles of a time.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable
from fractions import Fraction
from typing import Any

from pycparser import c_ast

from servogen.compiler.ctypes import BIT, U8, IntType
from servogen.compiler.dialect import ChipBit
from servogen.compiler.statements import Statements
from servogen.compiler.tree import Assign, Binary, Deref, Expr, Num, Ref
from servogen.errors import Place
from servogen.pic.device import register_bits, registers
from servogen.units import Clock, Cycles


class ChipAccess(Statements):
    """Adds references to registers and bits, and delays in cycles."""

    clock: Clock | None = None
    serial_settings: dict[str, str]

    def register_ref(self, name: str, place: Place) -> Ref:
        symbol = self.scopes.register(registers()[name])
        return Ref(symbol, 0, None, U8, place)

    def chip_bit(self, name: str, place: Place) -> Ref:
        register, bit = register_bits()[name]
        return Ref(self.scopes.register(register), 0, None, BIT, place, bit, 1)

    def set_bit(self, target: Ref | Deref, value: int) -> Expr:
        return Assign(target, Num(value, BIT, target.place), BIT, target.place)

    def _bit_number(self, node: Any) -> Expr:
        """A bit's number: a constant, or the name of a bit."""
        if isinstance(node, c_ast.ID):
            found = self.scopes.find(node.name)
            if isinstance(found, ChipBit):
                return Num(found.bit, self.int_type, self.place(node))
        return self.arithmetic(self.expr(node))

    def bit_target(self, variable: Any, number: Any, node: Any) -> Ref | Deref | tuple[Ref | Deref, Expr]:
        """The bit that set_bit and its kin mean; variable and number when the number is not a constant."""
        base = self.expr(variable)
        if not isinstance(base, (Ref, Deref)) or not isinstance(base.type, IntType):
            raise self.fail("the first argument must be a variable or a register", node)
        bit = self._bit_number(number)
        if isinstance(bit, Num):
            found = self.bit_of(base, bit.value, node)
            assert isinstance(found, (Ref, Deref))
            return found
        return base, bit

    def _mask(self, base: Ref | Deref, bit: Expr, place: Place) -> Expr:
        assert isinstance(base.type, IntType)
        work = base.type.plain()
        assert isinstance(work, IntType)
        return Binary("<<", Num(1, work, place), bit, work, place)

    def delay_cycles(self, us: Fraction, node: Any, *, cut: bool = False) -> int:
        """Whole cycles of a time, the nearest or what is left when the rest is cut off; warns of both."""
        if self.clock is None:
            raise self.fail(
                "the clock frequency is not known",
                node,
                hint="say '#pragma CLOCK_FREQ 4000000', '#define _XTAL_FREQ 4000000' or --clock-hz",
            )
        cycles = Cycles(us // self.clock.cycle_us) if cut else self.clock.round_us(us).cycles
        achieved = self.clock.us(cycles)
        if achieved != us:
            self.reporter.warn(
                f"{_decimal(us)} µs is not a whole number of cycles at {self.clock.hz} Hz: "
                f"{cycles} cycles are {_decimal(achieved)} µs",
                self.place(node),
            )
        return cycles

    def constant_us(self, node: Any, *, fractions: bool = False) -> Fraction | None:
        """A constant argument of a delay; with `fractions` also one that is made of floating constants."""
        exact = self._fraction(node) if fractions else None
        if exact is not None:
            return exact
        expr = self.rvalue(self.expr(node))
        return Fraction(expr.value) if isinstance(expr, Num) else None

    def _fraction(self, node: Any) -> Fraction | None:
        """The exact value of `2.5` or `2.5 * 3`; None where there is no floating constant, or no value."""
        match node:
            case c_ast.Constant(type="float" | "double" | "long double", value=text):
                return Fraction(text.rstrip("fFlL")) if _SHORT_FLOAT.fullmatch(text) else None
            case c_ast.UnaryOp(op="+" | "-", expr=inner):
                value = self._fraction(inner)
                return -value if value is not None and node.op == "-" else value
            case c_ast.BinaryOp(op="+" | "-" | "*" | "/"):
                left, right = self._fraction(node.left), self._fraction(node.right)
                if left is None and right is None:
                    return None  # integers follow the rules of integers
                left = self.constant_us(node.left) if left is None else left
                right = self.constant_us(node.right) if right is None else right
                if left is None or right is None or (node.op == "/" and right == 0):
                    return None
                return _ARITHMETIC[node.op](left, right)
        return None


_SHORT_FLOAT = re.compile(r"[\d.]{1,30}([eE][+-]?\d{1,2})?[fFlL]?")
"""Numbers beyond this are no times."""
_ARITHMETIC: dict[str, Callable[[Fraction, Fraction], Fraction]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
}


def _decimal(value: Fraction) -> str:
    return f"{float(value):.10g}"
