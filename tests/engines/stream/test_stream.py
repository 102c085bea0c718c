"""The stream engine on the chip: every edge is the model's, whatever comes over the line or goes wrong."""

import random
import re
from dataclasses import replace
from fractions import Fraction
from functools import cache
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from servogen.compiler import Options, Source, compile_sources
from servogen.edges import HIGH, LOW, PINS, Driven, EdgeChunk, EdgeTrace, join, part
from servogen.engines.board import board_of
from servogen.engines.stream.firmware import compiled, timing_budgets
from servogen.engines.stream.firmware import firmware as made_of
from servogen.engines.stream.layout import RoundLayout
from servogen.engines.stream.protocol import (
    MAX_VALUE,
    WidthRange,
    group_begins,
    group_goes,
    position_command,
    query_command,
    speed_command,
    trim_command,
)
from servogen.engines.stream.rendering import render_stream
from servogen.errors import InputError
from servogen.job import loads, plan_job
from servogen.pic.device import RAM_FIRST
from servogen.pulse.expected import expected
from servogen.simulator import Levels, Machine, Reset, Stimuli
from servogen.units import Cycles
from servogen.verify import verify
from servogen.workflows.engines import planned
from servogen.workflows.job_build import Build, build, judge_firmware, report
from servogen.workflows.verification import judge_edges, judge_forever, motion_cycles, running
from tests.campaigns import sampled
from tests.engines.player.player_jobs import built
from tests.engines.stream import stream_soak
from tests.engines.stream.chip_model import Chip, schedule, widths
from tests.engines.stream.stream_line import Line, group, talk
from tests.engines.stream.stream_soak import JOBS, TWELVE, Firmware, check, firmware_of, line_of
from tests.workflows.other_compilers import sdcc, sdcc_compiled

NAMES = ("stream-arm", "stream-eight", "stream-fast")
WDT_ON = 0x0004
"""WDTE, bit 2 of the configuration word (DS30430 register 8-1)."""
ANDWF_F = 0x0580
firmware = cache(stream_soak.firmware)


def played(made: Firmware, line: Line, frames: int, *more: object) -> EdgeChunk:
    """The edges from reset on, over so many frames."""
    plan = made.streamed.plan.schedule
    machine = Machine(made.image, plan.clock, board_of(plan), Stimuli([line, *more]))  # type: ignore[list-item]
    return Driven()(join(machine.stream(made.first_rise + frames * plan.period)))


def pulses(chunk: EdgeChunk, pin: str) -> tuple[np.ndarray, np.ndarray]:
    """Rises and widths of a pin's whole pulses."""
    mine = chunk.pin == PINS.index(pin)
    cycle, level = chunk.cycle[mine], chunk.level[mine]
    first = int(np.argmax(level == HIGH))
    cycle, level = cycle[first:], level[first:]
    count = len(cycle) // 2
    assert (level[: 2 * count : 2] == HIGH).all() and (level[1 : 2 * count : 2] == LOW).all()
    return cycle[: 2 * count : 2], cycle[1 : 2 * count : 2] - cycle[: 2 * count : 2]


@pytest.mark.parametrize(
    ("name", "dialect"),
    sampled([*((name, "c2c") for name in NAMES), ("stream-eight", "xc8"), ("stream-arm", "sdcc")]),
)
def test_a_random_line_moves_no_edge_by_a_cycle_and_no_command_is_lost(name: str, dialect: str) -> None:
    made = firmware(name, dialect)
    line = line_of(made, 3)
    while line.now < 12 * made.job.clock.cycles_per_second:
        talk(line, 5)
        line.noise(0.01)
    assert len(line.heard) > 400
    verdict = check(made, line)
    assert verdict.passed, verdict.reasons


@pytest.mark.parametrize(
    ("name", "error"),
    sampled([(name, Fraction(sign * 2, 100)) for name in NAMES for sign in (-1, 1)], 2),
)
def test_a_sender_that_is_two_per_cent_off_is_understood_byte_for_byte(name: str, error: Fraction) -> None:
    made = firmware(name)
    line = line_of(made, 4)
    for _ in range(600):
        line.send(position_command(line.dice.randrange(3), line.dice.randint(0, MAX_VALUE)), error)
        line.idle(line.dice.random())
    verdict = check(made, line)
    assert verdict.passed, verdict.reasons


