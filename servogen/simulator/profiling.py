"""Where a program spends its cycles, and which of its words and lines it ever executed.

In: a machine, a number of cycles, the program's `Listing`. Out: a `Profile`.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from servogen.pic.listing import Listing
from servogen.simulator.machine import Machine, Observation
from servogen.units import Cycles


@dataclass(frozen=True, slots=True)
class Spent:
    """What one word, line or function cost: how often its instructions were executed, and their cycles."""

    executions: int
    cycles: Cycles


@dataclass(frozen=True, slots=True)
class Profile:
    """Cycles by address, by source line and by function; what is in no function is under ""."""

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
        """The executed part of the program's words, 0 to 1."""
        total = len(self.words) + len(self.unexecuted)
        return len(self.words) / total if total else 1.0


def profile(machine: Machine, cycles: int, listing: Listing | None = None) -> Profile:
    """Run `machine` for `cycles`, counting; stack and RAM figures are since power-up."""
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
