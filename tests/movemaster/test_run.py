"""A program's trajectory: its frames, its speeds, its limits, its repetition; other robots."""

import math
from collections.abc import Callable
from dataclasses import replace
from math import radians

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.kinematics.catalogue import arm
from servogen.movemaster import PortInput, ProgramRun, input_of, manipulator
from tests.movemaster.conftest import full_turns

Ran = Callable[..., ProgramRun]
Refused = Callable[..., str]

PICK = (
    "PD 1, 250, 200, 350, -60, 20\nPD 2, 100, 300, 250, -90, 90\nPD 3, -50, 320, 300, -45, 0\n"
    "SP 9\n10 MO 1\n20 MS 2, 20\n30 GC\n40 MC 1, 3\n50 MT 2, -30, O\n60 DW 5, 5, 5\n70 NT\n80 ED\n"
)


def test_the_trajectory_has_a_column_a_joint_and_one_for_the_hand(ran: Ran) -> None:
    trajectory = ran(PICK).trajectory
    assert trajectory.joints == ("q1", "q2", "q3", "q4", "q5", "hand")
    assert not np.isnan(trajectory.angles).any()


def test_a_program_that_ended_holds_its_last_pose(ran: Ran) -> None:
    trajectory = ran(PICK).trajectory
    assert trajectory.loop_start == len(trajectory.angles) - 1
    assert (trajectory.angles[-1] == trajectory.angles[-2]).all()


def test_the_steps_of_a_run_fill_all_frames_between_the_first_and_the_last(ran: Ran) -> None:
    run = ran(PICK)
    at = 1
    for step in run.steps:
        assert step.frame == at
        at += step.frames
    assert at == len(run.trajectory.angles) - 1


@pytest.mark.parametrize("speed", [0, 4, 9])
def test_no_joint_is_faster_than_its_share_of_its_top_speed(ran: Ran, speed: int) -> None:
    angles = ran(PICK.replace("SP 9", f"SP {speed}")).trajectory.angles
    tops = np.radians([120, 72, 109, 100, 163]) * (speed + 1) / 10
    assert (np.abs(np.diff(angles[:, :5], axis=0)) / 0.02 <= tops * (1 + 1e-9)).all()


def test_the_slowest_joint_is_as_fast_as_it_may_be(ran: Ran) -> None:
    # one joint alone: 90° at 120°/s, at the trapezoid's peak of 4/3 of the mean speed: 1 s and no frame more
    (step,) = ran("SP 9\nMJ -90, 0, 0, 0, 0").steps
    assert step.frames == 50


