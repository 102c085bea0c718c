"""Semantic analysis of types: declarators, structures, enumerations.

In: pycparser declarators. Out: types; tags and enumeration constants are added to the scopes.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from pycparser import c_ast

from servogen.compiler.ast.types import (
    BIT,
    U8,
    VOID,
    ArrayType,
    CType,
    FuncType,
    IntType,
    Member,
    PointerType,
    StructLayout,
    StructType,
    VoidType,
    qualified,
    same,
)
from servogen.compiler.frontend.dialects import WIDE_TYPES, chip_registers, int_type
from servogen.compiler.frontend.extensions import CONFIG_NAME, EEPROM
from servogen.compiler.sema.analyser import Analyser
from servogen.compiler.sema.names import constant, register_layout
from servogen.compiler.sema.scopes import Constant, TypeName
from servogen.pic.device import PROGRAM_WORDS


def declared_type(analyser: Analyser, node: Any, *, variable: bool = False) -> CType:
    """Return the type of a declarator or type name; only a variable can be in the EEPROM."""
    match node:
        case c_ast.Typename() | c_ast.Decl() | c_ast.Typedef():
            return declared_type(analyser, node.type)
        case c_ast.TypeDecl():
            base = specified(analyser, node.type, node)
            return _qualified(analyser, base, node, variable)
        case c_ast.PtrDecl():
            if in_eeprom(node.type):
                raise analyser.fail(
                    "c-unsupported",
                    "there are no pointers into the EEPROM",
                    node,
                    hint="a pointer that is itself in the EEPROM is 'char *__eeprom p'",
                )
            target = declared_type(analyser, node.type)
            if isinstance(target, IntType) and target.is_bit:
                raise analyser.fail("c-type", "there are no pointers to bits", node)
            return _qualified(analyser, PointerType(target), node, variable)
        case c_ast.ArrayDecl():
            return _array(analyser, node, variable)
        case c_ast.Struct() | c_ast.Union() | c_ast.Enum():
            return specified(analyser, node, node)
        case c_ast.FuncDecl():
            return FuncType(declared_type(analyser, node.type), _parameters(analyser, node))
    # pycparser has a type alone, an IdentifierType, only for a member (ISO C 6.7.2.1).
    raise analyser.fail("c-syntax", "this member has no name", node)


def in_eeprom(declarator: Any) -> bool:
    """Return whether what a declarator declares, an array or one object, is qualified with `__eeprom`."""
    while isinstance(declarator, c_ast.ArrayDecl):
        declarator = declarator.type
    return EEPROM in (getattr(declarator, "quals", None) or [])


def _qualified(analyser: Analyser, kind: CType, declarator: Any, variable: bool) -> CType:
    """Return a type with the qualifiers of its declarator; `__eeprom` is only allowed for a variable."""
    quals = declarator.quals or []
    if EEPROM in quals and not variable:
        raise analyser.fail(
            "c-type",
            "only a variable can be in the EEPROM, not a member, parameter, result or type",
            declarator if declarator.coord else declarator.type,
        )
    return qualified(kind, const="const" in quals, volatile="volatile" in quals)


def _array(analyser: Analyser, node: Any, variable: bool) -> CType:
    """Return the type of an array declarator (ISO C 6.7.6.2)."""
    element = declared_type(analyser, node.type, variable=variable)
    if isinstance(element, IntType) and element.is_bit:
        raise analyser.fail("c-type", "there are no arrays of bits", node)
    if isinstance(element, StructType) and element.layout.size is None:
        raise analyser.fail("c-undefined", f"'{element}' is not defined", node)
    if isinstance(element, VoidType) or (isinstance(element, ArrayType) and element.length is None):
        raise analyser.fail("c-type", f"an array of '{element}' has no size", node)
    if node.dim is None:
        return ArrayType(element, None)
    length = constant(analyser, node.dim, "the size of an array")
    if length < 1:
        raise analyser.fail("c-type", f"an array needs at least one element, not {length}", node)
    return sized(analyser, ArrayType(element, length), node)


def sized(analyser: Analyser, kind: ArrayType, node: Any) -> ArrayType:
    """Return the same type if some memory of the chip could hold it."""
    if kind.size > PROGRAM_WORDS:
        raise analyser.fail(
            "program-too-large", f"an array of {kind.size} bytes is larger than the chip's memory", node
        )
    return kind


def specified(analyser: Analyser, node: Any, where: Any) -> CType:
    """Return the type that a declaration's specifiers name (ISO C 6.7.2)."""
    match node:
        case c_ast.IdentifierType(names=names):
            return _named(analyser, tuple(names), node)
        case c_ast.Struct() | c_ast.Union() | c_ast.Enum():
            # declarators that share a specifier share its node: it is read once
            if node not in analyser.types_read:
                structure = not isinstance(node, c_ast.Enum)
                analyser.types_read[node] = (
                    StructType(_structure(analyser, node)) if structure else _enumeration(analyser, node)
                )
            return analyser.types_read[node]
    raise analyser.fail("c-unsupported", "this type is not supported", where)


