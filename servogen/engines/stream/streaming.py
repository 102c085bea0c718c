"""The numbers of a stream job: frame, widths, fail-safe, and the schedule of an idle line.

In: the servos, the frame, the line. Out: `Streaming`, whose schedule is what the chip does without commands:
the neutral pose, then the fail-safe's action.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from servogen.engines.inputs.serial import OFF, Stream
from servogen.engines.stream.layout import RoundLayout, is_coarse, layout
from servogen.engines.stream.protocol import BITS, MAX_VALUE, WidthRange, travel
from servogen.engines.stream.settings import UNIT, bit_units, first_units
from servogen.errors import Diagnostic, InputError, Location
from servogen.pulse.lint import check_calibration, check_period
from servogen.pulse.plan import PulsePlan
from servogen.pulse.quantise import PARTS, Quantised, error_of_rows, largest
from servogen.pulse.schedule import Channel, Pulse, PulseSchedule, Run
from servogen.pulse.slots import Frame
from servogen.robot.servo import Servo
from servogen.units import Clock, Cycles

TRIMS = 256
"""The maximum distance between two trims, by which a servo's way to its goal can exceed its travel."""
MIN_SILENCE = 5
"""The minimum silence in frames: longer than a write to the EEPROM and the time between two commands."""


@dataclass(frozen=True, slots=True)
class Streaming:
    """The parts of the firmware; `travels` and `neutral` are in the order of the servos."""

    plan: PulsePlan
    layout: RoundLayout
    stream: Stream
    bit_units: int
    first_units: int
    """The receiver's time of a bit, and from a start bit's beginning to its sample, in units of 4 cycles."""
    travels: tuple[WidthRange, ...]
    neutral: tuple[Cycles, ...]
    silence_frames: int
    soft_frames: int
    """The number of frames in which the servos go to the neutral pose."""
    coarse: bool
    """Whether the chip keeps a byte of each place and goal, the position and 1, instead of a width."""

    @property
    def kept(self) -> tuple[int, ...]:
        """Return what the chip keeps of the neutral pose: widths without trims, or positions and 1."""
        if not self.coarse:
            return self.neutral
        pairs = zip(self.travels, self.neutral, strict=True)
        return tuple(1 + travel.nearest(width) for travel, width in pairs)

    @property
    def byte_cycles(self) -> int:
        """Return the cycles from a start bit's time stamp to its byte's stop bit."""
        return (self.first_units + (BITS - 1) * self.bit_units) * UNIT

    @property
    def farthest(self) -> int:
        """Return the most that a servo's place can be from its goal, in what the chip keeps of both."""
        travels = [travel.maximum - travel.minimum for travel in self.travels]
        return MAX_VALUE if self.coarse else max(travels) + TRIMS


def streaming(
    servos: Sequence[Servo],
    frame: Frame,
    clock: Clock,
    stream: Stream,
    soft_start_s: Fraction,
    soft_start_place: Location | None = None,
) -> Streaming:
    """Return the stream engine of these servos. Raises InputError."""
    units = bit_units(stream, clock)
    first = first_units(clock.cycles_per_second / stream.baud)
    slots = layout(servos, frame, clock, stream.baud)
    period_s = clock.seconds(slots.period)
    silence = round(stream.silence_s / period_s)
    if not MIN_SILENCE <= silence <= MAX_VALUE:
        raise InputError(
            "out-of-range",
            f"a silence of {float(stream.silence_s):g} s is {silence} frames",
            stream.place,
            f"{MIN_SILENCE} to {MAX_VALUE} frames are counted, "
            f"{float(MIN_SILENCE * period_s):.2g} to {float(MAX_VALUE * period_s):.2g} s",
        )
    neutral = tuple(clock.round_us(servo.width_us(servo.neutral)).cycles for servo in servos)
    travels = tuple(travel(servo, clock) for servo in servos)
    coarse = is_coarse(servos)
    if coarse:
        neutral = tuple(each.width(each.nearest(width)) for each, width in zip(travels, neutral, strict=True))
    soft, soft_warnings = _soft_frames(soft_start_s, period_s, soft_start_place)
    schedule = _schedule(servos, slots, clock, neutral, silence, soft, stream.fail_safe)
    widths = tuple(
        _quantised(servo, width, clock, schedule.lead_in_frames + schedule.loop_frames)
        for servo, width in zip(servos, neutral, strict=True)
    )
    errors = (error_of_rows(servo, (row,)) for servo, row in zip(servos, widths, strict=True))
    schedule = replace(schedule, plan_error=largest(errors))
    plan = PulsePlan(schedule, widths, (*_warnings(servos, frame, slots, clock), *soft_warnings))
    return Streaming(plan, slots, stream, units, first, travels, neutral, silence, soft, coarse)


def _soft_frames(
    seconds: Fraction, period_s: Fraction, place: Location | None
) -> tuple[int, tuple[Diagnostic, ...]]:
    """Return the number of frames for going to the neutral pose, and a warning if that exceeds the request.

    Raises InputError for more frames than a group of positions can count.
    """
    frames = round(seconds / period_s)
    if frames > MAX_VALUE:
        raise InputError(
            "out-of-range",
            f"a soft start of {float(seconds):g} s is {frames} frames",
            place,
            f"the stream engine counts up to {MAX_VALUE} frames, {float(MAX_VALUE * period_s):.4g} s",
        )
    if frames:
        return frames, ()
    text = f"going to the neutral pose takes one frame, {float(period_s):g} s, not {float(seconds):g} s"
    return 1, (Diagnostic("warning", "soft-start-rounded", text, place),)


def _schedule(
    servos: Sequence[Servo],
    slots: RoundLayout,
    clock: Clock,
    neutral: Sequence[Cycles],
    silence: int,
    soft: int,
    fail_safe: str,
) -> PulseSchedule:
    """Return the schedule of the neutral pose until the fail-safe has acted, and then of its result."""
    channels = tuple(Channel(servo.name, servo.pin, servo.model.name) for servo in servos)
    pulses = tuple(Pulse(slots.rise(number), width) for number, width in enumerate(neutral))
    if fail_safe == OFF:
        none = (None,) * len(servos)
        return PulseSchedule(clock, slots.period, channels, (Run(silence - 1, pulses),), (Run(1, none),))
    return PulseSchedule(clock, slots.period, channels, (Run(silence + soft, pulses),), (Run(1, pulses),))


def _quantised(servo: Servo, width: Cycles, clock: Clock, frames: int) -> Quantised:
    asked = Fraction(round(servo.width_us(servo.neutral) * PARTS), PARTS)
    return Quantised(servo.name, servo.neutral, asked, width, clock.us(width), frames)


def _warnings(
    servos: Sequence[Servo], frame: Frame, slots: RoundLayout, clock: Clock
) -> tuple[Diagnostic, ...]:
    warnings = [*check_period(clock.round_us(clock.us(slots.period)), frame.place)]
    if slots.period != frame.period.cycles:
        warnings.append(
            Diagnostic(
                "warning",
                "period-rounded",
                f"the frame takes {float(clock.us(slots.period)):g} µs, "
                f"not {float(frame.period.requested_us):g}: "
                f"{slots.slots} slots of {slots.rounds} rounds of 256 cycles",
                frame.place,
            )
        )
    return (*warnings, *(caution for servo in servos for caution in check_calibration(servo)))
