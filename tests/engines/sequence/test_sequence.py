"""The program of a schedule makes that schedule's edges, whatever a compiler adds between them."""

from itertools import islice
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from servogen.engines.c_text import RenderError, environment
from servogen.engines.firmware import DIALECTS
from servogen.engines.sequence.programs import DelayPath, Overheads
from servogen.engines.sequence.rendering import comments_of, render
from servogen.engines.sequence.sequencing import sequence
from servogen.errors import InputError
from servogen.pic.device import device
from servogen.pulse import Channel, Pulse, PulseSchedule, Run
from servogen.pulse.expected import expected
from servogen.pulse.plan import PulsePlan
from servogen.pulse.quantise import quantise
from servogen.robot.servo import servo
from servogen.robot.servo_models import servo_model
from servogen.units import Clock, Cycles

PERIOD = Cycles(20_000)
SLOT = 2500


def schedule_of(lead_in: list[tuple[int, list[int]]], loop: list[tuple[int, list[int]]]) -> PulseSchedule:
    """Runs of (frames, width of each channel; 0 for none), the channels in slots of their own."""

    def run(frames: int, widths: list[int]) -> Run:
        return Run(
            frames,
            tuple(
                Pulse(Cycles(slot * SLOT), Cycles(width)) if width else None
                for slot, width in enumerate(widths)
            ),
        )

    channels = tuple(Channel(f"servo{n}", f"RB{n}", "any") for n in range(len(loop[0][1])))
    return PulseSchedule(
        Clock(4_000_000),
        PERIOD,
        channels,
        tuple(run(*each) for each in lead_in),
        tuple(run(*each) for each in loop),
    )


def expected_times(schedule: PulseSchedule, count: int) -> list[int]:
    """The distinct times of the schedule's first edges, from the pulse package's own account of them."""
    times: list[int] = []
    for chunk in expected(schedule).chunks:
        times += np.unique(chunk.cycle).tolist()
        if len(times) >= count:
            break
    return times[:count]


def ran(
    schedule: PulseSchedule,
    cost: dict[DelayPath, int],
    rounds: int,
    count: int,
    measured: dict[DelayPath, int] | None = None,
) -> list[int]:
    """The edge times of a machine whose statements cost `cost`, after `rounds` of measuring, which finds
    this or what is given as `measured`.
    """
    overheads = Overheads(measured or cost) if rounds else Overheads()
    time, times = 0, []
    for path, asked in islice(sequence(schedule, overheads).walk(), count):
        time += asked + cost.get(path, 0)
        times.append(time)
    return [each - times[0] for each in times]


WIDTHS = st.lists(st.sampled_from([0, 1000, 1500, 2000]), min_size=2, max_size=2)
RUNS = st.lists(st.tuples(st.integers(1, 300), WIDTHS), min_size=1, max_size=4)


@settings(max_examples=25)
@given(RUNS, RUNS, st.integers(0, 40))
def test_delays_less_overheads_and_the_overheads_make_the_schedule(
    lead_in: list[tuple[int, list[int]]], loop: list[tuple[int, list[int]]], seed: int
) -> None:
    schedule = schedule_of(lead_in, loop)
    if not any(any(run.pulses) for run in schedule.loop):
        return
    count = min(2000, len(list(islice(sequence(schedule, Overheads()).walk(), 2000))))
    paths = {path for path, _ in islice(sequence(schedule, Overheads()).walk(), count)}
    cost = {path: (hash((path.owner, path.edge)) + seed) % 41 for path in paths}
    assert ran(schedule, cost, rounds=1, count=count) == expected_times(schedule, count)


def test_without_the_overheads_the_edges_are_off_by_them() -> None:
    schedule = schedule_of([], [(3, [1500])])
    cost = {DelayPath("in", 1, 0): 1}
    assert ran(schedule, cost, 1, 4) == [0, 1500, 20_000, 21_500]
    assert ran(schedule, cost, 0, 4) == [0, 1501, 20_001, 21_502]


def test_a_frame_that_is_repeated_or_comes_back_is_a_function() -> None:
    """1000 µs twice, for a frame each; 1500 µs once, for two frames; 2000 µs once, for one frame."""
    schedule = schedule_of([(1, [1000]), (2, [1500])], [(1, [2000]), (1, [1000])])
    program = sequence(schedule, Overheads())
    widths = [position.frame.last - position.frame.first for position in program.positions]
    assert widths == [1000, 1500]
    steps = [step.position and step.position.number for step in (*program.lead_in, *program.loop)]
    assert steps == [1, 2, None, 1]
    assert ran(schedule, {}, 1, 40) == expected_times(schedule, 40)


