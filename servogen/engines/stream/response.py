"""Whether the stream's C prepares every pulse before its slot: a bound over all lines, commands and widths.

In: the words of a program, its frame layout, the travel of its servos. Out: `Response`: the cycles that the C
needs, the minimum that the interrupts leave it in a slot, and whether the former always fits the latter.

*What the interrupts leave.* The interrupt's code is executed abstractly from the overflow on, for every
latency, with the time known and the received data unknown (`interrupt_code`). The C has to wait for the
latest end of an interrupt. A fall is followed for each of the 256 cycles of its round; if it ends in the next
round, that round's interrupt begins then.

*What the C needs.* `pic.wcet` counts its longest paths: `prepare`, from the beginning of the main loop until
the request is cleared, and `execute`, from there to the loop's beginning with a command. At a request the C
is in its loop, or at most one `execute` behind. Commands are at least three bytes of the line apart.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import NamedTuple

from servogen.engines.stream.interrupt_code import (
    AFTER_EDGE,
    DUE,
    FINE,
    HALF,
    INTCON,
    LATENCY,
    PORT_VARIABLES,
    REPRESENTATIVE,
    REST,
    ROUND,
    SPANS_NEXT_ROUND,
    TICKS,
    TIMING_VARIABLES,
    InterruptCode,
    TimedState,
    Timer,
    find_edge,
)
from servogen.graph import reached
from servogen.pic.device import INTERRUPT_VECTOR
from servogen.pic.isa import encode
from servogen.pic.known_values import FSR, INDF, Undefined, renumbered, word_of
from servogen.pic.listing import ListedFunction, Listing
from servogen.pic.wcet import TimedProgram
from servogen.units import Cycles

GIE = 7
MAX_END = 3 * ROUND
MAX_STATES = 100_000
MAX_SLOTS = 1000
"""The number of slots after which C that is still behind is assumed to fall behind indefinitely."""


@dataclass(frozen=True, slots=True)
class Response:
    """Times in cycles of the C; None if no bound was found."""

    prepare: Cycles | None
    execute: Cycles | None
    supply: Cycles | None
    """The minimum cycles that the interrupts leave the C in a slot."""
    slots_between_commands: int
    """The minimum number of slots between two commands."""
    masked: int
    """The maximum cycles for which the C masks interrupts."""

    @property
    def after_command(self) -> Cycles | None:
        """Return the maximum cycles from a request to its completion, including work that commands have left
        over; None if the C falls behind indefinitely.
        """
        if self.prepare is None or self.execute is None or self.supply is None:
            return None
        behind = maximum = 0
        for slot in range(MAX_SLOTS):
            maximum = max(maximum, behind + self.prepare)
            behind += self.prepare + (self.execute if slot % self.slots_between_commands == 0 else 0)
            behind = max(0, behind - self.supply)
            if behind == 0 and slot and slot % self.slots_between_commands == self.slots_between_commands - 1:
                return Cycles(maximum)
        return None


def response(listing: Listing, rounds: int, max_travel: int, min_command: int) -> Response:
    """Return the bound for slots of `rounds` rounds of TMR0.

    `max_travel` is the maximum distance in cycles from a servo's width to its goal, `min_command` the minimum
    cycles between two commands.
    """
    needed = _main_loop_times(listing, max_travel)
    supply = _supply(listing, rounds, needed.masked)
    between = max(1, min_command // (rounds * ROUND))
    return Response(needed.prepare, needed.execute, supply, between, needed.masked)


def _addresses(listing: Listing) -> Mapping[str, int]:
    return {name: address for address, name, _ in listing.variables}


# the demand of the C


class MainLoopTimes(NamedTuple):
    """The longest `prepare` and `execute` of the main loop, None without a bound, and how long it masks
    interrupts.
    """

    prepare: Cycles | None
    execute: Cycles | None
    masked: int


class MainLoop(NamedTuple):
    """The address at which the main loop begins, and that of the instruction that clears the request."""

    head: int
    clear: int


def _main_loop_times(listing: Listing, max_travel: int) -> MainLoopTimes:
    words = listing.words
    due = _addresses(listing)[DUE]
    # Interrupts repeat this loop: each round has at most one, and lets the C do more than one turn.
    whole, parts = listing.label("st_whole"), listing.label("st_parts")
    bounds = dict.fromkeys(_addresses_with(words, encode("BCF", f=INTCON, b=GIE)), 2) | {whole: 1}
    changing = _changed_by_interrupt(listing)
    program = TimedProgram(words, listing.functions, changing=changing, bounds=bounds)
    # The division takes one turn of this loop per 256 cycles of distance, with at least one frame left.
    turn = TimedProgram(words, listing.functions, changing=changing).between(whole, {whole}, without={parts})
    head, clear = main_loop(listing)
    test = _only(address for address in range(head, clear) if words[address] == encode("BTFSS", f=due, b=1))
    poll = program.longest(head, {test})
    until_cleared = program.longest(head, {clear + 1}, without={test + 1})
    execute = program.longest(clear + 1, {head})
    masked = _longest_masking(words, program)
    missed = program.longest(test, {head}, without={test + 2})
    if poll is None or missed is None or until_cleared is None or execute is None or turn.longest is None:
        return MainLoopTimes(None, None, masked)
    # The request may come just after the loop has tested for it: the rest of that turn, and a cycle more.
    prepare = poll + 1 + missed + until_cleared + max_travel // ROUND * turn.longest
    return MainLoopTimes(Cycles(prepare), execute, masked)


def _longest_masking(words: Mapping[int, int], program: TimedProgram) -> int:
    """Return the maximum cycles from an instruction that clears GIE to the one that sets it again."""
    mask = _addresses_with(words, encode("BCF", f=INTCON, b=GIE))
    unmask = _addresses_with(words, encode("BSF", f=INTCON, b=GIE))
    masked = 0
    for begin, end in zip(mask, unmask, strict=True):
        # GIE is cleared again where an interrupt that came with the first time has set it.
        repeat = {address for address in range(begin, end) if words[address] == encode("GOTO", k=begin)}
        masked = max(masked, program.longest(begin, {end + 1}, without=repeat) or MAX_END)
    return masked


def _addresses_with(words: Mapping[int, int], wanted: int) -> list[int]:
    return [address for address, word in words.items() if word == wanted]


def main_loop(listing: Listing) -> MainLoop:
    """Return where the main loop is."""
    words = listing.words
    main, due = _main(listing), _addresses(listing)[DUE]
    clear = _only(
        address for address in range(main.start, main.end) if words[address] == encode("ANDWF", f=due, d=1)
    )
    return MainLoop(_loop_head(words, main, enable_address(listing)), clear)


def enable_address(listing: Listing) -> int:
    """Return the address of the instruction with which main enables interrupts."""
    enable, main = encode("MOVWF", f=INTCON), _main(listing)
    return max(
        row.address for row in listing.rows if row.word == enable and main.start <= row.address < main.end
    )


def _main(listing: Listing) -> ListedFunction:
    return next(function for function in listing.functions if function.name.strip("_") == "main")


def _only(candidates: Iterator[int]) -> int:
    (code,) = candidates
    return code


def _loop_head(words: Mapping[int, int], main: ListedFunction, after: int) -> int:
    """Return where the endless loop of main begins: the first target of a jump back."""
    targets = [
        word.k
        for address in range(after, main.end)
        for word in [word_of(words[address])]
        if word.flow == "jump" and after < word.k <= address
    ]
    return min(targets)


def _changed_by_interrupt(listing: Listing) -> set[int]:
    """Return the bytes that an interrupt may change; FSR is again what it was, as `prove` checks."""
    program = TimedProgram(listing.words, ())
    executed = map(program.word, program.reached(INTERRUPT_VECTOR))
    return {word.f for word in executed if word.writes_f} - {FSR}


# the supply that the interrupts leave


class LatestEnd(NamedTuple):
    """How an interrupt ends."""

    cycle: int
    ahead: int
    """The cycles by which TMR0 is ahead of the time then."""
    spans_next: bool
    """Whether the next round has no other interrupt."""


class CyclesLeft(NamedTuple):
    """The minimum cycles that the interrupts leave the C."""

    edges: int
    """In the three rounds of a slot that are a rise's, a fall's, and the one after it."""
    plain: int
    """In each other round."""


class _NoEnd(Exception):
    """Raised where an interrupt takes longer than it may, or on too many paths."""


@dataclass(eq=False)
class InterruptTimes:
    """The latest ends of the interrupts of a round, and what they leave of it."""

    code: InterruptCode
    masked: int
    """The maximum number of cycles for which the C masks interrupts."""
    _ends: dict[tuple[int, Timer], tuple[LatestEnd, ...] | None] = field(default_factory=dict)
    """The ends of interrupts that were followed, by the cycle in which they begin."""

    def cycles_left(self, begins: range) -> int | None:
        """Return the minimum cycles left in a round without an edge whose first interrupt begins in one of
        `begins`; None if no bound is found.
        """
        fewest = ROUND
        for begin in begins:
            first = self._interrupt(begin, REPRESENTATIVE, Timer())
            if first is None:
                return None
            for end in first:
                if end.ahead == HALF:
                    left = self._left_after_first(begins, end.cycle)
                else:
                    left = max(0, ROUND - end.cycle)
                late = end.ahead == 0 and end.cycle + LATENCY > ROUND
                if left is None or end.ahead not in (0, HALF) or late:
                    return None
                fewest = min(fewest, left)
        return fewest

    def _left_after_first(self, begins: range, end: int) -> int | None:
        """Return the minimum cycles left after the end of a round's first interrupt if it has a second
        one.
        """
        fewest = ROUND
        # An end that is earlier than the latest may be that of a round whose second interrupt does more.
        latest = HALF + self.masked if end + LATENCY < HALF else end
        for begin in range(HALF + 2, latest + LATENCY + 3):
            second = self._interrupt(begin, REPRESENTATIVE - 1, Timer(HALF))
            if second is None or any(after.ahead or after.cycle + LATENCY > ROUND for after in second):
                return None
            fewest = min(fewest, *(max(0, HALF - end) + ROUND - after.cycle for after in second))
        return fewest

    def end_after_edge(self, rest: int, fine: int) -> LatestEnd | None:
        """Return the latest end of an interrupt with an edge `fine` cycles after `rise`; None if no bound is
        found.

        The edge is in exactly that cycle whatever came before it (tests/engines/stream/test_stream_tick.py).
        """
        ram, edge = self.code.ram, self.code.edge
        known = {ram[REST]: rest, ram[FINE]: fine, ram[TICKS]: 1}
        ends = self._latest(TimedState(edge + 1, (), self.rise + fine + 1, known, Timer(phase=AFTER_EDGE)))
        if ends is None or len({end.spans_next for end in ends}) > 1:
            return None
        return max(ends)

    @cached_property
    def rise(self) -> int:
        """Return the cycle of the round in which a pulse begins: that of a short look at the line."""
        ram = self.code.ram
        state = TimedState(INTERRUPT_VECTOR, (), 2, {ram[REST]: 0, ram[FINE]: 0, ram[TICKS]: 1})
        while state.address != self.code.edge:
            state = self.code.successors(state, self.code.word(state.address))[0]
            if state.cycle > MAX_END:
                raise LookupError("the interrupt makes no edge")
        return state.cycle

    def left_with_fall(self, rest: int, fine: int, plain: int) -> int | None:
        """Return the minimum cycles left in the round of a fall and the next one; `plain` is what a round
        without an edge leaves otherwise. None if no bound is found.
        """
        fall = self.end_after_edge(rest, fine)
        if fall is None:
            return None
        end = fall.cycle
        if fall.spans_next:
            return 2 * ROUND - end if end + LATENCY <= 2 * ROUND else None
        if end + LATENCY < ROUND:
            return ROUND - end + plain
        # As above, the next interrupt may begin earlier, and do more.
        late = self.cycles_left(range(2, max(2, end - ROUND) + LATENCY + 2 + self.masked))
        return None if late is None else max(0, ROUND - end) + min(late, plain)

    def _interrupt(self, begin: int, ticks: int, timer: Timer) -> tuple[LatestEnd, ...] | None:
        """Return the latest ends of an interrupt that begins in a cycle, with so many left until an edge."""
        if (begin, timer) not in self._ends:
            known = {self.code.ram[TICKS]: ticks}
            self._ends[begin, timer] = self._latest(TimedState(INTERRUPT_VECTOR, (), begin, known, timer))
        return self._ends[begin, timer]

    def _latest(self, begin: TimedState) -> tuple[LatestEnd, ...] | None:
        """Return the latest end from a state on, for each number of cycles that TMR0 is then ahead of the
        time and whether T0IF was cleared; None if no bound is found.
        """
        code = self.code
        begin.known.update(code.fixed_ports())
        tracked = code.places() | begin.known.keys()
        visited: set[Hashable] = set()
        latest: dict[tuple[int, bool], int] = {}

        def is_new(state: TimedState) -> bool:
            count = len(visited)
            visited.add(state.key())
            return len(visited) > count

        def following(state: TimedState) -> list[TimedState]:
            """Follow the only path from a state to where it forks: only there can it meet another again."""
            while True:
                state.forget(tracked)
                if state.cycle > MAX_END or len(visited) > MAX_STATES:
                    raise _NoEnd
                word = code.word(state.address)
                if word.name == "RETFIE":
                    how = state.timer.ahead, state.timer.phase is SPANS_NEXT_ROUND
                    latest[how] = max(latest.get(how, 0), state.cycle + 2)
                    return []
                successors = code.successors(state, word)
                if len(successors) != 1:
                    break
                (state,) = successors
            for successor in successors:
                successor.forget(tracked)
            return successors

        try:
            for _ in reached([begin], following, is_new):
                pass  # the ends are noted where they are found
        except (_NoEnd, KeyError, Undefined):
            return None
        return tuple(LatestEnd(end, *how) for how, end in latest.items())


def _supply(listing: Listing, rounds: int, masked: int) -> Cycles | None:
    """Return the minimum cycles left in a slot, from the request in the round of its rise on."""
    words = listing.words
    executed = sorted(TimedProgram(words, ()).reached(INTERRUPT_VECTOR))
    edge = find_edge({address: words[address] for address in executed}, listing.label("st_exactly"))
    names = (*TIMING_VARIABLES, *PORT_VARIABLES)
    ram = {name: address for name, address in _addresses(listing).items() if name in names}
    code, places = [words[address] for address in executed], tuple(ram.values())
    if not any(word_of(word).has_f and word_of(word).f == INDF for word in code):
        # Without a pointer it does not matter where variables are: programs that differ in it share the rest.
        code, places = renumbered(code, places)
    left = _cycles_left(
        *(tuple(zip(executed, code, strict=True)), tuple(zip(ram, places, strict=True))),
        *(listing.label("st_look"), edge, masked),
    )
    # The rounds of a slot: that of the rise, those of the fall and after it, and all others.
    return None if left is None else Cycles(left.edges + (rounds - 3) * left.plain)


@cache
def _cycles_left(
    words: tuple[tuple[int, int], ...],
    ram: tuple[tuple[str, int], ...],
    look: int,
    edge: int,
    masked: int,
) -> CyclesLeft | None:
    """Return what the interrupt's words leave; None if no bound is found."""
    times = InterruptTimes(InterruptCode(dict(words), dict(ram), look, edge), masked)
    latest = LATENCY + 2
    """The interrupt's latest first cycle: an instruction of two cycles delays it."""
    try:
        plain, rise = times.cycles_left(range(2, latest + 1)), times.end_after_edge(0, 0)
        # Masked interrupts let the C run, and the round's two interrupts are nevertheless over in time.
        if plain is None or rise is None or times.cycles_left(range(2, latest + masked + 1)) is None:
            return None
        with_fall = 2 * ROUND
        for fine in range(ROUND):
            for rest in (1, REPRESENTATIVE):
                left = times.left_with_fall(rest, fine, plain)
                if left is None:
                    return None
                with_fall = min(with_fall, left)
    except LookupError:
        return None
    return CyclesLeft(max(0, ROUND - rise.cycle) + with_fall, plain)
