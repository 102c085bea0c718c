"""The motion of an arm frame by frame, by hand: paths, the hand, waits, limits of a run, loops and calls."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.kinematics.catalogue import arm
from servogen.movemaster import Budget, ProgramRun, manipulator
from servogen.movemaster.arm import Hand, Manipulator, Mover, sampled
from servogen.movemaster.memory import ToolPose
from servogen.robot.model import FixedFrame

Ran = Callable[..., ProgramRun]
Refused = Callable[..., str]
FRAME = Fraction(1, 50)
RV_M1 = manipulator(arm("rv-m1"), (1.0, 2.0, 1.0, 1.0, 1.0))


def mover(hand: Hand | None = None, max_s: int = 100) -> Mover:
    return Mover(RV_M1, hand, FRAME, Fraction(max_s))


def trapezoid(share: float) -> float:
    """The share of the way of a trapezoid with ramps of a quarter of the time: its peak speed is 4/3."""
    if share > 0.5:
        return 1 - trapezoid(1 - share)
    return 8 / 3 * share**2 if share <= 0.25 else 1 / 6 + 4 / 3 * (share - 0.25)


# ---- paths ----------------------------------------------------------------------------------------------


def test_a_path_of_one_leg_takes_four_thirds_of_the_time_at_top_speed() -> None:
    """3 rad at 2 rad/s are 1.5 s; at 4/3 of the mean speed 2 s: a hundred frames."""
    path = sampled(np.array([[0.0, 1.0], [3.0, 0.0]]), np.array([2.0, 5.0]), FRAME)
    expected = [trapezoid(frame / 100) for frame in range(1, 101)]
    assert path[:, 0] == pytest.approx(3 * np.array(expected))
    assert path[:, 1] == pytest.approx(1 - np.array(expected))
    assert path[-1].tolist() == [3.0, 0.0]


def test_each_leg_takes_as_long_as_its_slowest_joint_needs() -> None:
    """Legs of 1 s and 0.5 s: the first two thirds of the way of the law are the first leg."""
    points = np.array([[0.0, 0.0], [1.0, 0.1], [1.1, 1.1]])
    path = sampled(points, np.array([1.0, 2.0]), FRAME)
    assert len(path) == math.ceil(1.5 * 4 / 3 / 0.02)
    for frame, row in enumerate(path, 1):
        way = 1.5 * trapezoid(frame / len(path))
        expected = (
            points[0] + way * (points[1] - points[0])
            if way <= 1
            else points[1] + (way - 1) * 2 * (points[2] - points[1])
        )
        assert row == pytest.approx(expected)


def test_even_legs_all_take_as_long_as_the_longest() -> None:
    points = np.array([[0.0], [1.0], [1.5]])
    path = sampled(points, np.array([1.0]), FRAME, even=True)
    assert len(path) == math.ceil(2 * 4 / 3 / 0.02)
    for frame, (value,) in enumerate(path, 1):
        way = 2 * trapezoid(frame / len(path))
        assert value == pytest.approx(way if way <= 1 else 1 + (way - 1) / 2)


def test_a_time_of_whole_frames_is_not_one_frame_more_and_a_way_of_a_nanometre_none() -> None:
    assert len(sampled(np.array([[0.0], [1.5]]), np.array([1.0]), FRAME)) == 100
    assert len(sampled(np.array([[0.0], [1.5 + 1e-6]]), np.array([1.0]), FRAME)) == 101
    assert sampled(np.array([[0.0], [0.9e-9]]), np.array([1.0]), FRAME).shape == (0, 1)
    assert len(sampled(np.array([[0.0], [1.1e-9]]), np.array([1.0]), FRAME)) == 1


@pytest.mark.parametrize("speed", range(10))
def test_a_speed_is_tenths_of_the_top_speeds(speed: int) -> None:
    """Joint 2 turns 0.6 rad at 2 rad/s: 0.3 s at the top speed, times 4/3, twenty frames."""
    own = mover()
    own.speed = speed
    own.turn_joints(np.array([0.0, 0.6, 0.0, 0.0, 0.0]))
    assert own.frame - 1 == math.ceil(200 / (speed + 1) - 1e-9)


def test_without_sp_the_speed_is_four_and_the_hand_takes_three_tenths_of_a_second() -> None:
    """docs/movemaster.md: the values before the first SP and GP are the manufacturer's."""
    own = mover()
    assert (own.speed, own.grip_tenths, own.hand_state) == (4, 3, "O")
    own.grip("C")
    assert (own.frame, own.hand_state) == (16, "C")


