"""The `player` engine as C: `templates/player/main.c.j2` is the body, `player/*.asm` are its assembly.

In: what is played, where its script is, and a dialect. Out: the text of one C file.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Protocol

from servogen.engines.c_text import (
    AsmLine,
    ChannelText,
    PortText,
    assembly,
    channel_text,
    decimal,
    header_values,
    render_template,
    table_lines,
)
from servogen.engines.inputs.buttons import PRESSED_FRAMES, ButtonPin, ControlButtons
from servogen.engines.inputs.commands import (
    COMMAND_SHIFT,
    CommandButton,
    CommandButtons,
    Commander,
    CommandLine,
    hearing_table,
)
from servogen.engines.inputs.wire import LOOKED_LATE, FrameWire, quiet_pause
from servogen.engines.player.arithmetic import ENTRIES, FRACTION
from servogen.engines.player.encoding import Encoded
from servogen.engines.player.layout import TICKS, SlotLayout, to_rise
from servogen.engines.player.playing import Playing
from servogen.engines.player.script import (
    AGAIN,
    AT,
    ENTRY,
    HALF,
    SILENT,
    SPOT,
    STAY,
    STRAIGHT,
    DirectionPlaces,
)
from servogen.engines.stored_script import Stored
from servogen.pic.device import EEPROM_ADDRESS, Device, registers
from servogen.pulse.plan import PulsePlan
from servogen.units import Clock, Cycles

PRESCALER = 0x84
"""OPTION_REG: TMR0 counts cycles, 1:32; one more for each doubling; no pull-ups (DS35007 section 2.3.2)."""

WAY = 32
"""The kernel's cycles from the rise to the first fall, without its counted loops."""


FORWARD = 2
"""The number of the first direction that is read forward."""

JOIN_C = 6
"""The cycles of a turn of the loop that finds the wire's cycle, without its delay, if it was not late."""

LAST_C = 4
"""The cycles from the wire's last rise before the pulses to that in the middle of the kernel's look, without
the last delay, the ticks and the kernel's way to the rise of its pins."""

OVERRUN = "overrun"
"""The variable whose bit 0 is set once the C between two slots has taken too long."""


@dataclass(frozen=True, slots=True)
class _Slot:
    """The masks of a slot's pins, 0 for none, and the places of its channels in the order of the C."""

    a: int
    b: int
    ticks: int
    channel: int
    other: int


class Slotted(Protocol):
    """A motion whose pulses are in slots."""

    @property
    def plan(self) -> PulsePlan: ...

    @property
    def layout(self) -> SlotLayout: ...

    @property
    def order(self) -> tuple[int, ...]:
        """Return the channels in the order of the C."""


@dataclass(frozen=True, slots=True)
class Slots:
    """The slots of a frame, and what the C computes from the previous value instead of a table."""

    all: tuple[_Slot, ...]
    ports: tuple[str, ...]
    """The addresses of the ports, in the order in which slots use them."""
    names: tuple[str, ...]
    """Their letters."""
    first: int
    """The number of slots before those on the second port."""

    @classmethod
    def of(cls, played: Slotted) -> Slots:
        """Return the slots of a frame: those of each port are consecutive, those without pulses come last."""
        slots = []
        for slot in played.layout.slots:
            masks = [1 << int(played.plan.schedule.channels[channel].pin[2]) for channel in slot.channels]
            a, b = [*masks, 0, 0][:2]
            places = [played.order.index(channel) for channel in slot.channels] or [0]
            slots.append(_Slot(a, b, slot.ticks, places[0], places[-1]))
        used = [slot.port for slot in played.layout.slots if slot.channels]
        ports = tuple(f"0x{registers()[f'PORT{name}'].address:02X}" for name in dict.fromkeys(used))
        return cls(
            tuple(slots), ports, tuple(dict.fromkeys(used)), used.count(used[0]) + played.layout.looking
        )

    @property
    def b_follows(self) -> bool:
        """Return whether pin B is everywhere the port's next pin after pin A."""
        return all(slot.b == slot.a << 1 for slot in self.all)

    @property
    def singles(self) -> bool:
        """Return whether a slot has one channel."""
        return any(slot.a and not slot.b for slot in self.all)

    @property
    def other_follows(self) -> bool:
        """Return whether the channel of pin B is everywhere the next one after that of pin A."""
        return all(slot.other == slot.channel + 1 for slot in self.all if slot.b)


