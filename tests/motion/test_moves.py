"""Moves between poses: by law, as fast as the limits allow, along paths, through via points."""

import math
from fractions import Fraction

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.motion import Motion, PlannedPoses, Pose, bound, trajectory
from servogen.motion.follow import Followed, trace
from servogen.motion.laws import NAMES, law
from servogen.motion.limits import JointLimits, at_rest, stretch
from servogen.motion.paths import StraightLine
from servogen.robot.binding import Binding
from servogen.units import Clock, Cycles

CLOCK, PERIOD, FRAME_S = Clock(4_000_000), Cycles(20_000), 0.02
LIMITS = (JointLimits(2.0, 30.0), JointLimits(3.0, 20.0))
HOLD = Fraction(1, 50)


def planned(*poses: Pose, repeat: bool = True) -> PlannedPoses:
    return trajectory(Motion(("a", "b"), poses, repeat, limits=LIMITS), PERIOD, CLOCK)


def around(made: PlannedPoses) -> np.ndarray:
    angles = made.trajectory.angles
    return np.concatenate((angles, angles[:4]))


@pytest.mark.parametrize("name", NAMES)
def test_a_move_with_a_time_follows_its_law(name: str) -> None:
    made = planned(
        Pose((0.0, 1.0), hold_s=HOLD), Pose((1.0, -1.0), move_s=Fraction(1), law=name), repeat=False
    )
    share = law(name).share(np.arange(51) / 50)
    wanted = np.stack([share, 1 - 2 * share], axis=1)
    assert made.trajectory.angles[:51] == pytest.approx(wanted)


@pytest.mark.parametrize("name", NAMES)
def test_a_move_without_a_time_is_as_fast_as_the_limits_allow(name: str) -> None:
    made = planned(
        Pose((0.0, 0.0), hold_s=HOLD), Pose((1.0, 2.0), move_s=None, hold_s=HOLD, law=name), repeat=False
    )
    angles = made.trajectory.angles
    assert stretch(angles, FRAME_S, LIMITS) <= 1 + 1e-9
    # Two frames fewer would break a limit: the continuous law is rounded up to whole frames.
    quicker = np.concatenate(([0.0], law(name).share(np.arange(1, len(angles) - 4) / (len(angles) - 5))))
    if name in ("linear", "cubic", "quintic"):
        assert stretch(at_rest(np.outer(quicker, [1.0, 2.0])), FRAME_S, LIMITS) > 1


def test_all_joints_of_a_move_end_together() -> None:
    made = planned(Pose((0.0, 0.0), hold_s=HOLD), Pose((0.1, 2.0), move_s=None, law="cubic"), repeat=False)
    angles = made.trajectory.angles
    assert angles[:, 0] * 20 == pytest.approx(angles[:, 1])


def test_via_points_are_passed_at_their_time_without_stopping() -> None:
    step = Fraction(1, 5)
    made = planned(
        Pose((0.0, 0.0), hold_s=HOLD),
        Pose((1.0, 0.5), move_s=step, via=True),
        Pose((0.5, 1.0), move_s=step, via=True),
        Pose((0.0, 1.0), move_s=step),
        repeat=False,
    )
    angles = made.trajectory.angles
    assert angles[10] == pytest.approx([1.0, 0.5])
    assert angles[20] == pytest.approx([0.5, 1.0])
    assert angles[30] == pytest.approx([0.0, 1.0])
    jumps = np.abs(np.diff(angles[:31], 2, axis=0)).max()
    assert jumps < 0.05
    assert np.abs(angles[11] - angles[9]).max() > 0.01


def test_via_points_without_times_keep_the_limits() -> None:
    made = planned(
        Pose((0.0, 0.0), hold_s=HOLD),
        Pose((1.0, 0.5), move_s=None, via=True),
        Pose((0.5, 1.0), move_s=None, via=True),
        Pose((0.0, 1.0), move_s=None),
        repeat=False,
    )
    assert 0.9 < stretch(made.trajectory.angles, FRAME_S, LIMITS) <= 1 + 1e-9


