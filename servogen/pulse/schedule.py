"""`PulseSchedule`: every pulse of every channel in integer cycles, from which firmware is generated.

In: run-length frames. Out: the same as deterministic JSON, and back. Module `expected` computes its edges.

    frame (period cycles)                frame
    ├─rise─┐width┌───────────────────────├─rise─┐width┌────
           └─────┘  channel 0                   └─────┘
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from hashlib import sha256
from math import ceil
from types import MappingProxyType
from typing import Any

from servogen.edges import PINS
from servogen.errors import InputError, Location, did_you_mean
from servogen.motion.trajectory import MAX_FRAMES
from servogen.notebooks import table_html
from servogen.pic.device import OPEN_DRAIN_PIN
from servogen.plan_error import PlanError
from servogen.units import Clock, Cycles

VERSION = 1
"""The version of the JSON schema."""

OPTIONAL: Mapping[str, Any] = MappingProxyType(
    {
        "inputs": [],
        "buttons": None,
        "commands": None,
        "plan_error": None,
        "device": None,
        "wire": None,
        "tape": None,
    }
)
"""Keys that a schedule may omit, with their default values."""

MAX_DISTANCE = 1e9
"""The maximum plan error in any unit; a larger number must be a mistake."""

TAPE_FILE = "tape.bin"
"""The file beside a schedule's JSON with the content of its tape."""

START_FRAMES = 50
"""The maximum number of frames from reset to the first pulse; later, a program counts as silent."""


@dataclass(frozen=True, slots=True)
class Channel:
    """A servo on a pin; `servo` is its model's name."""

    name: str
    pin: str
    servo: str


@dataclass(frozen=True, slots=True)
class Pulse:
    """A pulse: high for `width` cycles from cycle `rise` of its frame."""

    rise: Cycles
    width: Cycles


@dataclass(frozen=True, slots=True)
class Run:
    """`frames` equal frames; `pulses` has one entry per channel, None for no pulse."""

    frames: int
    pulses: tuple[Pulse | None, ...]


@dataclass(frozen=True, slots=True)
class Input:
    """A pin that the program reads, and the level, 0 or 1, at which the board holds it."""

    pin: str
    level: int


@dataclass(frozen=True, slots=True)
class ButtonRule:
    """How the buttons change the motion: see "Start and emergency stop" in docs/firmware.md.

    The levels of `start` and `stop` are those while pressed. The schedule itself assumes that start is
    pressed and stop is released from power-up on: with a start button its first frame is repeated
    `pressed_frames` - 1 times at the beginning.
    """

    start: Input | None
    stop: Input | None
    off: bool
    """Whether stop switches the pulses off; otherwise it holds them."""
    pressed_frames: int
    """The number of consecutive frames in which a button must be seen pressed to count."""

    @property
    def waiting(self) -> int:
        """Return how many times the first frame is repeated at the beginning of the schedule."""
        return self.pressed_frames - 1 if self.start else 0

    def to_json(self) -> dict[str, object]:
        return {
            "start": {"pin": self.start.pin, "level": self.start.level} if self.start else None,
            "stop": {"pin": self.stop.pin, "level": self.stop.level} if self.stop else None,
            "pulses": "off" if self.off else "hold",
            "pressed_frames": self.pressed_frames,
        }


@dataclass(frozen=True, slots=True)
class DirectionRuns:
    """The frames of a commanded direction: `start` once, `cycle` repeatedly, `stop` once."""

    name: str
    selector: str | Input | None
    """The levels of its code, without the start; or its button, with the level while it is pressed; None if
    one button steps through the directions.
    """
    start: tuple[Run, ...]
    cycle: tuple[Run, ...]
    stop: tuple[Run, ...]

    def to_json_text(self) -> str:
        """Return the direction as text with one run per line."""
        parts = ", ".join(
            f'"{name}": {_runs_text(runs)}'
            for name, runs in (("start", self.start), ("cycle", self.cycle), ("stop", self.stop))
        )
        if self.selector is None:
            selector = ""
        elif isinstance(self.selector, str):
            selector = f'"code": {json.dumps(self.selector)}, '
        else:
            selector = f'"pin": {json.dumps(self.selector.pin)}, "level": {self.selector.level}, '
        return f'{{"name": {json.dumps(self.name)}, {selector}{parts}}}'


