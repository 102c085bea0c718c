"""What each command does to the arm, the hand and the memory.

Expected poses come from the specification's closed form of the RV-M1: p = (c1 K, s1 K, d1 + a2 s2 + a3 s23 -
d5 c234), K = a2 c2 + a3 c23 + d5 s234, with d1 300, a2 250, a3 160, d5 72 mm.
"""

import re
from collections.abc import Callable
from dataclasses import replace
from math import acos, cos, degrees, radians, sin, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from servogen.kinematics.catalogue import arm
from servogen.kinematics.inverse.solve import solutions_near
from servogen.movemaster import ProgramRun, manipulator
from servogen.movemaster import arm as movemaster_arm
from tests.movemaster.conftest import full_turns

Ran = Callable[..., ProgramRun]
Refused = Callable[..., str]

CASES = Path(__file__).with_name("programs")

P1 = "PD 1, 250, 200, 350, -60, 20\n"
P2 = "PD 2, 100, 300, 250, -90, 90\n"
P3 = "PD 3, -50, 320, 300, -45, 0\n"


def pose(q: np.ndarray, tool_mm: float = 0.0) -> tuple[float, ...]:
    """The specification's closed form: x, y, z in mm, pitch and roll in degrees."""
    q1, q2, q3, q4, q5 = q[:5].tolist()
    lean, hand = q2 + q3 + q4, 72 + tool_mm
    out = 250 * cos(q2) + 160 * cos(q2 + q3) + hand * sin(lean)
    up = 300 + 250 * sin(q2) + 160 * sin(q2 + q3) - hand * cos(lean)
    return out * cos(q1), out * sin(q1), up, degrees(lean) - 90, degrees(q5)


def end(run: ProgramRun) -> np.ndarray:
    return run.trajectory.angles[-1]


def hand_deg(run: ProgramRun) -> float:
    return round(degrees(run.trajectory.angles[-1, -1]), 6)


def test_the_arm_begins_at_home_with_the_hand_open(ran: Ran) -> None:
    first = ran("10 ED").trajectory.angles[0]
    assert np.degrees(first) == pytest.approx([90, 0, 0, 0, 90, 30])


def test_mo_brings_the_tool_to_the_pose_that_pd_defined(ran: Ran) -> None:
    assert pose(end(ran(P1 + "10 MO 1"))) == pytest.approx((250, 200, 350, -60, 20), abs=1e-6)


def test_mo_without_a_position_is_refused(refused: Refused) -> None:
    assert refused("10 MO 7") == (
        "a.rvm:1:4: error: program line 10: position 7 is not defined [undefined-position]\n"
        "  PD, HE, PL or PT defines it before it is used"
    )


def test_mp_brings_the_tool_to_the_pose_it_is_given(ran: Ran) -> None:
    assert pose(end(ran("MP 250, 200, 350, -60, 20"))) == pytest.approx((250, 200, 350, -60, 20), abs=1e-6)


def test_mj_turns_each_joint_by_degrees(ran: Ran) -> None:
    q = end(ran("MJ -90, 30, -40, 5, -80\nMJ 1, 0, 0, 0, 0"))
    assert np.degrees(q[:5]) == pytest.approx([1, 30, -40, 5, 10])


def test_mj_beyond_a_limit_names_the_joint(refused: Refused) -> None:
    assert refused("MJ 151, 0, 0, 0, 0") == (
        "a.rvm:1:1: error: joint q1 would turn to 241° [servo-limit]\n  its limits are -60° to 240°"
    )


def test_dw_moves_the_hand_along_the_base_axes_and_keeps_its_direction(ran: Ran) -> None:
    assert pose(end(ran(P1 + "10 MO 1\n20 DW -10, 20, 30.5"))) == pytest.approx(
        (240, 220, 380.5, -60, 20), abs=1e-6
    )


def test_ma_adds_the_increments_of_the_second_position(ran: Ran) -> None:
    run = ran(P1 + "PD 50, 5, -5, 10, 2, 3\n10 MA 1, 50")
    assert pose(end(run)) == pytest.approx((255, 195, 360, -58, 23), abs=1e-6)
    assert run.positions[1].pose.values == (250, 200, 350, -60, 20)


