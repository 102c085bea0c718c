"""The time of the C between the pulses: its bound holds, what is left is left, too slow a C is found out."""

from dataclasses import replace

import pytest

from servogen.engines.board import machine_of
from servogen.engines.firmware import DIALECTS
from servogen.engines.player.engine import play
from servogen.engines.player.firmware import CHECK, DONE, WIDTHS, firmware
from servogen.engines.player.theorem import LAST_WORDS
from servogen.job import loads, plan_job
from servogen.pic.isa import decode
from servogen.workflows.engines import planned
from servogen.workflows.job_build import Build, judge_firmware, report
from tests.campaigns import sampled
from tests.engines.player.player_jobs import ROOT, built, built_text, job_text, sweep
from tests.engines.player.test_player_kernel import VARIABLES, assembled, ram
from tests.engines.player.test_player_kernel import label as label_of_assembled

SMALL = job_text(5, sweep(5, 0.64), firmware="soft_start_s = 0.16")


def slower(cycles: int) -> Build:
    """The small job with so many cycles more after each slot, in C2C."""
    done = built_text(SMALL, "c2c")
    turns, rest = divmod(cycles - 1, 3)
    wait = [f"movlw {turns}", "movwf _count", "waste:", "decfsz _count, F", "goto waste", *["nop"] * rest]
    lines = done.programs[0].firmware.text.splitlines(keepends=True)
    last = lines.index(f"{DONE}:\n") + 1 + LAST_WORDS
    text = "".join([*lines[:last], *(f"{each}\n" for each in wait), *lines[last:]])
    played = play(done.job)[1]
    made = firmware(text, done.job, played.layout, "c2c")
    schedule = done.plan.schedule
    return replace(done, programs=(judge_firmware(schedule, made),))


@pytest.mark.parametrize(
    ("name", "dialect"), sampled([("hexapod-tripod", "c2c"), ("hexapod-turn", "xc8"), ("scara-pick", "sdcc")])
)
def test_no_slot_and_no_frame_takes_longer_than_the_bound(name: str, dialect: str) -> None:
    done = built(name, dialect)
    schedule = done.plan.schedule
    played = play(done.job)[1]
    frames = 150 if name == "scara-pick" else 60  # which have one of nearly the longest
    for program in done.programs:
        listing = program.firmware.compilation.listing
        check, end = listing.label(CHECK), listing.label(DONE)
        begin = listing.label(WIDTHS)
        machine = machine_of(schedule, program.image)
        machine.run_until(pc=end, limit=100_000)
        worst = {False: 0, True: 0}
        machine.breakpoints = {begin, check}
        for _ in range(frames * len(played.layout.slots)):
            since, frame = machine.cycles, False
            machine.run(100_000)
            while machine.pc == begin:
                frame = True
                machine.run(100_000)
            assert machine.pc == check
            worst[frame] = max(worst[frame], machine.cycles - since)
            machine.run_until(pc=end, limit=100_000)
        for room, took in zip(program.firmware.timing_budgets, (worst[False], worst[True]), strict=True):
            assert room.worst is not None and took <= room.worst
            # The bound is no fancy: a path of nearly that length is run.
            assert room.worst - took < 0.12 * room.worst


@pytest.mark.parametrize("name", ["hexapod-tripod", "scara-pick"])
def test_the_kernel_in_every_program_is_the_one_whose_cycles_are_counted(name: str) -> None:
    # tests/engines/player/test_player_kernel.py counts the words of the assembled kernel; these are the same.
    counted = [decode(word) for _, word in sorted(assembled().image.program.items())][
        :-1
    ]  # its last is a NOP
    for program in built(name, "c2c").programs:
        listing = program.firmware.compilation.listing
        begin = listing.label(DONE) - label_of_assembled("pl_done")
        made = [decode(row.word) for row in listing.rows if begin <= row.address < begin + len(counted)]
        addresses = {name: address for address, name, _ in listing.variables}
        for at, (one, other) in enumerate(zip(counted, made, strict=True)):
            assert one is not None and other is not None
            assert one.instruction == other.instruction and (one.d, one.b) == (other.d, other.b), at
            if one.instruction.mnemonic == "GOTO":
                assert other.k - begin == one.k
            else:
                assert other.k == one.k
            names = [each for each in VARIABLES if ram(each) == one.f]
            assert other.f == (addresses[names[0]] if names else one.f)


KEPT = (
    *("hexapod-tripod", "hexapod-ripple", "hexapod-wave", "hexapod-turn", "hexapod-command", "scara-pick"),
    *("stream-arm", "stream-eight", "stream-fast"),
)
"""Jobs whose folders in firmware/ are what `build` writes, as tests/test_firmware.py shows."""


def test_every_kept_job_has_time_left_in_every_dialect() -> None:
    for name in KEPT:
        report_kept = (ROOT / "firmware" / name / "report.txt").read_text()
        assert report_kept.count("overrun: never") == len(DIALECTS)
        assert "may take" not in report_kept and "more than it has" not in report_kept


@pytest.mark.parametrize(("mhz", "servos"), sampled([(1, 6), (2, 9), (2, 10), (4, 11)]))
def test_the_tightest_frames_have_time_for_buttons_and_pauses_too(mhz: int, servos: int) -> None:
    motion = sweep(servos, 1.28).replace("move_s = 1.28 },\n]", "move_s = 1.28, pause_s = 0.2 },\n]")
    firmware = 'soft_start_s = 0.16\nstart_pin = "RA4"\nstop_pin = "RA3"'
    made = planned(
        plan_job(loads(job_text(servos, motion, clock_hz=mhz * 1_000_000, firmware=firmware), "job.toml"))
    )
    for dialect in DIALECTS:
        assert all((room.left or 0) > 0 for room in made.make(dialect).timing_budgets)


def test_the_report_says_what_the_c_takes_and_that_it_never_came_too_late() -> None:
    done = built_text(SMALL, "c2c")
    text = report(done)
    for program in done.programs:
        for room in program.firmware.timing_budgets:
            assert f"{room.worst}" in text and f"{room.left} ({room.left} µs)" in text
    assert text.count("overrun: never") == len(done.programs)


def test_all_of_the_time_left_can_be_used_and_not_a_cycle_more() -> None:
    left = built_text(SMALL, "c2c").programs[0].firmware.timing_budgets[0].left
    assert left is not None and left > 0
    used = slower(left).programs[0]
    assert used.firmware.timing_budgets[0].left == 0 and not used.firmware.warnings
    assert used.exact and used.overrun is None
    more = slower(left + 1).programs[0]
    assert more.firmware.timing_budgets[0].left == -1
    assert "1 more than it has" in more.firmware.warnings[0].message


def test_c_that_comes_too_late_is_seen_in_the_bit_in_the_edges_and_in_the_report() -> None:
    left = built_text(SMALL, "c2c").programs[0].firmware.timing_budgets[0].left
    assert left is not None
    done = slower(left + 200)
    late = done.programs[0]
    assert late.overrun is not None
    assert not late.verdict.passed and not late.exact and not done.exact
    period = done.plan.schedule.period
    # Only long pulses leave too little time: the bit says so within a frame of the first wrong edge.
    assert late.verdict.difference is not None
    wrong = late.verdict.difference.cycle
    assert 10 * period < wrong <= late.overrun <= wrong + 2 * period
    assert f"overrun: by cycle {late.overrun} after reset" in report(done)
    assert "may take" in report(done)
