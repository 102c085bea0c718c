"""Directives that assign values to names: EQU, SET, =, VARIABLE, CONSTANT, CBLOCK, LOCAL, #DEFINE."""

from __future__ import annotations

import re

from servogen.pic.assembler.expressions import BINARY, parse_expression
from servogen.pic.assembler.messages import SourceError
from servogen.pic.assembler.source import ASSIGNMENTS, Statement
from servogen.pic.assembler.state import Directive, Pass
from servogen.pic.assembler.substitution import Definition
from servogen.pic.assembler.symbols import Kind
from servogen.pic.assembler.text import IDENTIFIER, Text


def _label(statement: Statement) -> str:
    if statement.label is None:
        raise SourceError(
            "asm-missing-argument",
            f"{statement.operation.upper()} needs a name in front of it",
            statement.column,
        )
    return statement.label


def _equ(state: Pass, statement: Statement) -> None:
    state.symbols.define(_label(statement), state.one(statement), "constant", statement.label_column)


def _set(state: Pass, statement: Statement) -> None:
    state.symbols.define(_label(statement), state.one(statement), "variable", statement.label_column)


def _assign(state: Pass, statement: Statement) -> None:
    """Process `name op= expression`, `name++` and `name--`."""
    name = _label(statement)
    old = state.symbols.find(name)
    if old is None or old.in_pass != state.symbols.in_pass:
        raise SourceError(
            "asm-undefined-symbol", f"symbol not previously defined: '{name}'", statement.label_column
        )
    if statement.operation in ("++", "--"):
        step = 1
        if statement.rest:
            raise SourceError(
                "asm-syntax", f"'{statement.rest.chars}' is not expected here", statement.rest.column(0)
            )
    else:
        step = state.one(statement)
    sign = statement.operation[0] if statement.operation in ("++", "--") else statement.operation[:-1]
    if sign in "/%" and step == 0:
        raise SourceError("asm-divide-by-zero", "divide by zero", statement.column)
    state.symbols.define(name, BINARY[sign][1](old.value, step), "variable", statement.label_column)


def _named_values(state: Pass, statement: Statement, kind: Kind, default: int | None) -> None:
    """Process `name = expression, name, …`."""
    for part in statement.rest.split(","):
        name, value = _name_and_value(state, part)
        if value is None:
            if default is None:
                raise SourceError("asm-missing-argument", f"constant '{name}' needs a value", part.column(0))
            old = state.symbols.find(name)
            value = default if old is None else old.value
        state.symbols.define(name, value, kind, part.column(0))


def _name_and_value(state: Pass, part: Text) -> tuple[str, int | None]:
    match = IDENTIFIER.match(part.chars)
    if match is None:
        raise SourceError("asm-missing-argument", "a name is missing here", part.column(0))
    rest = part[match.end() :].strip()
    if not rest:
        return match[0], None
    if not rest.chars.startswith("="):
        raise SourceError("asm-syntax", f"'{rest.chars[0]}' is not expected here", rest.column(0))
    return match[0], state.evaluate(parse_expression(rest[1:], state.radix))


def _variable(state: Pass, statement: Statement) -> None:
    _named_values(state, statement, "variable", 0)


def _constant(state: Pass, statement: Statement) -> None:
    _named_values(state, statement, "constant", None)


def _local(state: Pass, statement: Statement) -> None:
    for part in statement.rest.split(","):
        match = IDENTIFIER.match(part.chars)
        if match is not None:
            state.symbols.declare_local(match[0])
        name, value = _name_and_value(state, part)
        if value is not None:
            state.symbols.define(name, value, "variable", part.column(0))


def _cblock(state: Pass, statement: Statement) -> None:
    """Define consecutive names, `name` or `name:size`, up to ENDC."""
    if statement.rest:
        state.cblock = state.one(statement)
    for raw in state.readers[-1].block("cblock", "endc", statement):
        state.line = raw
        state.spend()
        try:
            line = state.substituted(raw)
            for part in line.text.without_comment().strip().split(","):
                if part:
                    _cblock_entry(state, part)
        except SourceError as error:
            state.report("error", error.code, error.text, raw, error.column, error.hint)


def _cblock_entry(state: Pass, part: Text) -> None:
    match = IDENTIFIER.match(part.chars)
    if match is None:
        raise SourceError("asm-syntax", f"'{part.chars}' is not a name", part.column(0))
    rest = part[match.end() :].strip()
    size = 1
    if rest.chars.startswith(":"):
        rest = rest[1:].strip()
    if rest:
        size = state.evaluate(parse_expression(rest, state.radix))
    state.symbols.define(match[0], state.cblock, "constant", part.column(0))
    state.blocks.append((state.cblock, match[0], size))
    state.cblock += size


_DEFINE = re.compile(rf"({IDENTIFIER.pattern})(?:\(([^)]*)\))?")


def _define(state: Pass, statement: Statement) -> None:
    match = _DEFINE.match(statement.rest.chars)
    if match is None:
        raise SourceError("asm-missing-argument", "#DEFINE needs a name", statement.column)
    if match[1] in state.definitions:
        raise SourceError(
            "asm-duplicate-symbol",
            f"'{match[1]}' is defined already",
            statement.rest.column(0),
            "#undefine it first",
        )
    names = tuple(name.strip() for name in (match[2] or "").split(",") if name.strip())
    state.definitions[match[1]] = Definition(statement.rest.chars[match.end() :].strip(), names)


def _undefine(state: Pass, statement: Statement) -> None:
    name = statement.rest.chars.strip()
    if state.definitions.pop(name, None) is None:
        text = f"'{name}' was not defined by #define"
        state.report("warning", "asm-unknown-symbol", text, statement.line, statement.rest.column(0))


DEFINITIONS: dict[str, Directive] = {
    "equ": _equ,
    "set": _set,
    ".set": _set,
    "=": _set,
    **dict.fromkeys((sign for sign in ASSIGNMENTS if sign != "="), _assign),
    "variable": _variable,
    "constant": _constant,
    "local": _local,
    "cblock": _cblock,
    "#define": _define,
    "#undefine": _undefine,
}
