"""The player at every clock: as many servos as fit, every edge exact; the arithmetic where they do not."""

import re
from dataclasses import replace
from itertools import pairwise

import pytest

from servogen.engines.player.engine import play
from servogen.errors import InputError
from servogen.job import loads, plan_job
from servogen.units import Clock, Cycles
from servogen.workflows.engines import planned
from servogen.workflows.verification import judge_edges, running
from tests.campaigns import sampled
from tests.engines.player.player_jobs import built_text, job_text, poses, sweep, trimmed

TABLE = ((1, 6, 32), (4, 13, 32), (2, 10, 32), (8, 13, 32), (10, 13, 32), (16, 13, 32), (20, 13, 64))
"""MHz, servos with pulses of up to 2 ms, cycles of a tick."""


def text(
    mhz: int,
    servos: int,
    *,
    full: tuple[float, float] | None = None,
    limits: tuple[float, float] = (10, 160),
    **more: object,
) -> str:
    """A job in which neighbours cross; with `full`, every servo goes from one angle to the other."""
    motion = sweep(servos, 1.28) if full is None else poses([[end] * servos for end in full], 1.28)
    return job_text(
        servos,
        motion,
        limits=limits,
        clock_hz=mhz * 1_000_000,
        firmware="soft_start_s = 0.16",
        **more,  # type: ignore[arg-type]
    )


@pytest.mark.parametrize(("mhz", "servos", "tick"), sampled(TABLE))
def test_every_edge_is_exact(mhz: int, servos: int, tick: int) -> None:
    done = built_text(text(mhz, servos))
    played = play(done.job)[1]
    assert played.layout.tick == tick
    for program in done.programs:
        assert program.exact and program.verdict.worst_edge_error == 0
        for room in program.firmware.timing_budgets:
            assert room.left is not None and room.left >= 0
    # The period is the nearest whole number of ticks; what that costs is said.
    clock = Clock(mhz * 1_000_000)
    wanted = clock.round_us(20_000).cycles
    assert abs(done.plan.schedule.period - wanted) <= tick / 2
    rounded = [each.message for each in done.warnings if each.code == "period-rounded"]
    assert bool(rounded) == bool(wanted % tick)
    if rounded:
        assert f"{done.plan.schedule.period - wanted:+d} cycles" in rounded[0]


