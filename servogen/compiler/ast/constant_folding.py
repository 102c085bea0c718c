"""Constant arithmetic as C defines it on this chip, and the range of values that an expression can take.

In: typed tree nodes. Out: folded constants (ISO C 6.5 on types of 8 to 32 bits, wrapping), and (low, high)
intervals from which the code generator chooses the narrowest arithmetic that is still right.
"""

from __future__ import annotations

from servogen.compiler.ast import nodes as tree
from servogen.compiler.ast.types import FloatType, IntType, PointerType
from servogen.compiler.ast.walk import VALUES, evaluated

MIRRORED = {"<": ">", ">": "<", "<=": ">=", ">=": "<=", "==": "==", "!=": "!="}
"""The comparison that holds for exchanged operands."""
COMPARISONS = frozenset(MIRRORED)
Interval = tuple[int, int]


def fold(op: str, left: int, right: int, kind: IntType) -> int | None:
    """Return `left op right` computed in a type; None for a division by zero."""
    match op:
        case "+":
            value = left + right
        case "-":
            value = left - right
        case "*":
            value = left * right
        case "/" | "%":
            if right == 0:
                return None
            # C rounds towards zero (ISO C 6.5.5), Python's // downwards
            quotient = abs(left) // abs(right) * (1 if (left < 0) == (right < 0) else -1)
            value = quotient if op == "/" else left - right * quotient
        case "&":
            value = left & right
        case "|":
            value = left | right
        case "^":
            value = left ^ right
        case "<<":
            # the code that shifts at run time counts in one byte too
            value = left << (right & 0xFF)
        case ">>":
            value = left >> (right & 0xFF)
        case _:
            raise ValueError(op)
    return kind.wrap(value)


def compare(op: str, left: int, right: int) -> bool:
    """Return whether `left op right` holds."""
    match op:
        case "==":
            return left == right
        case "!=":
            return left != right
        case "<":
            return left < right
        case "<=":
            return left <= right
        case ">":
            return left > right
        case _:
            return left >= right


def type_interval(kind: object) -> Interval:
    """Return the minimum and maximum value of a type; pointers and floating-point values count as their
    bytes.
    """
    if isinstance(kind, IntType):
        return kind.low, kind.high
    if isinstance(kind, (PointerType, FloatType)):
        return 0, (1 << 8 * kind.size) - 1
    return 0, 0


def interval(expr: tree.Expr) -> Interval:
    """Return the minimum and maximum value of an expression, derived from its types and constants."""
    full = type_interval(expr.type)
    match expr:
        case tree.Num(value):
            return value, value
        case tree.Ref(width=width) | tree.Deref(width=width) if width:
            return _field(expr, width)
        case tree.Cast(operand):
            inner = interval(operand)
            if isinstance(expr.type, IntType) and expr.type.is_bool:
                return 0, 1
            return inner if full[0] <= inner[0] and inner[1] <= full[1] else full
        case tree.Unary("!") | tree.Logic():
            return 0, 1
        case tree.Unary("-", operand):
            low, high = interval(operand)
            return _fits((-high, -low), full)
        case tree.Binary(op) if op in COMPARISONS:
            return 0, 1
        case tree.Binary():
            return _fits(_binary(expr, full), full)
        case tree.Choice(_, yes, no):
            one, two = interval(yes), interval(no)
            return min(one[0], two[0]), max(one[1], two[1])
        case tree.Comma(_, second):
            return interval(second)
        case tree.Assign(target, value):
            full, inner = interval(target), interval(value)
            return inner if full[0] <= inner[0] and inner[1] <= full[1] else full
        case tree.Update():
            return full
    return full


def _field(expr: tree.Ref | tree.Deref, width: int) -> Interval:
    """Return the values that a bit-field can hold."""
    if isinstance(expr.type, IntType) and expr.type.signed:
        return -(1 << width - 1), (1 << width - 1) - 1
    return 0, (1 << width) - 1


def _fits(values: Interval, full: Interval) -> Interval:
    """Return the exact interval of a result; the type's own where the result may wrap."""
    return values if full[0] <= values[0] and values[1] <= full[1] else full


def _binary(expr: tree.Binary, full: Interval) -> Interval:
    """Return the interval of a binary operator's result before it wraps; `full` where it is unknown."""
    a, b = interval(expr.left), interval(expr.right)
    match expr.op:
        case "+":
            return a[0] + b[0], a[1] + b[1]
        case "-":
            return a[0] - b[1], a[1] - b[0]
        case "*":
            ends = [x * y for x in a for y in b]
            return min(ends), max(ends)
        case "&" if b[0] >= 0 or a[0] >= 0:
            # a result bit is set in both operands: the smaller of the non-negative ones bounds it
            bounds = [high for low, high in (a, b) if low >= 0]
            return 0, min(bounds)
        case "|" | "^" if a[0] >= 0 and b[0] >= 0:
            # no bit above the highest one of the operands is set
            return 0, (1 << max(a[1], b[1]).bit_length()) - 1
        case "/" if b[0] > 0 and a[0] >= 0:
            return a[0] // b[1], a[1] // b[0]
        case "%" if b[0] > 0 and a[0] >= 0:
            return 0, min(a[1], b[1] - 1)
        case ">>" if b[0] == b[1] and b[0] >= 0:
            return a[0] >> b[0], a[1] >> b[0]
        case ">>" if a[0] >= 0:
            return 0, a[1]
        case "<<" if b[0] == b[1] and 0 <= b[0] < 32:
            return a[0] << b[0], a[1] << b[0]
    return full


def has_effect(expr: tree.Expr) -> bool:
    """Return whether evaluating an expression does more than yield a value; reading a volatile object
    counts.
    """
    return any(map(_acts, evaluated(expr)))


def _acts(expr: tree.Expr) -> bool:
    """Return whether a node by itself does more than yield a value."""
    match expr:
        case tree.Ref(symbol):
            return symbol.volatile or expr.type.volatile
        case tree.Deref():
            return expr.type.volatile
        case tree.Builtin(name):
            return name not in tree.FLOAT_OPERATIONS
    return not isinstance(expr, VALUES)