def test_mt_stops_along_the_tool_before_or_behind_the_position(ran: Ran) -> None:
    # pitch -90°: the tool points down, so 40 mm along it is 40 mm lower
    assert pose(end(ran(P2 + "10 MT 2, 40"))) == pytest.approx((100, 300, 210, -90, 90), abs=1e-6)
    assert pose(end(ran(P2 + "10 MT 2, -40"))) == pytest.approx((100, 300, 290, -90, 90), abs=1e-6)


def test_mt_follows_the_direction_of_a_leaning_tool(ran: Ran) -> None:
    # pitch -60° in the plane at atan2(200, 250): cos 60° outward, sin 60° down
    share = 10 * cos(radians(60)) / (250**2 + 200**2) ** 0.5
    expected = (250 + 250 * share, 200 + 200 * share, 350 - 10 * sin(radians(60)), -60, 20)
    assert pose(end(ran(P1 + "10 MT 1, 10"))) == pytest.approx(expected, abs=1e-6)


def test_ms_follows_the_straight_line(ran: Ran) -> None:
    run = ran(P1 + P2 + "10 MO 1\n20 MS 2, 50")
    step = run.steps[-1]
    start, target = np.array([250, 200, 350]), np.array([100, 300, 250])
    along = (target - start) / np.linalg.norm(target - start)
    for row in run.trajectory.angles[step.frame : step.frame + step.frames]:
        way = np.array(pose(row)[:3]) - start
        assert np.linalg.norm(way - (way @ along) * along) < 0.05
    assert pose(end(run)) == pytest.approx((100, 300, 250, -90, 90), abs=1e-6)


P_FAR = "PD 1, 250, 300, 350, -60, 20\nPD 2, -250, 300, 350, -60, 20\n"


def off_the_line_mm(run: ProgramRun, number: int) -> float:
    """How far the tool is at most from the line between P_FAR's positions in step `number`."""
    step = run.steps[number]
    tools = [pose(row)[1:3] for row in run.trajectory.angles[step.frame : step.frame + step.frames]]
    return float(np.linalg.norm(np.array(tools) - [300, 350], axis=1).max())


def test_ms_with_few_points_warns_and_says_how_many_are_enough(ran: Ran) -> None:
    run = ran(P_FAR + "10 MO 1\n20 MS 2, 1")
    (warning,) = run.warnings
    assert warning.code == "off-the-line"
    assert str(warning.location) == "a.rvm:4:4: program line 20"
    found = re.fullmatch(
        r"on the move to position 2 the tool is up to ([\d.]+) mm off the straight line: "
        r"(\d+) intermediate points keep it within 1 mm",
        warning.message,
    )
    assert found
    assert float(found[1]) == pytest.approx(off_the_line_mm(run, -1), abs=0.06)
    enough = int(found[2])
    run = ran(P_FAR + f"10 MO 1\n20 MS 2, {enough}")
    assert not run.warnings
    assert off_the_line_mm(run, -1) <= 1
    assert ran(P_FAR + f"10 MO 1\n20 MS 2, {enough - 1}").warnings


