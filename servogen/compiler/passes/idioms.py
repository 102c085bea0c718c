"""Replaces sequences, also across skips, by the shorter ones of a table.

In: a `Function` and its liveness. Out: fewer instructions, and on no path more cycles: where nothing jumps,
an instruction takes one cycle whether it is skipped or not. A row of `IDIOMS` reads

    MOVWF a; MOVLW k; ANDWF a,F -> ANDLW k; MOVWF a [W]

`a` and `b` stand for two different bytes of RAM, `k` for any literal. What stands in brackets (W, a flag, a
byte) may hold anything afterwards, so that a row applies only where that is not needed.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache

from servogen.compiler.ast.nodes import Symbol
from servogen.compiler.ast.types import U8
from servogen.compiler.ir.function import Function, Line, is_skipped
from servogen.compiler.ir.instruction import DC, STATUS, Byte, C, Instruction, Z, exposed
from servogen.compiler.passes.liveness import C_BIT, D_BIT, W_BIT, Z_BIT, Liveness, is_private

IDIOMS = """
ADDWF a,F; SUBWF a,W; BTFSS C; INCF b,F -> ADDWF a,F; BTFSC C; INCF b,F [C D W Z]
MOVF a,W; MOVWF b; MOVLW k; ANDWF a,F; MOVF a,W -> MOVF a,W; MOVWF b; ANDLW k; ANDWF a,F
MOVWF a; MOVLW k; ANDWF a,W -> MOVWF a; ANDLW k
MOVWF a; MOVLW k; ANDWF a,F -> ANDLW k; MOVWF a [W]
MOVWF a; MOVLW k; ADDWF a,F -> ADDLW k; MOVWF a [W]
MOVF a,W; XORLW 255 -> COMF a,W
MOVLW 255; ANDWF a,W -> MOVF a,W
INCF a,F; MOVF a,W; XORLW 255 -> INCF a,F; INCF a,W [W]
DECF a,F; MOVF a,W -> DECF a,F [W]
ADDWF a,F; MOVF a,W -> ADDWF a,W [a]
MOVWF a; MOVF a,W -> ADDLW 0 [C D a]
BCF C; RLF a,W; MOVWF b; MOVF a,W -> MOVF a,W; MOVWF b; ADDWF b,F [D Z]
BCF C; RLF a,F; MOVF a,W -> MOVF a,W; ADDWF a,W [D a]
BCF C; RLF a,F; MOVF a,W -> MOVF a,W; ADDWF a,F [D W]
BCF C; RLF a,W; ADDLW 1 -> INCF a,W; ADDWF a,W [C D]
MOVWF a; BCF C; RLF a,F -> MOVWF a; ADDWF a,F [D Z]
MOVF a,W; MOVWF b; ADDWF b,F; ADDWF b,F; MOVF b,W -> MOVF a,W; ADDWF a,W; ADDWF a,W; MOVWF b
MOVF a,W; MOVWF b; ADDWF b,F; ADDWF b,F; MOVF b,W -> MOVF a,W; ADDWF a,W; ADDWF a,W [b]
MOVF a,W; MOVWF b; ADDWF b,F; ADDWF b,F; INCF b,W -> INCF a,W; ADDWF a,W; ADDWF a,W [C D b]
MOVF a,W; ADDWF a,F; ADDWF a,W; ADDLW 2 -> INCF a,W; ADDWF a,F; ADDWF a,W [C D a]
BCF C; RRF a,W -> RRF a,W [W]
RRF a,F; BCF C; RRF b,W -> RRF a,F; RRF b,W [W]
RRF a,F; RRF b,F; MOVF b,W -> RRF a,F; RRF b,W [Z b]
RRF a,W; RRF b,F; MOVF b,W -> RRF a,W; RRF b,W [Z b]
RLF a,F; MOVF a,W -> RLF a,W [Z a]
MOVF a,W; MOVWF b; BCF C; RRF b,F -> ADDLW 0; RRF a,W; MOVWF b [D W Z]
BCF C; RRF a,F; RRF b,F; RRF a,W -> RRF a,F; RRF b,F; RRF a,W [W a]
RRF a,W; RRF b,W; ANDLW 15 -> RRF b,W; ANDLW 15
RRF a,W; RRF b,F; RRF b,W; ANDLW 15 -> RRF b,F; RRF b,W; ANDLW 15 [b]
ADDLW k; RRF a,W -> RRF a,W [D W Z]
MOVF a,W; MOVWF b; RLF b,W; RRF b,F -> RLF a,W; RRF a,W; MOVWF b [W Z]
RRF a,F; RLF b,W; RRF b,W -> RRF a,F; RRF b,W [W]
RLF a,W; RRF a,F; RRF b,F; RRF a,W -> RRF a,F; RRF b,F; RRF a,W [W a]
MOVWF a; BCF C; RRF b,F; MOVF a,W -> ADDLW 0; RRF b,F [D a]
MOVWF a; MOVLW 0; BTFSC C; ADDLW 1 -> MOVWF a; RLF a,W; ANDLW 1 [C D Z]
RLF a,W; ANDLW 1; MOVWF b -> CLRF b; RLF b,F [C W Z]
MOVWF a; RLF a,W; ANDLW 1; ADDLW 255; MOVWF b; MOVF a,W -> CLRF b; RLF b,F; DECF b,F [C D Z a]
MOVLW 0; BTFSS C; ADDLW 1; SUBLW 0 -> MOVLW 255; BTFSC C; MOVLW 0 [D Z]
MOVLW 255; BTFSC C; MOVLW 0; MOVWF a -> CLRF a; RLF a,F; DECF a,F [C W Z]
MOVLW 0; BTFSS C; MOVLW 1; SUBWF a,W -> RLF a,W; IORWF a,W; ADDLW 255 [W Z]
MOVLW 1; SUBWF a,W; RLF b,W; IORWF b,W; ADDLW 255 -> MOVF b,W; IORWF a,W; ADDLW 255 [D W Z]
IORWF a,W; ADDLW 255; MOVLW 128; BTFSS C; MOVLW k -> IORWF a,W; MOVLW 128; BTFSC Z; MOVLW k [C D Z]
RLF a,W; IORWF a,W; ADDLW 255; BTFSS C; CLRF b -> RLF a,W; SUBWF a,F; BTFSC Z; ANDWF b,F [C D W Z a]
MOVF a,W; MOVLW 0; BTFSS Z; MOVLW k -> MOVF a,W; BTFSS Z; MOVLW k
MOVWF a; XORLW 255; BTFSC Z; CLRF a -> MOVWF a; INCFSZ a,F; DECF a,F [W Z]
INCF a,F; MOVF a,W; XORLW k; BTFSC Z; CLRF a -> MOVLW k; SUBWF a,F; INCFSZ a,F; ADDWF a,F [C D W Z]
ADDLW 0; MOVWF a -> MOVWF a [C D Z]
MOVF a,W; BTFSC C; ADDLW 1; ADDWF b,W -> RLF b,W; SUBWF b,W; SUBWF a,W [C D]
XORLW k; ADDLW 0 -> XORLW k [C D]
ADDWF a,F; BTFSC C; INCF b,F; MOVF a,W -> ADDWF a,W; BTFSC C; INCF b,F [Z a]
MOVF a,W; ADDWF b,W; ADDLW 1 -> INCF b,W; ADDWF a,W [C D]
MOVWF a; MOVLW k; ANDWF b,W; IORWF a,W -> IORWF b,F; IORLW k; ANDWF b,W [a b]
MOVWF a; CLRF b; BCF C; RLF a,F -> MOVWF a; ADDWF a,F; CLRF b [D]
MOVWF a; MOVLW k; ADDWF a,W -> MOVWF a; ADDLW k
MOVF a,W; XORLW 1 -> DECF a,W [W]
MOVWF a; MOVF b,W; ANDLW k; IORWF a,W; MOVWF b -> IORWF b,F; IORLW k; ANDWF b,F; MOVF b,W [a]
MOVWF a; MOVLW 0; BTFSC C; MOVLW 1 -> MOVWF a; RLF a,W; ANDLW 1 [C Z]
MOVF a,W; MOVWF b; ADDWF b,F; BCF C; RLF b,F -> MOVF a,W; ADDWF a,W; MOVWF b; ADDWF b,F [D W Z]
RLF a,W; RRF a,W -> RRF a,W [W]
MOVLW 0; IORWF a,W -> MOVF a,W
MOVLW 255; BTFSC C; MOVLW 0; ADDWF a,W -> BTFSS C; DECF a,F; MOVF a,W [C D a]
IORWF a,W; ADDLW 255; BTFSC C; INCF b,F -> IORWF a,W; BTFSS Z; INCF b,F [C D W Z]
"""

_TEXT = re.compile(r"(?P<op>[A-Z]+) (?:(?P<f>[abCZ])(?:,(?P<d>[WF]))?|(?P<k>k|\d+))")
_FLAGS = {"C": C, "D": DC, "Z": Z}
_LIVE = {"W": W_BIT, "C": C_BIT, "D": D_BIT, "Z": Z_BIT}
_BYTES = {name: Byte(Symbol(name, U8, "local"), 0) for name in "ab"}
"""What a row's instructions have in place of bytes."""
_ANY = -1
"""The literal of a row's instruction that stands for any."""


