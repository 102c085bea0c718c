"""Library routines that take their time: variable delays, the EEPROM, serial lines.

In: a `Routine` and its key. Out: its instructions.
"""

from __future__ import annotations

from collections.abc import Callable

from servogen.compiler.ctypes import U8, U16, U24, U32, IntType
from servogen.compiler.emitter import Code
from servogen.compiler.machine import INTCON, STATUS, C, Reg, Z
from servogen.compiler.routine import Routine
from servogen.pic.device import register_bits, registers

Library = Callable[[str, tuple[int, ...]], Code]
_UNSIGNED: tuple[IntType, ...] = (U8, U16, U24, U32)
_EEDATA, _EEADR, _EECON1, _EECON2 = (
    Reg(registers()[name].address) for name in ("EEDATA", "EEADR", "EECON1", "EECON2")
)
_GIE, _RD, _WR, _WREN = (register_bits()[name][1] for name in ("GIE", "RD", "WR", "WREN"))


def delay_variable(r: Routine, key: tuple[int, ...], library: Library) -> None:
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


def eeprom_read(r: Routine, key: tuple[int, ...], library: Library) -> None:
    """DS35007 section 3.1."""
    r.store(_EEADR)
    r.emit("BSF", _EECON1, b=_RD)
    r.emit("MOVF", _EEDATA, 0)
    r.emit("RETURN")


def eeprom_write(r: Routine, key: tuple[int, ...], library: Library) -> None:
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


def putchar(r: Routine, key: tuple[int, ...], library: Library) -> None:
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


def getchar(r: Routine, key: tuple[int, ...], library: Library) -> None:
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
