"""What the stream's interrupt guarantees for every line and every compiler, from its words in a program.

In: the listing of a program, whatever compiled the C, and the stream's numbers. Out: `Guarantee`, or
`InterruptChanged` with the first thing that does not hold. docs/firmware.md states the theorem.

The interrupt's code is executed abstractly: the time, `ticks`, `rest` and `fine` are known; every test of the
line, of what was received and of what the C left goes both ways. An interrupt begins in every cycle in which
it can: the C's instructions of two cycles delay it, and so do its writes to the EEPROM. The states in which
interrupts begin are collected until no new one comes:

    round without an edge   first half ──▶ second half ──▶ next round
    rise                    whole round ──▶ next round
    fall, `fine` 0 to 255   whole round, or this one and the next ──▶ next round, perhaps late
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from servogen.engines.stream.layout import LATEST, RoundLayout
from servogen.engines.stream.protocol import BITS
from servogen.engines.stream.response import (
    AHEAD,
    CLEARED,
    FOLLOWED,
    HALF,
    INTCON,
    LATENCY,
    MANY,
    PORT_NAMES,
    PORTS,
    ROUND,
    TMR0,
    WRITTEN,
    Round,
)
from servogen.engines.stream.settings import MASKED, SAMPLE_AFTER, STOP_AFTER, UNIT
from servogen.engines.stream.streaming import Streaming
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

OF_TIME = ("ticks", "rest", "fine", "t", "due", "mask", "port")
"""The interrupt's variables that looks at the line leave alone, but for `t`, whose value nothing keeps."""
OF_RECEIVER = ("t", "rx_bits", "rx_left", "rx_last", "rx_byte", "command", "todo", "value")
"""Its variables that nothing but looks at the line writes."""
OF_COUNTS = frozenset(
    [("DECFSZ", 1), ("DECF", 1), ("DECF", 0), ("SUBWF", 1), ("MOVF", 1), ("BTFSS", 0), ("BTFSC", 0)]
)
"""The instructions whose outcome is the same for every count that is odd and more than 1, or one less: they
count, test for zero, or test the lowest bit. With the destination, or the bit that is tested.
"""
T0IF, FSR_ADDRESS = 2, 4
MAX_STATES = 200_000
MAX_ROUNDS = 2
MAX_TIMES = MAX_ROUNDS * ROUND + HALF

HUNT, START, WAIT, BIT, SENT = "hunt", "start", "wait", "bit", "sent"
"""A look: for a start bit, none there; a start bit seen; a bit is not due yet; a bit is taken; an
answer's first bit is sent.
"""


Tell = Callable[[str, int, int], None]


class InterruptChanged(Exception):
    """Raised if the words are not those of an interrupt whose edges are exact; says what does not hold."""


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


@dataclass(frozen=True, slots=True)
class _Look:
    """An outcome of a look at the line; times in cycles from the subroutine's first word."""

    kind: str
    cycles: int
    sample: int
    stamp: int


_Last = tuple[str, int, int]
"""The kind of the last look, its sample's cycle and its time stamp's."""
_State = tuple[int, tuple[int, ...], int, frozenset[tuple[int, int]], _Last, int]
"""Address, return addresses, cycle of the round, known values, last look, the last bit's time stamp."""
_Going = tuple[int, tuple[int, ...], int, Known, _Last, int]
"""The same with the known values as they are used."""
_Entry = tuple[int, str, str]
"""The cycle of the round in which an interrupt begins, the kind of the last look, what the round may be."""
_Entries = dict[_Entry, _Last]
"""With the earliest look of that kind: the one from which the gap to the next is largest."""
NO_LOOK: _Last = ("", 0, 0)
PLAIN, RISE, FALL = "p", "r", "f"
"""What a round may be: without an edge, or with one."""
ANY = PLAIN + RISE + FALL
MAYS = (ANY, PLAIN + RISE, PLAIN + FALL, PLAIN, RISE)
LONG_AGO = -10 * ROUND
BYTE = 10
"""What `rx_bits` is when a start bit was seen: not 0."""


