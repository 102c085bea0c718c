"""What goes wrong on a board: resets at any time, a watchdog left on, an EEPROM erased or full of trims."""

import random
from dataclasses import replace

import pytest

from servogen.edges import LOW, PINS, EdgeTrace, join, part
from servogen.engines.board import board_of
from servogen.pic.image import Image
from servogen.pulse import PulseSchedule
from servogen.pulse.expected import expected
from servogen.simulator import Machine, Reset, SimulatorOptions, Stimuli
from servogen.units import Cycles
from servogen.verify import Verdict, verify
from servogen.workflows.verification import judge_edges, motion_cycles, running
from tests.campaigns import sampled
from tests.engines.player.player_jobs import built, built_text, job_text, sweep, trimmed, widths

WDT_ON = 0x0004
"""WDTE, bit 2 of the configuration word (DS30430 register 8-1)."""

SMALL = job_text(5, sweep(5, 0.64), firmware="soft_start_s = 0.16")


def after_reset(schedule: PulseSchedule, image: Image, at: int, held: int, frames: int) -> Verdict:
    """Compare the edges from the end of a reset on with the schedule's first `frames` frames."""
    machine = Machine(image, schedule.clock, board_of(schedule), Stimuli([Reset(at, at + held)]))
    end = at + held + (frames + 3) * schedule.period
    chunk = join(machine.stream(end))
    # While reset is held all pins are let go.
    cut = int((chunk.cycle < at + held).sum())
    later = part(chunk, slice(cut, None))
    moved = later._replace(cycle=later.cycle - (at + held))
    assert machine.state().resets["mclr"] == 1
    trace = EdgeTrace(schedule.clock, (moved,), Cycles(end - at - held))
    return verify(expected(schedule), trace, Cycles(frames * schedule.period))


def test_a_reset_at_any_cycle_of_any_frame_is_followed_by_the_soft_start_and_exact_edges() -> None:
    done = built_text(SMALL)
    schedule, dice = done.plan.schedule, random.Random(6)
    for number in range(21):
        program = done.programs[number % len(done.programs)]
        at = number * schedule.period + dice.randrange(schedule.period)
        verdict = after_reset(schedule, program.image, at, dice.randrange(20, 60_000), 24)
        assert verdict.passed, (at, verdict.reasons)


def test_a_reset_in_the_middle_of_a_walk_goes_back_to_the_neutral_pose() -> None:
    done = built("hexapod-tripod", "sdcc")
    schedule = done.plan.schedule
    for frame in (10, 77, 200):
        verdict = after_reset(schedule, done.programs[0].image, frame * schedule.period + 4321, 1000, 60)
        assert verdict.passed, verdict.reasons
    assert {pulse.width for pulse in schedule.lead_in[0].pulses if pulse} == {1500}


def test_a_reset_cuts_pulses_short_and_lengthens_none() -> None:
    done = built_text(SMALL)
    schedule, image = done.plan.schedule, done.programs[0].image
    longest = max(pulse.width for run in (*schedule.lead_in, *schedule.loop) for pulse in run.pulses if pulse)
    dice = random.Random(7)
    for number in range(20):
        at = 10 * schedule.period + dice.randrange(10 * schedule.period)
        machine = Machine(image, schedule.clock, stimulus=Stimuli([Reset(at, at + 500 + number)]))
        trace = EdgeTrace(schedule.clock, machine.stream(40 * schedule.period), Cycles(40 * schedule.period))
        chunk = join(trace.driven())
        for channel in schedule.channels:
            assert max(widths(chunk, PINS.index(channel.pin))) <= longest


