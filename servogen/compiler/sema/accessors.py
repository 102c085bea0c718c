"""Objects that are not plain bytes of RAM: bit-fields of 9 to 15 bits, and variables in the EEPROM.

In: references to them. Out: the expression that reads one, and the one that stores a value.
"""

from __future__ import annotations

from servogen.compiler.ast import nodes as tree
from servogen.compiler.ast.constant_folding import has_effect
from servogen.compiler.ast.types import U8, U16, VOID, CType, IntType
from servogen.compiler.sema.analyser import Analyser
from servogen.errors import Location

Accessor = tree.WideField | tree.EepromObject


def load(analyser: Analyser, target: Accessor) -> tree.Expr:
    """Return the value of an object as an ordinary expression."""
    place = target.place
    if isinstance(target, tree.EepromObject):
        if not target.type.scalar:
            raise analyser.fail(
                "c-unsupported", "an array or structure in the EEPROM cannot be copied as a whole", target
            )
        return _joined([_byte(target, number) for number in range(target.type.size)], target.type, place)
    mask = tree.Num((1 << target.width) - 1, U16, place)
    field: tree.Expr = tree.Binary("&", target.container, mask, U16, place)
    if isinstance(target.type, IntType) and target.type.signed:
        sign = tree.Num(1 << target.width - 1, U16, place)
        # (x ^ s) - s extends the sign bit s
        field = tree.Binary("-", tree.Binary("^", field, sign, U16, place), sign, U16, place)
    # ISO C 6.3.1.1: an int holds all values of the field, signed or not
    return tree.Cast(field, target.type if analyser.c2c else analyser.types["int16_t"], place)


def _byte(target: tree.EepromObject, number: int) -> tree.Expr:
    return tree.Builtin("eeprom_read", [_address(target, number)], U8, target.place, pure=True)


def _address(target: tree.EepromObject, number: int) -> tree.Expr:
    """Return the address of a byte of an object in the EEPROM."""
    if isinstance(target.address, tree.Num):
        return tree.Num(target.address.value + number, U8, target.place)
    if not number:
        return target.address
    return tree.Binary("+", target.address, tree.Num(number, U8, target.place), U8, target.place)


def _joined(parts: list[tree.Expr], kind: CType, place: Location) -> tree.Expr:
    """Return the value whose bytes are given, the low one first."""
    if len(parts) == 1:
        return tree.Cast(parts[0], kind, place) if kind.plain() != U8 else parts[0]
    work = IntType("", len(parts), False)
    joined: tree.Expr = tree.Cast(parts[0], work, place)
    for number, part in enumerate(parts[1:], 1):
        shifted = tree.Binary(
            "<<", tree.Cast(part, work, place), tree.Num(8 * number, U8, place), work, place
        )
        joined = tree.Binary("|", joined, shifted, work, place)
    return tree.Cast(joined, kind, place)


def store(analyser: Analyser, target: Accessor, value: tree.Expr) -> tree.Expr:
    """Return the expression that stores a value, already converted to the object's type, and has that
    value.
    """
    place = target.place
    if isinstance(value, tree.Num):
        stored = tree.Num(_wrapped(target, value.value), target.type.plain(), place)
        return tree.Comma(_stored(target, value), stored, target.type.plain(), place)
    if analyser.function is None:
        raise analyser.fail("c-not-constant", "the initialiser must be a constant", value)
    symbol = analyser.new_local("stored", target.type.plain(), place)
    copy = tree.Ref(symbol, 0, None, symbol.type, place)
    steps = tree.Comma(tree.Assign(copy, value, symbol.type, place), _stored(target, copy), VOID, place)
    now = load(analyser, target) if isinstance(target, tree.WideField) else copy
    return tree.Comma(steps, now, now.type.plain(), place)


def _wrapped(target: Accessor, value: int) -> int:
    """Return what is left of a constant in a bit-field."""
    if isinstance(target, tree.EepromObject) or not isinstance(target.type, IntType):
        return value
    value &= (1 << target.width) - 1
    return value - (1 << target.width) if target.type.signed and value >> target.width - 1 else value


def _stored(target: Accessor, value: tree.Num | tree.Ref) -> tree.Expr:
    """Return the expression that writes a value: the bytes of the EEPROM, or the field between its
    neighbours.
    """
    place = target.place
    if isinstance(target, tree.EepromObject):
        stored: tree.Expr | None = None
        for number in range(target.type.size):
            write = tree.Builtin(
                "eeprom_write", [_address(target, number), _part(value, number)], VOID, place
            )
            stored = write if stored is None else tree.Comma(stored, write, VOID, place)
        assert stored is not None
        return stored
    mask = (1 << target.width) - 1
    unchanged = tree.Binary("&", target.container, tree.Num(0xFFFF & ~mask, U16, place), U16, place)
    given = tree.Binary("&", tree.Cast(value, U16, place), tree.Num(mask, U16, place), U16, place)
    return tree.Assign(target.container, tree.Binary("|", unchanged, given, U16, place), U16, place)


def _part(value: tree.Num | tree.Ref, number: int) -> tree.Expr:
    """Return one byte of a value."""
    if isinstance(value, tree.Num):
        return tree.Num(value.value >> 8 * number & 0xFF, U8, value.place)
    return tree.Ref(value.symbol, number, None, U8, value.place)


def evaluated_once(analyser: Analyser, target: Accessor) -> None:
    """Refuse an object that an operator would evaluate twice if evaluating it has an effect."""
    inner: tree.Expr = target.address if isinstance(target, tree.EepromObject) else target.container
    index = (
        inner.index
        if isinstance(inner, tree.Ref)
        else inner.pointer
        if isinstance(inner, tree.Deref)
        else inner
    )
    if index is not None and has_effect(index):
        raise analyser.fail(
            "c-unsupported",
            "the address of this object would be computed twice, and computing it has a side effect",
            target,
            hint="compute the index in a statement of its own",
        )


def element(target: tree.EepromObject, step: tree.Expr, kind: CType) -> tree.EepromObject:
    """Return a part of an object in the EEPROM, `step` bytes further on."""
    base = target.address
    if isinstance(base, tree.Num) and isinstance(step, tree.Num):
        address: tree.Expr = tree.Num(base.value + step.value, U8, target.place)
    else:
        address = tree.Binary("+", step, base, U8, target.place)
    return tree.EepromObject(address, kind, target.place)