def declare_tag(analyser: Analyser, node: Any) -> None:
    """Analyse a declaration without a declarator; `struct s;` begins a new type in its block (ISO C
    6.7.2.3).
    """
    if isinstance(node, (c_ast.Struct, c_ast.Union)) and node.decls is None:
        analyser.scopes.here.tags.setdefault(
            node.name, StructLayout(node.name, isinstance(node, c_ast.Union))
        )
    declared_type(analyser, node)


def _named(analyser: Analyser, names: tuple[str, ...], node: Any) -> CType:
    """Return the type of one or several type names."""
    if names == ("void",):
        return VOID
    if names in (("float",), ("double",), ("long", "double"), ("double", "long")):
        return analyser.float_type
    if names.count("long") > 1 or (len(names) == 1 and names[0] in WIDE_TYPES):
        raise analyser.fail(
            "c-unsupported", "64-bit integers are not supported", node, hint="the widest type is 32 bits"
        )
    integer = int_type(names, analyser.dialect)
    if integer is not None:
        return integer
    if len(names) == 1:
        meaning = analyser.scopes.find(names[0])
        if isinstance(meaning, TypeName):
            return meaning.type
        if names[0] in analyser.types:
            return analyser.types[names[0]]
        register = names[0].removesuffix("bits_t")
        if register in chip_registers():
            return StructType(register_layout(register))
    raise analyser.fail("c-type", f"'{' '.join(names)}' is not a type", node)


def _structure(analyser: Analyser, node: Any) -> StructLayout:
    """Return the layout of a structure or union; without a body it may be completed later (ISO C 6.7.2.3)."""
    union = isinstance(node, c_ast.Union)
    tag = node.name or f"(unnamed {analyser.place(node).line})"
    if node.decls is None:
        earlier = analyser.scopes.tag(tag)
        if isinstance(earlier, StructLayout):
            return earlier
        layout = StructLayout(tag, union)
        analyser.scopes.here.tags[tag] = layout
        return layout
    # two without a name are two types, on one line too
    tags = analyser.scopes.here.tags if node.name else {}
    known = tags.get(tag)
    layout = known if isinstance(known, StructLayout) and known.size is None else StructLayout(tag, union)
    if known is layout or tag not in tags:
        tags[tag] = layout
    else:
        raise analyser.fail("c-redeclared", f"'{tag}' is defined twice", node)
    _members(analyser, layout, node.decls)
    if layout.size == 0:
        kind = "union" if union else "structure"
        analyser.reporter.error("c-type", f"a {kind} needs a member", analyser.place(node))
        layout.size = 1  # its uses are not reported too
    return layout


