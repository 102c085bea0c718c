"""A servo at a pin turns pulses into an angle, no faster than it can."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from servogen.edges import PINS, edge_chunk
from servogen.errors import InputError
from servogen.simulator import ServoLoad
from tests.simulator.helpers import CLOCK

RB0 = PINS.index("RB0")
S3001 = ServoLoad((1000.0, 2000.0), (0.0, math.pi), speed=1.8)


def pulses(widths: list[int], period: int = 20_000) -> list[object]:
    rows = [(n * period + at, RB0, level) for n, w in enumerate(widths, 1) for at, level in ((0, 1), (w, 0))]
    return [edge_chunk(*zip(*rows, strict=True))]


def angles(widths: list[int], load: ServoLoad = S3001) -> list[float]:
    return [position.angle for position in load.positions(pulses(widths), CLOCK, RB0)]  # type: ignore[arg-type]


def test_the_commanded_angle_is_linear_in_the_width_and_stops_at_the_travels_ends() -> None:
    commanded = [p.commanded for p in S3001.positions(pulses([1500, 1000, 2000, 2500, 500]), CLOCK, RB0)]  # type: ignore[arg-type]
    assert commanded == pytest.approx([math.pi / 2, 0, math.pi, math.pi, 0])


def test_the_shaft_moves_no_faster_than_the_servos_speed() -> None:
    found = angles([2000] * 120)
    steps = [b - a for a, b in pairwise(found)]
    assert max(steps) == pytest.approx(1.8 * 0.02)
    assert found[-1] == pytest.approx(math.pi)
    assert found[1] - found[0] == pytest.approx(1.8 * 0.02)


def test_a_servo_without_pulses_stays() -> None:
    assert list(S3001.positions([], CLOCK, RB0)) == []
    assert angles([1000, 1000]) == [0.0, 0.0]


def test_a_pulse_may_be_divided_between_chunks() -> None:
    whole = list(S3001.positions(pulses([1500] * 3), CLOCK, RB0))  # type: ignore[arg-type]
    (chunk,) = pulses([1500] * 3)
    parts = [edge_chunk(*(column[i : i + 1] for column in chunk)) for i in range(6)]  # type: ignore[attr-defined]
    assert list(S3001.positions(parts, CLOCK, RB0)) == whole


@pytest.mark.parametrize("widths", [(1000.0,), (2000.0, 1000.0)])
def test_a_calibration_needs_two_rising_widths(widths: tuple[float, ...]) -> None:
    with pytest.raises(InputError, match="rising pulse widths"):
        ServoLoad(widths, tuple(0.0 for _ in widths), 1.0)
    with pytest.raises(InputError, match="more than 0"):
        ServoLoad((1.0, 2.0), (0.0, 1.0), 0.0)
