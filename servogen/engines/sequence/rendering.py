"""A `Sequence` as C: `templates/sequence/main.c.j2` is the body, `c2c.j2`, `xc8.j2` and `sdcc.j2` are the
dialects.

In: the program and a dialect. Out: the text of one C file.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from servogen.engines.c_text import ChannelText, decimal, header_values, render_template
from servogen.engines.sequence.programs import FrameEdges, Hold, Sequence, SilentStep, Step
from servogen.engines.sequence.waits import CALLS
from servogen.pic.device import Device
from servogen.pulse import PulseSchedule, Quantised
from servogen.robot.servo import Servo
from servogen.units import Clock, Cycles

AngleTexts = Mapping[tuple[str, Cycles], str]
"""What a comment says beside the pulses of a channel that have this width."""


def angle_texts(widths: Iterable[Quantised], servos: Iterable[Servo]) -> AngleTexts:
    """Return the planned angle of each width; of several, one that is held."""
    unit = {servo.name: "deg/s" if servo.model.continuous else "deg" for servo in servos}
    return {
        (row.channel, row.cycles): f"{math.degrees(row.angle):z.4g} {unit[row.channel]}"
        for row in sorted(widths, key=lambda row: row.held)
    }


def render(
    program: Sequence, dialect: str, device: Device, title: str, angles: AngleTexts = MappingProxyType({})
) -> str:
    """Return the C file of `program` in `dialect`; its comments say the `angles`.

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
                _frame_text(position.frame, program.schedule, angles),
                _lines(position.frame, program.schedule, dialect),
                _calls(position.gap, dialect, clock),
                _calls(position.again, dialect, clock),
            )
            for position in program.positions
        ],
        lead_in=[_step(step, program.schedule, dialect, angles) for step in program.lead_in],
        counts_turns=any(
            isinstance(step, Hold) and step.turns > 1 for step in (*program.lead_in, *program.loop)
        ),
        loop=[_step(step, program.schedule, dialect, angles) for step in program.loop],
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


def _step(step: Step, schedule: PulseSchedule, dialect: str, angles: AngleTexts) -> _StepText:
    clock = schedule.clock
    if isinstance(step, SilentStep):
        seconds = decimal(clock.seconds(step.wait))
        return _StepText("", (), f"{seconds} s without pulses", _calls(step.wait, dialect, clock))
    after = _calls(step.after, dialect, clock)
    comment = _frame_text(step.frame, schedule, angles)
    if step.position:
        seconds = decimal(clock.seconds(step.all_frames * schedule.period))
        call = f"position_{step.position.number}({step.frames});"
        turns, turn = (step.turns, _calls(step.turn, dialect, clock)) if step.turns > 1 else (0, "")
        return _StepText(call, (), f"{comment}, for {seconds} s", after, turns, turn)
    return _StepText("", _lines(step.frame, schedule, dialect), comment, after)


def _frame_text(frame: FrameEdges, schedule: PulseSchedule, angles: AngleTexts) -> str:
    texts = []
    for channel, pulse in zip(schedule.channels, frame.run.pulses, strict=True):
        if pulse:
            angle = angles.get((channel.name, pulse.width))
            beside = f" {angle}:" if angle else ""
            texts.append(f"{channel.name}{beside} {decimal(schedule.clock.us(pulse.width))} us")
    return ", ".join(texts)


def _calls(cycles: Cycles, dialect: str, clock: Clock) -> str:
    return " ".join(str(call) for call in CALLS[dialect](cycles, clock))
