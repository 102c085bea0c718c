"""The names of a source and their values, kept from the first pass to the second.

A name is a constant (`equ`, `constant`, a `cblock` entry), a label (an address) or a variable (`set`); what
`local` declares belongs to one call of a macro.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from servogen.pic.assembler.messages import SourceError

Kind = Literal["constant", "label", "variable"]


@dataclass(slots=True)
class AssemblerSymbol:
    value: int
    kind: Kind
    in_pass: int
    """The pass that gave the value last."""


Table = dict[str, AssemblerSymbol | None]
"""None stands for a name that `local` declared and that has no value yet."""


class Symbols:
    def __init__(self) -> None:
        self._globals: Table = {}
        self._calls: list[Table] = []
        """The local names of each macro call, in order: the second pass finds those of the first again."""
        self._open: list[Table] = []
        self._entered = 0
        self.in_pass = 1

    def second_pass(self) -> None:
        self.in_pass = 2
        self._entered = 0
        self._open = []

    def enter(self) -> None:
        """Begin the local names of a macro call."""
        if self._entered == len(self._calls):
            self._calls.append({})
        self._open.append(self._calls[self._entered])
        self._entered += 1

    def leave(self) -> None:
        self._open.pop()

    def declare_local(self, name: str) -> None:
        if not self._open:
            raise SourceError("asm-unexpected-directive", "local is allowed in a macro only")
        self._open[-1].setdefault(name, None)

    def find(self, name: str) -> AssemblerSymbol | None:
        return self._table(name).get(name)

    def is_local(self, name: str) -> bool:
        """Return whether `local` declared the name in a macro that is being expanded."""
        return any(name in table for table in self._open)

    def defined(self, name: str) -> bool:
        return self.find(name) is not None

    def in_this_pass(self, name: str) -> bool:
        symbol = self.find(name)
        return symbol is not None and symbol.in_pass == self.in_pass

    def define(self, name: str, value: int, kind: Kind, column: int) -> None:
        """Assign a value to a name. A constant or label can have only one value, the same in both passes."""
        table = self._table(name)
        old = table.get(name)
        if old is not None and "variable" not in (kind, old.kind) and old.value != value:
            if old.in_pass == self.in_pass:
                text = f"'{name}' is defined already, as {_hexadecimal(old.value)}"
                raise SourceError("asm-duplicate-symbol", text, column)
            table[name] = AssemblerSymbol(value, kind, self.in_pass)
            raise SourceError(
                "asm-phase",
                f"'{name}' is {_hexadecimal(old.value)} in pass 1, {_hexadecimal(value)} in pass 2: "
                "what stands before it depends on a name that is defined later",
                column,
            )
        table[name] = AssemblerSymbol(value, kind, self.in_pass)

    def names(self) -> Iterator[str]:
        for table in (*self._open, self._globals):
            yield from (name for name, symbol in table.items() if symbol is not None)

    def addresses(self) -> dict[str, int]:
        """Return the global labels and their addresses."""
        return {
            name: symbol.value
            for name, symbol in self._globals.items()
            if symbol is not None and symbol.kind == "label"
        }

    def _table(self, name: str) -> Table:
        return next((table for table in reversed(self._open) if name in table), self._globals)


def _hexadecimal(value: int) -> str:
    return f"0x{value & 0xFFFFFFFF:X}"
