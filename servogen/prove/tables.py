"""Bytes that depend on the EEPROM's, as tables, and the runs for each value in them.

In: tables, and the outcomes of runs, one row for each combination of what tables say. Out: `RunTable`, from
which another table is read off; `RunMemory`, which finds the runs of all states that agree in what runs read.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from copy import copy
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from servogen.prove.chip import FIELD, MERGED, TIME_FIELDS, UNCERTAIN, Lanes
from servogen.prove.transitions import Ram, Rest

Ints = npt.NDArray[np.int64]
Key = TypeVar("Key")
VALUES = 256
"""Values of a byte of the EEPROM."""
CLASSES = (1, 1 << 16, 1 << 11)
"""How many different values a byte's tables may have in the runs from one address, alone or in a pair."""


class UndecidedTrims(Exception):
    """The proof for any EEPROM does not reach so far; the text says why."""


@dataclass(frozen=True, eq=False)
class ByteTable:
    """A byte for each value of one byte of the EEPROM, or for each pair of values of two."""

    cells: tuple[int, ...]
    """Which bytes of the EEPROM."""
    values: Ints
    source: RunTable | None = None
    rows: Ints | None = None
    """Of two bytes: the runs that made it, and the row of the run for each pair."""


class RunTable:
    """The runs from one state, by what tables say: one row for each combination that has been run."""

    def __init__(self, example: Ram, classes: int) -> None:
        self.example = example
        self.row_of = np.full(classes, -1, dtype=np.int32)
        self.read: frozenset[int] = frozenset()
        self.cycles = np.zeros(0, dtype=np.int64)
        self.ram: dict[int, Ints] = {}
        self.edges: dict[tuple[int, int], Ints] = {}
        self.rest: Rest = ()
        self.fit = True
        self.same_end = True
        """Whether all runs end in the same state, apart from the RAM and the time."""

    def copied_for(self, example: Ram) -> RunTable:
        """Return the same runs for another RAM, which may have more of its own."""
        second = copy(self)
        second.example, second.row_of = example, self.row_of.copy()
        second.ram, second.edges = dict(self.ram), dict(self.edges)
        return second

    def varying_places(self) -> list[int]:
        """Return the places in the RAM that all runs write, with known values that are not all the same."""
        return [
            place
            for place, column in self.ram.items()
            if ((column >= 0) & (column < VALUES)).all() and (column != column[0]).any()
        ]

    def add(self, classes: Ints, lanes: Lanes) -> None:
        """Note the runs of `classes`."""
        before = len(self.cycles)
        self.row_of[classes] = before + np.arange(len(classes))
        self.cycles = np.concatenate([self.cycles, lanes.cycles])
        written = {int(place): lanes.ram[:, place] for place in np.flatnonzero((lanes.ram >= 0).any(axis=0))}
        self.ram = _appended(self.ram, written, before, len(classes))
        self.edges = _appended(self.edges, lanes.edges, before, len(classes))
        self.fit = self.fit and bool(lanes.fit.all())
        self.read |= frozenset(lanes.read)
        for rest in lanes.rests:
            self.rest = join_rests(self.rest, rest) if self.rest else rest
            self.same_end = self.same_end and bool(self.rest)


def _appended(
    columns: Mapping[Key, Ints], new: Mapping[Key, Ints], before: int, count: int
) -> dict[Key, Ints]:
    """Return columns of `before` rows continued with `count` rows: -1 where a column says nothing."""
    nothing = np.full(before, -1, dtype=np.int64), np.full(count, -1, dtype=np.int64)
    return {
        name: np.concatenate([columns.get(name, nothing[0]), new.get(name, nothing[1])])
        for name in {**columns, **new}
    }


_LOOSE = {FIELD[name] for name in (*TIME_FIELDS, "INTCON", "INTCON_UNKNOWN")}
_BYTES = {FIELD[name]: FIELD[UNCERTAIN[name].unknown_name] for name in MERGED}
_MASKS = {mask: value for value, mask in _BYTES.items()}
_BITS = {FIELD[name]: UNCERTAIN[name].bits for name in MERGED}


def join_rests(first: Rest, second: Rest) -> Rest:
    """Return a state beside the RAM that contains both, but for the time; () if they differ in more."""
    if first == second:
        return first
    cells = list(first)
    for number, (a, b) in enumerate(zip(first, second, strict=True)):
        if a == b or number in _LOOSE:
            continue
        if number not in _BYTES and number not in _MASKS:
            return ()
        value, mask = (number, _BYTES[number]) if number in _BYTES else (_MASKS[number], number)
        unknown = (first[mask] | second[mask] | first[value] ^ second[value]) & _BITS[value]
        cells[mask], cells[value] = unknown, first[value] & ~unknown
    return tuple(cells)


@dataclass
class RunMemory:
    """The runs from the states that agree in everything that they read."""

    read: frozenset[int] = frozenset()
    found: dict[tuple[int, ...], RunTable] = field(default_factory=dict)
    classes: dict[int, dict[bytes, int]] = field(default_factory=dict)
    """By byte of the EEPROM: what its tables say, numbered."""

    def key(self, ram: Ram) -> tuple[int, ...]:
        """Return the cells of the bytes that runs read."""
        return tuple(ram[place] for place in sorted(self.read))

    def note(self, read: frozenset[int]) -> None:
        """Note that runs read more bytes: the remembered ones get longer keys."""
        if not self.read.issuperset(read):
            self.read |= read
            self.found = {self.key(runs.example): runs for runs in self.found.values()}

    def class_numbers(self, cells: tuple[int, ...], tables: Collection[ByteTable]) -> Ints:
        """Return a number for each value or pair of values, the same where the tables say the same.

        Raises UndecidedTrims.
        """
        numbers = np.zeros((VALUES,) * len(cells), dtype=np.int64)
        for axis, cell in enumerate(cells):
            columns = [table.values for table in tables if table.cells == (cell,)]
            known = self.classes.setdefault(cell, {})
            rows = np.stack(columns, axis=1).astype(np.uint8)
            classes = [known.setdefault(row.tobytes(), len(known)) for row in rows]
            if len(known) > CLASSES[len(cells)]:
                raise UndecidedTrims(f"byte {cell} of the EEPROM makes too many different values")
            numbers = numbers * CLASSES[len(cells)] + broadcast_along(np.array(classes), axis, len(cells))
        return numbers


def broadcast_along(values: Ints, axis: int, axes: int) -> Ints:
    """Return values that belong to one of several bytes, for all their combinations."""
    shape = [1] * axes
    shape[axis] = VALUES
    return np.broadcast_to(values.reshape(shape), (VALUES,) * axes)


def broadcast_table(table: ByteTable, cells: tuple[int, ...]) -> Ints:
    """Return what a table says for each combination of the values of `cells`."""
    if table.cells == cells:
        return table.values
    return broadcast_along(table.values, cells.index(table.cells[0]), len(cells))


def table_of(values: Ints, cells: tuple[int, ...], runs: RunTable, rows: Ints) -> ByteTable:
    """Return the table of a byte, of one byte of the EEPROM if it is enough."""
    if len(cells) == 1:
        return ByteTable(cells, values)
    if (values == values[:, :1]).all():
        return ByteTable(cells[:1], values[:, 0])
    if (values == values[:1]).all():
        return ByteTable(cells[1:], values[0])
    return ByteTable(cells, values, runs, rows)
