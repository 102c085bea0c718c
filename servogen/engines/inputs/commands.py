"""Codes or buttons that command a walk, or segments of a motion; read once per frame, after the last slot.

In: the names of directions. Out: their codes, and the table with which the chip follows the line; or their
buttons.

    line   ▔▔▔▔▔▁▁▁▔▔▔▁▁▁▔▔▔▁▁▁▔▔▔▔▔▔▔      high at rest; each level lasts one frame
                s  0  1  0  1  0  rest      a start, the five levels of a direction, three frames of rest

Other levels change nothing. `STOP_FRAMES` low frames are the command to stop, whatever came before: a line
that is broken or held low ends the walk.

Buttons need no code: the robot walks in a direction while only the button of that direction is held; or one
button steps through the directions.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import ClassVar

from servogen.engines.inputs import EngineInput
from servogen.engines.inputs.buttons import PRESSED_FRAMES, ButtonPin
from servogen.motion.gait.commands import STRAIGHT, TURN
from servogen.pulse.schedule import CodeLine, DirectionButtons, Input, StepButton

COMMANDS = "commands"

REST_FRAMES = 3
"""The number of high frames before a start; within a code, at most two frames in a row are high."""

STOP_FRAMES = 5
"""The number of low frames that command a stop; a code has at most three, or four with one wrong level."""

CODES: Mapping[str, str] = MappingProxyType(
    dict(zip((*STRAIGHT, *TURN), ("01010", "00110", "11000", "11011"), strict=True))
)
"""The levels after the start. No single level that is wrong, missing or doubled turns a code into that of
another direction; of all sets of five-level codes with this property, this one needs the minimum number of
states.
"""

CODE_LEVELS = 5

IDLE_LEVEL = 1

STOP_BYTE = 0x00
"""The byte that sends a stop at 8N1: nine low frames."""


@dataclass(frozen=True, slots=True)
class CommandLine:
    """The input pin for codes."""

    kind: ClassVar[str] = COMMANDS

    pin: str
    codes: Mapping[str, str] = field(default_factory=lambda: dict(CODES))
    """Those of the directions, or of the segments, by name: a `dict`, for builds pass between processes."""

    @property
    def inputs(self) -> tuple[Input, ...]:
        """Return the levels at which the robot stands."""
        return (Input(self.pin, IDLE_LEVEL),)

    @property
    def rule(self) -> CodeLine:
        """Return the rule about the line for the schedule."""
        return CodeLine(self.inputs[0], REST_FRAMES, STOP_FRAMES)

    def has(self, direction: str) -> bool:
        """Return whether a direction can be commanded."""
        return True

    def selector(self, direction: str) -> str:
        """Return the code of a direction."""
        return self.codes[direction]

    def text(self) -> tuple[str, ...]:
        """Return the wiring of the pin and the command to stop, as text for the header of the C."""
        return (
            f"{self.pin}: commands, one level per frame, high at rest: 10 kOhm pull-up to VDD.",
            f"Low for {STOP_FRAMES} frames: stop.",
        )


@dataclass(frozen=True, slots=True)
class CommandButtons:
    """The buttons of directions, by the directions' names."""

    kind: ClassVar[str] = COMMANDS

    buttons: Mapping[str, ButtonPin]

    @property
    def inputs(self) -> tuple[Input, ...]:
        """Return the levels at which the robot stands."""
        return tuple(Input(button.pin, 1 - button.level) for button in self.buttons.values())

    @property
    def rule(self) -> DirectionButtons:
        """Return the rule about the buttons for the schedule."""
        return DirectionButtons(PRESSED_FRAMES)

    def has(self, direction: str) -> bool:
        """Return whether a direction can be commanded."""
        return direction in self.buttons

    def selector(self, direction: str) -> Input:
        """Return the button of a direction."""
        return Input(self.buttons[direction].pin, self.buttons[direction].level)

    def text(self) -> tuple[str, ...]:
        """Return the wiring of the buttons and their effects, as text for the header of the C."""
        buttons = (
            f"{button.pin}: {direction} while it is held: {button.text()}."
            for direction, button in self.buttons.items()
        )
        return (*buttons, f"None or several for {PRESSED_FRAMES} frames: stop.")


