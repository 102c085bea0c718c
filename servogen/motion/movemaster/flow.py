"""The order in which program lines run: jumps, loops (RC/NX) and subroutines (GS/RT).

In: the program lines and where to begin and end. Out: the next statement, one at a time. Loops belong to the
subroutine that opened them: RT closes those still open.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from servogen.errors import InputError
from servogen.motion.movemaster.language import DEEPEST
from servogen.motion.movemaster.parse import Statement

JUMPS: Mapping[str, int] = {"GT": 0, "GS": 0, "EQ": 1, "NE": 1, "LG": 1, "SM": 1, "TB": 1}
"""Commands that go to a line, and which of their arguments is its number."""


@dataclass(slots=True)
class _Loop:
    """An open loop: its RC, the line after it, and how often it still runs after this time."""

    start: Statement
    body: int
    left: int


@dataclass(slots=True)
class _Level:
    """The program itself or a subroutine: where its GS goes on, and its open loops."""

    back: int = 0
    loops: list[_Loop] = field(default_factory=list)


class Flow:
    """One run of a program. Raises InputError at once for a jump to a line that there is none of."""

    def __init__(self, program: Mapping[int, Statement], first: int, last: int | None) -> None:
        self._lines = [program[number] for number in sorted(program)]
        self._index = {line.number: index for index, line in enumerate(self._lines)}
        for number in (first, last):
            if number is not None and number not in self._index:
                raise InputError(f"there is no program line {number}", hint=self._known(number))
        for line in self._lines:
            if line.command and line.command.mnemonic in JUMPS:
                self._check(line, line.whole(JUMPS[line.command.mnemonic]))
        self._next = self._index[first]
        self._end = len(self._lines) if last is None else self._index[last]
        self._levels = [_Level()]

    def take(self) -> Statement | None:
        """The statement to run now; None: the program has ended."""
        if self._next == self._end or self._next >= len(self._lines):
            return None
        self._next += 1
        return self._lines[self._next - 1]

    def end(self) -> None:
        self._next = len(self._lines)

    def go_to(self, number: int) -> None:
        self._next = self._index[number]

    def call(self, number: int) -> None:
        if len(self._levels) > DEEPEST:
            raise InputError(
                f"subroutines are called {len(self._levels)} deep: {DEEPEST} is the most",
                hint="a subroutine ends with RT; GT does not leave it",
            )
        self._levels.append(_Level(self._next))
        self.go_to(number)

    def give_back(self) -> None:
        if len(self._levels) == 1:
            raise InputError("RT without a GS", hint="GS calls a subroutine, RT ends it; ED ends the program")
        self._next = self._levels.pop().back

    def open_loop(self, statement: Statement, times: int) -> None:
        loops = self._levels[-1].loops
        for index, loop in enumerate(loops):
            if loop.start is statement:  # jumped back to: it begins anew
                del loops[index:]
                break
        if sum(len(level.loops) for level in self._levels) == DEEPEST:
            raise InputError(f"loops are nested deeper than {DEEPEST}", hint="each RC needs its NX")
        loops.append(_Loop(statement, self._next, times - 1))

    def close_loop(self) -> None:
        loops = self._levels[-1].loops
        if not loops:
            raise InputError("NX without an RC", hint="RC n opens a loop, NX closes it")
        if loops[-1].left:
            loops[-1].left -= 1
            self._next = loops[-1].body
        else:
            loops.pop()

    def _check(self, line: Statement, target: int) -> None:
        if target not in self._index:
            raise line.error(f"there is no program line {target} to go to", self._known(target))

    def _known(self, number: int) -> str:
        numbers = [line.number or 0 for line in self._lines]
        near = sorted(sorted(numbers, key=lambda each: abs(each - number))[:4])
        if not near:
            return "the program stands before RN in the file, each line with its number"
        return f"near it are the lines {', '.join(map(str, near))}"
