"""The shortest and the longest time of each function, from its first instruction to its return's end.

In: code with delays still whole. Out: (least, most) cycles by name; `most` is None where a loop's bound is
not known, both are None where the function never returns. Instructions are followed with the values that are
known: a loop whose counter starts from a constant is gone through as often as it will be.
"""

from __future__ import annotations

import heapq
from collections.abc import Mapping

from servogen.compiler.emitter import Code
from servogen.compiler.liveness import FLAG_BITS, W_BIT, Liveness, is_private
from servogen.compiler.machine import DELAY, LABEL, PCL, SKIPS, STATUS, Byte, C, Ins, Z

Times = tuple[int | None, int | None]
_LIMIT = 4000
"""States of one function that are followed before its longest time is given up."""
State = dict[object, int]
_Key = tuple[int, tuple[tuple[str, int], ...]]
_TWO = frozenset(("GOTO", "CALL", "RETURN", "RETLW", "RETFIE"))


def all_times(codes: Mapping[str, Code]) -> dict[str, Times]:
    """The times of every function, callees first."""
    found: dict[str, Times] = {}

    def visit(name: str) -> None:
        if name in found:
            return
        found[name] = (None, None)
        for callee in codes[name].calls():
            if callee in codes:
                visit(callee)
        found[name] = _Explorer(codes[name], found).times()

    for name in codes:
        visit(name)
    return found


class _Explorer:
    """The graph of (instruction, known values) of one function."""

    def __init__(self, code: Code, callees: Mapping[str, Times]) -> None:
        self.code = code
        self.callees = callees
        self.live = Liveness(code)
        self.edges: dict[_Key, list[tuple[int, int, _Key | None]]] = {}

    def times(self) -> Times:
        if self.code.table is not None:
            return 4, 9  # with and without setting PCLATH
        if not self.code.ins:
            return 0, 0
        start: _Key = (0, ())
        states: dict[_Key, State] = {start: {}}
        waiting = [start]
        complete = True
        while waiting:
            key = waiting.pop()
            if key in self.edges:
                continue
            if len(self.edges) > _LIMIT:
                complete = False
                self.edges[key] = []
                continue
            self.edges[key] = []
            for fewest, most, at, state in self._steps(key[0], dict(states[key])):
                if at is None or at >= len(self.code.ins):
                    self.edges[key].append((fewest, most, None))
                    continue
                after = self._key(at, state)
                states[after] = state
                self.edges[key].append((fewest, most, after))
                waiting.append(after)
        least = self._shortest(start)
        return least, self._longest(start) if complete and least is not None else None

    def _key(self, at: int, state: State) -> _Key:
        """Only what is still needed tells states apart."""
        needed = self.live.before[at]
        for loc in list(state):
            if loc == "W":
                bit = W_BIT
            elif isinstance(loc, Byte):
                bit = self.live.bit(loc)
            else:
                bit = FLAG_BITS[C if loc == "C" else Z]
            if not needed & bit:
                del state[loc]
        shown = [
            (str(self.live.number[loc]) if isinstance(loc, Byte) else str(loc), value)
            for loc, value in state.items()
        ]
        return at, tuple(sorted(shown))

    def _shortest(self, start: _Key) -> int | None:
        best = {start: 0}
        heap: list[tuple[int, int, _Key]] = [(0, 0, start)]
        count = 0
        while heap:
            cost, _, key = heapq.heappop(heap)
            if cost > best.get(key, cost):
                continue
            for least, _, after in self.edges.get(key, []):
                if after is None:
                    count += 1
                    best[(-1, ())] = min(best.get((-1, ()), cost + least), cost + least)
                elif cost + least < best.get(after, cost + least + 1):
                    best[after] = cost + least
                    count += 1
                    heapq.heappush(heap, (cost + least, count, after))
        return best.get((-1, ()))

    def _longest(self, start: _Key) -> int | None:
        """None when a state comes back to itself."""
        done: dict[_Key, int | None] = {}
        open_: set[_Key] = set()
        stack: list[tuple[_Key, bool]] = [(start, False)]
        while stack:
            key, leaving = stack.pop()
            if leaving:
                open_.discard(key)
                values = [
                    most + (done[after] or 0) if after is not None else most
                    for _, most, after in self.edges[key]
                    if most >= 0
                ]
                if len(values) < len(self.edges[key]):
                    return None
                done[key] = max(values, default=0)
                continue
            if key in done:
                continue
            if key in open_:
                return None
            open_.add(key)
            stack.append((key, True))
            for _, _, after in self.edges[key]:
                if after in open_:
                    return None
                if after is not None and after not in done:
                    stack.append((after, False))
        return done[start]

    # one instruction

    def _steps(self, at: int, state: State) -> list[tuple[int, int, int | None, State]]:
        """(least, most, next index or None for the end, state); most is -1 when it is not known."""
        ins = self.code.ins[at]
        op = ins.op
        if op == LABEL or op == "ORG":
            return [(0, 0, at + 1, state)]
        if op == DELAY:
            assert isinstance(ins.k, int)
            state.pop("W", None)
            return [(ins.k, ins.k, at + 1, _no_flags(state))]
        if op in ("RETURN", "RETLW", "RETFIE"):
            return [(2, 2, None, state)]
        if op == "GOTO":
            return self._jump(ins, state)
        if op == "CALL":
            least, most = self.callees.get(ins.target, (None, None))
            kept = _no_flags({loc: value for loc, value in state.items() if self._own(loc)})
            kept.pop("W", None)
            return [(2 + (least or 0), 2 + most if most is not None else -1, at + 1, kept)]
        if ins.f == PCL and ins.writes_f:
            return [(2, -1, None, state)]
        if op in SKIPS:
            return self._skip(at, ins, state)
        _execute(ins, state)
        return [(1, 1, at + 1, state)]

    def _own(self, loc: object) -> bool:
        return not isinstance(loc, Byte) or loc.symbol in self.code.own

    def _jump(self, ins: Ins, state: State) -> list[tuple[int, int, int | None, State]]:
        if ins.target in self.live.where:
            return [(2, 2, self.live.where[ins.target], state)]
        least, most = self.callees.get(ins.target, (None, None))
        return [(2 + (least or 0), 2 + most if most is not None else -1, None, state)]

    def _skip(self, at: int, ins: Ins, state: State) -> list[tuple[int, int, int | None, State]]:
        after = self.live.next_real(at + 1) + 1
        taken: bool | None = None
        if ins.op in ("BTFSC", "BTFSS"):
            value = _bit(ins, state)
            taken = None if value is None else value == (ins.op == "BTFSS")
        else:
            _execute(ins, state)
            result = state.get("W" if ins.d == 0 else ins.f)
            taken = None if result is None else result == 0
        ways: list[tuple[int, int, int | None, State]] = []
        if taken is not True:
            ways.append((1, 1, at + 1, dict(state)))
        if taken is not False:
            ways.append((2, 2, after, dict(state)))
        return ways


