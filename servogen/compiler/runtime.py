"""The library: multiplication, division, tables, variable delays, EEPROM, serial; each routine made on
demand.

In: the name of a routine and its sizes. Out: its `Code`, with parameters and result like any function's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from servogen.compiler.arith import Arithmetic
from servogen.compiler.ctypes import U8, U16, U24, U32, IntType
from servogen.compiler.emitter import Code
from servogen.compiler.machine import FSR, INDF, INTCON, PCL, PCLATH, STATUS, Byte, C, Loc, Reg, Z
from servogen.compiler.tree import Symbol
from servogen.pic.device import register_bits, registers

Library = Callable[[str, tuple[int, ...]], Code]
_UNSIGNED: tuple[IntType, ...] = (U8, U16, U24, U32)
_EEDATA, _EEADR, _EECON1, _EECON2 = (
    Reg(registers()[name].address) for name in ("EEDATA", "EEADR", "EECON1", "EECON2")
)
_GIE, _RD, _WR, _WREN = (register_bits()[name][1] for name in ("GIE", "RD", "WR", "WREN"))


class Routine(Arithmetic):
    """Emits a library routine."""

    def __init__(self, code: Code) -> None:
        self.code = code
        self.place = None
        self._labels = 0
        self._temps = 0

    def variable(self, name: str, size: int, *, parameter: bool = False, in_w: bool = False) -> list[Loc]:
        symbol = Symbol(name, _UNSIGNED[size - 1], "param" if parameter else "temp", function=self.code.name)
        self.code.own.append(symbol)
        if parameter:
            self.code.parameters.append(symbol)
        if in_w:
            self.code.w_parameter = symbol
        return [Byte(symbol, each) for each in range(size)]

    def parameter(self, name: str, size: int, *, in_w: bool = False) -> list[Loc]:
        return self.variable(name, size, parameter=True, in_w=in_w)


def build(kind: str, key: tuple[int, ...], code: Code, library: Library) -> None:
    """Fill `code` with a routine."""
    _BUILDERS[kind](Routine(code), key, library)


def with_result(code: Code, name: str) -> Code:
    """The same routine seen with another of its variables as the result."""
    return replace(code, result=next(each for each in code.own if each.name == name))


def _multiply(r: Routine, key: tuple[int, ...], library: Library) -> None:
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


def _divide(r: Routine, key: tuple[int, ...], library: Library) -> None:
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


def _divide_signed(r: Routine, key: tuple[int, ...], library: Library) -> None:
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


def _flash_read(r: Routine, key: tuple[int, ...], library: Library) -> None:
    """W = the byte behind a pointer to const: a jump into a table of RETLW, or a look into RAM."""
    high, low = r.parameter("high", 1)[0], r.parameter("low", 1, in_w=True)[0]
    flash = r.new_label()
    r.goto_if(7, True, flash, high)
    r.store(FSR)
    r.emit("MOVF", INDF, 0)
    r.emit("RETURN")
    r.label(flash)
    r.store(low)
    r.load(high)
    r.store(PCLATH)
    r.load(low)
    r.store(PCL)


def _delay_variable(r: Routine, key: tuple[int, ...], library: Library) -> None:
    """No instruction of it may be optimised away."""
    _delay_body(r, key)
    for ins in r.code.ins:
        ins.fixed = ins.op != "DELAY"


def _delay_body(r: Routine, key: tuple[int, ...]) -> None:
    """W times `unit` cycles, from the load of W to behind the call; less than the minimum returns at once."""
    (unit,) = key
    least = least_units(unit)
    r.emit("ADDLW", k=-least)
    r.skip_if(C, True)
    r.emit("RETURN")
    loop = r.new_label()
    r.code.bounds[loop] = (255 - least >> {1: 2, 2: 1}.get(unit, 0)) + 1
    if unit in (1, 2):
        held = r.variable("count", 1)[0]
        r.store(held)
        bits = (0, 1, 1) if unit == 1 else (0, 0)
        for bit in bits:  # two cycles when the bit is 0, three when it is 1
            after = r.new_label()
            r.goto_if(bit, True, after, held)
            r.label(after)
        if unit == 1:
            r.emit("RRF", held, 1)
            r.emit("RRF", held, 0)
            r.emit("ANDLW", k=0x3F)
        else:
            r.emit("NOP")
            r.emit("RRF", held, 0)
            r.emit("ANDLW", k=0x7F)
        _count_w(r, loop)
    elif unit == 4:
        _count_w(r, loop)
    else:
        held = r.variable("count", 1)[0]
        r.store(held)
        r.emit("INCF", held, 1)
        if unit == 3:
            r.label(loop)
            r.emit("DECFSZ", held, 1)
            r.goto(loop)
        else:
            body = r.new_label()
            r.delay(unit * least - 12)
            r.label(loop)
            r.emit("DECFSZ", held, 1)
            r.goto(body)
            r.emit("RETURN")
            r.label(body)
            r.delay(unit - 5)
            r.goto(loop)
            return
    r.emit("RETURN")


def _count_w(r: Routine, loop: str) -> None:
    """4 W + 4 cycles."""
    r.emit("ADDLW", k=1)
    r.label(loop)
    r.emit("ADDLW", k=-1)
    r.goto_if(Z, False, loop)


def least_units(unit: int) -> int:
    """The least argument for which a variable delay of `unit` cycles a step is exact."""
    return {1: 22, 2: 10, 3: 4, 4: 3}.get(unit, -(-12 // unit))


def _eeprom_read(r: Routine, key: tuple[int, ...], library: Library) -> None:
    """DS35007 section 3.1."""
    r.store(_EEADR)
    r.emit("BSF", _EECON1, b=_RD)
    r.emit("MOVF", _EEDATA, 0)
    r.emit("RETURN")


def _eeprom_write(r: Routine, key: tuple[int, ...], library: Library) -> None:
    """DS35007 section 3.2: no interrupt may come between 0x55 and 0xAA; it waits until the byte is
    written.
    """
    r.code.waits_for = "the EEPROM"
    address, value = r.parameter("address", 1)[0], r.parameter("value", 1, in_w=True)[0]
    enabled = r.variable("enabled", 1)[0]
    del value
    r.store(_EEDATA)
    r.load(address)
    r.store(_EEADR)
    r.emit("CLRF", enabled)
    r.skip_if(_GIE, False, INTCON)
    r.emit("INCF", enabled, 1)
    r.emit("BCF", INTCON, b=_GIE)
    r.emit("BSF", _EECON1, b=_WREN)
    r.emit("MOVLW", k=0x55)
    r.store(_EECON2)
    r.emit("MOVLW", k=0xAA)
    r.store(_EECON2)
    r.emit("BSF", _EECON1, b=_WR)
    r.emit("BCF", _EECON1, b=_WREN)
    r.skip_if(0, False, enabled)
    r.emit("BSF", INTCON, b=_GIE)
    wait = r.new_label()
    r.label(wait)
    r.emit("MOVF", _EECON1, 0)
    r.emit("ANDLW", k=1 << _WR)
    r.goto_if(Z, False, wait)
    r.emit("RETURN")


def _putchar(r: Routine, key: tuple[int, ...], library: Library) -> None:
    """8 data bits, low bit first, one stop bit; every bit is `cycles` long to the cycle."""
    port_address, pin, cycles, inverted = key
    port = Reg(port_address)
    value = r.parameter("value", 1, in_w=True)[0]
    count = r.variable("count", 1)[0]
    zero, one = ("BSF", "BCF") if inverted else ("BCF", "BSF")
    loop, high, after = r.new_label(), r.new_label(), r.new_label()
    r.store(value)
    r.emit("MOVLW", k=9)
    r.store(count)
    r.emit(zero, port, b=pin)
    r.delay(5)
    r.label(loop)
    r.delay(cycles - 11)
    r.emit("BSF", STATUS, b=C)
    r.emit("RRF", value, 1)
    r.goto_if(C, True, high)
    r.emit("NOP")
    r.emit(zero, port, b=pin)
    r.goto(after)
    r.label(high)
    r.emit(one, port, b=pin)
    r.goto(after)
    r.label(after)
    r.emit("DECFSZ", count, 1)
    r.goto(loop)
    r.delay(cycles - 6)
    r.emit("RETURN")
    for ins in r.code.ins:
        ins.fixed = ins.op != "DELAY"


def _getchar(r: Routine, key: tuple[int, ...], library: Library) -> None:
    """Waits for a start bit and samples each bit in its middle."""
    port_address, pin, cycles, inverted = key
    port = Reg(port_address)
    value, count = r.variable("value", 1)[0], r.variable("count", 1)[0]
    wait, loop = r.new_label(), r.new_label()
    r.code.waits_for = "a start bit"
    r.label(wait)
    r.goto_if(pin, not inverted, wait, port)
    r.emit("MOVLW", k=8)
    r.store(count)
    r.delay(cycles + cycles // 2 - 6)
    r.label(loop)
    r.emit("BSF" if inverted else "BCF", STATUS, b=C)
    r.skip_if(pin, False, port)
    r.emit("BCF" if inverted else "BSF", STATUS, b=C)
    r.emit("RRF", value, 1)
    r.delay(cycles - 7)
    r.emit("DECFSZ", count, 1)
    r.goto(loop)
    r.load(value)
    r.emit("RETURN")
    for ins in r.code.ins:
        ins.fixed = ins.op != "DELAY"


_BUILDERS: dict[str, Callable[[Routine, tuple[int, ...], Library], None]] = {
    "mul": _multiply,
    "divide": _divide,
    "sdivide": _divide_signed,
    "flash": _flash_read,
    "delay": _delay_variable,
    "eeprom_read": _eeprom_read,
    "eeprom_write": _eeprom_write,
    "putchar": _putchar,
    "getchar": _getchar,
}
