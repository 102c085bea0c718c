"""Poses become one row of angles a frame."""

from fractions import Fraction

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.motion import JointTrajectory, Motion, Pose, trajectory
from servogen.units import Clock, Cycles

CLOCK = Clock(4_000_000)
PERIOD = Cycles(20_000)  # 20 ms


def pose(angle: float, **seconds: Fraction | int | str | bool) -> Pose:
    times = {name: value if name == "release" else Fraction(value) for name, value in seconds.items()}
    return Pose((angle,), **times)  # type: ignore[arg-type]


def run(*poses: Pose, repeat: bool = True, release_at_end: bool = False) -> JointTrajectory:
    return trajectory(Motion(("arm",), poses, repeat, release_at_end), PERIOD, CLOCK).trajectory


def column(made: JointTrajectory) -> list[float]:
    return [float(value) for value in made.angles[:, 0]]


def test_holds_are_whole_frames() -> None:
    made = run(pose(0.5, hold_s=2), pose(1.5, hold_s=5), pose(2.0, hold_s=3))
    values, counts = np.unique(made.angles, return_counts=True)
    assert dict(zip(values.tolist(), counts.tolist(), strict=True)) == {0.5: 100, 1.5: 250, 2.0: 150}
    assert made.loop_start == 0


def test_a_move_takes_equal_steps_and_ends_on_the_pose() -> None:
    made = run(pose(0.0, hold_s="0.04"), pose(1.0, move_s="0.08", hold_s="0.02"))
    assert column(made) == [0.0, 0.0, 0.25, 0.5, 0.75, 1.0, 1.0]


def test_a_pose_without_a_move_is_a_step() -> None:
    assert column(run(pose(0.0, hold_s="0.02"), pose(1.0, hold_s="0.02"))) == [0.0, 1.0]


def test_the_first_poses_move_comes_from_the_last_pose_and_belongs_to_the_loop() -> None:
    made = run(pose(0.0, move_s="0.04", hold_s="0.02"), pose(1.0, hold_s="0.02"))
    assert column(made) == [0.0, 1.0, 0.5, 0.0]
    assert made.loop_start == 0


def test_a_pause_holds_the_position_unless_it_is_released() -> None:
    held = column(run(pose(0.5, hold_s="0.02", pause_s="0.04")))
    assert held == [0.5, 0.5, 0.5]
    released = column(run(pose(0.5, hold_s="0.02", pause_s="0.04", release=True)))
    assert released[0] == 0.5
    assert np.isnan(released[1:]).all()


def test_a_motion_that_does_not_repeat_ends_holding() -> None:
    made = run(pose(0.0, hold_s="0.04"), pose(1.0, hold_s="0.04"), repeat=False)
    assert made.loop_start == 4
    assert column(made)[4:] == [1.0]


def test_a_motion_that_does_not_repeat_may_end_released() -> None:
    made = run(pose(0.0, hold_s="0.04"), repeat=False, release_at_end=True)
    assert made.loop_start == 2
    assert np.isnan(made.angles[2:]).all()


def test_the_first_move_of_a_motion_that_does_not_repeat_is_not_made_and_said() -> None:
    motion = Motion(("arm",), (pose(0.0, move_s=1, hold_s="0.02"),), repeat=False)
    made = trajectory(motion, PERIOD, CLOCK)
    assert [each.code for each in made.warnings] == ["move-unused"]
    assert made.trajectory.loop_start == 1


def test_what_is_not_whole_frames_is_rounded_and_said() -> None:
    motion = Motion(("arm",), (pose(0.0, hold_s="0.055"),))
    made = trajectory(motion, PERIOD, CLOCK)
    assert len(made.trajectory.angles) == 3
    (warning,) = made.warnings
    assert warning.code == "frames-rounded"
    assert "hold_s = 0.055 is not a whole number of frames: 3 frames last 0.06 s" in warning.message


def test_a_time_shorter_than_half_a_frame_is_one_frame() -> None:
    assert column(run(pose(0.5, hold_s="0.001"))) == [0.5]


def test_a_pose_that_takes_no_time_is_refused() -> None:
    with pytest.raises(InputError, match="a pose takes no time"):
        run(pose(0.0, hold_s=1), pose(1.0))


def test_a_motion_without_a_pulse_is_refused() -> None:
    with pytest.raises(InputError, match="the motion has no pulse"):
        run(pose(0.0, pause_s=1, release=True))


def test_a_motion_that_would_fill_the_memory_is_refused() -> None:
    with pytest.raises(InputError, match="frames long"):
        run(pose(0.0, hold_s=10**9))