@dataclass(frozen=True, slots=True)
class CodeLine:
    """A line that carries the codes of directions; its level is that at rest."""

    line: Input
    rest_frames: int
    """The number of frames for which the line must be at rest before a code."""
    stop_frames: int
    """The number of frames at the other level that command a stop."""

    def to_json_text(self) -> str:
        return (
            f'"pin": {json.dumps(self.line.pin)}, "rest_level": {self.line.level}, '
            f'"rest_frames": {self.rest_frames}, "stop_frames": {self.stop_frames}'
        )


@dataclass(frozen=True, slots=True)
class DirectionButtons:
    """A button for each direction; none pressed, or several, commands a stop."""

    pressed_frames: int
    """The number of consecutive frames in which the same must be seen to count."""

    def to_json_text(self) -> str:
        return f'"pressed_frames": {self.pressed_frames}'


@dataclass(frozen=True, slots=True)
class StepButton:
    """A button whose press commands a stop if a direction is commanded, and else the next direction.

    Its level is that while it is pressed.
    """

    button: Input
    pressed_frames: int
    """The number of consecutive frames in which it must be seen pressed to count."""

    def to_json_text(self) -> str:
        return (
            f'"pin": {json.dumps(self.button.pin)}, "level": {self.button.level}, '
            f'"pressed_frames": {self.pressed_frames}'
        )


@dataclass(frozen=True, slots=True)
class CommandRule:
    """How a line or buttons command the motion: see "Walk on command" in docs/firmware.md.

    The schedule itself assumes a line at rest, or no button pressed, from power-up on: its loop is the frame
    of the stance.
    """

    read: CodeLine | DirectionButtons | StepButton
    """What the program reads in each frame."""
    directions: tuple[DirectionRuns, ...]

    def to_json_text(self) -> str:
        """Return the rule as text."""
        directions = ",\n    ".join(direction.to_json_text() for direction in self.directions)
        return f'{{{self.read.to_json_text()}, "directions": [\n    {directions}\n  ]}}'


NO_CYCLES = Cycles(0)

POLL_CYCLES, FIRST_CYCLES = Cycles(2), Cycles(4)
"""The cycles from one look to the next for the rise of a wire from another crystal: in every frame, and for
the first rise, by which its time is known before them.
"""


MAX_PPM = 1000
"""The most by which crystals of their own may be off."""


def drift(crystal_ppm: int) -> Fraction:
    """Return by how much one of two crystals may be faster than the other, as a part of its frequency."""
    return Fraction(2 * crystal_ppm, 1_000_000 - crystal_ppm)


