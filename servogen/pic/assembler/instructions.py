"""One instruction of assembly: parsed into the expressions of its operands, and these encoded into a word.

In: a line such as `loop: btfss PORTB, 3`. Out: `ParsedLine` with `ParsedInstruction`s, whose operands are
still expressions, so that the compiler can place inline assembly itself; then `encode_instruction` returns
the 14-bit word and the diagnostics that MPASM would issue. MPASM's special mnemonics (DS33014, appendix
"Instruction sets", table of the special mnemonics for 12 and 14 bits) are replaced by the instructions that
they stand for.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Protocol

from servogen.errors import Diagnostic, InputError, Location, Severity
from servogen.pic.assembler.expressions import (
    Expression,
    Name,
    Number,
    Parser,
    SymbolScope,
    evaluate,
    suggestion,
)
from servogen.pic.assembler.messages import SourceError
from servogen.pic.assembler.text import IDENTIFIER, Text
from servogen.pic.device import PROGRAM_WORDS
from servogen.pic.isa import LEGACY, TRIS_PORTS, Opcode, by_mnemonic, encode

DEFAULT_RADIX = 16
"""MPASM's."""


@dataclass(frozen=True, slots=True)
class ParsedInstruction:
    """An instruction whose operands are expressions; an operand that its row does not have is None.

    `d` is also None if the source omits the destination, which is then the file register.
    """

    mnemonic: str
    place: Location
    f: Expression | None = None
    d: Expression | None = None
    b: Expression | None = None
    k: Expression | None = None

    @property
    def row(self) -> Opcode:
        return by_mnemonic()[self.mnemonic]


@dataclass(frozen=True, slots=True)
class ParsedLine:
    """A label, if the line has one, and its instructions: none, one, or those of a special mnemonic."""

    label: str | None
    instructions: tuple[ParsedInstruction, ...]


_C, _DC, _Z = (3, 0), (3, 1), (3, 2)
"""STATUS and the bit: MPASM's special mnemonics know no names."""

Step = tuple[str, tuple[int, ...]]
"""A mnemonic and its fixed operands; the operands of the source go in front of them."""

SPECIAL: dict[str, tuple[int, int, tuple[Step, ...], tuple[Step, ...]]] = {
    # name: minimum and maximum number of operands; steps that take none of them; steps that take them
    **{f"SKP{flag}": (0, 0, (("BTFSS", bit),), ()) for flag, bit in (("C", _C), ("DC", _DC), ("Z", _Z))},
    **{f"SKPN{flag}": (0, 0, (("BTFSC", bit),), ()) for flag, bit in (("C", _C), ("DC", _DC), ("Z", _Z))},
    **{f"CLR{flag}": (0, 0, (("BCF", bit),), ()) for flag, bit in (("C", _C), ("DC", _DC), ("Z", _Z))},
    **{f"SET{flag}": (0, 0, (("BSF", bit),), ()) for flag, bit in (("C", _C), ("DC", _DC), ("Z", _Z))},
    **{
        f"B{flag}": (1, 1, (("BTFSC", bit),), (("GOTO", ()),))
        for flag, bit in (("C", _C), ("DC", _DC), ("Z", _Z))
    },
    **{
        f"BN{flag}": (1, 1, (("BTFSS", bit),), (("GOTO", ()),))
        for flag, bit in (("C", _C), ("DC", _DC), ("Z", _Z))
    },
    "B": (1, 1, (), (("GOTO", ()),)),
    "ADDCF": (1, 2, (("BTFSC", _C),), (("INCF", ()),)),
    "ADDDCF": (1, 2, (("BTFSC", _DC),), (("INCF", ()),)),
    "SUBCF": (1, 2, (("BTFSC", _C),), (("DECF", ()),)),
    "SUBDCF": (1, 2, (("BTFSC", _DC),), (("DECF", ()),)),
    "MOVFW": (1, 1, (), (("MOVF", (0,)),)),
    "TSTF": (1, 1, (), (("MOVF", (1,)),)),
    "NEGF": (1, 2, (), (("COMF", (1,)), ("INCF", ()))),
    # the chip has one page of program: the L forms need no page bits
    "LCALL": (1, 1, (), (("CALL", ()),)),
    "LGOTO": (1, 1, (), (("GOTO", ()),)),
}


