"""Whether the stream's C prepares every pulse before its slot: a bound over all lines, commands and widths.

In: the words of a program, its frame layout, the travel of its servos. Out: `Response`: the cycles that the C
needs, the minimum that the interrupts leave it in a slot, and whether the former always fits the latter.

*What the interrupts leave.* TMR0 counts cycles and is only advanced by constants, so the interrupt's code
knows the time. The code is executed abstractly from the overflow on, for every latency, with the time known
and the received data unknown: both outcomes of each test of a received bit, and of a counter of the receiver,
are followed. The C has to wait for the latest end of an interrupt. A fall is followed for each of the 256
cycles of its round; if it ends in the next round, that round's interrupt begins then.

*What the C needs.* `pic.wcet` counts its longest paths: `prepare`, from the beginning of the main loop until
the request is cleared, and `execute`, from there to the loop's beginning with a command. At a request the C
is in its loop, or at most one `execute` behind. Commands are at least three bytes of the line apart.
"""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

from servogen.engines.stream.rendering import OVERRUN
from servogen.graph import reached
from servogen.pic.device import INTERRUPT_VECTOR, addresses
from servogen.pic.isa import encode
from servogen.pic.known_values import (
    CARRY,
    FSR,
    INDF,
    RETURNED,
    ZERO,
    DecodedWord,
    Known,
    Undefined,
    W,
    execute,
    renumbered,
    step,
    word_of,
)
from servogen.pic.listing import ListedFunction, Listing
from servogen.pic.wcet import TimedProgram
from servogen.units import Cycles

ROUND = 256
HALF = 128
"""A round without an edge has two interrupts, 128 cycles apart."""
TMR0_STANDS = 3
"""Cycles from a write of TMR0 in which it does not count, that of the write included (DS35007 figure 5-2)."""
LATENCY = 4
"""The maximum number of cycles from the overflow to the first instruction of the interrupt (DS35007 section
6.8).
"""
TMR0, INTCON = addresses("TMR0", "INTCON")
GIE = 7
PORTS = addresses("PORTA", "PORTB")
MAX_END = 3 * ROUND
MAX_STATES = 100_000
MAX_SLOTS = 1000
"""The number of slots after which C that is still behind is assumed to fall behind indefinitely."""
MANY = 101
"""Interrupts that are left until an edge: not the last one. Odd: TMR0 shows the time."""
FOLLOWED = TICKS, REST, FINE, T = "ticks", "rest", "fine", "t"
"""The interrupt's variables that decide how long it waits."""
DUE = OVERRUN
"""The C's bits: 0, a pulse was not prepared in time; 1, a pulse is requested."""
PORT_NAMES = PORT, NEXT_PORT = "port", "next_port"
"""Its variables with the address of a port, if servos are on both."""


class Timer(NamedTuple):
    """What is known of TMR0, which shows the time modulo 256 unless it was written, and of its flag."""

    ahead: int = 0
    """The cycles by which it is ahead of the time."""
    written: int | None = None
    """The cycle in which this interrupt wrote it."""
    cleared: bool | None = None
    """Whether T0IF was cleared since the edge, so that the next round has no other interrupt; None: there was
    no edge yet.
    """


class RoundMoment(NamedTuple):
    """What is known before an instruction of the interrupt's code."""

    address: int
    stack: tuple[int, ...]
    cycle: int
    """Of the round, of which 0 is its overflow of TMR0; or since a subroutine's first instruction."""
    known: Known
    """Changed by the instruction."""
    timer: Timer = Timer()

    def forget(self, followed: Collection[int]) -> None:
        """Forget the places that are not `followed`."""
        for place in [place for place in self.known if place not in followed]:
            del self.known[place]

    def key(self) -> Hashable:
        """Return what tells this moment from others."""
        return self.address, self.stack, self.cycle, frozenset(self.known.items()), self.timer


