"""Inline assembly before the parser: its blocks in the source text, macros in operands, constants.

In: the text of a source file; then the preprocessor's tokens and the definition of a macro at each point.
Out: text with the same lines, in which each block of assembly that is not an `asm("…")` is a numbered marker;
then the blocks with each operand that names a macro for numbers, registers or bits replaced by its expansion.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from servogen.compiler.diagnostics import Reporter
from servogen.errors import Location
from servogen.pic.assembler.expressions import evaluate, parse_expression
from servogen.pic.assembler.instructions import takes_label
from servogen.pic.assembler.messages import SourceError
from servogen.pic.assembler.text import Text
from servogen.pic.device import register_bits, registers

MARKER = "__servogen_asm"

_TOKEN = re.compile(
    r"""(?P<comment>//[^\n]*|/\*.*?(?:\*/|\Z))
      | (?P<string>"(?:[^"\\\n]|\\.)*"|'(?:[^'\\\n]|\\.)*')
      | (?P<hash>\#[ \t]*asm\b.*?(?:\#[ \t]*endasm\b[^\n]*|\Z))
      | (?P<sdcc>\b_?_asm\b(?!\s*(?:(?:__)?volatile(?:__)?\s*)?[({])
          (?:(?!\b_?_asm\b).)*?\b_?_endasm\b[ \t]*;?)
      | (?P<asm>\b(?:__asm__|__asm|_asm|asm)\b(?!\s*(?:(?:__)?volatile(?:__)?\s*)?\())
      | (?P<word>\b\w+\b)""",
    re.VERBOSE | re.DOTALL,
)


@dataclass(frozen=True, slots=True)
class AsmBlock:
    """Lines of assembly as (line number in the file, text)."""

    file: str
    lines: tuple[tuple[int, str], ...]


class _Lines:
    """Maps ascending positions in a text to line numbers in linear time."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.position, self.line = 0, 1

    def at(self, position: int) -> int:
        """Return the line number of a position, which must not precede the last one asked for."""
        self.line += self.text.count("\n", self.position, position)
        self.position = position
        return self.line


def rewrite(text: str, file: str, blocks: list[AsmBlock], reporter: Reporter) -> str:
    """Return the text in the form that the preprocessor accepts. Blocks of assembly are appended to
    `blocks`.
    """
    out: list[str] = []
    position = 0
    lines = _Lines(text)
    while match := _TOKEN.search(text, position):
        out.append(text[position : match.start()])
        position = match.end()
        comment = match["comment"]
        if comment and comment.startswith("/*") and (len(comment) < 4 or not comment.endswith("*/")):
            reporter.error(
                "c-syntax",
                "the comment is not closed",
                Location(file, lines.at(match.start())),
                hint="write '*/' where it ends",
            )
            out.append("\n" * comment.count("\n"))
        elif comment and ("/*" in comment[2:] or comment.endswith("\\")):
            inner = comment.find("/*", 2) if comment.startswith("/*") else -1
            if inner > 0 or comment.endswith("\\"):
                reporter.warn(
                    "c-comment",
                    "a comment begins inside a comment"
                    if inner > 0
                    else "'\\' at its end continues this comment on the next line",
                    Location(file, lines.at(match.start() + max(inner, 0))),
                    hint="the first '*/' ends both" if inner > 0 else None,
                )
            out.append(comment)
        elif match["hash"] and "endasm" in match["hash"]:
            body = match["hash"].split("\n", 1)
            inside = body[1].rsplit("\n", 1)[0] if len(body) > 1 and "\n" in body[1] else ""
            start = lines.at(match.start()) + 1
            out.append(_marker(blocks, file, start, inside) + "\n" * match["hash"].count("\n"))
        elif match["sdcc"]:
            inside = re.sub(r"^_?_asm|_?_endasm\s*;?$", "", match["sdcc"])
            start = lines.at(match.start())
            out.append(_marker(blocks, file, start, inside) + "\n" * match["sdcc"].count("\n"))
        elif match["asm"]:
            body_start, end = _asm_extent(text, position)
            inside = (
                text[body_start:end].strip("{}")
                if text[body_start : body_start + 1] == "{"
                else text[body_start:end]
            )
            start = lines.at(body_start)
            out.append(_marker(blocks, file, start, inside) + "\n" * text.count("\n", position, end))
            position = end
        else:
            out.append(match.group())
    out.append(text[position:])
    return "".join(out)


def _marker(blocks: list[AsmBlock], file: str, start: int, inside: str) -> str:
    """Add a block of assembly, and return the marker that stands for it."""
    lines = tuple(
        (start + number, line) for number, line in enumerate(inside.split("\n")) if _code(line).strip()
    )
    blocks.append(AsmBlock(file, lines))
    return f"{MARKER}({len(blocks) - 1});"


def _code(line: str) -> str:
    """Return an assembly line without its comment."""
    return re.split(r";|//", line, maxsplit=1)[0]


def _asm_extent(text: str, position: int) -> tuple[int, int]:
    """Return the start and end of what follows the word asm: a block in braces, or the rest of the line."""
    start = position
    brace = re.compile(r"\s*\{").match(text, position)
    if brace:
        end = text.find("}", brace.end())
        return brace.end() - 1, len(text) if end < 0 else end + 1
    end = text.find("\n", position)
    return start, len(text) if end < 0 else end


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
    """Return a text whose binary numbers are decimal, and without the suffixes of C's numbers."""
    return re.sub(r"\b(0[xX][0-9a-fA-F]+|\d+)[uUlL]+\b", r"\1", decimal(text))


_BINARY = re.compile(r"\b(?:0[bB]([01]+)(?=[uUlL]*\b)|([01]+)[bB]\b)")


def decimal(text: str) -> str:
    """Return a text whose binary numbers, 0b101 and C2C's 101b, are decimal."""
    return _BINARY.sub(lambda match: str(int(match[1] or match[2], 2)), text)


def hexadecimal(text: str) -> str:
    """Return a text whose binary numbers are hexadecimal, which in C have the same type."""
    return _BINARY.sub(lambda match: hex(int(match[1] or match[2], 2)), text)


def _operands(text: str) -> bool:
    """Return whether a text means the same in assembly as in C; 017, for one, does not."""
    return not re.search(r"\b0\d", text) and all(
        _of_the_chip(part.strip()) or assembler_number(part) is not None for part in text.split(",")
    )


def _of_the_chip(name: str) -> bool:
    return name.upper() in registers() or name.upper() in register_bits()


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
