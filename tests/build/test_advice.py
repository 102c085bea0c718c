"""The error of the pulses has a limit, and what is said to fit does fit."""

import re

import pytest

from servogen.build import advice, build, planned
from servogen.engines.firmware import ResourceError
from servogen.errors import InputError
from servogen.job import loads, plan_job
from tests.engines.player.player_jobs import ROOT, job_text, poses

TRIPOD = (ROOT / "jobs" / "hexapod-tripod.toml").read_text()
MORE = ", { turn_deg = 20, cycles = 3 }, { forward_mm = -30, cycles = 3 }, { turn_deg = -20, cycles = 3 }"
ROUTE = "route = [{ forward_mm = 40, cycles = 4 }]"
LONG = TRIPOD.replace('gait = "tripod"', 'gait = "wave"').replace(
    ROUTE, f"route = [{{ forward_mm = 40, cycles = 3 }}{MORE}]"
)


def refused(text: str) -> InputError:
    with pytest.raises(InputError) as caught:
        build(plan_job(loads(text, "job.toml")))
    return caught.value


def test_beyond_its_limit_nothing_is_built_and_within_it_all_is() -> None:
    """A Tiny-S turns 0.36° in a µs; the tripod is 1.487 µs from its plan."""
    error = refused(TRIPOD + "max_error_us = 1.3\n")
    assert isinstance(error, ResourceError) and error.code == "beyond-max-error"
    assert error.location is not None and error.location.key == "firmware.max_error_us"
    assert "1.487 µs, 0.535°" in error.message
    assert "max_error_us allows 1.3 µs" in error.message
    assert planned(plan_job(loads(TRIPOD + "max_error_us = 1.49\n", "job.toml"))).engine == "player"


def test_without_a_limit_of_its_own_a_job_has_ten_microseconds() -> None:
    """At 125 kHz a cycle is 32 µs: a width is up to 16 µs from the planned one."""
    slow = job_text(1, poses([[31], [77.7]], 1), clock_hz=125_000).replace('"player"', '"sequence"')
    assert refused(slow).code == "beyond-max-error"
    allowed = slow.replace('"sequence"', '"sequence"\nmax_error_us = 16')
    assert planned(plan_job(loads(allowed, "job.toml"))).plan.schedule.plan_error is not None


@pytest.mark.parametrize("limit", ["0", "-1", "nan", '"10"'])
def test_a_limit_is_a_number_above_zero(limit: str) -> None:
    with pytest.raises(InputError, match=r"firmware\.max_error_us"):
        loads(TRIPOD + f"max_error_us = {limit}\n", "job.toml")


def test_a_period_that_is_said_to_fit_does_and_a_shorter_one_does_not() -> None:
    text = job_text(
        13, poses([[10] * 13, [178] * 13], 1.28), limits=(10, 178), firmware="soft_start_s = 0.16"
    )
    error = refused(text)
    assert error.code == "frame-too-short" and error.hint is not None
    found = re.search(r"period_us = (\d+) \((\d+) bytes of motion, (\d+) words, [\d.]+ µs\)", error.hint)
    assert found
    done = build(plan_job(loads(text.replace("[frame]", f"[frame]\nperiod_us = {found[1]}"), "job.toml")))
    assert done.proven
    assert done.programs[0].firmware.compilation.words == int(found[3])


def test_each_change_that_is_said_to_fit_a_walk_does() -> None:
    error = refused(LONG)
    assert error.code == "does-not-fit" and error.hint is not None
    fits, _, parts = error.hint.partition("\n")
    assert 'gait = "tripod"' in fits
    changed = LONG.replace('gait = "wave"', 'gait = "tripod"')
    made = planned(plan_job(loads(changed, "job.toml")))
    words = made.make("c2c").compilation.words
    error_us = made.plan.schedule.plan_error
    assert error_us is not None
    assert (
        f'gait = "tripod" ({made.data_bytes} bytes of motion, {words} words, {error_us.width_us:g} µs)'
        in fits
    )
    alone = LONG.replace(MORE, "")
    data = planned(plan_job(loads(alone, "job.toml"))).data_bytes
    assert f"segment 1 alone takes {data} bytes of motion" in parts
    assert "segment 4 alone takes" in parts


def test_a_walk_on_command_that_does_not_fit_has_changes_that_do() -> None:
    text = (ROOT / "jobs" / "hexapod-command.toml").read_text().replace('gait = "tripod"', 'gait = "wave"')
    error = refused(text)
    assert error.code == "does-not-fit" and error.hint is not None
    assert 'gait = "tripod" (' in error.hint
    found = re.search(
        r"commands without turn_deg \((\d+) bytes of motion, (\d+) words, ([\d.]+) µs\)", error.hint
    )
    assert found
    made = planned(plan_job(loads(text.replace("turn_deg = 20, ", ""), "job.toml")))
    assert made.data_bytes == int(found[1])
    assert made.make("c2c").compilation.words == int(found[2])


def test_a_limit_that_no_engine_keeps_has_a_larger_one_that_fits() -> None:
    """The widths of lab9-exercise are whole cycles, 0.433 µs off."""
    text = (ROOT / "jobs" / "lab9-exercise.toml").read_text() + "\n[firmware]\nmax_error_us = 0.4\n"
    error = refused(text)
    assert error.code == "beyond-max-error" and "nor can the player" in error.message
    assert error.hint is not None and re.search(r"max_error_us = 1 \([^)]*, 0\.433 µs\)", error.hint)
    assert planned(plan_job(loads(text.replace("= 0.4\n", "= 1\n"), "job.toml"))).engine == "sequence"


def test_nothing_is_tried_for_other_errors() -> None:
    """A pulse of 10 cycles fits no change of the motion."""
    text = job_text(1, poses([[31], [77]], 1), clock_hz=125_000, firmware="max_error_us = 20")
    error = refused(text)
    assert error.code == "pulse-too-short" and "what fits" not in str(error)


@pytest.mark.parametrize(("count", "tried"), [(500, True), (501, False)])
def test_for_motions_far_beyond_the_chip_nothing_is_tried(
    count: int, tried: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[object] = []

    def refuse(job: object) -> None:
        calls.append(job)
        raise ResourceError("does-not-fit", "no")

    monkeypatch.setattr(advice, "planned", refuse)
    moments = ", ".join(f"{{ arm_deg = {number % 181}, hold_s = 0.02 }}" for number in range(count))
    job = plan_job(
        loads(
            '[chip]\ndevice = "PIC16F84"\nclock_hz = 4_000_000\n'
            f'[[servo]]\nname = "arm"\npin = "RB0"\nmodel = "futaba-s3001"\n[motion]\nposes = [{moments}]\n',
            "job.toml",
        )
    )
    error = ResourceError("does-not-fit", "too long")
    assert advice.advised(job, error) is error
    assert bool(calls) is tried
