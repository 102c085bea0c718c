"""Where a player's script is: in flash, or, if flash cannot hold the program, in the data EEPROM too.

In: a script and the number of channels, whose trims are the first bytes of the EEPROM. Out: `Stored`.

    EEPROM   | trims, one per channel | the last bytes of the script |
    flash    the bytes of the script before them, if any
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from servogen.pic.device import EEPROM_BYTES

if TYPE_CHECKING:
    from servogen.answers import ScriptAnswer


@dataclass(frozen=True, slots=True)
class Stored:
    """A script: its bytes in flash, and those that follow them in the EEPROM, from byte `first` on."""

    flash: bytes
    eeprom: bytes = b""
    first: int = 0

    @property
    def size(self) -> int:
        """Return the number of bytes of the script."""
        return len(self.flash) + len(self.eeprom)

    @property
    def offset(self) -> int:
        """Return what the chip adds to a place in the script for the address in the EEPROM, modulo 256."""
        return (self.first - len(self.flash)) & 0xFF

    @property
    def text(self) -> str:
        """Return where the script is, in words."""
        if not self.eeprom:
            return f"{self.size} bytes in flash"
        last = self.first + len(self.eeprom) - 1
        beside = f"{len(self.flash)} bytes in flash, " if self.flash else ""
        return f"{beside}{len(self.eeprom)} bytes in the EEPROM, bytes {self.first} to {last}"

    def to_json(self) -> ScriptAnswer:
        """Return the places as a value that JSON can hold."""
        return {
            "flash_bytes": len(self.flash),
            "eeprom_bytes": len(self.eeprom),
            "eeprom_first": self.first if self.eeprom else None,
        }


def eeprom_room(channels: int) -> int:
    """Return the bytes of the EEPROM that trims leave to a script."""
    return EEPROM_BYTES - channels


def in_flash(script: bytes) -> Stored:
    """Return a script in flash."""
    return Stored(script)


def in_eeprom(script: bytes, channels: int) -> Stored:
    """Return a script whose last bytes, as many as there is room for, are in the EEPROM."""
    cut = max(0, len(script) - eeprom_room(channels))
    return Stored(script[:cut], script[cut:], channels)
