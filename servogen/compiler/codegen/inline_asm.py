"""Translates one line of inline assembly to instructions.

In: a line as written in C2C, XC8 or SDCC programs: a label, a mnemonic, and operands that name registers,
bits, C variables (`_name`, `_name_function`) and numbers. Out: symbolic instructions. The assembler parses
the line; this module gives the names in it their meaning in C.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

from servogen.compiler.ast.nodes import AddressByte, Symbol
from servogen.compiler.frontend.assembly import RADIX, binary_constants
from servogen.compiler.ir.function import Line
from servogen.compiler.ir.instruction import STATUS, Byte, Instruction, Label, Loc, Reg
from servogen.errors import Diagnostic, InputError, Location
from servogen.pic.assembler.expressions import (
    BinaryOperation,
    Expression,
    Here,
    Name,
    Number,
    UnaryOperation,
    evaluate,
    spelling,
)
from servogen.pic.assembler.instructions import ParsedInstruction, parse_line
from servogen.pic.assembler.messages import SourceError
from servogen.pic.device import RAM_FIRST, RAM_LAST, register_bits, registers

BANK_1 = 0x80
"""The bit of an address that is the bank; instructions hold the other seven."""
BANK_MASK = 0x7F
RP0 = register_bits()["RP0"][1]

Names = Callable[[str], Symbol | None]
Labels = Callable[[str], str]

MARK = ".asm."
"""Between the name of a function and that of a label in its assembly."""


def program_label(function: str, name: str) -> str:
    """Return the name, unique in the program, of a label in a function's assembly."""
    return f"{function}{MARK}{name}"


def source_label(label: str) -> str | None:
    """Return a label's name in the source, or None for a label that the compiler made."""
    function, mark, name = label.partition(MARK)
    return name if mark and function.isidentifier() else None


def assemble_line(text: str, place: Location, names: Names, label: Labels) -> list[Line]:
    """Return the label and the instructions of a line, if it has them. Raises InputError."""
    code = re.split(r"//|/\*", text, maxsplit=1)[0]
    if match := _BANK_DIRECTIVE.fullmatch(code):
        return _selected_bank(match["word"], match["name"], place, names)
    code = _BANKMASK.sub("(", code)
    parsed = parse_line(binary_constants(code), place, RADIX)
    lines: list[Line] = [Label(label(parsed.label), place)] if parsed.label else []
    try:
        return [*lines, *(_instruction(instruction, names, label) for instruction in parsed.instructions)]
    except SourceError as error:
        raise InputError.of([Diagnostic("error", error.code, error.text, place, error.hint)]) from error


_BANK_DIRECTIVE = re.compile(
    r"\s*(?P<word>banksel|pagesel|bankisel)\b\s*\(?\s*(?P<name>\w+)\s*\)?\s*(;.*)?", re.IGNORECASE
)
_BANKMASK = re.compile(r"\bBANKMASK\s*\(", re.IGNORECASE)
"""XC8's macro that removes the bank from an address; registers are encoded without it in any case."""


def _selected_bank(word: str, name: str, place: Location, names: Names) -> list[Line]:
    """Return the instruction of BANKSEL: RP0 set for a register of bank 1, cleared for the others. One page
    and one range for FSR need no instructions.
    """
    if word.lower() != "banksel":
        return []
    address = None if names(name) is not None else _ChipNames().value(name)
    if address is None and names(name) is None:
        problem = f"'{name}' is neither a register nor a variable"
        raise InputError.of([Diagnostic("error", "c-asm", problem, place)])
    mnemonic = "BSF" if address is not None and address & BANK_1 else "BCF"
    return [Instruction(mnemonic, STATUS, b=RP0, place=place, fixed=True)]


def _instruction(parsed: ParsedInstruction, names: Names, label: Labels) -> Instruction:
    """Return a parsed instruction with its operands resolved."""
    ins = Instruction(parsed.mnemonic, place=parsed.place, fixed=True)
    if parsed.f is not None:
        ins.f = _file(parsed.f, names)
    if "d" in parsed.row.operands:
        ins.d = 1 if parsed.d is None else _destination(parsed.d)
    if parsed.b is not None:
        ins.b = _bit(parsed.b)
    if parsed.k is not None and parsed.row.has_target:
        ins.target = _target(parsed.k, label)
    elif parsed.k is not None:
        ins.k = _literal(parsed.k, names)
    return ins


@dataclass(frozen=True, slots=True)
class _ChipNames:
    """The names of registers, and those of bits if `bits`, as numbers; a label has none here."""

    registers: bool = True
    bits: bool = False
    here = 0

    def value(self, name: str) -> int | None:
        name = name.upper().removeprefix("_")  # the assembler names of C's registers begin with it
        name = {"OPTION": "OPTION_REG"}.get(name, name)
        if self.registers and name in registers():
            return registers()[name].address
        return register_bits()[name][1] if self.bits and name in register_bits() else None

    def hint(self, name: str) -> str | None:
        return None


