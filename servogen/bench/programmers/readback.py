"""What a programmer reads back from a chip, and where that first differs from the file.

In: the HEX files that the programmers' programs write, each in its own way. Out: `Contents`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from operator import ne
from pathlib import Path

from servogen.pic.device import EEPROM_BYTES
from servogen.pic.image import Image, from_hex
from servogen.pic.isa import WORD_MASK

PROGRAM, EEPROM, CONFIG = "program memory", "data EEPROM", "configuration word"
ERASED_BYTE = 0xFF

Contents = Mapping[str, Sequence[int]]
"""Of each memory that was read all words or bytes, from address 0."""


@dataclass(frozen=True, slots=True)
class Look:
    """One way to read: `arguments` for the programmer's program, and the contents of the file that it
    writes.
    """

    arguments: tuple[str, ...]
    contents: Callable[[Path, Image], Contents]
    of_protected: bool = False
    """Whether it reads the same of a chip whose code is protected."""


def wanted(image: Image) -> Contents:
    """Return the contents of a chip programmed with `image`."""
    contents: dict[str, Sequence[int]] = {
        PROGRAM: image.flash(),
        EEPROM: [image.eeprom.get(address, ERASED_BYTE) for address in range(EEPROM_BYTES)],
    }
    if image.config is not None:
        contents[CONFIG] = [image.config & WORD_MASK]
    return contents


def difference(read: Contents, image: Image) -> str | None:
    """Return where `read` first differs from `image`, in words; None if it does not."""
    for memory, right in wanted(image).items():
        for address, (word, got) in enumerate(zip(right, read.get(memory, right), strict=True)):
            if word != got:
                at = "" if memory == CONFIG else f" at address 0x{address:03X}"
                digits = 2 if memory == EEPROM else 4
                return f"in the {memory}{at}: 0x{got:0{digits}X} where the file has 0x{word:0{digits}X}"
    return None


def program_of(file: Path, image: Image) -> Contents:
    """Return the contents of a HEX file of the program memory alone."""
    return {PROGRAM: _image(file).flash()}


def whole_of(file: Path, image: Image) -> Contents:
    """Return the contents of a HEX file of all memories; missing parts were not read."""
    read = _image(file)
    contents = wanted(read)
    return contents if read.eeprom else {name: words for name, words in contents.items() if name != EEPROM}


def picpro_eeprom(file: Path, image: Image) -> Contents:
    """Return picpro's bytes from address 0. Version 0.3.0 swaps the bytes of each pair, so the order in which
    fewer bytes differ is used.
    """
    data = _bytes(file)
    right = wanted(image)[EEPROM]
    swapped = [byte for pair in zip(data[1::2], data[::2], strict=True) for byte in pair]
    return {EEPROM: min(swapped, data, key=lambda order: sum(map(ne, order, right)))}


def picpro_config(file: Path, image: Image) -> Contents:
    """Return a K150's answer, as `picpro_here` has it written: device ID, eight ID bytes, words, low byte
    first.
    """
    data = _bytes(file)
    return {CONFIG: [int.from_bytes(data[10:12], "little") & WORD_MASK]}


def _image(file: Path) -> Image:
    return from_hex(file.read_text(encoding="ascii"), str(file))


def _bytes(file: Path) -> list[int]:
    from intelhex import IntelHex

    return list(IntelHex(str(file)).tobinarray())
