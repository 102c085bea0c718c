"""The theorem about a stream's interrupt: every edge is exact, for every line and compiler.

*For every* level of the line in every cycle, every content of the receiver's variables and of those that the
C hands over, every cycle in which the chip can enter an interrupt, every number of rounds in a pulse, and
each of the 256 cycles of a round in which it can end,

*assuming* that outside of the interrupt nothing writes its variables, TMR0, OPTION_REG, a servo's port or the
bits that enable interrupts, except to mask them for up to MASKED cycles (`lemmas.check_sharing`, `response`);
that a prepared pulse takes 1 to `rounds` - 1 whole rounds, and after the most of them up to LATEST cycles
(`proof.widths`); and, if the chip answers, that no byte ends within 20 ms of a query: an answer's first bit
is due at once, and otherwise two bits are at least `min_bit_cycles` apart, on which the times of an interrupt
rest;

*it holds* that

- edges: the rises of slots are `rounds` rounds apart, each in cycle `Guarantee.rise` of its round; the fall
  is 256 * `next_hi` + `next_lo` cycles later. Both write the port and pin that the C prepared, and no other
  word writes a servo's pin. Where the C has not prepared a pulse there is none, and bit 0 of `due` is set;
- samples, as long as no trim masks interrupts: gaps between looks at the line are at most
  `Guarantee.samples`.

In: the listing of a program, and the stream's numbers. Out: `Guarantee`, or `InterruptChanged` with the first
thing that does not hold.

*How.* `interrupt` executes one interrupt from a set of cycles. Where it can end says in which cycles, and in
which kind of round, the next one can begin; these states are collected until no new one comes. That each ends
with TMR0 in step and `ticks`, `rest` counted down as here is what makes the rounds of edges those of the
width.

    round without an edge   first half ──▶ second half ──▶ next round
    rise                    whole round ──▶ next round
    fall, `fine` 0 to 255   whole round, or this one and the next ──▶ next round, perhaps late
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from enum import Flag, auto
from typing import NamedTuple

from servogen.engines.stream.interrupt_code import (
    AFTER_EDGE,
    BEFORE_EDGE,
    FINE,
    HALF,
    LATENCY,
    NEXT_PORT,
    PORT,
    REPRESENTATIVE,
    REST,
    ROUND,
    SPANS_NEXT_ROUND,
    TICKS,
)
from servogen.engines.stream.layout import LATEST, RoundLayout
from servogen.engines.stream.settings import MASKED
from servogen.engines.stream.streaming import Streaming
from servogen.pic.listing import Listing
from servogen.prove.stream.interrupt import (
    NEXT_HI,
    NEXT_LO,
    Beginning,
    Ending,
    Interrupt,
    find_interrupt,
    min_first_bit_cycles,
)
from servogen.prove.stream.looks import NONE, InterruptChanged, Kind
from servogen.prove.stream.samples import NO_LOOK, LastLook, LookSequence, SampleTimes

Tell = Callable[[str, int, int], None]


class RoundKind(Flag):
    """What a round may be: without an edge, or with one."""

    PLAIN = auto()
    RISE = auto()
    FALL = auto()


PLAIN, RISE, FALL = RoundKind
ANY = PLAIN | RISE | FALL
KNOWLEDGE = (ANY, PLAIN | RISE, PLAIN | FALL, PLAIN, RISE)
"""All that the round before can tell of a round."""


class _Entry(NamedTuple):
    """States in which an interrupt begins."""

    first: bool
    """Whether a round begins with it; else it is in the middle of one."""
    cycle: int
    look: Kind
    """The kind of the last look at the line."""
    may_be: RoundKind


@dataclass(frozen=True, slots=True)
class Guarantee:
    """For every line, and every C that keeps the interrupt's variables to itself."""

    rise: int
    """The cycle of its round in which a pulse begins."""
    samples: SampleTimes
    states: int
    """The states in which an interrupt begins."""


def guarantee(
    listing: Listing,
    streamed: Streaming,
    fines: Iterable[int] = range(ROUND),
    tell: Tell = lambda task, count, of: None,
) -> Guarantee:
    """Return what the interrupt of a program guarantees. Raises InterruptChanged.

    `fines`: the cycles of its round in which a fall is followed: all of them, unless a test has less time.
    """
    layout, fines = streamed.layout, tuple(fines)
    interrupt = find_interrupt(listing, streamed)
    masked = 0 if streamed.coarse else MASKED
    exact = _Closure(interrupt, layout, fines, masked, tell, "edges")
    exact.close()
    # Only a trim's write to the EEPROM masks interrupts, and senders leave the line alone while it begins.
    answers = streamed.stream.transmit_pin is not None
    sequence = LookSequence(answers, min_first_bit_cycles(streamed))
    _Closure(replace(interrupt, sequence=sequence), layout, fines, 0, tell, "samples").close()
    return Guarantee(exact.rise, sequence.times(), len(exact.entries))


