"""A joint that has turned round follows its stance again before the foot lands.

What a joint does is worked out here by the definition of a dead band alone: a shaft stays where it is until
the command is more than half of the lost motion away, and then keeps that distance.
"""

import math
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from servogen.job import load, loads, plan_job
from servogen.kinematics.hexapod import feet
from servogen.kinematics.protocol import Posture
from servogen.motion.gait import footwork
from servogen.motion.gait.footwork import MAX_BEYOND, swing_share
from servogen.motion.gait.phases import gait
from servogen.motion.gait.quasistatic import rigid_body_path
from servogen.motion.gait.steps import Segment
from servogen.motion.gait.walk import Walk, walk
from servogen.motion.limits import JointLimits
from servogen.robot.servo_models import servo_model
from servogen.units import Clock, Cycles
from tests.motion.robots import hexapod_with_limits

JOBS = Path(__file__).parents[2] / "jobs"
LOST = math.radians(4 * 180 / 500)
"""Of a Tiny-S: 2 µs on both sides, where 500 µs are 180°."""
FRAMES = 48
AHEAD, TURN = Segment(forward=0.04), Segment(turn=math.radians(20))
WALKS = [
    ("tripod", 0.11, AHEAD), ("tripod", 0.13, AHEAD), ("ripple", 0.11, AHEAD), ("ripple", 0.13, AHEAD),
    ("tripod", 0.13, TURN), ("wave", 0.11, AHEAD),
]  # fmt: skip


def walked(
    name: str, height: float, segment: Segment, lost: float, *, frames: int = FRAMES, alpha_deg: float = 90
) -> Walk:
    robot = hexapod_with_limits(alpha_deg)
    return walk(
        robot,
        gait(name, robot),
        [segment],
        Posture(height),
        Cycles(20_000),
        Clock(4_000_000),
        frames_per_cycle=frames,
        limits=JointLimits(),
        lost=lost,
    )


def shafts(commands: np.ndarray, lost: float) -> np.ndarray:
    """The shafts' angles, frame by frame, of servos that lose `lost` when they turn round."""
    rows, here = [], commands[0]
    for row in commands:
        here = np.clip(here, row - lost / 2, row + lost / 2)
        rows.append(here)
    return np.array(rows)


