"""The quasi-static model of rigid legs against the physics, with which it shares no equation."""

import math
import random

import pytest

pytest.importorskip("mujoco", reason="the twin's physics needs MuJoCo: pip install 'servogen[twin]'")

from servogen.twin import TwinSettings, TwinVerdict
from tests.campaigns import sampled
from tests.engines.player.own_robots import drawn
from tests.twin.own_model import compared, stronger
from tests.twin.walking import AHEAD, CURVE, SUPPLIED, TURN, WALK, rigid_end, walking

Pose = tuple[float, float, float]


def apart(one: Pose, other: Pose) -> tuple[float, float]:
    """Return how far two poses are apart, in mm and degrees."""
    return 1000 * math.dist(one[:2], other[:2]), abs(math.degrees(one[2] - other[2]))


def planned_end(verdict: TwinVerdict) -> Pose:
    assert verdict.planned.rigid is not None
    x, y, yaw = verdict.planned.rigid[-1].tolist()
    return x, y, yaw


@pytest.mark.parametrize("route", sampled([WALK, TURN, CURVE]))
def test_with_the_joint_angles_of_the_physics_it_goes_where_the_physics_goes(route: str) -> None:
    seen = walking(route, extra=SUPPLIED).twin()
    way, turn = apart(rigid_end(seen), seen.done)
    assert way <= 5 and turn <= 3


@pytest.mark.parametrize("route", sampled([WALK, TURN]))
def test_the_path_of_the_plan_is_the_one_of_the_physics(route: str) -> None:
    """Of the curve it is not: where joints lag, the direction of all that follows changes."""
    seen = walking(route, extra=SUPPLIED).twin()
    way, turn = apart(planned_end(seen), seen.done)
    assert way <= 5 and turn <= 3


def test_a_servo_that_does_not_follow_takes_the_robot_off_the_path_of_the_plan() -> None:
    seen = walking(AHEAD, extra=SUPPLIED).twin(TwinSettings(unplugged=("R2-lift",)))
    way, turn = apart(planned_end(seen), seen.done)
    assert way > 5 and turn > 3


@pytest.mark.campaign
def test_a_model_of_its_own_that_reads_the_files_alone_goes_where_the_twin_goes() -> None:
    """`python -m tests.twin.own_model` compares twelve random robots."""
    found = compared(stronger(drawn(0, random.Random(1), "hip-lift"), 0, 8))
    assert found.good
    assert abs(found.own[2]) > 0.1 and found.ways[0] > 0.1