def test_the_tool_s_speed_along_ms_is_constant_between_its_ramps(ran: Ran) -> None:
    run = ran("PD 1, 200, 300, 250, -90, 90\nPD 2, -200, 300, 250, -90, 90\n10 MO 1\n20 MS 2, 40")
    step = run.steps[-1]
    from servogen.kinematics.forward import fk_position

    rows = run.trajectory.angles[step.frame : step.frame + step.frames, :5]
    speeds = np.linalg.norm(np.diff(fk_position(arm("rv-m1"), rows), axis=0), axis=1)
    middle = speeds[len(speeds) // 3 : 2 * len(speeds) // 3]
    assert np.ptp(middle) < 0.02 * middle.mean()


def test_joints_stay_within_their_limits_always(ran: Ran) -> None:
    robot = arm("rv-m1")
    narrow = replace(
        robot,
        joints=tuple(replace(j, lower=radians(-100), upper=radians(150)) for j in robot.joints),
    )
    angles = ran(PICK, robot=manipulator(narrow, (1.0,) * 5)).trajectory.angles
    assert angles[:, :5].min() >= radians(-100) - 1e-9
    assert angles[:, :5].max() <= radians(150) + 1e-9


def test_a_position_out_of_reach_is_named_with_line_and_reason(refused: Refused) -> None:
    said = refused("PD 5, 900, 0, 300, 0, 0\n10 NT\n20 MO 5")
    assert said.startswith(
        "a.rvm:3:4: error: program line 20: position 5 (900.0, 0.0, 300.0) mm, pitch 0.0°, roll 0.0° "
        "cannot be reached: "
    )
    assert "the nearest reachable point is (" in said


def test_a_position_that_only_the_limits_forbid_names_the_joint(refused: Refused) -> None:
    robot = arm("rv-m1")
    joints = (*(replace(joint, lower=radians(0), upper=radians(100)) for joint in robot.joints[:2]),)
    said = refused(
        "PD 5, 200, -250, 300, -90, 90\n10 MO 5",
        robot=manipulator(replace(robot, joints=(*joints, *robot.joints[2:])), (1.0,) * 5),
    )
    # atan2(-250, 200) = -51.340°, and 128.660° for the arm that reaches back over itself
    assert "q1 would have to be at -51.340°" in said or "q1 would have to be at 128.660°" in said
    assert "its limits are 0° to 100°" in said


def test_the_solution_nearest_to_where_the_arm_is_is_taken(ran: Ran) -> None:
    robot = full_turns(arm("rv-m1"))
    up = ran("MJ 0, 40, -60, 0, 0\n10 HE 1", robot=robot).positions[1]
    text = "PD 1, {:f}, {:f}, {:f}, {:f}, {:f}\n".format(*up.pose.values)
    above = ran("MJ 0, 60, -80, 0, 0\n" + text + "10 MO 1", robot=robot).trajectory.angles[-1]
    below = ran("MJ 0, -20, 80, -80, 0\n" + text + "10 MO 1", robot=robot).trajectory.angles[-1]
    assert above[2] < 0 < below[2]


# Repetition ----------------------------------------------------------------------------------------------


def test_a_program_that_ends_where_it_began_is_one_loop_behind_its_lead_in(ran: Ran) -> None:
    run = ran(PICK.replace("SP 9", "SP 9\nMJ 10, 0, 0, 0, 0\nNT"), repeat=True)
    angles, start = run.trajectory.angles, run.trajectory.loop_start
    assert angles[-1] == pytest.approx(angles[start - 1])
    assert start == run.steps[1].frame + run.steps[1].frames or start > 1


def test_a_program_that_ends_elsewhere_is_repeated_from_its_second_pass_on(ran: Ran) -> None:
    text = "PD 1, 250, 200, 350, -60, 20\nPD 2, 100, 300, 250, -90, 90\n10 MO 1\n20 MO 2\n30 ED\nRN 10"
    run = ran(text, repeat=True)
    _, second, third, fourth = run.steps
    assert run.trajectory.loop_start == third.frame
    assert (second.statement.text, fourth.statement.text) == ("MO 2", "MO 2")
    assert run.trajectory.angles[-1] == pytest.approx(run.trajectory.angles[third.frame - 1])


def test_steps_across_the_loop_s_end_are_as_slow_as_all_others(ran: Ran) -> None:
    trajectory = ran(PICK, repeat=True).trajectory
    loop = trajectory.angles[trajectory.loop_start :, :5]
    around = np.vstack([loop, loop])
    tops = np.radians([120, 72, 109, 100, 163])
    assert (np.abs(np.diff(around, axis=0)) / 0.02 <= tops * (1 + 1e-9)).all()


def test_a_program_that_counts_on_and_on_is_not_repeated(refused: Refused) -> None:
    assert "its second pass ends differently from its first" in refused("10 IC 1\n20 TI 1", repeat=True)


def test_only_a_program_run_once_and_last_is_repeated(refused: Refused) -> None:
    assert "must be run by a single RN" in refused("10 TI 1\nRN 10\nTI 1", repeat=True)
    assert "must be run by a single RN" in refused("10 TI 1\nRN 10\nRN 10", repeat=True)
    assert "there is no program to repeat" in refused("TI 1", repeat=True)
    assert "a program with inputs cannot be repeated" in refused(
        "10 TI 1", repeat=True, inputs=(input_of("1=1"),)
    )


def test_a_program_that_takes_no_time_is_a_loop_of_one_frame(ran: Ran) -> None:
    run = ran("10 ED", repeat=True)
    assert len(run.trajectory.angles) - run.trajectory.loop_start == 1


# Other robots --------------------------------------------------------------------------------------------


def test_the_six_joint_arm_takes_the_same_words(ran: Ran) -> None:
    robot = manipulator(arm("irb6400c"), (1.0,) * 6)
    home = robot.pose(np.array(robot.arm.home))
    text = "10 DW 0, 0, -50\n20 HE 1\n30 DW 20, 30, 0\n40 MO 1"
    run = ran(text, robot=robot)
    x, y, z, p, r = run.positions[1].pose.values
    assert (x, y, z) == pytest.approx((home.x, home.y, home.z - 50), abs=1e-5)
    assert robot.pose(run.trajectory.angles[-1, :6]).values == pytest.approx((x, y, z, p, r), abs=1e-5)


def test_an_arm_without_an_orientation_takes_no_pitch(ran: Ran, refused: Refused) -> None:
    robot = manipulator(arm("anthropomorphic"), (1.0,) * 3)
    x, y, z = (1000 * float(v) for v in _point(robot.arm, (0.3, 0.4, 0.5)))
    run = ran(f"MP {x:.4f}, {y:.4f}, {z:.4f}, 0, 0", robot=robot)
    assert robot.pose(run.trajectory.angles[-1, :3]).values[:3] == pytest.approx((x, y, z), abs=1e-3)
    assert "takes no pitch and roll" in refused(f"MP {x:.4f}, {y:.4f}, {z:.4f}, 10, 0", robot=robot)


def _point(robot: object, q: tuple[float, ...]) -> np.ndarray:
    from servogen.kinematics.forward import fk_position

    return fk_position(robot, q)  # type: ignore[arg-type]


def test_an_arm_without_speeds_is_refused() -> None:
    with pytest.raises(InputError, match="the maximum speed of rv-m1's joint q1 is not known"):
        manipulator(arm("rv-m1"), (None,) * 5)


@pytest.mark.parametrize(
    "q", [(0.3, 0.2, -0.4, 0.5, 1.0), (-2.0, 0.7, -1.1, 1.4, -2.5), (1.2, -0.3, 0.9, 0.1, 3.0)]
)
def test_pitch_and_roll_are_those_of_the_specification(q: tuple[float, ...]) -> None:
    pose = manipulator(arm("rv-m1"), (1.0,) * 5).pose(np.array(q))
    assert pose.p == pytest.approx(math.degrees(q[1] + q[2] + q[3]) - 90)
    assert pose.r == pytest.approx(math.degrees(q[4]))


def test_an_input_between_two_frames_counts_from_the_next_one(ran: Ran) -> None:
    (step,) = ran("10 IN", inputs=(PortInput(input_of("0.301=1").at_s, 1),)).steps
    assert step.frame + step.frames == 16


def test_a_move_to_where_the_arm_is_takes_no_frame(ran: Ran) -> None:
    assert not ran("10 DW 0, 0, 0\n20 HE 1\n30 MO 1\n40 MS 1, 5\n50 MC 1, 1\n60 NT").steps
