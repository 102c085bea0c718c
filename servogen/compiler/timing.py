"""The shortest and the longest time of each function, from its first instruction to its return's end.

In: code with delays still whole. Out: `Times` by name. Instructions are followed with the values that are
known: a loop whose counter starts from a constant is gone through as often as it will be. What has no known
end is named.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from servogen.compiler.cycles import longest
from servogen.compiler.emitter import Code
from servogen.compiler.known import State, bit_value, execute, without_flags
from servogen.compiler.liveness import FLAG_BITS, W_BIT, Liveness, is_private
from servogen.compiler.loop_names import Key, name_of, uncounted
from servogen.compiler.machine import DELAY, LABEL, PCL, SKIPS, Byte, C, Ins, Z
from servogen.compiler.tree import Symbol


@dataclass(frozen=True, slots=True)
class Times:
    """Cycles; `least` is None where the function never returns, `most` where `unbounded` says why."""

    least: int | None
    most: int | None
    unbounded: tuple[str, ...] = ()


_MOST_STATES = 6000
"""States of one function that are followed before its longest time is given up."""
_ALL_STATES = 24000
"""The same of the whole program: it bounds the compiler's own time."""
_TABLE = Times(4, 9)
"""A look into a table in flash, with and without setting PCLATH."""
_Way = tuple[int, int | None, int | None, State]
"""(least, most, next index or None for the end, known values)."""
_COUNTING = frozenset(("INCF", "DECF", "INCFSZ", "DECFSZ", "ADDWF", "SUBWF"))


def all_times(codes: Mapping[str, Code]) -> dict[str, Times]:
    """The times of every function, callees first."""
    found: dict[str, Times] = {}
    changed: dict[str, set[Symbol]] = {}
    left = _ALL_STATES

    def visit(name: str) -> None:
        nonlocal left
        if name in found:
            return
        code = codes[name]
        found[name], changed[name] = (
            Times(None, None),
            {each.f.symbol for each in code.ins if each.writes_f and isinstance(each.f, Byte)},
        )
        for callee in code.calls():
            if callee in codes:
                visit(callee)
                changed[name] |= changed[callee]
        for globals_too in (True, False):
            explorer = _Explorer(code, found, changed, min(left, _MOST_STATES), globals_too)
            found[name] = explorer.times()
            left -= len(explorer.edges)
            if explorer.complete or not explorer.counters:
                break

    for name in codes:
        visit(name)
    return found


