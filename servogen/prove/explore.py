"""The search through all abstract states that a program can reach at its cut points.

In: the transitions of a program, a specification, cut points with what is generalised there. Out: the
states, from each of which every run to the next cut was followed, with all its edges as specified; or what
was found instead. Breadth first: the first violation is one of the nearest.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass, field, replace
from enum import Enum
from operator import ge

from servogen.prove.chip import FIELD, AbstractChip, AssumedBits, ChipState, Reason, RunOutcome, Use
from servogen.prove.forks import ALONE, Choices, PreparedProgram, before_instruction, ways_of, ways_of_latches
from servogen.prove.generalise import Generaliser
from servogen.prove.nodes import Decision, Node
from servogen.prove.quantifiers import Quantifiers
from servogen.prove.specification import BEFORE, IN_FRAME, Specification, SpecState, Violation
from servogen.prove.transitions import Ram, Transitions, applied
from servogen.prove.wire import SILENT
from servogen.pulse.schedule import START_FRAMES
from servogen.simulator.layout import EEIE, NEVER, T0IF, USE_INTERRUPT

_SLEEPING, _EE_DONE_AT = FIELD["SLEEPING"], FIELD["EE_DONE_AT"]

MAX_POINTS = 20_000
"""Points between two cuts on the ways from one state: more are an explosion, not a program of this kind."""
WORK_PER_STATE = 20
"""Points in all, for each state that may be stored."""


class SearchAnswer(Enum):
    """How a search ended."""

    CLOSED = "no new state comes"
    VIOLATED = "a way leads to an edge that is not the specification's"
    UNDECIDED = "not decided"
    REFINE = "something that was generalised decides"
    CUT = "a cut point is missing"


@dataclass(frozen=True, slots=True)
class SearchFinding:
    """A violation, or what could not be decided, and the way there."""

    node: int
    decisions: tuple[Decision, ...]
    cycle: int
    """Since the node."""
    message: str
    certain: bool
    pc: int
    use: Use | None = None
    silent: bool = False
    """Whether it is that no pulse comes."""


@dataclass(slots=True)
class SearchResult:
    """The result of a search."""

    answer: SearchAnswer
    nodes: list[Node]
    finding: SearchFinding | None = None
    open_nodes: int = 0
    cut: int = 0
    waits: tuple[tuple[int, int, int], ...] = ()
    """The ways between states before the first pulse, which must not form a cycle, and their cycles."""
    asynchronous: bool = False
    """Whether something other than TMR0 may interrupt the program, end its SLEEP or its EEPROM write."""
    silence: int | None = None
    """The cycles from a reset to the first pulse, at least; None where no way comes to one by itself."""


@dataclass(frozen=True, slots=True)
class _Trail:
    """The decisions since the last cut, the latest first."""

    decision: Decision
    before: _Trail | None


def _decisions(trail: _Trail | None) -> tuple[Decision, ...]:
    decisions = []
    while trail is not None:
        decisions.append(trail.decision)
        trail = trail.before
    return tuple(reversed(decisions))


PointKey = tuple[Ram, int, SpecState, Use | None, Choices, int]


@dataclass(slots=True)
class _Point:
    """Between two cuts."""

    node: int
    """At the last of them."""
    ram: Ram
    rest: int
    spec: SpecState
    cycle: int
    trail: _Trail | None = None
    chosen: Choices = ()
    use: Use | None = None

    @property
    def key(self) -> PointKey:
        """Return what the ways from here depend on; before the first pulse also the time since the cut."""
        waited = self.cycle if self.spec.phase == BEFORE else 0
        return (self.ram, self.rest, self.spec, self.use, self.chosen, waited)


def starts_of(chip: AbstractChip, over: Quantifiers, written: frozenset[int]) -> list[ChipState]:
    """Return the states in which a run may begin, if the program writes the places in `written`."""
    if not over.resets:
        return [chip.power_on()]
    reset = chip.after_reset(written)
    return [chip.power_on(), reset] if over.start else [reset]


def search_until_decided(
    search: Callable[[frozenset[int]], SearchResult],
    add_cut: Callable[[int], None],
    most: tuple[int, int],
    written: Callable[[], frozenset[int]],
) -> tuple[SearchResult, frozenset[int]]:
    """Search, add what the search asks for, and search again; return the last answer, and what was written.

    `search` gets the places that the program is known to write. `most` is how many cuts are added, and how
    often a state is refined. `written` returns the places that matter to a start.
    """
    cuts, refinements = most
    known: frozenset[int] = frozenset()
    while True:
        found = search(known)
        if found.answer is SearchAnswer.CUT and cuts:
            cuts -= 1
            add_cut(found.cut)
        elif found.answer is SearchAnswer.REFINE and refinements:
            refinements -= 1
        elif found.answer is SearchAnswer.CLOSED and written() - known:
            # A reset leaves the RAM as it was (DS35007 table 6-4): of the known start values, only those
            # hold that the program never writes. Runs with fewer of them may write more places, so this
            # repeats until none is added.
            known = written()
        else:
            return found, known


def why_undecided(finding: SearchFinding, search: SearchResult) -> str:
    """Return a finding with its place, and how far the search came."""
    place = f"address 0x{finding.pc:03X}, {len(search.nodes)} states seen, {search.open_nodes} open"
    return f"{finding.message} ({place})"


class _Ended(Exception):
    """Raised where a search has its answer before all states are expanded."""

    def __init__(self, answer: SearchAnswer, finding: SearchFinding | None = None, cut: int = 0) -> None:
        super().__init__(answer)
        self.answer, self.finding, self.cut = answer, finding, cut


@dataclass
class Explorer:
    """One search."""

    program: PreparedProgram
    transitions: Transitions
    spec: Specification
    generaliser: Generaliser
    phases: int
    """In how many ways TMR0 may begin."""
    max_states: int
    tell: Callable[[int, int], None]
    starts: Sequence[ChipState]
    latches: int = 0
    """The pins, as bits, whose latches at the start are told apart."""
    _nodes: list[Node] = field(default_factory=list)
    _known: dict[tuple[Ram, int, object], list[tuple[tuple[int, ...], int]]] = field(default_factory=dict)
    """The numbers of the nodes, with what is greater in worse ones."""
    _covered: set[int] = field(default_factory=set)
    """Nodes for which a worse one was found."""
    _queue: deque[int] = field(default_factory=deque)
    _work: int = 0
    _reads_eeprom: bool = False
    _writes_eeprom: bool = False
    _asynchronous: bool = False
    _rises: dict[int, int] = field(default_factory=dict)
    """By node, in how many cycles from there the first pulse comes, at least."""
    _waits: list[tuple[int, int, int]] = field(default_factory=list)

    def search(self) -> SearchResult:
        """Return all states, or the first finding."""
        ended = _Ended(SearchAnswer.CLOSED)
        try:
            self._expand_all()
        except _Ended as early:
            ended = early
        return SearchResult(
            answer=ended.answer,
            nodes=self._nodes,
            finding=ended.finding,
            open_nodes=len(self._queue),
            cut=ended.cut,
            waits=tuple(self._waits),
            asynchronous=self._asynchronous,
            silence=self._silence(),
        )

    def _silence(self) -> int | None:
        """Return the cycles from a reset to the first pulse on the shortest way."""
        since = dict.fromkeys(range(len(self.starts)), 0)
        shorter = True
        while shorter:
            shorter = False
            for parent, child, cycles in self._waits:
                if parent in since and since[parent] + cycles < since.get(child, NEVER):
                    since[child], shorter = since[parent] + cycles, True
        return min((since[node] + rise for node, rise in self._rises.items()), default=None)

    def _expand_all(self) -> None:
        """Expand states until no new one comes. Raises _Ended, as all that follows does."""
        for start in self.starts:
            self._store(start.ram, self.transitions.number(start.rest), self.spec.start(), -1, 0, ())
        expanded = 0
        while self._queue:
            number = self._queue.popleft()
            if number not in self._covered:
                self._expand(number)
            expanded += 1
            if expanded % 500 == 0:
                self.tell(expanded, len(self._nodes))
            if len(self._nodes) > self.max_states:
                message = f"more than {self.max_states} states"
                raise _Ended(SearchAnswer.UNDECIDED, SearchFinding(number, (), 0, message, False, 0))

    def _store(
        self, ram: Ram, rest: int, spec: SpecState, parent: int, cycles: int, decisions: tuple[Decision, ...]
    ) -> None:
        raw = (ram, rest)
        if parent >= 0:  # a start is not at a cut, and is as general as the quantifiers make it
            ram, rest = self.generaliser.generalised(ram, rest)
        number = self._covering(ram, rest, spec)
        if number < 0:
            number = len(self._nodes)
            self._queue.append(number)
            self._nodes.append(Node(ram, rest, spec, parent, cycles, decisions, raw))
        if spec.phase == BEFORE and parent >= 0:
            # The time before the first pulse is not part of a state, so a program that waits endlessly closes
            # the search. It is found as a cycle among these pairs.
            self._waits.append((parent, number, cycles))

    def _covering(self, ram: Ram, rest: int, spec: SpecState) -> int:
        """Return the state that covers this one: it itself, or one that is worse; -1 if it is new.

        Then it is noted, in place of those that it covers, which need not be expanded any more.
        """
        same, times = self.spec.ordered(spec)
        known = self._known.setdefault((ram, rest, same), [])
        for its, number in known:
            if all(map(ge, its, times)):
                return number
        covered = [number for its, number in known if all(map(ge, times, its))]
        self._covered.update(covered)
        known[:] = [each for each in known if each[1] not in covered]
        known.append((times, len(self._nodes)))
        return -1

    def _expand(self, number: int) -> None:
        node = self._nodes[number]
        points = [_Point(number, node.ram, node.rest, node.spec, 0)]
        seen: set[PointKey] = set()
        while points:
            point = points.pop()
            if point.key in seen:
                continue  # another way has led to the same
            seen.add(point.key)
            self._work += 1
            if len(seen) > MAX_POINTS:
                raise self._without_cut(point, seen)
            if self._work > WORK_PER_STATE * self.max_states:
                raise self._stuck(point, "too many ways between two frames")
            # A bit that only the generalisation made unknown is restored, not split: the ways with its
            # other value would be those of chips that do not exist.
            undecided = all(choice == ALONE for choice in point.chosen)
            if point.use is not None and undecided and self._blamed(point, point.use):
                raise _Ended(SearchAnswer.REFINE)
            # The ways cover every value of what is unknown (`forks`), so following all of them covers every
            # chip.
            ways = self._ways(point)
            if node.parent < 0 and point.trail is None and not point.chosen:
                latches = ways_of_latches(ChipState(node.ram, self.transitions.rest(node.rest)), self.latches)
                ways = [latch + way for latch in latches for way in ways]
            for choices in ways:
                points += self._follow(point, choices)

    def _without_cut(self, point: _Point, seen: Set[PointKey]) -> _Ended:
        """Return that there is no cut on the way of most points; they cannot be followed without one."""
        counts = Counter(self.transitions.pc(rest) for _, rest, *_ in seen)
        stuck = self._stuck(point, "too many ways between two frames")
        for cut in sorted(counts.keys() - self.generaliser.cuts.keys(), key=lambda pc: (-counts[pc], pc))[:1]:
            stuck.answer, stuck.cut = SearchAnswer.CUT, cut
        return stuck

    def _ways(self, point: _Point) -> list[Choices]:
        """Return the choices that together cover every chip at a point."""
        state = ChipState(point.ram, self.transitions.rest(point.rest))
        before: list[Choices] = [point.chosen]
        if not point.chosen and self.transitions.pc(point.rest) in self.transitions.stops:
            self._reads_eeprom = self._reads_eeprom or self.program.reads_eeprom(state)
            before = before_instruction(self.program, state, self.spec.sampled, self.phases)
        if point.use is None:
            return before
        interrupts = point.use.kind == USE_INTERRUPT and point.use.subject & ~T0IF
        self._asynchronous = self._asynchronous or bool(interrupts)
        every: list[Choices] = []
        for chosen in before:
            ways = ways_of(self.program, state, point.use, chosen)
            if ways is None:
                raise self._stuck(point, "what decides is not known", point.use)
            every += ways
        return every

    def _follow(self, point: _Point, choices: Choices) -> list[_Point]:
        """Run one way up to the next stop; store the state there, or return where the search goes on."""
        transitions = self.transitions
        outcome = transitions.run(point.ram, point.rest, choices)
        if outcome.reason is Reason.NEVER:
            return []
        if outcome.reason is Reason.USE and outcome.cycles == 0:
            # Nothing was executed: the same instruction needs more choices.
            return [replace(point, chosen=choices, use=outcome.use)]
        if choices:
            point = replace(point, trail=_Trail(Decision(point.cycle, choices), point.trail))
        spec = self._specified(point, choices, outcome)
        if point.spec.phase == BEFORE and spec.phase == IN_FRAME:
            rise = point.cycle + next(cycle for cycle, _, level in outcome.edges if level)
            self._rises[point.node] = min(rise, self._rises.get(point.node, rise))
        rest, cycle = transitions.number(outcome.rest), point.cycle + outcome.cycles
        ram = applied(point.ram, outcome)
        after = _Point(point.node, ram, rest, spec, cycle, point.trail, (), outcome.use)
        if outcome.reason is Reason.WARNING:
            raise self._violated(after, "; ".join(outcome.warnings))
        # A state does not hold the EEPROM's cells: a read gives what the file says, not what was written.
        if outcome.rest[_EE_DONE_AT] != NEVER:
            self._asynchronous = self._writes_eeprom = True
        if self._writes_eeprom and (self._reads_eeprom or not self.program.eeprom_accesses):
            why = "what the program writes to the EEPROM, it reads, or it writes through INDF"
            raise self._stuck(after, why)
        if outcome.rest[_SLEEPING]:
            return self._asleep(replace(after, spec=self.spec.at_rest(spec)))
        if spec.phase == BEFORE and cycle >= START_FRAMES * self.spec.period:
            raise self._violated(after, "no pulse comes")
        if outcome.reason is Reason.LIMIT:  # a loop without a cut, which would be followed endlessly
            raise _Ended(SearchAnswer.CUT, cut=transitions.pc(rest))
        # The induction: whatever the state is replaced by contains it, and is expanded in its turn.
        if outcome.reason is Reason.STOP and transitions.pc(rest) in self.generaliser.cuts:
            self._store(ram, rest, spec, point.node, cycle, _decisions(point.trail))
            return []
        return [after]

    def _specified(self, point: _Point, choices: Choices, outcome: RunOutcome) -> SpecState:
        """Return the specification's state after a run, whose edges are the specified ones."""
        spec = point.spec
        try:
            for choice in choices:
                if choice.field == "PINS":
                    spec = self.spec.sample(spec, choice.bits.bit_length() - 1, int(choice.value != 0))
            return self.spec.advance(spec, outcome.edges, outcome.cycles)
        except Violation as violation:
            there = replace(point, cycle=point.cycle + violation.cycle)
            raise self._violated(there, violation.message, violation.certain) from None

    def _asleep(self, point: _Point) -> list[_Point]:
        """Wake a sleeping chip in every way, where the time of waking does not matter."""
        self._asynchronous = True
        rest = ChipState(point.ram, self.transitions.rest(point.rest))
        watchdog = self.transitions.chip.watchdog
        if point.spec.phase == BEFORE and not watchdog:
            raise self._violated(point, "no pulse comes: SLEEP, and nothing has to end it", silent=True)
        if point.spec.phase == IN_FRAME:
            raise self._violated(point, "SLEEP while pulses are due", silent=True)
        if point.spec.phase == SILENT:
            raise self._stuck(point, "SLEEP while the wire is awaited")
        # An enable bit is three places above its flag; a flag that is known needs no choice.
        intcon = rest["INTCON"]
        flags = [1 << bit for bit in range(3) if (intcon >> 3 & rest["INTCON_UNKNOWN"]) >> bit & 1]
        wakes = [AssumedBits("INTCON", flag, flag) for flag in flags]
        wakes += [AssumedBits("WATCHDOG", 0, 0)] if watchdog else []
        wakes += [AssumedBits("EE_DONE", 0, 0)] if intcon & EEIE and rest["EE_DONE_AT"] != NEVER else []
        return [after for wake in wakes for after in self._follow(point, (wake,))]

    def _blamed(self, point: _Point, use: Use) -> bool:
        """Return whether what was generalised at the last cut made the use; it is kept from now on then."""
        node = self._nodes[point.node]
        if node.parent < 0:
            return False
        return self.generaliser.blamed(node, _decisions(point.trail), point.cycle, use)

    def _violated(self, point: _Point, message: str, certain: bool = True, *, silent: bool = False) -> _Ended:
        return _Ended(SearchAnswer.VIOLATED, self._finding(point, message, certain, silent=silent))

    def _stuck(self, point: _Point, why: str, use: Use | None = None) -> _Ended:
        return _Ended(SearchAnswer.UNDECIDED, self._finding(point, why, False, use))

    def _finding(
        self, point: _Point, message: str, certain: bool, use: Use | None = None, *, silent: bool = False
    ) -> SearchFinding:
        pc, decisions = self.transitions.pc(point.rest), _decisions(point.trail)
        return SearchFinding(point.node, decisions, point.cycle, message, certain, pc, use, silent)
