"""The frame of a program: vectors, start-up code, context saving around the interrupt, tables, and their
order in flash.

In: the generated functions and the program's variables. Out: an `Arrangement`: the code in the order in which
it is placed.

Address 0 holds a GOTO to the start-up code if there is an interrupt function; otherwise the start-up code
itself begins there.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from servogen.compiler.ast.nodes import AddressByte, Data, ProgramTree, Symbol
from servogen.compiler.ast.types import U8
from servogen.compiler.codegen.program import ProgramGenerator
from servogen.compiler.codegen.tables import add_tables, pointed_to
from servogen.compiler.ir.function import ISR_SUFFIX, Function, Line
from servogen.compiler.ir.instruction import FSR, INDF, PCLATH, STATUS, TARGETED, Byte, Instruction, Label, Z
from servogen.graph import reached
from servogen.pic.device import INTERRUPT_VECTOR, PROGRAM_WORDS

RESET, START = "__reset", "__start"
_CLEAR_LABEL = f"{START}.clear"
_CLEAR_LOOP_WORDS = 8
"""The loop that clears variables has so many words; a CLRF each is shorter up to as many bytes."""


@dataclass(slots=True)
class Arrangement:
    """The roots of the call trees (main's first), the static variables, the labels of flash objects, and the
    order of the code.
    """

    roots: list[str]
    statics: list[Symbol]
    tables: dict[Symbol, str] = field(default_factory=dict)
    first: list[str] = field(default_factory=list)

    def order(self, functions: dict[str, Function]) -> list[Function]:
        """Return the start-up code, the interrupt, main, then the other functions in the order of their
        creation.
        """
        names = [*self.first, *(name for name in functions if name not in self.first)]
        return [functions[name] for name in names if name in functions]


def arrange(generator: ProgramGenerator, program: ProgramTree) -> Arrangement:
    """Add the start-up code and the interrupt's frame to the functions, and return how they are arranged."""
    functions = generator.functions
    statics = used_statics(
        [symbol for symbol in program.symbols if symbol.kind in ("global", "fixed")], functions
    )
    arrangement = Arrangement([START], statics)
    start = Function(START, falls_into="main")
    _initialise(start, statics)
    functions[START] = start
    placed = [symbol for symbol in program.symbols if symbol.kind == "flash" and _in_flash(symbol)]
    anywhere = not placed and all(function.origin is None for function in functions.values())
    if generator.graph.handler or not anywhere:
        functions[RESET] = Function(RESET, origin=0)
        functions[RESET].append(Instruction("GOTO", target=START))
        arrangement.first = [RESET]
    if generator.graph.handler:
        handler = functions[generator.graph.handler]
        isr = [
            handler,
            *(
                functions[name]
                for name in functions
                if name.endswith(ISR_SUFFIX) or name in generator.graph.isr
            ),
        ]
        fsr = any(ins.f in (FSR, INDF) for function in isr for ins in function.instructions())
        pclath = any(
            ins.f == PCLATH or ins.table is not None for function in isr for ins in function.instructions()
        )
        leaves = any(function.inline_asm and _leaves(function, functions) for function in isr)
        if program.functions[generator.graph.handler].naked:
            handler.origin = INTERRUPT_VECTOR
        else:
            _save_context(handler, fsr=fsr or leaves, pclath=pclath or leaves)
        arrangement.roots.append(handler.name)
        arrangement.first.append(handler.name)
    arrangement.tables = add_tables(functions, statics, placed)
    arrangement.first += [
        START,
        "main",
        *(name for name, function in functions.items() if function.table is not None),
    ]
    return arrangement


def _in_flash(symbol: Symbol) -> bool:
    """Return whether a constant has a fixed address among the program words."""
    return symbol.address is not None and symbol.address < PROGRAM_WORDS


def _leaves(function: Function, functions: dict[str, Function]) -> bool:
    """Return whether assembly calls or jumps to another function, which is not analysed here."""
    return any(
        ins.op in TARGETED and ins.fixed and ins.target in functions for ins in function.instructions()
    )


def _initialise(function: Function, statics: list[Symbol]) -> None:
    """Emit the initial values: constants are stored; zeros are cleared, in a loop where that is shorter."""
    statics = [symbol for symbol in statics if not symbol.persistent]
    zero = [symbol for symbol in statics if symbol.kind == "global" and not symbol.initial]
    together = all(symbol.kind == "global" for symbol in statics)
    if together and sum(symbol.size for symbol in zero) > _CLEAR_LOOP_WORDS:
        function.extend(_clear_loop(zero))
        function.bounds[_CLEAR_LABEL] = sum(symbol.size for symbol in zero)
    else:
        zero = []
    for symbol in statics:
        if symbol in zero or (symbol.kind == "fixed" and symbol.initial is None):
            continue
        data: dict[int, Data] = symbol.initial or {}
        bytes_ = [(data.get(offset, 0), offset) for offset in range(symbol.size)]
        loaded: Data | None = None
        # zeros first, then equal values together, so that each value is loaded once
        for value, offset in sorted(bytes_, key=lambda pair: (pair[0] != 0, repr(pair[0]), pair[1])):
            if value == 0:
                function.append(Instruction("CLRF", Byte(symbol, offset)))
                continue
            if value != loaded:
                function.append(Instruction("MOVLW", k=value))
            function.append(Instruction("MOVWF", Byte(symbol, offset)))
            loaded = value


def _clear_loop(zero: list[Symbol]) -> list[Line]:
    """Return a loop that clears consecutive variables."""
    first, last = AddressByte(zero[0], 0, 0), AddressByte(zero[-1], zero[-1].size, 0)
    # FSR counts up to the address behind the last variable; XORWF is 0 there
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


def used_statics(statics: list[Symbol], functions: dict[str, Function]) -> list[Symbol]:
    """Return the variables that an instruction refers to, or that the initial value of a used variable or
    constant refers to; those that start as zero come first, those that are not initialised last.
    """
    in_code: list[Symbol] = []
    for function in functions.values():
        for ins in function.instructions():
            if isinstance(ins.f, Byte):
                in_code.append(ins.f.symbol)
            if isinstance(ins.k, AddressByte):
                in_code.append(ins.k.symbol)
            if ins.table is not None:
                in_code.append(ins.table)
    named = set(reached(in_code, pointed_to))
    used = [symbol for symbol in statics if symbol in named or symbol.kind == "fixed"]
    return sorted(used, key=lambda symbol: (symbol.persistent, bool(symbol.initial)))


def _save_context(function: Function, *, fsr: bool, pclath: bool) -> None:
    """Save and restore W, STATUS, and FSR and PCLATH where the interrupt uses them (DS35007 section 6.9,
    "Context saving").

    SWAPF moves STATUS without changing its flags. Bank 0 is selected for the function itself.
    """

    def context_byte(name: str) -> Byte:
        symbol = Symbol(f"saved_{name}", U8, "temp", function=function.name, pinned=True)
        function.own.append(symbol)
        return Byte(symbol, 0)

    # the bank is unknown on entry, which is harmless: RAM is the same in both
    w, status = context_byte("w"), context_byte("status")
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
            saved = context_byte("fsr" if register == FSR else "pclath")
            before += [Instruction("MOVF", register, 0), Instruction("MOVWF", saved)]
            after = [Instruction("MOVF", saved, 0), Instruction("MOVWF", register), *after]
    for ins in (*before, *after):
        ins.fixed = True
    body = list(function.lines())
    assert isinstance(body[-1], Instruction) and body[-1].op == "RETFIE"
    function.replace([*before, *body[:-1], *after])
    function.origin = INTERRUPT_VECTOR