@dataclass(frozen=True, slots=True)
class CommandButton:
    """The button that steps through the directions, forward, back, left, right, or through the segments of a
    motion.
    """

    kind: ClassVar[str] = COMMANDS

    button: ButtonPin
    name: str = "walk"

    @property
    def inputs(self) -> tuple[Input, ...]:
        """Return the level at which the robot stands."""
        return (Input(self.button.pin, 1 - self.button.level),)

    @property
    def rule(self) -> StepButton:
        """Return the rule about the button for the schedule."""
        return StepButton(Input(self.button.pin, self.button.level), PRESSED_FRAMES)

    def has(self, direction: str) -> bool:
        """Return whether a direction can be commanded."""
        return True

    def selector(self, direction: str) -> None:
        """Return None: all directions have the same button."""

    def text(self) -> tuple[str, ...]:
        """Return the wiring of the button and its effect, as text for the header of the C."""
        return (
            f"{self.button.pin}: pressed for {PRESSED_FRAMES} frames: {self.button.text()}.",
            "A press commands a stop, or, if the robot is to stand, the next direction."
            if self.name == "walk"
            else "A press commands the rest, or, if that is commanded, the next segment.",
        )


Commander = CommandLine | CommandButtons | CommandButton
"""What commands a walk."""


def commander(inputs: Iterable[EngineInput]) -> Commander | None:
    """Return what commands the walk of a job with these inputs; None if nothing does."""
    return next((each for each in inputs if isinstance(each, Commander)), None)


def uart_byte(name: str | None, by_name: Mapping[str, str] = CODES) -> int:
    """Return the byte that sends a direction's code over a UART (8N1) with one bit per frame; None: stop."""
    if name is None:
        return STOP_BYTE
    levels = by_name[name].ljust(8, "1")
    return sum(int(level) << bit for bit, level in enumerate(levels))


COMMAND_SHIFT = 5
"""In the table: a command is left of the next state, 0 for none, 1 to stop, 2 for the first direction."""


def hearing_table(names: Sequence[str], by_name: Mapping[str, str] = CODES) -> bytes:
    """Return the table with the next state of every state, for a low and a high line.

    Direction n of `names` is command n + 1.

    The first state is that of power-up.
    """
    codes = {by_name[name]: number + 1 for number, name in enumerate(names)}
    states: list[str] = ["0"]
    rows: list[tuple[int, int]] = []
    # New states are found while the table is written, in the order in which they get their numbers.
    while len(rows) < len(states):
        row = []
        for level in "01":
            state, direction = _next_state(states[len(rows)], level, codes)
            if state not in states:
                states.append(state)
            row.append(states.index(state) | (0 if direction is None else direction + 1 << COMMAND_SHIFT))
        rows.append((row[0], row[1]))
    return bytes(value for row in rows for value in row)


IDLE = "idle"


def _next_state(state: str, level: str, codes: Mapping[str, int]) -> tuple[str, int | None]:
    """Return the state after another level, and the direction that it commands: a number, 0 to stop, or None.

    A state is `IDLE`, "s" followed by the levels since a start, or else the latest equal levels.
    """
    if state == IDLE:
        return (IDLE if level == "1" else "s"), None
    if state.startswith("s"):
        levels = state[1:] + level
        if any(code.startswith(levels) for code in codes):
            if len(levels) < CODE_LEVELS:
                return f"s{levels}", None
            # After a code its last levels count as rest or stop, as if no code had begun.
            return _last_run("0" + levels), codes[levels]
        # No code begins like this: the levels since the start, which is low, are only a run.
        state = "0" + state[1:]
    after = _last_run(state + level)
    if after == "1" * REST_FRAMES:
        return IDLE, None
    if after == "0" * STOP_FRAMES:
        return after[1:], 0
    return after, None


def _last_run(levels: str) -> str:
    """Return the equal levels at the end."""
    return levels[len(levels.rstrip(levels[-1])) :]
