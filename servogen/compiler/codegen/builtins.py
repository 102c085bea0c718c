"""The operations of the chip and the library that a program calls by a built-in function's name, and those on
floating-point values.

In: `Builtin` nodes. Out: instructions, delays, calls of library routines; a result is in W, that of a
floating-point operation in bytes. The floating-point routines find their first operand where they leave their
results, so that a chain of operations moves no intermediate value: where the order of the operands does not
matter, the result of another operation becomes the first.
"""

from __future__ import annotations

from servogen.compiler.ast.nodes import FLOAT_OPERATIONS, Builtin, Expr
from servogen.compiler.ast.types import FloatType
from servogen.compiler.codegen.calls import library_call
from servogen.compiler.codegen.effects import calls_something
from servogen.compiler.codegen.expressions import into
from servogen.compiler.codegen.float_routines import integer_places, second_operand, shared
from servogen.compiler.codegen.generator import FunctionGenerator
from servogen.compiler.codegen.operands import operands_of
from servogen.compiler.codegen.operators import to_w
from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import PCL, PCLATH, Byte, Loc
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
        case _:
            raise AssertionError(f"no code for the built-in operation {expr.name!r}")
    return []


_LOOP_CYCLES = 4
"""Of one round of a watched delay, beside the delay in it: CLRWDT, DECFSZ and GOTO."""
MAX_CARRY_CYCLES = 8
"""What a watched delay takes at most between two CLRWDT, beside the delay itself."""
_WITHOUT_LOOP = 11
"""A loop takes a cycle more: 4 for its counters, 5 for the shortest round, and 3 for its end."""


def watched_delay(gen: FunctionGenerator, cycles: int, unwatched: int) -> None:
    """Emit a delay of so many cycles that clears the watchdog at its start, and again after at most
    `unwatched` cycles.

    The rounds are counted in two bytes. A round takes 4 cycles beside its delay, 2 more where the low byte
    reaches 0, and the last one 1 more.
    """
    if cycles <= max(unwatched, _WITHOUT_LOOP):
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
    gen.label(top, rounds)
    gen.emit("CLRWDT", fixed=True)
    gen.delay(wait)
    for byte in counter:
        gen.emit("DECFSZ", byte, 1, fixed=True)
        gen.emit("GOTO", target=top, fixed=True)
    gen.emit("CLRWDT", fixed=True)
    gen.delay(cycles - used - 1)


_COMMUTATIVE = ("float_add", "float_subtract", "float_multiply")
"""Operations whose operands may be exchanged; a difference is a sum in which one operand changes its sign."""


def float_operation(gen: FunctionGenerator, expr: Builtin) -> list[Loc]:
    """Emit an operation and return the bytes of its result; none where it is in W."""
    match expr.name:
        case "float_to_integer":
            return _to_integer(gen, expr)
        case "float_from_integer":
            return _from_integer(gen, expr)
        case "float_square_root":
            size = _size(expr)
            routine = gen.library(expr.name, (size,))
            _evaluate_into(gen, expr.arguments[0], shared(gen.library, size).value)
            return _called(gen, routine)
    return _binary(gen, expr)


def _size(expr: Builtin) -> int:
    """Return the size of the floating-point values of an operation, whose operand or result is one."""
    return next(
        operand.type.size for operand in (expr, *expr.arguments) if isinstance(operand.type, FloatType)
    )


def _called(gen: FunctionGenerator, routine: Function) -> list[Loc]:
    """Call a routine and return the bytes of its result."""
    gen.emit("CALL", target=routine.name)
    if routine.result is None:
        return []
    return [Byte(routine.result, index) for index in range(routine.result.size)]


def _to_integer(gen: FunctionGenerator, expr: Builtin) -> list[Loc]:
    """Emit the conversion to an integer and return its bytes."""
    routine = gen.library(expr.name, (_size(expr),))
    parameter = routine.parameters[0]
    _evaluate_into(gen, expr.arguments[0], [Byte(parameter, index) for index in range(parameter.size)])
    return _called(gen, routine)


def _from_integer(gen: FunctionGenerator, expr: Builtin) -> list[Loc]:
    """Emit the conversion of an integer, evaluated into the place where the routine finds its mantissa."""
    size = _size(expr)
    signed, integer = bool(expr.data), expr.arguments[0]
    routine = gen.library(expr.name, (size, integer.type.size, int(signed)))
    extra: list[Loc] = [Byte(symbol, 0) for symbol in routine.own if symbol.name == "extra"]
    _evaluate_into(gen, integer, integer_places(shared(gen.library, size), extra, integer.type.size))
    return _called(gen, routine)


def _evaluate_into(gen: FunctionGenerator, expr: Expr, target: list[Loc]) -> None:
    """Evaluate an operand into a routine's bytes. What calls a function goes through a temporary, because the
    bytes of two functions may overlap; the result of an operation lies in the routines' bytes already.
    """
    if not calls_something(expr) or _is_operation(expr):
        into(gen, expr, target)
        return
    temporary: list[Loc] = gen.temp(len(target))
    into(gen, expr, temporary)
    gen.move_all(target, list(temporary))


def _is_operation(expr: Expr) -> bool:
    """Return whether an expression leaves its value where the routines have their results."""
    return isinstance(expr, Builtin) and expr.name in FLOAT_OPERATIONS and isinstance(expr.type, FloatType)


def _binary(gen: FunctionGenerator, expr: Builtin) -> list[Loc]:
    """Emit an operation with two operands, evaluated in the order that needs the fewest copies."""
    size = _size(expr)
    routine = gen.library("float_add" if expr.name == "float_subtract" else expr.name, (size,))
    value, other = shared(gen.library, size).value, second_operand(gen.library, size)
    first, second = expr.arguments
    second_is_there = expr.name in _COMMUTATIVE and _is_operation(second)
    place_of_second = value if second_is_there else other
    place_of_first = other if second_is_there else value
    if not calls_something(second):
        _evaluate_into(gen, first, place_of_first)
        into(gen, second, place_of_second)
    elif not calls_something(first):
        _evaluate_into(gen, second, place_of_second)
        into(gen, first, place_of_first)
    else:
        temporary: list[Loc] = gen.temp(size)
        into(gen, first, temporary)
        _evaluate_into(gen, second, place_of_second)
        gen.move_all(place_of_first, list(temporary))
    if expr.name == "float_subtract":
        gen.emit("MOVLW", k=0x80)
        gen.emit("XORWF", place_of_second[-1], 1)
    return _called(gen, routine)
