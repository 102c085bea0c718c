"""The assembler: MPASM's language for the PIC16F84 and PIC16F84A, and one line of it for inline assembly.

`Assembly`, `assemble` and `beside` are imported when they are first used: the compiler needs only the line.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from servogen.pic.assembler.expressions import (
    BinaryOperation,
    Expression,
    Here,
    Name,
    Number,
    String,
    SymbolScope,
    UnaryOperation,
    evaluate,
)
from servogen.pic.assembler.instructions import (
    ParsedInstruction,
    ParsedLine,
    encode_instruction,
    mnemonics,
    parse_line,
)

if TYPE_CHECKING:
    from servogen.pic.assembler.assembly import Assembly, assemble, beside

__all__ = [
    "Assembly",
    "BinaryOperation",
    "Expression",
    "Here",
    "Name",
    "Number",
    "ParsedInstruction",
    "ParsedLine",
    "String",
    "SymbolScope",
    "UnaryOperation",
    "assemble",
    "beside",
    "encode_instruction",
    "evaluate",
    "mnemonics",
    "parse_line",
]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(import_module("servogen.pic.assembler.assembly"), name)
