"""Conversions, which all parts of the semantic analysis share.

In: typed operands. Out: operands converted according to ISO C 6.3, constants folded, with warnings for loss
of information.
"""

from __future__ import annotations

from servogen.compiler.ast import nodes as tree
from servogen.compiler.ast.types import (
    C2C_INT,
    U8,
    U16,
    ArrayType,
    CType,
    FloatType,
    FuncType,
    IntType,
    PointerType,
    StructType,
    VoidType,
    common,
    differs_in_const,
    promote,
    same,
)
from servogen.compiler.sema.accessors import load
from servogen.compiler.sema.analyser import Analyser
from servogen.compiler.sema.floats import converted, truth_of_float, warn_inexact

_ALL_ONES = (1 << 16, 1 << 24, 1 << 32)
"""One more than the numbers that stand for -1 where programs compare pointers with it."""
NUMBERS = (IntType, FloatType)
"""The arithmetic types."""

# conversions


def decay(analyser: Analyser, expr: tree.Expr) -> tree.Expr:
    """Return an array as the address of its first element, and a pointer in the EEPROM as its value; other
    expressions are unchanged.
    """
    if isinstance(expr, tree.EepromObject) and isinstance(expr.type, PointerType):
        return load(analyser, expr)
    if isinstance(expr.type, ArrayType):
        kind = PointerType(expr.type.element)
        if isinstance(expr, tree.Ref):
            return address(expr, kind)
        if isinstance(expr, tree.Deref):
            return offset_pointer(expr.pointer, expr.offset, kind)
        if isinstance(expr, tree.Comma):
            second = decay(analyser, expr.second)
            return tree.Comma(expr.first, second, second.type, expr.place)
        if isinstance(expr, tree.EepromObject):
            raise analyser.fail("c-unsupported", "there are no pointers into the EEPROM", expr)
    return expr


def address(target: tree.Ref, kind: PointerType) -> tree.Expr:
    """Return the address of an object, which from now on may be accessed through pointers."""
    target.symbol.pinned = True
    return tree.AddressOf(target, kind, target.place)


def offset_pointer(pointer: tree.Expr, offset: int, kind: CType) -> tree.Expr:
    """Return a pointer moved by a number of bytes."""
    if isinstance(pointer, tree.Num):
        return tree.Num((pointer.value + offset) & (1 << 8 * kind.size) - 1, kind, pointer.place)
    moved = tree.Cast(pointer, kind, pointer.place)
    if offset == 0:
        return moved
    return tree.Binary("+", moved, tree.Num(offset, address_int(kind), pointer.place), kind, pointer.place)


def address_int(kind: CType) -> IntType:
    """Return the integer type of a pointer's size."""
    return U8 if kind.size == 1 else U16


def rvalue(analyser: Analyser, expr: tree.Expr) -> tree.Expr:
    """Return the value of an expression: arrays decay; void has no value."""
    if isinstance(expr, (tree.WideField, tree.EepromObject)):
        return load(analyser, expr)
    expr = decay(analyser, expr)
    if isinstance(expr.type, VoidType):
        raise analyser.fail("c-type", "this has no value: its type is void", expr)
    return expr


def arithmetic(analyser: Analyser, expr: tree.Expr) -> tree.Expr:
    """Return the value of an expression that must be an integer."""
    expr = rvalue(analyser, expr)
    if not isinstance(expr.type, IntType):
        raise analyser.fail("c-type", f"an integer is needed here, not '{expr.type}'", expr)
    return expr


def promoted(analyser: Analyser, expr: tree.Expr) -> tree.Expr:
    """Return the value of an integer after the integer promotions (ISO C 6.3.1.1)."""
    expr = arithmetic(analyser, expr)
    assert isinstance(expr.type, IntType)
    return cast(analyser, expr, promote(expr.type, c2c=analyser.c2c))


def balance(analyser: Analyser, left: tree.Expr, right: tree.Expr) -> tuple[tree.Expr, tree.Expr, IntType]:
    """Return two operands after the usual arithmetic conversions, and their common type (ISO C 6.3.1.8)."""
    left, right = arithmetic(analyser, left), arithmetic(analyser, right)
    assert isinstance(left.type, IntType) and isinstance(right.type, IntType)
    kind = common(left.type, right.type, c2c=analyser.c2c)
    return cast(analyser, left, kind), cast(analyser, right, kind), kind


def cast(analyser: Analyser, expr: tree.Expr, kind: CType) -> tree.Expr:
    """Return an explicit conversion; constants are folded and conversions without effect dropped."""
    kind = kind.plain()
    if expr.type.plain() == kind:
        return expr
    if isinstance(kind, FloatType) or isinstance(expr.type, FloatType):
        return converted(analyser, expr, kind)
    if isinstance(expr, tree.Num):
        if isinstance(kind, IntType):
            return tree.Num(kind.wrap(expr.value), kind, expr.place)
        if isinstance(kind, PointerType):
            # a negative number, as in (char *) -1, stands for its bytes
            bits = 8 * kind.size
            if not -(1 << bits - 1) <= expr.value < 1 << bits and expr.value + 1 not in _ALL_ONES:
                raise analyser.fail(
                    "c-address",
                    f"the address 0x{expr.value & 0xFFFFFFFF:X} does not fit '{kind}'",
                    expr,
                    hint=f"it has {kind.size} byte{'s' * (kind.size > 1)}",
                )
            return tree.Num(expr.value & (1 << bits) - 1, kind, expr.place)
    return tree.Cast(expr, kind, expr.place)


