"""The sections of report.txt, line by line, of builds made by hand."""

from __future__ import annotations

import math
from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import pytest

from servogen.engines.firmware import TimingBudget
from servogen.errors import Diagnostic, Location
from servogen.pulse import Channel, Pulse, PulseSchedule, Quantised, Run
from servogen.pulse.schedule import Input
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


@pytest.mark.parametrize(
    ("value", "shown"),
    [(Fraction(1, 3), "0.333333"), (Fraction(5), "5"), (Fraction(0), "0"), (Fraction(1, 4), "0.25"),
     (Fraction(100), "100"), (Fraction(-1, 10**9), "0")],
)  # fmt: skip
def test_a_number_has_six_decimals_at_most(value: Fraction, shown: str) -> None:
    assert text._number(value) == shown


def test_a_table_is_as_wide_as_its_widest_cells() -> None:
    lines = list(text._table(("a", "long"), [("wide", "b"), ("c", "d")]))
    assert lines == ["a     long", "wide  b   ", "c     d   "]


def test_only_sections_with_lines_are_shown_below_the_name(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("_chip", "_wiring", "_pulses", "_motion", "_paths", "_programs", "_verdict", "_warnings"):
        lines = {"_chip": ["chip  "], "_motion": ["one", "two"]}.get(name, [])
        monkeypatch.setattr(text, name, lambda facts, lines=lines: iter(lines))
    report = text.report_text(facts(job=SimpleNamespace(name="arm")))
    assert report == "arm\n===\n\nChip\n----\nchip\n\nMotion\n------\none\ntwo\n"


def test_the_chip_has_its_crystal_and_its_cycle() -> None:
    """DS35007 section 6.2: HS above 4 MHz."""
    job = SimpleNamespace(clock=CLOCK, device=SimpleNamespace(name="PIC16F84A"))
    assert list(text._chip(facts(job=job))) == [
        "PIC16F84A, 8000000 Hz crystal (HS)",
        "One instruction cycle is 0.5 µs.",
    ]


def width(which: str = "") -> Quantised:
    """90° asked for as 1500.2 µs, made as 3000 cycles."""
    return Quantised("arm", math.pi / 2, Fraction("1500.2"), Cycles(3000), Fraction(1500), 7, which)


@pytest.mark.parametrize("which", ["", "longest"])
def test_pulses_have_their_error_and_perhaps_which_they_are(which: str) -> None:
    schedule = SimpleNamespace(period=Cycles(40_000), clock=CLOCK)
    lines = list(text._pulses(facts(plan=SimpleNamespace(schedule=schedule, widths=[width(which)]))))
    head = ["servo", *(["pulse"] if which else [])]
    columns = ["angle_deg", "requested_us", "cycles", "achieved_us", "error_us", "frames"]
    assert lines[0].split() == [*head, *columns]
    cells = ["arm", *([which] if which else []), "90.00", "1500.200", "3000", "1500.000", "-0.200", "7"]
    assert lines[1].split() == cells
    assert lines[2:] == ["", "Period 40000 cycles, 20000 µs."]


def test_a_motion_has_its_levels_its_parts_and_its_notes() -> None:
    run = Run(50, (Pulse(Cycles(0), Cycles(1)),))
    channels = (Channel("a", "RB0", ""),)
    inputs = (Input("RB1", 1), Input("RB2", 0))
    schedule = PulseSchedule(CLOCK, Cycles(40_000), channels, (run,), (run, run), inputs=inputs)
    job = SimpleNamespace(notes=[SimpleNamespace(message="a note")])
    assert list(text._motion(facts(plan=SimpleNamespace(schedule=schedule), job=job))) == [
        "with RB1 high, RB2 low from power-up on:",
        "lead-in: 50 frames, 1 s",
        "loop: 100 frames, 2 s",
        "a note",
    ]
    plain = PulseSchedule(CLOCK, Cycles(40_000), channels, (), (run,))
    lines = list(text._motion(facts(plan=SimpleNamespace(schedule=plain), job=SimpleNamespace(notes=[]))))
    assert lines == ["loop: 50 frames, 1 s"]


def test_programs_have_what_is_left_and_the_commands_of_other_compilers() -> None:
    """1024 words and 68 bytes: DS35007 sections 2.1 and 2.2."""
    job = SimpleNamespace(clock=CLOCK, device=SimpleNamespace(name="PIC16F84A"))
    lines = list(text._programs(facts(engine="player", programs=(program(),), job=job)))
    assert lines.pop(0) == "Engine: player"
    assert lines[1].split() == ["c2c", "main.c", "main.hex", "200", "824", "8", "of", "68"]
    assert lines[2] == ""
    assert [line.split()[0] for line in lines[4:]] == ["compiler", "C2C", "XC8", "SDCC"]
    assert "main.c2c.c, which states the configuration word" in lines[5]
    assert "xc8-cc -mcpu=16f84a " in lines[6]
    assert "sdcc -mpic14 -p16f84a " in lines[7]


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


def test_warnings_are_sentences_without_folders() -> None:
    first = Diagnostic("warning", "w", "odd", Location("/home/x/a.toml", 3))
    plain = Diagnostic("warning", "w", "even")
    nowhere = Diagnostic("warning", "w", "key", Location(key="motion"))
    lines = list(text._warnings(facts(warnings=(first, plain, nowhere))))
    assert lines[0].startswith("a.toml:3")
    assert lines[0].endswith(": odd")
    assert lines[1] == "even"
    assert lines[2].endswith("motion: key")
    assert list(text._warnings(facts(warnings=()))) == ["none"]
