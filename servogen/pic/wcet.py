"""Best-case and worst-case execution times, from the words of a program.

In: program words and the starts of its functions. Out: `Times` of a function, from its first instruction to
the end of its return; or the maximum number of cycles from one address to others. Costs are those of DS35007
table 7-2.

Instructions are executed abstractly, with the values that are known, so that a loop whose counter starts at a
constant is repeated exactly as often as on the chip; if a value is not known, both edges of a skip are
followed. The result is a graph of states, a state being an address with the values known there. A cycle in
the graph is a loop without a known bound; without cycles, the times are its shortest and its longest path.
Three techniques keep the graph small:

- values that no instruction will read any more are dropped, so that paths merge;
- a loop that only counts is one step (`_counted_loop`), as are the iterations of a loop that differ only in
  the counter (`_Walk.turns`), and a piece of code that always takes the same time (`pieces`);
- a function is explored once, with nothing known, and again for the values of one call only if the first
  exploration finds no bound.

A recursion is followed only as far as the values that are known bound it. More calls in each other than the
stack has levels have no bound, because the chip then forgets the first return address.

Interrupts are not counted. The bytes that an interrupt changes must be given as `changing`.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache, cached_property

from servogen.graph import bottom_up, components, reached
from servogen.pic.device import ERASED_WORD, PROGRAM_WORDS, RAM_FIRST, RAM_LAST, STACK_LEVELS
from servogen.pic.known_values import (
    CARRY,
    FSR,
    INDF,
    STATUS,
    ZERO,
    DecodedWord,
    Known,
    Undefined,
    W,
    execute,
    skipped,
    word_of,
)
from servogen.pic.listing import ListedFunction
from servogen.units import Cycles

MAX_STATES = 200_000
"""The number of states between two addresses after which the search is given up."""
MAX_FUNCTION_STATES, MAX_PROGRAM_STATES = 2_000, 8_000
"""These limits for one function of a program, and for all functions, which bound the time of the compiler."""
_MAX_NESTING = 4 * STACK_LEVELS
"""The number of calls in each other beyond which nothing is explored: a recursion of as many turns as a byte
counts would not fit on the stack of Python.
"""
_PASSES = 0x1000
"""Places from here on count how often an address was passed, for loops whose bound is given."""
_STARTING = -1
"""The mark of the function of a walk's first instruction, to which the walk may return."""
_MAX_TURN = 400
"""The maximum number of steps of a turn of a loop that are examined."""
_MAX_UNEVEN = 2
"""Uneven turns in succession after which a loop is followed turn by turn. The first turn of a loop around a
counting loop is uneven: only from the second one on does the inner counter start at 0.
"""
_ALL_PLACES = (1 << RAM_LAST + 1) - 1
_BITS = {W: RAM_LAST + 1, CARRY: RAM_LAST + 2, ZERO: RAM_LAST + 3}


@dataclass(frozen=True, slots=True)
class Unbounded:
    """The reason why a time has no upper bound: a "loop", a "call", a "computed jump", "sleep", "stack" (more
    calls in each other than it has levels), or "too many states".
    """

    kind: str
    addresses: tuple[int, ...]
    """The words of the loop, or the one that calls, jumps or sleeps."""


@dataclass(frozen=True, slots=True)
class Times:
    """Times of a function; `shortest` is None if it never returns, `longest` if there is no bound."""

    shortest: Cycles | None
    longest: Cycles | None
    unbounded: tuple[Unbounded, ...] = ()
    levels: int = field(default=0, compare=False)
    """The levels of the stack that its calls take."""


_Call = tuple[int, tuple[tuple[int, int], ...]]
"""The start of a function, and the values that are known when it is called."""
_State = tuple[int, int, tuple[int, ...], tuple[tuple[int, int], ...]]
"""An address, the function that it belongs to, the return addresses, the known values."""
_Point = tuple[int, int, tuple[int, ...], Known]
"""A state on the way from one node of the graph to the next: the known values are updated in place."""
_Step = tuple[int, int | None, _Point | None]
"""(minimum cycles, maximum cycles, where they lead, or None for the end)."""
_Edge = tuple[int, int | None, int | None]
"""(minimum cycles, maximum cycles, number of the next state, or None for the end)."""


@dataclass(frozen=True, slots=True)
class _Piece:
    """Code that always takes the same time from its start to `end`."""

    cycles: int
    end: int
    changes: frozenset[int]
    levels: int


class _NoBound(Exception):
    """Raised for something whose time is not known."""

    def __init__(self, kind: str, address: int) -> None:
        self.why = Unbounded(kind, (address,))


class _Decoded(dict[int, DecodedWord]):
    """The instructions by address, decoded when they are first needed. Raises Undefined."""

    def __init__(self, words: Mapping[int, int]) -> None:
        super().__init__()
        self._words = words

    def __missing__(self, address: int) -> DecodedWord:
        word = self[address] = word_of(self._words.get(address, ERASED_WORD))
        return word