def _constant(expression: Expression, known: _ChipNames) -> int | None:
    """Return the value of an expression; None if a name in it has none, or the address of the instruction."""
    try:
        return None if _has_here(expression) else evaluate(expression, known)
    except SourceError:
        return None


def _has_here(expression: Expression) -> bool:
    """Return whether an expression contains `$`, the address of the instruction."""
    match expression:
        case Here():
            return True
        case UnaryOperation(_, operand):
            return _has_here(operand)
        case BinaryOperation(_, left, right):
            return _has_here(left) or _has_here(right)
    return False


def _with_offset(expression: Expression, names: Names) -> tuple[Symbol, int] | None:
    """Return the C variable and the offset of an expression such as `_name + 1`; None if it has another
    form.
    """
    match expression:
        case Name(name):
            symbol = names(name)
            return None if symbol is None else (symbol, 0)
        case BinaryOperation("&", left, Number(value)) if value == BANK_MASK:
            return _with_offset(left, names)
        case BinaryOperation("+" | "-" as sign, left, right):
            offset = _constant(right, _ChipNames())
            if sign == "+" and offset is None:
                left, offset = right, _constant(left, _ChipNames())
            inner = None if offset is None else _with_offset(left, names)
            return inner and (inner[0], inner[1] + (offset or 0) * (-1 if sign == "-" else 1))
    return None


def _used(symbol: Symbol) -> Symbol:
    """Return a symbol that assembly accesses, which the compiler leaves where it is."""
    symbol.pinned = symbol.volatile = True
    return symbol


def _target(expression: Expression, label: Labels) -> str:
    """Return a label, or the distance of the target from the instruction, as `$+2`."""
    match expression:
        case Name(name):
            return label(name)
        case Here():
            return "$"
        case BinaryOperation("+" | "-" as sign, Here(), right):
            distance = _constant(right, _ChipNames())
            if distance is not None:
                return f"${distance if sign == '+' else -distance:+d}"
    raise SourceError("c-asm", f"'{spelling(expression)}' is not a label")


def _file(expression: Expression, names: Names) -> Loc:
    """Return the register or variable byte that an operand names."""
    location = _with_offset(expression, names)
    if location is not None:
        symbol, offset = _used(location[0]), location[1]
        if symbol.kind == "flash":
            raise SourceError("c-asm", f"'{symbol.name}' is in flash and has no RAM address")
        if symbol.kind == "fixed" and symbol.address is not None:
            address = symbol.address + offset
            return Byte(symbol, offset) if RAM_FIRST <= address & 0x7F <= RAM_LAST else Reg(address)
        return Byte(symbol, offset)
    value = _constant(expression, _ChipNames())
    if value is None:
        raise SourceError("c-asm", f"'{spelling(expression)}' is neither a register nor a variable")
    if not 0 <= value <= 0xFF:
        raise SourceError("c-asm", f"the register address {_computed(expression, value)} outside 0 to 0xFF")
    return Reg(value)


def _destination(expression: Expression) -> int:
    """Return the destination bit of an operand: W or F, 0 or 1."""
    value = _constant(expression, _ChipNames(registers=False))
    if value not in (0, 1):
        raise SourceError("c-asm", f"the destination is W or F, not '{spelling(expression)}'")
    return value


def _bit(expression: Expression) -> int:
    """Return the bit number of an operand."""
    value = _constant(expression, _ChipNames(registers=False, bits=True))
    if value is None or not 0 <= value <= 7:
        raise SourceError("c-asm", f"'{spelling(expression)}' is not a bit number from 0 to 7")
    return value


def _literal(expression: Expression, names: Names) -> int | AddressByte:
    """Return a literal: a number, or the low or high byte of the address of a variable and an offset."""
    part, within = 0, expression
    if isinstance(expression, UnaryOperation) and expression.operator in ("low", "high"):
        part, within = int(expression.operator == "high"), expression.operand
    address = _with_offset(within, names)
    if address is not None:
        return AddressByte(_used(address[0]), address[1], part)
    value = _constant(expression, _ChipNames(bits=True))
    if value is None:
        raise SourceError("c-asm", f"'{spelling(expression)}' is not a number from 0 to 255")
    if not -128 <= value <= 255:
        raise SourceError("c-asm", f"the literal {_computed(expression, value)} outside 0 to 255")
    return value & 0xFF


def _computed(expression: Expression, value: int) -> str:
    """Return an expression and its value in words, as `(1500 + 14) / 4 is 378,`; `-300 is` for a number."""
    text = spelling(expression)
    return f"{value} is" if isinstance(expression, Number) or text == str(value) else f"{text} is {value},"
