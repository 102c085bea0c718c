"""Every path of a program from reset, interrupts at any point included, on abstract states.

In: the words of a program. Out: `Paths`: what its paths reach, read, write and call. The result holds for
every content of RAM and registers at power-up, every level of every input at any time, and every moment of
every interrupt that the program enables.

States are kept apart by address, return addresses and values, so that loops with known counters are followed
turn by turn, until an address has `MAX_STATES` of them; from then on they are joined.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import reduce
from operator import or_

from servogen.pic.analysis import values
from servogen.pic.analysis.demand import ExecutionGroup, Graph, Node, SplitPlan
from servogen.pic.analysis.state import (
    BANK,
    DIGIT,
    GIE,
    INTCON,
    LATCHES,
    OPTION,
    PCLATH,
    PORT_BITS,
    PORTA,
    PRESERVED,
    T0IE,
    TRISA,
    TRISB,
    AbstractState,
    Effects,
    Place,
    at_interrupt,
    at_reset,
    bits,
    computed,
    execute,
    operands,
    skip_ways,
)
from servogen.pic.analysis.values import Value
from servogen.pic.device import (
    ERASED_WORD,
    INTERRUPT_VECTOR,
    PROGRAM_WORDS,
    RAM_FIRST,
    RAM_LAST,
    STACK_LEVELS,
)
from servogen.pic.isa import Opcode, decode
from servogen.pic.known_values import CARRY, FSR, PCL, ZERO, DecodedWord, Undefined, W, word_of
from servogen.pic.wcet import TimedProgram, is_live

MAX_STATES = 20
"""The number of states of an address and call path kept apart; beyond it, those with equal FSR are joined."""
MAX_POINTERS = 80
"""The number of values of FSR that are then kept apart: a loop over all 68 bytes of RAM is followed turn
by turn.
"""
MAX_APART = 4000
"""The number of values of FSR and the demanded bytes that are kept apart."""
MAX_PARTS = 16
"""The number of parts into which a state is split, one for each member of demanded values."""
MAX_GROWN = 6
"""The number of members to which other values may then grow at the head of a loop; beyond it, they become
any.
"""
MAX_STEPS = 500_000
"""The number of instructions after which the analysis is given up."""
MAX_JUMP_STEPS = 1_400_000
"""The same for all that is followed again, to decide jumps and pointers."""
MAX_REFINED_STEPS = 2_300_000
"""The same including what is followed once more, to decide which pins are written."""
STEPS_TOLD = 20_000
"""The number of instructions between two reports of progress."""
IN_INTERRUPT = -1
"""The mark, at the bottom of the return addresses, of the one that an interrupt pushes."""

_Values = tuple[int | None, ...]
_REST: _Values = ()
"""The key of all states beyond the number that is kept apart."""
_Key = tuple[object, ...]
"""The part of a state that distinguishes it from others: everything except the set of written bytes."""


@dataclass(slots=True)
class _Node:
    """The states in which one address is reached on one call path."""

    apart: dict[_Key, AbstractState] = field(default_factory=dict)
    joined: dict[_Values, AbstractState] | None = None
    """Joined states by the constants in FSR and the counters, once too many states are kept apart."""


@dataclass(frozen=True, slots=True)
class PinWrite:
    """A write of pins by the instruction at `address`; pins count RA0 to RA4, RB0 to RB7."""

    address: int
    pin: int
    certain: bool = True
    """Whether the instruction writes the pin every time it is executed."""


@dataclass(slots=True)
class Paths:
    """What the paths of a program do; sets of (address, place) are unordered."""

    executed: set[int] = field(default_factory=set)
    depth: int = 0
    """The maximum number of return addresses on the stack, outside interrupts."""
    depth_when_interrupted: int | None = None
    """The same where an interrupt may come; None if none ever comes."""
    depth_of_interrupt: int = 0
    """The stack levels that the interrupt needs, including its own return address."""
    overflows: dict[int, tuple[int, ...]] = field(default_factory=dict)
    """Calls that push a ninth return address, with the return addresses on the stack."""
    underflows: set[int] = field(default_factory=set)
    """Returns that find the stack empty."""
    nested_interrupts: set[int] = field(default_factory=set)
    """Addresses in the interrupt's code where another interrupt may come."""

    unwritten_reads: set[tuple[int, Place]] = field(default_factory=set)
    input_writes: set[PinWrite] = field(default_factory=set)
    """Writes of pins that may be inputs then, and whose directions the program has set before."""
    early_writes: set[PinWrite] = field(default_factory=set)
    """Writes of pins whose directions the program has not set yet: it prepares their latches."""
    outputs: set[int] = field(default_factory=set)
    """Pins that are outputs at any time."""
    driven_unwritten: set[PinWrite] = field(default_factory=set)
    """Instructions that make pins outputs whose latches may never have been written."""
    undefined: set[int] = field(default_factory=set)
    """Executed words that no data sheet defines."""
    pointers: set[int] = field(default_factory=set)
    """Instructions that use a completely unknown pointer, which is assumed to address RAM."""
    tables: dict[int, tuple[int, int]] = field(default_factory=dict)
    """Computed jumps with an unknown target, assumed to stay in the table after them, first to last word."""
    beyond: dict[int, int] = field(default_factory=dict)
    """Computed jumps whose known target is beyond the table of RETLWs after them, and that target."""
    computed: dict[int, set[int]] = field(default_factory=dict)
    """The targets of computed jumps."""
    lost: dict[int, str] = field(default_factory=dict)
    """Addresses beyond which paths were not followed, and why."""
    called_from: dict[int, set[int]] = field(default_factory=dict)
    """Starts of functions, and the calls to them."""
    interrupt_sources: int = 0
    """The bits of INTCON that enable interrupts while GIE may be set."""
    interrupt_changes: set[Place] = field(default_factory=set)
    """Places that the code of the interrupt may write."""
    not_restored: set[Place] = field(default_factory=set)
    """Registers that the interrupted program uses and the interrupt may not restore."""
    timer_writes: dict[int, Value] = field(default_factory=dict)
    """Instructions that write TMR0, and the values that they write."""
    timer_adds: dict[int, Value] = field(default_factory=dict)
    """Instructions that add to TMR0, and the values that they add."""
    timer_requests: set[int] = field(default_factory=set)
    """Instructions that may set T0IF."""
    option_writes: dict[int, Value] = field(default_factory=dict)
    """Instructions that write OPTION_REG, and its values afterwards."""
    timer_options: Value | None = None
    """The values that it may have while an interrupt of TMR0 may come; None if none ever comes."""
    timer_interrupted: set[int] = field(default_factory=set)
    """Addresses where it may come."""
    interrupts: bool = False

    @property
    def levels_when_interrupted(self) -> int:
        """Return the maximum depth of the stack inside the interrupt; 0 if none ever comes."""
        if self.depth_when_interrupted is None:
            return 0
        return self.depth_when_interrupted + max(1, self.depth_of_interrupt)

    @property
    def options(self) -> Value:
        """Return the values that OPTION_REG may have at any time."""
        return reduce(or_, self.option_writes.values(), values.constant(0xFF))