def test_where_no_number_of_points_is_enough_none_is_advised(
    ran: Ran, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(movemaster_arm, "OFF_THE_LINE_MM", 1e-3)
    (warning,) = ran(P_FAR + "10 MO 1\n20 MS 2, 99").warnings
    assert warning.message.endswith("99 intermediate points, the maximum, do not keep it within 0.001 mm")


def test_ms_names_the_point_of_the_line_that_is_out_of_reach(refused: Refused) -> None:
    said = refused(
        "PD 1, 0, 320, 350, 0, 0\nPD 2, 0, -320, 350, 0, 0\n10 MO 1\n20 MS 2, 7",
        robot=full_turns(arm("rv-m1")),
    )
    # The wrist is 72 mm behind the tool, 50 mm above the shoulder, and at least 250 - 160 = 90 mm from it:
    # 72 + √(90² - 50²) = 146.833
    assert said.startswith(
        "a.rvm:4:4: error: program line 20: the straight line to position 2 leaves what the arm reaches at "
        "(0.000, 146.833, 350.000) mm: "
    )
    assert "but not in this orientation" in said  # the hand would have to point another way


def test_ms_ends_where_the_branch_does_that_a_numerical_method_follows(
    refused: Refused, ran: Ran, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The elbow bends to 60°: there the tool is √(300² + 200² + 2 · 300 · 200 cos 60°) mm from the axis. Bent
    the other way it would reach farther in.
    """

    def one_elbow(*asked: Any) -> np.ndarray:
        found = solutions_near(*asked)
        return np.where(found[..., 1:] > 0, found, np.nan)

    monkeypatch.setattr(movemaster_arm, "solutions_near", one_elbow)
    plain = arm("theta1-theta2")
    shoulder, elbow = plain.joints
    elbow = replace(elbow, lower=-2.0, upper=radians(60), home=radians(40))
    robot = manipulator(replace(plain, joints=(shoulder, elbow)), (1.0, 1.0))
    text = "PD 1, 470, 0, 0, 0, 0\nPD 2, 400, 0, 0, 0, 0\n10 MO 1\n20 {}"
    assert refused(text.format("MS 2, 7"), robot=robot) == (
        "a.rvm:4:4: error: program line 20: the straight line to position 2 leaves what the arm reaches at "
        f"({sqrt(300**2 + 200**2 + 300 * 200):.3f}, 0.000, 0.000) mm: the arm is at the limit of its reach "
        "[leaves-reach]\n  MO goes to position 2 through joint space"
    )
    assert ran(text.format("MO 2"), robot=robot).trajectory.angles[-1, 1] < 0


def test_ms_that_would_change_the_branch_is_refused_at_the_place(refused: Refused) -> None:
    # The arm stands turned round, q1 = -90°, and its hand down: q2 + q3 + q4 = 0. When q4 comes to its end at
    # -180° the forearm is level: 250 cos q2 - 160 = -120, so q2 = 80.793° and z = 300 + 250 sin q2 - 72.
    text = (CASES / "ms.rvm").read_text("utf-8").replace("30 MS 2, 5", "30 MO 2")
    said = refused(text, robot=full_turns(arm("rv-m1")))
    q2 = acos(40 / 250)
    assert said.startswith(
        "a.rvm:10:4: error: program line 50: the straight line to position 5 would change the branch "
        "of the inverse "
        f"kinematics at (0.000, 120.000, {300 + 250 * sin(q2) - 72:.3f}) mm: "
        f"from q1 -90.000°, q2 {degrees(q2):.3f}°, q3 {180 - degrees(q2):.3f}°, q4 -180.000°, q5 -90.000° "
        "to q1 90.000°, q2 "
    )
    assert said.endswith("\n  MO goes to position 5 through joint space")


def test_ms_that_would_turn_the_hand_past_its_limit_is_refused_where_it_is_reached(refused: Refused) -> None:
    # From roll 170° to -170° the short way is 20°, over 180° half way: there q5 is at its end.
    said = refused((CASES / "ms.rvm").read_text("utf-8"), robot=full_turns(arm("rv-m1")))
    assert said.startswith(
        "a.rvm:8:4: error: program line 30: the straight line to position 2 would change the branch "
        "of the inverse "
        "kinematics at (100.000, 275.000, 250.000) mm: from q1 70.017°, "
    )
    here, there = said.split(" mm: from ")[1].split("\n")[0].split(" to ")
    assert "q5 180.000°" in here
    assert "q5 180.000°" not in there


def test_the_hand_turns_the_short_way_along_ms_where_its_joint_allows_it(ran: Ran) -> None:
    text = "PD 1, 200, 250, 300, -60, 170\nPD 2, 0, 300, 200, -90, -170\n10 MO 1\n20 MS 2, 9"
    run = ran(text, robot=full_turns(arm("rv-m1"), 400))
    step = run.steps[-1]
    rolls = np.degrees(run.trajectory.angles[step.frame - 1 : step.frame + step.frames, 4])
    assert np.ptp(rolls) == pytest.approx(20, abs=1e-6)
    assert np.abs(np.diff(rolls)).sum() == pytest.approx(20, abs=1e-6)


def test_mc_passes_all_defined_positions_between_without_stopping(ran: Ran) -> None:
    run = ran(P1 + P2 + P3 + "10 MC 1, 3")
    tools = np.array([pose(row)[:3] for row in run.trajectory.angles])
    for point in ((250, 200, 350), (100, 300, 250)):
        assert np.linalg.norm(tools - point, axis=1).min() < 15
    assert pose(end(run)) == pytest.approx((-50, 320, 300, -45, 0), abs=1e-6)
    moved = np.abs(np.diff(run.trajectory.angles[:, :5], axis=0)).max(axis=1)
    assert (moved[:-1] > 0).all(), "only the last frame stands"


def test_mc_goes_downwards_too_and_skips_what_is_not_defined(ran: Ran) -> None:
    run = ran(P1 + P3 + "10 MC 3, 1")
    assert pose(end(run)) == pytest.approx((250, 200, 350, -60, 20), abs=1e-6)


def test_mc_needs_both_ends(refused: Refused) -> None:
    assert "position 2 is not defined" in refused(P1 + P3 + "10 MC 1, 2")


def test_ip_and_dp_go_to_the_neighbours_in_number(ran: Ran) -> None:
    positions = P1 + "PD 5, 100, 300, 250, -90, 90\n" + "PD 9, -50, 320, 300, -45, 0\n"
    assert pose(end(ran(positions + "10 IP")))[2] == pytest.approx(350)
    assert pose(end(ran(positions + "10 MO 5\n20 IP")))[2] == pytest.approx(300)
    assert pose(end(ran(positions + "10 MO 5\n20 DP")))[2] == pytest.approx(350)


@pytest.mark.parametrize(("command", "side"), [("IP", "above"), ("DP", "below")])
def test_ip_and_dp_without_a_neighbour_are_refused(refused: Refused, command: str, side: str) -> None:
    assert f"no position {side} 1 is defined" in refused(P1 + f"10 MO 1\n20 {command}")


def test_he_stores_where_the_arm_is_and_how_the_hand_is(ran: Ran) -> None:
    run = ran(P1 + "10 MO 1\n20 GC\n30 HE 8\n40 NT\n50 MO 8")
    assert run.positions[8].pose.values == pytest.approx((250, 200, 350, -60, 20), abs=1e-6)
    assert run.positions[8].hand == "C"
    assert pose(end(run)) == pytest.approx((250, 200, 350, -60, 20), abs=1e-6)


def test_nt_returns_to_the_home_of_the_robot(ran: Ran) -> None:
    assert np.degrees(end(ran(P1 + "10 MO 1\n20 NT"))[:5]) == pytest.approx([90, 0, 0, 0, 90])


def test_og_goes_to_the_pose_that_ho_took_and_before_it_to_the_origin(ran: Ran) -> None:
    run = ran(P1 + P2 + "10 MO 1\n20 HO\n30 MO 2\n40 OG")
    assert pose(end(run)) == pytest.approx((250, 200, 350, -60, 20), abs=1e-6)
    assert np.degrees(end(ran(P1 + "10 MO 1\n20 OG"))[:5]) == pytest.approx([90, 0, 0, 0, 90])


def test_tl_moves_the_point_that_positions_mean(ran: Ran) -> None:
    q = end(ran("TL 107.5\n" + P2 + "10 MO 2"))
    assert pose(q, 107.5) == pytest.approx((100, 300, 250, -90, 90), abs=1e-6)


def test_pl_copies_px_exchanges_sf_adds_pc_clears(ran: Ran) -> None:
    assert ran(P1 + "10 PL 4, 1").positions[4] == ran(P1 + "10 ED").positions[1]
    swapped = ran(P1 + P2 + "10 PX 1, 2").positions
    assert (swapped[1].pose.z, swapped[2].pose.z) == (250, 350)
    shifted = ran(P1 + "PD 2, 1, 2, 3, 4, 5\n10 SF 1, 2").positions
    assert shifted[1].pose.values == (251, 202, 353, -56, 25)
    assert shifted[2].pose.values == (1, 2, 3, 4, 5)
    assert list(ran(P1 + P2 + P3 + "PC 1, 2\n10 ED").positions) == [3]
    assert list(ran(P1 + P2 + P3 + "PC 2\n10 ED").positions) == [1, 3]
    assert not ran(P1 + P2 + P3 + "PC 0\n10 ED").positions


def test_pc_with_numbers_that_make_no_sense_is_refused(refused: Refused) -> None:
    assert "PC 0 clears all positions" in refused("PC 0, 5")
    assert "the second number must be the higher one" in refused("PC 5, 2")


def test_nw_deletes_the_program_and_the_positions(ran: Ran) -> None:
    run = ran(P1 + "10 MO 1\nNW\n10 TI 5\n20 ED")
    assert not run.positions
    assert [step.statement.text for step in run.steps] == ["TI 5"]


def test_go_and_gc_move_the_hand_s_servo(ran: Ran) -> None:
    assert hand_deg(ran("10 GC")) == 90
    assert hand_deg(ran("10 GC\n20 GO")) == 30


def test_a_hand_that_is_there_already_takes_no_time(ran: Ran) -> None:
    assert not ran("10 GO").steps


def test_gp_says_how_long_the_hand_takes_but_not_longer_than_its_servo(ran: Ran) -> None:
    # 60° at 300°/s take 0.2 s: ten frames
    assert [step.frames for step in ran("10 GC").steps] == [15]
    assert [step.frames for step in ran("10 GP 8, 5, 20\n20 GC").steps] == [100]
    run = ran("10 GP 8, 5, 0\n20 GC")
    assert [step.frames for step in run.steps] == [10]
    assert [warning.code for warning in run.warnings] == ["grip-force"]


def test_the_hand_of_a_position_is_what_gf_said_when_pd_stored_it(ran: Ran) -> None:
    assert hand_deg(ran("GF 1\n" + P1 + "10 MO 1")) == 90
    assert hand_deg(ran("GF 1\nGF 0\n" + P1 + "10 GC\n20 MO 1")) == 30


@pytest.mark.parametrize("move", ["MO 1, C", "MA 1, 9, C", "MS 1, 9, C", "MT 1, 0, C"])
def test_a_written_hand_state_goes_before_the_stored_one_and_before_the_move(ran: Ran, move: str) -> None:
    run = ran(P1 + "PD 9,,,,,\n10 " + move)
    step = run.steps[0]
    closing = run.trajectory.angles[step.frame : step.frame + 15]
    assert np.ptp(closing[:, :5], axis=0).max() == 0
    assert hand_deg(run) == 90
    assert run.positions[1].hand == "O"


def test_mc_leaves_the_hand_as_it_is(ran: Ran) -> None:
    assert hand_deg(ran(P1 + P2 + "10 GC\n20 MC 1, 2")) == 90


def test_without_a_hand_s_servo_gripping_takes_its_time_only(ran: Ran) -> None:
    run = ran("10 GC", hand=None)
    assert run.trajectory.joints == ("q1", "q2", "q3", "q4", "q5")
    assert [step.frames for step in run.steps] == [15]


@pytest.mark.parametrize(("tenths", "frames"), [(0, 0), (1, 5), (20, 100)])
def test_ti_waits_tenths_of_a_second(ran: Ran, tenths: int, frames: int) -> None:
    assert sum(step.frames for step in ran(f"10 TI {tenths}").steps) == frames


def test_sp_sets_tenths_of_the_top_speed(ran: Ran) -> None:
    frames = {speed: ran(P1 + f"10 SP {speed}\n20 MO 1").steps[0].frames for speed in (0, 4, 9)}
    assert frames[4] == pytest.approx(2 * frames[9], abs=1)
    assert frames[0] == pytest.approx(10 * frames[9], abs=10)


def test_rs_as_a_direct_line_changes_nothing(ran: Ran) -> None:
    assert ran(P1 + "RS\n10 ED").positions == ran(P1 + "10 ED").positions
