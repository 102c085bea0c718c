"""The jobs of labs 8 and 9 are the motions that the exercises ask for."""

import math
from pathlib import Path

import numpy as np
import pytest

from servogen.job import PlannedJob, load, plan_job
from servogen.kinematics.leg import Leg
from servogen.pulse import PulsePlan, Run, plan

JOBS = Path(__file__).parents[2] / "jobs"


def planned(name: str) -> tuple[PlannedJob, PulsePlan]:
    job = plan_job(load(JOBS / f"{name}.toml"))
    return job, plan(job.trajectory, job.servos, job.frame)


def widths(runs: tuple[Run, ...]) -> list[tuple[int, ...]]:
    """(frames, width of each channel or 0) of each run."""
    return [(run.frames, *(pulse.width if pulse else 0 for pulse in run.pulses)) for run in runs]


@pytest.mark.parametrize("name", ["lab8-program", "lab8-exercise", "lab9-program", "lab9-exercise"])
def test_no_lab_warns_or_has_a_lead_in(name: str) -> None:
    job, made = planned(name)
    assert (job.warnings, made.warnings, made.schedule.lead_in) == ((), (), ())
    assert made.schedule.period == 20_000


def test_exercise_8_4_holds_30_90_and_120_degrees_for_2_5_and_3_seconds() -> None:
    assert widths(planned("lab8-exercise")[1].schedule.loop) == [(100, 1167), (250, 1500), (150, 1667)]


def test_lab_8_goes_from_end_to_end_with_pauses_without_pulses() -> None:
    assert widths(planned("lab8-program")[1].schedule.loop) == [(100, 1000), (250, 0), (100, 2000), (250, 0)]


def test_lab_9_goes_down_and_up_behind() -> None:
    assert widths(planned("lab9-program")[1].schedule.loop) == [(20, 1500, 1250), (20, 1250, 1250)]


def test_exercise_9_5_walks_forward() -> None:
    job, made = planned("lab9-exercise")
    vertical, horizontal = job.trajectory.angles.T
    foot = 1000 * Leg(0.025, 0.04, 0.04, 0.06).fk(horizontal - math.pi / 2, vertical - math.pi / 2)
    ground = np.isclose(foot[:, 2], -100, atol=1e-6)
    steps = np.diff(foot[:, 0])
    # On the ground the foot goes back, 50 mm a round in 10 frames; it comes forward in the air.
    on_ground = ground[1:] & ground[:-1]
    assert (steps[on_ground] <= 1e-9).all()
    assert steps[on_ground].sum() == pytest.approx(-50)
    assert (foot[~ground, 2] > -92.1).all()
    assert np.ptp(foot[~ground, 0]) == pytest.approx(50, abs=0.01)
    assert made.schedule.loop_frames * 0.02 == pytest.approx(0.6)


def test_exercise_9_5_stays_within_what_the_tiny_s_takes() -> None:
    job, made = planned("lab9-exercise")
    assert all(1250 <= row.cycles <= 1750 for row in made.widths)
    assert all(servo.model.name == "mpx-tiny-s" for servo in job.servos)


def test_exercise_9_5_has_few_enough_distinct_frames_for_the_chip() -> None:
    # About 24 words of flash for each run of two channels.
    assert len(planned("lab9-exercise")[1].schedule.loop) * 24 < 900


def test_the_examples_leg_is_down_when_its_vertical_servo_is_in_the_middle() -> None:
    job, _ = planned("lab9-exercise")
    assert job.trajectory.angles[0, 0] == pytest.approx(math.pi / 2)
