"""The library: multiplication, division, tables, variable delays, EEPROM, serial; each routine made on
demand.

In: the name of a routine and its sizes. Out: its `Code`, with parameters and result like any function's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from servogen.compiler.ctypes import U8, U16, U24, U32, IntType
from servogen.compiler.emitter import Code
from servogen.compiler.machine import FSR, INDF, PCL, PCLATH, Reg
from servogen.compiler.routine import Routine
from servogen.compiler.runtime_arith import divide, divide_signed, multiply
from servogen.compiler.runtime_devices import delay_variable, eeprom_read, eeprom_write, getchar, putchar
from servogen.pic.device import register_bits, registers

Library = Callable[[str, tuple[int, ...]], Code]
_UNSIGNED: tuple[IntType, ...] = (U8, U16, U24, U32)
_EEDATA, _EEADR, _EECON1, _EECON2 = (
    Reg(registers()[name].address) for name in ("EEDATA", "EEADR", "EECON1", "EECON2")
)
_GIE, _RD, _WR, _WREN = (register_bits()[name][1] for name in ("GIE", "RD", "WR", "WREN"))


def build(kind: str, key: tuple[int, ...], code: Code, library: Library) -> None:
    """Fill `code` with a routine."""
    _BUILDERS[kind](Routine(code), key, library)


def with_result(code: Code, name: str) -> Code:
    """The same routine seen with another of its variables as the result."""
    return replace(code, result=next(each for each in code.own if each.name == name))


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


_BUILDERS: dict[str, Callable[[Routine, tuple[int, ...], Library], None]] = {
    "mul": multiply,
    "divide": divide,
    "sdivide": divide_signed,
    "flash": _flash_read,
    "delay": delay_variable,
    "eeprom_read": eeprom_read,
    "eeprom_write": eeprom_write,
    "putchar": putchar,
    "getchar": getchar,
}
