"""One interrupt of a stream's program, executed abstractly from each cycle in which it can begin.

In: the listing of a program, whatever compiled the C, and the stream's numbers; the moments in which an
interrupt begins. Out: every way in which it can end; the cycles of its edges; the gaps between its looks at
the line. The time, `ticks`, `rest` and `fine` are known; every test of the line, of what was received and of
what the C left goes both ways.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

from servogen.engines.stream.response import (
    DUE,
    FINE,
    FOLLOWED,
    HALF,
    INTCON,
    MANY,
    PORT,
    PORT_NAMES,
    PORTS,
    REST,
    ROUND,
    TICKS,
    TMR0,
    Round,
    RoundMoment,
    T,
    Timer,
)
from servogen.engines.stream.settings import MASKED, UNIT
from servogen.engines.stream.streaming import Streaming
from servogen.graph import reached
from servogen.pic.device import INTERRUPT_VECTOR, registers
from servogen.pic.isa import encode
from servogen.pic.known_values import (
    CARRY,
    FSR,
    INDF,
    NOT_FOLLOWED,
    STATUS,
    ZERO,
    DecodedWord,
    Known,
    Undefined,
    W,
    word_of,
)
from servogen.pic.listing import Listing
from servogen.pic.wcet import TimedProgram
from servogen.prove.stream.looks import (
    BIT,
    BYTE,
    HUNT,
    NONE,
    OF_RECEIVER,
    RX_BITS,
    SENT,
    START,
    WAIT,
    InterruptChanged,
    Kind,
    Look,
    check_receiver,
    check_samples,
    looks_of,
)

MASK = "mask"
NEXT_WIDTH = NEXT_HI, NEXT_LO = "next_hi", "next_lo"
"""The width that the C prepared for the next slot."""
OF_TIME = (*FOLLOWED, DUE, MASK, PORT)
"""The interrupt's variables that looks at the line leave alone, but for `t`, whose value nothing keeps."""
OF_COUNTS = frozenset(
    [("DECFSZ", 1), ("DECF", 1), ("DECF", 0), ("SUBWF", 1), ("MOVF", 1), ("BTFSS", 0), ("BTFSC", 0)]
)
"""The instructions whose outcome is the same for every count that is odd and more than 1, or one less: they
count, test for zero, or test the lowest bit. With the destination, or the bit that is tested.
"""
T0IF, FSR_ADDRESS = 2, 4
MAX_STATES = 200_000  # against words that never come back; the templates' interrupts need some thousands
MAX_ROUNDS = 2  # a fall behind the end of a round is waited for in the same interrupt
MAX_TIMES = MAX_ROUNDS * ROUND + HALF
NEVER = -math.inf
"""When the last bit was taken, where that is so long ago that the next one may be."""


class LastLook(NamedTuple):
    """The latest look at the line; times are cycles of the round."""

    kind: Kind = NONE
    sample: int = 0
    stamp: int = 0


NO_LOOK = LastLook()


class Beginning(NamedTuple):
    """The cycle of its round in which an interrupt begins, and the look before it."""

    cycle: int
    last: LastLook = NO_LOOK


class Ending(NamedTuple):
    """How an interrupt can end."""

    cycle: int
    ahead: int
    """The cycles by which TMR0 is ahead of the time then."""
    cleared: bool
    """Whether the next round has no other interrupt."""
    ticks: int | None
    rest: int | None
    fine: int | None
    last: LastLook


class _State(NamedTuple):
    """Within an interrupt."""

    at: RoundMoment
    last: LastLook
    bit: float
    """The time stamp of the last bit that was taken, or NEVER."""


