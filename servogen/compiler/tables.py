"""Constants in flash: tables of RETLW, and the few instructions in front that jump into them.

In: flash objects that the code names. Out: a `Code` each. A table whose program lies in the first 256 words with
all others needs only ADDWF PCL; elsewhere PCLATH is set, and a carry is added where a table crosses a page of 256
words (DS35007 section 2.4; "Implementing a Table Read", Microchip AN556).
"""

from __future__ import annotations

from servogen.compiler.ctypes import U8
from servogen.compiler.emitter import Code
from servogen.compiler.machine import LABEL, PCL, PCLATH, STATUS, Byte, C, Ins
from servogen.compiler.tree import AddressByte, Symbol

_PAGE = 256


def table_name(symbol: Symbol) -> str:
    """The label of the routine that reads a flash object by index."""
    place = symbol.place
    return f"__table.{symbol.name}@{place.file}:{place.line}:{place.column}"


def data_label(symbol: Symbol) -> str:
    """The label of a flash object's first byte."""
    return table_name(symbol) + ".data"


def add_tables(codes: dict[str, Code], statics: list[Symbol]) -> dict[Symbol, str]:
    """Make a Code for every flash object that is named, and give the labels of their first bytes."""
    found: dict[Symbol, str] = {}
    waiting = [ins.k.symbol for code in codes.values() for ins in code.ins if isinstance(ins.k, AddressByte)]
    waiting += [each.symbol for symbol in statics for each in (symbol.initial or {}).values() if isinstance(each, AddressByte)]
    called = {ins.table for code in codes.values() for ins in code.ins if ins.table is not None}
    waiting += sorted(called, key=table_name)
    while waiting:
        symbol = waiting.pop(0)
        if symbol.kind != "flash" or symbol in found:
            continue
        found[symbol] = data_label(symbol)
        held = Symbol("index", U8, "temp", function=table_name(symbol))
        codes[table_name(symbol)] = Code(table_name(symbol), own=[held] if symbol in called else [], table=symbol)
        codes[table_name(symbol)].w_parameter = held if symbol in called else None
        waiting += [each.symbol for each in (symbol.initial or {}).values() if isinstance(each, AddressByte)]
    return found


def table_code(code: Code, address: int, *, only_first_page: bool) -> list[Ins] | None:
    """The instructions of a table at an address; None when it would leave the first page and must not."""
    symbol = code.table
    assert symbol is not None
    data = [Ins("RETLW", k=(symbol.initial or {}).get(each, 0), fixed=True) for each in range(symbol.size)]
    label = Ins(LABEL, target=data_label(symbol), fixed=True)
    if code.w_parameter is None:
        return [label, *data]
    last = address + len(data)
    if only_first_page:
        return [Ins("ADDWF", PCL, 1), label, *data] if last < _PAGE else None
    held = Byte(code.w_parameter, 0)
    base = AddressByte(symbol, 0, 0)
    page = AddressByte(symbol, 0, 1)
    front = [Ins("MOVWF", held), Ins("MOVLW", k=page), Ins("MOVWF", PCLATH)]
    start = address + 5
    if start // _PAGE == (start + len(data) - 1) // _PAGE:
        return [*front, Ins("MOVF", held, 0), Ins("ADDWF", PCL, 1), label, *data]
    return [
        *front,
        Ins("MOVLW", k=base),
        Ins("ADDWF", held, 0),
        Ins("BTFSC", STATUS, b=C),
        Ins("INCF", PCLATH, 1),
        Ins("MOVWF", PCL),
        label,
        *data,
    ]
