"""One drive: sends a motion over a serial line until it is over, and always stops the robot at the end.

In: the motion, the commands, the controller, the line, the time. Out: `Summary`; every command and event is
logged when it happens.

    first pose ─▶ sample the motion ─▶ positions that changed, servo by servo, as the line is free ─▶ sample …

A stream engine goes to the first pose as a group: all servos together, in the time given for it. The line
determines how often the motion is sampled: positions that it cannot carry are never queued. If the port
disappears, the session waits for it; the motion pauses meanwhile, and then all positions are sent again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from servogen.bench.ports import Unplugged
from servogen.drive.commands import QUIT, CommandSource, NoCommands
from servogen.drive.controller import ServoController
from servogen.drive.motions import AngleFunction
from servogen.drive.serial_link import SerialLink, Time
from servogen.engines.stream.protocol import MAX_VALUE, group_begins, group_goes, speed_command
from servogen.errors import InputError, Location, ServogenError, ToolError
from servogen.motion.trajectory import Floats

if TYPE_CHECKING:
    from servogen.answers import DriveAnswer

Log = Callable[[dict[str, object]], None]

POLL_S = 0.005
"""The interval between samples when nothing has changed: much less than a servo's frame."""


ARRIVE_S = 1.0
"""The default time in which a stream engine goes to the first pose."""


@dataclass(slots=True)
class Summary:
    """What was sent. `rounds` is the number of poses in which a servo changed; `slowest_s` is the time of the
    slowest one.
    """

    seconds: float = 0.0
    moving_s: float = 0.0
    """The part of `seconds` after the first pose was reached, without the time when the port was missing."""
    commands: int = 0
    rounds: int = 0
    slowest_s: float = 0.0
    outages: int = 0
    away_s: float = 0.0
    stopped: bool = False

    @property
    def poses_per_second(self) -> float:
        """Return the mean number of poses per second while the robot moved."""
        return self.rounds / self.moving_s if self.moving_s > 0 else 0.0

    def to_json(self) -> DriveAnswer:
        """Return the summary as a value that JSON can hold."""
        return {
            "seconds": self.seconds,
            "moving_s": self.moving_s,
            "commands": self.commands,
            "rounds": self.rounds,
            "slowest_s": self.slowest_s,
            "outages": self.outages,
            "away_s": self.away_s,
            "stopped": self.stopped,
            "poses_per_second": self.poses_per_second,
        }