@dataclass(frozen=True, slots=True)
class _End:
    """How an interrupt can end."""

    cycle: int
    ahead: int
    cleared: bool
    ticks: int | None
    rest: int | None
    fine: int | None
    last: _Last


@dataclass(slots=True)
class _Seen:
    """The states that have been executed.

    Of two that differ only in when the last look and the last bit were, the earlier one can do all that the
    other can, and the gaps that it ends are larger: it stands for both.
    """

    times: dict[tuple[object, ...], list[tuple[int, int, int]]] = field(default_factory=dict)
    """By state without times: sample and time stamp of the last look, time stamp of the last bit."""

    def add(self, state: _State) -> bool:
        """Add a state; return whether none stood for it."""
        address, stack, now, known, (kind, sample, stamp), bit = state
        times = self.times.setdefault((address, stack, now, known, kind), [])
        for other in times:
            if other[0] <= sample and other[1] <= stamp and other[2] <= bit:
                return False
        times.append((sample, stamp, bit))
        return True


@dataclass(slots=True)
class _Interrupt:
    """The interrupt's code, executed; it notes the edges and the gaps that it meets."""

    code: Round
    looks: Mapping[int, tuple[_Look, ...]]
    """The outcomes of each subroutine that looks at the line, by its address."""
    out: tuple[int, int] | None
    """The port and bit on which the chip answers."""
    gaps: bool
    """Whether the gaps between looks are of interest, too."""
    bits_apart: int
    """The minimum number of cycles from one bit taken to the next within an interrupt."""
    first_apart: int
    """The same from a start bit's time stamp to the first bit taken."""
    edges: set[int] = field(default_factory=set)
    starts: set[tuple[int, int, int]] = field(default_factory=set)
    """Looks for a start bit: the time stamp's cycle of its round, cycles since the sample, and from the
    sample before to this one.
    """
    waits: set[tuple[int, int]] = field(default_factory=set)
    """Pairs of time stamps within a byte: the former's cycle of its round, and the cycles between them."""

    def run(self, begins: Iterable[tuple[int, _Last]], known: Known) -> Iterator[_End]:
        """Yield every end of an interrupt that begins in one of these cycles of its round, after these looks;
        the edges are in `edges`.
        """
        code = self.code
        if "port" in code.ram:
            known |= {code.ram[name]: PORTS[1] for name in PORT_NAMES}
        followed = {W, CARRY, ZERO, FSR, AHEAD, CLEARED, WRITTEN, code.ram["rx_bits"], *known}
        followed |= {code.ram[name] for name in FOLLOWED}
        frozen = frozenset(known.items())
        rest = known.get(code.ram["rest"])
        waiting: list[_State] = []
        seen = _Seen()
        for begin, last in begins:
            bit = last[2] if last[0] == BIT else LONG_AGO
            first: _State = (INTERRUPT_VECTOR, (), begin, frozen, last if self.gaps else NO_LOOK, bit)
            if seen.add(first):
                waiting.append(first)
        ends: dict[_End, None] = {}  # in order, so that every run of the search finds the same
        going: _Going | None = None
        while waiting or going:
            if going:
                address, stack, now, known, last, bit = going
                going = None
            else:
                address, stack, now, frozen, last, bit = waiting.pop()
                known = dict(frozen)
            if now > MAX_TIMES or len(seen.times) > MAX_STATES:
                raise InterruptChanged(f"the interrupt does not end within {MAX_TIMES} cycles")
            try:
                word = word_of(code.words[address])
            except (KeyError, Undefined):
                raise InterruptChanged(f"the interrupt leaves its words at 0x{address:03X}") from None
            if word.name == "RETFIE":
                if not self.gaps:
                    last = (BIT, bit, bit) if now + 2 - bit < self.bits_apart else NO_LOOK
                ends[self._end(now + 2, known, last)] = None
                continue
            self._check_word(address, word, now, known, rest)
            following = self._following(word, rest, (address, stack, now, known, last, bit))
            if len(following) == 1 and word.flow != "jump":
                (going,) = following  # states are compared where paths part, and where they can meet again
                continue
            for target, more, then, after, looked, taken in following:
                remembered = frozenset(item for item in after.items() if item[0] in followed)
                if then - taken >= self.bits_apart:
                    taken = LONG_AGO
                state = (target, more, then, remembered, looked, taken)
                if seen.add(state):
                    waiting.append(state)
        yield from ends

    def _check_word(self, address: int, word: DecodedWord, now: int, known: Known, rest: int | None) -> None:
        """Check what a word writes at this time, and that it does the same for each count that is meant."""
        if address == self.code.edge:
            self._check_edge(word, known)
            self.edges.add(now)
            known[CLEARED] = 0
        elif word.writes_f and word.f == INTCON:
            self._check_flag(now, known)
        elif word.writes_f and word.f == self.code.ram["due"] and rest != 0:
            raise InterruptChanged(f"the word at 0x{address:03X} asks the C for a pulse beside a rise")
        if self._stands_for_all(word, known, rest) and not self._same_for_all(address, word):
            raise InterruptChanged(f"the word at 0x{address:03X} depends on how many interrupts are left")

    def _following(self, word: DecodedWord, rest: int | None, one: _Going) -> list[_Going]:
        """Return what can follow a word."""
        address, stack, now, known, last, bit = one
        if word.flow == "call" and word.k in self.looks:
            return list(self._looked(self.looks[word.k], one))
        following: list[_Going] = []
        one_of_all = (word.name == "DECF" and self._stands_for_all(word, known, rest)) or (
            rest == MANY and self._takes_count(address)
        )
        for target, more, cycles, after in self.code.steps(address, stack, now, word, known):
            if one_of_all:
                after.pop(W, None)
            following.append((target, more, now + cycles, after, last, bit))
        return following

    def _looked(self, looks: Iterable[_Look], one: _Going) -> Iterator[_Going]:
        """Yield what can follow a call of a look at the line."""
        address, stack, now, known, last, bit = one
        receiving, called = self.code.ram["rx_bits"], now + 2
        for place in (W, CARRY, ZERO, self.code.ram["t"]):
            known.pop(place, None)
        for look in looks:
            if look.kind == BIT and called + look.stamp - bit < self.bits_apart:
                continue  # the time that is left of a bit is longer
            if (known.get(receiving, 1) == 0) != (look.kind in (HUNT, START)) and receiving in known:
                continue  # rx_bits is 0 while no byte is being received
            if self.gaps and not self._may_follow(last, look, called + look.stamp):
                continue
            after = {place: value for place, value in known.items() if place != receiving}
            if look.kind in (HUNT, START):
                after[receiving] = 0 if look.kind == HUNT else BYTE
            taken = called + look.stamp if look.kind == BIT else bit
            seen_at = NO_LOOK
            if self.gaps:
                kind = SENT if (last[0], look.kind) == (HUNT, BIT) else look.kind
                seen_at = (kind, called + look.sample, called + look.stamp)
                self._note_gap(last, seen_at)
            yield address + 1, stack, called + look.cycles, after, seen_at, taken

    def _stands_for_all(self, word: DecodedWord, known: Known, rest: int | None) -> bool:
        """Return whether a word reads a count that stands for all that are larger than the last one.

        That is `ticks` in a round without an edge, in which `rest` is not known, or after a fall behind which
        there are many interrupts, which `rest` holds before.
        """
        if not word.has_f or word.name in ("MOVWF", "CLRF"):
            return False
        if word.f == self.code.ram["ticks"]:
            return rest is None or (rest == MANY and CLEARED in known)
        return rest == MANY and word.f == self.code.ram["rest"]

    def _same_for_all(self, address: int, word: DecodedWord) -> bool:
        """Return whether a word does the same for each of these counts."""
        if word.name == "MOVF" and not word.writes_f:
            return self._takes_count(address + 1)
        return (word.name, word.b if word.tests_bit else int(word.writes_f)) in OF_COUNTS

    def _takes_count(self, address: int) -> bool:
        """Return whether a word moves `rest` from W to `ticks`, after a fall."""
        moves = encode("MOVF", f=self.code.ram["rest"], d=0), encode("MOVWF", f=self.code.ram["ticks"])
        return (self.code.words.get(address - 1), self.code.words.get(address)) == moves

    def _end(self, now: int, known: Known, last: _Last) -> _End:
        ram = self.code.ram
        ahead, cleared = known[AHEAD], bool(known.get(CLEARED, 0))
        return _End(
            now, ahead, cleared, known.get(ram["ticks"]), known.get(ram["rest"]), known.get(ram["fine"]), last
        )

    def _check_edge(self, word: DecodedWord, known: Known) -> None:
        """Check what the instruction of an edge writes: 0, or `mask` where a pulse begins, to a port."""
        if word.f not in PORTS and (word.f != INDF or known.get(FSR) not in PORTS):
            raise InterruptChanged("an edge is not written to a port")
        rest, value = known.get(self.code.ram["rest"]), known.get(W)
        if rest is None or (rest and value != 0):
            raise InterruptChanged("a fall does not clear the port")
        mask = encode("MOVF", f=self.code.ram["mask"], d=0)
        if not rest and (value is not None or self.code.words[self.code.edge - 1] != mask):
            raise InterruptChanged("a rise does not write the pin that the C prepared")

    def _check_flag(self, now: int, known: Known) -> None:
        """Check that the flag that is cleared is that of one overflow: the one that began the interrupt, or
        after an edge that of the next round.
        """
        if WRITTEN in known or now // ROUND != int(CLEARED in known):
            raise InterruptChanged(f"T0IF is cleared in cycle {now} of a round")

    def _may_follow(self, last: _Last, look: _Look, stamp: int) -> bool:
        """Return whether a look can be the next one after `last`."""
        if last[0] == START:
            return look.kind == WAIT or (look.kind == BIT and stamp - last[2] >= self.first_apart)
        if look.kind in (HUNT, START):
            return last[0] != SENT
        return last[0] != HUNT or self.out is not None

    def _note_gap(self, last: _Last, look: _Last) -> None:
        kinds = last[0], look[0]
        if kinds[0] in (HUNT, BIT) and kinds[1] == START:
            gap = look[1] - last[1]
            self.starts.add((look[2] % ROUND, look[2] - look[1], gap))
        elif kinds[0] in (START, WAIT, BIT) and kinds[1] in (WAIT, BIT):
            self.waits.add((last[2] % ROUND, look[2] - last[2]))


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
    exact = _Closure(_interrupt(listing, streamed, gaps=False), layout, tuple(fines), MASKED, tell, "edges")
    exact.close()
    # Only a trim's write to the EEPROM masks interrupts, and senders leave the line alone while it begins.
    gaps = _Closure(_interrupt(listing, streamed, gaps=True), layout, tuple(fines), 0, tell, "samples")
    gaps.close()
    starts, waits = frozenset(gaps.one.starts), frozenset(gaps.one.waits)
    return Guarantee(exact.rise, starts, waits, len(exact.firsts) + len(exact.seconds))