def test_one_bit_that_is_another_is_seen_and_said_where() -> None:
    made = firmware("stream-arm")
    line = line_of(made, 5)
    talk(line, 4)
    number = next(n for n, (_, each) in enumerate(line.heard) if n > 20 and each.to_bytes()[1] == 1)
    at, command = line.heard[number]
    line.heard[number] = (at, replace(command, value=command.value ^ 1))
    verdict = check(made, line)
    assert not verdict.passed
    assert any("shoulder" in reason for reason in verdict.reasons)


def test_every_width_is_exact_while_the_line_is_busy() -> None:
    # One cycle more a frame, from end to end and back: every phase of the timer and of the looks.
    made = firmware("stream-eight")
    line = line_of(made, 6)
    for servo in range(8):
        line.send(position_command(servo, 254 * (servo % 2)))
    line.seconds(0.3)
    for servo in range(8):
        line.send(speed_command(servo, 1))
        line.send(position_command(servo, 254 * (1 - servo % 2)))
    while line.now < 22 * made.job.clock.cycles_per_second:
        line.send(speed_command(line.dice.randrange(8), 1))
    verdict = check(made, line)
    assert verdict.passed, verdict.reasons
    commands = [(at - made.first_rise, each) for at, each in line.heard]
    seen = set().union(*islice(widths(made.streamed, commands), 1100))
    assert seen >= set(range(1000, 2001))


def test_a_command_counts_in_the_first_frame_that_begins_ten_ms_after_its_stop_bit() -> None:
    for name in NAMES:
        made = firmware(name)
        plan, line = made.streamed.plan.schedule, line_of(made, 7)
        servo, ends = 1, []
        second = plan.clock.cycles_per_second
        for number in range(150):
            # Two periods and an odd part of one later, so that every moment of the frame comes.
            line.now = Fraction(made.first_rise + int(plan.period * (5 + number * Fraction(2013, 1000))))
            frame = position_command(servo, MAX_VALUE * (number % 2))
            for value in frame:
                line.byte(value, Fraction(1))
            ends.append(int(line.now))
        chunk = played(made, line, 310)
        rises, lengths = pulses(chunk, plan.channels[servo].pin)
        offset = made.streamed.layout.rise(servo)
        for number, end in enumerate(ends):
            wanted = made.streamed.travels[servo].width(MAX_VALUE * (number % 2))
            begins = rises - offset
            first = int(np.argmax(begins >= end + second / 100))
            assert lengths[first] == wanted, (name, number)


def test_after_torn_frames_the_next_whole_one_is_understood() -> None:
    made = firmware("stream-arm")
    line = line_of(made, 8)
    for torn in (b"\xff", b"\xff\x01", b"\xff\xff", b"\x01\x40", b"\xff\x09\x10", b"\x80", b"\xff\x01\xff"):
        for p in (0, 254):
            line.send(torn)
            line.send(position_command(1, p))
            line.seconds(0.03)
    assert [each.value for _, each in line.heard] == 7 * [0, 254]
    verdict = check(made, line)
    assert verdict.passed, verdict.reasons


def test_a_group_starts_in_one_frame_and_arrives_in_one_frame() -> None:
    made = firmware("stream-eight")
    line = line_of(made, 9)
    line.send(group_begins())
    for servo in range(8):
        line.send(position_command(servo, 30 * servo))
    line.send(group_goes(25))
    line.seconds(0.8)
    verdict = check(made, line)
    assert verdict.passed, verdict.reasons
    commands = [(at - made.first_rise, each) for at, each in line.heard]
    table = np.array(list(islice(widths(made.streamed, commands), 60)))
    moving = (np.diff(table, axis=0) != 0).any(axis=0)
    assert moving.all()
    starts = {int(np.flatnonzero(np.diff(column))[0]) for column in table.T}
    ends = {int(np.flatnonzero(np.diff(column))[-1]) for column in table.T}
    assert len(starts) == len(ends) == 1
    assert ends.pop() - starts.pop() == 24


