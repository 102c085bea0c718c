"""Proves rules by trying all values of the bytes and flags that they read.

In: two sequences. Out: the names that they leave different.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import product

import numpy as np

from servogen.compiler.passes.superoptimise import FLAGS, RuleInstruction
from servogen.pic.isa import by_mnemonic
from tools.superoptimiser.machine import NAMES, State, run

MAX_BYTES = 3
"""Read by a rule: more would take too long to try."""


def can_be_proven(old: Iterable[RuleInstruction], new: Iterable[RuleInstruction]) -> bool:
    """Return whether few enough bytes are read."""
    return len((read_first(old) | read_first(new)) - {*FLAGS}) <= MAX_BYTES


def holds(old: Iterable[RuleInstruction], new: Iterable[RuleInstruction], dead: Iterable[str]) -> bool:
    """Return whether two sequences do the same but for what is dead, for all values of what they read."""
    return all(found <= set(dead) for found in _differences(tuple(old), tuple(new)))


def differing(old: Iterable[RuleInstruction], new: Iterable[RuleInstruction]) -> set[str]:
    """Return the names that two sequences leave different for some values of what they read."""
    return set[str]().union(*_differences(tuple(old), tuple(new)))


def _differences(old: Sequence[RuleInstruction], new: Sequence[RuleInstruction]) -> Iterator[set[str]]:
    for state in _states(read_first(old) | read_first(new)):
        one, two = run(old, state), run(new, state)
        yield {name for name in NAMES if (one[name] != two[name]).any()}


def names_in(sequence: Iterable[RuleInstruction]) -> set[str]:
    """Return the bytes that a sequence names, and "k" if it has a literal for all."""
    sequence = tuple(sequence)
    found = {each.f for each in sequence if each.f in ("a", "b")}
    return found | ({"k"} if any(each.k == "k" for each in sequence) else set())


def read_first(sequence: Iterable[RuleInstruction]) -> set[str]:
    """Return the names that a sequence may read before it has certainly written them."""
    found: set[str] = set()
    written: set[str] = set()
    skipped = False
    for each in sequence:
        reads, writes = _reads_writes(each)
        found |= reads - written
        if not skipped:
            written |= writes
        skipped = by_mnemonic()[each.op].skips
    return found


def _reads_writes(each: RuleInstruction) -> tuple[set[str], set[str]]:
    """Return the names that an instruction reads, and those that it overwrites entirely."""
    row = by_mnemonic()[each.op]
    reads = {name for name in "WC" if name in row.reads}
    if each.k == "k":
        reads.add("k")
    if each.f and ("f" in row.reads or each.f in FLAGS):
        reads.add(each.f)
    if row.changes_bit or row.tests_bit:
        return reads, set()
    writes = {"W"} if row.writes == "W" else {each.f} if row.writes == "f" else set()
    if row.writes == "d":
        writes = {each.f if each.d else "W"}
    return reads, writes


def _states(read: set[str]) -> Iterator[State]:
    """Yield states that together have all values of the names that are read.

    Two bytes and the flags vary within a state of many columns; further bytes are the same in all of them.
    What is not read passes through or is lost, whatever it holds: two values of each, different from those of
    all others, show which.
    """
    bytes_ = [name for name in (*NAMES, "k") if name in read and name not in FLAGS]
    columns = [*bytes_[:2], *(name for name in FLAGS if name in read)]
    ranges = [np.arange(2 if name in FLAGS else 256).astype(np.uint8) for name in columns]
    *grid, second = [each.ravel() for each in np.meshgrid(*ranges, np.array([0, 1], np.uint8), indexing="ij")]
    state = dict(zip(columns, grid, strict=True))
    for number, name in enumerate((*NAMES, "k")):
        if name not in read:
            state[name] = second if name in FLAGS else np.where(second == 1, 255 - 37 * number, 37 * number)
            state[name] = state[name].astype(np.uint8)
    for values in product(range(256), repeat=len(bytes_[2:])):
        fixed = zip(bytes_[2:], values, strict=True)
        yield state | {name: np.full(len(second), value, np.uint8) for name, value in fixed}
