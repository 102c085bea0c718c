"""The search through all abstract states that a program can reach at its cut points.

In: the transitions of a program, a specification, cut points with what is generalised there. Out: the
states, from each of which every run to the next cut was followed, with all its edges as specified; or what
was found instead. Breadth first: the first violation is one of the nearest.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum

from servogen.prove.chip import FIELD, AbstractChip, AssumedBits, ChipState, Reason, Use
from servogen.prove.forks import ALONE, Choices, PreparedProgram, before_instruction, ways_of
from servogen.prove.generalise import Generaliser
from servogen.prove.nodes import Decision, Node
from servogen.prove.quantifiers import Quantifiers
from servogen.prove.specification import BEFORE, IN_FRAME, START_FRAMES, Specification, SpecState, Violation
from servogen.prove.transitions import Ram, Transitions, applied
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
    waits: tuple[tuple[int, int], ...] = ()
    """The ways between states before the first pulse, which must not form a cycle."""
    asynchronous: bool = False
    """Whether something other than TMR0 may interrupt the program, end its SLEEP or its EEPROM write."""


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


@dataclass(slots=True)
class _Point:
    """Between two cuts."""

    ram: Ram
    rest: int
    spec: SpecState
    cycle: int
    trail: _Trail | None = None
    chosen: Choices = ()
    use: Use | None = None

    @property
    def key(self) -> tuple[object, ...]:
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


class Explorer:
    """One search."""

    def __init__(
        self,
        program: PreparedProgram,
        transitions: Transitions,
        spec: Specification,
        generaliser: Generaliser,
        phases: int,
        max_states: int,
        tell: Callable[[int, int], None],
        starts: Sequence[ChipState],
    ) -> None:
        self._starts = starts
        self._program = program
        self._transitions = transitions
        self._spec = spec
        self._generaliser = generaliser
        self._phases = phases
        self._max_states = max_states
        self._tell = tell
        self._nodes: list[Node] = []
        self._known: dict[tuple[Ram, int, SpecState], int] = {}
        self._queue: deque[int] = deque()
        self._work = 0
        self._reads_eeprom = self._writes_eeprom = self._asynchronous = False
        self._waits: list[tuple[int, int]] = []

    def search(self) -> SearchResult:
        """Return all states, or the first finding."""
        for start in self._starts:
            self._store(start.ram, self._transitions.number(start.rest), self._spec.start(), -1, 0, ())
        expanded = 0
        while self._queue:
            number = self._queue.popleft()
            ended = self._expand(number)
            expanded += 1
            if expanded % 500 == 0:
                self._tell(expanded, len(self._nodes))
            if ended is not None:
                return ended
            if len(self._nodes) > self._max_states:
                finding = SearchFinding(
                    node=number,
                    decisions=(),
                    cycle=0,
                    message=f"more than {self._max_states} states",
                    certain=False,
                    pc=0,
                )
                return self._ended(SearchAnswer.UNDECIDED, finding)
        return self._ended(SearchAnswer.CLOSED, None)

    def _ended(self, answer: SearchAnswer, finding: SearchFinding | None, cut: int = 0) -> SearchResult:
        waits = tuple(self._waits)
        return SearchResult(
            answer=answer,
            nodes=self._nodes,
            finding=finding,
            open_nodes=len(self._queue),
            cut=cut,
            waits=waits,
            asynchronous=self._asynchronous,
        )

    def _store(
        self, ram: Ram, rest: int, spec: SpecState, parent: int, cycles: int, decisions: tuple[Decision, ...]
    ) -> None:
        raw = (ram, rest)
        if parent >= 0:  # a start is not at a cut, and is as general as the quantifiers make it
            ram, rest = self._generaliser.generalised(ram, rest)
            spec = self._spec.generalised(spec)
        key = (ram, rest, spec)
        if key not in self._known:
            self._known[key] = len(self._nodes)
            self._queue.append(len(self._nodes))
            self._nodes.append(Node(ram, rest, spec, parent, cycles, decisions, raw))
        if spec.phase == BEFORE and parent >= 0:
            # The time before the first pulse is not part of a state, so a program that waits endlessly closes
            # the search. It is found as a cycle among these pairs.
            self._waits.append((parent, self._known[key]))

    def _expand(self, number: int) -> SearchResult | None:
        node = self._nodes[number]
        points = [_Point(node.ram, node.rest, node.spec, 0)]
        seen = set()
        count = 0
        while points:
            point = points.pop()
            if point.key in seen:
                continue  # another way has led to the same
            seen.add(point.key)
            count += 1
            self._work += 1
            if count > MAX_POINTS or self._work > WORK_PER_STATE * self._max_states:
                return self._stuck(number, point, "too many ways between two frames")
            # A bit that only the generalisation made unknown is restored, not split: the ways with its
            # other value would be those of chips that do not exist.
            undecided = all(choice == ALONE for choice in point.chosen)
            if point.use is not None and undecided and self._blamed(number, point, point.use):
                return self._ended(SearchAnswer.REFINE, None)
            ways = self._ways(point)
            if ways is None:
                return self._stuck(number, point, "what decides is not known", point.use)
            # The ways cover every value of what is unknown (`forks`), so following all of them covers every
            # chip.
            for choices in ways:
                ended = self._follow(number, point, choices, points)
                if ended is not None:
                    return ended
        return None

    def _ways(self, point: _Point) -> list[Choices] | None:
        state = ChipState(point.ram, self._transitions.rest(point.rest))
        before: list[Choices] = [point.chosen]
        if not point.chosen and self._transitions.pc(point.rest) in self._transitions.stops:
            self._reads_eeprom = self._reads_eeprom or self._program.reads_eeprom(state)
            before = before_instruction(self._program, state, self._spec.sampled, self._phases)
        if point.use is None:
            return before
        interrupts = point.use.kind == USE_INTERRUPT and point.use.subject & ~T0IF
        self._asynchronous = self._asynchronous or bool(interrupts)
        every: list[Choices] = []
        for chosen in before:
            ways = ways_of(self._program, state, point.use, chosen)
            if ways is None:
                return None
            every += ways
        return every

    def _follow(
        self, number: int, point: _Point, choices: Choices, points: list[_Point]
    ) -> SearchResult | None:
        """Run one way up to the next stop, and store or append the state there."""
        transitions = self._transitions
        outcome = transitions.run(point.ram, point.rest, choices)
        if outcome.reason is Reason.USE and outcome.cycles == 0:
            # Nothing was executed: the same instruction needs more choices.
            points.append(
                _Point(point.ram, point.rest, point.spec, point.cycle, point.trail, choices, outcome.use)
            )
            return None
        trail = _Trail(Decision(point.cycle, choices), point.trail) if choices else point.trail
        try:
            spec = point.spec
            for choice in choices:
                if choice.field == "PINS":
                    pin = choice.bits.bit_length() - 1
                    spec = self._spec.sample(spec, pin, int(choice.value != 0))
            spec = self._spec.advance(spec, outcome.edges, outcome.cycles)
        except Violation as violation:
            finding = SearchFinding(
                node=number,
                decisions=_decisions(trail),
                cycle=point.cycle + violation.cycle,
                message=violation.message,
                certain=violation.certain,
                pc=transitions.pc(point.rest),
            )
            return self._ended(SearchAnswer.VIOLATED, finding)
        cycle = point.cycle + outcome.cycles
        if outcome.reason is Reason.WARNING:
            pc = transitions.pc(transitions.number(outcome.rest))
            finding = SearchFinding(
                node=number,
                decisions=_decisions(trail),
                cycle=cycle,
                message="; ".join(outcome.warnings),
                certain=True,
                pc=pc,
            )
            return self._ended(SearchAnswer.VIOLATED, finding)
        rest = transitions.number(outcome.rest)
        ram = applied(point.ram, outcome)
        # A state does not hold the EEPROM's cells: a read gives what the file says, not what was written.
        if outcome.rest[_EE_DONE_AT] != NEVER:
            self._asynchronous = self._writes_eeprom = True
        if self._writes_eeprom and (self._reads_eeprom or not self._program.eeprom_accesses):
            why = "what the program writes to the EEPROM, it reads, or it writes through INDF"
            return self._stuck(number, _Point(ram, rest, spec, cycle, trail), why)
        if outcome.rest[_SLEEPING]:
            return self._asleep(number, _Point(ram, rest, self._spec.at_rest(spec), cycle, trail), points)
        if spec.phase == BEFORE and cycle >= START_FRAMES * self._spec.period:
            finding = SearchFinding(
                node=number,
                decisions=_decisions(trail),
                cycle=cycle,
                message="no pulse comes",
                certain=True,
                pc=transitions.pc(rest),
            )
            return self._ended(SearchAnswer.VIOLATED, finding)
        if outcome.reason is Reason.LIMIT:  # a loop without a cut, which would be followed endlessly
            return self._ended(SearchAnswer.CUT, None, transitions.pc(rest))
        # The induction: whatever the state is replaced by contains it, and is expanded in its turn.
        if outcome.reason is Reason.STOP and transitions.pc(rest) in self._generaliser.cuts:
            self._store(ram, rest, spec, number, cycle, _decisions(trail))
            return None
        points.append(_Point(ram, rest, spec, cycle, trail, (), outcome.use))
        return None

    def _asleep(self, number: int, point: _Point, points: list[_Point]) -> SearchResult | None:
        """Wake a sleeping chip in every way, where the time of waking does not matter."""
        self._asynchronous = True
        rest = ChipState(point.ram, self._transitions.rest(point.rest))
        watchdog = self._transitions.chip.watchdog
        why = "SLEEP while pulses are due" if point.spec.phase == IN_FRAME else ""
        if point.spec.phase == BEFORE and not watchdog:
            why = "no pulse comes: SLEEP, and nothing has to end it"
        if why:
            pc = self._transitions.pc(point.rest)
            finding = SearchFinding(
                node=number,
                decisions=_decisions(point.trail),
                cycle=point.cycle,
                message=why,
                certain=True,
                pc=pc,
                silent=True,
            )
            return self._ended(SearchAnswer.VIOLATED, finding)
        # An enable bit is three places above its flag; a flag that is known needs no choice.
        intcon = rest["INTCON"]
        flags = [1 << bit for bit in range(3) if (intcon >> 3 & rest["INTCON_UNKNOWN"]) >> bit & 1]
        wakes = [AssumedBits("INTCON", flag, flag) for flag in flags]
        wakes += [AssumedBits("WATCHDOG", 0, 0)] if watchdog else []
        wakes += [AssumedBits("EE_DONE", 0, 0)] if intcon & EEIE and rest["EE_DONE_AT"] != NEVER else []
        for wake in wakes:
            ended = self._follow(number, point, (wake,), points)
            if ended is not None:
                return ended
        return None

    def _blamed(self, number: int, point: _Point, use: Use) -> bool:
        """Return whether what was generalised at the last cut made the use; it is kept from now on then."""
        if self._nodes[number].parent < 0:
            return False
        return self._generaliser.blamed(self._nodes[number], _decisions(point.trail), point.cycle, use)

    def _stuck(self, number: int, point: _Point, why: str, use: Use | None = None) -> SearchResult:
        finding = SearchFinding(
            node=number,
            decisions=_decisions(point.trail),
            cycle=point.cycle,
            message=why,
            certain=False,
            pc=self._transitions.pc(point.rest),
            use=use,
        )
        return self._ended(SearchAnswer.UNDECIDED, finding)
