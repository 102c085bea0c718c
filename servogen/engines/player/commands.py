"""Codes that command a walk; the player reads one level of the line per frame, after the last slot.

In: the names of directions. Out: their codes, and the table with which the chip follows the line.

    line   ▔▔▔▔▔▁▁▁▔▔▔▁▁▁▔▔▔▁▁▁▔▔▔▔▔▔▔      high at rest; each level lasts one frame
                s  0  1  0  1  0  rest      a start, the five levels of a direction, three frames of rest

Other levels change nothing. `STOP_FRAMES` low frames are the command to stop, whatever came before: a line
that is broken or held low ends the walk.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from servogen.motion.gait.commands import STRAIGHT, TURN

REST_FRAMES = 3
"""The number of high frames before a start; within a code, at most two frames in a row are high."""

STOP_FRAMES = 5
"""The number of low frames that command a stop; a code has at most three, or four with one wrong level."""

CODES: Mapping[str, str] = MappingProxyType(
    dict(zip((*STRAIGHT, *TURN), ("01010", "00110", "11000", "11011"), strict=True))
)
"""The levels after the start. No single level that is wrong, missing or doubled turns a code into that of
another direction; of all sets of five-level codes with this property, this one needs the fewest states.
"""

CODE_LEVELS = 5

IDLE_LEVEL = 1

STOP_BYTE = 0x00
"""The byte that sends a stop at 8N1: nine low frames."""


@dataclass(frozen=True, slots=True)
class CommandLine:
    """The input pin for codes."""

    pin: str

    def text(self) -> tuple[str, str]:
        """Return the wiring of the pin and the command to stop, as text for the header of the C."""
        return (
            f"{self.pin}: commands, one level per frame, high at rest: 10 kOhm pull-up to VDD.",
            f"Low for {STOP_FRAMES} frames: stop.",
        )


ENTRY = 2
"""The bytes of a pose in the script: the place of its row; its lifted legs and the timing of the step to
it.
"""


@dataclass(frozen=True, slots=True)
class Chain:
    """The directions of a walk as places in the script, four for each: where its start, its cycle and its
    stop begin, and where it ends. The first four belong to standing, which has only a start.

    Of the directions the first, the third … are read backward, the others and standing forward.
    """

    line: CommandLine
    names: tuple[str, ...]
    places: tuple[int, ...]
    stance: int
    """The place at which the lead-in ends."""
    spot_timing: int
    """The number of the timing of steps on the spot."""


def uart_byte(name: str | None) -> int:
    """Return the byte that sends a direction's code over a UART (8N1) with one bit per frame; None: stop."""
    if name is None:
        return STOP_BYTE
    levels = CODES[name].ljust(8, "1")
    return sum(int(level) << bit for bit, level in enumerate(levels))


COMMAND_SHIFT = 5
"""In the table: a command is left of the next state, 0 for none, 1 to stop, 2 for the first direction."""


def hearing_table(names: Sequence[str]) -> bytes:
    """Return the table with the next state of every state, for a low and a high line.

    Direction n of `names` is command n + 1.

    The first state is that of power-up.
    """
    codes = {CODES[name]: number + 1 for number, name in enumerate(names)}
    states: list[str] = ["0"]
    rows: list[tuple[int, int]] = []
    while len(rows) < len(states):
        row = []
        for level in "01":
            state, direction = _heard(states[len(rows)], level, codes)
            if state not in states:
                states.append(state)
            row.append(states.index(state) | (0 if direction is None else direction + 1 << COMMAND_SHIFT))
        rows.append((row[0], row[1]))
    return bytes(value for row in rows for value in row)


IDLE = "idle"


def _heard(state: str, level: str, codes: Mapping[str, int]) -> tuple[str, int | None]:
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
            return _latest("0" + levels), codes[levels]
        state = "0" + state[1:]
    after = _latest(state + level)
    if after == "1" * REST_FRAMES:
        return IDLE, None
    if after == "0" * STOP_FRAMES:
        return after[1:], 0
    return after, None


def _latest(levels: str) -> str:
    """Return the equal levels at the end."""
    return levels[len(levels.rstrip(levels[-1])) :]
