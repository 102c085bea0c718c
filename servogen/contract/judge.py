"""The judgement: the observers of a contract follow the levels of the pins.

In: clauses and one run or recording of all pins. Out: a `ContractVerdict`: for each clause how often what it
is about was seen, and where it was first broken.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from servogen.contract.clauses import Clause
from servogen.contract.observers import Broken, State
from servogen.edges import HIGH, EdgeChunk, EdgeTrace
from servogen.units import Clock, Cycles, counted

if TYPE_CHECKING:
    from servogen.answers import ClauseAnswer, ContractVerdictAnswer


@dataclass(frozen=True, slots=True)
class Breach:
    """Where a clause was broken, in cycles since the beginning."""

    cycle: Cycles
    message: str


@dataclass(frozen=True, slots=True)
class ClauseVerdict:
    """What was seen of one clause."""

    clause: Clause
    seen: int
    """How often what it is about came: pulses, causes, changes, bytes."""
    breaches: int
    first: Breach | None

    @property
    def kept(self) -> bool:
        """Return whether it was never broken, and there was something to judge."""
        return not self.breaches and self.seen > 0

    @property
    def word(self) -> str:
        return "violated" if self.breaches else "kept" if self.seen else "not seen"

    def to_json(self, clock: Clock) -> ClauseAnswer:
        return {
            "clause": self.clause.text,
            "line": self.clause.place.line,
            "verdict": self.word,
            "seen": self.seen,
            "breaches": self.breaches,
            "first_breach_cycle": None if self.first is None else self.first.cycle,
            "first_breach_us": None if self.first is None else float(clock.us(self.first.cycle)),
            "message": None if self.first is None else self.first.message,
        }


@dataclass(frozen=True, slots=True)
class ContractVerdict:
    """What one run or one recording shows. `capture` is whether it came from a bench."""

    clock: Clock
    end: Cycles
    clauses: tuple[ClauseVerdict, ...]
    capture: bool = False
    unseen: tuple[str, ...] = ()
    """What the run or the recording cannot show."""

    @property
    def violated(self) -> bool:
        return any(clause.breaches for clause in self.clauses)

    @property
    def complete(self) -> bool:
        """Return whether every clause was seen and kept."""
        return not self.unseen and all(clause.kept for clause in self.clauses)

    def accepted(self, partial: bool) -> bool:
        """Return whether it passes; with `partial` also where not every clause was seen."""
        return not self.violated and (partial or self.complete)

    @property
    def word(self) -> str:
        if self.violated:
            return "violated"
        kept = "agrees" if self.capture else "exact"
        return kept if self.complete else f"{kept}, but not all of it was seen"

    def lines(self) -> Iterator[str]:
        """Yield the text, the verdict first."""
        seconds = float(self.clock.seconds(self.end))
        what = "a recording" if self.capture else "one run from power-up"
        yield f"{self.word}: {what} of {seconds:g} s, {counted(len(self.clauses), 'clause')}"
        for each in self.clauses:
            number = counted(each.seen, each.clause.counted)
            yield f"  {each.word:<9} {each.clause.text} ({number})"
            if each.first is not None:
                ms = float(self.clock.us(each.first.cycle)) / 1000
                more = f", and {each.breaches - 1} times later" if each.breaches > 1 else ""
                where = f"{each.clause.place.in_file}: " if each.clause.place.in_file else ""
                moment = f"at {ms:g} ms, cycle {each.first.cycle}"
                yield f"            {where}{moment}: {each.first.message}{more}"
        for reason in self.unseen:
            yield f"  not judged: {reason}"

    def to_json(self) -> ContractVerdictAnswer:
        return {
            "verdict": "violated" if self.violated else "kept" if self.complete else "not seen",
            "exact": self.complete and not self.capture,
            "agrees": self.complete and self.capture,
            "clock_hz": self.clock.hz,
            "end_cycle": self.end,
            "clauses": [each.to_json(self.clock) for each in self.clauses],
            "not_judged": list(self.unseen),
        }


class Watch:
    """One clause while it is watched."""

    def __init__(self, clause: Clause, from_reset: bool) -> None:
        self.clause = clause
        self.seen = int(from_reset and clause.always)
        self.breaches = 0
        self.first: Breach | None = None
        self._state = clause.observer.start(from_reset)

    def wait(self, cycle: int, levels: int, cycles: int) -> None:
        """Let time pass from a cycle on."""
        try:
            self._state = self.clause.observer.wait(self._state, levels, cycles)
        except Broken as broken:
            self._break(cycle + broken.after, broken.message)

    def react(self, cycle: int, before: int, after: int) -> None:
        """Take in a change of levels."""
        observer = self.clause.observer
        self.seen += observer.sees(self._state, before, after)
        try:
            self._state = observer.react(self._state, before, after)
        except Broken as broken:
            self._break(cycle, broken.message)
            self._state = self._again(before, after)

    def _again(self, before: int, after: int) -> State:
        """Return the state after a breach: the change that broke the clause may begin something new."""
        observer = self.clause.observer
        try:
            return observer.react(observer.after_breach(), before, after)
        except Broken:
            return observer.after_breach()

    def _break(self, cycle: int, message: str) -> None:
        self.breaches += 1
        self.first = self.first or Breach(Cycles(cycle), message)
        self._state = self.clause.observer.after_breach()

    def verdict(self) -> ClauseVerdict:
        return ClauseVerdict(self.clause, self.seen, self.breaches, self.first)


def judge_contract(
    clauses: Sequence[Clause], trace: EdgeTrace, *, from_reset: bool, capture: bool = False
) -> ContractVerdict:
    """Return the verdict on the levels of all pins; `from_reset`: whether cycle 0 is that after a reset.

    The levels at cycle 0 are those that it begins with: no instruction has changed a pin by then, and what is
    outside has not changed one since.
    """
    watches = [Watch(clause, from_reset) for clause in clauses]
    cycle = levels = 0
    for moment, after in _moments(trace.chunks):
        if moment >= trace.end:
            break
        if moment > 0:
            watched = levels ^ after
            for watch in watches:
                # An observer sees only its own pins; the time of all others is added up by the next wait.
                watch.wait(cycle, levels, moment - cycle)
                if watched & watch.clause.observer.pins:
                    watch.react(moment, levels, after)
        cycle, levels = moment, after
    for watch in watches:
        watch.wait(cycle, levels, trace.end - cycle)
    verdicts = tuple(watch.verdict() for watch in watches)
    return ContractVerdict(trace.clock, trace.end, verdicts, capture)


def _moments(chunks: Iterable[EdgeChunk]) -> Iterator[tuple[int, int]]:
    """Yield each cycle in which levels change, with all levels after it; undriven pins count as low."""
    levels = current = 0
    moment = -1
    for chunk in chunks:
        for cycle, pin, level in zip(*(column.tolist() for column in chunk), strict=True):
            if cycle != moment:
                if current != levels:
                    yield moment, current
                    levels = current
                moment = cycle
            current = current | 1 << pin if level == HIGH else current & ~(1 << pin)
    if current != levels:
        yield moment, current