def test_a_loop_of_via_points_never_stops() -> None:
    corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    made = planned(*(Pose(corner, move_s=None, via=True) for corner in corners))
    angles = around(made)
    assert made.trajectory.loop_start == 0
    assert np.linalg.norm(np.diff(angles, axis=0), axis=1).min() > 0.01
    assert stretch(angles, FRAME_S, LIMITS) <= 1 + 1e-6
    for corner in corners:
        assert np.abs(angles - corner).max(axis=1).min() < 0.03


@pytest.mark.parametrize("repeat", [True, False])
def test_a_motion_cannot_begin_with_a_pose_that_it_only_passes(repeat: bool) -> None:
    with pytest.raises(InputError, match="begin or end with a via pose"):
        planned(Pose((0.0, 0.0), via=True), Pose((1.0, 1.0), hold_s=HOLD), repeat=repeat)


def test_a_path_says_its_chord_error_and_keeps_the_limits() -> None:
    # The joints are the polar coordinates of the point.
    line = StraightLine((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))

    def forward(angles: np.ndarray) -> np.ndarray:
        r, turn = angles.T
        return np.stack([r * np.cos(turn), r * np.sin(turn), 0 * r], axis=1)

    def inverse(shares: np.ndarray, near: np.ndarray) -> np.ndarray:
        points = line.point(shares)
        polar = [np.hypot(points[:, 0], points[:, 1]), np.arctan2(points[:, 1], points[:, 0])]
        return np.stack(polar, axis=1)[:, None, :]

    def way(shares: np.ndarray) -> Followed:
        return trace(line, inverse, (1.0, 0.0), str).followed(shares, forward)

    made = planned(
        Pose((1.0, 0.0), hold_s=HOLD),
        Pose((1.0, math.pi / 2), move_s=None, law="quintic", path=way, hold_s=HOLD),
        repeat=False,
    )
    angles = made.trajectory.angles
    assert line.distance(forward(angles)).max() < 1e-12
    assert 0.9 < stretch(angles, FRAME_S, LIMITS) <= 1 + 1e-9
    (note,) = made.notes
    assert note.code == "off-the-path"
    between = (angles[:-1] + angles[1:]) / 2
    worst = 1000 * line.distance(forward(between)).max()
    assert f"within {worst:.3f} mm" in note.message


def test_a_move_that_nothing_limits_is_refused_at_its_pose() -> None:
    motion = Motion(
        ("a",),
        (Pose((0.0,), hold_s=HOLD), Pose((1.0,), move_s=None)),
        limits=(JointLimits(),),
    )
    with pytest.raises(InputError, match="the speed of this move is not known"):
        trajectory(motion, PERIOD, CLOCK)


def test_joints_become_servos_by_their_bindings() -> None:
    made = planned(Pose((0.5, 2.0), hold_s=HOLD)).trajectory
    servos = bound(made, [Binding("b", "lift", 0.25, -0.5), Binding("a", "turn")])
    assert servos.joints == ("lift", "turn")
    assert servos.angles.tolist() == [[-0.75, 0.5]]
    assert Binding("b", "lift", 0.25, -0.5).position([-0.75]).tolist() == [2.0]
    with pytest.raises(InputError, match="does not move a joint 'c'"):
        bound(made, [Binding("c", "x")])


@pytest.mark.parametrize("name", NAMES)
def test_a_path_without_a_time_is_not_accelerated_faster_than_allowed_from_rest(name: str) -> None:
    """The frames of rest before and after it count: a law that jumps to its speed at once, too."""
    line = StraightLine((0.0, 0.0, 0.0), (0.5, 0.5, 0.0))

    def follow(shares: np.ndarray) -> Followed:
        return Followed(shares, line.point(shares)[:, :2], 0.0)

    made = planned(
        Pose((0.0, 0.0), hold_s=HOLD),
        Pose((0.5, 0.5), move_s=None, hold_s=HOLD, law=name, path=follow),
        repeat=False,
    )
    angles = made.trajectory.angles
    assert np.abs(np.diff(angles, 2, axis=0)).max() / FRAME_S**2 <= 20.0 * (1 + 1e-9)
    assert np.abs(np.diff(angles[1:-1], axis=0)).max() / FRAME_S <= 2.0 + 1e-9
