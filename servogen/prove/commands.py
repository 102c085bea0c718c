"""The inputs that command a walk, as the specification follows them: "Walk on command" in docs/firmware.md.

In: a `CommandRule`, and the frames of its directions as numbers. Out: what is heard of the line or seen of
the buttons, level by level, what it commands, and the frame that follows a frame.
"""

from __future__ import annotations

from typing import Protocol

from servogen.edges import PINS
from servogen.pulse.schedule import CodeLine, CommandRule, DirectionButtons, Input, PulseSchedule, StepButton

AT_REST = 0
"""`heard` once the line has been at rest long enough for a code to begin. Values from 1 to 63 are a 1
followed, in binary, by the levels since a code began.
"""
OFF_REST, ON_REST = 64, 128
"""`heard` while the levels are not a code: one of these, plus the number of equal levels in a row."""
COUNT = 8
"""`heard` of several buttons is the number of the direction, plus COUNT times the frames in which it was the
same; of one button, the number of frames in which it was pressed, plus COUNT times the latest direction.
"""


class InputReader(Protocol):
    """What the program reads of the inputs in a frame."""

    @property
    def pins(self) -> tuple[int, ...]:
        """Return the inputs, each of which is read once per frame."""

    @property
    def at_power_up(self) -> int:
        """Return what is heard before the first frame."""

    def sampled(
        self, heard: int, wanted: int, read: int, pin: int, level: int
    ) -> tuple[int, int, int] | None:
        """Return what is heard, commanded and read in this frame after an input was read; None if it is
        read again.
        """

    def unread(self, read: int) -> int | None:
        """Return an input that was not read in a frame; None if all were."""

    def ended(self, heard: int, wanted: int, read: int) -> tuple[int, int]:
        """Return what is heard and commanded at the end of a frame."""


class SerialCodes:
    """A line with codes: what was read of it counts at once."""

    def __init__(self, rule: CodeLine, codes: tuple[str, ...]) -> None:
        self._rule = rule
        self._codes = {code: number + 1 for number, code in enumerate(codes)}
        self.pins = (PINS.index(rule.line.pin),)

    @property
    def at_power_up(self) -> int:
        """Return one level that is not at rest."""
        return OFF_REST + 1

    def sampled(
        self, heard: int, wanted: int, read: int, pin: int, level: int
    ) -> tuple[int, int, int] | None:
        if read:
            return None
        heard, direction = self.heard(heard, level)
        return heard, wanted if direction is None else direction, 1

    def unread(self, read: int) -> int | None:
        return None if read else self.pins[0]

    def ended(self, heard: int, wanted: int, read: int) -> tuple[int, int]:
        return heard, wanted

    def heard(self, before: int, level: int) -> tuple[int, int | None]:
        """Return what is heard after another level, and the direction that it commands, 0 to stop."""
        rest = self._rule.line.level
        if before == AT_REST:
            return (AT_REST if level == rest else 1), None
        if before >= OFF_REST:
            latest, run = (rest, before - ON_REST) if before >= ON_REST else (1 - rest, before - OFF_REST)
            return self._run(level, run + 1 if level == latest else 1)
        levels = f"{before:b}"[1:] + str(level)
        if any(code.startswith(levels) and code != levels for code in self._codes):
            return before << 1 | level, None
        since = f"{1 - rest}{levels}"
        heard, stop = self._run(level, len(since) - len(since.rstrip(str(level))))
        return heard, self._codes.get(levels, stop)

    def _run(self, level: int, run: int) -> tuple[int, int | None]:
        if level == self._rule.line.level:
            return (AT_REST if run >= self._rule.rest_frames else ON_REST + run), None
        most = self._rule.stop_frames
        return OFF_REST + min(run, most - 1), 0 if run >= most else None


