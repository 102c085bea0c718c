"""Drives, laws, limits, splines and paths by formulas worked out by hand, their bounds from both sides."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from servogen.errors import InputError, Location
from servogen.kinematics.omni import OmniBase
from servogen.kinematics.protocol import Stretch
from servogen.motion import Motion, PlannedPoses, Pose, trajectory
from servogen.motion import moves as m
from servogen.motion import poses as poses_module
from servogen.motion.drive import drive, positions
from servogen.motion.follow import Followed
from servogen.motion.laws import NAMES, law
from servogen.motion.limits import JointLimits, fastest, stretch
from servogen.motion.paths import StraightLine, arc
from servogen.motion.trajectory import JointTrajectory, Part
from servogen.units import Clock, Cycles

CLOCK, PERIOD, FRAME_S = Clock(4_000_000), Cycles(20_000), 0.02


# ---- drives ---------------------------------------------------------------------------------------------


def driven(length: float, speed: float = 0.1, **options: object) -> np.ndarray:
    """The speeds of the one wheel, which turns by a radian per metre, over one stretch."""
    made = drive([Stretch(length, (length,), "")], speed, PERIOD, CLOCK, wheels=("w",), **options)  # type: ignore[arg-type]
    return made.trajectory.angles[:, 0]


def test_a_stretch_takes_whole_frames_at_one_speed_without_ramps() -> None:
    for length, frames in [(0.3, 150), (0.3001, 151), (0.29999, 150), (0.0001, 1), (0.002, 1)]:
        speeds = driven(length)
        assert len(speeds) == frames
        assert speeds == pytest.approx(np.full(frames, length / frames / FRAME_S))


def test_ramps_are_straight_alike_at_both_ends_and_cover_the_whole_length() -> None:
    """In the middle of frame i a ramp of r frames is at (i + 1/2)/r of full speed, at most at 1."""
    for length in [0.004, 0.013, 0.02, 0.1, 0.3]:
        for ramp in [1, 2, 5, 10]:
            speeds = driven(length, ramp_s=Fraction(ramp, 50))
            count = len(speeds)
            shape = [min(1.0, (i + 0.5) / ramp, (count - i - 0.5) / ramp) for i in range(count)]
            assert speeds / speeds.max() == pytest.approx(np.array(shape) / max(shape))
            assert speeds.sum() * FRAME_S == pytest.approx(length)
            assert speeds.max() <= 0.1 * (1 + 1e-9)
            # a frame fewer would have to go faster
            fewer = [min(1.0, (i + 0.5) / ramp, (count - i - 1.5) / ramp) for i in range(count - 1)]
            assert sum(fewer) * 0.1 * FRAME_S < length * (1 - 1e-9)


@pytest.mark.parametrize(("pause", "ramp"), [(0, 0), (1, 0), (0, 2), (3, 2)])
def test_a_drive_may_be_as_long_as_the_memory_holds(
    pause: int, ramp: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each of two stretches: 10 frames at full speed, two ramps, a pause, and one frame for its rounding."""
    frames = 2 * (10 + 2 * ramp + pause + 1)
    two = [Stretch(0.02, (1.0,), "")] * 2

    def made() -> object:
        return drive(
            two,
            0.1,
            PERIOD,
            CLOCK,
            wheels=("w",),
            pause_s=Fraction(pause, 50),
            ramp_s=Fraction(ramp, 50),
        )

    monkeypatch.setattr("servogen.motion.drive.MAX_FRAMES", frames)
    made()
    monkeypatch.setattr("servogen.motion.drive.MAX_FRAMES", frames - 1)
    with pytest.raises(InputError, match=f"more than {frames - 1} frames long"):
        made()


