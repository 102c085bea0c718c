"""The disassembler: translates an `Image` to assembly that assembles to the same image.

In: the contents of a chip. Out: MPASM source with labels for jump targets, the names of registers and bits,
the configuration word, ID words and data EEPROM. A word that the data sheet does not define, or whose ignored
bits differ from what assemblers write, becomes a `dw` with a comment, so that nothing is lost.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

from servogen.pic.device import (
    CONFIG_OSCILLATOR_MASK,
    CONFIG_POWER_UP_TIMER_OFF,
    CONFIG_WATCHDOG_ON,
    EEPROM_ADDRESS,
    ERASED_WORD,
    ID_ADDRESS,
    ID_WORDS,
    INTERRUPT_VECTOR,
    OSCILLATORS,
    PROGRAM_WORDS,
    RESET_VECTOR,
    Device,
)
from servogen.pic.image import Image
from servogen.pic.isa import decode
from servogen.pic.spelling import assembly_text, is_exact, other_bank

VECTORS = {RESET_VECTOR: "reset", INTERRUPT_VECTOR: "interrupt"}
COMMENT_COLUMN = 40
"""Where comments begin: behind the longest usual instruction with its label."""


def disassemble(image: Image, device: Device) -> str:
    """Return the source of an image. The same image always gives the same text."""
    labels = _labels(image)
    sections = [
        _heading(image, device),
        _configuration(image),
        _program(image.program, labels),
        _ids(image.ids),
        _eeprom(image.eeprom),
        ["        end"],
    ]
    return "\n".join(line for section in sections for line in section) + "\n"


def code_protected(config: int | None, device: Device) -> bool:
    """Return whether the configuration word protects the code: any of its protection bits is 0 (DS35007
    section 6.1).
    """
    return config is not None and config & device.code_protect_mask != device.code_protect_mask


def _heading(image: Image, device: Device) -> list[str]:
    name = device.short_name.lower()
    rows = [
        f"; {device.name}: {image.words} of {PROGRAM_WORDS} program words",
        "; registers have their bank 0 names; the comment says what they are when RP0 is 1",
    ]
    if code_protected(image.config, device):
        rows.append("; CODE PROTECTED: once programmed, the chip does not let this program be read back")
    return [*rows, "", f"        list p={name}", f"        include <p{name}.inc>", "        radix hex", ""]


def _configuration(image: Image) -> list[str]:
    if image.config is None:
        return []
    oscillator = next(
        name for name, bits in OSCILLATORS.items() if bits == image.config & CONFIG_OSCILLATOR_MASK
    )
    meaning = [
        f"{oscillator} oscillator",
        f"watchdog {'on' if image.config & CONFIG_WATCHDOG_ON else 'off'}",
        f"power-up timer {'off' if image.config & CONFIG_POWER_UP_TIMER_OFF else 'on'}",
    ]
    return [_commented(f"        __config 0x{image.config:04X}", ", ".join(meaning)), ""]


def _labels(image: Image) -> dict[int, str]:
    """Return names for the targets of CALL and GOTO where there is a word."""
    targets: dict[int, str] = {}
    for word in image.program.values():
        decoded = decode(word)
        if decoded is None or not decoded.instruction.has_target:
            continue
        address = decoded.k
        if address in image.program:
            called = decoded.instruction.flow == "call" or targets.get(address, "").startswith("sub")
            targets[address] = f"{'sub' if called else 'at'}_{address:03x}"
    named = {
        address: name
        for address, name in VECTORS.items()
        if image.program.get(address, ERASED_WORD) != ERASED_WORD
    }
    return dict(sorted((targets | named).items()))


def _program(program: Mapping[int, int], labels: Mapping[int, str]) -> Iterator[str]:
    def target(address: int) -> str:
        return labels.get(address, f"0x{address:03X}")

    for start, words in _runs(program):
        yield f"        org 0x{start:03X}"
        address = start
        while address < start + len(words):
            word = words[address - start]
            count = _repeated(words[address - start :], address, labels)
            if address in labels:
                yield f"{labels[address]}:"
            if count >= FILL_FROM:
                yield _commented(f"        fill 0x{word:04X}, 0x{count:X}", _reason(word))
                address += count
            else:
                yield _instruction(word, target)
                address += 1
        yield ""


FILL_FROM = 8
"""The minimum number of equal words, none of them an instruction, that become one `fill`."""


def _repeated(words: Sequence[int], address: int, labels: Mapping[int, str]) -> int:
    """Return how many consecutive words from here are equal and neither instructions nor labelled; at least
    1.
    """
    if is_exact(words[0]):
        return 1
    count = 1
    while count < len(words) and words[count] == words[0] and address + count not in labels:
        count += 1
    return count


def _instruction(word: int, target: Callable[[int], str]) -> str:
    if not is_exact(word):
        return _commented(f"        dw 0x{word:04X}", _reason(word))
    decoded = decode(word)
    bank1 = other_bank(decoded.f) if decoded and "f" in decoded.instruction.operands else None
    text = f"        {assembly_text(word, target)}"
    return _commented(text, bank1) if bank1 else text


def _reason(word: int) -> str:
    """Return the reason why a word is not written as an instruction."""
    if word == ERASED_WORD:
        return f"erased, executes as {assembly_text(word)}"
    if decode(word) is None:
        return "not defined by the data sheet"
    return f"executes as {assembly_text(word)}, with bits that the chip ignores"


def _ids(ids: Mapping[int, int]) -> Iterator[str]:
    if len(ids) == ID_WORDS and all(word <= 0xF for word in ids.values()):
        digits = "".join(f"{ids[number]:X}" for number in range(ID_WORDS))
        yield f"        __idlocs 0x{digits}"
        yield ""
        return
    for start, words in _runs(ids):
        yield f"        org 0x{ID_ADDRESS + start:04X}"
        yield _commented("        dw " + ", ".join(f"0x{word:04X}" for word in words), "ID words")
        yield ""


def _eeprom(eeprom: Mapping[int, int]) -> Iterator[str]:
    for start, values in _runs(eeprom):
        yield _commented(f"        org 0x{EEPROM_ADDRESS + start:04X}", f"data EEPROM from 0x{start:02X}")
        for row in range(0, len(values), 8):
            yield "        de " + ", ".join(f"0x{value:02X}" for value in values[row : row + 8])
        yield ""


def _runs(words: Mapping[int, int]) -> Iterator[tuple[int, list[int]]]:
    """Yield the first address and the values of each stretch without a gap."""
    stretch: list[int] = []
    for address in sorted(words):
        if stretch and address != stretch[-1] + 1:
            yield stretch[0], [words[address] for address in stretch]
            stretch = []
        stretch.append(address)
    if stretch:
        yield stretch[0], [words[address] for address in stretch]


def _commented(line: str, comment: str) -> str:
    return f"{line:<{COMMENT_COLUMN}}; {comment}"
