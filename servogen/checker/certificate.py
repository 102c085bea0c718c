"""Certificates: what a proof claims, as states of the chip at certain addresses of the program.

In: a compressed file. Out: a `Certificate` with one row of the chip's slots per state; docs/proof.md has the
format. Whatever it contains is only a claim. Bounds: 4 MiB, 64 MiB unpacked, 250 000 states.
"""

from __future__ import annotations

import hashlib
import json
import lzma
from bisect import bisect_left
from dataclasses import dataclass
from typing import Any

import numpy as np

from servogen.checker import chip
from servogen.checker.plan import OVER, PINS, Place, Plan, Position
from servogen.errors import InputError, Location
from servogen.pic.image import Image

Ints = chip.Ints
MAX_TEXT, MAX_STATES = 64 << 20, 250_000
RAM = [f"ram.{address:02x}" for address in range(chip.RAM, chip.RAM_END)]
CELLS = {name: chip.RAM + n for n, name in enumerate(RAM)} | {
    "w": chip.W, "fsr": chip.FSR, "tmr0": chip.T0, "eedata": chip.EEDATA, "eeadr": chip.EEADR
}  # fmt: skip
"""Columns that are bytes which may be unknown, or move with the phase."""
DIRECT = {"pc": chip.PC, "depth": chip.DEPTH, "pclath": chip.PCLATH, "option": chip.OPTION,
          "tmr0_wait": chip.T0_AT}  # fmt: skip
MASKED = {"status": chip.STATUS, "intcon": chip.INTCON, "eecon1": chip.EECON1, "prescaler": chip.PRESCALER}
STACK = [f"stack{level}" for level in range(8)]
RANGES = {"pc": 1023, "pclath": 31, "option": 255, "tris": 0x1FFF, "latch": 0x1FFF, "latch_unknown": 0x1FFF,
          "rb_old": 0x1FFF, "rb_old_unknown": 0x1FFF, "depth": 8, "tmr0_wait": 3, "tmr0_flagged": 1,
          "watchdog_age": 1 << 40, "irq": 8, "glitch": 0x1FFF, "glitch_age": 10,
          "sleeping": 1, "spec.phase": 2, "spec.time": 1 << 30, "spec.frame": 1 << 30, "spec.running": 1,
          "spec.on": 1, "spec.start_seen": 255, "spec.stop_seen": 255, "spec.start_sample": 1,
          "spec.stop_sample": 1, "spec.heard": 255, "spec.wanted": 255, "spec.line_read": 511,
          **dict.fromkeys(STACK, 0x1FFF)}  # fmt: skip
"""The other columns, and their largest values; the least is 0, but for `LEAST`."""
PLACED = ["spec.phase", "spec.start_sample", "spec.stop_sample", "spec.line_read",
          *(f"spec.{name}" for name in Position._fields)]  # fmt: skip
NO_IRQ = -1000
LEAST = {"irq": NO_IRQ, "spec.start_sample": -1, "spec.stop_sample": -1}
KEYS = {"format": int, "image": str, "schedule": str, "clock_hz": int, "held": dict,
        "assumptions": list, "cuts": list, "count": int, "columns": dict}  # fmt: skip


@dataclass(frozen=True)
class Certificate:
    """What is claimed: of which program and schedule, and the states in columns."""

    image: str
    schedule: str
    clock_hz: int
    held: dict[str, int]
    cuts: frozenset[int]
    count: int
    columns: dict[str, Ints]


class ImpossibleState(Exception):
    """A listed state, by its number, that the chip or the schedule does not have."""


def read_certificate(packed: bytes, file: str) -> Certificate:
    """Return what a certificate claims. Raises InputError if it is not one."""
    try:
        unpacker = lzma.LZMADecompressor(lzma.FORMAT_XZ, memlimit=256 << 20)
        text = unpacker.decompress(packed, MAX_TEXT + 1)
        if len(text) > MAX_TEXT or not unpacker.eof or unpacker.unused_data:
            raise ValueError("the file is cut short, too large, or has something after its end")
        data = json.loads(text)
        if {key: type(value) for key, value in data.items()} != KEYS or data["format"] != 1:
            raise ValueError(f"it needs format 1 and the keys {', '.join(KEYS)}")
        return _certificate(data)
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError, EOFError,
            MemoryError, lzma.LZMAError) as error:  # fmt: skip
        raise InputError("not-a-certificate", f"not a certificate: {error}", Location(file)) from error


def _certificate(data: dict[str, Any]) -> Certificate:
    count, cuts, held = data["count"], data["cuts"], data["held"]
    if not 0 <= count <= MAX_STATES or any(type(cut) is not int or not 0 <= cut < 1024 for cut in cuts):
        raise ValueError("count or cuts")
    if any(pin not in PINS or level not in (0, 1) for pin, level in held.items()):
        raise ValueError("held")
    if data["columns"].keys() != {*CELLS, *MASKED, *RANGES}:
        raise ValueError(f"columns {', '.join(sorted(data['columns'].keys() ^ {*CELLS, *MASKED, *RANGES}))}")
    columns = {name: _column(name, column, count) for name, column in data["columns"].items()}
    return Certificate(
        data["image"], data["schedule"], data["clock_hz"], held, frozenset(cuts), count, columns
    )


