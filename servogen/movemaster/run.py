"""An arm program -> `ProgramRun`: its `JointTrajectory`, its writes to the output port, its steps' durations.

In: the parsed file, the arm with its speeds, the hand, the frame, inputs, budgets. Out: one row per frame.
The first frame is at the home position; the last pose is held when the program has ended, or the program is
repeated.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from servogen.errors import Diagnostic, InputError, Location
from servogen.motion.trajectory import JointTrajectory
from servogen.movemaster.arm import Hand, Manipulator, Mover
from servogen.movemaster.interpreter import CommandStep, Controller
from servogen.movemaster.memory import CLOSED, InputPort, Output, PortInput, StoredPosition
from servogen.movemaster.parser import ParsedProgram, ProgramLine
from servogen.units import Clock, Cycles

if TYPE_CHECKING:
    from servogen.answers import ProgramRunAnswer

SAME = 1e-9
"""Joint positions (radians, metres) this near are the same."""


@dataclass(frozen=True, slots=True)
class Budget:
    """The limits at which a program that does not end is stopped."""

    commands: int = 100_000
    seconds: Fraction = Fraction(3600)


@dataclass(frozen=True, slots=True, eq=False)
class ProgramRun:
    """The result of a program. `positions` and `counters` are the memory at its end."""

    trajectory: JointTrajectory
    steps: tuple[CommandStep, ...]
    outputs: tuple[Output, ...]
    positions: dict[int, StoredPosition]
    counters: dict[int, int]
    warnings: tuple[Diagnostic, ...]

    def seconds(self, frames: int) -> float:
        """Return how long a number of frames lasts."""
        return float(self.trajectory.clock.seconds(frames * self.trajectory.period))

    def to_json(self) -> ProgramRunAnswer:
        """Return the motion in metres, degrees and seconds, without its joints and the warnings."""
        return {
            "period_s": self.seconds(1),
            "frames": len(self.trajectory.angles),
            "loop_start": self.trajectory.loop_start,
            "steps": [
                {
                    "line": step.statement.number,
                    "command": step.statement.text,
                    "start_s": self.seconds(step.frame),
                    "duration_s": self.seconds(step.frames),
                    **step.pose.to_json(),
                    "hand": "closed" if step.hand == CLOSED else "open",
                }
                for step in self.steps
            ],
            "outputs": [
                {"time_s": self.seconds(output.frame), "value": output.value, "strobe": output.strobe}
                for output in self.outputs
            ],
            "positions": {
                str(number): position.pose.to_json() for number, position in self.positions.items()
            },
            "counters": {str(number): value for number, value in self.counters.items()},
        }


def run(
    source: ParsedProgram,
    arm: Manipulator,
    period: Cycles,
    clock: Clock,
    *,
    hand: Hand | None = None,
    inputs: tuple[PortInput, ...] = (),
    repeat: bool = False,
    budget: Budget = Budget(),
) -> ProgramRun:
    """Return the result of the file: direct lines run immediately, the program at RN, or at the end without
    RN.

    With `repeat`, the program is the loop and any motion before it the lead-in, including its first pass if
    the second moves differently; the second must end as the first did. Raises InputError with the location of
    the line that cannot be executed.
    """
    period_s = clock.seconds(period)
    mover = Mover(arm, hand, period_s, budget.seconds)
    controller = Controller(mover, InputPort(inputs, period_s), budget.commands)
    start = _once(controller, source)
    if repeat:
        first, loop_start, end = _run_twice(controller, source, start, inputs)
    else:
        first, loop_start, end = 0, mover.frame, mover.frame + 1
        # The frame that is held at the end is not part of the program's time.
        mover.uncounted += 1
        mover.stand(1)
    joints = (*arm.joints, hand.name) if hand else arm.joints
    return ProgramRun(
        trajectory=JointTrajectory(
            joints=joints,
            clock=clock,
            period=period,
            angles=mover.samples[first:end],
            loop_start=loop_start - first,
        ),
        steps=tuple(
            replace(step, frame=step.frame - first) for step in controller.steps if step.frame >= first
        ),
        outputs=tuple(
            replace(output, frame=output.frame - first)
            for output in controller.outputs
            if output.frame >= first
        ),
        positions=dict(sorted(controller.memory.positions.items())),
        counters=dict(sorted(controller.memory.counters.items())),
        warnings=tuple(controller.warnings),
    )


@dataclass(frozen=True, slots=True)
class _Start:
    """The state before the program, the frame at which it began, and the RN that started it, None at the end
    of the file.
    """

    kept: tuple[object, ...]
    frame: int
    statement: ProgramLine | None


def _once(controller: Controller, source: ParsedProgram) -> _Start | None:
    """Run all statements in order, then the program if no RN started it."""
    start: _Start | None = None
    waiting: ProgramLine | None = None
    for statement in source.statements:
        runs = statement.command is not None and statement.command.mnemonic == "RN"
        if runs:
            start, waiting = _Start(controller.kept(), controller.mover.frame, statement), None
        elif statement.number is not None:
            waiting = waiting or statement
        controller.take(statement)
    if waiting is not None and start is not None:
        controller.warn(
            Diagnostic(
                "warning",
                "lines-not-run",
                "the program lines from here on are after RN, and do not run",
                waiting.place,
            )
        )
    if start is None and controller.program:
        start = _Start(controller.kept(), controller.mover.frame, None)
        controller.run_program(min(controller.program), None)
    return start


def _run_twice(
    controller: Controller, source: ParsedProgram, start: _Start | None, inputs: tuple[PortInput, ...]
) -> tuple[int, int, int]:
    """Run the program twice, and return the first frame that is needed, the first of the loop, and the end.

    If the second pass moves as the first did, the first is already the loop; frames at rest before it, at the
    position where the loop ends, are not needed.
    """
    place = Location(source.file)
    if start is None:
        raise InputError(
            "not-repeatable",
            "there is no program to repeat",
            place,
            "number the lines, or write repeat = false",
        )
    if inputs:
        raise InputError(
            "not-repeatable",
            "a program with inputs cannot be repeated: they occur only once",
            place,
            "write repeat = false",
        )
    last = source.statements[-1]
    if start.statement is not None and (
        start.statement is not last or sum(_is_run(statement) for statement in source.statements) > 1
    ):
        raise start.statement.error(
            "not-repeatable",
            "a program that is repeated must be run by a single RN, on the last line",
            "or write repeat = false",
        )
    after, second = controller.kept(), controller.mover.frame
    steps, outputs = len(controller.steps), len(controller.outputs)
    controller.commands = 0  # each pass has the full budget
    # The time limit applies to each pass, too.
    controller.mover.uncounted += second + 1
    if start.statement is None:
        controller.run_program(min(controller.program), None)
    else:
        controller.take(start.statement)
    if controller.kept() != after:
        raise InputError(
            "not-repeatable",
            "the program cannot be repeated: its second pass ends differently from its first",
            place,
            "set speeds and counters at its beginning, end where it began, or write repeat = false",
        )
    if second == controller.mover.frame:  # a loop has at least one frame
        controller.mover.stand(1)
    samples = controller.mover.samples
    loop, again = samples[start.frame : second], samples[second:]
    if loop.shape != again.shape or not np.allclose(loop, again, rtol=0, atol=SAME):
        return 0, second, len(samples)
    # The second pass only showed that the first one repeats.
    del controller.steps[steps:], controller.outputs[outputs:]
    still = np.allclose(samples[: start.frame], loop[-1], rtol=0, atol=SAME)
    return start.frame if still else 0, start.frame, second


def _is_run(statement: ProgramLine) -> bool:
    return statement.command is not None and statement.command.mnemonic == "RN"