def convert(analyser: Analyser, expr: tree.Expr, kind: CType, role: str) -> tree.Expr:
    """Return the implicit conversion of an assignment, argument, initialiser or result."""
    expr = rvalue(analyser, expr)
    kind = kind.plain()
    if isinstance(kind, IntType) and isinstance(expr.type, IntType):
        _warn_range(analyser, expr, kind)
        return cast(analyser, expr, kind)
    if isinstance(kind, NUMBERS) and isinstance(expr.type, NUMBERS):
        warn_inexact(analyser, expr, kind)
        return cast(analyser, expr, kind)
    if isinstance(kind, PointerType):
        return _to_pointer(analyser, expr, kind, role)
    if isinstance(kind, StructType) and same(kind, expr.type):
        return expr
    if isinstance(kind, IntType) and isinstance(expr.type, PointerType):
        if kind.is_bool:
            return cast(analyser, expr, kind)
        analyser.reporter.warn(
            "c-conversion",
            f"{role} makes '{kind}' from the pointer '{expr.type}' without a cast",
            expr.place,
            hint="to call a function, write its name and parentheses"
            if isinstance(expr.type.target, FuncType)
            else None,
        )
        return cast(analyser, expr, kind)
    raise analyser.fail("c-type", f"{role} needs '{kind}', not '{expr.type}'", expr)


def _warn_range(analyser: Analyser, expr: tree.Expr, kind: IntType) -> None:
    """Warn about a constant that an implicit conversion changes."""
    if not isinstance(expr, tree.Num) or kind.is_bool:
        return
    becomes = kind.wrap(expr.value)
    if expr.exact is not None:
        value, narrow = expr.exact, kind if expr.exact >> 8 * kind.bytes else expr.type
        changed = value != becomes & (1 << 8 * kind.bytes) - 1
    else:
        value, narrow = expr.value, kind
        # -1 for an unsigned type is taken as meant: all ones; but C2C's `int` is one without saying so
        low = 0 if kind == C2C_INT else -(1 << 8 * kind.bytes - 1)
        changed = not low <= value < 1 << 8 * kind.bytes - kind.signed
    if changed:
        analyser.reporter.warn(
            "c-conversion", f"{value} does not fit '{narrow}' and becomes {becomes}", expr.place
        )


def _to_pointer(analyser: Analyser, expr: tree.Expr, kind: PointerType, role: str) -> tree.Expr:
    """Return the implicit conversion to a pointer (ISO C 6.5.16.1)."""
    if isinstance(expr, tree.Num) and isinstance(expr.type, IntType):
        if expr.value != 0:
            analyser.reporter.warn(
                "c-conversion",
                f"{role} makes a pointer from the number {expr.value} without a cast",
                expr.place,
            )
        return cast(analyser, expr, kind)
    if not isinstance(expr.type, PointerType):
        if isinstance(expr.type, IntType):
            analyser.reporter.warn(
                "c-conversion", f"{role} makes a pointer from '{expr.type}' without a cast", expr.place
            )
            return cast(analyser, expr, kind)
        raise analyser.fail("c-type", f"{role} needs '{kind}', not '{expr.type}'", expr)
    keep_const(analyser, expr, kind, role)
    source, target = expr.type.target, kind.target
    if not same(source, target) and not isinstance(source, VoidType) and not isinstance(target, VoidType):
        analyser.reporter.warn(
            "c-conversion", f"{role} makes '{kind}' from '{expr.type}' without a cast", expr.place
        )
    return cast(analyser, expr, kind)


def keep_const(analyser: Analyser, expr: tree.Expr, kind: CType, role: str) -> None:
    """Reject the conversion of a pointer that may lead to flash to one that reaches only RAM, also where such
    pointers, or functions that take or return them, are what is pointed to: their sizes differ.
    """
    if not isinstance(expr.type, PointerType) or not isinstance(kind, PointerType):
        return
    if expr.type.size > kind.size:
        raise analyser.fail(
            "c-const",
            f"{role} would drop const: '{expr.type}' may point to flash, '{kind}' cannot",
            expr,
            hint="declare the pointer as a pointer to const",
        )
    if differs_in_const(expr.type.target, kind.target):
        raise analyser.fail(
            "c-const",
            f"{role} makes '{kind}' from '{expr.type}': a pointer to const has two bytes, others have one",
            expr,
            hint="declare both with the same const",
        )


def truth(analyser: Analyser, expr: tree.Expr) -> tree.Expr:
    """Return the operand of a condition."""
    function = isinstance(expr.type, PointerType) and isinstance(expr.type.target, FuncType)
    if (isinstance(expr.type, ArrayType) and isinstance(expr, tree.Ref)) or (
        function and isinstance(expr, tree.Num)
    ):
        analyser.reporter.warn(
            "c-comparison",
            "this address is always true",
            expr.place,
            hint="call the function: write its name and parentheses"
            if function
            else "an element needs an index",
        )
    expr = rvalue(analyser, expr)
    if not expr.type.scalar:
        raise analyser.fail("c-type", f"a condition needs a number or a pointer, not '{expr.type}'", expr)
    return truth_of_float(analyser, expr) if isinstance(expr.type, FloatType) else expr