@dataclass(slots=True)
class DriveSession:
    """The parts of a drive: `source` gives commands to `on_command`; `stop` is the final pose, None for
    none.
    """

    controller: ServoController
    line: SerialLink
    time: Time
    log: Log
    stop: Floats | None = None
    source: CommandSource = field(default_factory=NoCommands)
    on_command: Callable[[str], None] = field(default=lambda command: None)
    arrive_s: float = ARRIVE_S
    """The time in which a stream engine goes to the first pose."""
    summary: Summary = field(default_factory=Summary)
    _sent: list[int | None] = field(init=False)
    _arrive_frames: int = 0
    _turn: int = 0
    _begun: float = 0.0
    _last: float = 0.0
    _known: bool = False
    """Whether the robot is known to have received what was sent."""
    _held_s: float = 0.0
    """The time for which the motion has waited for the port and for the first pose."""
    _in_group: bool = False

    def __post_init__(self) -> None:
        self._sent = [None] * len(self.controller.channels)
        frame_s = self.controller.frame_s
        self._arrive_frames = round(self.arrive_s / frame_s) if frame_s else 0
        if frame_s and self._arrive_frames > MAX_VALUE:
            raise InputError(
                "out-of-range",
                f"{self.arrive_s:g} s to the first pose are {self._arrive_frames} frames",
                Location(key="--arrive-s"),
                f"the stream engine counts up to {MAX_VALUE} frames, {MAX_VALUE * frame_s:.4g} s",
            )

    def run(self, motion: AngleFunction) -> Summary:
        """Drive until the motion is over or `quit` is given, then stop the robot, also after any error.

        Raises ToolError if the port does not come back, InputError for an unknown command.
        """
        self._begun = self._last = self.time.now()
        moment = 0.0
        try:
            while (angles := self._commanded_angles(motion, moment)) is not None:
                try:
                    if self._known:
                        self._follow(angles)
                    else:
                        self._arrive(angles)
                except Unplugged as error:
                    self._recover(error)
                else:
                    moment = self.time.now() - self._begun - self._held_s
        finally:
            self._stop()
            self.summary.seconds = self.time.now() - self._begun
            self.summary.moving_s = self.summary.seconds - self._held_s
        return self.summary

    def _commanded_angles(self, motion: AngleFunction, moment: float) -> Floats | None:
        """Carry out the commands given until `moment` and return the angles then; None if the drive is
        over.
        """
        for command in self.source.since(moment):
            self.log({"s": round(moment, 4), "command": command})
            if command == QUIT:
                return None
            self.on_command(command)
        return motion.at(moment)

    def _arrive(self, angles: Floats) -> None:
        """Send the whole pose to a robot that may be anywhere; the motion waits until it is there."""
        begin, frames = self.time.now(), self._arrive_frames
        changed = self.controller.changes([None] * len(self._sent), angles)
        # The controller has no groups: each servo moves as soon as its position arrives.
        if not frames:
            self._pose(changed)
        else:
            self._in_group = True
            self._bytes(group_begins())
            self._pose(changed)
            self._group_goes(frames)
            ends = self._last + frames * (self.controller.frame_s or 0.0)
            while (left := ends - self.time.now()) > 0:
                self.time.sleep(min(left, self.controller.refresh_s))
                self._bytes(speed_command(0, 0))  # no effect, but shows the chip that its line is alive
        self.line.drain()
        self.summary.rounds += 1
        self._known = True
        if frames:
            self._held_s += self.time.now() - begin

    def _follow(self, angles: Floats) -> None:
        """Send the positions that changed."""
        changed = self.controller.changes(self._sent, angles)
        begin = self.time.now()
        if changed:
            self.summary.rounds += 1
        elif begin - self._last >= self.controller.refresh_s:
            changed = self._next_refresh()
        if not changed:
            self.time.sleep(POLL_S)
            return
        self._pose(changed)
        self.summary.slowest_s = max(self.summary.slowest_s, self._last - begin)
        self.line.drain()  # so that the next sample is no older than the time it takes to send it

    def _next_refresh(self) -> list[tuple[int, int]]:
        """Return the servo that is refreshed next, with the position last sent to it."""
        known = [(index, p) for index, p in enumerate(self._sent) if p is not None]
        self._turn += 1
        # One servo at a time, in turn, so that a refresh never delays a motion by a whole pose.
        return [known[self._turn % len(known)]] if known else []

    def _pose(self, changed: Sequence[tuple[int, int]]) -> None:
        """Send positions one after the other."""
        for index, position in changed:
            channel = self.controller.channels[index]
            self._bytes(
                self.controller.command(index, position),
                servo=channel.servo.name,
                number=channel.number,
                position=position,
                width_us=round(channel.widths_us[position], 3),
            )
            self._sent[index] = position
            self.summary.commands += 1

    def _group_goes(self, frames: int) -> None:
        self._bytes(group_goes(frames), frames=frames)
        self._in_group = False

    def _bytes(self, command: bytes, **facts: object) -> None:
        self._last = self.line.send(command)
        self.log({"s": round(self._last - self._begun, 4), **facts, "bytes": command.hex(" ")})

    def _recover(self, error: Unplugged) -> None:
        """Wait for the port; it is not known how much of the last pose the robot has received."""
        self.log({"s": self._now(), "event": "lost", "text": str(error)})
        away = self.line.reopen(self._waits)
        self.summary.outages += 1
        self.summary.away_s += away
        self._held_s += away
        self._known = False
        self.log({"s": self._now(), "event": "back", "away_s": round(away, 3)})

    def _waits(self, error: ToolError) -> None:
        """Log why the port cannot be opened, such as another program using it, unless it is still missing."""
        if error.code != "no-such-port":
            self.log({"s": self._now(), "event": "waiting", "text": str(error)})

    def _stop(self) -> None:
        """Send the stop pose to every servo; errors are logged, as another one may be propagating."""
        if self.stop is None:
            return
        try:
            if self._in_group:  # the chip would wait for the end of a group that was cut off
                self._group_goes(1)
            # `None` for every servo sends all positions: the robot may have missed the last ones.
            self._pose(self.controller.changes([None] * len(self._sent), self.stop))
            self.line.drain()
        except ServogenError as error:
            self.log({"s": self._now(), "event": "not stopped", "text": str(error)})
            return
        self.summary.stopped = True
        self.log({"s": self._now(), "event": "stopped"})

    def _now(self) -> float:
        return round(self.time.now() - self._begun, 4)
