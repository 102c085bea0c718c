"""Steering a walk on command: codes for the line of its chip, or its buttons; what a chip does with them.

In: a job whose robot walks on command, a source of commands, and the port of a real chip, if there is one.
Out: the codes on the port, and a `CommandedFrame` for each frame.

    command ─▶ byte ─▶ port, at one bit per frame
                 ╰───▶ a simulated chip with the job's program ─▶ direction, part, frame, widths
    command ─▶ button held ─▶ the same

The state is always that of the simulated chip: a real chip sends nothing back, but does the same as long as
it hears the same and stood at the beginning.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from servogen.bench.virtual.chip import HeldButtons, Levels, VirtualChip
from servogen.bench.virtual.serial_line import LineStimulus
from servogen.drive.commands import NEXT, QUIT, STOP, CommandSource
from servogen.drive.serial_link import SerialLink, Time
from servogen.edges import PINS, edge_chunk
from servogen.engines.board import board_of
from servogen.engines.firmware import Firmware
from servogen.engines.inputs import given
from servogen.engines.inputs.buttons import PRESSED_FRAMES
from servogen.engines.inputs.commands import CommandButton, Commander, CommandLine, uart_byte
from servogen.engines.inputs.tape import Tape
from servogen.engines.player.engine import play
from servogen.engines.player.firmware import compiled
from servogen.engines.player.script import DirectionPlaces
from servogen.engines.tape.firmware import compiled as compiled_tape
from servogen.engines.tape.taping import taped
from servogen.errors import InputError, did_you_mean
from servogen.job import PlannedJob
from servogen.pic.device import RAM_FIRST
from servogen.pulse import PulseSchedule
from servogen.pulses import PulseReader

if TYPE_CHECKING:
    from servogen.answers import CommandedFrameAnswer

POLL_S = 0.01
"""The interval at which commands are polled: less than a frame."""

STANCE, LEAD_IN = "stance", "lead-in"
PARTS = ("start", "cycle", "stop")
RELEASED_FRAMES = 2
"""The number of frames for which the one button is released after a press."""

REPEATS = 2
"""The number of times that a code is sent, because a code with a level missed or read twice is not heard."""


def line_baud(job: PlannedJob) -> int:
    """Return the rate at which a bit lasts one frame, to the nearest baud."""
    return round(1 / job.clock.seconds(job.frame.period.cycles))


@dataclass(frozen=True, slots=True)
class CommandedFrame:
    """What the chip does in a frame; `part` is empty in the stance and in the lead-in."""

    seconds: float
    """Since power-up."""
    frame: int
    direction: str
    part: str
    widths_us: Mapping[str, float]
    """The latest complete pulse of each servo."""

    def to_json(self) -> CommandedFrameAnswer:
        """Return the state as a value that JSON can hold."""
        return {
            "s": round(self.seconds, 3),
            "frame": self.frame,
            "direction": self.direction,
            "part": self.part,
            "widths_us": dict(self.widths_us),
        }

    def text(self) -> str:
        """Return the state in one line."""
        widths = " ".join(f"{width:.0f}" for width in self.widths_us.values())
        return (
            f"{self.seconds:8.2f} s  frame {self.frame:5}  {f'{self.direction} {self.part}':14}  {widths} µs"
        )


class Twin:
    """A simulated chip with the job's program, and the line that it hears or its buttons."""

    def __init__(self, job: PlannedJob) -> None:
        """Compile the job's program and switch the chip on. Raises InputError."""
        assert job.commands is not None
        self._read = job.commands
        schedule, firmware, self._playing = _playing(job)
        self.stimulus = _idle_stimulus(job, self._read, int(schedule.period))
        self.chip = VirtualChip(
            firmware.compilation.image, job.clock, board_of(schedule), stimulus=self.stimulus
        )
        self.chip.listeners.append(self._heard)
        self._period = int(schedule.period)
        self._clock = job.clock
        self._pins = {PINS.index(channel.pin): channel.name for channel in schedule.channels}
        self._reader = PulseReader()
        self._widths = dict.fromkeys(self._pins.values(), 0.0)
        self._frames = 0
        self._walks = False
        """Whether the latest press of the one button commanded a direction."""

    @property
    def directions(self) -> tuple[str, ...]:
        """Return the names of the directions that can be commanded; one button commands the next one."""
        read = self._read
        if isinstance(read, CommandButton):
            return (NEXT,)
        return self._playing.names if isinstance(read, CommandLine) else tuple(read.buttons)

    @property
    def seconds(self) -> float:
        """Return the time since power-up."""
        return float(self._clock.seconds(self.chip.now))

    def command(self, command: str) -> bytes:
        """Give a command to the chip and return the bytes put on its line; none if it has buttons."""
        direction = None if command == STOP else command
        if isinstance(self.stimulus, HeldButtons):
            if isinstance(self._read, CommandButton):
                if direction or self._walks:
                    # One frame more than a press needs, in case it begins after the button was read in its
                    # frame.
                    self.stimulus.presses.extend([NEXT] * (PRESSED_FRAMES + 1) + [""] * RELEASED_FRAMES)
                    self._walks = not self._walks
            else:
                self.stimulus.held = direction or ""
            return b""
        assert isinstance(self._read, CommandLine)
        code = bytes([uart_byte(direction, self._read.codes)] * REPEATS)
        self.stimulus.waiting.extend(code)
        return code

    def frame(self) -> CommandedFrame:
        """Run the chip for one frame and return its state at the end."""
        self.chip.run(self._period)
        self._frames += 1
        direction, part = self._playing.now(self.chip.machine.state().ram)
        return CommandedFrame(
            seconds=self.seconds,
            frame=self._frames,
            direction=direction,
            part=part,
            widths_us=dict(self._widths),
        )

    def _heard(self, levels: Levels, now: int) -> None:
        """Measure the pulses in the changes of the pins."""
        cycle, word = levels
        pins = np.array(list(self._pins))
        level = word[:, None] >> pins & 1
        chunk = edge_chunk(np.repeat(cycle, len(pins)), np.tile(pins, len(cycle)), level.ravel())
        ended = self._reader(chunk).whole()
        for pin, width in zip(ended.pin.tolist(), ended.width.tolist(), strict=True):
            self._widths[self._pins[pin]] = float(self._clock.us(width))


