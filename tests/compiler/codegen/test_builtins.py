"""Delays that clear the watchdog: exact, and never longer between two CLRWDT than they may be."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace

from servogen.compiler.codegen.builtins import watched_delay
from servogen.compiler.diagnostics import Reporter
from servogen.compiler.ir.builder import InstructionBuilder
from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import Instruction
from servogen.errors import Location
from tests.compiler.cases import every
from tests.compiler.ir.assembly import Chip, texts


class Watched(Chip):
    """A chip that notes when each CLRWDT is executed."""

    def _skips(self, ins: Instruction) -> bool:
        if ins.op == "CLRWDT":
            self.clears = [*getattr(self, "clears", []), self.cycles]
        return super()._skips(ins)


def delay(cycles: int, unwatched: int) -> tuple[Function, list[str]]:
    made = InstructionBuilder(Function("f"), place=Location("main.c", 3))
    reporter = Reporter()
    made.context = SimpleNamespace(reporter=reporter)  # type: ignore[attr-defined]
    watched_delay(made, cycles, unwatched)  # type: ignore[arg-type]
    found = [each.message for each in reporter.failure().diagnostics] if reporter.ordered() else []
    return made.function, found


SHORTEST = 11


@every("unwatched", [1, 8, 11, 12, 17, 18, 19, 50, 100])
@every("cycles", [0, 1, 2, 8, 9, 10, 11, 12, 13, 14, 15, 20, 49, 50, 51, 99, 100, 101, 1283, 1284, 1290])
def test_a_watched_delay_is_exact_and_clears_the_watchdog_in_time(cycles: int, unwatched: int) -> None:
    made, errors = delay(cycles, unwatched)
    assert errors == []
    chip = Watched({"f": made})
    chip.call("f")
    assert chip.cycles == cycles
    clears: list[int] = getattr(chip, "clears", [])
    # a shorter time is not possible: the counters are set between the first two
    limit = max(unwatched, SHORTEST)
    assert bool(clears) == bool(cycles)
    if clears:
        # a loop sets its counter first: MOVLW and MOVWF, twice
        assert clears[0] in (1, 5)
        assert all(two - one <= limit for one, two in pairwise([*clears, cycles]))
    for top, bound in made.bounds.items():
        assert chip.passed[top] == bound
    assert all(ins.fixed or ins.op == "DELAY" for ins in made.instructions())


def test_a_short_delay_needs_no_loop() -> None:
    assert texts(delay(50, 50)[0]) == ["*CLRWDT", "DELAY 49"]
    assert texts(delay(11, 1)[0]) == ["*CLRWDT", "DELAY 10"]
    assert texts(delay(0, 50)[0]) == []
    assert "*DECFSZ t1,F" in texts(delay(51, 50)[0])
    # unwatched // 2 - 8 cycles in each round
    assert "DELAY 17" in texts(delay(51, 50)[0]) and "DELAY 1" in texts(delay(51, 18)[0])


def test_the_rounds_are_counted_in_two_bytes() -> None:
    """Of five cycles each, 2 more in each 256th: 65536 · 641 / 128 + 6 cycles are one round too many."""
    made, errors = delay(328_197, 1)
    assert errors == [] and list(made.bounds.values()) == [65535]
    made, errors = delay(328_198, 1)
    text = "a delay of 328198 cycles would clear the watchdog 65536 times; the maximum is 65535"
    assert errors == [text] and made.size == 0
