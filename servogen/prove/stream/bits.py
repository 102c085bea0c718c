"""Bit-vectors: numbers where they are known, terms of the solver bitwuzla where they are not.

In: numbers, named unknowns, and the operations of a byte machine. Out: `Bits` and `Truth`, and from `Solver`
whether a statement can be true. Operations on numbers give numbers: specifications that are written with
these operations run on plain numbers, too, without the solver.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from servogen.errors import ToolError

TIME_LIMIT_MS = 1_200_000
"""The time after which the solver gives up one question."""


class GivenUp(Exception):
    """Raised if the solver does not answer within its time."""


@cache
def solver_library() -> Any:
    """Return the solver's module. Raises ToolError if it is not installed."""
    if find_spec("bitwuzla") is None:
        raise ToolError(
            "tool-missing",
            "the proof for any line needs the solver bitwuzla",
            hint="pip install 'servogen[solver]'",
        )
    return import_module("bitwuzla")


@cache
def term_manager() -> Any:
    return solver_library().TermManager()


@cache
def _sort(width: int) -> Any:
    return term_manager().mk_bv_sort(width)


@cache
def _number(width: int, value: int) -> Any:
    return term_manager().mk_bv_value(_sort(width), value)


def _term(kind: str, *operands: Any, indices: tuple[int, ...] = ()) -> Any:
    return term_manager().mk_term(getattr(solver_library().Kind, kind), list(operands), list(indices))


class Truth:
    """A statement: true, false, or a term."""

    __slots__ = ("_node", "known")

    def __init__(self, known: bool | None, term: Any = None) -> None:
        self.known = known
        self._node = term

    @property
    def term(self) -> Any:
        """Return the solver's term, made when it is first needed."""
        if self._node is None:
            self._node = term_manager().mk_true() if self.known else term_manager().mk_false()
        return self._node

    def __and__(self, other: Truth) -> Truth:
        if self.known is not None:
            return other if self.known else self
        if other.known is not None:
            return self if other.known else other
        return self if self._node is other._node else Truth(None, _term("AND", self.term, other.term))

    def __or__(self, other: Truth) -> Truth:
        return ~(~self & ~other)

    def __invert__(self) -> Truth:
        if self.known is not None:
            return Truth(not self.known)
        return Truth(None, _term("NOT", self._node))


TRUE, FALSE = Truth(True), Truth(False)


