"""The certificate: what a search found, for a checker that repeats it with a chip of its own.

In: a proof and the text of the schedule. Out: bytes, the format of docs/proof.md: the listed states at the
cut points, column by column, as differences, compressed.
"""

from __future__ import annotations

import json
import lzma
from hashlib import sha256

from servogen.edges import PINS
from servogen.pic.device import EEPROM_BYTES, RAM_FIRST, RAM_LAST, registers
from servogen.pic.image import Image
from servogen.prove.chip import ALL_UNKNOWN, BASE, CELL_MASK_SHIFT, CELL_PHASED, FIELD, FREE_BYTES, UNCERTAIN
from servogen.prove.commands import AT_REST, COUNT, OFF_REST, ON_REST
from servogen.prove.prover import Proof
from servogen.prove.specification import BEFORE, IN_FRAME, OVER, SpecState
from servogen.prove.transitions import Transitions
from servogen.prove.wire import LOOK, SILENT
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import CodeLine, CommandRule, Input, StepButton
from servogen.simulator import layout
from servogen.simulator.layout import NEVER, PS, PSA, ROWS

FORMAT = 2
NO_FRAME = {OVER: -1, SILENT: -2}
"""The frame in phases that are in none."""
Memory = tuple[int | str, ...]
Place = tuple[Memory, int, int]


def image_digest(image: Image) -> str:
    """Return the digest of an image's words, configuration and EEPROM."""
    words = "".join(f"{address:03x} {word:04x}\n" for address, word in sorted(image.program.items()))
    config = "none" if image.config is None else f"{image.config:04x}"
    eeprom = "".join(f"{image.eeprom.get(cell, 0xFF):02x}" for cell in range(EEPROM_BYTES))
    return sha256(f"{words}config {config}\n{eeprom}\n".encode()).hexdigest()


def certificate(
    proof: Proof, image: Image, schedule: PulseSchedule, schedule_text: bytes, hold_inputs: bool = False
) -> bytes:
    """Return the certificate of a proof. Raises ValueError for a proof that is none, or has gaps.

    With `hold_inputs`, it may be about one level of each button or line; the checker must be told so.
    """
    if not proof.proven or proof.transitions is None or not proof.quantifiers.complete:
        raise ValueError("only a proof over every power-up, reset and chip has a certificate")
    if proof.held and (schedule.buttons or schedule.commands) and not hold_inputs:
        raise ValueError("only a proof over every level of the buttons and the line has a certificate")
    listed = [node for node in proof.nodes if node.parent >= 0 and node.spec.phase != BEFORE]
    nodes = [node for node in listed if is_settled(proof.transitions, node.rest)]
    rows = {node.rest: row_cells(proof.transitions, node.rest) for node in nodes}
    columns = {name: [rows[node.rest][name] for node in nodes] for name in _NAMES}
    for place, address in enumerate(range(RAM_FIRST, RAM_LAST + 1)):
        columns[f"ram.{address:02x}"] = [node.ram[place] for node in nodes]
    columns["tape_clock"] = [_tape_clock(proof.transitions, node.rest) or 0 for node in nodes]
    columns["time"] = [node.spec.time for node in nodes]
    columns["frame"] = [NO_FRAME.get(node.spec.phase, node.spec.frame) for node in nodes]
    reader = None if proof.held else schedule.commands
    places: dict[Place, int] = {}
    columns["place"] = [
        places.setdefault(place_key(node.spec, schedule, reader), len(places)) for node in nodes
    ]
    content = {
        "format": FORMAT,
        "image": image_digest(image),
        "schedule": sha256(schedule_text).hexdigest(),
        "clock_hz": schedule.clock.hz,
        "held": {PINS[pin]: level for pin, level in sorted(proof.held.items())},
        "assumptions": list(proof.assumptions),
        "cuts": list(proof.cuts),
        "count": len(nodes),
        "places": list(places),
        # Without a write to the EEPROM, or a tape, there is no column of it: such certificates stay as they
        # are.
        "columns": {
            name: compact_column(each)
            for name, each in columns.items()
            if name not in ("write_left", "tape_clock") or any(each)
        },
        **({"tape": sha256(schedule.tape.content).hexdigest()} if schedule.tape else {}),
    }
    text = json.dumps(content, separators=(",", ":"))
    return lzma.compress(text.encode(), preset=9 | lzma.PRESET_EXTREME)


def compact_column(values: list[int]) -> dict[str, int | list[int]]:
    """Return one value if all are the same, else each one's difference from the one before."""
    if len(set(values)) == 1:
        return {"all": values[0]}
    return {"delta": [now - before for before, now in zip([0, *values], values, strict=False)]}