_PRUNED = frozenset({W, CARRY, ZERO, FSR, *range(RAM_FIRST, RAM_LAST + 1)})


class _TooLong(Exception):
    """Raised when the analysis has executed too many instructions."""


class UndecidedInstruction(Exception):
    """Raised at an instruction that a plan does not decide, and is not meant to."""

    def __init__(self, node: Node, used: int) -> None:
        super().__init__(node, used)
        self.node, self.used = node, used


@dataclass(slots=True)
class _Interrupt:
    """The effects of the interrupt on the interrupted program, as far as they have been found."""

    entry: AbstractState | None = None
    changes: set[Place] = field(default_factory=set)
    not_restored: set[Place] = field(default_factory=set)
    lost: set[Place] = field(default_factory=set)
    """The registers that it may not restore, and the bytes of RAM that it may write."""
    exits: dict[Place, Value] = field(default_factory=dict)
    """The values of the special registers at the end of the interrupt."""

    def signature(self) -> object:
        """Return what the next round depends on, for comparison with the round before."""
        return (
            frozenset(self.changes),
            frozenset(self.not_restored),
            tuple(sorted(self.exits.items(), key=repr)),
        )


_SPECIAL = (OPTION, TRISA, TRISB, INTCON, PCLATH)
"""Registers whose values after an interrupt are either those before it or those at its end."""