@pytest.mark.parametrize(
    ("name", "watchdog_us", "dialect"),
    sampled(
        [("hexapod-tripod", 7000, "sdcc"), ("hexapod-tripod", 18_000, "xc8"), ("scara-pick", 7000, "c2c")]
    ),
)
def test_a_watchdog_that_was_left_on_changes_no_edge(name: str, watchdog_us: int, dialect: str) -> None:
    # 7 ms is the shortest that a chip may have (DS35007 section 9, parameter 31).
    done = built(name, dialect)
    schedule = done.plan.schedule
    span = motion_cycles(schedule)
    limit = Cycles(span + 10 * schedule.period)
    for program in done.programs:
        assert program.image.config is not None
        watched = replace(program.image, config=program.image.config | WDT_ON)
        machine = Machine(watched, schedule.clock, SimulatorOptions(watchdog_us=watchdog_us))
        trace = EdgeTrace(schedule.clock, machine.stream(limit), limit)
        verdict = judge_edges(schedule, trace, span)
        assert verdict.passed, verdict.reasons
        assert machine.state().resets["watchdog"] == 0


@pytest.mark.parametrize(("mhz", "servos"), sampled([(1, 6), (2, 10), (4, 13), (10, 13), (20, 13)]))
def test_a_watchdog_of_7_ms_changes_no_edge_at_any_clock(mhz: int, servos: int) -> None:
    text = job_text(servos, sweep(servos, 1.28), clock_hz=mhz * 1_000_000, firmware="soft_start_s = 0.16")
    done = built_text(text)
    schedule, image = done.plan.schedule, done.programs[0].image
    assert image.config is not None
    watched = replace(image, config=image.config | WDT_ON)
    options = replace(board_of(schedule), watchdog_us=7000)
    machine = Machine(watched, schedule.clock, options)
    span = motion_cycles(schedule)
    limit = Cycles(span + 10 * schedule.period)
    trace = EdgeTrace(schedule.clock, machine.stream(limit), limit)
    verdict = judge_edges(schedule, trace, span)
    assert verdict.passed, verdict.reasons


def test_a_watchdog_faster_than_any_chip_has_is_seen() -> None:
    done = built("scara-pick", "c2c")
    schedule, image = done.plan.schedule, done.programs[0].image
    assert image.config is not None
    watched = replace(image, config=image.config | WDT_ON)
    machine = Machine(watched, schedule.clock, SimulatorOptions(watchdog_us=3000))
    limit = Cycles(100 * schedule.period)
    trace = EdgeTrace(schedule.clock, machine.stream(limit), limit)
    assert not judge_edges(schedule, trace, Cycles(90 * schedule.period)).agrees


def test_an_erased_eeprom_is_no_trim() -> None:
    done = built_text(SMALL)
    schedule, span = done.plan.schedule, motion_cycles(done.plan.schedule)
    for program in done.programs:
        assert all(value == 0xFF for value in program.image.eeprom.values())
        erased = replace(program.image, eeprom=dict.fromkeys(range(64), 0xFF))
        assert judge_edges(schedule, running(schedule, erased, span), span).passed


@pytest.mark.parametrize("byte", [0x00, 0x01, 0x7F, 0x80, 0x81, 0xFE])
def test_whatever_byte_the_eeprom_holds_the_pulses_are_the_scheduled_ones_and_that_trim(byte: int) -> None:
    done = built_text(SMALL)
    trim = byte - 256 if byte & 0x80 else byte
    trim = max(trim, -128)
    schedule = trimmed(done.plan.schedule, dict.fromkeys(range(5), trim))
    span = motion_cycles(schedule)
    for program in done.programs:
        image = replace(program.image, eeprom=dict.fromkeys(range(64), byte))
        verdict = judge_edges(schedule, running(schedule, image, span), span)
        assert verdict.passed, verdict.reasons


def test_a_trim_survives_a_reset() -> None:
    done = built_text(SMALL)
    trims = {0: 33, 2: -75, 4: 5}
    schedule = trimmed(done.plan.schedule, trims)
    for program in done.programs:
        eeprom = {channel: trim & 0xFF for channel, trim in trims.items()}
        image = replace(program.image, eeprom={**program.image.eeprom, **eeprom})
        verdict = after_reset(schedule, image, 31 * schedule.period + 77, 4000, 40)
        assert verdict.passed, verdict.reasons


def test_before_the_first_pulse_no_pin_is_high() -> None:
    done = built_text(SMALL)
    for program in done.programs:
        assert program.verdict.start is not None
        early = join(Machine(program.image, done.job.clock).stream(program.verdict.start))
        assert set(early.level.tolist()) <= {LOW}
