"""The certificate: what a search found, for a checker that repeats it with a chip of its own.

In: a proof and the text of the schedule. Out: bytes, the format of docs/proof.md: the listed states at the
cut points, column by column, as differences, compressed.
"""

from __future__ import annotations

import json
import lzma
from hashlib import sha256

from servogen.edges import PINS
from servogen.pic.device import EEPROM_BYTES, RAM_FIRST, RAM_LAST
from servogen.pic.image import Image
from servogen.prove.prover import Proof
from servogen.prove.transitions import Transitions
from servogen.pulse import PulseSchedule
from servogen.simulator import layout
from servogen.simulator.abstract import BASE, CELL_MASK_SHIFT, CELL_PHASED, FIELD
from servogen.simulator.layout import NEVER

FORMAT = 1
NO_INTERRUPT = -1000
ALL_PINS = (1 << len(PINS)) - 1


def image_digest(image: Image) -> str:
    """Return the digest of an image's words, configuration and EEPROM."""
    words = "".join(f"{address:03x} {word:04x}\n" for address, word in sorted(image.program.items()))
    config = "none" if image.config is None else f"{image.config:04x}"
    eeprom = "".join(f"{image.eeprom.get(cell, 0xFF):02x}" for cell in range(EEPROM_BYTES))
    return sha256(f"{words}config {config}\n{eeprom}\n".encode()).hexdigest()


def certificate(proof: Proof, image: Image, schedule: PulseSchedule, schedule_text: bytes) -> bytes:
    """Return the certificate of a proof. Raises ValueError for a proof that is none, or has gaps."""
    if not proof.proven or proof.transitions is None or not proof.quantifiers.complete:
        raise ValueError("only a proof over every power-up, reset and chip has a certificate")
    if proof.asynchronous:
        raise ValueError("interrupts by INT and port B, SLEEP and EEPROM writes are not certified")
    nodes = [node for node in proof.nodes if node.parent >= 0]
    rows = {node.rest: _row(proof.transitions, node.rest) for node in nodes}
    columns = {name: [rows[node.rest][name] for node in nodes] for name in _NAMES}
    for place, address in enumerate(range(RAM_FIRST, RAM_LAST + 1)):
        columns[f"ram.{address:02x}"] = [node.ram[place] for node in nodes]
    for name in nodes[0].spec._fields if nodes else ():
        columns[f"spec.{name}"] = [getattr(node.spec, name) for node in nodes]
    content = {
        "format": FORMAT,
        "image": image_digest(image),
        "schedule": sha256(schedule_text).hexdigest(),
        "clock_hz": schedule.clock.hz,
        "held": {PINS[pin]: level for pin, level in sorted(proof.held.items())},
        "assumptions": list(proof.assumptions),
        "cuts": list(proof.cuts),
        "count": len(nodes),
        "columns": {name: _column(values) for name, values in columns.items()},
    }
    text = json.dumps(content, separators=(",", ":"))
    return lzma.compress(text.encode(), preset=9 | lzma.PRESET_EXTREME)


def _column(values: list[int]) -> dict[str, int | list[int]]:
    if len(set(values)) == 1:
        return {"all": values[0]}
    return {"delta": [now - before for before, now in zip([0, *values], values, strict=False)]}


_STACK = tuple(f"stack{level}" for level in range(8))
_NAMES = (
    *("pc", "w", "fsr", "tmr0", "eedata", "eeadr", "status", "intcon", "eecon1", "pclath", "option", "tris"),
    *("latch", "latch_unknown", "rb_old", "rb_old_unknown", "depth", *_STACK, "tmr0_wait", "tmr0_flagged"),
    *("prescaler", "watchdog_age", "irq", "glitch", "glitch_age", "sleeping"),
)


def _row(transitions: Transitions, number: int) -> dict[str, int]:
    rest = transitions.rest(number)

    def get(name: str) -> int:
        return rest[FIELD[name]]

    def cell(value: str, mask: str) -> int:
        bits = get(mask)
        if bits == layout.PHASED:
            return get(value) | CELL_PHASED
        return get(value) & ~bits & 0xFF | (bits & 0xFF) << CELL_MASK_SHIFT

    pins = get("DRIVEN_UNKNOWN")
    ages = [BASE - get(f"DRIVEN_FROM_{pin}") for pin in PINS if pins >> PINS.index(pin) & 1]
    row = {
        "pc": get("PC") & 0x3FF,
        "w": cell("W", "W_UNKNOWN"),
        "fsr": cell("FSR", "FSR_UNKNOWN"),
        "tmr0": cell("T0_VALUE", "T0_UNKNOWN"),
        "eedata": cell("EEDATA", "EEDATA_UNKNOWN"),
        "eeadr": cell("EEADR", "EEADR_UNKNOWN"),
        "status": cell("STATUS", "STATUS_UNKNOWN"),
        "intcon": cell("INTCON", "INTCON_UNKNOWN"),
        "eecon1": cell("EECON1", "EECON1_UNKNOWN"),
        "pclath": get("PCLATH"),
        "option": get("OPTION"),
        "tris": get("TRIS") & ALL_PINS,
        "latch": get("LATCH"),
        "latch_unknown": get("LATCH_UNKNOWN"),
        "rb_old": get("RB_OLD"),
        "rb_old_unknown": get("RB_OLD_UNKNOWN"),
        "depth": get("DEPTH"),
        "tmr0_wait": get("T0_AT") - BASE,
        "tmr0_flagged": int(get("T0_FLAGGED") == BASE),
        "prescaler": cell("PRESCALER", "PRESCALER_UNKNOWN"),
        "watchdog_age": BASE - get("WDT_CLEARED"),
        "irq": NO_INTERRUPT if get("IRQ_AT") == NEVER else get("IRQ_AT") - BASE,
        "glitch": pins,
        "glitch_age": max(ages, default=0),
        "sleeping": get("SLEEPING"),
    }
    return row | {name: get(f"STACK{level}") for level, name in enumerate(_STACK)}
