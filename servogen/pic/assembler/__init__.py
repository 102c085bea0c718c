"""The assembler: MPASM's language for the PIC16F84 and PIC16F84A, and one line of it for inline assembly."""

from servogen.pic.assembler.assemble import Assembly, assemble, beside
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
