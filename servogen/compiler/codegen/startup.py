"""The frame of a program: vectors, start-up, saving of registers around the interrupt, tables, their order
in flash.

In: the generated functions and the program's variables. Out: an `Arrangement`: which code comes where.

Address 0 holds a GOTO to the start-up when there is an interrupt function; without one, the start-up
stands there.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from servogen.compiler.ast.nodes import AddressByte, Data, Program, Symbol
from servogen.compiler.ast.types import U8
from servogen.compiler.codegen.program import ProgramGenerator
from servogen.compiler.codegen.tables import add_tables, pointed_to
from servogen.compiler.diagnostics import Reporter
from servogen.compiler.frontend.settings import Settings
from servogen.compiler.ir.function import ISR_SUFFIX, Function, Line
from servogen.compiler.ir.instruction import FSR, INDF, PCLATH, STATUS, Byte, Instruction, Label, Z
from servogen.pic.device import INTERRUPT_VECTOR

RESET, START = "__reset", "__start"
_CLEAR_LABEL = f"{START}.clear"
_CLEAR_LOOP_WORDS = 8
"""The loop that clears variables has so many words; a CLRF each is shorter up to as many bytes."""


@dataclass(slots=True)
class Arrangement:
    """Roots of the call trees (main's first), static variables, flash objects' labels, code order."""

    roots: list[str]
    statics: list[Symbol]
    tables: dict[Symbol, str] = field(default_factory=dict)
    first: list[str] = field(default_factory=list)

    def order(self, codes: dict[str, Function]) -> list[Function]:
        """Start-up, interrupt, main, then the functions in the order in which they were made."""
        names = [*self.first, *(name for name in codes if name not in self.first)]
        return [codes[name] for name in names if name in codes]


def arrange(
    generator: ProgramGenerator, program: Program, settings: Settings, reporter: Reporter
) -> Arrangement:
    """Add the start-up code and the interrupt's frame to the codes."""
    codes = generator.codes
    statics = used_statics([each for each in program.symbols if each.kind in ("global", "fixed")], codes)
    found = Arrangement([START], statics)
    start = Function(START, falls_into="main")
    _initialise(start, statics)
    codes[START] = start
    if generator.graph.handler:
        codes[RESET] = Function(RESET)
        codes[RESET].append(Instruction("GOTO", target=START))
        handler = codes[generator.graph.handler]
        isr = [
            handler,
            *(codes[name] for name in codes if name.endswith(ISR_SUFFIX) or name in generator.graph.isr),
        ]
        fsr = any(ins.f in (FSR, INDF) for code in isr for ins in code.instructions())
        pclath = any(ins.f == PCLATH or ins.table is not None for code in isr for ins in code.instructions())
        leaves = any(code.inline_asm and _leaves(code, codes) for code in isr)
        _save_context(handler, fsr=fsr or leaves, pclath=pclath or leaves)
        found.roots.append(handler.name)
        found.first = [RESET, handler.name]
    found.tables = add_tables(codes, statics)
    found.first += [START, "main", *(name for name, code in codes.items() if code.table is not None)]
    return found


def _leaves(code: Function, codes: dict[str, Function]) -> bool:
    """Whether assembly calls or goes to another function: what that does is not looked at here."""
    return any(
        ins.op in ("CALL", "GOTO") and ins.fixed and ins.target in codes for ins in code.instructions()
    )


def _initialise(code: Function, statics: list[Symbol]) -> None:
    """Start values: constants stored; what starts as zero is cleared, in a loop where that is shorter."""
    zero = [symbol for symbol in statics if symbol.kind == "global" and not symbol.initial]
    together = all(symbol.kind == "global" for symbol in statics)
    if together and sum(symbol.size for symbol in zero) > _CLEAR_LOOP_WORDS:
        code.extend(_clear_loop(zero))
        code.bounds[_CLEAR_LABEL] = sum(symbol.size for symbol in zero)
    else:
        zero = []
    for symbol in statics:
        if symbol in zero or (symbol.kind == "fixed" and symbol.initial is None):
            continue
        data: dict[int, Data] = symbol.initial or {}
        bytes_ = [(data.get(offset, 0), offset) for offset in range(symbol.size)]
        loaded: Data | None = None
        for value, offset in sorted(bytes_, key=lambda pair: (pair[0] != 0, repr(pair[0]), pair[1])):
            if value == 0:
                code.append(Instruction("CLRF", Byte(symbol, offset)))
                continue
            if value != loaded:
                code.append(Instruction("MOVLW", k=value))
            code.append(Instruction("MOVWF", Byte(symbol, offset)))
            loaded = value


def _clear_loop(zero: list[Symbol]) -> list[Line]:
    """Clear variables that lie one behind the other."""
    first, last = AddressByte(zero[0], 0, 0), AddressByte(zero[-1], zero[-1].size, 0)
    return [
        Instruction("MOVLW", k=first),
        Instruction("MOVWF", FSR),
        Label(_CLEAR_LABEL),
        Instruction("CLRF", INDF),
        Instruction("INCF", FSR, 1),
        Instruction("MOVLW", k=last),
        Instruction("XORWF", FSR, 0),
        Instruction("BTFSS", STATUS, b=Z),
        Instruction("GOTO", target=_CLEAR_LABEL),
    ]


def used_statics(statics: list[Symbol], codes: dict[str, Function]) -> list[Symbol]:
    """Return the variables that an instruction names, or a start value or constant that is used itself;
    those that start as zero come first.
    """
    named: set[Symbol] = set()
    waiting: list[Symbol] = []
    for code in codes.values():
        for ins in code.instructions():
            if isinstance(ins.f, Byte):
                waiting.append(ins.f.symbol)
            if isinstance(ins.k, AddressByte):
                waiting.append(ins.k.symbol)
            if ins.table is not None:
                waiting.append(ins.table)
    while waiting:
        symbol = waiting.pop()
        if symbol not in named:
            named.add(symbol)
            waiting += pointed_to(symbol)
    found = [symbol for symbol in statics if symbol in named or symbol.kind == "fixed"]
    return sorted(found, key=lambda symbol: bool(symbol.initial))


def _save_context(code: Function, *, fsr: bool, pclath: bool) -> None:
    """W, STATUS and what the interrupt uses of FSR and PCLATH are kept (DS35007 section 6.9, "Context
    saving").

    SWAPF moves STATUS without changing its flags. Bank 0 is selected for the function itself.
    """

    def kept(name: str) -> Byte:
        symbol = Symbol(f"saved_{name}", U8, "temp", function=code.name, pinned=True)
        code.own.append(symbol)
        return Byte(symbol, 0)

    w, status = kept("w"), kept("status")
    before = [
        Instruction("MOVWF", w),
        Instruction("SWAPF", STATUS, 0),
        Instruction("MOVWF", status),
        Instruction("CLRF", STATUS),
    ]
    after = [
        Instruction("SWAPF", status, 0),
        Instruction("MOVWF", STATUS),
        Instruction("SWAPF", w, 1),
        Instruction("SWAPF", w, 0),
        Instruction("RETFIE"),
    ]
    for register, wanted in ((FSR, fsr), (PCLATH, pclath)):
        if wanted:
            held = kept("fsr" if register == FSR else "pclath")
            before += [Instruction("MOVF", register, 0), Instruction("MOVWF", held)]
            after = [Instruction("MOVF", held, 0), Instruction("MOVWF", register), *after]
    for each in (*before, *after):
        each.fixed = True
    body = list(code.lines())
    assert isinstance(body[-1], Instruction) and body[-1].op == "RETFIE"
    code.replace([*before, *body[:-1], *after])
    code.origin = INTERRUPT_VECTOR