def test_joints_may_turn_up_to_their_limits(ran: Ran, refused: Refused) -> None:
    """q1 of the RV-M1 is at 90° and turns from -60° to 240°."""
    for by, end in ((150, 240), (-150, -60)):
        assert math.degrees(ran(f"MJ {by}, 0, 0, 0, 0").trajectory.angles[-1, 0]) == pytest.approx(end)
        beyond = by + math.copysign(0.1, by)
        assert f"joint q1 would turn to {end + math.copysign(0.1, by):g}°" in refused(
            f"MJ {beyond}, 0, 0, 0, 0"
        )


def test_mj_moves_sliding_joints_by_millimetres_and_refuses_joints_that_are_not_there(
    refused: Refused,
) -> None:
    robot = manipulator(arm("scara"), (1.0,) * 4)
    own = Mover(robot, None, FRAME, Fraction(100))
    before = own.q.copy()
    own.turn_joints(np.array([0.1, 0.0, 0.01, 0.0]))
    assert own.q - before == pytest.approx([0.1, 0, 0.01, 0])
    joint = robot.arm.joints[2]
    far = joint.upper - own.q[2] + 0.05
    with pytest.raises(
        InputError, match=f"joint {joint.name} would turn to {1000 * (joint.upper + 0.05):g} mm"
    ):
        own.turn_joints(np.array([0.0, 0.0, far, 0.0]))
    assert "MJ turns five joints, scara has 4" in refused("MJ 0, 0, 0, 0, 1", robot=robot)
    assert "MJ turns five joints, irb6400c has 6" in refused(
        "MJ 0, 0, 0, 0, 0", robot=manipulator(arm("irb6400c"), (1.0,) * 6)
    )


def test_mj_moves_a_scara_s_slider_in_millimetres(ran: Ran) -> None:
    robot = manipulator(arm("scara"), (1.0,) * 4)
    angles = ran("MJ 10, -20, 30, 5, 0", robot=robot).trajectory.angles
    assert angles[-1, :4] - angles[0, :4] == pytest.approx(
        [math.radians(10), math.radians(-20), 0.03, math.radians(5)]
    )


# ---- the hand -------------------------------------------------------------------------------------------

HAND = Hand("hand", open=0.5, closed=2.0, speed=3.0)


def test_the_hand_moves_evenly_and_as_fast_as_its_servo_may() -> None:
    own = mover(HAND)
    assert [HAND.angle(state) for state in "OC"] == [0.5, 2.0]
    own.grip("C")  # 1.5 rad at 3 rad/s: 25 frames, longer than the 15 of GP
    assert own.samples[1:, -1] == pytest.approx([0.5 + 1.5 * frame / 25 for frame in range(1, 26)])
    assert own.samples[-1, -1] == 2.0
    assert np.ptp(own.samples[:, :-1], axis=0).max() == 0
    own.grip_tenths = 10
    own.grip("O")
    assert len(own.samples) == 1 + 25 + 50
    own.grip("O")
    assert len(own.samples) == 76


def test_a_hand_of_unlimited_speed_takes_the_time_of_gp_but_a_frame_at_least() -> None:
    own = mover(replace(HAND, speed=None))
    own.grip_tenths = 0
    own.grip("C")
    assert own.samples[:, -1].tolist() == [0.5, 2.0]
    own.grip_tenths = 1
    own.grip("O")
    assert own.frame == 2 + 5


@pytest.mark.parametrize(
    ("seconds", "frames"),
    [("0", 0), ("0.001", 1), ("0.02", 1), ("0.0299", 1), ("0.03", 2), ("0.05", 3), ("1", 50)],
)
def test_a_wait_takes_the_nearest_number_of_frames_and_half_of_one_more(seconds: str, frames: int) -> None:
    own = mover()
    own.wait_s(Fraction(seconds))
    assert own.frame - 1 == frames


# ---- poses ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("angle", [-180.0, 180.0, 540.0, -179.0, 0.0, 181.0])
def test_a_roll_is_in_half_a_turn_to_both_sides(angle: float) -> None:
    q = np.array([0.3, 0.2, -0.4, 0.5, math.radians(angle)])
    wrapped = math.remainder(angle, 360)
    roll = RV_M1.pose(q).r
    assert roll == pytest.approx(180 if abs(wrapped) == 180 else wrapped, abs=1e-9) or roll == pytest.approx(
        -180
    )
    assert roll + 1e-6 > -180


def test_a_tool_s_length_moves_its_point_along_it() -> None:
    q = np.array([0.3, 0.2, -0.4, 0.5, 1.0])
    longer = RV_M1.with_tool_mm(125.0)
    assert (RV_M1.tool_mm, longer.tool_mm) == (0.0, pytest.approx(125))
    before, after = RV_M1.pose(q), longer.pose(q)
    along = RV_M1.approach(before)
    assert np.linalg.norm(along) == pytest.approx(1)
    assert np.array(after.values[:3]) - before.values[:3] == pytest.approx(125 * along)
    # the approach has the pitch above the horizontal, in the plane of the tool's azimuth
    azimuth = math.atan2(before.y, before.x)
    pitch = math.radians(before.p)
    assert along == pytest.approx(
        [math.cos(azimuth) * math.cos(pitch), math.sin(azimuth) * math.cos(pitch), math.sin(pitch)]
    )