class PathExplorer:
    """Follows every path of a program; `explore` returns what they do."""

    def __init__(
        self,
        words: Mapping[int, int],
        plan: SplitPlan | None = None,
        max_steps: int = MAX_STEPS,
        tell: Callable[[str], None] = lambda text: None,
    ) -> None:
        """Prepare to follow the paths of `words`, with the states kept apart that `plan` says."""
        self._plan = plan
        self._max_joined = MAX_POINTERS if plan is None else MAX_APART
        self._max_steps = max_steps
        self._tell = tell
        self.visits: dict[Node, ExecutionGroup] = {}
        """What was executed, if there is no plan yet: one is made from it."""
        self.undecided: dict[Node, int] = {}
        """Instructions about whose index or pointer too little was known, with the places that they use."""
        self.open_pins: dict[Node, int] = {}
        """The same for writes of which it is not known whether they write inputs."""
        self.gave_up = False
        self._deepest_interrupted = 0
        """Where an interrupt finds the most return addresses on the stack."""
        self.words = {address: in_memory(words.get(address, ERASED_WORD)) for address in range(PROGRAM_WORDS)}
        self._loops: set[int] = set()
        self._heads = self._find_heads()
        live = TimedProgram(self.words, ()).live
        self._dead = {
            address: frozenset(place for place in _PRUNED if not is_live(place, live[address]))
            for address in self._heads
        }
        self._interrupt = _Interrupt()
        self.steps = 0
        self.paths = Paths()

    def explore(self) -> Paths:
        """Return what the paths from reset do. Repeats until what the interrupt changes is stable."""
        try:
            while True:
                before = self._interrupt.signature()
                # What the last round found is discarded, because it assumed that the interrupt changes less.
                self.paths = Paths()
                self._interrupt.entry = None
                self._follow(0, (), at_reset())
                while self._interrupt.entry is not None:
                    entered = self._interrupt.entry
                    self._interrupt.entry = None
                    self._follow(INTERRUPT_VECTOR, (IN_INTERRUPT,), at_interrupt(entered))
                if self._interrupt.signature() == before:
                    break
        except _TooLong:
            self.gave_up = True
            self.paths.lost[0] = f"more than {self._max_steps} instructions to follow"
        self._lose_overflowing_interrupts()
        self.paths.interrupt_changes = set(self._interrupt.changes)
        self.paths.not_restored = set(self._interrupt.not_restored)
        return self.paths

    def _lose_overflowing_interrupts(self) -> None:
        """Note where an interrupt overwrites a return address, so that the program returns astray."""
        paths = self.paths
        if paths.levels_when_interrupted > STACK_LEVELS:
            paths.lost[self._deepest_interrupted] = "an interrupt pushes a ninth return address"
        elif paths.nested_interrupts:
            paths.lost[min(paths.nested_interrupts)] = "the interrupt may be interrupted, without a bound"

    @property
    def open(self) -> tuple[int, int]:
        """Return how many instructions are not decided, and how many writes of pins."""
        return len(self.undecided), len(self.open_pins)

    def _find_heads(self) -> frozenset[int]:
        heads = {0, INTERRUPT_VECTOR}
        for address, number in self.words.items():
            try:
                word = word_of(number)
            except Undefined:
                continue
            if word.flow in ("jump", "call"):
                heads |= {word.k, (address + 1) % PROGRAM_WORDS}
                if word.flow == "jump" and word.k <= address and self._plan is not None:
                    self._loops.add(word.k)
        return frozenset(heads)

    def _prune(self, address: int, state: AbstractState) -> None:
        """Forget values that no instruction will read again, so that paths meet."""
        dead = self._dead.get(address, frozenset())
        for place in state.values.keys() & dead:
            del state.values[place]
        for flag in state.facts.keys() & dead:
            del state.facts[flag]
        if W in dead:
            state.copies = ()

    def _follow(self, address: int, stack: tuple[int, ...], state: AbstractState) -> None:
        """Follow every path from a state to its end."""
        nodes: dict[tuple[int, tuple[int, ...]], _Node] = {}
        waiting: deque[tuple[int, tuple[int, ...], AbstractState]] = deque()
        pending: set[int] = set()
        entry: AbstractState | None = None

        def reach(address: int, stack: tuple[int, ...], state: AbstractState) -> None:
            """Note that a state reaches an address, split where the plan keeps states apart."""
            for part in self._parts(address, stack, state):
                self._prune(address, part)
                reach_with(address, stack, part)

        def reach_with(address: int, stack: tuple[int, ...], state: AbstractState) -> None:
            """Store a state at its node, and queue it if the node did not cover it yet."""
            node = nodes.setdefault((address, stack), _Node())
            if node.joined is None:
                key = (
                    frozenset(state.values.items()),
                    frozenset(state.saved.items()),
                    frozenset(state.facts.items()),
                    state.copies,
                )
                # `written` is not part of the key: states that differ only in it are joined, and keep
                # what both have written.
                known_state = node.apart.get(key)
                if known_state is not None:
                    if known_state.written & ~state.written:
                        known_state.written &= state.written
                        waiting.append((address, stack, known_state))
                    return
                if len(node.apart) < MAX_STATES:
                    node.apart[key] = state
                    waiting.append((address, stack, state))
                    return
                node.joined = {}
                for separate in node.apart.values():
                    add(address, stack, node, separate)
            add(address, stack, node, state)

        def add(address: int, stack: tuple[int, ...], node: _Node, state: AbstractState) -> None:
            """Join a state to those of its node with the same key, and queue the result if it has grown."""
            joined = node.joined
            assert joined is not None
            key = tuple(state.get(place).constant for place in (FSR, *self._apart(address, stack)))
            if key not in joined and len(joined) >= self._max_joined:
                key = _REST
            known = joined.get(key)
            if known is None:
                joined[key] = state.copy()
                pending.add(id(joined[key]))
                waiting.append((address, stack, joined[key]))
            # A state that is still waiting will be executed with what was added to it.
            elif known.join(state, *self._growth(address, stack)) and id(known) not in pending:
                pending.add(id(known))
                waiting.append((address, stack, known))

        def interruptible(state: AbstractState) -> None:
            """Add a state in which an interrupt may come to the state in which its code begins."""
            nonlocal entry
            if entry is None:
                entry = state.copy()
                self._interrupt.entry = entry
            elif entry.join(state):
                self._interrupt.entry = entry

        self._reach, self._interruptible = reach, interruptible
        reach(address, stack, state.copy())
        # To the fixed point, not a search of what is reached: a state comes back as often as it grows.
        while waiting:
            address, stack, state = waiting.popleft()
            pending.discard(id(state))
            self._run(address, stack, state.copy())

    def _apart(self, address: int, stack: tuple[int, ...]) -> tuple[Place, ...]:
        """Return the places by whose values the states of a node are kept apart."""
        return () if self._plan is None else self._plan.apart.get((address, stack), ())

    def _growth(self, address: int, stack: tuple[int, ...]) -> tuple[int, int]:
        """Return how many members a value may grow to where states meet, and the places that are exempt."""
        if self._plan is None or address not in self._loops:
            return 256, 0
        return MAX_GROWN, self._plan.kept.get((address, stack), 0)

    def _parts(self, address: int, stack: tuple[int, ...], state: AbstractState) -> list[AbstractState]:
        """Return a state, split into one for each member of the values that keep states apart."""
        parts = [state]
        for place in self._apart(address, stack):
            value = state.values.get(place)
            if place == W or value is None or value.constant is not None:
                continue  # W alone would be split just before the jump that it is the index of
            if len(parts) * value.size > MAX_PARTS:
                continue
            parts = [part for whole in parts for part in whole.split(place)]
        return parts

    def _run(self, address: int, stack: tuple[int, ...], state: AbstractState) -> None:
        """Execute instructions up to where paths part or meet, or up to one that was executed already."""
        passed: set[int] = set()
        while True:
            passed.add(address)
            followers = self._step(address, stack, state)
            if self._plan is None:
                self._visit(address, stack, state, followers)
            # A computed jump may lead back, even to itself, to an address that no GOTO or CALL names.
            if len(followers) != 1 or followers[0][0] in self._heads or followers[0][0] in passed:
                for follower in followers:
                    self._reach(*follower)
                return
            address, stack, state = followers[0]

    def _visit(
        self,
        address: int,
        stack: tuple[int, ...],
        state: AbstractState,
        followers: list[tuple[int, tuple[int, ...], AbstractState]],
    ) -> None:
        """Note where an instruction continues, and which bytes it addressed."""
        visit = self.visits.get((address, stack))
        if visit is None:
            visit = self.visits[address, stack] = ExecutionGroup()
        visit.followers.update((follower, then) for follower, then, _ in followers)
        try:
            word = word_of(self.words[address])
        except Undefined:
            return
        if word.has_f:
            visit.places.update(operand.place for operand in operands(state, word.f)[0])

    def _step(
        self, address: int, stack: tuple[int, ...], state: AbstractState
    ) -> list[tuple[int, tuple[int, ...], AbstractState]]:
        self.steps += 1
        if self.steps > self._max_steps:
            raise _TooLong
        if not self.steps % STEPS_TOLD:
            self._tell(f"following every path: {self.steps} of at most {self._max_steps} instructions")
        paths, inside = self.paths, bool(stack) and stack[0] == IN_INTERRUPT
        paths.executed.add(address)
        if state.interruptible:
            self._note_interrupt(address, stack, state, inside=inside)
        try:
            word = word_of(self.words[address])
        except Undefined:
            paths.undefined.add(address)
            return [((address + 1) % PROGRAM_WORDS, stack, state)]
        if state.interruptible and not inside:
            self._after_interrupt(state)
        if word.writes_pcl:
            return self._computed_jump(address, stack, state, word)
        after, effects = execute(state, word, address)
        self._note(address, stack, state, after, word, effects, inside=inside)
        if effects.jumps:
            self._leave_open(address, stack, FSR)
            paths.lost[address] = "a pointer may address PCL"
            return []
        if word.flow == "skip":
            return [
                ((address + step) % PROGRAM_WORDS, stack, self._settled(refined, inside=inside))
                for step, refined in skip_ways(after, state, word, address)
            ]
        after = self._settled(after, inside=inside)
        if word.flow == "jump":
            return [(word.k, stack, after)]
        if word.flow == "call":
            return self._call(address, stack, after, word)
        if word.flow == "return":
            return self._return(address, stack, after, word)
        return [((address + 1) % PROGRAM_WORDS, stack, after)]

    def _settled(self, state: AbstractState, *, inside: bool) -> AbstractState:
        if not inside and state.interruptible:
            self._after_interrupt(state)
        return state

    def _note_interrupt(
        self, address: int, stack: tuple[int, ...], state: AbstractState, *, inside: bool
    ) -> None:
        paths = self.paths
        paths.interrupts = True
        sources = 0
        for member in state.get(INTCON):
            if member & GIE:
                sources |= member & 0x78
        paths.interrupt_sources |= sources
        if sources & T0IE:
            option = state.get(OPTION)
            paths.timer_options = option if paths.timer_options is None else paths.timer_options | option
            paths.timer_interrupted.add(address)
        if inside:
            paths.nested_interrupts.add(address)
            return
        if paths.depth_when_interrupted is None or len(stack) > paths.depth_when_interrupted:
            paths.depth_when_interrupted, self._deepest_interrupted = len(stack), address
        self._interruptible(state)

    def _after_interrupt(self, state: AbstractState) -> None:
        """Add to a state in which an interrupt may come what it may be afterwards."""
        interrupt = self._interrupt
        state.forget(interrupt.lost)
        for place, value in interrupt.exits.items():
            if place in state.values:
                state.values[place] |= value
                state.unrelate(place)

    def _leave_open(self, address: int, stack: tuple[int, ...], *used: Place, pins: bool = False) -> None:
        """Note an instruction that is not decided. Raises Undecided if the plan leaves out what it uses."""
        node, plan = (address, stack), self._plan
        kind = self.open_pins if pins else self.undecided
        kind[node] = kind.get(node, 0) | bits(used)
        if plan is not None and plan.pins >= pins and kind[node] & ~plan.uses.get(node, 0):
            raise UndecidedInstruction(node, kind[node])

    def _note(
        self,
        address: int,
        stack: tuple[int, ...],
        before: AbstractState,
        after: AbstractState,
        word: DecodedWord,
        effects: Effects,
        *,
        inside: bool,
    ) -> None:
        paths = self.paths
        for place in effects.unwritten:
            paths.unwritten_reads.add((address, place))
        if effects.any_byte or effects.wild:
            self._leave_open(address, stack, FSR)
            paths.pointers.add(address)
        if inside:
            self._interrupt.changes |= effects.changed
            self._interrupt.lost |= {place for place in effects.changed if RAM_FIRST <= place <= RAM_LAST}
        for noted, value in (
            (paths.timer_writes, effects.timer_writes),
            (paths.timer_adds, effects.timer_adds),
        ):
            if value is not None:
                noted[address] = noted[address] | value if address in noted else value
        if effects.requests_timer:
            paths.timer_requests.add(address)
        for pin in effects.driven_unwritten:
            paths.driven_unwritten.add(PinWrite(address, pin))
        for place, port in ((TRISA, PORTA), (TRISB, 6)):
            if place in effects.changed:
                first, count = PORT_BITS[port]
                directions = after.get(place)
                paths.outputs |= {first + bit for bit in range(count) if directions.may_be_0 >> bit & 1}
        if OPTION in effects.changed:
            option = after.get(OPTION)
            known = paths.option_writes.get(address)
            paths.option_writes[address] = option if known is None else known | option
        for port, may, must in effects.pins:
            if self._note_pins(address, before, port, may, must):
                self._leave_open(address, stack, FSR, W, pins=True)

    def _note_pins(self, address: int, state: AbstractState, port: int, may: int, must: int) -> bool:
        """Note the inputs that are written; return whether it is not known which."""
        first, count = PORT_BITS[port]
        direction = TRISA if port == PORTA else TRISB
        directions = state.get(direction)
        untouched, open_ = directions.constant == (1 << count) - 1, False
        for bit in range(count):
            if may >> bit & 1 and directions.may_be_1 >> bit & 1:
                target = self.paths.early_writes if untouched else self.paths.input_writes
                certain = bool(must >> bit & 1)
                target.add(PinWrite(address, first + bit, certain))
                open_ |= not (certain or untouched)
        return open_

    def _call(
        self, address: int, stack: tuple[int, ...], state: AbstractState, word: DecodedWord
    ) -> list[tuple[int, tuple[int, ...], AbstractState]]:
        paths, target = self.paths, word.k
        paths.called_from.setdefault(target, set()).add(address)
        if len(stack) >= STACK_LEVELS:
            paths.overflows.setdefault(address, stack)
            paths.lost[address] = "a ninth return address"
            return []
        deeper = (*stack, (address + 1) % PROGRAM_WORDS)
        if deeper[0] == IN_INTERRUPT:
            paths.depth_of_interrupt = max(paths.depth_of_interrupt, len(deeper))
        elif len(deeper) > paths.depth:
            paths.depth = len(deeper)
        return [(target, deeper, state)]

    def _return(
        self, address: int, stack: tuple[int, ...], state: AbstractState, word: DecodedWord
    ) -> list[tuple[int, tuple[int, ...], AbstractState]]:
        if not stack:
            self.paths.underflows.add(address)
            self.paths.lost[address] = "a return with an empty stack"
            return []
        if word.name == "RETFIE":
            enables = values.mapped(state.get(INTCON), lambda member: member | GIE)
            state.put(INTCON, enables)
        if stack[-1] == IN_INTERRUPT:
            self.paths.depth_of_interrupt = max(self.paths.depth_of_interrupt, 1)
            self._end_interrupt(state)
            return []
        if stack[0] != IN_INTERRUPT:
            self._settled(state, inside=False)
        return [(stack[-1], stack[:-1], state)]

    def _end_interrupt(self, state: AbstractState) -> None:
        interrupt = self._interrupt
        for place in PRESERVED:
            if state.saved.get(place) != (place, False):
                interrupt.not_restored.add(place)
                interrupt.lost.add(place)
        for place in _SPECIAL:
            if place in interrupt.changes or place == INTCON:
                value = state.get(place)
                interrupt.exits[place] = interrupt.exits[place] | value if place in interrupt.exits else value

    def _computed_jump(
        self, address: int, stack: tuple[int, ...], state: AbstractState, word: DecodedWord
    ) -> list[tuple[int, tuple[int, ...], AbstractState]]:
        paths, inside = self.paths, bool(stack) and stack[0] == IN_INTERRUPT
        after, effects = execute(state, word, address)
        self._note(address, stack, state, after, word, effects, inside=inside)
        low, high, table = _low_byte(state, word, address), state.get(PCLATH), self._table(address)
        targets = {(page << 8 | byte) % PROGRAM_WORDS for page in high for byte in low}
        leaves = bool(table) and targets.isdisjoint(table)  # whatever the index is: PCLATH is of another page
        if len(targets) > 1 and not targets <= set(table) and not leaves:
            self._leave_open(address, stack, W)
            if not table:
                paths.lost[address] = "a computed jump"
                return []
            paths.tables[address] = (table[0], table[-1])
            targets = set(table)
        elif not targets <= set(table) and word.name == "ADDWF" and self._is_table_of_bytes(table):
            self._leave_open(address, stack, W)
            paths.beyond[address] = min(targets)
        paths.computed.setdefault(address, set()).update(targets)
        after = self._settled(after, inside=inside)
        words = [decode(self.words[target]) for target in sorted(targets)]
        returned = [word.k for word in words if word is not None and _is_retlw(word.instruction)]
        if len(words) > 1 and len(returned) == len(words):
            # A table: one return with any of its bytes
            paths.executed |= targets
            self.steps += len(targets)
            after.put(W, values.of(returned))
            return self._return(address, stack, self._settled(after, inside=inside), word)
        return [(target, stack, after.copy()) for target in sorted(targets)]

    def _is_table_of_bytes(self, table: list[int]) -> bool:
        words = [decode(self.words[address]) for address in table]
        return len(words) > 1 and all(word is not None and _is_retlw(word.instruction) for word in words)

    def _table(self, address: int) -> list[int]:
        """Return the RETLWs or GOTOs that follow a computed jump without a gap."""
        addresses = []
        for following in range(address + 1, PROGRAM_WORDS):
            decoded = decode(self.words[following])
            if decoded is None or not (decoded.instruction.flow == "jump" or _is_retlw(decoded.instruction)):
                break
            addresses.append(following)
        return addresses


