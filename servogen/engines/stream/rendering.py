"""The `stream` engine as C: `templates/stream/main.c.j2` is the body, `stream/*.asm` are its assembly.

In: what is streamed and a dialect. Out: the text of one C file.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from servogen.engines.c_text import (
    ChannelText,
    assembly,
    decimal,
    header_values,
    render_template,
    table_lines,
)
from servogen.engines.stream.layout import RISE
from servogen.engines.stream.protocol import TRIM_ZERO
from servogen.engines.stream.streaming import Streaming
from servogen.pic.device import Device, registers

NONE = 0xFE
"""The mark for "no command", a byte with which no command begins."""

LAST = 80
"""Cycles from the last sample before an edge to the edge: the longest sample and the path to
st_exactly fit.
"""

LATE = 92
"""TMR0 from which on it is too late to divide a round in two, because a preceding edge took long."""

SECOND, LATEST_SECOND = 168, 184
"""TMR0 at the second sample of such a round; after the later time there is none."""


OVERRUN = "due"
"""The variable whose bit 0 is set once a pulse is not prepared in time."""


@dataclass(frozen=True, slots=True)
class _Out:
    """The port of the pin that answers: its TRIS register, and its pins while nothing is sent."""

    name: str
    tris: str
    idle: str


def render_stream(streamed: Streaming, dialect: str, device: Device, title: str) -> str:
    """Return the C file of `streamed` in `dialect`. Raises RenderError."""
    schedule, stream = streamed.plan.schedule, streamed.stream
    pins = [channel.pin for channel in schedule.channels]
    two_ports = len({pin[1] for pin in pins}) > 1
    return render_template(
        "stream/main.c.j2",
        **header_values(dialect, title, device, schedule),
        overrun=OVERRUN,
        baud=stream.baud,
        line=stream.receive_pin,
        channels=list(_channels(streamed)),
        servos=len(pins),
        slots=streamed.layout.slots,
        slot_ticks=streamed.layout.rounds,
        out=_out(stream.transmit_pin),
        answers=stream.transmit_pin is not None,
        two_ports=two_ports,
        coarse=streamed.coarse,
        facts=table_lines([(_facts(streamed, two_ports), "")]),
        everybody=_everybody(pins, two_ports),
        fail_safe=stream.fail_safe,
        silence_frames=streamed.silence_frames,
        soft_frames=streamed.soft_frames,
        nothing=f"0x{NONE:02X}",
        trim_zero=TRIM_ZERO,
        tick=list(assembly(tick(streamed))),
        **{
            name: list(assembly(render_template(f"stream/{name}.asm", coarse=streamed.coarse)))
            for name in ("extend", "trim", "keep", "ready", "multiply", "add", "way", "step", "divide")
        },
    )


def tick(streamed: Streaming) -> str:
    """Return the assembly of the interrupt."""
    pins = [channel.pin for channel in streamed.plan.schedule.channels]
    ports = sorted({f"PORT{pin[1]}" for pin in pins})
    line, out = streamed.stream.receive_pin, streamed.stream.transmit_pin
    return render_template(
        "stream/tick.asm",
        rise=RISE,
        last=LAST,
        late=LATE,
        second=SECOND,
        latest_second=LATEST_SECOND,
        slot_ticks=streamed.layout.rounds,
        two_ports=len(ports) > 1,
        port="INDF" if len(ports) > 1 else ports[0],
        nothing=f"0x{NONE:02X}",
        line_port=f"PORT{line[1]}",
        line_bit=line[2],
        answers=out is not None,
        out_port=f"PORT{out[1]}" if out else "",
        out_bit=out[2] if out else "",
        bit_units=streamed.bit_units,
        first_units=streamed.first_units,
    )


def _channels(streamed: Streaming) -> Iterator[ChannelText]:
    schedule = streamed.plan.schedule
    for channel, travel in zip(schedule.channels, streamed.travels, strict=True):
        ends = (decimal(schedule.clock.us(width)) for width in (travel.minimum, travel.maximum))
        yield ChannelText(channel.name, channel.pin, " to ".join(ends))


def _out(pin: str | None) -> _Out | None:
    """Return the registers of the transmit pin. No servo is on its port: its other pins stay inputs."""
    if pin is None:
        return None
    mask = 1 << int(pin[2])
    inputs = 0x1F if pin[1] == "A" else 0xFF
    return _Out(pin[1], f"0x{inputs & ~mask:02X}", f"0x{mask:02X}")


def _facts(streamed: Streaming, two_ports: bool) -> list[int]:
    """Return the rows of the table, one number per servo in each; two rows are looked up at a time."""
    pins = [channel.pin for channel in streamed.plan.schedule.channels]
    masks = [1 << int(pin[2]) for pin in pins]
    widths: list[list[int]] = [
        [each.minimum for each in streamed.travels],
        [each.scale for each in streamed.travels],
    ]
    if not streamed.coarse:
        widths.append([*streamed.neutral])
    rows = [
        half for row in widths for half in ([width & 0xFF for width in row], [width >> 8 for width in row])
    ]
    if not streamed.coarse:
        rows.append([1 << number for number in range(len(pins))] if two_ports else masks)
    rows.append(masks)
    if two_ports:
        rows.append([registers()[f"PORT{pin[1]}"].address for pin in pins])
    if streamed.coarse:
        rows.append([*streamed.kept])
    return [number for row in rows for number in row]


def _everybody(pins: list[str], two_ports: bool) -> str:
    """Return the bits of all servos: by number, or by pin if all are on one port."""
    bits = range(len(pins)) if two_ports else [int(pin[2]) for pin in pins]
    return f"0x{sum(1 << bit for bit in bits):02X}"
