"""`Value`: the knowledge of one byte, the set of values that it may have.

A small set is kept as it is; a larger one as the values that each of its bits may have. The operations return
a superset of the results for every combination of their operands' members.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cache, cached_property

from servogen.pic.semantics import NUMBERS

MAX_MEMBERS = 64
"""The maximum number of members of a set that is kept exactly."""
MAX_COMBINATIONS = 1024
"""The maximum number of operand combinations that are computed one by one; beyond it, the result is
unknown.
"""


@dataclass(frozen=True, eq=False)
class Value:
    """The set of values that a byte may have: `members`, or every byte whose bits are allowed by the masks.

    Equal values are one object, made by the functions below: they are compared and hashed by identity.
    """

    members: frozenset[int] | None
    may_be_0: int = 0xFF
    """The bits that are 0 in some member."""
    may_be_1: int = 0xFF
    """The bits that are 1 in some member."""

    @cached_property
    def constant(self) -> int | None:
        """Return the only member; None if there are several."""
        if self.members is not None and len(self.members) == 1:
            return next(iter(self.members))
        return None

    @property
    def size(self) -> int:
        """Return the number of members."""
        if self.members is not None:
            return len(self.members)
        return int(1 << (self.may_be_0 & self.may_be_1).bit_count())

    def __iter__(self) -> Iterator[int]:
        """Yield the members in ascending order."""
        if self.members is not None:
            yield from sorted(self.members)
            return
        for value in range(256):
            if not (value & ~self.may_be_1 or ~value & 0xFF & ~self.may_be_0):
                yield value

    def __or__(self, other: Value) -> Value:
        """Return the union."""
        if self is other:
            return self
        if self.members is not None and other.members is not None:
            return _of_set(self.members | other.members)
        return of_bits(self.may_be_0 | other.may_be_0, self.may_be_1 | other.may_be_1)

    def __contains__(self, number: int) -> bool:
        if self.members is not None:
            return number in self.members
        return not (number & ~self.may_be_1 or ~number & 0xFF & ~self.may_be_0)


@cache
def of_bits(may_be_0: int, may_be_1: int) -> Value:
    """Return the bytes whose bits are as the two masks allow."""
    free = may_be_0 & may_be_1
    if 1 << free.bit_count() <= MAX_MEMBERS:
        base = may_be_1 & ~may_be_0
        members = [0]
        for bit in range(8):
            if free >> bit & 1:
                members += [member | 1 << bit for member in members]
        return _of_set(frozenset(base | member for member in members))
    return Value(None, may_be_0, may_be_1)


@cache
def _of_set(members: frozenset[int]) -> Value:
    zeros = ones = 0
    for member in members:
        zeros |= ~member & 0xFF
        ones |= member
    return Value(members, zeros, ones) if len(members) <= MAX_MEMBERS else of_bits(zeros, ones)


def of(members: Iterable[int]) -> Value:
    """Return the smallest value that has these members."""
    return _of_set(frozenset(members))


ANY = of_bits(0xFF, 0xFF)
BIT = of((0, 1))
"""A flag that is not known."""
_CONSTANTS = tuple(of((number,)) for number in range(256))


def constant(number: int) -> Value:
    """Return the value with one member."""
    return _CONSTANTS[number]


def combined(left: Value, right: Value, operation: Callable[[int, int], int]) -> Value:
    """Return the results of an operation on every pair of members; `ANY` if there are too many pairs."""
    if left.members is None or right.members is None or len(left.members) * len(right.members) > 64:
        return ANY
    return _of_set(frozenset(operation(a, b) & 0xFF for a in left.members for b in right.members))


def conjunction(left: Value, right: Value) -> Value:
    """Return the bitwise AND of every pair of members."""
    if left.members is not None and right.members is not None:
        return combined(left, right, lambda a, b: a & b)
    return of_bits(left.may_be_0 | right.may_be_0, left.may_be_1 & right.may_be_1)


def disjunction(left: Value, right: Value) -> Value:
    """Return the bitwise OR of every pair of members."""
    if left.members is not None and right.members is not None:
        return combined(left, right, lambda a, b: a | b)
    return of_bits(left.may_be_0 & right.may_be_0, left.may_be_1 | right.may_be_1)


def mapped(value: Value, operation: Callable[[int], int]) -> Value:
    """Return the results of an operation on every member."""
    return _of_set(frozenset(operation(member) & 0xFF for member in value))


def where(value: Value, condition: Callable[[int], bool]) -> Value | None:
    """Return the members that satisfy a condition; None if there are none."""
    members = frozenset(filter(condition, value))
    return _of_set(members) if members else None


def zero_flag(result: Value) -> Value:
    """Return the zero flag of a result."""
    has_zero = 0 in result
    if not has_zero:
        return _CONSTANTS[0]
    return _CONSTANTS[1] if result.constant == 0 else BIT


class Sets:
    """The domain of `pic.semantics` whose bytes and flags are values: every operation on every member."""

    def number(self, value: int) -> Value:
        return constant(value)

    def add(self, a: Value, b: Value) -> Value:
        return _of_members(NUMBERS.add, a, b)

    def subtract(self, a: Value, b: Value) -> Value:
        return _of_members(NUMBERS.subtract, a, b)

    def carry(self, a: Value, b: Value, bits: int) -> Value:
        # DC is not followed: no path depends on it.
        return _of_members(lambda x, y: NUMBERS.carry(x, y, 8), a, b, unknown=BIT) if bits == 8 else BIT

    def no_borrow(self, a: Value, b: Value, bits: int) -> Value:
        return _of_members(lambda x, y: NUMBERS.no_borrow(x, y, 8), a, b, unknown=BIT) if bits == 8 else BIT

    def conjunction(self, a: Value, b: Value) -> Value:
        return conjunction(a, b)

    def disjunction(self, a: Value, b: Value) -> Value:
        return disjunction(a, b)

    def difference(self, a: Value, b: Value) -> Value:
        return _of_members(NUMBERS.difference, a, b)

    def with_bit(self, a: Value, number: int, value: int) -> Value:
        bit = 1 << number
        return disjunction(a, constant(bit)) if value else conjunction(a, constant(0xFF & ~bit))

    def bit(self, a: Value, number: int) -> Value:
        return mapped(a, lambda member: member >> number & 1)

    def rotate_left(self, a: Value, carry: Value) -> Value:
        return _of_members(NUMBERS.rotate_left, a, carry)

    def rotate_right(self, a: Value, carry: Value) -> Value:
        return _of_members(NUMBERS.rotate_right, a, carry)

    def swap(self, a: Value) -> Value:
        return mapped(a, NUMBERS.swap)

    def is_zero(self, a: Value) -> Value:
        return zero_flag(a)


SETS = Sets()


def _of_members(operation: Callable[[int, int], int], a: Value, b: Value, unknown: Value = ANY) -> Value:
    """Return the results of an operation on every pair of members; `unknown` if there are too many."""
    if a.size * b.size > MAX_COMBINATIONS:
        return unknown
    return of(operation(left, right) for left in a for right in b)
