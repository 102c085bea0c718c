"""The sections of report.txt, line by line, of builds made by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from servogen.engines.firmware import TimingBudget
from servogen.report import text
from servogen.report.text import Overrun, ProgramFacts
from servogen.units import Clock, Cycles

CLOCK = Clock(8_000_000)  # a cycle is half a microsecond


def program(*budgets: TimingBudget, **others: Any) -> ProgramFacts:
    verdict: Any = SimpleNamespace(passed=True)
    return ProgramFacts("c2c", "main.c", "main.hex", 200, 8, verdict, budgets, **others)


def budget(
    worst: int | None, room: int, seen: int | None = None, between: str = "the pulses"
) -> TimingBudget:
    late = None if seen is None else Cycles(seen)
    return TimingBudget(between, None if worst is None else Cycles(worst), Cycles(room), late)


def facts(**others: Any) -> Any:
    return SimpleNamespace(**others)


def test_only_sections_with_lines_are_shown_below_the_name(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("_chip", "_wiring", "_pulses", "_motion", "_paths", "_programs", "_verdict", "_warnings"):
        lines = {"_chip": ["chip  "], "_motion": ["one", "two"]}.get(name, [])
        monkeypatch.setattr(text, name, lambda facts, lines=lines: iter(lines))
    report = text.report_text(facts(job=SimpleNamespace(name="arm")))
    assert report == "arm\n===\n\nChip\n----\nchip\n\nMotion\n------\none\ntwo\n"


def test_the_c_between_the_pulses_has_a_bound_and_what_is_left_of_its_room() -> None:
    lines = list(text.timing_budgets_text([program(budget(120, 500), budget(None, 90))], CLOCK))
    assert lines[0] == "The C between the pulses, in cycles:"
    assert lines[2].split() == ["c2c", "the", "pulses", "120", "500", "380", "(190", "µs)"]
    assert lines[3].split() == ["c2c", "the", "pulses", "not", "known", "90", "?"]
    assert list(text.timing_budgets_text([program()], CLOCK)) == []


def test_any_compiler_has_the_room_and_the_time_that_is_noticed() -> None:
    first = program(budget(1, 500, 700), budget(1, 40, 60, "frames"))
    rooms = [first, program(budget(1, 9, None, "others"))]
    assert list(text.any_compiler(rooms)) == [
        "Any compiler that keeps the kernel's assembly: the same edges with at most "
        "500 between the pulses and 40 between frames;",
        "the same edges, or overrun is set, with at most 700 between the pulses and 60 between frames.",
    ]
    assert list(text.any_compiler([program(budget(1, 2))])) == []


@pytest.mark.parametrize(
    ("at", "worst", "line"),
    [
        (None, 5, "c2c: overrun: never"),
        (300, 5, "c2c: overrun: by cycle 300 after reset (150 µs)"),
        (None, 10, "c2c: overrun: never"),
        (None, 11, "c2c: overrun: never in this run; the bound over all paths exceeds the room"),
    ],
)
def test_an_overrun_is_said_with_what_it_holds_for(at: int | None, worst: int, line: str) -> None:
    late = Overrun(None if at is None else Cycles(at))
    lines = list(text.timing_budgets_text([program(budget(worst, 10), overrun=late)], CLOCK))
    assert lines[-1] == line


@pytest.mark.parametrize("eeprom", [True, False])
def test_a_script_in_the_eeprom_is_said(eeprom: bool) -> None:
    script: Any = SimpleNamespace(eeprom=eeprom, text="30 bytes")
    lines = list(text.timing_budgets_text([program(script=script)], CLOCK))
    assert lines == ["c2c: script: 30 bytes; the trims are before it"] * eeprom


def test_a_program_is_proven_if_it_was_never_late() -> None:
    assert program().exact
    assert program(overrun=Overrun(None)).exact
    assert not program(overrun=Overrun(Cycles(0))).exact
