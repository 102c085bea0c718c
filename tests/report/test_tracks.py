"""From pulses back: what whole cycles do to foot, tool and base."""

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from servogen.job import PlannedJob, loads, plan_job
from servogen.pulse.plan import plan
from servogen.report.film import job_scene
from servogen.report.tracks import Track, end_errors, end_tracks, largest_error, made_angles
from tests.report.planned import planned

JOBS = Path(__file__).parents[2] / "jobs"
ARMED = ("lab9-exercise", "scara-pick", "rvm1-program", "hexapod-tripod")


def scaled(job: PlannedJob, share: float) -> tuple[Track, ...]:
    """The tracks of a job whose angles are off by a share of what whole cycles make them."""
    schedule = plan(job.trajectory, job.servos, job.frame).schedule
    off = share * (made_angles(schedule, job.servos) - job.trajectory.angles)
    found = []
    for end in job.ends:
        asked = job.trajectory.angles
        before, after = end.points(asked), end.points(asked + off)
        found.append(Track(end.name, end.kind, before, after, end.shift(asked, off)))
    return tuple(found)


@pytest.mark.parametrize("name", ARMED)
def test_the_jacobian_and_the_direct_calculation_agree_to_first_order(name: str) -> None:
    """What they differ by is of second order: with half the error a quarter is left."""
    job, _, tracks = planned(name)
    left = []
    for share in (1.0, 0.5, 0.25):
        parts = scaled(job, share)
        left.append(max(float(np.abs(each.made - each.planned - each.shift).max()) for each in parts))
    assert 0 < left[0] < 0.01 * max(float(track.error.max()) for track in tracks)
    for larger, smaller in pairwise(left):
        assert larger / smaller == pytest.approx(4, rel=0.05)


@pytest.mark.parametrize("name", ARMED)
def test_the_worst_and_rms_through_the_jacobian_are_the_direct_ones(name: str) -> None:
    for each in end_errors(planned(name)[2]):
        assert each.first_order_worst_m == pytest.approx(each.worst_m, rel=0.01)
        assert each.first_order_rms_m == pytest.approx(each.rms_m, rel=0.01)


@pytest.mark.parametrize("name", ("lab9-exercise", "scara-pick", "rvm1-program"))
def test_the_planned_path_is_the_one_that_the_job_itself_calculates(name: str) -> None:
    job, _, (track,) = planned(name)
    assert job.tip is not None
    columns = [job.servos.index(servo) for servo in job.tip.servos]
    assert track.planned == pytest.approx(job.tip.where(job.trajectory.angles[:, columns]), abs=1e-12)


def test_a_walking_robot_has_a_track_for_each_foot_in_the_body_frame() -> None:
    """At a body height of 130 mm sin² β is 1 - (50 / 60)²: the foot is r = 30 + 20 mm beside its mount and
    60 sin β = 33.166 mm before or behind it, √(50² + 33.166²) = 60 mm from it, and α turns it straight out.
    """
    tracks = planned("hexapod-tripod")[2]
    assert [track.name for track in tracks] == ["L1", "L2", "L3", "R1", "R2", "R3"]
    stood = [(x, y, -130) for y in (110, -110) for x in (90, 0, -90)]
    assert [tuple(np.round(1000 * track.planned[0], 9)) for track in tracks] == stood


def test_a_servo_of_known_slope_errs_by_its_half_cycle_times_its_lever() -> None:
    """40 mm swept by α with 1 cycle = 1 µs and 500 µs for 180°: half a cycle is 0.18°."""
    job, schedule, (track,) = planned("lab9-exercise")
    lever = np.hypot(*track.planned[:, :2].T)
    turned = made_angles(schedule, job.servos)[:, 1] - job.trajectory.angles[:, 1]
    assert np.abs(turned).max() <= math.radians(0.18) + 1e-12
    still = np.abs(track.planned[:, 2] + 0.1) < 1e-12  # β = 0 is exactly 1500 µs there
    assert track.error[still] == pytest.approx(
        2 * lever[still] * np.abs(np.sin(turned[still] / 2)), abs=1e-12
    )