@dataclass(frozen=True, slots=True)
class _ButtonText:
    port: str
    mask: str
    released: str


@dataclass(frozen=True, slots=True)
class _DirectionText:
    """Twice a direction's number, and its button."""

    number: int
    port: str
    mask: str
    pressed: str


@dataclass(frozen=True, slots=True)
class _LineText:
    port: str
    mask: str


@dataclass(frozen=True, slots=True)
class _Pad:
    """A counted loop of 3 cycles per turn, and instructions for the remaining cycles."""

    turns: int
    rest: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Delay:
    """`cycles` as a loop of 8 cycles a turn, counted in two bytes, and instructions for the rest."""

    cycles: int
    low: int
    high: int
    rest: tuple[str, ...]

    @classmethod
    def of(cls, cycles: int) -> _Delay:
        """Return the delay of at most half a million cycles; its ends take 3 beside the turns."""
        turns, rest = divmod(cycles - 3, 8)
        more = (*["goto    $+1"] * (rest // 2), *["nop"] * (rest % 2))
        return cls(cycles, turns & 0xFF, (turns - 1 >> 8) + 1 & 0xFF, more)


@dataclass(frozen=True, slots=True)
class _WireText:
    follows: bool
    own: bool
    """Whether each chip has its own crystal."""
    mask: str
    code: tuple[AsmLine, ...]
    restart: str | None
    pull: PortText
    """The port of `restart`, with no other output."""
    pulled: tuple[AsmLine, ...]


def _wire(wire: FrameWire | None, played: Playing) -> _WireText | None:
    """Return what a program does about the wire between two chips before its motion."""
    if wire is None:
        return None
    period, slots = played.plan.schedule.period, played.layout
    values: dict[str, object] = {
        "follows": wire.follows,
        "own": bool(wire.crystal_ppm),
        "frames": wire.quiet_frames(played.plan.schedule.clock, period),
        "frame": _Delay.of(period - JOIN_C if wire.follows else period),
    }
    if wire.follows:
        values |= {
            "port": wire.pin[1],
            "bit": int(wire.pin[2]),
            "pause": quiet_pause(Cycles(period + slots.early)),
            "late": LOOKED_LATE,
            "ahead": slots.slots[0].ticks,
            "last": _Delay.of(
                sum(slot.ticks for slot in slots.slots[1:]) * slots.tick
                if slots.early
                else period - LAST_C - to_rise(slots.tick) - slots.slots[0].ticks * slots.tick
            ),
        }
    return _WireText(
        wire.follows,
        bool(wire.crystal_ppm),
        f"0x{1 << int(wire.pin[2]):02X}",
        _code("wire", **values),
        wire.restart if wire.follows else None,
        PortText("A", "0x0F"),
        _code("restart"),
    )


def render_player(
    played: Playing,
    stored: Stored,
    buttons: ControlButtons,
    dialect: str,
    device: Device,
    title: str,
    wire: FrameWire | None = None,
    parts: Iterable[str] = (),
) -> str:
    """Return the C file of `played` in `dialect`, with its script as `stored`; a comment says what its
    `parts` do. Raises RenderError.
    """
    schedule, encoded, layout = played.plan.schedule, played.encoded, played.layout
    slots, legs, follows = Slots.of(played), encoded.legs, wire if wire and wire.follows else None
    constants = _constants(played, slots)
    tables = {name: table_lines(_row_groups(rows, encoded.stride)) for name, rows in _tables(played).items()}
    high = sorted({int(base) >> 8 for base in encoded.scale.bases})
    return render_template(
        "player/main.c.j2",
        **header_values(dialect, title, device, schedule),
        overrun=OVERRUN,
        parts=[part.replace("*/", "* /") for part in parts],
        tick=layout.tick,
        tick_us=decimal(schedule.clock.us(layout.tick)),
        prescaler=f"0x{PRESCALER + TICKS.index(layout.tick):02X}",
        channels=[_channel(played, channel) for channel in played.order],
        columns=encoded.stride,
        tables=tables,
        slots=slots,
        base_high=high[0] if len(high) == 1 else None,
        places=constants.named,
        constants=table_lines(constants.groups),
        **_script(played, stored),
        legs=legs is not None,
        stand=legs.stand if legs else None,
        top=legs.lifted if legs else None,
        neutral=legs.neutral if legs else None,
        rising=encoded.script.third,
        spots=legs is not None and len(encoded.laws) > 2 * ENTRIES,
        released=legs is not None and bool(encoded.silent.any()),
        **_chain(played.chain),
        **looking(buttons),
        inputs_text=[
            *buttons.text(),
            *(played.chain.read.text() if played.chain else ()),
            *(wire.text() if wire else ()),
        ],
        wire=_wire(wire, played),
        **_calculations(encoded, schedule.clock),
        kernel=list(assembly(kernel(layout.tick, layout.stagger, follows, layout.early, layout.look_delay))),
    )


def _script(played: Playing, stored: Stored) -> dict[str, object]:
    """Return the template's values for the script: where it is, and which kinds of steps it has."""
    script = played.encoded.script
    laws = {timing.law for timing in script.timings}
    return {
        "script": table_lines([(stored.flash, "")]) if stored.flash else [],
        "flash_bytes": len(stored.flash),
        "script_bytes": stored.size,
        "eeprom": list(stored.eeprom),
        "eeprom_first": stored.first,
        "eeprom_address": EEPROM_ADDRESS,
        "eeprom_offset": stored.offset,
        "fetch": _code("fetch"),
        "loop": script.loop,
        "again": AGAIN,
        "at": AT,
        "spot": SPOT,
        "stay": STAY,
        "silent": SILENT,
        "half": HALF,
        "repeats": played.chain is None and _repeats(script.data),
        "starts": any(timing.start for timing in script.timings),
        "laws": bool(played.encoded.laws),
        "stays": bool(laws & {STAY, SILENT}),
        "silence": SILENT in laws,
    }


def _calculations(encoded: Encoded, clock: Clock) -> dict[str, object]:
    """Return the assembly that makes widths of values, whose steps may be finer for some channels."""
    shifts = sorted(set(encoded.scale.shifts.tolist()))
    finest, knees = shifts[0], encoded.scale.bent
    return {
        "step_us": " or ".join(decimal(clock.us(1 << shift)) for shift in shifts),
        "blend": _code("blend", twice=encoded.legs is not None),
        "width": _code("width", doublings=finest, lift_doublings=shifts[-1] - finest, knees=knees),
        "knees": knees,
        "knee": _code("knee", bits=FRACTION - finest),
    }


def _code(name: str, **values: object) -> tuple[AsmLine, ...]:
    """Return the lines of a template of assembly."""
    return tuple(assembly(render_template(f"player/{name}.asm", **values)))


def _chain(chain: DirectionPlaces | None) -> dict[str, object]:
    """Return the template's values for a walk on command."""
    if chain is None:
        return {"chain": False}
    return {
        "chain": True,
        **listening(chain.read, chain.names, FORWARD),
        "entry": ENTRY,
        "stance": chain.stance,
        "before": -ENTRY & 0xFF,
        "spot_timing": chain.spot_timing,
    }


def listening(read: Commander, names: Sequence[str], first: int) -> dict[str, object]:
    """Return the values of `player/listen.c.j2`: what is read, and the directions in the order of their
    numbers from 1 on; one button steps through them from number `first` on, downward.
    """
    line, buttons = None, []
    if isinstance(read, CommandLine):
        line = _LineText(read.pin[1], f"0x{1 << int(read.pin[2]):02X}")
    elif isinstance(read, CommandButtons):
        for number, name in enumerate(names, 1):
            if name in read.buttons:
                pin, level = read.buttons[name].pin, read.buttons[name].level
                mask = f"0x{1 << int(pin[2]):02X}"
                buttons.append(_DirectionText(2 * number, pin[1], mask, "!= 0" if level else "== 0"))
    return {
        "line": line,
        "direction_buttons": buttons,
        "step_button": _button(read.button) if isinstance(read, CommandButton) else None,
        "last_direction": 2 * len(names),
        "before_first": 2 * first + 2,
        "commands": f"0x{0x100 - (1 << COMMAND_SHIFT):02X}",
        "states": f"0x{(1 << COMMAND_SHIFT) - 1:02X}",
    }


def looking(buttons: ControlButtons) -> dict[str, object]:
    """Return the values of `player/look.c.j2` and `player/look_begin.c.j2`."""
    return {
        "start": _button(buttons.start),
        "stop": _button(buttons.stop),
        "stop_off": buttons.stop is not None and buttons.off,
        "pressed_frames": PRESSED_FRAMES,
    }


@dataclass(slots=True)
class Constants:
    """Small tables combined into one, each with a name and a description."""

    groups: list[tuple[list[int | str], str]] = field(default_factory=list)
    """The numbers of each, and the comment beside them."""
    named: list[tuple[str, int, str]] = field(default_factory=list)
    """The names that the C uses, where they begin, and their description."""

    def add(self, name: str, values: Iterable[int | str], note: str = "") -> int:
        """Append a table and return the index at which it begins; its numbers alone if it has no name."""
        begin = sum(len(group) for group, _ in self.groups)
        if name:
            self.named.append((name, begin, note))
        self.groups.append(([*values], name or note))
        return begin

    def add_slots(self, slots: Slots, width_bytes: int) -> None:
        """Append the tables of the slots; a channel's number is that of its width, of so many bytes."""
        self.add("SLOT_A", [f"0x{slot.a:02X}" for slot in slots.all], "the pins that rise together in a slot")
        if not slots.b_follows:
            self.add("SLOT_B", [f"0x{slot.b:02X}" for slot in slots.all])
        self.add("SLOT_TICKS", [slot.ticks for slot in slots.all], "ticks from the slot before")
        self.add("SLOT_CHANNEL", [width_bytes * slot.channel for slot in slots.all], "the channel of pin A")


def _constants(played: Playing, slots: Slots) -> Constants:
    encoded = played.encoded
    constants = Constants()
    timings = encoded.script.timings
    bases = [int(encoded.scale.bases[channel]) for channel in played.order]
    constants.add("BASE_LOW", [base & 0xFF for base in bases], "the channels' base widths")
    if len({base >> 8 for base in bases}) > 1:
        constants.add("BASE_HIGH", [base >> 8 for base in bases])
    if encoded.legs is not None and encoded.scale.bent:
        scale, pairs = encoded.scale, []
        for turn in encoded.legs.turns:
            bend = int(scale.bends[turn])
            pairs += [int(scale.knees[turn]), abs(bend) | (0x80 if bend < 0 else 0)]
        constants.add("KNEE", pairs, "of each leg's turn, and by how many 256ths it is steeper; bit 7: less")
    constants.add_slots(slots, 1)
    if not slots.other_follows:
        constants.add("SLOT_OTHER", [slot.other for slot in slots.all], "and of pin B")
    constants.add("FRAMES", [timing.frames & 0xFF for timing in timings], "of a step; 0 is 256")
    constants.add("SPEED_LOW", [timing.speed & 0xFF for timing in timings], "65536ths of a step in a frame")
    constants.add("SPEED_HIGH", [timing.speed >> 8 for timing in timings])
    if any(timing.start for timing in timings):
        constants.add("START", [timing.start for timing in timings], "256ths of a step at its first frame")
    if played.chain is not None:
        if isinstance(played.chain.read, CommandLine):
            constants.add(
                "HEARING", hearing_table(played.chain.names), "for each state the line low, and high"
            )
        note = "for standing and each direction, where its start, its cycle and its stop begin, and its end"
        constants.add("PARTS", played.chain.places, note)
    note, first = "weights at each sixteenth of a step", 0
    if encoded.legs is not None:
        laws = iter(encoded.laws)
        for name, turned in (
            ("LAW", note),
            ("LIFT_LAW", "of lifting"),
            ("SPOT_LAW", "of turning on the spot"),
        ):
            if part := list(islice(laws, ENTRIES)):
                constants.add(name, part, turned)
    elif encoded.laws:
        first = constants.add("", encoded.laws, f"laws: {note}")
    if encoded.legs is None and any(timing.law != STRAIGHT for timing in timings):
        places = [timing.law + (first if timing.law < SILENT else 0) for timing in timings]
        note = f"where its law begins; {STRAIGHT}: straight, {STAY}: at once, {SILENT}: no pulses"
        constants.add("TIMING_LAW", places, note)
    return constants


def _repeats(data: bytes) -> bool:
    """Return whether a script repeats steps."""
    place = 0
    while place < len(data):
        if data[place] == AGAIN:
            return True
        place += 2 if data[place] == AT else 1
    return False


def _row_groups(rows: list[int], columns: int) -> Iterator[tuple[list[int], str]]:
    """Yield the rows of a table of poses, each with its place; those of one byte together."""
    if columns == 1:
        yield rows, ""
        return
    for first in range(0, len(rows), columns):
        yield rows[first : first + columns], str(first)


def _tables(played: Playing) -> dict[str, list[int]]:
    """Return the table of poses, or the two of halves of them, by name, with columns in the order of the
    slots, or of the legs.
    """
    encoded, stride = played.encoded, played.encoded.stride
    if encoded.legs is not None:
        return {"ROW": list(encoded.rows)}
    count = len(played.order)
    rows = [
        [encoded.rows[first + channel] for channel in played.order]
        for first in range(0, len(encoded.rows), count)
    ]
    halves = {"ROW": [value for row in rows for value in row[:stride]]}
    if stride < count:
        padded = [[*row, 0][stride : 2 * stride] for row in rows]
        halves["REST"] = [value for row in padded for value in row]
    return halves


def kernel(
    tick: Cycles, stagger: Cycles, wire: FrameWire | None = None, early: int = 0, look_delay: int = 0
) -> str:
    """Return the kernel's assembly; TMR0 counts every `tick` cycles, a slot's second servo rises `stagger`
    later; it looks at the `wire`. With two crystals it does so `look_delay` cycles after it would raise pins,
    for a rise that it awaits `early` cycles later.

    The timer's next three increments are read at the cycles `reads` after the beginning of the slot.
    """
    reads = (tick - 2, 2 * tick - 1, 3 * tick - 1)
    pads = (_pad(tick - 9), _pad(tick - 9), _pad(tick - 7), _pad(look_delay - 1))
    looks = {"wire": wire and wire.pin[1], "bit": wire and wire.pin[2], "early": early}
    return render_template(
        "player/kernel.asm", tick=tick, reads=reads, pads=pads, stagger=stagger, way=WAY + stagger, **looks
    )


def _pad(cycles: int) -> _Pad:
    turns, rest = divmod(cycles, 3)
    return _Pad(turns, ((), ("nop",), ("goto    $+1",))[rest])


def _button(button: ButtonPin | None) -> _ButtonText | None:
    if button is None:
        return None
    return _ButtonText(button.pin[1], f"0x{1 << int(button.pin[2]):02X}", "== 0" if button.level else "!= 0")


def _channel(played: Playing, channel: int) -> ChannelText:
    widths = played.encoded.widths[~played.encoded.silent, channel]
    return channel_text(played.plan.schedule, channel, widths.tolist())
