"""A walking robot's feet stand still on the ground, step where they should, and the robot does not fall."""

import math
from dataclasses import replace
from itertools import pairwise
from random import Random
from typing import Any

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.kinematics.leg import Leg
from servogen.kinematics.protocol import Posture
from servogen.kinematics.transforms import to_body, to_leg
from servogen.motion.gait.phases import custom, gait
from servogen.motion.gait.steps import Segment
from servogen.motion.gait.walk import Walk, walk
from servogen.motion.limits import JointLimits, stretch
from servogen.robot.model import Mount
from servogen.units import Clock, Cycles
from tests.campaigns import sampled
from tests.motion.robots import hexapod

SIX_LEGGED = ("tripod", "ripple", "wave")

CLOCK, PERIOD, FRAME_S = Clock(4_000_000), Cycles(20_000), 0.02
SERVO = JointLimits(speed=math.radians(750), acceleration=300.0)
FOREVER = Segment(forward=0.04)
SEGMENTS = {
    "forward": Segment(forward=0.04, cycles=2),
    "back": Segment(forward=-0.03, cycles=1.5),
    "turn": Segment(turn=0.2, cycles=2),
    "curve": Segment(forward=0.03, turn=0.1, cycles=2),
    "short": Segment(forward=0.04, cycles=0.25),
}


def walked(name: str, *segments: Segment, frames: int | None = 48, **options: Any) -> Walk:
    robot = hexapod()
    posture = options.pop("posture", Posture())
    return walk(
        robot, gait(name, robot), segments, posture, PERIOD, CLOCK, frames_per_cycle=frames, **options
    )


def standing(made: Walk) -> np.ndarray:
    """Where the feet are wanted on the ground, x + iy, NaN in the air."""
    feet = made.feet + made.corrections
    return np.where(made.ground, feet[:, :, 0] + 1j * feet[:, :, 1], np.nan)


@pytest.mark.parametrize("name", SIX_LEGGED)
@pytest.mark.parametrize("way", SEGMENTS)
def test_between_two_frames_all_feet_on_the_ground_move_as_one_rigid_body(name: str, way: str) -> None:
    feet = standing(walked(name, SEGMENTS[way]))
    for before, after in pairwise(feet):
        both = ~np.isnan(before) & ~np.isnan(after)
        a, b = before[both], after[both]
        # The distances between feet that stand do not change, nor do the angles: only the body moves.
        assert np.abs(b[:, None] - b) == pytest.approx(np.abs(a[:, None] - a), abs=1e-12)
        turn = np.angle((b[1:] - b[0]) / (a[1:] - a[0]))
        assert np.ptp(turn) < 1e-9


@pytest.mark.parametrize("name", SIX_LEGGED)
def test_the_body_goes_a_stride_each_cycle(name: str) -> None:
    made = walked(name, FOREVER)
    start = made.trajectory.loop_start
    feet = standing(made)[start:]
    moved = np.diff(feet, axis=0)
    moved[np.isnan(moved)] = 0
    frames = (~np.isnan(np.diff(feet, axis=0))).sum(axis=0)
    # A foot on the ground goes back by the same small way each frame: stride / frames of a cycle.
    assert moved.sum(axis=0).real / frames == pytest.approx(np.full(6, -0.04 / 48))
    assert np.abs(moved.sum(axis=0).imag).max() < 1e-12


@pytest.mark.parametrize("name", SIX_LEGGED)
def test_each_foot_is_on_the_ground_for_its_duty_and_as_far_before_as_behind(name: str) -> None:
    robot, made = hexapod(), walked(name, FOREVER)
    ground = made.ground[made.trajectory.loop_start :]
    duty = float(gait(name, robot).duty)
    assert ground.sum(axis=0) == pytest.approx(np.full(6, duty * 48), abs=1)
    feet = standing(made)[made.trajectory.loop_start :]
    for column, mount in zip(feet.T, robot.mounts, strict=True):
        x = column.real - mount.x
        assert np.nanmax(x) == pytest.approx(duty * 0.04 / 2)
        assert np.nanmin(x) == pytest.approx(-duty * 0.04 / 2)


@pytest.mark.parametrize("name", SIX_LEGGED)
@pytest.mark.parametrize("way", SEGMENTS)
def test_a_walk_begins_and_ends_standing_in_the_same_posture(name: str, way: str) -> None:
    made = walked(name, SEGMENTS[way])
    angles = made.trajectory.angles
    assert angles[-1] == pytest.approx(angles[0], abs=1e-9)
    assert made.ground[-1].all()


