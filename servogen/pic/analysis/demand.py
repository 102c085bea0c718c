"""Demand: the bytes, at each point of a program, from which an index, a pointer or pins are computed later.

In: the graph of what a first exploration executed, and the instructions that are to be decided. Out: a
`SplitPlan`: for each node, the places whose values decide them. It only determines which states are kept
apart and which values are not widened: a missing place costs precision, an unnecessary one costs time, and
neither affects soundness.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field

from servogen.graph import reached
from servogen.pic.analysis.state import Place, bit, bits
from servogen.pic.device import RAM_FIRST, RAM_LAST
from servogen.pic.known_values import CARRY, FSR, INDF, DecodedWord, Undefined, W, word_of

Node = tuple[int, tuple[int, ...]]
"""An address with the return addresses on the stack."""
FEW_BITS = 4
"""A mask of up to this many bits bounds a value well enough: its origin is not followed."""
APART = (W, *range(RAM_FIRST, RAM_LAST + 1))
"""The places by whose values states may be kept apart; they always are by that of FSR."""


@dataclass(slots=True)
class ExecutionGroup:
    """What the executions of one instruction have in common, with one content of the stack."""

    followers: set[Node] = field(default_factory=set)
    places: set[Place | None] = field(default_factory=set)
    """The bytes that its operand may address; None: one that is not tracked."""


class Graph:
    """The instructions that an exploration executed, with their followers and the bytes that they address."""

    def __init__(self, words: Mapping[int, int], visits: Mapping[Node, ExecutionGroup]) -> None:
        self._visits = visits
        self._words: dict[int, DecodedWord] = {}
        for address in {address for address, _ in visits}:
            try:
                self._words[address] = word_of(words[address])
            except Undefined:
                continue
        self._preceding: dict[Node, list[Node]] = {node: [] for node in visits}
        for node, visit in visits.items():
            for follower in visit.followers & visits.keys():
                self._preceding[follower].append(node)
        self._free: int | None = None

    def indices(self) -> dict[Node, int]:
        """Return the computed jumps and the instructions that use a pointer, with what they use."""
        used = {node: _index(self._words[node[0]]) for node in self._visits if node[0] in self._words}
        return {node: places for node, places in used.items() if places}

    def alike(self, node: Node) -> list[Node]:
        """Return the instructions that write the same operand with the same content of the stack: if one of
        them is not decided, the others are not, either.
        """
        word, stack = self._words.get(node[0]), node[1]
        if word is None or word.writes_pcl or not word.writes_f:
            return [node]  # None: only a jump beyond its table leads there
        candidates = [other for other in self._visits if other[1] == stack and other[0] in self._words]
        words = [(other, self._words[other[0]]) for other in candidates]
        return [
            node,
            *(other for other, written in words if written.writes_f and written.f == word.f),
        ]

    def demanded(self, uses: Mapping[Node, int]) -> dict[Node, int]:
        """Return, for each node, the places from which those are made that are used later, as bit sets."""
        # Backwards to the fixed point, so a node comes back as often as its set grows: no search of what is
        # reached. One that waits already is not queued again.
        demanded: dict[Node, int] = {}
        waiting = list(self._visits)
        queued = set(waiting)
        while waiting:
            node = waiting.pop()
            queued.discard(node)
            after = 0
            for follower in self._visits[node].followers:
                after |= demanded.get(follower, 0)
            before = self._before(node, after) | uses.get(node, 0)
            if before != demanded.get(node, 0):
                demanded[node] = before
                fresh = [preceding for preceding in self._preceding[node] if preceding not in queued]
                queued.update(fresh)
                waiting += fresh
        return demanded

    def _before(self, node: Node, after: int) -> int:
        """Return the places that are demanded before an instruction, from those after it."""
        word = self._words.get(node[0])
        if word is None:
            return after
        if word.writes_pcl:  # the byte of a table depends on the index
            return after
        places = self._visits[node].places
        written, certain = _written(word, places)
        if not written & after:
            return after
        # A byte that is certainly overwritten here is not demanded from before; one that may be, still is.
        before = after & ~certain
        if not _bounds(word):
            if "W" in word.reads:
                before |= bit(W)
            if "f" in word.reads:
                before |= bits(place for place in places if place is not None)
            if "C" in word.reads:
                before |= bit(CARRY)
        return before

    # values that come from outside

    def free(self) -> int:
        """Return the bit set of the bytes that are given a masked value or an input."""
        if self._free is None:
            self._free = self._given_what_is_free()
        return self._free

    def _given_what_is_free(self) -> int:
        """Follow, forward, where W holds what is not followed."""
        free = 0

        def given(at: tuple[Node, bool]) -> list[tuple[Node, bool]]:
            """Return where W holds what is not followed after a node, before which it may hold it."""
            nonlocal free
            node, holds = at
            word = self._words.get(node[0])
            visit = self._visits[node]
            if word is not None:
                if word.writes_f and holds and "W" in word.reads:
                    free |= bits(place for place in visit.places if place is not None)
                holds = _holds_free(word, visit.places, before=holds)
            return [(follower, True) for follower in visit.followers & self._visits.keys() if holds]

        for _ in reached([(node, False) for node in self._visits], given):
            pass
        return free


def _index(word: DecodedWord) -> int:
    """Return what an instruction uses as an index or a pointer."""
    if word.writes_pcl:
        return bit(W)
    return bit(FSR) if word.has_f and word.f == INDF else 0


def _bounds(word: DecodedWord) -> bool:
    """Return whether an instruction bounds its result by itself."""
    return word.name == "ANDLW" and word.k.bit_count() <= FEW_BITS


def _written(word: DecodedWord, places: Iterable[Place | None]) -> tuple[int, int]:
    """Return the tracked places that an instruction may and must write."""
    written = certain = 0
    if word.writes_w:
        written = certain = bit(W)
    elif word.writes_f:
        written = bits(place for place in places if place is not None)
        certain = written if written.bit_count() == 1 else 0
    flags = bit(CARRY) if "C" in word.flags else 0
    return written | flags, certain | flags


def _holds_free(word: DecodedWord, places: Collection[Place | None], *, before: bool) -> bool:
    """Return whether W holds what is not followed after an instruction."""
    if word.writes_pcl:
        return False
    if not word.writes_w:
        return before
    if _bounds(word):
        return True
    outside = "f" in word.reads and None in places
    return outside or (before and "W" in word.reads)


@dataclass(frozen=True, slots=True)
class SplitPlan:
    """Which states are kept apart, in order to decide some jumps, pointers and writes of pins."""

    uses: Mapping[Node, int]
    """The instructions for whose sake states are kept apart, and what they use, as bit sets."""
    pins: bool
    """Whether they are kept apart for the sake of the pins that are written, too."""
    apart: Mapping[Node, tuple[Place, ...]]
    """The places by whose values the states of a node are kept apart."""
    kept: Mapping[Node, int]
    """The places whose values are not widened, as bit sets."""

    @classmethod
    def of(cls, graph: Graph, uses: Mapping[Node, int], *, pins: bool) -> SplitPlan:
        """Return the plan that keeps states apart for the sake of `uses`, and widens no index."""
        free = graph.free()
        apart = {
            node: places
            for node, demanded in graph.demanded(uses).items()
            if (places := tuple(place for place in APART if demanded & ~free & bit(place)))
        }
        return cls(dict(uses), pins, apart, graph.demanded(graph.indices()))