def test_a_run_longer_than_a_byte_counts_is_split_and_keeps_its_period() -> None:
    for frames, calls in ((1000, [(250, 4)]), (256, [(128, 2)]), (257, [(255, 1), (2, 1)])):
        schedule = schedule_of([], [(frames, [1500])])
        program = sequence(schedule, Overheads())
        assert [(step.frames, step.turns) for step in program.loop] == calls
        assert ran(schedule, {DelayPath("turn", 0): 9}, 1, 2400) == expected_times(schedule, 2400)


def test_a_day_of_the_same_frame_is_a_few_steps() -> None:
    program = sequence(schedule_of([], [(4_320_000, [1500])]), Overheads())
    assert sum(step.all_frames for step in program.loop) == 4_320_000
    assert len(program.loop) < 70


def test_edges_closer_than_their_statements_are_refused() -> None:
    schedule = schedule_of([], [(2, [1500])])
    with pytest.raises(InputError, match="too close after cycle 0 of a frame"):
        sequence(schedule, Overheads({DelayPath("in", 1, 0): 1501}))


def test_edges_of_both_ports_in_one_cycle_are_refused() -> None:
    pulse = Pulse(Cycles(0), Cycles(1500))
    channels = (Channel("a", "RA0", "any"), Channel("b", "RB0", "any"))
    schedule = PulseSchedule(Clock(4_000_000), PERIOD, channels, (), (Run(1, (pulse, pulse)),))
    with pytest.raises(InputError, match="edges of both ports fall on cycle 0"):
        sequence(schedule, Overheads())


def test_a_schedule_without_a_pulse_is_refused() -> None:
    with pytest.raises(InputError, match="no pulse"):
        sequence(schedule_of([], [(5, [0])]), Overheads())


@pytest.mark.parametrize("dialect", DIALECTS)
def test_the_c_says_each_width_and_names_no_day_or_host(dialect: str) -> None:
    schedule = schedule_of([], [(100, [1167]), (250, [1500]), (150, [1667]), (250, [0])])
    text = render(sequence(schedule, Overheads()), dialect, device("PIC16F84"), "lab8")
    for said in ("1167 us", "1500 us", "1667 us", "RB0", "PIC16F84", "5 s without pulses"):
        assert said in text
    assert text == render(sequence(schedule, Overheads()), dialect, device("PIC16F84"), "lab8")
    assert not [line for line in text.splitlines() if line != line.rstrip()]


def test_the_c_says_the_angles_beside_the_widths_as_the_job_states_them() -> None:
    """Widths are whole cycles, 0.18° each; the comments say 30, which the exercise asks for, not 30.06."""
    schedule = schedule_of([], [(100, [1167]), (250, [1500]), (150, [1667]), (50, [1001])])
    name = schedule.channels[0].name
    arm = servo(name, "RB0", servo_model("futaba-s3001"))
    _, widths = quantise(arm, np.radians([30.0, 30.0, 30.06, 90.0, 120.0, 0.2]), schedule.clock)
    job: Any = SimpleNamespace(
        servos=(arm,), ends=(), trajectory=SimpleNamespace(angles=np.zeros((schedule.loop_frames, 1)))
    )
    comments = comments_of(job, PulsePlan(schedule, tuple(widths), ()))
    text = render(sequence(schedule, Overheads()), "c2c", device("PIC16F84"), "lab8", comments)
    for said in ("30 deg: 1167 us", "90 deg: 1500 us", "120 deg: 1667 us", "0.2 deg: 1001 us"):
        assert f"/* {name} {said}" in text


@pytest.mark.parametrize(
    ("wrong", "message"), [("{{ nobody }}", "'nobody' is undefined"), ("{% iff %}", ".*unknown tag 'iff'")]
)
def test_an_error_in_a_template_has_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wrong: str, message: str
) -> None:
    schedule = schedule_of([], [(1, [1500])])
    (tmp_path / "sequence").mkdir()
    (tmp_path / "sequence" / "main.c.j2").write_text(f"/* {{{{ title }}}} */\n{wrong}\n")
    monkeypatch.setattr("servogen.engines.c_text.template_folder", lambda: tmp_path)
    environment.cache_clear()
    try:
        with pytest.raises(RenderError, match=rf"sequence/main\.c\.j2:2: error: {message}"):
            render(sequence(schedule, Overheads()), "c2c", device("PIC16F84"), "t")
    finally:
        environment.cache_clear()
