"""What speaks against programming an image, and what its owner should know before it is done."""

from __future__ import annotations

from servogen.pic.device import CONFIG_WATCHDOG_ON, Device
from servogen.pic.image import Image
from servogen.pic.isa import decode

CLEARS_WATCHDOG = ("CLRWDT", "SLEEP")
"""DS35007 section 6.10: both clear it; a program with neither is reset for ever."""


def objections(image: Image) -> tuple[str, ...]:
    """Reasons not to program `image`."""
    found = []
    if not image.words:
        found.append("the image has no program")
    if image.config is None:
        found.append("the image has no configuration word: oscillator and watchdog would be left to chance")
    elif image.config & CONFIG_WATCHDOG_ON and not _clears_watchdog(image):
        found.append("the watchdog is on, and the program never clears it: the chip would be reset for ever")
    return tuple(found)


def remarks(image: Image, device: Device) -> tuple[str, ...]:
    """What programming it means."""
    found = []
    if device.name == "PIC16F84":
        found.append(
            "the PIC16F84 has no device ID: no programmer can tell whether this is the chip in the socket"
        )
    if protected(image, device):
        found.append("code protection is on: the chip cannot be read again, only erased")
    return tuple(found)


def protected(image: Image, device: Device) -> bool:
    mask = device.code_protect_mask
    return image.config is not None and image.config & mask != mask


def _clears_watchdog(image: Image) -> bool:
    found = (decode(word) for word in image.program.values())
    return any(each is not None and each.instruction.mnemonic in CLEARS_WATCHDOG for each in found)