@cache
def mnemonics() -> frozenset[str]:
    """Return every mnemonic that assembly may use, in upper case."""
    return frozenset((*by_mnemonic(), *SPECIAL))


def takes_label(mnemonic: str) -> bool:
    """Return whether the operand of a mnemonic, special or not, is the address of an instruction."""
    return mnemonic.upper() in _label_takers()


@cache
def _label_takers() -> frozenset[str]:
    jumps = {name for name, row in by_mnemonic().items() if row.has_target}
    return frozenset(jumps).union(
        name for name, (*_, taking) in SPECIAL.items() if any(step in jumps for step, _ in taking)
    )


def parse_line(line: str, place: Location, radix: int = DEFAULT_RADIX) -> ParsedLine:
    """Parse a line of assembly without directives, as used in inline assembly: `label: MNEMONIC operands`.

    A label ends with a colon; in the first column it may do without, unless it is a mnemonic. A comment
    begins with `;`. `place` is the location of the line's first character. Raises InputError.
    """
    text = Text.of(line, place.column or 1).without_comment().strip()
    try:
        label = None
        match = IDENTIFIER.match(text.chars)
        if match and text.chars[match.end() :].lstrip().startswith(":"):
            label = match[0]
            text = text[text.chars.index(":") + 1 :].strip()
        elif match and not line[:1].isspace() and _is_bare_label(text.chars):
            label = match[0]
            text = text[match.end() :].strip()
        if not text:
            return ParsedLine(label, ())
        match = IDENTIFIER.match(text.chars)
        word = match[0] if match else text.chars.split()[0]
        if word.upper() not in mnemonics():
            hint = suggestion(word, mnemonics())
            raise SourceError("asm-syntax", f"unknown instruction '{word}'", text.column(0), hint)
        fields = Parser.of(text[len(word) :], radix).fields()
        address = replace(place, column=text.column(0))
        return ParsedLine(label, tuple(instructions(word, fields, address)))
    except SourceError as error:
        column = place.column if error.column is None else error.column
        raise InputError.of(
            [
                Diagnostic(
                    severity="error",
                    code=error.code,
                    message=error.text,
                    location=replace(place, column=column),
                    hint=error.hint,
                )
            ]
        ) from error


def _is_bare_label(line: str) -> bool:
    """Return whether a line begins with a label without a colon: with no mnemonic, but the line's only word,
    or in front of a mnemonic.
    """
    first, *rest = line.split(maxsplit=2)
    return first.upper() not in mnemonics() and (not rest or rest[0].upper() in mnemonics())


def instructions(
    mnemonic: str, fields: Sequence[Expression | None], place: Location
) -> Iterator[ParsedInstruction]:
    """Yield the instructions of a mnemonic, special or not, with these operand fields. Raises SourceError."""
    name = mnemonic.upper()
    if name not in SPECIAL:
        yield _instruction(name, fields, place)
        return
    minimum, maximum, bare, taking = SPECIAL[name]
    _count(name, fields, minimum, maximum)
    for step, fixed in bare:
        yield _instruction(step, [Number(value) for value in fixed], place)
    for step, fixed in taking:
        own = fields[:1] if fixed else fields
        yield _instruction(step, [*own, *(Number(value) for value in fixed)], place)


def _instruction(name: str, fields: Sequence[Expression | None], place: Location) -> ParsedInstruction:
    """Parse the operands of one row in assembly order: f,d or f,b or f or k; d may be omitted."""
    row = by_mnemonic()[name]
    wanted = row.operands
    _count(name, fields, len(wanted.replace("d", "")), len(wanted))
    values = dict(zip(wanted, fields, strict=False))
    missing = [field for field, value in values.items() if value is None and field != "d"]
    if missing:
        raise SourceError("asm-missing-argument", f"{name} lacks an operand", place.column)
    if values.get("d") is not None:
        values["d"] = _destination(values["d"])
    return ParsedInstruction(name, place, **values)


