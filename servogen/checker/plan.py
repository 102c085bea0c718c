"""What the pins must do: the frames of a schedule, and the inputs that choose among them.

In: schedule.json as bytes. Out: a `Plan`. Pins are bits of a word: RA0 to RA4 are 0 to 4, RB0 to RB7 are 5 to
12. What the inputs choose follows docs/firmware.md; each way of choosing keeps a memory of what was read.
"""

from __future__ import annotations

import json
from bisect import bisect_right
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import accumulate
from math import ceil
from typing import Any, ClassVar, NamedTuple, cast

import numpy as np
import numpy.typing as npt

from servogen.checker.layout import RA4
from servogen.checker.wire import WireReads
from servogen.errors import InputError, Location

Ints = npt.NDArray[np.int64]
Memory = tuple[Any, ...]
PINS = [f"RA{n}" for n in range(5)] + [f"RB{n}" for n in range(8)]
LARGEST = 10**9
"""The largest number in a schedule, in cycles 1000 s at 4 MHz: a larger one is a mistake."""


class PlanPosition(NamedTuple):
    """The frame whose pulses are due, and the memory of the inputs."""

    frame: int
    memory: Memory


OVER = PlanPosition(-1, ())
"""No pulse will follow, whatever happens."""
AWAITED = -2
"""The frame of a program without pulses that awaits the wire of another chip."""


class Place(NamedTuple):
    """The memory of the inputs, the pins that were read in this frame, and their levels."""

    memory: Memory
    levels: int = 0
    sampled: int = 0


class RecordedTape(NamedTuple):
    """The EEPROM of a tape: its pins, SCL and RA4, as a word; its bytes, and those of them that are known."""

    pins: int
    size: int
    content: bytes


class Button(NamedTuple):
    pin: int
    pressed: int
    """The level while it is pressed."""

    def down(self, levels: int) -> bool:
        """Return whether it is pressed."""
        return levels >> self.pin & 1 == self.pressed


@dataclass(frozen=True)
class StartStop:
    """Buttons that start and stop the motion, by "Start and emergency stop". The memory is whether it runs,
    whether there are pulses, and for how many frames start and stop were seen pressed.
    """

    start: Button | None
    stop: Button | None
    off: bool
    """Whether stop ends the pulses."""
    frames: int
    """The frames in a row in which a button must be pressed."""
    at_once: ClassVar[bool] = False

    @property
    def power_up(self) -> Memory:
        """Return the memory at power-up."""
        return int(self.start is None), 1, 0, 0

    def hear(self, memory: Memory, levels: int) -> Memory:
        """Return the memory after a frame in which the buttons had these levels."""
        running, on, started, stopped = memory
        if self.start:
            before, started = started, self._count(self.start, started, levels)
            if started == self.frames > before:
                running = on = 1
        if self.stop:
            stopped = self._count(self.stop, stopped, levels)
            if stopped == self.frames:
                running, on = 0, int(on and not self.off)
        return running, on, started, stopped

    def _count(self, button: Button, seen: int, levels: int) -> int:
        return min(seen + 1, self.frames) if button.down(levels) else 0


@dataclass(frozen=True)
class Line:
    """A line with codes, by "Walk on command". The memory is the direction that is commanded, 0 to stand, and
    what was heard since the line was at rest: the levels of a code, or - and equal levels that are none.
    """

    pin: int
    rest: str
    """The level at rest."""
    rest_frames: int
    stop_frames: int
    codes: list[str]
    at_once: ClassVar[bool] = True
    """What is read counts at once, not at the end of the frame."""

    @property
    def power_up(self) -> Memory:
        """Return the memory at power-up: one level that is not at rest was heard."""
        return 0, "-" + "10"[int(self.rest)]

    def hear(self, memory: Memory, levels: int) -> Memory:
        """Return the memory after the line was read at this level."""
        wanted, heard = memory
        level = str(levels >> self.pin & 1)
        if heard == "" and level == self.rest:
            return wanted, ""
        heard += level
        code = heard[1:]
        if heard[0] != "-":
            if code in self.codes:
                wanted = self.codes.index(code) + 1
            elif any(other.startswith(code) for other in self.codes):
                return wanted, heard
        run = len(heard) - len(heard.rstrip(level))
        if level == self.rest:
            return wanted, "" if run >= self.rest_frames else "-" + level * run
        if run >= self.stop_frames:
            return 0, "-" + level * (self.stop_frames - 1)
        return wanted, "-" + level * run