class _Explorer:
    """The graph of (label, known values) of one function."""

    def __init__(
        self,
        code: Code,
        callees: Mapping[str, Times],
        changed: Mapping[str, set[Symbol]],
        limit: int,
        globals_too: bool,
    ) -> None:
        self.code = code
        self.callees = callees
        self.changed = changed
        self.limit = limit
        self.own = set(code.own)
        self.live = Liveness(code)
        self.edges: dict[Key, list[tuple[int, int | None, Key | None]]] = {}
        self.complete = True
        self.reasons: dict[str, None] = {}
        self.counters = {ins.f for ins in code.ins if globals_too and _counts_global(ins)}

    def times(self) -> Times:
        if self.code.table is not None:
            return _TABLE
        if not self.code.ins:
            return Times(0, 0)
        start: Key = (0, ())
        states: dict[Key, State] = {start: {}}
        waiting = [start]
        while waiting:
            key = waiting.pop()
            if key in self.edges:
                continue
            self.edges[key] = []
            if len(self.edges) > self.limit:
                self.complete = False
                continue
            for fewest, most, at, state in self._run(key[0], dict(states[key])):
                after = None
                if at is not None and at < len(self.code.ins):
                    after = self._key(at, state)
                    states[after] = state
                    waiting.append(after)
                self.edges[key].append((fewest, most, after))
        return self._answer(start)

    def _answer(self, start: Key) -> Times:
        least = self._shortest(start)
        if not self.complete:
            often = Counter(at for at, _ in self.edges)
            at = max(often, key=lambda each: often[each])
            return Times(least, None, (f"{name_of(self.code, [at])}, too long to be counted",))
        graph = {
            key: [after for _, _, after in ways if after is not None] for key, ways in self.edges.items()
        }
        self.reasons.update(dict.fromkeys(uncounted(self.code, graph, returns=least is not None)))
        if self.reasons or least is None:
            return Times(least, None, tuple(self.reasons) or ("stands still at its end",))
        return Times(least, longest(start, self.edges))

    def _key(self, at: int, state: State) -> Key:
        """Only what is still needed tells states apart."""
        needed = self.live.before[at]
        for loc in list(state):
            if not isinstance(loc, Byte):
                bit = {"W": W_BIT, "C": FLAG_BITS[C], "Z": FLAG_BITS[Z]}.get(str(loc), 0)
                gone = bool(bit) and not needed & bit
            else:
                gone = loc in self.live.number and not needed & self.live.bit(loc)
            if gone:
                del state[loc]
        return at, tuple(sorted((_shown(loc), value) for loc, value in state.items()))

    def _shortest(self, start: Key) -> int | None:
        best = {start: 0}
        heap: list[tuple[int, int, Key]] = [(0, 0, start)]
        end: int | None = None
        count = 0
        while heap:
            cost, _, key = heapq.heappop(heap)
            if cost > best.get(key, cost):
                continue
            for least, _, after in self.edges.get(key, []):
                if after is None:
                    end = cost + least if end is None else min(end, cost + least)
                elif cost + least < best.get(after, cost + least + 1):
                    best[after] = cost + least
                    count += 1
                    heapq.heappush(heap, (cost + least, count, after))
        return end

    def _unknown(self, why: str, ins: Ins) -> None:
        line = ins.place.line if ins.place is not None else None
        self.reasons[f"{why} at line {line}" if line else why] = None

    # instructions

    def _run(self, at: int, state: State) -> list[_Way]:
        """From a label, or the place behind a skip, to the next."""
        least, most = 0, 0
        unknown = False
        while True:
            ways: list[_Way] = []
            for fewest, slowest, after, known in self._steps(at, state):
                unknown = unknown or slowest is None
                ways.append((least + fewest, most + (slowest or 0), after, known))
            follower = ways[0][2] if len(ways) == 1 else None
            if follower is None or follower >= len(self.code.ins) or self.code.ins[follower].op == LABEL:
                return [(few, None if unknown else many, *rest) for few, many, *rest in ways]  # type: ignore[misc]
            least, most, state = ways[0][0], ways[0][1] or 0, ways[0][3]
            at = follower

    def _steps(self, at: int, state: State) -> list[_Way]:
        """Where one instruction leads; no way at all from a loop that has been gone through too often."""
        ins = self.code.ins[at]
        op = ins.op
        if op == LABEL:
            return self._label(ins, at, state)
        if op == "ORG":
            return [(0, 0, at + 1, state)]
        if op == DELAY:
            assert isinstance(ins.k, int)
            state.pop("W", None)
            return [(ins.k, ins.k, at + 1, without_flags(state))]
        if op in ("RETURN", "RETLW", "RETFIE"):
            return [(2, 2, None, state)]
        if op in ("GOTO", "CALL"):
            return self._jump(ins, at, state)
        if ins.f == PCL and ins.writes_f:
            if self.code.name.startswith("__"):
                return [(4, 4, None, state)]  # into a table: RETLW
            self._unknown("a computed jump", ins)
            return [(2, None, None, state)]
        if op in SKIPS:
            return self._skip(at, ins, state)
        execute(ins, state, self._followed)
        return [(1, 1, at + 1, state)]

    def _label(self, ins: Ins, at: int, state: State) -> list[_Way]:
        bound = self.code.bounds.get(ins.target)
        if bound is not None:
            state[ins.target] = state.get(ins.target, 0) + 1
            if state[ins.target] > bound:
                return []
        return [(0, 0, at + 1, state)]

    def _followed(self, loc: object) -> bool:
        return is_private(loc) or loc in self.counters

    def _jump(self, ins: Ins, at: int, state: State) -> list[_Way]:
        if ins.op == "GOTO" and ins.target in self.live.where:
            return [(2, 2, self.live.where[ins.target], state)]
        times = self.callees.get(ins.target, Times(None, None))
        if times.most is None:
            self._unknown(f"call of {ins.target}", ins)
        most = None if times.most is None else 2 + times.most
        changed = self.changed.get(ins.target, set())
        kept = {loc: value for loc, value in state.items() if self._survives(loc, changed)}
        return [(2 + (times.least or 0), most, at + 1 if ins.op == "CALL" else None, kept)]

    def _survives(self, loc: object, changed: set[Symbol]) -> bool:
        """Whether a value is still known behind a call."""
        if not isinstance(loc, Byte):
            return loc not in ("W", "C", "Z")
        return (loc.symbol in self.own or loc in self.counters) and loc.symbol not in changed

    def _skip(self, at: int, ins: Ins, state: State) -> list[_Way]:
        after = self.live.next_real(at + 1) + 1
        taken: bool | None = None
        if ins.op in ("BTFSC", "BTFSS"):
            value = bit_value(ins, state)
            taken = None if value is None else value == (ins.op == "BTFSS")
        else:
            execute(ins, state, self._followed)
            result = state.get("W" if ins.d == 0 else ins.f)
            taken = None if result is None else result == 0
        ways: list[_Way] = []
        if taken is not True:
            ways.append((1, 1, at + 1, dict(state)))
        if taken is not False:
            ways.append((2, 2, after, dict(state)))
        return ways


def _shown(loc: object) -> str:
    return f"{id(loc.symbol)}+{loc.offset}" if isinstance(loc, Byte) else str(loc)


def _counts_global(ins: Ins) -> bool:
    """Whether it counts in a variable of the program that only named instructions change."""
    if ins.op not in _COUNTING or (not ins.writes_f and ins.op not in SKIPS):
        return False
    if not isinstance(ins.f, Byte) or is_private(ins.f):
        return False
    symbol = ins.f.symbol
    return symbol.kind == "global" and not symbol.volatile and not symbol.pinned
