"""The simulator executes by its own dispatch; every fact on a row of `pic.isa` holds of what it does.

Each instruction is executed from many states. What changes is what it writes, what makes a difference is what
it reads; both must be the row's, neither more nor less.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import pytest

from servogen.pic.image import Image
from servogen.pic.isa import INSTRUCTIONS, LEGACY, Decoded, Opcode, by_mnemonic, decode, encode
from servogen.simulator import Machine, SimulatorOptions
from servogen.simulator import layout as at
from servogen.simulator.words import D_BIT, FILE_OPS, OPS, pack
from tests.simulator.helpers import CLOCK

ROWS = (*INSTRUCTIONS, *LEGACY)
RAM, TOP, LITERAL, TARGET = 0x20, 0x123, 0x5A, 0x15A
W_VALUES = (0x00, 0x01, 0x0F, 0x80, 0xFF)
F_VALUES = (0x00, 0x01, 0x08, 0x10, 0x5A, 0xFF)
FLAGS = {"C": 0x01, "D": 0x02, "Z": 0x04, "P": 0x08, "T": 0x10}
STATUSES = (0x00, 0x01, 0x07, 0x18, 0x1F)
"""No flag, C alone, C, DC and Z, and two with TO and PD."""


@dataclass(frozen=True)
class Run:
    """One execution: the values before it, and those after it."""

    w: int
    f: int
    status: int
    w_after: int
    f_after: int
    status_after: int
    pc: int
    cycles: int
    others: tuple[int, ...]
    """OPTION_REG, TRIS, GIE, the levels of the stack in use and its top, and whether the chip sleeps."""


def words(row: Opcode, literal: int = LITERAL) -> list[int]:
    """The words that are executed: with either destination, and for TRIS either port."""
    fields = {"f": (RAM,), "b": (3,), "d": (0, 1), "k": (TARGET if row.has_target else literal,)}
    if row.mnemonic == "TRIS":
        fields["f"] = (5, 6)
    used = [field for field in "fdbk" if field in row.operands]
    return [
        encode(row.mnemonic, **dict(zip(used, values, strict=True)))
        for values in product(*(fields[each] for each in used))
    ]


def chip(word: int, tracked: bool = False) -> Machine:
    return Machine(
        Image({0: word}, config=0x3FF1), CLOCK, SimulatorOptions(device="PIC16F84A"), tracked=tracked
    )


def runs(word: int) -> list[Run]:
    machine = chip(word)
    fresh = machine.numbers.copy()
    fresh[at.STACK] = TOP
    fresh[at.SP] = fresh[at.DEPTH] = 1
    found = []
    for w, f, status in product(W_VALUES, F_VALUES, STATUSES):
        s = machine.numbers
        s[:] = fresh
        s[at.W], s[RAM], s[at.STATUS] = w, f, status
        machine.step()
        others = (at.OPTION, at.TRIS, at.INTCON, at.DEPTH, at.STACK, at.STACK + 1, at.SLEEPING)
        found.append(
            Run(
                w,
                f,
                status,
                int(s[at.W]),
                int(s[RAM]),
                int(s[at.STATUS]),
                machine.pc,
                int(machine.cycles),
                tuple(int(s[each]) for each in others),
            )
        )
    return found


def of_all_words(row: Opcode) -> list[tuple[int, list[Run]]]:
    """(destination bit, runs) of each word."""
    return [(decoded(word).d, runs(word)) for word in words(row)]


def decoded(word: int) -> Decoded:
    found = decode(word)
    assert found is not None
    return found


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.mnemonic)
def test_the_simulator_changes_the_flags_of_the_row_and_no_others(row: Opcode) -> None:
    changed = 0
    for _, all_runs in of_all_words(row):
        for each in all_runs:
            changed |= each.status ^ each.status_after
    assert "".join(flag for flag in "CDZTP" if changed & FLAGS[flag]) == row.flags


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.mnemonic)
def test_the_simulator_writes_what_the_row_says(row: Opcode) -> None:
    for d, all_runs in of_all_words(row):
        assert any(each.w != each.w_after for each in all_runs) == row.writes_w(d)
        writes_another_value = row.writes_file(d) and row.mnemonic != "MOVF"  # MOVF f,F writes what it read
        assert any(each.f != each.f_after for each in all_runs) == writes_another_value


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.mnemonic)
def test_the_simulator_reads_what_the_row_says(row: Opcode) -> None:
    reads = set()
    for d, all_runs in of_all_words(row):
        mask = sum(FLAGS[flag] for flag in row.flags)
        by_input = {
            (each.w, each.f, each.status): (
                each.w_after if row.writes_w(d) else None, each.f_after if row.writes_file(d) else None,
                each.status_after & mask, each.pc, each.cycles, each.others,
            )
            for each in all_runs
        }  # fmt: skip
        for (w, f, status), outcome in by_input.items():
            reads |= {"W" for other in W_VALUES if by_input[other, f, status] != outcome}
            reads |= {"f" for other in F_VALUES if by_input[w, other, status] != outcome}
        reads |= {"C" for w, f in product(W_VALUES, F_VALUES) if by_input[w, f, 0] != by_input[w, f, 1]}
    assert reads == set(row.reads)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.mnemonic)
def test_the_simulator_continues_where_the_row_says_after_its_cycles(row: Opcode) -> None:
    expected = {
        "next": {(1, row.cycles)},
        "skip": {(1, row.cycles), (2, row.cycles + 1)},
        "jump": {(TARGET, row.cycles)},
        "call": {(TARGET, row.cycles)},
        "return": {(TOP, row.cycles)},
    }[row.flow]
    depth = 3  # of the others
    for _, all_runs in of_all_words(row):
        assert {(each.pc, each.cycles) for each in all_runs} == expected
        levels = {each.others[depth] for each in all_runs}
        assert levels == {{"call": 2, "return": 0}.get(row.flow, 1)}


@pytest.mark.parametrize("row", [row for row in INSTRUCTIONS if row.reads], ids=lambda row: row.mnemonic)
def test_an_unknown_operand_makes_only_the_flags_of_the_row_unknown(row: Opcode) -> None:
    unknown_flags = 0
    for word in {*words(row), *words(row, literal=0)}:  # k | W is certainly not 0 unless k is
        machine = chip(word, tracked=True)
        fresh = machine.numbers.copy()
        for w, f in product(W_VALUES, F_VALUES):
            s = machine.numbers
            s[:] = fresh
            s[at.W], s[at.STATUS], s[at.STATUS_UNKNOWN] = w, 0x18, 0
            s[at.W_UNKNOWN] = 0x1FF if "W" in row.reads else 0
            s[RAM] = f | (0x1FF << at.UNKNOWN_SHIFT if "f" in row.reads else 0)
            machine.step()
            unknown_flags |= int(s[at.STATUS_UNKNOWN]) & 0xFF
    assert "".join(flag for flag in "CDZ" if unknown_flags & FLAGS[flag]) == row.flags


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.mnemonic)
def test_the_packed_word_has_the_operands_of_the_row(row: Opcode) -> None:
    """Operations on registers have the low numbers, and bit D says that the result goes to the register."""
    assert (OPS[row.mnemonic] < FILE_OPS) == ("f" in row.operands and row.mnemonic != "TRIS")
    for word in words(row):
        found = decoded(word)
        assert found.instruction is row
        if "f" in row.operands and not row.tests_bit:
            assert bool(pack(found) >> D_BIT & 1) == row.writes_file(found.d)


@pytest.mark.parametrize(
    ("test", "wrong"),
    [
        (test_the_simulator_changes_the_flags_of_the_row_and_no_others, {"flags": "CZ"}),
        (test_the_simulator_writes_what_the_row_says, {"writes": "f"}),
        (test_the_simulator_reads_what_the_row_says, {"reads": "Wf"}),
        (test_the_simulator_continues_where_the_row_says_after_its_cycles, {"cycles": 2}),
        (test_the_simulator_continues_where_the_row_says_after_its_cycles, {"flow": "skip"}),
    ],
)
def test_a_wrong_row_is_found(test: Callable[[Opcode], None], wrong: dict[str, Any]) -> None:
    with pytest.raises(AssertionError):
        test(replace(by_mnemonic()["INCF"], **wrong))
