"""Which program moves a robot, and from which frame on its motion counts."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from servogen.twin import TwinSettings
from servogen.workflows import twinning
from servogen.workflows.twinning import twin_of, twin_of_build


def job(loop_start: int) -> Any:
    firmware = SimpleNamespace(dialect="xc8")
    device = SimpleNamespace(name="PIC16F84A")
    return SimpleNamespace(
        trajectory=SimpleNamespace(loop_start=loop_start), firmware=firmware, device=device, chips=()
    )


@pytest.fixture
def moved(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, ...]]:
    """What was simulated; the verdict is what it was judged by."""
    asked: list[tuple[Any, ...]] = []
    monkeypatch.setattr(twinning, "simulate", lambda *given: asked.append(given) or "record")
    monkeypatch.setattr(twinning, "planned_of", lambda played, lead_in, loops: (played, lead_in, loops))
    monkeypatch.setattr(twinning, "verdict_of", lambda *given: given)
    monkeypatch.setattr(
        twinning, "read_program", lambda path, device: SimpleNamespace(image=(path.name, device))
    )
    return asked


def test_a_job_moves_by_its_own_program_or_by_one_in_a_file(
    moved: list[tuple[Any, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The engine's soft start makes the lead-in 40 frames longer than the job's of 10."""
    own, played = job(10), job(50)
    firmware = SimpleNamespace(compilation=SimpleNamespace(image="own program"))
    made: Any = SimpleNamespace(
        job=played,
        plan=SimpleNamespace(schedule="schedule"),
        make=lambda dialect: firmware if dialect == "xc8" else None,
    )
    monkeypatch.setattr(twinning, "planned", lambda given: made if given is own else None)
    settings, told = TwinSettings(loops=3), []
    for program, image in ((None, "own program"), (Path("a/b.hex"), ("b.hex", "PIC16F84A"))):
        stimuli: Any = "stimuli"
        found: Any = twin_of(own, settings, program, stimuli, told.append)
        assert moved.pop() == (played, "schedule", image, 40, settings, "stimuli")
        assert found == ("record", own, (played, 40, 3))
    assert told == 2 * ["compiling", "moving"]


def test_a_build_moves_by_its_first_program(moved: list[tuple[Any, ...]]) -> None:
    own, played = job(0), job(7)
    programs = [SimpleNamespace(image="first"), SimpleNamespace(image="second")]
    build: Any = SimpleNamespace(job=played, plan=SimpleNamespace(schedule="schedule"), programs=programs)
    found: Any = twin_of_build(own, build)
    assert moved == [(played, "schedule", "first", 7, TwinSettings(), None)]
    assert found == ("record", own, (played, 7, TwinSettings().loops))
