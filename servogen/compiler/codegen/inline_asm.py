"""Translates one line of inline assembly to instructions.

In: a line as written in C2C, XC8 or SDCC programs: a label, a mnemonic of the chip, and operands that name
registers, bits, C variables (`_name`, `_name_function`) and numbers. Out: symbolic instructions.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from servogen.compiler.ast.nodes import AddressByte, Symbol
from servogen.compiler.frontend.asm_numbers import assembler_number
from servogen.compiler.ir.function import Line
from servogen.compiler.ir.instruction import Byte, Instruction, Label, Loc, Reg
from servogen.errors import Location, did_you_mean
from servogen.pic.device import RAM_FIRST, RAM_LAST, register_bits, registers
from servogen.pic.isa import by_mnemonic

Names = Callable[[str], Symbol | None]

_MACROS = {
    # assembler short forms: (mnemonic, fixed operands)
    "CLRC": ("BCF", "STATUS,C"),
    "SETC": ("BSF", "STATUS,C"),
    "CLRZ": ("BCF", "STATUS,Z"),
    "SETZ": ("BSF", "STATUS,Z"),
    "SKPC": ("BTFSS", "STATUS,C"),
    "SKPNC": ("BTFSC", "STATUS,C"),
    "SKPZ": ("BTFSS", "STATUS,Z"),
    "SKPNZ": ("BTFSC", "STATUS,Z"),
}


MARK = ".asm."
"""Between the name of a function and that of a label in its assembly."""


class AsmError(Exception):
    """An error in a line of assembly, with a hint."""

    def __init__(self, message: str, hint: str | None = None) -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint


def program_label(function: str, name: str) -> str:
    """Return the name, unique in the program, of a label in a function's assembly."""
    return f"{function}{MARK}{name}"


def source_label(label: str) -> str | None:
    """Return a label's name in the source, or None for a label that the compiler made."""
    function, mark, name = label.partition(MARK)
    return name if mark and function.isidentifier() else None


def assemble_line(text: str, place: Location, names: Names, label: Callable[[str], str]) -> list[Line]:
    """Return the label and the instruction of a line, if it has them. Raises AsmError."""
    code = re.split(r";|//|/\*", text, maxsplit=1)[0]
    out: list[Line] = []
    match = re.match(r"\s*([A-Za-z_.$][\w.$]*)\s*:\s*(.*)$", code, re.DOTALL)
    if match:
        out.append(Label(label(match[1]), place))
        code = match[2]
    words = code.split(None, 1)
    if not words:
        return out
    mnemonic = words[0].upper()
    rest = words[1].strip() if len(words) > 1 else ""
    if mnemonic in _MACROS:
        mnemonic, rest = _MACROS[mnemonic]
    rows = by_mnemonic()
    if mnemonic not in rows:
        if not match and not text[:1].isspace() and (not rest or rest.split()[0].upper() in rows):
            return [
                Label(label(words[0]), place),
                *assemble_line(" " + rest, place, names, label),
            ]
        raise AsmError(f"'{words[0]}' is not an instruction of this chip", did_you_mean(mnemonic, rows))
    operands = [each.strip() for each in rest.split(",")] if rest else []
    out.append(_instruction(mnemonic, operands, place, names, label))
    return out


def _instruction(
    mnemonic: str, operands: list[str], place: Location, names: Names, label: Callable[[str], str]
) -> Instruction:
    row = by_mnemonic()[mnemonic]
    fields = row.operands
    ins = Instruction(mnemonic, place=place, fixed=True)
    if "d" in fields and len(operands) == 1:
        operands = [*operands, "F"]
    if len(operands) != len(fields):
        raise AsmError(
            f"{mnemonic} takes {len(fields)} operand{'s' * (len(fields) != 1)}, not {len(operands)}"
        )
    for field, text in zip(fields, operands, strict=True):
        if field == "f":
            ins.f = _file(text, names)
        elif field == "d":
            found = {"W": 0, "0": 0, "F": 1, "1": 1}.get(text.upper())
            if found is None:
                raise AsmError(f"the destination is W or F, not '{text}'")
            ins.d = found
        elif field == "b":
            ins.b = _bit(text)
        elif mnemonic in ("GOTO", "CALL"):
            ins.target = _target(text, names, label)
        else:
            ins.k = _literal(text, names)
    return ins


def _target(text: str, names: Names, label: Callable[[str], str]) -> str:
    if re.fullmatch(r"\$(\s*[+-]\s*\d+)?", text):
        return text.replace(" ", "")
    if not re.fullmatch(r"[A-Za-z_.][\w.]*", text):
        raise AsmError(f"'{text}' is not a label")
    return label(text)


def _file(text: str, names: Names) -> Loc:
    match = re.fullmatch(r"([A-Za-z_]\w*)\s*(?:([+-])\s*(\d+))?", text)
    if match:
        offset = int(match[3] or 0) * (-1 if match[2] == "-" else 1)
        symbol = names(match[1])
        if symbol is not None:
            symbol.pinned = symbol.read = symbol.written = True
            symbol.volatile = True
            if symbol.kind == "fixed" and symbol.address is not None:
                address = symbol.address + offset
                return Byte(symbol, offset) if RAM_FIRST <= address & 0x7F <= RAM_LAST else Reg(address)
            if symbol.kind == "flash":
                raise AsmError(f"'{symbol.name}' is in flash and has no RAM address")
            return Byte(symbol, offset)
        register = registers().get(match[1].upper()) or (
            registers()["OPTION_REG"] if match[1].upper() == "OPTION" else None
        )
        if register is not None:
            return Reg(register.address + offset)
    value = assembler_number(text)
    if value is None:
        raise AsmError(f"'{text}' is neither a register nor a variable")
    if not 0 <= value <= 0xFF:
        raise AsmError(f"the register address {text} is not 0 to 0xFF")
    return Reg(value)


def _bit(text: str) -> int:
    value = assembler_number(text)
    found = register_bits().get(text.upper())
    if value is None and found is not None:
        value = found[1]
    if value is None or not 0 <= value <= 7:
        raise AsmError(f"'{text}' is not a bit, 0 to 7")
    return value


def _literal(text: str, names: Names) -> int | AddressByte:
    match = re.fullmatch(r"(?i)(?:(low|high)\s*)?\(?\s*([A-Za-z_]\w*)\s*(?:\+\s*(\d+))?\s*\)?", text)
    if match and assembler_number(text) is None:
        symbol = names(match[2])
        if symbol is not None:
            symbol.pinned = symbol.read = symbol.written = symbol.volatile = True
            return AddressByte(symbol, int(match[3] or 0), int((match[1] or "low").lower() == "high"))
        register = registers().get(match[2].upper())
        if register is not None:
            return register.address & 0x7F
    value = assembler_number(text)
    if value is None:
        raise AsmError(f"'{text}' is not a number from 0 to 255")
    if not -128 <= value <= 255:
        computed = "" if text == str(value) else f" {value},"
        raise AsmError(f"the literal {text} is{computed} not 0 to 255")
    return value & 0xFF
