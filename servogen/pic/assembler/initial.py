"""Initialised data, IDATA: its bytes in the program, and the table by which the program copies them.

In: the sections of all sources. Out: sections of code for gplink's copies, `NAME_i`, and its table, `_cinit`,
of which each byte is a RETLW. The table has the number of sections; then for each the address of its copy,
its own address and its size, in two bytes each, the low one first.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from servogen.pic.assembler.sections import Section, Sections, groups_of
from servogen.pic.assembler.source import SourceLine

TABLE = ".cinit"
TABLE_SYMBOL = "_cinit"


class InitialData:
    """The copies and the table; nothing if no source has initialised data."""

    def __init__(self, sources: Sequence[Sections]) -> None:
        self.sections = Sections()
        sections = (section for each in sources for section in each if section.kind == "idata")
        self._groups = [group for group in groups_of(sections) if any(section.size for section in group)]
        if self._groups:
            self._table = self.sections.open(TABLE, "code", None, self._groups[0][0].place)
            self._table.size = 2 + 6 * len(self._groups)
            self._copies = [
                Section(
                    f"{first.name}_i", "code", None, first.place, sum(each.size for each in (first, *more))
                )
                for first, *more in self._groups
            ]
            for group, copy in zip(self._groups, self._copies, strict=True):
                group[0].copy = copy

    def symbols(self) -> dict[str, int]:
        """Return the name of the table, once it has its address."""
        return {TABLE_SYMBOL: self._table.base} if self._groups else {}

    def bytes(self) -> Iterator[tuple[int, int, SourceLine]]:
        """Yield the address of each RETLW, its byte and the line that it is of."""
        if not self._groups:
            return
        numbers = [len(self._groups)]
        for group, copy in zip(self._groups, self._copies, strict=True):
            numbers += [copy.base, group[0].base, copy.size]
            data = [each for section in group for each in section.data]
            for offset, (byte, line) in enumerate(data):
                yield copy.base + offset, byte, line
        line = next(line for group in self._groups for section in group for _, line in section.data)
        for offset, byte in enumerate(b"".join(number.to_bytes(2, "little") for number in numbers)):
            yield self._table.base + offset, byte, line