def test_pauses_follow_every_stretch_and_the_end_stands_still() -> None:
    parts = [Stretch(0.004, (-0.004,), "a"), Stretch(0.006, (0.0,), "b")]
    made = drive(parts, 0.1, PERIOD, CLOCK, wheels=("w",), pause_s=Fraction(1, 25), repeat=False)
    assert made.frames == (2, 3)
    assert made.trajectory.angles[:, 0].tolist() == pytest.approx([-0.1, -0.1, 0, 0, 0, 0, 0, 0, 0, 0])
    assert not np.signbit(made.trajectory.angles[2:]).any()
    assert made.trajectory.loop_start == 9
    assert repr(made.trajectory) == "<JointTrajectory w; 9 + 1 frames>"
    again = drive(parts, 0.1, PERIOD, CLOCK, wheels=("w",), pause_s=Fraction(1, 25))
    assert repr(again.trajectory) == "<JointTrajectory w; 0 + 9 frames>"


def test_a_drive_needs_a_speed() -> None:
    for speed in [0.0, -0.1, math.nan]:
        with pytest.raises(InputError, match="the speed must be more than 0"):
            driven(0.1, speed)


def test_positions_are_the_arcs_of_small_steps() -> None:
    """Each frame in a thousand Euler steps."""
    base = OmniBase("o", "", 0.04, 0.135, 1.0, 1)
    speeds = np.random.default_rng(4).uniform(-3, 3, (6, 3))
    x = y = heading = 0.0
    for row, found in zip(speeds, positions(base, speeds, 0.1)[1:], strict=True):
        vx, vy, turn = base.body_speed(row).tolist()
        for _ in range(1000):
            middle = heading + turn * 0.00005
            x += (vx * math.cos(middle) - vy * math.sin(middle)) * 0.0001
            y += (vx * math.sin(middle) + vy * math.cos(middle)) * 0.0001
            heading += turn * 0.0001
        assert found == pytest.approx([x, y, heading], abs=1e-7)


# ---- laws and limits ------------------------------------------------------------------------------------


def test_a_law_is_symmetrical_rests_outside_and_its_derivatives_belong_together() -> None:
    for name in NAMES:
        found = law(name, 0.3, 0.2)
        u = np.linspace(0, 1, 2001)
        s = found.share(u)
        assert (s[0], s[-1]) == (0, pytest.approx(1))
        assert s + s[::-1] == pytest.approx(np.ones(len(u)))
        assert found.share([-0.5, 1.5]) == pytest.approx([0, 1])
        for order in (1, 2, 3):
            assert found.derivative([-1e-9, 1 + 1e-9], order).tolist() == [0, 0]
        middle = (u[1:] + u[:-1]) / 2
        assert np.diff(s) * 2000 == pytest.approx(found.derivative(middle, 1), abs=1e-5)
        slopes = np.diff(found.derivative(u, 1)) * 2000
        assert slopes == pytest.approx(found.derivative(middle, 2), abs=0.02)


def test_ramps_and_bends_are_at_most_a_half() -> None:
    for ramp, bend, fits in [
        (0.5, 0.5, True),
        (1e-6, 1e-6, True),
        (0.0, 0.5, False),
        (0.5, 0.0, False),
        (0.51, 0.5, False),
        (0.5, 0.51, False),
        (math.nan, 0.5, False),
    ]:
        for name in ("trapezoid", "s-curve"):
            if fits:
                assert law(name, ramp, bend).share(1.0) == pytest.approx(1)
            else:
                with pytest.raises(InputError, match=r"ramp and bend are more than 0 and at most 0.5"):
                    law(name, ramp, bend)


