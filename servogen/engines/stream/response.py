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

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache

from servogen.graph import reached
from servogen.pic.device import INTERRUPT_VECTOR, addresses
from servogen.pic.isa import encode
from servogen.pic.known_values import (
    CARRY,
    FSR,
    INDF,
    RETURNED,
    ZERO,
    Continuation,
    DecodedWord,
    Known,
    Undefined,
    W,
    known_result,
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
6.9).
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
FOLLOWED = ("ticks", "rest", "fine", "t")
"""The interrupt's variables that decide how long it waits."""
PORT_NAMES = ("port", "next_port")
"""Its variables with the address of a port, if servos are on both."""


_Moment = tuple[int, tuple[int, ...], int]
"""Address, return addresses, cycle."""
_State = tuple[int, tuple[int, ...], int, tuple[tuple[int, int], ...]]
"""Address, return addresses, cycle of the round, known values."""
AHEAD = -10
"""The key, among the known values, of the cycles by which TMR0 is ahead of the time."""
WRITTEN = -11
"""The key of the cycle in which TMR0 was written last."""
CLEARED = -12
"""The key of whether T0IF was cleared since the edge: then the next round has no other interrupt."""


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
    due = _addresses(listing)["due"]
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
    due = _addresses(listing)["due"]
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
    (one,) = candidates
    return one


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
    """Return the bytes that the interrupt's code may write."""
    words = {row.address: row.word for row in listing.rows}
    program = TimedProgram(words, ())
    return {
        program.word(address).f
        for address in program.reached(INTERRUPT_VECTOR)
        if program.word(address).writes_f
    }


