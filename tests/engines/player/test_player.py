"""The player on the chip: hexapods exact in every dialect, trims, power-up, a watchdog left on."""

from dataclasses import replace

import pytest

from servogen.edges import PINS, join
from servogen.engines.firmware import ResourceError
from servogen.engines.player.engine import play
from servogen.job import loads, plan_job
from servogen.pic.device import PROGRAM_WORDS, RAM_BYTES
from servogen.simulator import Machine
from servogen.units import Cycles
from servogen.workflows.engines import planned
from servogen.workflows.verification import judge_edges, running
from tests.engines.player.player_jobs import (
    ROOT,
    built,
    built_text,
    crossings,
    job_text,
    poses,
    sweep,
    trimmed,
    widths,
)

TRIPOD = (ROOT / "jobs" / "hexapod-tripod.toml").read_text()


def test_a_whole_hexapod_is_exact_on_one_chip_in_every_dialect() -> None:
    done = built("hexapod-tripod")
    assert done.engine == "player"
    assert len(done.plan.schedule.channels) == 12
    for program in done.programs:
        assert program.verdict.passed, program.verdict.reasons
        assert program.verdict.worst_edge_error == 0
        assert program.firmware.compilation.words <= PROGRAM_WORDS
        assert program.firmware.compilation.ram_bytes <= RAM_BYTES


def test_the_first_pulses_go_to_the_neutral_pose() -> None:
    schedule = built("hexapod-tripod").plan.schedule
    first = schedule.lead_in[0]
    assert first.frames >= 50
    assert {pulse.width for pulse in first.pulses if pulse} == {1500}


def test_the_tripod_starts_from_standing_and_stops_standing() -> None:
    done = built("hexapod-tripod")
    rows = [run.pulses for run in done.plan.schedule.loop for _ in range(run.frames)]
    lifts = [n for n, channel in enumerate(done.plan.schedule.channels) if channel.name.endswith("-lift")]
    turns = [n for n in range(12) if n not in lifts]

    def width(row: int, channel: int) -> int:
        pulse = rows[row][channel]
        assert pulse is not None
        return pulse.width

    # It begins and ends with all feet down; in between three feet at a time are lifted.
    assert rows[0] == rows[-1]
    lifted = [{n for n in lifts if abs(width(row, n) - width(0, n)) > 5} for row in range(len(rows))]
    assert not lifted[0]
    assert max(map(len, lifted)) == 3 and len({frozenset(each) for each in lifted if len(each) == 3}) == 2
    # The legs swing in between.
    reach = [max(abs(width(row, n) - width(0, n)) for n in turns) for row in range(len(rows))]
    assert reach[-1] == 0 and max(reach) > 30


def test_a_trim_in_the_eeprom_moves_that_servo_by_exactly_that_much() -> None:
    done = built("hexapod-tripod")
    trims = {0: 25, 3: -40, 4: 127, 7: -2, 11: -127}
    schedule = trimmed(done.plan.schedule, trims)
    span = Cycles(200 * schedule.period)
    for program in done.programs:
        order = play(done.job)[1].order
        data = {order.index(channel): trim & 0xFF for channel, trim in trims.items()}
        data |= {order.index(2): 0xFF, order.index(5): 0}
        image = replace(program.image, eeprom={**program.image.eeprom, **data})
        verdict = judge_edges(schedule, running(schedule, image, span), span)
        assert verdict.worst_edge_error == 0, verdict.reasons


def test_after_power_up_no_pin_is_high_before_its_first_pulse_and_none_is_short() -> None:
    done = built("hexapod-tripod")
    schedule, image = done.plan.schedule, done.programs[0].image
    chunk = join(Machine(image, schedule.clock).stream(Cycles(40 * schedule.period)))
    for channel in schedule.channels:
        assert set(widths(chunk, PINS.index(channel.pin))) == {1500}


@pytest.mark.campaign
def test_thirteen_servos_that_sweep_across_each_other_are_exact() -> None:
    # Ten minutes of the same: python -m tests.engines.player.player_jobs.
    done = built_text(job_text(13, sweep(13, 2.56), firmware="soft_start_s = 0.32"))
    assert done.exact
    assert len(crossings(done)) == 6 and min(crossings(done).values()) >= 2
    most = dict.fromkeys(range(13), 127)
    schedule = trimmed(done.plan.schedule, most)
    span = Cycles(150 * schedule.period)
    for program in done.programs:
        assert program.verdict.worst_edge_error == 0
        # The slots have room for the longest pulse with the longest trim, in every frame.
        image = replace(program.image, eeprom=most)
        verdict = judge_edges(schedule, running(schedule, image, span), span)
        assert verdict.worst_edge_error == 0, verdict.reasons


def test_held_poses_between_two_steps_are_held() -> None:
    # Steps of 4 µs; the poses are 1 and 2 µs off them. A pose that is held has one width in all its frames.
    done = built_text(
        job_text(3, poses([(10.3, 20, 31), (159, 144.4, 77)], 0.32).replace("move_s", "hold_s = 0.3, move_s"))
    )
    played = play(done.job)[1]
    assert set(played.encoded.scale.shifts.tolist()) == {2}
    held = [run for run in done.plan.schedule.loop if run.frames >= 15]
    assert len(held) == 2
    for program in done.programs:
        assert program.exact and program.verdict.worst_edge_error == 0


@pytest.mark.campaign
def test_a_motion_with_too_many_poses_is_refused_with_its_bytes() -> None:
    long = TRIPOD.replace('gait = "tripod"', 'gait = "wave"').replace("forward_mm = 40, cycles = 4", WAYS)
    with pytest.raises(ResourceError, match=r"the motion's poses have \d+ bytes: their table holds 256"):
        planned(plan_job(loads(long, "long.toml")))


WAYS = " }, { ".join(
    f"{way}, cycles = 3"
    for way in ("forward_mm = 40", "turn_deg = 20", "forward_mm = -30", "turn_deg = -20", "forward_mm = 20")
)