def _members(analyser: Analyser, layout: StructLayout, decls: list[Any]) -> None:
    """Add the members of a structure to its layout (ISO C 6.7.2.1); bit-fields of up to 8 bits do not cross
    bytes.
    """
    offset, bit, largest = 0, 0, 0
    for decl in decls:
        if not isinstance(decl, c_ast.Decl):
            continue
        kind = declared_type(analyser, decl.type)
        width = (
            constant(analyser, decl.bitsize, "the width of a bit-field") if decl.bitsize is not None else 0
        )
        is_field = decl.bitsize is not None
        if isinstance(kind, IntType) and kind.is_bit and not is_field:
            width, is_field = 1, True
        if is_field:
            if not isinstance(kind, IntType) or not 0 <= width <= min(MAX_FIELD, 8 * kind.size):
                # the structure is read to its end, so that its members are known
                widest = min(MAX_FIELD, 8 * kind.size) if isinstance(kind, IntType) else MAX_FIELD
                analyser.reporter.error(
                    "c-bit", f"a bit-field has 1 to {widest} bits of an integer type", analyser.place(decl)
                )
                kind, width = U8, 8
            if width > 8:
                offset, bit = _wide_field(analyser, layout, decl, kind, width, offset + (bit > 0))
                largest = max(largest, offset + (bit > 0))
                if layout.union:
                    offset = bit = 0
                continue
            # a field of width 0 ends the byte (ISO C 6.7.2.1); no field crosses one
            if width == 0 or bit + width > 8:
                offset, bit = offset + (bit > 0), 0
            if width == 0:
                continue
            small = qualified(
                _field_type(analyser, kind, width),
                const=kind.const,
                volatile=kind.volatile,
            )
            if decl.name is not None:
                layout.members[decl.name] = Member(decl.name, small, offset, bit, width)
                layout.parts.append(layout.members[decl.name])
            bit += width
            largest = max(largest, offset + 1)
            if layout.union:
                bit = 0
            continue
        # a member that is not a bit-field begins with a byte of its own
        if bit:
            offset, bit = offset + 1, 0
        if kind.size == 0 or isinstance(kind, (FuncType, VoidType)):
            raise analyser.fail("c-type", f"a member cannot be of type '{kind}'", decl)
        # the members of an unnamed structure belong to the outer one (ISO C 6.7.2.1)
        if decl.name is None and isinstance(kind, StructType) and decl.type.name is None:
            for name, member in kind.layout.members.items():
                layout.members[name] = replace(member, offset=offset + member.offset)
            layout.parts.append(Member("", kind, offset))
        elif decl.name is None:
            continue  # a tag or enumeration constants
        elif decl.name in layout.members:
            raise analyser.fail("c-redeclared", f"duplicate member '{decl.name}'", decl)
        else:
            layout.members[decl.name] = Member(decl.name, kind, offset)
            layout.parts.append(layout.members[decl.name])
        largest = max(largest, offset + kind.size)
        if not layout.union:
            offset += kind.size
    if largest > PROGRAM_WORDS:
        raise analyser.fail(
            "program-too-large", f"a structure of {largest} bytes is larger than the chip's memory", decls[0]
        )
    layout.size = largest


MAX_FIELD = 16
"""Bits of a bit-field."""


def _field_type(analyser: Analyser, kind: IntType, width: int) -> CType:
    """Return the type of a bit-field of up to 8 bits: `bool` converts, `unsigned : 1` keeps one bit."""
    if kind.is_bool:
        return kind
    if kind.signed:
        return analyser.types["int8_t"]
    return BIT if width == 1 else U8


