"""Tracks what W and bytes hold, so that nothing is loaded, stored or tested twice.

In: a `Function`. Out: loads of what W already holds are removed, operands whose value is known become
constants, temporaries that are copies are replaced by their originals. Facts flow forward; where edges meet
only what holds on all of them is kept, and nothing where a loop comes back.
"""

from __future__ import annotations

from collections import Counter
from itertools import count

from servogen.compiler.ir.function import Block, Function
from servogen.compiler.ir.instruction import (
    BIT_TESTS,
    DELAY,
    ENDS,
    FSR,
    IDLE,
    INDF,
    STATUS,
    Byte,
    Imm,
    Instruction,
    Loc,
)
from servogen.compiler.passes.dead_code import remove
from servogen.compiler.passes.liveness import Z_BIT, Liveness, is_private
from servogen.pic.isa import literal_forms

Value = Imm | int
"""A constant, or the number of something unknown."""
State = dict[object, Value]
_W, _ZERO = "W", "Z"
"""Keys of a state besides bytes: what W holds, and the value that Z tells to be 0 or not."""
_TO_LITERAL = literal_forms()


def trackable(loc: object) -> bool:
    """Return whether a location is a byte of RAM, or FSR, that changes only where the code does so."""
    return loc == FSR or (isinstance(loc, Byte) and not loc.symbol.volatile)


def number_values(function: Function) -> bool:
    """Replace operands and remove instructions using what is known to be equal; return whether something
    changed.
    """
    return _Tracker(function).run()