class ButtonCommands:
    """A button for each direction; what was read in a frame counts at its end.

    Read: bit 2n + 1 once button n was read, bit 2n + 2 if it is pressed.
    """

    at_power_up = 0

    def __init__(self, rule: DirectionButtons, buttons: tuple[Input, ...]) -> None:
        self._enough = rule.pressed_frames
        self._pressed = tuple(button.level for button in buttons)
        self.pins = tuple(PINS.index(button.pin) for button in buttons)

    def sampled(
        self, heard: int, wanted: int, read: int, pin: int, level: int
    ) -> tuple[int, int, int] | None:
        number = self.pins.index(pin)
        if read >> 2 * number & 2:
            return None
        return heard, wanted, read | (2 if level != self._pressed[number] else 6) << 2 * number

    def unread(self, read: int) -> int | None:
        return next((pin for number, pin in enumerate(self.pins) if not read >> 2 * number & 2), None)

    def ended(self, heard: int, wanted: int, read: int) -> tuple[int, int]:
        pressed = [number + 1 for number in range(len(self.pins)) if read >> 2 * number & 4]
        seen = pressed[0] if len(pressed) == 1 else 0
        frames, before = divmod(heard, COUNT)
        frames = min(frames + 1, self._enough) if seen == before else 1
        return frames * COUNT + seen, seen if frames == self._enough else wanted


class OneButton:
    """A button that steps through the directions: what was read of it counts at once."""

    at_power_up = 0

    def __init__(self, rule: StepButton, directions: int) -> None:
        self._rule = rule
        self._directions = directions
        self.pins = (PINS.index(rule.button.pin),)

    def sampled(
        self, heard: int, wanted: int, read: int, pin: int, level: int
    ) -> tuple[int, int, int] | None:
        if read:
            return None
        latest, frames = divmod(heard, COUNT)
        if level != self._rule.button.level:
            return latest * COUNT, wanted, 1
        if frames + 1 == self._rule.pressed_frames:
            latest = latest if wanted else latest % self._directions + 1
            wanted = 0 if wanted else latest
        return latest * COUNT + min(frames + 1, self._rule.pressed_frames), wanted, 1

    def unread(self, read: int) -> int | None:
        return None if read else self.pins[0]

    def ended(self, heard: int, wanted: int, read: int) -> tuple[int, int]:
        return heard, wanted


def reader_of(rule: CommandRule) -> InputReader:
    """Return what follows the inputs of a rule."""
    selectors = [direction.selector for direction in rule.directions]
    if isinstance(rule.read, CodeLine):
        return SerialCodes(rule.read, tuple(selector for selector in selectors if isinstance(selector, str)))
    if isinstance(rule.read, StepButton):
        return OneButton(rule.read, len(rule.directions))
    return ButtonCommands(rule.read, tuple(selector for selector in selectors if isinstance(selector, Input)))


class WalkCommands:
    """The frames of a walk on command. Directions are numbered from 1 on; 0 is the stance."""

    def __init__(self, schedule: PulseSchedule, rule: CommandRule) -> None:
        self.reader = reader_of(rule)
        first_frame = schedule.lead_in_frames
        self._first: list[tuple[int, int, int]] = [(first_frame, first_frame, first_frame)]
        self._after: dict[int, int] = {first_frame - 1: 0, first_frame + schedule.loop_frames - 1: 0}
        """The last frame of each part, and the direction whose start or cycle it is; 0: the robot stands."""
        first_frame += schedule.loop_frames
        for number, direction in enumerate(rule.directions):
            firsts = []
            for runs, then in (
                (direction.start, number + 1),
                (direction.cycle, number + 1),
                (direction.stop, 0),
            ):
                firsts.append(first_frame)
                first_frame += sum(run.frames for run in runs)
                self._after[first_frame - 1] = then
            self._first.append((firsts[0], firsts[1], firsts[2]))

    def following(self, frame: int, wanted: int) -> int:
        """Return the frame after `frame` if `wanted` is commanded."""
        direction = self._after.get(frame)
        if direction is None:
            return frame + 1
        if direction == 0:
            return self._first[wanted][0]
        return self._first[direction][1 if wanted == direction else 2]
