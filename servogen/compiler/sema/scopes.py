"""Names and their meanings: block scopes on top of the chip's registers and bits.

In: declarations as they are read. Out: the meaning of a name: variable, function, type, enumeration constant,
register bit.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from servogen.compiler.ast.nodes import FunctionDefinition, Symbol
from servogen.compiler.ast.types import U8, CType, StructLayout
from servogen.compiler.diagnostics import Fatal
from servogen.compiler.frontend.dialects import ChipBit, chip_bits, chip_registers
from servogen.compiler.frontend.extensions import Rewritten
from servogen.errors import Location
from servogen.pic.device import BOTH_BANKS, Register


@dataclass(frozen=True, slots=True)
class TypeName:
    """The meaning of a typedef's name or of an enumeration's tag."""

    type: CType


@dataclass(frozen=True, slots=True)
class Constant:
    """The meaning of an enumeration constant."""

    value: int
    type: CType


@dataclass(frozen=True, slots=True)
class BitAlias:
    """The meaning of a bit variable with a fixed address: a bit of another variable or of a register."""

    symbol: Symbol
    bit: int
    place: Location


@dataclass(frozen=True, slots=True)
class Lost:
    """The meaning of a name in a declaration that has been reported as wrong."""


Meaning = Symbol | FunctionDefinition | TypeName | Constant | ChipBit | BitAlias


@dataclass(slots=True)
class Scope:
    """The names and tags that one block, or a file, declares (ISO C 6.2.1, 6.2.3)."""

    names: dict[str, Meaning | Lost] = field(default_factory=dict)
    tags: dict[str, StructLayout | TypeName] = field(default_factory=dict)


class Scopes:
    """A stack of scopes; the chip's names lie below the first."""

    def __init__(self, source: Rewritten) -> None:
        self.source = source
        """The file: what its extensions say of the names in it."""
        self.stack: list[Scope] = [Scope()]
        self._registers: dict[str, Symbol] = {}

    @contextmanager
    def block(self) -> Iterator[None]:
        """Open the scope of a block, and close it however the block is left."""
        self.stack.append(Scope())
        try:
            yield
        finally:
            self.stack.pop()

    @property
    def here(self) -> Scope:
        return self.stack[-1]

    @property
    def file_level(self) -> bool:
        return len(self.stack) == 1

    def find(self, name: str) -> Meaning | None:
        """Return the meaning of a name: the innermost declaration, or else the chip's. What uses a name whose
        declaration is wrong is abandoned: it would be reported for the same reason.
        """
        for scope in reversed(self.stack):
            if name in scope.names:
                meaning = scope.names[name]
                if isinstance(meaning, Lost):
                    raise Fatal(name)
                return meaning
        return self.chip(name)

    def tag(self, name: str) -> StructLayout | TypeName | None:
        for scope in reversed(self.stack):
            if name in scope.tags:
                return scope.tags[name]
        return None

    def chip(self, name: str) -> Meaning | None:
        """Return a register (as a variable at its address) or a register's bit; None for other names."""
        register = chip_registers().get(name)
        return self.register(register) if register is not None else chip_bits().get(name)

    def register(self, register: Register) -> Symbol:
        # one symbol for each register, so that all uses of it compare equal
        """Return the variable that a special function register is."""
        if register.name not in self._registers:
            self._registers[register.name] = Symbol(
                register.name,
                U8,
                "fixed",
                Location(),
                address=register.address,
                bank1=bool(register.address & 0x80) and register.name not in BOTH_BANKS,
                volatile=True,
                pinned=True,
            )
        return self._registers[register.name]

    def known(self) -> list[str]:
        names = [name for scope in self.stack for name in scope.names]
        return names + [name for name in chip_registers() if name.isupper()]
