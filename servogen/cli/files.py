"""What commands read: source texts and HEX images, with an error that names the file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from servogen.errors import InputError, Place

if TYPE_CHECKING:
    from servogen.pic.image import Image
    from servogen.pulse import PulseSchedule


def read_source(path: Path) -> str:
    """A text file; old editors' code pages are taken as Latin-1. Raises InputError."""
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", Place(str(path))) from error
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def read_image(path: Path) -> Image:
    """The image in a HEX file. Raises InputError."""
    from servogen.pic.image import from_hex

    return from_hex(read_source(path), str(path))


def read_schedule(path: Path) -> PulseSchedule:
    """The schedule in a schedule.json. Raises InputError."""
    from servogen.pulse import from_json

    return from_json(read_source(path), str(path))
