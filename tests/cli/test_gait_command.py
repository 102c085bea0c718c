"""`gait` as a user runs it: what it says, what it refuses, what it writes."""

import json
import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from tests.cli.conftest import rows_of

Run = Callable[..., Any]


def moved(rows: list[dict[str, str]], key: str, ground: str) -> list[float]:
    """How much `key` changes from frame to frame while a leg stands in the steady walk."""
    steady = rows[len(rows) // 2 :]
    return [
        float(after[key]) - float(before[key])
        for before, after in pairwise(steady)
        if before[ground] == after[ground] == "1"
    ]


def told(run: Run, *options: object) -> Any:
    done = run("gait", "hexapod", *options, "--json")
    assert done.code == 0, done.err
    return json.loads(done.out)


def test_a_tripod_lifts_two_threes_of_legs_by_turns(run: Run) -> None:
    found = told(run)
    assert found["duty"] == 0.5
    assert {leg for leg, lift in found["lifts"].items() if lift == 0} == {"L1", "R2", "L3"}
    assert {leg for leg, lift in found["lifts"].items() if lift == 0.5} == {"R1", "L2", "R3"}


def test_the_table_shows_each_leg_in_the_air_for_its_share_of_the_cycle(run: Run) -> None:
    lines = run("gait", "hexapod", "--gait", "wave").out.splitlines()
    cycle = [line.split()[-1] for line in lines if line.split()[:1] in (["L1"], ["R3"])]
    assert cycle == ["▁▁▁▁▔▔▁▁▁▁▁▁", "▁▁▁▁▁▁▔▔▁▁▁▁"]  # L1 lifts at 2/6, R3 at 3/6, each for 1/6


@pytest.mark.parametrize(("name", "duty"), [("tripod", 1 / 2), ("ripple", 2 / 3), ("wave", 5 / 6)])
def test_every_named_gait_keeps_the_centre_of_mass_inside_of_the_feet(
    run: Run, name: str, duty: float
) -> None:
    found = told(run, "--gait", name, "--stride-mm", 40)
    assert found["duty"] == pytest.approx(duty)
    assert found["stability"]["minimum_m"] > 0.03


@pytest.mark.parametrize(
    ("name", "frames", "frame", "front", "middle", "stepped"),
    [
        # When the body starts a foot is 40 mm · (lift - duty / 2) from the middle of its stance.
        # R1, L2, R3 step; L1 and R2 stand where they will lift, 10 mm behind.
        ("tripod", 20, 11, 90 - 10, -10, True),
        # L1 and R3 step; R1 stands 40/6 mm behind, L2 in the middle.
        ("ripple", 30, 21, 90 - 40 / 6, 0, True),
        # L1 steps; L2 stands 10 mm behind, R1 is at rest.
        ("wave", 60, 21, 90, -10, False),
    ],
)
def test_the_least_margin_is_that_of_steps_on_the_spot(
    run: Run, name: str, frames: int, frame: int, front: float, middle: float, stepped: bool
) -> None:
    """The body's centre is nearest to the side from a front foot to the middle one across.

    At rest a foot stands at y = 100 mm; the line of its stance of length c is the sagitta's half inside.
    """
    found = told(run, "--gait", name, "--stride-mm", 40)
    assert (found["frames_per_cycle"], found["stability"]["frame"]) == (frames, frame)
    half = 20 * found["duty"]
    y = 100 - (50 - math.sqrt(50**2 - half**2)) / 2
    across = y if stepped else 100
    least = (front * y + middle * across) / math.hypot(front - middle, y + across)
    assert 1000 * found["stability"]["minimum_m"] == pytest.approx(least, abs=0.02)


def test_the_springs_correction_of_a_straight_stance_is_the_sagitta_shared_out(run: Run) -> None:
    """Stance 20 mm on a circle of ρ = 50 mm: c² / 16 ρ = 0.5 mm on either side."""
    spring = told(run, "--stride-mm", 40)["spring"]
    assert 1000 * spring["largest_m"] == pytest.approx(20**2 / (16 * 50), abs=0.01)


def test_body_height_and_clearance_follow_from_the_legs_lengths(run: Run) -> None:
    """Straight down the leg is 60 + 80 mm; its knee is 80 mm above the foot."""
    found = told(run)
    assert found["body_height_m"] == pytest.approx(0.140)
    assert found["clearance_m"] == pytest.approx(0.080)
    assert found["lift_m"] == pytest.approx(0.020)
    low = told(run, "--body-height-mm", 130, "--lift-mm", 10)
    assert (low["body_height_m"], low["lift_m"]) == pytest.approx((0.130, 0.010))


def test_no_joint_is_faster_than_the_servo(run: Run) -> None:
    found = told(run, "--servo", "futaba-s3001")
    assert max(joint["peak_speed_deg_s"] for joint in found["joints"]) <= math.degrees(1.8) * (1 + 1e-9)
    slow = told(run, "--cycle-s", 2)
    assert slow["cycle_s"] == 2
    assert slow["frames_per_cycle"] == 100


def test_ones_own_gait_by_duty_factor_and_phases(run: Run) -> None:
    """The tripod by its table is the tripod."""
    by_name = told(run, "--duty", 0.5, "--lifts", "L1=0,R2=0,L3=0,R1=0.5,L2=0.5,R3=0.5")
    in_order = told(run, "--duty", 0.5, "--lifts", "0,0.5,0,0.5,0,0.5")
    tripod = told(run)
    for found in (by_name, in_order):
        assert found.pop("gait") == "own"
        assert found == {key: value for key, value in tripod.items() if key != "gait"}


def test_walking_sideways_and_turning_move_the_feet_so(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "walk.csv"
    told(run, "--stride-mm", 0, "--turn-deg", 10, "--csv", path)
    turned = moved(rows_of(path), "L2_x_mm", "L2_ground")
    assert turned and all(x > 0 for x in turned)  # turning left, a left foot goes forward under the body
    told(run, "--stride-mm", 20, "--direction-deg", 90, "--csv", path)
    sideways = moved(rows_of(path), "R2_y_mm", "R2_ground")
    assert sideways and all(y < 0 for y in sideways)  # going left, every foot goes to the right of the body


def test_a_walk_of_some_cycles_starts_and_stops_without_a_jump(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "walk.csv"
    found = told(run, "--cycles", 2, "--csv", path)
    rows = rows_of(path)
    assert len(rows) == found["frames"]
    assert found["loop_start"] == 0
    joints = [key for key in rows[0] if key.endswith("_deg")]
    for key in joints:
        assert float(rows[0][key]) == pytest.approx(float(rows[-1][key]), abs=1e-4)
    steps = [abs(float(b[key]) - float(a[key])) for a, b in pairwise(rows) for key in joints]
    assert max(steps) <= 750 * 0.02 + 1e-3


def test_the_csv_says_which_feet_are_on_the_ground_and_the_margin(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "walk.csv"
    found = told(run, "--csv", path)
    rows = rows_of(path)
    least = min(rows, key=lambda row: float(row["margin_mm"]))
    assert float(least["margin_mm"]) == pytest.approx(1000 * found["stability"]["minimum_m"], abs=1e-4)
    named = rows[found["stability"]["frame"]]
    assert named["margin_mm"] == least["margin_mm"]
    legs = ("L1", "L2", "L3", "R1", "R2", "R3")
    assert [leg for leg in legs if named[f"{leg}_ground"] == "1"] == found["stability"]["feet"]


def test_one_leg_on_the_bench_has_no_stability(run: Run) -> None:
    found = told(run, "--leg", "L2")
    assert found["stability"] is None
    assert [joint["name"] for joint in found["joints"]] == ["L2_alpha", "L2_beta"]


def test_a_walk_that_goes_nowhere_stands(run: Run) -> None:
    found = told(run, "--stride-mm", 0)
    assert found["lift_m"] == 0
    assert {joint["minimum_deg"] for joint in found["joints"] if joint["name"].endswith("beta")} == {0}
    assert 1000 * found["stability"]["minimum_m"] == pytest.approx(90)  # half of the body's length


UNSTABLE = ("--duty", 0.5, "--lifts", "L1=0,L2=0,L3=0,R1=0.5,R2=0.5,R3=0.5")


def test_a_gait_that_falls_over_is_refused_with_why(run: Run) -> None:
    done = run("gait", "hexapod", *UNSTABLE)
    assert done.code == 2
    assert "falls over in frame" in done.err
    assert "mm outside the feet R1, R2, R3" in done.err
    assert "--allow-falling" in done.err


def test_it_is_planned_when_that_is_asked_for(run: Run) -> None:
    assert told(run, *UNSTABLE, "--allow-falling")["stability"]["minimum_m"] < -0.09


def test_a_robot_in_the_air_has_no_margin_at_all(run: Run) -> None:
    done = run("gait", "hexapod", "--duty", 0.4, "--lifts", "0,0,0,0,0,0")
    assert done.code == 2
    assert "no foot is on the ground" in done.err
    assert (
        told(run, "--duty", 0.4, "--lifts", "0,0,0,0,0,0", "--allow-falling")["stability"]["minimum_m"]
        is None
    )


def test_an_unknown_gait_names_the_nearest(run: Run) -> None:
    done = run("gait", "hexapod", "--gait", "tripodd")
    assert done.code == 2
    assert "did you mean 'tripod'?" in done.err


def test_a_robot_that_does_not_walk_is_refused(run: Run) -> None:
    done = run("gait", "scara")
    assert done.code == 2
    assert "scara does not walk" in done.err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--duty", 0.5), "the phase of each leg"),
        (("--lifts", "0,0,0,0,0,0"), "a duty factor"),
        (("--duty", 0.5, "--lifts", "L1=x"), "is not a table of phases"),
        (("--duty", 0.5, "--lifts", "L1=0"), "the phase of the leg L2 is missing"),
        (("--duty", 0.5, "--lifts", "0,0"), "2 phases for 6 legs"),
        (("--duty", 1.5, "--lifts", "0,0,0,0,0,0"), "less than or equal to 1"),
        (("--beta-sign", 2), "1 or -1"),
        (("--clearance-mm", 90), "the ground clearance is 80.0 mm, less than the 90 mm required"),
        (("--spring-mm", 0.1), "but yield 0.1 mm at most"),
        (("--stride-mm", 4000), "limits"),
        (("--lift-mm", 0), "does not take the foot off the ground"),
        (("--body-height-mm", 300), "cannot stand"),
        (("--cycle-s", 0.04), "too short"),
        (("--cycles", 0), "needs more than 0 cycles"),
        (("--leg", "L4"), "no leg 'L4'"),
        (("--servo", "tiny"), "unknown servo"),
        (("--stride-mm", "nan"), "--stride-mm"),
        (("--direction-deg", "inf"), "--direction-deg"),
        (("--duty", 0.999, "--lifts", "0,0,0,0,0,0"), "between 0 and 1"),
        (("--cycles", 1e9), "less than or equal to 10000"),
        (("--cycle-s", 1e6), "frames long"),
    ],
)
def test_what_cannot_be_walked_is_refused_with_why(
    run: Run, options: tuple[object, ...], message: str
) -> None:
    done = run("gait", "hexapod", *options)
    assert done.code == 2, done.out
    assert message in done.err


@pytest.mark.campaign
def test_a_leg_and_a_falling_robot_can_be_drawn_too(run: Run, tmp_path: Path) -> None:
    told(run, "--leg", "L2", "--plot", tmp_path / "leg.png")
    told(run, "--duty", 0.4, "--lifts", "0,0,0,0,0,0", "--allow-falling", "--plot", tmp_path / "air.png")
    assert (tmp_path / "leg.png").stat().st_size > 10_000
    assert (tmp_path / "air.png").stat().st_size > 10_000


def test_a_film_lasts_as_long_as_the_loop_in_as_many_pictures_as_are_allowed(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from PIL import Image

    monkeypatch.setattr("servogen.report.film.MAX_PICTURES", 4)
    path = tmp_path / "walk.gif"
    found = told(run, "--leg", "L2", "--animate", path)
    assert found["frames_per_cycle"] == 20
    with Image.open(path) as film:
        assert film.n_frames == 4
        assert film.info["duration"] == 100


def test_an_mp4_needs_ffmpeg(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    done = run("gait", "hexapod", "--animate", tmp_path / "walk.mp4")
    assert done.code == 3
    assert "ffmpeg" in done.err
    assert not (tmp_path / "walk.mp4").exists()


def test_a_film_of_unknown_kind_is_refused(run: Run, tmp_path: Path) -> None:
    done = run("gait", "hexapod", "--animate", tmp_path / "walk.avi")
    assert done.code == 2
    assert ".gif, .mp4" in done.err


@pytest.mark.parametrize(
    ("name", "seconds", "frames"),
    [("tripod", 1, 50), ("tripod", 0.98, 50), ("ripple", 1, 54), ("ripple", 1.08, 54), ("wave", 1.1, 60)],
)
def test_a_cycle_is_lengthened_until_all_legs_lift_and_land_on_frames(
    run: Run, name: str, seconds: float, frames: int
) -> None:
    """Of 20 ms; halves are whole in multiples of 2 frames, sixths in multiples of 6."""
    found = told(run, "--gait", name, "--cycle-s", seconds)
    assert found["frames_per_cycle"] == frames
    assert found["cycle_s"] == pytest.approx(frames * 0.02)
    assert found["phase_changes"] == []


def test_a_cycle_of_a_large_grain_is_kept_and_what_moves_for_it_is_said(run: Run) -> None:
    """25ths and sixths are whole in multiples of 150 frames. Of 49 frames the swing has 15, not 15.68; no
    lift moves by more than half a frame (32.67 to 33, 16.33 to 16, 8.17 to 8, 40.83 to 41, 24.5 to 25).
    """
    lifts = "L1=0.6667,L2=0.3333,L3=0,R1=0.1667,R2=0.8333,R3=0.5"
    options = ("--duty", 0.68, "--lifts", lifts, "--cycle-s", 0.98)
    found = told(run, *options)
    assert (found["cycle_s"], found["frames_per_cycle"]) == (0.98, 49)
    (change,) = found["phase_changes"]
    assert change["what"] == "duty"
    assert change["frames"] == pytest.approx(0.68)
    done = run("gait", "hexapod", *options)
    assert "the duty factor is 0.6939 of the cycle, not 0.68: 0.68 frames" in done.out


def test_a_walk_that_is_too_heavy_for_its_servo_is_said(run: Run, tmp_path: Path) -> None:
    robot = tmp_path / "heavy.toml"
    robot.write_text('name = "heavy"\nkind = "hexapod"\nlike = "hexapod"\nmass_g = 2240\n')
    command = ("gait", robot, "--body-height-mm", 120, "--cycle-s", 1)
    done = run(*command)
    assert "0.49 N·m" in done.err
    assert "(0.33 N·m if all standing feet shared it equally)" in done.err
    torque = json.loads(run(*command, "--json").out)["torque"]
    assert torque["largest_nm"] == pytest.approx(2.24 * 9.80665 / 2 * 0.0447214, rel=1e-3)
    assert torque["leg"][1] == "2"
    assert run(*command, "--servo", "futaba-s3001").code == 0
    assert json.loads(run("gait", "hexapod", "--cycle-s", 1, "--json").out)["torque"] is None
