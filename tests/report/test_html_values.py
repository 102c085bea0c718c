"""The values that a page writes down: badges, tiles, tables and the viewer's data, worked out by hand."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from servogen.edges import PINS
from servogen.job import PlannedJob, loads, plan_job
from servogen.pic.listing import ListedFunction, Listing
from servogen.pulse import PulsePlan, plan
from servogen.report import html
from servogen.report.html import CaptureFacts, PageFacts
from servogen.report.text import Overrun, ProgramFacts
from servogen.units import Clock, Cycles

TEXT = """
[chip]
device = "PIC16F84"
clock_hz = 8_000_000
[[servo]]
name = "arm"
pin = "RB0"
model = "futaba-s3001"
trim_us = 12.5
[[servo]]
name = "hand"
pin = "RA1"
model = "futaba-s3001"
[motion]
poses = [{ arm_deg = 0, hand_deg = 45, hold_s = 0.1 }, { arm_deg = 90, hand_deg = 0, hold_s = 0.2 }]
"""


def planned(text: str = TEXT, loop_start: int = 5) -> tuple[PlannedJob, PulsePlan]:
    """Fifteen frames of 20 ms, of which the last ten repeat; a cycle is half a microsecond."""
    job = plan_job(loads(text, "two.toml"))
    job = replace(job, trajectory=replace(job.trajectory, loop_start=loop_start))
    return job, plan(job.trajectory, job.servos, job.frame)


@pytest.fixture(scope="module")
def facts() -> PageFacts:
    return PageFacts(*planned(), ())


def verdict(exact: bool = True, **others: Any) -> Any:
    given = {
        "passed": exact,
        "clock": Clock(8_000_000),
        "span": SimpleNamespace(frames=30, compared=Cycles(1_200_000)),
        "plan_error": None,
        "start": Cycles(25_000),
        "reasons": (),
        "channels": (),
        "worst_edge_error": 3,
    }
    return SimpleNamespace(**{**given, **others})


def program(exact: bool = True, **others: Any) -> ProgramFacts:
    return ProgramFacts("xc8", "main.c", "main.xc8.hex", 256, 17, verdict(exact, **others))


def capture(exact: bool, agrees: bool, **others: Any) -> CaptureFacts:
    found: Any = SimpleNamespace(passed=exact, agrees=agrees, word="agrees in part", reasons=(), **others)
    return CaptureFacts("run.vcd", Any, found)  # type: ignore[arg-type]


def test_the_wiring_has_the_range_and_the_trim_of_each_servo(facts: PageFacts) -> None:
    """A Futaba S3001 of the labs: 1 ms at 0° and 1 ms more at 180°, trimmed by 12.5 µs."""
    arm, hand, supply, *_ = html.wiring_rows(facts.job)
    title = facts.job.servos[0].model.title
    low, high = facts.job.servos[1].widths_us
    assert arm == ("6", "RB0", "arm", title, f"{low + 12.5:g} to {high + 12.5:g} µs", "+12.5 µs")
    assert hand == ("18", "RA1", "hand", title, f"{low:g} to {high:g} µs", "–")
    assert supply == ("14", "VDD", "+5 V, 100 nF to VSS", "", "", "")
    assert ("4", "MCLR", "10 kΩ to VDD", "", "", "") in list(html.wiring_rows(facts.job))


def test_rounded_widths_have_the_pulse_that_they_are_of(facts: PageFacts) -> None:
    """12.5 µs of trim are 25 cycles of half a microsecond: nothing is rounded."""
    first = next(iter(html.rounding(facts.plan)))
    row = facts.plan.widths[0]
    assert first == (
        "arm",
        "0.00",
        f"{float(row.requested_us):.3f}",
        str(row.cycles),
        f"{row.cycles / 2:.3f}",
        "+0.000",
        "5",
    )
    named = replace(facts.plan, widths=(replace(row, which="lowest"),))
    assert next(iter(html.rounding(named)))[0] == "arm, lowest"


def worst(error: int) -> Any:
    return SimpleNamespace(error=error)


def test_a_program_has_its_size_its_times_and_its_channels() -> None:
    """1,200,000 cycles of half a microsecond are 0.6 s; 25,000 are 12.5 ms."""
    channels = [
        SimpleNamespace(
            name="arm", pin=PINS.index("RB3"), observed=29, scheduled=30, missing=1, extra=2,
            width=worst(-4), period=worst(0), edge=worst(5),
        ),
        SimpleNamespace(
            name="b", pin=0, observed=30, scheduled=30, missing=0, extra=0,
            width=worst(0), period=worst(-7), edge=worst(0),
        ),
    ]  # fmt: skip
    budgets: Any = (SimpleNamespace(between="the pulses", worst=120, room=Cycles(500)),)
    found = replace(program(channels=channels, reasons=("late",)), timing_budgets=budgets)
    shown = html.program_values(found)
    assert shown["name"] == "main.xc8.hex"
    assert shown["facts"] == (
        "xc8, 256 words, 17 bytes of RAM, the C between the pulses at most 120 of 500 cycles"
    )
    assert (shown["exact"], shown["start"], shown["reasons"]) == (True, "12500 µs after reset", ("late",))
    assert shown["span"] == "30 frames, 0.6 s, 1200000 cycles, on all 13 pins; no plan to compare with"
    assert shown["rows"] == [
        ("arm", "RB3", "29 of 30", "1", "2", "-4", "0", "+5"),
        ("b", PINS[0], "30 of 30", "0", "0", "0", "-7", "0"),
    ]
    never = replace(program(start=None), overrun=Overrun(None))
    assert (html.program_values(never)["start"], html.program_values(never)["reasons"]) == (None, ())
    late = replace(program(), overrun=Overrun(Cycles(300)))
    assert html.program_values(late)["reasons"] == ("overrun: by cycle 300 after reset (150 µs)",)
    assert html.program_values(late)["exact"] is False


def test_a_capture_has_its_channels_in_microseconds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(html, "capture_summary", lambda verdict: ("summary",))
    spread = SimpleNamespace(worst_us=-0.25, mean_us=0.125)
    common: dict[str, Any] = {"captured": 7, "scheduled": 8, "width": spread, "jitter_us": 0.0625}
    channels = [
        SimpleNamespace(name="arm", pin=0, connected=True, mean_period_us=20_000.126, **common),
        SimpleNamespace(name="hand", pin=1, connected=False, mean_period_us=None, **common),
    ]
    assert html.capture_values(None) is None
    rows = [
        ("arm", PINS[0], "7 of 8", "-0.250", "+0.125", "20000.13", "0.062"),
        ("hand", PINS[1], "not connected", "-0.250", "+0.125", "–", "0.062"),
    ]
    for exact, agrees, badge, word in (
        (True, True, "good", "agrees in part"),
        (False, True, "open", "agrees in part"),
        (False, False, "bad", "does NOT agree"),
    ):
        assert html.capture_values(capture(exact, agrees, channels=channels)) == {
            "name": "run.vcd",
            "badge": badge,
            "word": word,
            "lines": ("summary",),
            "reasons": (),
            "rows": rows,
        }


def test_functions_are_listed_from_the_longest_to_the_shortest_then_by_address() -> None:
    functions = (
        ListedFunction(
            "early", 0x010, 0x015, minimum_cycles=7, maximum_cycles=7, ram_bytes=3, deepest_calls=2
        ),
        ListedFunction("long", 0x020, 0x03F),
        ListedFunction("late", 0x100, 0x105, maximum_cycles=9),
    )
    assert list(html.costs(Listing((), (functions[2], *functions[:2])))) == [
        ("long", "0020", "31", "0", "0", "–"),
        ("early", "0010", "5", "3", "2", "7"),
        ("late", "0100", "5", "0", "0", "up to 9"),
    ]
    assert list(html.costs(None)) == []


def test_memory_is_a_share_of_the_chips() -> None:
    """256 of 1024 words are a quarter, 17 of 68 bytes as well."""
    assert html.memory(()) == ()
    assert html.memory((program(), replace(program(), words=1))) == (
        ("program words", 256, 1024, "25.0"),
        ("bytes of RAM", 17, 68, "25.0"),
    )