def _count(name: str, fields: Sequence[Expression | None], minimum: int, maximum: int) -> None:
    if len(fields) < minimum:
        raise SourceError(
            "asm-missing-argument", f"{name} needs {minimum} operand{'s' * (minimum > 1)}, not {len(fields)}"
        )
    if len(fields) > maximum:
        raise SourceError(
            "asm-too-many-arguments",
            f"{name} takes at most {maximum} operand{'s' * (maximum != 1)}, not {len(fields)}",
        )


def _destination(expression: Expression | None) -> Expression | None:
    """Return the expression of a destination, with the names W and F, in either case, replaced by 0 and 1."""
    if isinstance(expression, Name) and expression.name.upper() in "WF":
        return Number("WF".index(expression.name.upper()), expression.column)
    return expression


def encode_instruction(
    instruction: ParsedInstruction, scope: SymbolScope
) -> tuple[int, tuple[Diagnostic, ...]]:
    """Return the word of an instruction, and MPASM's diagnostics for it. Raises SourceError.

    A value that is too large is masked, as MPASM does, with a diagnostic.
    """
    remarks: list[Diagnostic] = []

    def remark(severity: Severity, code: str, text: str) -> None:
        remarks.append(Diagnostic(severity, code, text, instruction.place))

    def value(expression: Expression | None) -> int:
        return 0 if expression is None else evaluate(expression, scope)

    name, row = instruction.mnemonic, instruction.row
    fields: dict[str, int] = {}
    if row in LEGACY:
        remark("warning", "asm-deprecated", f"{name} is not recommended: write the register in bank 1")
    if name == "TRIS":
        fields["f"] = _port(value(instruction.f), instruction.place, remark)
    elif "f" in row.operands:
        fields["f"] = _register(value(instruction.f), remark)
    if "d" in row.operands:
        fields["d"] = _flag(instruction.d, value(instruction.d), remark)
    if "b" in row.operands:
        bit = value(instruction.b)
        if not 0 <= bit <= 7:
            remark(
                "warning",
                "asm-argument-truncated",
                f"there is no bit {bit}: its least significant bits are used",
            )
        fields["b"] = bit & 7
    if "k" in row.operands:
        fields["k"] = (_target if row.has_target else _literal)(value(instruction.k), remark)
    return encode(name, **fields), tuple(remarks)


class _Remark(Protocol):
    def __call__(self, severity: Severity, code: str, text: str) -> None: ...


def _register(address: int, remark: _Remark) -> int:
    """Return a file register's address within its bank; bit 7 is selected by RP0, not by the instruction."""
    if address & 0x80:
        remark("note", "asm-bank", f"register 0x{address & 0xFFFF:02X} is not in bank 0: check the bank bits")
    return address & 0x7F


def _port(address: int, place: Location, remark: _Remark) -> int:
    port = _register(address, remark)
    if port not in TRIS_PORTS:
        raise SourceError(
            "asm-argument-range", f"TRIS takes port 5 (PORTA) or 6 (PORTB), not {port}", place.column
        )
    return port


def _flag(expression: Expression | None, destination: int, remark: _Remark) -> int:
    if expression is None:
        remark("note", "asm-no-destination", "no destination: the file register (1) is assumed")
        return 1
    if destination not in (0, 1):
        remark(
            "warning",
            "asm-argument-truncated",
            f"destination {destination} is neither 0 (W) nor 1 (F): its lowest bit is used",
        )
    return destination & 1


def _literal(literal: int, remark: _Remark) -> int:
    if not -0xFF <= literal <= 0xFF:
        remark(
            "warning",
            "asm-argument-truncated",
            f"{literal} (0x{literal & 0xFFFFFFFF:X}) does not fit 8 bits: the lowest are used",
        )
    return literal & 0xFF


def _target(address: int, remark: _Remark) -> int:
    if not 0 <= address < PROGRAM_WORDS:
        remark(
            "warning",
            "asm-address-truncated",
            f"address 0x{address & 0xFFFFFFFF:X} is beyond the chip's {PROGRAM_WORDS} words",
        )
    return address & 0x7FF
