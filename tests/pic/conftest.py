"""What the tests of the assembler share: the words and the remarks of a source."""

from __future__ import annotations

import pytest

from servogen.pic.assembler import Assembly, AssemblyError, assemble
from servogen.pic.device import DEVICES

FILE = "t.asm"
HEADER = " list p=16f84\n include <p16f84.inc>\n"


class Asm:
    """Short ways to assemble; `end` is added where a source needs it."""

    def assembled(self, source: str, *, header: bool = False) -> Assembly:
        return assemble(f"{HEADER if header else ''}{source}\n end\n", FILE, DEVICES[0])

    def words(self, source: str, *, header: bool = False) -> list[int]:
        """The program words by address; there must be no gap."""
        program = self.assembled(source, header=header).image.program
        assert list(program) == list(range(len(program)))
        return list(program.values())

    def word(self, instruction: str) -> int:
        """The one word of an instruction."""
        (found,) = self.words(f" {instruction}")
        return found

    def value(self, expression: str, *, before: str = "") -> int:
        """The low byte of an expression."""
        return self.words(f"{before}\n retlw low({expression})")[-1] & 0xFF

    def errors(self, source: str) -> list[str]:
        """The errors of a source as "line:column number text"."""
        try:
            assemble(source, FILE, DEVICES[0])
        except AssemblyError as error:
            return [
                f"{each.place.line}:{each.place.column} {each.number} {each.text}"
                for each in error.diagnostics
            ]
        return []

    def remarks(self, source: str) -> list[str]:
        """Warnings and messages as "line:column number"."""
        found = self.assembled(source).warnings
        return [f"{each.place.line}:{each.place.column} {each.number}" for each in found]


@pytest.fixture(scope="session")
def asm() -> Asm:
    return Asm()
