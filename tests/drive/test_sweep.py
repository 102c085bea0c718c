"""The widths of a calibration: at even distances, both ends of the range included, never beyond a limit."""

from __future__ import annotations

import math
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from servogen.drive.controller import ControllerChannel, ServoController
from servogen.drive.serial_link import VirtualTime
from servogen.drive.sweep import Sweep, positions, refusals, servo_index, sweep_readings
from servogen.errors import InputError
from servogen.job import load
from servogen.robot.calibration import Reading, calibration_text, fit, write_calibration
from tests.bench.conftest import ROOT


@pytest.fixture
def channel() -> ControllerChannel:
    """201 positions, of which 50 and 150 are the limits, the others at even distances."""
    servo = load(ROOT / "jobs" / "lab8-exercise.toml").servos[0]
    servo = replace(servo, trim_us=0.0, reverse=False)
    low, high = servo.widths_us
    assert low < high
    step = (high - low) / 100
    return ControllerChannel(servo, 0, tuple(low - 50 * step + each * step for each in range(201)))


def test_the_whole_range_ends_at_the_servos_limits(channel: ControllerChannel) -> None:
    """Positions 50 and 150 are exactly the limits."""
    assert positions(channel, None, None, 5) == (50, 75, 100, 125, 150)


def test_a_range_of_widths_includes_both_ends(channel: ControllerChannel) -> None:
    low, high = channel.widths_us[60], channel.widths_us[70]
    assert positions(channel, low, high, 11) == tuple(range(60, 71))
    assert positions(channel, low, high, 3) == (60, 65, 70)


def test_a_range_between_positions_takes_those_inside(channel: ControllerChannel) -> None:
    step = channel.widths_us[1] - channel.widths_us[0]
    low, high = channel.widths_us[60] + 0.25 * step, channel.widths_us[70] - 0.25 * step
    assert positions(channel, low, high, 9) == tuple(range(61, 70))


@pytest.mark.parametrize(("below", "above"), [(0.01, 0.0), (0.0, 0.01)])
def test_a_hundredth_of_a_microsecond_beyond_a_limit_is_refused(
    channel: ControllerChannel, below: float, above: float
) -> None:
    low, high = channel.servo.widths_us
    with pytest.raises(InputError, match="accepts 1000 to"):
        positions(channel, low - below, high + above, 5)


def test_rounding_beyond_a_limit_is_not_refused(channel: ControllerChannel) -> None:
    low, high = channel.servo.widths_us
    most = positions(channel, low - 0.5 * channel.slack_us, high + 0.5 * channel.slack_us, 101)
    assert most == tuple(range(50, 151))


def test_as_many_points_as_there_are_positions_and_no_more(channel: ControllerChannel) -> None:
    low, high = channel.widths_us[60], channel.widths_us[64]
    assert positions(channel, low, high, 5) == (60, 61, 62, 63, 64)
    with pytest.raises(InputError, match="produces 5 widths there"):
        positions(channel, low, high, 6)


def test_three_points_are_the_fewest(channel: ControllerChannel) -> None:
    assert len(positions(channel, None, None, 3)) == 3
    with pytest.raises(InputError, match="3 points or more"):
        positions(channel, None, None, 2)
    assert math.isclose(channel.widths_us[50], channel.servo.widths_us[0])


def test_a_width_exactly_the_slack_beyond_an_end_still_counts(channel: ControllerChannel) -> None:
    widths, slack = channel.widths_us, channel.slack_us
    low, high = widths[60], widths[70]
    near = replace(channel, widths_us=(*widths[:59], low - slack, *widths[60:71], high + slack, *widths[72:]))
    assert positions(near, low, high, 13) == tuple(range(59, 72))


def test_a_range_exactly_the_slack_beyond_the_limits_is_allowed(channel: ControllerChannel) -> None:
    low, high = channel.servo.widths_us
    assert len(positions(channel, low - channel.slack_us, high + channel.slack_us, 3)) == 3


Sent = list[tuple[float, int]]


