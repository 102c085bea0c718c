"""The clauses of a contract as the checker watches them: each one thing that comes too late, or too early.

In: the text of a contract and the clock, by docs/contracts.md. Out: watches. Each has a start, and says how
its state goes on when time passes, pins change or an input is read, or raises `ClauseBroken`. Of two states
that are equal in the first part that `split` returns, one that is greater in the second is worse: it breaks
the clause in every run in which the other one does.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from math import ceil, floor
from typing import Any

from servogen.checker.plan import PINS

Numbers = tuple[int, ...]
Changed = Callable[[int, int], bool]
"""Whether something happens when the levels of the pins go from one word to another."""
NONE = -1
NEVER_READ = 1_000_000
"""Cycles after which an input has been read too late, whatever is due."""


class ClauseBroken(Exception):
    """A clause is broken; the text says how."""


class Uncovered(Exception):
    """The checker does not watch such a clause; the text says which."""


@dataclass(frozen=True, kw_only=True)
class ClauseWatch:
    """What watches a clause, or a half of it. Pins are bits of a word."""

    text: str
    pins: int
    """Those of the program that it is about."""
    asks: int = 0
    """The one whose events are causes."""
    reads: bool = False
    """Whether the program learns of the causes only where it reads that pin."""

    def start(self) -> Numbers:
        return (NONE,)

    def wait(self, state: Numbers, cycles: int) -> Numbers:
        return state

    def change(self, state: Numbers, before: int, after: int) -> Numbers:
        return state

    def read(self, state: Numbers, level: int) -> Numbers:
        raise ClauseBroken("a pin whose events are causes is not driven where it is read")

    def rest(self, state: Numbers) -> Numbers:
        """Return the worst state after any time without a change."""
        return state

    def split(self, state: Numbers) -> tuple[Numbers, Numbers]:
        return state, ()


@dataclass(frozen=True, kw_only=True)
class SpanWatch(ClauseWatch):
    """From one event to another: most cycles, or else least ones. State: cycles since the first, or NONE."""

    begins: Changed
    ends: Changed
    least: int
    most: int | None
    again: bool = False
    """Whether the end begins the next one."""
    begun: bool = False
    """Whether one begins with a reset."""

    def start(self) -> Numbers:
        return (0 if self.begun else NONE,)

    def wait(self, state: Numbers, cycles: int) -> Numbers:
        since = state[0] + cycles
        if state[0] == NONE:
            return state
        if self.most is None:
            return (min(since, self.least),)
        if since > self.most:
            raise ClauseBroken(f"more than {self.most} cycles")
        return (since,)

    def change(self, state: Numbers, before: int, after: int) -> Numbers:
        since, ends = state[0], self.ends(before, after)
        if since == NONE:
            if not self.begins(before, after):
                return state
            if self.again or not ends:
                return (0,)
            since = 0
        if ends and since < self.least:
            raise ClauseBroken(f"{since} cycles, not {self.least}")
        return (since if not ends else 0 if self.again else NONE,)

    def rest(self, state: Numbers) -> Numbers:
        if self.most is not None and state[0] != NONE:
            raise ClauseBroken("nothing has to end it")
        return state

    def split(self, state: Numbers) -> tuple[Numbers, Numbers]:
        return (int(state[0] == NONE),), (state[0] if self.most is not None else -state[0],)


@dataclass(frozen=True, kw_only=True)
class AnswerWatch(ClauseWatch):
    """An answer to an input, at most so many cycles after the earliest moment at which the cause may have
    come, or at least after the latest one. State: the level read last or NONE, cycles since, and since the
    cause, or NONE.
    """

    reads: bool = True
    may_follow: tuple[bool, bool]
    """Whether the cause may come after level 0, and 1, was read."""
    then: Changed
    least: int
    most: int | None
    held: int
    """A cause that is undone earlier is none."""

    def start(self) -> Numbers:
        return (NONE, 0, NONE)

    def wait(self, state: Numbers, cycles: int) -> Numbers:
        level, since, cause = state
        if self.most is None:
            return (level, 0, cause if cause == NONE else min(cause + cycles, self.least))
        since += cycles
        if cause != NONE and cause + cycles > self.most:
            raise ClauseBroken(f"no answer for more than {self.most} cycles")
        may = level != NONE and self.may_follow[level]
        if cause == NONE and (since > NEVER_READ or (may and since > self.most + 1)):
            raise ClauseBroken(f"the input is not read for {since} cycles")
        return (level, min(since, NEVER_READ), cause if cause == NONE else cause + cycles)

    def change(self, state: Numbers, before: int, after: int) -> Numbers:
        level, since, cause = state
        if not self.then(before, after):
            return state
        if self.most is None and cause == NONE and (level == NONE or self.may_follow[level]):
            raise ClauseBroken("the answer comes, and the cause may have come just before it, unread")
        if cause != NONE and cause < self.least:
            raise ClauseBroken(f"the answer comes after {cause} cycles, not {self.least}")
        return (level, since, NONE)

    def read(self, state: Numbers, level: int) -> Numbers:
        last, since, cause = state
        if level != last and cause < self.held:
            cause = NONE
        if level != last != NONE and cause == NONE and self.may_follow[last]:
            cause = max(since - 1, 0)  # it came after the read before; `least` is of one that comes now
        return (level, 0, cause)

    def rest(self, state: Numbers) -> Numbers:
        raise ClauseBroken("nothing has to end SLEEP, and the input is not read")

    def split(self, state: Numbers) -> tuple[Numbers, Numbers]:
        level, since, cause = state
        return (level, int(cause == NONE)), ((since, cause) if self.most is not None else (-cause,))


@dataclass(frozen=True, kw_only=True)
class TurnsWatch(ClauseWatch):
    """Events that come one after the other, again and again. State: the next one."""

    events: tuple[Changed, ...]

    def start(self) -> Numbers:
        return (0,)

    def change(self, state: Numbers, before: int, after: int) -> Numbers:
        """Take all events that happen at once, each of them once, in their turn."""
        due, left = state[0], {each for each in self.events if each(before, after)}
        while left:
            if self.events[due] not in left:
                raise ClauseBroken(f"an event comes where number {due + 1} is due")
            left.remove(self.events[due])
            due = (due + 1) % len(self.events)
        return (due,)


@dataclass(frozen=True, kw_only=True)
class FramesWatch(ClauseWatch):
    """Bytes on a serial line. State: cycles since the start bit began and whether the line is idle now, or
    NONE between two frames.
    """

    bit: Fraction
    tolerance: Fraction
    high: bool
    """Whether the idle line is."""
    bits: int

    def wait(self, state: Numbers, cycles: int) -> Numbers:
        if state == (NONE,):
            return state
        since, idle = state[0] + cycles, state[1]
        if not idle and since > 9 * self.bit * (1 + self.tolerance) + Fraction(1, 2):
            raise ClauseBroken("no stop bit")
        end = self.bits * self.bit * (1 - self.tolerance) - Fraction(1, 2)
        return (NONE,) if since >= end else (since, idle)

    def change(self, state: Numbers, before: int, after: int) -> Numbers:
        if not (before ^ after) & self.pins:
            return state
        since, idle = state[0], int(bool(after & self.pins) == self.high)
        if since == NONE:
            return state if idle else (0, 0)
        bits = max(1, floor(since / self.bit + Fraction(1, 2)))
        if bits > 9 or abs(since - bits * self.bit) > bits * self.bit * self.tolerance + Fraction(1, 2):
            raise ClauseBroken(f"an edge {since} cycles after the start bit began")
        return (since, idle)

    def rest(self, state: Numbers) -> Numbers:
        if state != (NONE,):
            raise ClauseBroken("SLEEP within a byte")
        return state


def read_watches(text: str, cycles_per_second: Fraction, inputs: int) -> list[ClauseWatch]:
    """Return the watches of a contract; `inputs` are the pins that the program does not drive.

    Raises Uncovered, or what a text that is no contract leads to.
    """
    # By way of `float`, whose exponents are bounded: the whole number 10 ** -exponent may fill the memory.
    tables = tomllib.loads(text, parse_float=lambda number: Fraction(repr(float(number))))
    tables.pop("clock_hz", None)
    reader = _Reader(cycles_per_second / 1_000_000, inputs)
    kinds: dict[str, Callable[..., Iterator[ClauseWatch]]]
    kinds = {"pulse": reader.pulse, "response": reader.response, "never": reader.never,
             "every": reader.every, "order": reader.order, "serial": reader.serial}  # fmt: skip
    watches: list[ClauseWatch] = []
    for kind, listed in tables.items():
        for table in listed:
            if kind not in kinds or "duty_percent" in table:
                raise Uncovered(f"duty_percent in [[{kind}]]" if kind in kinds else f"[[{kind}]]")
            watches += kinds[kind](f"[[{kind}]]", **table)  # another key is a TypeError
    for watch in watches:
        if watch.pins & (inputs | 1 << PINS.index("RA4")):
            raise Uncovered(f"{watch.text}: a clause about an input, or about RA4, which does not drive high")
    return watches


def _never(before: int, after: int) -> bool:
    return False


class _Reader:
    """Makes watches of tables, whose keys are the parameters."""

    def __init__(self, cycles_per_us: Fraction, inputs: int) -> None:
        self._rate, self._inputs = cycles_per_us, inputs
        self._events: dict[str, Changed] = {}

    def _pin(self, *texts: str) -> int:
        """Return the pins that texts begin with."""
        return sum({1 << PINS.index(text.split()[0]) for text in texts})

    def _event(self, text: str) -> Changed:
        """Return whether a pin rises, falls or changes: the same function for the same words."""
        pin, (_, kind) = self._pin(text), text.split()
        level = {"rises": (pin,), "falls": (0,), "changes": (0, pin)}[kind]
        return self._events.setdefault(
            f"{pin} {kind}", lambda before, after: bool((before ^ after) & pin) and after & pin in level
        )

    def _limits(self, us: Any) -> Iterator[dict[str, Any]]:
        """Return the whole cycles in a range, most and least: only one of them counts in each pair."""
        if us[1:]:
            yield {"least": 0, "most": floor(Fraction(us[1]) * self._rate)}
        if ceil(Fraction(us[0]) * self._rate):
            yield {"least": ceil(Fraction(us[0]) * self._rate), "most": None}

    def pulse(self, text: str, pin: str, **times: Any) -> Iterator[ClauseWatch]:
        rises, falls = self._event(f"{pin} rises"), self._event(f"{pin} falls")
        ends = {"high_us": (rises, falls), "low_us": (falls, rises), "period_us": (rises, rises)}
        for key, us in times.items():
            one, other = ends[key]
            for limits in self._limits(us):
                yield SpanWatch(text=f"{text} {key}", pins=self._pin(pin), begins=one, ends=other,
                           again=one is other, **limits)  # fmt: skip

    def every(self, text: str, event: str, first_us: Any = (0,), gap_us: Any = (0,)) -> Iterator[ClauseWatch]:
        pins, happens = self._pin(event), self._event(event)
        for limits in self._limits(first_us):
            yield SpanWatch(text=text, pins=pins, begins=_never, ends=happens, begun=True, **limits)
        for limits in self._limits(gap_us):
            yield SpanWatch(text=text, pins=pins, begins=happens, ends=happens, again=True, **limits)

    def never(self, text: str, condition: str, longer_us: Any = 0) -> Iterator[ClauseWatch]:
        words = dict(each.split() for each in re.split(r"\band\b", condition))
        pins, high = self._pin(*words), self._pin(*(pin for pin, level in words.items() if level == "high"))
        yield SpanWatch(
            text=f"{text} {condition}",
            pins=pins,
            begins=lambda before, after: after & pins == high != before & pins,
            ends=lambda before, after: after & pins != high,
            least=0,
            most=floor(Fraction(longer_us) * self._rate),
            begun=high == 0,
        )

    def response(
        self, text: str, when: Any, then: str, within_us: Any, held_us: Any = 0
    ) -> Iterator[ClauseWatch]:
        causes, held = [when] if isinstance(when, str) else when, ceil(Fraction(held_us) * self._rate)
        if len(causes) > 1:
            raise Uncovered(f"{text} with several causes")
        asks, pins, ends, kind = self._pin(*causes), self._pin(then), self._event(then), causes[0].split()[1]
        for limits in self._limits(within_us):
            if held and (limits["least"] or not asks & self._inputs):
                raise Uncovered(f"{text}: held_us with a least time, or of a pin that the program drives")
            if asks & self._inputs:
                may = kind != "falls", kind != "rises"
                yield AnswerWatch(
                    text=text, pins=pins, asks=asks, may_follow=may, then=ends, held=held, **limits
                )
            else:
                begins = self._event(causes[0])
                yield SpanWatch(text=text, pins=pins | asks, asks=asks, begins=begins, ends=ends, **limits)

    def order(self, text: str, events: list[str]) -> Iterator[ClauseWatch]:
        yield TurnsWatch(text=text, pins=self._pin(*events), events=tuple(map(self._event, events)))

    def serial(
        self,
        text: str,
        pin: str,
        baud: Any,
        tolerance_percent: Any = 2,
        idle: str = "high",
        stop_bits: int = 1,
    ) -> Iterator[ClauseWatch]:
        bit, tolerance = self._rate * 1_000_000 / Fraction(baud), Fraction(tolerance_percent) / 100
        pins, bits = self._pin(pin), 9 + stop_bits
        yield FramesWatch(text=text, pins=pins, bit=bit, tolerance=tolerance, high=idle == "high", bits=bits)
