"""The player on the chip: hexapods proven in every dialect, trims, power-up, a watchdog left on."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from servogen.edges import HIGH, LOW, PINS, EdgeChunk, join
from servogen.errors import InputError
from servogen.job import load, loads
from servogen.pic.device import PROGRAM_WORDS, RAM_BYTES
from servogen.pipeline import Build, build, prove, running
from servogen.pulse import PulseSchedule, Run
from servogen.simulator import Machine
from servogen.units import Cycles

ROOT = Path(__file__).parents[2]
TRIPOD = (ROOT / "jobs" / "hexapod-tripod.toml").read_text()
WDT_ON = 0x0004
"""WDTE, bit 2 of the configuration word (DS30430 register 8-1)."""


@cache
def built(name: str = "hexapod-tripod") -> Build:
    return build(load(ROOT / "jobs" / f"{name}.toml"))


def widths(chunk: EdgeChunk, pin: int, first: int) -> list[int]:
    """The widths of the first pulses of a pin that begin from cycle `first` on."""
    mine = (chunk.pin == pin) & (chunk.cycle >= first)
    cycle, level = chunk.cycle[mine], chunk.level[mine]
    start = int(np.argmax(level == HIGH))
    cycle, level = cycle[start:], level[start:]
    count = len(cycle) // 2
    assert (level[0 : 2 * count : 2] == HIGH).all() and (level[1 : 2 * count : 2] == LOW).all()
    found: list[int] = (cycle[1 : 2 * count : 2] - cycle[0 : 2 * count : 2]).tolist()
    return found


@pytest.mark.parametrize("name", ["hexapod-tripod", "hexapod-ripple", "hexapod-wave"])
def test_a_whole_hexapod_is_exact_on_one_chip_in_every_dialect(name: str) -> None:
    done = built(name)
    assert done.engine == "player"
    assert len(done.plan.schedule.channels) == 12
    for program in done.programs:
        assert program.verdict.proven, program.verdict.reasons
        assert program.verdict.worst_edge_error == 0
        assert program.firmware.compilation.words <= PROGRAM_WORDS
        assert program.firmware.compilation.ram_bytes <= RAM_BYTES


def test_the_first_pulses_go_to_the_neutral_pose() -> None:
    schedule = built().plan.schedule
    first = schedule.lead_in[0]
    assert first.frames == 50
    assert {pulse.width for pulse in first.pulses if pulse} == {1500}


def trimmed(schedule: PulseSchedule, trims: dict[int, int]) -> PulseSchedule:
    """The schedule with these cycles added to the pulses of these channels."""

    def run(each: Run) -> Run:
        pulses = tuple(
            pulse and replace(pulse, width=Cycles(pulse.width + trims.get(channel, 0)))
            for channel, pulse in enumerate(each.pulses)
        )
        return replace(each, pulses=pulses)

    return replace(
        schedule,
        lead_in=tuple(run(each) for each in schedule.lead_in),
        loop=tuple(run(each) for each in schedule.loop),
    )


def test_a_trim_in_the_eeprom_moves_that_servo_by_exactly_that_much() -> None:
    done = built()
    trims = {0: 25, 3: -40, 4: 127, 7: -2, 11: -127}
    schedule = trimmed(done.plan.schedule, trims)
    span = Cycles(200 * schedule.period)
    for program in done.programs:
        data = {channel: trim & 0xFF for channel, trim in trims.items()} | {2: 0xFF, 5: 0}
        image = replace(program.image, eeprom={**program.image.eeprom, **data})
        verdict = prove(schedule, running(schedule, image, span), span)
        assert verdict.worst_edge_error == 0, verdict.reasons


def test_an_erased_eeprom_is_no_trim() -> None:
    image = built().programs[0].image
    assert all(value == 0xFF for value in image.eeprom.values())


def test_a_watchdog_that_was_left_on_changes_no_edge() -> None:
    done = built()
    schedule, image = done.plan.schedule, done.programs[0].image
    assert image.config is not None
    watched = replace(image, config=image.config | WDT_ON)
    span = Cycles(300 * schedule.period)
    verdict = prove(schedule, running(schedule, watched, span), span)
    assert verdict.worst_edge_error == 0, verdict.reasons


def test_after_power_up_no_pin_is_high_before_its_first_pulse_and_none_is_short() -> None:
    done = built()
    schedule, image = done.plan.schedule, done.programs[0].image
    chunk = join(Machine(image, schedule.clock).stream(Cycles(40 * schedule.period)))
    for channel in schedule.channels:
        assert set(widths(chunk, PINS.index(channel.pin), 0)) == {1500}


THIRTEEN = (
    '[chip]\ndevice = "PIC16F84A"\nclock_hz = 4_000_000\n'
    + "".join(
        f'[[servo]]\nname = "s{n}"\npin = "{pin}"\nmodel = "futaba-s3001"\nmin_deg = 10\nmax_deg = 160\n'
        + ("open_drain = true\n" if pin == "RA4" else "")
        for n, pin in enumerate(PINS)
    )
    + "[motion]\nposes = [\n  { "
    + ", ".join(f"s{n}_deg = {10 + 10 * n}" for n in range(13))
    + ", move_s = 4 },\n  { "
    + ", ".join(f"s{n}_deg = {160 - 7 * n}" for n in range(13))
    + ', move_s = 4 },\n]\n[firmware]\nengine = "player"\n'
)


def test_thirteen_servos_that_sweep_across_each_other_are_exact() -> None:
    done = build(loads(THIRTEEN, "thirteen.toml"))
    assert done.proven
    most = dict.fromkeys(range(13), 127)
    schedule = trimmed(done.plan.schedule, most)
    span = Cycles(450 * schedule.period)
    for program in done.programs:
        assert program.verdict.worst_edge_error == 0
        # The slots have room for the longest pulse with the longest trim, in every frame.
        image = replace(program.image, eeprom=most)
        verdict = prove(schedule, running(schedule, image, span), span)
        assert verdict.worst_edge_error == 0, verdict.reasons


def test_a_motion_with_too_many_keyframes_is_refused_with_its_bytes() -> None:
    long = TRIPOD.replace('gait = "tripod"', 'gait = "wave"').replace("cycles = 4", "cycles = 7")
    with pytest.raises(
        InputError, match=r"the motion has \d+ bytes of keyframes: the player's table holds 256"
    ):
        build(loads(long, "long.toml"))
