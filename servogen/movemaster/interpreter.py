"""The controller: executes statements in order, direct ones immediately, programs line by line.

In: statements, one after another. Out: the resulting contents of `Mover`, `Memory` and the output record.
What each command does to the controller is a row of `ACTIONS`, by its mnemonic. A program that does not end
is stopped after a number of commands or of frames.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction

import numpy as np

from servogen.errors import Diagnostic, InputError
from servogen.graph import reached
from servogen.movemaster.arm import Mover
from servogen.movemaster.language import MAX_DEPTH, POSITIONS
from servogen.movemaster.memory import CLOSED, OPEN, InputPort, Memory, Output, StoredPosition, ToolPose
from servogen.movemaster.parser import ProgramLine


@dataclass(frozen=True, slots=True)
class CommandStep:
    """A command that took time: `frames` frames from `frame` on, and the resulting state of tool and hand."""

    statement: ProgramLine
    frame: int
    frames: int
    pose: ToolPose
    hand: str


Action = Callable[["Controller", ProgramLine], None]
"""What a command does to the controller."""


class Controller:
    """One controller with its arm, from power-on."""

    def __init__(self, mover: Mover, inputs: InputPort, max_commands: int) -> None:
        self.mover = mover
        self.inputs = inputs
        self.max_commands = max_commands
        self.memory = Memory()
        self.program: dict[int, ProgramLine] = {}
        self.stored_hand = OPEN
        self.reference: ToolPose | None = None
        self.current = 0
        self.output = 0
        self.outputs: list[Output] = []
        self.steps: list[CommandStep] = []
        self.warnings: list[Diagnostic] = []
        self.commands = 0
        self._flow: Flow | None = None

    @property
    def flow(self) -> Flow:
        """Return the running program. Raises InputError on a line outside a program."""
        if self._flow is None:
            raise InputError("no-program", "no program is running")
        return self._flow

    def take(self, statement: ProgramLine) -> None:
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
        """Write the output port and record the write."""
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

    def _count(self, statement: ProgramLine) -> None:
        self.commands += 1
        if self.commands > self.max_commands:
            raise statement.error(
                "program-too-long",
                f"the program has not ended after {self.max_commands} commands",
                "end it with ED and let its job repeat it, or allow more commands",
            )

    def _carry_out(self, statement: ProgramLine) -> None:
        """Execute a statement; errors and warnings without a location get the statement's."""
        if statement.command is None:
            return
        before, warned = self.mover.frame, len(self.mover.warnings)
        try:
            ACTIONS[statement.command.mnemonic](self, statement)
        except InputError as error:
            if error.location is None:
                raise error.at(statement.place) from error
            raise
        for warning in self.mover.warnings[warned:]:
            if warning.location is None:
                self.warn(replace(warning, location=statement.place))
        # RN is not a step of its own: the commands that it runs are.
        if self.mover.frame > before and statement.command.mnemonic != "RN":
            frames = self.mover.frame - before
            self.steps.append(
                CommandStep(
                    statement=statement,
                    frame=before,
                    frames=frames,
                    pose=self.mover.pose,
                    hand=self.mover.hand_state,
                )
            )


JUMPS: Mapping[str, int] = {"GT": 0, "GS": 0, "EQ": 1, "NE": 1, "LG": 1, "SM": 1, "TB": 1}
"""Commands that go to a line, and which of their arguments is its number."""


_OPENS: Mapping[str, int] = {"RC": 1, "NX": -1}
"""The change in the number of open loops by a command."""


