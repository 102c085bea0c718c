"""What a page is exact by, and which part of a capture it shows."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from servogen.edges import EdgeTrace
from servogen.errors import ToolError
from servogen.plan_error import PlanError
from servogen.traces.captures import Capture
from servogen.units import Clock, Cycles
from servogen.workflows import reporting
from servogen.workflows.reporting import ReportPage, build_page, capture_facts

CAPTURE = Capture(EdgeTrace(Clock(4_000_000), (), Cycles(10)), sample=1.0)


def judged(exact: bool, text: str = "") -> Any:
    return SimpleNamespace(passed=exact, to_json=lambda: text)


def test_a_page_in_json_says_of_each_kind_of_verdict_its_own_word() -> None:
    bare = ReportPage("", True, None)
    assert bare.to_json() == {"exact": True, "plan_error": None, "capture": None, "twin": None}
    error = PlanError(0.5)
    full = ReportPage("", True, None, error, judged(True, "of the capture"), judged(True, "of the twin"))
    assert full.to_json() == {
        "exact": True,
        "plan_error": error.to_json(),
        "capture": "of the capture",
        "twin": "of the twin",
    }


@dataclass(frozen=True)
class Judged:
    """The verdict on a capture of pieces with so many frames."""

    pieces: tuple[Any, ...] = ()
    first_frame: int = 0


def test_of_several_captures_in_a_file_the_longest_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[object] = []

    def sampled_at(capture: Capture, rate: int) -> Capture:
        asked.append(rate)
        return replace(capture, sample=1e6 / rate)

    monkeypatch.setattr(reporting, "read_capture", lambda path, wires: CAPTURE)
    monkeypatch.setattr(reporting, "sampled_at", sampled_at)
    monkeypatch.setattr(reporting, "split", lambda trace, pieces: ["first", "second", "third"])
    pieces = tuple(SimpleNamespace(frames=frames, first_frame=10 * frames) for frames in (2, 5, 3))
    schedule: Any = "schedule"
    for verdict, name, trace, first in (
        (Judged(pieces), "run.vcd, piece 2 of 3", "second", 50),
        (Judged(pieces[:1]), "run.vcd, piece 1 of 1", "first", 20),
    ):
        monkeypatch.setattr(reporting, "verdict_on", lambda *given, verdict=verdict: verdict)
        found: Any = capture_facts(schedule, Path("a/run.vcd"))
        assert (found.name, found.trace, found.verdict.first_frame) == (name, trace, first)
    assert asked == []
    monkeypatch.setattr(
        reporting, "verdict_on", lambda schedule, capture, path, wires: Judged((), capture.sample)
    )
    found = capture_facts(schedule, Path("a/run.vcd"), 500_000)
    assert (found.name, found.trace.end, found.verdict.first_frame) == ("run.vcd", 10, 2.0)
    assert asked == [500_000]


def test_that_the_robot_is_moved_is_said_before_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """It takes long, and fails without MuJoCo."""
    told: list[str] = []

    def twin_of_build(job: object, result: object) -> None:
        raise ToolError("tool-missing", f"no MuJoCo for {job} and {result}")

    monkeypatch.setattr(reporting, "build", lambda job, progress: "build")
    monkeypatch.setattr(reporting, "twin_of_build", twin_of_build)
    job: Any = "job"
    with pytest.raises(ToolError, match="no MuJoCo for job and build"):
        build_page(job, progress=told.append, twin=True)
    assert told == ["moving the robot"]
