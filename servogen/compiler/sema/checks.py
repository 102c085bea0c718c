"""Warnings about the whole program: legal C that causes trouble on this chip.

In: the typed tree. Out: warnings for a read-modify-write of a pin that stays an input, and for variables of
several bytes that main and the interrupt share while interrupts are enabled.
"""

from __future__ import annotations

from collections.abc import Iterator

from servogen.compiler.ast.nodes import (
    AddressOf,
    Assign,
    BlockStatement,
    Builtin,
    Call,
    Cast,
    Deref,
    Expr,
    ExprStmt,
    FunctionDefinition,
    If,
    Loop,
    Num,
    ProgramTree,
    Ref,
    Stmt,
    Switch,
    Symbol,
    Update,
)
from servogen.compiler.ast.types import VoidType
from servogen.compiler.ast.walk import expressions
from servogen.compiler.diagnostics import Reporter
from servogen.compiler.sema.call_graph import CallGraph, has_assembly, statements
from servogen.compiler.sema.function_pointers import DISPATCHER

_PORTS = {"PORTA": "TRISA", "PORTB": "TRISB"}
_PINS = {"PORTA": "RA", "PORTB": "RB"}


def check_program(graph: CallGraph, reporter: Reporter) -> None:
    """Report all warnings of this module."""
    if not graph.program_has_assembly:
        _inputs(graph.program, reporter)
    _unused_results(graph.program, reporter)
    if graph.handler:
        _shared(graph, reporter)


# pins that stay inputs


def _inputs(program: ProgramTree, reporter: Reporter) -> None:
    """Warn about read-modify-writes of inputs: a write to a port reads the pins, and the level of an input
    gets into its latch (DS35007 section 4).
    """
    every = [
        expr
        for function in program.functions.values()
        if function.body is not None
        for expr in expressions(function.body)
    ]
    writes = [expr for expr in every if isinstance(expr, (Assign, Update))]
    for port, tris in _PORTS.items():
        outputs = _possible_outputs(writes, every, tris)
        for expr in writes:
            bits = _changed_bits(expr, port)
            for bit in bits:
                if not outputs >> bit & 1:
                    reporter.warn(
                        "c-input-pin",
                        f"{_PINS[port]}{bit} is an input: {tris} never makes it an output",
                        expr.place,
                    )


def _possible_outputs(writes: list[Assign | Update], every: list[Expr], tris: str) -> int:
    """Return the pins that some write to TRIS may make outputs, as a mask."""
    mask = 0
    for expr in every:
        if isinstance(expr, (AddressOf, Deref)):
            return 0xFF
    for expr in writes:
        target = expr.target
        if not isinstance(target, Ref) or target.symbol.name != tris:
            continue
        if target.width:
            constant = isinstance(expr, Assign) and isinstance(expr.value, Num) and expr.value.value
            mask |= 0 if constant else 1 << (target.bit or 0)
        elif isinstance(expr, Assign) and isinstance(expr.value, Num):
            mask |= ~expr.value.value & 0xFF
        else:
            return 0xFF
    return mask


def _changed_bits(expr: Assign | Update, port: str) -> list[int]:
    """Return the pins that a read-modify-write of a port is intended to change."""
    target = expr.target
    if not isinstance(target, Ref) or target.symbol.name != port:
        return []
    if target.width:
        return [target.bit or 0]
    if isinstance(expr, Update) and expr.op in "|^" and isinstance(expr.value, Num):
        return [bit for bit in range(8) if expr.value.value >> bit & 1]
    return []


# calls whose only effect is their result


def _unused_results(program: ProgramTree, reporter: Reporter) -> None:
    """Warn about a statement that calls a function without effects and discards its result."""
    acting: set[str] = set()
    grown = True
    # a function acts if one that it calls acts: repeat until no more are found
    while grown:
        more = {
            name
            for name, definition in program.functions.items()
            if name not in acting and _acts(definition, acting)
        }
        grown = bool(more)
        acting |= more
    for function in program.functions.values():
        for call in _statements_that_call(function.body):
            unknown = call.function.startswith(DISPATCHER)  # what a pointer calls is not known here
            if call.function not in acting and not unknown and not isinstance(call.type, VoidType):
                reporter.warn(
                    "c-unused-result",
                    f"the result of '{call.function}' is not used, and the call has no other effect",
                    call.place,
                )