@pytest.mark.parametrize(("mhz", "servos"), [(1, 7), (1, 13), (2, 11)])
def test_more_than_fits_is_refused_with_the_arithmetic(mhz: int, servos: int) -> None:
    with pytest.raises(InputError) as refused:
        play(plan_job(loads(text(mhz, servos, full=(10, 160)), "job.toml")))
    found = re.search(
        r"those of (\d+) servos.*take (\d+) cycles.*a frame is (\d+) cycles", str(refused.value)
    )
    assert found
    said, needed, have = map(int, found.groups())
    assert (said, have) == (servos, mhz * 5000)
    # Two at a time, each slot the longest pulse, 127 cycles of trim and what the kernel needs.
    longest = round(2016 * mhz / 4)
    assert needed > have and needed > -(-servos // 2) * (longest + 127 + 100)


@pytest.mark.parametrize(("mhz", "servos"), [(1, 6), (2, 9), (4, 12), (8, 13), (20, 13)])
def test_how_many_servos_with_pulses_of_2_ms_fit(mhz: int, servos: int) -> None:
    ends = (10.0, 180.0)
    played = play(plan_job(loads(text(mhz, servos, full=ends, limits=ends), "job.toml")))[1]
    assert len(played.layout.order) == servos
    if servos < 13:
        with pytest.raises(InputError, match="do not fit a frame"):
            play(plan_job(loads(text(mhz, servos + 1, full=ends, limits=ends), "job.toml")))


def test_slots_are_as_long_as_the_motion_needs_whatever_the_servos_limits_are() -> None:
    """Twelve servos of 550 to 2400 µs whose motion uses 760 to 2200 µs fit 20 ms, whatever their trims."""
    wide = "points = [{ angle_deg = 0, width_us = 550 }, { angle_deg = 180, width_us = 2400 }]\n"
    angles = [180 * (width - 550) / 1850 for width in (760, 2200)]
    made = text(4, 12, full=(angles[0], angles[1]), limits=(0, 180))
    made = made.replace('model = "futaba-s3001"\n', f'model = "futaba-s3001"\n{wide}')
    done = built_text(made)
    assert done.exact
    played = play(done.job)[1]
    longest = [slot.longest for slot in played.layout.slots if slot.channels]
    # The longest pulse (within a cycle), the margin of 20 µs, and the longest trim: not the limit of 2400.
    assert all(abs(each - (2200 + 20 + 127)) <= 4 for each in longest)
    most = dict.fromkeys(range(12), 127)
    schedule = trimmed(done.plan.schedule, most)
    span = Cycles(200 * schedule.period)
    for program in done.programs:
        verdict = judge_edges(schedule, running(schedule, replace(program.image, eeprom=most), span), span)
        assert verdict.worst_edge_error == 0, verdict.reasons
    # A motion that uses all of the limits does not fit.
    with pytest.raises(InputError, match="do not fit a frame"):
        play(plan_job(loads(made.replace(f"{angles[1]:g}", "180"), "job.toml")))


def test_a_servos_limits_bound_its_slot() -> None:
    """A motion that ends 5 µs below the limit has a margin of 5 µs."""
    top = 160 - 5 / (1000 / 180)
    played = play(plan_job(loads(text(4, 2, full=(10.0, top)), "job.toml")))[1]
    # futaba-s3001: 1000 to 2000 µs over 180°.
    limit = 1000 + 160 * 1000 / 180
    assert played.layout.slots[0].longest == round(limit) + 127


def test_the_refusal_counts_whole_ticks() -> None:
    # In cycles the pulses and the C would be 4 less than a frame; slots begin at ticks.
    with pytest.raises(InputError) as refused:
        ends = (10.0, 162.0)
        play(plan_job(loads(text(4, 13, full=ends, limits=ends, frame="max_together = 1"), "job.toml")))
    found = re.search(r"take (\d+) cycles.*a frame is 20000 cycles", str(refused.value))
    assert found and int(found[1]) > 20_000 and int(found[1]) % 32 == 0


def test_the_longest_pulses_at_20_mhz_have_slots_of_more_than_8160_cycles() -> None:
    done = built_text(text(20, 13, limits=(0, 180)))
    played = play(done.job)[1]
    # From the first slot to the second, and so on; the last, without a pulse, only waits.
    slots = [slot.ticks * played.layout.tick for slot in played.layout.slots[1:7]]
    assert min(slots) > 255 * 32
    assert done.exact


def test_a_long_frame_is_cut_by_slots_without_pulses() -> None:
    done = built_text(job_text(3, sweep(3, 1.28), frame="period_us = 60_000"))
    played = play(done.job)[1]
    assert sum(not slot.channels for slot in played.layout.slots) >= 5
    assert done.exact and done.plan.schedule.period == 60_000


@pytest.mark.parametrize("mhz", sampled([2, 4, 20]))
def test_with_max_together_1_no_two_pins_rise_within_32_cycles(mhz: int) -> None:
    done = built_text(text(mhz, 8, frame="max_together = 1"))
    assert done.exact
    rises = sorted(pulse.rise for pulse in done.plan.schedule.lead_in[0].pulses if pulse)
    assert min(b - a for a, b in pairwise(rises)) == 32
    together = planned(plan_job(loads(text(mhz, 8), "job.toml")))
    assert len({pulse.rise for pulse in together.plan.schedule.lead_in[0].pulses if pulse}) == 4


def test_the_sequence_engine_keeps_the_rule_by_its_slots() -> None:
    lab = text(4, 2, frame="max_together = 1\nper_slot = 2").replace('"player"', '"sequence"')
    with pytest.raises(InputError, match="per_slot = 2 servos start together, max_together allows 1"):
        plan_job(loads(lab, "job.toml"))