@pytest.mark.parametrize("name", SIX_LEGGED)
@pytest.mark.parametrize("segments", [(FOREVER,), tuple(SEGMENTS.values())], ids=["for ever", "all"])
def test_no_joint_is_asked_for_more_than_its_servo_can_do(name: str, segments: tuple[Segment, ...]) -> None:
    made = walked(name, *segments, frames=None, limits=SERVO)
    assert asked_of(made, SERVO) <= 1 + 1e-9


def asked_of(made: Walk, *limits: JointLimits) -> float:
    """The factor by which a walk from standing must be slowed down for the limits of a leg's joints."""
    angles, start = made.trajectory.angles, made.trajectory.loop_start
    around = np.concatenate((angles[:1], angles, angles[start:], angles[start : start + 2]))
    return stretch(around, FRAME_S, [*limits] * (12 // len(limits)))


@pytest.mark.parametrize("name", sampled(SIX_LEGGED))
@pytest.mark.parametrize(
    "leg",
    [
        (JointLimits(1.5), JointLimits(6.0)),
        (JointLimits(8.0), JointLimits(1.2)),
        (JointLimits(8.0, 30.0), JointLimits(8.0)),
    ],
    ids=["alpha's speed", "beta's speed", "alpha's acceleration"],
)
def test_no_shorter_cycle_keeps_the_limits_of_each_joint(name: str, leg: tuple[JointLimits, ...]) -> None:
    made = walked(name, FOREVER, frames=None, limits=leg * 6)
    count, grain = made.frames_per_cycle, gait(name, hexapod()).grain
    assert made.tightest is not None
    assert made.tightest[1].factor == pytest.approx(asked_of(made, *leg)) and asked_of(made, *leg) <= 1
    for fewer in (1, 2, 5):
        assert asked_of(walked(name, FOREVER, frames=count - fewer * grain), *leg) > 1


@pytest.mark.parametrize("name", SIX_LEGGED)
def test_a_walk_for_ever_repeats_exactly_one_cycle(name: str) -> None:
    made = walked(name, FOREVER)
    start = made.trajectory.loop_start
    assert len(made.trajectory.angles) - start == 48
    assert start <= 2 * 48


@pytest.mark.parametrize(("name", "cycles"), [("tripod", 1), ("ripple", 7 / 6), ("wave", 1)])
def test_the_lead_in_is_a_step_of_each_foot_and_the_rise_of_those_that_are_in_the_air(
    name: str, cycles: float
) -> None:
    # One of the ripple's feet then is half of its swing of 1/3 into the air, straight out, where it stood.
    assert walked(name, FOREVER).trajectory.loop_start == round(48 * cycles)


@pytest.mark.parametrize("name", SIX_LEGGED)
def test_the_body_is_at_rest_until_it_goes_at_full_speed_and_feet_land_without_going_back(name: str) -> None:
    made = walked(name, Segment(forward=0.04, cycles=2))
    feet = standing(made)
    steps = np.diff(feet.real, axis=0)
    still = np.abs(steps) < 1e-12
    goes = np.abs(steps + 0.04 / 48) < 1e-12
    lead_in = walked(name, FOREVER).trajectory.loop_start
    for frame, both in enumerate(~np.isnan(steps)):
        moving = lead_in <= frame < lead_in + 96
        assert (goes if moving else still)[frame][both].all(), frame
    # On the spot each foot turns one way only: it is not dragged backwards while it is low.
    alphas = made.leg_angles[: lead_in - 8 if name == "ripple" else lead_in + 1, :, 0]
    for leg in alphas.T:
        turned = np.diff(leg)
        assert (turned >= -1e-12).all() or (turned <= 1e-12).all()


def test_a_foot_that_the_walk_begins_with_in_the_air_rises_in_place() -> None:
    made = walked("ripple", FOREVER)
    leg, lead_in = made.legs.index("R2"), made.trajectory.loop_start
    rises = slice(lead_in - 8, lead_in + 1)
    alpha, beta = made.leg_angles[rises, leg].T
    assert np.abs(np.diff(alpha)).max() < 1e-12
    assert np.abs(np.diff(beta)).min() > 0
    assert made.ground[lead_in - 8, leg] and not made.ground[lead_in - 7 : lead_in + 1, leg].any()
    # From the middle of its swing on it does what it does in each cycle.
    assert made.feet[lead_in, leg, 2] == pytest.approx(made.feet[:, leg, 2].max())


def test_in_the_tripod_opposite_legs_do_the_same_half_a_cycle_later() -> None:
    made = walked("tripod", FOREVER)
    angles = made.trajectory.angles[made.trajectory.loop_start :].reshape(48, 6, 2)
    for left, right in ((0, 3), (1, 4), (2, 5)):
        assert np.roll(angles[:, left], 24, axis=0) == pytest.approx(angles[:, right], abs=1e-7)


@pytest.mark.parametrize("name", SIX_LEGGED)
def test_the_springs_give_what_the_chord_of_the_stance_asks_for(name: str) -> None:
    # Stroke c on a circle of radius rho, its middle c²/(16 rho) inside: the same at the ends, outside.
    robot, made = hexapod(), walked(name, FOREVER)
    rho, stroke = Leg.of(robot.leg.length).r, 0.04 * float(gait(name, robot).duty)
    assert made.largest_correction_m == pytest.approx(stroke**2 / (16 * rho), rel=0.02)


def test_the_feet_are_where_forward_kinematics_say() -> None:
    robot, made = hexapod(), walked("wave", SEGMENTS["curve"])
    leg = Leg.of(robot.leg.length)
    angles = made.trajectory.angles.reshape(-1, 6, 2)
    for index, mount in enumerate(robot.mounts):
        x, y, z = leg.fk(angles[:, index, 0], angles[:, index, 1]).T
        side = -1 if mount.mirrored else 1
        assert made.feet[:, index] == pytest.approx(np.stack([mount.x + x, mount.y + side * y, z], axis=1))


def test_feet_are_lifted_as_high_as_asked_and_never_below_the_ground() -> None:
    made = walked("ripple", FOREVER, posture=Posture(lift=0.03))
    height = made.feet[:, :, 2] - made.feet[:, :, 2].min()
    assert height[made.ground].max() < 1e-12
    assert height[~made.ground].min() >= 0
    assert made.lift_m == pytest.approx(0.03, rel=0.01)


def test_a_lower_body_stands_lower() -> None:
    made = walked("wave", FOREVER, posture=Posture(body_height=0.12))
    assert made.feet[:, :, 2][made.ground] == pytest.approx(np.full(made.ground.sum(), -0.12))


def test_the_stance_width_can_be_given() -> None:
    made = walked("wave", SEGMENTS["forward"], posture=Posture(stance_width=0.196))
    width = standing(made)[0].imag
    assert width[:3] - width[3:] == pytest.approx(np.full(3, 0.196))


@pytest.mark.parametrize("name", SIX_LEGGED)
def test_the_robot_stands_safely_in_every_gait(name: str) -> None:
    made = walked(name, *SEGMENTS.values())
    assert len(made.margins) == len(made.trajectory.angles)
    assert made.minimum_margin_m > 0.01


def test_a_gait_in_which_the_robot_falls_is_refused_unless_allowed() -> None:
    robot = hexapod()
    bad = custom("hop", 0.5, [0.0, 0.0, 0.0, 0.5, 0.5, 0.5], robot)
    with pytest.raises(InputError, match=r"the robot falls over in frame 1: .* outside the feet R1, R2, R3"):
        walk(robot, bad, [FOREVER], Posture(), PERIOD, CLOCK, frames_per_cycle=48)
    made = walk(robot, bad, [FOREVER], Posture(), PERIOD, CLOCK, frames_per_cycle=48, allow_falling=True)
    assert made.minimum_margin_m < -0.05


@pytest.mark.parametrize(
    ("name", "segment"),
    [("tripod", Segment(forward=0.02, left=0.035)), ("ripple", Segment(forward=0.02, turn=math.radians(15)))],
)
def test_the_margin_is_the_least_at_any_time_not_only_at_the_beginning_of_a_frame(
    name: str, segment: Segment
) -> None:
    """The centre of mass is in front of the middle: the margin is least just before a foot lands."""
    robot = replace(hexapod(), centre_of_mass=(0.02, 0.0, 0.0))
    few, many = (
        walk(
            robot,
            gait(name, robot),
            [segment],
            Posture(),
            PERIOD,
            CLOCK,
            frames_per_cycle=count,
            allow_falling=True,
        )
        for count in (30, 600)
    )
    assert few.minimum_margin_m == pytest.approx(many.minimum_margin_m, abs=1e-5)


def test_a_single_leg_walks_as_it_does_on_the_robot() -> None:
    robot = hexapod()
    alone = robot.with_leg("R2")
    rhythm = custom("alone", gait("wave", robot).duty, {"R2": dict(gait("wave", robot).lifts)["R2"]}, alone)
    made = walk(alone, rhythm, [FOREVER], Posture(), PERIOD, CLOCK, frames_per_cycle=48)
    whole = walked("wave", FOREVER).trajectory
    column = whole.joints.index("R2_alpha")
    loop = whole.angles[whole.loop_start :, column : column + 2]
    mine = made.trajectory.angles[made.trajectory.loop_start :]
    turns = [np.abs(np.roll(mine, shift, axis=0) - loop).max() for shift in range(48)]
    assert min(turns) < 1e-6
    assert made.trajectory.joints == ("R2_alpha", "R2_beta")


def test_mounts_turn_and_mirror_legs() -> None:
    mount = Mount("R1", 0.1, -0.05, 0.01, math.radians(30), mirrored=True)
    point = np.array([[0.0, 0.05, -0.14]])
    # Mirrored to (0, -0.05), turned by 30° to (0.025, -0.0433), moved.
    wanted = [[0.125, -0.05 - 0.05 * math.cos(math.radians(30)), -0.13]]
    assert to_body(mount, point) == pytest.approx(np.array(wanted))
    assert to_leg(mount, to_body(mount, point)) == pytest.approx(point)


@pytest.mark.parametrize(
    ("segments", "options", "says"),
    [
        ((), {}, "at least one segment"),
        ((FOREVER, FOREVER), {}, "only the last segment"),
        ((Segment(0.04, cycles=0),), {}, "a segment needs more than 0 cycles"),
        ((Segment(0.4),), {}, "L1_alpha would have to turn from"),
        (
            (Segment(turn=0.3),),
            {"spring_m": 0.0005},
            "the springs would have to yield 0.8. mm, but yield 0.5 mm",
        ),
        ((FOREVER,), {"frames": None}, "the speed of the cycle is not known"),
        ((FOREVER,), {"frames": 6}, "a cycle of 6 frames is too short for the gait 'tripod'"),
        ((FOREVER,), {"posture": Posture(body_height=0.2)}, "the legs cannot stand "),
        ((FOREVER,), {"posture": Posture(lift=0.5)}, "the legs cannot stand "),
        ((FOREVER,), {"posture": Posture(lift=0.0)}, "does not take the foot off the ground"),
    ],
)
def test_a_walk_that_cannot_be_is_refused(
    segments: tuple[Segment, ...], options: dict[str, object], says: str
) -> None:
    with pytest.raises(InputError, match=says):
        walked("tripod", *segments, **options)  # type: ignore[arg-type]


def test_a_way_of_nothing_is_stood() -> None:
    made = walked("tripod", Segment())
    assert made.ground.all()
    assert np.ptp(made.trajectory.angles, axis=0) == pytest.approx(np.zeros(12))


@pytest.mark.parametrize(("name", "frames"), [("tripod", 8), ("ripple", 12), ("wave", 24)])
def test_a_swing_takes_four_frames_at_least(name: str, frames: int) -> None:
    """A foot swings for a half, a third or a sixth of the cycle."""
    assert walked(name, Segment(0.01, cycles=1), frames=frames).frames_per_cycle == frames
    with pytest.raises(InputError) as caught:
        walked(name, Segment(0.01, cycles=1), frames=frames - 1)
    assert str(caught.value) == (
        f"servogen: error: a cycle of {frames - 1} frames is too short for the gait '{name}' [cycle-time]\n"
        f"  at least {frames} frames: each swing takes 4 or more"
    )


def test_a_walk_that_is_too_long_to_be_meant_is_refused() -> None:
    with pytest.raises(InputError, match="more than 500000 frames long"):
        walked("tripod", Segment(0.04, cycles=1e7))


def test_a_second_is_a_second_for_26_random_gaits() -> None:
    """50 frames of 20 ms a cycle, whatever the phases: every leg lifts and lands once in each of them."""
    dice = Random(26)
    clock = Clock(4_000_000)
    for number in range(26):
        duty = round(dice.uniform(0.5, 0.85), 3)
        lifts = [round(dice.random(), 3) % 1 for _ in range(6)]
        made = walk(
            hexapod(),
            custom("mine", duty, lifts, hexapod()),
            [Segment(0.02, 0.0, 0.0, None)],
            Posture(),
            Cycles(20_000),
            clock,
            frames_per_cycle=50,
            allow_falling=True,
        )
        loop = made.ground[made.trajectory.loop_start :]
        assert len(loop) == made.frames_per_cycle == 50, number
        swing = int((1 - duty) * 50 + 1e-9)
        for column in loop.T:
            assert (~column).sum() == swing - 1, (number, duty)  # at both ends it is on the ground
            begins = np.flatnonzero(column & ~np.roll(column, -1))
            assert len(begins) == 1
