"""Semantic analysis of declarations: variables and function signatures.

In: pycparser declarations. Out: symbols and functions in the program, names in the scopes.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from pycparser import c_ast

from servogen.compiler.ast import nodes as tree
from servogen.compiler.ast.types import (
    U8,
    ArrayType,
    CType,
    FloatType,
    FuncType,
    IntType,
    StructType,
    VoidType,
    holds_volatile,
    is_const_object,
    qualified,
    same,
)
from servogen.compiler.diagnostics import is_own_file
from servogen.compiler.frontend.dialects import SDCC
from servogen.compiler.frontend.extensions import EEPROM, BitAddress, FixedAddress, position
from servogen.compiler.sema.analyser import Analyser
from servogen.compiler.sema.conversions import convert
from servogen.compiler.sema.initialisers import complete, fill, initialise, is_constant, scalars
from servogen.compiler.sema.names import expression, use
from servogen.compiler.sema.scopes import BitAlias, TypeName
from servogen.compiler.sema.type_names import declare_tag, declared_type, enter_name, in_eeprom
from servogen.errors import Location
from servogen.pic.device import (
    CONFIG_ADDRESS,
    EEPROM_ADDRESS,
    EEPROM_BYTES,
    PROGRAM_WORDS,
    RAM_BYTES,
    RAM_FIRST,
    RAM_LAST,
    data_byte_exists,
    register_at,
)


def declare(analyser: Analyser, node: Any) -> None:
    """Analyse one declaration, at file level or in a block; initialisers of locals are added to `pending`."""
    if isinstance(node, c_ast.Typedef):
        enter_name(analyser, node.name, TypeName(declared_type(analyser, node.type)), node)
        return
    # `struct s { … };` declares a tag only
    if node.name is None:
        declare_tag(analyser, node.type)
        return
    kind = declared_type(analyser, node.type, variable=True)
    place = analyser.place(node)
    if node.align:
        analyser.reporter.warn("c-attribute", "the alignment is ignored", analyser.place(node.align[0]))
    if isinstance(kind, FuncType):
        declare_function(analyser, node, kind)
        return
    kind = complete(analyser, kind, node)
    if isinstance(kind, VoidType):
        raise analyser.fail("c-type", f"'{node.name}' cannot be of type void", node)
    if isinstance(kind, StructType) and kind.layout.size is None:
        raise analyser.fail("c-undefined", f"'{kind}' is not defined", node)
    storage = node.storage or []
    static = "static" in storage
    here = position(place, node.name)
    address = analyser.scopes.source.addresses.get(here)
    analyser.variables.add(here)
    if address is not None and isinstance(kind, IntType) and kind.is_bit:
        _bit_alias(analyser, node, address)
        return
    if isinstance(address, BitAddress):
        raise analyser.fail("c-address", "a fixed address must be a number", node)
    if analyser.scopes.file_level:
        _global(analyser, node, kind, static, "extern" in storage, address)
    elif "extern" in storage:
        known = analyser.externals.get(node.name)
        if isinstance(known, tree.Symbol) and same(known.type, kind):
            _redeclare(analyser, known, kind, node, address)
        elif known is None:
            known = _new_global(analyser, node, kind, address)
            analyser.externals[node.name] = known
        else:
            raise analyser.fail(
                "c-redeclared", f"'{node.name}' is already declared", node, hint=f"at {known.place}"
            )
        enter_name(analyser, node.name, known, node)
    else:
        _local(analyser, node, kind, static, address)


def _bit_alias(analyser: Analyser, node: Any, address: FixedAddress) -> None:
    """Declare a bit variable at a fixed address; a number counts bits, as in XC8 and SDCC: 8 * byte + bit."""
    if node.init is not None:
        raise analyser.fail(
            "c-initialiser", f"the bit '{node.name}' at a fixed address cannot be initialised", node
        )
    byte, bit = (
        (address.byte, address.bit) if isinstance(address, BitAddress) else (address // 8, address % 8)
    )
    place = analyser.place(node)
    if isinstance(byte, str):
        byte_symbol = analyser.scopes.find(byte)
        if not isinstance(byte_symbol, tree.Symbol):
            raise analyser.fail("c-undeclared", f"'{byte}' is not declared", node)
    else:
        register = register_at(byte)
        if register is not None:
            byte_symbol = analyser.scopes.register(register)
        else:
            byte_symbol = tree.Symbol(f"0x{byte:02X}", U8, "fixed", place)
            _fix(analyser, byte_symbol, byte, place)
            analyser.program.symbols.append(byte_symbol)
    if not 0 <= bit < 8 * byte_symbol.type.size:
        raise analyser.fail("c-bit", f"'{byte_symbol.type}' has no bit {bit}", node)
    byte_symbol.pinned = True
    enter_name(analyser, node.name, BitAlias(byte_symbol, bit, place), node)


def _new_global(analyser: Analyser, node: Any, kind: CType, address: int | None) -> tree.Symbol:
    """Return the symbol of a variable with static storage: in RAM, flash, EEPROM or at a fixed address."""
    name, place = node.name, analyser.place(node)
    if in_eeprom(node.type):
        if address is not None:
            raise analyser.fail("c-address", f"'{name}' in the EEPROM cannot have a fixed address", node)
        return _in_eeprom(analyser, name, kind, place)
    if address == CONFIG_ADDRESS:
        return _configuration(analyser, name, kind, place)
    if address is not None and is_const_object(kind) and address in EEPROM_IN_HEX:
        return _at_eeprom(analyser, name, kind, place, address - EEPROM_ADDRESS)
    where = "flash" if is_const_object(kind) else "global"
    symbol = tree.Symbol(name, kind, where, place, asm_name=f"_{name}")
    symbol.volatile = holds_volatile(kind)
    symbol.persistent = position(place, name) in analyser.scopes.source.persistent
    if symbol.persistent and (where == "flash" or node.init is not None):
        raise analyser.reporter.fatal(
            "c-initialiser", f"'{name}' keeps its value through a reset and cannot be initialised", place
        )
    if address is not None:
        _fix(analyser, symbol, address, place)
    if where == "flash" and symbol.volatile:
        raise analyser.reporter.fatal(
            "c-const", f"the constant '{name}' cannot have a volatile member", place
        )
    analyser.program.symbols.append(symbol)
    return symbol


EEPROM_IN_HEX = range(EEPROM_ADDRESS, EEPROM_ADDRESS + EEPROM_BYTES)
"""The addresses at which a HEX file, and a constant in SDCC's C, holds the EEPROM."""


