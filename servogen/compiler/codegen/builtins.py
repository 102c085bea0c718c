"""The operations of the chip and the library that a dialect offers as built-in functions.

In: built-in operations of the typed tree. Out: instructions; a result of one byte is left in W.
"""

from __future__ import annotations

from servogen.compiler.ast.nodes import Builtin
from servogen.compiler.codegen.calls import library_call
from servogen.compiler.codegen.generator import FunctionGenerator
from servogen.compiler.codegen.operands import operands_of
from servogen.compiler.codegen.operators import to_w


def builtin(gen: FunctionGenerator, expr: Builtin) -> None:
    gen.place = expr.place if expr.place.line else gen.place
    match expr.name:
        case "instruction":
            gen.emit(str(expr.data), fixed=True)
        case "delay":
            assert isinstance(expr.data, int)
            gen.delay(expr.data)
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
            function = gen.library(expr.name, tuple(int(each) for each in data))
            operands = [operands_of(gen, each, 1) for each in expr.arguments]
            library_call(gen, function, operands)