# The shortest times over a way of 1, by the kinematics of constant acceleration or jerk.
def test_the_shortest_time_of_a_law_within_its_limits() -> None:
    for name, limits, seconds in [
        ("trapezoid", JointLimits(0.5, 1.0), 0.5 + 2.0),  # ramps of 0.5 s, v²/a = 0.25 of the way
        ("trapezoid", JointLimits(1.0, 1.0), 2.0),  # the speed is just reached
        ("trapezoid", JointLimits(9.0, 4.0), 1.0),  # 2 √(1/a)
        ("trapezoid", JointLimits(acceleration=4.0), 1.0),
        ("trapezoid", JointLimits(2.0), 4 / 3 / 2.0),
        ("s-curve", JointLimits(0.5, 1.0, 2.0), 2.0 + 0.5 + 0.5),  # 1/v + v/a + a/j
        ("s-curve", JointLimits(0.5, 9.0, 2.0), 2.0 + 2 * 0.5),  # 1/v + 2 √(v/j)
        ("s-curve", JointLimits(9.0, 9.0, 2.0), 4 * 0.25 ** (1 / 3)),  # four rises of ∛(1/2j)
        ("s-curve", JointLimits(9.0, 1.0, 100.0), 0.01 + math.sqrt(0.01**2 + 4)),
        ("s-curve", JointLimits(0.5, 1.0), 2.0 + 1.0),  # half of the acceleration on the mean
        ("linear", JointLimits(0.5, 0.001, 0.001), 2.0),
        ("cubic", JointLimits(9.0, 6.0), 1.0),
        ("cubic", JointLimits(9.0, 60.0, 12.0), 1.0),
        ("quintic", JointLimits(15 / 8), 1.0),
    ]:
        for way in (1.0, -1.0):
            assert fastest(name, [way], [limits]).duration == pytest.approx(seconds)


def test_a_way_of_a_nanometre_takes_no_time() -> None:
    for way, moves in [(0.9e-9, False), (1.1e-9, True), (-1.1e-9, True)]:
        assert (fastest("cubic", [way], [JointLimits(1.0)]).duration > 0) == moves
        if not moves:
            assert fastest("cubic", [way], [JointLimits()]).duration == 0


def test_samples_are_slowed_down_by_speed_acceleration_and_jerk() -> None:
    cube = (np.arange(6.0) ** 3)[:, None]  # third difference 6
    for step, limits, factor in (
        (1.0, JointLimits(jerk=6.0 / 27), 3.0),
        (0.5, JointLimits(jerk=6.0), 2.0),
        (1.0, JointLimits(speed=61.0), 1.0),
        (1.0, JointLimits(acceleration=24.0 / 4), 2.0),
        (1.0, JointLimits(), 0.0),
    ):
        assert stretch(cube, step, [limits]) == pytest.approx(factor)
    assert stretch(cube[:1], 1.0, [JointLimits(1.0)]) == 0.0
    assert stretch(cube[:2], 1.0, [JointLimits(0.5, 0.1)]) == 2.0


# ---- splines and moves ----------------------------------------------------------------------------------


def test_a_spline_of_two_intervals_by_hand() -> None:
    """0, 1, 0 in intervals of 1 s: by symmetry the speed in the middle is 0, so each half is 3u² - 2u³."""
    curve = m.spline([[0.0], [1.0], [0.0]], [0.0, 1.0, 2.0])
    u = np.linspace(0, 1, 11)
    assert curve.at(u)[:, 0] == pytest.approx(3 * u**2 - 2 * u**3)
    assert curve.at(2 - u)[:, 0] == pytest.approx(3 * u**2 - 2 * u**3)
    assert curve.at(u, 1)[:, 0] == pytest.approx(6 * u - 6 * u**2)
    assert curve.at(u[:-1], 2)[:, 0] == pytest.approx(6 - 12 * u[:-1])
    assert curve.at(u[:-1], 3)[:, 0] == pytest.approx(np.full(10, -12.0))
    speed, acceleration = curve.peaks()
    assert (speed[0], acceleration[0]) == pytest.approx((1.5, 6))
    assert curve.at([-1.0, 9.0])[:, 0].tolist() == [0, 0]
    slow = curve.slower(2.0)
    assert slow.duration == 4
    assert slow.at(1.0)[0] == pytest.approx(0.5)
    assert [float(part[0]) for part in slow.peaks()] == pytest.approx([0.75, 1.5])


def test_a_spline_needs_a_later_time_for_each_point() -> None:
    for points, times in [
        ([[0.0]], [0.0]),
        ([[0.0], [1.0]], [0.0]),
        ([[0.0], [1.0]], [1.0, 1.0]),
        ([[0.0], [1.0]], [1.0, 0.5]),
    ]:
        with pytest.raises(InputError, match="a spline needs two points or more, and a later time for each"):
            m.spline(points, times)


