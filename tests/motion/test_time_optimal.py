"""The fastest way along a course: what is known in closed form, and what every fastest way has."""

import math
from pathlib import Path

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.job import PlannedJob, plan_job
from servogen.job.reader import loads
from servogen.job.starter import template
from servogen.kinematics.statics import GRAVITY
from servogen.motion.follow import Followed
from servogen.motion.limits import JointLimits, at_rest, stretch
from servogen.motion.moves import quickest_along, quickest_through
from servogen.motion.time_optimal import time_optimal
from servogen.motion.torque import TorqueLimits
from servogen.robot.binding import Binding
from servogen.robot.model import Arm, DHRow, FixedFrame, Joint, Length

SPEED, ACCELERATION = 2.0, 5.0
BOTH = [JointLimits(SPEED, ACCELERATION)] * 2


def test_a_straight_course_takes_the_time_of_ramps_and_full_speed() -> None:
    timed = time_optimal(lambda share: np.outer(share, [3.0, 1.0]), BOTH)
    assert timed is not None
    assert timed.duration == pytest.approx(3 / SPEED + SPEED / ACCELERATION, rel=1e-6)


def test_a_circle_is_driven_at_the_speed_that_its_curvature_allows() -> None:
    """On a circle of r the acceleration toward the middle is v²/r: many turns are at v = √(a r) or less."""
    limits = [JointLimits(math.inf, ACCELERATION)] * 2
    turns = 40 * math.pi

    timed = time_optimal(
        lambda share: 0.1 * np.stack((np.cos(turns * share), np.sin(turns * share)), axis=1), limits
    )
    assert timed is not None
    fastest, slowest = (math.sqrt(ACCELERATION * 0.1 * factor) for factor in (math.sqrt(2), 1))
    # Each joint alone may have the whole acceleration: over the diagonal that is up to √2 of it.
    assert 0.1 * turns / fastest < timed.duration < 1.02 * 0.1 * turns / slowest + 2 * fastest / ACCELERATION


def test_a_limit_counts_although_the_course_turns_back_in_a_joint() -> None:
    def follow(shares: np.ndarray) -> Followed:
        return Followed(shares, np.stack((2 * shares, np.sin(6 * shares)), axis=1), 0.0)

    move = quickest_along(follow, BOTH, 0.01)
    assert move is not None and stretch(at_rest(move.angles), 0.01, BOTH) <= 1 + 1e-9
    # At every moment some joint is at one of its limits, else it would not be the fastest.
    speeds = np.abs(np.diff(move.angles, axis=0)) / 0.01 / SPEED
    forces = np.abs(np.diff(move.angles, 2, axis=0)) / 0.01**2 / ACCELERATION
    used = np.maximum(forces.max(axis=1), np.minimum(speeds[1:], speeds[:-1]).max(axis=1))
    assert np.quantile(used, 0.1) > 0.9
    # In 7 % less time no limit would be kept.
    timed = time_optimal(lambda shares: follow(shares).angles, BOTH)
    assert timed is not None
    short = follow(timed.shares_in(math.floor(0.93 * timed.duration / 0.01)))
    assert stretch(at_rest(short.angles), 0.01, BOTH) > 1.03


def test_a_course_without_any_limit_is_refused_and_one_that_rests_takes_no_time() -> None:
    with pytest.raises(InputError, match="the speed of this move is not known"):
        time_optimal(lambda share: np.outer(share, [1.0]), [JointLimits()])
    assert time_optimal(lambda share: np.outer(0 * share, [1.0]), [JointLimits()]) is None


def test_via_points_are_passed_on_the_same_curve_in_fewer_frames() -> None:
    points = np.array([[0, 0], [1, 0.1], [1.1, 1], [3, 1]])
    move = quickest_through(points, BOTH, 0.01)
    near = np.linalg.norm(move[:, None, :] - points[None, 1:], axis=2).min(axis=0)
    assert (
        near.max() < 0.03
        and stretch(np.vstack((points[:1], points[:1], move, move[-1:])), 0.01, BOTH) <= 1 + 1e-9
    )


def job_of(poses: str) -> PlannedJob:
    text = template("arm").replace(
        'model = "futaba-s3001"', 'model = "futaba-s3001"\nacceleration_deg_s2 = 900'
    )
    head = text[: text.index("[motion]")]
    return plan_job(loads(f"{head}[motion]\nrepeat = false\nposes = [{poses}]\n", "arm.toml"))


LINE = (
    '{{ tip_mm = [300, {y}, 50], hold_s = 0.5 }}, {{ tip_mm = [{x}, {y}, 50], path = "line", law = "{law}" }}'
)


def test_a_line_is_faster_than_by_a_law_and_keeps_the_limits() -> None:
    frames = {}
    for law in ("fastest", "trapezoid"):
        angles = job_of(LINE.format(x=100, y=200, law=law)).trajectory.angles
        limits = [JointLimits(math.radians(103.1), math.radians(900))] * 3
        assert stretch(angles, 0.02, limits) <= 1.001
        frames[law] = len(angles)
    assert frames["fastest"] < frames["trapezoid"]


