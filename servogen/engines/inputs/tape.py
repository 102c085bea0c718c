"""A serial EEPROM beside the chip that holds the motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from servogen.errors import Location

SDA = "RA4"
"""The chip's open drain (DS35007 section 4.1), as the bus asks for one."""
RELEASE, HOLD = "release", "hold"


@dataclass(frozen=True, slots=True)
class Tape:
    """The EEPROM and its clock's pin; what happens to the pulses when it cannot be read."""

    kind: ClassVar[str] = "a tape"

    eeprom: str = "24LC256"
    scl: str = "RA3"
    on_error: str = RELEASE
    """RELEASE: no more pulses; HOLD: the last widths are held."""
    error_pin: str | None = None
    """The pin that goes high then."""
    place: Location | None = None

    @property
    def pins(self) -> dict[str, str]:
        """Return what is on the pins that it takes."""
        error = {self.error_pin: "the tape's error pin"} if self.error_pin else {}
        return {self.scl: "SCL", SDA: "SDA", **error}
