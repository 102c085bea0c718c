"""Library routines of arithmetic: multiplication and division of every width.

In: a `Routine` and its sizes. Out: its instructions.
"""

from __future__ import annotations

from collections.abc import Callable

from servogen.compiler.ctypes import U8, U16, U24, U32, IntType
from servogen.compiler.emitter import Code
from servogen.compiler.machine import Byte, C, Reg, Z
from servogen.compiler.routine import Routine
from servogen.pic.device import register_bits, registers

Library = Callable[[str, tuple[int, ...]], Code]
_UNSIGNED: tuple[IntType, ...] = (U8, U16, U24, U32)
_EEDATA, _EEADR, _EECON1, _EECON2 = (
    Reg(registers()[name].address) for name in ("EEDATA", "EEADR", "EECON1", "EECON2")
)
_GIE, _RD, _WR, _WREN = (register_bits()[name][1] for name in ("GIE", "RD", "WR", "WREN"))


def multiply(r: Routine, key: tuple[int, ...], library: Library) -> None:
    width, size = key
    if width == 1 and size == 2:
        _multiply_8_to_16(r)
        return
    a, b = r.parameter("a", size), r.parameter("b", size)
    product = r.variable("product", size)
    assert isinstance(product[0], Byte)
    r.code.result = product[0].symbol
    for each in product:
        r.emit("CLRF", each)
    loop, no_add = r.new_label(), r.new_label()
    r.code.bounds[loop] = 8 * size
    r.label(loop)
    r.one_right(b, signed=False)
    r.goto_if(C, False, no_add)
    r.add(product, list(product), list(a))
    r.label(no_add)
    r.one_left(a)
    r.load(b[0])
    for each in b[1:]:
        r.emit("IORWF", each, 0)
    if size == 1:
        r.emit("IORLW", k=0)
    r.goto_if(Z, False, loop)
    r.emit("RETURN")


def _multiply_8_to_16(r: Routine) -> None:
    """Shift and add from the low bit; the bit that starts at the top of the low byte ends the loop."""
    a, b = r.parameter("a", 1), r.parameter("b", 1, in_w=True)
    low, high = r.variable("product", 2)
    assert isinstance(low, Byte)
    r.code.result = low.symbol
    r.store(b[0])
    r.emit("CLRF", high)
    r.emit("MOVLW", k=0x80)
    r.store(low)
    r.load(a[0])
    loop = r.new_label()
    r.code.bounds[loop] = 8
    r.label(loop)
    r.emit("RRF", b[0], 1)
    r.skip_if(C, False)
    r.emit("ADDWF", high, 1)
    r.emit("RRF", high, 1)
    r.emit("RRF", low, 1)
    r.goto_if(C, False, loop)
    r.emit("RETURN")


def divide(r: Routine, key: tuple[int, ...], library: Library) -> None:
    """Bit by bit: the quotient grows where the dividend leaves."""
    (size,) = key
    a, b = r.parameter("quotient", size), r.parameter("divisor", size)
    rest, count = r.variable("remainder", size), r.variable("count", 1)[0]
    for each in rest:
        r.emit("CLRF", each)
    r.emit("MOVLW", k=8 * size)
    r.store(count)
    loop, subtract, after = r.new_label(), r.new_label(), r.new_label()
    r.label(loop)
    r.one_left([*a, *rest])
    r.goto_if(C, True, subtract)
    r.compare_less(list(rest), list(b))
    r.goto_if(C, False, after)
    r.label(subtract)
    r.subtract(rest, list(rest), list(b))
    r.emit("BSF", a[0], b=0)
    r.label(after)
    r.emit("DECFSZ", count, 1)
    r.goto(loop)
    r.emit("RETURN")


def divide_signed(r: Routine, key: tuple[int, ...], library: Library) -> None:
    """Through the unsigned division of the absolute values, whose variables it uses."""
    inner = library("divide", key)
    dividend, divisor = inner.parameters
    remainder = next(each for each in inner.own if each.name == "remainder")
    size = key[0]
    a, b, rest = ([Byte(symbol, each) for each in range(size)] for symbol in (dividend, divisor, remainder))
    r.code.parameters = [dividend, divisor]
    signs = r.variable("signs", 1)[0]
    r.emit("CLRF", signs)
    for operand, mask in ((a, 3), (b, 1)):
        positive = r.new_label()
        r.goto_if(7, False, positive, operand[-1])
        r.negate(list(operand), list(operand))
        r.emit("MOVLW", k=mask)
        r.emit("XORWF", signs, 1)
        r.label(positive)
    r.emit("CALL", target=inner.name)
    for result, bit in ((a, 0), (rest, 1)):
        positive = r.new_label()
        r.goto_if(bit, False, positive, signs)
        r.negate(list(result), list(result))
        r.label(positive)
    r.emit("RETURN")
