"""One observer for each kind of clause: a timed automaton beside the pins.

In: levels of the pins and the cycles for which they stay. Out: the observer's next state, a tuple of whole
numbers, or `Broken`. Times are cycles since something, and stop counting where no limit reaches, so that
the states of a program that repeats are finite in number, and a search over them ends.

    wait(state, levels, cycles)     the levels stay for so many cycles
    react(state, before, after)     they change, all that change in one cycle at once
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import ceil, floor
from typing import Protocol

from servogen.contract.events import PinEvent, PinLevels
from servogen.edges import PINS

State = tuple[int, ...]

NONE = -1
"""In a state: there was none."""


@dataclass(slots=True)
class Broken(Exception):
    """A clause is broken `after` cycles from the beginning of a wait; 0 at a change."""

    message: str
    after: int = 0


UNBOUNDED = 1 << 60
"""The most cycles of a range without an upper end."""


@dataclass(frozen=True, slots=True)
class Limits:
    """The least and the most cycles that something may take."""

    least: int
    most: int = UNBOUNDED

    @property
    def cap(self) -> int:
        """Return the cycles from which on it makes no difference how many more there are."""
        return self.least if self.most == UNBOUNDED else self.most + 1

    def __contains__(self, cycles: int) -> bool:
        return self.least <= cycles <= self.most

    def __str__(self) -> str:
        if self.most == UNBOUNDED:
            return f"at least {self.least} cycles"
        return f"{self.least} to {self.most} cycles" if self.least != self.most else f"{self.least} cycles"


class Observer(Protocol):
    """What watches one clause."""

    @property
    def pins(self) -> int:
        """Return a bit for each pin that it watches."""

    def start(self, from_reset: bool) -> State:
        """Return the state at the first cycle, which is that after a reset or any one."""

    def wait(self, state: State, levels: int, cycles: int) -> State:
        """Return the state after the levels have stayed. Raises Broken."""

    def react(self, state: State, before: int, after: int) -> State:
        """Return the state after a change. Raises Broken."""

    def sees(self, state: State, before: int, after: int) -> bool:
        """Return whether a change is one of those that the clause is about."""

    def after_breach(self) -> State:
        """Return the state with which it goes on after it was broken."""


def _older(age: int, cycles: int, cap: int) -> int:
    return age if age == NONE else min(age + cycles, cap)


@dataclass(frozen=True, slots=True)
class PulseObserver:
    """Every pulse of a pin. State: cycles since its rise, and since its fall, or `NONE` while it is high."""

    pin: int
    high: Limits | None
    low: Limits | None
    period: Limits | None
    duty: tuple[Fraction, Fraction] | None
    """Parts of a period; needs `period`."""

    @property
    def pins(self) -> int:
        return 1 << self.pin

    def start(self, from_reset: bool) -> State:
        return (NONE, NONE)

    def wait(self, state: State, levels: int, cycles: int) -> State:
        since_rise, low = state
        if since_rise == NONE:
            return state
        if low == NONE and self.high is not None and since_rise + cycles > self.high.most:
            raise Broken(f"is high for more than {self.high.most} cycles", self.high.most + 1 - since_rise)
        if low != NONE and self.low is not None and low + cycles > self.low.most:
            raise Broken(f"is low for more than {self.low.most} cycles", self.low.most + 1 - low)
        if self.period is not None and since_rise + cycles > self.period.most:
            message = f"does not rise within {self.period.most} cycles of its last rise"
            raise Broken(message, self.period.most + 1 - since_rise)
        if self.duty is not None:  # a part of a period has no limit in cycles
            return (since_rise + cycles, low if low == NONE else low + cycles)
        high, down, period = (0 if each is None else each.cap for each in (self.high, self.low, self.period))
        return (min(since_rise + cycles, max(high, period)), _older(low, cycles, down))

    def react(self, state: State, before: int, after: int) -> State:
        since_rise, low = state
        changed = (before ^ after) >> self.pin & 1
        if not changed:
            return state
        if not after >> self.pin & 1:
            if since_rise == NONE:  # it was high from the beginning on
                return state
            if self.high is not None and since_rise not in self.high:
                raise Broken(f"is high for {since_rise} cycles, not {self.high}")
            return (since_rise, 0)
        if since_rise != NONE:
            self._check_period(since_rise, low)
        return (0, NONE)

    def _check_period(self, period: int, low: int) -> None:
        if self.low is not None and low not in self.low:
            raise Broken(f"is low for {low} cycles, not {self.low}")
        if self.period is not None and period not in self.period:
            raise Broken(f"rises {period} cycles after its last rise, not {self.period}")
        high = period - low
        if self.duty is not None and not self.duty[0] <= Fraction(high, period) <= self.duty[1]:
            raise Broken(f"is high for {high} of {period} cycles, {100 * high / period:.4g} %")

    def after_breach(self) -> State:
        return self.start(from_reset=False)

    def sees(self, state: State, before: int, after: int) -> bool:
        return bool((after & ~before) >> self.pin & 1)


@dataclass(frozen=True, slots=True)
class ResponseObserver:
    """What must follow a cause: events one after the other.

    State: how many of the cause's events have come, and the most and the fewest cycles since its last one,
    or `NONE` twice. Only where an input was read now and then do these two differ. A cause during a wait
    changes nothing: the first one counts. A cause that is undone within `held` cycles is none.
    """

    when: Sequence[PinEvent]
    then: PinEvent
    within: Limits
    held: int = 0

    @property
    def pins(self) -> int:
        pins = 1 << self.then.pin
        for each in self.when:
            pins |= 1 << each.pin
        return pins

    def start(self, from_reset: bool) -> State:
        return (0, NONE, NONE)

    def wait(self, state: State, levels: int, cycles: int) -> State:
        come, most, fewest = state
        if most != NONE and most + cycles > self.within.most:
            raise Broken(self.missing, self.within.most + 1 - most)
        cap = max(self.within.cap, self.held)
        return (come, _older(most, cycles, cap), _older(fewest, cycles, cap))

    @property
    def missing(self) -> str:
        return f"'{self.then}' does not come within {self.within.most} cycles"

    def react(self, state: State, before: int, after: int) -> State:
        come, most, fewest = state
        answered = self.then.happens(before, after)
        if most != NONE and not answered and most < self.held and self._undone(before, after):
            return (0, NONE, NONE)
        if most != NONE:
            return self._after_answer(fewest) if answered else state
        come = self._come(come, before, after)
        if come < len(self.when):
            return (come, NONE, NONE)
        return self._after_answer(0) if answered else (0, 0, 0)

    def _undone(self, before: int, after: int) -> bool:
        return bool((before ^ after) >> self.when[-1].pin & 1)

    def _after_answer(self, fewest: int) -> State:
        if fewest < self.within.least:
            raise Broken(f"'{self.then}' comes after {fewest} cycles, not {self.within}")
        return (0, NONE, NONE)

    def _come(self, come: int, before: int, after: int) -> int:
        if self.when[come].happens(before, after):
            return come + 1
        other = any(each.happens(before, after) for each in self.when)
        return int(self.when[0].happens(before, after)) if other else come

    def after_breach(self) -> State:
        return self.start(from_reset=False)

    def sees(self, state: State, before: int, after: int) -> bool:
        return self.when[-1].happens(before, after)


@dataclass(frozen=True, slots=True)
class NeverObserver:
    """Levels that pins do not have for longer than some cycles. State: for how long they have had them."""

    condition: PinLevels
    longer: int

    @property
    def pins(self) -> int:
        return self.condition.pins

    def start(self, from_reset: bool) -> State:
        return (0,)

    def wait(self, state: State, levels: int, cycles: int) -> State:
        if not self.condition.holds(levels):
            return (0,)
        if state[0] > self.longer:  # it has been told
            return state
        if state[0] + cycles > self.longer:
            for_longer = f" for more than {self.longer} cycles" if self.longer else ""
            raise Broken(f"{self.condition}{for_longer}", self.longer - state[0])
        return (state[0] + cycles,)

    def react(self, state: State, before: int, after: int) -> State:
        return state if self.condition.holds(before) and self.condition.holds(after) else (0,)

    def after_breach(self) -> State:
        return (self.longer + 1,)

    def sees(self, state: State, before: int, after: int) -> bool:
        return bool((before ^ after) & self.condition.pins)


@dataclass(frozen=True, slots=True)
class OrderObserver:
    """Events that come in turn, again and again. State: the number of the next one."""

    events: Sequence[PinEvent]

    @property
    def pins(self) -> int:
        pins = 0
        for each in self.events:
            pins |= 1 << each.pin
        return pins

    def start(self, from_reset: bool) -> State:
        return (0 if from_reset else NONE,)

    def wait(self, state: State, levels: int, cycles: int) -> State:
        return state

    def react(self, state: State, before: int, after: int) -> State:
        (due,) = state
        happening = {each for each in self.events if each.happens(before, after)}
        while happening:
            if due == NONE and (due := self._only(happening)) == NONE:
                return (NONE,)
            if self.events[due] not in happening:
                names = ", ".join(f"'{each}'" for each in sorted(happening, key=self.events.index))
                raise Broken(f"{names} comes where '{self.events[due]}' is due")
            happening.remove(self.events[due])
            due = (due + 1) % len(self.events)
        return (due,)

    def _only(self, happening: set[PinEvent]) -> int:
        """Return the place of the first event that has only one, or `NONE`."""
        places = [self.events.index(each) for each in happening if self.events.count(each) == 1]
        return min(places, default=NONE)

    def after_breach(self) -> State:
        return self.start(from_reset=False)

    def sees(self, state: State, before: int, after: int) -> bool:
        return any(each.happens(before, after) for each in self.events)


@dataclass(frozen=True, slots=True)
class CountObserver:
    """How often an event comes in every window of so many cycles. State: the ages of the latest ones.

    From the first event on (from reset on, if it is known) every window that has passed must have enough.
    """

    event: PinEvent
    times: Limits
    window: int

    @property
    def pins(self) -> int:
        return 1 << self.event.pin

    def start(self, from_reset: bool) -> State:
        return ()

    def wait(self, state: State, levels: int, cycles: int) -> State:
        enough = self.times.least
        if enough and len(state) >= enough and state[enough - 1] + cycles > self.window:
            message = f"'{self.event}' comes fewer than {enough} times in {self.window} cycles"
            raise Broken(message, self.window + 1 - state[enough - 1])
        kept = max(enough, self.times.most)
        return tuple(min(age + cycles, self.window + 1) for age in state[:kept])

    def react(self, state: State, before: int, after: int) -> State:
        if not self.event.happens(before, after):
            return state
        most = self.times.most
        if len(state) >= most and (not most or state[most - 1] < self.window):
            raise Broken(f"'{self.event}' comes more than {most} times in {self.window} cycles")
        return (0, *state)[: max(self.times.least, most, 1)]

    def after_breach(self) -> State:
        return self.start(from_reset=False)

    def sees(self, state: State, before: int, after: int) -> bool:
        return self.event.happens(before, after)


@dataclass(frozen=True, slots=True)
class EveryObserver:
    """An event that comes at least and at most so often; from reset on only if `first` says when.

    State: cycles since the last one, or since reset (then the second number is 1), or `NONE`.
    """

    event: PinEvent
    first: Limits | None
    gap: Limits | None

    @property
    def pins(self) -> int:
        return 1 << self.event.pin

    def start(self, from_reset: bool) -> State:
        return (0, 1) if from_reset and self.first is not None else (NONE, 0)

    def _limits(self, state: State) -> Limits | None:
        return self.first if state[1] else self.gap

    def wait(self, state: State, levels: int, cycles: int) -> State:
        limits = self._limits(state)
        if state[0] == NONE or limits is None:
            return state
        if state[0] + cycles > limits.most:
            what = "reset" if state[1] else "the last one"
            message = f"'{self.event}' does not come within {limits.most} cycles of {what}"
            raise Broken(message, limits.most + 1 - state[0])
        return (min(state[0] + cycles, limits.cap), state[1])

    def react(self, state: State, before: int, after: int) -> State:
        if not self.event.happens(before, after):
            return state
        limits = self._limits(state)
        if state[0] != NONE and limits is not None and state[0] < limits.least:
            what = "reset" if state[1] else "the last one"
            raise Broken(f"'{self.event}' comes {state[0]} cycles after {what}, not {limits}")
        return (0 if self.gap is not None else NONE, 0)

    def after_breach(self) -> State:
        return self.start(from_reset=False)

    def sees(self, state: State, before: int, after: int) -> bool:
        return self.event.happens(before, after)


@dataclass(frozen=True, slots=True)
class SerialObserver:
    """Bytes of 8 bits, least significant first, with a start bit and one stop bit or more.

    Every edge of a frame lies at a whole number of bits from its first one, within a part of that time and
    half a cycle (edges lie in whole cycles). State: cycles since the start bit began, or `NONE` between two
    frames.
    """

    pin: int
    bit: Fraction
    """Cycles."""
    tolerance: Fraction
    """A part of the time since the start bit began."""
    idle: int
    stop_bits: int

    @property
    def pins(self) -> int:
        return 1 << self.pin

    @property
    def _stop(self) -> int:
        """Return the last cycle of a frame in which the line may still have the level of its last bit."""
        return floor(9 * self.bit * (1 + self.tolerance) + Fraction(1, 2))

    @property
    def _end(self) -> int:
        """Return the first cycle in which the next frame may begin."""
        bits = 9 + self.stop_bits
        return ceil(bits * self.bit * (1 - self.tolerance) - Fraction(1, 2))

    def start(self, from_reset: bool) -> State:
        return (NONE,)

    def wait(self, state: State, levels: int, cycles: int) -> State:
        (since,) = state
        if since == NONE:
            return state
        if levels >> self.pin & 1 != self.idle and since + cycles > self._stop:
            raise Broken("has no stop bit", max(0, self._stop + 1 - since))
        return (NONE,) if since + cycles >= self._end else (since + cycles,)

    def react(self, state: State, before: int, after: int) -> State:
        if not (before ^ after) >> self.pin & 1:
            return state
        (since,) = state
        if since == NONE:
            # From the idle level a start bit begins; a line that leaves the other level only becomes idle.
            return (0,) if before >> self.pin & 1 == self.idle else state
        bits = max(1, int(since / self.bit + Fraction(1, 2)))
        off = since - bits * self.bit
        if bits > 9:
            raise Broken(f"begins a frame {since} cycles after the last one, in its stop bit")
        if abs(off) > bits * self.bit * self.tolerance + Fraction(1, 2):
            raise Broken(
                f"has an edge {since} cycles after the start bit began: {float(abs(off)):.4g} cycles "
                f"{'late' if off > 0 else 'early'} of {bits} bits"
            )
        return state

    def after_breach(self) -> State:
        return self.start(from_reset=False)

    def sees(self, state: State, before: int, after: int) -> bool:
        return state == (NONE,) and before >> self.pin & 1 == self.idle != after >> self.pin & 1


def pin_names(pins: int) -> str:
    """Return the names of the pins in a number of levels."""
    return ", ".join(name for pin, name in enumerate(PINS) if pins >> pin & 1)
