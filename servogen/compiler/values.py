"""Follows what W and bytes hold, so that nothing is loaded, stored or tested twice.

In: a `Code`. Out: loads of what W already holds are dropped, operands whose value is known become constants,
temporaries that are copies give way to their originals. Knowledge flows forward; where ways meet only what
all of them know is kept, and where a loop comes back nothing.
"""

from __future__ import annotations

from servogen.compiler.deadcode import remove
from servogen.compiler.emitter import Code
from servogen.compiler.liveness import Z_BIT, Liveness, is_private
from servogen.compiler.machine import DELAY, ENDS, FSR, INDF, LABEL, SKIPS, Byte, Imm, Ins, Loc

Value = Imm | int
"""A constant, or the number of something unknown."""
State = dict[object, Value]
_W = "W"
_TO_LITERAL = {"ADDWF": "ADDLW", "ANDWF": "ANDLW", "IORWF": "IORLW", "XORWF": "XORLW", "SUBWF": "SUBLW"}
_READERS = frozenset(
    [
        "MOVF",
        "ADDWF",
        "ANDWF",
        "IORWF",
        "XORWF",
        "SUBWF",
        "COMF",
        "INCF",
        "DECF",
        "SWAPF",
        "RLF",
        "RRF",
        "BTFSC",
        "BTFSS",
    ]
)


def trackable(loc: object) -> bool:
    """A byte of RAM, or FSR, that changes only where the code says so."""
    return loc == FSR or (isinstance(loc, Byte) and not loc.symbol.volatile)


