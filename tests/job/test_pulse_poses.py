"""Poses in microseconds: `arm_us` is the width of the servo's pulses themselves."""

import pytest

from servogen.errors import InputError
from servogen.job import loads, plan_job
from servogen.workflows.engines import nearest_pulses

JOB = """\
[chip]
device = "PIC16F84A"
clock_hz = 4_000_000

[[servo]]
name = "arm"
pin = "RB0"
model = "futaba-s3001"
trim_us = 13
reverse = true
points = [
    { angle_deg = 0, width_us = 700 },
    { angle_deg = 80, width_us = 1400 },
    { angle_deg = 180, width_us = 2300 },
]

[motion]
poses = [{ POSE, hold_s = 1 }]
"""


def widths(pose: str) -> set[int]:
    """Return the pulse widths in cycles of a microsecond."""
    _, plan = nearest_pulses(plan_job(loads(JOB.replace("POSE", pose), "job.toml")))
    runs = (*plan.schedule.lead_in, *plan.schedule.loop)
    return {pulse.width for run in runs for pulse in run.pulses if pulse}


@pytest.mark.parametrize("width_us", [713, 1500, 2313])
def test_the_pulses_have_the_width_of_the_pose_whatever_trim_and_calibration(width_us: int) -> None:
    assert widths(f"arm_us = {width_us}") == {width_us}


@pytest.mark.parametrize(
    ("pose", "says"),
    [
        ("arm_us = 2314", "arm cannot go to"),
        ("arm_us = 1500, arm_deg = 90", "arm_deg and arm_us both place arm"),
        ('arm_us = "1500"', "is not a width"),
        ("amr_us = 1500", "there is no servo 'amr'"),
        ("arm_ms = 1500", "'arm_ms' is not given in ms"),
    ],
)
def test_a_width_that_says_nothing_is_refused(pose: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        plan_job(loads(JOB.replace("POSE", pose), "job.toml"))