@dataclass(frozen=True)
class StepButton:
    """One button that steps through the directions. The memory is the direction that is commanded, 0 to
    stand, the latest one, and the frames in which the button was seen pressed.
    """

    button: Button
    frames: int
    directions: int
    power_up: ClassVar[Memory] = (0, 0, 0)
    at_once: ClassVar[bool] = True

    def hear(self, memory: Memory, levels: int) -> Memory:
        """Return the memory after the button was read at this level."""
        wanted, latest, seen = memory
        if not self.button.down(levels):
            return wanted, latest, 0
        if seen + 1 == self.frames:
            latest = latest if wanted else latest % self.directions + 1
            wanted = 0 if wanted else latest
        return wanted, latest, min(seen + 1, self.frames)


@dataclass(frozen=True)
class DirectionButtons:
    """A button for each direction. The memory is the direction that is commanded, 0 to stand, the one whose
    button alone is pressed, 0 for none, and the frames in which that was the same.
    """

    buttons: list[Button]
    frames: int
    power_up: ClassVar[Memory] = (0, 0, 0)
    at_once: ClassVar[bool] = False

    def hear(self, memory: Memory, levels: int) -> Memory:
        """Return the memory after a frame in which the buttons had these levels."""
        wanted, before, seen = memory
        down = [number for number, button in enumerate(self.buttons, 1) if button.down(levels)]
        now = down[0] if len(down) == 1 else 0
        seen = min(seen + 1, self.frames) if now == before else 1
        return now if seen == self.frames else wanted, now, seen


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
    buttons: int
    """The pins that are read once in each frame, as a word."""
    inputs: StartStop | Line | StepButton | DirectionButtons | WireReads
    parts: list[tuple[int, int, int, int]]
    """Of the stance and of each direction: the first frames of its start, cycle and stop, and the frame
    after; empty if none is commanded.
    """
    stated: frozenset[tuple[str, int]] = frozenset()
    """Input pins with the one level of which the schedule says what follows; it says nothing of other levels.
    """
    write_us: int = 20_000
    """The longest EEPROM write (parameter D122)."""
    fastest: int = 20_000_000
    """The chip's largest clock in Hz."""
    tape: RecordedTape | None = None

    @property
    def waiting(self) -> int:
        """Return the frame that is repeated until start is pressed; the first frames stand for its delay."""
        inputs = self.inputs
        return inputs.frames - 1 if isinstance(inputs, StartStop) and inputs.start else 0

    @property
    def wire(self) -> WireReads | None:
        """Return the wire of another chip that the program follows; None if it follows none."""
        return self.inputs if isinstance(self.inputs, WireReads) else None

    @cached_property
    def start(self) -> PlanPosition:
        """Return the position at power-up: no pulse is due before a wire has risen."""
        return PlanPosition(AWAITED, self.wire.power_up) if self.wire else self.first

    @cached_property
    def first(self) -> PlanPosition:
        """Return the position at the first pulse."""
        run = next(number for number, (cycles, _) in enumerate(self.edges) if len(cycles))
        return PlanPosition(max(self.waiting, self.ends[run - 1] if run else 0), self.inputs.power_up)

    def sample(self, place: Place, pin: int, level: int) -> Place | None:
        """Return the place once the pin was read; None if it was read before in this frame."""
        memory, levels, sampled = place
        if sampled >> pin & 1:
            return None
        if self.inputs.at_once:
            return Place(self.inputs.hear(memory, level << pin), 0, 1 << pin)
        return Place(memory, levels | level << pin, sampled | 1 << pin)

    def run_of(self, position: PlanPosition) -> int:
        """Return the number of the run of equal frames at `position`; one of no edges if no pulse is due."""
        on = position.frame >= 0 and (not isinstance(self.inputs, StartStop) or position.memory[1])
        return bisect_right(self.ends, position.frame) if on else len(self.ends)

    def following(self, frame: int, memory: Memory) -> PlanPosition:
        """Return the position of the frame after `frame`, with what is remembered at its end."""
        if self.parts:
            return PlanPosition(self._commanded(frame, memory[0]), memory)
        if self.wire:
            return PlanPosition(frame + 1 if frame + 1 < self.loop_end else self.loop, self.wire.plays)
        inputs = cast(StartStop, self.inputs)
        running, on, _, stopped = memory
        if inputs.start and inputs.off and stopped == inputs.frames:
            frame = self.waiting
        if running:
            frame = frame + 1 if frame + 1 < self.loop_end else self.loop
        pulses = any(len(cycles) for cycles, _ in self.edges[bisect_right(self.ends, self.loop) :])
        silent = frame >= self.loop and not self.buttons and not pulses
        return OVER if silent or not (on or inputs.start) else PlanPosition(frame, memory)

    def silent_after(self, frame: int) -> bool:
        """Return whether no frame after `frame` has a pulse, whatever the inputs are."""
        later = self.edges[min(bisect_right(self.ends, frame + 1), bisect_right(self.ends, self.loop)) :]
        return not (self.buttons or self.parts or any(len(cycles) for cycles, _ in later))

    def _commanded(self, frame: int, wanted: int) -> int:
        """Return the frame after `frame`, that of another part where it is the last one of its part."""
        for direction, (start, cycle, stop, end) in enumerate(self.parts):
            if frame + 1 == end or (frame + 1 == start and not direction):
                return self.parts[wanted][0]
            if frame + 1 in (cycle, stop) and direction:
                return cycle if wanted == direction else stop
        return frame + 1