@dataclass(slots=True)
class _Visited:
    """The states that have been followed.

    Of two that differ only in when the last look and the last bit were, the earlier one can do all that the
    other can, and the gaps that it ends are larger: it stands for both.
    """

    followed: Collection[int]
    """The places whose values are remembered."""
    times: dict[Hashable, list[tuple[int, int, float]]] = field(default_factory=dict)
    """By state without times: sample and time stamp of the last look, time stamp of the last bit."""

    def is_new(self, state: _State) -> bool:
        """Note a state; return whether none stood for it."""
        (kind, sample, stamp), bit = state.last, state.bit
        state.at.forget(self.followed)
        times = self.times.setdefault((state.at.key(), kind), [])
        if any(other[0] <= sample and other[1] <= stamp and other[2] <= bit for other in times):
            return False
        times.append((sample, stamp, bit))
        return True


@dataclass(slots=True)
class Interrupt:
    """The interrupt's code, executed; it notes the edges and the gaps that it meets."""

    code: Round
    looks: Mapping[int, tuple[Look, ...]]
    """The outcomes of each subroutine that looks at the line, by its address."""
    answers: bool
    """Whether the chip answers on a pin."""
    min_bit_cycles: int
    """The minimum number of cycles from one bit taken to the next within an interrupt."""
    min_first_bit_cycles: int
    """The same from a start bit's time stamp to the first bit taken."""
    gaps: bool = False
    """Whether the gaps between looks are of interest, too."""
    edges: set[int] = field(default_factory=set)
    starts: set[tuple[int, int, int]] = field(default_factory=set)
    """Looks for a start bit: the time stamp's cycle of its round, cycles since the sample, and from the
    sample before to this one.
    """
    waits: set[tuple[int, int]] = field(default_factory=set)
    """Pairs of time stamps within a byte: the former's cycle of its round, and the cycles between them."""

    def run(self, begins: Iterable[Beginning], known: Known, ahead: int = 0) -> Iterable[Ending]:
        """Return every end of an interrupt that begins so, with TMR0 some cycles ahead; the edges are in
        `edges`.
        """
        ram = self.code.ram
        if PORT in ram:
            known |= {ram[name]: PORTS[1] for name in PORT_NAMES}
        followed = {W, CARRY, ZERO, FSR, ram[RX_BITS], *known, *(ram[name] for name in FOLLOWED)}
        rest = known.get(ram[REST])
        visited = _Visited(followed)
        ends: dict[Ending, None] = {}  # in order, so that every run of the search finds the same
        starts = [
            _State(
                RoundMoment(INTERRUPT_VECTOR, (), begin, dict(known), Timer(ahead)),
                last if self.gaps else NO_LOOK,
                last.stamp if last.kind == BIT else NEVER,
            )
            for begin, last in begins
        ]

        def following(state: _State) -> list[_State]:
            """Follow the only path to where it parts, or can meet another."""
            at, last, bit = state
            while True:
                if at.cycle > MAX_TIMES or len(visited.times) > MAX_STATES:
                    raise InterruptChanged(f"the interrupt does not end within {MAX_TIMES} cycles")
                word = self._word(at.address)
                if word.name == "RETFIE":
                    ends[self._ending_at(at, last, bit)] = None
                    return []
                self._check_word(word, at, rest)
                if word.flow == "call" and word.k in self.looks:
                    looked = list(self._after_look(self.looks[word.k], at, last, bit))
                    if len(looked) != 1:
                        return [self._forget_old_bit(successor) for successor in looked]
                    ((at, last, bit),) = looked
                    continue
                successors = self._successors(word, rest, at)
                if len(successors) != 1 or word.flow == "jump":
                    return [self._forget_old_bit(_State(successor, last, bit)) for successor in successors]
                (at,) = successors

        for _ in reached(starts, following, visited.is_new):
            pass  # the ends are noted where they are found
        return ends

    def _word(self, address: int) -> DecodedWord:
        try:
            return self.code.word(address)
        except (KeyError, Undefined):
            raise InterruptChanged(f"the interrupt leaves its words at 0x{address:03X}") from None

    def _forget_old_bit(self, state: _State) -> _State:
        """Forget when the last bit was, where that is so long ago that the next one may be."""
        recent = state.at.cycle - state.bit < self.min_bit_cycles
        return state if recent else _State(state.at, state.last, NEVER)

    def _ending_at(self, at: RoundMoment, last: LastLook, bit: float) -> Ending:
        known, ram = at.known, self.code.ram
        end = at.cycle + 2
        if not self.gaps:
            last = LastLook(BIT, int(bit), int(bit)) if end - bit < self.min_bit_cycles else NO_LOOK
        ticks, rest, fine = (known.get(ram[name]) for name in (TICKS, REST, FINE))
        return Ending(end, at.timer.ahead, bool(at.timer.cleared), ticks, rest, fine, last)

    # what the words may do at their time

    def _check_word(self, word: DecodedWord, at: RoundMoment, rest: int | None) -> None:
        """Check what a word writes at this time, and that it does the same for each count that is meant."""
        if at.address == self.code.edge:
            self._check_edge(word, at.known)
            self.edges.add(at.cycle)
        elif word.writes_f and word.f == INTCON:
            # The flag that is cleared is that of the overflow that began the interrupt, or after an edge that
            # of the next round.
            if at.timer.written is not None or at.cycle // ROUND != int(at.timer.cleared is not None):
                raise InterruptChanged(f"T0IF is cleared in cycle {at.cycle} of a round")
        elif word.writes_f and word.f == self.code.ram[DUE] and rest != 0:
            raise InterruptChanged(f"the word at 0x{at.address:03X} asks the C for a pulse beside a rise")
        if self._stands_for_all(word, at, rest) and not self._same_for_all(at.address, word):
            raise InterruptChanged(f"the word at 0x{at.address:03X} depends on how many interrupts are left")

    def _check_edge(self, word: DecodedWord, known: Known) -> None:
        """Check what the instruction of an edge writes: 0, or `mask` where a pulse begins, to a port."""
        if word.f not in PORTS and (word.f != INDF or known.get(FSR) not in PORTS):
            raise InterruptChanged("an edge is not written to a port")
        rest, value = known.get(self.code.ram[REST]), known.get(W)
        if rest is None or (rest and value != 0):
            raise InterruptChanged("a fall does not clear the port")
        mask = encode("MOVF", f=self.code.ram[MASK], d=0)
        if not rest and (value is not None or self.code.words[self.code.edge - 1] != mask):
            raise InterruptChanged("a rise does not write the pin that the C prepared")

    def _stands_for_all(self, word: DecodedWord, at: RoundMoment, rest: int | None) -> bool:
        """Return whether a word reads a count that stands for all that are larger than the last one.

        That is `ticks` in a round without an edge, in which `rest` is not known, or after a fall behind which
        there are many interrupts, which `rest` holds before.
        """
        if not word.has_f or word.name in ("MOVWF", "CLRF"):
            return False
        if word.f == self.code.ram[TICKS]:
            return rest is None or (rest == MANY and at.timer.cleared is not None)
        return rest == MANY and word.f == self.code.ram[REST]

    def _same_for_all(self, address: int, word: DecodedWord) -> bool:
        """Return whether a word does the same for each of these counts."""
        if word.name == "MOVF" and not word.writes_f:
            return self._takes_count(address + 1)
        return (word.name, word.b if word.tests_bit else int(word.writes_f)) in OF_COUNTS

    def _takes_count(self, address: int) -> bool:
        """Return whether a word moves `rest` from W to `ticks`, after a fall."""
        move = _move(self.code.ram[REST], self.code.ram[TICKS])
        return (self.code.words.get(address - 1), self.code.words.get(address)) == move

    # what can follow

    def _successors(self, word: DecodedWord, rest: int | None, at: RoundMoment) -> list[RoundMoment]:
        """Return what can follow a word that does not look at the line."""
        # What W holds then is another number for each of the counts.
        one_of_all = (word.name == "DECF" and self._stands_for_all(word, at, rest)) or (
            rest == MANY and self._takes_count(at.address)
        )
        if at.address == self.code.edge:  # from now on the flag may be cleared
            at = at._replace(timer=at.timer._replace(cleared=False))
        successors = self.code.steps(at, word)
        if one_of_all:
            for successor in successors:
                successor.known.pop(W, None)
        return successors

    def _after_look(
        self, looks: Iterable[Look], at: RoundMoment, last: LastLook, bit: float
    ) -> Iterator[_State]:
        """Yield what can follow a call of a look at the line."""
        address, stack, now, known, timer = at
        receiving, called = self.code.ram[RX_BITS], now + 2
        for place in (W, CARRY, ZERO, self.code.ram[T]):
            known.pop(place, None)
        for look in looks:
            sample, stamp = called + look.sample, called + look.stamp
            hunts = look.kind in (HUNT, START)
            if look.kind == BIT and stamp - bit < self.min_bit_cycles:
                continue  # the time that is left of a bit is longer
            if receiving in known and (known[receiving] == 0) != hunts:
                continue  # rx_bits is 0 while no byte is being received
            if self.gaps and not self._may_follow(last, look.kind, stamp):
                continue
            after = {place: value for place, value in known.items() if place != receiving}
            if hunts:
                after[receiving] = 0 if look.kind == HUNT else BYTE
            looked = NO_LOOK
            if self.gaps:
                kind = SENT if (last.kind, look.kind) == (HUNT, BIT) else look.kind
                looked = LastLook(kind, sample, stamp)
                self._note_gap(last, looked)
            yield _State(
                RoundMoment(address + 1, stack, called + look.cycles, after, timer),
                looked,
                stamp if look.kind == BIT else bit,
            )

    def _may_follow(self, last: LastLook, kind: Kind, stamp: int) -> bool:
        """Return whether a look can be the next one after `last`."""
        if last.kind == START:
            return kind == WAIT or (kind == BIT and stamp - last.stamp >= self.min_first_bit_cycles)
        if kind in (HUNT, START):
            return last.kind != SENT
        return last.kind != HUNT or self.answers

    def _note_gap(self, last: LastLook, look: LastLook) -> None:
        if last.kind in (HUNT, BIT) and look.kind == START:
            self.starts.add((look.stamp % ROUND, look.stamp - look.sample, look.sample - last.sample))
        elif last.kind in (START, WAIT, BIT) and look.kind in (WAIT, BIT):
            self.waits.add((last.stamp % ROUND, look.stamp - last.stamp))