class TimedProgram:
    """The words of a program, and the times of its functions.

    `bounds` gives, for addresses inside loops, how often one call can pass them. `pieces` are (start, end) of
    code that is worth exploring once on its own, such as delays. `targets` gives the addresses that a
    computed jump can reach, if it is not one into a table of RETLWs.
    """

    def __init__(
        self,
        words: Mapping[int, int],
        functions: Iterable[ListedFunction],
        *,
        changing: Collection[int] = (),
        bounds: Mapping[int, int] | None = None,
        pieces: Iterable[tuple[int, int]] = (),
        targets: Mapping[int, Collection[int]] | None = None,
    ) -> None:
        self._words = words
        self.decoded = _Decoded(words)
        self._targets = targets or {}
        self.functions = {function.start: function for function in functions}
        self.changing = frozenset(changing)
        self.bounds = bounds or {}
        self._pieces = dict(pieces)
        self._piece_times: dict[int, _Piece | None] = {}
        self._times: dict[_Call, Times] = {}
        self._reached: dict[int, frozenset[int]] = {}
        self._changes: dict[int, frozenset[int]] = {}
        self._read: dict[int, int] = {}
        self._called_without: set[int] = set()
        self._heads: set[int] | None = None
        self._states_left = MAX_PROGRAM_STATES
        self._being_timed: set[_Call] = set()
        self._recursive: set[_Call] = set()
        """The calls being timed that what is being timed now leads back to."""

    def word(self, address: int) -> DecodedWord:
        """Return the instruction at an address. Raises Undefined."""
        return self.decoded[address]

    @cached_property
    def _defined(self) -> Mapping[int, DecodedWord]:
        """Return the instructions by address, without the words that no data sheet defines."""
        defined: dict[int, DecodedWord] = {}
        for address in self._words:
            with suppress(Undefined):
                defined[address] = self.word(address)
        return defined

    @cached_property
    def plain(self) -> frozenset[int]:
        """Return the addresses of instructions that only go on to the next, and begin no counting loop."""
        return frozenset(address for address, word in self._defined.items() if self._is_plain(address, word))

    def _is_plain(self, address: int, word: DecodedWord) -> bool:
        if address in self.bounds or address in self._pieces or address + 1 == PROGRAM_WORDS:
            return False
        begins_counting = word.name == "DECF" or (word.name, word.k) == ("ADDLW", 0xFF)
        return word.flow == "next" and not word.writes_pcl and word.name != "SLEEP" and not begins_counting

    @cached_property
    def called(self) -> frozenset[int]:
        """Return the addresses that calls lead to."""
        return frozenset(word.k for word in self._defined.values() if word.flow == "call")

    @cached_property
    def home(self) -> Mapping[int, int]:
        """Return the first address of the function that each address belongs to."""
        return {
            address: function.start
            for function in self.functions.values()
            for address in range(function.start, function.end)
        }

    # times

    def times(self, start: int) -> Times:
        """Return the times of the function at `start`, for any arguments."""
        return self._times_from(start, ())

    def times_with_arguments(self, start: int) -> Times:
        """Return the times over all its calls, if they are bounded only with the values that these pass."""
        alone = self.times(start)
        calls = [times for (address, known), times in self._times.items() if address == start and known]
        if alone.longest is not None or not calls or start in self._called_without:
            return alone
        if any(call.longest is None for call in calls):
            return alone
        shortest = [call.shortest for call in calls if call.shortest is not None]
        longest = [call.longest for call in calls if call.longest is not None]
        return Times(min(shortest, default=None), max(longest))

    def longest(self, start: int, ends: Collection[int], without: Collection[int] = ()) -> Cycles | None:
        """Return the maximum number of cycles from `start` to the first of `ends`; paths through `without`
        are excluded.

        None if a loop has no known bound, no path leads to an end, or a computed jump leads anywhere but into
        a table of RETLW. A return from the function that `start` is in goes to each of its callers.
        """
        try:
            walk = _Walk(self, frozenset(ends), frozenset(without), MAX_STATES, returns_to_callers=True)
            walk.explore((start, self._home_of(start), (), ()))
        except (_NoBound, Undefined):
            return None
        return walk.times().longest

    def between(
        self, start: int, ends: Collection[int], *, without: Collection[int] = (), must_end: bool = False
    ) -> Times:
        """Return the times from `start` to the first of `ends`, on the paths that lead there.

        With `must_end` a jump to itself that is no end is a loop like any other; without it, paths that stay
        there do not count. Paths through `without` are excluded.
        """
        walk = _Walk(self, frozenset(ends), frozenset(without), MAX_STATES, returns_to_callers=True)
        walk.counts_standing_still = must_end
        try:
            home = self._home_of(start)
            # Coming back to the start is an end of its own: no other state has this home.
            walk.explore((start, _STARTING if start in ends else home, (), ()))
        except _NoBound as reason:
            return Times(None, None, (reason.why,))
        except Undefined:
            return Times(None, None, (Unbounded("undefined word", (start,)),))
        return walk.times()

    # facts for the walks, computed once

    def _home_of(self, address: int) -> int:
        if address not in self.home:
            raise _NoBound("computed jump", address)
        return self.home[address]

    def _times_from(self, start: int, known: tuple[tuple[int, int], ...]) -> Times:
        key = (start, known)
        if key in self._being_timed:
            self._recursive.add(key)
            return Times(None, None, (Unbounded("call", (start,)),))
        if key in self._times:
            return self._times[key]
        if len(self._being_timed) == _MAX_NESTING:
            return Times(Cycles(0), None, (Unbounded("stack", (start,)),))
        recursive, self._recursive = self._recursive, set()
        self._being_timed.add(key)
        try:
            times = self._explored(start, known)
        finally:
            self._being_timed.remove(key)
            self._recursive.discard(key)
        # What calls a function that is being timed has a shortest path for that one only.
        self._times[key] = replace(times, shortest=Cycles(0)) if self._recursive else times
        self._recursive |= recursive
        return times

    def _explored(self, start: int, known: tuple[tuple[int, int], ...]) -> Times:
        try:
            walk = self._walk(start, known)
            # A function with too many states is explored once more with only what bounds its loops,
            # unless nothing else was known.
            if not walk.complete and not walk.known_places() <= (counters := self._counters(start)):
                walk = self._walk(start, known, tracked=counters)
        except Undefined:
            return Times(None, None, (Unbounded("computed jump", (start,)),))
        return walk.times()

    def _walk(
        self, start: int, known: tuple[tuple[int, int], ...], tracked: frozenset[int] | None = None
    ) -> _Walk:
        """Return the graph of a function called with these values, of as many states as are left."""
        limit = min(MAX_FUNCTION_STATES, self._states_left)
        walk = _Walk(self, frozenset(), frozenset(), limit, tracked=tracked)
        walk.explore((start, start, (), known))
        self._states_left -= len(walk.edges)
        return walk

    def call(self, target: int, known: Known) -> Times:
        """Return the times of a function called with these values."""
        times = self.times(target)
        if times.longest is None:
            # Values that the function never reads would only split the calls into more cases.
            read = self.live.get(target, -1) & self.reads(target)
            brought = tuple(sorted((place, known[place]) for place in known if read & _bit(place)))
            if brought:
                return self._times_from(target, brought)
            self._called_without.add(target)
        return times

    def piece(self, address: int) -> _Piece | None:
        """Return the piece of code that begins at an address, if it always takes the same time."""
        if address not in self._pieces:
            return None
        if address not in self._piece_times:
            self._piece_times[address] = None  # while it is being explored it is not one step
            self._piece_times[address] = self._explored_piece(address, self._pieces[address])
        return self._piece_times[address]

    def _explored_piece(self, start: int, end: int) -> _Piece | None:
        walk = _Walk(self, frozenset({end}), frozenset(), MAX_FUNCTION_STATES)
        walk.explore((start, start, (), ()))
        times = walk.times()
        if not walk.complete or times.longest is None or times.shortest != times.longest:
            return None
        words = [self.word(address) for address in range(start, end)]
        changed = {W, CARRY, ZERO}.union(*(self.changes(word.k) for word in words if word.flow == "call"))
        fs = {word.f for word in words if word.writes_f}
        # A write through INDF may change any byte: a step over the piece would have to forget everything.
        return None if INDF in fs else _Piece(times.longest, end, frozenset(changed | fs), times.levels)

    def following(self, starts: Iterable[int]) -> frozenset[int]:
        """Return the addresses that may be executed after any of `starts`, and these; a return leads to every
        call of its function.
        """

        def successors(address: int) -> Iterable[int]:
            word = self._defined.get(address)
            if word is None:  # it does nothing that a data sheet defines, and goes on
                return (_beyond(address, 1),) if address in self._words else ()
            returns = self.callers(address) if word.flow == "return" or word.writes_pcl else ()
            return (*self._followers_and_called(address), *returns)

        return frozenset(self._words.keys() & reached(starts, successors))

    def reached(self, start: int) -> frozenset[int]:
        """Return the addresses that a call of `start` may execute, without the RETLWs of tables."""
        if start not in self._reached:
            self._reached[start] = frozenset(
                self._words.keys() & reached([start], self._followers_and_called)
            )
        return self._reached[start]

    def _followers_and_called(self, address: int) -> list[int]:
        """Return the addresses inside the function where execution may continue, and a function it calls."""
        if address not in self._words:
            return []
        word = self.word(address)
        return [*self._followers(address), *([word.k] if word.flow == "call" else [])]

    def _followers(self, address: int) -> list[int]:
        """Return the addresses inside the function where execution may continue."""
        word = self.word(address)
        if word.flow == "jump":
            return [word.k]
        if word.writes_pcl:
            return list(self._targets.get(address, ()))
        if word.flow == "return":
            return []
        words = (1, 2) if word.flow == "skip" else (1,)
        return [_beyond(address, count) for count in words]

    def changes(self, start: int) -> frozenset[int]:
        """Return the places that a call of `start` may change; through INDF this may be any place."""
        if start not in self._changes:
            fs = {word.f for word in map(self.word, self.reached(start)) if word.writes_f}
            every = range(RAM_FIRST, RAM_LAST + 1) if INDF in fs else fs
            self._changes[start] = frozenset({W, CARRY, ZERO, FSR, *every})
        return self._changes[start]

    def reads(self, start: int) -> int:
        """Return the places that a call of `start` may read, as a bit set."""
        if start not in self._read:
            places = 0
            for address in self.reached(start):
                places |= uses_and_kills(self.word(address))[0]
            self._read[start] = places
        return self._read[start]

    def _counters(self, start: int) -> frozenset[int]:
        """Return the bytes that the function at `start` counts in, W, FSR and the flags."""
        words = [self.word(address) for address in self.reached(start)]
        counts = {word.f for word in words if word.name in ("DECFSZ", "INCFSZ", "DECF", "INCF")}
        return frozenset({W, CARRY, ZERO, FSR, *counts})

    @property
    def heads(self) -> set[int]:
        """Return the addresses that are reached other than from the preceding instruction; states are kept
        there.
        """
        if self._heads is None:
            self._heads = set(self.functions) | set(self.bounds)
            for address, word in self._defined.items():
                if word.flow in ("jump", "call"):
                    self._heads |= {word.k, _beyond(address, 1)}
        return self._heads

    @cached_property
    def loop_heads(self) -> frozenset[int]:
        """Return the addresses that jumps lead back to."""
        return frozenset(
            word.k for address, word in self._defined.items() if word.flow == "jump" and word.k <= address
        )

    def targets(self, address: int) -> Collection[int]:
        """Return the addresses that a computed jump is known to reach; none if they are not known."""
        return self._targets.get(address, ())

    def callers(self, address: int) -> Collection[int]:
        """Return the addresses to which a return at `address` may lead: those after every call of a function
        whose code, with the code that it jumps to, includes `address`.
        """
        return self._callers.get(address, ())

    @cached_property
    def _callers(self) -> Mapping[int, Collection[int]]:
        after: dict[int, list[int]] = {}
        for address, word in self._defined.items():
            if word.flow == "call":
                after.setdefault(word.k, []).append(_beyond(address, 1))
        callers: dict[int, dict[int, None]] = {}
        for start, returns in after.items():
            body = reached([start], lambda at: self._followers(at) if at in self._defined else ())
            for address in self._words.keys() & body:
                callers.setdefault(address, {}).update(dict.fromkeys(returns))
        return {address: tuple(returns) for address, returns in callers.items()}

    def check_table(self, address: int) -> None:
        """Check that a computed jump at `address` leads to a RETLW: only RETLWs may follow it, up to the end
        of the function, and its targets, if they are known, are RETLWs. Raises _NoBound.

        One that ends its function is taken to lead to a table elsewhere: that is how the compiler's routine
        reads flash through a pointer.
        """
        start = self._home_of(address)
        end = self.functions[start].end
        if any(
            self.word(after).name != "RETLW" for after in (*range(address + 1, end), *self.targets(address))
        ):
            raise _NoBound("computed jump", address)

    @cached_property
    def live(self) -> Mapping[int, int]:
        """Return, for each address, the places that some instruction may still read, as a bit set.

        It only decides which values are kept, so that paths merge: forgetting too much costs precision, never
        soundness. A return leads back to every caller of any function.
        """
        at_return = 0
        live: dict[int, int] = dict.fromkeys(self._words, 0)
        facts = [
            (address, *fact)
            for address in sorted(self._words, reverse=True)
            if (fact := self._live_fact(address))
        ]
        changed = True
        while changed:
            changed = False
            for address, followers, returns, uses, kills in facts:
                after = at_return if returns else 0
                for follower in followers:
                    after |= live.get(follower, 0)
                if returns is None:  # a call: what it returns to
                    at_return |= live.get(_beyond(address, 1), 0)
                # Backward liveness. The bit sets only grow, so the iteration ends.
                before = uses | after & ~kills
                if before != live[address]:
                    live[address] = before
                    changed = True
        return live

    def _live_fact(self, address: int) -> tuple[Sequence[int], bool | None, int, int] | None:
        """Return where an instruction leads, whether it returns (None: it calls), what it uses and kills."""
        try:
            word = self.word(address)
        except Undefined:
            return None
        uses, kills = uses_and_kills(word)
        if word.flow == "call":
            return (word.k,), None, uses, kills
        if word.flow == "return" or word.writes_pcl:
            return (), word.name != "RETFIE", uses, kills
        return self._followers(address), False, uses, kills