class Tracker:
    """One forward pass over a function."""

    def __init__(self, code: Code) -> None:
        self.code = code
        self.live = Liveness(code)
        self.own = {id(symbol) for symbol in code.own}
        self.next = 0
        self.results: dict[tuple[str, Value, object], Value] = {}
        self.dead: set[int] = set()
        self.changed = False
        self.arriving: dict[str, list[State]] = {}
        self.seen: dict[str, int] = {}

    def run(self) -> bool:
        """Rewrite the code. True when something changed."""
        ins = self.code.ins
        sources: dict[str, int] = {}
        for each in ins:
            if each.op == "GOTO":
                sources[each.target] = sources.get(each.target, 0) + 1
        state: State | None = {}
        before_skip: State | None = None
        for at, each in enumerate(ins):
            if each.op == LABEL:
                state = self._meet(each.target, sources.get(each.target, 0), state)
                before_skip = None if before_skip is None else {}
                continue
            if state is None:
                continue
            skipped = before_skip
            before_skip = None
            if skipped is None or each.op not in SKIPS:
                self._rewrite(at, each, state, in_skip=skipped is not None)
            if at in self.dead:
                if skipped is not None:
                    state = _common(state, skipped)
                continue
            if each.op == "GOTO":
                self.arriving.setdefault(each.target, []).append(dict(state))
                self.seen[each.target] = self.seen.get(each.target, 0) + 1
            self._apply(each, state)
            if each.fixed and each.op not in ("NOP", "CLRWDT", "SLEEP"):
                state.clear()  # assembly may reach variables by their addresses
            if each.op in SKIPS:
                before_skip = dict(state)
                if skipped is not None:  # a skip that may be skipped: what follows may be reached three ways
                    state = _common(state, skipped)
                    before_skip = dict(state)
            elif each.op in ENDS:
                state = skipped
            elif skipped is not None:
                state = _common(state, skipped)
        if self.dead:
            remove(self.code, self.dead, self.live)
        return self.changed or bool(self.dead)

    def _meet(self, label: str, sources: int, state: State | None) -> State | None:
        if self.seen.get(label, 0) < sources:
            return {}  # a loop comes back here
        states = [each for each in [*self.arriving.get(label, []), state] if each is not None]
        if not states:
            return None
        found = states[0]
        for each in states[1:]:
            found = _common(found, each)
        return dict(found)

    def fresh(self) -> int:
        self.next += 1
        return self.next

    def value(self, state: State, loc: object) -> Value:
        if loc not in state:
            state[loc] = self.fresh()
        return state[loc]

    # what an instruction changes

    def _apply(self, ins: Ins, state: State) -> None:
        op = ins.op
        if op in ("NOP", "CLRWDT", "SLEEP", "GOTO") or op in ENDS:
            return
        if op == "CALL":
            for loc in [each for each in state if not (is_private(each) and id(each.symbol) in self.own)]:  # type: ignore[attr-defined]
                del state[loc]
            return
        if op == DELAY:
            state.pop(_W, None)
            return
        if op == "MOVLW":
            state[_W] = Imm(ins.k)
        elif op == "CLRW":
            state[_W] = Imm(0)
        elif op == "MOVF" and ins.d == 0 and trackable(ins.f):
            state[_W] = self.value(state, ins.f)
        elif op == "MOVF" and ins.d == 1:
            pass
        elif op == "MOVWF":
            self._store(ins.f, self.value(state, _W), state)
        elif op == "CLRF":
            self._store(ins.f, Imm(0), state)
        elif ins.writes_f:
            self._store(ins.f, self.fresh(), state)
        elif ins.writes_w:
            state[_W] = self._result(ins, state)

    def _result(self, ins: Ins, state: State) -> Value:
        """The same operation on the same values has the same value."""
        other: object
        if ins.op in _TO_LITERAL.values() or ins.op == "SUBLW":
            other = Imm(ins.k)
        elif ins.op in _TO_LITERAL and trackable(ins.f):
            other = self.value(state, ins.f)
        else:
            return self.fresh()
        return self.results.setdefault((ins.op[:3], self.value(state, _W), other), self.fresh())

    def _store(self, loc: Loc | None, value: Value, state: State) -> None:
        if loc == INDF:
            for each in [each for each in state if not is_private(each) and each not in (_W, FSR)]:
                del state[each]
        elif trackable(loc):
            self._forget_aliases(loc, state)
            state[loc] = value

    def _forget_aliases(self, loc: Loc | None, state: State) -> None:
        """Fixed-address variables may lie over one another."""
        if isinstance(loc, Byte) and loc.symbol.kind == "fixed":
            for each in [
                each
                for each in state
                if isinstance(each, Byte) and each.symbol.kind == "fixed" and each != loc
            ]:
                del state[each]

    # what an instruction can become

    def _rewrite(self, at: int, ins: Ins, state: State, *, in_skip: bool) -> None:
        if ins.fixed:
            return
        z_free = not self.live.after[at] & Z_BIT
        w = state.get(_W)
        match ins.op:
            case "MOVLW":
                if w == Imm(ins.k):
                    self.dead.add(at)
            case "MOVWF":
                if trackable(ins.f) and w is not None and state.get(ins.f) == w:
                    self.dead.add(at)
            case "CLRF":
                if z_free and trackable(ins.f) and state.get(ins.f) == Imm(0):
                    self.dead.add(at)
            case "MOVF" if ins.d == 0 and trackable(ins.f):
                known = state.get(ins.f)
                if z_free and known is not None and known == w:
                    self.dead.add(at)
                elif z_free and isinstance(known, Imm):
                    ins.op, ins.f, ins.k = "MOVLW", None, known.value
                    self.changed = True
        if at in self.dead:
            return
        if ins.op in _TO_LITERAL and ins.d == 0 and trackable(ins.f):
            known = state.get(ins.f)
            if isinstance(known, Imm):
                ins.op, ins.f, ins.k = _TO_LITERAL[ins.op], None, known.value
                self.changed = True
                return
        if (
            ins.op in _READERS
            and not ins.writes_f
            and isinstance(ins.f, Byte)
            and ins.f.symbol.kind == "temp"
        ):
            self._original(ins, state)

    def _near(self, loc: Byte) -> bool:
        """A variable of this function or a global: another function's bytes are only good right
        behind its call.
        """
        return loc.symbol.static or id(loc.symbol) in self.own

    def _original(self, ins: Ins, state: State) -> None:
        """Read the variable that a temporary is a copy of."""
        known = state.get(ins.f)
        if known is None or not is_private(ins.f):
            return
        for loc, value in state.items():
            if loc == ins.f:
                return  # the temporary came first
            if value == known and isinstance(loc, Byte) and trackable(loc) and self._near(loc):
                ins.f = loc
                self.changed = True
                return


def _common(one: State, two: State) -> State:
    return {loc: value for loc, value in one.items() if two.get(loc) == value}
