"""Cycles of small programs that every compiler of this chip is asked for: those beside this module.

In: a HEX file whose program holds RA0 high while it works and shows a checksum on port B before it sets RA1.
Out: the cycles between the edges of RA0, and the checksum.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from servogen.compiler import Options, Source, compile_sources
from servogen.edges import HIGH, PINS
from servogen.pic.image import Image
from servogen.simulator import Machine
from servogen.units import Clock

HERE = Path(__file__).parent
RECORD = HERE / "cycles.json"
LIMIT = 100_000
"""Cycles: the longest program takes a tenth of that."""


@dataclass(frozen=True)
class Measured:
    words: int
    cycles: int
    checksum: int


def programs() -> list[Path]:
    return sorted(HERE.glob("*.c"))


def measured(image: Image) -> Measured:
    """Run a program. Raises ValueError if it does not end within LIMIT cycles."""
    machine = Machine(image, Clock(4_000_000))
    chunk = machine.run(LIMIT)
    working, done = PINS.index("RA0"), PINS.index("RA1")
    rises = chunk.cycle[(chunk.pin == working) & (chunk.level == HIGH)]
    falls = chunk.cycle[(chunk.pin == working) & (chunk.level != HIGH)]
    ended = chunk.cycle[(chunk.pin == done) & (chunk.level == HIGH)]
    if not (len(rises) and len(ended)):
        raise ValueError(f"does not end within {LIMIT} cycles")
    checksum = sum(1 << bit for bit in range(8) if machine.levels[PINS.index(f"RB{bit}")] == HIGH)
    took = int(falls[falls > rises[0]][0] - rises[0])
    return Measured(len(image.program), took, checksum)


def ours(path: Path) -> Measured:
    return measured(compile_sources([Source(path.read_text(), path.name)], Options(dialect="sdcc")).image)


def recorded() -> dict[str, Measured]:
    rows = json.loads(RECORD.read_text()) if RECORD.exists() else {}
    return {name: Measured(**row) for name, row in rows.items()}
