"""One interrupt of a stream's program: how it can end from given counts, whatever is on the line.

In: the listing of a program, whatever compiled the C, and the stream's numbers; the cycles in which the
interrupt begins, `ticks`, `rest` and `fine` then. Out: every end that it can have and the cycles of its
edges; `InterruptChanged` where

- an edge writes anything but 0 (a fall) or the pin that the C prepared (a rise), or not to a port;
- T0IF is cleared while that may lose an interrupt, or the C is asked for a pulse beside a rise;
- words differ in what they do between the counts of interrupts that one number stands for (below);
- it takes more than two and a half rounds, or leaves its words.

The levels of the line, the receiver's variables and those of the C are not known: their tests go both ways.

*Counts.* How many interrupts are left until an edge only matters when it is the last. `REPRESENTATIVE`, in
`ticks` or in `rest`, stands for every odd number above 1, and that less 1 for every even one. This is sound
because each word that reads such a count does the same for all of them: it tests it for 0 or its lowest bit,
moves `rest` to `ticks`, or subtracts a number, as long as no count gets to 0. What it makes of it in W is
forgotten, as it differs between them.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

from servogen.engines.stream.interrupt_code import (
    AFTER_EDGE,
    BEFORE_EDGE,
    DUE,
    FINE,
    HALF,
    INTCON,
    NEXT_PORT,
    PORT,
    PORT_VARIABLES,
    PORTS,
    REPRESENTATIVE,
    REST,
    ROUND,
    TICKS,
    EdgePhase,
    InterruptCode,
    TimedState,
    Timer,
    find_edge,
)
from servogen.engines.stream.settings import UNIT
from servogen.engines.stream.streaming import Streaming
from servogen.graph import reached
from servogen.pic.device import INTERRUPT_VECTOR
from servogen.pic.isa import encode
from servogen.pic.known_values import FSR, INDF, DecodedWord, Known, Undefined, W
from servogen.pic.listing import Listing
from servogen.pic.wcet import TimedProgram
from servogen.prove.stream.looks import (
    BIT,
    BYTE,
    HUNT,
    RECEIVER_VARIABLES,
    RX_BITS,
    START,
    InterruptChanged,
    Look,
    check_receiver,
    check_sample_times,
    look_outcomes,
)
from servogen.prove.stream.samples import NO_LOOK, LastLook, LookSequence
from servogen.prove.stream.writes import (
    OWN_VARIABLES,
    check_look_writes,
    check_writes,
    writes_mask_if_rest_is_0,
)

NEXT_WIDTH = NEXT_HI, NEXT_LO = "next_hi", "next_lo"
"""The width that the C prepared for the next slot."""
LEAST_REPRESENTATIVE = REPRESENTATIVE - 2
"""It stands for 1 and all odd numbers above, as REPRESENTATIVE stands for 3 and those above."""
MAX_STATES = 200_000  # against words that never come back; the templates' interrupts need some thousands
MAX_CYCLES = 2 * ROUND + HALF  # a fall behind the end of a round is waited for in the same interrupt
NEVER = -math.inf
"""When the last bit was taken, where that is so long ago that the next one may be."""


class Beginning(NamedTuple):
    """The cycle of its round in which an interrupt begins, and the look before it."""

    cycle: int
    last: LastLook = NO_LOOK


class Ending(NamedTuple):
    """How an interrupt can end."""

    cycle: int
    ahead: int
    """The cycles by which TMR0 is ahead of the time then."""
    phase: EdgePhase
    """BEFORE_EDGE if it made none; SPANS_NEXT_ROUND if the next round has no other interrupt."""
    ticks: int | None
    rest: int | None
    fine: int | None
    port: int | None
    """None if all servos are on one port."""
    last: LastLook


class InterruptRun(NamedTuple):
    """All ends of an interrupt, and the cycles of its edges."""

    ends: tuple[Ending, ...]
    edges: frozenset[int]


@dataclass(frozen=True, slots=True)
class Interrupt:
    """The interrupt of a program."""

    code: InterruptCode
    looks: Mapping[int, tuple[Look, ...]]
    """The outcomes of each subroutine that looks at the line, by its address."""
    min_bit_cycles: int
    """The minimum number of cycles from one bit taken to the next within an interrupt."""
    sequence: LookSequence | None = None
    """Notes the gaps between looks; without it, only the times of bits are remembered."""

    def run(self, begins: Iterable[Beginning], variables: Mapping[str, int], ahead: int = 0) -> InterruptRun:
        """Return what an interrupt can do that begins so, with TMR0 some cycles ahead, if these of its
        variables have these values. Raises InterruptChanged.
        """
        known = {self.code.ram[name]: value for name, value in variables.items()} | self.code.fixed_ports()
        tracked = self.code.places() | {self.code.ram[RX_BITS]} | known.keys()
        run = _Run(self, variables.get(REST), tracked)
        starts = [
            _State(
                TimedState(INTERRUPT_VECTOR, (), begin, dict(known), Timer(ahead)),
                last if self.sequence else NO_LOOK,
                last.stamp if last.kind == BIT else NEVER,
            )
            for begin, last in begins
        ]
        for _ in reached(starts, run.following, run.is_new):
            pass  # the ends are noted where they are found
        return InterruptRun(tuple(run.ends), frozenset(run.edges))


class _State(NamedTuple):
    """Within an interrupt."""

    at: TimedState
    last: LastLook
    bit_stamp: float
    """The time stamp of the last bit that was taken, or NEVER."""


class _LookTimes(NamedTuple):
    """When the last look and the last bit were."""

    sample: int
    stamp: int
    bit_stamp: float

    def dominates(self, later: _LookTimes) -> bool:
        """Return whether none of these is later: then whatever can follow `later` can follow this, too, after
        gaps at least as long.
        """
        stamps = self.stamp <= later.stamp and self.bit_stamp <= later.bit_stamp
        return self.sample <= later.sample and stamps


@dataclass(slots=True)
class _Run:
    """One interrupt, executed from all its beginnings together."""

    interrupt: Interrupt
    rest: int | None
    """`rest` before it; None in a round without an edge."""
    tracked: Collection[int]
    """The places whose values are remembered."""
    ends: dict[Ending, None] = field(default_factory=dict)  # in order: every run of the search finds the same
    edges: set[int] = field(default_factory=set)
    visited: dict[Hashable, list[_LookTimes]] = field(default_factory=dict)
    """By state without times: those times that no other state with it dominates."""

    def is_new(self, state: _State) -> bool:
        """Note a state; return whether none that was followed dominates it."""
        state.at.forget(self.tracked)
        times = _LookTimes(state.last.sample, state.last.stamp, state.bit_stamp)
        followed = self.visited.setdefault((state.at.key(), state.last.kind), [])
        if any(earlier.dominates(times) for earlier in followed):
            return False
        followed.append(times)
        return True

    def following(self, state: _State) -> list[_State]:
        """Follow the only path from a state to where it forks, or can meet another."""
        at, last, bit_stamp = state
        while True:
            if at.cycle > MAX_CYCLES or len(self.visited) > MAX_STATES:
                raise InterruptChanged(f"the interrupt does not end within {MAX_CYCLES} cycles")
            word = self._word(at.address)
            if word.name == "RETFIE":
                self.ends[self._ending(_State(at, last, bit_stamp))] = None
                return []
            self._check_word(word, at)
            if word.flow == "call" and word.k in self.interrupt.looks:
                looks = self.interrupt.looks[word.k]
                states = list(self._after_look(looks, _State(at, last, bit_stamp)))
                if len(states) == 1:
                    ((at, last, bit_stamp),) = states
                    continue
            else:
                successors = self._after_word(word, at)
                if len(successors) == 1 and word.flow != "jump":
                    (at,) = successors
                    continue
                states = [_State(successor, last, bit_stamp) for successor in successors]
            return [self._forget_old_bit(state) for state in states]

    def _word(self, address: int) -> DecodedWord:
        try:
            return self.interrupt.code.word(address)
        except (KeyError, Undefined):
            raise InterruptChanged(f"the interrupt leaves its words at 0x{address:03X}") from None

    def _forget_old_bit(self, state: _State) -> _State:
        """Forget when the last bit was, where that is so long ago that the next one may be."""
        return state if self._is_recent(state.bit_stamp, state.at.cycle) else state._replace(bit_stamp=NEVER)

    def _is_recent(self, bit_stamp: float, cycle: int) -> bool:
        return cycle - bit_stamp < self.interrupt.min_bit_cycles

    def _ending(self, state: _State) -> Ending:
        (_, _, cycle, known, timer), last, bit_stamp = state
        end, ram = cycle + 2, self.interrupt.code.ram
        if not self.interrupt.sequence:
            # Of the last look only a bit matters to the next interrupt, and only if it is recent.
            recent = self._is_recent(bit_stamp, end)
            last = LastLook(BIT, int(bit_stamp), int(bit_stamp)) if recent else NO_LOOK
        ticks, rest, fine = (known.get(ram[name]) for name in (TICKS, REST, FINE))
        port = known.get(ram[PORT]) if PORT in ram else None
        return Ending(end, timer.ahead, timer.phase, ticks, rest, fine, port, last)

    # what the words may do at their time

    def _check_word(self, word: DecodedWord, at: TimedState) -> None:
        """Check what a word writes at this time, and that it does the same for each count that is meant."""
        code = self.interrupt.code
        if at.address == code.edge:
            self._check_edge(word, at.known)
            self.edges.add(at.cycle)
        elif word.writes_f and word.f == INTCON:
            # Before an edge T0IF is that of the overflow in cycle 0; behind it, of the next round's, which
            # must have begun. A write of TMR0 moves the overflow that comes.
            has_edge = at.timer.phase is not BEFORE_EDGE
            if at.timer.written is not None or at.cycle // ROUND != int(has_edge):
                raise InterruptChanged(f"T0IF is cleared in cycle {at.cycle} of a round")
        elif word.writes_f and word.f == code.ram[DUE] and self.rest != 0:
            raise InterruptChanged(f"the word at 0x{at.address:03X} asks the C for a pulse beside a rise")
        if self.rest is None and word.writes_f and word.f in (code.ram[REST], code.ram[FINE]):
            raise InterruptChanged(f"the word at 0x{at.address:03X} moves an edge in a round without one")
        if self._reads_representative(word, at) and not self._is_uniform(word, at):
            raise InterruptChanged(f"the word at 0x{at.address:03X} depends on how many interrupts are left")

    def _check_edge(self, word: DecodedWord, known: Known) -> None:
        """Check what the instruction of an edge writes, and where: 0, or `mask` where a pulse begins."""
        code = self.interrupt.code
        rest = known.get(code.ram[REST])
        if word.f == INDF:
            port = known.get(code.ram.get(PORT if rest else NEXT_PORT, FSR))
            if known.get(FSR) not in PORTS or known.get(FSR) != port:
                raise InterruptChanged("an edge is not written to the port of its pulse")
        elif word.f not in PORTS:
            raise InterruptChanged("an edge is not written to a port")
        if rest is None:
            raise InterruptChanged("an edge is in a round without one")
        if not writes_mask_if_rest_is_0(code):
            raise InterruptChanged("a rise does not write the pin that the C prepared, or a fall not 0")

    # the counts that one number stands for

    def _reads_representative(self, word: DecodedWord, at: TimedState) -> bool:
        """Return whether a word reads a count that stands for others.

        That is `ticks` in a round without an edge, or after a fall if `rest` did before; and `rest` itself.
        """
        if "f" not in word.reads:
            return False
        ram = self.interrupt.code.ram
        if word.f == ram[TICKS]:
            after_fall = self.rest == REPRESENTATIVE and at.timer.phase is not BEFORE_EDGE
            return self.rest is None or after_fall
        return self.rest == REPRESENTATIVE and word.f == ram[REST]

    def _is_uniform(self, word: DecodedWord, at: TimedState) -> bool:
        """Return whether a word that reads such a count does the same for each number that it stands for.

        It may test the lowest bit, or for zero, and subtract as long as none of the numbers gets to zero.
        """
        if word.tests_bit:
            return word.b == 0
        if word.name == "MOVF":
            return word.writes_f or self._ends_move_to_ticks(at.address + 1)
        less = at.known.get(W) if word.name == "SUBWF" and word.writes_f else None
        if word.name == "DECF" or (word.name == "DECFSZ" and word.writes_f):
            less = 1
        count = at.known.get(word.f)
        return less is not None and (count is None or count - less >= LEAST_REPRESENTATIVE)

    def _ends_move_to_ticks(self, address: int) -> bool:
        """Return whether a word is the second of the two that move `rest` to `ticks`, after a fall."""
        code = self.interrupt.code
        move = _move(code.ram[REST], code.ram[TICKS])
        return (code.words.get(address - 1), code.words.get(address)) == move

    # what can follow

    def _after_word(self, word: DecodedWord, at: TimedState) -> list[TimedState]:
        """Return what can follow a word that does not look at the line."""
        code = self.interrupt.code
        # What W holds then is another number for each of the counts.
        forgets_w = (word.name == "DECF" and self._reads_representative(word, at)) or (
            word.name == "MOVWF" and self.rest == REPRESENTATIVE and self._ends_move_to_ticks(at.address)
        )
        if at.address == code.edge:
            at = at._replace(timer=at.timer._replace(phase=AFTER_EDGE))
        successors = code.successors(at, word)
        if forgets_w:
            for successor in successors:
                successor.known.pop(W, None)
        return successors

    def _after_look(self, looks: Iterable[Look], state: _State) -> Iterator[_State]:
        """Yield what can follow a call of a look at the line."""
        code, sequence = self.interrupt.code, self.interrupt.sequence
        at, last, bit_stamp = state
        rx_bits, called = code.ram[RX_BITS], at.cycle + 2
        for look in looks:
            sample, stamp = called + look.sample, called + look.stamp
            hunts = look.kind in (HUNT, START)
            if look.kind == BIT and self._is_recent(bit_stamp, stamp):
                continue  # the time that is left of a bit is longer
            if rx_bits in at.known and (at.known[rx_bits] == 0) != hunts:
                continue  # rx_bits is 0 while no byte is being received
            if sequence and not sequence.may_follow(last, look.kind, stamp):
                continue
            after = code.after_look(at, look.cycles)
            after.known.pop(rx_bits, None)
            if hunts:
                after.known[rx_bits] = 0 if look.kind == HUNT else BYTE
            yield _State(
                after,
                sequence.append(last, look.kind, sample, stamp) if sequence else NO_LOOK,
                stamp if look.kind == BIT else bit_stamp,
            )


@cache
def _move(source: int, target: int) -> tuple[int, int]:
    """Return the words that move a byte."""
    return encode("MOVF", f=source, d=0), encode("MOVWF", f=target)


def find_interrupt(listing: Listing, streamed: Streaming) -> Interrupt:
    """Return the interrupt of a program. Raises InterruptChanged if its parts are not there, or if its words
    write what is not theirs.
    """
    words = listing.words
    names = (*OWN_VARIABLES, *RECEIVER_VARIABLES, *PORT_VARIABLES, *NEXT_WIDTH)
    ram = {name: place for place, name, _ in listing.variables if name in names}
    program = TimedProgram(words, ())
    executed = {address: words[address] for address in sorted(program.reached(INTERRUPT_VECTOR))}
    try:
        look, take, hunt = subroutines = [listing.label(f"st_{name}") for name in ("look", "take", "hunt")]
        code = InterruptCode(executed, ram, look, find_edge(executed, listing.label("st_exactly")))
    except LookupError as error:
        raise InterruptChanged(f"the interrupt's parts are not there: {error}") from None
    looking = frozenset[int]().union(*map(program.reached, subroutines))
    check_writes(code, listing, looking)
    check_look_writes(code, looking, streamed)
    check_receiver(words, ram, take, hunt, streamed)
    looks = {address: look_outcomes(code, address, hunt) for address in subroutines}
    check_sample_times(code, take)
    return Interrupt(code, looks, min_bit_cycles(streamed))


def min_bit_cycles(streamed: Streaming) -> int:
    """Return the minimum number of cycles from one bit taken to the next within an interrupt.

    Time stamps count modulo 64 units, so a bit is taken at most 64 units after it is due, and the next one no
    earlier than that much less than a bit after it.
    """
    return UNIT * (streamed.bit_units - ROUND // UNIT)


def min_first_bit_cycles(streamed: Streaming) -> int:
    """Return the minimum number of cycles from a start bit's time stamp to the first bit taken."""
    return UNIT * streamed.first_units + 1
