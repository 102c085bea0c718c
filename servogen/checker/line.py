"""What a line or buttons command, by "Walk on command" of docs/firmware.md: the direction and the next frame.

In: the commands of schedule.json. Out: a `Line` or `DirectionButtons`, and the `Directions`. What was heard
is a number, as docs/proof.md lists them. Of a line: 0 at rest; a 1 before the levels since a start, as a
binary number; 64 + n or 128 + n after n equal levels that are not a code, off rest or at rest. Of buttons:
the direction whose button alone is pressed, 0 for none, plus 8 for each frame in which it was the same. Of
one button: the frames in which it was pressed, plus 8 times the latest direction.
"""

from __future__ import annotations

from dataclasses import dataclass

OFF, ON = 64, 128


@dataclass(frozen=True)
class Line:
    pin: int
    rest: str
    """The level at rest."""
    rest_frames: int
    stop_frames: int
    codes: list[str]
    """Of the directions, which are numbered from 1 on."""
    power_up: int = OFF + 1

    def hear(self, heard: int, wanted: int, level: int) -> tuple[int, int]:
        """Return what is heard, and what is commanded, after another level."""
        bit = str(level)
        code = heard != 0 and heard < OFF
        if heard == 0 and bit == self.rest:
            return 0, wanted
        if heard == 0:
            return 1, wanted
        if code:
            levels = bin(heard)[3:] + bit
            if levels in self.codes:
                wanted = self.codes.index(levels) + 1
            elif any(each[: len(levels)] == levels for each in self.codes):
                return heard * 2 + level, wanted
            history = "10"[int(self.rest)] + levels
        else:
            count, latest = (heard - ON, self.rest) if heard >= ON else (heard - OFF, "10"[int(self.rest)])
            history = latest * count + bit
        run = 1
        while run < len(history) and history[-1 - run] == bit:
            run += 1
        if bit == self.rest:
            return (0 if run >= self.rest_frames else ON + run), wanted
        if run >= self.stop_frames:
            return OFF + self.stop_frames - 1, 0
        return OFF + run, wanted


@dataclass(frozen=True)
class StepButton:
    pin: int
    pressed: int
    """The level while it is pressed."""
    frames: int
    """The frames in a row in which it must be pressed."""
    directions: int
    power_up: int = 0

    def hear(self, heard: int, wanted: int, level: int) -> tuple[int, int]:
        """Return what is heard, and what is commanded, after another level."""
        count, latest = heard % 8, heard // 8
        if level != self.pressed:
            return heard - count, wanted
        if count >= self.frames:
            return heard, wanted
        if count + 1 < self.frames:
            return heard + 1, wanted
        if wanted:
            return heard + 1, 0
        latest = 1 if latest >= self.directions else latest + 1
        return latest * 8 + self.frames, latest


@dataclass(frozen=True)
class DirectionButtons:
    pins: list[tuple[int, int]]
    """Of each direction, the pin of its button and the level while it is pressed."""
    frames: int
    """The frames in a row in which the same must be seen."""

    def word(self) -> int:
        """Return the pins."""
        return sum(1 << pin for pin, _ in self.pins)

    def read(self, line_read: int) -> tuple[int, int]:
        """Return the levels and the pins that a certificate says were read: two bits for each button."""
        levels = sampled = 0
        for number, (pin, pressed) in enumerate(self.pins):
            was_read, was_pressed = line_read >> 2 * number + 1 & 1, line_read >> 2 * number + 2 & 1
            sampled |= was_read << pin
            levels |= (pressed if was_pressed else 1 - pressed) * was_read << pin
        return levels, sampled

    def hear(self, heard: int, wanted: int, levels: int) -> tuple[int, int]:
        """Return what is heard, and what is commanded, after a frame."""
        down = [number for number, (pin, level) in enumerate(self.pins, 1) if levels >> pin & 1 == level]
        now = down[0] if len(down) == 1 else 0
        count = heard // 8 + 1 if heard % 8 == now else 1
        if count < self.frames:
            return count * 8 + now, wanted
        return self.frames * 8 + now, now


@dataclass(frozen=True)
class Directions:
    parts: list[tuple[int, int, int, int]]
    """Of the stance and each direction: the first frames of start, cycle and stop, and the frame after."""

    def after(self, frame: int, wanted: int) -> int:
        """Return the frame that follows, whose part is the next one where `frame` is the last of its part."""
        stance = self.parts[0]
        if frame + 1 < stance[0]:
            return frame + 1
        if frame + 1 == stance[0] or frame + 1 == stance[3]:
            return self.parts[wanted][0]
        for direction, (start, cycle, stop, end) in enumerate(self.parts):
            if direction and start <= frame < end:
                if frame + 1 in (cycle, stop):
                    return cycle if wanted == direction else stop
                if frame + 1 == end:
                    return self.parts[wanted][0]
        return frame + 1