def seldom(period: Cycles) -> Cycles:
    """Return the most cycles from one look at a quiet wire to the next: no pulse may be missed."""
    return Cycles(period // 60)


def awaited_early(period: Cycles, crystal_ppm: int) -> Cycles:
    """Return by how much the looks for a wire's rise begin before a frame has passed, and end after it, if
    both crystals may be off by `crystal_ppm`; an even number, 0 for one crystal. They begin before any rise,
    seen late or not.
    """
    if not crystal_ppm:
        return NO_CYCLES
    return Cycles(2 * (ceil(period * drift(crystal_ppm)) // 2 + 1) + FIRST_CYCLES)


@dataclass(frozen=True, slots=True)
class WireRule:
    """The wire from another chip: see "Two chips" in docs/firmware.md.

    The first edge of the schedule comes `cycles` cycles after the wire has risen in frame `frames`, counted
    from 0, of the other chip's motion. A rise is that of frame 0 if the wire was low in each of the program's
    looks before it, the first of them `quiet` cycles or more before the last. After each reset the program
    pulls `restart`, wired to the other chip's MCLR, low for `pulled` cycles or more, once, before its first
    look. Chips with two crystals, each off by `crystal_ppm` or less, look for the rise every `POLL_CYCLES`
    around its time: `cycles` count from the look that sees it.
    """

    pin: str
    source: str
    """The other chip's pin."""
    frames: int
    cycles: Cycles
    quiet: Cycles
    restart: str | None = None
    pulled: Cycles = NO_CYCLES
    crystal_ppm: int = 0
    """0 for one crystal."""

    def early(self, period: Cycles) -> Cycles:
        """Return by how much the looks for a rise begin before a frame has passed; 0 with one crystal."""
        return awaited_early(period, self.crystal_ppm)

    def to_json(self) -> dict[str, object]:
        restart = {"restart": self.restart, "restart_cycles": self.pulled} if self.restart else {}
        crystal = {"crystal_ppm": self.crystal_ppm} if self.crystal_ppm else {}
        return {
            "pin": self.pin,
            "from": self.source,
            "frames": self.frames,
            "cycles": self.cycles,
            "quiet_cycles": self.quiet,
            **restart,
            **crystal,
        }


@dataclass(frozen=True, slots=True)
class TapeRule:
    """The serial EEPROM from which the program reads its frames: see "The tape" in docs/firmware.md."""

    scl: str
    sda: str
    eeprom: str
    """The part."""
    content: bytes = field(default=b"", repr=False)
    """Its bytes, which a file of their own holds (`TAPE_FILE`)."""

    @property
    def digest(self) -> str:
        """Return how many bytes the content has, and the beginning of its SHA-256."""
        return f"{len(self.content)} bytes with SHA-256 {sha256(self.content).hexdigest()[:16]}…"

    def to_json(self) -> dict[str, object]:
        return {"scl": self.scl, "sda": self.sda, "eeprom": self.eeprom}


@dataclass(frozen=True, slots=True)
class PulseSchedule:
    """Frames of `period` cycles: `lead_in` once, then `loop` repeatedly.

    `inputs` are held from power-up on; a button pressed at another time results in another schedule.
    """

    clock: Clock
    period: Cycles
    channels: tuple[Channel, ...]
    lead_in: tuple[Run, ...]
    loop: tuple[Run, ...]
    inputs: tuple[Input, ...] = ()
    plan_error: PlanError | None = None
    """The distance of the pulses from the planned motion; None if no plan is known."""
    device: str | None = None
    """The chip that the schedule was built for; None if it is not known."""
    buttons: ButtonRule | None = None
    """The effect of buttons that are not pressed as `inputs` states; None if it is not known."""
    commands: CommandRule | None = None
    """The effect of a line, or of buttons, at other levels than `inputs` states; None if there are none."""
    wire: WireRule | None = None
    """The wire that the program follows; None for a program that follows no other chip."""
    tape: TapeRule | None = None
    """The EEPROM from which the program reads its frames; None for a program that holds them itself."""

    def __repr__(self) -> str:
        channels = ", ".join(f"{channel.name} on {channel.pin}" for channel in self.channels)
        frames = f"{self.lead_in_frames} + {self.loop_frames} frames"
        return f"<PulseSchedule {channels}; {frames} of {float(self.clock.us(self.period)) / 1000:g} ms>"

    def _repr_html_(self) -> str:
        frames = f"{self.lead_in_frames} frames, then {self.loop_frames} repeatedly"
        title = f"{frames}, of {float(self.clock.us(self.period)) / 1000:g} ms"
        rows = []
        for number, channel in enumerate(self.channels):
            pulses = (run.pulses[number] for run in (*self.lead_in, *self.loop))
            widths = [float(self.clock.us(pulse.width)) for pulse in pulses if pulse]
            shown = f"{min(widths):.10g} to {max(widths):.10g}" if widths else "none"
            rows.append((channel.name, channel.pin, shown))
        return table_html(title, ("channel", "pin", "pulses, µs"), rows)

    @property
    def plan_error_us(self) -> float:
        """Return the largest distance of a pulse from the plan in µs; 0 if no plan is known."""
        return 0.0 if self.plan_error is None else self.plan_error.width_us

    @property
    def lead_in_frames(self) -> int:
        """Return the number of frames before the loop."""
        return sum(run.frames for run in self.lead_in)

    @property
    def loop_frames(self) -> int:
        """Return the number of frames in the loop."""
        return sum(run.frames for run in self.loop)

    def run_cycles(self, span: int) -> Cycles:
        """Return the cycles from reset in which a program shows `span` cycles of pulses, or is silent."""
        return Cycles(span + START_FRAMES * self.period)

    def json_text(self) -> str:
        """Return the schedule as text with one run per line; equal schedules give equal texts."""
        channels = ",\n".join(
            "    " + json.dumps({"name": channel.name, "pin": channel.pin, "servo": channel.servo})
            for channel in self.channels
        )
        return (
            f'{{\n  "version": {VERSION},\n'
            f"{self._device_text()}"
            f'  "clock_hz": {self.clock.hz},\n'
            f'  "period_cycles": {self.period},\n'
            f'  "channels": [\n{channels}\n  ],\n'
            f"{self._inputs_text()}"
            f"{self._buttons_text()}"
            f"{self._commands_text()}"
            f"{self._wire_text()}"
            f"{self._tape_text()}"
            f"{self._plan_error_text()}"
            f'  "lead_in": {_runs_text(self.lead_in)},\n'
            f'  "loop": {_runs_text(self.loop)}\n}}\n'
        )

    def _inputs_text(self) -> str:
        """Return the JSON line of the inputs, empty if the program reads no pin."""
        levels = [{"pin": one.pin, "level": one.level} for one in self.inputs]
        return f'  "inputs": {json.dumps(levels)},\n' if levels else ""

    def _buttons_text(self) -> str:
        return "" if self.buttons is None else f'  "buttons": {json.dumps(self.buttons.to_json())},\n'

    def _commands_text(self) -> str:
        return "" if self.commands is None else f'  "commands": {self.commands.to_json_text()},\n'

    def _wire_text(self) -> str:
        return "" if self.wire is None else f'  "wire": {json.dumps(self.wire.to_json())},\n'

    def _tape_text(self) -> str:
        return "" if self.tape is None else f'  "tape": {json.dumps(self.tape.to_json())},\n'

    def _device_text(self) -> str:
        return "" if self.device is None else f'  "device": {json.dumps(self.device)},\n'

    def _plan_error_text(self) -> str:
        return (
            "" if self.plan_error is None else f'  "plan_error": {json.dumps(self.plan_error.to_json())},\n'
        )


def _runs_text(runs: Iterable[Run]) -> str:
    lines = [
        "    "
        + json.dumps(
            {
                "frames": run.frames,
                "pulses": [[pulse.rise, pulse.width] if pulse else None for pulse in run.pulses],
            }
        )
        for run in runs
    ]
    return "[\n" + ",\n".join(lines) + "\n  ]" if lines else "[]"


MAX_NUMBER = 10**9
"""The maximum of any number in a schedule: hertz, frames, cycles of a frame."""


def _literal(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:37]}…"


def from_json(text: str, file: str) -> PulseSchedule:
    """Return the schedule in a text. Raises InputError that names the wrong key."""
    try:
        data = json.loads(text)
    except json.JSONDecodeError as error:
        raise InputError(
            "json-syntax", f"JSON syntax: {error.msg}", Location(file, error.lineno, error.colno)
        ) from error
    except ValueError as error:
        raise InputError("json-syntax", f"JSON syntax: {error}", Location(file)) from error
    except RecursionError as error:
        raise InputError("json-syntax", "JSON syntax: nested too deeply", Location(file)) from error
    return _Reader(file).schedule(data)


@dataclass(frozen=True, slots=True)
class _Reader:
    """Converts JSON values; every error names the key."""

    file: str

    def schedule(self, data: Any) -> PulseSchedule:
        keys = ("version", "clock_hz", "period_cycles", "channels", "lead_in", "loop", *OPTIONAL)
        known = {**OPTIONAL, **data} if isinstance(data, dict) else data
        table = self._table(known, "", keys)
        version, clock_hz, period, channels, lead_in, loop, inputs, buttons, commands = table[:9]
        plan_error, device, wire, tape = table[9:]
        if self._whole(version, "version", 0) != VERSION:
            raise self._error("json-value", "version", f"is {version}, this servogen reads version {VERSION}")
        cycles = self._whole(period, "period_cycles", 1)
        read = tuple(
            self._channel(entry, f"channels[{index}]")
            for index, entry in enumerate(self._array(channels, "channels"))
        )
        if not read:
            raise self._error("json-value", "channels", "is empty: a schedule has at least one channel")
        for column in ("name", "pin"):
            values = [getattr(channel, column) for channel in read]
            for value in values:
                if values.count(value) > 1:
                    raise self._error("json-value", "channels", f"two channels have the {column} {value}")
        runs = [
            tuple(
                self._run(item, f"{key}[{index}]", len(read), cycles)
                for index, item in enumerate(self._array(value, key))
            )
            for key, value in (("lead_in", lead_in), ("loop", loop))
        ]
        frames = sum(run.frames for part in runs for run in part)
        if frames > MAX_FRAMES:
            raise self._error(
                "json-value", "loop", f"the schedule has {_literal(frames)} frames", f"at most {MAX_FRAMES}"
            )
        if not runs[1]:
            raise self._error(
                "json-value",
                "loop",
                "is empty: the motion must be followed by a frame, at least one without pulses",
            )
        clock = Clock(self._whole(clock_hz, "clock_hz", 1))
        held_inputs = tuple(
            self._input(entry, f"inputs[{index}]", read)
            for index, entry in enumerate(self._array(inputs, "inputs"))
        )
        return PulseSchedule(
            clock=clock,
            period=Cycles(cycles),
            channels=read,
            lead_in=runs[0],
            loop=runs[1],
            inputs=held_inputs,
            plan_error=None if plan_error is None else self._plan_error(plan_error),
            device=None if device is None else self._text(device, "device"),
            buttons=None if buttons is None else self._buttons(buttons, read),
            commands=None if commands is None else self._commands(commands, read, cycles),
            wire=None if wire is None else self._wire(wire, read),
            tape=None if tape is None else self._tape(tape, read),
        )

    def _tape(self, data: Any, channels: tuple[Channel, ...]) -> TapeRule:
        scl, sda, eeprom = self._table(data, "tape", ("scl", "sda", "eeprom"))
        pins = [
            self._input({"pin": pin, "level": 1}, f"tape.{key}", channels).pin
            for key, pin in (("scl", scl), ("sda", sda))
        ]
        return TapeRule(pins[0], pins[1], self._text(eeprom, "tape.eeprom"))

    def _wire(self, data: Any, channels: tuple[Channel, ...]) -> WireRule:
        keys = ("pin", "from", "frames", "cycles", "quiet_cycles", "restart", "restart_cycles", "crystal_ppm")
        usual = {"restart": None, "restart_cycles": 0, "crystal_ppm": 0}
        known = {**usual, **data} if isinstance(data, dict) else data
        pin, source, frames, cycles, quiet, restart, pulled, ppm = self._table(known, "wire", keys)
        if restart not in (None, OPEN_DRAIN_PIN):
            raise self._error("json-value", "wire.restart", f"is not {OPEN_DRAIN_PIN}: {_literal(restart)}")
        read = self._input({"pin": pin, "level": 0}, "wire", channels)
        return WireRule(
            read.pin,
            self._input({"pin": source, "level": 0}, "wire.from", ()).pin,
            self._whole(frames, "wire.frames", 0),
            Cycles(self._whole(cycles, "wire.cycles", 0)),
            Cycles(self._whole(quiet, "wire.quiet_cycles", 0)),
            None
            if restart is None
            else self._input({"pin": restart, "level": 0}, "wire.restart", channels).pin,
            Cycles(self._whole(pulled, "wire.restart_cycles", 0 if restart is None else 1)),
            self._whole(ppm, "wire.crystal_ppm", 0, MAX_PPM),
        )

    def _buttons(self, data: Any, channels: tuple[Channel, ...]) -> ButtonRule:
        start, stop, pulses, frames = self._table(
            data, "buttons", ("start", "stop", "pulses", "pressed_frames")
        )
        if start is None and stop is None:
            raise self._error("json-value", "buttons", "has neither 'start' nor 'stop'")
        if pulses not in ("off", "hold"):
            message = f"is neither 'off' nor 'hold': {_literal(pulses)}"
            raise self._error("json-value", "buttons.pulses", message)
        return ButtonRule(
            None if start is None else self._input(start, "buttons.start", channels),
            None if stop is None else self._input(stop, "buttons.stop", channels),
            pulses == "off",
            self._whole(frames, "buttons.pressed_frames", 1),
        )

    def _commands(self, data: Any, channels: tuple[Channel, ...], period: int) -> CommandRule:
        read: CodeLine | DirectionButtons | StepButton
        if isinstance(data, dict) and {"pressed_frames", "pin"} <= data.keys():
            keys = ("pin", "level", "pressed_frames", "directions")
            pin, level, pressed, directions = self._table(data, "commands", keys)
            read = StepButton(
                self._input({"pin": pin, "level": level}, "commands", channels),
                self._whole(pressed, "commands.pressed_frames", 1),
            )
        elif isinstance(data, dict) and "pressed_frames" in data:
            pressed, directions = self._table(data, "commands", ("pressed_frames", "directions"))
            read = DirectionButtons(self._whole(pressed, "commands.pressed_frames", 1))
        else:
            names = ("pin", "rest_level", "rest_frames", "stop_frames", "directions")
            pin, level, rest, stop, directions = self._table(data, "commands", names)
            read = CodeLine(
                self._input({"pin": pin, "level": level}, "commands", channels),
                self._whole(rest, "commands.rest_frames", 1),
                self._whole(stop, "commands.stop_frames", 1),
            )
        runs = tuple(
            self._direction(entry, f"commands.directions[{index}]", channels, period, read)
            for index, entry in enumerate(self._array(directions, "commands.directions"))
        )
        if not runs:
            raise self._error(
                "json-value", "commands.directions", "is empty: at least one direction can be commanded"
            )
        own = {
            direction.selector.pin if isinstance(direction.selector, Input) else direction.selector
            for direction in runs
        }
        if len(own) < len(runs) and not isinstance(read, StepButton):
            key = "code" if isinstance(read, CodeLine) else "pin"
            raise self._error("json-value", "commands.directions", f"two directions have the same {key}")
        return CommandRule(read, runs)

    def _direction(
        self,
        data: Any,
        key: str,
        channels: tuple[Channel, ...],
        period: int,
        read: CodeLine | DirectionButtons | StepButton,
    ) -> DirectionRuns:
        parts_of = ("start", "cycle", "stop")
        selector: str | Input | None = None
        if isinstance(read, StepButton):
            name, *parts = self._table(data, key, ("name", *parts_of))
        elif isinstance(read, CodeLine):
            name, code, *parts = self._table(data, key, ("name", "code", *parts_of))
            selector = self._text(code, f"{key}.code")
            if not selector or selector.strip("01"):
                raise self._error(
                    "json-value", f"{key}.code", f"is not a string of 0 and 1: {_literal(code)}"
                )
        else:
            name, pin, level, *parts = self._table(data, key, ("name", "pin", "level", *parts_of))
            selector = self._input({"pin": pin, "level": level}, key, channels)
        runs = []
        for part, value in zip(parts_of, parts, strict=True):
            where = f"{key}.{part}"
            entries = enumerate(self._array(value, where))
            runs.append(
                tuple(
                    self._run(entry, f"{where}[{index}]", len(channels), period) for index, entry in entries
                )
            )
            if not runs[-1]:
                raise self._error("json-value", where, "is empty: at least one frame is needed")
            if sum(run.frames for run in runs[-1]) > MAX_FRAMES:
                raise self._error("json-value", where, "has too many frames", f"at most {MAX_FRAMES}")
        return DirectionRuns(self._text(name, f"{key}.name"), selector, *runs)

    def _plan_error(self, data: Any) -> PlanError:
        keys = ("width_us", "angle_deg", "speed_deg_s", "end", "end_mm")
        width, angle, speed, end, away = self._table(data, "plan_error", keys)
        if (end is None) != (away is None):
            raise self._error(
                "json-value", "plan_error", "has only one of 'end' and 'end_mm': state both, or null for both"
            )
        return PlanError(
            width_us=self._distance(width, "plan_error.width_us"),
            angle_deg=None if angle is None else self._distance(angle, "plan_error.angle_deg"),
            speed_deg_s=None if speed is None else self._distance(speed, "plan_error.speed_deg_s"),
            end=None if end is None else self._text(end, "plan_error.end"),
            end_mm=None if away is None else self._distance(away, "plan_error.end_mm"),
        )

    def _channel(self, data: Any, key: str) -> Channel:
        values = self._table(data, key, ("name", "pin", "servo"))
        for value, name in zip(values, ("name", "pin", "servo"), strict=True):
            self._text(value, f"{key}.{name}")
        if values[1] not in PINS:
            raise self._error(
                "unknown-pin", f"{key}.pin", f"unknown pin {values[1]!r}", did_you_mean(values[1], PINS)
            )
        return Channel(*values)

    def _input(self, data: Any, key: str, channels: tuple[Channel, ...]) -> Input:
        pin, level = self._table(data, key, ("pin", "level"))
        if pin not in PINS:
            raise self._error(
                "unknown-pin", f"{key}.pin", f"unknown pin {pin!r}", did_you_mean(str(pin), PINS)
            )
        if pin in [channel.pin for channel in channels]:
            raise self._error("json-value", f"{key}.pin", f"{pin} is a servo's")
        if self._whole(level, f"{key}.level", 0) > 1:
            raise self._error("json-value", f"{key}.level", f"is neither 0 nor 1: {level}")
        return Input(pin, level)

    def _run(self, data: Any, key: str, channels: int, period: int) -> Run:
        frames, pulses = self._table(data, key, ("frames", "pulses"))
        entries = self._array(pulses, f"{key}.pulses")
        if len(entries) != channels:
            raise self._error(
                "json-value", f"{key}.pulses", f"has {len(entries)} entries for {channels} channels"
            )
        return Run(
            self._whole(frames, f"{key}.frames", 1),
            tuple(
                self._pulse(entry, f"{key}.pulses[{index}]", period) for index, entry in enumerate(entries)
            ),
        )

    def _pulse(self, data: Any, key: str, period: int) -> Pulse | None:
        if data is None:
            return None
        pair = self._array(data, key)
        if len(pair) != 2:
            raise self._error("json-value", key, f"is [rise, width] or null, not {len(pair)} numbers")
        rise, width = self._whole(pair[0], f"{key}[0]", 0), self._whole(pair[1], f"{key}[1]", 1)
        if rise + width >= period:
            raise self._error("json-value", key, f"ends in cycle {rise + width}, its frame has only {period}")
        return Pulse(Cycles(rise), Cycles(width))

    def _table(self, data: Any, key: str, names: tuple[str, ...]) -> list[Any]:
        if not isinstance(data, dict):
            raise self._error("json-value", key, f"is not an object with {', '.join(names)}")
        for name in data:
            if name not in names:
                raise self._error(
                    "unknown-key", f"{key}.{name}".lstrip("."), "unknown key", did_you_mean(name, names)
                )
        for name in names:
            if name not in data:
                raise self._error("missing-key", key, f"'{name}' is missing")
        return [data[name] for name in names]

    def _array(self, data: Any, key: str) -> list[Any]:
        if not isinstance(data, list):
            raise self._error("json-value", key, "is not an array")
        return data

    def _whole(self, data: Any, key: str, minimum: int, maximum: int = MAX_NUMBER) -> int:
        if not isinstance(data, int) or isinstance(data, bool) or not minimum <= data <= maximum:
            raise self._error(
                "json-value", key, f"is not a whole number of {minimum} to {maximum}: {_literal(data)}"
            )
        return data

    def _distance(self, data: Any, key: str) -> float:
        number = isinstance(data, int | float) and not isinstance(data, bool)
        if not number or not 0 <= data <= MAX_DISTANCE:
            raise self._error("json-value", key, f"is not a number from 0 to {MAX_DISTANCE:g}: {data!r}")
        return float(data)

    def _text(self, data: Any, key: str) -> str:
        if not isinstance(data, str):
            raise self._error("json-value", key, f"is not a text: {data!r}")
        return data

    def _error(self, code: str, key: str, message: str, hint: str | None = None) -> InputError:
        return InputError(code, message, Location(self.file, key=key or "schedule"), hint)