def _at_eeprom(analyser: Analyser, name: str, kind: CType, place: Location, first: int) -> tree.Symbol:
    """Return the symbol of a constant that lies in the EEPROM from byte `first` on."""
    symbol = tree.Symbol(name, kind, "eeprom", place, address=first)
    symbol.initial = {}
    analyser.program.symbols.append(symbol)
    return symbol


def _in_eeprom(analyser: Analyser, name: str, kind: CType, place: Location) -> tree.Symbol:
    """Return the symbol of a variable in the EEPROM, behind those declared before it."""
    symbol = tree.Symbol(name, kind, "eeprom", place, address=analyser.eeprom_used)
    symbol.initial = {}
    analyser.eeprom_used += kind.size
    if analyser.eeprom_used > EEPROM_BYTES:
        raise analyser.reporter.fatal(
            "program-too-large",
            f"'{name}' ends at byte {analyser.eeprom_used} of the EEPROM, which has {EEPROM_BYTES}",
            place,
        )
    analyser.program.symbols.append(symbol)
    return symbol


def _fix(analyser: Analyser, symbol: tree.Symbol, address: int, place: Location) -> None:
    """Assign a fixed address to a variable, or to a constant: that of a word of the program memory."""
    if symbol.kind == "flash":
        symbol.address = address
        _check_in_flash(analyser, symbol.name, address, symbol.size, place)
        return
    symbol.kind, symbol.address, symbol.pinned = "fixed", address, True
    in_ram = RAM_FIRST <= address & 0x7F <= RAM_LAST
    symbol.volatile = symbol.volatile or not RAM_FIRST <= address <= RAM_LAST
    symbol.bank1 = bool(address & 0x80) and not in_ram
    size = symbol.size
    if not 0 <= address <= 0xFF:
        analyser.reporter.error(
            "c-address", f"the address 0x{address:X} is not in the data memory (0x00-0xFF)", place
        )
    elif not all(data_byte_exists(address + index) for index in range(size)):
        analyser.reporter.error(
            "c-address",
            f"there is no memory at 0x{address:02X} for {size} byte{'s' * (size != 1)}",
            place,
            hint=f"RAM is 0x{RAM_FIRST:02X} to 0x{RAM_LAST:02X}",
        )