def _bit(place: int) -> int:
    return 1 << (_BITS.get(place, place) if place < _PASSES else _BITS[ZERO] + 1)


def is_live(place: int, live: int) -> bool:
    """Return whether a place is in one of the bit sets of `TimedProgram.live`."""
    return place >= _PASSES or bool(live >> _BITS.get(place, place) & 1)


@cache
def uses_and_kills(word: DecodedWord) -> tuple[int, int]:
    """Return what an instruction reads, and what it overwrites entirely, as bit sets."""
    uses = kills = 0
    if "W" in word.reads:
        uses |= _bit(W)
    if "C" in word.reads:
        uses |= _bit(CARRY)
    if word.writes_w:
        kills |= _bit(W)
    if "C" in word.flags:
        kills |= _bit(CARRY)
    if "Z" in word.flags:
        kills |= _bit(ZERO)
    if word.has_f:
        reads = "f" in word.reads
        if word.f == INDF:
            uses |= _bit(FSR) | (_ALL_PLACES if reads else 0)
        elif word.f == STATUS and reads:
            uses |= _bit(CARRY) | _bit(ZERO)
        elif word.f == FSR or RAM_FIRST <= word.f <= RAM_LAST:
            uses |= _bit(word.f) if reads else 0
            kills |= 0 if reads else _bit(word.f)
    return uses, kills


