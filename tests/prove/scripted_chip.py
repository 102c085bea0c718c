"""A chip whose runs are given, for what only looks at their outcomes."""

from __future__ import annotations

from typing import Any

from servogen.prove.chip import ChipState, Reason, RunOutcome
from servogen.prove.transitions import Transitions
from tests.prove.chip_states import rest


def outcome(
    cycles: int = 5, reason: Reason = Reason.STOP, after: tuple[int, ...] | None = None, **more: Any
) -> RunOutcome:
    values: dict[str, Any] = {"edges": (), "read": (), "written": ()} | more
    return RunOutcome(reason=reason, cycles=cycles, rest=rest(PC=9) if after is None else after, **values)


class Chip:
    """A chip whose runs are given by a function of its state and the choices."""

    watchdog = False

    def __init__(self, run: Any) -> None:
        self._run = run
        self.asked: list[tuple[Any, ...]] = []

    def run(self, state: ChipState, stops: Any, limit: int, choices: Any = ()) -> RunOutcome:
        self.asked.append((state, stops, limit, choices))
        result = self._run(state, choices)
        assert isinstance(result, RunOutcome)
        return result


def transitions_of(run: Any) -> tuple[Transitions, Chip]:
    chip = Chip(run)
    made: Any = chip
    return Transitions(made, 777), chip


class Ways:
    """A program's ways: from (state beside the RAM, choices) to an outcome."""

    def __init__(self, table: dict[tuple[int, Any], RunOutcome]) -> None:
        self.table = table

    def __call__(self, state: ChipState, choices: Any) -> RunOutcome:
        return self.table[state["PC"], choices]
