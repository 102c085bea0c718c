"""The stream engine's protocol: the meaning of three bytes, as data and pure functions.

In: servo numbers (0 to 11, a job's order), widths in cycles, times in frames. Out: the bytes of a command,
and conversely the command that bytes encode and the width that a position commands.

    FF n     p      position p of servo n                    width = min + p (max - min) / 254
    FF 40+n  s      up to s cycles per frame; 0: no limit
    FF 80    0      a group begins: the following positions wait, and so do their servos
    FF 80    t      the group starts: all servos start in one frame and arrive t frames later
    FF C0+n  127+c  trim c of servo n, to the EEPROM
    FF F0    q      the high byte of servo q's width, in cycles, is sent back; for q - 8 the low byte

A coarse chip, of 8 servos on both ports or more, keeps positions instead of widths: s is in positions per
frame, a group is all servos, and there are no trims and no answers.

FF occurs only at the beginning, so that a receiver that has lost synchronisation regains it with the next
command.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from servogen.errors import InputError
from servogen.robot.servo import Servo
from servogen.units import Clock, Cycles

SYNC = 0xFF
MAX_VALUE = 254
"""The maximum third byte: positions, frames, trims."""
MAX_SERVOS = 12
FINE_SERVOS = 8
"""The most servos of a chip that is not coarse, if all are on one port; on both it is one less."""

BYTES = 3
BITS = 10
"""The bits of a byte on the line: start, eight data bits (lowest first), stop."""

MAX_TRIM = 127
TRIM_ZERO = 127
NO_TRIM = 0xFF
"""An erased byte of the EEPROM; in two's complement it is -1, which therefore cannot be a trim."""

SCALE_BITS = 8
ASK_LOW = 8
"""Added to a servo's number to query the low byte of its width."""


class CommandKind(Enum):
    """The kind of a command; its value is the second byte, for servo 0."""

    POSITION = 0x00
    SPEED = 0x40
    GROUP = 0x80
    TRIM = 0xC0
    QUERY = 0xF0

    @property
    def of_a_servo(self) -> bool:
        """Return whether a servo's number is added to the second byte."""
        return self in (CommandKind.POSITION, CommandKind.SPEED, CommandKind.TRIM)


@dataclass(frozen=True, slots=True)
class StreamCommand:
    """A command; `servo` is 0 for kinds that apply to all servos, `value` is the third byte."""

    kind: CommandKind
    servo: int
    value: int

    def to_bytes(self) -> bytes:
        """Return the three bytes of the command."""
        return bytes((SYNC, self.kind.value + self.servo, self.value))


def command_of(
    second: int, third: int, servos: int = FINE_SERVOS, *, answers: bool = True, trims: bool = True
) -> StreamCommand | None:
    """Return the command of the two bytes after SYNC; None if a chip with `servos` servos ignores it.

    `answers`: whether the chip has a pin to send on; `trims`: whether it is not coarse.
    """
    if not 0 <= third <= MAX_VALUE:
        return None
    for kind in CommandKind:
        if (kind is CommandKind.QUERY and not answers) or (kind is CommandKind.TRIM and not trims):
            continue
        number = second - kind.value
        if 0 <= number < (servos if kind.of_a_servo else 1):
            return StreamCommand(kind, number, third)
    return None


def position_command(servo: int, p: int) -> bytes:
    """Return the command of a servo's position."""
    return _command(CommandKind.POSITION, servo, p)


def speed_command(servo: int, cycles_a_frame: int) -> bytes:
    """Return the command of a servo's speed limit in cycles of width per frame; 0: no limit."""
    return _command(CommandKind.SPEED, servo, cycles_a_frame)


def group_begins() -> bytes:
    """Return the command after which positions wait for `group_goes`."""
    return _command(CommandKind.GROUP, 0, 0)


def group_goes(frames: int) -> bytes:
    """Return the command that starts all waiting positions in one frame, to arrive after `frames` frames."""
    if frames < 1:
        raise InputError("bad-command", "a group's time is at least one frame")
    return _command(CommandKind.GROUP, 0, frames)


def trim_command(servo: int, cycles: int) -> bytes:
    """Return the command of a trim from -127 to 127 cycles, but not -1, whose byte is that of
    erased EEPROM.
    """
    if not -MAX_TRIM <= cycles <= MAX_TRIM or trim_byte(cycles) == NO_TRIM:
        raise InputError(
            "bad-command", f"a trim of {cycles} cycles cannot be sent", hint="-127 to 127 cycles, but not -1"
        )
    return _command(CommandKind.TRIM, servo, TRIM_ZERO + cycles, FINE_SERVOS)


def query_command(servo: int, *, low: bool = False) -> bytes:
    """Return the command that asks for one byte of a servo's width in cycles, its trim included.

    The chip does not receive until it has answered, which takes up to three slots and a byte.
    """
    _check_servo(servo, FINE_SERVOS)
    return _command(CommandKind.QUERY, 0, servo + (ASK_LOW if low else 0))


def _check_servo(servo: int, servos: int) -> None:
    if not 0 <= servo < servos:
        raise InputError("unknown-servo", f"there is no servo {servo}", hint=f"servos are 0 to {servos - 1}")


def _command(kind: CommandKind, servo: int, value: int, servos: int = MAX_SERVOS) -> bytes:
    _check_servo(servo, servos)
    if not 0 <= value <= MAX_VALUE:
        raise InputError(
            "bad-command", f"{value} cannot be the third byte of a command", hint=f"0 to {MAX_VALUE}"
        )
    return StreamCommand(kind, servo, value).to_bytes()


def trim_byte(cycles: int) -> int:
    """Return a trim's byte in the EEPROM: two's complement."""
    return cycles & 0xFF


def trim_cycles(byte: int) -> int:
    """Return the trim of a byte of the EEPROM."""
    return 0 if byte == NO_TRIM else (byte ^ 0x80) - 0x80


@dataclass(frozen=True, slots=True)
class WidthRange:
    """A servo's range of widths without trim; position p commands `width(p)`, computed as the chip does."""

    minimum: Cycles
    maximum: Cycles

    @property
    def scale(self) -> int:
        """Return the factor by which the chip multiplies p: 256ths of a cycle per position, rounded."""
        return (2 * (self.maximum - self.minimum << SCALE_BITS) + MAX_VALUE) // (2 * MAX_VALUE)

    def width(self, p: int) -> Cycles:
        """Return min + p (max - min) / 254 to within a cycle; exact at 0 and 254."""
        if not 0 <= p <= MAX_VALUE:
            raise InputError("bad-command", f"{p} is not a position", hint=f"0 to {MAX_VALUE}")
        return Cycles(self.minimum + (p * self.scale + (1 << SCALE_BITS - 1) >> SCALE_BITS))

    def nearest(self, width: float) -> int:
        """Return the position whose width is nearest, the smaller of two; an end for a width beyond it."""
        return min(range(MAX_VALUE + 1), key=lambda p: (abs(self.width(p) - width), p))


def travel(servo: Servo, clock: Clock) -> WidthRange:
    """Return the widths of p = 0 and p = 254: the limits of the servo, including its own trim."""
    low, high = (clock.round_us(width).cycles for width in servo.widths_us)
    return WidthRange(low, high)