def test_angles_that_are_whole_cycles_have_no_error() -> None:
    text = (JOBS / "lab9-exercise.toml").read_text()
    head, _ = text.split("[motion]")
    poses = "[motion]\nposes = [{ vertical_deg = 90, horizontal_deg = 45, hold_s = 1 }]\n"
    job = plan_job(loads(head + poses, "job.toml"))
    (error,) = end_errors(end_tracks(job, plan(job.trajectory, job.servos, job.frame).schedule))
    assert (error.worst_m, error.rms_m) == pytest.approx((0, 0), abs=1e-15)


def test_reversed_and_trimmed_servos_are_read_back_as_they_are_mounted() -> None:
    text = (JOBS / "lab8-exercise.toml").read_text().replace("trim_us = 0", "trim_us = 7\nreverse = true")
    job = plan_job(loads(text, "job.toml"))
    schedule = plan(job.trajectory, job.servos, job.frame).schedule
    assert made_angles(schedule, job.servos) == pytest.approx(job.trajectory.angles, abs=math.radians(0.09))


def test_frames_without_pulses_have_no_point_and_no_error() -> None:
    text = (JOBS / "lab9-exercise.toml").read_text()
    text = text.replace("hold_s = 0.1 }, ", "hold_s = 0.1, pause_s = 0.1, release = true }, ", 1)
    job = plan_job(loads(text, "job.toml"))
    schedule = plan(job.trajectory, job.servos, job.frame).schedule
    (track,) = end_tracks(job, schedule)
    silent = np.isnan(job.trajectory.angles).any(axis=1)
    assert silent.sum() == 5
    assert (np.isnan(track.planned).all(axis=1) == silent).all()
    assert math.isfinite(end_errors((track,))[0].rms_m)


def test_servos_that_move_no_robot_have_no_track() -> None:
    assert planned("lab8-exercise")[2] == ()


def test_the_base_ends_its_square_where_the_drive_says() -> None:
    """The job's note has the closing error from its own integration of the wheels' achieved speeds."""
    job, _, (track,) = planned("omni-square")
    closing = next(note.message for note in job.notes if note.code == "closing")
    assert f"{1000 * math.hypot(*track.made[-1, :2]):.2f} mm" in closing
    assert track.planned[-1] == pytest.approx([0, 0, 0], abs=1e-12)
    assert 1000 * track.planned[149] == pytest.approx([300, 0, 0], abs=1e-9)


def test_the_base_to_first_order_is_the_base_driven_but_for_a_hundredth() -> None:
    (error,) = end_errors(planned("omni-square")[2])
    assert error.first_order_worst_m == pytest.approx(error.worst_m, rel=0.01)


def test_the_worst_end_is_the_one_with_the_greatest_error_and_the_first_of_equal_ones() -> None:
    errors = end_errors(planned("hexapod-tripod")[2])
    worst = largest_error(errors)
    assert worst.worst_m == pytest.approx(max(each.worst_m for each in errors), abs=1e-9)
    assert worst.name == "L1"  # L1, R2 and L3 step alike


def test_the_wheels_may_be_listed_in_any_order() -> None:
    text = (JOBS / "omni-square.toml").read_text()
    head, *servos = text.split("[[servo]]")
    last, rest = servos[2].split("[drive]")
    other = "[[servo]]".join([head, last, servos[1], servos[0]]) + "[drive]" + rest
    job = plan_job(loads(other, "job.toml"))
    assert [servo.name for servo in job.servos] == ["wheel3", "wheel2", "wheel1"]
    (track,) = end_tracks(job, plan(job.trajectory, job.servos, job.frame).schedule)
    (usual,) = planned("omni-square")[2]
    assert track.planned == pytest.approx(usual.planned, abs=1e-12)
    assert track.made == pytest.approx(usual.made, abs=1e-12)
    assert job_scene(job).count == job_scene(planned("omni-square")[0]).count


def test_speeds_given_wheel_by_wheel_have_no_known_base() -> None:
    text = (JOBS / "omni-square.toml").read_text().split("[drive]")[0]
    poses = "[motion]\nposes = [{ wheel1_deg_s = 90, wheel2_deg_s = 0, wheel3_deg_s = 0, hold_s = 1 }]\n"
    job = plan_job(loads(text + poses, "job.toml"))
    assert end_tracks(job, plan(job.trajectory, job.servos, job.frame).schedule) == ()
