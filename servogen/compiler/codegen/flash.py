"""Constants in flash, and the operations of the chip and the library.

In: typed references to flash, built-in operations. Out: instructions.
"""

from __future__ import annotations

from servogen.compiler.ast.nodes import AddressByte, Binary, Builtin, Deref, Num, Ref, Symbol
from servogen.compiler.codegen.arithmetic import add, count_up, imms
from servogen.compiler.codegen.calls import library_call
from servogen.compiler.codegen.expressions import into
from servogen.compiler.codegen.generator import FunctionGenerator
from servogen.compiler.codegen.operands import kept, negative_possible, operands_of, widen
from servogen.compiler.codegen.operators import to_w
from servogen.compiler.codegen.tables import table_name
from servogen.compiler.ir.function import ISR_SUFFIX
from servogen.compiler.ir.instruction import Imm, Loc, Operand


def flash_byte(gen: FunctionGenerator, expr: Ref) -> None:
    """Load one byte of a table into W."""
    held = _flash_index(gen, expr)
    _flash_call(gen, expr.symbol, held, 0)


def _flash_index(gen: FunctionGenerator, expr: Ref) -> list[Operand]:
    """Return the index of a byte in its table: one operand byte, or two for large tables."""
    size = 1 if expr.symbol.size <= 256 else 2
    if expr.index is None:
        return [Imm(expr.offset >> 8 * each & 0xFF) for each in range(size)]
    index = expr.index
    if expr.offset:
        kind = index.type
        index = Binary("+", index, Num(expr.offset, kind, expr.place), kind, expr.place)
    return operands_of(gen, index, size)


def _flash_call(gen: FunctionGenerator, symbol: Symbol, index: list[Operand], step: int) -> None:
    """Load byte index + step of a flash object into W."""
    if len(index) == 1:
        gen.load(index[0])
        if step:
            gen.emit("ADDLW", k=step)
        call = gen.emit("CALL", target=table_name(symbol) + (ISR_SUFFIX if gen.isr else ""))
        call.table = symbol
        return
    pointer: list[Loc] = gen.temp(2)
    add(gen, pointer, index, [Imm(AddressByte(symbol, step, 0)), Imm(AddressByte(symbol, step, 1))])
    _read_pointer(gen, pointer)


def _read_pointer(gen: FunctionGenerator, pointer: list[Loc]) -> None:
    function = gen.library("flash", ())
    library_call(gen, function, [[pointer[1]], [pointer[0]]])


def from_flash(gen: FunctionGenerator, expr: Ref, target: list[Loc]) -> None:
    size = min(len(target), expr.type.size)
    index = _flash_index(gen, expr)
    if size > 1:
        index = kept(gen, index)
    for number in range(size):
        _flash_call(gen, expr.symbol, index, number)
        gen.store(target[number])
    if len(target) > size:
        widen(gen, target, size, signed=negative_possible(gen, expr))


def wide_load(gen: FunctionGenerator, expr: Deref, target: list[Loc]) -> None:
    size = min(len(target), expr.type.size)
    pointer: list[Loc] = gen.temp(2)
    into(gen, expr.pointer, pointer)
    if expr.offset:
        add(gen, pointer, list(pointer), imms(expr.offset, 2))
    for number in range(size):
        if number:
            count_up(gen, pointer)
        _read_pointer(gen, pointer)
        gen.store(target[number])
    if len(target) > size:
        widen(gen, target, size, signed=negative_possible(gen, expr))


def builtin(gen: FunctionGenerator, expr: Builtin) -> None:
    gen.place = expr.place if expr.place.line else gen.place
    match expr.name:
        case "instruction":
            gen.emit(str(expr.data), fixed=True)
        case "delay":
            assert isinstance(expr.data, int)
            gen.delay(expr.data)
        case "delay_variable":
            assert isinstance(expr.data, int)
            function = gen.library("delay", (expr.data,))
            load = gen.load(operands_of(gen, expr.arguments[0], 1)[0])
            load.fixed = True  # it is part of the time
            gen.emit("CALL", target=function.name)
        case "eeprom_read":
            function = gen.library("eeprom_read", ())
            to_w(gen, expr.arguments[0])
            gen.emit("CALL", target=function.name)
        case "eeprom_write" | "putchar" | "getchar":
            data = expr.data if isinstance(expr.data, tuple) else ()
            function = gen.library(expr.name, tuple(int(each) for each in data))
            operands = [operands_of(gen, each, 1) for each in expr.arguments]
            library_call(gen, function, operands)
