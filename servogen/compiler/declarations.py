"""Semantic analysis of declarations: types, variables, initialisers, functions' signatures.

In: pycparser declarations. Out: symbols and functions in the program, names in the scopes.
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
    is_const_object,
    same,
)
from servogen.compiler.dialect import int_type
from servogen.compiler.expressions import Expressions
from servogen.compiler.rewrite import CONFIG_NAME
from servogen.compiler.scopes import Constant, TypeName
from servogen.compiler.tree import (
    AddressByte,
    AddressOf,
    Assign,
    Binary,
    Cast,
    Data,
    Expr,
    ExprStmt,
    Function,
    Num,
    Ref,
    Symbol,
)
from servogen.errors import Place
from servogen.pic.device import RAM_FIRST, RAM_LAST


class Declarations(Expressions):
    """Adds types, variables and signatures."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.externals: dict[str, Symbol | Function] = {}
        self._read: dict[Any, CType] = {}
        self._defined: set[Function] = set()
        self.pending: list[ExprStmt] = []
        """Initialisations of the locals being declared."""

    # types

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
        raise self.fail(f"this type is not supported ({type(node).__name__})", node)

    def _qualified(self, kind: CType, quals: list[str]) -> CType:
        const, volatile = "const" in quals, "volatile" in quals
        if isinstance(kind, ArrayType) and (const or volatile):
            return replace(kind, element=self._qualified(kind.element, quals))
        if const or volatile:
            return replace(kind, const=kind.const or const, volatile=kind.volatile or volatile)
        return kind

    def _array(self, node: Any) -> CType:
        element = self.declared_type(node.type)
        if isinstance(element, IntType) and element.is_bit:
            raise self.fail("there are no arrays of bits", node)
        if isinstance(element, VoidType) or (isinstance(element, ArrayType) and element.length is None):
            raise self.fail(f"an array of '{element}' has no size", node)
        if node.dim is None:
            return ArrayType(element, None)
        length = self.constant(node.dim, "the size of an array")
        if length < 1:
            raise self.fail(f"an array needs at least one element, not {length}", node)
        return ArrayType(element, length)

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
        known = self.scopes.here.tags.get(tag)
        layout = known if isinstance(known, Layout) and known.size is None else Layout(tag, union)
        if known is layout or tag not in self.scopes.here.tags:
            self.scopes.here.tags[tag] = layout
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
                    raise self.fail("a bit-field has 1 to 8 bits of an integer type", decl)
                if width == 0 or bit + width > 8:
                    offset, bit = offset + (bit > 0), 0
                if width == 0:
                    continue
                small = (
                    BIT
                    if width == 1 and not kind.signed
                    else (U8 if not kind.signed else self.types["int8_t"])
                )
                if decl.name is not None:
                    layout.members[decl.name] = Member(decl.name, small, offset, bit, width)
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
            elif decl.name in layout.members:
                raise self.fail(f"the member '{decl.name}' is there twice", decl)
            else:
                layout.members[decl.name] = Member(decl.name, kind, offset)
            largest = max(largest, offset + kind.size)
            if not layout.union:
                offset += kind.size
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
        self.reading_config = False
        small = all(0 <= each <= 255 for each in values)
        chosen = U8 if small else self.int_type
        if node.name:
            self.scopes.here.tags[node.name] = TypeName(chosen)
        return chosen

    # names

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

    def declare(self, node: Any) -> None:
        """One declaration, at file level or in a block; locals' initialisers go to `pending`."""
        if isinstance(node, c_ast.Typedef):
            self._declare(node.name, TypeName(self.declared_type(node.type)), node)
            return
        kind = self.declared_type(node.type)
        if node.name is None:
            return
        place = self.place(node)
        if isinstance(kind, FuncType):
            self.declare_function(node, kind)
            return
        kind = self._complete(kind, node)
        if isinstance(kind, VoidType):
            raise self.fail(f"'{node.name}' cannot be of type void", node)
        if isinstance(kind, StructType) and kind.layout.size is None:
            raise self.fail(f"'{kind}' is not defined", node)
        storage = node.storage or []
        static = "static" in storage
        address = self.addresses.get((place.file, place.line, place.column))
        if self.scopes.file_level:
            self._global(node, kind, static, "extern" in storage, address)
        elif "extern" in storage:
            known = self.externals.get(node.name)
            if not isinstance(known, Symbol):
                known = self._new_global(node.name, kind, place, address)
                self.externals[node.name] = known
            self._declare(node.name, known, node)
        else:
            self._local(node, kind, static, address)

    def _complete(self, kind: CType, node: Any) -> CType:
        """An array without a length takes it from its initialiser."""
        if not isinstance(kind, ArrayType) or kind.length is not None:
            return kind
        init = node.init
        if isinstance(init, c_ast.InitList):
            length, at = 0, 0
            for each in init.exprs:
                if isinstance(each, c_ast.NamedInitializer):
                    designator = each.name[0]
                    inner = getattr(designator, "expr", designator)
                    at = self.constant(inner, "an index")
                at += 1
                length = max(length, at)
            if (
                isinstance(kind.element, ArrayType)
                and init.exprs
                and not isinstance(init.exprs[0], (c_ast.InitList, c_ast.NamedInitializer, c_ast.Constant))
            ):
                length = -(-length // (kind.element.length or 1))
            return replace(kind, length=max(length, 1))
        if isinstance(init, c_ast.Constant) and init.type == "string":
            return replace(kind, length=len(self.characters(init.value, self.place(init))) + 1)
        if "extern" in (node.storage or []):
            known = self.externals.get(node.name)
            return known.type if isinstance(known, Symbol) else kind
        raise self.fail(f"the size of the array '{node.name}' is missing", node)

    def _new_global(self, name: str, kind: CType, place: Place, address: int | None) -> Symbol:
        where = "fixed" if address is not None else "flash" if is_const_object(kind) else "global"
        symbol = Symbol(name, kind, where, place, address=address, asm_name=f"_{name}")
        symbol.volatile = kind.volatile or (address is not None and not RAM_FIRST <= address <= RAM_LAST)
        if address is not None:
            symbol.pinned = True
            symbol.bank1 = bool(address & 0x80) and not RAM_FIRST <= address & 0x7F <= RAM_LAST
            if not 0 <= address <= 0xFF:
                self.reporter.error(f"the address 0x{address:X} is not in the data memory (0x00-0xFF)", place)
        if isinstance(kind, ArrayType):
            element: CType = kind
            while isinstance(element, ArrayType):
                element = element.element
            symbol.volatile = element.volatile
        self.program.symbols.append(symbol)
        return symbol

    def _global(self, node: Any, kind: CType, static: bool, extern: bool, address: int | None) -> None:
        place, name = self.place(node), node.name
        known = self.scopes.here.names.get(name)
        if known is None and not static:
            known = self.externals.get(name)
            if known is not None:
                self.scopes.here.names[name] = known
        if known is not None:
            if not isinstance(known, Symbol) or not same(known.type, kind):
                raise self.fail(
                    f"'{name}' is already declared", node, hint=f"at {getattr(known, 'place', '')}"
                )
            if isinstance(known.type, ArrayType) and known.type.length is None:
                known.type = kind
            symbol = known
        else:
            symbol = self._new_global(name, kind, place, address)
            self.scopes.here.names[name] = symbol
            if not static:
                self.externals[name] = symbol
        self.asm_symbols[f"_{name}"] = symbol
        if node.init is not None:
            if symbol.initial is not None:
                raise self.fail(f"'{name}' is initialised twice", node)
            symbol.initial = {}
            self.initialise(symbol.initial, kind, node.init, 0)
        elif symbol.kind == "flash" and not extern and symbol.initial is None:
            self.reporter.warn(f"the constant '{name}' has no value; it is 0", place)
            symbol.initial = {}

    def _local(self, node: Any, kind: CType, static: bool, address: int | None) -> None:
        assert self.function is not None
        place, name = self.place(node), node.name
        constant = is_const_object(kind) and node.init is not None
        if static or address is not None or (constant and isinstance(kind, (ArrayType, StructType))):
            symbol = self._new_global(name, kind, place, address)
            symbol.function = self.function.name
            self._declare(name, symbol, node)
            symbol.initial = {} if node.init is not None or symbol.kind == "flash" else None
            if node.init is not None:
                assert symbol.initial is not None
                self.initialise(symbol.initial, kind, node.init, 0)
        else:
            if constant and kind.scalar and self._constant_local(node, kind, place):
                return
            symbol = Symbol(name, kind, "local", place, function=self.function.name)
            symbol.volatile = kind.volatile
            symbol.pinned = isinstance(kind, (ArrayType, StructType))
            self._declare(name, symbol, node)
            self.function.locals.append(symbol)
            if node.init is not None:
                self._initialise_local(symbol, node)
        symbol.asm_name = f"_{name}_{self.function.name}"
        self.asm_symbols[symbol.asm_name] = symbol

    def _constant_local(self, node: Any, kind: CType, place: Place) -> bool:
        """`const int n = 5;` in a block is the number itself."""
        value = self.convert(self.expr(node.init), kind, "the initialiser")
        if not isinstance(value, Num) or not isinstance(kind, IntType):
            return False
        symbol = self._new_global(node.name, kind, place, None)
        symbol.function = self.function.name if self.function else None
        symbol.initial = {each: value.value >> 8 * each & 0xFF for each in range(kind.size)}
        self._declare(node.name, symbol, node)
        return True

    def _initialise_local(self, symbol: Symbol, node: Any) -> None:
        kind = replace(symbol.type, const=False) if symbol.type.const else symbol.type
        place = self.place(node)
        if isinstance(kind, (ArrayType, StructType)) and (
            isinstance(node.init, c_ast.InitList) or isinstance(kind, ArrayType)
        ):
            self._fill(symbol, kind, node.init, 0, place)
            return
        init = node.init.exprs[0] if isinstance(node.init, c_ast.InitList) else node.init
        value = self.convert(self.expr(init), kind, "the initialiser")
        target = self.use(symbol, place)
        assert isinstance(target, Ref)
        target.type = kind
        self.pending.append(ExprStmt(Assign(target, value, kind, place)))

    def _fill(self, symbol: Symbol, kind: CType, init: Any, offset: int, place: Place) -> None:
        """Assignments for an array or structure in RAM whose initialiser may not be constant."""
        leaves: list[tuple[int, CType, Any]] = []
        self._leaves(kind, init, offset, leaves)
        given = {at: (leaf, value) for at, leaf, value in leaves}
        for at, leaf in _scalars(kind, offset):
            found = given.get(at)
            place_here = self.place(found[1]) if found and not isinstance(found[1], int) else place
            if found is None:
                value: Expr = Num(0, leaf, place)
            elif isinstance(found[1], int):
                value = Num(found[1], leaf, place)
            else:
                value = self.convert(self.expr(found[1]), leaf, "the initialiser")
            target = Ref(symbol, at, None, leaf.plain(), place_here)
            self.pending.append(ExprStmt(Assign(target, value, leaf.plain(), place_here)))

    def initialise(self, data: dict[int, Data], kind: CType, init: Any, offset: int) -> None:
        """The bytes of a constant initialiser."""
        leaves: list[tuple[int, CType, Any]] = []
        self._leaves(kind, init, offset, leaves)
        for at, leaf, value in leaves:
            if isinstance(value, int):
                data[at] = value & 0xFF
                continue
            expr = self.convert(self.expr(value), leaf, "the initialiser")
            for number, byte in enumerate(self._bytes(expr, leaf.size, value)):
                data[at + number] = byte

    def _bytes(self, expr: Expr, size: int, node: Any) -> list[Data]:
        while (
            isinstance(expr, Cast)
            and expr.type.size <= expr.operand.type.size
            and not isinstance(expr.type, VoidType)
        ):
            expr = expr.operand
        if isinstance(expr, Num):
            return [expr.value >> 8 * each & 0xFF for each in range(size)]
        if isinstance(expr, Cast) and isinstance(expr.operand, AddressOf):
            expr = expr.operand
        if isinstance(expr, Binary) and isinstance(expr.left, AddressOf) and isinstance(expr.right, Num):
            move = expr.right.value if expr.op == "+" else -expr.right.value
            target = expr.left.target
            expr = AddressOf(
                Ref(target.symbol, target.offset + move, target.index, target.type, target.place),
                expr.type,
                expr.place,
            )
        if isinstance(expr, AddressOf) and expr.target.index is None:
            target = expr.target
            return [AddressByte(target.symbol, target.offset, part) for part in range(size)]
        raise self.fail("the initialiser must be a constant", node)

    def _leaves(self, kind: CType, init: Any, offset: int, out: list[tuple[int, CType, Any]]) -> None:
        """The scalars of an initialiser as (offset, type, node or byte), braces left out or not."""
        if isinstance(kind, ArrayType) and isinstance(kind.element, IntType) and kind.element.size == 1:
            inner = init
            if isinstance(init, c_ast.InitList) and len(init.exprs) == 1:
                inner = init.exprs[0]
            if isinstance(inner, c_ast.Constant) and inner.type == "string":
                values = self.characters(inner.value, self.place(inner))
                length = kind.length or 0
                if len(values) > length:
                    raise self.fail(f"the string of {len(values)} characters does not fit {length}", inner)
                out += [(offset + at, kind.element, value) for at, value in enumerate([*values, 0][:length])]
                return
        if isinstance(kind, (ArrayType, StructType)):
            if not isinstance(init, c_ast.InitList):
                raise self.fail(f"'{kind}' needs an initialiser in braces", init)
            items = list(init.exprs)
            self._aggregate(kind, items, offset, out, braced=True)
            if items:
                raise self.fail(f"too many initialisers for '{kind}'", items[0])
            return
        if isinstance(init, c_ast.InitList):
            if len(init.exprs) != 1:
                raise self.fail(f"'{kind}' takes one initialiser, {len(init.exprs)} are given", init)
            init = init.exprs[0]
        out.append((offset, kind, init))

    def _aggregate(
        self,
        kind: ArrayType | StructType,
        items: list[Any],
        offset: int,
        out: list[tuple[int, CType, Any]],
        *,
        braced: bool,
    ) -> None:
        """Take from `items` what the elements of one array or structure need."""
        slots: list[tuple[int, CType]] = _elements(kind)
        names = list(kind.layout.members) if isinstance(kind, StructType) else []
        if isinstance(kind, StructType) and kind.layout.union:
            slots = slots[:1]
        at = 0
        while items and (at < len(slots) or isinstance(items[0], c_ast.NamedInitializer)):
            item = items[0]
            if isinstance(item, c_ast.NamedInitializer):
                if not braced:
                    return
                at = self._designated(kind, item, names)
                slots = _elements(kind)
                if at >= len(slots):
                    raise self.fail("this element does not exist", item)
                if len(item.name) > 1:
                    raise self.fail("nested designators are not supported", item)
                items[0] = item = item.expr
            where, element = slots[at]
            if (
                isinstance(element, (ArrayType, StructType))
                and not isinstance(item, c_ast.InitList)
                and not (isinstance(item, c_ast.Constant) and item.type == "string")
            ):
                self._aggregate(element, items, offset + where, out, braced=False)
            else:
                items.pop(0)
                if isinstance(element, IntType) and element.is_bit:
                    raise self.fail("bit-fields cannot be initialised; assign them", item)
                self._leaves(element, item, offset + where, out)
            at += 1

    def _designated(self, kind: CType, item: Any, names: list[str]) -> int:
        designator = item.name[0]
        inner = getattr(designator, "expr", designator)
        if isinstance(kind, StructType):
            if not isinstance(inner, c_ast.ID) or inner.name not in names:
                raise self.fail(f"'{kind}' has no such member", item)
            return names.index(inner.name)
        return self.constant(inner, "an index")

    # functions

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
            if isinstance(kind, (VoidType, FuncType)):
                raise self.fail(f"a parameter cannot be of type '{kind}'", each)
            found.append(kind)
        return tuple(found)

    def declare_function(self, node: Any, kind: FuncType, *, define: bool = False) -> Function:
        """A prototype, or the head of a definition."""
        name, place = node.name, self.place(node)
        static = "static" in (node.storage or [])
        known = self.scopes.find(name) if name in self.scopes.stack[0].names else None
        if known is None and not static:
            known = self.externals.get(name)
        if known is not None and not isinstance(known, Function):
            raise self.fail(f"'{name}' is already declared", node, hint=f"at {getattr(known, 'place', '')}")
        if known is None:
            mangled = name
            while mangled in self.program.functions:
                mangled += "'"
            known = Function(mangled, kind.result, self._parameter_symbols(node, kind, mangled), place)
            known.prototyped = kind.parameters is not None or define
            known.static = static
            known.interrupt = name in self.interrupts
            self.program.functions[mangled] = known
            if not static:
                self.externals[name] = known
        else:
            self._same_signature(known, kind, node, define=define)
        self.scopes.stack[0].names[name] = known
        if define:
            if known in self._defined:
                raise self.fail(
                    f"the function '{name}' is defined twice", node, hint=f"first at {known.place}"
                )
            self._defined.add(known)
            known.parameters = self._parameter_symbols(node, kind, known.name)
            known.place = place
            known.prototyped = True
        return known

    def _same_signature(self, known: Function, kind: FuncType, node: Any, *, define: bool) -> None:
        both = FuncType(
            known.result, tuple(each.type for each in known.parameters) if known.prototyped else None
        )
        if not same(both, kind):
            raise self.fail(
                f"'{node.name}' is declared differently before: '{both}', now '{kind}'",
                node,
                hint=f"the other declaration is at {known.place}",
            )

    def _parameter_symbols(self, node: Any, kind: FuncType, function: str) -> list[Symbol]:
        declarator = node.type
        while not isinstance(declarator, c_ast.FuncDecl):
            declarator = declarator.type
        names = list(declarator.args.params) if declarator.args is not None else []
        found = []
        for number, each in enumerate(kind.parameters or ()):
            name = getattr(names[number], "name", None) or f"argument{number + 1}"
            symbol = Symbol(name, each, "param", self.place(names[number]), function=function)
            symbol.asm_name = f"_{name}_{function}"
            symbol.pinned = isinstance(each, StructType)
            symbol.volatile = each.volatile
            found.append(symbol)
        return found


def _elements(kind: ArrayType | StructType) -> list[tuple[int, CType]]:
    """(offset, type) of each element or member."""
    if isinstance(kind, ArrayType):
        return [(number * kind.element.size, kind.element) for number in range(kind.length or 0)]
    return [(member.offset, member.type) for member in kind.layout.members.values()]


def _scalars(kind: CType, offset: int) -> list[tuple[int, CType]]:
    """(offset, type) of everything in an object that is not made of parts."""
    if isinstance(kind, StructType) and any(member.width for member in kind.layout.members.values()):
        return [(offset + each, U8) for each in range(kind.size)]
    if isinstance(kind, StructType) and kind.layout.union:
        return [(offset + each, U8) for each in range(kind.size)]
    if isinstance(kind, (ArrayType, StructType)):
        return [leaf for at, element in _elements(kind) for leaf in _scalars(element, offset + at)]
    return [(offset, kind)]