def in_memory(number: int) -> int:
    """Return a word whose jump or call leads into the 1024 words that the chip has; they repeat (DS35007
    section 2.1).
    """
    decoded = decode(number)
    if decoded is None or decoded.instruction.flow not in ("jump", "call"):
        return number
    return number & ~PROGRAM_WORDS


def _is_retlw(row: Opcode) -> bool:
    return row.flow == "return" and row.writes == "W"


def _low_byte(state: AbstractState, word: DecodedWord, address: int) -> Value:
    """Return what an instruction writes to PCL."""
    return computed(word, state.get(W), values.constant(address + 1 & 0xFF), state.get(CARRY))[0]


def explore(words: Mapping[int, int], tell: Callable[[str], None] = lambda text: None) -> Paths:
    """Return what the paths of a program do; `tell` is given the progress.

    Where jumps or pointers are not decided the paths are followed again, with states kept apart by the bytes
    from which these are made; what is not decided then is added, until it takes too long. After that the same
    is done for the pins that are written.
    """
    best = PathExplorer(words, tell=tell)
    best.explore()
    graph = Graph(best.words, best.visits)
    uses: dict[Node, int] = {}
    steps = 0
    for pins, limit in ((False, MAX_JUMP_STEPS), (True, MAX_REFINED_STEPS)):
        fresh = best.open_pins if pins else best.undecided
        uses |= {node: uses.get(node, 0) | used for node, used in fresh.items()}
        while fresh:
            if steps >= limit:
                return best.paths
            plan = SplitPlan.of(graph, uses, pins=pins)
            explorer = PathExplorer(words, plan, max_steps=limit - steps, tell=tell)
            try:
                explorer.explore()
            except UndecidedInstruction as undecided:
                for node in graph.alike(undecided.node):
                    uses[node] = uses.get(node, 0) | undecided.used
                steps += explorer.steps
                continue
            if explorer.gave_up:
                return best.paths
            steps += explorer.steps
            if explorer.paths.beyond or explorer.open < best.open:
                best = explorer
            break
    return best.paths


_NAMES = {
    W: "W", FSR: "FSR", CARRY: "C", DIGIT: "DC", ZERO: "Z", BANK: "RP0", 1: "TMR0", PCL: "PCL",
    PCLATH: "PCLATH", INTCON: "INTCON", OPTION: "OPTION_REG", TRISA: "TRISA", TRISB: "TRISB",
}  # fmt: skip


def place_text(place: Place, names: Mapping[int, str]) -> str:
    """Return one place as a reader knows it."""
    if place in _NAMES:
        return _NAMES[place]
    if place >= LATCHES:
        return f"the latch of {pin_text(place - LATCHES)}"
    return f"{names[place]} (0x{place:02X})" if place in names else f"byte 0x{place:02X}"


def pin_text(pin: int) -> str:
    """Return a pin's name by its index: RA0 to RA4, RB0 to RB7."""
    return f"RA{pin}" if pin < 5 else f"RB{pin - 5}"
