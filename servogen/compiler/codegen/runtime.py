"""The library: multiplication, division, tables, variable delays, EEPROM, serial; each routine is generated
on demand.

In: the kind of a routine and its sizes. Out: its `Function`, with parameters and a result like any other
function.
"""

from __future__ import annotations

from collections.abc import Callable

from servogen.compiler.ast.nodes import Symbol
from servogen.compiler.ast.types import U8, U16, U24, U32, IntType
from servogen.compiler.codegen.arithmetic import (
    add,
    compare_less,
    negate,
    one_left,
    one_right,
    rotate_right,
    subtract,
    zero_test,
)
from servogen.compiler.ir.builder import InstructionBuilder, Library
from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import (
    DELAY,
    FSR,
    INDF,
    INTCON,
    PCL,
    PCLATH,
    STATUS,
    Byte,
    C,
    Imm,
    Instruction,
    Loc,
    Reg,
    Z,
)
from servogen.pic.device import register_bits, registers

_UNSIGNED: tuple[IntType, ...] = (U8, U16, U24, U32)


def variable(
    gen: InstructionBuilder, name: str, size: int, *, parameter: bool = False, in_w: bool = False
) -> list[Loc]:
    """Return the bytes of a new variable of a library routine, low byte first."""
    symbol = Symbol(name, _UNSIGNED[size - 1], "param" if parameter else "temp", function=gen.function.name)
    gen.function.own.append(symbol)
    if parameter:
        gen.function.parameters.append(symbol)
    if in_w:
        gen.function.w_parameter = symbol
    return [Byte(symbol, index) for index in range(size)]


def parameter(gen: InstructionBuilder, name: str, size: int, *, in_w: bool = False) -> list[Loc]:
    """Return the bytes of a new parameter of a library routine, low byte first."""
    return variable(gen, name, size, parameter=True, in_w=in_w)


def multiply(gen: InstructionBuilder, key: tuple[int, ...], library: Library) -> None:
    """Emit a shift-and-add multiplication of `key[0]` bytes by `key[1]` bytes to `key[2]` bytes."""
    width, factor, size = key
    if (width, factor, size) == (1, 1, 2):
        _multiply_8_to_16(gen)
        return
    if width + factor == size:
        _multiply_to_the_right(gen, width, factor)
        return
    a, b = parameter(gen, "a", size), parameter(gen, "b", factor)
    product = variable(gen, "product", size)
    assert isinstance(product[0], Byte)
    gen.function.result = product[0].symbol
    gen.clear(product)
    loop, no_add = gen.new_label(), gen.new_label()
    gen.label(loop, 8 * factor)
    one_right(gen, b, signed=False)
    gen.goto_if(C, False, no_add)
    add(gen, product, list(product), list(a))
    gen.label(no_add)
    one_left(gen, a)
    # the loop ends as soon as no bit of the factor is left
    zero_test(gen, b)
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
    gen.move(low, Imm(0x80))
    gen.load(a[0])
    loop = gen.new_label()
    gen.label(loop, 8)
    gen.emit("RRF", b[0], 1)
    gen.skip_if(C, False)
    gen.emit("ADDWF", high, 1)
    gen.emit("RRF", high, 1)
    gen.emit("RRF", low, 1)
    gen.goto_if(C, False, loop)
    gen.emit("RETURN")


def _multiply_to_the_right(gen: InstructionBuilder, width: int, factor: int) -> None:
    """Emit a multiplication without a lost bit: each sum is added at the top, and the product moves right
    into the bytes that the second factor, its first contents, leaves bit by bit.
    """
    a, product = parameter(gen, "a", width), parameter(gen, "product", width + factor)
    count = variable(gen, "count", 1)[0]
    assert isinstance(product[0], Byte)
    gen.function.result = product[0].symbol
    low, high = product[:factor], product[factor:]
    gen.clear(high)
    gen.move(count, Imm(8 * factor))
    # from here on C is the next bit of the factor; what it was before leaves the product at its end
    rotate_right(gen, low)
    loop, no_add = gen.new_label(), gen.new_label()
    gen.label(loop)
    gen.goto_if(C, False, no_add)
    add(gen, high, list(high), list(a))
    gen.label(no_add)
    rotate_right(gen, product)
    gen.emit("DECFSZ", count, 1)
    gen.goto(loop)
    gen.emit("RETURN")