class _Tracker:
    """One forward pass over a function."""

    def __init__(self, function: Function) -> None:
        self.function = function
        self.live = Liveness(function)
        self.own = {id(symbol) for symbol in function.own}
        self.numbers = count()
        self.results: dict[tuple[str, Value, object], Value] = {}
        self.dead: set[Instruction] = set()
        self.changed = False
        self.arriving: dict[str, list[State]] = {}
        self.seen: dict[str, int] = {}

    def run(self) -> bool:
        """Visit the blocks in order, each with what holds on the edges that lead to it; return whether
        something changed.
        """
        blocks = self.function.blocks
        sources = Counter(ins.target for ins in self.function.instructions() if ins.op == "GOTO")
        skipped = self.function.skipped()
        over: dict[int, State] = {}
        """What is known on the edge over a skipped block, by the number of the block behind it."""
        state: State | None = {}
        for number, block in enumerate(blocks):
            state = self._join(state, over.pop(number, None))
            for label in block.labels:
                state = self._meet(label.name, sources[label.name], state)
            if state is None:
                continue
            self._block(block, state, in_skip=block in skipped)
            last = block.last
            if last is not None and last.skips and last not in self.dead:
                # the edge over the next block arrives at the one after it
                over[number + 2] = dict(state)
            elif last is not None and last.op in ENDS:
                state = None
        return remove(self.function, self.dead, self.live) or self.changed

    def _block(self, block: Block, state: State, *, in_skip: bool) -> None:
        """Visit the instructions of a block; the state holds before each of them."""
        for ins in block.instructions:
            if not (in_skip and ins.skips):
                self._rewrite(ins, state)
            if ins in self.dead:
                continue
            if ins.op == "GOTO":
                self.arriving.setdefault(ins.target, []).append(dict(state))
                self.seen[ins.target] = self.seen.get(ins.target, 0) + 1
            self._apply(ins, state)
            if ins.fixed and ins.op not in IDLE:
                state.clear()  # assembly may reach variables by their addresses

    def _join(self, left: State | None, right: State | None) -> State | None:
        """Return what holds on both of two edges; None is an edge that control does not take."""
        if left is None or right is None:
            return right if left is None else left
        return _common(left, right)

    def _meet(self, label: str, sources: int, state: State | None) -> State | None:
        """Return what holds at a label: on all jumps to it and on the path that falls into it."""
        if self.seen.get(label, 0) < sources:
            return {}  # a jump back leads here, and its state is not known yet
        states = [arriving for arriving in [*self.arriving.get(label, []), state] if arriving is not None]
        if not states:
            return None
        common = states[0]
        for arriving in states[1:]:
            common = _common(common, arriving)
        return dict(common)

    def fresh(self) -> int:
        return next(self.numbers)

    def value(self, state: State, loc: object) -> Value:
        """Return the value of a location, numbered anew if nothing is known about it."""
        if loc not in state:
            state[loc] = self.fresh()
        return state[loc]

    # what an instruction changes

    def _apply(self, ins: Instruction, state: State) -> None:
        """Update the state by the effect of an instruction."""
        op = ins.op
        if op in IDLE or op in ENDS:
            return
        if op == "CALL":
            # the callee may change everything except the private bytes of this function
            for loc in [key for key in state if not (is_private(key) and id(key.symbol) in self.own)]:  # type: ignore[attr-defined]
                del state[loc]
            return
        # the loop that a delay is expanded to may count in W
        if op == DELAY:
            state.pop(_W, None)
            state.pop(_ZERO, None)
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
        if "Z" in ins.flags:
            self._note_zero(ins, state)

    def _note_zero(self, ins: Instruction, state: State) -> None:
        """Note which value Z tells to be 0 or not."""
        holder: object = ins.f if ins.op == "MOVF" or ins.writes_f else _W
        if ins.f == STATUS or (holder != _W and not trackable(holder)):
            state.pop(_ZERO, None)
        else:
            state[_ZERO] = self.value(state, holder)

    def _result(self, ins: Instruction, state: State) -> Value:
        """Return the value number of a result; the same operation on the same values has the same number."""
        other: object
        if ins.op in _TO_LITERAL.values():
            other = Imm(ins.k)
        elif ins.op in _TO_LITERAL and trackable(ins.f):
            other = self.value(state, ins.f)
        else:
            return self.fresh()
        return self.results.setdefault((ins.op, self.value(state, _W), other), self.fresh())

    def _store(self, loc: Loc | None, value: Value, state: State) -> None:
        """Record the value of a location that is written; a write through INDF may change any byte but
        private ones.
        """
        if loc == INDF:
            for other in [other for other in state if not is_private(other) and other not in (_W, FSR)]:
                del state[other]
        elif trackable(loc):
            self._forget_aliases(loc, state)
            state[loc] = value

    def _forget_aliases(self, loc: Loc | None, state: State) -> None:
        """Forget what is known about fixed-address variables, which may overlap a location."""
        if isinstance(loc, Byte) and loc.symbol.kind == "fixed":
            for other in [
                other
                for other in state
                if isinstance(other, Byte) and other.symbol.kind == "fixed" and other != loc
            ]:
                del state[other]

    # what an instruction can become

    def _rewrite(self, ins: Instruction, state: State) -> None:
        """Replace an instruction by a cheaper one, or mark it as dead, where the state allows that."""
        if ins.fixed:
            return
        z_free = not self.live.after[ins] & Z_BIT
        w = state.get(_W)
        match ins.op:
            case "MOVLW":
                if w == Imm(ins.k):
                    self.dead.add(ins)
            case "MOVWF":
                if trackable(ins.f) and w is not None and state.get(ins.f) == w:
                    self.dead.add(ins)
            case "CLRF":
                if z_free and trackable(ins.f) and state.get(ins.f) == Imm(0):
                    self.dead.add(ins)
            case "MOVF" if ins.d == 0 and trackable(ins.f):
                known = state.get(ins.f)
                if z_free and known is not None and known == w:
                    self.dead.add(ins)
                elif z_free and isinstance(known, Imm):
                    ins.op, ins.f, ins.k = "MOVLW", None, known.value
                    self.changed = True
                elif known is not None and known == w == state.get(_ZERO):
                    self.dead.add(ins)
            case "MOVF" if trackable(ins.f):
                known = state.get(ins.f)
                if known is not None and known == state.get(_ZERO):
                    self.dead.add(ins)  # Z is set already
            case "IORLW" if ins.k == 0:
                if w is not None and w == state.get(_ZERO):
                    self.dead.add(ins)
        if ins in self.dead:
            return
        if ins.op in _TO_LITERAL and ins.d == 0 and trackable(ins.f):
            known = state.get(ins.f)
            if isinstance(known, Imm):
                ins.op, ins.f, ins.k = _TO_LITERAL[ins.op], None, known.value
                self.changed = True
                return
        only_reads = ins.reads_f and not ins.writes_f and (not ins.skips or ins.op in BIT_TESTS)
        if only_reads and isinstance(ins.f, Byte) and ins.f.symbol.kind == "temp":
            self._original(ins, state)

    def _near(self, loc: Byte) -> bool:
        """Return whether a location is a variable of this function or a global; another function's bytes are
        only valid directly after a call of it.
        """
        return loc.symbol.static or id(loc.symbol) in self.own

    def _original(self, ins: Instruction, state: State) -> None:
        """Read the variable that a temporary is a copy of instead of the temporary."""
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


def _common(left: State, right: State) -> State:
    """Return what two states agree on."""
    return {loc: value for loc, value in left.items() if right.get(loc) == value}
