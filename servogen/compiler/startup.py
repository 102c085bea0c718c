"""The frame of a program: vectors, start-up, saving of registers around the interrupt, tables, their order in flash.

In: the generated functions and the program's variables. Out: an `Arrangement`: which code comes where.

Address 0 holds a GOTO to the start-up when there is an interrupt function; without one, the start-up stands there.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from servogen.compiler.backend import Backend
from servogen.compiler.ctypes import U8
from servogen.compiler.diagnostics import Reporter
from servogen.compiler.emitter import Code
from servogen.compiler.machine import FSR, PCLATH, STATUS, Byte, Ins
from servogen.compiler.settings import Settings
from servogen.compiler.tables import add_tables, table_name
from servogen.compiler.tree import Data, Program, Symbol
from servogen.pic.device import INTERRUPT_VECTOR

RESET, START = "__reset", "__start"
_CLEAR_LOOP_FROM = 6
"""From this many bytes on a loop clears variables in fewer words than a CLRF each."""


@dataclass(slots=True)
class Arrangement:
    """Roots of the call trees (main's first), static variables, flash objects' labels, code order."""

    roots: list[str]
    statics: list[Symbol]
    tables: dict[Symbol, str] = field(default_factory=dict)
    first: list[str] = field(default_factory=list)

    def order(self, codes: dict[str, Code]) -> list[Code]:
        """Start-up, interrupt, main, then the functions in the order in which they were made."""
        names = [*self.first, *(name for name in codes if name not in self.first)]
        return [codes[name] for name in names if name in codes]


def arrange(backend: Backend, program: Program, settings: Settings, reporter: Reporter) -> Arrangement:
    """Add the start-up code and the interrupt's frame to the codes."""
    codes = backend.codes
    statics = [symbol for symbol in program.symbols if symbol.kind in ("global", "fixed")]
    found = Arrangement([START], statics)
    start = Code(START, falls_into="main")
    start.ins += _initialise(statics)
    codes[START] = start
    if backend.handler:
        codes[RESET] = Code(RESET, [Ins("GOTO", target=START)])
        handler = codes[backend.handler]
        _save_context(handler)
        found.roots.append(handler.name)
        found.first = [RESET, handler.name]
    found.tables = add_tables(codes, statics)
    found.first += [START, "main", *(table_name(symbol) for symbol in found.tables)]
    return found


def _initialise(statics: list[Symbol]) -> list[Ins]:
    """Start values: constants stored, the rest cleared."""
    out: list[Ins] = []
    for symbol in statics:
        if symbol.kind == "fixed" and symbol.initial is None:
            continue
        data: dict[int, Data] = symbol.initial or {}
        for offset in range(symbol.size):
            value = data.get(offset, 0)
            if value == 0:
                out.append(Ins("CLRF", Byte(symbol, offset)))
            else:
                out += [Ins("MOVLW", k=value), Ins("MOVWF", Byte(symbol, offset))]
    return out


def _save_context(code: Code) -> None:
    """W, STATUS, FSR and PCLATH are kept around the interrupt (DS35007 section 6.9, "Context saving").

    SWAPF moves STATUS without changing its flags. Bank 0 is selected for the function itself.
    """
    kept = {name: Symbol(f"saved_{name}", U8, "temp", function=code.name, pinned=True) for name in ("w", "status", "fsr", "pclath")}
    code.own += kept.values()
    w, status, fsr, pclath = (Byte(symbol, 0) for symbol in kept.values())
    before = [
        Ins("ORG", k=INTERRUPT_VECTOR),
        Ins("MOVWF", w),
        Ins("SWAPF", STATUS, 0),
        Ins("MOVWF", status),
        Ins("CLRF", STATUS),
        Ins("MOVF", FSR, 0),
        Ins("MOVWF", fsr),
        Ins("MOVF", PCLATH, 0),
        Ins("MOVWF", pclath),
        Ins("CLRF", PCLATH),
    ]
    after = [
        Ins("MOVF", pclath, 0),
        Ins("MOVWF", PCLATH),
        Ins("MOVF", fsr, 0),
        Ins("MOVWF", FSR),
        Ins("SWAPF", status, 0),
        Ins("MOVWF", STATUS),
        Ins("SWAPF", w, 1),
        Ins("SWAPF", w, 0),
        Ins("RETFIE"),
    ]
    for each in (*before, *after):
        each.fixed = True
    body = code.ins
    assert body[-1].op == "RETFIE"
    code.ins = [*before, *body[:-1], *after]