@pytest.mark.parametrize("cycles", [50, -127, 127, -2])
def test_a_trim_moves_that_servo_by_exactly_that_much_and_survives_a_reset(cycles: int) -> None:
    made = firmware("stream-arm")
    plan, line = made.streamed.plan.schedule, line_of(made, 10)
    line.send(trim_command(2, cycles))
    line.seconds(0.3)
    reset = int(line.now)
    line.seconds(0.5)
    frames = int(line.now) // plan.period
    chunk = played(made, line, frames, Reset(reset, reset + 2000))
    for channel, moved in zip(plan.channels, (0, 0, cycles), strict=True):
        rises, lengths = pulses(chunk, channel.pin)
        settled = (rises > 150_000) & ((rises > reset + 3000) | (rises < reset - 3000))
        assert set(lengths[settled].tolist()) == {1500 + moved}
        assert (rises > reset + plan.period).sum() > 10


def answers(made: Firmware, chunk: EdgeChunk) -> list[int]:
    """The bytes on the pin that answers, each bit looked at in its middle."""
    assert made.job.stream and made.job.stream.transmit_pin
    bit = made.job.clock.cycles_per_second / made.job.stream.baud
    mine = chunk.pin == PINS.index(made.job.stream.transmit_pin)
    cycle, level = chunk.cycle[mine], chunk.level[mine]
    found, free = [], 0
    for at in cycle[level == LOW].tolist():
        if at >= free:
            middles = [at + int(bit * (2 * n + 1) / 2) for n in range(10)]
            start, *bits, stop = (int(level[np.searchsorted(cycle, each, "right") - 1]) for each in middles)
            assert (start, stop) == (LOW, HIGH)
            found.append(sum(bit << n for n, bit in enumerate(bits)))
            free = middles[-1]
    return found


def test_a_question_is_answered_with_the_width_in_two_bytes() -> None:
    made = firmware("stream-arm")
    line, wanted = line_of(made, 18), []
    for number in range(40):
        servo, p = number % 3, line.dice.randint(0, MAX_VALUE)
        line.send(position_command(servo, p))
        line.seconds(0.05)
        for low in (False, True):
            line.send(query_command(servo, low=low))
        wanted += list(made.streamed.travels[servo].width(p).to_bytes(2, "big"))
    plan = made.streamed.plan.schedule
    machine = Machine(made.image, plan.clock, board_of(plan), Stimuli([line]))
    assert answers(made, join(machine.stream(int(line.now) + plan.period))) == wanted
    verdict = check(made, line)
    assert verdict.passed, verdict.reasons


def test_a_servo_that_is_off_is_at_its_position_at_once() -> None:
    made = firmware("stream-eight")
    line = line_of(made, 11)
    line.seconds(2.5)
    line.send(speed_command(3, 1))
    line.send(position_command(3, 0))
    line.seconds(0.2)
    chunk = played(made, line, 145)
    _, lengths = pulses(part(chunk, chunk.cycle > 2_400_000), "RB3")
    assert set(lengths.tolist()) == {1000}
    verdict = check(made, line)
    assert verdict.passed, verdict.reasons


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("level", [LOW, HIGH])
def test_a_line_that_is_stuck_is_an_idle_line(name: str, level: int) -> None:
    made = firmware(name)
    plan = made.streamed.plan.schedule
    assert made.job.stream
    pin = PINS.index(made.job.stream.receive_pin)
    span = motion_cycles(plan)
    machine = Machine(made.image, plan.clock, board_of(plan), Stimuli([Levels(pin, ((0, level),))]))
    trace = EdgeTrace(plan.clock, machine.stream(span + 3 * plan.period), Cycles(span + 3 * plan.period))
    assert judge_edges(plan, trace, span).passed


def test_a_line_that_is_stuck_in_the_midst_of_a_command_is_silence() -> None:
    made = firmware("stream-eight")
    for cut in range(0, 12_500, 1400):
        line = line_of(made, 12)
        line.send(position_command(0, 0))
        line.seconds(0.1)
        begun = int(line.now)
        line.send(position_command(0, 254), Fraction(0))
        line.changes_made = [each for each in line.changes_made if each.cycle < begun + cut]
        line.level(LOW)
        line.changes_made[-1] = line.changes_made[-1]._replace(cycle=begun + cut)
        line.heard = [each for each in line.heard if each[0] < begun + cut]
        line.now = Fraction(begun + cut)
        line.seconds(1.5)
        verdict = check(made, line)
        assert verdict.passed, (cut, verdict.reasons)