@dataclass(slots=True)
class _Closure:
    """The states in which interrupts begin, until no new one comes."""

    one: _Interrupt
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
    _new: list[tuple[_Entry, _Last]] = field(default_factory=list)
    """Interrupts with which a round begins, and that have not been continued with falls yet."""

    def close(self) -> None:
        """Execute every interrupt from every state in which it can begin. Raises InterruptChanged."""
        try:
            self._check_counts()
            for begin in self._begins(0, 0):
                self._add(True, begin, NO_LOOK, ANY)
            while self._waiting:
                self._run_plain()
                begins = [(begin, last) for (begin, _, may), last in self._new if FALL in may]
                self._new.clear()
                for number, fine in enumerate(self.fines if begins else ()):
                    self.tell(self.what, number, len(self.fines))
                    self._fall(begins, fine)
        except LookupError as error:
            raise InterruptChanged(str(error)) from None

    def _run_plain(self) -> None:
        """Execute all but the falls, until nothing new comes."""
        while self._waiting:
            waiting, self._waiting = self._waiting, []
            firsts = [(entry, self.firsts[entry]) for first, entry in waiting if first]
            seconds = [(entry[0], self.seconds[entry]) for first, entry in waiting if not first]
            self._new += firsts
            self._rise([(begin, last) for (begin, _, may), last in firsts if RISE in may])
            self._first([(begin, last) for (begin, _, may), last in firsts if PLAIN in may])
            self._second(seconds)

    def _begins(self, overflow: int, end: int) -> range:
        """Return the cycles in which the interrupt of an overflow can begin, if the one before ended at
        `end`.
        """
        if self.one.gaps and end < overflow:
            return range(overflow + 2, overflow + 4)  # three cycles, less or more one (DS35007 section 6.8)
        latest = LATENCY if self.one.gaps else LATENCY + 2 + self.masked
        return range(max(overflow + 2, end), max(overflow, end) + latest + 1)

    def _add(self, first: bool, begin: int, last: _Last, may: str) -> None:
        entries = self.firsts if first else self.seconds
        if not self.one.gaps:
            last = (last[0], last[2], last[2])  # only when a bit was taken is of interest
        # An entry with an earlier look, in a round that may be all that this one may be, stands for it.
        for other in MAYS:
            if set(may) <= set(other):
                before = entries.get((begin, last[0], other))
                unlimited = not self.one.gaps and (begin, NO_LOOK[0], other) in entries
                if unlimited or (before is not None and before[1:] <= last[1:]):
                    return
        entry = (begin, last[0], may)
        entries[entry] = last
        if (first, entry) not in self._waiting:
            self._waiting.append((first, entry))

    def _next(self, end: _End, rounds: int, may: str = ANY) -> None:
        """Add the first interrupts of the round after `rounds` rounds."""
        kind, sample, stamp = end.last
        moved = (kind, sample - rounds * ROUND, stamp - rounds * ROUND)
        for begin in self._begins(0, end.cycle - rounds * ROUND):
            self._add(True, begin, moved if kind else NO_LOOK, may)

    def _first(self, begins: list[tuple[int, _Last]]) -> None:
        """Execute the first interrupts of rounds without an edge."""
        for end in self.one.run(begins, {self.one.code.ram["ticks"]: MANY, AHEAD: 0}):
            if end.ahead == HALF:
                self._check(end.ticks == MANY - 1, "a round's first interrupt", end)
                for following in self._begins(HALF, end.cycle):
                    self._add(False, following, end.last, PLAIN)
            else:
                self._check(end.ahead == 0 and end.ticks == MANY - 2, "the interrupt of a whole round", end)
                self._next(end, 1)

    def _second(self, begins: list[tuple[int, _Last]]) -> None:
        """Execute the second interrupts of rounds without an edge."""
        for end in self.one.run(begins, {self.one.code.ram["ticks"]: MANY - 1, AHEAD: HALF}):
            self._check(end.ahead == 0 and end.ticks == MANY - 2, "a round's second interrupt", end)
            self._next(end, 1)

    def _rise(self, begins: list[tuple[int, _Last]]) -> None:
        """Execute rises: the edge is in the same cycle for every begin."""
        for end in self._edge(begins, 0, None) if begins else ():
            self._check(end.ahead == 0 and not end.cleared, "a rise", end)
            self._next(end, 1, PLAIN + FALL)

    def _fall(self, begins: list[tuple[int, _Last]], fine: int) -> None:
        # Only after an early fall can the next rise be in the next round (`layout.LATEST`).
        rests = (1, MANY) if fine <= LATEST else (MANY,)
        for rest in rests:
            for end in self._edge(begins, rest, fine):
                whole = 2 * end.cleared
                self._check(end.ahead == 0 and end.ticks == rest - whole and end.rest == 0, "a fall", end)
                # With so little left, the next rise is in the next round; else it is later.
                may = PLAIN + RISE if end.cleared else RISE if rest == 1 else PLAIN
                self._next(end, 2 if end.cleared else 1, may)

    def _edge(self, begins: list[tuple[int, _Last]], rest: int, fine: int | None) -> list[_End]:
        """Return the ends of an interrupt with an edge; check its cycle."""
        ram = self.one.code.ram
        known: Known = {ram["ticks"]: 1, ram["rest"]: rest, AHEAD: 0}
        if fine is not None:
            known[ram["fine"]] = fine
        self.one.edges.clear()
        ends = list(self.one.run(begins, known))
        wanted = {self.rise + (fine or 0)}
        if self.rise < 0 and fine is None and len(self.one.edges) == 1:
            (self.rise,) = wanted = set(self.one.edges)
        if self.one.edges != wanted:
            name = "rise" if fine is None else f"fall, {fine} cycles after a rise in its round,"
            cycles = ", ".join(map(str, sorted(self.one.edges)))
            raise InterruptChanged(f"a {name} is in cycle {cycles} of its round, not {min(wanted)}")
        return ends

    def _check_counts(self) -> None:
        """Check, for every width, in how many interrupts the fall and the next rise are due."""
        ram, rounds = self.one.code.ram, self.layout.rounds
        for whole in range(1, rounds):
            # The low byte is only passed on to `fine`: some other value for each number of rounds.
            low = 37 * whole % ROUND
            known: Known = {ram["ticks"]: 1, ram["rest"]: 0, AHEAD: 0}
            known |= {ram["next_hi"]: whole, ram["next_lo"]: low}
            for end in self.one.run([(2, NO_LOOK)], known):
                due = 2 * whole - 1, 2 * (rounds - whole) - 1, low
                self._check(
                    (end.ticks, end.rest, end.fine) == due,
                    f"after the rise of a pulse of {whole} rounds",
                    end,
                )

    def _check(self, holds: bool, where: str, end: _End) -> None:
        if not holds:
            raise InterruptChanged(
                f"{where}: it ends with TMR0 {end.ahead} cycles ahead, ticks {end.ticks}, rest {end.rest}"
            )


