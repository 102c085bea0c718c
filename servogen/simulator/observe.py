"""The trace: every executed instruction, with its source line.

In: a machine, a number of cycles, optionally the program's `Listing`. Out: rows, produced on demand.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from servogen.pic.image import Image
from servogen.pic.isa import Decoded, decode
from servogen.pic.listing import Listing, ListingRow
from servogen.simulator.machine import Machine, Observation
from servogen.units import Cycles

if TYPE_CHECKING:
    from servogen.answers import ProfileAnswer

ROWS = 1 << 14
FLAGS = "CDZPT"
"""Letters of STATUS bits 0 to 4: carry, digit carry, zero, PD, TO."""


@dataclass(frozen=True, slots=True)
class TraceRow:
    """One executed instruction, with W and STATUS as it left them."""

    cycle: Cycles
    pc: int
    w: int
    status: int
    assembly: str
    file: str | None = None
    line: int | None = None
    source: str = ""

    def __str__(self) -> str:
        flags = "".join(
            name if self.status >> bit & 1 else "-" for bit, name in reversed([*enumerate(FLAGS)])
        )
        where = f"  {self.file}:{self.line}: {self.source}" if self.file else ""
        return f"{self.cycle:>12} {self.pc:04X}  {self.assembly:<20} W={self.w:02X} {flags}{where}".rstrip()


def trace(machine: Machine, cycles: int, listing: Listing | None = None) -> Iterator[TraceRow]:
    """Run `machine` for `cycles`, yielding every instruction that it executes."""
    listed = {row.address: row for row in listing.rows} if listing else {}
    sources = {name: text.splitlines() for name, text in listing.sources} if listing else {}
    observation = Observation(trace=np.zeros((ROWS, 4), dtype=np.int64))
    for _, rows in machine.observe(cycles, observation):
        for cycle, pc, w, status in rows.tolist():
            yield _row(machine.image, cycle, pc, w, status, listed, sources)


def _row(
    image: Image,
    cycle: int,
    pc: int,
    w: int,
    status: int,
    listed: dict[int, ListingRow],
    sources: dict[str, list[str]],
) -> TraceRow:
    address = pc % 0x400
    row = listed.get(address)
    if row is None:
        return TraceRow(Cycles(cycle), pc, w, status, plain_assembly(image, address))
    text = sources.get(row.file or "", [])
    source = text[row.line - 1].strip() if row.line is not None and 0 < row.line <= len(text) else ""
    return TraceRow(Cycles(cycle), pc, w, status, row.assembly, row.file, row.line, source)


def plain_assembly(image: Image, address: int) -> str:
    """Return the instruction at an address without names: "ADDWF 0x20, F"."""
    if address not in image.program:
        return "(erased)"
    decoded = decode(image.program[address])
    return f"(undefined 0x{image.program[address]:04X})" if decoded is None else _assembly(decoded)


def _assembly(decoded: Decoded) -> str:
    parts = []
    for field in decoded.instruction.operands:
        value = getattr(decoded, field)
        parts.append("WF"[value] if field == "d" else str(value) if field == "b" else f"0x{value:02X}")
    return f"{decoded.instruction.mnemonic} {', '.join(parts)}".strip()


@dataclass(frozen=True, slots=True)
class Spent:
    """The cost of one word, line or function: how often its instructions were executed, and their cycles."""

    executions: int
    cycles: Cycles


@dataclass(frozen=True, slots=True)
class Profile:
    """Cycles by address, by source line and by function; words outside any function are listed under ""."""

    cycles: Cycles
    """The cycles profiled; those of no instruction (interrupt latency, sleep, reset) are `idle` of them."""
    idle: Cycles
    words: dict[int, Spent]
    """By address; only words that were executed."""
    lines: dict[tuple[str, int], Spent]
    """By (file, line)."""
    functions: dict[str, Spent]
    """By name; `executions` counts its instructions."""
    unexecuted: tuple[int, ...]
    """Addresses in the program that were never executed."""
    deepest_stack: int
    ram_high_water: int
    read_unwritten: tuple[int, ...]

    @property
    def coverage(self) -> float:
        """Return the executed part of the program's words, 0 to 1."""
        total = len(self.words) + len(self.unexecuted)
        return len(self.words) / total if total else 1.0

    def to_json(self) -> ProfileAnswer:
        return {
            "cycles": self.cycles,
            "idle_cycles": self.idle,
            "coverage": self.coverage,
            "unexecuted": list(self.unexecuted),
            "function_cycles": {name: spent.cycles for name, spent in self.functions.items()},
            "lines": [
                {"file": file, "line": line, "cycles": spent.cycles, "executions": spent.executions}
                for (file, line), spent in self.lines.items()
            ],
            "deepest_stack": self.deepest_stack,
            "ram_high_water": self.ram_high_water,
            "read_unwritten": list(self.read_unwritten),
        }


def profile(machine: Machine, cycles: int, listing: Listing | None = None) -> Profile:
    """Run `machine` for `cycles` and return the counts; stack and RAM figures are those since power-up."""
    observation = Observation()
    start = machine.cycles
    for _ in machine.observe(cycles, observation):
        pass
    taken = machine.cycles - start
    counts = {a: Spent(int(n), Cycles(int(c))) for a, (n, c) in enumerate(observation.counts) if n}
    lines: Counter[tuple[str, int]] = Counter()
    line_cycles: Counter[tuple[str, int]] = Counter()
    for row in listing.rows if listing else ():
        if row.address in counts and row.file is not None and row.line is not None:
            lines[row.file, row.line] += counts[row.address].executions
            line_cycles[row.file, row.line] += counts[row.address].cycles
    state = machine.state()
    return Profile(
        cycles=Cycles(taken),
        idle=Cycles(taken - sum(spent.cycles for spent in counts.values())),
        words=counts,
        lines={key: Spent(lines[key], Cycles(line_cycles[key])) for key in lines},
        functions=_by_function(counts, listing),
        unexecuted=tuple(sorted(set(machine.image.program) - set(counts))),
        deepest_stack=state.deepest_stack,
        ram_high_water=state.ram_high_water,
        read_unwritten=state.read_unwritten,
    )


def _by_function(counts: dict[int, Spent], listing: Listing | None) -> dict[str, Spent]:
    names = {a: f.name for f in (listing.functions if listing else ()) for a in range(f.start, f.end)}
    executions: Counter[str] = Counter()
    cycles: Counter[str] = Counter()
    for address, spent in counts.items():
        executions[names.get(address, "")] += spent.executions
        cycles[names.get(address, "")] += spent.cycles
    return {name: Spent(executions[name], Cycles(cycles[name])) for name in executions}
