"""All short sequences, by what they do; and for the windows of real programs the shortest that does the same.

In: windows with what is not needed behind them. Out: proven rules.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

from servogen.compiler.passes.rules import FLAGS, RuleInstruction
from tools.superoptimiser.machine import NAMES, State, Values, run, step

SAMPLES = 96
"""States in which sequences are compared before a rule is proven for all of them."""

MAX_BYTES = 2
"""Read by a rule: more would take too long to prove by trying all values."""

MAX_CANDIDATES = 40
"""Sequences that do the same in all samples, of which some differ for other values."""

Hashes = npt.NDArray[np.uint64]
Numbers = npt.NDArray[np.int16]
Sequence_ = tuple[RuleInstruction, ...]


def parse(*texts: str) -> tuple[RuleInstruction, ...]:
    return tuple(map(RuleInstruction.parse, texts))


LITERALS = ("0", "1", "255", "k")
SIMPLE = parse(
    *(
        f"{op} {f},{d}"
        for op in [
            "MOVF",
            "ADDWF",
            "SUBWF",
            "ANDWF",
            "IORWF",
            "XORWF",
            "INCF",
            "DECF",
            "COMF",
            "SWAPF",
            "RLF",
            "RRF",
        ]
        for f in "ab"
        for d in "WF"
    ),
    *(f"{op} {f}" for op in ("MOVWF", "CLRF") for f in "ab"),
    *(f"{op} {k}" for op in ["MOVLW", "ADDLW", "SUBLW", "ANDLW", "IORLW", "XORLW"] for k in LITERALS),
    *(f"{op} {bit}" for op in ("BCF", "BSF") for bit in ("C", "a.0", "a.7", "b.0", "b.7")),
)
SKIPS = parse(
    *(f"{op} {bit}" for op in ("BTFSC", "BTFSS") for bit in ("C", "Z", "a.0", "a.7", "b.0", "b.7")),
    *(f"{op} {f},{d}" for op in ("INCFSZ", "DECFSZ") for f in "ab" for d in "WF"),
)


def samples() -> State:
    """Return random states with many special values."""
    dice = np.random.default_rng(84)
    special = np.array([0, 1, 2, 0x7F, 0x80, 0xFE, 0xFF, 0x0F, 0x10], np.uint8)
    state: State = {}
    for name in (*NAMES, "k"):
        if name in FLAGS:
            state[name] = dice.integers(0, 2, SAMPLES, np.uint8)
            continue
        values = dice.integers(0, 256, SAMPLES).astype(np.uint8)
        chosen = dice.random(SAMPLES) < 0.35
        values[chosen] = dice.choice(special, chosen.sum())
        state[name] = values
    same = dice.random(SAMPLES) < 0.1
    state["b"][same] = state["a"][same]
    return state


@dataclass(frozen=True, slots=True)
class Catalogue:
    """All sequences up to a length: `index` holds their instructions' numbers, -1 behind the last."""

    index: npt.NDArray[np.int16]
    hashes: Hashes
    """(sequences, names): what each name holds behind a sequence."""

    def sequence(self, number: int) -> tuple[RuleInstruction, ...]:
        return tuple(ALL[each] for each in self.index[number] if each >= 0)


ALL = (*SIMPLE, *SKIPS)


def _weights() -> Hashes:
    return np.random.default_rng(16).integers(1, 1 << 63, SAMPLES, np.uint64) | np.uint64(1)


def hashed(state: State) -> Hashes:
    """Return a number for what each name holds (..., names)."""
    weights = _weights()
    return np.stack([(state[name].astype(np.uint64) * weights).sum(axis=-1) for name in NAMES], axis=-1)


def catalogue(longest: int) -> Catalogue:
    """Return all sequences of up to `longest` instructions, shorter ones first; one may skip another."""
    start = {name: value[None] for name, value in samples().items()}
    layers: list[tuple[Numbers, State]] = [(np.empty((1, 0), np.int16), start)]
    indexes, hashes = [layers[0][0]], [hashed(start)]
    for length in range(1, longest + 1):
        numbers, states = [], []
        for added, state in _longer(layers, length):
            numbers.append(added)
            hashes.append(hashed(state))
            if length < longest:  # the last states are not needed any more
                states.append({name: np.broadcast_to(state[name], (len(added), SAMPLES)) for name in NAMES})
        index = np.concatenate(numbers)
        indexes.append(index)
        if states:
            whole = {name: np.concatenate([each[name] for each in states]) for name in NAMES}
            layers.append((index, whole | {"k": start["k"]}))
    padded = [np.pad(each, ((0, 0), (0, longest - each.shape[1])), constant_values=-1) for each in indexes]
    return Catalogue(np.concatenate(padded), np.concatenate(hashes))


def _longer(layers: list[tuple[Numbers, State]], length: int) -> Iterator[tuple[Numbers, State]]:
    """Yield all sequences of a length with the states behind them, from all shorter ones."""
    before, state = layers[length - 1]
    for number, last in enumerate(SIMPLE):
        yield np.pad(before, ((0, 0), (0, 1)), constant_values=number), step(last, state)[0]
    if length < 2:
        return
    before, state = layers[length - 2]
    for (skip, guard), (number, last) in product(enumerate(SKIPS, len(SIMPLE)), enumerate(SIMPLE)):
        tail = np.tile(np.array([[skip, number]], np.int16), (len(before), 1))
        yield np.hstack((before, tail)), run((guard, last), state)