def swept(channel: ControllerChannel, at: int) -> tuple[Sweep, VirtualTime, Sent]:
    """A sweep that stands at a position, its clock, and the positions that it sends, with their times."""
    clock, sent = VirtualTime(), Sent()
    line = SimpleNamespace(send=lambda data: sent.append((round(clock.at, 6), data[-1])))
    controller = ServoController((channel,), None, 0.05)
    return Sweep(controller, 0, line, clock.time(), at), clock, sent  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("begin", "end", "way"),
    [
        (100, 110, [103, 106, 109, 110]),
        (110, 100, [107, 104, 101, 100]),
        (100, 103, [103]),
        (100, 101, [101]),
        (100, 100, [100]),
    ],
)
def test_a_servo_goes_through_its_range_in_a_second_and_a_half_and_settles(
    channel: ControllerChannel, begin: int, end: int, way: list[int]
) -> None:
    """254 positions in 75 steps of 20 ms: three in each."""
    sweep, clock, sent = swept(channel, begin)
    sweep.go(end)
    assert sent == [(round(0.02 * number, 6), position) for number, position in enumerate(way)]
    assert clock.at == pytest.approx(0.02 * len(way) + 0.5)
    assert sweep.at == end


def test_the_position_is_sent_again_while_a_person_thinks(channel: ControllerChannel) -> None:
    """Asked every 20 ms; sent again once 50 ms have passed, which is after 60."""
    sweep, _, sent = swept(channel, 100)
    answers = iter([None] * 10 + ["90"])
    assert sweep.wait_for(lambda: next(answers)) == "90"
    assert sent == [(0.06, 100), (0.12, 100), (0.18, 100)]


def test_a_sweep_begins_and_ends_in_the_middle_also_when_it_is_broken_off(channel: ControllerChannel) -> None:
    sweep, clock, sent = swept(channel, 0)

    def angle(sweep: Sweep, point: int) -> float:
        asked.append((sweep.at, point))
        if broken and point:
            raise KeyboardInterrupt
        return float(point)

    for broken in (False, True):
        asked: list[tuple[int, int]] = []
        sent.clear()
        wait = pytest.raises(KeyboardInterrupt) if broken else nullcontext()
        with wait:
            found = sweep_readings(sweep.controller, 0, (90, 97), sweep.line, clock.time(), angle)
            assert found == [Reading(channel.widths_us[90], 0.0), Reading(channel.widths_us[97], 1.0)]
        assert asked == [(90, 0), (97, 1)]
        positions = [position for _, position in sent]
        assert positions == [100, 97, 94, 91, 90, 93, 96, 97, 100]


def test_the_only_servo_of_a_job_needs_no_name() -> None:
    one, three = (load(ROOT / "jobs" / f"{name}.toml") for name in ("lab8-exercise", "omni-square"))
    assert servo_index(one, None) == servo_index(one, "arm") == 0
    assert servo_index(three, "wheel3") == 2
    for name in (None, "wheel4"):
        with pytest.raises(InputError) as error:
            servo_index(three, name)
        assert "wheel" in (error.value.diagnostics[0].hint or "")


def test_a_calibration_with_which_the_motion_is_impossible_is_refused(tmp_path: Path) -> None:
    """1500 µs at 0° and 8 µs per degree: 120° would need 2460 µs, more than the servo accepts."""
    file = tmp_path / "arm.calibration.toml"
    readings = tuple(Reading(1500 + 8 * angle, math.radians(angle)) for angle in (0, 30, 60))
    job = load(ROOT / "jobs" / "lab8-exercise.toml")
    write_calibration(file, calibration_text(fit(readings, math.radians(5), False), job.servos[0]))
    assert {each.severity for each in refusals(job, "arm", file)} == {"warning"}
    readings = tuple(Reading(1000 + 5.6 * angle, math.radians(angle)) for angle in (0, 90, 180))
    write_calibration(file, calibration_text(fit(readings, math.radians(5), False), job.servos[0]))
    assert refusals(job, "arm", file) == ()
