"""What XC8's files have in common: the names that it gives to functions, variables and its own places.

In: the sections, symbols and lines of a program, from the reader of one file. Out: `ProgramNames`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from servogen.pic.device import PROGRAM_WORDS, RAM_LAST, register_bits
from servogen.pic.symbols.names import ProgramNames, by_address, in_ram, sized

Space = Literal["program", "ram", "absolute"]

_INTERNAL = re.compile(r"__|[lu]\d+$")
"""The names that the compiler and the linker give to places in the program."""
_OTHER_BITS = ("CARRY", "ZERO")
"""Bits of STATUS that XC8's header names otherwise."""
END = "__end_of"
"""`__end_of_main` is the address after the function `_main`."""


@dataclass
class Xc8Program:
    """What a file has said so far. Addresses are of words in the program and of bytes in RAM."""

    words: dict[int, int | None] = field(default_factory=dict)
    code: dict[str, int] = field(default_factory=dict)
    variables: set[tuple[int, str]] = field(default_factory=set)
    marks: set[int] = field(default_factory=set)
    """Where the compiler's own blocks begin in RAM."""
    sections: list[range] = field(default_factory=list)
    lines: dict[int, tuple[str, int]] = field(default_factory=dict)

    def section(self, space: Space, start: int, size: int, words: Mapping[int, int] | None = None) -> None:
        """Add a section; what its words are if the file says so."""
        if space == "ram":
            self.sections.append(range(start, min(start + size, RAM_LAST + 1)))
        else:
            self.words |= words or dict.fromkeys(range(start, min(start + size, PROGRAM_WORDS)))

    def line(self, address: int, source: str, line: int) -> None:
        if address < PROGRAM_WORDS and source and line:
            self.lines[address] = (source, line)

    def symbol(self, name: str, at: int, space: Space) -> None:
        byte = in_ram(at)
        if space == "program":
            if at < PROGRAM_WORDS:
                self.code.setdefault(name, at)
        elif byte is not None and _is_variable(name) and not (space == "absolute" and _is_bit(name)):
            self.variables.add((byte, name.replace("@", ".")))  # `main.i`, as this compiler lists it
        elif byte is not None and space == "ram":
            self.marks.add(byte)

    def names(self) -> ProgramNames:
        labels = [(name, at) for name, at in self.code.items() if not _INTERNAL.match(name)]
        ends = {name: self.code.get(END + name, 0) for name in self.code}
        functions = [(name, at, ends[name]) for name, at in self.code.items() if at < ends[name]]
        return ProgramNames(
            self.words,
            by_address(labels),
            tuple(sorted(functions, key=lambda function: function[1])),
            sized(self.variables, self.sections, self.marks),
            self.lines,
        )


def _is_variable(name: str) -> bool:
    """Return whether a symbol in RAM is the program's: `_duty`, `main@i`; not the compiler's `btemp`,
    `__pcstackBANK0` and `??_main`.
    """
    return "@" in name or (name.startswith("_") and not name.startswith("__"))


def _is_bit(name: str) -> bool:
    """Return whether a symbol is a bit of a register: the value of `_RB0` is 8 times the address of PORTB."""
    return name.removeprefix("_") in register_bits() or name.removeprefix("_") in _OTHER_BITS
