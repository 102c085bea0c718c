"""`ProgramNames`: what a file beside a HEX says of the program, in the terms of all formats.

In: what a reader of one format found. Out: a value that can be compared with the words of the HEX.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from servogen.errors import InputError, Location
from servogen.pic.device import PROGRAM_WORDS, RAM_FIRST, RAM_LAST

MIRROR = 0x80
"""Bank 1 shows the same bytes of RAM (DS35007 section 2.2)."""
NAME_BYTES = 1000
"""The longest name that is read."""


@dataclass(frozen=True, slots=True)
class ProgramNames:
    """The names and lines of one program. Addresses are of words in the program and of bytes in RAM."""

    words: Mapping[int, int | None]
    """The words of the program by address; None where the file says only that there is a word."""
    labels: tuple[tuple[str, int], ...] = ()
    functions: tuple[tuple[str, int, int], ...] = ()
    """(name, start, end) of functions whose ends the file states."""
    variables: tuple[tuple[int, str, int], ...] = ()
    """(address, name, bytes)."""
    lines: Mapping[int, tuple[str, int]] = field(default_factory=dict)
    """(source file, line) of an address at which the code of a line begins."""


def damaged(file: str, problem: str, line: int | None = None) -> InputError:
    return InputError("names-damaged", problem, Location(file, line))


def in_ram(address: int) -> int | None:
    """Return the address in bank 0 of a byte of RAM; None for a register and whatever else is no RAM."""
    address &= ~MIRROR
    return address if RAM_FIRST <= address <= RAM_LAST else None


def by_address(labels: Iterable[tuple[str, int]]) -> tuple[tuple[str, int], ...]:
    """Return labels in the order of their addresses, those of one address in that of their names."""
    return tuple(sorted(labels, key=lambda label: (label[1], label[0])))


def words_from(start: int, content: bytes) -> dict[int, int]:
    """Return the words of the program in `content`, two bytes each, the low one first, by their addresses."""
    count = min(len(content) // 2, max(PROGRAM_WORDS - start, 0))
    return {
        start + index: int.from_bytes(content[2 * index : 2 * index + 2], "little") for index in range(count)
    }


def text_at(raw: bytes, at: int) -> str:
    """Return a text that ends with a byte of 0."""
    return raw[at : at + NAME_BYTES].partition(b"\0")[0].decode("latin-1")


def sized(
    found: Iterable[tuple[int, str]], sections: Iterable[range], marks: Iterable[int] = ()
) -> tuple[tuple[int, str, int], ...]:
    """Return variables with sizes: each extends to the next variable or mark in its section, or to the end of
    the section. One that lies in no section counts as one byte.
    """
    known = sorted(set(found))
    addresses = {address for address, _ in known}
    bounds, spans = addresses | set(marks), tuple(sections)
    sizes = {}
    for address in addresses:  # at most one for each byte of RAM, however many names there are
        stop = next((span.stop for span in spans if address in span), address + 1)
        sizes[address] = min((bound for bound in bounds if address < bound < stop), default=stop) - address
    return tuple((address, name, sizes[address]) for address, name in known)