@cache
def _move(source: int, target: int) -> tuple[int, int]:
    """Return the words that move a byte."""
    return encode("MOVF", f=source, d=0), encode("MOVWF", f=target)


def interrupt_of(listing: Listing, streamed: Streaming) -> Interrupt:
    """Return the interrupt of a program. Raises InterruptChanged if its parts are not there, or if its words
    write what is not theirs.
    """
    words = {row.address: row.word for row in listing.rows}
    names = (*OF_TIME, *OF_RECEIVER, *PORT_NAMES, *NEXT_WIDTH)
    ram = {name: place for place, name, _ in listing.variables if name in names}
    try:
        wait = encode("CALL", k=listing.label("st_exactly"))
        called = next(address for address in sorted(words) if words[address] == wait)
        edge = next(
            address for address in range(called, max(words)) if word_of(words[address]).name == "MOVWF"
        )
        subroutines = [listing.label(name) for name in ("st_look", "st_take", "st_hunt")]
    except (LookupError, StopIteration) as error:
        raise InterruptChanged(f"the interrupt's parts are not there: {error}") from None
    program = TimedProgram(words, ())
    ran = {address: words[address] for address in sorted(program.reached(INTERRUPT_VECTOR))}
    look, take, hunt = subroutines
    code = Round(ran, ram, look, edge, MASKED)
    pin = streamed.stream.transmit_pin
    out = None if pin is None else (registers()[f"PORT{pin[1]}"].address, int(pin[2]))
    looking = frozenset[int]().union(*map(program.reached, subroutines))
    _check_writes(ran, ram, listing, looking, edge)
    _check_looks(ran, ram, looking, out)
    check_receiver(words, ram, take, hunt, streamed)
    looks = {address: looks_of(code, address, hunt) for address in subroutines}
    check_samples(code, take)
    # Time stamps count modulo 64 units, so a bit is taken at most 64 units after it is due, and the next one
    # no earlier than that much less than a bit after it.
    min_bit_cycles = UNIT * (streamed.bit_units - ROUND // UNIT)
    return Interrupt(code, looks, out is not None, min_bit_cycles, UNIT * streamed.first_units + 1)


def _check_writes(
    ran: Mapping[int, int], ram: Mapping[str, int], listing: Listing, looking: Collection[int], edge: int
) -> None:
    """Check that the interrupt without its looks at the line writes no variable of the C or of the receiver,
    and of the registers only what it may.
    """
    own = {ram[name] for name in OF_TIME if name in ram}
    for first, name, count in listing.variables:
        if name.endswith("(temporary)"):
            own |= set(range(first, first + count))  # the context, kept by the compiler
    for address, word in ((address, word_of(ran[address])) for address in ran):
        if word.name in NOT_FOLLOWED:
            raise InterruptChanged(f"{word.name} at 0x{address:03X} is not followed")
        if word.flow == "jump" and word.k == edge:
            raise InterruptChanged(f"the word at 0x{address:03X} jumps to an edge")
        if not word.writes_f or word.f == TMR0 or address in looking or address == edge:
            continue  # these are checked where they are executed, looks by `_check_looks`
        if word.f in (*PORTS, INDF):
            raise InterruptChanged(f"the word at 0x{address:03X} writes a port")
        allowed = {
            INTCON: word.name == "BCF" and word.b == T0IF,
            STATUS: _keeps_bank(ran, address, word),
            FSR_ADDRESS: word.name == "MOVWF",
            ram[DUE]: word.name == "BSF",
            ram[MASK]: _is_unprepared(ran, address, ram),
        }.get(word.f, word.f in own or word.name == "MOVF")
        if not allowed:
            raise InterruptChanged(f"the word at 0x{address:03X} writes what is not the interrupt's")


def _check_looks(
    ran: Mapping[int, int], ram: Mapping[str, int], looking: Iterable[int], out: tuple[int, int] | None
) -> None:
    """Check that a look at the line writes the receiver's variables and the pin that answers, and that the
    interrupt does not end in it.
    """
    own = {ram[name] for name in OF_RECEIVER}
    for address, word in ((address, word_of(ran[address])) for address in sorted(looking)):
        if word.name == "RETFIE":
            raise InterruptChanged(f"a look at the line ends the interrupt at 0x{address:03X}")
        answers = word.changes_bit and (word.f, word.b) == out
        keeps = word.f == STATUS and _keeps_bank(ran, address, word)
        if word.writes_f and not (answers or keeps or word.f in own):
            raise InterruptChanged(f"a look at the line writes what is not its own, at 0x{address:03X}")


def _keeps_bank(ran: Mapping[int, int], address: int, word: DecodedWord) -> bool:
    """Return whether a write of STATUS leaves bank 0 selected, or returns to the bank of the C at the end."""
    if word.name in ("BSF", "BCF"):
        return word.b == 0 or word.selects_bank_0
    following = address + 1
    while following in ran and word_of(ran[following]).name == "SWAPF":  # W is restored, and no flag changes
        following += 1
    return word.name == "CLRF" or (word.name == "MOVWF" and ran.get(following) == encode("RETFIE"))


def _is_unprepared(ran: Mapping[int, int], address: int, ram: Mapping[str, int]) -> bool:
    """Return whether the pin is cleared only where the C is late, and the overrun bit is set then."""
    return (ran.get(address - 2), ran.get(address), ran.get(address + 1)) == (
        encode("BTFSS", f=ram[DUE], b=1),
        encode("CLRF", f=ram[MASK]),
        encode("BSF", f=ram[DUE], b=0),
    )
