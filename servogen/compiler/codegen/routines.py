"""Which library routine the products and quotients of a program need.

In: the typed tree of every function that is reached. Out: for the divisions of each size one routine, and one
for the products, as narrow as the widest divisor or factor allows. Two routines side by side would take more
words than the narrow one saves.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from servogen.compiler.ast.constant_folding import interval
from servogen.compiler.ast.nodes import Binary, Expr, FunctionDefinition, Num, Update
from servogen.compiler.ast.walk import expressions
from servogen.compiler.codegen.effects import stripped, updated, width_of

MAX_SHIFT_WORDS = 24
"""Of the shifts of a signed division by a power of 2; more would be longer than calling the division."""


class Divisor(NamedTuple):
    """What a dividing routine must accept. A greater one serves where a smaller one is asked for."""

    bytes: int
    carry: bool
    """Whether twice the remainder may need a bit more: not with divisors up to half of the byte's range."""


class Quotient(NamedTuple):
    """A division: the bytes and the signedness in which it is computed, and what its divisor may be."""

    size: int
    signed: bool
    negative_divisor: bool
    divisor: Divisor


def quotient(expr: Binary) -> Quotient:
    """Return how a division or a remainder is computed."""
    (a, b), (c, d) = interval(expr.left), interval(expr.right)
    # -128 / -1 is 128: a signed quotient may need a byte more than its operands
    full = width_of(*interval(expr))[0] if min(a, c) < 0 else 1
    size, signed = width_of(min(a, c), max(b, d))
    size = min(max(size, full), expr.type.size)
    if c < 0 or (not signed and d >= 1 << 8 * size):
        return Quotient(size, signed, c < 0, Divisor(size, not signed))
    width = min(width_of(0, d)[0], size)
    carry = d > 1 << 8 * width - 1
    if signed and carry:  # a remainder from -254 to 254 needs a second byte
        return Quotient(size, signed, False, Divisor(width + 1, False))
    return Quotient(size, signed, False, Divisor(width, carry))


def halvings(expr: Binary, size: int) -> int:
    """Return by how many bits a signed division by a constant shifts, where that is short; otherwise 0."""
    divisor = expr.right
    if expr.op != "/" or not isinstance(divisor, Num) or divisor.value <= 0 or divisor.value.bit_count() != 1:
        return 0
    shift = divisor.value.bit_length() - 1
    return shift if shift < 8 * size - 1 and shift % 8 * (size + 1) <= MAX_SHIFT_WORDS else 0


def is_power_of_two(expr: Expr) -> bool:
    return isinstance(expr, Num) and expr.value.bit_count() == 1


def is_byte(expr: Expr) -> bool:
    """Return whether a value is from 0 to 255."""
    low, high = interval(expr)
    return low >= 0 and high <= 0xFF


def negative(expr: Expr) -> bool:
    """Return whether a value may be negative."""
    return interval(expr)[0] < 0


def keeps_all_bits(left: Expr, right: Expr, size: int) -> bool:
    """Return whether a product of two factors of at most two bytes needs more than two."""
    return size > 2 and all(width_of(*interval(factor))[0] <= 2 for factor in (left, right))


class Routines:
    """The routines of one program."""

    def __init__(self, functions: Iterable[FunctionDefinition]) -> None:
        self._divisors: dict[int, Divisor] = {}
        self._negative_divisors: set[int] = set()
        """The sizes in which a signed division may have one."""
        self._byte_factor = True
        self._long_byte_factor = True
        """Whether every product that keeps all its bits has an unsigned factor and one of one byte."""
        for function in functions:
            for expr in _computed(function):
                if expr.op == "*":
                    byte_factor = is_byte(expr.left) or is_byte(expr.right)
                    self._byte_factor &= byte_factor
                    if keeps_all_bits(expr.left, expr.right, expr.type.size):
                        self._long_byte_factor &= byte_factor and not any(
                            map(negative, (expr.left, expr.right))
                        )
                else:
                    self._count(expr)

    def _count(self, expr: Binary) -> None:
        """Widen the routine of a division's size to its divisor, unless the division becomes shifts."""
        one = quotient(expr)
        if (not one.signed and is_power_of_two(expr.right)) or (one.signed and halvings(expr, one.size)):
            return
        if one.negative_divisor:
            self._negative_divisors.add(one.size)
        self._divisors[one.size] = max(self._divisors.get(one.size, one.divisor), one.divisor)

    def divide(self, one: Quotient) -> tuple[int, ...]:
        """Return the key of the unsigned routine."""
        return one.size, *map(int, max(self._divisors.get(one.size, one.divisor), one.divisor))

    def divide_signed(self, one: Quotient) -> tuple[int, ...]:
        """Return the key of the signed routine: the unsigned one's, and whether divisors may be negative."""
        negative = one.negative_divisor or one.size in self._negative_divisors
        return *self.divide(one), int(negative)

    def multiply(self, left: Expr, right: Expr, size: int) -> tuple[int, ...]:
        """Return the key: the bytes of both factors, and of the product, which may be wider or narrower."""
        if is_byte(left) and is_byte(right):
            return 1, 1, min(size, 2)
        # signed factors need a second routine: with a byte, a few turns of the wide one are shorter than that
        signed = negative(left) or negative(right)
        if keeps_all_bits(left, right, size) and not (signed and self._byte_factor):
            factor = 1 if self._byte_factor or self._long_byte_factor else 2
            return 2, factor, 2 + factor
        return size, 1 if self._byte_factor and (is_byte(left) or is_byte(right)) else size, size


def _computed(function: FunctionDefinition) -> Iterator[Binary]:
    """Yield the products, quotients and remainders of a function."""
    for expr in expressions(function.body):
        if isinstance(expr, Update) and expr.op in ("*", "/", "%"):
            expr = stripped(updated(expr, expr.target))
        if isinstance(expr, Binary) and expr.op in ("*", "/", "%"):
            yield expr
