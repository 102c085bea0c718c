"""Floating-point arithmetic a second time, for the compiler's routines to be compared with.

In: the bytes of operands as integers. Out: the bytes that IEEE 754 requires. 32 bits are numpy's float32; the
24-bit format, binary32 with 15 bits of mantissa, is computed with exact fractions and rounded by bisection.
"""

from __future__ import annotations

import operator
import random
from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import lru_cache
from math import ceil, floor, isqrt

import numpy as np

NAN = None
"""Any value that is not a number: its sign and mantissa say nothing."""
OPERATORS: dict[str, Callable[[Fraction, Fraction], Fraction]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
}
RELATIONS: dict[str, Callable[[Fraction, Fraction], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    "==": operator.eq,
    "!=": operator.ne,
    ">": operator.gt,
    ">=": operator.ge,
}


def canonical(bits: int, width: int) -> int | None:
    """Return the bytes of a value, or NAN."""
    magnitude = bits & (1 << width - 1) - 1
    return NAN if magnitude > 0xFF << width - 9 else bits


def as_float32(bits: int) -> np.float32:
    return np.uint32(bits).view(np.float32)


def binary(op: str, left: int, right: int, width: int) -> int | None:
    """Return the bytes of `left op right`."""
    if width == 32:
        with np.errstate(all="ignore"):
            found = OPERATORS[op](as_float32(left), as_float32(right))  # type: ignore[arg-type]
        return canonical(int(np.float32(found).view(np.uint32)), 32)
    return _binary24(op, left, right)


def relation(op: str, left: int, right: int, width: int) -> int:
    if width == 32:
        return int(RELATIONS[op](as_float32(left), as_float32(right)))  # type: ignore[arg-type]
    if canonical(left, width) is NAN or canonical(right, width) is NAN:
        return int(op == "!=")
    return int(RELATIONS[op](_number24(left), _number24(right)))


INFINITY24 = 0x7F8000
BEYOND = Fraction(2) ** 1000
"""Stands for infinity where only the order counts."""


@lru_cache(maxsize=1 << 16)
def _number24(bits: int) -> Fraction:
    sign = -1 if bits >> 23 else 1
    exponent, mantissa = bits >> 15 & 0xFF, bits & 0x7FFF
    if exponent == 0xFF:
        return sign * BEYOND
    if exponent == 0:
        return sign * Fraction(mantissa, 2**15) * Fraction(1, 2**126)
    return sign * (1 + Fraction(mantissa, 2**15)) * Fraction(2) ** (exponent - 127)


def round24(value: Fraction, sign: int) -> int:
    """Return the 24-bit value nearest to a number: bisect the ordered magnitudes, then decide between two."""
    size, low, high = abs(value), 0, INFINITY24
    if size >= Fraction(2) ** 128:
        return sign << 23 | INFINITY24
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if _number24(middle) <= size else (low, middle)
    above = Fraction(2) ** 128 if high == INFINITY24 else _number24(high)
    below = size - _number24(low)
    rest = above - size
    up = rest < below or (rest == below and low & 1)
    return sign << 23 | (high if up else low)


def _binary24(op: str, left: int, right: int) -> int | None:
    if canonical(left, 24) is NAN or canonical(right, 24) is NAN:
        return NAN
    if op == "-":
        return _binary24("+", left, right ^ 0x800000)
    one, two = _number24(left), _number24(right)
    signs = (left ^ right) >> 23
    if op == "+":
        if BEYOND in (abs(one), abs(two)):
            if abs(one) == abs(two):
                return left if left == right else NAN
            return left if abs(one) == BEYOND else right
        total = one + two
        sign = int(total < 0) if total else left >> 23 & right >> 23
        return round24(total, sign)
    if op == "*":
        if BEYOND in (abs(one), abs(two)):
            return NAN if 0 in (one, two) else signs << 23 | INFINITY24
        return round24(one * two, signs)
    if abs(one) == BEYOND or two == 0:
        undefined = abs(two) == BEYOND if abs(one) == BEYOND else one == 0
        return NAN if undefined else signs << 23 | INFINITY24
    return round24(Fraction(0) if abs(two) == BEYOND else one / two, signs)


def from_integer(value: int, width: int) -> int:
    """Return the bytes of the value nearest to an integer."""
    if width == 32:
        return int(np.float32(value).view(np.uint32))
    return round24(Fraction(value), int(value < 0))


def to_integer(bits: int, width: int) -> int:
    """Return the low 32 bits of a value rounded towards zero; 0 for infinities and what is not a number."""
    if bits >> width - 9 & 0xFF == 0xFF:
        return 0
    number = Fraction(float(as_float32(bits))) if width == 32 else _number24(bits)
    return int(number) & 0xFFFFFFFF


def square_root(bits: int, width: int) -> int | None:
    if width == 32:
        with np.errstate(all="ignore"):
            return canonical(int(np.sqrt(as_float32(bits)).view(np.uint32)), 32)
    if canonical(bits, 24) is NAN or (bits >> 23 and bits != 0x800000):
        return NAN
    if bits in (0x800000, INFINITY24):
        return bits
    number = _number24(bits) * Fraction(2) ** 400  # so many binary digits that no tie is missed
    root = isqrt(int(number))
    exact = root * root == number
    return round24((Fraction(root) if exact else root + Fraction(1, 2)) / Fraction(2) ** 200, 0)


def rounded(function: str, bits: int, width: int) -> int | None:
    """Return the bytes of the whole number below ("floor") or above ("ceil") a value."""
    if width == 32:
        with np.errstate(all="ignore"):
            found = getattr(np, function)(as_float32(bits))
        return canonical(int(np.float32(found).view(np.uint32)), 32)
    if bits >> 15 & 0xFF == 0xFF:
        return canonical(bits, 24)
    number = _number24(bits)
    return round24(Fraction(floor(number) if function == "floor" else ceil(number)), bits >> 23)


def edges(width: int) -> list[int]:
    """Return the values at which something changes, of both signs."""
    stored = width - 9
    one = 127 << stored
    sizes = [
        *(0, 1, 2, 3),
        *((1 << stored) - 1, 1 << stored, (1 << stored) + 1),
        *(one - 2, one - 1, one, one + 1, one + 2, one + (1 << stored - 1)),
        *((254 << stored) + (1 << stored) - 1, 255 << stored, (255 << stored) + 1),
        *((126 << stored), (128 << stored), (255 << stored) - (1 << stored)),
        *(1 << stored - 1, (127 + stored << stored), (127 + stored + 1 << stored) + 1),
    ]
    return [size | sign << width - 1 for size in sizes for sign in (0, 1)]


def operands(width: int, seed: int) -> Iterator[tuple[int, int]]:
    """Yield pairs of operands without end: of all magnitudes, close to each other, of few bits, and edges."""
    chance = random.Random(seed)
    special = edges(width)
    stored = width - 9
    while True:
        kind = chance.randrange(7)
        left, right = chance.getrandbits(width), chance.getrandbits(width)
        if kind == 1:  # about equal magnitudes, so that leading digits cancel
            right = (
                left
                ^ chance.getrandbits(chance.randrange(1, stored + 3))
                ^ chance.getrandbits(1) << width - 1
            )
        elif kind == 2:  # exponents within the length of the mantissa
            exponent = (left >> stored & 0xFF) + chance.randrange(-stored - 4, stored + 5)
            right = right & ~(0xFF << stored) | min(max(exponent, 0), 255) << stored
        elif kind == 3:  # mantissas with few digits, so that results are exact or ties
            keep = chance.randrange(1, 6)
            mask = ~((1 << stored - keep) - 1)
            left, right = left & mask, right & mask
            right = (
                right & ~(0xFF << stored) | min((left >> stored & 0xFF) + chance.randrange(20), 255) << stored
            )
        elif kind == 4:
            left = chance.choice(special)
        elif kind == 5:
            left, right = chance.choice(special), chance.choice(special)
        elif kind == 6:  # about half a unit in the last place of the other: ties, and just beside them
            exponent = (left >> stored & 0xFF) - stored - chance.choice((1, 1, 1, 2, 0))
            last = chance.choice((0, 1, 2, 3, (1 << stored) - 1, chance.getrandbits(stored // 2)))
            if not chance.randrange(3):  # a carry out of the mantissa, with one bit far below it
                left |= (1 << stored) - 1
                exponent = (left >> stored & 0xFF) - chance.choice((7, 8, 9))
                last = chance.getrandbits(stored - 8) << 8 | 1
            right = right & 1 << width - 1 | max(exponent, 0) << stored | last
        yield (left, right) if chance.getrandbits(1) else (right, left)
