"""What the pins must do: the frames of a schedule, and the buttons or the line that choose among them.

In: schedule.json as bytes. Out: a `Plan`. Pins are bits of a word: RA0 to RA4 are 0 to 4, RB0 to RB7 are 5 to
12. The buttons follow docs/firmware.md, "Start and emergency stop".
"""

from __future__ import annotations

import json
from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from servogen.checker.line import OFF, DirectionButtons, Directions, Line, StepButton
from servogen.errors import InputError, Location

Ints = npt.NDArray[np.int64]
PINS = [f"RA{n}" for n in range(5)] + [f"RB{n}" for n in range(8)]
LARGEST = 10**9


class Position(NamedTuple):
    """The frame whose pulses are due, and the state of the buttons."""

    frame: int
    running: int = 1
    on: int = 1
    start_seen: int = 0
    stop_seen: int = 0
    heard: int = 0
    wanted: int = 0
    """Of a line that commands: see `checker.line`."""


OVER = Position(-1, on=0)
"""No pulse will follow, whatever happens."""


class Place(NamedTuple):
    """A position, the inputs that were read in its frame, and their levels."""

    position: Position
    levels: int = 0
    sampled: int = 0


class Button(NamedTuple):
    pin: int
    pressed: int
    """The level while it is pressed."""


@dataclass(frozen=True)
class Plan:
    clock_hz: int
    period: int
    channels: int
    """The pins with servos, as a word."""
    ends: list[int]
    """Of each run of equal frames, the frame after it."""
    edges: list[tuple[Ints, Ints]]
    """Of a frame in each run, the cycles of its edges and the levels of all pins from each on; the last ones
    are those of no run.
    """
    loop: int
    """The frame that follows the last one."""
    loop_end: int
    """The frame after the loop."""
    start: Button | None
    stop: Button | None
    off: bool
    """Whether stop ends the pulses."""
    seen: int
    """The frames in a row in which a button must be pressed."""
    line: Line | StepButton | None
    """The line, or the one button, that commands the motion."""
    pushed: DirectionButtons | None
    """The buttons that command the motion."""
    directions: Directions | None
    """What is commanded."""

    @property
    def buttons(self) -> int:
        """Return the pins that are read once in each frame."""
        pushed = self.pushed.word() if self.pushed else 0
        return pushed + sum(1 << each.pin for each in (self.start, self.stop, self.line) if each)

    @property
    def waiting(self) -> int:
        """Return the frame that is repeated until start is pressed; the first frames stand for its delay."""
        return self.seen - 1 if self.start else 0

    @cached_property
    def start_up(self) -> Position:
        """Return the position before the first pulse."""
        heard = self.line.power_up if self.line else 0
        return Position(self.waiting, running=int(self.start is None), heard=heard)

    @cached_property
    def first(self) -> Position:
        """Return the position at the first pulse."""
        run = next((n for n, (at, _) in enumerate(self.edges) if len(at)), 0)
        return self.start_up._replace(frame=max(self.waiting, self.ends[run - 1] if run else 0))

    def sample(self, place: Place, pin: int, level: int) -> Place | None:
        """Return the place once input `pin` (0: none) was read as `level`; None if it was read before in this
        frame.
        """
        position, levels, sampled = place
        if sampled & pin:
            return None
        if self.line and pin:
            heard, wanted = self.line.hear(position.heard, position.wanted, level)
            position = position._replace(heard=heard, wanted=wanted)
        else:
            levels |= pin * level
        return Place(position, levels, sampled | pin)

    def run_of(self, position: Position) -> int:
        """Return the number of the run of equal frames at `position`; one of no edges if no pulse is due."""
        return bisect_right(self.ends, position.frame) if position.on else len(self.ends)

    def due(self, position: Position) -> tuple[Ints, Ints]:
        """Return the edges of the frame at `position`."""
        return self.edges[self.run_of(position)]

    def after(self, position: Position, levels: int) -> Position:
        """Return the position of the next frame, if the buttons were read as `levels` after this one."""
        frame, running, on, start_seen, stop_seen, heard, wanted = position
        if self.pushed:
            heard, wanted = self.pushed.hear(heard, wanted, levels)
        if self.directions:
            frame = self.directions.after(frame, wanted)
            return position._replace(frame=frame, heard=heard, wanted=wanted)
        if self.start:
            before, start_seen = start_seen, self._count(self.start, start_seen, levels)
            if start_seen == self.seen > before:
                running = on = 1
        if self.stop:
            stop_seen = self._count(self.stop, stop_seen, levels)
            if stop_seen == self.seen:
                running, on = 0, on and not self.off
                if self.off and self.start:
                    frame = self.waiting
        if running:
            frame = frame + 1 if frame + 1 < self.loop_end else self.loop
        silent = frame >= self.loop and not self.buttons and self._silent_loop
        if silent or (not on and not self.start):
            return OVER
        return Position(frame, running, int(on), start_seen, stop_seen, heard, wanted)

    @property
    def _silent_loop(self) -> bool:
        return not any(len(at) for at, _ in self.edges[bisect_right(self.ends, self.loop) :])

    def _count(self, button: Button, seen: int, levels: int) -> int:
        return min(seen + 1, self.seen) if levels >> button.pin & 1 == button.pressed else 0


