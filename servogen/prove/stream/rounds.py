"""What the stream's interrupt guarantees for every line and every compiler, from its words in a program.

In: the listing of a program, whatever compiled the C, and the stream's numbers. Out: `Guarantee`, or
`InterruptChanged` with the first thing that does not hold. docs/firmware.md states the theorem.

An interrupt begins in every cycle in which it can: the C's instructions of two cycles delay it, and so do its
writes to the EEPROM. The states in which interrupts begin are collected until no new one comes:

    round without an edge   first half ──▶ second half ──▶ next round
    rise                    whole round ──▶ next round
    fall, `fine` 0 to 255   whole round, or this one and the next ──▶ next round, perhaps late
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from enum import Flag, auto

import numpy as np

from servogen.engines.stream.layout import LATEST, RoundLayout
from servogen.engines.stream.protocol import BITS
from servogen.engines.stream.response import FINE, HALF, LATENCY, MANY, REST, ROUND, TICKS
from servogen.engines.stream.settings import MASKED, SAMPLE_AFTER, STOP_AFTER, UNIT
from servogen.engines.stream.streaming import Streaming
from servogen.pic.known_values import Known
from servogen.pic.listing import Listing
from servogen.prove.stream.interrupt import (
    NEXT_HI,
    NEXT_LO,
    NO_LOOK,
    Beginning,
    Ending,
    Interrupt,
    LastLook,
    interrupt_of,
)
from servogen.prove.stream.looks import NONE, InterruptChanged, Kind

Tell = Callable[[str, int, int], None]


class May(Flag):
    """What a round may be: without an edge, or with one."""

    PLAIN = auto()
    RISE = auto()
    FALL = auto()


PLAIN, RISE, FALL = May
ANY = PLAIN | RISE | FALL
MAYS = (ANY, PLAIN | RISE, PLAIN | FALL, PLAIN, RISE)
"""What is known of a round, after the one before it."""

_Entry = tuple[int, Kind, May]
"""The cycle of the round in which an interrupt begins, the kind of the last look, what the round may be."""
_Entries = dict[_Entry, LastLook]
"""With the earliest look of that kind: the one from which the gap to the next is largest."""


@dataclass(frozen=True, slots=True)
class Guarantee:
    """For every line, and every C that keeps the interrupt's variables to itself."""

    rise: int
    """The cycle of its round in which a pulse begins."""
    starts: frozenset[tuple[int, int, int]]
    """Looks for a start bit: the time stamp's cycle of its round, cycles since the sample, and from the
    sample before to this one.
    """
    waits: frozenset[tuple[int, int]]
    """Pairs of time stamps within a byte: the former's cycle of its round, and the cycles between them."""
    states: int
    """The states in which an interrupt begins."""

    @property
    def start_gap(self) -> int:
        """Return the maximum cycles between two samples of the line while a start bit is looked for."""
        return max(gap for _, _, gap in self.starts)

    @property
    def bit_gap(self) -> int:
        """Return the maximum cycles between two time stamps within a byte."""
        return max(wait for _, wait in self.waits)

    def latest_sample(self, k: int, first_units: int, bit_units: int) -> int:
        """Return the maximum cycles from the beginning of a byte to the sample of bit k (0: the start bit).

        A start's time stamp fixes the cycle of its round in which each bit is due. Only those pairs of time
        stamps count between which that cycle is.
        """
        after = STOP_AFTER if k == BITS - 1 else SAMPLE_AFTER[1]
        before, wait = np.array(sorted(self.waits), dtype=np.int64).T
        latest = 0
        for stamp, since, gap in self.starts:
            due = UNIT * (stamp // UNIT + first_units + 1 + k * bit_units)
            # The bit is taken by the first look whose time stamp is at `due` or later: within a wait in which
            # `due` falls, that is the look at its end.
            passed = (due - before - 1) % ROUND
            later = (wait - 1 - passed)[passed < wait]
            latest = max(latest, gap + since + due - stamp + int(later.max(initial=0)) + after)
        return latest

    def earliest_sample(self, k: int, first_units: int, bit_units: int) -> int:
        """Return the minimum cycles from the beginning of a byte to the sample of bit k."""
        due = UNIT * (first_units + 1 + k * bit_units)
        return SAMPLE_AFTER[0] + min(
            since + due + UNIT * (stamp // UNIT) - stamp for stamp, since, _ in self.starts
        )


def guarantee(
    listing: Listing,
    streamed: Streaming,
    fines: Iterable[int] = range(ROUND),
    tell: Tell = lambda task, count, of: None,
) -> Guarantee:
    """Return what the interrupt of a program guarantees. Raises InterruptChanged.

    `fines`: the cycles of its round in which a fall is followed: all of them, unless a test has less time.
    """
    layout = streamed.layout
    interrupt = interrupt_of(listing, streamed)
    masked = 0 if streamed.coarse else MASKED
    exact = _Closure(interrupt, layout, tuple(fines), masked, tell, "edges")
    exact.close()
    # Only a trim's write to the EEPROM masks interrupts, and senders leave the line alone while it begins.
    looking = replace(interrupt, gaps=True, edges=set())
    _Closure(looking, layout, tuple(fines), 0, tell, "samples").close()
    starts, waits = frozenset(looking.starts), frozenset(looking.waits)
    return Guarantee(exact.rise, starts, waits, len(exact.firsts) + len(exact.seconds))


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
    firsts: _Entries = field(default_factory=dict)
    """Interrupts with which a round begins."""
    seconds: _Entries = field(default_factory=dict)
    """Interrupts in the middle of a round."""
    _waiting: list[tuple[bool, _Entry]] = field(default_factory=list)
    _new: list[tuple[_Entry, LastLook]] = field(default_factory=list)
    """Interrupts with which a round begins, and that have not been continued with falls yet."""

    def close(self) -> None:
        """Execute every interrupt from every state in which it can begin. Raises InterruptChanged."""
        try:
            self._check_counts()
            for begin in self._begins(0, 0):
                self._add(True, begin, NO_LOOK, ANY)
            while self._waiting:
                self._run_plain()
                begins = [Beginning(begin, last) for (begin, _, may), last in self._new if FALL in may]
                self._new.clear()
                for number, fine in enumerate(self.fines if begins else ()):
                    self.tell(self.what, number, len(self.fines))
                    self._run_falls(begins, fine)
        except LookupError as error:
            raise InterruptChanged(str(error)) from None

    def _run_plain(self) -> None:
        """Execute all but the falls, until nothing new comes."""
        while self._waiting:
            waiting, self._waiting = self._waiting, []
            firsts = [(entry, self.firsts[entry]) for first, entry in waiting if first]
            self._new += firsts
            self._run_rises([Beginning(begin, last) for (begin, _, may), last in firsts if RISE in may])
            self._run_firsts([Beginning(begin, last) for (begin, _, may), last in firsts if PLAIN in may])
            self._run_seconds(
                [Beginning(entry[0], self.seconds[entry]) for first, entry in waiting if not first]
            )

    def _begins(self, overflow: int, end: int) -> range:
        """Return the cycles in which the interrupt of an overflow can begin, if the one before ended at
        `end`.
        """
        if self.interrupt.gaps and end < overflow:
            # It is the same for instructions of one and of two cycles (DS35007 section 6.8): 2, or one more.
            return range(overflow + 2, overflow + 4)
        latest = LATENCY if self.interrupt.gaps else LATENCY + 2 + self.masked
        return range(max(overflow + 2, end), max(overflow, end) + latest + 1)

    def _add(self, first: bool, begin: int, last: LastLook, may: May) -> None:
        entries = self.firsts if first else self.seconds
        if not self.interrupt.gaps:
            last = last._replace(sample=last.stamp)  # only when a bit was taken is of interest
        # An entry with an earlier look, in a round that may be all that this one may be, stands for it.
        for wider in MAYS:
            if may in wider:
                before = entries.get((begin, last.kind, wider))
                unlimited = not self.interrupt.gaps and (begin, NO_LOOK.kind, wider) in entries
                if unlimited or (before is not None and before[1:] <= last[1:]):
                    return
        entry = (begin, last.kind, may)
        entries[entry] = last
        if (first, entry) not in self._waiting:
            self._waiting.append((first, entry))

    def _add_next_round(self, end: Ending, rounds: int, may: May = ANY) -> None:
        """Add the first interrupts of the round after `rounds` rounds."""
        kind, sample, stamp = end.last
        moved = (
            LastLook(kind, sample - rounds * ROUND, stamp - rounds * ROUND) if kind is not NONE else NO_LOOK
        )
        for begin in self._begins(0, end.cycle - rounds * ROUND):
            self._add(True, begin, moved, may)

    def _run_firsts(self, begins: list[Beginning]) -> None:
        """Execute the first interrupts of rounds without an edge."""
        for end in self.interrupt.run(begins, {self.interrupt.code.ram[TICKS]: MANY}):
            if end.ahead == HALF:
                self._check(end.ticks == MANY - 1, "a round's first interrupt", end)
                for following in self._begins(HALF, end.cycle):
                    self._add(False, following, end.last, PLAIN)
            else:
                self._check(end.ahead == 0 and end.ticks == MANY - 2, "the interrupt of a whole round", end)
                self._add_next_round(end, 1)

    def _run_seconds(self, begins: list[Beginning]) -> None:
        """Execute the second interrupts of rounds without an edge."""
        for end in self.interrupt.run(begins, {self.interrupt.code.ram[TICKS]: MANY - 1}, ahead=HALF):
            self._check(end.ahead == 0 and end.ticks == MANY - 2, "a round's second interrupt", end)
            self._add_next_round(end, 1)

    def _run_rises(self, begins: list[Beginning]) -> None:
        """Execute rises: the edge is in the same cycle for every begin."""
        for end in self._run_edges(begins, 0, None) if begins else ():
            self._check(end.ahead == 0 and not end.cleared, "a rise", end)
            self._add_next_round(end, 1, PLAIN | FALL)

    def _run_falls(self, begins: list[Beginning], fine: int) -> None:
        # Only after an early fall can the next rise be in the next round (`layout.LATEST`).
        rests = (1, MANY) if fine <= LATEST else (MANY,)
        for rest in rests:
            for end in self._run_edges(begins, rest, fine):
                whole = 2 * end.cleared
                self._check(end.ahead == 0 and end.ticks == rest - whole and end.rest == 0, "a fall", end)
                # With so little left, the next rise is in the next round; else it is later.
                may = PLAIN | RISE if end.cleared else RISE if rest == 1 else PLAIN
                self._add_next_round(end, 2 if end.cleared else 1, may)

    def _run_edges(self, begins: list[Beginning], rest: int, fine: int | None) -> list[Ending]:
        """Return the ends of an interrupt with an edge; check its cycle."""
        ram = self.interrupt.code.ram
        known: Known = {ram[TICKS]: 1, ram[REST]: rest}
        if fine is not None:
            known[ram[FINE]] = fine
        self.interrupt.edges.clear()
        ends = list(self.interrupt.run(begins, known))
        wanted = {self.rise + (fine or 0)}
        if self.rise < 0 and fine is None and len(self.interrupt.edges) == 1:
            (self.rise,) = wanted = set(self.interrupt.edges)
        if self.interrupt.edges != wanted:
            name = "rise" if fine is None else f"fall, {fine} cycles after a rise in its round,"
            cycles = ", ".join(map(str, sorted(self.interrupt.edges)))
            raise InterruptChanged(f"a {name} is in cycle {cycles} of its round, not {min(wanted)}")
        return ends

    def _check_counts(self) -> None:
        """Check, for every width, in how many interrupts the fall and the next rise are due."""
        ram, rounds = self.interrupt.code.ram, self.layout.rounds
        for whole in range(1, rounds):
            # The low byte is only passed on to `fine`: some other value for each number of rounds.
            low = 37 * whole % ROUND
            known = {ram[TICKS]: 1, ram[REST]: 0, ram[NEXT_HI]: whole, ram[NEXT_LO]: low}
            for end in self.interrupt.run([Beginning(2)], known):
                due = 2 * whole - 1, 2 * (rounds - whole) - 1, low
                self._check(
                    (end.ticks, end.rest, end.fine) == due,
                    f"after the rise of a pulse of {whole} rounds",
                    end,
                )

    def _check(self, holds: bool, where: str, end: Ending) -> None:
        if not holds:
            raise InterruptChanged(
                f"{where}: it ends with TMR0 {end.ahead} cycles ahead, ticks {end.ticks}, rest {end.rest}"
            )
