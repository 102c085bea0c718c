"""Shifts by constants and by variables.

In: typed shift expressions. Out: instructions; a right shift is as wide as the range of its left operand.
"""

from __future__ import annotations

from servogen.compiler.effects import calls_something, width_of
from servogen.compiler.fold import has_effect, interval
from servogen.compiler.machine import Loc, Z
from servogen.compiler.operators import Operators
from servogen.compiler.tree import (
    Binary,
    Num,
)


class Shifts(Operators):
    """Adds `<<` and `>>`."""

    def _shift(self, expr: Binary, target: list[Loc], *, left: bool) -> None:
        size = len(target)
        count = expr.right
        if isinstance(count, Num):
            operand = self.apart(target, self.value(expr.left, size))
            if left:
                self.shift_left(target, operand, count.value & 0xFF)
            return
        self._variable_shift(expr, target, size, left=left, signed=False)

    def _right_shift(self, expr: Binary, target: list[Loc]) -> None:
        low, high = interval(expr.left)
        size, signed = width_of(low, high)
        size = min(size, expr.left.type.size)
        count = expr.right
        size = max(size, len(target))
        work = target if len(target) == size else self.temp(size)
        if isinstance(count, Num):
            operand = self.apart(work, self.value(expr.left, size))
            self.shift_right(work, operand, count.value & 0xFF, signed=signed)
        else:
            self._variable_shift(expr, work, size, left=False, signed=signed)
        if work is not target:
            self.move_all(target, list(work[: len(target)]))

    def _variable_shift(
        self, expr: Binary, target: list[Loc], size: int, *, left: bool, signed: bool
    ) -> None:
        held: list[Loc] = self.temp(size)
        count = self.temp()[0]
        if has_effect(expr.left) or calls_something(expr.right) or has_effect(expr.right):
            a, b = self.pair(expr.left, expr.right, size)
            self.move(count, b[0])
            self.move_all(held, a)
        else:
            self.into(expr.right, [count])
            self.into(expr.left, held)
        loop, end = self.new_label(), self.new_label()
        self.emit("MOVF", count, 1)
        self.goto_if(Z, True, end)
        self.label(loop)
        if left:
            self.one_left(held)
        else:
            self.one_right(held, signed=signed)
        self.emit("DECFSZ", count, 1)
        self.goto(loop)
        self.label(end)
        self.move_all(target, list(held))
