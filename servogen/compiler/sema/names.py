"""Semantic analysis of primary expressions: literals, strings, names of variables, registers and bits.

In: pycparser nodes and the names in scope. Out: typed expressions; const objects of known value become
numbers.
"""

from __future__ import annotations

import re
from functools import cache
from typing import Any

import servogen.compiler.sema.function_pointers as function_pointers
from servogen.compiler.ast import nodes as tree
from servogen.compiler.ast.constant_folding import has_effect
from servogen.compiler.ast.types import (
    BIT,
    U8,
    FloatType,
    IntType,
    Member,
    StructLayout,
    StructType,
    VoidType,
)
from servogen.compiler.diagnostics import Fatal
from servogen.compiler.frontend.dialects import (
    REGISTER_FIELDS,
    ChipBit,
    chip_bits,
    chip_registers,
    config_names,
)
from servogen.compiler.limits import DIGITS
from servogen.compiler.sema.accessors import load
from servogen.compiler.sema.analyser import Analyser
from servogen.compiler.sema.conversions import arithmetic
from servogen.compiler.sema.floats import float_literal
from servogen.compiler.sema.scopes import BitAlias, Constant
from servogen.errors import Location, did_you_mean

_ESCAPES = {
    "n": 10,
    "t": 9,
    "r": 13,
    "0": 0,
    "a": 7,
    "b": 8,
    "f": 12,
    "v": 11,
    "\\": 92,
    "'": 39,
    '"': 34,
    "?": 63,
}
_LITERAL = re.compile(r'"(?:[^"\\]|\\.)*"|\'(?:[^\'\\]|\\.)*\'', re.DOTALL)
_CHARACTER = re.compile(r"\\x([0-9a-fA-F]+)|\\([0-7]{1,3})|\\(.)|([^\\])", re.DOTALL)


def expression(analyser: Analyser, node: Any) -> tree.Expr:
    """Return the typed form of an expression of pycparser's tree."""
    handler = analyser.dispatch.expressions.get(type(node))
    if handler is None:
        construct = re.sub(r"(?<!^)(?=[A-Z])", " ", type(node).__name__).lower()
        raise analyser.fail("c-unsupported", f"a {construct} is not supported", node)
    return handler(analyser, node)


def constant(analyser: Analyser, node: Any, role: str) -> int:
    """Return the value of a constant expression."""
    expr = arithmetic(analyser, expression(analyser, node))
    if not isinstance(expr, tree.Num):
        raise analyser.fail("c-not-constant", f"{role} must be a constant", node)
    return expr.value


def literal(analyser: Analyser, node: Any) -> tree.Expr:
    """Analyse a number, character or string (ISO C 6.4.4, 6.4.5)."""
    place = analyser.place(node)
    if node.type == "string":
        return analyser.string([*characters(analyser, node.value, place), 0], place)
    if node.type == "char":
        values = characters(analyser, node.value, place)
        if len(values) != 1:
            raise analyser.fail("c-number", "a character constant holds one character", node)
        return analyser.number(values[0], analyser.int_type, place)
    if node.type in ("float", "double", "long double"):
        return float_literal(analyser, node.value, place)
    match = re.fullmatch(r"(0[xX][0-9a-fA-F]+|[0-9]+)([uUlL]*)", node.value)
    assert match is not None  # the parser has rejected other numbers
    digits = match[1]
    octal = len(digits) > 1 and digits[0] == "0" and digits[1] not in "xX"
    shown = digits if len(digits) <= DIGITS else digits[:DIGITS] + "…"
    value = int(digits, 8 if octal else 0) if shown == digits else None
    if value is None or value > 0xFFFFFFFF:
        raise analyser.fail("c-number", f"{shown} does not fit in 32 bits", node)
    return tree.Num(
        value, analyser.literal_type(value, match[2].lower(), digits[0] != "0" or digits == "0"), place
    )


def characters(analyser: Analyser, text: str, place: Location) -> list[int]:
    """Return the character codes of a character literal or of adjacent strings, given with their quotes."""
    values = []
    for spelled in _LITERAL.findall(text):
        for match in _CHARACTER.finditer(spelled[1:-1]):
            hexadecimal, octal, escape, plain = match.groups()
            if hexadecimal or octal:
                value = int(hexadecimal or octal, 16 if hexadecimal else 8)
                if value > 0xFF:
                    analyser.reporter.warn(
                        "c-number",
                        f"the escape '{match[0]}' is more than 8 bits and becomes 0x{value & 0xFF:02X}",
                        place,
                        hint='a string that ends behind an escape ends it too: "\\xDF" "C"',
                    )
                values.append(value & 0xFF)
            elif escape:
                if escape not in _ESCAPES:
                    analyser.reporter.warn("c-number", f"unknown escape '\\{escape}'", place)
                values.append(_ESCAPES.get(escape, ord(escape) & 0xFF))
            else:
                encoded = plain.encode("latin-1", "replace")
                if plain != "?" and encoded == b"?":
                    analyser.reporter.warn(
                        "c-number", f"the character '{plain}' is not in Latin-1 and becomes '?'", place
                    )
                values.append(encoded[0])
    return values


def identifier(analyser: Analyser, node: Any) -> tree.Expr:
    return named(analyser, node, as_bit=not analyser.c2c)


