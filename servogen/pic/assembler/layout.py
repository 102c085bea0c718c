"""Directives that place words: ORG, RES, FILL, DATA, DW, DB, DT, DE, DA; those that open sections, and those
that select banks.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from servogen.pic.assembler import instructions
from servogen.pic.assembler.expressions import Expression, Number, String
from servogen.pic.assembler.messages import SourceError
from servogen.pic.assembler.sections import KINDS
from servogen.pic.assembler.source import Statement
from servogen.pic.assembler.state import Directive, Pass
from servogen.pic.assembler.text import IDENTIFIER
from servogen.pic.device import EEPROM_ADDRESS, EEPROM_BYTES, register_bits
from servogen.pic.isa import WORD_MASK, encode


def _org(state: Pass, statement: Statement) -> None:
    address = state.one(statement)
    if state.sections:
        state.open_section(f".org_{address:x}", "code", address, statement)
    state.location = address
    if statement.label is not None:
        state.symbols.define(statement.label, state.location, "label", statement.label_column)


def _res(state: Pass, statement: Statement) -> None:
    """Reserve words, which stay erased, or in a section of data bytes."""
    reserve(state, statement, statement.label)


def reserve(state: Pass, statement: Statement, name: str | None) -> None:
    section = state.sections.current
    if section is not None and not section.is_code:
        size = counted(state.one(statement), statement)
        if name is not None and not state.first:
            state.blocks.append((state.location, name, size))
        if state.is_initial_data:
            for _ in range(size):
                state.initialise(0, statement)
            return
        state.location += size
        return
    for _ in range(counted(state.one(statement), statement)):
        state.emit(WORD_MASK, statement)


MAX_COUNT = 0x2200
"""The maximum count of FILL and RES, of ORG in a section and of REPT: more words than there are addresses."""


def counted(count: int, statement: Statement, what: str = "words") -> int:
    """Return the number of words, or turns, that a line asks for. Raises SourceError beyond `MAX_COUNT`."""
    if not 0 <= count <= MAX_COUNT:
        raise SourceError(
            "asm-argument-range",
            f"{statement.operation.upper()} of {count} {what}",
            statement.column,
            f"0 to {MAX_COUNT} {what}",
        )
    return count


def _fill(state: Pass, statement: Statement) -> None:
    """Process `fill value, count`, or `fill (instruction), count`; the value is evaluated at each address."""
    bracketed = _BRACKETED.match(statement.rest.chars)
    if bracketed is None or bracketed[1].upper() not in instructions.mnemonics():
        value, count = state.fields(statement, 2, 2)
        for _ in range(counted(state.evaluate(count), statement)):
            state.emit(state.evaluate(value), statement)
        return
    fields = state.parser(statement.rest[bracketed.end(1) : bracketed.end(2)]).fields()
    count = state.expression(statement.rest[bracketed.end() :])
    for _ in range(counted(state.evaluate(count), statement)):
        for instruction in instructions.instructions(bracketed[1], fields, statement.place):
            state.encode(instruction, statement)


_BRACKETED = re.compile(r"\(\s*(\w+)(.*)\)\s*,")


def _bytes(state: Pass, fields: list[Expression]) -> Iterator[int]:
    """Yield each value, and each character of each string."""
    for field in fields:
        if isinstance(field, String):
            yield from field.codes
        else:
            yield state.evaluate(field)


def _pack(state: Pass, statement: Statement, bits: int) -> None:
    """Place numbers, and strings as two characters of that many bits per word."""
    mask = (1 << bits) - 1
    for field in state.fields(statement, 1):
        if not isinstance(field, String):
            state.emit(state.evaluate(field), statement)
            continue
        codes = [*field.codes, 0]
        for high, low in zip(codes[0:-1:2], codes[1::2], strict=False):
            state.emit((high & mask) << bits | low & mask, statement)


def _data(state: Pass, statement: Statement) -> None:
    """Place words; strings are packed two characters per word, the first in the high byte; a last single one
    goes in the low byte.
    """
    _pack(state, statement, 8)


def _db(state: Pass, statement: Statement) -> None:
    """Place bytes packed two per word, the first in the high byte; in the data EEPROM, one per address."""
    values = [_byte(state, value, statement) for value in _bytes(state, state.fields(statement, 1))]
    if state.is_initial_data:
        for value in values:
            state.initialise(value, statement)
        return
    if EEPROM_ADDRESS <= state.location < EEPROM_ADDRESS + EEPROM_BYTES:
        for value in values:
            state.emit(value, statement)
        return
    if len(values) % 2:
        values.append(0)
    for high, low in zip(values[::2], values[1::2], strict=True):
        state.emit(high << 8 | low, statement)


def _byte(state: Pass, value: int, statement: Statement) -> int:
    if not -128 <= value <= 0xFF:
        state.report(
            "warning",
            "asm-argument-truncated",
            f"{value} does not fit 8 bits: the lowest are used",
            statement.line,
            statement.column,
        )
    return value & 0xFF


def _de(state: Pass, statement: Statement) -> None:
    for value in _bytes(state, state.fields(statement, 1)):
        state.emit(value & 0xFF, statement)


def _dt(state: Pass, statement: Statement) -> None:
    """Place a table: one RETLW per byte."""
    for value in _bytes(state, state.fields(statement, 1)):
        state.emit(encode("RETLW", k=value & 0xFF), statement, is_code=True)


def _da(state: Pass, statement: Statement) -> None:
    """Place 7-bit characters, two per word."""
    _pack(state, statement, 7)


def _select(state: Pass, statement: Statement, bit_name: str, is_set: bool) -> None:
    register, bit = register_bits()[bit_name]
    fields = (Number(register.address), Number(bit))
    for instruction in instructions.instructions("BSF" if is_set else "BCF", fields, statement.place):
        state.encode(instruction, statement)


def _banksel(state: Pass, statement: Statement) -> None:
    """Select a register bank with RP0; the chip has two (DS35007 section 2.2)."""
    _select(state, statement, "RP0", bool(state.one(statement) & 0x80))


def _bankisel(state: Pass, statement: Statement) -> None:
    """Set IRP, which selects indirect addresses above 0xFF (DS35007 section 2.5); the chip implements the bit
    but has no such addresses.
    """
    _select(state, statement, "IRP", state.one(statement) > 0xFF)


def _pagesel(state: Pass, statement: Statement) -> None:
    """Do nothing: the chip has one page of program memory."""
    state.one(statement)
    state.report(
        "note",
        "asm-page",
        "the chip has one page: no page selection is needed",
        statement.line,
        statement.column,
    )


def _section(state: Pass, statement: Statement) -> None:
    """Process `name CODE address` and its like; without a name it is that of the kind."""
    kind = next(each for each in KINDS if each == statement.operation)
    origin = state.one(statement) if statement.rest else None
    state.open_section(statement.label or f".{kind}", kind, origin, statement)


def _names(statement: Statement) -> Iterator[tuple[str, int]]:
    """Yield the names of `global a, b`, with their columns."""
    for part in statement.rest.split(","):
        if not IDENTIFIER.fullmatch(part.chars):
            raise SourceError("asm-missing-argument", "a name is missing here", part.column(0))
        yield part.chars, part.column(0)


def _global(state: Pass, statement: Statement) -> None:
    state.globals |= {name: statement.line for name, _ in _names(statement)}


def _extern(state: Pass, statement: Statement) -> None:
    for name, column in _names(statement):
        if state.symbols.defined(name):
            raise SourceError("asm-duplicate-symbol", f"'{name}' is defined in this source", column)
        state.externs.add(name)


def _foreign(state: Pass, statement: Statement) -> None:
    raise SourceError(
        "asm-relocatable",
        f"{statement.operation.upper()} is not supported",
        statement.column,
        "it is for another chip: UDATA reserves bytes",
    )


def _named(directive: Directive) -> Directive:
    """Return the directive; in IDATA its label names the bytes that it places."""

    def process(state: Pass, statement: Statement) -> None:
        first = state.location
        directive(state, statement)
        if state.is_initial_data and statement.label is not None and not state.first:
            state.blocks.append((first, statement.label, state.location - first))

    return process


LAYOUT: dict[str, Directive] = {
    "org": _org,
    "res": _res,
    "fill": _fill,
    "data": _named(_data),
    "dw": _named(_data),
    "db": _named(_db),
    "de": _de,
    "dt": _dt,
    "da": _da,
    "banksel": _banksel,
    "bankisel": _bankisel,
    "pagesel": _pagesel,
    "pageselw": _pagesel,
    **dict.fromkeys(KINDS, _section),
    "global": _global,
    "extern": _extern,
    "udata_acs": _foreign,
}
