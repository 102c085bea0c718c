"""Library routines for arithmetic: multiplication and division of every width.

In: a builder and the operand sizes. Out: its instructions.
"""

from __future__ import annotations

from collections.abc import Callable

from servogen.compiler.codegen.arithmetic import add, compare_less, negate, one_left, one_right, subtract
from servogen.compiler.codegen.routine import parameter, variable
from servogen.compiler.ir.builder import InstructionBuilder
from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import Byte, C, Z

Library = Callable[[str, tuple[int, ...]], Function]


def multiply(gen: InstructionBuilder, key: tuple[int, ...], library: Library) -> None:
    width, size = key
    if width == 1 and size == 2:
        _multiply_8_to_16(gen)
        return
    a, b = parameter(gen, "a", size), parameter(gen, "b", size)
    product = variable(gen, "product", size)
    assert isinstance(product[0], Byte)
    gen.function.result = product[0].symbol
    for each in product:
        gen.emit("CLRF", each)
    loop, no_add = gen.new_label(), gen.new_label()
    gen.function.bounds[loop] = 8 * size
    gen.label(loop)
    one_right(gen, b, signed=False)
    gen.goto_if(C, False, no_add)
    add(gen, product, list(product), list(a))
    gen.label(no_add)
    one_left(gen, a)
    gen.load(b[0])
    for each in b[1:]:
        gen.emit("IORWF", each, 0)
    if size == 1:
        gen.emit("IORLW", k=0)
    gen.goto_if(Z, False, loop)
    gen.emit("RETURN")


def _multiply_8_to_16(gen: InstructionBuilder) -> None:
    """Emit a shift-and-add multiplication from the low bit; a sentinel that starts at the top of the low byte
    ends the loop.
    """
    a, b = parameter(gen, "a", 1), parameter(gen, "b", 1, in_w=True)
    low, high = variable(gen, "product", 2)
    assert isinstance(low, Byte)
    gen.function.result = low.symbol
    gen.store(b[0])
    gen.emit("CLRF", high)
    gen.emit("MOVLW", k=0x80)
    gen.store(low)
    gen.load(a[0])
    loop = gen.new_label()
    gen.function.bounds[loop] = 8
    gen.label(loop)
    gen.emit("RRF", b[0], 1)
    gen.skip_if(C, False)
    gen.emit("ADDWF", high, 1)
    gen.emit("RRF", high, 1)
    gen.emit("RRF", low, 1)
    gen.goto_if(C, False, loop)
    gen.emit("RETURN")


def divide(gen: InstructionBuilder, key: tuple[int, ...], library: Library) -> None:
    """Emit an unsigned bit-by-bit division; the quotient fills the bits that the dividend vacates."""
    (size,) = key
    a, b = parameter(gen, "quotient", size), parameter(gen, "divisor", size)
    rest, count = variable(gen, "remainder", size), variable(gen, "count", 1)[0]
    for each in rest:
        gen.emit("CLRF", each)
    gen.emit("MOVLW", k=8 * size)
    gen.store(count)
    loop, take_away, after = gen.new_label(), gen.new_label(), gen.new_label()
    gen.label(loop)
    one_left(gen, [*a, *rest])
    gen.goto_if(C, True, take_away)
    compare_less(gen, list(rest), list(b))
    gen.goto_if(C, False, after)
    gen.label(take_away)
    subtract(gen, rest, list(rest), list(b))
    gen.emit("BSF", a[0], b=0)
    gen.label(after)
    gen.emit("DECFSZ", count, 1)
    gen.goto(loop)
    gen.emit("RETURN")


def divide_signed(gen: InstructionBuilder, key: tuple[int, ...], library: Library) -> None:
    """Emit a signed division: the unsigned division of the absolute values, sharing its variables."""
    inner = library("divide", key)
    dividend, divisor = inner.parameters
    remainder = next(each for each in inner.own if each.name == "remainder")
    size = key[0]
    a, b, rest = ([Byte(symbol, each) for each in range(size)] for symbol in (dividend, divisor, remainder))
    gen.function.parameters = [dividend, divisor]
    signs = variable(gen, "signs", 1)[0]
    gen.emit("CLRF", signs)
    for operand, mask in ((a, 3), (b, 1)):
        positive = gen.new_label()
        gen.goto_if(7, False, positive, operand[-1])
        negate(gen, list(operand), list(operand))
        gen.emit("MOVLW", k=mask)
        gen.emit("XORWF", signs, 1)
        gen.label(positive)
    gen.emit("CALL", target=inner.name)
    for result, bit in ((a, 0), (rest, 1)):
        positive = gen.new_label()
        gen.goto_if(bit, False, positive, signs)
        negate(gen, list(result), list(result))
        gen.label(positive)
    gen.emit("RETURN")