def multiply_signed(gen: InstructionBuilder, key: tuple[int, ...], library: Library) -> None:
    """Emit a product of `key[0]` signed bytes and as many, which are signed if `key[1]` is not 0: the
    unsigned product, from whose upper half each factor is taken away if the other is negative.
    """
    width, both = key
    inner = library("mul", (width, width, 2 * width))
    a, product = ([Byte(symbol, index) for index in range(symbol.size)] for symbol in inner.parameters)
    gen.function.parameters, gen.function.result = list(inner.parameters), inner.result
    b, high = product[:width], product[width:]
    excess = variable(gen, "excess", width)
    gen.clear(excess)
    for signed, other in ((a, b), (b, a)) if both else ((a, b),):
        positive = gen.new_label()
        gen.goto_if(7, False, positive, signed[-1])
        add(gen, excess, list(excess), list(other))
        gen.label(positive)
    gen.emit("CALL", target=inner.name)
    subtract(gen, list(high), list(high), list(excess))
    gen.emit("RETURN")


def divide(gen: InstructionBuilder, key: tuple[int, ...], library: Library) -> None:
    """Emit an unsigned bit-by-bit division; the quotient fills the bits that the dividend vacates.

    `key` has the bytes of the dividend and of the divisor, and whether twice the remainder may be wider.
    """
    size, width, carry = key
    a, b = parameter(gen, "quotient", size), parameter(gen, "divisor", width)
    rest, count = variable(gen, "remainder", width), variable(gen, "count", 1)[0]
    gen.clear(rest)
    gen.move(count, Imm(8 * size))
    loop, take_away, after = gen.new_label(), gen.new_label(), gen.new_label()
    gen.label(loop)
    # the top bit of the dividend moves into the remainder; a bit of the quotient takes its place
    one_left(gen, [*a, *rest])
    # a remainder that has lost its top bit is greater than any divisor
    if carry:
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
    """Emit a signed division: the unsigned division of the absolute values, sharing its variables.

    `key` is that of the unsigned routine, and whether the divisor may be negative.
    """
    *unsigned, negative_divisor = key
    inner = library("divide", tuple(unsigned))
    dividend, divisor = inner.parameters
    remainder = next(symbol for symbol in inner.own if symbol.name == "remainder")
    a, b, rest = (
        [Byte(symbol, index) for index in range(symbol.size)] for symbol in (dividend, divisor, remainder)
    )
    gen.function.parameters = [dividend, divisor]
    signs = variable(gen, "signs", 1)[0]
    gen.emit("CLRF", signs)
    # bit 0 is the quotient's sign, bit 1 the remainder's, which is the dividend's (ISO C 6.5.5)
    for operand, mask in ((a, 3), (b, 1)) if negative_divisor else ((a, 3),):
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


_EEDATA, _EEADR, _EECON1, _EECON2 = (
    Reg(registers()[name].address) for name in ("EEDATA", "EEADR", "EECON1", "EECON2")
)
_GIE, _RD, _WR, _WREN = (register_bits()[name][1] for name in ("GIE", "RD", "WR", "WREN"))


def _fix(gen: InstructionBuilder) -> None:
    """Mark every instruction as fixed, because the routine takes an exact time."""
    for line in gen.function.lines():
        line.fixed = not (isinstance(line, Instruction) and line.op == DELAY)


def delay_variable(gen: InstructionBuilder, key: tuple[int, ...], library: Library) -> None:
    """Emit a variable delay; none of its instructions may be optimised away."""
    _delay_body(gen, key)
    _fix(gen)