# the supply that the interrupts leave


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
    _ends: dict[tuple[int, int, int], tuple[tuple[int, int, int], ...] | None] = field(default_factory=dict)
    _look_cycles: tuple[int, ...] = ()

    def left(self, begins: range) -> int | None:
        """Return the minimum cycles left in a round without an edge whose first interrupt begins in one of
        `begins`; None if no bound is found.
        """
        fewest = ROUND
        for begin in begins:
            first = self._latest(INTERRUPT_VECTOR, begin, {self.ram["ticks"]: MANY, AHEAD: 0})
            if first is None:
                return None
            for end, ahead, _ in first:
                left = self._left_after(begins, end) if ahead == HALF else max(0, ROUND - end)
                if left is None or ahead not in (0, HALF) or (ahead == 0 and end + LATENCY > ROUND):
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
            second = self._latest(INTERRUPT_VECTOR, begin, {self.ram["ticks"]: MANY - 1, AHEAD: HALF})
            if second is None or any(ahead or after + LATENCY > ROUND for after, ahead, _ in second):
                return None
            fewest = min(fewest, *(max(0, HALF - end) + ROUND - after for after, _, _ in second))
        return fewest

    def end_after_edge(self, rest: int, fine: int) -> tuple[int, bool] | None:
        """Return the latest end of an interrupt with an edge `fine` cycles after `rise`, and whether the next
        round has no other interrupt.

        The edge is in exactly that cycle whatever came before it (tests/engines/stream/test_stream_tick.py).
        """
        known = {self.ram["rest"]: rest, self.ram["fine"]: fine, self.ram["ticks"]: 1, AHEAD: 0}
        known[CLEARED] = 0
        ends = self._latest(self.edge + 1, self.rise() + fine + 1, known)
        if ends is None or len({cleared for _, _, cleared in ends}) > 1:
            return None
        return max(end for end, _, _ in ends), bool(ends[0][2])

    def rise(self) -> int:
        """Return the cycle of the round in which a pulse begins: that of a short look at the line."""
        known: Known = {self.ram["rest"]: 0, self.ram["fine"]: 0, self.ram["ticks"]: 1, AHEAD: 0}
        address, now = INTERRUPT_VECTOR, 2
        stack: tuple[int, ...] = ()
        while address != self.edge:
            ways = list(self.steps(address, stack, now, word_of(self.words[address]), known))
            address, stack, cycles, known = ways[0]
            now += cycles
            if now > MAX_END:
                raise LookupError("the interrupt makes no edge")
        return now

    def looks(self) -> tuple[int, ...]:
        """Return all durations of a look at the line, whatever the receiver does."""
        if not self._look_cycles:
            begin: _Moment = (self.look, (), 0)

            def following(moment: _Moment) -> Iterator[_Moment]:
                address, stack, now = moment
                if address != RETURNED:
                    for target, more, cycles, _ in self.steps(
                        address, stack, now, word_of(self.words[address]), {}
                    ):
                        yield target, more, now + cycles

            found = reached([begin], following)
            self._look_cycles = tuple(sorted(now for address, _, now in found if address == RETURNED))
        return self._look_cycles

    def _latest(self, address: int, now: int, known: Known) -> tuple[tuple[int, int, int], ...] | None:
        """Return the latest end of the interrupt from a state on, for each number of cycles that TMR0 is then
        ahead of the time and each value of CLEARED; None if no bound is found.
        """
        if "port" in self.ram:
            known |= {self.ram[name]: PORTS[1] for name in PORT_NAMES}
        begun = (address, now, known[AHEAD])
        if begun in self._ends and address == INTERRUPT_VECTOR:
            return self._ends[begun]
        followed = {W, CARRY, ZERO, FSR, *(self.ram[name] for name in FOLLOWED), *known, WRITTEN}
        waiting: list[_State] = [(address, (), now, tuple(sorted(known.items())))]
        seen = set(waiting)
        latest: dict[tuple[int, int], int] = {}
        while waiting:
            address, stack, now, frozen = waiting.pop()
            ways = [(address, stack, 0, dict(frozen))]
            while len(ways) == 1:  # only where a path forks can it meet another one again
                address, stack, cycles, known = ways[0]
                known = {place: value for place, value in known.items() if place in followed}
                now += cycles
                if now > MAX_END or len(seen) > MAX_STATES:
                    return None
                try:
                    word = word_of(self.words[address])
                except (KeyError, Undefined):
                    return None
                if word.name == "RETFIE":
                    how = known[AHEAD], known.get(CLEARED, 0)
                    latest[how] = max(latest.get(how, 0), now + 2)
                    ways = []
                else:
                    ways = list(self.steps(address, stack, now, word, known))
            for following, more, cycles, after in ways:
                remembered = sorted((place, value) for place, value in after.items() if place in followed)
                state = (following, more, now + cycles, tuple(remembered))
                if state not in seen:
                    seen.add(state)
                    waiting.append(state)
        self._ends[begun] = tuple((end, *how) for how, end in latest.items())
        return self._ends[begun]

    def steps(
        self, address: int, stack: tuple[int, ...], now: int, word: DecodedWord, known: Known
    ) -> Iterator[Continuation]:
        """Yield where execution continues. Updates `known`. Raises LookupError for a use of TMR0 that is not
        followed.
        """
        if word.flow == "call" and word.k == self.look:
            for place in (W, CARRY, ZERO, self.ram["t"]):
                known.pop(place, None)
            for cycles in self.looks():
                yield address + 1, stack, 2 + cycles, known
        elif word.has_f and word.f == TMR0:
            yield from self._timer(address, stack, now, word, known)
        elif word.flow == "next" and word.f == INDF and word.writes_f and known.get(FSR) in PORTS:
            yield address + 1, stack, 1, known
        else:
            if word.name == "BCF" and word.f == INTCON and CLEARED in known:
                known[CLEARED] = 1
            yield from step(address, stack, word, known)

    def _timer(
        self, address: int, stack: tuple[int, ...], now: int, word: DecodedWord, known: Known
    ) -> Iterator[Continuation]:
        """Execute an instruction that reads the timer, or adds a constant to it."""
        if now - known.get(WRITTEN, now - ROUND) <= TMR0_STANDS:
            raise LookupError("TMR0 is read while it does not count")
        timer = (now + known.get(AHEAD, 0)) % ROUND
        if word.writes_f:
            added = known.get(W)
            if word.name != "ADDWF" or added is None or WRITTEN in known:
                raise LookupError("TMR0 is written by an instruction that is not followed")
            # It would set T0IF too early: an interrupt that no time accounts for.
            if timer + added >= ROUND:
                raise LookupError("TMR0 overflows because it is written")
            known[AHEAD] = (known.get(AHEAD, 0) + added - TMR0_STANDS) % ROUND
            known[WRITTEN] = now
            for place in (CARRY, ZERO):
                known.pop(place, None)
            yield address + 1, stack, 1, known
            return
        if word.flow == "skip":
            taken = bool(timer >> word.b & 1) == (word.name == "BTFSS")
            yield address + 1 + taken, stack, 1 + taken, known
            return
        w = known.get(W)
        result, carry = known_result(word.name, w, timer, word.k, word.b, known.get(CARRY))
        for place, value in ((W, result), (CARRY, carry if "C" in word.flags else known.get(CARRY))):
            if value is None:
                known.pop(place, None)
            else:
                known[place] = value
        known.pop(ZERO, None)
        if result is not None:
            known[ZERO] = int(result == 0)
        yield address + 1, stack, 1, known


