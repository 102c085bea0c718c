"""Calls: arguments, library routines, multiplication, division, tables in flash.

In: typed calls and operators. Out: instructions. Arguments are written to the callee's own bytes, except that
the last one-byte argument is passed in W. A one-byte result is returned in W, a wider one in the callee's
result bytes.
"""

from __future__ import annotations

from servogen.compiler.ast.constant_folding import has_effect
from servogen.compiler.ast.nodes import Binary, Call, Expr, Num
from servogen.compiler.codegen.arithmetic import add, bitwise, imms, shift_left, shift_right
from servogen.compiler.codegen.effects import calls_something
from servogen.compiler.codegen.expressions import effect, into
from servogen.compiler.codegen.generator import Division, FunctionGenerator
from servogen.compiler.codegen.operands import apart, operands_of, pair, preserved, widen
from servogen.compiler.codegen.operators import to_w
from servogen.compiler.codegen.routines import halvings, is_byte, is_power_of_two, negative, quotient
from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import Byte, Imm, Loc, Operand


def call(gen: FunctionGenerator, expr: Call) -> Function:
    """Emit a call and return the callee, which says where its result is."""
    name = expr.function
    function = gen.signature(name)
    _arguments(gen, function, expr.arguments)
    gen.place = expr.place if expr.place.line else gen.place
    gen.emit("CALL", target=function.name)
    return function


def _arguments(gen: FunctionGenerator, function: Function, arguments: list[Expr]) -> None:
    """Evaluate the arguments; those that contain calls go through temporaries, because a call overwrites the
    callee's bytes.
    """
    parameters = function.parameters
    ready: list[list[Operand] | None] = [None] * len(arguments)
    for number, (parameter, argument) in enumerate(zip(parameters, arguments, strict=True)):
        later = any(calls_something(other) or has_effect(other) for other in arguments[number + 1 :])
        calls = calls_something(argument) and len(arguments) > 1
        if calls or (later and not isinstance(argument, Num)):
            temporary: list[Loc] = gen.temp(parameter.size)
            into(gen, argument, temporary)
            ready[number] = list(temporary)
    w_number = None
    for number, (parameter, argument) in enumerate(zip(parameters, arguments, strict=True)):
        if parameter is function.w_parameter:
            w_number = number
            continue
        target: list[Loc] = [Byte(parameter, index) for index in range(parameter.size)]
        operands = ready[number]
        if operands is not None:
            gen.move_all(target, operands)
        elif len(arguments) == 1 and calls_something(argument):
            temporary = gen.temp(parameter.size)
            into(gen, argument, temporary)
            gen.move_all(target, list(temporary))
        else:
            into(gen, argument, target)
    # W comes last, because evaluating another argument would overwrite it
    if w_number is not None:
        operands = ready[w_number]
        if operands is not None:
            gen.load(operands[0])
        else:
            to_w(gen, arguments[w_number])


def library_call(gen: FunctionGenerator, function: Function, operands: list[list[Operand]]) -> list[Loc]:
    """Call a library routine with evaluated operands, of which it takes the low bytes; return its result
    bytes.
    """
    w_operand: Operand | None = None
    for parameter, values in zip(function.parameters, operands, strict=True):
        if parameter is function.w_parameter:
            w_operand = values[0]
            continue
        for number, value in enumerate(values[: parameter.size]):
            gen.move(Byte(parameter, number), value)
    if w_operand is not None:
        gen.load(w_operand)
    gen.emit("CALL", target=function.name)
    if function.result is None:
        return []
    return [Byte(function.result, index) for index in range(function.result.size)]


def multiply(gen: FunctionGenerator, expr: Binary, target: list[Loc]) -> None:
    """Emit target = left * right: by shifts for some constants, otherwise by a library routine."""
    size = len(target)
    left, right = expr.left, expr.right
    if isinstance(left, Num):
        left, right = right, left
    if isinstance(right, Num) and _multiply_constant(gen, left, right.value, target):
        return
    # the routine takes one turn for each bit of its second factor
    if (is_byte(left) and not is_byte(right)) or negative(right):
        left, right = right, left
    key = gen.context.routines.multiply(left, right, size)
    width, factor, bytes_ = key
    if width < min(bytes_, size) and negative(left):
        function = gen.library("smul", (width, int(negative(right))))
    else:
        function = gen.library("mul", key)
    one, two = pair(gen, left, right, max(width, factor))
    result = library_call(gen, function, [one, two[:factor]])
    gen.move_all(target[:bytes_], list(result[:size]))
    widen(gen, target, bytes_, signed=False)