def _column(name: str, column: dict[str, Any], count: int) -> Ints:
    """Return the values of one column."""
    numbers = column.get("delta", [column.get("all")])
    if len(column) != 1 or any(type(number) is not int for number in numbers):
        raise ValueError(f"column {name}")
    values = np.array(numbers, dtype=np.int64)
    values = np.cumsum(values) if "delta" in column else np.full(count, values[0])
    least, largest = LEAST.get(name, 0), RANGES.get(name, 0x1FFFF)
    wrong = len(values) != count or (values < least).any() or (values > largest).any()
    if name not in RANGES:
        mask = values >> 8 & 0xFF
        phased = values >> 16 == 1
        wrong = wrong or (values & mask).any() or (phased & ((mask != 0) | (name in MASKED))).any()
    if wrong:
        raise ValueError(f"column {name} has {len(values)} values of {count}, or one that is out of range")
    return values


def fingerprint(image: Image) -> str:
    """Return the digest of a program, its configuration word and its EEPROM."""
    config = "none" if image.config is None else f"{image.config:04x}"
    text = "".join(f"{address:03x} {word:04x}\n" for address, word in sorted(image.program.items()))
    cells = "".join(f"{image.eeprom.get(cell, 0xFF):02x}" for cell in range(64))
    return hashlib.sha256(f"{text}config {config}\n{cells}\n".encode()).hexdigest()


def chip_states(claim: Certificate, plan: Plan) -> tuple[Ints, list[Place]]:
    """Return the listed states as rows of the chip's slots, and each state's place in the plan.

    Raises ImpossibleState for one that the chip or the plan does not have.
    """
    c = claim.columns
    s = np.zeros((claim.count, chip.SLOTS), dtype=np.int64)
    for name, slot in (*CELLS.items(), *MASKED.items(), *DIRECT.items()):
        s[:, slot] = c[name]
    latch, dark, tris = c["latch"] & ~c["latch_unknown"], c["latch_unknown"], c["tris"]
    s[:, chip.PORTA], s[:, chip.PORTB] = latch & 0x1F | (dark & 0x1F) << 8, latch >> 5 | dark >> 5 << 8
    s[:, chip.TRISA], s[:, chip.TRISB], s[:, chip.OUT] = tris & 0x1F, tris >> 5, latch & ~tris
    stack = np.stack([c[name] for name in STACK], axis=1)
    s[:, chip.STACK : chip.STACK + 8] = stack & 0x3FF
    s[:, chip.IRQ] = np.where(c["irq"] == NO_IRQ, chip.NEVER, c["irq"])
    s[:, chip.DARK] = np.where(c["glitch"] != 0, chip.GLITCH - c["glitch_age"], chip.NEVER)
    s[:, chip.WDT_CLEARED] = -c["watchdog_age"]
    phase, time = c["spec.phase"], c["spec.time"]
    s[:, chip.FRAME] = np.where(phase == 0, chip.BEFORE, np.where(phase == 1, -time, chip.NEVER))
    wrong = (c["sleeping"] != 0) | (time >= np.where(phase == 1, plan.period, 1))
    wrong |= ((stack != 0) & (np.arange(8) >= c["depth"][:, None])).any(axis=1)
    places: list[Place] = []
    known: dict[tuple[int, ...], Place | None] = {}
    fields = zip(*(c[name].tolist() for name in PLACED), strict=True)
    for number, (now, key) in enumerate(zip(time.tolist(), fields, strict=True)):
        if key not in known:
            known[key] = _place(key, plan)
        place = known[key]
        if place is None or wrong[number]:
            raise ImpossibleState(number)
        places.append(place)
        s[number, chip.EDGE] = bisect_left(plan.due(place.position)[0], now) if key[0] else 0
    return s, places


def _place(key: tuple[int, ...], plan: Plan) -> Place | None:
    """Return the place that the columns `PLACED` name; None if the plan has none such."""
    phase, start_sample, stop_sample, line_read, *fields = key
    position = Position(*fields)
    if position.frame >= plan.ends[-1] or (phase == 0 and position != plan.start_up):
        return None
    if plan.directions and position.wanted >= len(plan.directions.parts):
        return None
    if line_read > (1 if plan.line else 511 if plan.pushed else 0):
        return None
    levels, sampled = 0, line_read << plan.line.pin if plan.line else 0
    if plan.pushed:
        levels, sampled = plan.pushed.read(line_read)
    for button, level in ((plan.start, start_sample), (plan.stop, stop_sample)):
        if level != -1:
            if button is None:
                return None
            levels, sampled = levels | level << button.pin, sampled | 1 << button.pin
    return Place((plan.first, position, OVER)[phase], levels, sampled)