def named(analyser: Analyser, node: Any, *, as_bit: bool) -> tree.Expr:
    """Return what a name refers to; the name of a register's bit is the bit, or in C2C its number."""
    meaning = analyser.scopes.find(node.name)
    place = analyser.place(node)
    match meaning:
        case tree.Symbol():
            return use(meaning, place)
        case Constant(value, kind):
            return tree.Num(value, kind, place)
        case ChipBit(register, bit):
            if not as_bit:
                return tree.Num(bit, analyser.int_type, place)
            return tree.Ref(analyser.scopes.register(register), 0, None, BIT, place, bit, 1)
        case BitAlias(symbol, bit):
            return tree.Ref(symbol, bit // 8, None, BIT, place, bit % 8, 1)
        case tree.FunctionDefinition():
            return function_pointers.address(analyser, meaning, place)
    if node.name in ("__func__", "__FUNCTION__") and analyser.function is not None:
        return analyser.string([*analyser.function.name.encode(), 0], place)
    # PORTBbits, as in XC8's headers
    match = re.fullmatch(r"(\w+)bits", node.name)
    register_symbol = analyser.scopes.chip(match[1]) if match else None
    if isinstance(register_symbol, tree.Symbol):
        return tree.Ref(register_symbol, 0, None, StructType(register_layout(match[1])), place)  # type: ignore[index]
    if analyser.reading_config and node.name in config_names():
        return tree.Num(config_names()[node.name], analyser.int_type, place)
    if node.name in analyser.reporter.lost:
        raise Fatal(node.name)
    raise analyser.fail(
        "c-undeclared", f"'{node.name}' is not declared", node, hint=_suggest(analyser, node.name)
    )


def _suggest(analyser: Analyser, name: str) -> str | None:
    hint = did_you_mean(name, analyser.scopes.known())
    return hint if hint.startswith("did you") else None


def use(symbol: tree.Symbol, place: Location) -> tree.Expr:
    """Return a variable as an expression; a constant of known value is that number."""
    kind = symbol.type
    if symbol.kind == "eeprom":
        return tree.EepromObject(tree.Num(symbol.address or 0, U8, place), kind, place)
    if symbol.kind == "flash" and kind.scalar and symbol.initial is not None:
        data = [symbol.initial.get(offset, 0) for offset in range(kind.size)]
        if all(isinstance(byte, int) for byte in data) and isinstance(kind, (IntType, FloatType)):
            value = sum(byte << 8 * index for index, byte in enumerate(data) if isinstance(byte, int))
            value = kind.wrap(value) if isinstance(kind, IntType) else value
            return tree.ConstNum(tree.Ref(symbol, 0, None, kind, place), value)
    if isinstance(kind, IntType) and kind.is_bit:
        return tree.Ref(symbol, 0, None, kind, place, 0, 1)
    return tree.Ref(symbol, 0, None, kind, place)


def expression_list(analyser: Analyser, node: Any) -> tree.Expr:
    """Analyse the comma operator (ISO C 6.5.17)."""
    *before, last = node.exprs
    sequence = value_of(analyser, expression(analyser, last))
    for part in reversed(before):
        first = value_of(analyser, expression(analyser, part))
        warn_unused(analyser, first)
        sequence = tree.Comma(first, sequence, sequence.type, analyser.place(part))
    return sequence


def value_of(analyser: Analyser, expr: tree.Expr) -> tree.Expr:
    """Return an expression whose value is read by the code generator itself."""
    return load(analyser, expr) if isinstance(expr, (tree.WideField, tree.EepromObject)) else expr


def warn_unused(analyser: Analyser, expr: tree.Expr) -> None:
    """Warn about a statement without effect."""
    if isinstance(expr, tree.Cast) and isinstance(expr.type, VoidType):
        return
    if isinstance(expr, (tree.Choice, tree.Logic, tree.Comma)) and has_effect(expr):
        return
    if isinstance(expr, tree.Binary) and expr.op == "==":
        analyser.reporter.warn(
            "c-no-effect",
            "this comparison has no effect",
            expr.place,
            hint="'=' assigns, '==' compares" if expr.op == "==" else None,
        )
    elif not has_effect(expr):
        analyser.reporter.warn("c-no-effect", "this statement has no effect", expr.place)
    elif isinstance(expr, tree.Deref) and isinstance(expr.pointer, tree.Update) and not expr.type.volatile:
        analyser.reporter.warn(
            "c-unused-result",
            "the value that the pointer points to is read but not used",
            expr.place,
            hint="'(*p)++' changes it, 'p++' moves the pointer",
        )
    elif isinstance(expr, (tree.Binary, tree.Unary, tree.Cast)) or (
        isinstance(expr, tree.Builtin) and expr.pure
    ):
        analyser.reporter.warn("c-unused-result", "the result of this expression is not used", expr.place)


@cache
def register_layout(name: str) -> StructLayout:
    """Return the bits and fields of a register as members of a structure."""
    register = chip_registers()[name]
    members = {
        bit_name: Member(bit_name, BIT, 0, bit.bit, 1)
        for bit_name, bit in chip_bits().items()
        if bit.register is register
    }
    fields = {
        field: Member(field, U8, 0, bit, width)
        for field, (bit, width) in REGISTER_FIELDS.get(register.name, {}).items()
    }
    return StructLayout(f"{register.name}bits", False, {**members, **fields}, size=1)
