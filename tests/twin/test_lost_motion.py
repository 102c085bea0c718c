"""What the compensation of lost motion does for the robot in the physics; the soak has the whole table."""

import math

import pytest

pytest.importorskip("mujoco", reason="the twin's physics needs MuJoCo: pip install 'servogen[twin]'")

from servogen.twin import Ground, TwinSettings
from tests.twin.walking import SUPPLIED, TURN, WALK, walking


def share_of_way(compensate: bool) -> float:
    """Return the way of the ripple at 110 mm as a share of that with rigid legs."""
    made = walking(WALK, "ripple", 110, SUPPLIED, compensate=compensate)
    seen = made.twin(TwinSettings(ground=Ground(0.3)))
    assert seen.planned.rigid is not None
    assert abs(math.degrees(seen.done[2])) < 3
    return seen.done[0] / float(seen.planned.rigid[-1, 0])


@pytest.mark.campaign
def test_the_ripple_at_110_mm_goes_95_to_102_percent_of_its_way() -> None:
    assert 0.95 <= share_of_way(True) <= 1.02


@pytest.mark.campaign
def test_without_compensation_it_falls_short() -> None:
    assert share_of_way(False) < 0.94


@pytest.mark.campaign
def test_a_turn_of_180_degrees_is_one_within_8() -> None:
    seen = walking(TURN, extra=SUPPLIED).twin(TwinSettings(ground=Ground(1.0)))
    assert math.degrees(seen.done[2]) == pytest.approx(180, abs=8)