def test_a_reset_at_any_frame_is_followed_by_the_neutral_pose() -> None:
    made = firmware("stream-arm")
    plan, dice = made.streamed.plan.schedule, random.Random(13)
    for number in range(15):
        line = line_of(made, number)
        at = 100_000 + number * plan.period + dice.randrange(plan.period)
        while line.now < at:
            line.send(position_command(line.dice.randrange(3), line.dice.randint(0, MAX_VALUE)))
        line.changes_made = [each for each in line.changes_made if each.cycle < at - 5000]
        line.level(HIGH)
        line.changes_made.sort(key=lambda each: each.cycle)
        held = dice.randrange(20, 60_000)
        end = at + held + 23 * plan.period
        machine = Machine(made.image, plan.clock, board_of(plan), Stimuli([line, Reset(at, at + held)]))
        chunk = join(machine.stream(end))
        later = part(chunk, chunk.cycle >= at + held)
        moved = later._replace(cycle=later.cycle - (at + held))
        trace = EdgeTrace(plan.clock, (moved,), Cycles(end - at - held))
        assert verify(expected(plan), trace, Cycles(20 * plan.period)).passed, number
        for channel in plan.channels:
            _, lengths = pulses(part(chunk, chunk.cycle < at), channel.pin)
            assert (lengths >= 1000).all() and (lengths <= 2000).all()


@pytest.mark.parametrize("name", NAMES)
def test_a_watchdog_that_was_left_on_changes_no_edge(name: str) -> None:
    made = firmware(name)
    assert made.image.config is not None
    watched = replace(made, image=replace(made.image, config=made.image.config | WDT_ON))
    line = line_of(made, 14)
    talk(line, 4)
    verdict = check(watched, line)
    assert verdict.passed, verdict.reasons


def test_an_erased_eeprom_is_no_trim_and_any_other_byte_is_one() -> None:
    made = firmware("stream-arm")
    assert all(value == 0xFF for value in made.image.eeprom.values())
    dice = random.Random(15)
    for _ in range(8):
        data = {n: dice.randrange(256) for n in range(3)}
        image = replace(made.image, eeprom={**made.image.eeprom, **data})
        line = line_of(made, 15)
        talk(line, 2)
        verdict = check(replace(made, image=image), line, Chip(made.streamed, dict(data)))
        assert verdict.passed, verdict.reasons


def test_an_idle_line_is_proven_for_all_time() -> None:
    made = firmware("stream-arm")
    plan = made.streamed.plan.schedule
    found = judge_forever(plan, made.image, Cycles(400 * plan.period))
    assert found.passed, found.text()


TWO_PORTS = (
    '[chip]\ndevice = "PIC16F84A"\nclock_hz = 16_000_000\n'
    + "".join(
        f'[[servo]]\nname = "s{n}"\npin = "{pin}"\nmodel = "futaba-s3001"\n'
        for n, pin in enumerate(("RA0", "RB7", "RA3", "RB0", "RB4"))
    )
    + '[stream]\nbaud = 9600\nreceive_pin = "RB1"\nfail_safe = "neutral"\n'
)


@pytest.mark.parametrize("text", [TWO_PORTS, TWELVE])
@pytest.mark.parametrize("dialect", sampled(["c2c", "xc8", "sdcc"]))
def test_servos_on_both_ports_are_exact_and_always_in_time(dialect: str, text: str) -> None:
    made = firmware_of(plan_job(loads(text, "two-ports.toml")), dialect)
    (bound, _) = timing_budgets(made.listing, made.streamed)
    assert bound.left is not None and bound.left > 0
    line = line_of(made, 16)
    talk(line, 5)
    verdict = check(made, line)
    assert verdict.passed, verdict.reasons


