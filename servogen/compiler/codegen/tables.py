"""Constants in flash: tables of RETLW, the few instructions that jump into them, and the code that reads
them.

In: the flash objects that the code refers to, and typed references to them. Out: a `Function` for each
object; instructions. A table needs only ADDWF PCL if it lies, with all others, in the first 256 words;
elsewhere PCLATH is set, and a carry is added where a table crosses a page of 256 words (DS35007 section
2.4; "Implementing a Table Read", Microchip AN556).
"""

from __future__ import annotations

from servogen.compiler.ast.nodes import AddressByte, Binary, Deref, Num, Ref, Symbol
from servogen.compiler.ast.types import U8
from servogen.compiler.codegen.arithmetic import add, count_up, imms
from servogen.compiler.codegen.calls import library_call
from servogen.compiler.codegen.expressions import into
from servogen.compiler.codegen.generator import FunctionGenerator
from servogen.compiler.codegen.operands import negative_possible, operands_of, preserved, widen
from servogen.compiler.ir.function import ISR_SUFFIX, Function, Line
from servogen.compiler.ir.instruction import (
    PCL,
    PCLATH,
    STATUS,
    Byte,
    C,
    Imm,
    Instruction,
    Label,
    Loc,
    Operand,
)

_PAGE = 256


def table_name(symbol: Symbol) -> str:
    """Return the label of the routine that reads a flash object by index."""
    place = symbol.place
    return f"__table.{symbol.name}@{place.file}:{place.line}:{place.column}"


def data_label(name: str) -> str:
    """Return the label of the first byte of the table with that name."""
    return name + ".data"


def add_tables(
    functions: dict[str, Function], statics: list[Symbol], placed: list[Symbol]
) -> dict[Symbol, str]:
    """Create a Function for every flash object that is referred to or `placed` at a fixed address, and return
    the labels of their first bytes.

    A table that both main and the interrupt read exists twice, because its routine keeps the index in a byte.
    """
    tables: dict[Symbol, str] = {}
    called: dict[str, Symbol] = {}
    waiting = [*placed]
    for function in functions.values():
        for ins in function.instructions():
            if ins.table is not None:
                called[ins.target] = ins.table
            elif isinstance(ins.k, AddressByte):
                waiting.append(ins.k.symbol)
    waiting += [
        byte.symbol
        for symbol in statics
        for byte in (symbol.initial or {}).values()
        if isinstance(byte, AddressByte)
    ]
    for name, symbol in called.items():
        index = Symbol("index", U8, "temp", function=name)
        functions[name] = Function(name, own=[index], table=symbol, w_parameter=index)
        tables.setdefault(symbol, data_label(name))
        waiting += pointed_to(symbol)
    while waiting:
        symbol = waiting.pop(0)
        if symbol.kind == "flash" and symbol not in tables:
            name = table_name(symbol)
            functions[name] = Function(name, table=symbol, origin=symbol.address, place=symbol.place)
            tables[symbol] = data_label(name)
            waiting += pointed_to(symbol)
    return tables


def pointed_to(symbol: Symbol) -> list[Symbol]:
    """Return the objects whose addresses the initial value of a variable or flash object contains."""
    return [byte.symbol for byte in (symbol.initial or {}).values() if isinstance(byte, AddressByte)]


def table_code(function: Function, address: int, *, only_first_page: bool) -> list[Line] | None:
    """Return the instructions of a table at an address; None if it would leave the first page and must
    not.
    """
    symbol = function.table
    assert symbol is not None
    data = [
        Instruction("RETLW", k=(symbol.initial or {}).get(index, 0), fixed=True)
        for index in range(symbol.size)
    ]
    label = Label(data_label(function.name), fixed=True)
    if function.w_parameter is None:
        return [label, *data]
    last = address + len(data)
    if only_first_page:
        return [Instruction("ADDWF", PCL, 1), label, *data] if last < _PAGE else None
    index_byte = Byte(function.w_parameter, 0)
    # The jump into the data is five words long; eight where the data cross a page of 256 words, because the
    # carry of index + start is then added to PCLATH. ADDWF PCL alone would lose it.
    start = address + 5
    crosses = start // _PAGE != (start + len(data) - 1) // _PAGE
    start = address + 8 if crosses else start
    front = [
        Instruction("MOVWF", index_byte),
        Instruction("MOVLW", k=start // _PAGE),
        Instruction("MOVWF", PCLATH),
    ]
    if not crosses:
        return [*front, Instruction("MOVF", index_byte, 0), Instruction("ADDWF", PCL, 1), label, *data]
    return [
        *front,
        Instruction("MOVLW", k=start % _PAGE),
        Instruction("ADDWF", index_byte, 0),
        Instruction("BTFSC", STATUS, b=C),
        Instruction("INCF", PCLATH, 1),
        Instruction("MOVWF", PCL),
        label,
        *data,
    ]


def flash_byte(gen: FunctionGenerator, expr: Ref) -> None:
    """Load one byte of a table into W."""
    index = _flash_index(gen, expr)
    _flash_call(gen, expr.symbol, index, 0)


def _flash_index(gen: FunctionGenerator, expr: Ref) -> list[Operand]:
    """Return the index of a byte in its table: one operand byte; two for large tables, and for one at a fixed
    address, in front of which no instructions fit.
    """
    size = 1 if expr.symbol.size <= 256 and expr.symbol.address is None else 2
    if expr.index is None:
        return [Imm(expr.offset >> 8 * number & 0xFF) for number in range(size)]
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
    # the address is computed in two bytes and read as through a pointer
    pointer: list[Loc] = gen.temp(2)
    add(gen, pointer, index, [Imm(AddressByte(symbol, step, 0)), Imm(AddressByte(symbol, step, 1))])
    _read_pointer(gen, pointer)


def _read_pointer(gen: FunctionGenerator, pointer: list[Loc]) -> None:
    function = gen.library("flash", ())
    library_call(gen, function, [[pointer[1]], [pointer[0]]])


def from_flash(gen: FunctionGenerator, expr: Ref, target: list[Loc]) -> None:
    """Store a value that lies in flash, byte by byte."""
    size = min(len(target), expr.type.size)
    index = _flash_index(gen, expr)
    if size > 1:
        index = preserved(gen, index)
    for number in range(size):
        _flash_call(gen, expr.symbol, index, number)
        gen.store(target[number])
    if len(target) > size:
        widen(gen, target, size, signed=negative_possible(expr))


def wide_load(gen: FunctionGenerator, expr: Deref, target: list[Loc]) -> None:
    """Store a value behind a pointer that may lead to flash or to RAM; the routine distinguishes them."""
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
        widen(gen, target, size, signed=negative_possible(expr))
