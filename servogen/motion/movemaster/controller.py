"""The controller: carries out statements in order, direct ones at once, programs line by line.

In: statements, one after another. Out: what `Mover`, `Memory` and the output record hold then. A program that
does not end is stopped after a number of commands or of frames.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from servogen.errors import Caution, InputError
from servogen.motion.movemaster.flow import Flow
from servogen.motion.movemaster.memory import OPEN, Memory, Pose
from servogen.motion.movemaster.mover import Mover
from servogen.motion.movemaster.parse import Statement
from servogen.motion.movemaster.ports import InputPort, Output


@dataclass(frozen=True, slots=True)
class Step:
    """A command that took frames: `frames` of them from `frame` on; where it left the tool and the hand."""

    statement: Statement
    frame: int
    frames: int
    pose: Pose
    hand: str


Action = Callable[["Controller", Statement], None]
"""What a command does to the controller."""


class Controller:
    """One controller with its arm, from switching it on; `actions` by mnemonic."""

    def __init__(
        self, mover: Mover, inputs: InputPort, most_commands: int, actions: Mapping[str, Action]
    ) -> None:
        self.mover = mover
        self.inputs = inputs
        self.most_commands = most_commands
        self.actions = actions
        self.memory = Memory()
        self.program: dict[int, Statement] = {}
        self.stored_hand = OPEN
        self.reference: Pose | None = None
        self.current = 0
        self.output = 0
        self.outputs: list[Output] = []
        self.steps: list[Step] = []
        self.cautions: list[Caution] = []
        self.commands = 0
        self._flow: Flow | None = None

    @property
    def flow(self) -> Flow:
        if self._flow is None:
            raise InputError("no program runs")
        return self._flow

    def take(self, statement: Statement) -> None:
        """Carries out a direct statement, or stores a numbered one as a program line."""
        if statement.number is None:
            self._carry_out(statement)
            return
        if statement.number in self.program:
            other = self.program[statement.number].place
            raise statement.error(
                f"program line {statement.number} is given twice", f"the other one is at {other}"
            )
        self.program[statement.number] = statement

    def run_program(self, first: int, last: int | None) -> None:
        """From line `first` until it ends, or comes to line `last`."""
        self._flow = Flow(self.program, first, last)
        while (statement := self._flow.take()) is not None:
            if statement.command is not None:
                self._count(statement)
                self._carry_out(statement)
        self._flow = None

    def write(self, value: int, strobe: bool) -> None:
        self.output = value
        self.outputs.append(Output(self.mover.frame, value, strobe))

    def caution(self, caution: Caution) -> None:
        """Said once a kind and place."""
        if caution not in self.cautions:
            self.cautions.append(caution)

    def kept(self) -> tuple[object, ...]:
        """Everything that decides what happens next, to be compared."""
        reference = self.reference.values if self.reference else None
        here = (self.stored_hand, reference, self.current, self.output)
        return (*self.memory.kept(), *self.mover.kept(), *here)

    def _count(self, statement: Statement) -> None:
        self.commands += 1
        if self.commands > self.most_commands:
            raise statement.error(
                f"the program has not ended after {self.most_commands} commands",
                "end it with ED; what should go on for ever is repeated by its job; or allow more commands",
            )

    def _carry_out(self, statement: Statement) -> None:
        if statement.command is None:
            return
        before, said = self.mover.frame, len(self.mover.cautions)
        try:
            self.actions[statement.command.mnemonic](self, statement)
        except InputError as error:
            if error.place is None:
                raise InputError(error.message, statement.place, error.hint) from error
            raise
        for caution in self.mover.cautions[said:]:
            if caution.place is None:
                self.caution(replace(caution, place=statement.place))
        if self.mover.frame > before and statement.command.mnemonic != "RN":
            frames = self.mover.frame - before
            self.steps.append(Step(statement, before, frames, self.mover.pose, self.mover.hand_state))
