"""Lists all short sequences that no earlier one equals, and which of the sought behaviours each has.

In: behaviours, as fingerprints of what sequences leave in a few hundred states. Out: sequences that have
them, to be proven, and how much of the space was covered.

Only sequences whose first byte is `a` are listed: the others are these with `a` and `b` exchanged. A
sequence is left out where its first or last instructions have an earlier twin, because the sequence with that
twin in their place does the same.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product

import numba
import numpy as np
import numpy.typing as npt

from servogen.compiler.passes.superoptimise import FLAGS, RuleInstruction
from servogen.pic.isa import mnemonics
from tools.superoptimiser.machine import NAMES, State, run

SAMPLES = 256
"""States in which sequences are compared before a rule is proven for all of them."""

MAX_CANDIDATES = 40
"""Sequences kept for one behaviour: some differ from what is sought in states that are not sampled."""

Hashes = npt.NDArray[np.uint64]
Codes = npt.NDArray[np.int64]
Sequence_ = tuple[RuleInstruction, ...]

_UNKNOWN, _NEW, _TWIN, _SHORTER = range(4)
"""What is known of a sequence: nothing, that no earlier one equals it, that one of its length does, or a
shorter one."""


def parse(*texts: str) -> Sequence_:
    return tuple(map(RuleInstruction.parse, texts))


POOL = (0, 1, 2, 15, 127, 128, 240, 254, 255)
"""Literals that rules name; any other is "k"."""
_LITERALS = (*map(str, POOL), "k")
_BITS = [f"{f}.{bit}" for f in "ab" for bit in range(8)]
_ON_FILES = mnemonics(lambda row: row.operands == "fd" and not row.skips)
SIMPLE = parse(
    *(f"{op} {f},{d}" for op in sorted(_ON_FILES) for f in "ab" for d in "WF"),
    *(f"{op} {f}" for op in ("MOVWF", "CLRF") for f in "ab"),
    *(f"{op} {k}" for op in ("MOVLW", "ADDLW", "SUBLW", "ANDLW", "IORLW", "XORLW") for k in _LITERALS),
    *(f"{op} {bit}" for op in ("BCF", "BSF") for bit in ("C", *_BITS)),
)
SKIPS = parse(
    *(f"{op} {bit}" for op in ("BTFSC", "BTFSS") for bit in ("C", "Z", *_BITS)),
    *(f"{op} {f},{d}" for op in ("INCFSZ", "DECFSZ") for f in "ab" for d in "WF"),
)
ALL = (*SIMPLE, *SKIPS)
_NUMBERS = {each: number for number, each in enumerate(ALL)}


def exchanged(each: RuleInstruction) -> RuleInstruction:
    """Return an instruction with `a` and `b` exchanged."""
    return RuleInstruction(each.op, {"a": "b", "b": "a"}.get(each.f, each.f), each.d, each.b, each.k)


_EXCHANGED = np.array([_NUMBERS[exchanged(each)] for each in ALL])
_BASE = len(ALL)


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


_WEIGHTS = np.random.default_rng(16).integers(1, 1 << 63, (len(NAMES), SAMPLES), np.uint64) | np.uint64(1)


@numba.njit(cache=True)
def _sums(values: npt.NDArray[np.uint8], weights: Hashes) -> Hashes:
    out = np.zeros(len(values), np.uint64)
    for row in range(len(values)):
        total = np.uint64(0)
        for column in range(values.shape[1]):
            total += np.uint64(values[row, column]) * weights[column]
        out[row] = total
    return out


def hashed(state: Mapping[str, npt.NDArray[np.uint8]]) -> Hashes:
    """Return a number for what each name holds (states, names)."""
    columns = [_sums(np.ascontiguousarray(state[name]), _WEIGHTS[row]) for row, name in enumerate(NAMES)]
    return np.stack(columns, axis=1)


# behaviours


@dataclass(frozen=True, slots=True)
class Sought:
    """What a sequence has to do: the same as `old` but for what is dead, with fewer instructions."""

    old: Sequence_
    dead: frozenset[str]

    @property
    def mask(self) -> int:
        return sum(1 << row for row, name in enumerate(NAMES) if name not in self.dead)

    def exchanged(self) -> Sought:
        names = {"a": "b", "b": "a"}
        return Sought(tuple(map(exchanged, self.old)), frozenset(names.get(each, each) for each in self.dead))


@numba.njit(cache=True)
def _probe(
    hashes: Hashes,
    masks: Codes,
    filter_: npt.NDArray[np.bool_],
    keys: Hashes,
    wanted: Codes,
    out: Codes,
) -> int:
    """Write the (row, key's number) of each state that looks, under a mask, like one of the sorted keys.

    `wanted` says of how many more sequences each key has to be given; the number written is returned.
    """
    found = 0
    sums = np.zeros(64, np.uint64)
    for row in range(len(hashes)):
        for mask in range(1, 64):
            low = 0
            while not mask >> low & 1:
                low += 1
            sums[mask] = sums[mask & (mask - 1)] + hashes[row, low]
        for mask in masks:
            key = sums[mask] + np.uint64(mask)
            if filter_[key >> np.uint64(44)]:
                at = np.searchsorted(keys, key)
                if at < len(keys) and keys[at] == key and wanted[at] > 0:
                    wanted[at] -= 1
                    out[found, 0] = row
                    out[found, 1] = at
                    found += 1
    return found


@numba.njit(cache=True)
def _entered(whole: Hashes, length: int, table: Hashes, out: npt.NDArray[np.uint8]) -> int:
    """Enter states into a hash table with the length of the sequence; write what is known of each.

    The number of new ones is returned. The lowest three bits of an entry are the length.
    """
    size, low = np.uint64(len(table) - 1), np.uint64(7)
    count = 0
    for row in range(len(whole)):
        value = whole[row] & ~low
        at = (value * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(20) & size
        while table[at] != 0 and table[at] & ~low != value:
            at = at + np.uint64(1) & size
        if table[at] == 0:
            table[at] = value | np.uint64(length)
            out[row] = _NEW
            count += 1
        else:
            out[row] = _TWIN if table[at] & low == length else _SHORTER
    return count


@dataclass(slots=True)
class Coverage:
    """How many sequences of one length there are, and what became of them."""

    length: int
    all: int
    """Sequences of this length, in canonical naming."""
    pruned: int = 0
    """Left out, because a part of them has an earlier twin."""
    listed: int = 0
    new: int = 0
    """Of those listed: how many do what no earlier one does. Not counted for the last length."""
    seconds: float = 0.0

    @property
    def complete(self) -> bool:
        return self.pruned + self.listed == self.all

    def __str__(self) -> str:
        share = 100 * (self.pruned + self.listed) / self.all
        new = f", {self.new} do something new" if self.new else ""
        return (
            f"{self.length} instructions: {share:.1f} % of {self.all} sequences: {self.pruned} have a part"
            f" with an earlier twin, {self.listed} were run{new}; {self.seconds:.0f} s"
        )


class Behaviours:
    """What is sought, by fingerprint, and the sequences found for each."""

    def __init__(self, sought: Sequence[Sought]) -> None:
        self.candidates: dict[Sought, list[Sequence_]] = {each: [] for each in sought}
        by_key: dict[int, list[tuple[Sought, bool]]] = {}
        start = {name: value[None] for name, value in samples().items()}
        for each in sought:
            for form, mirrored in ((each, False), (each.exchanged(), True)):
                whole = hashed(run(form.old, start))[0] * _MIXERS
                live = [row for row in range(len(NAMES)) if form.mask >> row & 1]
                key = int(whole[live].sum(dtype=np.uint64) + np.uint64(form.mask))
                by_key.setdefault(key, []).append((each, mirrored))
        self._keys = np.array(sorted(by_key), np.uint64)
        self._sought = [by_key[int(key)] for key in self._keys]
        self._longest = np.array([max(len(one.old) for one, _ in each) for each in self._sought])
        self._masks = np.array(sorted({form.mask for one in sought for form in (one, one.exchanged())}))
        self._filter = np.zeros(1 << 20, np.bool_)
        self._filter[self._keys >> np.uint64(44)] = True
        self._wanted = np.full(len(self._keys), MAX_CANDIDATES, np.int64)

    def of_length(self, length: int) -> None:
        """Do without what the sequences that come now are too long for."""
        self._wanted[self._longest <= length] = 0

    def look_up(self, mixed: Hashes, sequence: Callable[[int], Sequence_]) -> None:
        """Keep those sequences that do what is sought in all samples."""
        out = np.empty((len(mixed) * len(self._masks), 2), np.int64)
        for row, at in out[: _probe(mixed, self._masks, self._filter, self._keys, self._wanted, out)]:
            new = sequence(int(row))
            for sought, mirrored in self._sought[at]:
                if len(new) < len(sought.old):
                    self.candidates[sought].append(tuple(map(exchanged, new)) if mirrored else new)


# enumeration


_MIXERS = np.random.default_rng(628).integers(1, 1 << 63, len(NAMES), np.uint64) | np.uint64(1)
_PLAIN = np.array([each.f not in ("a", "b") for each in ALL])


def _first_byte(numbers: Sequence[int]) -> str:
    return next((ALL[each].f for each in numbers if ALL[each].f in ("a", "b")), "")


def _number(numbers: Sequence[int]) -> int:
    """Return the number of a sequence among all of its length."""
    total = 0
    for each in numbers:
        total = total * _BASE + each
    return total


SINGLES = [(number,) for number in range(len(SIMPLE))]
PAIRS = list(product(range(len(SIMPLE), _BASE), range(len(SIMPLE))))
_UNITS = {1: SINGLES, 2: PAIRS}
"""What sequences consist of: an instruction, or a skip with the instruction that it skips."""


def _tails(length: int) -> Iterator[tuple[int, ...]]:
    if length == 0:
        yield ()
    for size, units in _UNITS.items():
        if size <= length:
            for rest in _tails(length - size):
                for unit in units:
                    yield (*rest, *unit)


@dataclass(slots=True)
class _Units:
    """Units of one size that sequences begin or end with."""

    units: list[tuple[int, ...]]
    numbers: Codes
    mirrored: Codes
    """The numbers of the same units with `a` and `b` exchanged."""
    bytes: list[str]
    """Which byte each names first, "" for none."""

    @classmethod
    def of(cls, size: int, names: str = "") -> _Units:
        """Return all units, or those that name `a` first, or "-" for those that name neither."""
        wanted = {"": ("", "a", "b"), "-": ("",)}.get(names, (names,))
        units = [each for each in _UNITS[size] if _first_byte(each) in wanted]
        return cls(
            units,
            np.array([_number(each) for each in units]),
            np.array([_number(_EXCHANGED[list(each)].tolist()) for each in units]),
            [_first_byte(each) for each in units],
        )

    def states(self) -> State:
        """Return the states behind each unit, one row per unit."""
        start = {name: value[None] for name, value in samples().items()}
        each = [run((ALL[number] for number in unit), start) for unit in self.units]
        return {name: np.concatenate([state[name] for state in each]) for name in NAMES}


@dataclass
class Enumeration:
    """All sequences up to a length, as many of them as there is time for."""

    longest: int
    behaviours: Behaviours
    seconds: float
    frequency: Mapping[Sequence_, int]
    """How often parts of sequences occur in programs: sequences with frequent inner parts come first."""
    report: Callable[[str], None] = print

    def run(self) -> list[Coverage]:
        """Enumerate; return what was covered."""
        self._end = time.process_time() + self.seconds
        self._start = {name: value[None] for name, value in samples().items()}
        self._literals = {"k": self._start["k"]}
        self._status: dict[int, npt.NDArray[np.uint8]] = {}
        self._table = np.zeros(1 << (22 if self.longest < 5 else 26), np.uint64)
        known = np.zeros(1, np.uint8)
        _entered(self._whole(hashed(self._start) * _MIXERS), 0, self._table, known)
        found = []
        for length in range(1, self.longest + 1):
            self.behaviours.of_length(length)
            if length < self.longest:
                self._status[length] = np.zeros(_BASE**length, np.uint8)
            found.append(self._of_length(length))
            self.report(str(found[-1]))
            if not found[-1].complete:
                break
        return found

    @staticmethod
    def _whole(mixed: Hashes) -> Hashes:
        return np.asarray(mixed.sum(axis=1), np.uint64)

    def _of_length(self, length: int) -> Coverage:
        began = time.process_time()
        coverage = Coverage(length, canonical(length))
        if length in _UNITS:
            for names in ("-", "a"):
                units = _Units.of(length, names)
                self._take(coverage, units.states(), units.units, units.numbers)
        for first, last, tail in self._shapes(length):
            if time.process_time() > self._end:
                break
            self._extend(coverage, first, tail, last)
        coverage.seconds = time.process_time() - began
        return coverage

    def _shapes(self, length: int) -> list[tuple[int, int, tuple[int, ...]]]:
        """Return the sizes of the first and last unit and what is between, the most frequent first."""
        found = [
            (first, last, tail)
            for first, last in product(_UNITS, _UNITS)
            if first + last <= length
            for tail in _tails(length - first - last)
        ]

        def rank(shape: tuple[int, int, tuple[int, ...]]) -> int:
            tail = shape[2]
            mirrored = _EXCHANGED[list(tail)].tolist() if _first_byte(tail) == "b" else tail
            return -self.frequency.get(tuple(ALL[each] for each in mirrored), 0)

        return sorted(found, key=rank)

    def _extend(self, coverage: Coverage, first: int, tail: tuple[int, ...], last: int) -> None:
        """Take all sequences of a unit, a tail and a unit that are worth running."""
        length, lasts = coverage.length, units_of(last)
        byte = _first_byte(tail)
        number = _number(tail)
        suffixes = self._status[len(tail) + last]
        plain = suffixes[number * _BASE**last + lasts.numbers]
        exchanged_ = suffixes[_number(_EXCHANGED[list(tail)].tolist()) * _BASE**last + lasts.mirrored]
        # a twin of the same length of an exchanged part may come later: only a shorter one counts
        exchanged_ = np.where(exchanged_ == _SHORTER, _SHORTER, _NEW).astype(np.uint8)
        names_b = np.array([(byte or each) == "b" for each in lasts.bytes])
        known = np.where(names_b, exchanged_, plain)
        for names in ("-", "a"):
            firsts = units_of(first, names)
            allowed = np.ones(len(lasts.units), np.bool_) if names == "a" else ~names_b
            if not allowed.any():
                continue
            prefixes = firsts.numbers * _BASE ** len(tail) + number
            prefix = self._status[first + len(tail)][prefixes]
            numbers = prefixes * _BASE**last
            worth = prefix == _NEW
            runs = allowed & (known == _NEW) & worth.any()
            count = int(worth.sum()) * int(runs.sum())
            coverage.pruned += int(allowed.sum()) * len(prefix) - count
            if length < self.longest:
                for at in np.flatnonzero(allowed):
                    self._status[length][numbers + lasts.numbers[at]] = np.maximum(prefix, known[at])
            if not count:
                continue
            state = {name: value[worth] for name, value in _states(first, names).items()} | self._literals
            state = run((ALL[each] for each in tail), state)
            base = hashed(state) * _MIXERS
            units = [unit for unit, kept in zip(firsts.units, worth, strict=True) if kept]
            for at in np.flatnonzero(runs):
                unit = lasts.units[at]
                after = run((ALL[each] for each in unit), state)
                mixed = base.copy()
                for row, name in enumerate(NAMES):
                    if after[name] is not state[name]:
                        mixed[:, row] = _sums(after[name], _WEIGHTS[row]) * _MIXERS[row]
                self._enter(coverage, mixed, units, (*tail, *unit), numbers[worth] + lasts.numbers[at])

    def _take(self, coverage: Coverage, state: State, units: list[tuple[int, ...]], numbers: Codes) -> None:
        self._enter(coverage, hashed(state) * _MIXERS, units, (), numbers)

    def _enter(
        self,
        coverage: Coverage,
        mixed: Hashes,
        units: list[tuple[int, ...]],
        rest: tuple[int, ...],
        numbers: Codes,
    ) -> None:
        """Enter sequences that were run: the units, each followed by the rest."""
        coverage.listed += len(mixed)
        if coverage.length < self.longest:
            known = np.zeros(len(mixed), np.uint8)
            coverage.new += _entered(self._whole(mixed), coverage.length, self._table, known)
            self._status[coverage.length][numbers] = known
        self.behaviours.look_up(mixed, lambda row: tuple(ALL[number] for number in (*units[row], *rest)))


@cache
def units_of(size: int, names: str = "") -> _Units:
    return _Units.of(size, names)


@cache
def _states(size: int, names: str) -> State:
    return units_of(size, names).states()


def canonical(length: int) -> int:
    """Return the number of sequences of a length whose first byte, if there is one, is `a`."""

    def count(size: int, simple: int, skips: int) -> int:
        if size <= 0:
            return int(size == 0)
        return simple * (count(size - 1, simple, skips) + skips * count(size - 2, simple, skips))

    plain = _PLAIN.astype(int)
    without = count(length, int(plain[: len(SIMPLE)].sum()), int(plain[len(SIMPLE) :].sum()))
    return (count(length, len(SIMPLE), len(SKIPS)) + without) // 2