def _wide_field(
    analyser: Analyser, layout: StructLayout, decl: Any, kind: IntType, width: int, offset: int
) -> tuple[int, int]:
    """Add a bit-field of more than 8 bits, which begins with a byte; return the byte and bit after it."""
    two = analyser.types["int16_t" if kind.signed else "uint16_t"]
    member = qualified(two, const=kind.const, volatile=kind.volatile)
    if decl.name is not None:
        layout.members[decl.name] = Member(decl.name, member, offset, 0, width if width < MAX_FIELD else 0)
        layout.parts.append(layout.members[decl.name])
    return (offset + 1, width - 8) if width < MAX_FIELD else (offset + 2, 0)


def _enumeration(analyser: Analyser, node: Any) -> CType:
    """Declare the constants of an enumeration, and return the narrowest type for them (ISO C 6.7.2.2)."""
    if node.values is None:
        known = analyser.scopes.tag(node.name)
        if not isinstance(known, TypeName):
            raise analyser.fail("c-undefined", f"'enum {node.name}' is not defined", node)
        return known.type
    value, values = -1, []
    for enumerator in node.values.enumerators:
        # the names of masks are known only inside __CONFIG(…)
        analyser.reading_config = enumerator.name.startswith(CONFIG_NAME)
        value = (
            constant(analyser, enumerator.value, "an enumeration constant")
            if enumerator.value is not None
            else value + 1
        )
        kind = (
            analyser.int_type
            if -32768 <= value <= 32767
            else analyser.literal_type(value & 0xFFFFFFFF, "", False)
        )
        enter_name(analyser, enumerator.name, Constant(value, kind), enumerator)
        values.append(value)
        if not -32768 <= value <= 65535 or (value > 32767 and min(values) < 0):
            raise analyser.fail(
                "c-number",
                f"the enumeration constant '{enumerator.name}' is {value}",
                enumerator,
                hint="an enumeration holds 0 to 65535 or -32768 to 32767",
            )
    analyser.reading_config = False
    chosen: CType = U8
    if not all(0 <= number <= 255 for number in values):
        chosen = analyser.types["uint16_t"] if max(values) > 32767 else analyser.int_type
    if node.name:
        analyser.scopes.here.tags[node.name] = TypeName(chosen)
    return chosen


def enter_name(analyser: Analyser, name: str, meaning: Any, node: Any) -> None:
    """Declare a name in the current scope; a typedef may be repeated (ISO C 6.7)."""
    if name in analyser.scopes.here.names:
        before = analyser.scopes.here.names[name]
        if isinstance(before, TypeName) and isinstance(meaning, TypeName) and same(before.type, meaning.type):
            return
        where = getattr(before, "place", None)
        raise analyser.fail(
            "c-redeclared", f"'{name}' is already declared", node, hint=f"at {where}" if where else None
        )
    analyser.scopes.here.names[name] = meaning


def _parameters(analyser: Analyser, node: Any) -> tuple[CType, ...] | None:
    """Return the types of a function's parameters; an array and a function become pointers (ISO C 6.7.6.3).
    None if none are declared.
    """
    if node.args is None:
        return None
    params = node.args.params
    unnamed = len(params) == 1 and isinstance(params[0], c_ast.Typename) and params[0].name is None
    if unnamed and isinstance(declared_type(analyser, params[0]), VoidType):
        return ()
    parameters = []
    for param in params:
        if isinstance(param, c_ast.EllipsisParam):
            raise analyser.fail("c-unsupported", "functions with '...' parameters are not supported", param)
        if isinstance(param, c_ast.ID):
            parameters.append(analyser.types["uint16_t"] if analyser.c2c else analyser.int_type)
            continue
        kind = declared_type(analyser, param)
        if isinstance(kind, ArrayType):
            kind = PointerType(kind.element)
        if isinstance(kind, FuncType):
            kind = PointerType(kind)
        if isinstance(kind, StructType) and kind.layout.size is None:
            raise analyser.fail("c-undefined", f"'{kind}' is not defined", param)
        if isinstance(kind, VoidType):
            raise analyser.fail("c-type", f"a parameter cannot be of type '{kind}'", param)
        parameters.append(kind)
    return tuple(parameters)
