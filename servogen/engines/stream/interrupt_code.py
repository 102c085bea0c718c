"""The words of a stream's interrupt, executed abstractly: what is known after each, and in which cycle.

In: the words, the addresses of the interrupt's variables. Out: what can follow a word. TMR0 counts cycles and
is only advanced by constants, so a word that reads it reads a known number; of what is received nothing is
known, so a test of it goes both ways. Time is divided into rounds of 256 cycles, one revolution of TMR0:

    ticks   interrupts left until the round of the next edge; odd: TMR0 shows the time, even: it is HALF ahead
    rest    the number of interrupts from the round after the next fall to that of the next rise; 0: the next
            edge is a rise
    fine    the cycles by which the next fall is later in its round than a rise is
    t       scratch
"""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterator, Mapping
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import NamedTuple

from servogen.engines.stream.rendering import OVERRUN
from servogen.graph import reached
from servogen.pic.device import addresses
from servogen.pic.isa import encode
from servogen.pic.known_values import (
    CARRY,
    FSR,
    INDF,
    RETURNED,
    ZERO,
    DecodedWord,
    Known,
    W,
    execute,
    step,
    word_of,
)

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
PORTS = addresses("PORTA", "PORTB")
REPRESENTATIVE = 101
"""The `ticks` or `rest` that stands for every odd number above 1: the words do the same for each of them,
which `prove.stream.interrupt` shows.
"""
TIMING_VARIABLES = TICKS, REST, FINE, T = "ticks", "rest", "fine", "t"
"""The interrupt's variables that decide how long it waits."""
DUE = OVERRUN
"""The C's bits: 0, a pulse was not prepared in time; 1, a pulse is requested."""
PORT_VARIABLES = PORT, NEXT_PORT = "port", "next_port"
"""Its variables with the address of a port, if servos are on both."""


class EdgePhase(IntEnum):
    """How far an interrupt with an edge is; one without an edge stays before it."""

    BEFORE_EDGE = 0
    """T0IF, if it is cleared, is that of the overflow that began this interrupt."""
    AFTER_EDGE = 1
    SPANS_NEXT_ROUND = 2
    """T0IF was cleared after the edge: the next round has no interrupt of its own."""


BEFORE_EDGE, AFTER_EDGE, SPANS_NEXT_ROUND = EdgePhase


class Timer(NamedTuple):
    """What is known of TMR0, which shows the time modulo 256 unless it was written, and of its flag."""

    ahead: int = 0
    """The cycles by which it is ahead of the time."""
    written: int | None = None
    """The cycle in which this interrupt wrote it."""
    phase: EdgePhase = BEFORE_EDGE


class TimedState(NamedTuple):
    """What is known before an instruction of the interrupt's code."""

    address: int
    stack: tuple[int, ...]
    cycle: int
    """Of the round, of which 0 is its overflow of TMR0; or since a subroutine's first instruction."""
    known: Known
    """Changed by the instruction."""
    timer: Timer = Timer()

    def forget(self, tracked: Collection[int]) -> None:
        """Forget the places that are not `tracked`."""
        for place in [place for place in self.known if place not in tracked]:
            del self.known[place]

    def key(self) -> Hashable:
        """Return what tells this state from others."""
        return self.address, self.stack, self.cycle, frozenset(self.known.items()), self.timer


@dataclass(frozen=True, eq=False)
class InterruptCode:
    """The words that an interrupt can execute."""

    words: Mapping[int, int]
    ram: Mapping[str, int]
    """The addresses of its variables."""
    look: int
    """The address of the subroutine that looks at the line."""
    edge: int
    """The address of the instruction that makes an edge."""

    @cached_property
    def look_cycles(self) -> tuple[int, ...]:
        """Return all durations of a look at the line, whatever the receiver does."""
        begin: tuple[int, tuple[int, ...], int] = (self.look, (), 0)

        def following(at: tuple[int, tuple[int, ...], int]) -> Iterator[tuple[int, tuple[int, ...], int]]:
            if at[0] != RETURNED:
                successors = self.successors(TimedState(*at, {}), self.word(at[0]))
                yield from (after[:3] for after in successors)

        found = reached([begin], following)
        return tuple(sorted(cycles for address, _, cycles in found if address == RETURNED))

    def places(self) -> set[int]:
        """Return the places whose values decide what the interrupt does when."""
        return {W, CARRY, ZERO, FSR, *(self.ram[name] for name in TIMING_VARIABLES)}

    def fixed_ports(self) -> Known:
        """Return addresses of ports for the variables that hold some, two different ones: the interrupt does
        the same for any.
        """
        return (
            dict(zip((self.ram[name] for name in PORT_VARIABLES), PORTS, strict=True))
            if PORT in self.ram
            else {}
        )

    def word(self, address: int) -> DecodedWord:
        """Return an instruction of the code. Raises KeyError, Undefined."""
        return word_of(self.words[address])

    def after_look(self, state: TimedState, cycles: int) -> TimedState:
        """Return what follows a call of a look at the line that takes so many cycles."""
        known = dict(state.known)
        for place in (W, CARRY, ZERO, self.ram[T]):
            known.pop(place, None)
        # The call takes two cycles itself.
        return TimedState(state.address + 1, state.stack, state.cycle + 2 + cycles, known, state.timer)

    def successors(self, state: TimedState, word: DecodedWord) -> list[TimedState]:
        """Return what follows an instruction. Changes `state.known`.

        Raises LookupError for a use of TMR0 that is not followed.
        """
        address, stack, now, known, timer = state
        if word.flow == "call" and word.k == self.look:
            return [self.after_look(state, cycles) for cycles in self.look_cycles]
        if word.has_f and word.f == TMR0:
            return [self._after_timer(state, word)]
        if word.f == INDF and word.writes_f and word.flow == "next" and known.get(FSR) in PORTS:
            return [TimedState(address + 1, stack, now + 1, known, timer)]
        if word.name == "BCF" and word.f == INTCON and timer.phase is not BEFORE_EDGE:
            timer = timer._replace(phase=SPANS_NEXT_ROUND)
        return [
            TimedState(target, more, now + cycles, after, timer)
            for target, more, cycles, after in step(address, stack, word, known)
        ]

    def _after_timer(self, state: TimedState, word: DecodedWord) -> TimedState:
        """Execute an instruction that reads the timer, or adds a constant to it."""
        address, stack, now, known, timer = state
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
            return TimedState(address + 1, stack, now + 1, known, timer._replace(ahead=ahead, written=now))
        if word.flow == "skip":
            skips = bool(value >> word.b & 1) == (word.name == "BTFSS")
            return TimedState(address + 1 + skips, stack, now + 1 + skips, known, timer)
        # It is read into W as a byte would be: the instruction is executed on one that holds it.
        execute(word, known, operand=value)
        return TimedState(address + 1, stack, now + 1, known, timer)


def find_edge(words: Mapping[int, int], wait: int) -> int:
    """Return the address of the instruction that makes an edge: in an interrupt's words the MOVWF after the
    call of `wait`, the subroutine `st_exactly`. Raises LookupError.
    """
    calls = [address for address in sorted(words) if words[address] == encode("CALL", k=wait)]
    for address in sorted(words):
        if calls and address > calls[0] and word_of(words[address]).name == "MOVWF":
            return address
    raise LookupError("the interrupt makes no edge")
