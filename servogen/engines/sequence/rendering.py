"""A `Sequence` as C: `templates/sequence/main.c.j2` is the body, `c2c.j2`, `xc8.j2` and `sdcc.j2` are the
dialects.

In: the program and a dialect. Out: the text of one C file.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from servogen.engines.c_text import ChannelText, decimal, header_values, render_template
from servogen.engines.sequence.programs import FrameEdges, Hold, Sequence, SilentStep, Step
from servogen.engines.sequence.waits import CALLS
from servogen.pic.device import Device
from servogen.pulse import PulseSchedule
from servogen.robot.servo import Servo
from servogen.units import Clock, Cycles


def render(
    program: Sequence, dialect: str, device: Device, title: str, servos: tuple[Servo, ...] = ()
) -> str:
    """Return the C file of `program` in `dialect`; its comments say the angles of `servos`.

    Raises RenderError, and InputError for a delay that the dialect cannot express.
    """
    clock = program.schedule.clock
    return render_template(
        "sequence/main.c.j2",
        **header_values(dialect, title, device, program.schedule),
        cycle_us=decimal(clock.cycle_us),
        channels=list(_channels(program.schedule)),
        start=_calls(program.start, dialect, clock),
        positions=[
            _PositionText(
                f"position_{position.number}",
                _frame_text(position.frame, program.schedule, servos),
                _lines(position.frame, program.schedule, dialect),
                _calls(position.gap, dialect, clock),
                _calls(position.again, dialect, clock),
            )
            for position in program.positions
        ],
        lead_in=[_step(step, program.schedule, dialect, servos) for step in program.lead_in],
        counts_turns=any(
            isinstance(step, Hold) and step.turns > 1 for step in (*program.lead_in, *program.loop)
        ),
        loop=[_step(step, program.schedule, dialect, servos) for step in program.loop],
        long_waits=any(isinstance(step, SilentStep) for step in (*program.lead_in, *program.loop)),
    )


@dataclass(frozen=True, slots=True)
class _LineText:
    """A port write, its comment, the delay after it and that delay's comment."""

    write: str
    comment: str
    calls: str


@dataclass(frozen=True, slots=True)
class _PositionText:
    name: str
    comment: str
    lines: tuple[_LineText, ...]
    gap: str
    again: str


@dataclass(frozen=True, slots=True)
class _StepText:
    """A call of a position (`turns` times, if that is not 0), a frame of its own (`lines`) or a pause."""

    call: str
    lines: tuple[_LineText, ...]
    comment: str
    after: str
    turns: int = 0
    turn: str = ""


def _channels(schedule: PulseSchedule) -> Iterator[ChannelText]:
    for number, channel in enumerate(schedule.channels):
        widths = sorted(
            {pulse.width for run in (*schedule.lead_in, *schedule.loop) if (pulse := run.pulses[number])}
        )
        yield ChannelText(
            channel.name, channel.pin, ", ".join(decimal(schedule.clock.us(width)) for width in widths)
        )


def _lines(frame: FrameEdges, schedule: PulseSchedule, dialect: str) -> tuple[_LineText, ...]:
    lines = []
    for edge in frame.edges:
        words = []
        for channel, level in edge.changes:
            name, pulse = schedule.channels[channel].name, frame.run.pulses[channel]
            width = f" for {decimal(schedule.clock.us(pulse.width))} us" if level and pulse else ""
            words.append(f"{name} {'high' if level else 'low'}{width}")
        lines.append(
            _LineText(
                f"PORT{edge.port} = 0x{edge.value:02X};",
                ", ".join(words),
                _calls(edge.wait, dialect, schedule.clock),
            )
        )
    return tuple(lines)


def _step(step: Step, schedule: PulseSchedule, dialect: str, servos: tuple[Servo, ...]) -> _StepText:
    clock = schedule.clock
    if isinstance(step, SilentStep):
        seconds = decimal(clock.seconds(step.wait))
        return _StepText("", (), f"{seconds} s without pulses", _calls(step.wait, dialect, clock))
    after = _calls(step.after, dialect, clock)
    comment = _frame_text(step.frame, schedule, servos)
    if step.position:
        seconds = decimal(clock.seconds(step.all_frames * schedule.period))
        call = f"position_{step.position.number}({step.frames});"
        turns, turn = (step.turns, _calls(step.turn, dialect, clock)) if step.turns > 1 else (0, "")
        return _StepText(call, (), f"{comment}, for {seconds} s", after, turns, turn)
    return _StepText("", _lines(step.frame, schedule, dialect), comment, after)


def _frame_text(frame: FrameEdges, schedule: PulseSchedule, servos: tuple[Servo, ...]) -> str:
    by_name = {servo.name: servo for servo in servos}
    texts = []
    for channel, pulse in zip(schedule.channels, frame.run.pulses, strict=True):
        if pulse:
            servo, width = by_name.get(channel.name), pulse.width
            angle = f" {_angle(servo, width, schedule.clock)}:" if servo else ""
            texts.append(f"{channel.name}{angle} {decimal(schedule.clock.us(width))} us")
    return ", ".join(texts)


def _angle(servo: Servo, width: Cycles, clock: Clock) -> str:
    """Return the angle with the fewest decimals whose pulse has this width: 30 rather than 30.06 deg."""
    exact = math.degrees(servo.angle(float(clock.us(width))))
    unit = "deg/s" if servo.model.continuous else "deg"
    for decimals in range(4):
        angle = round(exact, decimals)
        radians = math.radians(angle)
        if servo.allows(radians) and clock.round_us(servo.width_us(radians)).cycles == width:
            return f"{angle:zg} {unit}"
    return f"{exact:z.4g} {unit}"


def _calls(cycles: Cycles, dialect: str, clock: Clock) -> str:
    return " ".join(str(call) for call in CALLS[dialect](cycles, clock))