@dataclass(frozen=True, slots=True)
class Response:
    """Times in cycles of the C; None if no bound was found."""

    prepare: Cycles | None
    execute: Cycles | None
    supply: Cycles | None
    """The minimum cycles that the interrupts leave the C in a slot."""
    commands_apart: int
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
            behind += self.prepare + (self.execute if slot % self.commands_apart == 0 else 0)
            behind = max(0, behind - self.supply)
            if behind == 0 and slot and slot % self.commands_apart == self.commands_apart - 1:
                return Cycles(maximum)
        return None

    @property
    def proven(self) -> bool:
        """Return whether every pulse is prepared before its slot."""
        worst = self.after_command
        return worst is not None and self.supply is not None and worst <= self.supply

    def to_json(self) -> dict[str, object]:
        return {
            "prepare_cycles": self.prepare,
            "execute_cycles": self.execute,
            "supply_cycles": self.supply,
            "slots_between_commands": self.commands_apart,
            "proven": self.proven,
        }


def response(listing: Listing, rounds: int, max_travel: int, min_command: int) -> Response:
    """Return the bound for slots of `rounds` rounds of TMR0.

    `max_travel` is the maximum distance in cycles from a servo's width to its goal, `min_command` the minimum
    cycles between two commands.
    """
    prepare, command, masked = _demand(listing, max_travel)
    supply = _supply(listing, rounds, masked)
    return Response(prepare, command, supply, max(1, min_command // (rounds * ROUND)), masked)


def _addresses(listing: Listing) -> Mapping[str, int]:
    return {name: address for address, name, _ in listing.variables}


# the demand of the C


def _demand(listing: Listing, max_travel: int) -> tuple[Cycles | None, Cycles | None, int]:
    """Return the longest `prepare` and `execute` of the main loop, and how long it masks interrupts."""
    words = {row.address: row.word for row in listing.rows}
    due = _addresses(listing)[DUE]
    mask = [address for address, word in words.items() if word == encode("BCF", f=INTCON, b=GIE)]
    unmask = [address for address, word in words.items() if word == encode("BSF", f=INTCON, b=GIE)]
    # Interrupts repeat this loop: each round has at most one, and lets the C do more than one turn.
    whole, parts = listing.label("st_whole"), listing.label("st_parts")
    bounds = dict.fromkeys(mask, 2) | {whole: 1}
    changing = _changed_by_interrupt(listing)
    program = TimedProgram(words, listing.functions, changing=changing, bounds=bounds)
    # The division takes one turn of this loop per 256 cycles of distance, with at least one frame left.
    turn = TimedProgram(words, listing.functions, changing=changing).between(whole, {whole}, without={parts})
    head, clear = main_loop(listing)
    test = _only(address for address in range(head, clear) if words[address] == encode("BTFSS", f=due, b=1))
    poll = program.longest(head, {test})
    until_cleared = program.longest(head, {clear + 1}, without={test + 1})
    back = program.longest(clear + 1, {head})
    masked = 0
    for begin, end in zip(mask, unmask, strict=True):
        repeat = {address for address in range(begin, end) if words[address] == encode("GOTO", k=begin)}
        longest = program.longest(begin, {end + 1}, without=repeat)
        masked = max(masked, longest or MAX_END)
    missed = program.longest(test, {head}, without={test + 2})
    if poll is None or missed is None or until_cleared is None or back is None or turn.longest is None:
        return None, None, masked
    # The request may come just after the loop has tested for it: the rest of that turn, and a cycle more.
    prepare = poll + 1 + missed + until_cleared + max_travel // ROUND * turn.longest
    return Cycles(prepare), back, masked


def main_loop(listing: Listing) -> tuple[int, int]:
    """Return where the main loop begins, and the address of the instruction that clears the request."""
    words = {row.address: row.word for row in listing.rows}
    main = _main(listing)
    due = _addresses(listing)[DUE]
    clear = _only(
        address for address in range(main.start, main.end) if words[address] == encode("ANDWF", f=due, d=1)
    )
    return _loop_head(words, main, enabling(listing)), clear


def enabling(listing: Listing) -> int:
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
    words = {row.address: row.word for row in listing.rows}
    program = TimedProgram(words, ())
    return {
        program.word(address).f
        for address in program.reached(INTERRUPT_VECTOR)
        if program.word(address).writes_f
    } - {FSR}


# the supply that the interrupts leave


class LatestEnd(NamedTuple):
    """How an interrupt ends."""

    cycle: int
    ahead: int
    """The cycles by which TMR0 is ahead of the time then."""
    cleared: bool
    """Whether the next round has no other interrupt."""


class _NoEnd(Exception):
    """Raised where an interrupt takes longer than it may, or too many ways."""


@dataclass(slots=True)
class Round:
    """The abstract execution of the interrupt's code in one round."""

    words: Mapping[int, int]
    ram: Mapping[str, int]
    look: int
    """The address of the subroutine that looks at the line."""
    edge: int
    """The address of the instruction that makes an edge."""
    masked: int
    """The maximum number of cycles for which the C masks interrupts."""
    _ends: dict[tuple[int, Timer], tuple[LatestEnd, ...] | None] = field(default_factory=dict)
    """The ends of interrupts that were followed, by the cycle in which they begin."""
    _look_cycles: tuple[int, ...] = ()
    _rise: int = 0

    def left(self, begins: range) -> int | None:
        """Return the minimum cycles left in a round without an edge whose first interrupt begins in one of
        `begins`; None if no bound is found.
        """
        fewest = ROUND
        for begin in begins:
            first = self._interrupt(begin, MANY, Timer())
            if first is None:
                return None
            for end in first:
                left = self._left_after(begins, end.cycle) if end.ahead == HALF else max(0, ROUND - end.cycle)
                late = end.ahead == 0 and end.cycle + LATENCY > ROUND
                if left is None or end.ahead not in (0, HALF) or late:
                    return None
                fewest = min(fewest, left)
        return fewest

    def _left_after(self, begins: range, end: int) -> int | None:
        """Return the minimum cycles left after the end of a round's first interrupt if it has a second
        one.
        """
        fewest = ROUND
        usual = range(HALF + 2, HALF + LATENCY + 3 + self.masked)
        late = range(end, end + LATENCY + 3)
        for begin in usual if end + LATENCY < HALF else late:
            second = self._interrupt(begin, MANY - 1, Timer(HALF))
            if second is None or any(after.ahead or after.cycle + LATENCY > ROUND for after in second):
                return None
            fewest = min(fewest, *(max(0, HALF - end) + ROUND - after.cycle for after in second))
        return fewest

    def end_after_edge(self, rest: int, fine: int) -> LatestEnd | None:
        """Return the latest end of an interrupt with an edge `fine` cycles after `rise`; None if no bound is
        found.

        The edge is in exactly that cycle whatever came before it (tests/engines/stream/test_stream_tick.py).
        """
        known = {self.ram[REST]: rest, self.ram[FINE]: fine, self.ram[TICKS]: 1}
        ends = self._latest(
            RoundMoment(self.edge + 1, (), self.rise() + fine + 1, known, Timer(cleared=False))
        )
        if ends is None or len({end.cleared for end in ends}) > 1:
            return None
        return max(ends)

    def rise(self) -> int:
        """Return the cycle of the round in which a pulse begins: that of a short look at the line."""
        if self._rise:
            return self._rise
        known: Known = {self.ram[REST]: 0, self.ram[FINE]: 0, self.ram[TICKS]: 1}
        at = RoundMoment(INTERRUPT_VECTOR, (), 2, known)
        while at.address != self.edge:
            at = self.steps(at, self.word(at.address))[0]
            if at.cycle > MAX_END:
                raise LookupError("the interrupt makes no edge")
        self._rise = at.cycle
        return at.cycle

    def looks(self) -> tuple[int, ...]:
        """Return all durations of a look at the line, whatever the receiver does."""
        if not self._look_cycles:
            begin: tuple[int, tuple[int, ...], int] = (self.look, (), 0)

            def following(at: tuple[int, tuple[int, ...], int]) -> Iterator[tuple[int, tuple[int, ...], int]]:
                if at[0] != RETURNED:
                    yield from (after[:3] for after in self.steps(RoundMoment(*at, {}), self.word(at[0])))

            found = reached([begin], following)
            self._look_cycles = tuple(sorted(now for address, _, now in found if address == RETURNED))
        return self._look_cycles

    def _interrupt(self, begin: int, ticks: int, timer: Timer) -> tuple[LatestEnd, ...] | None:
        """Return the latest ends of an interrupt that begins in a cycle, with so many left until an edge."""
        if (begin, timer) not in self._ends:
            known = {self.ram[TICKS]: ticks}
            self._ends[begin, timer] = self._latest(RoundMoment(INTERRUPT_VECTOR, (), begin, known, timer))
        return self._ends[begin, timer]

    def _latest(self, begin: RoundMoment) -> tuple[LatestEnd, ...] | None:
        """Return the latest end from a moment on, for each number of cycles that TMR0 is then ahead of the
        time and whether T0IF was cleared; None if no bound is found.
        """
        if PORT in self.ram:
            begin.known.update({self.ram[name]: PORTS[1] for name in PORT_NAMES})
        followed = {W, CARRY, ZERO, FSR, *(self.ram[name] for name in FOLLOWED), *begin.known}
        met: set[Hashable] = set()
        latest: dict[tuple[int, bool], int] = {}

        def is_new(at: RoundMoment) -> bool:
            count = len(met)
            met.add(at.key())
            return len(met) > count

        def following(at: RoundMoment) -> list[RoundMoment]:
            """Follow the only path from a moment to where it forks: only there can it meet another again."""
            ways = [at]
            while len(ways) == 1:
                (at,) = ways
                at.forget(followed)
                if at.cycle > MAX_END or len(met) > MAX_STATES:
                    raise _NoEnd
                word = self.word(at.address)
                if word.name == "RETFIE":
                    how = at.timer.ahead, bool(at.timer.cleared)
                    latest[how] = max(latest.get(how, 0), at.cycle + 2)
                    return []
                ways = self.steps(at, word)
            for way in ways:
                way.forget(followed)
            return ways

        try:
            for _ in reached([begin], following, is_new):
                pass
        except (_NoEnd, KeyError, Undefined):
            return None
        return tuple(LatestEnd(end, *how) for how, end in latest.items())

    def word(self, address: int) -> DecodedWord:
        """Return an instruction of the code. Raises KeyError, Undefined."""
        return word_of(self.words[address])

    def steps(self, at: RoundMoment, word: DecodedWord) -> list[RoundMoment]:
        """Return what follows an instruction. Changes `at.known`.

        Raises LookupError for a use of TMR0 that is not followed.
        """
        address, stack, now, known, timer = at
        if word.flow == "call" and word.k == self.look:
            for place in (W, CARRY, ZERO, self.ram[T]):
                known.pop(place, None)
            after = now + 2
            return [
                RoundMoment(address + 1, stack, after + cycles, dict(known), timer) for cycles in self.looks()
            ]
        if word.has_f and word.f == TMR0:
            return [self._timer(at, word)]
        if word.f == INDF and word.writes_f and word.flow == "next" and known.get(FSR) in PORTS:
            return [RoundMoment(address + 1, stack, now + 1, known, timer)]
        if word.name == "BCF" and word.f == INTCON and timer.cleared is not None:
            timer = timer._replace(cleared=True)
        return [
            RoundMoment(target, more, now + cycles, after, timer)
            for target, more, cycles, after in step(address, stack, word, known)
        ]

    def _timer(self, at: RoundMoment, word: DecodedWord) -> RoundMoment:
        """Execute an instruction that reads the timer, or adds a constant to it."""
        address, stack, now, known, timer = at
        if timer.written is not None and now - timer.written <= TMR0_STANDS:
            raise LookupError("TMR0 is read while it does not count")
        value = (now + timer.ahead) % ROUND
        if word.writes_f or (word.flow == "skip" and not word.tests_bit):
            added = known.get(W)
            if word.name != "ADDWF" or added is None or timer.written is not None:
                raise LookupError("TMR0 is written by an instruction that is not followed")
            # It would set T0IF too early: an interrupt that no time accounts for.
            if value + added >= ROUND:
                raise LookupError("TMR0 overflows because it is written")
            for place in (CARRY, ZERO):
                known.pop(place, None)
            ahead = (timer.ahead + added - TMR0_STANDS) % ROUND
            return RoundMoment(address + 1, stack, now + 1, known, timer._replace(ahead=ahead, written=now))
        if word.flow == "skip":
            taken = bool(value >> word.b & 1) == (word.name == "BTFSS")
            return RoundMoment(address + 1 + taken, stack, now + 1 + taken, known, timer)
        # It is read into W as a byte would be: the instruction is executed on one that holds it.
        execute(word, known, operand=value)
        return RoundMoment(address + 1, stack, now + 1, known, timer)


def _supply(listing: Listing, rounds: int, masked: int) -> Cycles | None:
    """Return the minimum cycles left in a slot, from the request in the round of its rise on."""
    words = {row.address: row.word for row in listing.rows}
    exactly = encode("CALL", k=listing.label("st_exactly"))
    wait = _only(address for address, word in words.items() if word == exactly)
    edge = next(address for address in range(wait, max(words)) if word_of(words[address]).name == "MOVWF")
    ran = sorted(TimedProgram(words, ()).reached(INTERRUPT_VECTOR))
    ram = {name: address for name, address in _addresses(listing).items() if name in (*FOLLOWED, *PORT_NAMES)}
    code, places = [words[address] for address in ran], tuple(ram.values())
    if not any(word_of(word).has_f and word_of(word).f == INDF for word in code):
        # Without a pointer it does not matter where variables are: programs that differ in it share the rest.
        code, places = renumbered(code, places)
    left = _cycles_left(
        *(tuple(zip(ran, code, strict=True)), tuple(zip(ram, places, strict=True))),
        *(listing.label("st_look"), edge, masked),
    )
    # The rounds of a slot: that of the rise, those of the fall and after it, and all others.
    return None if left is None else Cycles(left[0] + (rounds - 3) * left[1])


@cache
def _cycles_left(
    words: tuple[tuple[int, int], ...],
    ram: tuple[tuple[str, int], ...],
    look: int,
    edge: int,
    masked: int,
) -> tuple[int, int] | None:
    """Return the minimum cycles that the interrupt's words leave in the rounds with and after a pulse's edges
    together, and in another round.
    """
    code = Round(dict(words), dict(ram), look, edge, masked)
    latest = LATENCY + 2
    """The interrupt's latest first cycle: an instruction of two cycles delays it."""
    try:
        usual, rise = code.left(range(2, latest + 1)), code.end_after_edge(0, 0)
        # Masked interrupts let the C run, and the round's two interrupts are nevertheless over in time.
        if usual is None or rise is None or code.left(range(2, latest + masked + 1)) is None:
            return None
        with_fall = 2 * ROUND
        for fine in range(ROUND):
            left = _minimum([_cycles_left_with_fall(code, rest, fine, usual) for rest in (1, MANY)])
            if left is None:
                return None
            with_fall = min(with_fall, left)
    except LookupError:
        return None
    return max(0, ROUND - rise.cycle) + with_fall, usual


def _cycles_left_with_fall(code: Round, rest: int, fine: int, usual: int) -> int | None:
    """Return the minimum cycles left in the round of a fall and the next one."""
    fall = code.end_after_edge(rest, fine)
    if fall is None:
        return None
    end = fall.cycle
    if fall.cleared:
        return 2 * ROUND - end if end + LATENCY <= 2 * ROUND else None
    if end + LATENCY < ROUND:
        return ROUND - end + usual
    begins = max(2, end - ROUND)
    late = code.left(range(begins, begins + LATENCY + 2 + code.masked))
    return None if late is None else max(0, ROUND - end) + min(late, usual)


def _minimum(bounds: list[int | None]) -> int | None:
    """Return the minimum of all; None if one of them has no bound."""
    numbers = [number for number in bounds if number is not None]
    return min(numbers) if len(numbers) == len(bounds) else None