UNCOMMANDED = StartStop(None, None, off=False, frames=1)
NO_EDGES = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)


def read_plan(text: bytes, file: str, tape: bytes = b"") -> Plan:
    """Return the plan in a schedule, with the content of its tape. Raises InputError."""
    try:
        return _plan(json.loads(text), tape)
    except (ValueError, TypeError, KeyError, AttributeError, IndexError, RecursionError) as error:
        message = f"not a schedule: {type(error).__name__}: {error}"
        raise InputError("not-a-schedule", message, Location(file)) from error


def _plan(data: dict[str, Any], tape: bytes) -> Plan:
    period = _number(data["period_cycles"], 1)
    buttons = [1 << PINS.index(entry["pin"]) for entry in _inputs(data)]
    pins = [1 << PINS.index(channel["pin"]) for channel in data["channels"]]
    commands = data.get("commands")
    directions = commands["directions"] if commands else []
    parts = [data["lead_in"], data["loop"]]
    parts += [direction[part] for direction in directions for part in ("start", "cycle", "stop")]
    lengths = [sum(_number(run["frames"], 1) for run in part) for part in parts]
    steered = [key for key in ("commands", "buttons", "wire") if data.get(key)]
    if not all(lengths[1:]) or len(set(pins)) < len(pins) or len(steered) > 1:
        raise ValueError("it needs frames in the loop and in all directions, and a pin for each channel")
    if len(set(buttons)) < len(buttons):
        raise ValueError("the inputs need different pins")
    loop, end, *turns = accumulate(lengths)
    runs = [run for part in parts for run in part]
    edges = [_edges(run["pulses"], pins, period) for run in runs]
    if not any(len(cycles) for cycles, _ in edges):
        raise ValueError("it has no pulses")
    first = [end, *turns]
    return Plan(
        clock_hz=_number(data["clock_hz"], 4),
        period=period,
        channels=sum(pins),
        ends=list(accumulate(run["frames"] for run in runs)),
        edges=[*edges, NO_EDGES],
        loop=loop,
        loop_end=end,
        buttons=sum(buttons),
        inputs=_commands(commands)
        if commands
        else _wire(data["wire"], edges, period)
        if data.get("wire")
        else _start_stop(data.get("buttons")),
        parts=[(loop, end, end, end), *zip(first[:-1:3], turns[::3], turns[1::3], turns[2::3], strict=True)]
        if commands
        else [],
        stated=frozenset() if buttons else frozenset(map(_stated, data.get("inputs", []))),
        write_us=8_000 if data.get("device") == "PIC16F84A" else 20_000,
        fastest=20_000_000 if data.get("device") in (None, "PIC16F84A") else 10_000_000,
        tape=_tape(data["tape"], tape, sum(pins) | sum(buttons)) if data.get("tape") else None,
    )


def _inputs(data: dict[str, Any]) -> list[dict[str, Any]]:
    """Return what has a pin among the buttons, or the directions, or the line."""
    commands, buttons = data.get("commands"), data.get("buttons") or {}
    if data.get("wire"):
        return [data["wire"]]
    if commands:
        return [commands] if "pin" in commands else commands["directions"]
    return [buttons[name] for name in ("start", "stop") if buttons.get(name)]


