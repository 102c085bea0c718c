"""Tables of what depends on the EEPROM's bytes, and the ways that runs take for each value."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from servogen.edges import PINS
from servogen.prove import tables
from servogen.prove.tables import (
    ByteTable,
    RunMemory,
    RunTable,
    UndecidedTrims,
    broadcast_along,
    broadcast_table,
    join_rests,
    table_of,
)
from tests.prove.chip_states import fields, ram, rest

RB0 = PINS.index("RB0")


def test_two_states_beside_the_ram_become_one_that_contains_both() -> None:
    one = rest(W=0b1100, STATUS=0b101, TMR0=4, INTCON=4)
    assert join_rests(one, one) is one
    other = rest(W=0b1010, STATUS=0b100, TMR0=9, INTCON=0)
    both = join_rests(one, other)
    assert fields(both, "W", "W_UNKNOWN", "STATUS", "STATUS_UNKNOWN") == [0b1000, 0b0110, 0b100, 0b001]
    assert fields(both, "TMR0", "INTCON") == [4, 4], "the time is that of one of them"
    assert join_rests(one, rest(W=0b1100, PC=1, STATUS=0b101)) == (), "at another address"
    some = rest(W=0b1100, W_UNKNOWN=0b0011)
    # What is unknown in one of them is unknown, and W's lower bits with it.
    both = join_rests(some, rest(W=0b1111))
    assert fields(both, "W", "W_UNKNOWN") == [0b1100, 0b0011]
    for name in ("EEADR", "LATCH", "TRIS"):
        assert join_rests(rest(), rest(**{name: 1})) == (), name


def test_values_of_one_byte_are_spread_over_pairs() -> None:
    values = np.arange(256)
    rows, columns = broadcast_along(values, 0, 2), broadcast_along(values, 1, 2)
    assert rows.shape == (256, 256) and rows[3, 7] == 3 and columns[3, 7] == 7
    assert broadcast_along(values, 0, 1).tolist() == values.tolist()
    table = ByteTable((5,), values)
    assert broadcast_table(table, (5,)) is values
    assert broadcast_table(table, (2, 5))[3, 7] == 7 and broadcast_table(table, (5, 9))[3, 7] == 3


def test_a_table_is_of_one_byte_if_that_is_enough() -> None:
    ways = RunTable(ram(), 1)
    numbers = np.zeros((256, 256), dtype=np.int64)
    first, second = broadcast_along(np.arange(256), 0, 2), broadcast_along(np.arange(256), 1, 2)
    assert table_of(first, (2, 5), ways, numbers).cells == (2,)
    one = table_of(second, (2, 5), ways, numbers)
    assert one.cells == (5,) and one.values.tolist() == list(range(256)) and one.source is None
    both = table_of(first ^ second, (2, 5), ways, numbers)
    assert both.cells == (2, 5) and both.source is ways and both.rows is numbers
    assert table_of(np.arange(256), (2,), ways, numbers).cells == (2,)


def test_ways_differ_in_known_bytes_that_all_of_them_write() -> None:
    ways = RunTable(ram(), 8)
    ways.ram = {
        1: np.array([5, 5]),
        2: np.array([5, 6]),
        3: np.array([-1, 6]),
        4: np.array([5, 256]),
        5: np.array([0, 255]),
    }
    assert ways.varying_places() == [2, 5]
    other = ways.copied_for(ram(c1=9))
    other.row_of[0] = 7
    other.ram[9] = np.array([1])
    assert ways.row_of[0] == -1 and 9 not in ways.ram and other.example == ram(c1=9)


def test_ways_are_added_with_their_cycles_bytes_and_edges() -> None:
    def lanes(cycles: list[int], written: dict[int, list[int]], **more: Any) -> Any:
        table = np.full((len(cycles), 68), -1, dtype=np.int64)
        for place, column in written.items():
            table[:, place] = column
        values = {"read": (1,), "edges": {}, "fit": [True] * len(cycles), "rests": {rest(W=1): None}} | more
        values["fit"] = np.array(values["fit"])
        return SimpleNamespace(cycles=np.array(cycles), ram=table, **values)

    ways = RunTable(ram(), 8)
    ways.add(np.array([4, 2]), lanes([10, 11], {5: [1, 2]}, edges={(RB0, 1): np.array([3, 3])}))
    ways.add(np.array([0]), lanes([12], {6: [3]}, read=(2,), rests={rest(W=3): None}))
    assert ways.row_of.tolist() == [2, -1, 1, -1, 0, -1, -1, -1]
    assert ways.cycles.tolist() == [10, 11, 12] and ways.read == {1, 2} and ways.fit and ways.same_end
    assert {place: column.tolist() for place, column in ways.ram.items()} == {5: [1, 2, -1], 6: [-1, -1, 3]}
    assert ways.edges[RB0, 1].tolist() == [3, 3, -1]
    assert fields(ways.rest, "W", "W_UNKNOWN") == [1, 2]
    ways.add(np.array([1]), lanes([1], {}, rests={rest(PC=5): None}))
    assert not ways.same_end
    ways.add(np.array([3, 5]), lanes([1, 2], {}, fit=[True, False]))
    assert not ways.fit


def test_a_memory_s_keys_grow_with_what_runs_read() -> None:
    memory = RunMemory()
    assert memory.key(ram(c1=1)) == ()
    first, second = RunTable(ram(c1=1, c2=2), 4), RunTable(ram(c1=3, c2=4), 4)
    memory.note(frozenset({1}))
    memory.found = {memory.key(first.example): first, memory.key(second.example): second}
    assert memory.found.keys() == {(1,), (3,)}
    memory.note(frozenset({2}))
    assert memory.found == {(1, 2): first, (3, 4): second}
    memory.note(frozenset({1, 2}))
    assert memory.read == {1, 2} and memory.key(ram(c1=8, c2=9, c3=7)) == (8, 9)


def test_what_tables_say_is_numbered(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same number where tables say the same, for each pair of two bytes; too many are not told apart."""
    four, two = np.arange(256) % 4, np.arange(256) % 2
    memory, table = RunMemory(), [ByteTable((5,), four)]
    assert memory.class_numbers((5,), table).tolist() == four.tolist()
    assert memory.class_numbers((5,), [ByteTable((5,), four + 2)]).tolist() == [2, 3, 4, 5] * 64
    both = [ByteTable((5,), four), ByteTable((9,), two), ByteTable((9,), four)]
    numbers = RunMemory().class_numbers((5, 9), both)
    assert numbers.shape == (256, 256) and len(np.unique(numbers)) == 16
    assert numbers[2, 3] == numbers[6, 7] != numbers[3, 2]
    monkeypatch.setattr(tables, "CLASSES", (1, 4, 2))
    RunMemory().class_numbers((5,), table)
    for limits, cells, given in (((1, 3, 9), (5,), table), ((1, 9, 3), (5, 9), both)):
        monkeypatch.setattr(tables, "CLASSES", limits)
        with pytest.raises(UndecidedTrims) as undecided:
            RunMemory().class_numbers(cells, given)
        assert str(undecided.value) == "byte 5 of the EEPROM makes too many different values"
