"""`Firmware`: one dialect's C and its compilation; `TimingBudget`; `ResourceError` if it does not fit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from servogen.engines.stored_script import Stored
from servogen.errors import Diagnostic, ServogenError
from servogen.units import Cycles

if TYPE_CHECKING:
    from servogen.answers import RoomAnswer
    from servogen.compiler import Compilation  # planning a motion does not load the compiler


DIALECTS = ("c2c", "xc8", "sdcc")
"""The C dialects that every engine generates."""


class ResourceError(ServogenError):
    """A motion that can be planned but that its engine cannot fit on the chip."""


@dataclass(frozen=True, slots=True)
class Firmware:
    """One dialect's C file and its compilation."""

    dialect: str
    file: str
    text: str
    compilation: Compilation
    timing_budgets: tuple[TimingBudget, ...] = ()
    """The budgets of the C between the pulses."""
    overrun: int | None = None
    """The address of the byte whose bit 0 is set once the C takes too long; None if the engine has none."""
    warnings: tuple[Diagnostic, ...] = ()
    script: Stored | None = None
    """Where the script of the motion is; None for engines without one."""


@dataclass(frozen=True, slots=True)
class TimingBudget:
    """The time available to the C between two moments, named by `between`; `worst` is None if unbounded."""

    between: str
    worst: Cycles | None
    room: Cycles
    """The maximum number of cycles that the C of any compiler may take without affecting the edges."""
    seen: Cycles | None = None
    """The maximum number of cycles for which a late end is recorded; None if it always is."""

    @property
    def left(self) -> int | None:
        """Return the cycles to spare, negative if the C may be late; None if there is no bound."""
        return None if self.worst is None else self.room - self.worst

    def to_json(self) -> RoomAnswer:
        """Return the budget as a value that JSON can hold."""
        return {
            "between": self.between,
            "worst_cycles": self.worst,
            "room_cycles": self.room,
            "left_cycles": self.left,
            "late_is_seen_up_to_cycles": self.seen,
        }
