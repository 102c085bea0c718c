"""The picture of a calibration: its words, its styles and the range of its residuals."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from matplotlib.colors import same_color

from servogen.errors import InputError
from servogen.job import loads
from servogen.report import calibration_plot
from servogen.robot.calibration import Reading, fit
from servogen.robot.servo import Servo
from tests.report.legible import check_legible
from tests.report.test_html import JOB


@pytest.fixture
def servo() -> Servo:
    return loads(JOB, "job.toml").servos[0]


def drawn(monkeypatch: pytest.MonkeyPatch, servo: Servo, *readings: tuple[float, float]) -> Any:
    """The figure of readings (width in µs, angle in degrees)."""
    figures: list[Any] = []
    monkeypatch.setattr(calibration_plot, "save", lambda figure, path: figures.append(figure))
    taken = [Reading(width, math.radians(angle)) for width, angle in readings]
    calibration_plot.calibration_plot(fit(taken, math.radians(20)), servo, Path("a.png"))
    return figures[0]


def test_the_words_of_a_calibration_have_its_numbers_with_their_sign(
    monkeypatch: pytest.MonkeyPatch, servo: Servo
) -> None:
    """1000 µs at 0° and 5 µs a degree; then the same reversed, from 1900 µs down."""
    up = drawn(monkeypatch, servo, (1000, 0), (1450, 90), (1900, 180))
    down = drawn(monkeypatch, servo, (1900, 0), (1450, 90), (1000, 180))
    for figure, text in ((up, "fit: 1000.0 µs + 5.000 µs/°"), (down, "fit: 1900.0 µs − 5.000 µs/°")):
        above, below = figure.axes
        assert figure.get_suptitle() == f"arm: 3 readings of a {servo.model.title}"
        legend = above.get_legend()
        assert [each.get_text() for each in legend.get_texts()] == [text, "the job until now", "read"]
        assert not legend.get_frame_on()
        assert (above.get_ylabel(), below.get_ylabel()) == ("pulse width, µs", "residual, °")
        assert (above.get_xlabel(), below.get_xlabel()) == ("", "angle seen, °")
        assert above.get_shared_x_axes().joined(above, below)
        for axes in figure.axes:
            line = axes.xaxis.get_gridlines()[0]
            assert line.get_visible()
        check_legible(figure)


def test_a_wheel_has_speeds(monkeypatch: pytest.MonkeyPatch, servo: Servo) -> None:
    wheel = replace(servo, model=replace(servo.model, continuous=True))
    _, below = drawn(monkeypatch, wheel, (1000, 0), (1450, 90), (1900, 180)).axes
    assert (below.get_xlabel(), below.get_ylabel()) == ("speed, °/s", "residual, °/s")


@pytest.mark.parametrize(("off", "most"), [(0.0, 0.6), (0.6, 0.6), (0.75, 0.6), (0.9, 0.72), (3.0, 2.4)])
def test_the_residuals_have_half_a_degree_at_least_and_a_fifth_more_than_the_greatest(
    monkeypatch: pytest.MonkeyPatch, servo: Servo, off: float, most: float
) -> None:
    """The middle of three readings is off: two thirds of it remain, a third at each end."""
    _, below = drawn(monkeypatch, servo, (1000, 0), (1450, 90 + off), (1900, 180)).axes
    assert below.get_ylim() == pytest.approx((-most, most))
    _, mirrored = drawn(monkeypatch, servo, (1000, 0), (1450, 90 - off), (1900, 180)).axes
    assert mirrored.get_ylim() == pytest.approx((-most, most))


def test_the_fit_is_a_line_the_readings_are_dots_and_the_old_line_is_dashed(
    monkeypatch: pytest.MonkeyPatch, servo: Servo
) -> None:
    figure = drawn(monkeypatch, servo, (1000, 0), (1450, 90), (1900, 180))
    above, below = figure.axes
    line, before, read = above.lines
    assert line.get_linestyle() == "-"
    assert not same_color(before.get_color(), line.get_color())
    assert before.get_linestyle() == "--"
    zero, dots = below.lines
    for each in (read, dots):
        assert (each.get_marker(), each.get_linestyle()) == ("o", "None")
    assert list(zero.get_ydata()) == [0, 0]
    assert len(below.collections) == 1  # from the line to each dot
    assert above.bbox.height > below.bbox.height


def test_an_unknown_ending_is_refused(servo: Servo) -> None:
    taken = [Reading(1000 + 5.0 * angle, math.radians(angle)) for angle in (0, 90, 180)]
    with pytest.raises(InputError, match=r"'\.gif' is not a picture"):
        calibration_plot.calibration_plot(fit(taken), servo, Path("a.gif"))
