"""The operations of the chip and the library that a program calls by a built-in function's name.

In: `Builtin` nodes. Out: instructions, delays, calls of library routines; a result is in W, that of a
floating-point operation in bytes.
"""

from __future__ import annotations

from servogen.compiler.ast.nodes import FLOAT_OPERATIONS, Builtin
from servogen.compiler.codegen.calls import library_call
from servogen.compiler.codegen.floats import float_operation
from servogen.compiler.codegen.generator import FunctionGenerator
from servogen.compiler.codegen.operands import operands_of
from servogen.compiler.codegen.operators import to_w
from servogen.compiler.ir.instruction import PCL, PCLATH, Loc
from servogen.errors import Location


def builtin(gen: FunctionGenerator, expr: Builtin) -> list[Loc]:
    """Execute an operation; return the bytes of its result, or none where a result is in W."""
    gen.place = expr.place if expr.place.line else gen.place
    if expr.name in FLOAT_OPERATIONS:
        return float_operation(gen, expr)
    match expr.name:
        case "instruction":
            gen.emit(str(expr.data), fixed=True)
        case "delay":
            assert isinstance(expr.data, int)
            gen.delay(expr.data)
        case "delay_watched":
            assert isinstance(expr.data, tuple)
            watched_delay(gen, *expr.data)
        case "restart":
            # writing PCL jumps, and takes the high bits of the address from PCLATH (DS35007 section 2.4)
            gen.emit("CLRF", PCLATH, fixed=True)
            gen.emit("CLRF", PCL, fixed=True)
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
            function = gen.library(expr.name, tuple(int(parameter) for parameter in data))
            operands = [operands_of(gen, argument, 1) for argument in expr.arguments]
            library_call(gen, function, operands)
    return []


_LOOP_CYCLES = 4
"""Of one round of a watched delay, beside the delay in it: CLRWDT, DECFSZ and GOTO."""
MAX_CARRY_CYCLES = 8
"""What a watched delay takes at most between two CLRWDT, beside the delay itself."""


def watched_delay(gen: FunctionGenerator, cycles: int, unwatched: int) -> None:
    """Emit a delay of so many cycles that clears the watchdog at its start, and again after at most
    `unwatched` cycles.

    The rounds are counted in two bytes. A round takes 4 cycles beside its delay, 2 more where the low byte
    reaches 0, and the last one 1 more.
    """
    if cycles <= max(unwatched, MAX_CARRY_CYCLES):
        if cycles:
            gen.emit("CLRWDT", fixed=True)
            gen.delay(cycles - 1)
        return
    wait = max(unwatched // 2 - MAX_CARRY_CYCLES, 1)
    rounds = (cycles - 6) * 128 // ((wait + _LOOP_CYCLES) * 128 + 1)  # 2 cycles more in each 256th round
    if rounds > 0xFFFF:
        text = f"a delay of {cycles} cycles would clear the watchdog {rounds} times; the maximum is 65535"
        gen.context.reporter.error("c-argument", text, gen.place or Location())
        return
    low, high = rounds & 0xFF or 0x100, -(-rounds // 0x100)
    used = 4 + rounds * (wait + _LOOP_CYCLES) + 2 * (high - 1) + 1
    counter = gen.temp(2)
    for byte, value in zip(counter, (low, high), strict=True):
        gen.emit("MOVLW", k=value, fixed=True)
        gen.emit("MOVWF", byte, fixed=True)
    top = gen.new_label("wait")
    gen.function.bounds[top] = rounds
    gen.label(top)
    gen.emit("CLRWDT", fixed=True)
    gen.delay(wait)
    for byte in counter:
        gen.emit("DECFSZ", byte, 1, fixed=True)
        gen.emit("GOTO", target=top, fixed=True)
    gen.emit("CLRWDT", fixed=True)
    gen.delay(cycles - used - 1)
