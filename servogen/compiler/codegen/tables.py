"""Constants in flash: tables of RETLW, and the few instructions that jump into them.

In: the flash objects that the code refers to. Out: a `Function` for each. A table needs only ADDWF PCL if it
lies, with all others, in the first 256 words; elsewhere PCLATH is set, and a carry is added where a table
crosses a page of 256 words (DS35007 section 2.4; "Implementing a Table Read", Microchip AN556).
"""

from __future__ import annotations

from servogen.compiler.ast.nodes import AddressByte, Symbol
from servogen.compiler.ast.types import U8
from servogen.compiler.ir.function import Function, Line
from servogen.compiler.ir.instruction import PCL, PCLATH, STATUS, Byte, C, Instruction, Label

_PAGE = 256


def table_name(symbol: Symbol) -> str:
    """Return the label of the routine that reads a flash object by index."""
    place = symbol.place
    return f"__table.{symbol.name}@{place.file}:{place.line}:{place.column}"


def data_label(name: str) -> str:
    """Return the label of the first byte of the table with that name."""
    return name + ".data"


def add_tables(functions: dict[str, Function], statics: list[Symbol]) -> dict[Symbol, str]:
    """Create a Function for every flash object that is referred to, and return the labels of their first
    bytes.

    A table that both main and the interrupt read exists twice, because its routine keeps the index in a byte.
    """
    found: dict[Symbol, str] = {}
    called: dict[str, Symbol] = {}
    waiting: list[Symbol] = []
    for function in functions.values():
        for ins in function.instructions():
            if ins.table is not None:
                called[ins.target] = ins.table
            elif isinstance(ins.k, AddressByte):
                waiting.append(ins.k.symbol)
    waiting += [
        each.symbol
        for symbol in statics
        for each in (symbol.initial or {}).values()
        if isinstance(each, AddressByte)
    ]
    for name, symbol in called.items():
        held = Symbol("index", U8, "temp", function=name)
        functions[name] = Function(name, own=[held], table=symbol, w_parameter=held)
        found.setdefault(symbol, data_label(name))
        waiting += pointed_to(symbol)
    while waiting:
        symbol = waiting.pop(0)
        if symbol.kind == "flash" and symbol not in found:
            name = table_name(symbol)
            functions[name] = Function(name, table=symbol)
            found[symbol] = data_label(name)
            waiting += pointed_to(symbol)
    return found


def pointed_to(symbol: Symbol) -> list[Symbol]:
    """Return the objects whose addresses the initial value of a variable or flash object contains."""
    return [each.symbol for each in (symbol.initial or {}).values() if isinstance(each, AddressByte)]


def table_code(function: Function, address: int, *, only_first_page: bool) -> list[Line] | None:
    """Return the instructions of a table at an address; None if it would leave the first page and must
    not.
    """
    symbol = function.table
    assert symbol is not None
    data = [
        Instruction("RETLW", k=(symbol.initial or {}).get(each, 0), fixed=True) for each in range(symbol.size)
    ]
    label = Label(data_label(function.name), fixed=True)
    if function.w_parameter is None:
        return [label, *data]
    last = address + len(data)
    if only_first_page:
        return [Instruction("ADDWF", PCL, 1), label, *data] if last < _PAGE else None
    held = Byte(function.w_parameter, 0)
    start = address + 5
    crosses = start // _PAGE != (start + len(data) - 1) // _PAGE
    start = address + 8 if crosses else start
    front = [Instruction("MOVWF", held), Instruction("MOVLW", k=start // _PAGE), Instruction("MOVWF", PCLATH)]
    if not crosses:
        return [*front, Instruction("MOVF", held, 0), Instruction("ADDWF", PCL, 1), label, *data]
    return [
        *front,
        Instruction("MOVLW", k=start % _PAGE),
        Instruction("ADDWF", held, 0),
        Instruction("BTFSC", STATUS, b=C),
        Instruction("INCF", PCLATH, 1),
        Instruction("MOVWF", PCL),
        label,
        *data,
    ]