def _interrupt(listing: Listing, streamed: Streaming, *, gaps: bool) -> _Interrupt:
    """Return the interrupt of a program. Raises InterruptChanged if its parts are not there."""
    words = {row.address: row.word for row in listing.rows}
    bit_units, first_units = streamed.bit_units, streamed.first_units
    names = (*OF_TIME, *OF_RECEIVER, *PORT_NAMES, "next_hi", "next_lo")
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
    ran = {address: words[address] for address in sorted(TimedProgram(words, ()).reached(INTERRUPT_VECTOR))}
    code = Round(ran, ram, subroutines[0], edge, MASKED)
    hunt = subroutines[2]
    pin = streamed.stream.transmit_pin
    out = None if pin is None else (registers()[f"PORT{pin[1]}"].address, int(pin[2]))
    program = TimedProgram(ran, ())
    looking = frozenset[int]().union(*map(program.reached, subroutines))
    _check_writes(ran, ram, listing, looking, edge)
    _check_looks(ran, ram, looking, out)
    _check_receiver(words, ram, subroutines[1], hunt, bit_units, first_units)
    looks = {address: _looks(code, address, hunt) for address in subroutines}
    _check_samples(code, subroutines[1])
    # Time stamps count modulo 64 units, so a bit is taken at most 64 units after it is due, and the next one
    # no earlier than that much less than a bit after it.
    bits_apart = UNIT * (bit_units - ROUND // UNIT)
    first_apart = UNIT * first_units + 1
    return _Interrupt(code, looks, out, gaps, bits_apart, first_apart)


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
            ram["due"]: word.name == "BSF",
            ram["mask"]: _is_unprepared(ran, address, ram),
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
        encode("BTFSS", f=ram["due"], b=1),
        encode("CLRF", f=ram["mask"]),
        encode("BSF", f=ram["due"], b=0),
    )


