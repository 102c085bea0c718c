"""The one table of what instructions compute, against every arithmetic that is written apart from it.

The operands are exhausted: every W and every byte or literal that an instruction reads, C if it reads that,
every bit. tests/simulator/test_instructions.py compares the simulator's instruction loop with the table. What
is known, sets and terms are compared with the table's own numbers: they must contain them.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable

import numpy as np
import numpy.typing as npt
import pytest

from servogen.checker import chip, layout
from servogen.pic import semantics
from servogen.pic.analysis.values import SETS, Value, of
from servogen.pic.image import Image
from servogen.pic.isa import by_mnemonic, encode
from servogen.pic.known_values import known_result
from servogen.pic.semantics import CARRIES, NUMBERS, RESULTS, row_of
from tests.checker.each import result_table
from tests.simulator.flags import BYTE_ORIENTED, LITERAL
from tests.simulator.reference import Chip

Lanes = npt.NDArray[np.int64]
Witness = Callable[[str, Lanes, Lanes, Lanes, int], tuple[Lanes, Lanes] | None]
"""From a mnemonic, byte or literal, W, the flags, and a bit: the result and the flags; None: it has none."""
FLAGS = {"C": 1, "D": 2, "Z": 4}
NAMES = [name for name in by_mnemonic() if row_of(name)]
RAM = 0x20


def operands(name: str, step: int = 1) -> tuple[Lanes, Lanes, Lanes]:
    """Every operand on which an instruction depends; the flags that it does not read are different ones."""
    row = by_mnemonic()[name]
    every, some = np.arange(0, 256, step), np.array([0, 0x5A, 0xFF])
    f = every if "f" in row.reads or "k" in row.operands else some
    w = every if "W" in row.reads else some
    flags = np.arange(8) if "C" in row.reads else np.array([0])
    f, w, before = (each.ravel() for each in np.meshgrid(f, w, flags))
    return f, w, before if "C" in row.reads else f * 5 + w & 7


def tabled(name: str, f: Lanes, w: Lanes, before: Lanes, bit: int) -> tuple[Lanes, Lanes]:
    made = semantics.result(NUMBERS, name, f, w, before & 1, bit)
    after = before
    for letter, value in semantics.flags(NUMBERS, name, f, w, made).items():
        after = after & ~FLAGS[letter] | value * FLAGS[letter]
    return made, after


def by_adders(name: str, f: Lanes, w: Lanes, before: Lanes, bit: int) -> tuple[Lanes, Lanes] | None:
    model = (BYTE_ORIENTED | LITERAL).get(name)
    if model is None:
        return None
    result, *changed = model(f, w, before & 1)
    after = before
    for flag, value in zip(FLAGS.values(), changed, strict=True):
        after = after if value is None else after & ~flag | value * flag
    return result, after


def by_checker(name: str, f: Lanes, w: Lanes, before: Lanes, bit: int) -> tuple[Lanes, Lanes]:
    fields = {"f": RAM, "d": 1, "b": bit}
    word = encode(name, **{field: fields.get(field, 0) for field in by_mnemonic()[name].operands})
    code = chip.program_code(Image({0: word}), frozenset())[0]
    x = {layout.X_IS_W: w, layout.X_IS_CARRY: before & 1}.get(code[layout.X], code[layout.X])
    found = result_table()[code[layout.OP], x, f].copy()
    return found & 0xFF, before & ~code[layout.FLAGS] | found >> 8 & code[layout.FLAGS]


class LaneChip(Chip):
    """The second chip of the tests, on arrays."""

    def flag(self, bit: int, on: Lanes) -> None:
        self.status = np.where(on, self.status | bit, self.status & ~bit)


def by_second_chip(name: str, f: Lanes, w: Lanes, before: Lanes, bit: int) -> tuple[Lanes, Lanes] | None:
    chip = LaneChip(Image({}))
    chip.status, chip.w = before, w
    literal = getattr(chip, f"do_{name.lower()}", None)
    if literal is None:
        return chip.result(name, f, w, bit), chip.status
    literal(type("Decoded", (), {"k": f}))
    return np.broadcast_to(chip.w, f.shape), chip.status


def by_ghidra(name: str, f: Lanes, w: Lanes, before: Lanes, bit: int) -> tuple[Lanes, Lanes]:
    """Where it differs from the data sheet, as tests/checker/test_ghidra.py says, it is corrected."""
    from tests.checker.pcode import LANGUAGES, Semantics

    ghidra, row = Semantics(LANGUAGES[0]), by_mnemonic()[name]
    result, after = np.empty_like(f), np.empty_like(f)
    for k in range(256) if "k" in row.operands else (None,):
        lanes = np.flatnonzero(f == k) if k is not None else np.arange(len(f))
        fields = {"f": RAM, "d": 1, "b": bit, "k": k}
        word = encode(name, **{field: fields[field] for field in row.operands})
        status, ram = ("DATA", 3), ("DATA", RAM)
        given = {ghidra.w: w[lanes], ram: f[lanes], status: before[lanes]}
        found = ghidra.execute(word, 0x123, given | {ghidra.skip: np.zeros_like(lanes)})
        result[lanes] = found[ghidra.w if row.writes_w(1) else ram]
        after[lanes] = found[status] & 7
    if name in ("RLF", "RRF"):
        after = after & ~4 | before & 4
    return result, after ^ 2 if name[:3] == "SUB" else after


WITNESSES: dict[str, Witness] = {
    "the adders of the tests": by_adders,
    "the checker": by_checker,
    "the second chip": by_second_chip,
    "Ghidra": by_ghidra,
}


def differences(witness: Witness, names: Iterable[str] = NAMES, step: int = 1) -> list[str]:
    """The instructions that the witness computes otherwise than the table."""
    found = []
    for name in names:
        for bit in range(8) if by_mnemonic()[name].changes_bit else (0,):
            f, w, before = operands(name, step)
            theirs = witness(name, f, w, before, bit)
            ours = tabled(name, f, w, before, bit)
            pairs = zip(ours, theirs or ours, strict=True)
            if not all(np.array_equal(*np.broadcast_arrays(*pair)) for pair in pairs):
                found.append(name)
                break
    return found


@pytest.mark.parametrize("witness", WITNESSES)
def test_every_arithmetic_computes_the_same_for_every_operand(witness: str) -> None:
    if witness == "Ghidra":
        pytest.importorskip("pypcode", reason="pypcode (extra `dev`) is not installed")
    assert differences(WITNESSES[witness]) == []


@pytest.mark.parametrize("row", RESULTS)
def test_a_row_that_is_altered_is_found_and_named(row: str, monkeypatch: pytest.MonkeyPatch) -> None:
    names = [name for name in NAMES if row_of(name) == row]
    right = RESULTS[row]
    monkeypatch.setitem(RESULTS, row, lambda on, *given: on.difference(right(on, *given), on.number(1)))
    assert differences(by_checker, step=15) == names
    assert differences(by_second_chip, step=15) == names
    monkeypatch.setitem(RESULTS, row, right)
    if row in CARRIES:
        carries = CARRIES[row]
        monkeypatch.setitem(CARRIES, row, lambda on, f, w, bits: 1 - carries(on, f, w, bits))
        assert differences(by_checker, step=15) == names


def test_exactly_the_instructions_with_a_result_have_a_row() -> None:
    """RETLW returns, OPTION and TRIS write a register without an address: the others are moves of control."""
    writing = {name for name, row in by_mnemonic().items() if row.writes}
    assert {name for name in by_mnemonic() if row_of(name)} == writing - {"RETLW"}
    assert set(RESULTS) == {row_of(name) for name in NAMES}
    carrying = {row_of(name) for name in NAMES if "C" in by_mnemonic()[name].flags}
    assert set(CARRIES) == carrying


def samples(name: str, count: int) -> Iterable[tuple[int, int, int, int]]:
    rng = random.Random(name)
    for _ in range(count):
        yield (
            rng.choice((0, 0xFF, rng.randrange(256))),
            rng.randrange(256),
            rng.randrange(2),
            rng.randrange(8),
        )


def numbers(name: str, f: int, w: int, c: int, bit: int) -> tuple[int, dict[str, int]]:
    made = semantics.result(NUMBERS, name, f, w, c, bit)
    return made, dict(semantics.flags(NUMBERS, name, f, w, made))


@pytest.mark.parametrize("name", NAMES)
def test_what_is_known_is_the_number(name: str) -> None:
    for f, w, c, bit in samples(name, 20):
        made, changed = numbers(name, f, w, c, bit)
        byte, literal = (f ^ 1, f) if "k" in by_mnemonic()[name].operands else (f, f ^ 1)
        assert known_result(name, w, byte, literal, bit, c) == (made, changed.get("C"))


@pytest.mark.parametrize("name", NAMES)
def test_a_set_contains_the_number_of_every_choice_of_members(name: str) -> None:
    rng = random.Random(name)
    for f, w, c, bit in samples(name, 12):
        more = [of([each, *(rng.randrange(256) for _ in range(rng.choice((0, 3, 90))))]) for each in (f, w)]
        carry = of([c, rng.randrange(2)])
        result: Value = semantics.result(SETS, name, *more, carry, bit)
        changed = semantics.flags(SETS, name, *more, result)
        made, flags = numbers(name, f, w, c, bit)
        assert made in result
        assert (
            all(value in changed[letter] for letter, value in flags.items())
            and flags.keys() == changed.keys()
        )


@pytest.mark.parametrize("name", NAMES)
def test_a_term_is_the_number_where_its_unknowns_are_the_operands(name: str) -> None:
    pytest.importorskip("bitwuzla", reason="bitwuzla (extra `solver`) is not installed")
    from servogen.prove.stream.bits import FALSE, TERMS, Solver, as_bit, unknown

    f, w, c = unknown("f"), unknown("w"), unknown("c", 1).bit(0)
    differs = FALSE
    for byte, other, carry, _ in samples(name, 12):
        made, flags = numbers(name, byte, other, carry, 5)
        result = semantics.result(TERMS, name, f, w, c, 5)
        changed = semantics.flags(TERMS, name, f, w, result)
        same = result.equals(made)
        for letter, value in flags.items():
            same = same & as_bit(changed[letter]).equals(value)
        differs = differs | (f.equals(byte) & w.equals(other) & as_bit(c).equals(carry) & ~same)
    assert not Solver().possible(differs)