@pytest.mark.parametrize("clock_hz", sampled([4_000_000, 4_194_304, 8_000_000, 10_000_000]))
def test_one_servo_at_other_clocks_is_exact(clock_hz: int) -> None:
    baud = 4800 if clock_hz > 8_000_000 - 1 else 2400
    text = (
        f'[chip]\ndevice = "PIC16F84"\nclock_hz = {clock_hz}\n'
        '[[servo]]\nname = "one"\npin = "RA1"\nmodel = "futaba-s3001"\n'
        f'[stream]\nbaud = {baud}\nreceive_pin = "RB7"\nfail_safe = "hold"\n'
    )
    made = firmware_of(plan_job(loads(text, "one.toml")))
    line = line_of(made, 17)
    talk(line, 6)
    verdict = check(made, line)
    assert verdict.passed, verdict.reasons


@pytest.mark.campaign
def test_pulses_that_do_not_fit_a_frame_are_refused_with_a_period_that_does() -> None:
    text = (JOBS / "stream-eight.toml").read_text() + "\n[frame]\nperiod_us = 18_000\n"
    with pytest.raises(InputError, match=r"take 9 rounds") as found:
        build(plan_job(loads(text, "eight.toml")))
    fits = re.search(r"period_us = (\d+)", found.value.hint or "")
    assert fits
    planned(plan_job(loads(text.replace("18_000", fits[1]), "eight.toml"))).make("c2c")


def test_the_model_without_a_command_does_what_the_schedule_of_the_build_says() -> None:
    for name in NAMES:
        made = firmware(name)
        plan = made.streamed.plan.schedule
        frames = plan.lead_in_frames + plan.loop_frames
        model = schedule(made.streamed, islice(widths(made.streamed, ()), frames))
        for wanted in (plan, model):
            span = motion_cycles(wanted)
            assert judge_edges(wanted, running(plan, made.image, span), span).passed


@pytest.mark.campaign
def test_a_pulse_is_prepared_before_its_slot() -> None:
    # The worst of the worst: eight servos at 4 MHz, groups, commands while the fail-safe comes.
    text = (JOBS / "stream-eight.toml").read_text().replace('"off"', '"neutral"\nsilence_s = 0.12')
    job = plan_job(loads(text, "eight.toml"))
    made = firmware_of(job)
    listing = compiled(job, made.streamed, "c2c").compilation.listing
    due = next(address for address, name, _ in listing.variables if name == "due")
    main = next(each for each in listing.functions if each.name == "main")
    clears = ANDWF_F | due
    line = line_of(made, 19)
    while line.now < 6_000_000:
        for _ in range(3):
            line.send(position_command(line.dice.randrange(8), line.dice.randint(0, MAX_VALUE)))
        line.seconds(0.1 + line.dice.random() * 0.12)
        group(line, 0)
    machine = Machine(made.image, job.clock, board_of(made.streamed.plan.schedule), Stimuli([line]))
    machine.breakpoints = {
        row.address for row in listing.rows if row.word == clears and main.start <= row.address < main.end
    }
    slot, worst = made.streamed.layout.rounds * 256, 0
    while machine.cycles < line.now:
        machine.run(int(line.now) + 1 - machine.cycles)
        if machine.cycles > made.first_rise:
            worst = max(worst, (machine.cycles - made.first_rise) % slot)
        machine.step()
    assert 1000 < worst < slot - 200


def test_c_that_is_late_loses_pulses_but_makes_no_wrong_one() -> None:
    made = firmware("stream-eight")
    short = replace(
        made.streamed,
        layout=RoundLayout(8, 5),
        neutral=(Cycles(1050),) * 8,
        travels=(WidthRange(Cycles(1000), Cycles(1100)),) * 8,
    )
    text = render_stream(short, "c2c", made.job.device, "late")
    image = compile_sources([Source(text, "late.c")], Options(device=made.job.device)).image
    late = replace(made, streamed=short, image=image)
    line = line_of(late, 20)
    while line.now < 3_000_000:
        line.send(position_command(line.dice.randrange(8), 254 * line.dice.randrange(2)))
    chunk = played(late, line, 60)
    for channel in made.streamed.plan.schedule.channels:
        rises, lengths = pulses(chunk, channel.pin)
        assert 10 < len(rises) < 290
        assert set(lengths.tolist()) <= {1000, 1050, 1100}


def waste(turns: int) -> tuple[str, ...]:
    """1 + 5 * turns cycles."""
    return (f"movlw {turns}", "movwf _sum_hi", "waste:", "goto $+1", "decfsz _sum_hi, F", "goto waste")


