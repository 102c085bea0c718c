"""The longest way through a program from one address to others, counted from its words.

In: program words, functions, a start and ends. Out: cycles, or None where no bound is known. Instructions are
followed with the values that are known, so that a loop whose counter begins at a constant is gone through as
often as it will be; where a value is not known, both ways of a skip are. A function that is called is gone
through once, with nothing known, if that has a bound; else each time. Costs as in DS35007 table 7-2. There
are no interrupts.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace

from servogen.pic.device import RAM_FIRST, RAM_LAST
from servogen.pic.known import INDF, PCL, Known, Undefined, Word, execute, skipped, word_of
from servogen.pic.listing import ListedFunction
from servogen.units import Cycles

MOST_STATES = 200_000
"""States that are followed before the search is given up."""

ERASED = 0x3FFF
_BACK = -1
"""Where a function that is gone through alone returns to."""


@dataclass(frozen=True, slots=True)
class _State:
    """Where the chip is, the returns that are known, the function that returns after them, what is known."""

    at: int
    home: int
    stack: tuple[int, ...] = ()
    known: tuple[tuple[str, int], ...] = ()


_Step = tuple[int, _State]


class _Unbounded(Exception):
    """Something whose time is not known."""


def longest(
    program: Mapping[int, int],
    functions: Collection[ListedFunction],
    start: int,
    ends: Collection[int],
    without: Collection[int] = (),
) -> Cycles | None:
    """The most cycles from `start` to the first of `ends`; ways through `without` do not count.

    None where a loop has no known bound, no way leads to an end, or a computed jump leads anywhere but into
    a table of RETLW. A return from the function that `start` is in goes to each of its callers.
    """
    walk = _Walk(program, tuple(functions), frozenset(ends), frozenset(without))
    try:
        found = walk.longest(_State(start, walk.home(start)))
    except (_Unbounded, Undefined):
        return None
    return None if found is None else Cycles(found)


@dataclass(frozen=True, slots=True)
class _Called:
    """A function from its first instruction to its return's end: the most cycles, and what it may change."""

    most: int
    changes: frozenset[str]


