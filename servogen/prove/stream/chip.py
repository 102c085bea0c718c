"""The specification of a stream program: what its chip does, as docs/firmware.md states it.

In: the numbers of a stream, and the chip's variables. Out: the variables after a frame's beginning, after a
pulse is prepared, after a command, after a look at the line. Values are `Bits`, known or not.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field

from servogen.engines.inputs.serial import HOLD, NEUTRAL, OFF
from servogen.engines.stream.protocol import BITS, NO_TRIM, SYNC, TRIM_ZERO, CommandKind
from servogen.engines.stream.streaming import Streaming
from servogen.prove.stream.bits import FALSE, TRUE, Bits, Truth, all_of, byte, choose, choose_truth

LEAST_TRIM, MOST_TRIM = -128, 127


@dataclass(slots=True)
class StreamChip:
    """The variables of the C; widths and goals have 16 bits, one entry per servo.

    In a coarse chip they are positions and 1 of 255; 0 is, as there, a servo without pulses.
    """

    streamed: Streaming
    widths: list[Bits]
    goals: list[Bits]
    speeds: list[Bits]
    trims: list[Bits]
    """The servos' bytes in the EEPROM."""
    waiting: list[Truth]
    """Which servos wait for their group to start."""
    group: list[Truth]
    """Which servos are in the group that moves."""
    frames_left: Bits
    """Of the group that moves."""
    starting: Truth
    """Whether the group starts with the next frame."""
    gathering: Truth
    """Whether positions wait for their group."""
    silence: Bits
    answer: Bits | None = field(default=None)
    """The byte that is sent."""

    @classmethod
    def after_reset(cls, streamed: Streaming, trims: Sequence[Bits]) -> StreamChip:
        """Return a chip with these bytes in its EEPROM before its first frame: in the neutral pose."""
        none = [FALSE] * len(trims)
        speeds = [byte(0) for _ in trims]
        chip = cls(streamed, [], [], speeds, [*trims], none, [*none], byte(0), FALSE, FALSE, byte(0))
        chip.goals = [Bits(16, int(width)) + chip.trim(n) for n, width in enumerate(streamed.kept)]
        chip.widths = [*chip.goals]
        return chip

    def copy(self) -> StreamChip:
        """Return the same chip; steps of one do not change the other."""
        chip = copy(self)
        for name in ("widths", "goals", "speeds", "trims", "waiting", "group"):
            setattr(chip, name, [*getattr(self, name)])
        return chip

    @property
    def servos(self) -> int:
        return len(self.trims)

    def valid(self) -> Truth:
        """Return what holds of the variables between any two steps."""
        servos = range(self.servos)
        conditions = [
            self._is_in_range(n, value) for n in servos for value in (self.widths[n], self.goals[n])
        ]
        if self.streamed.stream.fail_safe == OFF:
            off = [(self.widths[n].equals(0), self.goals[n].equals(0)) for n in servos]
            conditions = [
                (within_width & within_goal & ~no_pulse & ~no_goal) | (no_pulse & no_goal)
                for within_width, within_goal, (no_pulse, no_goal) in zip(
                    conditions[::2], conditions[1::2], off, strict=True
                )
            ]
        # A group moves only with frames left: the way of its servos is divided by their number.
        conditions += [~self.frames_left.equals(0) | ~member for member in self.group]
        if self.streamed.stream.fail_safe != HOLD:
            conditions.append(self.silence.less(self._max_silence + 1))
        return all_of(conditions)

    def _is_in_range(self, n: int, value: Bits) -> Truth:
        """Return whether a width without its trim is in the servo's range."""
        if self.streamed.coarse:
            return ~value.equals(0)
        travel, plain = self.streamed.travels[n], value - self.trim(n)
        return ~plain.less(int(travel.minimum)) & plain.less(int(travel.maximum) + 1)

    @property
    def _max_silence(self) -> int:
        return self.streamed.silence_frames + (self.streamed.stream.fail_safe == NEUTRAL)

    def trim(self, n: int) -> Bits:
        """Return the trim of a servo in cycles."""
        if self.streamed.coarse:
            return Bits(16, 0)
        return choose(self.trims[n].equals(NO_TRIM), Bits(16, 0), self.trims[n].sign_extend(16))

    def begin_frame(self) -> None:
        """Count the frames of groups and of silence."""
        fewer = choose(self.frames_left.equals(0), self.frames_left, self.frames_left - 1)
        over = ~self.starting & ~self.frames_left.equals(0) & fewer.equals(0)
        self.frames_left = choose(self.starting, self.frames_left, fewer)
        self.group = [choose_truth(over, FALSE, member) for member in self.group]
        self.starting = FALSE
        if self.streamed.stream.fail_safe == HOLD:
            return
        counts = self.silence.less(self._max_silence)
        self.silence = choose(counts, self.silence + 1, self.silence)
        if self.streamed.stream.fail_safe == NEUTRAL:
            now = counts & self.silence.equals(self.streamed.silence_frames)
            self.group = [choose_truth(now, TRUE, member) for member in self.group]
            self.waiting = [choose_truth(now, FALSE, waits) for waits in self.waiting]
            self.starting = choose_truth(now, TRUE, self.starting)
            self.gathering = choose_truth(now, FALSE, self.gathering)
            self.frames_left = choose(now, byte(self.streamed.soft_frames), self.frames_left)

    def prepare(self, n: int) -> None:
        """Move a servo's width towards its goal, to that of its next pulse."""
        fail_safe = self.streamed.stream.fail_safe
        silent = self.silence.equals(self.streamed.silence_frames)
        if fail_safe == NEUTRAL:
            neutral = Bits(16, int(self.streamed.kept[n]))
            self._set_goal(n, neutral, silent & self.group[n])
        elif fail_safe == OFF:
            self.goals[n] = choose(silent, Bits(16, 0), self.goals[n])
            self.widths[n] = choose(silent, Bits(16, 0), self.widths[n])
        goal, width = self.goals[n], self.widths[n]
        down = goal.less(width)
        distance = choose(down, width - goal, goal - width)
        speed = self.speeds[n].zero_extend(16)
        limited = choose(~speed.equals(0) & speed.less(distance), speed, distance)
        step = choose(self.group[n], distance // self.frames_left.zero_extend(16), limited)
        step = choose(self.waiting[n] | (self.group[n] & self.starting), Bits(16, 0), step)
        self.widths[n] = choose(down, width - step, width + step)

    def pulse(self, n: int) -> Bits:
        """Return the width of a servo's pulse, where it has one."""
        return self._width(n, (self.widths[n] - 1)[0:8]) if self.streamed.coarse else self.widths[n]

    def _width(self, n: int, position: Bits) -> Bits:
        """Return the width without trim that a position commands."""
        travel = self.streamed.travels[n]
        return (position.zero_extend(32) * travel.scale + 128 >> 8)[0:16] + int(travel.minimum)

    def _set_goal(self, n: int, target: Bits, where: Truth = TRUE) -> None:
        """Make a width without trim a servo's goal; a servo without pulses is there at once."""
        goal = target + self.trim(n)
        width = choose(self.widths[n].equals(0), goal, self.widths[n])
        self.goals[n] = choose(where, goal, self.goals[n])
        self.widths[n] = choose(where, width, self.widths[n])

    def execute(self, second: int, value: Bits) -> None:
        """Execute the command with these bytes after SYNC; another one changes nothing."""
        kind = next(
            (kind for kind in CommandKind if 0 <= second - kind.value < self._servo_numbers(kind)), None
        )
        if kind is None:
            return
        n = second - kind.value
        if kind is CommandKind.POSITION:
            if self.streamed.coarse:
                self._set_goal(n, value.zero_extend(16) + 1)
            else:
                self._set_goal(n, self._width(n, value))
                self.group[n] = FALSE
                self.waiting[n] = self.gathering
        elif kind is CommandKind.SPEED:
            self.speeds[n] = value
        elif kind is CommandKind.TRIM:
            before = self.trim(n)
            self.trims[n] = value - TRIM_ZERO
            moved, off = self.trim(n) - before, self.goals[n].equals(0)
            self.goals[n] = choose(off, self.goals[n], self.goals[n] + moved)
            self.widths[n] = choose(off, self.widths[n], self.widths[n] + moved)
        elif kind is CommandKind.GROUP:
            begins = value.equals(0)
            self.gathering = begins
            self.starting = choose_truth(begins, self.starting, TRUE)
            # All servos of a coarse chip are a group, and wait for it.
            begun = [TRUE] * self.servos if self.streamed.coarse else self.waiting
            self.group = [choose_truth(begins, *pair) for pair in zip(self.group, begun, strict=True)]
            self.waiting = [choose_truth(begins, waits, FALSE) for waits in begun]
            self.frames_left = choose(begins, self.frames_left, value)
        elif kind is CommandKind.QUERY:
            asked = self.widths[0]
            for number in range(1, self.servos):
                asked = choose(value[0:3].equals(number), self.widths[number], asked)
            self.answer = choose(value.bit(3), asked[0:8], asked[8:16])
        self.silence = byte(0)

    def _servo_numbers(self, kind: CommandKind) -> int:
        """Return how many servos a kind of command has numbers for."""
        if kind is CommandKind.QUERY:
            return int(self.streamed.stream.transmit_pin is not None)
        if kind is CommandKind.TRIM and self.streamed.coarse:
            return 0
        return self.servos if kind.of_a_servo else 1


NOTHING = 0xFE
"""The value of `command` and `todo` while there is no command: a byte with which no command begins."""
BROKEN, SENDING = 7, 6
"""Bits of `bits`: a byte without its stop bit came, the line is not high again; the chip answers."""


@dataclass(slots=True)
class ReceiverState:
    """The variables of the receiver; `bits` is how many bits of a byte are still to come, 10 at its start."""

    streamed: Streaming
    bits: Bits
    left: Bits
    """Units of time until the next bit is due."""
    last: Bits
    """The unit of time of the last look, modulo 64."""
    byte: Bits
    command: Bits
    """0xFF after SYNC; then the second byte of a command; else `NOTHING`."""
    todo: Bits
    value: Bits
    level: Truth | None = None
    """What the chip sends if a bit is due at this look; None while it receives."""
    due: Truth = FALSE
    """Whether a bit is due at this look."""

    def look(self, now: Bits, line: Truth) -> None:
        """Look at the line while a byte is being received or sent; `now` is the unit of time."""
        bits = self.bits.value
        assert bits is not None
        if bits >> BROKEN & 1:
            self.bits = choose(line, byte(0), self.bits)
            return
        passed = (now - self.last) & 0x3F
        due = self.due = self.left.less(passed)
        left = self.left - passed
        self.left = choose(due, left + self.streamed.bit_units, left)
        self.last = now
        after = copy(self)  # where the bit is due
        if bits >> SENDING & 1 and self.streamed.stream.transmit_pin is not None:
            after._send_bit(bits)
        else:
            after._receive_bit((bits - 1) & 0xFF, line)
        for name in ("bits", "left", "byte", "command", "todo", "value"):
            setattr(self, name, choose(due, getattr(after, name), getattr(self, name)))
        if after.level is not None:
            self.level = after.level

    def _receive_bit(self, bits: int, line: Truth) -> None:
        """Receive a bit of the line; `bits` are still to come after it."""
        self.bits = byte(bits)
        if bits == 0:
            self._end_byte(line)
        # Of the counts 9 to 1 only 9 has bits 3 and 0 set: these are the bits that the words test.
        elif bits & 9 == 9:  # the start bit: a high line was noise
            self.bits = choose(line, byte(0), byte(bits))
        else:
            self.byte = choose(line, Bits(1, 1), Bits(1, 0)).concat(self.byte[1:8])

    def _end_byte(self, line: Truth) -> None:
        """End a byte with its stop bit."""
        sync, second = self.byte.equals(SYNC), self.command.equals(SYNC)
        third = ~sync & ~second & ~self.command.equals(NOTHING) & line
        self.todo = choose(third, self.command, self.todo)
        self.value = choose(third, self.byte, self.value)
        next_command = choose(sync, byte(SYNC), choose(second, self.byte, byte(NOTHING)))
        self.command = choose(line, next_command, byte(NOTHING))
        self.bits = choose(line, byte(0), byte(1 << BROKEN))

    def _send_bit(self, bits: int) -> None:
        """Send a bit of an answer, the lowest of its byte first; then stop bits."""
        bits -= 1
        self.bits = byte(bits)
        if bits & 9 == 9:
            self.left = byte(self.streamed.bit_units)
            self.level = FALSE
            return
        self.level = self.byte.bit(0)
        self.byte = Bits(1, 1).concat(self.byte[1:8])
        if bits & 0x3F == 0:
            self.bits = byte(0)

    def hunt(self, now: Bits, line: Truth) -> None:
        """Look for a start bit while no byte is being received."""
        self.bits = choose(line, self.bits, byte(BITS))
        self.left = choose(line, self.left, byte(self.streamed.first_units))
        self.last = choose(line, self.last, now)
