"""Certificates: what a proof claims, as states of the chip at certain addresses of the program.

In: a compressed file. Out: a `Certificate` with one row of the chip's slots per state; docs/proof.md has the
format. Whatever it contains is only a claim. Bounds: 4 MiB, 64 MiB unpacked, 250 000 states.
"""

from __future__ import annotations

import hashlib
import json
import lzma
from dataclasses import dataclass
from typing import Any

import numpy as np

from servogen.checker import chip, layout
from servogen.checker.plan import AWAITED, PINS, Place
from servogen.errors import InputError, Location
from servogen.pic.image import Image

Ints = chip.Ints
MAX_TEXT, MAX_STATES = 64 << 20, 250_000
FRAME_NUMBER, PLACE, WIDTH = range(layout.SLOTS, layout.SLOTS + 3)
"""Columns beside the chip's slots: the schedule's frame, -1 when nothing more is due, and the number of the
place in the list.
"""
WRITE_LEFT = "write_left"
TAPE_CLOCK = "tape_clock"
"""The columns that may be missing: no state has an EEPROM write in progress, and there is no tape."""
RAM = {f"ram.{address:02x}": address for address in range(layout.RAM, layout.RAM_END)}
FREE = {*RAM, *(row.name for row in layout.REGISTERS if row.may_move)}
"""Columns of cells that may move with φ."""
CELLS = {row.name: (row.slot, row.unknown) for row in layout.REGISTERS if row.unknown}
CELLS |= {name: (slot, 0xFF) for name, slot in RAM.items()}
"""Columns of cells, with the bits that may be unknown."""
NUMBERS = {**{row.name: (row.slot, row.reset) for row in layout.REGISTERS if not row.unknown},
           "pc": (layout.PC, 0x3FF), "depth": (layout.DEPTH, 8), "prescaler": (layout.PRESCALER, 0xFF),
           WRITE_LEFT: (layout.WRITE_LEFT, 1 << 30), TAPE_CLOCK: (layout.POINTER, 9 << 16),
           "watchdog_age": (layout.AGE, 1 << 40), "time": (layout.TIME, 1 << 30),
           "frame": (FRAME_NUMBER, 1 << 30), "place": (PLACE, MAX_STATES),
           **{f"stack{level}": (layout.STACK + level, 0x3FF) for level in range(8)}}  # fmt: skip
"""Columns of numbers, with the largest ones."""
LEAST = {"frame": AWAITED, "time": -(1 << 30)}
"""The least ones, of those that may be negative: a frame that follows a wire's rise begins before time 0."""
KEYS = {"format": int, "image": str, "schedule": str, "clock_hz": int, "held": dict,
        "assumptions": list, "cuts": list, "count": int, "places": list, "columns": dict,
        "tape": str}  # fmt: skip


@dataclass(frozen=True)
class Certificate:
    """What is claimed: of which program and schedule, and the states."""

    image: str
    schedule: str
    clock_hz: int
    held: dict[str, int]
    cuts: frozenset[int]
    places: list[Place]
    states: Ints
    tape: str = ""
    """The digest of the tape's content."""

    @property
    def count(self) -> int:
        """Return the number of listed states."""
        return len(self.states)


def read_certificate(packed: bytes, file: str) -> Certificate:
    """Return what a certificate claims. Raises InputError if it is not one."""
    try:
        unpacker = lzma.LZMADecompressor(lzma.FORMAT_XZ, memlimit=256 << 20)
        text = unpacker.decompress(packed, MAX_TEXT + 1)
        if len(text) > MAX_TEXT or not unpacker.eof or unpacker.unused_data:
            raise ValueError("the file is cut short, too large, or has something after its end")
        data = {"tape": ""} | json.loads(text)
        if {key: type(value) for key, value in data.items()} != KEYS or data["format"] != 2:
            raise ValueError(f"it needs format 2 and the keys {', '.join(KEYS)}")
        return _certificate(data)
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError, EOFError,
            MemoryError, lzma.LZMAError) as error:  # fmt: skip
        raise InputError("not-a-certificate", f"not a certificate: {error}", Location(file)) from error


def _certificate(data: dict[str, Any]) -> Certificate:
    count, cuts, held_levels = data["count"], data["cuts"], data["held"]
    if not 0 <= count <= MAX_STATES or any(type(cut) is not int or not 0 <= cut < 1024 for cut in cuts):
        raise ValueError("count or cuts")
    if any(
        pin not in PINS or type(level) is not int or level not in (0, 1) for pin, level in held_levels.items()
    ):
        raise ValueError("held")
    places = [Place(tuple(memory), levels, sampled) for memory, levels, sampled in data["places"]]
    words = [word for place in places for word in (place.levels, place.sampled)]
    if any(type(word) is not int or not 0 <= word < 1 << len(PINS) for word in words):
        raise ValueError("places")
    columns = {name: {"all": 0} for name in (WRITE_LEFT, TAPE_CLOCK)} | data["columns"]
    if columns.keys() != {*CELLS, *NUMBERS}:
        raise ValueError(f"columns {', '.join(sorted(columns.keys() ^ {*CELLS, *NUMBERS}))}")
    states = np.zeros((count, WIDTH), dtype=np.int64)
    for name, column in columns.items():
        slot, largest = NUMBERS.get(name) or CELLS[name]
        values = _column(name, column, count)
        mask, phased = (values >> 8 & 0xFF, values >> 16) if name in CELLS else (0 * values, 0 * values)
        wrong = (values < LEAST.get(name, 0)) | (values > (0x1FFFF if name in CELLS else largest))
        wrong |= values & mask != 0 if name in CELLS else False
        wrong |= (mask & ~largest != 0) | (phased & ((mask != 0) | (name not in FREE)) != 0)
        if wrong.any():
            raise ValueError(f"column {name} has a value that is out of range")
        states[:, slot] = values
    # A pin may set INTF and RBIF at any time: they are 1 or unknown.
    states[:, layout.INTCON] |= (layout.INTF | layout.RBIF) << 8 & ~(states[:, layout.INTCON] << 8)
    if (states[:, PLACE] >= len(places)).any():
        raise ValueError("column place")
    fields = {key: data[key] for key in ("image", "schedule", "clock_hz", "held", "tape")}
    return Certificate(**fields, cuts=frozenset(cuts), places=places, states=states)


def _column(name: str, column: dict[str, Any], count: int) -> Ints:
    """Return the values of one column."""
    numbers = column.get("delta", [column.get("all")])
    if len(column) != 1 or any(type(number) is not int for number in numbers):
        raise ValueError(f"column {name}")
    values = np.array(numbers, dtype=np.int64)
    values = np.cumsum(values) if "delta" in column else np.full(count, values[0])
    if len(values) != count:
        raise ValueError(f"column {name} has {len(values)} values of {count}")
    return values


def fingerprint(image: Image) -> str:
    """Return the digest of a program, its configuration word and its EEPROM."""
    config = "none" if image.config is None else f"{image.config:04x}"
    text = "".join(f"{address:03x} {word:04x}\n" for address, word in sorted(image.program.items()))
    cells = "".join(f"{image.eeprom.get(cell, 0xFF):02x}" for cell in range(64))
    return hashlib.sha256(f"{text}config {config}\n{cells}\n".encode()).hexdigest()
