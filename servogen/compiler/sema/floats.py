"""Floating-point expressions: literals, operators, comparisons and conversions as calls of the routines.

In: operands of the type `float`, and of integers where C converts them. Out: typed expressions in which a
`Builtin` of `FLOAT_OPERATIONS` computes and everything else moves bytes; constants are folded.
"""

from __future__ import annotations

import re
from fractions import Fraction

from servogen.compiler.ast.constant_folding import COMPARISONS
from servogen.compiler.ast.float_values import (
    compare_float,
    decode,
    encode,
    fold_float,
    fold_square_root,
    infinity,
    whole_part,
)
from servogen.compiler.ast.nodes import EQUAL, GREATER, LESS, Binary, Builtin, Cast, Expr, Num
from servogen.compiler.ast.types import S16, S32, U8, U16, U32, CType, FloatType, IntType
from servogen.compiler.sema.analyser import Analyser
from servogen.errors import Location

OPERATORS = {"+": "float_add", "-": "float_subtract", "*": "float_multiply", "/": "float_divide"}
_OUTCOMES = {"<": LESS, "<=": LESS | EQUAL, "==": EQUAL, "!=": EQUAL, ">": GREATER, ">=": GREATER | EQUAL}
"""The results of a comparison for which an operator holds; for `!=` those for which it does not."""
_DECIMAL = re.compile(r"(\d*)\.?(\d*)(?:[eE]([+-]?\d+))?[fFlL]?")
_HEXADECIMAL = re.compile(r"0[xX]([0-9a-fA-F]*)\.?([0-9a-fA-F]*)[pP]([+-]?\d+)[fFlL]?")
MAX_DIGITS = 400
MAX_EXPONENT = 2000
"""An exponent that no number of digits brings back into the range of a type; to compute with greater ones
would only take time."""


def float_literal(analyser: Analyser, text: str, place: Location) -> Num:
    """Return the value nearest to a floating constant."""
    kind = analyser.float_type
    if match := _HEXADECIMAL.fullmatch(text):
        digits, base, step = 16, 2, 4
    else:
        match = _DECIMAL.fullmatch(text)
        digits, base, step = 10, 10, 1
    assert match is not None  # the parser has rejected other numbers
    whole, fraction = match[1] or "", match[2] or ""
    if len(whole + fraction) > MAX_DIGITS:
        raise analyser.fail("c-number", f"the number has more than {MAX_DIGITS} digits", place)
    power = _power(match[3] or "0") - step * len(fraction)
    number = int(whole + fraction, digits) * Fraction(base) ** power
    bits = encode(number, kind)
    if bits == infinity(kind):
        raise analyser.fail("c-number", f"{text} does not fit '{kind}'", place)
    if bits == 0 and number:
        analyser.reporter.warn("c-conversion", f"{text} is too small for '{kind}' and becomes 0", place)
    return Num(bits, kind, place)


def _power(text: str) -> int:
    """Return the exponent of a literal, limited to one that is out of range for every type."""
    size = text.lstrip("+-").lstrip("0")
    power = int(size or 0) if len(size) <= len(str(MAX_EXPONENT)) else MAX_EXPONENT
    return -min(power, MAX_EXPONENT) if text[0] == "-" else min(power, MAX_EXPONENT)


def shown(bits: int, kind: FloatType) -> str:
    """Return a value in decimal, for messages."""
    number = decode(bits, kind)
    return f"{float(number):.9g}" if number is not None else "not a finite number"


def converted(analyser: Analyser, expr: Expr, kind: CType) -> Expr:
    """Return the conversion between floating-point and another type."""
    if isinstance(kind, FloatType) and isinstance(expr.type, IntType):
        return _from_integer(expr, kind)
    if isinstance(kind, IntType) and isinstance(expr.type, FloatType):
        return _to_integer(analyser, expr, kind)
    raise analyser.fail("c-type", f"'{expr.type}' cannot be converted to '{kind}'", expr)


def _from_integer(expr: Expr, kind: FloatType) -> Expr:
    """Return an integer as a floating-point value (ISO C 6.3.1.4)."""
    assert isinstance(expr.type, IntType)
    if isinstance(expr, Num):
        return Num(encode(Fraction(expr.value), kind), kind, expr.place)
    signed = expr.type.signed
    short = expr.type.size <= U16.size
    work = (S16 if short else S32) if signed else (U16 if short else U32)
    integer = expr if expr.type.size == work.size else Cast(expr, work, expr.place)
    return Builtin("float_from_integer", [integer], kind, expr.place, signed, pure=True)


def _to_integer(analyser: Analyser, expr: Expr, kind: IntType) -> Expr:
    """Return a floating-point value as an integer, rounded towards zero (ISO C 6.3.1.4)."""
    assert isinstance(expr.type, FloatType)
    if kind.is_bool:
        return Cast(truth_of_float(analyser, expr), kind, expr.place)
    if isinstance(expr, Num):
        return Num(kind.wrap(whole_part(expr.value, expr.type)), kind, expr.place)
    whole = Builtin("float_to_integer", [expr], S32, expr.place, pure=True)
    return whole if kind.plain() == S32 else Cast(whole, kind, expr.place)