@dataclass(slots=True)
class _Walk:
    """The graph of states reached from one start."""

    program: TimedProgram
    ends: frozenset[int]
    without: frozenset[int]
    limit: int
    returns_to_callers: bool = False
    tracked: frozenset[int] | None = None
    """The places that are tracked; None: all."""
    counts_standing_still: bool = False
    """Whether a jump to itself is a loop without a bound even if no path leads to an end."""
    states: list[_State] = field(default_factory=list)
    """The nodes of the graph, from the start on; their index is their number."""
    numbers: dict[_State, int] = field(default_factory=dict)
    edges: dict[int, list[_Edge]] = field(default_factory=dict)
    complete: bool = True
    reasons: dict[Unbounded, None] = field(default_factory=dict)
    uneven: Counter[int] = field(default_factory=Counter)
    """How many turns in succession differed from those that follow, by the head of the loop."""
    levels: int = 0
    """The levels of the stack that the calls on the paths take."""

    def explore(self, start: _State) -> None:
        """Follow every path from a state to the ends."""
        for number in reached([self._number(start)], self._followers):
            if len(self.edges) >= self.limit:
                self.complete = False
                return
            state = self.states[number]
            self.edges[number] = [
                (minimum, maximum, None if after is None else self._number(self._kept(after)))
                for minimum, maximum, after in self.turns(state) or self._run(state)
            ]

    def _followers(self, number: int) -> list[int]:
        return [after for _, _, after in self.edges[number] if after is not None]

    def known_places(self) -> set[int]:
        """Return the places whose values are known in some state."""
        return {place for *_, known in self.states for place, _ in known if place < _PASSES}

    def _number(self, state: _State) -> int:
        number = self.numbers.setdefault(state, len(self.states))
        if number == len(self.states):
            self.states.append(state)
        return number

    # answers

    def times(self) -> Times:
        """Return the times from the start to the ends of the explored graph, with what has no bound."""
        return replace(self._times(), levels=self.levels)

    def _times(self) -> Times:
        # Without a cycle every state has finitely many paths to the end, so both extremes come from one pass
        # over the states, each after its followers.
        if self.complete and not self.reasons:
            order = bottom_up(0, self._followers)
            if order is not None:
                return self._times_without_loops(order)
        shortest = self._shortest()
        if not self.complete:
            often = Counter(self.states[number][0] for number in self.edges)
            busiest = max(often, key=lambda address: often[address], default=self.states[0][0])
            return Times(shortest, None, (Unbounded("too many states", (busiest,)),))
        return Times(shortest, None, self._unbounded(returns=shortest is not None))

    def _times_without_loops(self, order: Sequence[int]) -> Times:
        """Return the lengths of the shortest and the longest path; in `order`, states follow all those that
        they lead to.
        """
        extremes: dict[int | None, tuple[int, int]] = {None: (0, 0)}
        for number in order:
            lengths = [
                (minimum + extremes[after][0], maximum + extremes[after][1])
                for minimum, maximum, after in self.edges[number]
                if maximum is not None and after in extremes
            ]
            if lengths:  # otherwise no path leads from here to the end
                shortest, longest = zip(*lengths, strict=True)
                extremes[number] = min(shortest), max(longest)
        if 0 not in extremes:
            return Times(None, None)
        return Times(Cycles(extremes[0][0]), Cycles(extremes[0][1]))

    def _unbounded(self, *, returns: bool) -> tuple[Unbounded, ...]:
        """Return everything without a bound: calls and jumps as they were met, then loops, outer ones
        first.
        """
        graph = {
            number: [after for _, _, after in edges if after is not None]
            for number, edges in self.edges.items()
        }
        parts = self._loops(graph, returns=returns or self.counts_standing_still)
        return tuple({**self.reasons, **dict.fromkeys(Unbounded("loop", part) for part in parts)})

    def _loops(self, graph: Mapping[int, list[int]], *, returns: bool) -> Iterator[tuple[int, ...]]:
        """Yield the addresses of each loop, then of the loops that remain inside it without its first
        address.

        If the function never returns, a jump to itself is its end.
        """
        for part in components(graph):
            if not returns and len(part) == 1 and self._stands_still(self.states[part[0]][0]):
                continue
            addresses = tuple(sorted({self.states[number][0] for number in part}))
            # What is still a cycle without its first address is a loop nested in this one.
            yield addresses
            inside = {number for number in part if self.states[number][0] != addresses[0]}
            yield from self._loops(
                {number: [after for after in graph[number] if after in inside] for number in inside},
                returns=returns,
            )

    def _stands_still(self, address: int) -> bool:
        word = self.program.word(address)
        return word.flow == "jump" and word.k == address

    def _shortest(self) -> Cycles | None:
        """Return the length of the shortest path by Dijkstra's algorithm; None if there is none."""
        if 0 not in self.edges:  # not one state was left for this function: nothing is known of it
            return Cycles(0)
        best = {0: 0}
        heap: list[tuple[int, int, int]] = [(0, 0, 0)]
        end: int | None = None
        count = 0
        while heap:
            cost, _, number = heapq.heappop(heap)
            if cost > best[number] or (end is not None and cost >= end):
                continue
            for minimum, _, after in self.edges.get(number, ()):
                if (
                    after is None or after not in self.edges
                ):  # the search was abandoned: this is a lower bound
                    end = cost + minimum if end is None else min(end, cost + minimum)
                elif cost + minimum < best.get(after, cost + minimum + 1):
                    best[after] = cost + minimum
                    count += 1
                    heapq.heappush(heap, (cost + minimum, count, after))
        return None if end is None else Cycles(end)

    # states

    def turns(self, state: _State) -> list[_Step]:
        """Return all iterations of a loop except the last as one step, if they differ only in the counter.

        One iteration is executed. It must be the only path and leave everything else that is known unchanged,
        and the counter may only be accessed by one DECFSZ or DECF, which reveal nothing of the result but
        whether it is 0, and by no function that is called. Then every iteration down to the last value of the
        counter is the same path with the same cycles. Empty if these conditions do not hold.
        """
        address, home, stack, before = state
        if address not in self.program.loop_heads or self.uneven[address] == _MAX_UNEVEN:
            return []
        # Set first, so that every return below without a result leaves the loop to be followed turn by turn.
        self.uneven[address] += 1
        cycles = 0
        here: _Point = (address, home, stack, dict(before))
        touched: Counter[int] = Counter()
        counted: set[int] = set()
        read_by_calls = 0
        for _ in range(_MAX_TURN):
            word = self.program.decoded[here[0]]
            if word.flow == "return" or (word.has_f and word.f == INDF) or here[0] in self.program.bounds:
                return []
            if word.flow == "call":
                touched.update(self.program.changes(word.k))
                # A function that reads the counter may take another time in every turn.
                read_by_calls |= self.program.reads(word.k)
            if word.has_f:
                touched[word.f] += 1
                if word.name in ("DECFSZ", "DECF") and word.d:
                    counted.add(word.f)
            steps = self._steps(here)
            if len(steps) != 1:
                return []
            minimum, maximum, following = steps[0]
            if minimum != maximum or following is None:
                return []
            cycles += minimum
            here = following
            if here[:3] == state[:3]:
                break
        else:
            return []
        known, after = dict(before), dict(self._kept(here)[3])
        changed = {place for place in known.keys() | after.keys() if known.get(place) != after.get(place)}
        counter = next(iter(changed)) if len(changed) == 1 else None
        if counter not in counted or touched[counter] != 1 or counter not in known or counter not in after:
            return []
        if read_by_calls & _bit(counter):
            return []
        del self.uneven[address]
        turns = (known[counter] - 1) & 0xFF
        if not turns or not after[counter]:
            return []
        return [(turns * cycles, turns * cycles, (address, home, stack, known | {counter: 1}))]

    def _run(self, state: _State) -> list[_Step]:
        """Follow the only path from a state up to where paths part or meet."""
        address, home, stack, before = state
        point: _Point = (address, home, stack, dict(before))
        heads = self.program.heads
        minimum, maximum = 0, 0
        unknown = False
        while True:
            point, passed = self._straight(point)
            minimum += passed
            maximum += passed
            steps = [self._within(point, step) for step in self._steps(point)]
            if len(steps) != 1:
                return [
                    (minimum + fewest, None if unknown or slowest is None else maximum + slowest, after)
                    for fewest, slowest, after in steps
                ]
            fewest, slowest, after = steps[0]
            minimum += fewest
            maximum += slowest or 0
            unknown |= slowest is None
            if after is None or after[0] in heads:
                return [(minimum, None if unknown else maximum, after)]
            point = after

    def _straight(self, point: _Point) -> tuple[_Point, int]:
        """Return the point after the plain instructions that follow, and their number, which is their cycles.

        `_steps` would yield the same one by one, but most of a program is plain, and this is much faster.
        """
        program = self.program
        plain, heads, decoded, changing = program.plain, program.heads, program.decoded, program.changing
        first, home, stack, known = point
        address = first
        while (
            address in plain
            and address + 1 not in heads
            and address not in self.ends
            and address not in self.without
        ):
            execute(decoded[address], known, changing)
            address += 1
        return (address, home, stack, known), address - first

    def _within(self, before: _Point, step: _Step) -> _Step:
        """Return the edge, ended at the boundary of a function that nothing calls if its code runs on into
        another: the start-up code before main.
        """
        minimum, maximum, after = step
        if after is None or self.returns_to_callers or after[0] not in self.program.functions:
            return step
        if before[1] in self.program.called:  # it returns where the other one does
            return step
        runs_on = after[0] in (before[0] + 1, before[0] + 2) and after[0] != before[1]
        return (minimum, maximum, None) if runs_on else step

    def _kept(self, point: _Point) -> _State:
        """Return a point as a state, without the values that need not be remembered."""
        address, home, stack, known = point
        if not known:
            return address, home, stack, ()
        live, tracked = self.program.live.get(address, 0), self.tracked
        remembered = [
            (place, value)
            for place, value in known.items()
            if place >= _PASSES
            or (live >> _BITS.get(place, place) & 1 and (tracked is None or place in tracked))
        ]
        return address, home, stack, tuple(sorted(remembered))

    def _steps(self, point: _Point) -> list[_Step]:
        """Return the successors of one instruction, or of one loop that only counts; the values known at the
        point are those of its successors afterwards.
        """
        address, home, stack, known = point
        if address in self.ends and (address, home, stack, tuple(sorted(known.items()))) != self.states[0]:
            return [(0, 0, None)]
        if address in self.without or not self._passed(address, known):
            return []
        piece = self.program.piece(address)
        if piece is not None and not any(address < end < piece.end for end in self.ends):
            unchanged = {place: value for place, value in known.items() if place not in piece.changes}
            if not self._has_levels(len(stack) + piece.levels):
                return self._no_bound("stack", address)
            return [(piece.cycles, piece.cycles, (piece.end, home, stack, unchanged))]
        word = self.program.decoded[address]
        counted = _counted_loop(self.program, address, word, known, self.ends | self.without)
        if counted is not None:
            cycles, after = counted
            return [(cycles, cycles, (after, home, stack, known))]
        if word.flow == "jump":
            return self._jump(word, point)
        if word.flow == "call":
            return self._call(word, point)
        if word.flow == "return":
            if word.name == "RETLW":
                known[W] = word.k
            return self._return(2, point)
        if word.writes_pcl:
            return self._computed_jump(point)
        if word.name == "SLEEP":
            return self._no_bound("sleep", address)
        if word.flow == "skip":
            taken = skipped(word, known, self.program.changing)
            # A skip that is taken executes the next word as a NOP: one cycle more (DS35007 table 7-2, note
            # 3).
            following: _Step = (1, 1, (_beyond(address, 1), home, stack, known))
            beyond: _Step = (2, 2, (_beyond(address, 2), home, stack, known))
            return [following, beyond] if taken is None else [beyond] if taken else [following]
        execute(word, known, self.program.changing)
        return [(1, 1, (_beyond(address, 1), home, stack, known))]

    def _jump(self, word: DecodedWord, point: _Point) -> list[_Step]:
        """Return the step of a jump inside the function, or to another function, which returns in its
        place.
        """
        address, home, stack, known = point
        elsewhere = word.k in self.program.functions and word.k != home
        if self.returns_to_callers:
            return [(2, 2, (word.k, self._home(word.k, home), stack, known))]
        if not elsewhere:
            return [(2, 2, (word.k, home, stack, known))]
        # The other function returns to the caller of this one, so its end is the end here.
        times = self._call_times(address, word, known)
        if not self._has_levels(len(stack) + times.levels):
            return self._no_bound("stack", address)
        if times.shortest is None:
            return []
        return [(2 + times.shortest, None if times.longest is None else 2 + times.longest, None)]

    def _has_levels(self, levels: int) -> bool:
        """Note the levels of the stack that a path takes, and return whether there are as many."""
        self.levels = max(self.levels, levels)
        return levels <= STACK_LEVELS

    def _home(self, address: int, home: int) -> int:
        return self.program.home.get(address, home)

    def _passed(self, address: int, known: Known) -> bool:
        """Count a pass of an address, and return whether another is allowed."""
        bound = self.program.bounds.get(address)
        if bound is None:
            return True
        known[_PASSES + address] = known.get(_PASSES + address, 0) + 1
        return known[_PASSES + address] <= bound

    def _no_bound(self, kind: str, address: int) -> list[_Step]:
        if self.returns_to_callers:
            raise _NoBound(kind, address)
        self.reasons[Unbounded(kind, (address,))] = None
        return [(2, None, None)]

    def _call(self, word: DecodedWord, point: _Point) -> list[_Step]:
        address, home, stack, known = point
        # An end inside the callee has to be seen: the callee is followed, not replaced by its time.
        if (self.ends or self.without) and self.program.reached(word.k) & (self.ends | self.without):
            if not self._has_levels(len(stack) + 1):
                return self._no_bound("stack", address)
            return [(2, 2, (word.k, word.k, (*stack, _beyond(address, 1)), known))]
        times = self._call_times(address, word, known)
        if not self._has_levels(len(stack) + 1 + times.levels):
            return self._no_bound("stack", address)
        if times.shortest is None:
            return []  # it never comes back
        changed = self.program.changes(word.k)
        unchanged = {place: value for place, value in known.items() if place not in changed}
        maximum = None if times.longest is None else 2 + times.longest
        return [(2 + times.shortest, maximum, (_beyond(address, 1), home, stack, unchanged))]

    def _call_times(self, address: int, word: DecodedWord, known: Known) -> Times:
        """Return the times of the function that is entered at `address`."""
        times = self.program.call(word.k, known)
        if times.longest is None:
            if self.returns_to_callers:
                raise _NoBound("call", address)
            self.reasons[Unbounded("call", (address,))] = None
        return times

    def _computed_jump(self, point: _Point) -> list[_Step]:
        """Return the step of a jump into a table: the jump takes two cycles, the RETLW it reaches two more;
        or those of a jump whose targets are known.
        """
        address, home, stack, known = point
        execute(self.program.word(address), known, self.program.changing)
        try:
            self.program.check_table(address)
        except _NoBound:
            targets = self.program.targets(address)
            if not targets:
                return self._no_bound("computed jump", address)
            return [(2, 2, (target, self._home(target, home), stack, known)) for target in targets]
        known.pop(W, None)
        return self._return(2 + 2, point)

    def _return(self, cycles: int, point: _Point) -> list[_Step]:
        address, home, stack, known = point
        if stack:
            return [(cycles, cycles, (stack[-1], self._home(stack[-1], home), stack[:-1], known))]
        if not self.returns_to_callers:
            return [(cycles, cycles, None)]
        # An interrupt may come anywhere, so there is no list of callers to return to.
        if self.program.word(address).name == "RETFIE":
            raise _NoBound("computed jump", address)
        return [
            (cycles, cycles, (back, self.program._home_of(back), (), known))
            for back in self.program.callers(address)
        ]