def _supply(listing: Listing, rounds: int, masked: int) -> Cycles | None:
    """Return the minimum cycles left in a slot, from the request in the round of its rise on."""
    words = {row.address: row.word for row in listing.rows}
    exactly = encode("CALL", k=listing.label("st_exactly"))
    wait = _only(address for address, word in words.items() if word == exactly)
    edge = next(address for address in range(wait, max(words)) if word_of(words[address]).name == "MOVWF")
    ran = sorted(TimedProgram(words, ()).reached(INTERRUPT_VECTOR))
    ram = tuple(
        (name, address) for name, address in _addresses(listing).items() if name in (*FOLLOWED, *PORT_NAMES)
    )
    looks = listing.label("st_look")
    return _supply_of(tuple((address, words[address]) for address in ran), ram, looks, edge, rounds, masked)


@cache
def _supply_of(
    words: tuple[tuple[int, int], ...],
    ram: tuple[tuple[str, int], ...],
    look: int,
    edge: int,
    rounds: int,
    masked: int,
) -> Cycles | None:
    """Do the same for the interrupt's words, which are equal in dialects that differ only in the C."""
    one = Round(dict(words), dict(ram), look, edge, masked)
    latest = LATENCY + 2
    """The interrupt's latest first cycle: an instruction of two cycles delays it."""
    try:
        usual, rise = one.left(range(2, latest + 1)), one.end_after_edge(0, 0)
        # Masked interrupts let the C run, and the round's two interrupts are nevertheless over in time.
        if usual is None or rise is None or one.left(range(2, latest + masked + 1)) is None:
            return None
        with_fall = 2 * ROUND
        for fine in range(ROUND):
            left = _minimum([_left_with_fall(one, rest, fine, usual) for rest in (1, MANY)])
            if left is None:
                return None
            with_fall = min(with_fall, left)
    except LookupError:
        return None
    # The rounds of a slot: that of the rise, those of the fall and after it, and all others.
    return Cycles(max(0, ROUND - rise[0]) + with_fall + (rounds - 3) * usual)


def _left_with_fall(one: Round, rest: int, fine: int, usual: int) -> int | None:
    """Return the minimum cycles left in the round of a fall and the next one."""
    fall = one.end_after_edge(rest, fine)
    if fall is None:
        return None
    end, whole = fall
    if whole:
        return 2 * ROUND - end if end + LATENCY <= 2 * ROUND else None
    if end + LATENCY < ROUND:
        return ROUND - end + usual
    begins = max(2, end - ROUND)
    late = one.left(range(begins, begins + LATENCY + 2 + one.masked))
    return None if late is None else max(0, ROUND - end) + min(late, usual)


def _minimum(bounds: list[int | None]) -> int | None:
    """Return the minimum of all; None if one of them has no bound."""
    numbers = [number for number in bounds if number is not None]
    return min(numbers) if len(numbers) == len(bounds) else None
