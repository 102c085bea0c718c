"""A watchdog that somebody left on: the sequence feeds it in each frame."""

from dataclasses import replace

import numpy as np
import pytest

from servogen.edges import HIGH, PINS, EdgeTrace, join
from servogen.simulator import Machine, SimulatorOptions
from servogen.units import Cycles
from servogen.workflows.job_build import Build, BuiltProgram
from servogen.workflows.verification import judge_edges
from tests.campaigns import sampled
from tests.engines.player.player_jobs import built
from tests.engines.player.test_player_faults import WDT_ON

SHORTEST_US = 7000
"""Of any chip (DS35007 section 9, parameter 31); after reset the prescaler makes it 128 times as long."""


def watched(done: Build, program: BuiltProgram, watchdog_us: int, frames: int) -> tuple[Machine, EdgeTrace]:
    schedule, config = done.plan.schedule, program.image.config
    assert config is not None
    machine = Machine(
        replace(program.image, config=config | WDT_ON),
        schedule.clock,
        SimulatorOptions(watchdog_us=watchdog_us),
    )
    limit = Cycles(frames * schedule.period)
    return machine, EdgeTrace(schedule.clock, machine.stream(limit), limit)


@pytest.mark.parametrize("name", sampled(["lab8-exercise", "lab9-exercise", "lab9-program", "omni-square"]))
def test_a_watchdog_that_was_left_on_changes_no_edge(name: str) -> None:
    done = built(name)
    for program in done.programs:
        machine, trace = watched(done, program, SHORTEST_US, 1100)
        verdict = judge_edges(done.plan.schedule, trace, Cycles(1000 * done.plan.schedule.period))
        assert verdict.passed, verdict.reasons
        assert machine.state().resets["watchdog"] == 0


def test_a_pause_longer_than_the_watchdog_begins_the_motion_anew_and_cuts_no_pulse() -> None:
    done = built("lab8-program")
    schedule = done.plan.schedule
    wanted = {
        pulse.width
        for run in (*schedule.lead_in, *schedule.loop)
        for pulse in run.pulses
        if pulse is not None
    }
    for program in done.programs:
        machine, trace = watched(done, program, 18_000, 3000)
        chunk = join(trace.chunks)
        seen = set()
        for channel in schedule.channels:
            mine = chunk.pin == PINS.index(channel.pin)
            cycle, rises = chunk.cycle[mine], np.flatnonzero(chunk.level[mine][:-1] == HIGH)
            seen |= set((cycle[rises + 1] - cycle[rises]).tolist())
        assert machine.state().resets["watchdog"] > 0
        assert seen <= wanted


def test_a_watchdog_shorter_than_a_frame_is_seen() -> None:
    done = built("lab8-exercise")
    _, trace = watched(done, done.programs[0], 100, 100)
    assert not judge_edges(done.plan.schedule, trace, Cycles(50 * done.plan.schedule.period)).agrees