def _number(value: Any, least: int, largest: int = LARGEST) -> int:
    if type(value) is not int or not least <= value <= largest:
        raise ValueError(f"{value!r} is not a number of {least} to {largest}")
    return value


def _stated(data: Any) -> tuple[str, int]:
    return PINS[PINS.index(data["pin"])], _number(data["level"], 0, 1)


def _button(data: Any) -> Button:
    return Button(PINS.index(data["pin"]), _number(data["level"], 0, 1))


def _start_stop(data: dict[str, Any] | None) -> StartStop:
    if data is None:
        return UNCOMMANDED
    start, stop = (_button(data[name]) if data[name] else None for name in ("start", "stop"))
    return StartStop(
        start, stop, ("hold", "off").index(data["pulses"]) == 1, _number(data["pressed_frames"], 1)
    )


def _commands(data: dict[str, Any]) -> Line | StepButton | DirectionButtons:
    directions = data["directions"]
    if "pin" not in data:
        buttons = [_button(direction) for direction in directions]
        if not buttons:
            raise ValueError("the directions need buttons")
        return DirectionButtons(buttons, _number(data["pressed_frames"], 1))
    if "pressed_frames" in data:
        return StepButton(_button(data), _number(data["pressed_frames"], 1), _number(len(directions), 1))
    codes = [direction["code"] for direction in directions]
    if not codes or not all(codes) or set("".join(codes)) - set("01") or len(set(codes)) < len(codes):
        raise ValueError("a line needs directions of different codes of levels")
    rest = str(_number(data["rest_level"], 0, 1))
    rest_frames, stop_frames = (_number(data[name], 1, 99) for name in ("rest_frames", "stop_frames"))
    return Line(PINS.index(data["pin"]), rest, rest_frames, stop_frames, codes)


def _tape(data: dict[str, Any], content: bytes, used: int) -> RecordedTape:
    pins = 1 << PINS.index(data["scl"]) | RA4
    kilobits = _number(int(data["eeprom"].removeprefix("24LC")), 32, 512)
    if data["sda"] != "RA4" or pins == RA4 or pins & used or kilobits & kilobits - 1:
        raise ValueError("a tape's SDA is RA4, an open drain, and its EEPROM a 24LC32 to 24LC512")
    if not 0 < len(content) <= kilobits * 128:
        raise ValueError(f"a tape of {len(content)} bytes in a {data['eeprom']}")
    return RecordedTape(pins, kilobits * 128, content)


def _wire(data: dict[str, Any], edges: list[tuple[Ints, Ints]], period: int) -> WireReads:
    first = next(int(cycles[0]) for cycles, _ in edges if len(cycles))
    early, ppm = 0, _number(data.get("crystal_ppm", 0), 0, 1000)
    if ppm:
        apart = ceil(Fraction(2 * period * ppm, 1_000_000 - ppm))  # how far two crystals drift in a frame
        early = 4 + apart + 2 - apart % 2
    ahead = _number(data["cycles"], early + 1)
    look = period + first - ahead - (early or 1)
    if not all(2 < cycle < look for cycles, _ in edges for cycle in cycles[1:]):
        raise ValueError("the wire is looked at between the pulses of two frames")
    frames, quiet = _number(data["frames"], 1, 99), _number(data["quiet_cycles"], 1)
    if ppm and frames != 1:
        raise ValueError("with a crystal each the first frame is that of the wire's rise 1")
    restart, pulled = 0, 0
    if "restart" in data:
        restart, pulled = 1 << PINS.index(data["restart"]), _number(data["restart_cycles"], 1)
    return WireReads(PINS.index(data["pin"]), period, frames, quiet, look, restart, pulled, early)


def _edges(pulses: list[Any], pins: list[int], period: int) -> tuple[Ints, Ints]:
    """Return the edges of a frame, which all lie within it."""
    changes: dict[int, int] = {}
    for pin, pulse in zip(pins, pulses, strict=True):
        if pulse is not None:
            rise, width = _number(pulse[0], 0), _number(pulse[1], 1)
            for cycle in (rise, _number(rise + width, 0, period - 1)):
                changes[cycle] = changes.get(cycle, 0) ^ pin
    cycles = sorted(changes)
    levels = np.bitwise_xor.accumulate(np.array([changes[cycle] for cycle in cycles], dtype=np.int64))
    return np.array(cycles, dtype=np.int64), levels
