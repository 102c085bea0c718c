"""Frames that differ one by one are rows of tables of widths: shorter C, and the same edges to the cycle."""

from __future__ import annotations

from itertools import islice, pairwise
from pathlib import Path

import pytest

from servogen.compiler import Options, Source, compile_sources
from servogen.engines.firmware import DIALECTS
from servogen.engines.sequence.programs import DelayPath, Move, Overheads
from servogen.engines.sequence.sequencing import sequence
from servogen.engines.sequence.tuning import tune
from servogen.job import load, loads, plan_job
from servogen.pic.device import device
from servogen.pulse.schedule import Pulse, PulseSchedule, Run
from servogen.units import Clock, Cycles
from servogen.workflows.engines import planned
from servogen.workflows.verification import checked_cycles, judge_image
from tests.engines.sequence.test_sequence import expected_times, ran, schedule_of

PIC = device("PIC16F84")
LAW = """
[chip]
device = "PIC16F84"
clock_hz = 4_000_000
[[servo]]
name = "arm"
pin = "RB0"
model = "futaba-s3001"
[motion]
law = "cubic"
poses = [ { arm_deg = 30, hold_s = 2 }, { arm_deg = 90, move_s = 1.4, hold_s = 5 },
          { arm_deg = 120, move_s = 0.8, hold_s = 3 } ]
"""


def moving(*widths: list[int]) -> PulseSchedule:
    """A hold of 20 frames, then a frame for each row of widths, endlessly."""
    return schedule_of([], [(20, widths[0]), *((1, row) for row in widths)])


def moves_of(schedule: PulseSchedule) -> list[tuple[int, int]]:
    program = sequence(schedule, Overheads())
    return [(step.first, step.rows) for step in program.loop if isinstance(step, Move)]


def test_delays_of_rows_less_overheads_and_the_overheads_make_the_schedule() -> None:
    """Two servos move at once, one rests between them: every path through a row has a cost of its own."""
    rows = [[1000 + 13 * row, 1500, 2000 - 29 * row] for row in range(12)]
    schedule = moving(*rows, *rows[::-1])
    cost = {
        path: 40 + 3 * index
        for index, path in enumerate(
            {path: None for path, _ in islice(sequence(schedule, Overheads()).walk(), 400)}
        )
    }
    assert {path.kind for path in cost} == {"start", "in", "again", "row", "next", "after"}
    right = expected_times(schedule, 400)
    assert ran(schedule, cost, rounds=1, count=400) == right
    row = DelayPath("row", 1, 0)
    late = ran(schedule, {**cost, row: cost[row] + 1}, rounds=1, count=400, measured=cost)
    first = [path for path, _ in islice(sequence(schedule, Overheads(cost)).walk(), 400)].index(row)
    assert late[:first] == right[:first] and late[first] == right[first] + 1


def test_few_frames_and_long_holds_are_no_rows() -> None:
    ramp = [[1000 + 10 * row] for row in range(5)]
    assert moves_of(moving(*ramp)) == []
    assert moves_of(moving(*ramp, [1100])) == [(0, 6)]
    hold = [(9, [1500 + 10 * each]) for each in range(8)]
    assert moves_of(schedule_of([], hold)) == []
    short = [(8, [1500 + 10 * each]) for each in range(8)]
    assert moves_of(schedule_of([], short)) == [(0, 64)]


def test_the_same_frames_again_are_the_same_rows() -> None:
    ramp = [(1, [1000 + 10 * row]) for row in range(9)]
    schedule = schedule_of([], [(20, [1000]), *ramp, (20, [1100]), *ramp[2:]])
    assert moves_of(schedule) == [(0, 9), (2, 7)]


def test_more_rows_than_a_byte_counts_are_two_tables() -> None:
    rows = [[1000 + row] for row in range(300)]
    program = sequence(moving(*rows), Overheads())
    assert [len(move.table.rows) for move in program.moves] == [255, 46 - 1]
    assert ran(moving(*rows), {}, 1, 700) == expected_times(moving(*rows), 700)


