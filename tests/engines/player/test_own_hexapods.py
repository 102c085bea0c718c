"""A hexapod of one's own, each servo calibrated by itself, fits the chip; own_robots builds many more."""

import random
import re
from functools import cache

import pytest

from servogen.engines.firmware import DIALECTS
from servogen.job import loads, plan_job
from servogen.workflows.job_build import Build, build
from tests.engines.player.player_jobs import ROOT

MOST_FRAME_C = 3700


@cache
def calibrated() -> Build:
    """`hexapod-turn` with points of each servo's own, up to 12 µs off at both ends."""
    chance = random.Random(12)
    text = (ROOT / "jobs" / "hexapod-turn.toml").read_text()

    def points(_: re.Match[str]) -> str:
        low, high = (end + chance.choice((-12, 12)) * chance.uniform(0.5, 1) for end in (1250, 1750))
        ends = ((0, low), (180, high))
        found = ", ".join(f"{{ angle_deg = {angle}, width_us = {width:.1f} }}" for angle, width in ends)
        return f'model = "mpx-tiny-s"\npoints = [{found}]'

    own, count = re.subn('model = "mpx-tiny-s"', points, text)
    assert count == 12
    return build(plan_job(loads(own, "job.toml")))


@pytest.mark.campaign
def test_a_walk_and_a_turn_with_servos_calibrated_one_by_one_is_within_five_microseconds() -> None:
    made = calibrated()
    error = made.plan.schedule.plan_error
    assert error is not None and error.width_us <= 5
    assert [program.firmware.dialect for program in made.programs] == list(DIALECTS)
    for program in made.programs:
        assert program.exact and program.verdict.worst_edge_error == 0
        assert program.firmware.compilation.words <= 950


@pytest.mark.campaign
def test_the_c_between_the_frames_of_a_walk_and_a_turn_has_its_bound() -> None:
    for program in calibrated().programs:
        _, frames = program.firmware.timing_budgets
        assert frames.worst is not None and frames.worst <= MOST_FRAME_C
