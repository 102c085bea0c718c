"""The `player` engine as C: `templates/player/main.c.j2` is the body, `player/*.asm` are its assembly.

In: the plan and a dialect. Out: the text of one C file.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

from servogen.engines.c_text import AsmLine, ChannelText, assembly, decimal, ports_of, render_template
from servogen.engines.player import Playing
from servogen.engines.player.buttons import PRESSED_FRAMES, Button, Buttons
from servogen.engines.player.layout import TICKS
from servogen.pic.device import Device, oscillator_for, registers
from servogen.units import Cycles

PRESCALER = 0x84
"""OPTION_REG: TMR0 counts cycles, 1:32, plus one for each doubling; no pull-ups (DS35007 section 2.3.2)."""

WAY = 32
"""The kernel's cycles from the rise to the first fall without its counted loops."""


OVERRUN = "overrun"
"""The variable whose bit 0 is set once the C between two slots takes too long."""


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


@dataclass(frozen=True, slots=True)
class _ButtonText:
    port: str
    mask: str
    released: str


@dataclass(frozen=True, slots=True)
class _Pad:
    """A counted loop of 3 cycles a turn, and what is left."""

    turns: int
    rest: tuple[str, ...]


def render_player(played: Playing, buttons: Buttons, dialect: str, device: Device, title: str) -> str:
    """Return the C file of `played` in `dialect`. Raises RenderError."""
    schedule, order = played.plan.schedule, played.layout.order
    tick = played.layout.tick
    clock = schedule.clock
    rows = list(dict.fromkeys(part.tracks for part in played.parts))
    tracks = [row[channel] for row in rows for channel in order]
    mirrored = [played.signs[channel] < 0 for _ in rows for channel in order]
    bases = [played.bases[channel] for channel in order]
    return render_template(
        "player/main.c.j2",
        overrun=OVERRUN,
        dialect=dialect,
        title=title,
        device=device.name,
        clock_hz=clock.hz,
        clock_mhz=decimal(Fraction(clock.hz, 1_000_000)),
        oscillator=oscillator_for(clock.hz),
        period_us=decimal(clock.us(schedule.period)),
        tick=tick,
        tick_us=decimal(clock.us(tick)),
        prescaler=f"0x{PRESCALER + TICKS.index(tick):02X}",
        step_us=decimal(clock.us(1 << played.shift)),
        channels=[_channel(played, channel) for channel in order],
        ports=list(ports_of(schedule)),
        slots=list(_slots(played)),
        parts=[
            _PartText(
                part.frames & 0xFF,
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
        start=_button(buttons.start),
        stop=_button(buttons.stop),
        stop_off=buttons.stop is not None and buttons.off,
        pressed_frames=PRESSED_FRAMES,
        buttons_text=list(buttons.text()),
        kernel=list(assembly(kernel(tick, played.layout.stagger))),
        trim=list(assembly(render_template("player/trim.asm"))),
        between=[
            *assembly(render_template("player/between.asm")),
            AsmLine("    clrf    _value_high", ""),
            *(line for _ in range(played.shift) for line in assembly(render_template("player/scale.asm"))),
        ],
    )


def kernel(tick: Cycles, stagger: Cycles) -> str:
    """Return the kernel's assembly: TMR0 counts every `tick` cycles, a slot's second servo rises `stagger`
    later.

    The timer's next three increments are read at the cycles `reads` after the beginning.
    """
    reads = (tick - 2, 2 * tick - 1, 3 * tick - 1)
    pads = (_pad(tick - 9), _pad(tick - 9), _pad(tick - 7))
    return render_template(
        "player/kernel.asm", tick=tick, reads=reads, pads=pads, stagger=stagger, way=WAY + stagger
    )


def _pad(cycles: int) -> _Pad:
    turns, rest = divmod(cycles, 3)
    return _Pad(turns, ((), ("nop",), ("goto    $+1",))[rest])


def _button(button: Button | None) -> _ButtonText | None:
    if button is None:
        return None
    return _ButtonText(button.pin[1], f"0x{1 << int(button.pin[2]):02X}", "== 0" if button.level else "!= 0")


def _channel(played: Playing, channel: int) -> ChannelText:
    schedule = played.plan.schedule
    runs = (*schedule.lead_in, *schedule.loop)
    widths = [pulse.width for run in runs if (pulse := run.pulses[channel])]
    ends = sorted({min(widths), max(widths)})
    each = schedule.channels[channel]
    return ChannelText(each.name, each.pin, " to ".join(decimal(schedule.clock.us(width)) for width in ends))


def _slots(played: Playing) -> Iterator[_SlotText]:
    """Yield the masks of each slot's pins; `channel` counts in the order of the slots."""
    first = 0
    for slot in played.layout.slots:
        masks = [1 << int(played.plan.schedule.channels[channel].pin[2]) for channel in slot.channels]
        a, b = [*masks, 0, 0][:2]
        port = registers()[f"PORT{slot.port}"].address
        yield _SlotText(f"0x{a:02X}", f"0x{b:02X}", f"0x{port:02X}", slot.ticks, first if masks else 0)
        first += len(masks)
