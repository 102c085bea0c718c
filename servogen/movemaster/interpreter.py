"""The controller: executes statements in order, direct ones at once, programs line by line.

In: statements, one after another. Out: the resulting contents of `Mover`, `Memory` and the output record. A
program that does not end is stopped after a number of commands or of frames.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from servogen.errors import Diagnostic, InputError
from servogen.movemaster.language import DEEPEST
from servogen.movemaster.memory import OPEN, Memory, Pose
from servogen.movemaster.mover import Mover
from servogen.movemaster.parser import Statement
from servogen.movemaster.ports import InputPort, Output


@dataclass(frozen=True, slots=True)
class Step:
    """A command that took time: `frames` frames from `frame` on, and the resulting state of tool and hand."""

    statement: Statement
    frame: int
    frames: int
    pose: Pose
    hand: str


Action = Callable[["Controller", Statement], None]
"""What a command does to the controller."""


class Controller:
    """One controller with its arm, from power-on; `actions` by mnemonic."""

    def __init__(
        self, mover: Mover, inputs: InputPort, max_commands: int, actions: Mapping[str, Action]
    ) -> None:
        self.mover = mover
        self.inputs = inputs
        self.max_commands = max_commands
        self.actions = actions
        self.memory = Memory()
        self.program: dict[int, Statement] = {}
        self.stored_hand = OPEN
        self.reference: Pose | None = None
        self.current = 0
        self.output = 0
        self.outputs: list[Output] = []
        self.steps: list[Step] = []
        self.warnings: list[Diagnostic] = []
        self.commands = 0
        self._flow: Flow | None = None

    @property
    def flow(self) -> Flow:
        if self._flow is None:
            raise InputError("no-program", "no program runs")
        return self._flow

    def take(self, statement: Statement) -> None:
        """Execute a direct statement, or store a numbered one as a program line."""
        if statement.number is None:
            self._carry_out(statement)
            return
        if statement.number in self.program:
            other = self.program[statement.number].place
            raise statement.error(
                "duplicate-name",
                f"program line {statement.number} is given twice",
                f"the other one is at {other}",
            )
        self.program[statement.number] = statement

    def run_program(self, first: int, last: int | None) -> None:
        """Run from line `first` until the program ends or reaches line `last`."""
        self._flow = Flow(self.program, first, last)
        while (statement := self._flow.take()) is not None:
            if statement.command is not None:
                self._count(statement)
                self._carry_out(statement)
        self._flow = None

    def write(self, value: int, strobe: bool) -> None:
        self.output = value
        self.outputs.append(Output(self.mover.frame, value, strobe))

    def warn(self, warning: Diagnostic) -> None:
        """Report a warning, once per kind and location."""
        if warning not in self.warnings:
            self.warnings.append(warning)

    def kept(self) -> tuple[object, ...]:
        """Return everything that determines what happens next, for comparison."""
        reference = self.reference.values if self.reference else None
        here = (self.stored_hand, reference, self.current, self.output)
        return (*self.memory.kept(), *self.mover.kept(), *here)

    def _count(self, statement: Statement) -> None:
        self.commands += 1
        if self.commands > self.max_commands:
            raise statement.error(
                "program-too-long",
                f"the program has not ended after {self.max_commands} commands",
                "end it with ED; what should go on for ever is repeated by its job; or allow more commands",
            )

    def _carry_out(self, statement: Statement) -> None:
        if statement.command is None:
            return
        before, said = self.mover.frame, len(self.mover.warnings)
        try:
            self.actions[statement.command.mnemonic](self, statement)
        except InputError as error:
            if error.location is None:
                raise error.at(statement.place) from error
            raise
        for warning in self.mover.warnings[said:]:
            if warning.location is None:
                self.warn(replace(warning, location=statement.place))
        if self.mover.frame > before and statement.command.mnemonic != "RN":
            frames = self.mover.frame - before
            self.steps.append(Step(statement, before, frames, self.mover.pose, self.mover.hand_state))


JUMPS: Mapping[str, int] = {"GT": 0, "GS": 0, "EQ": 1, "NE": 1, "LG": 1, "SM": 1, "TB": 1}
"""Commands that go to a line, and which of their arguments is its number."""


_OPENS: Mapping[str, int] = {"RC": 1, "NX": -1}
"""How many loops are open after a command more than before it."""


@dataclass(slots=True)
class _Loop:
    """An open loop: its RC, the line after it, and the number of further repetitions."""

    start: Statement
    body: int
    left: int


@dataclass(slots=True)
class _Level:
    """The program itself or a subroutine: where its GS continues, and its open loops."""

    back: int = 0
    loops: list[_Loop] = field(default_factory=list)


class Flow:
    """One run of a program. Raises InputError immediately for a jump to a missing line, and for RC without
    NX.
    """

    def __init__(self, program: Mapping[int, Statement], first: int, last: int | None) -> None:
        self._lines = [program[number] for number in sorted(program)]
        self._index = {line.number: index for index, line in enumerate(self._lines)}
        for number in (first, last):
            if number is not None and number not in self._index:
                raise InputError(
                    "unknown-line", f"there is no program line {number}", hint=self._known(number)
                )
        for line in self._lines:
            if line.command and line.command.mnemonic in JUMPS:
                self._check(line, line.whole(JUMPS[line.command.mnemonic]))
        self._next = self._index[first]
        self._end = len(self._lines) if last is None else self._index[last]
        self._check_loops()
        self._levels = [_Level()]

    def take(self) -> Statement | None:
        """Return the statement to run now; None if the program has ended."""
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
                "program-nesting",
                f"subroutines are called {len(self._levels)} deep: {DEEPEST} is the maximum",
                hint="a subroutine ends with RT; GT does not leave it",
            )
        self._levels.append(_Level(self._next))
        self.go_to(number)

    def give_back(self) -> None:
        if len(self._levels) == 1:
            raise InputError(
                "program-nesting",
                "RT without a GS",
                hint="GS calls a subroutine, RT ends it; ED ends the program",
            )
        self._next = self._levels.pop().back

    def open_loop(self, statement: Statement, times: int) -> None:
        loops = self._levels[-1].loops
        for index, loop in enumerate(loops):
            if loop.start is statement:  # reached by a jump back: the loop begins again
                del loops[index:]
                break
        if sum(len(level.loops) for level in self._levels) == DEEPEST:
            raise InputError(
                "program-nesting", f"loops are nested deeper than {DEEPEST}", hint="each RC needs its NX"
            )
        loops.append(_Loop(statement, self._next, times - 1))

    def close_loop(self) -> None:
        loops = self._levels[-1].loops
        if not loops:
            raise InputError("program-nesting", "NX without an RC", hint="RC n opens a loop, NX closes it")
        if loops[-1].left:
            loops[-1].left -= 1
            self._next = loops[-1].body
        else:
            loops.pop()

    def _check(self, line: Statement, target: int) -> None:
        if target not in self._index:
            raise line.error(
                "unknown-line", f"there is no program line {target} to go to", self._known(target)
            )

    def _check_loops(self) -> None:
        """Raise InputError for a reachable RC from which no path leads to the NX that closes its loop.

        The search goes backwards from the states (line, open loops) in which NX closes the last loop, along
        all paths through the program regardless of its conditions. Excessive nesting is rejected at run time.
        """
        before: dict[tuple[int, int], list[tuple[int, int]]] = {}
        found: list[tuple[int, int]] = []
        for index, line in enumerate(self._lines):
            for depth in range(1, DEEPEST + 1):
                deeper = depth + _OPENS.get(_mnemonic(line), 0)
                if deeper == 0 or deeper > DEEPEST:
                    found.append((index, depth))
                for target in self._after(index):
                    before.setdefault((target, deeper), []).append((index, depth))
        closed = set(found)
        while found:
            for state in before.get(found.pop(), ()):
                if state not in closed:
                    closed.add(state)
                    found.append(state)
        for index in sorted(self._run()):
            line = self._lines[index]
            if _mnemonic(line) == "RC" and (index + 1, 1) not in closed:
                raise line.error(
                    "program-nesting",
                    "RC without an NX: nothing closes this loop",
                    "RC n opens a loop, NX closes it",
                )

    def _after(self, index: int) -> list[int]:
        """Return the lines that a line leads to in its subroutine; none at the end of the program or
        subroutine.
        """
        line, mnemonic = self._lines[index], _mnemonic(self._lines[index])
        if mnemonic in ("ED", "RT"):
            return []
        # GS returns to the next line with the loops that were open before it
        targets = [] if mnemonic == "GT" else [index + 1]
        if mnemonic in JUMPS and mnemonic != "GS":
            targets.append(self._index[line.whole(JUMPS[mnemonic])])
        return [target for target in targets if target not in (self._end, len(self._lines))]

    def _run(self) -> set[int]:
        """Return the lines that can be reached from the beginning of the program."""
        found = [self._next] if self._next not in (self._end, len(self._lines)) else []
        seen = set(found)
        while found:
            index = found.pop()
            line, targets = self._lines[index], self._after(index)
            if _mnemonic(line) == "GS":
                targets.append(self._index[line.whole(JUMPS["GS"])])
            fresh = [target for target in targets if target not in seen]
            seen.update(fresh)
            found += fresh
        return seen

    def _known(self, number: int) -> str:
        numbers = [line.number or 0 for line in self._lines]
        near = sorted(sorted(numbers, key=lambda each: abs(each - number))[:4])
        if not near:
            return "the program stands before RN in the file, each line with its number"
        return f"near it are the lines {', '.join(map(str, near))}"


def _mnemonic(line: Statement) -> str:
    return line.command.mnemonic if line.command else ""
