"""The library: multiplication, division, tables, variable delays, EEPROM, serial; each routine is generated
on demand.

In: the kind of a routine and its sizes. Out: its `Function`, with parameters and a result like any other
function.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from servogen.compiler.codegen.routine import parameter
from servogen.compiler.codegen.runtime_arithmetic import divide, divide_signed, multiply
from servogen.compiler.codegen.runtime_devices import (
    delay_variable,
    eeprom_read,
    eeprom_write,
    getchar,
    putchar,
)
from servogen.compiler.ir.builder import InstructionBuilder
from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import FSR, INDF, PCL, PCLATH

Library = Callable[[str, tuple[int, ...]], Function]


def build(kind: str, key: tuple[int, ...], function: Function, library: Library) -> None:
    """Fill `function` with the instructions of a routine."""
    _BUILDERS[kind](InstructionBuilder(function), key, library)


def with_result(function: Function, name: str) -> Function:
    """Return the same routine with another of its variables as the result."""
    return replace(function, result=next(each for each in function.own if each.name == name))


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
    gen.store(PCLATH)
    gen.load(low)
    gen.store(PCL)


_BUILDERS: dict[str, Callable[[InstructionBuilder, tuple[int, ...], Library], None]] = {
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