def _check_in_flash(analyser: Analyser, name: str, address: int, words: int, place: Location) -> None:
    """Report an address that leaves the program memory."""
    if not 0 <= address <= PROGRAM_WORDS - words:
        analyser.reporter.error(
            "c-address",
            f"'{name}' at 0x{address:X} is not in the program memory (0x000-0x{PROGRAM_WORDS - 1:X})",
            place,
        )


def _redeclare(analyser: Analyser, symbol: tree.Symbol, kind: CType, node: Any, address: int | None) -> None:
    """Add what a further declaration of a variable specifies: its length, volatile, its address."""
    differing = {
        "const": is_const_object(symbol.type) != is_const_object(kind),
        EEPROM: symbol.kind != "eeprom" and in_eeprom(node.type),
    }
    for qualifier, differs in differing.items():
        if differs:
            raise analyser.fail(
                "c-redeclared",
                f"'{symbol.name}' is {qualifier} in one declaration only",
                node,
                hint=f"the other is at {symbol.place}",
            )
    if isinstance(symbol.type, ArrayType) and symbol.type.length is None:
        symbol.type = kind
    if holds_volatile(kind) and not holds_volatile(symbol.type):
        symbol.type = qualified(symbol.type, const=False, volatile=True)
    symbol.volatile = symbol.volatile or holds_volatile(kind)
    before = symbol.address
    if before is not None and symbol.kind == "eeprom":
        before += EEPROM_ADDRESS
    if address is None or address == before:
        return
    if before is not None:
        raise analyser.fail(
            "c-redeclared",
            f"'{symbol.name}' has two addresses: 0x{before:02X} and 0x{address:02X}",
            node,
            hint=f"the other declaration is at {symbol.place}",
        )
    _fix(analyser, symbol, address, analyser.place(node))


def _configuration(analyser: Analyser, name: str, kind: CType, place: Location) -> tree.Symbol:
    """Return the symbol for SDCC's form of the configuration word: a constant at its address."""
    if kind.size != 2 or not (is_const_object(kind) or analyser.dialect == SDCC):
        raise analyser.reporter.fatal(
            "c-configuration",
            f"the configuration word at 0x{CONFIG_ADDRESS:X} is a constant of 16 bits",
            place,
        )
    symbol = tree.Symbol(name, kind, "flash", place, address=CONFIG_ADDRESS, asm_name=f"_{name}")
    analyser.program.symbols.append(symbol)
    return symbol


def _global(
    analyser: Analyser, node: Any, kind: CType, static: bool, extern: bool, address: int | None
) -> None:
    """Declare a variable at file level; declarations of one name in several files are one object (ISO C
    6.2.2).
    """
    place, name = analyser.place(node), node.name
    known = analyser.scopes.here.names.get(name)
    # `static` gives internal linkage: another file's variable of that name is another one (ISO C 6.2.2)
    if known is None and not static:
        known = analyser.externals.get(name)
        if known is not None:
            analyser.scopes.here.names[name] = known
    if known is not None:
        if not isinstance(known, tree.Symbol) or not same(known.type, kind):
            raise analyser.fail(
                "c-redeclared",
                f"'{name}' is already declared",
                node,
                hint=f"at {getattr(known, 'place', '')}",
            )
        _redeclare(analyser, known, kind, node, address)
        symbol = known
    else:
        symbol = _new_global(analyser, node, kind, address)
        analyser.scopes.here.names[name] = symbol
        if not static:
            analyser.externals[name] = symbol
    analyser.asm_symbols[f"_{name}"] = symbol
    if node.init is not None:
        if symbol.initial is not None and symbol.kind != "eeprom":
            raise analyser.fail("c-initialiser", f"'{name}' is initialised twice", node)
        symbol.initial = {}
        initialise(analyser, symbol.initial, scalars(analyser, kind, node.init))
    elif symbol.kind == "flash" and not extern and symbol.initial is None:
        analyser.reporter.warn("c-initialiser", f"the constant '{name}' has no value; it is 0", place)
        symbol.initial = {}


