"""The values of floating-point types: numbers to their bytes and back, and constant arithmetic.

In: exact numbers, or the bytes of values as integers. Out: the nearest value, ties to even, as IEEE 754 has
it for binary32; the type of 3 bytes is binary32 with 15 bits of mantissa.
"""

from __future__ import annotations

from fractions import Fraction
from math import isqrt

from servogen.compiler.ast.constant_folding import compare
from servogen.compiler.ast.types import FLOAT_BIAS, FloatType

INFINITE = 0xFF
"""The exponent of infinities and of what is not a number."""

ROOT_DIGITS = 200
"""Binary digits of a square root behind the point: so many that one above a tie is not cut off to the tie."""


def mantissa_bits(kind: FloatType) -> int:
    """Return how many bits of the mantissa are stored."""
    return 8 * kind.bytes - 9


def infinity(kind: FloatType) -> int:
    return INFINITE << mantissa_bits(kind)


def not_a_number(kind: FloatType) -> int:
    return infinity(kind) | 1 << mantissa_bits(kind) - 1


def is_nan(bits: int, kind: FloatType) -> bool:
    """Return whether the bytes are those of a NaN: the greatest exponent with a mantissa other than 0."""
    return bits & kind.sign_bit - 1 > infinity(kind)


def is_finite(bits: int, kind: FloatType) -> bool:
    return bits & kind.sign_bit - 1 < infinity(kind)


def encode(value: Fraction, kind: FloatType, *, negative: bool = False) -> int:
    """Return the bytes of the value nearest to a number; `negative` is the sign of a zero."""
    sign = kind.sign_bit if value < 0 or (value == 0 and negative) else 0
    size = abs(value)
    if size == 0:
        return sign
    stored = mantissa_bits(kind)
    exponent = size.numerator.bit_length() - size.denominator.bit_length()
    if size < Fraction(2) ** exponent:
        exponent -= 1
    exponent = max(exponent, 1 - FLOAT_BIAS)
    if exponent > FLOAT_BIAS:
        return sign | infinity(kind)
    mantissa = round(size / Fraction(2) ** (exponent - stored))  # to even, as Python rounds
    # the hidden bit of a normal value counts the exponent up
    bits = (exponent + FLOAT_BIAS - 1 << stored) + mantissa
    return sign | min(bits, infinity(kind))


def decode(bits: int, kind: FloatType) -> Fraction | None:
    """Return the number that a value stands for; None for infinities and what is not a number."""
    if not is_finite(bits, kind):
        return None
    stored = mantissa_bits(kind)
    exponent = bits >> stored & INFINITE
    mantissa = bits & (1 << stored) - 1
    if exponent:
        mantissa |= 1 << stored
    size = mantissa * Fraction(2) ** (max(exponent, 1) - FLOAT_BIAS - stored)
    return -size if bits & kind.sign_bit else size


def fold_float(op: str, left: int, right: int, kind: FloatType) -> int:
    """Return `left op right` for the bytes of two values."""
    if is_nan(left, kind) or is_nan(right, kind):
        return not_a_number(kind)
    if op == "-":
        return fold_float("+", left, right ^ kind.sign_bit, kind)
    one, two = decode(left, kind), decode(right, kind)
    signs = (left ^ right) & kind.sign_bit
    if op == "+":
        if one is not None and two is not None:
            both_negative = bool(left & right & kind.sign_bit)
            return encode(one + two, kind, negative=both_negative)
        if one is None and two is None and signs:
            return not_a_number(kind)
        return left if one is None else right
    if op == "*":
        if one is None or two is None:
            return not_a_number(kind) if 0 in (one, two) else infinity(kind) | signs
        return encode(one * two, kind, negative=bool(signs))
    if one is None or two is None or two == 0:
        if (one is None and two is None) or (one == 0 and two == 0):
            return not_a_number(kind)
        return signs if two is None else infinity(kind) | signs
    return encode(one / two, kind, negative=bool(signs))


def fold_square_root(bits: int, kind: FloatType) -> int:
    """Return the square root of a value's bytes."""
    number = decode(bits, kind)
    if number == 0:
        return bits
    if is_nan(bits, kind) or bits & kind.sign_bit:
        return not_a_number(kind)
    if number is None:
        return bits
    root = isqrt(int(number * 4**ROOT_DIGITS))
    return encode(Fraction(root, 2**ROOT_DIGITS), kind)


def compare_float(op: str, left: int, right: int, kind: FloatType) -> bool:
    """Return whether a comparison of the bytes of two values holds."""
    if is_nan(left, kind) or is_nan(right, kind):
        return op == "!="
    return compare(op, _order(left, kind), _order(right, kind))


def _order(bits: int, kind: FloatType) -> int:
    """Return a number that is in the order of the values."""
    size = bits & kind.sign_bit - 1
    return -size if bits & kind.sign_bit else size


def whole_part(bits: int, kind: FloatType) -> int:
    """Return a value rounded towards zero; 0 for infinities and what is not a number."""
    return int(decode(bits, kind) or 0)
