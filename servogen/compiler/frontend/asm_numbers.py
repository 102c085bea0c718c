"""Constants of inline assembly.

In: an operand's text. Out: its value, if it consists of numbers only.
"""

from __future__ import annotations

import re

from servogen.pic.assembler.expressions import evaluate, parse_expression
from servogen.pic.assembler.messages import SourceError
from servogen.pic.assembler.text import Text


class _NoNames:
    """A symbol table without names, because constants consist of numbers only."""

    here = 0

    def value(self, name: str) -> int | None:
        return None

    def hint(self, name: str) -> str | None:
        return None


RADIX = 10
"""Numbers in inline assembly are decimal unless they say otherwise."""


def binary_constants(text: str) -> str:
    """Return assembly with C's constants such as 0b101 in the assembler's notation."""
    return re.sub(r"\b0[bB]([01]+)\b", r"B'\1'", text)


def assembler_number(text: str) -> int | None:
    """Return a constant as the assembler computes it, `(1500 - 14) / 1000 + 1`; C's 0b101 is accepted too."""
    try:
        expression = parse_expression(Text.of(binary_constants(text)), RADIX)
        return evaluate(expression, _NoNames())
    except SourceError:
        return None
