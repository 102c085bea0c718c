"""`TimingBudget`: what the C between two moments of the kernel may take, and what it takes at most."""

from __future__ import annotations

from dataclasses import dataclass

from servogen.units import Cycles


@dataclass(frozen=True, slots=True)
class TimingBudget:
    """`between`: in words; `worst` is None where no bound is known."""

    between: str
    worst: Cycles | None
    room: Cycles

    @property
    def left(self) -> int | None:
        """Cycles; below 0 where the C may come too late."""
        return None if self.worst is None else self.room - self.worst

    def to_json(self) -> dict[str, object]:
        return {
            "between": self.between,
            "worst_cycles": self.worst,
            "room_cycles": self.room,
            "left_cycles": self.left,
        }