@dataclass(frozen=True, slots=True)
class Idiom:
    """`old` may be replaced by `new`, which is shorter, where what is in `dead` is not needed afterwards."""

    old: tuple[Instruction, ...]
    new: tuple[Instruction, ...]
    dead: frozenset[str]

    @classmethod
    def parse(cls, row: str) -> Idiom:
        sides, _, dead = row.rstrip("]").partition(" [")
        old, new = (tuple(map(_parsed, side.split("; "))) for side in sides.split(" -> "))
        return cls(old, new, frozenset(dead.split()))


def _parsed(text: str) -> Instruction:
    """Return the instruction of a row's text, such as "ADDWF a,F", "MOVLW 3", "BTFSC C"."""
    match = _TEXT.fullmatch(text)
    assert match is not None, text
    op, f, d, k = match.group("op", "f", "d", "k")
    if f in _FLAGS:
        return Instruction(op, STATUS, b=_FLAGS[f])
    return Instruction(op, _BYTES.get(f), int(d == "F"), k=_ANY if k == "k" else int(k or 0))


@cache
def _idioms() -> dict[tuple[str, str], list[Idiom]]:
    """Return the rows by their first two operations, those that save most first."""
    rows = sorted(map(Idiom.parse, IDIOMS.strip().splitlines()), key=lambda row: len(row.new) - len(row.old))
    by_begin: dict[tuple[str, str], list[Idiom]] = {}
    for row in rows:
        by_begin.setdefault((row.old[0].op, row.old[1].op), []).append(row)
    return by_begin