NO_EDGES = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)


def read_plan(text: bytes, file: str) -> Plan:
    """Return the plan in a schedule. Raises InputError."""
    try:
        data = json.loads(text)
        period = _number(data["period_cycles"], 1)
        pins = [1 << PINS.index(channel["pin"]) for channel in data["channels"]]
        commands = data.get("commands")
        directions = commands["directions"] if commands else []
        parts = [direction[part] for direction in directions for part in ("start", "cycle", "stop")]
        loop_runs = len(data["lead_in"]) + len(data["loop"])
        runs = [*data["lead_in"], *data["loop"], *(run for part in parts for run in part)]
        frames = [_number(run["frames"], 1) for run in runs]
        buttons = data.get("buttons") or {"start": None, "stop": None, "pulses": "hold", "pressed_frames": 1}
        if not data["loop"] or len(set(pins)) < len(pins) or buttons["pulses"] not in ("off", "hold"):
            raise ValueError("it needs a loop, a pin for each channel, and pulses 'off' or 'hold'")
        return Plan(
            clock_hz=_number(data["clock_hz"], 4),
            period=period,
            channels=sum(pins),
            ends=list(accumulate(frames)),
            edges=[_edges(run["pulses"], pins, period) for run in runs] + [NO_EDGES],
            loop=(loop := sum(frames[: len(data["lead_in"])])),
            loop_end=(end := sum(frames[:loop_runs])),
            start=_button(buttons["start"]),
            stop=_button(buttons["stop"]),
            off=buttons["pulses"] == "off",
            seen=_number(buttons["pressed_frames"], 1),
            line=_line(commands) if commands and "pin" in commands else None,
            pushed=_pushed(commands) if commands and "pin" not in commands else None,
            directions=_directions(commands, loop, end) if commands else None,
        )
    except (ValueError, TypeError, KeyError, AttributeError, IndexError, RecursionError) as error:
        message = f"not a schedule: {type(error).__name__}: {error}"
        raise InputError("not-a-schedule", message, Location(file)) from error


def _number(value: Any, least: int, largest: int = LARGEST) -> int:
    if type(value) is not int or not least <= value <= largest:
        raise ValueError(f"{value!r} is not a number of {least} to {largest}")
    return value


def _button(data: Any) -> Button | None:
    return None if data is None else Button(PINS.index(data["pin"]), _number(data["level"], 0, 1))


def _directions(data: dict[str, Any], loop: int, at: int) -> Directions:
    """Return the directions of a schedule whose loop are the frames from `loop` up to `at`."""
    parts = [(loop, at, at, at)]
    for direction in data["directions"]:
        lengths = [
            sum(_number(run["frames"], 1) for run in direction[part]) for part in ("start", "cycle", "stop")
        ]
        start, cycle, stop, at = accumulate((at, *lengths))
        if not all(lengths):
            raise ValueError("a direction needs a start, a cycle and a stop")
        parts.append((start, cycle, stop, at))
    return Directions(parts)


def _pushed(data: dict[str, Any]) -> DirectionButtons:
    pins = [_button(direction) for direction in data["directions"]]
    buttons = [(button.pin, button.pressed) for button in pins if button]
    if not 0 < len({pin for pin, _ in buttons}) == len(buttons) < 8:
        raise ValueError("the directions need buttons of different pins")
    return DirectionButtons(buttons, _number(data["pressed_frames"], 1, 31))


def _line(data: dict[str, Any]) -> Line | StepButton:
    if "pressed_frames" in data:
        level, frames = _number(data["level"], 0, 1), _number(data["pressed_frames"], 1, 7)
        return StepButton(PINS.index(data["pin"]), level, frames, len(data["directions"]))
    codes = [direction["code"] for direction in data["directions"]]
    if not all(codes) or set("".join(codes)) - set("01"):
        raise ValueError("a direction needs a code of levels")
    if not codes or len(set(codes)) < len(codes):
        raise ValueError("a line needs directions of different codes")
    if 1 << max(map(len, codes)) > OFF:
        raise ValueError("a code has at most 6 levels")
    return Line(
        PINS.index(data["pin"]),
        str(_number(data["rest_level"], 0, 1)),
        _number(data["rest_frames"], 1, OFF - 1),
        _number(data["stop_frames"], 1, OFF - 1),
        codes,
    )


def _edges(pulses: list[Any], pins: list[int], period: int) -> tuple[Ints, Ints]:
    """Return the edges of a frame, which all lie within it."""
    changes: dict[int, int] = {}
    for pin, pulse in zip(pins, pulses, strict=True):
        if pulse is not None:
            rise, width = _number(pulse[0], 0), _number(pulse[1], 1)
            for cycle in (rise, _number(rise + width, 0, period - 1)):
                changes[cycle] = changes.get(cycle, 0) ^ pin
    at = sorted(changes)
    levels = np.bitwise_xor.accumulate(np.array([changes[cycle] for cycle in at], dtype=np.int64))
    return np.array(at, dtype=np.int64), levels