def test_a_solution_brings_the_tool_to_its_pose_and_many_do_as_one(ran: Ran) -> None:
    q = np.array([0.3, 0.6, -0.9, 0.5, 1.0])
    pose = RV_M1.pose(q)
    assert RV_M1.solve(pose, q) == pytest.approx(q, abs=1e-9)
    several = RV_M1.solutions(np.array([pose.values, pose.values]), np.stack([q, q + 0.01]))
    for solutions in several:
        assert np.nanmin(np.abs(solutions - q).max(axis=1)) < 1e-9


def test_without_an_orientation_pitch_and_roll_are_zero() -> None:
    three = manipulator(arm("anthropomorphic"), (1.0,) * 3)
    q = np.array([0.3, 0.4, 0.5])
    pose = three.pose(q)
    assert (pose.p, pose.r) == (0.0, 0.0)
    assert three.solve(pose, q) == pytest.approx(q, abs=1e-9)
    for wrong in (replace(pose, p=1.0), replace(pose, r=-2.0)):
        with pytest.raises(InputError, match="takes no pitch and roll: they must be 0"):
            three.solve(wrong, q)
    with pytest.raises(InputError, match="cannot orient its tool independently"):
        three.approach(pose)


@pytest.mark.parametrize("key", ["x", "y", "rx", "ry"])
def test_a_tool_beside_the_approach_axis_has_no_length_along_it(key: str) -> None:
    with pytest.raises(InputError, match="rv-m1's tool is not on its approach axis"):
        manipulator(arm("rv-m1").with_tool(FixedFrame(**{key: 0.1})), (1.0,) * 5)
    assert isinstance(manipulator(arm("rv-m1").with_tool(FixedFrame(z=0.1, rz=0.2)), (1.0,) * 5), Manipulator)


def test_what_a_mover_keeps_is_what_decides_how_it_moves_on() -> None:
    def after(action: Callable[[Mover], object]) -> tuple[object, ...]:
        own = mover()
        action(own)
        return own.kept()

    same = after(lambda own: None)
    assert after(lambda own: own.stand(3)) == same
    assert after(lambda own: own.go_joints(own.q + 1e-11)) == same
    others = [
        after(lambda own: own.go_joints(own.q + 1e-7)),
        after(lambda own: own.grip("C")),
        after(lambda own: setattr(own, "speed", 5)),
        after(lambda own: setattr(own, "grip_tenths", 4)),
        after(lambda own: own.set_tool_mm(1.0)),
    ]
    assert len({*others, same}) == 6


def test_an_unreachable_pose_is_named_with_its_reason() -> None:
    with pytest.raises(InputError, match=r"the pose \(5000\.0, 0\.0, 0\.0\) mm, .* cannot be reached: "):
        mover().go(ToolPose(5000.0, 0.0, 0.0, 0.0, 0.0), "the pose")


# ---- limits of a run ------------------------------------------------------------------------------------


def test_a_program_may_have_as_many_frames_as_the_memory_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("servogen.movemaster.arm.MAX_FRAMES", 50)
    full = mover()
    full.stand(49)
    assert len(full.samples) == full.frame == 50
    for frames in (1, 49):
        with pytest.raises(InputError, match="the program is more than 50 frames long, 1 s"):
            (mover() if frames > 1 else full).stand(frames + (frames > 1))


def test_a_program_may_take_all_of_its_time_and_not_a_frame_more(ran: Ran, refused: Refused) -> None:
    """The first frame and the one that is held at the end are not the program's."""
    assert ran("10 TI 20", budget=Budget(100, Fraction(2))).steps[0].frames == 100
    assert "would take longer than 2 s" in refused("10 TI 20\n20 TI 1", budget=Budget(100, Fraction(2)))
    assert "would take longer than 1.98 s" in refused("10 TI 20", budget=Budget(100, Fraction(99, 50)))


def test_each_pass_of_a_repeated_program_has_the_whole_time(ran: Ran) -> None:
    run = ran("SC 1, 0\n10 TI 20", repeat=True, budget=Budget(100, Fraction(2)))
    assert len(run.trajectory.angles) - run.trajectory.loop_start == 100


def test_a_program_may_have_as_many_commands_as_allowed(ran: Ran, refused: Refused) -> None:
    text = "10 RC 3\n20 IC 1\n30 NX"  # RC, and three times IC and NX
    assert ran(text, budget=Budget(7, Fraction(9))).counters == {1: 3}
    assert "the program has not ended after 6 commands" in refused(text, budget=Budget(6, Fraction(9)))
    assert Budget() == Budget(100_000, Fraction(3600))