def warn_inexact(analyser: Analyser, expr: Expr, kind: CType) -> None:
    """Warn about a constant that an implicit conversion changes."""
    if not isinstance(expr, Num):
        return
    if isinstance(expr.type, FloatType) and isinstance(kind, IntType) and not kind.is_bool:
        value = whole_part(expr.value, expr.type)
        low = -(1 << 8 * kind.bytes - 1)
        if decode(expr.value, expr.type) != value or not low <= value <= kind.high:
            analyser.reporter.warn(
                "c-conversion",
                f"{shown(expr.value, expr.type)} does not fit '{kind}' and becomes {kind.wrap(value)}",
                expr.place,
            )
    elif isinstance(expr.type, IntType) and isinstance(kind, FloatType):
        bits = encode(Fraction(expr.value), kind)
        if decode(bits, kind) != expr.value:
            analyser.reporter.warn(
                "c-conversion",
                f"{expr.value} has more digits than '{kind}' and becomes {shown(bits, kind)}",
                expr.place,
            )


def float_operator(analyser: Analyser, op: str, left: Expr, right: Expr, place: Location) -> Expr:
    """Return an arithmetic operator or a comparison of two values of the floating-point type."""
    kind = analyser.float_type
    if isinstance(left, Num) and isinstance(right, Num):
        if op in COMPARISONS:
            holds = compare_float(op, left.value, right.value, kind)
            return analyser.number(int(holds), analyser.int_type, place)
        return Num(fold_float(op, left.value, right.value, kind), kind, place)
    if op not in COMPARISONS:
        return Builtin(OPERATORS[op], [left, right], kind, place, pure=True)
    for one, two in ((left, right), (right, left)):
        if op in ("==", "!=") and isinstance(two, Num) and two.value & kind.sign_bit - 1 == 0:
            return _magnitude_test(analyser, one, op, place)
    outcome = Builtin("float_compare", [left, right], U8, place, pure=True)
    tested = Binary("&", outcome, Num(_OUTCOMES[op], U8, place), U8, place)
    return Binary("==" if op == "!=" else "!=", tested, Num(0, U8, place), analyser.int_type, place)


def bits_of(expr: Expr) -> Expr:
    """Return the bytes of a value as an unsigned integer."""
    assert isinstance(expr.type, FloatType)
    return Cast(expr, expr.type.bits, expr.place)


def _magnitude_test(analyser: Analyser, expr: Expr, op: str, place: Location) -> Expr:
    """Return whether a value is, or is not, one of the two zeros."""
    assert isinstance(expr.type, FloatType)
    bits = expr.type.bits
    size = Binary("&", bits_of(expr), Num(expr.type.sign_bit - 1, bits, place), bits, place)
    return Binary(op, size, Num(0, bits, place), analyser.int_type, place)


def truth_of_float(analyser: Analyser, expr: Expr) -> Expr:
    """Return whether a value is not zero."""
    assert isinstance(expr.type, FloatType)
    if isinstance(expr, Num):
        nonzero = expr.value & expr.type.sign_bit - 1 != 0
        return analyser.number(int(nonzero), analyser.int_type, expr.place)
    return _magnitude_test(analyser, expr, "!=", expr.place)


def negated(expr: Expr, place: Location) -> Expr:
    """Return a value with the other sign."""
    kind = expr.type.plain()
    assert isinstance(kind, FloatType)
    if isinstance(expr, Num):
        return Num(expr.value ^ kind.sign_bit, kind, place)
    changed = Binary("^", bits_of(expr), Num(kind.sign_bit, kind.bits, place), kind.bits, place)
    return Cast(changed, kind, place)


def without_sign(expr: Expr, place: Location) -> Expr:
    """Return the absolute value of a value."""
    kind = expr.type.plain()
    assert isinstance(kind, FloatType)
    if isinstance(expr, Num):
        return Num(expr.value & kind.sign_bit - 1, kind, place)
    size = Binary("&", bits_of(expr), Num(kind.sign_bit - 1, kind.bits, place), kind.bits, place)
    return Cast(size, kind, place)


def square_root(expr: Expr, place: Location) -> Expr:
    """Return the square root of a value."""
    kind = expr.type.plain()
    assert isinstance(kind, FloatType)
    if isinstance(expr, Num):
        return Num(fold_square_root(expr.value, kind), kind, place)
    return Builtin("float_square_root", [expr], kind, place, pure=True)


def one(analyser: Analyser, place: Location) -> Num:
    """Return the constant 1.0."""
    return Num(encode(Fraction(1), analyser.float_type), analyser.float_type, place)
