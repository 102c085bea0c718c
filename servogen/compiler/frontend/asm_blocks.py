"""Rewrites in the source text, line for line, what the C preprocessor cannot read.

In: the text of a source file. Out: text with the same lines, in which binary constants are hexadecimal ones
padded to the same columns and each block of assembly that is not an `asm("…")` is a numbered marker.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from servogen.compiler.diagnostics import Reporter
from servogen.errors import Location

MARKER = "__servogen_asm"

_TOKEN = re.compile(
    r"""(?P<comment>//[^\n]*|/\*.*?(?:\*/|\Z))
      | (?P<string>"(?:[^"\\\n]|\\.)*"|'(?:[^'\\\n]|\\.)*')
      | (?P<hash>\#[ \t]*asm\b.*?(?:\#[ \t]*endasm\b[^\n]*|\Z))
      | (?P<sdcc>\b_?_asm\b(?!\s*(?:(?:__)?volatile(?:__)?\s*)?[({])
          (?:(?!\b_?_asm\b).)*?\b_?_endasm\b[ \t]*;?)
      | (?P<asm>\b(?:__asm__|__asm|_asm|asm)\b(?!\s*(?:(?:__)?volatile(?:__)?\s*)?\())
      | (?P<binary>\b(?:0[bB][01]+[uUlL]*|[01]+[bB])\b)
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
        elif match["binary"]:
            out.append(_hexadecimal(match["binary"]))
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


def _hexadecimal(constant: str) -> str:
    """Return a binary constant as a hexadecimal one, padded to the same width."""
    bare = constant.rstrip("uUlL")
    digits = bare[2:] if bare[1:2] in "bB" and len(bare) > 2 else bare[:-1]
    value = int(digits, 2)
    shown = str(value) if value < 10 else f"0x{value:X}"
    return (shown + constant[len(bare) :]).ljust(len(constant))


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