class Bits:
    """`width` bits: a number, or a term."""

    __slots__ = ("_node", "_parts", "value", "width")

    def __init__(
        self, width: int, value: int | None, term: Any = None, parts: tuple[Bits, Bits] | None = None
    ) -> None:
        self.width = width
        self._parts = parts
        """The higher and the lower bits that it was put together from."""
        self.value = None if value is None else value & ((1 << width) - 1)
        self._node = term

    @property
    def term(self) -> Any:
        """Return the solver's term, made when it is first needed."""
        if self._node is None:
            assert self.value is not None
            self._node = _number(self.width, self.value)
        return self._node

    def _binary(self, other: Bits | int, kind: str, compute: Callable[[int, int], int]) -> Bits:
        """Return the result of an operation: a number if both are numbers, else a term."""
        number = self._operand_value(other)
        if self.value is not None and number is not None:
            return Bits(self.width, compute(self.value, number))
        return Bits(self.width, None, _term(kind, self.term, self._as_bits(other).term))

    def _as_bits(self, other: Bits | int) -> Bits:
        return other if isinstance(other, Bits) else Bits(self.width, other)

    def _operand_value(self, other: Bits | int) -> int | None:
        return other if isinstance(other, int) else other.value

    def __add__(self, other: Bits | int) -> Bits:
        number = self._operand_value(other)
        if number == 0:
            return self
        if self._parts is not None and number is not None and number > 0:
            upper, lower = self._parts
            # Without a carry the upper bits stay as they are, and the sum remains a pair of which one part is
            # known.
            if lower.value is not None and lower.value + number < 1 << lower.width:
                return upper.concat(lower + number)
        return self._binary(other, "BV_ADD", operator.add)

    def __sub__(self, other: Bits | int) -> Bits:
        return self if self._operand_value(other) == 0 else self._binary(other, "BV_SUB", operator.sub)

    def __mul__(self, other: Bits | int) -> Bits:
        return self._binary(other, "BV_MUL", operator.mul)

    def __floordiv__(self, other: Bits | int) -> Bits:
        """Return the quotient, rounded down; all ones if the divisor is 0."""
        return self._binary(other, "BV_UDIV", lambda dividend, by: dividend // by if by else -1)

    def __and__(self, other: Bits | int) -> Bits:
        number = self._operand_value(other)
        if number == 0 or self.value == 0:
            return Bits(self.width, 0)
        if number is not None and self._parts is not None:
            upper, lower = self._parts
            return (upper & (number >> lower.width)).concat(lower & (number & (1 << lower.width) - 1))
        return self if number == (1 << self.width) - 1 else self._binary(other, "BV_AND", operator.and_)

    def __or__(self, other: Bits | int) -> Bits:
        return self if self._operand_value(other) == 0 else self._binary(other, "BV_OR", operator.or_)

    def __xor__(self, other: Bits | int) -> Bits:
        return self if self._operand_value(other) == 0 else self._binary(other, "BV_XOR", operator.xor)

    def __invert__(self) -> Bits:
        return self ^ ((1 << self.width) - 1)

    def __rshift__(self, places: int) -> Bits:
        return self[places:].zero_extend(self.width) if places < self.width else Bits(self.width, 0)

    def __getitem__(self, which: slice) -> Bits:
        """Return bits `start` up to, but not including, `stop`; the lowest is bit 0."""
        low, high, _ = which.indices(self.width)
        if low == 0 and high == self.width:
            return self
        if self.value is not None:
            return Bits(high - low, self.value >> low)
        if self._parts is not None:
            upper, lower = self._parts
            if high <= lower.width:
                return lower[low:high]
            if low >= lower.width:
                return upper[low - lower.width : high - lower.width]
            return upper[: high - lower.width].concat(lower[low:])
        return Bits(high - low, None, _term("BV_EXTRACT", self._node, indices=(high - 1, low)))

    def bit(self, number: int) -> Truth:
        """Return whether a bit is 1."""
        if self.value is not None:
            return Truth(bool(self.value >> number & 1))
        return self[number : number + 1].equals(1)

    def with_bit(self, number: int, value: int) -> Bits:
        """Return the same with one bit set to a value."""
        bit = Bits(1, value)
        lower = bit if number == 0 else bit.concat(self[:number])
        return lower if number + 1 == self.width else self[number + 1 :].concat(lower)

    def concat(self, low: Bits) -> Bits:
        """Return these bits followed by lower ones."""
        width = self.width + low.width
        if self.value is not None and low.value is not None:
            return Bits(width, self.value << low.width | low.value)
        return Bits(width, None, _term("BV_CONCAT", self.term, low.term), (self, low))

    def zero_extend(self, width: int) -> Bits:
        """Return the number with zeros above it."""
        return self if width == self.width else Bits(width - self.width, 0).concat(self)

    def sign_extend(self, width: int) -> Bits:
        """Return the number in two's complement with more bits."""
        if self.value is not None:
            return Bits(width, self.value - (self.value >> self.width - 1 << self.width))
        return Bits(width, None, _term("BV_SIGN_EXTEND", self._node, indices=(width - self.width,)))

    def equals(self, other: Bits | int) -> Truth:
        """Return whether both are the same number."""
        number = self._operand_value(other)
        if self.value is not None and number is not None:
            return Truth(self.value == number & ((1 << self.width) - 1))
        if isinstance(other, Bits) and other._node is self._node:
            return TRUE
        return Truth(None, _term("EQUAL", self.term, self._as_bits(other).term))

    def less(self, other: Bits | int) -> Truth:
        """Return whether it is smaller, without signs."""
        number = self._operand_value(other)
        if self.value is not None and number is not None:
            return Truth(self.value < number)
        return Truth(None, _term("BV_ULT", self.term, self._as_bits(other).term))


def byte(value: int) -> Bits:
    """Return a known byte."""
    return Bits(8, value)


def unknown(name: str, width: int = 8) -> Bits:
    """Return bits of which nothing is known; each call makes others."""
    return Bits(width, None, term_manager().mk_const(_sort(width), name))


def choose(condition: Truth, yes: Bits, no: Bits) -> Bits:
    """Return `yes` where the condition is true, else `no`."""
    if condition.known is not None:
        return yes if condition.known else no
    if yes is no or (yes.value is not None and yes.value == no.value):
        return yes
    if yes.value is None and yes._node is no._node:
        return yes
    return Bits(yes.width, None, _term("ITE", condition.term, yes.term, no.term))


def choose_truth(condition: Truth, yes: Truth, no: Truth) -> Truth:
    """Return `yes` where the condition is true, else `no`."""
    return yes if yes is no else (condition & yes) | (~condition & no)


def as_bit(truth: Truth) -> Bits:
    """Return 1 where it is true, else 0."""
    return choose(truth, Bits(1, 1), Bits(1, 0))


def all_of(truths: Iterable[Truth]) -> Truth:
    """Return whether all are true."""
    conjunction = TRUE
    for truth in truths:
        conjunction = conjunction & truth
    return conjunction


class Terms:
    """The domain of `pic.semantics` whose bytes are `Bits` and whose flags are `Truth`."""

    def number(self, value: int) -> Bits:
        return byte(value)

    def add(self, a: Bits, b: Bits) -> Bits:
        # Of two unknown bytes the sum and its carry are one term, which the solver has to translate once.
        return a + b if b.value is not None else (a.zero_extend(9) + b.zero_extend(9))[0:8]

    def subtract(self, a: Bits, b: Bits) -> Bits:
        return a - b

    def carry(self, a: Bits, b: Bits, bits: int) -> Truth:
        return (a[0:bits].zero_extend(bits + 1) + b[0:bits].zero_extend(bits + 1)).bit(bits)

    def no_borrow(self, a: Bits, b: Bits, bits: int) -> Truth:
        return ~a[0:bits].less(b[0:bits])

    def conjunction(self, a: Bits, b: Bits) -> Bits:
        return a & b

    def disjunction(self, a: Bits, b: Bits) -> Bits:
        return a | b

    def difference(self, a: Bits, b: Bits) -> Bits:
        return a ^ b

    def with_bit(self, a: Bits, number: int, value: int) -> Bits:
        return a.with_bit(number, value)

    def bit(self, a: Bits, number: int) -> Truth:
        return a.bit(number)

    def rotate_left(self, a: Bits, carry: Truth) -> Bits:
        return a[0:7].concat(as_bit(carry))

    def rotate_right(self, a: Bits, carry: Truth) -> Bits:
        return as_bit(carry).concat(a[1:8])

    def swap(self, a: Bits) -> Bits:
        return a[0:4].concat(a[4:8])

    def is_zero(self, a: Bits) -> Truth:
        return a.equals(0)


TERMS = Terms()


class Solver:
    """Answers whether statements can be true together."""

    def __init__(self) -> None:
        self.questions = 0
        self.forget()

    def forget(self) -> None:
        """Begin anew: what was learned of other terms only makes the next questions slower."""
        library = solver_library()
        options = library.Options()
        options.set(library.Option.PRODUCE_MODELS, True)
        options.set(library.Option.TIME_LIMIT_PER, TIME_LIMIT_MS)
        self.solver = library.Bitwuzla(term_manager(), options)
        self._sat, self._unsat = library.Result.SAT, library.Result.UNSAT

    def possible(self, statement: Truth) -> bool:
        """Return whether a statement can be true. Raises GivenUp."""
        if statement.known is not None:
            return statement.known
        self.questions += 1
        result = self.solver.check_sat(statement.term)
        if result == self._sat:
            return True
        if result == self._unsat:
            return False
        raise GivenUp

    def example(self, bits: Bits) -> int:
        """Return the value of bits in the last possible statement."""
        if bits.value is not None:
            return bits.value
        return int(self.solver.get_value(bits.term).value(10))