@dataclass(slots=True)
class _Closure:
    """The states in which interrupts begin, until no new one comes."""

    interrupt: Interrupt
    layout: RoundLayout
    fines: tuple[int, ...]
    masked: int
    tell: Tell
    what: str
    rise: int = -1
    """The cycle of all rises, from the first that was followed; -1 until then."""
    entries: dict[_Entry, LastLook] = field(default_factory=dict)
    """With the earliest look of that kind: the one from which the gap to the next is largest."""
    _waiting: list[_Entry] = field(default_factory=list)
    _without_falls: list[tuple[RoundKind, Beginning]] = field(default_factory=list)
    """Interrupts with which a round begins, and that have not been continued with falls yet."""

    def close(self) -> None:
        """Execute every interrupt from every state in which it can begin. Raises InterruptChanged."""
        try:
            self._check_counts()
            for cycle in self._entry_cycles(0, 0):
                self._add(_Entry(True, cycle, NONE, ANY), NO_LOOK)
            while self._waiting:
                self._run_all_but_falls()
                begins = [beginning for may_be, beginning in self._without_falls if FALL in may_be]
                self._without_falls.clear()
                for number, fine in enumerate(self.fines if begins else ()):
                    self.tell(self.what, number, len(self.fines))
                    self._run_falls(begins, fine)
        except LookupError as error:
            raise InterruptChanged(str(error)) from None

    def _run_all_but_falls(self) -> None:
        """Execute all but the falls, until nothing new comes."""
        while self._waiting:
            waiting, self._waiting = self._waiting, []
            firsts = [
                (entry.may_be, Beginning(entry.cycle, self.entries[entry]))
                for entry in waiting
                if entry.first
            ]
            self._without_falls += firsts
            self._run_rises([beginning for may_be, beginning in firsts if RISE in may_be])
            self._run_firsts([beginning for may_be, beginning in firsts if PLAIN in may_be])
            self._run_seconds(
                [Beginning(entry.cycle, self.entries[entry]) for entry in waiting if not entry.first]
            )

    # the states in which an interrupt begins

    def _entry_cycles(self, overflow: int, end: int) -> range:
        """Return the cycles in which the interrupt of an overflow can begin, if the one before ended at
        `end`.
        """
        earliest, latest = max(overflow + 2, end), max(overflow, end) + LATENCY
        if self.interrupt.sequence is None:
            # Edges are exact for more: as if an instruction of two cycles delayed the latency, or masking
            # did.
            return range(earliest, latest + 2 + self.masked + 1)
        if end < overflow:
            # It is the same for instructions of one and of two cycles (DS35007 section 6.8): 2, or one more.
            return range(overflow + 2, overflow + 4)
        return range(earliest, latest + 1)

    def _add(self, entry: _Entry, last: LastLook) -> None:
        """Add a state, unless another stands for it: with an earlier look, in a round that may be as much."""
        for wider in KNOWLEDGE:
            if entry.may_be in wider:
                before = self.entries.get(entry._replace(may_be=wider))
                # Where only the times of bits are remembered, the next one may come at any time without them.
                unlimited = (
                    self.interrupt.sequence is None
                    and entry._replace(look=NONE, may_be=wider) in self.entries
                )
                # Sample and stamp of a kind are a fixed time apart: both are earlier, or neither.
                if unlimited or (before is not None and before[1:] <= last[1:]):
                    return
        self.entries[entry] = last
        if entry not in self._waiting:
            self._waiting.append(entry)

    def _add_next_round(self, end: Ending, rounds: int = 1, may_be: RoundKind = ANY) -> None:
        """Add the first interrupts of the round after `rounds` rounds."""
        passed, last = rounds * ROUND, end.last
        if last.kind is not NONE:
            last = LastLook(last.kind, last.sample - passed, last.stamp - passed)
        for cycle in self._entry_cycles(0, end.cycle - passed):
            self._add(_Entry(True, cycle, last.kind, may_be), last)

    # the interrupts of each kind of round

    def _run_firsts(self, begins: list[Beginning]) -> None:
        """Execute the first interrupts of rounds without an edge."""
        for end in self.interrupt.run(begins, {TICKS: REPRESENTATIVE}).ends:
            if end.ahead == HALF:
                self._check(end.ticks == REPRESENTATIVE - 1, "a round's first interrupt", end)
                for cycle in self._entry_cycles(HALF, end.cycle):
                    self._add(_Entry(False, cycle, end.last.kind, PLAIN), end.last)
            else:
                in_step = end.ahead == 0 and end.ticks == REPRESENTATIVE - 2
                self._check(in_step, "the interrupt of a whole round", end)
                self._add_next_round(end)

    def _run_seconds(self, begins: list[Beginning]) -> None:
        """Execute the second interrupts of rounds without an edge."""
        for end in self.interrupt.run(begins, {TICKS: REPRESENTATIVE - 1}, ahead=HALF).ends:
            in_step = end.ahead == 0 and end.ticks == REPRESENTATIVE - 2
            self._check(in_step, "a round's second interrupt", end)
            self._add_next_round(end)

    def _run_rises(self, begins: list[Beginning]) -> None:
        """Execute rises. A pulse takes a round at least, so that no rise follows."""
        for end in self._run_edges(begins, 0, None) if begins else ():
            self._check(end.ahead == 0 and end.phase is AFTER_EDGE, "a rise", end)
            self._add_next_round(end, may_be=PLAIN | FALL)

    def _run_falls(self, begins: list[Beginning], fine: int) -> None:
        """Execute falls `fine` cycles later in their round than a rise. No other fall follows."""
        # Only after an early fall can the next rise be in the next round (`layout.LATEST`).
        rests = (1, REPRESENTATIVE) if fine <= LATEST else (REPRESENTATIVE,)
        for rest in rests:
            for end in self._run_edges(begins, rest, fine):
                spans_next = end.phase is SPANS_NEXT_ROUND
                left = rest - 2 if spans_next else rest  # that round's two interrupts are counted
                self._check(end.ahead == 0 and end.ticks == left and end.rest == 0, "a fall", end)
                if spans_next:
                    self._add_next_round(end, 2, PLAIN | RISE)
                else:
                    self._add_next_round(end, 1, RISE if rest == 1 else PLAIN)

    def _run_edges(self, begins: list[Beginning], rest: int, fine: int | None) -> tuple[Ending, ...]:
        """Return the ends of an interrupt with an edge; check that its cycle is the same for every begin."""
        variables = {TICKS: 1, REST: rest}
        if fine is not None:
            variables[FINE] = fine
        ends, edges = self.interrupt.run(begins, variables)
        if self.rise < 0 and fine is None and len(edges) == 1:
            (self.rise,) = edges
        wanted = self.rise + (fine or 0)
        if edges != {wanted}:
            name = "rise" if fine is None else f"fall, {fine} cycles after a rise in its round,"
            cycles = ", ".join(map(str, sorted(edges)))
            raise InterruptChanged(f"a {name} is in cycle {cycles} of its round, not {wanted}")
        code = self.interrupt.code
        port = code.fixed_ports().get(code.ram[PORT if rest else NEXT_PORT]) if PORT in code.ram else None
        for end in ends:
            if end.phase is BEFORE_EDGE or end.port != port:
                raise InterruptChanged(
                    f"a {'fall' if rest else 'rise'} is not on every path, or another port's"
                )
        return ends

    def _check_counts(self) -> None:
        """Check, for every width, in how many interrupts the fall and the next rise are due."""
        rounds = self.layout.rounds
        for whole in range(1, rounds):
            # The low byte is only passed on to `fine` (`lemmas.rise` has all): another one for each number.
            low = 37 * whole % ROUND
            variables = {TICKS: 1, REST: 0, NEXT_HI: whole, NEXT_LO: low}
            for end in self.interrupt.run([Beginning(2)], variables).ends:
                due = 2 * whole - 1, 2 * (rounds - whole) - 1, low
                where = f"after the rise of a pulse of {whole} rounds"
                self._check((end.ticks, end.rest, end.fine) == due, where, end)

    def _check(self, holds: bool, where: str, end: Ending) -> None:
        if not holds:
            raise InterruptChanged(
                f"{where}: it ends with TMR0 {end.ahead} cycles ahead, ticks {end.ticks}, rest {end.rest}"
            )
