"""Times between two points of a program, and between two clearings of the watchdog, over all paths.

In: the words and `Paths`, which say which code runs and what an interrupt may change. Out: `CycleSpan`: the
minimum and the maximum number of cycles, or why there is no bound. Without interrupts these are the times of
`pic.wcet`. With interrupts, the maximum R is the least solution of

    R = C + ((R + A) // T + 2) * I

with C the cycles without interrupts, T the cycles between two overflows of TMR0, and I what one interrupt
takes with its latency: at most one request can be pending at the beginning, R // T + 1 overflows can follow.

Where the interrupt adds n to TMR0, it may come soon after another, but not often: in R cycles, with F
overflows and at most F + 2 additions, TMR0 goes on by R / p + 1 + (F + 2) n at most, with p cycles a count,
and F overflows take at least 256 F - 255. So F <= (R / p + 3 n) / (256 - n) + 1, that is T = (256 - n) p and
A = 3 n p.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property, reduce
from operator import or_

from servogen.graph import reached
from servogen.pic.analysis.paths import Paths, in_memory
from servogen.pic.analysis.state import INTCON, T0IE
from servogen.pic.analysis.values import Value
from servogen.pic.device import (
    ERASED_WORD,
    INTERRUPT_VECTOR,
    PROGRAM_WORDS,
    RAM_FIRST,
    RAM_LAST,
    STACK_LEVELS,
    masks,
)
from servogen.pic.isa import decode
from servogen.pic.known_values import Undefined, word_of
from servogen.pic.listing import ListedFunction
from servogen.pic.wcet import TimedProgram, Unbounded

LATENCY = 4
"""The maximum cycles from a request to the first instruction of the interrupt's code (DS35007 section
6.9).
"""
T0IF_BIT = 2
PSA, T0CS = masks("PSA", "T0CS")
SOURCES = {0x40: "the EEPROM", 0x20: "TMR0", 0x10: "RB0/INT", 0x08: "a change of RB4 to RB7"}
"""The interrupts by their enable bits in INTCON (DS35007 section 2.3.3)."""
MAX_CYCLES = 1 << 40
"""The cycles from which on a time counts as unbounded: two weeks at 4 MHz."""


@dataclass(frozen=True, slots=True)
class CycleSpan:
    """Cycles between two points; None without a bound or a path, for the `reasons` stated."""

    minimum: int | None
    maximum: int | None
    reasons: tuple[str, ...] = ()
    addresses: tuple[int, ...] = ()
    """The words that the reasons are about."""


class ProgramTimes:
    """The times of one program."""

    def __init__(self, words: Mapping[int, int], paths: Paths) -> None:
        self._paths = paths
        self._words = {
            address: in_memory(words.get(address, ERASED_WORD)) for address in sorted(paths.executed)
        }
        changing = {place for place in paths.interrupt_changes if RAM_FIRST <= place <= RAM_LAST}
        self._program = TimedProgram(
            self._words,
            _functions(paths),
            changing=changing if paths.interrupts else (),
            targets=paths.computed,
        )

    def between(self, starts: Collection[int], ends: Collection[int], *, interrupts: bool) -> CycleSpan:
        """Return the times from before any of `starts` to before the first of `ends`, on paths that reach
        one.
        """
        span = self._joined(starts, ends, interrupts=interrupts, must_end=False)
        if interrupts and self._paths.interrupts and self._interrupt_may_end(starts, ends):
            return CycleSpan(None, span.maximum, ("the interrupt may get there first",))
        return span

    def without_ends(self, starts: Iterable[int], ends: Collection[int], *, interrupts: bool) -> CycleSpan:
        """Return the times from any of `starts` to the first of `ends` if every path has to reach one."""
        return self._joined(starts, ends, interrupts=interrupts, must_end=True)

    def _joined(
        self, starts: Iterable[int], ends: Collection[int], *, interrupts: bool, must_end: bool
    ) -> CycleSpan:
        minimum: int | None = None
        maximum: int | None = 0
        reasons: list[str] = []
        addresses: list[int] = []
        for start in starts:
            times = self._program.between(start, ends, must_end=must_end)
            if times.shortest is not None:
                minimum = times.shortest if minimum is None else min(minimum, times.shortest)
            if times.longest is None:
                maximum = None
                reasons += [in_words(loop) for loop in times.unbounded]
                addresses += [address for loop in times.unbounded for address in loop.addresses]
                if not times.unbounded:
                    reasons.append(f"no path from 0x{start:03X} gets there")
                    addresses.append(start)
            elif maximum is not None:
                maximum = max(maximum, times.longest)
        if maximum is not None and interrupts and self._paths.interrupts:
            bound, why = self.with_interrupts(maximum)
            if bound is None:
                return CycleSpan(minimum, None, (why,))
            maximum = bound
        return CycleSpan(minimum, maximum, tuple(dict.fromkeys(reasons)), tuple(dict.fromkeys(addresses)))

    def _interrupt_may_end(self, starts: Collection[int], ends: Collection[int]) -> bool:
        """Return whether an interrupt after one of `starts` may execute one of `ends`."""
        from_reset, by_interrupt = (self._program.reached(start) for start in (0, INTERRUPT_VECTOR))
        return not from_reset.isdisjoint(starts) and not by_interrupt.isdisjoint(ends)

    def with_interrupts(self, cycles: int) -> tuple[int | None, str]:
        """Return the response time of code that takes `cycles` undisturbed, or why it has no bound."""
        paths = self._paths
        others = [text for bit, text in SOURCES.items() if bit != T0IE and paths.interrupt_sources & bit]
        if others:
            return None, f"an interrupt by {' or '.join(others)} can come at any time"
        if paths.nested_interrupts:
            return None, "the interrupt can be interrupted"
        if paths.not_restored:
            return None, "the interrupt does not restore every register that it changes"
        if paths.timer_requests:
            return None, "the program may set T0IF itself"
        if not self.clears_its_flag():
            return None, "the interrupt may return without clearing T0IF"
        period, why = self.overflow_period()
        if period is None:
            return None, why
        ahead = 3 * self._added() * self._prescale()
        times = self._program.between(INTERRUPT_VECTOR, self._interrupt_ends(), must_end=True)
        if times.longest is None:
            return None, f"the interrupt: {', '.join(map(in_words, times.unbounded)) or 'it never returns'}"
        # 2: the RETFIE with which the interrupt's code ends, at which the measured time stops.
        one = times.longest + 2 + LATENCY
        # The least solution is approached from below; the bound only grows, so the first fixed point is the
        # least.
        bound = cycles
        while bound < MAX_CYCLES:
            following = cycles + ((bound + ahead) // period + 2) * one
            if following == bound:
                return bound, ""
            bound = following
        return None, f"an interrupt of {one} cycles every {period} leaves no time"

    def _interrupt_ends(self) -> list[int]:
        """Return the addresses of the RETFIEs."""
        rows = {address: decode(number) for address, number in self._words.items()}
        return [
            address
            for address, row in rows.items()
            if row is not None and row.instruction.mnemonic == "RETFIE"
        ]

    def clears_its_flag(self) -> bool:
        """Return whether T0IF is clear on every path through the interrupt, because the path clears it, or
        has found it clear.
        """
        passed = reached([INTERRUPT_VECTOR], self._with_flag_set)
        try:
            return all(word_of(self._words[each]).flow != "return" for each in passed if each in self._words)
        except Undefined:
            return False

    def _with_flag_set(self, address: int) -> Iterable[int]:
        """Return where an instruction leads, unless it clears T0IF or finds it clear. Raises Undefined."""
        if address not in self._words:
            return ()
        word = word_of(self._words[address])
        of_flag = (word.f, word.b) == (INTCON, T0IF_BIT)
        if word.name == "BCF" and of_flag:
            return ()
        if word.writes_pcl:
            return self._paths.computed.get(address, ())
        after = [word.k] if word.flow in ("jump", "call") else [address + 1]
        if word.flow != "skip":
            return after
        # The other way is taken if the flag is clear.
        if word.name == "BTFSS" and of_flag:
            return [address + 2]
        return after if word.name == "BTFSC" and of_flag else [*after, address + 2]

    def overflow_period(self) -> tuple[int | None, str]:
        """Return the number of cycles between two overflows of TMR0, the minimum or, if the interrupt adds to
        it, on average; or why it is not known.
        """
        options = self._timer_options()
        if options is None or any(member & T0CS for member in options):
            return None, "TMR0 counts pulses of RA4"
        writes, adds = self._writes(self._paths.timer_writes), self._writes(self._paths.timer_adds)
        if any(value.members is None for value in (*writes.values(), *adds.values())):
            return None, "what the program writes to TMR0 is not known"
        if adds and writes:
            return None, "the program adds to TMR0, and also writes it, while its interrupt may come"
        from_reset, by_interrupt = (self._program.reached(start) for start in (0, INTERRUPT_VECTOR))
        if not adds.keys() <= by_interrupt - from_reset:
            return None, "the program adds to TMR0 outside its interrupt"
        if any(address in self._program.following([address + 1]) for address in adds):
            return None, "the interrupt may add to TMR0 more than once"
        # TMR0 counts up: the largest value that is written to it overflows first.
        first = max((max(value) for value in writes.values()), default=self._added())
        if first > 0xFF:
            return None, "the interrupt may add 256 to TMR0"
        return (256 - first) * self._prescale(), ""

    def _writes(self, noted: Mapping[int, Value]) -> Mapping[int, Value]:
        """Return the writes of TMR0, among these, that are executed once its interrupt may come."""
        later = self._later
        return {address: value for address, value in noted.items() if address in later}

    def _added(self) -> int:
        """Return the maximum that one interrupt adds to TMR0."""
        return sum(max(value) for value in self._writes(self._paths.timer_adds).values())

    def _prescale(self) -> int:
        """Return the minimum number of cycles between two counts of TMR0."""
        options = self._timer_options()
        assert options is not None
        return min(1 if member & PSA else 2 << (member & 7) for member in options)

    @cached_property
    def _later(self) -> frozenset[int]:
        """Return the addresses that may be executed once an interrupt of TMR0 may come."""
        return self._program.following({*self._paths.timer_interrupted, INTERRUPT_VECTOR})

    def _timer_options(self) -> Value | None:
        """Return what OPTION_REG may be from when an interrupt of TMR0 first may come; None if none comes.

        What it is before does not count: after a reset it lets TMR0 count the pulses of RA4. While the
        interrupt is masked, and inside it, TMR0 counts on.
        """
        paths = self._paths
        options = paths.timer_options
        if options is None:
            return None
        written = [value for address, value in paths.option_writes.items() if address in self._later]
        return reduce(or_, written, options)


def _functions(paths: Paths) -> list[ListedFunction]:
    """Return functions that cover the whole memory: they begin where calls lead."""
    starts = sorted({0, *paths.called_from, *([INTERRUPT_VECTOR] if paths.interrupts else [])})
    ends = [*starts[1:], PROGRAM_WORDS]
    return [ListedFunction(f"0x{a:03X}", a, b) for a, b in zip(starts, ends, strict=True)]


def in_words(why: Unbounded) -> str:
    """Return in words why a time has no bound."""
    places = ", ".join(f"0x{address:03X}" for address in why.addresses[:4])
    more = "" if len(why.addresses) <= 4 else ", …"
    texts = {
        "loop": "loop at",
        "call": "call of a subroutine without a bound at",
        "computed jump": "computed jump at",
        "sleep": "sleep at",
        "stack": f"more than {STACK_LEVELS} calls in each other at",
    }
    return f"{texts.get(why.kind, why.kind + ' at')} {places}{more}"
