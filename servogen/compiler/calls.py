"""Calls: arguments, library routines, multiplication, division, tables in flash.

In: typed calls and operators. Out: instructions. Arguments go into the callee's own bytes; the last one of
one byte goes in W. A result of one byte comes back in W, wider ones in the callee's result bytes.
"""

from __future__ import annotations

from servogen.compiler.conditions import Conditions
from servogen.compiler.ctypes import IntType
from servogen.compiler.effects import calls_something, width_of
from servogen.compiler.emitter import Code
from servogen.compiler.fold import has_effect, interval
from servogen.compiler.machine import Byte, Imm, Loc, Operand
from servogen.compiler.tree import (
    Binary,
    Call,
    Expr,
    Num,
)


class Calls(Conditions):
    """Adds calls."""

    def library(self, kind: str, key: tuple[int, ...]) -> Code:
        """The code of a library routine."""
        raise NotImplementedError

    def call(self, expr: Call) -> Code:
        name = expr.function
        code = self.signature(name)
        self._arguments(code, expr.arguments)
        self.place = expr.place if expr.place.line else self.place
        self.emit("CALL", target=code.name)
        return code

    def _arguments(self, code: Code, arguments: list[Expr]) -> None:
        """Arguments that call something go through temporaries, because calls use the callee's bytes."""
        parameters = code.parameters
        ready: list[list[Operand] | None] = [None] * len(arguments)
        for number, (parameter, argument) in enumerate(zip(parameters, arguments, strict=True)):
            later = any(calls_something(each) or has_effect(each) for each in arguments[number + 1 :])
            calls = calls_something(argument) and len(arguments) > 1
            if calls or (later and not isinstance(argument, Num)):
                held: list[Loc] = self.temp(parameter.size)
                self.into(argument, held)
                ready[number] = list(held)
        w_number = None
        for number, (parameter, argument) in enumerate(zip(parameters, arguments, strict=True)):
            if parameter is code.w_parameter:
                w_number = number
                continue
            target: list[Loc] = [Byte(parameter, each) for each in range(parameter.size)]
            done = ready[number]
            if done is not None:
                self.move_all(target, done)
            elif len(arguments) == 1 and calls_something(argument):
                held = self.temp(parameter.size)
                self.into(argument, held)
                self.move_all(target, list(held))
            else:
                self.into(argument, target)
        if w_number is not None:
            done = ready[w_number]
            if done is not None:
                self.load(done[0])
            else:
                self._argument_to_w(arguments[w_number])

    def _argument_to_w(self, argument: Expr) -> None:
        self.to_w(argument) if not _bool_cast(argument) else self._bool_to_w(argument)

    def _bool_to_w(self, argument: Expr) -> None:
        held = self.temp()
        self.into(argument, held)
        self.load(held[0])

    def library_call(self, code: Code, operands: list[list[Operand]]) -> list[Loc]:
        """Call a library routine with operands that are ready; gives its result bytes."""
        w_operand: Operand | None = None
        for parameter, values in zip(code.parameters, operands, strict=True):
            if parameter is code.w_parameter:
                w_operand = values[0]
                continue
            for number, each in enumerate(values):
                self.move(Byte(parameter, number), each)
        if w_operand is not None:
            self.load(w_operand)
        self.emit("CALL", target=code.name)
        if code.result is None:
            return []
        return [Byte(code.result, each) for each in range(code.result.size)]

    def multiply(self, expr: Binary, target: list[Loc]) -> None:
        size = len(target)
        left, right = expr.left, expr.right
        if isinstance(left, Num):
            left, right = right, left
        if isinstance(right, Num) and self._multiply_constant(left, right.value, target):
            return
        (a, b), (c, d) = interval(left), interval(right)
        small = min(a, c) >= 0 and max(b, d) <= 0xFF
        width = 1 if (small and size <= 2) or size == 1 else size
        code = self.library("mul", (width, size))
        one, two = self.pair(left, right, width)
        result = self.library_call(code, [one, two])
        self.move_all(target, list(result[:size]))

    def _multiply_constant(self, left: Expr, value: int, target: list[Loc]) -> bool:
        """By a power of two, or a sum of two: shifts and an addition."""
        size = len(target)
        value &= (1 << 8 * size) - 1
        bits = [bit for bit in range(8 * size) if value >> bit & 1]
        if not bits:
            self.effect(left)
            self.move_all(target, [Imm(0)] * size)
            return True
        if len(bits) == 1:
            operand = self.apart(target, self.value(left, size))
            self.shift_left(target, operand, bits[0])
            return True
        if len(bits) == 2 and bits[1] <= 3 and size <= 2:
            operand = self.kept(self.value(left, size))
            held: list[Loc] = self.temp(size)
            self.shift_left(held, operand, bits[1] - bits[0])
            self.add(held, list(held), operand)
            if bits[0]:
                self.shift_left(held, list(held), bits[0])
            self.move_all(target, list(held))
            return True
        return False

    def divide(self, expr: Binary, target: list[Loc]) -> None:
        (a, b), (c, d) = interval(expr.left), interval(expr.right)
        full = width_of(*interval(expr))[0] if min(a, c) < 0 else 1
        size, signed = width_of(min(a, c), max(b, d))
        size = min(max(size, full), expr.type.size)
        if isinstance(expr.right, Num) and not signed and expr.right.value.bit_count() == 1:
            shift = expr.right.value.bit_length() - 1
            work = target if len(target) >= size else self.temp(size)
            part = work[:size]
            operand = self.apart(part, self.value(expr.left, size))
            if expr.op == "/":
                self.shift_right(part, operand, shift, signed=False)
            else:
                self.bitwise(
                    "&", part, operand, [Imm(expr.right.value - 1 >> 8 * each & 0xFF) for each in range(size)]
                )
            if work is target:
                self.move_all(target[size:], [Imm(0)] * (len(target) - size))
            else:
                self.move_all(target, list(work[: len(target)]))
            return
        code = self.library("sdivide" if signed else "divide", (size,))
        holder = self.library("divide", (size,)) if signed else code
        result_symbol = next(
            each for each in holder.own if each.name == ("quotient" if expr.op == "/" else "remainder")
        )
        one, two = self.pair(expr.left, expr.right, size)
        self.library_call(code, [one, two])
        have = min(len(target), size)
        self.move_all(target[:have], [Byte(result_symbol, each) for each in range(have)])
        if len(target) > have:
            self.widen(target, have, signed=signed)


def _bool_cast(expr: Expr) -> bool:
    return isinstance(expr.type, IntType) and expr.type.is_bool and not isinstance(expr, Num)