def test_the_fastest_spline_is_at_one_of_its_limits() -> None:
    for limits, bound in [
        (JointLimits(1.0), "speed"),
        (JointLimits(1.0, 0.5), "acceleration"),
        (JointLimits(1.0, 1e6), "speed"),
    ]:
        curve = m.fastest_spline([[0.0, 0.0], [1.0, 0.2], [0.5, 0.9]], [limits, JointLimits(4.0, 40.0)])
        speed, acceleration = curve.peaks()
        shares = {"speed": speed[0] / limits.speed, "acceleration": acceleration[0] / limits.acceleration}
        assert max(shares.values()) == pytest.approx(1)
        assert max(shares, key=lambda key: shares[key]) == bound
        # the intervals are as long as the slowest joint needs for each at its top speed
        assert np.diff(curve.times)[0] / np.diff(curve.times)[1] == pytest.approx(1.0 / 0.5)


def test_a_spline_without_limits_or_with_equal_points_is_refused() -> None:
    with pytest.raises(InputError, match="need a speed limit of every joint that moves"):
        m.fastest_spline([[0.0], [1.0]], [JointLimits()])
    still = m.fastest_spline([[0.0, 5.0], [1.0, 5.0]], [JointLimits(1.0), JointLimits()])
    assert still.at(still.times[-1]).tolist() == [1, 5]
    with pytest.raises(InputError, match="two via points in a row are the same"):
        m.fastest_spline([[0.0], [1.0], [1.0]], [JointLimits(1.0)])


def test_moves_have_their_last_frame_at_their_end() -> None:
    start, end = np.array([0.1, 1.0]), np.array([0.7, -1.0])
    move = m.straight(start, end, "linear", 3)
    assert move == pytest.approx(np.array([[0.3, 1 / 3], [0.5, -1 / 3], [0.7, -1.0]]))
    assert move[-1].tolist() == end.tolist()
    assert m.straight(start, end, "cubic", 0).shape == (0, 2)
    # 0.6 rad at 1 rad/s are 30 frames; a nanosecond more is still 30, a microsecond 31
    for top, frames in ((1.0, 30), (1 / (1 + 1e-12), 30), (1 / (1 + 1e-5), 31)):
        fast = m.fastest_straight(start, end, "linear", [JointLimits(top), JointLimits(99.0)], FRAME_S)
        assert len(fast) == frames
        assert fast[-1].tolist() == end.tolist()
    through = m.through(np.array([[0.0], [1.0], [0.0]]), [2, 2], False)
    assert through[:, 0] == pytest.approx([0.5, 1.0, 0.5, 0.0])
    quick = m.fastest_through(np.array([[0.0], [1.0], [0.0]]), [JointLimits(1.5)], FRAME_S, False)
    assert len(quick) == 100  # two halves of a second each at the peak of 1.5
    assert quick[49, 0] == pytest.approx(1.0)


def test_a_fastest_move_is_the_move_of_its_law_in_its_whole_time() -> None:
    """1 rad at 1 rad/s takes 1.5 s by the cubic law: 75 frames, of which the first covers 3u² - 2u³."""
    start, end = np.array([0.2, -1.0]), np.array([1.2, -1.5])
    fast = m.fastest_straight(start, end, "cubic", [JointLimits(1.0)] * 2, FRAME_S)
    u = np.arange(1, 76)[:, None] / 75
    assert fast == pytest.approx(start + (3 * u**2 - 2 * u**3) * [1.0, -0.5])
    assert m.straight(start, end, "cubic", 75) == pytest.approx(fast)