def pulses(*each: tuple[int, int]) -> tuple[Pulse | None, ...]:
    return tuple(Pulse(Cycles(rise), Cycles(width)) for rise, width in each)


@pytest.mark.parametrize(
    ("frames", "why"),
    [
        ([pulses((0, 1000 + row), (900, 500)) for row in range(8)], "two pulses at once"),
        ([pulses((0, 1000 + row), (1200, 500)) for row in range(8)], "no time for the statements"),
        ([pulses((row, 1000 + row), (5000, 500)) for row in range(8)], "a rise that moves"),
        ([pulses((0, 200 + row), (5000, 500)) for row in range(8)], "a pulse shorter than the loops"),
    ],
)
def test_pulses_that_the_loop_cannot_make_stay_frames(
    frames: list[tuple[Pulse | None, ...]], why: str
) -> None:
    (first, *_), kept = frames, schedule_of([], [(1, [1000, 1000])])
    schedule = PulseSchedule(
        Clock(4_000_000), Cycles(20_000), kept.channels, (), tuple(Run(1, each) for each in frames)
    )
    assert sequence(schedule, Overheads()).moves == (), why
    assert first


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_table_s_program_makes_each_cycle_of_width(dialect: str) -> None:
    """Both loops, at every remainder, the shortest and the longest: 600 to 2500 cycles at 4 MHz."""
    widths = [600, 601, 607, 608, 1023, 1024, 1500, *range(1501, 1518), 2499, 2500]
    schedule = moving(*([1500, width] for width in widths))
    made = tune(schedule, dialect, PIC, "each")
    assert judge_image(schedule, made.compilation.image, checked_cycles(schedule)).edges_agree
    assert made.text.count("PORTB = 0x02;") == 2  # the hold, and all rows


def test_one_cycle_in_a_loop_is_seen() -> None:
    schedule = moving(*([width] for width in range(1500, 1510)))
    made = tune(schedule, "xc8", PIC, "wrong")
    text = made.text.replace("_delay(6);\n    } while (--longer)", "_delay(5);\n    } while (--longer)")
    assert text != made.text
    image = compile_sources([Source(text, "main.xc8.c")], Options(dialect="xc8", device=PIC)).image
    assert not judge_image(schedule, image, checked_cycles(schedule)).edges_agree


def test_a_law_on_one_servo_is_a_table_of_widths_that_rise_and_fall_with_it() -> None:
    """The job of the exercise, with a law: 30° to 90° to 120°, and back."""
    job = plan_job(loads(LAW, "law"))
    played = planned(job)
    assert played.engine == "sequence" and played.plan.schedule.plan_error_us <= 0.5
    text = played.make("c2c").text
    table = text.split("arm_width[] = {")[1].split("};")[0]
    numbers = [
        int(each) for line in table.splitlines() for each in line.split("/*")[0].split(",") if each.strip()
    ]
    schedule = played.plan.schedule
    shorter = [pulse.width for run in schedule.loop if run.frames <= 8 and (pulse := run.pulses[0])]
    assert sorted(set(numbers)) == sorted(set(shorter))
    rising = numbers[: numbers.index(max(numbers))]
    assert all(before <= after for before, after in pairwise(rising)) and numbers[-1] < numbers[0] + 1
    assert len(text.splitlines()) < 160 and "asm {" not in text


def test_the_leg_s_table_says_its_feet_as_the_job_states_them() -> None:
    path = Path(__file__).parents[3] / "jobs" / "lab9-exercise.toml"
    job = plan_job(load(path))
    text = planned(job).make("c2c").text
    for foot in ("25, 60, -100", "-25, 60, -100", "-47.15, 50.77, -92", "2.85, 69.23, -92"):
        assert f"foot {foot} mm" in text