def nested(depth: int) -> str:
    """Loops of two rounds in each other."""
    opens = "".join(f"{number} RC 2\n" for number in range(1, depth + 1))
    return f"{opens}50 IC 1\n" + "".join(f"{number} NX\n" for number in range(60, 60 + depth))


def called(depth: int) -> str:
    """Subroutines that call each other; the last one counts."""
    lines = ["1 GS 10", "2 ED"]
    for level in range(1, depth + 1):
        body = f"GS {10 * (level + 1)}" if level < depth else "IC 1"
        lines += [f"{10 * level} {body}", f"{10 * level + 1} RT"]
    return "\n".join(lines)


def test_loops_and_calls_nest_nine_deep(ran: Ran, refused: Refused) -> None:
    """The manufacturer's limit (docs/movemaster.md)."""
    assert ran(nested(9), budget=Budget(9999, Fraction(9))).counters == {1: 2**9}
    assert "loops are nested deeper than 9" in refused(nested(10), budget=Budget(9999, Fraction(9)))
    assert ran(called(9)).counters == {1: 1}
    assert "subroutines are called 10 deep: 9 is the maximum" in refused(called(10))
    assert "RT without a GS" in refused("10 RT")


def test_lines_near_a_missing_one_are_named(refused: Refused) -> None:
    said = refused("10 ED\n20 ED\n30 ED\n40 ED\n50 ED\n60 ED\nRN 37")
    assert said.endswith("there is no program line 37 [unknown-line]\n  near it are the lines 20, 30, 40, 50")
    assert refused("RN 5").endswith("put the program before RN, each line with its number")


def test_a_line_given_twice_is_refused_with_the_place_of_the_other(refused: Refused) -> None:
    said = refused("10 NT\n20 ED\n10 GO")
    assert said.startswith("a.rvm:3:4: error: program line 10: program line 10 is given twice")
    assert "the other one is at a.rvm:1:4" in said


def test_bits_of_the_output_port_are_set_and_cleared_alone(ran: Ran) -> None:
    text = "10 OD 0\n" + "".join(f"{20 + bit} OB +{bit}\n" for bit in range(8))
    text += "".join(f"{40 + bit} OB -{bit}\n" for bit in range(8))
    up = [2 ** (bit + 1) - 1 for bit in range(8)]
    down = [255 - each for each in up]
    assert [each.value for each in ran(text).outputs] == [0, *up, *down]


def test_the_answer_of_a_run_is_in_seconds_metres_and_radians(ran: Ran) -> None:
    run = ran("PD 1, 250, 200, 350, -60, 20\n10 TI 10\n20 OT 5\n30 MO 1, C\n40 SC 3, 7")
    answer = run.to_json()
    assert answer["period_s"] == 0.02
    assert answer["frames"] == len(run.trajectory.angles)
    assert answer["loop_start"] == len(run.trajectory.angles) - 1
    wait, move = answer["steps"]  # type: ignore[misc]
    assert (wait["line"], wait["command"], wait["start_s"], wait["duration_s"]) == (10, "TI 10", 0.02, 1.0)
    assert (wait["hand"], move["hand"]) == ("open", "closed")
    assert move["position_m"] == pytest.approx([0.25, 0.2, 0.35])
    assert move["pitch_deg"] == pytest.approx(-60)
    assert move["roll_deg"] == pytest.approx(20)
    assert answer["outputs"] == [{"time_s": 1.02, "value": 5, "strobe": True}]
    assert answer["positions"]["1"]["position_m"] == [0.25, 0.2, 0.35]  # type: ignore[index]
    assert answer["counters"] == {"3": 7}


def test_a_rest_before_a_repeated_program_is_left_out_of_its_frames(ran: Ran) -> None:
    """TI waits 50 frames before the program closes and opens the hand: the loop is the program alone."""
    text = "TI 10\nOD 1\n10 GC\n20 OD 5\n30 GO\n40 OD 6\nRN 10"
    run = ran(text, repeat=True)
    close, back = run.steps
    assert (run.trajectory.loop_start, close.frame, back.frame) == (0, 0, close.frames)
    assert len(run.trajectory.angles) == close.frames + back.frames
    assert [(output.frame, output.value) for output in run.outputs] == [
        *((0, 1), (close.frames, 5), (close.frames + back.frames, 6)),
    ]
    # a motion before it is its lead-in
    led = ran("MJ 0, 5, 0, 0, 0\nMJ 0, -5, 0, 0, 0\n" + text, repeat=True)
    first = led.steps[3]
    assert (led.trajectory.loop_start, first.frame) == (first.frame, led.trajectory.loop_start)
    assert [step.statement.text[:2] for step in led.steps] == ["MJ", "MJ", "TI", "GC", "GO"]
