"""The words that a source places: program, ID words, configuration word and data EEPROM by word address.

In: addresses and words as the assembler meets them. Out: an `Image`.
"""

from __future__ import annotations

from servogen.pic.assembler.messages import SourceError
from servogen.pic.device import ERASED_WORD
from servogen.pic.image import REGIONS, Image, image_of, region_of


class Memory:
    def __init__(self) -> None:
        self._words: dict[int, int] = {}

    def put(self, address: int, word: int) -> None:
        """Place a word. Raises SourceError if the chip has no such address, or it is already used."""
        part = region_of(address)
        if part is None:
            raise SourceError(
                "asm-address-range",
                f"address 0x{address & 0xFFFFFFFF:04X} is beyond the chip",
                hint="words are " + ", ".join(f"{region.name} {region.span}" for region in REGIONS),
            )
        if address in self._words:
            raise SourceError(
                "asm-overwrite", f"address 0x{address:04X} holds 0x{self._words[address]:04X} already"
            )
        self._words[address] = word & part.largest

    def change(self, address: int, mask: int, bits: int) -> None:
        """Set some bits of a word that is initially erased."""
        self._words[address] = self._words.get(address, ERASED_WORD) & ~mask | bits

    def image(self) -> Image:
        return image_of(self._words)
