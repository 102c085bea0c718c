"""Helpers for emitting one library routine.

In: an empty `Function`. Out: its instructions, parameters and variables.
"""

from __future__ import annotations

from servogen.compiler.ast.nodes import Symbol
from servogen.compiler.ast.types import U8, U16, U24, U32, IntType
from servogen.compiler.ir.builder import InstructionBuilder
from servogen.compiler.ir.instruction import Byte, Loc

_UNSIGNED: tuple[IntType, ...] = (U8, U16, U24, U32)


def variable(
    gen: InstructionBuilder, name: str, size: int, *, parameter: bool = False, in_w: bool = False
) -> list[Loc]:
    """Return the bytes of a new variable of a library routine, low byte first."""
    symbol = Symbol(name, _UNSIGNED[size - 1], "param" if parameter else "temp", function=gen.function.name)
    gen.function.own.append(symbol)
    if parameter:
        gen.function.parameters.append(symbol)
    if in_w:
        gen.function.w_parameter = symbol
    return [Byte(symbol, each) for each in range(size)]


def parameter(gen: InstructionBuilder, name: str, size: int, *, in_w: bool = False) -> list[Loc]:
    """Return the bytes of a new parameter of a library routine, low byte first."""
    return variable(gen, name, size, parameter=True, in_w=in_w)