def _no_flags(state: State) -> State:
    state.pop("C", None)
    state.pop("Z", None)
    return state


def _bit(ins: Ins, state: State) -> int | None:
    if ins.f == STATUS:
        return state.get({C: "C", Z: "Z"}.get(ins.b, ""))
    value = state.get(ins.f)
    return None if value is None else value >> ins.b & 1


def _execute(ins: Ins, state: State) -> None:
    """Change the known values as an instruction does; what it makes unknown is dropped."""
    w, f = state.get("W"), state.get(ins.f) if ins.f is not None else None
    k = ins.k if isinstance(ins.k, int) else None
    carry = state.get("C")
    result, new_carry = _compute(ins, w, f, k, carry)
    for letter in ins.flags:
        state.pop(letter, None)
    if ins.f == STATUS and ins.op in ("BCF", "BSF"):
        name = {C: "C", Z: "Z"}.get(ins.b)
        if name is not None:
            state[name] = int(ins.op == "BSF")
        return
    if "Z" in ins.flags and result is not None:
        state["Z"] = int(result == 0)
    if "C" in ins.flags and new_carry is not None:
        state["C"] = new_carry
    target: object = ins.f if ins.writes_f else "W" if ins.writes_w else None
    if target is None:
        return
    state.pop(target, None)
    if result is not None and (target == "W" or is_private(target)):
        state[target] = result


def _compute(
    ins: Ins, w: int | None, f: int | None, k: int | None, carry: int | None
) -> tuple[int | None, int | None]:
    """(result, carry), each None when it is not known."""
    one = {"MOVLW": k, "MOVWF": w, "MOVF": f, "CLRF": 0, "CLRW": 0}
    if ins.op in one:
        return one[ins.op], None
    if f is not None:
        match ins.op:
            case "INCF" | "INCFSZ":
                return f + 1 & 0xFF, None
            case "DECF" | "DECFSZ":
                return f - 1 & 0xFF, None
            case "COMF":
                return f ^ 0xFF, None
            case "SWAPF":
                return (f >> 4 | f << 4) & 0xFF, None
            case "BSF":
                return f | 1 << ins.b, None
            case "BCF":
                return f & ~(1 << ins.b), None
            case "RLF":
                return None if carry is None else (f << 1 | carry) & 0xFF, f >> 7
            case "RRF":
                return None if carry is None else f >> 1 | carry << 7, f & 1
    other = k if ins.op.endswith("LW") else f
    if w is None or other is None:
        return None, None
    match ins.op[:3]:
        case "ADD":
            return other + w & 0xFF, int(other + w > 0xFF)
        case "SUB":
            return other - w & 0xFF, int(other >= w)
        case "AND":
            return other & w, None
        case "IOR":
            return other | w, None
        case "XOR":
            return other ^ w, None
    return None, None