@dataclass(slots=True)
class _Meaning:
    """What the names of a row stand for in a function."""

    bytes: dict[Byte, Byte]
    literal: int | None = None

    def fits(self, row: Iterable[Instruction], lines: Iterable[Line]) -> bool:
        return all(self._fits(pattern, line) for pattern, line in zip(row, lines, strict=True))

    def _fits(self, pattern: Instruction, line: Line) -> bool:
        """Return whether a line is what an instruction of a row stands for; note what its names stand for."""
        if not isinstance(line, Instruction) or line.fixed:
            return False
        if (line.op, line.d, line.b) != (pattern.op, pattern.d, pattern.b):
            return False
        if not isinstance(pattern.f, Byte):
            if pattern.k != _ANY or not isinstance(line.k, int):
                return line.f == pattern.f and line.k == pattern.k
            self.literal = line.k if self.literal is None else self.literal
            return line.k == self.literal
        if not isinstance(line.f, Byte) or exposed(line.f) or line.f.symbol.kind == "fixed":
            return False
        if pattern.f not in self.bytes and line.f in self.bytes.values():
            return False
        return self.bytes.setdefault(pattern.f, line.f) == line.f

    def filled(self, pattern: Instruction, first: Instruction) -> Instruction:
        """Return an instruction of a row as it stands in the function."""
        f = self.bytes[pattern.f] if isinstance(pattern.f, Byte) else pattern.f
        k = self.literal if pattern.k == _ANY and self.literal is not None else pattern.k
        return replace(pattern, f=f, k=k, place=first.place)

    def needs(self, names: Iterable[str], last: Instruction, live: Liveness) -> bool:
        """Return whether one of the names is needed after an instruction."""
        after = live.after[last]
        for name in names:
            byte = self.bytes[_BYTES[name]] if name in _BYTES else None
            if after & _LIVE[name] if byte is None else not is_private(byte) or after & live.bit(byte):
                return True
        return False


def shorten_idioms(function: Function) -> bool:
    """Run the pass once; return whether something changed."""
    live = cache(lambda: Liveness(function))  # most functions have no place for any row
    lines = list(function.lines())
    out: list[Line] = []
    index, changed = 0, False
    while index < len(lines):
        shorter = None if is_skipped(lines, index) else _replacement(lines, index, live)
        if shorter is not None:
            new, replaced = shorter
            out += new
            index += replaced
            changed = True
        # liveness behind a match is as before, within it is not: the next match begins one line later
        out += lines[index : index + 1]
        index += 1
    if changed:
        function.replace(out)
    return changed


def _replacement(
    lines: Sequence[Line], index: int, live: Callable[[], Liveness]
) -> tuple[list[Instruction], int] | None:
    """Return what replaces the lines from an index on, and how many it replaces.

    A row has no label, does not end with a skip, and others cannot see what it changes.
    """
    match lines[index : index + 2]:
        case [Instruction() as first, Instruction(op=second)]:
            rows = _idioms().get((first.op, second), ())
        case _:
            return None
    for row in rows:
        old = lines[index : index + len(row.old)]
        meaning = _Meaning({})
        if len(old) < len(row.old) or not meaning.fits(row.old, old):
            continue
        last = old[-1]
        assert isinstance(last, Instruction)
        if not meaning.needs(row.dead, last, live()):
            return [meaning.filled(pattern, first) for pattern in row.new], len(old)
    return None