def _local(analyser: Analyser, node: Any, kind: CType, static: bool, address: int | None) -> None:
    """Declare a variable of a block; a static one, or one with a constant value, gets static storage."""
    assert analyser.function is not None
    place, name = analyser.place(node), node.name
    if in_eeprom(node.type) and not static:
        raise analyser.fail("c-type", f"'{name}' in the EEPROM must be static or outside functions", node)
    if static or address is not None:
        symbol = _new_global(analyser, node, kind, address)
        symbol.function = analyser.function.name
        enter_name(analyser, name, symbol, node)
        symbol.initial = {} if node.init is not None or symbol.kind == "flash" else None
        if node.init is not None:
            assert symbol.initial is not None
            initialise(analyser, symbol.initial, scalars(analyser, kind, node.init))
    else:
        if (
            is_const_object(kind)
            and kind.scalar
            and node.init is not None
            and _constant_local(analyser, node, kind)
        ):
            return
        symbol = tree.Symbol(name, kind, "local", place, function=analyser.function.name)
        symbol.volatile = holds_volatile(kind)
        enter_name(analyser, name, symbol, node)
        if node.init is not None:
            _initialise_local(analyser, symbol, node)
        if symbol.kind == "local":
            _in_frame(analyser, symbol, node)
    symbol.asm_name = f"_{name}_{analyser.function.name}"
    analyser.asm_symbols[symbol.asm_name] = symbol


def _in_frame(analyser: Analyser, symbol: tree.Symbol, node: Any) -> None:
    """Add a variable of a block to those of its function."""
    assert analyser.function is not None
    symbol.pinned = isinstance(symbol.type, (ArrayType, StructType))
    if symbol.pinned and symbol.size > RAM_BYTES:
        raise analyser.fail(
            "program-too-large",
            f"'{symbol.name}' needs {symbol.size} bytes of RAM, the chip has {RAM_BYTES}",
            node,
        )
    analyser.function.locals.append(symbol)
    analyser.declared_locals.append(symbol)


def compound_literal(analyser: Analyser, node: Any) -> tree.Expr:
    """Return an unnamed variable after the assignments that initialise it (ISO C 6.5.2.5)."""
    place = analyser.place(node)
    kind = analyser.dispatch.declared_type(analyser, node.type)
    if analyser.function is None:
        raise analyser.fail("c-unsupported", "a compound literal outside functions is not supported", node)
    named = c_ast.Decl(None, [], [], [], [], node.type, node.init, None, node.coord)
    kind = complete(analyser, kind.plain(), named)
    symbol = analyser.new_local("literal", kind, place)
    symbol.pinned = isinstance(kind, (ArrayType, StructType))
    waiting, analyser.pending = analyser.pending, []
    fill(analyser, symbol, kind, scalars(analyser, kind, node.init), place)
    steps, analyser.pending = [statement.expr for statement in analyser.pending], waiting
    literal: tree.Expr = tree.Ref(symbol, 0, None, kind, place)
    for step in reversed(steps):
        literal = tree.Comma(step, literal, kind, place)
    return literal


def _constant_local(analyser: Analyser, node: Any, kind: CType) -> bool:
    """Treat `const int n = 5;` in a block as the number itself; return whether it had that form."""
    value = convert(analyser, expression(analyser, node.init), kind, "the initialiser")
    if not isinstance(value, tree.Num) or not isinstance(kind, (IntType, FloatType)):
        return False
    symbol = _new_global(analyser, node, kind, None)
    symbol.function = analyser.function.name if analyser.function else None
    symbol.initial = {index: value.value >> 8 * index & 0xFF for index in range(kind.size)}
    enter_name(analyser, node.name, symbol, node)
    return True


def _initialise_local(analyser: Analyser, symbol: tree.Symbol, node: Any) -> None:
    """Add the assignments of a local's initialiser to `pending`; a constant array or structure whose values
    are known is in flash instead.
    """
    kind = replace(symbol.type, const=False) if symbol.type.const else symbol.type
    place = analyser.place(node)
    if isinstance(kind, (ArrayType, StructType)) and (
        isinstance(node.init, c_ast.InitList) or isinstance(kind, ArrayType)
    ):
        leaves = scalars(analyser, kind, node.init)
        if is_const_object(symbol.type) and not symbol.volatile and all(map(is_constant, leaves)):
            symbol.kind, symbol.initial = "flash", {}
            initialise(analyser, symbol.initial, leaves)
            analyser.program.symbols.append(symbol)
        else:
            fill(analyser, symbol, kind, leaves, place)
        return
    init = node.init.exprs[0] if isinstance(node.init, c_ast.InitList) else node.init
    value = convert(analyser, expression(analyser, init), kind, "the initialiser")
    target = use(symbol, place)
    assert isinstance(target, tree.Ref)
    target.type = kind
    analyser.pending.append(tree.ExprStmt(tree.Assign(target, value, kind, place)))


