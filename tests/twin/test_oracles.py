"""The physics against closed forms: what docs/twin.md says that its settings pass."""

import math

import pytest

pytest.importorskip("mujoco", reason="the twin's physics needs MuJoCo: pip install 'servogen[twin]'")

from tests.twin.scenes import elliptic_period, fall, pendulum_period, slides

STANDARD_GRAVITY = 9.80665


def test_a_pendulum_of_60_degrees_has_the_period_of_the_elliptic_integral() -> None:
    known = elliptic_period(math.radians(60), 0.25, STANDARD_GRAVITY)
    assert known == pytest.approx(2 * math.pi * math.sqrt(0.25 / STANDARD_GRAVITY) * 1.0731820, rel=1e-6)
    assert pendulum_period(math.radians(60), 0.25, 10) == pytest.approx(known, rel=1e-3)


def test_a_fall_is_half_a_step_ahead_of_the_closed_form_and_its_speed_exact() -> None:
    """A semi-implicit step moves with the speed at its end: s = g t (t + dt) / 2."""
    way, speed = fall(1.0)
    assert speed == pytest.approx(STANDARD_GRAVITY, rel=1e-9)
    assert way == pytest.approx(STANDARD_GRAVITY * 1.0 * 1.001 / 2, rel=1e-9)
    assert way == pytest.approx(STANDARD_GRAVITY / 2, rel=2e-3)


@pytest.mark.parametrize("friction", [0.3, 0.5, 0.8])
def test_a_block_slides_from_the_angle_of_friction_on(friction: float) -> None:
    angle = math.atan(friction)
    assert not slides(angle - math.radians(0.5), friction)
    assert slides(angle + math.radians(0.5), friction)