def _delay_body(gen: InstructionBuilder, key: tuple[int, ...]) -> None:
    """Emit a delay of W times `unit` cycles, from the load of W to after the call; values below the minimum
    return at once.
    """
    (unit,) = key
    minimum = min_units(unit)
    # the sum carries if the argument is at least the minimum
    gen.emit("ADDLW", k=-minimum)
    gen.skip_if(C, True)
    gen.emit("RETURN")
    loop = gen.new_label()
    gen.function.bounds[loop] = (255 - minimum >> {1: 2, 2: 1}.get(unit, 0)) + 1
    # the low bits of the argument choose single cycles, the rest counts rounds of four
    if unit in (1, 2):
        count = variable(gen, "count", 1)[0]
        gen.store(count)
        bits = (0, 1, 1) if unit == 1 else (0, 0)
        for bit in bits:  # two cycles when the bit is 0, three when it is 1
            after = gen.new_label()
            gen.goto_if(bit, True, after, count)
            gen.label(after)
        if unit == 1:
            gen.emit("RRF", count, 1)
            gen.emit("RRF", count, 0)
            gen.emit("ANDLW", k=0x3F)
        else:
            gen.emit("NOP")
            gen.emit("RRF", count, 0)
            gen.emit("ANDLW", k=0x7F)
        _count_w(gen, loop)
    elif unit == 4:
        _count_w(gen, loop)
    else:
        count = variable(gen, "count", 1)[0]
        gen.store(count)
        gen.emit("INCF", count, 1)
        if unit == 3:
            gen.label(loop)
            gen.emit("DECFSZ", count, 1)
            gen.goto(loop)
        else:
            body = gen.new_label()
            gen.delay(unit * minimum - 12)
            gen.label(loop)
            gen.emit("DECFSZ", count, 1)
            gen.goto(body)
            gen.emit("RETURN")
            gen.label(body)
            gen.delay(unit - 5)
            gen.goto(loop)
            return
    gen.emit("RETURN")


def _count_w(gen: InstructionBuilder, loop: str) -> None:
    """Emit a loop of 4 W + 4 cycles."""
    gen.emit("ADDLW", k=1)
    gen.label(loop)
    gen.emit("ADDLW", k=-1)
    gen.goto_if(Z, False, loop)


