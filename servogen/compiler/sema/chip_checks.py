"""Warnings about the chip: interrupts, directions of pins, RA4, the watchdog.

In: the typed tree of a program and its configuration. Out: warnings about what compiles but cannot work. A
program with assembly gets no warnings, because that may do what is missing.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from servogen.compiler.ast.nodes import AddressOf, Assign, Builtin, Deref, Expr, Num, Ref, Update
from servogen.compiler.ast.walk import expressions
from servogen.compiler.diagnostics import Reporter
from servogen.compiler.sema.call_graph import CallGraph
from servogen.errors import Location
from servogen.pic.device import register_bits

_SOURCES = {"T0IE": "T0IF", "INTE": "INTF", "RBIE": "RBIF", "EEIE": "EEIF"}
"""The bit that enables each interrupt, and the flag that calls it (DS35007 section 6.8)."""
_PORTS = {"PORTA": "TRISA", "PORTB": "TRISB"}


@dataclass(frozen=True, slots=True)
class _Write:
    """A write to a register: the bits that it sets for certain, may set and may clear, as masks."""

    register: str
    sets: int
    may_set: int
    may_clear: int
    whole: bool
    place: Location


def check_chip(graph: CallGraph, reporter: Reporter, *, watchdog: bool) -> None:
    """Report all warnings of this module. `watchdog`: whether the configuration word switches it on."""
    if graph.program_has_assembly:
        return
    in_main, in_isr = _expressions(graph, graph.main), _expressions(graph, graph.isr)
    every = [*in_main, *in_isr]
    main, isr = list(_writes(in_main)), list(_writes(in_isr))
    if not any(isinstance(expr, (AddressOf, Deref)) for expr in every):
        _enabled(graph, [*main, *isr], reporter)
        _flags(graph, [*main, *isr], isr, reporter)
        _directions([*main, *isr], reporter)
        _open_drain([*main, *isr], reporter)
    if watchdog and not any(_feeds(expr) for expr in every):
        reporter.warn(
            "c-watchdog",
            "the watchdog is on and never cleared: it resets the chip again and again",
            graph.program.functions["main"].place,
            hint="switch it off in the configuration word, or clear it in the main loop",
        )


def _expressions(graph: CallGraph, names: list[str]) -> list[Expr]:
    bodies = (graph.program.functions[name].body for name in names)
    return [expr for body in bodies if body is not None for expr in expressions(body)]


def _writes(every: list[Expr]) -> Iterator[_Write]:
    """Yield the writes to registers, with the bits that they set and clear."""
    for expr in every:
        if not isinstance(expr, (Assign, Update)) or not isinstance(expr.target, Ref):
            continue
        target, value = expr.target, expr.value
        if target.symbol.kind != "fixed":
            continue
        name = target.symbol.name
        if target.width:
            mask = (1 << target.width) - 1 << (target.bit or 0)
            given = value.value << (target.bit or 0) if isinstance(value, Num) else None
        else:
            mask, given = 0xFF, value.value if isinstance(value, Num) else None
        if isinstance(expr, Update) or given is None:
            yield _updated(name, expr, mask, given)
        else:
            yield _Write(name, mask & given, mask & given, mask & ~given, not target.width, expr.place)


def _updated(name: str, expr: Assign | Update, mask: int, given: int | None) -> _Write:
    """Return a write whose value is not constant as a whole; `|=` and `&=` of a constant say what they do."""
    op = expr.op if isinstance(expr, Update) else ""
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


def _feeds(expr: Expr) -> bool:
    """Return whether an expression clears the watchdog."""
    instruction = (
        isinstance(expr, Builtin) and expr.name == "instruction" and expr.data in ("CLRWDT", "SLEEP")
    )
    return instruction or (isinstance(expr, Builtin) and expr.name == "delay_watched")
