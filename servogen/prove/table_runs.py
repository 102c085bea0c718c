"""Runs of the chips of a state: a case split over what its tables say.

In: the start of a run, and the tables of the places that are split; the others stay unknown. Out:
`SplitRuns`, what the chips of the start do for every content of the bytes of the EEPROM that these tables
depend on.

Contents for which the split tables say the same are one *equivalence class*. It is run once, with these known
bytes; the run is a *row*. Every content is in a class and every class has a row, so every chip is covered. A
row holds for each start that agrees in the bytes that any row of its `RunTable` read, so starts share them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Set
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeVar

import numpy as np

from servogen.prove.chip import FIELD, MERGED, TIME_FIELDS, UNCERTAIN, AbstractChip, ChipState, Lanes
from servogen.prove.tables import (
    EEDATA,
    VALUES,
    ByteTable,
    Ints,
    Pairing,
    Place,
    UndecidedTrims,
    addresses_of,
    along,
    pairing_of,
    spread,
)
from servogen.prove.transitions import Ram, Rest
from servogen.prove.trim_pulses import Edges, PinEdges

Key = TypeVar("Key")
Split = Mapping[Place, ByteTable]
"""The places that are split, with their tables."""
MAX_CLASSES = (1, 1 << 16, 1 << 11)
"""By number of bytes that are split: equivalence classes of each, from one address. Classes of a pair are
numbered by both.
"""
CHUNK = 2048
"""Rows that are run at once: each needs 4 KB for a moment."""


class RunTable:
    """Runs that some starts share, as columns of one value for each row; `add` continues them."""

    def __init__(self, example: Ram) -> None:
        self.example = example
        """The RAM of one of the starts."""
        self.read: frozenset[int] = frozenset()
        self.cycles: Ints = np.zeros(0, dtype=np.int64)
        self.ram: dict[int, Ints] = {}
        """By place that is written, the cell at the end; -1 in rows that do not write it."""
        self.edges: dict[tuple[int, int], Ints] = {}
        """By pin and level, the cycle of the edge; -1 in rows without it."""
        self.rest: Rest = ()
        """A state beside the RAM that contains every row's end, but for the time."""
        self.fit = True
        """Whether every row reached a stop, by which nothing unknown had decided."""
        self.same_end = True
        """Whether there is such a `rest`."""
        self._row_of: Ints = np.zeros(0, dtype=np.int64)

    def rows_of(self, classes: Ints) -> Ints:
        """Return the row of each equivalence class; -1 where it has not been run."""
        room = int(classes.max()) + 1 - len(self._row_of)
        if room > 0:
            self._row_of = np.append(self._row_of, np.full(room, -1))
        return self._row_of[classes]

    def copied_for(self, example: Ram) -> RunTable:
        """Return the same rows for another start, which may add rows of its own."""
        second = copy(self)
        second.example, second._row_of = example, self._row_of.copy()
        return second

    def add(self, classes: Ints, lanes: Lanes) -> None:
        """Add the runs of equivalence classes."""
        before, count = len(self.cycles), len(classes)
        self._row_of[classes] = before + np.arange(count)
        self.cycles = np.concatenate([self.cycles, lanes.cycles])
        written = {int(place): lanes.ram[:, place] for place in np.flatnonzero((lanes.ram >= 0).any(axis=0))}
        self.ram = _continued(self.ram, written, before, count)
        self.edges = _continued(self.edges, lanes.edges, before, count)
        self.fit = self.fit and bool(lanes.fit.all())
        self.read |= frozenset(lanes.read)
        for rest in lanes.rests:
            self.rest = join_rests(self.rest, rest) if self.rest else rest
            self.same_end = self.same_end and bool(self.rest)


def _continued(
    columns: Mapping[Key, Ints], new: Mapping[Key, Ints], before: int, count: int
) -> dict[Key, Ints]:
    """Return columns of `before` rows with `count` rows more: -1 where a column says nothing."""
    nothing = np.full(before, -1), np.full(count, -1)
    return {
        name: np.concatenate([columns.get(name, nothing[0]), new.get(name, nothing[1])])
        for name in {**columns, **new}
    }


