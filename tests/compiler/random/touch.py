"""What the parts of an expression touch, so that no value depends on the order of evaluation.

In: reads and writes of whole objects, in the order in which the expression is made. Out: whether one more
is allowed: nothing is written that an unsequenced neighbour reads or writes (ISO C 6.5p2); calls count with
all that they reach, since the order of calls is open too (6.5.2.2p10).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from tests.compiler.random.program import Variable


@dataclass
class Touch:
    reads: set[Variable] = field(default_factory=set)
    writes: set[Variable] = field(default_factory=set)

    def copy(self) -> Touch:
        return Touch(set(self.reads), set(self.writes))

    def may_read(self, objects: Iterable[Variable]) -> bool:
        return self.writes.isdisjoint(objects)

    def may_write(self, objects: Iterable[Variable]) -> bool:
        objects = set(objects)
        return self.writes.isdisjoint(objects) and self.reads.isdisjoint(objects)

    def add(self, other: Touch) -> None:
        self.reads |= other.reads
        self.writes |= other.writes


BUS = Variable("bus", None, "global")  # type: ignore[arg-type]
"""Stands for the order of all stores to watched variables."""
CHECKSUM = Variable("checksum", None, "global")  # type: ignore[arg-type]
"""Stands for what `out` changes."""
