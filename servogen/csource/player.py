"""The `player` engine as C: `templates/player.c.j2` is the body, the `.asm` files beside it are its assembly.

In: what is played and a dialect. Out: the text of one C file.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

from servogen.csource.rendering import ChannelText, decimal, filled, ports_of, template_folder
from servogen.pic.device import Device, oscillator_for, registers
from servogen.pulse.player import Playing
from servogen.pulse.player.layout import TICK


@dataclass(frozen=True, slots=True)
class _Line:
    """A line of assembly; either may be empty."""

    code: str
    comment: str


@dataclass(frozen=True, slots=True)
class _SlotText:
    a: str
    b: str
    port: str
    ticks: int
    channel: int


@dataclass(frozen=True, slots=True)
class _PartText:
    frames: int
    repeats: int
    speed: int
    wrap: int
    row: int
    pins: str


def render_player(played: Playing, dialect: str, device: Device, title: str) -> str:
    """The C file of `played` in `dialect`. Raises RenderError."""
    schedule, order = played.plan.schedule, played.layout.order
    clock = schedule.clock
    rows = list(dict.fromkeys(part.tracks for part in played.parts))
    tracks = [row[channel] for row in rows for channel in order]
    mirrored = [played.signs[channel] < 0 for _ in rows for channel in order]
    bases = [played.bases[channel] for channel in order]
    return filled(
        "player.c.j2",
        dialect=dialect,
        title=title,
        device=device.name,
        clock_hz=clock.hz,
        clock_mhz=decimal(Fraction(clock.hz, 1_000_000)),
        oscillator=oscillator_for(clock.hz),
        period_us=decimal(clock.us(schedule.period)),
        tick_us=decimal(clock.us(TICK)),
        step_us=decimal(clock.us(1 << played.shift)),
        channels=[_channel(played, channel) for channel in order],
        ports=list(ports_of(schedule)),
        slots=list(_slots(played)),
        parts=[
            _PartText(
                part.frames,
                part.repeats,
                part.speed,
                part.wrap,
                rows.index(part.tracks) * len(order),
                "0x00" if part.silent else "0xFF",
            )
            for part in played.parts
        ],
        silence=any(part.silent for part in played.parts),
        tracks=[start for start, _ in tracks],
        ahead=[2 * count + flip for (_, count), flip in zip(tracks, mirrored, strict=True)],
        keyframes=list(played.data),
        bases_low=[base & 0xFF for base in bases],
        bases_high=[base >> 8 for base in bases],
        loop_part=played.loop_part,
        kernel=list(_assembly("player_kernel.asm")),
        trim=list(_assembly("player_trim.asm")),
        between=[
            *_assembly("player_between.asm"),
            _Line("    clrf    _value_high", ""),
            *(line for _ in range(played.shift) for line in _assembly("player_scale.asm")),
        ],
    )


def _channel(played: Playing, channel: int) -> ChannelText:
    schedule = played.plan.schedule
    runs = (*schedule.lead_in, *schedule.loop)
    widths = [pulse.width for run in runs if (pulse := run.pulses[channel])]
    ends = sorted({min(widths), max(widths)})
    each = schedule.channels[channel]
    return ChannelText(each.name, each.pin, " to ".join(decimal(schedule.clock.us(width)) for width in ends))


def _slots(played: Playing) -> Iterator[_SlotText]:
    """The masks of each slot's pins; `channel` counts in the order of the slots."""
    first = 0
    for slot in played.layout.slots:
        masks = [1 << int(played.plan.schedule.channels[channel].pin[2]) for channel in slot.channels]
        a, b = [*masks, 0, 0][:2]
        port = registers()[f"PORT{slot.port}"].address
        yield _SlotText(f"0x{a:02X}", f"0x{b:02X}", f"0x{port:02X}", slot.ticks, first if masks else 0)
        first += len(masks)


def _assembly(file: str) -> Iterator[_Line]:
    for line in (template_folder() / file).read_text().splitlines():
        code, _, comment = line.partition(";")
        yield _Line(code, comment.strip())