_LOOSE = {FIELD[name] for name in (*TIME_FIELDS, "INTCON", "INTCON_UNKNOWN")}
_MERGED = {FIELD[name]: UNCERTAIN[name] for name in MERGED}
_MASK_OF = {number: FIELD[row.unknown_name] for number, row in _MERGED.items()}


def join_rests(first: Rest, second: Rest) -> Rest:
    """Return a state beside the RAM that contains both, but for the time; () if they differ in more."""
    fields = list(first)
    differ = {n for n, (a, b) in enumerate(zip(first, second, strict=True)) if a != b} - _LOOSE
    for value, mask in _MASK_OF.items():
        if differ & {value, mask}:
            unknown = (first[mask] | second[mask] | first[value] ^ second[value]) & _MERGED[value].bits
            fields[mask], fields[value] = unknown, first[value] & ~unknown
            differ -= {value, mask}
    return () if differ else tuple(fields)


@dataclass
class _Memory:
    """The runs from starts that agree but for the RAM, where the same places are split."""

    read: frozenset[int] = frozenset()
    """Places that any of the runs read."""
    classes: dict[int, dict[bytes, int]] = field(default_factory=dict)
    """By byte of the EEPROM: what its tables say, numbered."""
    _tables: dict[tuple[int, ...], RunTable] = field(default_factory=dict)

    def table_from(self, ram: Ram) -> RunTable:
        """Return the runs that hold for a start with this RAM; none yet if it agrees with no other."""
        return self._tables.setdefault(self._key(ram), RunTable(ram))

    def keep(self, table: RunTable, read: Set[int]) -> None:
        """Keep runs that read these places; if that is more than others did, all get longer keys."""
        if not self.read >= read:
            self.read |= read
            self._tables = {self._key(known.example): known for known in self._tables.values()}
        self._tables[self._key(table.example)] = table

    def _key(self, ram: Ram) -> tuple[int, ...]:
        return tuple(ram[place] for place in sorted(self.read))

    def class_numbers(self, addresses: tuple[int, ...], tables: Collection[ByteTable]) -> Ints:
        """Return the equivalence class of each content or pair of contents. Raises UndecidedTrims."""
        most = MAX_CLASSES[len(addresses)]
        numbers = np.zeros((VALUES,) * len(addresses), dtype=np.int64)
        for axis, address in enumerate(addresses):
            columns = [table.values for table in tables if table.addresses == (address,)]
            known = self.classes.setdefault(address, {})
            told = np.stack(columns, axis=1).astype(np.uint8)
            classes = [known.setdefault(values.tobytes(), len(known)) for values in told]
            if len(known) > most:
                raise UndecidedTrims(f"byte {address} of the EEPROM makes too many different values")
            numbers = numbers * most + along(np.array(classes), axis, len(addresses))
        return numbers


@dataclass(frozen=True)
class SplitRuns:
    """What the chips of a start do, by contents of the bytes of the EEPROM that were split (see `tables`)."""

    start: Ram
    split: Split
    addresses: tuple[int, ...]
    """Of these bytes of the EEPROM."""
    table: RunTable
    rows: Ints
    """The row of each content."""

    @property
    def joinable(self) -> bool:
        """Return whether one state contains the ends of all rows; if not, there need not be all."""
        return self.table.fit and self.table.same_end

    @property
    def is_exact(self) -> bool:
        """Return whether no unknown bit decided, or was written to the RAM, in any row."""
        return self.table.fit and not any((column >= VALUES).any() for column in self.table.ram.values())

    @cached_property
    def pairing(self) -> Pairing:
        """Return what tables of two bytes at the end depend on."""
        return Pairing(self.table, self.rows)

    @cached_property
    def cycles(self) -> Ints:
        """Return how long the runs take."""
        return self.table.cycles[self.rows]

    @cached_property
    def edges(self) -> Edges:
        """Return the edges of each pin that has any."""
        columns = {key: column[self.rows] for key, column in self.table.edges.items()}
        present = {key: column for key, column in columns.items() if (column >= 0).any()}
        return {pin: PinEdges(present.get((pin, 1)), present.get((pin, 0))) for pin, _ in present}

    @cached_property
    def written(self) -> dict[int, Ints]:
        """Return the cells at the ends of each place in the RAM that some of the runs write."""
        written = {}
        for place, column in self.table.ram.items():
            cells = column[self.rows]
            unwritten = cells < 0
            if unwritten.all():
                continue
            if unwritten.any():
                split = self.split.get(place)
                before = np.array(self.start[place]) if split is None else spread(split, self.addresses)
                cells = np.where(unwritten, before, cells)
            written[place] = cells
        return written

    def paired(self) -> dict[Place, ByteTable]:
        """Return tables of two bytes, with one pairing, of the places to which every row of the table writes
        a known byte, not always the same.
        """
        return {
            place: ByteTable(self.addresses, column[self.rows], self.pairing)
            for place, column in self.table.ram.items()
            if ((column >= 0) & (column < VALUES)).all() and (column != column[0]).any()
        }


