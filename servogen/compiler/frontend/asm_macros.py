"""Expansion of macros in assembly.

In: the preprocessor's tokens, the blocks of assembly, the definition of a macro at that point. Out: the same
tokens and blocks, with each operand that names a macro for numbers, registers or bits replaced by its
expansion.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Callable, Iterator
from typing import Any

from servogen.compiler.frontend.asm_blocks import MARKER, AsmBlock
from servogen.compiler.frontend.asm_numbers import assembler_number
from servogen.pic.assembler.instructions import takes_label
from servogen.pic.device import register_bits, registers

Value = Callable[[str], str | None]
"""The expanded text of an object-like macro; None when there is none of that name."""

_LINE = re.compile(r"(\s*(?:[A-Za-z_.$][\w.$]*\s*:)?\s*[A-Za-z_]\w*\s)(.*?)(?=;|//|/\*|$)", re.DOTALL)
_OWN = frozenset(("W", "F", "OPTION"))


def assembly_macros(stream: Iterator[Any], blocks: list[AsmBlock], value: Value) -> Iterator[Any]:
    """Return the tokens of a file; `value` is queried as they pass: macros change in between."""
    within = ""
    for tok in stream:
        if tok.value in (MARKER, "asm", "__asm", "__asm__"):
            within = tok.value
        elif tok.value == ";":
            within = ""
        elif within == MARKER and tok.value.isdigit():
            # a macro may hold the block and be used again: it stays as it is, beside the new one
            block = blocks[int(tok.value)]
            lines = tuple((line, replace_macros(text, value)) for line, text in block.lines)
            blocks.append(AsmBlock(block.file, lines))
            tok = copy.copy(tok)
            tok.value = str(len(blocks) - 1)
            within = ""
        elif within and tok.value.startswith('"'):
            tok = copy.copy(tok)
            texts = [replace_macros(text, value) for text in tok.value[1:-1].split("\\n")]
            tok.value = '"' + "\\n".join(texts) + '"'
        yield tok


def replace_macros(line: str, value: Value) -> str:
    """Return a line of assembly with the macros in its operands expanded, except where the operand is a
    label.
    """
    match = _LINE.match(line)
    if not match or takes_label(match[1].split()[-1]):
        return line

    def replaced(word: re.Match[str]) -> str:
        name = word[0]
        if name.upper() in _OWN or _of_the_chip(name):
            return name
        text = value(name)
        return text if text is not None and _operands(text) else name

    operands = re.sub(r"(?<![\w'.])[A-Za-z_]\w*(?!['\w])", replaced, match[2])
    return match[1] + operands + line[match.end() :]


def plain_numbers(text: str) -> str:
    """Return a text with the suffixes of C's numbers removed."""
    return re.sub(r"\b(0[xX][0-9a-fA-F]+|\d+)[uUlL]+\b", r"\1", text)


def _operands(text: str) -> bool:
    """Return whether a text means the same in assembly as in C; 017, for one, does not."""
    return not re.search(r"\b0\d", text) and all(
        _of_the_chip(part.strip()) or assembler_number(part) is not None for part in text.split(",")
    )


def _of_the_chip(name: str) -> bool:
    return name.upper() in registers() or name.upper() in register_bits()
