"""`Overheads`: the cycles that a compiler's code takes between two edges in addition to the delays.

In: the cycles measured on one rendering. Out: a frozen table that the next rendering subtracts from its
delays.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType


@dataclass(frozen=True, slots=True)
class DelayPath:
    """A path through the program from one edge to the next that has its own delay.

    `kind` is "start" (from reset to the first edge), "in" (inside a frame, after its edge `edge`),
    "again" (from a frame to the same frame again), "turn" (from a call of step `owner` to its next call)
    or "after" (from step `owner` to the next one).
    """

    kind: str
    owner: int = 0
    edge: int = 0


START = DelayPath("start")


@dataclass(frozen=True, slots=True)
class Overheads:
    """Cycles by path; a path that was not measured yet costs 0."""

    cycles: Mapping[DelayPath, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "cycles", MappingProxyType(dict(self.cycles)))

    def of(self, path: DelayPath) -> int:
        return self.cycles.get(path, 0)
