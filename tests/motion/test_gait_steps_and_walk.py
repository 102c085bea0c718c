"""Gaits, steps, stability, loads, walks and branches on small cases worked out by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from servogen.errors import InputError, Location
from servogen.kinematics.protocol import Posture
from servogen.kinematics.statics import foot_forces
from servogen.motion import follow as f
from servogen.motion.gait import walk as walk_module
from servogen.motion.gait.commands import CommandedDirection, commanded_direction
from servogen.motion.gait.footwork import HeldBack, bump, footwork, swing_share
from servogen.motion.gait.phases import Gait, PhaseChange, custom, gait
from servogen.motion.gait.quasistatic import rigid_body_path
from servogen.motion.gait.stability import margin, support_polygon
from servogen.motion.gait.steps import Cruise, Segment, cruise_of, steps
from servogen.motion.gait.walk import Slip, Walk, walk
from servogen.motion.limits import JointLimits
from servogen.motion.loads import Loads, check_loads, check_torque, walk_loads
from servogen.motion.paths import StraightLine
from servogen.motion.trajectory import JointTrajectory
from servogen.robot.servo_models import servo_model
from servogen.units import Clock, Cycles
from tests.motion.robots import hexapod

CLOCK, PERIOD = Clock(4_000_000), Cycles(20_000)
HALF = Fraction(1, 2)


# ---- phases ---------------------------------------------------------------------------------------------

# The table of the module's page as the source draws it: when each leg lifts, in sixths of a cycle.
TABLE = {
    "tripod": (3, {"L1": 0, "L2": 3, "L3": 0, "R1": 3, "R2": 0, "R3": 3}),
    "ripple": (4, {"L1": 4, "L2": 2, "L3": 0, "R1": 1, "R2": 5, "R3": 3}),
    "wave": (5, {"L1": 2, "L2": 1, "L3": 0, "R1": 5, "R2": 4, "R3": 3}),
}


@pytest.mark.parametrize("name", TABLE)
def test_the_named_gaits_are_their_table(name: str) -> None:
    duty, lifts = TABLE[name]
    found = gait(name, hexapod())
    assert found.duty == Fraction(duty, 6)
    assert dict(found.lifts) == {leg: Fraction(sixths, 6) for leg, sixths in lifts.items()}


@pytest.mark.parametrize(
    ("duty", "fits"), [(Fraction(1, 24), True), (Fraction(23, 24), True), (0.04, False), (0.96, False)]
)
def test_stance_and_swing_last_a_twenty_fourth_of_the_cycle_at_least(duty: float, fits: bool) -> None:
    if fits:
        assert custom("own", duty, [0.0] * 6, hexapod()).duty == duty
    else:
        with pytest.raises(InputError, match="at least 1/24 away from both"):
            custom("own", duty, [0.0] * 6, hexapod())


@pytest.mark.parametrize(
    ("share", "exact"),
    [(0.333, "1/3"), (0.667, "2/3"), (0.083, "1/12"), (0.17, "17/100"), (0.3343, "1/3"), (0.32, "8/25"),
        (0.9996, "0")],
)  # fmt: skip
def test_a_share_of_three_digits_is_the_simple_fraction_that_it_abbreviates(share: float, exact: str) -> None:
    lifts = dict(custom("own", 0.5, [share, 0, 0, 0, 0, 0], hexapod()).lifts)
    assert lifts["L1"] == Fraction(exact)


def test_a_phase_is_from_zero_to_below_one() -> None:
    assert dict(custom("own", 0.5, [0, 0.5, 0.25, 0, 0, 0], hexapod()).lifts)["L3"] == Fraction(1, 4)
    for wrong in (1.0, -0.1):
        with pytest.raises(InputError, match="it is at least 0 and below 1"):
            custom("own", 0.5, [wrong, 0, 0, 0, 0, 0], hexapod())


@pytest.mark.parametrize(
    ("lift", "count", "on_frame"),
    [("1/6", 10, "1/5"), ("1/4", 10, "3/10"), ("1/5", 7, "1/7"), ("19/20", 10, "0"), ("94/100", 10, "9/10")],
)
def test_lifts_move_to_the_nearest_frame_and_from_the_middle_to_the_next(
    lift: str, count: int, on_frame: str
) -> None:
    own = Gait("own", Fraction(2, 3), (("a", Fraction(lift)),))
    rounded = own.on_frames(count)
    assert rounded.lifts == (("a", Fraction(on_frame)),)
    assert rounded.swing == Fraction(count // 3, count)
    assert own.grain == math.lcm(3, Fraction(lift).denominator)


def test_changes_are_the_shorter_way_round_the_cycle() -> None:
    change = PhaseChange("L1", Fraction(19, 20), Fraction(1, 20), 10)
    assert change.frames == 1
    assert change.text() == "the lift of L1 is 0.05 of the cycle, not 0.95: 1.00 frames"
    duty = PhaseChange("duty", Fraction(2, 3), Fraction(7, 10), 10)
    assert duty.text() == "the duty factor is 0.7 of the cycle, not 0.6667: 0.33 frames"
    asked = Gait("own", HALF, (("a", Fraction(1, 4)), ("b", Fraction(0))))
    for moved, shown in (("3/10", 0), ("4/10", 1), ("31/100", 1)):
        used = Gait("own", HALF, (("a", Fraction(moved)), ("b", Fraction(0))))
        assert len(used.changes_from(asked, 10)) == shown


# ---- steps ----------------------------------------------------------------------------------------------


def test_a_segment_goes_on_a_circle_about_its_centre() -> None:
    """A step of 0.1 m ahead and a quarter of a turn: the radius is 0.1 / (π/2), the centre to the left."""
    quarter = Segment(forward=0.1, turn=math.pi / 2)
    radius = 0.1 / (math.pi / 2)
    places, headings = quarter.travelled(np.array([0.0, 1.0, 2.0, 4.0]))
    assert headings == pytest.approx(np.array([0, 1, 2, 4]) * math.pi / 2)
    assert places == pytest.approx(np.array([0, radius + 1j * radius, 2j * radius, 0]), abs=1e-15)
    straight, _ = Segment(0.1, -0.05).travelled(np.array([2.0]))
    assert straight[0] == pytest.approx(0.2 - 0.1j)


@pytest.mark.parametrize(
    ("cycles", "stop", "speed"), [(2.0, 2.0, 1.0), (1.9, 2.0, 0.95), (1.25, 1.5, 1.25 / 1.5), (0.1, 0.5, 0.2)]
)
def test_a_body_stops_when_feet_lift_or_land(cycles: float, stop: float, speed: float) -> None:
    own = Gait("own", HALF, (("a", Fraction(0)), ("b", HALF)))
    cruise = cruise_of(own, cycles)
    assert (cruise.stop, cruise.speed) == (stop, pytest.approx(speed))
    assert cruise.at(np.array([-1.0, 0.25, 9.0])) == pytest.approx([0, speed / 4, cycles])
    assert cruise.steady(np.array([-1.0])) == pytest.approx([-speed])
    assert cruise_of(own, None) == Cruise(1.0, math.inf)


def test_the_steps_of_a_leg_put_its_foot_at_neutral_in_the_middle_of_each_stance() -> None:
    """Duty 1/2, lifts at 1/4: steps at 0.25 and 1.25; the stances between have their middles at 0, 1, 2."""
    own = Gait("own", HALF, (("a", Fraction(1, 4)),))
    made = steps(own, "a", Segment(forward=0.1, cycles=2), Cruise(1.0, 2.0), 0.05 + 0.2j)
    assert made.lifts.tolist() == [0.25, 1.25]
    assert made.lands.tolist() == [0.75, 1.75]
    assert made.holds == pytest.approx(np.array([0.05, 0.15, 0.25]) + 0.2j)
    time = np.array([0.0, 0.25, 0.26, 0.74, 0.75, 1.25, 1.5, 1.75, 2.0])
    assert made.swing_at(time).tolist() == [-1, -1, 0, 0, -1, -1, 1, -1, -1]
    assert made.swing_at(np.array([0.25 + 1e-10, 0.75 - 1e-10])).tolist() == [-1, -1]
    standing = made.standing(np.array([0.0, 0.25, 0.75, 1.0]))
    assert standing == pytest.approx(np.array([0.05, 0.025, 0.075, 0.05]) + 0.2j)
    first, last = made.ends(0)
    assert (first[0], last[0]) == (pytest.approx(0.025 + 0.2j), pytest.approx(0.075 + 0.2j))


def test_a_leg_in_the_air_at_the_start_lifted_before_it() -> None:
    own = Gait("own", HALF, (("a", Fraction(3, 4)),))
    made = steps(own, "a", Segment(forward=0.1, cycles=1), Cruise(1.0, 1.0), 0j)
    assert made.lifts.tolist() == [-0.25, 0.75]
    assert made.cut(0, np.array([-0.25, -0.2, 0.3])).tolist() == [True, False, False]
    assert made.cut(1, np.array([0.75, 1.2, 1.25, 1.3])).tolist() == [False, False, True, True]
    still = steps(own, "a", Segment(cycles=1), Cruise(1.0, 1.0), 0.1j)
    assert (len(still.lifts), len(still.lands), still.holds.tolist()) == (0, 0, [0.1j])
    assert still.swing_at(np.array([0.1, 0.9])).tolist() == [-1, -1]
    # a landing exactly at the start is not in the air
    half = steps(Gait("own", HALF, (("a", HALF),)), "a", Segment(forward=0.1, cycles=1), Cruise(1.0, 1.0), 0j)
    assert half.lifts.tolist() == [0.5]


@pytest.mark.parametrize("rate", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("beyond", [0.0, 0.1])
def test_the_law_of_a_swing_by_its_boundary_values(rate: float, beyond: float) -> None:
    step = 1e-5
    law = lambda u: swing_share(np.asarray(u, float), rate, beyond)  # noqa: E731
    assert [float(law(u)) for u in (0.0, 0.5, 1.0)] == pytest.approx([0, 0.5, 1])
    for end in (0.0, 1.0):
        assert float(law(end + step) - law(end - step)) / (2 * step) == pytest.approx(-rate, abs=1e-6)
    u = np.linspace(0, 1, 2001)
    assert law(u) + law(1 - u) == pytest.approx(np.ones(len(u)))
    if rate == 0.0:  # the quintic itself is within its ends: the rest goes beyond them by `beyond` at most
        bend = law(u) - swing_share(u, rate)
        assert bend.max() == pytest.approx(beyond, rel=1e-5)
        assert bend.min() == pytest.approx(-beyond, rel=1e-5)
    assert bump(np.array([0.0, 0.25, 0.5, 0.75, 1.0])) == pytest.approx([0, 9 / 16, 1, 9 / 16, 0])


# ---- stability and forces -------------------------------------------------------------------------------

SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])


@pytest.mark.parametrize(
    ("at", "expected"),
    [((1, 1), 1), ((0.25, 1), 0.25), ((2, 1), 0), ((3, 1), -1), ((5, 6), -5), ((1, -0.5), -0.5), ((2, 2), 0)],
)
def test_a_margin_is_the_distance_from_the_nearest_edge(at: tuple[float, float], expected: float) -> None:
    for order in ([0, 1, 2, 3], [3, 0, 2, 1], [2, 1, 0, 3]):
        assert margin(SQUARE[order], np.array(at, float)) == pytest.approx(expected)


def test_a_polygon_has_the_corners_of_the_hull_counter_clockwise() -> None:
    inside = np.vstack([SQUARE, [[1.0, 1.0], [1.0, 0.0], [0.5, 1.5], [2.0, 2.0]]])
    assert support_polygon(inside).tolist() == SQUARE.tolist()
    line = np.array([[0.0, 0.0], [3.0, 0.0]])
    assert margin(line, np.array([1.0, 2.0])) == pytest.approx(-2)
    assert margin(line, np.array([7.0, 3.0])) == pytest.approx(-5)
    assert margin(line[:1], np.array([3.0, 4.0])) == pytest.approx(-5)
    assert margin(line[:0], np.array([0.0, 0.0])) == -math.inf


def test_the_forces_at_feet_by_levers() -> None:
    """On three feet by the lever rule; four of a square carry alike; one that would pull carries nothing."""
    feet = np.array([[[0.0, 0.0], [3.0, 0.0], [0.0, 3.0]]])
    down = np.ones((1, 3), bool)
    assert foot_forces(feet, down, np.array([0.5, 1.0]), 12.0)[0] == pytest.approx([6, 2, 4])
    square = SQUARE[None] - 1
    assert foot_forces(square, np.ones((1, 4), bool), np.zeros(2), 8.0)[0] == pytest.approx([2, 2, 2, 2])
    forces = foot_forces(square, np.ones((1, 4), bool), np.array([0.9, 0.0]), 8.0)[0]
    assert (forces >= 0).all()
    assert forces.sum() == pytest.approx(8)
    assert forces @ square[0, :, 0] == pytest.approx(8 * 0.9)
    assert np.isnan(foot_forces(square, np.ones((1, 4), bool), np.array([1.01, 0.0]), 8.0)).all()


def test_feet_near_the_lowest_one_carry_the_body_of_the_other_method() -> None:
    """Feet up to 1 mm above the lowest are down and dragged along; the three that agree carry the body."""
    feet = np.zeros((2, 4, 3))
    feet[:, :, :2] = SQUARE / 10
    feet[1, :3, 0] -= 0.01  # three feet go back by 10 mm
    feet[1, 3, 0] += 0.05
    for height, in_the_air in ((0.0009, False), (0.0011, True)):
        feet[:, 3, 2] = height
        way = rigid_body_path(feet, (0.11, 0.09))
        assert way.pose[1] == pytest.approx([0.01, 0, 0], abs=1e-6)
        assert way.slip[1, 3] == pytest.approx(0.0 if in_the_air else 0.06, abs=1e-6)
    stated = rigid_body_path(feet, (0.11, 0.09), np.ones((2, 4), bool))
    assert stated.slip[1].max() > 0.001


# ---- loads ----------------------------------------------------------------------------------------------

S3001 = servo_model("futaba-s3001")  # 34 N·cm


def loads(torques: list[list[float]]) -> Loads:
    array = np.array(torques)
    return Loads(("A", "B"), 9.8, np.full(array.shape, 4.9), array, np.full(array.shape, 0.1))


def test_the_worst_load_is_the_first_of_the_largest() -> None:
    assert loads([[0.1, 0.2], [0.3, 0.3 + 1e-12]]).worst == (0, 1)
    assert loads([[0.1, math.nan], [math.nan, 0.2]]).worst == (1, 1)
    assert loads([[math.nan, math.nan]]).worst is None
    assert check_loads(None, "beta", S3001) == ()
    assert check_loads(loads([[math.nan, math.nan]]), "beta", S3001) == ()
    (found,) = check_loads(loads([[0.1, 0.2], [0.1, 0.5]]), "beta", S3001)
    assert found.message == (
        "holding B_beta in place needs 0.50 N·m in frame 1, a Futaba S3001 is rated 0.34 N·m; its foot "
        "carries 4.9 of 9.8 N (0.10 N·m if all standing feet shared it equally)"
    )


@pytest.mark.parametrize(("share", "warned"), [(1.0, 0), (1 + 0.9e-9, 0), (1 + 1e-6, 1)])
def test_a_torque_may_be_the_rated_one(share: float, warned: int) -> None:
    rated = S3001.torque_nm
    assert rated is not None
    assert len(check_torque(S3001, "q", np.array([rated * share]), place=Location("x"))) == warned


# ---- walks ----------------------------------------------------------------------------------------------


def planned(*segments: Segment, name: str = "tripod", frames: int | None = 24, **options: object) -> Walk:
    robot = hexapod()
    posture = Posture(body_height=0.1)
    return walk(
        robot, gait(name, robot), segments, posture, PERIOD, CLOCK, frames_per_cycle=frames, **options
    )  # type: ignore[arg-type]


WALKED = planned(Segment(forward=0.03, cycles=1))


def test_servos_lose_no_motion_unless_it_is_stated() -> None:
    assert (WALKED.lost, WALKED.beyond) == (0.0, 0.0)
    assert planned(Segment(forward=0.03, cycles=1), lost=math.radians(1.5)).beyond > 0


def test_a_spring_may_yield_as_far_as_it_can() -> None:
    worst = WALKED.largest_correction_m
    assert worst == pytest.approx(max(np.linalg.norm(each) for frame in WALKED.corrections for each in frame))
    again = planned(Segment(forward=0.03, cycles=1), spring_m=worst)
    assert again.largest_correction_m == worst
    with pytest.raises(InputError, match="the springs would have to yield"):
        planned(Segment(forward=0.03, cycles=1), spring_m=worst * (1 - 1e-9))


@pytest.mark.parametrize(("name", "minimum"), [("tripod", 8), ("ripple", 12), ("wave", 24)])
def test_a_swing_takes_four_frames_at_least(name: str, minimum: int) -> None:
    assert planned(Segment(forward=0.001, cycles=1), name=name, frames=minimum).frames_per_cycle == minimum
    with pytest.raises(InputError, match=f"a cycle of {minimum - 1} frames is too short") as caught:
        planned(Segment(forward=0.001, cycles=1), name=name, frames=minimum - 1)
    assert caught.value.hint == f"at least {minimum} frames: each swing takes 4 or more"


@pytest.mark.parametrize(("asked", "count"), [(12, 12), (13, 18), (18, 18), (19, 24)])
def test_a_cycle_is_a_multiple_of_the_gait_s_grain(asked: int, count: int) -> None:
    assert planned(Segment(forward=0.001, cycles=1), name="ripple", frames=asked).frames_per_cycle == count


def test_a_walk_may_have_as_many_frames_as_the_memory_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    way = (Segment(forward=0.01, cycles=2), Segment(forward=0.01))
    monkeypatch.setattr(walk_module, "MAX_FRAMES", 3 * 24)
    assert planned(*way).frames_per_cycle == 24
    monkeypatch.setattr(walk_module, "MAX_FRAMES", 3 * 24 - 1)
    with pytest.raises(InputError, match="more than 71 frames long"):
        planned(*way)
    for wrong, message in (
        ((), "at least one segment"),
        (way[::-1], "only the last segment of a walk can be endless"),
    ):
        with pytest.raises(InputError, match=message):
            planned(*wrong)


def test_a_walk_without_a_time_is_as_fast_as_its_speed_allows_or_a_minute_too_slow() -> None:
    fast = planned(Segment(forward=0.03, cycles=1), frames=None, limits=JointLimits(3.0))
    angles = fast.trajectory.angles
    assert np.abs(np.diff(angles, axis=0)).max() / 0.02 <= 3.0
    two_less = planned(Segment(forward=0.03, cycles=1), frames=fast.frames_per_cycle - 2).trajectory.angles
    assert np.abs(np.diff(two_less, axis=0)).max() / 0.02 > 3.0
    with pytest.raises(InputError, match="require a cycle of more than a minute"):
        planned(Segment(forward=0.03, cycles=1), frames=None, limits=JointLimits(0.001))
    with pytest.raises(InputError, match="the speed of the cycle is not known"):
        planned(Segment(forward=0.03, cycles=1), frames=None)


def shown(**values: object) -> Walk:
    return replace(WALKED, **values)  # type: ignore[arg-type]


def test_a_walk_in_words() -> None:
    assert Slip(0.9e-9, "L1", 3).text() == "with rigid legs no foot would slip"
    assert Slip(0.00125, "L1", 3).text() == (
        "with rigid legs a foot would slip up to 1.25 mm in a stance (L1, until frame 3)"
    )
    assert (
        HeldBack(0, "R2", math.radians(12.34))
        .text()
        .startswith("the limits of the joints of R2 keep its foot 12.3°")
    )
    assert shown(liftoff_slide_m=0.003).full_height() is None
    text = shown(liftoff_slide_m=0.0031).full_height()
    assert text is not None
    assert "a foot moves 3.1 mm sideways before it is 1 mm above the ground" in text
    assert shown(centres=(None, 0.1 - 0.2j)).centre_texts() == (
        (1, "the body turns about (100.0, -200.0) mm in its own frame"),
    )
    assert shown(lost=0.0).lost_motion_text() is None
    lost = math.radians(1.5)
    assert shown(lost=lost, ground=np.ones_like(WALKED.ground)).lost_motion_text() is None
    assert shown(lost=lost, beyond=0.0).lost_motion_text() == (
        "the swings take up the servos' lost motion of 1.50° before the feet land"
    )
    loses = "; a longer stride loses a smaller share of itself to the rest"
    for beyond, owners, rest in ((0.05, "the servos'", ""), (0.15, "part of the servos'", loses)):
        assert shown(lost=lost, beyond=beyond).lost_motion_text() == (
            f"the swings overshoot their footholds by a further {100 * beyond:.1f} % of their length, "
            f"so that {owners} lost motion of 1.50° is taken up before the feet land{rest}"
        )


def test_slip_adds_up_along_each_stance_and_across_the_end_of_the_loop() -> None:
    """Two legs, six frames, the loop from frame 3: A is dragged 1 mm a frame while it stands."""
    ground = np.array([[1, 1], [1, 1], [0, 1], [1, 1], [1, 0], [1, 1]], bool)
    corrections = np.zeros((6, 2, 3))
    corrections[:, 0, 0] = [0, 0.001, 0, 0, 0.001, 0.002]
    trajectory = JointTrajectory(("a", "b"), CLOCK, PERIOD, np.zeros((6, 2)), 3)
    own = shown(ground=ground, corrections=corrections, trajectory=trajectory, legs=("A", "B"))
    # from frame 3: 1, 2 mm at frames 4 and 5, and 2 mm back at the loop's frame 3
    assert own.slip == Slip(pytest.approx(0.006), "A", 5)
    assert own.largest_correction_m == pytest.approx(0.002)
    flat = shown(ground=ground, corrections=0 * corrections, trajectory=trajectory, legs=("A", "B"))
    assert flat.slip == Slip(0.0, "A", 0)


def test_the_lift_and_the_margin_of_a_walk_are_over_all_frames() -> None:
    heights = WALKED.feet[:, :, 2]
    assert WALKED.lift_m == pytest.approx(heights.max() - heights.min())
    assert WALKED.lift_m == pytest.approx(0.02, abs=1e-9)
    assert WALKED.minimum_margin_m == WALKED.margins.min()
    assert WALKED.leg_angles.shape == (len(WALKED.ground), 6, 2)
    assert shown(margins=np.zeros(0)).minimum_margin_m == math.inf


def test_three_legs_may_fall_and_two_are_held_by_something_else() -> None:
    """The left side alone stands straight out, 50 mm beside its mounts, which are 50 mm beside the middle."""
    for count, outside in ((2, math.inf), (3, -0.1)):
        robot = replace(hexapod(), mounts=hexapod().mounts[:count], mass=2.0)
        own = custom("own", 0.5, [0.0] * count, robot)
        made = walk(
            robot, own, [Segment(cycles=1)], Posture(), PERIOD, CLOCK, frames_per_cycle=24, allow_falling=True
        )
        assert made.minimum_margin_m == pytest.approx(outside)
        found = walk_loads(robot, made)
        assert (found is None) == (count == 2)
        if found is not None:
            assert found.worst is None, "it never stands"


def test_a_foot_s_rise_is_measured_up_to_a_height() -> None:
    """β from its stance to the top of the swing: how far the foot moves sideways until it is 1 mm up."""
    plan = footwork(hexapod(), gait("tripod", hexapod()), Posture(body_height=0.1), [Segment()])
    leg = plan.stance.legs[0].leg  # type: ignore[attr-defined]
    beta = leg.beta_at(-0.1)
    raised = leg.beta_at(-0.099)
    assert plan.liftoff_slide_m(0.001) == pytest.approx(
        leg.bc * abs(math.sin(beta) - math.sin(raised)), abs=1e-5
    )


def test_without_lost_motion_nothing_goes_beyond() -> None:
    plan = footwork(hexapod(), gait("tripod", hexapod()), Posture(body_height=0.1), [Segment(forward=0.03)])
    way = (Segment(forward=0.03, cycles=1),)
    assert plan.reach_beyond(way, 24, 0.0) == 0.0
    assert plan.reach_beyond(way, 24, 9.0) == 0.15
    assert plan.reach_beyond((Segment(cycles=1),), 24, 0.1) == 0.0
    shares = [plan.reach_beyond(way, 24, lost) for lost in (0.001, 0.01, 0.02, 0.04)]
    assert shares == sorted(shares)
    with pytest.raises(InputError, match="a segment needs more than 0 cycles, not 0"):
        plan.frames(Segment(forward=0.03, cycles=0.0), 24)


def test_a_swing_goes_beyond_as_far_as_what_is_lost_and_a_frame_of_the_stance() -> None:
    """By a search in steps of a ten thousandth; a swing turns a joint as far as the stance turns it back."""
    plan = footwork(hexapod(), gait("tripod", hexapod()), Posture(body_height=0.1), [Segment(forward=0.03)])
    made = planned(Segment(forward=0.03))
    loop = slice(made.trajectory.loop_start, None)
    alpha = np.where(made.ground[loop], made.leg_angles[loop, :, 0], np.nan)
    way = float(np.min(np.nanmax(alpha, axis=0) - np.nanmin(alpha, axis=0)))
    u = np.linspace(0, 1, 2001)
    shares = np.arange(1501) / 10_000
    comes_back = way * (np.array([swing_share(u, 1.0, share).max() for share in shares]) - 1)
    least, most = comes_back[[0, -1]] - way / 12  # what is taken up without going beyond, and at most
    for lost, expected in (
        (least * (1 - 1e-6), 0.0),
        *(
            (lost, float(shares[np.argmax(comes_back >= lost + way / 12)]))
            for lost in np.linspace(least, most, 5)[1:-1]
        ),
        (most + 1e-6, 0.15),
    ):
        found = plan.reach_beyond((Segment(forward=0.03), Segment(forward=0.05)), 24, lost)
        assert found == pytest.approx(expected, abs=2e-4), lost
        assert (found == expected) == (expected in (0.0, 0.15))


def test_loads_of_a_robot_are_its_weight_on_its_feet() -> None:
    robot = replace(hexapod(), mass=2.0)
    found = walk_loads(robot, WALKED)
    assert found is not None
    assert found.weight_n == pytest.approx(2 * 9.80665)
    standing = WALKED.ground[0].sum()
    assert found.forces[0].sum() == pytest.approx(found.weight_n)
    lever = robot.leg.length["bc"] * np.abs(np.sin(WALKED.leg_angles[0, :, 1]))
    assert found.equal_torques[0] == pytest.approx(found.weight_n / standing * lever)
    assert not WALKED.ground.all()
    assert found.forces[~WALKED.ground] == pytest.approx(0, abs=1e-9)
    assert found.equal_torques[~WALKED.ground] == pytest.approx(0, abs=1e-9), "in the air"
    assert walk_loads(hexapod(), WALKED) is None
    two = replace(robot, mounts=robot.mounts[:2])
    assert walk_loads(two, WALKED) is None


def test_a_foot_carries_where_its_spring_has_put_it() -> None:
    """The levers are those of the feet after their corrections: here R1 has gone 30 mm to the middle."""
    robot = replace(hexapod(), mass=2.0)
    corrections = np.zeros_like(WALKED.corrections)
    corrections[:, WALKED.legs.index("R1"), 1] = 0.03
    found = walk_loads(robot, shown(corrections=corrections))
    stand = (WALKED.feet + corrections)[:, :, :2]
    assert found is not None
    centre = np.array(robot.centre_of_mass[:2])
    for frame in (0, 6, 18):
        down = WALKED.ground[frame]
        levers = stand[frame, down] - centre
        assert found.forces[frame, down] @ levers == pytest.approx([0, 0], abs=1e-9)


# ---- directions and branches ----------------------------------------------------------------------------


def test_a_direction_is_cut_out_of_the_walk_that_begins_as_the_endless_one() -> None:
    """Start 0 1 2, cycle 3 4 5, stop 6 7 0; the walk of one cycle stops too early, a pause is left out."""
    endless = np.array([0, 1, 2, 3, 4, 5.0])[:, None]
    short = np.array([0, 1, 2, 6, 7, 0.0])[:, None]
    whole = np.array([0, 1, 2, 3, 4, 5, 6, 6, 7, 0, 0, 0.0])[:, None]
    for rest in (1, 2, 3):  # frames in which the robot stands at the end
        made = commanded_direction("forward", endless, 3, [short, whole[: 9 + rest]])
        assert made.angles[:, 0].tolist() == [0, 1, 2, 3, 4, 5, 6, 7, 0]
        assert (made.first, made.end) == (3, 6)
    for away, same in ((0.5e-6, True), (1e-3, False)):  # a millionth is the same angle
        if same:
            assert commanded_direction("forward", endless + away, 3, [whole]).end == 6
        else:
            with pytest.raises(InputError, match="the walk cannot be stopped"):
                commanded_direction("forward", endless + away, 3, [whole])
    with pytest.raises(InputError, match="the walk cannot be stopped"):  # it never leaves the stance
        commanded_direction("forward", 0 * endless, 3, [0 * whole])
    back = made.reversed("back")
    assert back.angles[:, 0].tolist() == [0, 7, 6, 5, 4, 3, 2, 1, 0]
    assert (back.name, back.first, back.end) == ("back", 2, 5)
    with pytest.raises(InputError, match="the walk cannot be stopped"):
        commanded_direction("forward", endless, 3, [short, short])
    assert isinstance(made, CommandedDirection)


LINE = StraightLine((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))


def branch(end: float = 1.0) -> f.Branch:
    def inverse(shares: np.ndarray, near: np.ndarray) -> np.ndarray:
        return np.stack([shares * end, 5 + shares], axis=1)[:, :, None]

    return f.trace(LINE, inverse, [0.0], str)


def test_a_branch_is_followed_and_its_chords_are_measured() -> None:
    made = branch()
    assert made.shares[0] == 0 and made.shares[-1] == 1
    assert made.end == pytest.approx([1.0])
    assert made.at(np.array([0.0, 0.3, 1.0]))[:, 0] == pytest.approx([0, 0.3, 1])

    def bowed(angles: np.ndarray) -> np.ndarray:
        x = angles[:, 0]
        return np.stack([x, x * (1 - x), 0 * x], axis=1)

    followed = made.followed([0.0, 1.0], bowed)
    assert followed.chord_error_m == pytest.approx(0.25)  # in the middle of the interval
    assert followed.missed_m == pytest.approx(0.0)
    assert made.followed([0.0, 0.5, 1.0], bowed).missed_m == pytest.approx(0.25)
    assert f.chord_errors(LINE, np.array([[0.5]]), bowed).tolist() == []


def test_a_path_without_a_solution_leaves_the_reach_where_it_ends() -> None:
    def inverse(shares: np.ndarray, near: np.ndarray) -> np.ndarray:
        return np.where(shares <= 0.4, shares, np.nan)[:, None, None]

    with pytest.raises(
        f.LeavesReach, match=r"leaves the reachable space at \(400\.000, 0\.000, 0\.000\) mm"
    ) as caught:
        f.trace(LINE, inverse, [0.0], str, Location("x"), "hint")
    assert caught.value.share == pytest.approx(0.4, abs=1e-6)
    assert (caught.value.location, caught.value.hint) == (Location("x"), "hint")


@pytest.mark.parametrize(("at", "where"), [(0.0, "at its start, "), (0.6, "at "), (1.0, "at its end, ")])
def test_a_jump_to_another_solution_changes_the_branch(at: float, where: str) -> None:
    error = f.ChangesBranch(at, (0.001, 0.0, 0.0), ("a", "b"), None)
    assert error.message == (
        f"the path would change the branch of the inverse kinematics {where}(1.000, 0.000, 0.000) mm: "
        "from a to b"
    )
    if 0 < at < 1:

        def inverse(shares: np.ndarray, near: np.ndarray) -> np.ndarray:
            return np.where(shares < at, shares, shares + 1)[:, None, None]

        with pytest.raises(f.ChangesBranch) as caught:
            f.trace(LINE, inverse, [0.0], lambda q: f"{q[0]:.3f}")
        assert caught.value.share == pytest.approx(at, abs=1e-6)
        assert caught.value.branches == (f"{at:.3f}", f"{at + 1:.3f}")


def test_a_hole_of_a_ten_millionth_of_the_path_is_passed() -> None:
    """At a singular point the inverse gives nothing; the branch goes on just behind it."""

    def inverse(shares: np.ndarray, near: np.ndarray) -> np.ndarray:
        return np.where(np.abs(shares - 0.5) < 1e-9, np.nan, shares)[:, None, None]

    made = f.trace(LINE, inverse, [0.0], str)
    assert made.end == pytest.approx([1.0])
    assert made.at(np.array([0.5]))[0] == pytest.approx([0.5], abs=1e-6)


def traced(*slopes: float, apart: float | None = None) -> f.Branch:
    """The branch of joints that turn evenly by `slopes`; with `apart` a second solution runs beside it."""

    def inverse(shares: np.ndarray, near: np.ndarray) -> np.ndarray:
        one = shares[:, None] * np.array(slopes)
        return np.stack([one, one + (5.0 if apart is None else apart)], axis=1)

    return f.trace(LINE, inverse, np.zeros(len(slopes)), str)


def test_a_slow_branch_is_sampled_at_sixty_four_shares() -> None:
    """0.3 rad in 64 steps are 4.7 mrad each, which is not a jump."""
    made = traced(0.3, -0.1)
    assert made.shares == pytest.approx(np.linspace(0, 1, 65))
    assert made.angles == pytest.approx(np.outer(made.shares, [0.3, -0.1]))


def test_the_steps_of_a_branch_begin_small_grow_threefold_and_stay_below_a_tenth() -> None:
    made = traced(20.0)
    steps_ = np.diff(made.angles[:, 0])
    assert steps_[0] <= 0.005
    assert steps_.max() <= 0.1
    assert steps_.max() > 0.03
    # one more than three times the slope before is divided by eight
    slopes = np.diff(made.angles[:, 0]) / np.diff(made.shares)
    assert slopes == pytest.approx(np.full(len(slopes), 20.0))
    shares = np.diff(made.shares)
    assert set(np.round(np.log(shares * 64) / np.log(8), 6).tolist()) <= {0.0, -1.0, -2.0, -3.0}


@pytest.mark.parametrize("apart", [0.1, 0.3])
def test_a_step_is_at_most_a_quarter_of_the_way_to_another_solution(apart: float) -> None:
    made = traced(4.0, apart=apart)
    assert made.end == pytest.approx([4.0])
    assert np.diff(made.angles[:, 0]).max() <= apart / 4 + 1e-12
    equal = traced(4.0, apart=0.9e-6)  # less than a millionth apart is the same solution
    assert equal.end == pytest.approx([4.0], abs=1e-5)


def test_a_branch_too_steep_for_its_samples_is_refused() -> None:
    with pytest.raises(InputError, match=r"the joints move too steeply there for 16384 samples"):
        traced(5000.0)


@pytest.mark.parametrize("at", [0.25, 0.5, 0.75])
def test_chords_are_measured_at_three_places_between_samples(at: float) -> None:
    def spiked(angles: np.ndarray) -> np.ndarray:
        x = angles[:, 0]
        return np.stack([x, np.maximum(0, 0.1 - np.abs(x - at)), 0 * x], axis=1)

    assert f.chord_errors(LINE, np.array([[0.0], [1.0]]), spiked) == pytest.approx([0.1])


def test_where_the_inverse_fails_a_branch_takes_its_neighbour_or_its_own_end() -> None:
    def holed(*holes: float) -> f.Branch:
        """The inverse gives nothing within half a ten millionth of the holes."""

        def inverse(shares: np.ndarray, near: np.ndarray) -> np.ndarray:
            lost = np.min(np.abs(shares[:, None] - np.array(holes)), axis=1) < 0.5e-7
            return np.where(lost, np.nan, shares)[:, None, None]

        return replace(branch(), inverse=inverse)

    made = holed(0.0, 0.5, 1.0)
    assert made.at(np.array([0.0, 0.25, 0.5, 1.0]))[:, 0] == pytest.approx([0, 0.25, 0.5, 1], abs=2e-7)
    nothing = replace(
        made, inverse=lambda shares, near: np.full((len(shares), 1, 1), np.nan), place=Location("x")
    )
    assert nothing.at(np.array([0.0, 1.0]))[:, 0].tolist() == [0.0, 1.0]
    with pytest.raises(f.LeavesReach, match=r"\(500\.000, 0\.000, 0\.000\) mm") as caught:
        nothing.at(np.array([0.5]))
    assert (caught.value.share, caught.value.location) == (0.5, Location("x"))


@pytest.mark.parametrize(("away", "same"), [(0.09, True), (0.11, False)])
def test_a_solution_a_tenth_beside_the_branch_is_not_on_it(away: float, same: bool) -> None:
    made = replace(branch(), inverse=lambda shares, near: (shares + away)[:, None, None])
    if same:
        assert made.at(np.array([0.5]))[0, 0] == pytest.approx(0.5 + away)
    else:
        with pytest.raises(f.LeavesReach):
            made.at(np.array([0.5]))