@dataclass(slots=True)
class _Loop:
    """An open loop: its RC, the line after it, and the number of further repetitions."""

    start: ProgramLine
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

    def __init__(self, program: Mapping[int, ProgramLine], first: int, last: int | None) -> None:
        self._lines = [program[number] for number in sorted(program)]
        self._index = {line.number: index for index, line in enumerate(self._lines)}
        for number in (first, last):
            if number is not None and number not in self._index:
                raise InputError(
                    "unknown-line", f"there is no program line {number}", hint=self._lines_near(number)
                )
        for line in self._lines:
            if line.command and line.command.mnemonic in JUMPS:
                self._check(line, line.whole(JUMPS[line.command.mnemonic]))
        self._next = self._index[first]
        self._end = len(self._lines) if last is None else self._index[last]
        self._check_loops()
        self._levels = [_Level()]

    def take(self) -> ProgramLine | None:
        """Return the statement to run now; None if the program has ended."""
        if self._next == self._end or self._next >= len(self._lines):
            return None
        self._next += 1
        return self._lines[self._next - 1]

    def end(self) -> None:
        """End the program."""
        self._next = len(self._lines)

    def go_to(self, number: int) -> None:
        """Continue at the program line `number`."""
        self._next = self._index[number]

    def call(self, number: int) -> None:
        """Call the subroutine at line `number`. Raises InputError beyond `MAX_DEPTH` levels."""
        if len(self._levels) > MAX_DEPTH:
            raise InputError(
                "program-nesting",
                f"subroutines are called {len(self._levels)} deep: {MAX_DEPTH} is the maximum",
                hint="a subroutine ends with RT; GT does not leave it",
            )
        self._levels.append(_Level(self._next))
        self.go_to(number)

    def give_back(self) -> None:
        """Return from the subroutine; its open loops are closed. Raises InputError outside a subroutine."""
        if len(self._levels) == 1:
            raise InputError(
                "program-nesting",
                "RT without a GS",
                hint="GS calls a subroutine, RT ends it; ED ends the program",
            )
        self._next = self._levels.pop().back

    def open_loop(self, statement: ProgramLine, times: int) -> None:
        """Open a loop of `times` iterations at an RC. Raises InputError beyond `MAX_DEPTH` loops."""
        loops = self._levels[-1].loops
        for index, loop in enumerate(loops):
            if loop.start is statement:  # reached by a jump back: the loop begins again
                del loops[index:]
                break
        if sum(len(level.loops) for level in self._levels) == MAX_DEPTH:
            raise InputError(
                "program-nesting", f"loops are nested deeper than {MAX_DEPTH}", hint="each RC needs its NX"
            )
        loops.append(_Loop(statement, self._next, times - 1))

    def close_loop(self) -> None:
        """Start the next iteration of the innermost loop, or close it. Raises InputError without a loop."""
        loops = self._levels[-1].loops
        if not loops:
            raise InputError("program-nesting", "NX without an RC", hint="RC n opens a loop, NX closes it")
        if loops[-1].left:
            loops[-1].left -= 1
            self._next = loops[-1].body
        else:
            loops.pop()

    def _check(self, line: ProgramLine, target: int) -> None:
        if target not in self._index:
            raise line.error(
                "unknown-line", f"there is no program line {target} to go to", self._lines_near(target)
            )

    def _check_loops(self) -> None:
        """Raise InputError for a reachable RC from which no path leads to the NX that closes its loop.

        The search goes backwards from the states (line, open loops) in which NX closes the last loop, along
        all paths through the program regardless of its conditions. Excessive nesting is rejected at run time.
        """
        # `before` has the predecessors of each state (line, loops open before it).
        before: dict[tuple[int, int], list[tuple[int, int]]] = {}
        loops: list[tuple[int, int]] = []
        for index, line in enumerate(self._lines):
            for depth in range(1, MAX_DEPTH + 1):
                deeper = depth + _OPENS.get(_mnemonic(line), 0)
                if deeper == 0 or deeper > MAX_DEPTH:
                    loops.append((index, depth))
                for target in self._after(index):
                    before.setdefault((target, deeper), []).append((index, depth))
        closed = set(reached(loops, lambda state: before.get(state, ())))
        # The loop's first line, with one loop open, must lead to the NX that closes it.
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

        def followers(index: int) -> list[int]:
            line, targets = self._lines[index], self._after(index)
            return [*targets, self._index[line.whole(JUMPS["GS"])]] if _mnemonic(line) == "GS" else targets

        return set(reached([] if self._next in (self._end, len(self._lines)) else [self._next], followers))

    def _lines_near(self, number: int) -> str:
        numbers = [line.number or 0 for line in self._lines]
        near = sorted(sorted(numbers, key=lambda candidate: abs(candidate - number))[:4])
        if not near:
            return "put the program before RN, each line with its number"
        return f"near it are the lines {', '.join(map(str, near))}"


def _mnemonic(line: ProgramLine) -> str:
    return line.command.mnemonic if line.command else ""


def _pose(statement: ProgramLine, first: int) -> ToolPose:
    return ToolPose(*(statement.decimal(first + index) for index in range(5)))


def _grip(controller: Controller, statement: ProgramLine, index: int, stored: str) -> None:
    """Set the hand before the arm moves: to the state in the statement, else to the stored one."""
    state = statement.arguments[index] if statement.has(index) else stored
    controller.mover.grip(CLOSED if state == CLOSED else OPEN)


def _go_to_position(controller: Controller, number: int) -> None:
    position = controller.memory.position(number)
    controller.mover.grip(position.hand)
    controller.mover.go(position.pose, f"position {number}")
    controller.current = number


def _go_to_neighbour(controller: Controller, step: int) -> None:
    _go_to_position(controller, controller.memory.neighbour(controller.current, step))


def _dw(controller: Controller, statement: ProgramLine) -> None:
    by = ToolPose(x=statement.decimal(0), y=statement.decimal(1), z=statement.decimal(2), p=0.0, r=0.0)
    controller.mover.go(controller.mover.pose.plus(by), "the point")


