"""Shifts by constants and by variables.

In: typed shift expressions. Out: instructions; a right shift is as wide as the value range of its left
operand requires.
"""

from __future__ import annotations

from servogen.compiler.ast.constant_folding import has_effect, interval
from servogen.compiler.ast.nodes import Binary, Num
from servogen.compiler.codegen.arithmetic import one_left, one_right, shift_left, shift_right
from servogen.compiler.codegen.effects import calls_something, width_of
from servogen.compiler.codegen.generator import FunctionGenerator
from servogen.compiler.codegen.operands import apart, operands_of, pair
from servogen.compiler.ir.instruction import Loc, Z


def shift(gen: FunctionGenerator, expr: Binary, target: list[Loc], *, left: bool) -> None:
    size = len(target)
    count = expr.right
    if isinstance(count, Num):
        operand = apart(gen, target, operands_of(gen, expr.left, size))
        if left:
            shift_left(gen, target, operand, count.value & 0xFF)
        return
    _variable_shift(gen, expr, target, size, left=left, signed=False)


def right_shift(gen: FunctionGenerator, expr: Binary, target: list[Loc]) -> None:
    low, high = interval(expr.left)
    size, signed = width_of(low, high)
    size = min(size, expr.left.type.size)
    count = expr.right
    size = max(size, len(target))
    work = target if len(target) == size else gen.temp(size)
    if isinstance(count, Num):
        operand = apart(gen, work, operands_of(gen, expr.left, size))
        shift_right(gen, work, operand, count.value & 0xFF, signed=signed)
    else:
        _variable_shift(gen, expr, work, size, left=False, signed=signed)
    if work is not target:
        gen.move_all(target, list(work[: len(target)]))


def _variable_shift(
    gen: FunctionGenerator, expr: Binary, target: list[Loc], size: int, *, left: bool, signed: bool
) -> None:
    held: list[Loc] = gen.temp(size)
    count = gen.temp()[0]
    if has_effect(expr.left) or calls_something(expr.right) or has_effect(expr.right):
        a, b = pair(gen, expr.left, expr.right, size)
        gen.move(count, b[0])
        gen.move_all(held, a)
    else:
        gen.lower.into(gen, expr.right, [count])
        gen.lower.into(gen, expr.left, held)
    loop, end = gen.new_label(), gen.new_label()
    gen.emit("MOVF", count, 1)
    gen.goto_if(Z, True, end)
    gen.label(loop)
    if left:
        one_left(gen, held)
    else:
        one_right(gen, held, signed=signed)
    gen.emit("DECFSZ", count, 1)
    gen.goto(loop)
    gen.label(end)
    gen.move_all(target, list(held))
