"""Semantic analysis of initialisers: bytes for constant parts, assignments for the others.

In: pycparser initialisers and the type that they initialise. Out: bytes by offset, or assignments to the
parts of a local.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

from pycparser import c_ast

from servogen.compiler.ast import nodes as tree
from servogen.compiler.ast.types import U8, ArrayType, CType, IntType, PointerType, StructType, VoidType, same
from servogen.compiler.sema.accessors import store
from servogen.compiler.sema.analyser import Analyser
from servogen.compiler.sema.conversions import convert
from servogen.compiler.sema.names import characters, constant, expression
from servogen.compiler.sema.type_names import sized
from servogen.errors import Location


class Leaf(NamedTuple):
    """A scalar of an initialiser: its offset, its type, the expression or byte; for a bit-field, its bits."""

    offset: int
    type: CType
    value: Any
    bit: int | None = None
    width: int = 0
    place: Location = Location()

    @property
    def bits(self) -> range:
        """The bits of the whole object that it takes."""
        start = 8 * self.offset + (self.bit or 0)
        return range(start, start + (self.width or 8 * self.type.size))


def complete(analyser: Analyser, kind: CType, node: Any) -> CType:
    """Return the type; an array without a length takes it from its initialiser."""
    if not isinstance(kind, ArrayType) or kind.length is not None:
        return kind
    init = node.init
    if isinstance(init, c_ast.InitList) and kind.element.scalar and len(init.exprs) == 1:
        init = init.exprs[0] if getattr(init.exprs[0], "type", "") == "string" else init
    if isinstance(init, c_ast.InitList):
        return sized(analyser, replace(kind, length=max(_count(analyser, kind, init), 1)), node)
    if isinstance(init, c_ast.Constant) and init.type == "string":
        return replace(kind, length=len(characters(analyser, init.value, analyser.place(init))) + 1)
    if "extern" in (node.storage or []):
        known = analyser.externals.get(node.name)
        return known.type if isinstance(known, tree.Symbol) else kind
    raise analyser.fail("c-initialiser", f"the size of the array '{node.name}' is missing", node)


def _count(analyser: Analyser, array: ArrayType, init: Any) -> int:
    """Return how many elements an initialiser in braces gives to an array without a length. Where inner
    braces are omitted, an element takes as many values as it has scalars (ISO C 6.7.9).
    """
    length, index, items, element = 0, 0, list(init.exprs), array.element
    while items:
        item = items[0]
        if isinstance(item, c_ast.NamedInitializer):
            index = _designated(analyser, array, item)
            items[0] = item.expr
        index += 1
        length = max(length, index)
        left = len(items)
        if isinstance(element, (ArrayType, StructType)) and not _is_whole(analyser, items, element):
            _aggregate(analyser, element, items, 0, [], braced=False)
        if len(items) == left:
            items.pop(0)
    return length


def _is_whole(analyser: Analyser, items: list[Any], element: ArrayType | StructType) -> bool:
    """Return whether the next item initialises an array or structure as a whole: one in braces, a string for
    characters, or another structure of its type. What may be one is replaced by its typed expression.
    """
    item = items[0]
    if isinstance(item, c_ast.InitList):
        return True
    if isinstance(item, c_ast.Constant) and item.type == "string":
        return (
            isinstance(element, ArrayType)
            and isinstance(element.element, IntType)
            and element.element.size == 1
        )
    if isinstance(element, ArrayType) or isinstance(item, c_ast.Constant):
        return False
    items[0] = _typed(analyser, item)
    return same(items[0].type, element)


def _typed(analyser: Analyser, item: Any) -> tree.Expr:
    """Return an initialiser as a typed expression, unless it is one already."""
    typed: tree.Expr = expression(analyser, item) if isinstance(item, c_ast.Node) else item
    return typed


def scalars(analyser: Analyser, kind: CType, init: Any) -> list[Leaf]:
    """Return the scalars of an initialiser, with their values converted to their types."""
    leaves: list[Leaf] = []
    _leaves(analyser, kind, init, 0, leaves)
    return [
        leaf
        if isinstance(leaf.value, int)
        else leaf._replace(
            value=convert(analyser, _typed(analyser, leaf.value), leaf.type, "the initialiser"),
            place=analyser.place(leaf.value),
        )
        for leaf in leaves
    ]


def is_constant(leaf: Leaf) -> bool:
    """Return whether a scalar is initialised with a number or an address that is known (ISO C 6.6)."""
    if isinstance(leaf.value, int):
        return True
    value = _stripped(leaf.value)
    return isinstance(value, tree.Num) or _address(value) is not None


def fill(analyser: Analyser, symbol: tree.Symbol, kind: CType, leaves: list[Leaf], place: Location) -> None:
    """Emit the assignments for an array or structure in RAM whose initialiser need not be constant."""
    given = {leaf.offset: leaf for leaf in leaves if not leaf.width}
    behind = 0
    for start, scalar in _scalars(kind, 0):
        if start < behind:
            continue  # a byte of a member that one expression initialises as a whole
        leaf = given.get(start) or Leaf(start, scalar, 0)
        behind = start + leaf.type.size
        _assign(analyser, symbol, leaf, place)
    for field in leaves:
        if field.width:
            _assign(analyser, symbol, field, place)


def _assign(analyser: Analyser, symbol: tree.Symbol, leaf: Leaf, place: Location) -> None:
    """Add the assignment of one scalar to `pending`."""
    kind = leaf.type.plain()
    if isinstance(leaf.value, int):
        value: tree.Expr = tree.Num(leaf.value, kind, place)
    else:
        value, place = leaf.value, leaf.place
    if leaf.width > 8:
        container = tree.Ref(symbol, leaf.offset, None, kind, place)
        field = tree.WideField(container, leaf.width, kind, place)
        analyser.pending.append(tree.ExprStmt(store(analyser, field, value)))
        return
    target = tree.Ref(symbol, leaf.offset, None, kind, place, leaf.bit, leaf.width)
    analyser.pending.append(tree.ExprStmt(tree.Assign(target, value, kind, place)))


def initialise(analyser: Analyser, data: dict[int, tree.Data], leaves: list[Leaf]) -> None:
    """Set the bytes of a constant initialiser."""
    for leaf in leaves:
        if isinstance(leaf.value, int):
            data[leaf.offset] = leaf.value & 0xFF
            continue
        content = _bytes(analyser, leaf)
        if leaf.width:
            _set_field(analyser, data, leaf, content)
            continue
        for number, byte in enumerate(content):
            data[leaf.offset + number] = byte


def _set_field(analyser: Analyser, data: dict[int, tree.Data], leaf: Leaf, value: list[tree.Data]) -> None:
    """Insert the value of a bit-field between those of its neighbours."""
    for number, byte in enumerate(value[: -(-leaf.width // 8)]):
        before = data.get(leaf.offset + number, 0)
        if not isinstance(byte, int) or not isinstance(before, int):
            raise analyser.fail("c-not-constant", "the initialiser must be a constant", leaf.place)
        mask = (1 << min(leaf.width - 8 * number, 8)) - 1
        data[leaf.offset + number] = before | (byte & mask) << (leaf.bit or 0)


def _bytes(analyser: Analyser, leaf: Leaf) -> list[tree.Data]:
    """Return the bytes of a constant initialiser; addresses are filled in by the layout."""
    value, size = _stripped(leaf.value), leaf.type.size
    if isinstance(value, tree.Num):
        return [value.value >> 8 * index & 0xFF for index in range(size)]
    address = _address(value)
    if address is None:
        raise analyser.fail("c-not-constant", "the initialiser must be a constant", leaf.place)
    return [tree.AddressByte(*address, part) for part in range(size)]


def _stripped(expr: tree.Expr) -> tree.Expr:
    """Return an expression without the conversions that keep its low bytes."""
    while (
        isinstance(expr, tree.Cast)
        and expr.type.size <= expr.operand.type.size
        and not isinstance(expr.type, VoidType)
    ):
        expr = expr.operand
    return expr


def _address(expr: tree.Expr) -> tuple[tree.Symbol, int] | None:
    """Return the object and the offset that an address constant points to; None if `expr` is not one."""
    match expr:
        case tree.AddressOf(target) if target.index is None:
            return target.symbol, target.offset
        case tree.Cast(operand) if isinstance(operand.type, PointerType):
            return _address(operand)
        case tree.Binary(op, pointer, tree.Num(bytes_)) if isinstance(expr.type, PointerType):
            moved = _address(pointer)
            return moved and (moved[0], moved[1] + (bytes_ if op == "+" else -bytes_))
    return None


def _leaves(analyser: Analyser, kind: CType, init: Any, offset: int, out: list[Leaf]) -> None:
    """Collect the scalars of an initialiser as (offset, type, node or byte), with braces present or
    omitted.
    """
    if isinstance(kind, ArrayType) and isinstance(kind.element, IntType) and kind.element.size == 1:
        inner = init
        if isinstance(init, c_ast.InitList) and len(init.exprs) == 1:
            inner = init.exprs[0]
        if isinstance(inner, c_ast.Constant) and inner.type == "string":
            values = characters(analyser, inner.value, analyser.place(inner))
            length = kind.length or 0
            if len(values) > length:
                raise analyser.fail(
                    "c-initialiser",
                    f"the string of {len(values)} characters does not fit an array of {length}",
                    inner,
                )
            # the 0 behind a string is left out where the array is full (ISO C 6.7.9)
            out += [
                Leaf(offset + index, kind.element, value) for index, value in enumerate([*values, 0][:length])
            ]
            return
    if isinstance(kind, (ArrayType, StructType)) and isinstance(init, c_ast.Node):
        if not isinstance(init, c_ast.InitList):
            raise analyser.fail("c-initialiser", f"'{kind}' needs an initialiser in braces", init)
        items = list(init.exprs)
        _aggregate(analyser, kind, items, offset, out, braced=True)
        if items:
            raise analyser.fail("c-initialiser", f"too many initialisers for '{kind}'", items[0])
        return
    out.append(Leaf(offset, kind, _scalar(analyser, kind, init)))


def _scalar(analyser: Analyser, kind: CType, init: Any) -> Any:
    """Return the initialiser of a scalar without its braces (ISO C 6.7.9)."""
    if not isinstance(init, c_ast.InitList):
        return init
    if len(init.exprs) != 1:
        raise analyser.fail(
            "c-initialiser", f"'{kind}' takes one initialiser, {len(init.exprs)} are given", init
        )
    return init.exprs[0]


def _aggregate(
    analyser: Analyser,
    kind: ArrayType | StructType,
    items: list[Any],
    offset: int,
    out: list[Leaf],
    *,
    braced: bool,
) -> None:
    """Consume from `items` what the elements of one array or structure need."""
    slots: list[tuple[int, CType]] = _elements(kind)
    parts = kind.layout.parts if isinstance(kind, StructType) else []
    # without a designator a union's first member is initialised (ISO C 6.7.9)
    if isinstance(kind, StructType) and kind.layout.union:
        slots = slots[:1]
    position = 0
    initialised: set[int] = set()
    by_name = False
    first = items[0] if items else None
    while items and (position < len(slots) or isinstance(items[0], c_ast.NamedInitializer)):
        item = items[0]
        if isinstance(item, c_ast.NamedInitializer):
            # a designator belongs to the object whose braces enclose it
            if not braced:
                return
            position = _designated(analyser, kind, item)
            by_name = True
            slots = _elements(kind)
            if position >= len(slots):
                raise analyser.fail("c-initialiser", "this element does not exist", item.expr)
            # `.a.b = 1` and `[2].x = 1`
            if len(item.name) > 1:
                raise analyser.fail("c-unsupported", "nested designators are not supported", item.expr)
            inside = bool(parts) and not parts[position].name
            items[0] = item = c_ast.InitList([item]) if inside else item.expr
            if inside:
                initialised.discard(position)  # another member of the unnamed one
        if position in initialised:
            analyser.reporter.warn("c-initialiser", "this element already has a value", analyser.place(item))
        where, element = slots[position]
        member = parts[position] if parts else None
        if by_name and isinstance(kind, StructType) and kind.layout.union:
            _override(out, Leaf(offset, kind, None))
        elif by_name and (member is None or member.name):
            bits = (member.bit, member.width) if member is not None and member.width else (None, 0)
            _override(out, Leaf(offset + where, element, None, *bits))
        if isinstance(element, (ArrayType, StructType)) and not _is_whole(analyser, items, element):
            _aggregate(analyser, element, items, offset + where, out, braced=False)
        else:
            item = items.pop(0)
            if member is not None and member.width:
                value = _scalar(analyser, element, item)
                out.append(Leaf(offset + where, element, value, member.bit, member.width))
            else:
                _leaves(analyser, element, item, offset + where, out)
        initialised.add(position)
        position += 1
    while isinstance(first, c_ast.InitList) and len(first.exprs) == 1:
        first = first.exprs[0]
    zero = isinstance(first, c_ast.Constant) and first.value == "0" and position == 1  # `{ 0 }`: all zero
    if parts and braced and not by_name and 0 < position < len(slots) and not zero and not items:
        analyser.reporter.warn(
            "c-initialiser",
            f"the member '{parts[position].name}' has no value and starts with 0",
            analyser.place(first),
        )


def _override(out: list[Leaf], later: Leaf) -> None:
    """Drop what was given for an object, or for a part of it, before: the later initialiser counts (ISO C
    6.7.9).
    """
    bits = later.bits
    out[:] = [leaf for leaf in out if leaf.bits.stop <= bits.start or bits.stop <= leaf.bits.start]


def _designated(analyser: Analyser, kind: CType, item: Any) -> int:
    """Return the index of the element or member that a designator refers to; for a member of an unnamed
    member, that of the unnamed member.
    """
    designator = item.name[0]
    inner = getattr(designator, "expr", designator)
    if isinstance(kind, StructType):
        for index, part in enumerate(kind.layout.parts):
            within = part.type.layout.members if isinstance(part.type, StructType) else {}
            if isinstance(inner, c_ast.ID) and inner.name in (within if not part.name else (part.name,)):
                return index
        raise analyser.fail("c-undeclared", f"'{kind}' has no such member", item.expr)
    return constant(analyser, inner, "an index")


def _elements(kind: ArrayType | StructType) -> list[tuple[int, CType]]:
    """Return (offset, type) of each element or member."""
    if isinstance(kind, ArrayType):
        return [(number * kind.element.size, kind.element) for number in range(kind.length or 0)]
    return [(part.offset, part.type) for part in kind.layout.parts]


def _scalars(kind: CType, offset: int) -> list[tuple[int, CType]]:
    """Return (offset, type) of every scalar in an object."""
    if isinstance(kind, StructType) and any(part.width for part in kind.layout.parts):
        return [(offset + index, U8) for index in range(kind.size)]
    if isinstance(kind, StructType) and kind.layout.union:
        return [(offset + index, U8) for index in range(kind.size)]
    if isinstance(kind, (ArrayType, StructType)):
        return [leaf for start, element in _elements(kind) for leaf in _scalars(element, offset + start)]
    return [(offset, kind)]
