"""Warnings about the whole program: legal C that causes trouble on this chip, or cannot work on it.

In: the typed tree of a program and its configuration. Out: warnings about pins that stay
inputs, results that are not used, variables that main and the interrupt share, interrupts, RA4 and the
watchdog. A program with assembly gets no warning about what is missing, because its assembly may do that.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from servogen.compiler.ast import nodes as tree
from servogen.compiler.ast.types import VoidType
from servogen.compiler.ast.walk import expressions
from servogen.compiler.diagnostics import Reporter
from servogen.compiler.sema.call_graph import CallGraph, has_assembly, statements
from servogen.compiler.sema.function_pointers import DISPATCHER
from servogen.errors import Location
from servogen.graph import reached
from servogen.pic.device import register_bits

_PORTS = {"PORTA": "TRISA", "PORTB": "TRISB"}
_PINS = {"PORTA": "RA", "PORTB": "RB"}


def check_program(graph: CallGraph, reporter: Reporter, *, watchdog: bool) -> None:
    """Report all warnings of this module. `watchdog`: whether the configuration word switches it on."""
    if not graph.program_has_assembly:
        _inputs(graph.program, reporter)
    _unused_results(graph, reporter)
    if graph.handler:
        _shared(graph, reporter)
    if not graph.program_has_assembly:
        _chip(graph, reporter, watchdog=watchdog)


# pins that stay inputs


def _inputs(program: tree.ProgramTree, reporter: Reporter) -> None:
    """Warn about read-modify-writes of inputs: a write to a port reads the pins, and the level of an input
    gets into its latch (DS35007 section 4).
    """
    every = [
        expr
        for function in program.functions.values()
        if function.body is not None
        for expr in expressions(function.body)
    ]
    writes = [expr for expr in every if isinstance(expr, (tree.Assign, tree.Update))]
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


def _possible_outputs(writes: list[tree.Assign | tree.Update], every: list[tree.Expr], tris: str) -> int:
    """Return the pins that some write to TRIS may make outputs, as a mask."""
    mask = 0
    for expr in every:
        if isinstance(expr, (tree.AddressOf, tree.Deref)):
            return 0xFF
    for expr in writes:
        target = expr.target
        if not isinstance(target, tree.Ref) or target.symbol.name != tris:
            continue
        if target.width:
            constant = isinstance(expr, tree.Assign) and isinstance(expr.value, tree.Num) and expr.value.value
            mask |= 0 if constant else 1 << (target.bit or 0)
        elif isinstance(expr, tree.Assign) and isinstance(expr.value, tree.Num):
            mask |= ~expr.value.value & 0xFF
        else:
            return 0xFF
    return mask


def _changed_bits(expr: tree.Assign | tree.Update, port: str) -> list[int]:
    """Return the pins that a read-modify-write of a port is intended to change."""
    target = expr.target
    if not isinstance(target, tree.Ref) or target.symbol.name != port:
        return []
    if target.width:
        return [target.bit or 0]
    if isinstance(expr, tree.Update) and expr.op in "|^" and isinstance(expr.value, tree.Num):
        return [bit for bit in range(8) if expr.value.value >> bit & 1]
    return []


# calls whose only effect is their result


def _unused_results(graph: CallGraph, reporter: Reporter) -> None:
    """Warn about a statement that calls a function without effects and discards its result."""
    functions, calls = graph.program.functions, graph.calls
    # a function acts if one that it calls acts
    acting = set(
        reached(
            (name for name, function in functions.items() if _acts(function)),
            lambda called: [name for name in calls if called in calls[name]],
        )
    )
    for function in functions.values():
        for call in _statements_that_call(function.body):
            unknown = call.function.startswith(DISPATCHER)  # what a pointer calls is not known here
            if call.function not in acting and not unknown and not isinstance(call.type, VoidType):
                reporter.warn(
                    "c-unused-result",
                    f"the result of '{call.function}' is not used, and the call has no other effect",
                    call.place,
                )


def _acts(function: tree.FunctionDefinition) -> bool:
    """Return whether a function itself changes anything but its own variables, or takes time on purpose."""
    if function.body is None or has_assembly(function.body):
        return True
    for expr in expressions(function.body):
        match expr:
            case tree.Assign(target) | tree.Update(_, target):
                if not isinstance(target, tree.Ref) or target.symbol.kind not in ("local", "param"):
                    return True
            case tree.Builtin():
                return True
            case tree.Ref(symbol) if symbol.volatile:
                return True
    return False


def _statements_that_call(node: tree.Stmt | None) -> Iterator[tree.Call]:
    """Yield the calls that are statements by themselves."""
    for statement in statements(node) if node is not None else ():
        if isinstance(statement, tree.ExprStmt) and isinstance(statement.expr, tree.Call):
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


def _uses(
    program: tree.ProgramTree, names: list[str], *, masked: bool
) -> tuple[set[tree.Symbol], set[tree.Symbol]]:
    """Return (variables read, variables written) of several bytes; with `masked`, only where interrupts may
    be enabled.
    """
    reads: set[tree.Symbol] = set()
    writes: set[tree.Symbol] = set()
    for name in names:
        body = program.functions[name].body
        if body is None:
            continue
        for statement in _unmasked(body) if masked else [body]:
            for expr in expressions(statement):
                if expr.type.size < 2:
                    continue
                if isinstance(expr, (tree.Assign, tree.Update)) and isinstance(expr.target, tree.Ref):
                    writes.add(expr.target.symbol)
                if isinstance(expr, tree.Ref):
                    reads.add(expr.symbol)
    return reads, writes


def _unmasked(block: tree.BlockStatement) -> list[object]:
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


def _parts(node: tree.Stmt) -> list[object]:
    """Return what a statement evaluates where interrupts may be enabled."""
    match node:
        case tree.BlockStatement():
            return _unmasked(node)
        case tree.If(condition, yes, no):
            return [condition, *_parts(yes), *(_parts(no) if no is not None else [])]
        case tree.Loop(condition, body, step):
            return [condition, step, *_parts(body)]
        case tree.Switch(value, _, _, body):
            return [value, *_parts(body)]
    return [node]


def _switches_interrupts(node: tree.Stmt) -> bool | None:
    """Return whether a statement enables or disables interrupts; None if neither."""
    if not isinstance(node, tree.ExprStmt):
        return None
    expr = node.expr
    while isinstance(expr, tree.Cast):
        expr = expr.operand
    if (
        not isinstance(expr, tree.Assign)
        or not isinstance(expr.target, tree.Ref)
        or not isinstance(expr.value, tree.Num)
    ):
        return None
    target = expr.target
    if target.symbol.name == "INTCON" and target.width == 1 and target.bit == 7:
        return bool(expr.value.value)
    return None


_SOURCES = {"T0IE": "T0IF", "INTE": "INTF", "RBIE": "RBIF", "EEIE": "EEIF"}
"""The bit that enables each interrupt, and the flag that calls it (DS35007 section 6.8)."""


@dataclass(frozen=True, slots=True)
class _Write:
    """A write to a register: the bits that it sets for certain, may set and may clear, as masks."""

    register: str
    sets: int
    may_set: int
    may_clear: int
    whole: bool
    place: Location


# interrupts, directions, RA4, the watchdog


def _chip(graph: CallGraph, reporter: Reporter, *, watchdog: bool) -> None:
    """Warn about what compiles but cannot work on the chip."""
    in_main, in_isr = _expressions(graph, graph.main), _expressions(graph, graph.isr)
    every = [*in_main, *in_isr]
    main, isr = list(_writes(in_main)), list(_writes(in_isr))
    if not any(isinstance(expr, (tree.AddressOf, tree.Deref)) for expr in every):
        _enabled(graph, [*main, *isr], reporter)
        _flags(graph, [*main, *isr], isr, reporter)
        _directions([*main, *isr], reporter)
        _open_drain([*main, *isr], reporter)
    if watchdog and not any(isinstance(expr, tree.Builtin) and expr.clears_watchdog for expr in every):
        reporter.warn(
            "c-watchdog",
            "the watchdog is on and never cleared: it resets the chip again and again",
            graph.program.functions["main"].place,
            hint="switch it off in the configuration word, or clear it in the main loop",
        )


def _expressions(graph: CallGraph, names: list[str]) -> list[tree.Expr]:
    bodies = (graph.program.functions[name].body for name in names)
    return [expr for body in bodies if body is not None for expr in expressions(body)]


def _writes(every: list[tree.Expr]) -> Iterator[_Write]:
    """Yield the writes to registers, with the bits that they set and clear."""
    for expr in every:
        if not isinstance(expr, (tree.Assign, tree.Update)) or not isinstance(expr.target, tree.Ref):
            continue
        target, value = expr.target, expr.value
        if target.symbol.kind != "fixed":
            continue
        name = target.symbol.name
        if target.width:
            mask = (1 << target.width) - 1 << (target.bit or 0)
            given = value.value << (target.bit or 0) if isinstance(value, tree.Num) else None
        else:
            mask, given = 0xFF, value.value if isinstance(value, tree.Num) else None
        if isinstance(expr, tree.Update) or given is None:
            yield _updated(name, expr, mask, given)
        else:
            yield _Write(name, mask & given, mask & given, mask & ~given, not target.width, expr.place)


def _updated(name: str, expr: tree.Assign | tree.Update, mask: int, given: int | None) -> _Write:
    """Return a write whose value is not constant as a whole; `|=` and `&=` of a constant say what they do."""
    op = expr.op if isinstance(expr, tree.Update) else ""
    if given is not None and op == "|":
        return _Write(name, mask & given, mask & given, 0, False, expr.place)
    if given is not None and op == "&":
        return _Write(name, 0, 0, mask & ~given, False, expr.place)
    return _Write(name, 0, mask, mask, mask == 0xFF and not op, expr.place)


def _bit(name: str) -> tuple[str, int]:
    register, bit = register_bits()[name]
    return register.name, 1 << bit


def _enabled(graph: CallGraph, writes: list[_Write], reporter: Reporter) -> None:
    """Warn about GIE set without an interrupt function, and about an interrupt function without GIE."""
    register, gie = _bit("GIE")
    here = [write for write in writes if write.register == register]
    if graph.handler is None:
        first = next((write for write in here if write.sets & gie), None)
        if first is not None:
            reporter.warn("c-interrupt-enable", "GIE is set, but there is no interrupt function", first.place)
    elif not any(write.may_set & gie for write in here):
        reporter.warn(
            "c-interrupt-enable",
            "this interrupt function is never called: GIE is never set",
            graph.program.functions[graph.handler].place,
        )


def _flags(graph: CallGraph, writes: list[_Write], isr: list[_Write], reporter: Reporter) -> None:
    """Warn about an enabled interrupt whose flag the function does not clear (DS35007 section 6.8)."""
    if graph.handler is None:
        return
    for enable, flag in _SOURCES.items():
        (register, on), (flag_register, up) = _bit(enable), _bit(flag)
        enabled = any(write.register == register and write.sets & on for write in writes)
        cleared = any(write.register == flag_register and write.may_clear & up for write in isr)
        if enabled and not cleared:
            reporter.warn(
                "c-interrupt-flag",
                f"this interrupt function never clears {flag}: it is called again as soon as it returns",
                graph.program.functions[graph.handler].place,
            )


def _directions(writes: list[_Write], reporter: Reporter) -> None:
    """Warn about a port that is written although TRIS, which starts with all ones, never is (DS35007 section
    4).
    """
    for port, tris in _PORTS.items():
        first = next((write for write in writes if write.register == port and write.whole), None)
        if first is not None and not any(write.register == tris for write in writes):
            reporter.warn(
                "c-port-direction",
                f"all pins of {port} are inputs: {tris} is never written",
                first.place,
                hint=f"{tris} = 0 makes all of them outputs",
            )


def _open_drain(writes: list[_Write], reporter: Reporter) -> None:
    """Warn about RA4 set as an output: its driver only pulls low (DS35007 section 4.1)."""
    ra4 = 1 << 4
    output = any(write.register == "TRISA" and write.may_clear & ra4 for write in writes)
    high = (write for write in writes if write.register == "PORTA" and write.sets & ra4)
    first = next((write for write in high if not write.whole or write.sets < 2 * ra4), None)
    if output and first is not None:
        reporter.warn(
            "c-open-drain",
            "RA4 is an open-drain output: it is high only with a pull-up resistor",
            first.place,
        )