def _check_receiver(
    words: Mapping[int, int], ram: Mapping[str, int], take: int, hunt: int, bit_units: int, first_units: int
) -> None:
    """Check the words that keep the receiver's time: what is known of a bit's time rests on them."""
    t, left, last, bits = ram["t"], ram["rx_left"], ram["rx_last"], ram["rx_bits"]
    time = (
        encode("MOVF", f=TMR0, d=0),
        encode("BTFSS", f=ram["ticks"], b=0),
        encode("ADDLW", k=HALF),
        encode("MOVWF", f=t),
        encode("RRF", f=t, d=1),
    )
    fixed_words = (
        (take, (*time, encode("RRF", f=t, d=1), encode("BTFSC", f=bits, b=7))),
        (
            take + 8,
            (
                encode("MOVF", f=last, d=0),
                encode("SUBWF", f=t, d=0),
                encode("ANDLW", k=0x3F),
                encode("SUBWF", f=left, d=1),
                encode("MOVF", f=t, d=0),
                encode("MOVWF", f=last),
                encode("BTFSC", f=STATUS, b=0),
                encode("RETURN"),
                encode("MOVLW", k=bit_units),
                encode("ADDWF", f=left, d=1),
            ),
        ),
        (
            hunt + 1,
            (
                encode("RETURN"),
                *time,
                encode("RRF", f=t, d=0),
                encode("MOVWF", f=last),
                encode("MOVLW", k=first_units),
                encode("MOVWF", f=left),
                encode("MOVLW", k=BYTE),
                encode("MOVWF", f=bits),
                encode("RETURN"),
            ),
        ),
    )
    for begin, wanted in fixed_words:
        for address, word in enumerate(wanted, begin):
            if words.get(address) != word:
                raise InterruptChanged(f"the receiver's clock is not kept by the word at 0x{address:03X}")
    sample = word_of(words[hunt])
    if sample.name != "BTFSC" or sample.f not in PORTS:
        raise InterruptChanged("a start bit is not looked for at a pin")