def min_units(unit: int) -> int:
    """Return the minimum argument for which a variable delay with steps of `unit` cycles is exact."""
    return {1: 22, 2: 10}.get(unit, -(-12 // unit))


def eeprom_read(gen: InstructionBuilder, key: tuple[int, ...], library: Library) -> None:
    """Emit a read of the EEPROM (DS35007 section 3.1)."""
    gen.store(_EEADR)
    gen.emit("BSF", _EECON1, b=_RD)
    gen.emit("MOVF", _EEDATA, 0)
    gen.emit("RETURN")


def eeprom_write(gen: InstructionBuilder, key: tuple[int, ...], library: Library) -> None:
    """Emit a write to the EEPROM that waits for its completion. No interrupt may come between 0x55 and 0xAA
    (DS35007 section 3.2).
    """
    gen.function.waits_for = "the EEPROM"
    address, value = parameter(gen, "address", 1)[0], parameter(gen, "value", 1, in_w=True)[0]
    enabled = variable(gen, "enabled", 1)[0]
    del value
    gen.store(_EEDATA)
    gen.load(address)
    gen.store(_EEADR)
    gen.emit("CLRF", enabled)
    gen.skip_if(_GIE, False, INTCON)
    gen.emit("INCF", enabled, 1)
    gen.emit("BCF", INTCON, b=_GIE)
    gen.emit("BSF", _EECON1, b=_WREN)
    gen.move(_EECON2, Imm(0x55))
    gen.move(_EECON2, Imm(0xAA))
    gen.emit("BSF", _EECON1, b=_WR)
    gen.emit("BCF", _EECON1, b=_WREN)
    gen.skip_if(0, False, enabled)
    gen.emit("BSF", INTCON, b=_GIE)
    wait = gen.new_label()
    gen.label(wait)
    # EECON1 is in bank 1, and no bank switch can follow a skip: the bit is tested in W
    gen.emit("MOVF", _EECON1, 0)
    gen.emit("ANDLW", k=1 << _WR)
    gen.goto_if(Z, False, wait)
    gen.emit("RETURN")


def putchar(gen: InstructionBuilder, key: tuple[int, ...], library: Library) -> None:
    """Emit a routine that sends 8 data bits, low bit first, and one stop bit, each exactly `cycles` long."""
    port_address, pin, cycles, inverted = key
    port = Reg(port_address)
    value = parameter(gen, "value", 1, in_w=True)[0]
    count = variable(gen, "count", 1)[0]
    zero, one = ("BSF", "BCF") if inverted else ("BCF", "BSF")
    loop, high, after = gen.new_label(), gen.new_label(), gen.new_label()
    gen.store(value)
    gen.move(count, Imm(9))
    gen.emit(zero, port, b=pin)
    gen.delay(5)
    gen.label(loop)
    gen.delay(cycles - 11)
    gen.emit("BSF", STATUS, b=C)
    gen.emit("RRF", value, 1)
    gen.goto_if(C, True, high)
    # both paths write the pin at the same cycle of the bit
    gen.emit("NOP")
    gen.emit(zero, port, b=pin)
    gen.goto(after)
    gen.label(high)
    gen.emit(one, port, b=pin)
    gen.goto(after)
    gen.label(after)
    gen.emit("DECFSZ", count, 1)
    gen.goto(loop)
    gen.delay(cycles - 6)
    gen.emit("RETURN")
    _fix(gen)


def getchar(gen: InstructionBuilder, key: tuple[int, ...], library: Library) -> None:
    """Emit a routine that waits for a start bit and samples each data bit in its middle."""
    port_address, pin, cycles, inverted = key
    port = Reg(port_address)
    value, count = variable(gen, "value", 1)[0], variable(gen, "count", 1)[0]
    wait, loop = gen.new_label(), gen.new_label()
    gen.function.waits_for = "a start bit"
    gen.label(wait)
    gen.goto_if(pin, not inverted, wait, port)
    gen.move(count, Imm(8))
    # the middle of the first data bit is one and a half bits behind the edge of the start bit
    gen.delay(cycles + cycles // 2 - 6)
    gen.label(loop)
    gen.emit("BSF" if inverted else "BCF", STATUS, b=C)
    gen.skip_if(pin, False, port)
    gen.emit("BCF" if inverted else "BSF", STATUS, b=C)
    gen.emit("RRF", value, 1)
    gen.delay(cycles - 7)
    gen.emit("DECFSZ", count, 1)
    gen.goto(loop)
    gen.load(value)
    gen.emit("RETURN")
    _fix(gen)


def build(kind: str, key: tuple[int, ...], function: Function, library: Library) -> None:
    """Fill `function` with the instructions of a routine."""
    _BUILDERS[kind](InstructionBuilder(function), key, library)


def _flash_read(gen: InstructionBuilder, key: tuple[int, ...], library: Library) -> None:
    """Load the byte behind a pointer to const into W: by a jump into a table of RETLW, or by a read
    from RAM.
    """
    high, low = parameter(gen, "high", 1)[0], parameter(gen, "low", 1, in_w=True)[0]
    flash = gen.new_label()
    gen.goto_if(7, True, flash, high)
    gen.store(FSR)
    gen.emit("MOVF", INDF, 0)
    gen.emit("RETURN")
    gen.label(flash)
    gen.store(low)
    gen.load(high)
    # bit 7 marks flash; PCLATH has five bits and drops it. The RETLW returns to the caller
    gen.store(PCLATH)
    gen.load(low)
    gen.store(PCL)


_BUILDERS: dict[str, Callable[[InstructionBuilder, tuple[int, ...], Library], None]] = {
    "mul": multiply,
    "smul": multiply_signed,
    "divide": divide,
    "sdivide": divide_signed,
    "flash": _flash_read,
    "delay": delay_variable,
    "eeprom_read": eeprom_read,
    "eeprom_write": eeprom_write,
    "putchar": putchar,
    "getchar": getchar,
}
