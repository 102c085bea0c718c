"""A picture of pulses shows what the trace has: channels, distinct frames, pulses that overlap."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from servogen.edges import HIGH, LOW, PINS, EdgeChunk, EdgeTrace
from servogen.errors import InputError
from servogen.report import pulse_plot as pulse_plot_module
from servogen.report.pulse_plot import (
    MAX_FRAMES_SHOWN,
    PlottedFrame,
    PlottedPulses,
    _lanes,
    _period,
    _starts,
    distinct_frames,
    observed_pulses,
    pulse_plot,
)
from servogen.units import Clock, Cycles

CLOCK = Clock(8_000_000)  # a cycle is half a microsecond


def trace(*pulses: tuple[str, int, int], end: int = 100_000) -> EdgeTrace:
    """(pin, rise, width) in cycles; both pins are driven low at cycle 10."""
    rows = [(10, PINS.index(pin), LOW) for pin in dict.fromkeys(pulse[0] for pulse in pulses)]
    for pin, rise, width in pulses:
        rows += [(rise, PINS.index(pin), HIGH), (rise + width, PINS.index(pin), LOW)]
    cycle, pin_, level = np.array(sorted(rows)).T
    chunk = EdgeChunk(cycle.astype(np.int64), pin_.astype(np.uint8), level.astype(np.uint8))
    return EdgeTrace(CLOCK, (chunk,), Cycles(end))


def channel(*pulses: tuple[float, float]) -> PlottedPulses:
    rise, width = np.array(pulses, dtype=float).T
    return PlottedPulses("x", "C0", rise, width)


def test_without_a_schedule_every_pin_that_pulses_is_a_channel() -> None:
    found = observed_pulses(trace(("RB1", 300, 40), ("RA2", 200, 20)), 10_000, None)
    assert [each.label for each in found] == ["RA2", "RB1"]
    assert [(each.rise.tolist(), each.width.tolist()) for each in found] == [([0], [10]), ([50], [20])]


def test_a_pulse_that_the_trace_or_the_span_cuts_off_is_not_drawn() -> None:
    edges = trace(("RB0", 100, 20), ("RB0", 300, 20), ("RB0", 500, 20))
    (found,) = observed_pulses(edges.until(510), 10_000, None)
    assert found.rise.tolist() == [0, 100]
    (found,) = observed_pulses(edges, 150, None)
    assert found.rise.tolist() == [0]


def test_frames_without_a_schedule_begin_with_their_first_pulse_whatever_their_lengths() -> None:
    """As in the printed programs: 19 ms and 20 ms, and a pause."""
    first, second = channel((0, 1), (19, 1), (69, 2), (89, 2)), channel((2, 1), (21, 1), (71, 1), (91, 1))
    starts = _starts([first, second], _period([first, second]), free=True)
    assert starts.tolist() == [0, 19, 69, 89]


def test_each_set_of_widths_is_shown_once() -> None:
    frames = distinct_frames([channel((0, 1), (20, 1), (40, 2), (60, 1))], np.array([0.0, 20, 40, 60]), 20)
    assert frames == [PlottedFrame(0, 20), PlottedFrame(40, 60)]


def test_of_many_frames_the_first_and_the_last_are_shown_and_some_between() -> None:
    many = channel(*((20.0 * number, 1.0 + number) for number in range(101)))
    frames = distinct_frames([many], many.rise, 20)
    assert [frame.start for frame in frames] == [0, 400, 800, 1200, 1600, 2000]
    assert len(frames) == MAX_FRAMES_SHOWN


def test_pulses_that_overlap_stand_below_each_other_and_others_beside() -> None:
    together, between, after = channel((0, 10)), channel((5, 10)), channel((15, 10))
    assert _lanes([together, between, after], [PlottedFrame(0, 100)]) == [0, 1, 0]
    assert _lanes([together, after, after], [PlottedFrame(0, 100)]) == [0, 0, 1]


def test_a_trace_without_pulses_is_no_picture(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no pulses to draw"):
        pulse_plot(trace(("RB0", 10, 5)).until(12), 100, tmp_path / "p.png", "none")
    assert not list(tmp_path.iterdir())


def test_below_the_widths_there_is_one_panel_for_each_distinct_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    figures: list[Any] = []
    monkeypatch.setattr(pulse_plot_module, "save", lambda figure, path: figures.append(figure))
    found = trace(("RB1", 300, 2000), ("RB1", 40_300, 3000), ("RB1", 80_300, 2000))
    pulse_plot(found, 100_000, Path("a.png"), "two widths")
    widths, *frames = figures[0].axes
    assert len(frames) == 2
    assert widths.get_ylabel() == "pulse width, µs"
    assert [text.get_text() for axes in frames for text in axes.texts] == ["1000 µs", "1500 µs"]
    assert [axes.get_xlabel() for axes in frames] == ["", "time in the frame, ms"]