class TableRunner:
    """Runs a program up to the next of `stops`, for every content of the bytes that are split."""

    def __init__(self, chip: AbstractChip, stops: frozenset[int], limit: int) -> None:
        self.count = 0
        """Runs so far."""
        self.written: set[int] = set()
        """Places in the RAM that any of them has written."""
        self._chip, self._stops, self._limit = chip, stops, limit
        self._memories: dict[tuple[object, ...], _Memory] = {}
        self._often_split: dict[tuple[int, tuple[int, ...]], set[Place]] = {}

    def run(self, start: ChipState, split: Split) -> SplitRuns:
        """Return the runs from a start. Tables of two bytes are split only together, with one pairing."""
        addresses, pairing = addresses_of(split.values()), pairing_of(split.values())
        if addresses and not pairing:
            split = self._with_constants(start, addresses, split)
        split = dict(sorted(split.items(), key=lambda item: str(item[0])))
        # Which place depends on which byte belongs to the key: a class is what the tables of a byte say.
        depends = tuple((place, table.addresses) for place, table in split.items())
        key = start.rest, depends, pairing and pairing.table
        memory = self._memories.setdefault(key, _Memory())
        # With a pairing, the rows of the earlier runs are the classes: they determine what the tables say.
        classes = pairing.rows if pairing else memory.class_numbers(addresses, split.values())
        table = memory.table_from(start.ram)
        missing = np.flatnonzero(table.rows_of(classes) < 0)
        if table.fit and len(missing):
            new, first = np.unique(classes.ravel()[missing], return_index=True)
            contents = missing[first]
            columns = [spread(each, addresses).ravel()[contents] for each in split.values()]
            values = np.array(columns, dtype=np.int64).reshape(len(split), len(new)).T.copy()
            table = self._extended(table, memory, start, (*split,), new, values)
        return SplitRuns(start.ram, split, addresses, table, table.rows_of(classes))

    def _with_constants(self, start: ChipState, addresses: tuple[int, ...], split: Split) -> Split:
        """Return also what is constant here but is split in other frames: then the frames share rows."""
        often = self._often_split.setdefault((start["PC"], addresses), set())
        constants = {
            place: ByteTable(addresses[:1], np.full(VALUES, start.ram[int(place)]))
            for place in often - {*split, EEDATA}
            if start.ram[int(place)] < VALUES
        }
        often |= {*split}
        return {**split, **constants}

    def _extended(
        self,
        table: RunTable,
        memory: _Memory,
        start: ChipState,
        places: tuple[Place, ...],
        new: Ints,
        values: Ints,
    ) -> RunTable:
        """Return the runs with those of new equivalence classes, which have `values` in `places`.

        Other starts no longer share it if these runs read a byte in which they differ.
        """
        batches = []
        for begin in range(0, len(new), CHUNK):
            part = slice(begin, begin + CHUNK)
            lanes = self._chip.run_lanes(start, places, values[part], self._stops, self._limit)
            batches.append((new[part], lanes))
            self.count += len(values[part])
            if not lanes.fit.all():
                break
        read = {place for _, lanes in batches for place in lanes.read} - {*places}
        if any(table.example[place] != start.ram[place] for place in read):
            table = table.copied_for(start.ram)
        for classes, lanes in batches:
            table.add(classes, lanes)
        self.written |= {*table.ram}
        memory.keep(table, read)
        return table
