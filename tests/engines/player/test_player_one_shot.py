"""A motion that is played once: what comes after it, for ever."""

from math import radians

import pytest

from servogen.units import Cycles
from servogen.workflows.verification import judge_forever
from tests.campaigns import sampled
from tests.engines.player.player_jobs import ROOT, built_text, job_text, poses

WAY = [(30, 150, 90), (120, 40, 90), (75, 75, 130)]


def once(end: str, **more: str) -> str:
    return job_text(
        3,
        poses(WAY, 0.64, f'repeat = false\nend = "{end}"').replace("move_s", "hold_s = 0.1, move_s"),
        firmware="soft_start_s = 0.16\n" + more.get("firmware", ""),
    )


@pytest.mark.parametrize("end", ["hold", "release"])
def test_a_motion_that_is_played_once_ends_for_ever_as_it_says(end: str) -> None:
    done = built_text(once(end))
    schedule = done.plan.schedule
    assert done.engine == "player" and done.exact
    (last,) = schedule.loop
    if end == "release":
        assert last.pulses == (None,) * 3
    else:
        wanted = [
            servo.width_us(radians(angle)) for servo, angle in zip(done.job.servos, WAY[-1], strict=True)
        ]
        made = [pulse.width for pulse in last.pulses if pulse]
        assert made == pytest.approx(wanted, abs=2.0)  # half a step of the table
    for program in done.programs:
        found = judge_forever(schedule, program.image, Cycles(2000 * schedule.period))
        assert found.passed, found.text()


def test_with_a_start_button_the_motion_is_played_once_after_it() -> None:
    done = built_text(once("release", firmware='start_pin = "RA4"\nstop_pin = "RA3"\n'))
    assert done.exact
    found = judge_forever(done.plan.schedule, done.programs[0].image, Cycles(2000 * 20_000))
    assert found.passed, found.text()


@pytest.mark.parametrize("end", sampled(["hold", "release"]))
def test_a_walk_can_be_played_once(end: str) -> None:
    walk = (ROOT / "jobs" / "hexapod-tripod.toml").read_text()
    walk = walk.replace("lift_mm = 20", f'lift_mm = 20\nrepeat = false\nend = "{end}"')
    done = built_text(walk)
    assert done.exact
    found = judge_forever(done.plan.schedule, done.programs[0].image, Cycles(2000 * 20_000))
    assert found.passed, found.text()