def _he(controller: Controller, statement: ProgramLine) -> None:
    mover = controller.mover
    controller.memory.positions[statement.whole(0)] = StoredPosition(mover.pose, mover.hand_state)


def _ho(controller: Controller, _: ProgramLine) -> None:
    controller.reference = controller.mover.pose


def _og(controller: Controller, statement: ProgramLine) -> None:
    if controller.reference is None:
        _nt(controller, statement)
    else:
        controller.mover.go(controller.reference, "the reference position")


def _nt(controller: Controller, _: ProgramLine) -> None:
    controller.mover.go_joints(np.array(controller.mover.manipulator.arm.home))


def _ma(controller: Controller, statement: ProgramLine) -> None:
    first, second = statement.whole(0), statement.whole(1)
    position, by = controller.memory.position(first), controller.memory.position(second)
    _grip(controller, statement, 2, position.hand)
    controller.mover.go(position.pose.plus(by.pose), f"position {first} displaced by {second}")


def _mc(controller: Controller, statement: ProgramLine) -> None:
    numbers = controller.memory.between(statement.whole(0), statement.whole(1))
    poses = [(controller.memory.positions[number].pose, f"position {number}") for number in numbers]
    controller.mover.through(poses)
    controller.current = numbers[-1]


def _mj(controller: Controller, statement: ProgramLine) -> None:
    joints = controller.mover.manipulator.arm.joints
    given = [statement.decimal(index) for index in range(5)]
    if any(given[len(joints) :]) or len(joints) > 5:
        raise InputError(
            "wrong-count",
            f"MJ turns five joints, {controller.mover.manipulator.arm.name} has {len(joints)}",
            hint="waist, shoulder, elbow, pitch, roll: 0 for joints that the arm does not have",
        )
    factors = [math.radians(1) if joint.turning else 0.001 for joint in joints]
    by = [value * factor for value, factor in zip(given, factors, strict=False)]
    controller.mover.turn_joints(np.array(by))


def _mo(controller: Controller, statement: ProgramLine) -> None:
    number = statement.whole(0)
    position = controller.memory.position(number)
    _grip(controller, statement, 1, position.hand)
    controller.mover.go(position.pose, f"position {number}")
    controller.current = number


def _ms(controller: Controller, statement: ProgramLine) -> None:
    number = statement.whole(0)
    position = controller.memory.position(number)
    _grip(controller, statement, 2, position.hand)
    controller.mover.line(position.pose, statement.whole(1), f"position {number}")
    controller.current = number


def _mt(controller: Controller, statement: ProgramLine) -> None:
    number, distance = statement.whole(0), statement.decimal(1)
    position = controller.memory.position(number)
    x, y, z = (distance * controller.mover.manipulator.approach(position.pose)).tolist()
    _grip(controller, statement, 2, position.hand)
    target = position.pose.plus(ToolPose(x=x, y=y, z=z, p=0.0, r=0.0))
    controller.mover.go(target, f"the point {distance:g} mm from position {number}")


def _pa(controller: Controller, statement: ProgramLine) -> None:
    controller.memory.pallets[statement.whole(0)] = (statement.whole(1), statement.whole(2))


def _pc(controller: Controller, statement: ProgramLine) -> None:
    first = statement.whole(0)
    last = statement.whole(1) if statement.has(1) else first
    if first == 0:
        if statement.has(1):
            raise InputError(
                "program-argument", "PC 0 clears all positions: a second number has no meaning", hint="PC 0"
            )
        first, last = POSITIONS
    if last < first:
        raise InputError("program-argument", f"PC {first}, {last}: the second number must be the higher one")
    controller.memory.clear(first, last)


def _pd(controller: Controller, statement: ProgramLine) -> None:
    controller.memory.positions[statement.whole(0)] = StoredPosition(
        _pose(statement, 1), controller.stored_hand
    )


def _pl(controller: Controller, statement: ProgramLine) -> None:
    positions = controller.memory.positions
    positions[statement.whole(0)] = controller.memory.position(statement.whole(1))


def _pt(controller: Controller, statement: ProgramLine) -> None:
    pallet = statement.whole(0)
    controller.memory.positions[pallet] = controller.memory.grid_point(pallet)


def _px(controller: Controller, statement: ProgramLine) -> None:
    one, two = statement.whole(0), statement.whole(1)
    first, second = controller.memory.position(one), controller.memory.position(two)
    controller.memory.positions[one], controller.memory.positions[two] = second, first


def _sp(controller: Controller, statement: ProgramLine) -> None:
    controller.mover.speed = statement.whole(0)


