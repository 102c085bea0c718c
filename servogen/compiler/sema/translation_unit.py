"""The semantic analysis of a program: the declarations of every file, then the bodies of its functions.

In: preprocessed and rewritten files. Out: the `Analyser` with the program's typed tree.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any

from pycparser import c_ast

import servogen.compiler.library as library
import servogen.compiler.sema.function_pointers as function_pointers
from servogen.compiler.ast.nodes import FunctionDefinition, Symbol
from servogen.compiler.ast.types import FloatType, FuncType
from servogen.compiler.diagnostics import Fatal, Reporter, is_own_file
from servogen.compiler.frontend.assembly import AsmBlock
from servogen.compiler.frontend.dialects import type_names
from servogen.compiler.frontend.extensions import CONFIG_NAME, EEPROM_NAME, ID_NAME, Rewritten
from servogen.compiler.frontend.parser import parse
from servogen.compiler.frontend.preprocessor import Preprocessed
from servogen.compiler.frontend.settings import PragmaSettings
from servogen.compiler.frontend.syntax_errors import place_of
from servogen.compiler.sema.analyser import Analyser, Dispatch, ReadFile
from servogen.compiler.sema.builtins import builtin, builtin_names
from servogen.compiler.sema.condition_checks import enumerated_names
from servogen.compiler.sema.declarations import compound_literal, declare, declare_function
from servogen.compiler.sema.expressions import assignment, binary_op, cast_expression, ternary_op, unary_op
from servogen.compiler.sema.lint import check_statics
from servogen.compiler.sema.lvalues import array_ref, func_call, struct_ref
from servogen.compiler.sema.names import expression_list, identifier, literal
from servogen.compiler.sema.scopes import Constant, Scopes
from servogen.compiler.sema.statements import define_function, static_assertion
from servogen.compiler.sema.string_pointers import infer_const_pointers
from servogen.compiler.sema.type_names import declared_type
from servogen.errors import Location
from servogen.pic.device import CONFIG_ADDRESS, EEPROM_BYTES
from servogen.pic.isa import WORD_MASK
from servogen.units import Clock

EEPROM_DATA_VALUES = 8
"""What one `__EEPROM_DATA` holds (XC8 User's Guide, library functions)."""


def begin_file(analyser: Analyser, rewritten: Rewritten) -> None:
    """Start a new file: a scope of its own in the same program."""
    analyser.scopes = Scopes(rewritten)
    analyser.file_scopes.append(analyser.scopes)


def head(analyser: Analyser, unit: Any) -> FunctionDefinition:
    """Declare the function that a definition defines, and return it."""
    kind = declared_type(analyser, unit.decl.type)
    # a typedef may give the type of a function, but no names for its parameters (ISO C 6.9.1)
    if not isinstance(kind, FuncType) or not isinstance(unit.decl.type, c_ast.FuncDecl):
        raise analyser.fail("c-syntax", f"'{unit.decl.name}' is not a function but has a body", unit)
    return declare_function(analyser, unit.decl, kind, define=True)


def file_assembly(analyser: Analyser, rewritten: Rewritten, settings: PragmaSettings) -> None:
    """Handle assembly outside functions; only `__config` is accepted."""
    for number, place in rewritten.file_asm:
        for line, text in analyser.asm_blocks[number].lines:
            words = text.split(";")[0].split(None, 1)
            where = Location(place.file, line)
            if words and words[0].lower() == "__config" and len(words) > 1:
                settings.asm_config(words[1], where)
            elif words:
                analyser.reporter.error("c-asm", "assembly outside functions can only be __config", where)


def finish(analyser: Analyser, settings: PragmaSettings) -> None:
    """Handle declarations that are recognised by their names: EEPROM data, configuration words."""
    for symbol in [other for other in analyser.program.symbols if other.name.startswith(EEPROM_NAME)]:
        analyser.program.symbols.remove(symbol)
        if symbol.type.size != EEPROM_DATA_VALUES:
            analyser.reporter.error(
                "c-initialiser",
                f"__EEPROM_DATA takes {EEPROM_DATA_VALUES} values, not {symbol.type.size}",
                symbol.place,
                hint="fill the rest with 0",
            )
        for value in _numbers(analyser, symbol):
            address = len(analyser.program.eeprom)
            if address >= EEPROM_BYTES:
                analyser.reporter.error(
                    "c-initialiser",
                    f"__EEPROM_DATA fills more than the {EEPROM_BYTES} bytes of the EEPROM",
                    symbol.place,
                )
                break
            analyser.program.eeprom[address] = value
    for symbol in [other for other in analyser.program.symbols if other.kind == "eeprom"]:
        analyser.program.symbols.remove(symbol)
        end = (symbol.address or 0) + symbol.size
        if end > EEPROM_BYTES:
            message = f"'{symbol.name}' ends at byte {end} of the EEPROM, which has {EEPROM_BYTES}"
            analyser.reporter.error("c-address", message, symbol.place)
            continue
        for address, value in enumerate(_numbers(analyser, symbol), symbol.address or 0):
            analyser.program.eeprom[address] = value
    analyser.program.eeprom.update(settings.eeprom)
    analyser.program.ids.update(settings.ids)
    everywhere = [named for scopes in analyser.file_scopes for named in scopes.stack[0].names.items()]
    for name, meaning in everywhere:
        if name.startswith(CONFIG_NAME) and isinstance(meaning, Constant):
            settings.config_mask = (meaning.value & WORD_MASK, Location())
        if name.startswith(ID_NAME) and isinstance(meaning, Constant):
            # each of the four ID words holds one hexadecimal digit
            digits = [meaning.value >> shift & 0xF for shift in (12, 8, 4, 0)]
            analyser.program.ids = dict(enumerate(digits))
    for symbol in analyser.program.symbols:
        if symbol.address == CONFIG_ADDRESS:
            low, high = _numbers(analyser, symbol)
            settings.config_mask = ((high << 8 | low) & WORD_MASK, symbol.place)


def _numbers(analyser: Analyser, symbol: Symbol) -> list[int]:
    """Return the bytes of a constant that is not in the program memory. Addresses are not known yet."""
    data = [(symbol.initial or {}).get(offset, 0) for offset in range(symbol.size)]
    numbers = [byte if isinstance(byte, int) else 0 for byte in data]
    if numbers != data:
        analyser.reporter.error("c-not-constant", "the initialiser must be a constant", symbol.place)
    return numbers


def analyse(
    files: list[tuple[Preprocessed, Rewritten]],
    dialect: str,
    reporter: Reporter,
    blocks: list[AsmBlock],
    settings: PragmaSettings,
    clock: Clock | None,
    read_library: ReadFile,
    float_type: FloatType,
) -> Analyser:
    """Parse and check every file, and the files of the library that define what is missing. Function heads
    come first, so that functions may be called before their definition.
    """
    analysis = Analyser(
        dialect,
        reporter,
        _DISPATCH,
        clock=clock,
        serial_settings=settings.serial,
        asm_blocks=blocks,
        read_library=read_library,
        float_type=float_type,
    )
    analysis.eeprom_used = EEPROM_DATA_VALUES * sum(
        token.text.startswith(EEPROM_NAME) for _, rewritten in files for token in rewritten.tokens
    )
    trees = [_parsed(analysis, rewritten) for _, rewritten in files]
    infer_const_pointers(trees)
    for units in trees:
        with suppress(RecursionError):  # the analysis reports it, with its place
            analysis.enumerated.update(enumerated_names(units))
    for (_, rewritten), units in zip(files, trees, strict=True):
        _declarations(analysis, rewritten, units)
        file_assembly(analysis, rewritten, settings)
    _bodies(analysis)
    # the library's functions may call others of the library
    while _called_of_library(analysis):
        _bodies(analysis)
    function_pointers.finish(analysis)
    if not reporter.errors:
        _check_addresses(analysis)
    finish(analysis, settings)
    return analysis


def _check_addresses(analysis: Analyser) -> None:
    """Report the words such as `__at` and `interrupt` whose name is none that can have them: a member or a
    parameter, for instance.
    """
    for scopes in analysis.file_scopes:
        source = scopes.source
        anything = analysis.variables | analysis.heads
        for strays, problem in (
            (source.addresses.keys() - anything, "only a variable or a function can have a fixed address"),
            (source.interrupts - analysis.heads, "only a function can be an interrupt function"),
            (source.naked - analysis.heads, "only a function can be naked"),
            (source.persistent - analysis.variables, "only a variable can be persistent"),
        ):
            for file, line, column, _ in strays:
                analysis.reporter.error("c-address", problem, Location(file, line, column))


def _parsed(analysis: Analyser, rewritten: Rewritten) -> list[Any]:
    """Return the external declarations of a file, with the parameters of old-style definitions in place."""
    units = parse(rewritten.tokens, type_names(), analysis.reporter, analysis.parenthesised)
    for unit in units:
        if isinstance(unit, c_ast.FuncDef) and unit.param_decls:
            _declare_in_parentheses(analysis, unit)
    return units


def _declare_in_parentheses(analysis: Analyser, unit: Any) -> None:
    """Move the parameters of `int add(a, b) int a, b; { … }`, as C was written before 1989, into the
    parentheses.
    """
    kind = unit.decl.type
    names = kind.args.params if isinstance(kind, c_ast.FuncDecl) and kind.args is not None else []
    declared = {decl.name: decl for decl in unit.param_decls}
    for number, parameter in enumerate(names):
        if isinstance(parameter, c_ast.ID) and parameter.name in declared:
            names[number] = declared.pop(parameter.name)
    for name, decl in declared.items():
        analysis.reporter.error(
            "c-undeclared", f"'{name}' is not a parameter of '{unit.decl.name}'", analysis.place(decl)
        )
    unit.param_decls = None


def _declarations(analysis: Analyser, rewritten: Rewritten, units: list[Any]) -> None:
    """Declare everything in a file, and note the bodies of its functions. A function of the library that the
    program defines itself is left out.
    """
    reporter = analysis.reporter
    begin_file(analysis, rewritten)
    for unit in units:
        try:
            if isinstance(unit, c_ast.FuncDef):
                known = analysis.externals.get(unit.decl.name)
                replaced = known in analysis.defined and is_own_file(analysis.place(unit))
                if not replaced:
                    function = head(analysis, unit)
                    body = (function, unit, analysis.scopes)
                    if is_own_file(function.place):
                        analysis.library_bodies[function.name] = body
                    else:
                        analysis.bodies.append(body)
            elif isinstance(unit, (c_ast.Decl, c_ast.Typedef)):
                declare(analysis, unit)
            elif isinstance(unit, c_ast.StaticAssert):
                static_assertion(analysis, unit)
        except RecursionError:
            raise reporter.too_deep(place_of(unit.coord)) from None
        except Fatal:
            declared = unit.decl if isinstance(unit, c_ast.FuncDef) else unit
            reporter.lost.update(filter(None, [getattr(declared, "name", None)]))
    if not reporter.errors:
        with suppress(RecursionError):
            check_statics(analysis, units)


def _bodies(analysis: Analyser) -> None:
    """Analyse the bodies that remain; one that calls the library may add others."""
    while analysis.bodies:
        function, unit, scopes = analysis.bodies.pop(0)
        analysis.scopes = scopes
        try:
            define_function(analysis, function, unit)
        except RecursionError:
            raise analysis.reporter.too_deep(function.place) from None


def _called_of_library(analysis: Analyser) -> bool:
    """Add the bodies of the library's functions that are called and not yet defined; return whether there are
    any.
    """
    missing = [
        name
        for name in sorted(analysis.called)
        if isinstance(meaning := analysis.externals.get(name), FunctionDefinition)
        and meaning not in analysis.defined
    ]
    for name in missing:
        if name in library.sources():
            library_function(analysis, name)
    wanted = analysis.called & analysis.library_bodies.keys()
    analysis.bodies += [analysis.library_bodies.pop(name) for name in sorted(wanted)]
    return bool(wanted)


def library_function(analysis: Analyser, name: str) -> FunctionDefinition:
    """Return a function of the library; its file is declared the first time, its bodies wait for analysis."""
    file = library.sources()[name]
    if file not in analysis.library_files:
        analysis.library_files.add(file)
        before = analysis.scopes
        _, rewritten = analysis.read_library(file)
        _declarations(analysis, rewritten, _parsed(analysis, rewritten))
        if own_putchar := analysis.externals.get("putchar"):
            analysis.scopes.stack[0].names.setdefault("putchar", own_putchar)
        analysis.scopes = before
    function = analysis.externals[name]
    assert isinstance(function, FunctionDefinition)
    return function


_DISPATCH = Dispatch(
    expressions={
        c_ast.Constant: literal,
        c_ast.ID: identifier,
        c_ast.ExprList: expression_list,
        c_ast.ArrayRef: array_ref,
        c_ast.StructRef: struct_ref,
        c_ast.FuncCall: func_call,
        c_ast.UnaryOp: unary_op,
        c_ast.BinaryOp: binary_op,
        c_ast.TernaryOp: ternary_op,
        c_ast.Assignment: assignment,
        c_ast.Cast: cast_expression,
        c_ast.CompoundLiteral: compound_literal,
    },
    declared_type=declared_type,
    builtin=builtin,
    builtin_names=builtin_names,
    library=library_function,
)
