"""What the tests of the assembler share: the words and the remarks of a source."""

from __future__ import annotations

import pytest

from servogen.errors import InputError
from servogen.pic.assembler import Assembly, assemble
from servogen.pic.device import DEVICES

FILE = "t.asm"

MPASM = {
    "asm-user-error": 100,
    "asm-syntax": 101,
    "asm-include": 102,
    "asm-parenthesis": 107,
    "asm-undefined-symbol": 113,
    "asm-divide-by-zero": 114,
    "asm-duplicate-symbol": 115,
    "asm-phase": 116,
    "asm-overwrite": 118,
    "asm-label": 121,
    "asm-unknown-operation": 122,
    "asm-else-if": 122,
    "asm-unexpected-directive": 123,
    "asm-bad-argument": 124,
    "asm-argument-range": 126,
    "asm-too-many-arguments": 127,
    "asm-missing-argument": 128,
    "asm-macro-arguments": 128,
    "asm-unclosed-block": 129,
    "asm-missing-name": 130,
    "asm-endless-loop": 131,
    "asm-too-complex": 132,
    "asm-relocatable": 149,
    "asm-section": 152,
    "unknown-device": 180,
    "asm-config": 181,
    "asm-unknown-symbol": 201,
    "asm-argument-truncated": 202,
    "asm-opcode-column": 203,
    "asm-no-end": 205,
    "asm-label-column": 207,
    "asm-unclosed-quote": 209,
    "asm-unclosed-if": 212,
    "asm-processor": 215,
    "asm-no-register": 219,
    "asm-address-range": 220,
    "asm-address-truncated": 220,
    "asm-deprecated": 224,
    "asm-defined-later": 230,
    "asm-user-message": 301,
    "asm-bank": 302,
    "asm-word-truncated": 303,
    "asm-id-truncated": 304,
    "asm-no-destination": 305,
    "asm-page": 312,
}
"""MPASM's numbers (DS33014, appendix "Errors, warnings, messages")."""
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
        except InputError as error:
            return [
                f"{each.location.line}:{each.location.column} {MPASM[each.code]} {each.message}"
                for each in error.diagnostics
                if each.location
            ]
        return []

    def remarks(self, source: str) -> list[str]:
        """Warnings and messages as "line:column number"."""
        found = self.assembled(source).warnings
        return [
            f"{each.location.line}:{each.location.column} {MPASM[each.code]}"
            for each in found
            if each.location
        ]


@pytest.fixture(scope="session")
def asm() -> Asm:
    return Asm()