def test_a_line_beside_the_axis_of_the_base_is_planned() -> None:
    """2 mm beside the axis the base turns by nearly half a turn within a few mm."""
    planned = job_of(
        "{ tip_mm = [150, 2, 250], hold_s = 0.5 }, "
        '{ tip_mm = [-150, 2, 250], path = "line", law = "fastest" }'
    )
    assert np.degrees(np.ptp(planned.trajectory.angles[:, 0])) > 170


def test_a_time_of_its_own_is_refused() -> None:
    with pytest.raises(InputError, match="has no time of its own") as error:
        job_of(LINE.format(x=100, y=200, law='fastest", move_s = 1, name = "a'))
    assert error.value.location is not None and error.value.location.key == "motion.poses[2].move_s"


MASS, RADIUS, TORQUE = 0.3, 0.2, 0.05


def turntable(tilt: float = 0.0, ratio: float = 1.0, torque: float = TORQUE) -> TorqueLimits:
    """One servo that turns a mass on a stick about an axis, upright or tilted."""
    row = DHRow(0.0, Length(), Length(constant=RADIUS), 0.0, 0)
    joint = Joint("turn", "turning", -math.pi, math.pi, 0.0)
    robot = Arm("own", "", "standard", (joint,), (row,), base=FixedFrame(rx=tilt), payload=MASS)
    return TorqueLimits(robot, (Binding("turn", "servo", 0.3, ratio),), (0,), np.array([torque]))


def turned(share: np.ndarray) -> np.ndarray:
    return np.outer(share, [1.0])


@pytest.mark.parametrize("ratio", [1.0, -2.0])
def test_a_torque_turns_a_mass_in_the_time_of_its_moment_of_inertia(ratio: float) -> None:
    """Half of the way at M / m r², half at its opposite; a gear of i: i times the torque, 1/i of the way."""
    timed = time_optimal(turned, [JointLimits(100.0)], turntable(ratio=ratio))
    assert timed is not None
    acceleration = abs(ratio) * TORQUE / (MASS * RADIUS**2)
    assert timed.duration == pytest.approx(2 * math.sqrt(1 / abs(ratio) / acceleration), rel=1e-4)


def test_a_lifted_mass_takes_what_its_weight_leaves_of_the_torque() -> None:
    """What the torque less the weight gains up to the greatest speed, the torque and the weight take."""
    weight = MASS * GRAVITY * RADIUS
    limits = turntable(math.pi / 2, torque=1.5 * weight)
    timed = time_optimal(turned, [JointLimits(100.0)], limits)
    assert timed is not None
    # The joint is at -0.3 at first: that is the binding's zero.
    angle = np.interp(np.argmax(timed.squares), np.arange(len(timed.shares)), timed.shares) - 0.3
    gained = 1.5 * weight * (angle + 0.3) - weight * (math.sin(angle) - math.sin(-0.3))
    lost = 1.5 * weight * (0.7 - angle) + weight * (math.sin(0.7) - math.sin(angle))
    assert gained == pytest.approx(lost, rel=1e-2)
    assert timed.squares.max() == pytest.approx(2 * gained / (MASS * RADIUS**2) / 100**2, rel=1e-2)


def test_every_frame_of_a_move_keeps_the_torque_and_a_servo_too_weak_for_the_weight_has_no_limit() -> None:
    weight = MASS * GRAVITY * RADIUS
    limits = turntable(math.pi / 2, torque=1.5 * weight)
    move = quickest_along(
        lambda shares: Followed(shares, turned(shares), 0.0), [JointLimits(100.0)], 0.01, limits
    )
    assert move is not None
    samples = at_rest(move.angles)[:, 0] - 0.3
    torque = MASS * RADIUS**2 * np.diff(samples, 2) / 0.01**2 + weight * np.cos(samples[1:-1])
    assert 1.4 * weight < np.abs(torque).max() <= 1.5 * weight * 1.001
    weak = turntable(math.pi / 2, torque=0.9 * weight)
    fast, free = (time_optimal(turned, [JointLimits(2.0, 5.0)], torque) for torque in (weak, None))
    assert fast is not None and free is not None and fast.duration == free.duration


def test_an_arm_with_a_payload_takes_longer_where_its_servos_are_weak(tmp_path: Path) -> None:
    text = template("arm")
    line = LINE.format(x=100, y=200, law="fastest")
    head = text[: text.index("[motion]")] + f"[motion]\nrepeat = false\nposes = [{line}]\n"
    frames = []
    for payload_g in (0, 94):
        robot = tmp_path / f"robot{payload_g}.toml"
        robot.write_text(f'name = "own"\nlike = "anthropomorphic"\npayload_g = {payload_g}\n')
        own = head.replace('name = "anthropomorphic"', f'name = "{robot}"')
        frames.append(len(plan_job(loads(own, "arm.toml")).trajectory.angles))
    assert frames[1] > frames[0] + 1
