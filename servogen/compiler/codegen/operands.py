"""Values as operands: bytes of variables, constants and temporaries; extended, preserved, kept disjoint.

In: typed expressions. Out: the requested number of operand bytes. A value whose bytes cannot simply be named
is evaluated into a temporary through `Lowering`.
"""

from __future__ import annotations

from servogen.compiler.ast.constant_folding import has_effect, interval
from servogen.compiler.ast.nodes import AddressByte, AddressOf, Cast, Expr, Num, Ref
from servogen.compiler.ast.types import IntType, VoidType
from servogen.compiler.codegen.arithmetic import imms, sign_byte
from servogen.compiler.codegen.effects import calls_something, stripped, width_of
from servogen.compiler.codegen.generator import FunctionGenerator
from servogen.compiler.ir.instruction import Byte, Imm, Loc, Operand


def operands_of(gen: FunctionGenerator, expr: Expr, size: int) -> list[Operand]:
    """Return operands for the low `size` bytes; they remain valid until the next assignment or call."""
    match expr:
        case Num(value):
            return imms(value, size)
        case AddressOf(target) if target.index is None:
            return address_operands(gen, target, expr.type.size, size)
        case Ref() if is_direct(expr):
            return extended(gen, list(ref_locs(gen, expr)), expr, size)
        case Cast(operand) if isinstance(expr.type, IntType) and not expr.type.is_bool:
            if expr.type.size >= size and operand.type.scalar:
                return operands_of(gen, operand, size)
            inner = operands_of(gen, operand, expr.type.size)
            return extended(gen, inner, expr, size)
        case Cast(operand) if not isinstance(expr.type, (IntType, VoidType)) and operand.type.scalar:
            return extended(gen, _pointer_cast(gen, expr), expr, size)
    need = min(size, expr.type.size, width_of(*interval(expr))[0])
    temporary: list[Loc] = gen.temp(need)
    gen.lower.into(gen, expr, temporary)
    return extended(gen, list(temporary), expr, size)


def _pointer_cast(gen: FunctionGenerator, expr: Cast) -> list[Operand]:
    operand, size = expr.operand, expr.type.size
    return operands_of(gen, operand, size)


def address_operands(gen: FunctionGenerator, target: Ref, have: int, size: int) -> list[Operand]:
    """Return the bytes of an object's address as constants, extended with zeros to `size`."""
    symbol = gen.symbol(target.symbol)
    address: list[Operand] = [
        Imm(AddressByte(symbol, target.offset, part)) for part in range(min(have, size))
    ]
    return address + imms(0, size - len(address))


def extended(gen: FunctionGenerator, operands: list[Operand], expr: Expr, size: int) -> list[Operand]:
    """Return the bytes of a value, extended with its sign or zeros, or truncated."""
    if len(operands) >= size:
        return operands[:size]
    missing = size - len(operands)
    if not negative_possible(expr):
        return operands + imms(0, missing)
    operands = [*operands[:-1], gen.steady(operands[-1])]
    sign = sign_byte(gen, operands[-1])
    return operands + [sign] * missing


def widen(gen: FunctionGenerator, target: list[Loc], size: int, *, signed: bool) -> None:
    """Fill the bytes above `size` with the sign or with zeros."""
    fill: Operand = Imm(0)
    if signed:
        top = target[size]
        gen.emit("CLRF", top)
        gen.skip_if(7, False, target[size - 1])
        gen.emit("COMF", top, 1)
        gen.move_all(target[size + 1 :], [top] * (len(target) - size - 1))
        return
    gen.move_all(target[size:], [fill] * (len(target) - size))


def widen_result(gen: FunctionGenerator, expr: Expr, target: list[Loc], size: int) -> None:
    """Extend a result of `size` bytes that lies in `target`."""
    if len(target) > size:
        widen(gen, target, size, signed=negative_possible(expr))


def negative_possible(expr: Expr) -> bool:
    """Return whether the value of an expression may be negative, so that extending it must copy the sign."""
    return isinstance(expr.type, IntType) and expr.type.signed and interval(expr)[0] < 0


def is_direct(expr: Expr) -> bool:
    """Return whether an expression is a whole variable, or a part of one at a known offset."""
    return isinstance(expr, Ref) and expr.index is None and not expr.width and expr.symbol.kind != "flash"


def ref_locs(gen: FunctionGenerator, expr: Ref) -> list[Loc]:
    return gen.locs(expr.symbol, expr.offset, expr.type.size)


def pair(gen: FunctionGenerator, left: Expr, right: Expr, size: int) -> tuple[list[Operand], list[Operand]]:
    """Return the operands of two values; the first survives the evaluation of the second."""
    if not has_effect(right) and not calls_something(right):
        a = operands_of(gen, left, size)
        return a, operands_of(gen, right, size)
    # the order is unspecified in C (ISO C 6.5): the operand with calls and effects comes first, if only one
    # has them
    b_first = not has_effect(left) and not calls_something(left)
    if b_first:
        b = preserved(gen, operands_of(gen, right, size))
        return operands_of(gen, left, size), b
    a = preserved(gen, operands_of(gen, left, size))
    return a, operands_of(gen, right, size)


def preserved(gen: FunctionGenerator, operands: list[Operand]) -> list[Operand]:
    """Return operands in which variables are replaced by copies, so that nothing can change them."""
    variables = [operand for operand in operands if not isinstance(operand, Imm) and not _is_temp(operand)]
    if not variables:
        return operands
    copies: list[Loc] = gen.temp(len(operands))
    gen.move_all(copies, operands)
    return list(copies)


def _is_temp(operand: Operand) -> bool:
    return isinstance(operand, Byte) and operand.symbol.kind == "temp"


def apart(gen: FunctionGenerator, target: list[Loc], operands: list[Operand]) -> list[Operand]:
    """Return operands of which no byte is a target byte at another position."""
    for number, operand in enumerate(operands):
        if any(operand == t and position != number for position, t in enumerate(target)):
            copies: list[Loc] = gen.temp(len(operands))
            gen.move_all(copies, operands)
            return list(copies)
    return operands


def is_constant(expr: Expr) -> bool:
    """Return whether the low byte of an expression is a constant, or part of an address."""
    return isinstance(stripped(expr), Num) or (
        isinstance(stripped(expr), AddressOf) and stripped(expr).target.index is None  # type: ignore[union-attr]
    )


def is_simple_operand(expr: Expr) -> bool:
    """Return whether the low byte of an expression is already a byte of memory."""
    return is_direct(stripped(expr))


def operand_ready(value: Expr) -> bool:
    """Return whether the low byte of a value is an operand already, without code to compute it."""
    return is_constant(value) or is_simple_operand(value)