def declare_function(
    analyser: Analyser, node: Any, kind: FuncType, *, define: bool = False
) -> tree.FunctionDefinition:
    """Analyse a prototype, or the head of a definition, and return the function."""
    name, place = node.name, analyser.place(node)
    static = "static" in (node.storage or [])
    known = analyser.scopes.find(name) if name in analyser.scopes.stack[0].names else None
    if known is None and not static:
        known = analyser.externals.get(name)
    if known is not None and not isinstance(known, tree.FunctionDefinition):
        raise analyser.fail(
            "c-redeclared", f"'{name}' is already declared", node, hint=f"at {getattr(known, 'place', '')}"
        )
    if known is None:
        # static functions of two files may have the same name
        mangled = name
        while mangled in analyser.program.functions:
            mangled += "'"
        known = tree.FunctionDefinition(
            mangled, kind.result, _parameter_symbols(analyser, node, kind, mangled), place
        )
        known.prototyped = kind.parameters is not None or define
        known.static = static
        analyser.program.functions[mangled] = known
        if not static:
            analyser.externals[name] = known
    elif known.prototyped and is_own_file(place) and len(known.parameters) == len(kind.parameters or ()):
        # the library's body takes the types that the program declares
        kind = FuncType(known.result, tuple(parameter.type for parameter in known.parameters))
    elif is_own_file(known.place):
        _replace_library(analyser, known, kind, node)
    else:
        _same_signature(analyser, known, kind, node)
    _function_words(analyser, known, node)
    analyser.scopes.stack[0].names[name] = known
    if define:
        if known in analyser.defined:
            raise analyser.fail(
                "c-redeclared",
                f"the function '{name}' is defined twice",
                node,
                hint=f"first at {known.place}",
            )
        analyser.defined.add(known)
        known.parameters = _parameter_symbols(analyser, node, kind, known.name)
        known.place = place
        known.prototyped = True
    return known


def _function_words(analyser: Analyser, function: tree.FunctionDefinition, node: Any) -> None:
    """Add what the words `interrupt`, `__naked` and `__at` of a declaration say of its function."""
    here = position(analyser.place(node), node.name)
    analyser.heads.add(here)
    source = analyser.scopes.source
    function.interrupt |= here in source.interrupts
    function.naked |= here in source.naked
    address = source.addresses.get(here)
    if address is None or address == function.origin:
        return
    if isinstance(address, BitAddress):
        raise analyser.fail("c-address", "a fixed address must be a number", node)
    if function.origin is not None:
        raise analyser.fail(
            "c-redeclared",
            f"'{function.name}' has two addresses: 0x{function.origin:02X} and 0x{address:02X}",
            node,
        )
    _check_in_flash(analyser, function.name, address, 1, analyser.place(node))
    function.origin = address


def _replace_library(analyser: Analyser, known: tree.FunctionDefinition, kind: FuncType, node: Any) -> None:
    """Let the program declare a function of the library with other types: its own declaration holds."""
    known.result, known.place = kind.result, analyser.place(node)
    known.parameters = _parameter_symbols(analyser, node, kind, known.name)
    known.prototyped = kind.parameters is not None


def _same_signature(analyser: Analyser, known: tree.FunctionDefinition, kind: FuncType, node: Any) -> None:
    """Reject a declaration that is not compatible with the one before it (ISO C 6.7.6.3)."""
    both = FuncType(
        known.result, tuple(parameter.type for parameter in known.parameters) if known.prototyped else None
    )
    if not same(both, kind):
        raise analyser.fail(
            "c-redeclared",
            f"'{node.name}' was declared as '{both}' before, now as '{kind}'",
            node,
            hint=f"the other declaration is at {known.place}",
        )


def _parameter_symbols(analyser: Analyser, node: Any, kind: FuncType, function: str) -> list[tree.Symbol]:
    """Return the symbols of a function's parameters."""
    arguments = node.type.args if isinstance(node.type, c_ast.FuncDecl) else None
    kinds = kind.parameters or ()
    # a declaration with the type of a typedef does not name them
    declared = arguments.params if arguments is not None else [node.type] * len(kinds)
    symbols = []
    for number, (parameter, declaration) in enumerate(zip(kinds, declared, strict=False), 1):
        name = getattr(declaration, "name", None) or f"argument{number}"
        symbol = tree.Symbol(name, parameter, "param", analyser.place(declaration), function=function)
        symbol.asm_name = f"_{name}_{function}"
        symbol.pinned = isinstance(parameter, StructType)
        symbol.volatile = holds_volatile(parameter)
        symbols.append(symbol)
    return symbols
