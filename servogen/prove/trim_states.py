"""States that stand for the chips of every content of the EEPROM, and the one state at the end of their runs.

In: a state, and what its chips do for every content (`SplitRuns`). Out: one state at the end. A state is
every combination of a content of the EEPROM, one of its times, and values of what is unknown. To join chips
to one state is sound because it only adds combinations: a content with a time of another one, or, where a
table is dropped, any value of its byte.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from servogen.prove.chip import ALL_UNKNOWN, CELL_PHASED, FIELD, FREE_BYTES, UNCERTAIN, ChipState
from servogen.prove.table_runs import SplitRuns
from servogen.prove.tables import VALUES, ByteTable, Place, UndecidedTrims, table_of
from servogen.prove.transitions import Ram, Rest
from servogen.prove.trim_pulses import NOT_BEGUN, Position
from servogen.simulator import layout


@dataclass(frozen=True, eq=False)
class TrimState:
    """All chips at one address, whatever the EEPROM holds."""

    ram: Ram
    rest: Rest
    tables: Mapping[Place, ByteTable] = field(default_factory=dict)
    """Of EEDATA, and of bytes that are unknown in `ram`: what they are for each content."""
    times: tuple[int, ...] = (0,)
    """How many cycles later than `rest` and `position` say the chips come, in order; the first is 0."""
    position: Position = NOT_BEGUN
    silent: int = 0
    """How many cuts it has passed before the first pulse."""

    @property
    def pc(self) -> int:
        """Return the address of the next instruction."""
        return self.rest[FIELD["PC"]] & 0x3FF

    @property
    def chip(self) -> ChipState:
        """Return the chips of the first time, with unknown bytes in place of tables."""
        return ChipState(self.ram, self.rest)

    @property
    def key(self) -> object:
        """Return what is the same only for states that stand for the same chips."""
        tables = frozenset((p, table.addresses, table.values.tobytes()) for p, table in self.tables.items())
        return self.ram, self.rest, self.times, self.position, self.silent, tables

    def undecided(self, why: str) -> UndecidedTrims:
        """Return the error that says why the proof does not go on here."""
        return UndecidedTrims(f"{why} (address 0x{self.pc:03X}, frame {self.position.frame})")

    def is_vague(self, place: int) -> bool:
        """Return whether nothing is known of a byte of the RAM."""
        return self.ram[place] == ALL_UNKNOWN and place not in self.tables

    def joined(self, runs: SplitRuns) -> TrimState:
        """Return the state with the RAM at the ends of the runs."""
        ram, tables = list(self.ram), dict(self.tables)
        new: dict[Place, ByteTable] = {}
        for place, cells in runs.written.items():
            tables.pop(place, None)
            ram[place] = int(cells.flat[0])
            if (cells != ram[place]).any():
                ram[place] = ALL_UNKNOWN
                if (cells < VALUES).all():
                    new[place] = table_of(cells, runs.addresses, runs.pairing)
        # Where one table is of two bytes, all become so: places can be split together with one pairing only.
        if any(table.pairing for table in new.values()):
            new = runs.paired()
            for paired in new:
                ram[int(paired)] = ALL_UNKNOWN
                tables.pop(paired, None)
        return replace(self, ram=tuple(ram), tables=tables | new)

    def completed(self, runs: SplitRuns) -> TrimState:
        """Return the state with the bytes that are vague, but known after other runs of its chips."""
        ram, tables = list(self.ram), dict(self.tables)
        for place, cells in runs.written.items():
            if self.is_vague(place) and (cells < VALUES).all():
                if (cells == cells[0]).all():
                    ram[place] = int(cells[0])
                else:
                    tables[place] = ByteTable(runs.addresses, cells)
        return replace(self, ram=tuple(ram), tables=tables)

    def with_own_phase(self) -> TrimState:
        """Return the same state, but φ is the first byte that moves with TMR0: then frames share runs."""
        first = next((cell & 0xFF for cell in self.ram if cell >= CELL_PHASED), 0)
        if not first or self.rest[FIELD["TMR0_UNKNOWN"]] != layout.PHASED:
            return self
        ram = tuple((cell - first & 0xFF) | CELL_PHASED if cell >= CELL_PHASED else cell for cell in self.ram)
        rest = list(self.rest)
        for name in FREE_BYTES:
            if rest[FIELD[UNCERTAIN[name].unknown_name]] == layout.PHASED:
                rest[FIELD[name]] = rest[FIELD[name]] - first & 0xFF
        return replace(self, ram=ram, rest=tuple(rest))