def place_key(spec: SpecState, schedule: PulseSchedule, commands: CommandRule | None) -> Place:
    """Return what the certificate says of the inputs: the memory, the levels read in this frame, and of which
    pins.
    """
    if schedule.wire:
        looked = spec.phase == IN_FRAME and spec.wire.seen == len(LOOK) and not schedule.wire.crystal_ppm
        return spec.wire, 0, looked << PINS.index(schedule.wire.pin)
    if commands is None:
        memory: Memory = (spec.running, spec.on, spec.start_seen, spec.stop_seen)
        rule = schedule.buttons
        read = [(rule.start, spec.start_sample), (rule.stop, spec.stop_sample)] if rule else []
        pins = [(PINS.index(button.pin), level) for button, level in read if button and level >= 0]
        return memory, sum(level << pin for pin, level in pins), sum(1 << pin for pin, _ in pins)
    frames, kind = divmod(spec.heard, COUNT)
    if isinstance(commands.read, CodeLine):
        line = commands.read.line
        return (spec.wanted, heard_text(spec.heard, line.level)), 0, spec.line_read << PINS.index(line.pin)
    if isinstance(commands.read, StepButton):
        pin = PINS.index(commands.read.button.pin)
        return (spec.wanted, frames, kind), 0, spec.line_read << pin
    levels = sampled = 0
    buttons = (direction.selector for direction in commands.directions)
    for number, button in enumerate(selector for selector in buttons if isinstance(selector, Input)):
        pin, seen = PINS.index(button.pin), spec.line_read >> 2 * number
        sampled |= (seen >> 1 & 1) << pin
        levels |= (button.level if seen & 4 else 1 - button.level) * (seen >> 1 & 1) << pin
    return (spec.wanted, kind, frames), levels, sampled


def heard_text(number: int, rest: int) -> str:
    """Return the levels that a number of `prove.commands.Line` stands for."""
    if number >= OFF_REST:
        level, count = (rest, number - ON_REST) if number >= ON_REST else (1 - rest, number - OFF_REST)
        return "-" + str(level) * count
    return "" if number == AT_REST else str(1 - rest) + f"{number:b}"[1:]


_STACK = tuple(f"stack{level}" for level in range(8))
_REGISTERS = [row for name in registers() for row in ROWS if row.register == name != "PCL"]
_CELLS = [row.name for row in _REGISTERS if row.name in UNCERTAIN and not row.is_free]
_NUMBERS = [row.name for row in _REGISTERS if row.name not in UNCERTAIN]
_BYTES = [part for name in FREE_BYTES for part in ((name, "PRESCALER") if name == "TMR0" else (name,))]
_NAMES = (
    "pc",
    *(name.lower() for name in (*_BYTES, *_CELLS, *_NUMBERS)),
    *("trisa", "trisb", "porta", "portb", "depth", *_STACK, "watchdog_age", "write_left"),
)
"""The columns beside those of the RAM and the schedule, in the order of the file."""


def is_settled(transitions: Transitions, number: int) -> bool:
    """Return whether no interrupt is under way, no key in EECON2, TMR0 counts, and a tape's EEPROM is amid a
    byte of its own; the checker passes other states by.
    """
    rest = transitions.rest(number)
    keys = rest[FIELD["EE_STEP"]] and rest[FIELD["EE_STEP_AT"]] >= BASE - 2
    reads = _tape_clock(transitions, number) is not None
    return rest[FIELD["IRQ_AT"]] == NEVER and rest[FIELD["T0_AT"]] <= BASE and not keys and reads


def _tape_clock(transitions: Transitions, number: int) -> int | None:
    """Return where on its tape the EEPROM is: see `TapeBeside.clock`; 0 without one."""
    tape = transitions.chip.tape
    return tape.clock(transitions.rest(number)[FIELD["DEVICE_STATE"]]) if tape else 0


def row_cells(transitions: Transitions, number: int) -> dict[str, int]:
    """Return the columns of what is beside the RAM.

    TMR0 is unknown if bits of its prescaler's count are that reach it.
    """
    rest = transitions.rest(number)

    def get(name: str) -> int:
        return rest[FIELD[name]]

    def cell(name: str, shift: int = 0, width: int = 8) -> int:
        bits = get(UNCERTAIN[name].unknown_name)
        if bits == layout.PHASED:
            return get(name) | CELL_PHASED
        every = (1 << width) - 1
        return get(name) >> shift & ~(bits >> shift) & every | (bits >> shift & every) << CELL_MASK_SHIFT

    counted = 0 if get("OPTION") & PSA else (2 << (get("OPTION") & PS)) - 1
    timed = not get("PRESCALER_UNKNOWN") & counted
    row = {
        "pc": get("PC") & 0x3FF,
        **{name.lower(): cell(name) for name in (*FREE_BYTES, *_CELLS)},
        **{name.lower(): get(name) for name in _NUMBERS},
        "prescaler": get("PRESCALER") & counted if timed else 0,
        "trisa": get("TRIS") & 0x1F,
        "trisb": get("TRIS") >> 5 & 0xFF,
        "porta": cell("LATCH", 0, 5),
        "portb": cell("LATCH", 5),
        "depth": get("DEPTH"),
        "watchdog_age": BASE - get("WDT_CLEARED"),
        "write_left": 0 if get("EE_DONE_AT") == NEVER else get("EE_DONE_AT") - BASE,
    }
    if not timed:
        row["tmr0"] = ALL_UNKNOWN
    return row | {name: get(f"STACK{level}") & 0x3FF for level, name in enumerate(_STACK)}
