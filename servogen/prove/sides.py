"""The clauses of a contract in halves, each of which says only what is too late or only what is too early.

Of two states of a half that differ in times only, one breaks it in every run in which the other does: of "too
late" the later one. So a search follows that one alone (`explore.Explorer`). What can be neither is whole.

Causes at inputs. A program learns of an input's change when it reads the pin. Between a read of one level and
the next read of the other the change may have come in any cycle: the answer is late if it is late for the
earliest of them, and early if it is early for the latest. If a change could come and the next read is later
than the answer is due, the clause is broken as well; where an answer comes before that read, it may be too
early, and nothing is decided. What is assumed: an input keeps a level until the program has read it (a
shorter pulse cannot be seen by any program without an interrupt).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from servogen.contract.clauses import Clause
from servogen.contract.events import CHANGES, RISES
from servogen.contract.observers import (
    NONE,
    UNBOUNDED,
    Broken,
    EveryObserver,
    Limits,
    NeverObserver,
    Observer,
    PulseObserver,
    ResponseObserver,
    State,
)
from servogen.edges import PINS
from servogen.prove.specification import Violation

UNREAD = 1_000_000
"""Cycles without a read of an input after which a whole pulse of it has been missed."""
FOREVER = UNBOUNDED // 2
"""Cycles that are longer than any limit that is one."""
TOO_LATE, TOO_EARLY, WHOLE = 1, -1, 0


@dataclass(frozen=True, slots=True)
class SampledResponse:
    """A response to a cause at an input, which the program reads now and then.

    State: the level that was read last or `NONE`, cycles since, and the most and the fewest cycles since the
    cause, or `NONE`.
    """

    response: ResponseObserver

    @property
    def pin(self) -> int:
        return self.response.when[0].pin

    @property
    def pins(self) -> int:
        return 1 << self.response.then.pin

    def start(self, from_reset: bool) -> State:
        return (NONE, 0, NONE, NONE)

    def _may_come(self, level: int) -> bool:
        """Return whether the cause may come after this level was read."""
        kind = self.response.when[0].kind
        return level != NONE and (kind == CHANGES or level != (kind == RISES))

    def wait(self, state: State, levels: int, cycles: int) -> State:
        level, since, most, fewest = state
        _, most, fewest = self.response.wait((0, most, fewest), levels, cycles)
        limit, cause = self.response.within.most, self.response.when[0]
        if limit == UNBOUNDED:  # what is too late is told by the other half
            return (level, min(since + cycles, self.response.held + 1), most, fewest)
        if most == NONE and self._may_come(level) and since + cycles > limit + 1:
            raise Broken(f"'{cause}' may come, and is not read within {limit} cycles", limit + 2 - since)
        if most == NONE and since + cycles > UNREAD:
            raise Broken(f"{PINS[cause.pin]} is not read for {UNREAD} cycles", UNREAD + 1 - since)
        return (level, min(since + cycles, max(limit, UNREAD) + 2), most, fewest)

    def read(self, state: State, level: int) -> State:
        """Return the state after the program has read the pin."""
        last, since, most, fewest = state
        if most != NONE and level != last and most < self.response.held:
            most = fewest = NONE
        if most == NONE and self._may_come(last) and level != last:
            most, fewest = max(since - 1, 0), 0  # the earliest is the cycle after the read before
        return (level, 0, most, fewest)

    def react(self, state: State, before: int, after: int) -> State:
        level, since, most, fewest = state
        if most != NONE:
            _, most, fewest = self.response.react((0, most, fewest), before, after)
        elif self.response.within.least and (level == NONE or self._may_come(level)):
            then, cause = self.response.then, self.response.when[0]
            if then.happens(before, after):
                message = f"'{then}' comes, and '{cause}' may have come just before it, unread"
                raise Violation(message, 0, certain=False)
        return (level, since, most, fewest)

    def sees(self, state: State, before: int, after: int) -> bool:
        return False

    def after_breach(self) -> State:
        return self.start(from_reset=False)


@dataclass(frozen=True, slots=True)
class Side:
    """A half of a clause, or the whole of it."""

    text: str
    """The clause."""
    observer: Observer
    sign: int
    """TOO_LATE, TOO_EARLY or WHOLE."""

    def ordered(self, state: State) -> tuple[State, State]:
        """Return what comparable states have in common, and the numbers of which a greater is worse."""
        if self.sign == WHOLE:
            return state, ()
        kind, times = _times(self, state)
        return kind, tuple(self.sign * each for each in times)

    def asleep(self, state: State, levels: int) -> State | None:
        """Return the worst state after any time in which no pin changes; None if it is not known.

        Raises Broken if the clause does not let any time pass.
        """
        later = self.observer.wait(state, levels, FOREVER)
        if self.sign == WHOLE:
            return later if later == self.observer.wait(state, levels, 0) else None
        return later if self.sign == TOO_LATE else state


def _times(side: Side, state: State) -> tuple[State, State]:
    """Return the part of a state that time does not change, and the times in it that count."""
    if isinstance(side.observer, SampledResponse):
        level, since, most, fewest = state
        return (level, int(most == NONE)), (since, most) if side.sign == TOO_LATE else (fewest,)
    if isinstance(side.observer, ResponseObserver):
        come, most, _ = state
        return (come, int(most == NONE)), (most,)
    if isinstance(side.observer, EveryObserver):
        since, from_reset = state
        return (from_reset, int(since == NONE)), (since,)
    return tuple(int(each == NONE) for each in state), state


def sides_of(clause: Clause, inputs: int) -> list[Side]:
    """Return what must be proven of a clause; `inputs` are pins that the program does not drive, as bits."""
    observer = clause.observer
    if isinstance(observer, NeverObserver):
        return [Side(clause.text, observer, TOO_LATE)]
    if isinstance(observer, ResponseObserver):
        return _of_response(clause.text, observer, inputs)
    if isinstance(observer, EveryObserver) or (isinstance(observer, PulseObserver) and observer.duty is None):
        halves = (_half(observer, _not_late), TOO_LATE), (_half(observer, _not_early), TOO_EARLY)
        sides = [Side(clause.text, half, sign) for half, sign in halves if half is not None]
        if sides:
            return sides
    return [Side(clause.text, observer, WHOLE)]


Within = Callable[[Limits], Limits]


def _half(observer: PulseObserver | EveryObserver, within: Within) -> Observer | None:
    """Return the observer with a half of its limits; None if nothing is left of them."""

    def part(limits: Limits | None) -> Limits | None:
        return limits and within(limits)

    half: Observer
    if isinstance(observer, PulseObserver):
        limits = part(observer.high), part(observer.low), part(observer.period)
        half = replace(observer, high=limits[0], low=limits[1], period=limits[2])
    else:
        limits = part(observer.first), part(observer.gap), None
        half = replace(observer, first=limits[0], gap=limits[1])
    return half if any(each not in (None, Limits(0)) for each in limits) else None


def _not_late(limits: Limits) -> Limits:
    return Limits(0, limits.most)


def _not_early(limits: Limits) -> Limits:
    return Limits(limits.least)


def _of_response(text: str, response: ResponseObserver, inputs: int) -> list[Side]:
    """Return the halves of a response: where one that is undone is no cause, an early answer has no worst."""
    late = replace(response, within=_not_late(response.within))
    early = replace(response, within=_not_early(response.within))
    halves = [(late, WHOLE if late.held and len(late.when) > 1 else TOO_LATE)]
    if early.within.least:
        halves.append((early, WHOLE if early.held else TOO_EARLY))
    sampled = inputs >> response.when[0].pin & 1
    return [Side(text, SampledResponse(half) if sampled else half, sign) for half, sign in halves]