def _beyond(address: int, words: int) -> int:
    """Return the address that many words on: behind the last one the program counter wraps around."""
    return (address + words) % PROGRAM_WORDS


def _counted_loop(
    program: TimedProgram, address: int, word: DecodedWord, known: Known, stops: Collection[int]
) -> tuple[int, int] | None:
    """Return the cycles of a loop that only counts, and the address after it; None for other code, and for a
    loop with one of `stops` behind its first word. Updates `known`.

    loop DECFSZ f,F     loop DECF f,F           loop ADDLW 0xFF
         GOTO loop           BTFSS STATUS,Z          BTFSS STATUS,Z
                             GOTO loop               GOTO loop
    """
    following = _beyond(address, 1)
    if following in stops:
        return None
    if word.name == "DECFSZ" and word.d and word.f in known and _is_goto(program, following, address):
        # A counter of 0 is decremented to 255 first: 256 turns.
        turns = known[word.f] or 256
        known[word.f] = 0
        return 3 * (turns - 1) + 2, _beyond(address, 2)
    place = (
        word.f if word.name == "DECF" and word.d else W if word.name == "ADDLW" and word.k == 0xFF else None
    )
    if place is None or place not in known or not _is_goto(program, _beyond(address, 2), address):
        return None
    if _beyond(address, 2) in stops:
        return None
    test = program.word(following)
    if (test.name, test.f, test.b) != ("BTFSS", STATUS, 2):
        return None
    turns = known[place] or 256
    known[place], known[ZERO] = 0, 1
    if place == W:
        known[CARRY] = 1  # the last addition is 1 + 0xFF
    return 4 * (turns - 1) + 3, _beyond(address, 3)


def _is_goto(program: TimedProgram, address: int, target: int) -> bool:
    word = program.word(address)
    return word.name == "GOTO" and word.k == target