def _cp(controller: Controller, statement: ProgramLine) -> None:
    controller.memory.comparison = controller.memory.counters.get(statement.whole(0), 0)


def _sc(controller: Controller, statement: ProgramLine) -> None:
    controller.memory.counters[statement.whole(0)] = statement.whole(1) if statement.has(1) else 0


def _second(statement: ProgramLine) -> int | None:
    return statement.whole(1) if statement.has(1) else None


def _jump_if(holds: Callable[[int, int], bool]) -> Action:
    """Return an action that jumps if the comparison value and the argument have this relation."""

    def action(controller: Controller, statement: ProgramLine) -> None:
        if holds(controller.memory.comparison, statement.whole(0)):
            controller.flow.go_to(statement.whole(1))

    return action


def _tb(controller: Controller, statement: ProgramLine) -> None:
    bit = statement.bit(0)
    if bool(controller.memory.comparison >> bit.number & 1) == bit.on:
        controller.flow.go_to(statement.whole(1))


def _nw(controller: Controller, _: ProgramLine) -> None:
    controller.program.clear()
    controller.memory.clear(*POSITIONS)


def _gf(controller: Controller, statement: ProgramLine) -> None:
    controller.stored_hand = CLOSED if statement.whole(0) else OPEN


def _gp(controller: Controller, statement: ProgramLine) -> None:
    controller.mover.grip_tenths = statement.whole(2)
    controller.warn(
        Diagnostic(
            "warning",
            "grip-force",
            "a servo's hand has no grip force: only the time of GP is used",
            statement.place,
        )
    )


def _id(controller: Controller, _: ProgramLine) -> None:
    controller.memory.comparison = controller.inputs.value(controller.mover.frame)


def _in(controller: Controller, _: ProgramLine) -> None:
    strobe = controller.inputs.strobe()
    if strobe is None:
        raise InputError(
            "program-argument",
            "IN waits for a strobe that never comes",
            hint="every input of the stimulus is a strobe: seconds=value",
        )
    frame, controller.memory.comparison = strobe
    controller.mover.stand(max(0, frame - controller.mover.frame))


def _ob(controller: Controller, statement: ProgramLine) -> None:
    bit = statement.bit(0)
    mask = 1 << bit.number
    controller.write(controller.output | mask if bit.on else controller.output & ~mask, strobe=False)


ACTIONS: Mapping[str, Action] = {
    "CP": _cp, "DW": _dw, "GF": _gf, "GP": _gp, "HE": _he, "HO": _ho, "ID": _id, "IN": _in, "MA": _ma,
    "MC": _mc, "MJ": _mj, "MO": _mo, "MS": _ms, "MT": _mt, "NT": _nt, "NW": _nw, "OB": _ob, "OG": _og,
    "PA": _pa, "PC": _pc, "PD": _pd, "PL": _pl, "PT": _pt, "PX": _px, "SC": _sc, "SP": _sp, "TB": _tb,
    "DP": lambda controller, _: _go_to_neighbour(controller, -1),
    "IP": lambda controller, _: _go_to_neighbour(controller, 1),
    "MP": lambda controller, statement: controller.mover.go(_pose(statement, 0), "the pose"),
    "SF": lambda controller, statement: controller.memory.shift(statement.whole(0), statement.whole(1)),
    "TI": lambda controller, statement: controller.mover.wait_s(Fraction(statement.whole(0), 10)),
    "TL": lambda controller, statement: controller.mover.set_tool_mm(statement.decimal(0)),
    "DC": lambda controller, statement: controller.memory.count(statement.whole(0), -1),
    "IC": lambda controller, statement: controller.memory.count(statement.whole(0), 1),
    "RN": lambda controller, statement: controller.run_program(statement.whole(0), _second(statement)),
    "ED": lambda controller, _: controller.flow.end(),
    "GT": lambda controller, statement: controller.flow.go_to(statement.whole(0)),
    "GS": lambda controller, statement: controller.flow.call(statement.whole(0)),
    "RT": lambda controller, _: controller.flow.give_back(),
    "RC": lambda controller, statement: controller.flow.open_loop(statement, statement.whole(0)),
    "NX": lambda controller, _: controller.flow.close_loop(),
    "EQ": _jump_if(operator.eq), "NE": _jump_if(operator.ne),
    "LG": _jump_if(operator.gt), "SM": _jump_if(operator.lt),
    "GC": lambda controller, _: controller.mover.grip(CLOSED),
    "GO": lambda controller, _: controller.mover.grip(OPEN),
    "OD": lambda controller, statement: controller.write(statement.whole(0), strobe=False),
    "OT": lambda controller, statement: controller.write(statement.whole(0), strobe=True),
    "RS": lambda *_: None,  # an error ends the run, so there is never one to clear
}  # fmt: skip
"""The action of each row of the language."""