def _acts(function: FunctionDefinition, acting: set[str]) -> bool:
    """Return whether a function changes anything but its own variables, or takes time on purpose."""
    if function.body is None or has_assembly(function.body):
        return True
    for expr in expressions(function.body):
        match expr:
            case Assign(target) | Update(_, target):
                if not isinstance(target, Ref) or target.symbol.kind not in ("local", "param"):
                    return True
            case Call(name):
                if name in acting:
                    return True
            case Builtin():
                return True
            case Ref(symbol) if symbol.volatile:
                return True
    return False


def _statements_that_call(node: Stmt | None) -> Iterator[Call]:
    """Yield the calls that are statements by themselves."""
    for statement in statements(node) if node is not None else ():
        if isinstance(statement, ExprStmt) and isinstance(statement.expr, Call):
            yield statement.expr


# variables shared with the interrupt


def _shared(graph: CallGraph, reporter: Reporter) -> None:
    """Warn about variables of several bytes that main and the interrupt share, since an access takes several
    instructions.
    """
    program = graph.program
    isr_reads, isr_writes = _uses(program, graph.isr, masked=False)
    main_reads, main_writes = _uses(program, list(graph.main), masked=True)
    for symbol in program.symbols:
        if symbol.kind != "global":
            continue
        if (symbol in isr_writes and symbol in main_reads | main_writes) or (
            symbol in main_writes and symbol in isr_reads
        ):
            reporter.warn(
                "c-shared-variable",
                f"'{symbol.name}' has {symbol.size} bytes and is shared with the interrupt, "
                "which can occur between two of them",
                symbol.place,
                hint="disable interrupts around its uses in the main program",
            )


def _uses(program: ProgramTree, names: list[str], *, masked: bool) -> tuple[set[Symbol], set[Symbol]]:
    """Return (variables read, variables written) of several bytes; with `masked`, only where interrupts may
    be enabled.
    """
    reads: set[Symbol] = set()
    writes: set[Symbol] = set()
    for name in names:
        body = program.functions[name].body
        if body is None:
            continue
        for statement in _unmasked(body) if masked else [body]:
            for expr in expressions(statement):
                if expr.type.size < 2:
                    continue
                if isinstance(expr, (Assign, Update)) and isinstance(expr.target, Ref):
                    writes.add(expr.target.symbol)
                if isinstance(expr, Ref):
                    reads.add(expr.symbol)
    return reads, writes


def _unmasked(block: BlockStatement) -> list[object]:
    """Return the statements and conditions that are not between GIE = 0 and GIE = 1 of one block."""
    unmasked: list[object] = []
    off = False
    for statement in block.body:
        switched = _switches_interrupts(statement)
        if switched is not None:
            off = not switched
        elif not off:
            unmasked += _parts(statement)
    return unmasked


def _parts(node: Stmt) -> list[object]:
    match node:
        case BlockStatement():
            return _unmasked(node)
        case If(condition, yes, no):
            return [condition, *_parts(yes), *(_parts(no) if no is not None else [])]
        case Loop(condition, body, step):
            return [condition, step, *_parts(body)]
        case Switch(value, _, _, body):
            return [value, *_parts(body)]
    return [node]


def _switches_interrupts(node: Stmt) -> bool | None:
    """Return whether a statement enables or disables interrupts; None if neither."""
    if not isinstance(node, ExprStmt):
        return None
    expr = node.expr
    while isinstance(expr, Cast):
        expr = expr.operand
    if not isinstance(expr, Assign) or not isinstance(expr.target, Ref) or not isinstance(expr.value, Num):
        return None
    target = expr.target
    if target.symbol.name == "INTCON" and target.width == 1 and target.bit == 7:
        return bool(expr.value.value)
    return None
