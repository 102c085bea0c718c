"""Semantic analysis of types: declarators, structures, enumerations.

In: pycparser declarators. Out: types; tags and enumeration constants go into the scopes.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from pycparser import c_ast

from servogen.compiler.ctypes import (
    BIT,
    U8,
    VOID,
    ArrayType,
    CType,
    FuncType,
    IntType,
    Layout,
    Member,
    PointerType,
    StructType,
    VoidType,
    qualified,
    same,
)
from servogen.compiler.dialect import int_type
from servogen.compiler.expressions import Expressions
from servogen.compiler.program import ExprStmt, Function
from servogen.compiler.rewrite import CONFIG_NAME
from servogen.compiler.scopes import Constant, TypeName
from servogen.compiler.tree import Symbol
from servogen.pic.device import PROGRAM_WORDS


class TypeNames(Expressions):
    """Adds `declared_type`."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.externals: dict[str, Symbol | Function] = {}
        self._read: dict[Any, CType] = {}
        self._defined: set[Function] = set()
        self.pending: list[ExprStmt] = []
        """Initialisations of the locals being declared."""

    def declared_type(self, node: Any) -> CType:
        """The type of a declarator or type name."""
        match node:
            case c_ast.Typename() | c_ast.Decl() | c_ast.Typedef():
                return self.declared_type(node.type)
            case c_ast.TypeDecl():
                base = self._specified(node.type, node)
                return self._qualified(base, node.quals or [])
            case c_ast.PtrDecl():
                target = self.declared_type(node.type)
                if isinstance(target, FuncType):
                    raise self.fail("function pointers are not supported", node)
                if isinstance(target, IntType) and target.is_bit:
                    raise self.fail("there are no pointers to bits", node)
                return self._qualified(PointerType(target), node.quals or [])
            case c_ast.ArrayDecl():
                return self._array(node)
            case c_ast.Struct() | c_ast.Union() | c_ast.Enum():
                return self._specified(node, node)
            case c_ast.FuncDecl():
                return FuncType(self.declared_type(node.type), self._parameters(node))
        raise self.fail("this type is not supported", node)

    def _qualified(self, kind: CType, quals: list[str]) -> CType:
        return qualified(kind, const="const" in quals, volatile="volatile" in quals)

    def _array(self, node: Any) -> CType:
        element = self.declared_type(node.type)
        if isinstance(element, IntType) and element.is_bit:
            raise self.fail("there are no arrays of bits", node)
        if isinstance(element, StructType) and element.layout.size is None:
            raise self.fail(f"'{element}' is not defined", node)
        if isinstance(element, VoidType) or (isinstance(element, ArrayType) and element.length is None):
            raise self.fail(f"an array of '{element}' has no size", node)
        if node.dim is None:
            return ArrayType(element, None)
        length = self.constant(node.dim, "the size of an array")
        if length < 1:
            raise self.fail(f"an array needs at least one element, not {length}", node)
        return self.sized(ArrayType(element, length), node)

    def sized(self, kind: ArrayType, node: Any) -> ArrayType:
        """The same type, if any memory of the chip could hold it."""
        if kind.size > PROGRAM_WORDS:
            raise self.fail(f"an array of {kind.size} bytes is larger than the chip's memory", node)
        return kind

    def _specified(self, node: Any, where: Any) -> CType:
        match node:
            case c_ast.IdentifierType(names=names):
                return self._named(tuple(names), node)
            case c_ast.Struct() | c_ast.Union() | c_ast.Enum():
                # declarators that share a specifier share its node: it is read once
                if node not in self._read:
                    structure = not isinstance(node, c_ast.Enum)
                    self._read[node] = (
                        StructType(self._structure(node)) if structure else self._enumeration(node)
                    )
                return self._read[node]
        raise self.fail("this type is not supported", where)

    def _named(self, names: tuple[str, ...], node: Any) -> CType:
        if names == ("void",):
            return VOID
        if any(name in ("float", "double") for name in names):
            raise self.fail("this compiler has no floating point", node, hint="use scaled integers")
        if names.count("long") > 1:
            raise self.fail("64-bit integers are not supported", node, hint="the widest type is 32 bits")
        found = int_type(names, self.dialect)
        if found is not None:
            return found
        if len(names) == 1:
            meaning = self.scopes.find(names[0])
            if isinstance(meaning, TypeName):
                return meaning.type
            if names[0] in self.types:
                return self.types[names[0]]
        if len(names) == 2 and names[0] == "unsigned" and names[1] in ("bit", "__bit"):
            return BIT
        raise self.fail(f"'{' '.join(names)}' is not a type", node)

    def _structure(self, node: Any) -> Layout:
        union = isinstance(node, c_ast.Union)
        tag = node.name or f"(unnamed {self.place(node).line})"
        if node.decls is None:
            found = self.scopes.tag(tag)
            if isinstance(found, Layout):
                return found
            layout = Layout(tag, union)
            self.scopes.here.tags[tag] = layout
            return layout
        # two without a name are two types, on one line too
        tags = self.scopes.here.tags if node.name else {}
        known = tags.get(tag)
        layout = known if isinstance(known, Layout) and known.size is None else Layout(tag, union)
        if known is layout or tag not in tags:
            tags[tag] = layout
        else:
            raise self.fail(f"'{tag}' is defined twice", node)
        self._members(layout, node.decls)
        return layout

    def _members(self, layout: Layout, decls: list[Any]) -> None:
        offset, bit, largest = 0, 0, 0
        for decl in decls:
            if not isinstance(decl, c_ast.Decl):
                continue
            kind = self.declared_type(decl.type)
            width = self.constant(decl.bitsize, "the width of a bit-field") if decl.bitsize is not None else 0
            is_field = decl.bitsize is not None
            if isinstance(kind, IntType) and kind.is_bit and not is_field:
                width, is_field = 1, True
            if is_field:
                if not isinstance(kind, IntType) or not 0 <= width <= 8:
                    # the structure is read to its end, so that its members are known
                    self.reporter.error("a bit-field has 1 to 8 bits of an integer type", self.place(decl))
                    kind, width = U8, 8
                if width == 0 or bit + width > 8:
                    offset, bit = offset + (bit > 0), 0
                if width == 0:
                    continue
                small = qualified(
                    self.types["int8_t"] if kind.signed else BIT if width == 1 else U8,
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
            if bit:
                offset, bit = offset + 1, 0
            if kind.size == 0 or isinstance(kind, (FuncType, VoidType)):
                raise self.fail(f"a member cannot be of type '{kind}'", decl)
            if decl.name is None and isinstance(kind, StructType):
                for name, member in kind.layout.members.items():
                    layout.members[name] = replace(member, offset=offset + member.offset)
                layout.parts.append(Member("", kind, offset))
            elif decl.name is None:
                continue  # `int;` declares nothing
            elif decl.name in layout.members:
                raise self.fail(f"the member '{decl.name}' is there twice", decl)
            else:
                layout.members[decl.name] = Member(decl.name, kind, offset)
                layout.parts.append(layout.members[decl.name])
            largest = max(largest, offset + kind.size)
            if not layout.union:
                offset += kind.size
        if largest > PROGRAM_WORDS:
            raise self.fail(f"a structure of {largest} bytes is larger than the chip's memory", decls[0])
        layout.size = largest

    def _enumeration(self, node: Any) -> CType:
        if node.values is None:
            found = self.scopes.tag(node.name)
            if not isinstance(found, TypeName):
                raise self.fail(f"'enum {node.name}' is not defined", node)
            return found.type
        value, values = -1, []
        for each in node.values.enumerators:
            self.reading_config = each.name.startswith(CONFIG_NAME)
            value = (
                self.constant(each.value, "an enumeration constant") if each.value is not None else value + 1
            )
            kind = (
                self.int_type
                if -32768 <= value <= 32767
                else self.literal_type(value & 0xFFFFFFFF, "", False)
            )
            self._declare(each.name, Constant(value, kind), each)
            values.append(value)
            if not -32768 <= value <= 65535 or (value > 32767 and min(values) < 0):
                raise self.fail(
                    f"the enumeration constant '{each.name}' is {value}",
                    each,
                    hint="an enumeration holds 0 to 65535 or -32768 to 32767",
                )
        self.reading_config = False
        chosen: CType = U8
        if not all(0 <= each <= 255 for each in values):
            chosen = self.types["uint16_t"] if max(values) > 32767 else self.int_type
        if node.name:
            self.scopes.here.tags[node.name] = TypeName(chosen)
        return chosen

    def _declare(self, name: str, meaning: Any, node: Any) -> None:
        if name in self.scopes.here.names:
            before = self.scopes.here.names[name]
            if (
                isinstance(before, TypeName)
                and isinstance(meaning, TypeName)
                and same(before.type, meaning.type)
            ):
                return
            where = getattr(before, "place", None)
            raise self.fail(f"'{name}' is already declared", node, hint=f"at {where}" if where else None)
        self.scopes.here.names[name] = meaning

    def _parameters(self, node: Any) -> tuple[CType, ...] | None:
        if node.args is None:
            return None
        params = node.args.params
        unnamed = len(params) == 1 and isinstance(params[0], c_ast.Typename) and params[0].name is None
        if unnamed and isinstance(self.declared_type(params[0]), VoidType):
            return ()
        found = []
        for each in params:
            if isinstance(each, c_ast.EllipsisParam):
                raise self.fail("functions with '…' arguments are not supported", each)
            if isinstance(each, c_ast.ID):
                found.append(self.types["uint16_t"] if self.c2c else self.int_type)
                continue
            kind = self.declared_type(each)
            if isinstance(kind, ArrayType):
                kind = PointerType(kind.element)
            if isinstance(kind, StructType) and kind.layout.size is None:
                raise self.fail(f"'{kind}' is not defined", each)
            if isinstance(kind, (VoidType, FuncType)):
                raise self.fail(f"a parameter cannot be of type '{kind}'", each)
            found.append(kind)
        return tuple(found)