@dataclass(slots=True)
class _Walk:
    program: Mapping[int, int]
    functions: tuple[ListedFunction, ...]
    ends: frozenset[int]
    without: frozenset[int]
    done: dict[_State, int | None] = field(default_factory=dict)
    calls: dict[int, _Called | None] = field(default_factory=dict)

    def longest(self, start: _State) -> int | None:
        """Depth first; a state that comes back to itself is a loop without a bound."""
        following: dict[_State, tuple[_Step, ...]] = {}
        stack: list[_State] = [start]
        while stack:
            state = stack[-1]
            if state in self.done:
                stack.pop()
            elif state in following:
                self.done[state] = self._most(following[state])
                stack.pop()
            elif len(following) > MOST_STATES:
                raise _Unbounded
            else:
                following[state] = tuple(self._steps(state))
                for _, after in following[state]:
                    if after.at in self.ends or after in self.done:
                        continue
                    if after in following:
                        raise _Unbounded
                    stack.append(after)
        return self.done[start]

    def home(self, at: int) -> int:
        """The beginning of the function that an address is in."""
        found = next((each.start for each in self.functions if each.start <= at < each.end), None)
        if found is None:
            raise _Unbounded
        return found

    def _word(self, at: int) -> Word:
        return word_of(self.program.get(at, ERASED))

    def _most(self, steps: tuple[_Step, ...]) -> int | None:
        ways = [
            cycles + most
            for cycles, after in steps
            for most in (0 if after.at in self.ends else self.done[after],)
            if most is not None
        ]
        return max(ways, default=None)

    def _steps(self, state: _State) -> Iterator[_Step]:
        """The cycles of the instruction and the state after it, for each way that it may go."""
        if state.at in self.without:
            return
        word = self._word(state.at)
        known = dict(state.known)
        if word.name == "GOTO":
            yield 2, replace(state, at=word.k)
        elif word.name == "CALL" and (called := self._called(word.k)):
            kept = tuple(each for each in state.known if each[0] not in called.changes)
            yield 2 + called.most, replace(state, at=state.at + 1, known=kept)
        elif word.name == "CALL":
            yield 2, replace(state, at=word.k, stack=(*state.stack, state.at + 1))
        elif word.name in ("RETURN", "RETLW"):
            if word.name == "RETLW":
                known["W"] = word.k
            yield from self._returns(2, state, known)
        elif word.name in ("SLEEP", "RETFIE"):
            raise _Unbounded
        elif word.f == PCL and word.writes_f:
            self._check_table(state.at + 1)
            known.pop("W", None)
            yield from self._returns(2 + 2, state, known)
        elif word.skips:
            taken = skipped(word, known)
            after = _sorted(known)
            if taken is not True:
                yield 1, replace(state, at=state.at + 1, known=after)
            if taken is not False:
                yield 2, replace(state, at=state.at + 2, known=after)
        else:
            execute(word, known)
            yield 1, replace(state, at=state.at + 1, known=_sorted(known))

    def _called(self, start: int) -> _Called | None:
        """The function at `start` as a whole; None where it has no bound, or an end of the way in it."""
        if start not in self.calls:
            self.calls[start] = None  # one that calls itself has no bound
            inside = self._reached(start)
            if not inside & (self.ends | self.without):
                part = _Walk(self.program, self.functions, frozenset({_BACK}), frozenset(), calls=self.calls)
                try:
                    most = part.longest(_State(start, start, (_BACK,)))
                except _Unbounded:
                    most = None
                if most is not None:
                    self.calls[start] = _Called(most, self._changes(inside))
        return self.calls[start]

    def _reached(self, start: int) -> frozenset[int]:
        """The addresses that a call of `start` may execute; not the RETLW of tables: they change nothing."""
        found: set[int] = set()
        waiting = [start]
        while waiting:
            at = waiting.pop()
            if at in found or at not in self.program:
                continue
            found.add(at)
            word = self._word(at)
            if word.name == "GOTO":
                waiting.append(word.k)
            elif word.name not in ("RETURN", "RETLW", "RETFIE") and not (word.f == PCL and word.writes_f):
                waiting += [at + 1, at + 2] if word.skips else [at + 1]
                waiting += [word.k] if word.name == "CALL" else []
        return frozenset(found)

    def _changes(self, inside: frozenset[int]) -> frozenset[str]:
        """The places that these words may change; through INDF it may be any."""
        fs = {word.f for word in map(self._word, inside) if word.writes_f}
        every = range(RAM_FIRST, RAM_LAST + 1) if INDF in fs else fs
        return frozenset({"W", "C", "Z", "FSR", *(f"{f:02X}" for f in every)})

    def _check_table(self, first: int) -> None:
        """A computed jump goes to a RETLW: what follows it must be nothing else, up to the function's end."""
        start = self.home(first)
        end = next(each.end for each in self.functions if each.start == start)
        if any(self._word(at).name != "RETLW" for at in range(first, end)):
            raise _Unbounded

    def _returns(self, cycles: int, state: _State, known: Known) -> Iterator[_Step]:
        after = _sorted(known)
        if state.stack:
            yield cycles, _State(state.stack[-1], state.home, state.stack[:-1], after)
            return
        for back in self._callers(state.home, set()):
            yield cycles, _State(back, self.home(back), (), after)

    def _callers(self, home: int, seen: set[int]) -> Iterator[int]:
        """Where a return from the function at `home` may lead; who jumps to it returns for it."""
        if home in seen:
            return
        seen.add(home)
        for address in self.program:
            word = self._word(address)
            if word.name == "CALL" and word.k == home:
                yield address + 1
            elif word.name == "GOTO" and word.k == home and self.home(address) != home:
                yield from self._callers(self.home(address), seen)


def _sorted(known: Known) -> tuple[tuple[str, int], ...]:
    return tuple(sorted(known.items()))