def _check_samples(code: Round, take: int) -> None:
    """Check how long after its time stamp a bit is sampled; rx_bits is 1 before the stop bit."""
    bits = code.ram["rx_bits"]
    for before, limits in ((1, (SAMPLE_AFTER[0], STOP_AFTER)), (None, SAMPLE_AFTER)):
        begin: Known = {} if before is None else {bits: before}
        waiting: list[tuple[int, tuple[int, ...], int, int, bool, Known]] = [(take, (), 0, 0, False, begin)]
        seen = set()
        while waiting:
            address, stack, now, stamp, taken, known = waiting.pop()
            word = word_of(code.words[address])
            stamp = now if word.has_f and word.f == TMR0 else stamp
            taken |= word.writes_f and word.f == code.ram["rx_left"] and word.name == "ADDWF"
            after = now - stamp
            if taken and word.tests_bit and word.f in PORTS and not limits[0] <= after <= limits[1]:
                raise InterruptChanged(
                    f"a bit is sampled {after} cycles after its time stamp, at 0x{address:03X}"
                )
            for target, more, cycles, then in code.steps(address, stack, now, word, dict(known)):
                remembered = {place: value for place, value in then.items() if place in (bits, ZERO)}
                state = (target, more, now + cycles, stamp, taken, tuple(sorted(remembered.items())))
                if target >= 0 and state not in seen:
                    seen.add(state)
                    waiting.append((target, more, now + cycles, stamp, taken, remembered))