def before_each_pulse(text: str, *code: str) -> str:
    """A stream's C that also does this where it prepares a pulse."""
    lines = text.splitlines(keepends=True)
    first = 1 + next(n for n, line in enumerate(lines) if line.startswith("; The way from _next to _x"))
    return "".join([*lines[:first], *(f"{each}\n" for each in code), *lines[first:]])


def far_too_slow() -> tuple[str, ...]:
    """Code that takes longer than any slot."""
    return tuple(line.replace("waste", f"waste_{n}") for n in range(9) for line in waste(255))


@pytest.mark.parametrize(("name", "turns"), [("stream-eight", 9), ("stream-arm", 60), ("stream-fast", 200)])
@pytest.mark.campaign
def test_a_pulse_could_take_the_c_longer_and_be_in_time(name: str, turns: int) -> None:
    # Long ways in few frames, all servos at once, on a line that is never silent for long; then far too slow.
    text = (JOBS / f"{name}.toml").read_text().replace('"off"', '"neutral"\nsilence_s = 0.12')
    job = plan_job(loads(text, "job.toml"))
    made = firmware_of(job)
    plan, line = made.streamed.plan.schedule, line_of(made, 19)
    while line.now < 5 * job.clock.cycles_per_second:
        line.send(group_begins())
        for servo in range(len(plan.channels)):
            line.send(
                position_command(servo, line.dice.choice((0, MAX_VALUE, line.dice.randint(0, MAX_VALUE))))
            )
        line.send(group_goes(line.dice.randint(1, 3)))
        line.seconds(line.dice.random() * 0.2)
    late = []
    for more in (waste(turns), far_too_slow()):
        slow = made_of(before_each_pulse(compiled(job, made.streamed, "c2c").text, *more), job, "c2c")
        machine = Machine(slow.compilation.image, plan.clock, board_of(plan), Stimuli([line]))
        for _ in machine.stream(int(line.now)):
            pass
        assert slow.overrun is not None
        late.append(machine.state().ram[slow.overrun - RAM_FIRST] & 1)
    assert late == [0, 1]


def slower(code: tuple[str, ...]) -> Build:
    """The arm's build with this code before each pulse, in one frame only: the 20th."""
    done = built("stream-arm", "c2c")
    only = ("movlw 20", "subwf _silence, W", "btfss STATUS, 2", "goto not_now")
    text = before_each_pulse(done.programs[0].firmware.text, *only, *code, "not_now:")
    schedule = done.plan.schedule
    made = made_of(text, done.job, "c2c")
    return replace(done, programs=(judge_firmware(schedule, made),))


def test_c_that_is_late_once_is_said_for_ever() -> None:
    used = slower(waste(50))
    assert used.exact and "overrun: never" in report(used)
    late = slower(far_too_slow())
    (program,) = late.programs
    assert not program.verdict.passed and not program.exact and not late.exact
    assert program.verdict.difference is not None and program.overrun is not None
    # A slot of the 20th frame is empty; 30 frames and more later the bit is still there to be read.
    period = late.plan.schedule.period
    assert 18 * period < program.overrun < 23 * period
    assert abs(program.overrun - program.verdict.difference.cycle) <= 2 * period
    assert late.frames > 50
    assert f"overrun: by cycle {program.overrun} after reset" in report(late)


def test_what_sdcc_makes_of_it_is_exact_too(tmp_path: Path) -> None:
    compiler = sdcc()
    if compiler is None:
        pytest.skip("this machine has no SDCC with the pic14 port")
    text = (
        (JOBS / "stream-arm.toml").read_text().replace("neutral", "hold").replace('transmit_pin = "RA3"', "")
    )
    made = firmware_of(plan_job(loads(text, "arm.toml")))
    image = sdcc_compiled(
        render_stream(made.streamed, "sdcc", made.job.device, "arm"), made.job.device.name, tmp_path, compiler
    )
    assert image is not None
    theirs = replace(made, image=image, first_rise=stream_soak.first_rise(made.streamed, image))
    line = line_of(theirs, 21)
    talk(line, 20)
    verdict = check(theirs, line)
    assert verdict.passed, verdict.reasons