@dataclass(frozen=True, slots=True)
class _Walk:
    """What the player's variables say: the direction that was begun, and where its part ends."""

    chain: DirectionPlaces
    begun: int
    until: int

    @property
    def names(self) -> tuple[str, ...]:
        return self.chain.names

    def now(self, ram: Sequence[int]) -> tuple[str, str]:
        """Return the direction and its part."""
        begun, until = ram[self.begun], ram[self.until]
        # The starts of the direction's start, cycle and stop, and its end; `begun` 0 is standing.
        places = self.chain.places[2 * begun : 2 * begun + 4]
        if not begun:
            return (STANCE if until == places[1] else LEAD_IN), ""
        return self.chain.names[begun // 2 - 1], PARTS[places.index(until, 1) - 1]


@dataclass(frozen=True, slots=True)
class _Tape:
    """What the variable of a tape's program says: twice the number of the direction that it plays, the last
    one first; which part of it the tape alone knows.
    """

    names: tuple[str, ...]
    walking: int

    def now(self, ram: Sequence[int]) -> tuple[str, str]:
        """Return the direction, and no part."""
        number = ram[self.walking] // 2
        return (self.names[-number] if number else STANCE), ""


def _playing(job: PlannedJob) -> tuple[PulseSchedule, Firmware, _Walk | _Tape]:
    """Return the job's program, and what its variables say."""
    if given(job.inputs, Tape) is not None:
        made = taped(job)
        firmware = compiled_tape(job, made, job.firmware.dialect)
        rule = made.plan.schedule.commands
        assert rule is not None
        names = tuple(direction.name for direction in rule.directions)
        return made.plan.schedule, firmware, _Tape(names, *_places(firmware, "walking"))
    _, played, _ = play(job)
    assert played.chain is not None
    firmware = compiled(job, played, job.firmware.dialect)
    return played.plan.schedule, firmware, _Walk(played.chain, *_places(firmware, "begun", "until"))


def _places(firmware: Firmware, *names: str) -> Iterator[int]:
    """Yield where variables are in the RAM."""
    for name in names:
        address = firmware.compilation.listing.variable(name)
        assert address is not None
        yield address - RAM_FIRST


def _idle_stimulus(job: PlannedJob, read: Commander, period: int) -> LineStimulus | HeldButtons:
    """Return the line at rest, or the buttons, none of them pressed."""
    if isinstance(read, CommandLine):
        return LineStimulus(PINS.index(read.pin), line_baud(job))
    named = {NEXT: read.button} if isinstance(read, CommandButton) else read.buttons
    buttons = {name: (PINS.index(button.pin), button.level) for name, button in named.items()}
    return HeldButtons(buttons, period)


@dataclass(slots=True)
class CommandedDrive:
    """One drive; `link` is the line of a real chip, None if there is only the simulated one."""

    twin: Twin
    source: CommandSource
    time: Time
    tell: Callable[[CommandedFrame], None]
    link: SerialLink | None = None
    single_keys: bool = False
    """Whether the commands are keys; keys without a meaning are ignored."""
    commanded: str = STOP
    sent: int = 0

    def run(self, seconds: float) -> None:
        """Take commands until one ends the drive, or for `seconds`; then stop the robot.

        Raises InputError for a command that the robot does not take.
        """
        begun = self.time.now()
        try:
            while (now := self.time.now() - begun) < seconds:
                for command in self.source.since(now):
                    if command == QUIT:
                        return
                    self.command(command)
                while self.twin.seconds < now:
                    self.tell(self.twin.frame())
                self.time.sleep(POLL_S)
        finally:
            if self.commanded != STOP:
                self.command(STOP)
            if self.link is not None:
                self.link.drain()

    def command(self, command: str) -> None:
        """Send a command. Raises InputError for an unknown one, Unplugged if the port is gone."""
        known = (*self.twin.directions, STOP)
        if command not in known:
            if self.single_keys:
                return
            raise InputError("bad-command", f"unknown command '{command}'", hint=did_you_mean(command, known))
        self.commanded = command
        self.sent += 1
        code = self.twin.command(command)
        if self.link is not None:
            self.link.send(code)