def _looks(code: Round, begin: int, hunt: int) -> tuple[_Look, ...]:
    """Return every outcome of a subroutine that looks at the line."""
    outcomes = set()
    waiting: list[tuple[int, tuple[int, ...], int, str, int, int]] = [(begin, (), 0, "", 0, 0)]
    seen = set(waiting)
    while waiting:
        address, stack, now, kind, sample, stamp = waiting.pop()
        if len(seen) > MAX_STATES:
            raise InterruptChanged("a look at the line does not end")
        word = word_of(code.words[address])
        if address == hunt:
            kind, sample = HUNT, now
        elif word.has_f and word.f == TMR0:
            kind, stamp = (START if kind == HUNT else WAIT), now
            sample = sample if kind == START else now + SAMPLE_AFTER[0]
        elif word.writes_f and word.f == code.ram["rx_left"] and word.name == "ADDWF":
            kind = BIT
        for target, more, cycles, _ in code.steps(address, stack, now, word, {}):
            if target < 0:
                outcomes.add(_Look(kind, now + cycles, sample, stamp))
            elif (state := (target, more, now + cycles, kind, sample, stamp)) not in seen:
                seen.add(state)
                waiting.append(state)
    return tuple(sorted(outcomes, key=lambda look: (look.kind, look.cycles, look.stamp)))