def steady_swings(made: Walk, lost: float) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield command and shaft of α in each swing of the steady walk, from lift to landing, forward upward."""
    lead = made.trajectory.loop_start
    rows = np.concatenate((np.arange(len(made.ground)), np.arange(lead, len(made.ground))))
    rows = np.concatenate((rows, np.arange(lead, len(made.ground))))
    alpha, ground = made.leg_angles[rows, :, 0], made.ground[rows]
    real, seen = shafts(alpha, lost), range(lead + FRAMES, len(rows))
    for leg in range(len(made.legs)):
        for land in (frame for frame in seen if ground[frame, leg] and not ground[frame - 1, leg]):
            lift = int(np.flatnonzero(ground[:land, leg])[-1])
            sign = math.copysign(1, alpha[land, leg] - alpha[lift, leg])
            yield sign * alpha[lift : land + 1, leg], sign * real[lift : land + 1, leg]


def behind_at_landing(made: Walk, lost: float) -> float:
    """Return the largest part of the lost motion that a joint has still to make up when its foot lands.

    A shaft that follows the stance is behind its command by half of the lost motion.
    """
    return max(lost / 2 - (real[-1] - command[-1]) for command, real in steady_swings(made, lost))


def comes_back(made: Walk) -> float:
    """Return the smallest angle by which a joint comes back before its foot lands."""
    return min(float(command.max() - command[-1]) for command, _ in steady_swings(made, 0.0))


@pytest.mark.parametrize(("name", "height", "segment"), WALKS)
def test_before_a_foot_lands_its_joint_follows_the_stance(name: str, height: float, segment: Segment) -> None:
    assert behind_at_landing(walked(name, height, segment, LOST), LOST) < 1e-9


def test_without_compensation_feet_land_on_joints_that_do_not_move_yet() -> None:
    assert behind_at_landing(walked("ripple", 0.11, AHEAD, 0.0), LOST) > math.radians(0.3)


def test_a_swing_that_falls_short_of_its_foothold_instead_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    right = footwork.Footwork.reach_beyond
    monkeypatch.setattr(footwork.Footwork, "reach_beyond", lambda *args: -right(*args))
    assert behind_at_landing(walked("ripple", 0.11, AHEAD, LOST), LOST) > math.radians(0.3)


@pytest.mark.parametrize(("name", "height", "segment"), WALKS[:5])
def test_rigid_legs_on_such_joints_go_where_the_walk_leads(
    name: str, height: float, segment: Segment
) -> None:
    """By the quasi-static model, which knows neither the law of the swing nor the physics."""
    cycles = 9 if segment is TURN else 4
    made = walked(name, height, replace(segment, cycles=cycles), LOST)
    angles = shafts(made.trajectory.angles, LOST).reshape(len(made.ground), -1, 2)
    x, _, yaw = rigid_body_path(feet(hexapod_with_limits(), angles), (0.0, 0.0)).pose[-1].tolist()
    if segment is TURN:
        assert math.degrees(yaw) == pytest.approx(180, abs=2)
    else:
        assert 1000 * x == pytest.approx(160, rel=0.015)


def test_twice_the_lost_motion_is_compensated_by_twice_the_angle() -> None:
    """Beside what the stance moves in a frame: 20° and a bit in 32 frames, 0.65°."""
    one, two = (comes_back(walked("ripple", 0.11, AHEAD, times * LOST)) for times in (0.5, 1))
    assert math.degrees(two - one) == pytest.approx(0.72, abs=0.1)  # frames do not hit the farthest point
    assert math.degrees(one) == pytest.approx(0.72 + 0.65, abs=0.1)


def test_nothing_lost_is_nothing_changed_and_a_swing_that_suffices_stays() -> None:
    plain = walked("tripod", 0.13, AHEAD, 0.0)
    assert plain.beyond == 0 and plain.lost_motion_text() is None
    small = walked("tripod", 0.13, AHEAD, math.radians(0.5))
    assert small.beyond == 0 and small.trajectory.angles == pytest.approx(plain.trajectory.angles, abs=0)
    assert small.lost_motion_text() == (
        "the swings take up the servos' lost motion of 0.50° before the feet land"
    )


def test_nothing_is_taken_up_where_no_foot_leaves_the_ground() -> None:
    made = walked("tripod", 0.13, Segment(), LOST)
    assert made.ground.all() and made.beyond == 0
    assert made.lost_motion_text() is None


def test_the_swing_is_lengthened_by_a_limited_share_and_that_is_said() -> None:
    made = walked("tripod", 0.13, Segment(forward=0.005, cycles=2), math.radians(3))
    assert made.beyond == MAX_BEYOND
    assert "a further 15.0 % of their length, so that part of the servos' lost motion" in str(
        made.lost_motion_text()
    )


def test_the_law_keeps_the_speed_at_both_ends_and_goes_beyond_them() -> None:
    u = np.linspace(0, 1, 1001)
    law = swing_share(u, 0.5, 0.1)
    assert law + law[::-1] == pytest.approx(np.ones(1001))  # one half mirrors the other
    slope = np.gradient(law, u, edge_order=2)
    assert (slope[0], slope[-1]) == pytest.approx((-0.5, -0.5), abs=1e-3)
    assert float((law - swing_share(u, 0.5)).max()) == pytest.approx(0.1, abs=1e-6)


def test_a_turn_at_the_limits_of_a_joint_leaves_room_for_the_longer_swing() -> None:
    """Without that room the swing would go beyond them, and the walk be refused."""
    made = walked("ripple", 0.13, TURN, LOST, alpha_deg=40)
    assert made.held_back
    assert np.degrees(np.abs(made.leg_angles[:, :, 0])).max() <= 40


def test_lost_motion_is_the_dead_band_on_both_sides_and_the_backlash() -> None:
    model = servo_model("mpx-tiny-s")
    lost = model.lost_motion(model.calibration)
    assert math.degrees(lost) == pytest.approx(1.44)
    twice = replace(model, motor=replace(model.motor, dead_band_us=4.0, backlash=0.01))
    assert twice.lost_motion(model.calibration) == pytest.approx(2 * lost + 0.01)
    unknown = replace(model, motor=replace(model.motor, dead_band_us=None))
    assert unknown.lost_motion(model.calibration) == 0


def test_a_job_compensates_unless_it_says_otherwise() -> None:
    text = (JOBS / "hexapod-ripple.toml").read_text()
    on = plan_job(load(JOBS / "hexapod-ripple.toml"))
    off = plan_job(loads(text.replace("[walk]", "[walk]\ncompensate = false"), "off.toml"))
    notes = [note.message for note in on.notes if note.code == "lost-motion"]
    assert len(notes) == 1
    assert re.fullmatch(
        r"the swings overshoot their footholds by a further \d\.\d % of their length, so that the servos' "
        r"lost motion of 1\.44° is taken up before the feet land \(assumed: dead_band_us\)",
        notes[0],
    )
    assert not [note for note in off.notes if note.code == "lost-motion"]
    assert np.ptp(on.trajectory.angles, axis=0).max() > np.ptp(off.trajectory.angles, axis=0).max()
    # Only swings differ: on the ground both command the same angles.
    plain = walked("ripple", 0.13, Segment(forward=0.04), 0.0)
    same = np.abs(on.trajectory.angles - off.trajectory.angles)[:, ::2] < 1e-9
    assert same[plain.ground].all() and not same[~plain.ground].all()