@dataclass(slots=True)
class Finder:
    """The shortest sequence for each behaviour, by what has to be right."""

    all: Catalogue
    tables: dict[tuple[int, ...], tuple[Hashes, npt.NDArray[np.int64]]]

    @classmethod
    def of(cls, all_sequences: Catalogue) -> Finder:
        return cls(all_sequences, {})

    def shorter(self, old: Sequence_, dead: Iterable[str]) -> Iterator[Sequence_]:
        """Yield shorter sequences that do the same in all samples for what is not dead, shortest first."""
        live = tuple(number for number, name in enumerate(NAMES) if name not in dead)
        if live not in self.tables:
            keys = self._keys(self.all.hashes, live)
            order = np.argsort(keys, kind="stable")
            self.tables[live] = keys[order], order
        keys, order = self.tables[live]
        key = self._keys(hashed({name: value[None] for name, value in run(old, samples()).items()}), live)[0]
        first, end = (int(np.searchsorted(keys, key, side=side)) for side in ("left", "right"))
        known = names_in(old)
        for number in order[first : min(end, first + MAX_CANDIDATES)]:
            new = self.all.sequence(int(number))
            if len(new) >= len(old):
                return
            if names_in(new) <= known:
                yield new

    def proven(self, old: Sequence_, dead: frozenset[str]) -> Sequence_ | None:
        """Return the shortest sequence that does the same for all values; None if there is none."""
        for new in self.shorter(old, dead):
            few = len((read_first(old) | read_first(new)) & {"W", "a", "b", "k"}) <= MAX_BYTES
            if few and differing(old, new) <= dead:
                return new
        return None

    @staticmethod
    def _keys(hashes: Hashes, live: tuple[int, ...]) -> Hashes:
        mixers = np.random.default_rng(628).integers(1, 1 << 63, len(NAMES), np.uint64) | np.uint64(1)
        return np.asarray((hashes[:, live] * mixers[list(live)]).sum(axis=1), np.uint64)


def names_in(sequence: Sequence_) -> set[str]:
    """Return the bytes that a sequence names, and "k" if it has a literal for all."""
    found = {each.f for each in sequence if each.f in ("a", "b")}
    return found | ({"k"} if any(each.k == "k" for each in sequence) else set())


def twins(all_sequences: Catalogue) -> Iterator[tuple[int, int, int]]:
    """Yield for each length the number of sequences, and of those with a twin that is no longer."""
    keys = Finder._keys(all_sequences.hashes, tuple(range(len(NAMES))))
    lengths = (all_sequences.index >= 0).sum(axis=1)
    _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
    has_twin = first[inverse] != np.arange(len(keys))
    for length in range(1, int(lengths.max()) + 1):
        here = lengths == length
        yield length, int(here.sum()), int((has_twin & here).sum())


def differing(old: Sequence_, new: Sequence_) -> set[str]:
    """Return the names that two sequences leave different, for all values of what they read.

    A name that neither reads passes through or is lost, whatever it holds: random values show which.
    """
    grid = _grid(read_first(old) | read_first(new))
    one, two = run(old, grid), run(new, grid)
    return {name for name in NAMES if (one[name] != two[name]).any()}


def read_first(sequence: Sequence_) -> set[str]:
    """Return the names that a sequence may read before it has certainly written them."""
    found: set[str] = set()
    written: set[str] = set()
    skipped = False
    for each in sequence:
        reads, writes = _reads_writes(each)
        found |= reads - written
        if not skipped:
            written |= writes
        skipped = each.op in ("BTFSC", "BTFSS", "INCFSZ", "DECFSZ")
    return found


def _reads_writes(each: RuleInstruction) -> tuple[set[str], set[str]]:
    reads: set[str] = set()
    if each.k == "k":
        reads.add("k")
    if each.op in (
        "ADDLW",
        "SUBLW",
        "ANDLW",
        "IORLW",
        "XORLW",
        "MOVWF",
        "ADDWF",
        "SUBWF",
        "ANDWF",
        "IORWF",
        "XORWF",
    ):
        reads.add("W")
    if each.f and each.op not in ("MOVWF", "CLRF"):
        reads.add(each.f)
    if each.op in ("RLF", "RRF"):
        reads.add("C")
    writes: set[str] = set()
    if each.op in ("MOVWF", "CLRF") or (
        each.f in ("a", "b") and each.d and each.op not in ("BCF", "BSF", "BTFSC", "BTFSS")
    ):
        writes.add(each.f)
    elif each.op not in ("BCF", "BSF", "BTFSC", "BTFSS"):
        writes.add("W")
    return reads, writes


def _grid(read: set[str]) -> State:
    """Return all values of the names that are read, in columns; two values of the others."""
    ranges: dict[str, Values] = {}
    for name in (*NAMES, "k"):
        if name in FLAGS and name in read:
            ranges[name] = np.array([0, 1], np.uint8)
        elif name in read:
            ranges[name] = np.arange(256).astype(np.uint8)
    free = [name for name in (*NAMES, "k") if name not in ranges]
    columns = np.meshgrid(*ranges.values(), indexing="ij")
    state = {name: column.ravel() for name, column in zip(ranges, columns, strict=True)}
    dice = np.random.default_rng(1)
    count = len(next(iter(state.values()))) if state else 1
    repeat = max(1, SAMPLES // count)
    state = {name: np.repeat(value, repeat) for name, value in state.items()}
    for name in free:  # neither side reads it
        state[name] = dice.integers(0, 2 if name in FLAGS else 256, count * repeat).astype(np.uint8)
    return state