def test_a_path_takes_as_few_frames_as_its_limits_allow(monkeypatch: pytest.MonkeyPatch) -> None:
    def follow(shares: np.ndarray) -> Followed:
        return Followed(shares, shares[:, None] * 1.0, 0.0)

    found = m.fastest_along(follow, "linear", [JointLimits(1.0)], FRAME_S)
    assert found is not None
    assert len(found.shares) == 51
    assert found.shares.tolist() == pytest.approx([frame / 50 for frame in range(51)])
    # 50.5 frames at the top speed: 50 are hardly too fast, and one more is enough
    hardly = m.fastest_along(follow, "linear", [JointLimits(50 / 50.5)], FRAME_S)
    assert hardly is not None
    assert len(hardly.shares) == 52
    for most, fits in ((50, True), (49, False)):
        monkeypatch.setattr(m, "MAX_PATH_FRAMES", most)
        assert (m.fastest_along(follow, "linear", [JointLimits(1.0)], FRAME_S) is not None) == fits


# ---- lines and arcs -------------------------------------------------------------------------------------


def test_a_line_s_points_and_the_distance_from_it_with_its_ends() -> None:
    line = StraightLine((1.0, 0.0, 0.0), (1.0, 4.0, 3.0))
    assert line.length == 5
    assert line.point([0.0, 0.5, 1.0]).tolist() == [[1, 0, 0], [1, 2, 1.5], [1, 4, 3]]
    away = line.distance(np.array([[3.0, 2.0, 1.5], [1.0, -3.0, 0.0], [1.0, 4.0, 5.0], [1.0, 0.0, 0.0]]))
    assert away == pytest.approx([2, 3, 2, 0], abs=1e-12)
    point = StraightLine((1.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    assert point.length == 0
    assert point.distance(np.array([[1.0, 2.0, 0.0]])) == pytest.approx([2])


@pytest.mark.parametrize(("through", "angle"), [((0, 1), math.pi), ((0, -1), math.pi)])
def test_a_half_circle_goes_through_its_point(through: tuple[int, int], angle: float) -> None:
    found = arc([1, 0, 0], [*through, 0], [-1, 0, 0])
    assert (found.radius, found.angle, found.length) == pytest.approx((1, angle, angle))
    assert found.centre == pytest.approx((0, 0, 0))
    assert found.point([0.5])[0] == pytest.approx([*through, 0], abs=1e-12)


def test_an_arc_of_three_quarters_and_the_distance_from_it() -> None:
    """From 0° through 135° to 270° on a circle of 2 about (1, 1, 5); the gap's middle is at 315°."""
    found = arc([3, 1, 5], [1 - math.sqrt(2), 1 + math.sqrt(2), 5], [1, -1, 5])
    assert (found.angle, found.length) == pytest.approx((1.5 * math.pi, 3 * math.pi))

    def at(degrees: float, radius: float, z: float = 5.0) -> list[float]:
        turn = math.radians(degrees)
        return [1 + radius * math.cos(turn), 1 + radius * math.sin(turn), z]

    def apart(one: list[float], two: list[float]) -> float:
        return math.dist(one, two)

    points = [at(90, 3), at(90, 0.5), at(200, 2, 6.0), at(300, 2), at(314, 2), at(316, 2), at(350, 2)]
    expected = [
        1,
        1.5,
        1,
        *(apart(points[i], at(270, 2)) for i in (3, 4)),
        *(apart(points[i], at(0, 2)) for i in (5, 6)),
    ]
    assert found.distance(np.array(points)) == pytest.approx(expected)
    assert found.point([0.0, 1.0]) == pytest.approx(np.array([[3, 1, 5], [1, -1, 5]]))


@pytest.mark.parametrize(("height", "bent"), [(0.0, False), (1e-10, False), (1e-6, True), (-1e-6, True)])
def test_three_points_on_a_line_are_no_arc(height: float, bent: bool) -> None:
    if bent:
        found = arc([0, 0, 0], [0.5, height, 0], [1, 0, 0])
        assert found.radius == pytest.approx((0.25 + height**2) / (2 * abs(height)), rel=1e-3)
        return
    with pytest.raises(InputError, match="the three points of the arc are on one line"):
        arc([0, 0, 0], [0.5, height, 0], [1, 0, 0])


def test_three_points_nanometres_apart_are_no_arc() -> None:
    for size, fits in ((1e-10, False), (1e-6, True)):
        corner = [[0, 0, 0], [size, 0, 0], [0, size, 0]]
        if fits:
            assert arc(*corner).radius == pytest.approx(size / math.sqrt(2))
        else:
            with pytest.raises(InputError, match="on one line"):
                arc(*corner)


# ---- poses ----------------------------------------------------------------------------------------------


def planned(*chain: Pose, repeat: bool = True, limits: tuple[JointLimits, ...] = ()) -> PlannedPoses:
    return trajectory(Motion(("a",), chain, repeat, limits=limits), PERIOD, CLOCK)


def test_times_are_rounded_half_up_to_frames() -> None:
    for seconds, frames, text in [
        ("0.03", 2, "2 frames last 0.04 s"),
        ("0.0299", 1, "1 frame last 0.02 s"),
        ("0.005", 1, "1 frame last 0.02 s"),
        ("0.05", 3, "3 frames last 0.06 s"),
        ("0.04", 2, None),
    ]:
        made = planned(Pose((0.5,), hold_s=Fraction(seconds)))
        assert len(made.trajectory.angles) == frames
        assert [warning.message.partition(": ")[2] for warning in made.warnings] == ([text] if text else [])


def test_a_motion_may_be_as_long_as_the_memory_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    def chain(second: str) -> tuple[Pose, Pose]:
        return Pose((0.0,), hold_s=Fraction("0.2")), Pose((1.0,), hold_s=Fraction(second))

    monkeypatch.setattr(poses_module, "MAX_FRAMES", 20)
    assert len(planned(*chain("0.2")).trajectory.angles) == 20
    with pytest.raises(InputError, match=r"with this pose the motion is more than 20 frames long, 0\.4 s"):
        planned(*chain("0.22"))
    assert len(planned(Pose((0.0,), hold_s=Fraction("0.4"))).trajectory.angles) == 20
    with pytest.raises(InputError, match=r"with hold_s = 0\.42 the motion is more than 20 frames long"):
        planned(Pose((0.0,), hold_s=Fraction("0.42")))


def test_the_parts_of_a_motion_are_its_poses_with_their_first_frames() -> None:
    tenth = Fraction(1, 10)
    made = planned(
        Pose((0.0,), hold_s=tenth, move_s=tenth),
        Pose((1.0,), hold_s=tenth, move_s=tenth),
        Pose((2.0,), move_s=tenth, hold_s=tenth, pause_s=tenth),
    )
    # hold 5; move and hold 10; move, hold and pause 15; the first pose's move 5
    assert made.parts == (Part("pose 1", 0), Part("pose 2", 5), Part("pose 3", 15), Part("pose 1", 30))
    assert len(made.trajectory.angles) == 35


def test_an_immediate_move_back_to_the_first_pose_is_no_part() -> None:
    """It takes no frame, in the loop's end as elsewhere."""
    tenth = Fraction(1, 10)
    made = planned(*(Pose((angle,), hold_s=tenth) for angle in (0.0, 1.0)))
    assert made.parts == (Part("pose 1", 0), Part("pose 2", 5))
    assert len(made.trajectory.angles) == 10


def test_a_pose_needs_a_time_of_its_own() -> None:
    tenth = Fraction(1, 10)
    for pose in (Pose((1.0,), hold_s=tenth), Pose((1.0,), pause_s=tenth), Pose((1.0,), move_s=tenth)):
        assert planned(Pose((0.0,), hold_s=tenth), pose).trajectory.loop_start == 0
    limited = planned(Pose((0.0,), hold_s=tenth), Pose((1.0,), move_s=None), limits=(JointLimits(1.0),))
    assert len(limited.trajectory.angles) > 5
    with pytest.raises(InputError, match="a pose takes no time"):
        planned(Pose((0.0,), hold_s=tenth), Pose((1.0,)))


def off_by(error: float, missed: float) -> m.FollowPath:
    def follow(shares: np.ndarray) -> Followed:
        # twice as many frames halve the distance from the path
        return Followed(shares, shares[:, None], missed + error * 10 / (len(shares) - 1), missed)

    return follow


# A move of ten frames: a note if it is within 1 mm of what its samples miss, otherwise a warning with the
# first doubled time that is enough.
def test_a_path_that_is_left_between_frames_is_warned_of() -> None:
    for error, missed, warns, advice in [
        (0.00099, 0.0, False, ""),
        (0.00101, 0.0, True, "; move_s = 0.4 keeps it within 0.505 mm"),
        (0.00099, 0.002, False, ""),
        (0.0039, 0.002, True, "; move_s = 0.8 keeps it within 2.975 mm"),
        (0.0079, 0.0, True, "; move_s = 1.6 keeps it within 0.988 mm"),
        (0.0159, 0.0, True, "; move_s = 3.2 keeps it within 0.994 mm"),
        (0.0161, 0.0, True, ""),
    ]:
        fifth = Fraction(1, 5)
        made = planned(
            Pose((0.0,), hold_s=fifth), Pose((1.0,), move_s=fifth, path=off_by(error, missed)), repeat=False
        )
        (found,) = made.warnings if warns else made.notes
        assert (len(made.warnings), len(made.notes)) == ((1, 0) if warns else (0, 1))
        assert (
            found.message == f"the path to pose 2 is followed within {1000 * (error + missed):.3f} mm{advice}"
        )


def test_a_path_too_fast_for_any_time_is_refused() -> None:
    def jumps(shares: np.ndarray) -> Followed:
        return Followed(shares, (shares[:, None] > 0.5) * 1.0, 0.0)

    with pytest.raises(InputError, match=r"not even in 32768 frames, 655\.36 s"):
        planned(
            Pose((0.0,), hold_s=Fraction(1)),
            Pose((1.0,), move_s=None, path=jumps),
            limits=(JointLimits(1.0),),
            repeat=False,
        )


def test_an_error_of_a_move_has_its_own_place_or_that_of_its_pose() -> None:
    def refuses(place: Location | None) -> m.FollowPath:
        def follow(shares: np.ndarray) -> Followed:
            raise InputError("leaves-reach", "it ends", place)

        return follow

    fifth, pose = Fraction(1, 5), Location("job.toml", 7)
    for place in (None, Location("job.toml", 9)):
        with pytest.raises(InputError, match="it ends") as caught:
            planned(Pose((0.0,), hold_s=fifth), Pose((1.0,), move_s=fifth, path=refuses(place), place=pose))
        assert caught.value.location == (place or pose)


def test_a_chain_of_via_poses_has_times_and_no_paths() -> None:
    hold, step = Fraction(1, 50), Fraction(1, 5)
    start, last = Pose((0.0,), hold_s=hold), Pose((0.0,), move_s=step)
    made = planned(start, Pose((1.0,), move_s=step, via=True), last, repeat=False)
    up = law("cubic").share(np.arange(11) / 10)
    assert made.trajectory.angles[:21, 0] == pytest.approx(np.concatenate((up, up[-2::-1])))
    assert made.parts == (Part("pose 1", 0), Part("pose 3", 1)), "a way through poses is its last one's"
    wrong = [
        Pose((1.0,), move_s=None, via=True),
        Pose((1.0,), move_s=Fraction(0), via=True),
        Pose((1.0,), move_s=step, via=True, path=off_by(0.0, 0.0)),
    ]
    for pose in wrong:
        with pytest.raises(InputError, match="either all via poses have a time, or none has"):
            planned(start, pose, last, repeat=False)
    for chain in ((Pose((0.0,), via=True, move_s=step), start), (start, Pose((1.0,), via=True, move_s=step))):
        with pytest.raises(InputError, match="cannot begin or end with a via pose"):
            planned(*chain, repeat=False)
    assert isinstance(made.trajectory, JointTrajectory)