def _multiply_constant(gen: FunctionGenerator, left: Expr, value: int, target: list[Loc]) -> bool:
    """Multiply by a power of two, or a sum of two powers, with shifts and an addition; return whether that
    applied.
    """
    size = len(target)
    bits = [bit for bit in range(8 * size) if value >> bit & 1]
    if not bits:
        effect(gen, left)
        gen.move_all(target, [Imm(0)] * size)
        return True
    # a power of two
    if len(bits) == 1:
        operand = apart(gen, target, operands_of(gen, left, size))
        shift_left(gen, target, operand, bits[0])
        return True
    if len(bits) == 2 and bits[1] <= 3 and size <= 2:
        operand = preserved(gen, operands_of(gen, left, size))
        product: list[Loc] = gen.temp(size)
        shift_left(gen, product, operand, bits[1] - bits[0])
        add(gen, product, list(product), operand)
        if bits[0]:
            shift_left(gen, product, list(product), bits[0])
        gen.move_all(target, list(product))
        return True
    return False


def divide(gen: FunctionGenerator, expr: Binary, target: list[Loc]) -> None:
    """Emit target = left / right or left % right (ISO C 6.5.5: rounded towards zero)."""
    form = quotient(expr)
    size, signed = form.size, form.signed
    # for unsigned values a power of two divides by a shift, and leaves its remainder in the low bits
    if isinstance(expr.right, Num) and not signed and is_power_of_two(expr.right):
        shift = expr.right.value.bit_length() - 1
        work = target if len(target) >= size else gen.temp(size)
        part = work[:size]
        operand = apart(gen, part, operands_of(gen, expr.left, size))
        if expr.op == "/":
            shift_right(gen, part, operand, shift, signed=False)
        else:
            bitwise(
                gen,
                "&",
                part,
                operand,
                [Imm(expr.right.value - 1 >> 8 * index & 0xFF) for index in range(size)],
            )
        if work is target:
            gen.move_all(target[size:], [Imm(0)] * (len(target) - size))
        else:
            gen.move_all(target, list(work[: len(target)]))
        return
    if signed and halvings(expr, size):
        _divide_by_halving(gen, expr, target, size)
        return
    routines = gen.context.routines
    holder = gen.library("divide", routines.divide(form))
    function = gen.library("sdivide", routines.divide_signed(form)) if signed else holder
    result_symbol = next(
        symbol for symbol in holder.own if symbol.name == ("quotient" if expr.op == "/" else "remainder")
    )
    one, two = pair(gen, expr.left, expr.right, size)
    # x / n and x % n side by side need one call: the routine leaves both results
    if not _divided_already(gen, function, one, two):
        library_call(gen, function, [one, two])
        gen.division = Division(gen.function.blocks[-1].instructions[-1], one, two)
    have = min(len(target), result_symbol.size)
    gen.move_all(target[:have], [Byte(result_symbol, index) for index in range(have)])
    if len(target) > have:
        widen(gen, target, have, signed=signed)


def _divided_already(
    gen: FunctionGenerator, function: Function, dividend: list[Operand], divisor: list[Operand]
) -> bool:
    """Return whether the quotient and the remainder of these operands are still there."""
    latest, blocks = gen.division, gen.function.blocks
    return (
        latest is not None
        and (latest.call.target, latest.dividend, latest.divisor) == (function.name, dividend, divisor)
        and latest.holds_behind(blocks[-1].instructions)
    )


def _divide_by_halving(gen: FunctionGenerator, expr: Binary, target: list[Loc], size: int) -> None:
    """Divide by 2ᵏ: a shift rounds down, so that 2ᵏ - 1 is added to a negative dividend first."""
    shift = halvings(expr, size)
    part: list[Loc] = gen.temp(size)
    gen.move_all(part, operands_of(gen, expr.left, size))
    end = gen.new_label()
    gen.goto_if(7, False, end, part[-1])
    add(gen, part, list(part), imms((1 << shift) - 1, size))
    gen.label(end)
    shift_right(gen, part, list(part), shift, signed=True)
    gen.move_all(target, list(part[: len(target)]))
