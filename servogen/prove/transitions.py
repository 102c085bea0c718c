"""Runs of an abstract chip between addresses of interest, remembered by what they depended on.

A run depends on the state beside the RAM, and on the bytes that it read before it wrote them; all others
stay as they are. So its result holds for every state that agrees in those: thousands of states that differ
in the buttons' counters share the run of one frame.
"""

from __future__ import annotations

from collections.abc import Callable, Set
from operator import itemgetter

from servogen.prove.chip import FIELD, AbstractChip, ChipState, RunOutcome
from servogen.prove.forks import Choices

Ram = tuple[int, ...]
Rest = tuple[int, ...]
_PC = FIELD["PC"]


class _Memory:
    """The outcomes of runs from one state beside the RAM, by the bytes that any of them read."""

    def __init__(self) -> None:
        self.read: frozenset[int] = frozenset()
        self._key: Callable[[Ram], object] = _nothing
        self._outcomes: dict[object, RunOutcome] = {}
        self._examples: list[tuple[Ram, RunOutcome]] = []

    def get(self, ram: Ram) -> RunOutcome | None:
        """Return the outcome for a RAM that agrees with a remembered one in all bytes that were read; None if
        none does.
        """
        return self._outcomes.get(self._key(ram))

    def put(self, ram: Ram, outcome: RunOutcome) -> None:
        """Remember an outcome."""
        self._examples.append((ram, outcome))
        # The runs remembered so far read fewer bytes; their keys are made again, with the RAM that each began
        # with, so that one key serves all of them.
        if not self.read.issuperset(outcome.read):
            self.read = self.read.union(outcome.read)
            self._key = itemgetter(*sorted(self.read))
            self._outcomes = {self._key(ram): outcome for ram, outcome in self._examples}
        self._outcomes[self._key(ram)] = outcome


def _nothing(ram: Ram) -> object:
    return None


class Transitions:
    """The transition relation of a program between the addresses in `stops`."""

    def __init__(self, chip: AbstractChip, limit: int) -> None:
        self.chip = chip
        self.limit = limit
        self.stops: frozenset[int] = frozenset()
        self.runs = 0
        """Runs that were executed, not remembered."""
        self.cycles = 0
        """Cycles of these."""
        self.written: set[int] = set()
        """Places in the RAM that any run has written."""
        self._numbers: dict[Rest, int] = {}
        self._rests: list[Rest] = []
        self._memories: dict[tuple[int, Choices], _Memory] = {}

    def stop_at(self, stops: Set[int]) -> None:
        """Set the addresses; what was remembered for other ones is forgotten."""
        if stops != self.stops:
            self.stops = frozenset(stops)
            self._memories.clear()

    def number(self, rest: Rest) -> int:
        """Return a number for a state beside the RAM, always the same."""
        number = self._numbers.setdefault(rest, len(self._rests))
        if number == len(self._rests):
            self._rests.append(rest)
        return number

    def rest(self, number: int) -> Rest:
        """Return the state beside the RAM with this number."""
        return self._rests[number]

    def pc(self, number: int) -> int:
        """Return the address of the next instruction, 0 to 0x3FF, in the state with this number."""
        return self._rests[number][_PC] & 0x3FF

    def run(self, ram: Ram, rest: int, choices: Choices) -> RunOutcome:
        """Return what the chips of a state do up to the next stop."""
        memory = self._memories.get((rest, choices))
        if memory is None:
            memory = self._memories[rest, choices] = _Memory()
        outcome = memory.get(ram)
        if outcome is None:
            outcome = self.chip.run(ChipState(ram, self._rests[rest]), self.stops, self.limit, choices)
            self.runs += 1
            self.cycles += outcome.cycles
            self.written.update(place for place, _ in outcome.written)
            memory.put(ram, outcome)
        return outcome


def applied(ram: Ram, outcome: RunOutcome) -> Ram:
    """Return the RAM after a run."""
    if not outcome.written:
        return ram
    cells = list(ram)
    for place, cell in outcome.written:
        cells[place] = cell
    return tuple(cells)
