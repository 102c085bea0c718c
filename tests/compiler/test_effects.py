"""What an expression may do beside having a value, by the definitions of C; and the bytes of a range."""

from __future__ import annotations

import pytest

from servogen.compiler.ast.nodes import (
    AddressOf,
    Assign,
    Binary,
    Cast,
    Choice,
    Comma,
    Deref,
    Expr,
    Logic,
    Num,
    Ref,
    Symbol,
    Unary,
)
from servogen.compiler.ast.types import U8, PointerType
from servogen.compiler.codegen.effects import calls_something, changes, touches, width_of
from servogen.compiler.ir.instruction import Byte, Reg
from servogen.errors import Location

HERE = Location("main.c", 1)
POINTER = PointerType(U8)
X, Y = Symbol("x", U8, "global"), Symbol("y", U8, "static")
PORT = Symbol("PORTB", U8, "fixed")


def ref(symbol: Symbol, index: Expr | None = None) -> Ref:
    return Ref(symbol, 0, index, U8, HERE)


ONE = Num(1, U8, HERE)
SET_X = Assign(ref(X), ONE, U8, HERE)


def around(inner: Expr) -> list[Expr]:
    """Every operator with `inner` as one of its operands and 1 as the others."""
    return [
        ref(Y, inner),
        Deref(Binary("+", ref(Y), inner, POINTER, HERE), 0, U8, HERE),
        AddressOf(ref(Y, inner), POINTER, HERE), Cast(inner, U8, HERE), Unary("-", inner, U8, HERE),
        Binary("+", inner, ONE, U8, HERE), Binary("+", ONE, inner, U8, HERE),
        Logic("&&", inner, ONE, U8, HERE), Logic("&&", ONE, inner, U8, HERE), Comma(inner, ONE, U8, HERE),
        Comma(ONE, inner, U8, HERE), Choice(inner, ONE, ONE, U8, HERE), Choice(ONE, inner, ONE, U8, HERE),
        Choice(ONE, ONE, inner, U8, HERE),
    ]  # fmt: skip


@pytest.mark.parametrize("position", range(14))
def test_an_assignment_in_any_operand_changes_something(position: int) -> None:
    assert changes(around(SET_X)[position])
    assert not changes(around(ref(X))[position])


@pytest.mark.parametrize("position", range(14))
def test_a_multiplication_in_any_operand_calls_a_routine(position: int) -> None:
    product = Binary("*", ref(X), ref(Y), U8, HERE)
    assert calls_something(around(product)[position])
    assert not calls_something(around(ref(X))[position])


@pytest.mark.parametrize("position", range(14))
def test_a_byte_in_any_operand_is_touched(position: int) -> None:
    assert touches(around(ref(X))[position], [Byte(X, 0)])
    assert not touches(around(ref(X))[position], [Byte(Symbol("z", U8, "global"), 0)])


def test_a_register_is_touched_by_what_lies_at_a_fixed_address() -> None:
    assert touches(ref(PORT), [Reg(6)])
    assert not touches(ref(X), [Reg(6)])
    assert not touches(ref(PORT), [Byte(X, 0)])


@pytest.mark.parametrize(
    ("low", "high", "wide"),
    [
        (0, 0, (1, False)), (0, 255, (1, False)), (0, 256, (2, False)), (0, 65535, (2, False)),
        (0, 65536, (3, False)), (-1, 127, (1, True)), (-1, 128, (2, True)), (-128, 0, (1, True)),
        (-129, 0, (2, True)), (-32768, 32767, (2, True)), (-32768, 32768, (3, True)),
    ],
)  # fmt: skip
def test_the_bytes_of_a_range_are_those_of_twos_complement(
    low: int, high: int, wide: tuple[int, bool]
) -> None:
    """n bytes hold 0 to 2^(8n) - 1, or -2^(8n-1) to 2^(8n-1) - 1."""
    assert width_of(low, high) == wide
