"""Runs between stops: remembered by what they depended on."""

from __future__ import annotations

from typing import Any

from servogen.prove.chip import ChipState, RunOutcome
from servogen.prove.forks import ALONE
from servogen.prove.transitions import applied
from tests.prove.chip_states import ram, rest
from tests.prove.scripted_chip import outcome, transitions_of


def test_a_run_is_repeated_only_if_it_depends_on_what_differs() -> None:
    def run(state: ChipState, choices: Any) -> RunOutcome:
        # Byte 0 decides whether byte 5 is read, too.
        read = (0, 5) if state.ram[0] else (0,)
        return outcome(10 + state.ram[5] * bool(state.ram[0]), read=read, written=((7, 1),))

    transitions, chip = transitions_of(run)
    transitions.stop_at({9})
    number = transitions.number(rest())

    def cycles(zero: int, five: int, nine: int = 0) -> int:
        return transitions.run(ram(c0=zero, c5=five, c9=nine), number, ()).cycles

    assert cycles(0, 1) == 10 and cycles(0, 2, 3) == 10 and len(chip.asked) == 1
    assert cycles(1, 1) == 11 and len(chip.asked) == 2
    assert cycles(1, 2) == 12 and cycles(1, 1, 9) == 11 and len(chip.asked) == 3
    # What was remembered before more bytes were read still serves for the bytes that it was run with.
    assert cycles(0, 1, 4) == 10 and len(chip.asked) == 3
    assert (transitions.runs, transitions.cycles, transitions.written) == (3, 10 + 11 + 12, {7})
    assert chip.asked[0][1:] == (frozenset({9}), 777, ())


def test_other_choices_states_and_stops_are_other_runs() -> None:
    transitions, _ = transitions_of(lambda state, choices: outcome())
    transitions.stop_at({9})
    one, other = transitions.number(rest()), transitions.number(rest(W=1))
    assert (one, other) == (0, 1) and transitions.number(rest(W=1)) == 1
    assert transitions.rest(1) == rest(W=1)
    for number, choices in ((one, ()), (one, (ALONE,)), (other, ()), (one, ())):
        transitions.run(ram(), number, choices)
    assert transitions.runs == 3
    transitions.stop_at({9})
    transitions.run(ram(), one, ())
    assert transitions.runs == 3
    transitions.stop_at({9, 10})
    transitions.run(ram(), one, ())
    assert transitions.runs == 4
    assert transitions.pc(transitions.number(rest(PC=0x7FF))) == 0x3FF


def test_written_bytes_are_in_the_ram_after_a_run() -> None:
    before = ram(c3=4)
    assert applied(before, outcome()) is before
    assert applied(before, outcome(written=((3, 9), (67, 1)))) == ram(c3=9, c67=1)
