"""What becomes of a process that grades, and what a grade states of the chip and its source."""

from __future__ import annotations

import pickle
import re
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from servogen import isolation
from servogen.edges import PINS
from servogen.grade import Check, Grade, Submission, load_lab
from servogen.isolation import COMPILING, WorkLimits
from servogen.pic.image import Image
from servogen.programs import read_submission
from servogen.workflows import grading, power_ups
from servogen.workflows.grading import Graded, GradingTask, grade_in_fresh_process, grade_submissions

LAB = load_lab("lab8-exercise")
TASK = GradingTask(LAB, cast(Any, len), WorkLimits(seconds=2), WorkLimits(seconds=3, elapsed_s=30))
ONE, TWO = (Submission(name, Path(name), Path()) for name in ("one.c", "two.c"))


def graded(submission: Submission) -> Graded:
    return Graded(submission, cast(Any, f"grade of {submission.name}"))


def test_limits_of_a_task_are_those_asked_for_and_elapsed_time_is_four_times_as_long() -> None:
    """Compiling takes no longer than it may by default."""
    for seconds, compiling_s in ((3.0, 3.0), (600.0, COMPILING.seconds)):
        task = GradingTask.of(LAB, cast(Any, len), seconds, 250)
        for limits, own_s in ((task.compiling, compiling_s), (task.running, seconds)):
            assert (limits.seconds, limits.memory_mb, limits.elapsed_s) == (own_s, 250, 4 * own_s)


def test_grades_come_in_the_order_of_the_programs_wherever_they_are_made(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[tuple[object, ...]] = []
    for name in ("_in_forks", "_in_fresh_processes", "_on_cluster"):
        monkeypatch.setattr(
            grading,
            name,
            lambda given, task, where, name=name: (
                asked.append((name, where)) or iter([(1, graded(TWO)), (0, graded(ONE))])
            ),
        )
    monkeypatch.setattr("os.cpu_count", lambda: 6)
    for forks, scheduler, at_once, expected in (
        (True, None, None, ("_in_forks", 6)),
        (True, None, 2, ("_in_forks", 2)),
        (False, None, 2, ("_in_fresh_processes", 2)),
        (False, "tcp://a:1", None, ("_on_cluster", "tcp://a:1")),
    ):
        done: list[int] = []
        monkeypatch.setattr(grading, "can_fork", lambda forks=forks: forks)
        found = grade_submissions([ONE, TWO], TASK, scheduler, done.append, at_once)
        assert [each.submission for each in found] == [ONE, TWO]
        assert (asked.pop(), done) == (expected, [1, 2])


def test_a_fresh_process_is_tried_again_for_each_program_if_it_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """It may take a minute to start, and 2 s to compile and 30 s to run each program."""
    runs: list[tuple[list[str], float]] = []

    def run(command: object, *, input: bytes, capture_output: bool, timeout: float) -> Any:
        given, _ = pickle.loads(input[len(pickle.dumps(grading.sys.path)) :])
        runs.append(([each.name for each in given], timeout))
        if len(given) > 1:
            raise subprocess.TimeoutExpired("python", timeout)
        if given[0].name == "one.c":
            return SimpleNamespace(returncode=0, stdout=pickle.dumps([graded(given[0])]))
        return SimpleNamespace(returncode=3, stderr=b"Traceback\nMemoryError: no room\n")

    monkeypatch.setattr(subprocess, "run", run)
    task = GradingTask(LAB, cast(Any, len), TASK.compiling, TASK.running)
    found = grade_in_fresh_process([ONE, TWO], task)
    assert runs == [(["one.c", "two.c"], 60 + 2 * 32), (["one.c"], 92), (["two.c"], 92)]
    assert found[0] == graded(ONE)
    assert "its process ended with exit code 3: MemoryError: no room" in found[1].defect

    def late(command: object, **given: Any) -> None:
        raise subprocess.TimeoutExpired("python", 92)

    monkeypatch.setattr(subprocess, "run", late)
    (slow,) = grade_in_fresh_process([ONE], task)
    assert (slow.grade.reasons, slow.defect) == (("compiling and running it took more than 92 s",), "")


SMALL_LAB = """
title = "Two positions"
task = "10° to and fro."
clock_hz = 4_000_000
watch_s = 1
rounds = 2
longest_move_s = 0.1
period = { range_ms = [3, 6], spread_us = 250 }
servo = [
    { name = "arm", model = "futaba-s3001", pin = "RB0", other_pins = ["RB3"] },
    { name = "leg", model = "futaba-s3001", pin = "RB1" },
]
[[solution]]
positions = [
    { name = "low", angles_deg = { arm = [88, 92], leg = [88, 92] } },
    { name = "high", angles_deg = { arm = [98, 102], leg = [98, 102] } },
]
"""
ALONE = re.sub(r", leg = [^}]*|.*name = \"leg\".*\n", " ", SMALL_LAB)
"""The same with one servo."""
LOW_US, HIGH_US, FAR_US = 1500, 1556, 1750
"""An S3001's widths at 90°, 100° and 135°: 1000 µs are 180°."""


def both(*widths_us: int, pins: Sequence[int] = (0, 1), frames: int = 40) -> str:
    """A program that sends each pulse to both servos, one after the other, so many times; then the next."""
    lines = [
        "#include <xc.h>",
        "#pragma config FOSC = XT, WDTE = OFF",
        "#define _XTAL_FREQ 4000000",
        "unsigned char n;",
        "void main(void) {",
        "TRISB = 0; PORTB = 0;",
        "while (1) {",
    ]
    for width in widths_us:
        pulses = " ".join(f"RB{pin} = 1; __delay_us({width}); RB{pin} = 0;" for pin in pins)
        lines.append(f"for (n = 0; n < {frames}; n++) {{ {pulses} __delay_ms(2); }}")
    return "\n".join([*lines, "}", "}", ""])


@pytest.fixture
def grade_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Grade]:
    """`grade_of(text)`: the grade of a C program, which is compiled and run in this process."""
    monkeypatch.setattr(isolation, "can_fork", lambda: False)
    lab, source = tmp_path / "lab.toml", tmp_path / "main.c"

    def graded(text: str, lab_text: str = SMALL_LAB) -> Grade:
        lab.write_text(lab_text)
        source.write_text(text)
        task = GradingTask(load_lab(str(lab)), read_submission)
        (done,) = grade_submissions([Submission("main.c", source, tmp_path)], task)
        assert not done.defect, done.defect
        return done.grade

    return graded


def lines_at_work(grade: Grade) -> tuple[float, str]:
    """The moment of the film in ms, and the source line that is at work then."""
    assert grade.film is not None and grade.film.source is not None
    source = grade.film.source
    return grade.film.moment_us / 1000, source.lines[source.line - source.first]


def test_a_right_program_passes_and_repeats_if_the_whole_chip_does(grade_of: Callable[..., Grade]) -> None:
    """A counter of 16 bits that counts rounds of 0.4 s is never twice the same in the second of the watch."""
    right = both(LOW_US, HIGH_US)
    grade = grade_of(right)
    assert (grade.reasons, grade.repeats, grade.film) == ((), True, None)
    assert grade.pins == (("arm", "RB0"), ("leg", "RB1"))
    counting = right.replace("unsigned char n;", "unsigned char n; unsigned k;").replace(
        "while (1) {", "while (1) { k++;"
    )
    grade = grade_of(counting)
    assert (grade.reasons, grade.repeats, grade.film) == ((), False, None)
    assert "watched for 1 s: the chip's state did not repeat" in grade.remarks[0].message
    grade = grade_of(both(LOW_US, HIGH_US, pins=[0]), ALONE)
    assert (grade.reasons, grade.repeats, grade.pins) == ((), True, (("arm", "RB0"),))


UNWRITTEN = "unsigned char unwritten @ 0x4F;\n"
"""A byte of RAM to which nothing is written before it is read."""

ON_SOME_CHIPS = {
    "if bit 3 of RAM 0x4F is 1 at power-up, there are no pulses for the servo 'arm' on RB0": (
        "TRISB = 0; PORTB = 0; if (unwritten & 8) while (1);", ""),
    "if RAM 0x4F is 0x5A at power-up, there are no pulses for the servo 'arm' on RB0": (
        "TRISB = 0; PORTB = 0; if (unwritten == 0x5A) while (1);", ""),
    "if RB7, an input that nothing drives, is high, there are no pulses for the servo 'arm' on RB0": (
        "TRISB = 0x80; PORTB = 0; if (RB7) while (1);", ""),
    "if the EEPROM holds what the run before has left (0x01 at 0x05), there are no pulses for the servo": (
        "TRISB = 0; PORTB = 0; if (eeprom_read(5) == 1) while (1); eeprom_write(5, 1);", ""),
    "if the EEPROM holds what the run before has left (0x07 at 0x01, 0x07 at 0x02, 0x07 at 0x03, …), there": (
        "TRISB = 0; PORTB = 0; if (eeprom_read(4) == 7) while (1);"
        "for (n = 1; n < 5; n++) eeprom_write(n, 7);", ""),
    "if the EEPROM holds what the run before has left (0x02 at 0x05), there are no pulses for the servo": (
        "TRISB = 0; PORTB = 0; n = eeprom_read(5) + 1; eeprom_write(5, n); if (n == 3) while (1);", ""),
    "if the chip's watchdog times out after 7 ms, the watchdog resets the chip": (
        "TRISB = 0; PORTB = 0; OPTION_REG = 0x88;", "if (n & 1) CLRWDT();"),
}  # fmt: skip
"""What is said of a program: what it does at power-up, and in each frame of 4.5 ms. In every second one it
clears the watchdog, which has 18 ms on a typical chip."""


@pytest.mark.parametrize("said", ON_SOME_CHIPS)
def test_what_is_right_on_the_first_chip_only_depends_on_the_chip(
    grade_of: Callable[..., Grade], said: str
) -> None:
    at_power_up, each_frame = ON_SOME_CHIPS[said]
    text = UNWRITTEN + both(LOW_US, HIGH_US, pins=[0]).replace("TRISB = 0; PORTB = 0;", at_power_up)
    text = text.replace("__delay_ms(2);", f"__delay_ms(2); {each_frame}")
    grade = grade_of(text.replace("WDTE = OFF", "WDTE = ON") if each_frame else text, ALONE)
    (reason,) = grade.reasons
    assert reason.startswith(f"it depends on the chip: {said}")
    assert (grade.faults[0].checks, grade.passed, grade.unchecked) == ((Check.CHIPS,), False, ())
    assert (grade.pins, grade.watched_s) == ((("arm", "RB0"),), 1.0)


def test_what_does_not_change_the_pulses_depends_on_no_chip(grade_of: Callable[..., Grade]) -> None:
    """It reads the same RAM, pin and EEPROM for a lamp only; the watchdog is cleared in each frame."""
    read = "TRISB = 0x80; PORTB = 0; n = eeprom_read(5); eeprom_write(5, n + 1); CLRWDT(); OPTION_REG = 0xA8;"
    read += "if ((unwritten == 0x5A) ^ RB7) RB4 = 1;"
    text = UNWRITTEN + both(LOW_US, HIGH_US, pins=[0]).replace("TRISB = 0; PORTB = 0;", read)
    text = text.replace("__delay_ms(2);", "__delay_ms(2); CLRWDT();").replace("WDTE = OFF", "WDTE = ON")
    grade = grade_of(text, ALONE)
    assert grade.reasons == ()
    assert grade.chips == 4 + 1 + 3, "four, one whose lamp is lit, three with the EEPROM of a run before"
    assert grade.repeats


def test_a_motion_that_ends_after_the_watch_is_watched_until_then(grade_of: Callable[..., Grade]) -> None:
    """Eight rounds of 0.37 s, of which two are asked for in the first second; then it stops for ever."""
    text = both(LOW_US, HIGH_US, pins=[0]).replace(
        "while (1) {", "unsigned char k; for (k = 0; k < 8; k++) {", 1
    )
    text = text.removesuffix("}\n}\n") + "}\nwhile (1);\n}\n"
    assert grade_of(text, ALONE).passed, "the lab does not watch it for longer"
    longer = ALONE.replace("watch_s = 1\n", "watch_s = 1\nlongest_watch_s = 16\n")
    (reason,) = grade_of(text, longer).reasons
    assert re.fullmatch(r"the pulses stop after 2\.\d s; the motion must repeat endlessly", reason)
    right = grade_of(both(LOW_US, HIGH_US, pins=[0]), longer)
    assert (right.passed, right.repeats, right.watched_s) == (True, True, 1.0)


def test_the_shortest_cause_is_found_whatever_else_differs() -> None:
    """Of 600 differences the 77th alone, or the 5th with the 300th, or a third one that hides the 77th."""
    every = tuple(power_ups.ChipDifference(str(number)) for number in range(600))
    for needed in ({77}, {5, 300}):
        asked: list[int] = []

        def fails(
            given: Sequence[power_ups.ChipDifference], needed: set[int] = needed, asked: list[int] = asked
        ) -> bool:
            asked.append(len(given))
            return needed <= {int(each.condition) for each in given}

        assert {int(each.condition) for each in power_ups.cause(every, fails)} == needed
        assert len(asked) <= 11 * len(needed)


def test_the_chips_have_each_bit_both_ways_and_watchdogs_only_where_it_is_on() -> None:
    """The third and the fourth chip are opposites of each other."""
    on, off = (Image({0: 0}, config=word) for word in (0x3FF5, 0x3FF1))
    for image, watchdogs in ((on, {33_000, 7_000}), (off, set())):
        second, third, fourth = power_ups.other_chips(image)
        assert {each.watchdog_us for chip in (second, third, fourth) for each in chip} - {None} == watchdogs
        starts = [{(each.start, each.high) for each in chip if each.start or each.high is not None}
                  for chip in (second, third, fourth)]  # fmt: skip
        assert starts[1] | starts[2] == starts[0] and not starts[1] & starts[2]
        assert {high for _, high in starts[0] if high is not None} == set(range(13)) - {PINS.index("RA4")}
        ram = {start for start, _ in starts[0] if start and start[0].startswith("0x")}
        assert len(ram) == 68 * 8


def test_a_right_program_is_remarked_for_what_other_chips_may_do(grade_of: Callable[..., Grade]) -> None:
    """The latches are not known at power-up; here the pins are driven to them for 100 µs."""
    grade = grade_of(both(LOW_US, HIGH_US).replace(" PORTB", " __delay_us(100); PORTB", 1))
    assert grade.reasons == ()
    remarks = [each.message for each in grade.remarks]
    assert any(each.startswith("other chips may behave differently: RB0, RB1") for each in remarks), remarks


def test_the_film_of_a_wrong_position_begins_with_its_first_pulse(grade_of: Callable[..., Grade]) -> None:
    wrong = both(LOW_US, HIGH_US, FAR_US, HIGH_US)
    grade = grade_of(wrong)
    assert not grade.passed
    moment, line = lines_at_work(grade)
    assert line == wrong.splitlines()[9] and "1750" in line
    # 40 frames of two pulses and 2 ms each; up to 50 µs for the instructions around them.
    assert moment == pytest.approx(40 * (2 * 1.5 + 2) + 40 * (2 * 1.556 + 2), abs=40 * 2 * 0.05)


def test_the_film_of_a_servo_without_pulses_begins_with_the_first_pulse_of_the_other(
    grade_of: Callable[..., Grade],
) -> None:
    """There is no wrong moment, but there are pulses; other pins than the servos' do not count."""
    text = both(LOW_US, HIGH_US, pins=[1]).replace(
        "PORTB = 0;", "PORTB = 0; __delay_ms(100); RB5 = 1; RB5 = 0;"
    )
    text = text.replace(
        "while (1) {", "__delay_ms(200);\nRB1 = 1; __delay_us(1490); RB1 = 0;\n__delay_ms(3);\nwhile (1) {"
    )
    grade = grade_of(text)
    assert any("there are no pulses for the servo 'arm' on RB0" in each for each in grade.reasons)
    moment, line = lines_at_work(grade)
    assert line == "RB1 = 1; __delay_us(1490); RB1 = 0;"
    assert moment == pytest.approx(300, abs=1)
    assert grade.film is not None
    assert [row.pin for row in grade.film.rows] == [PINS.index("RB0"), PINS.index("RB1")]
    assert grade.film.rows[0].rise_us == () and grade.film.rows[1].rise_us[0] / 1000 == moment


def test_the_film_of_a_program_without_pulses_begins_at_reset_with_the_line_in_which_it_ends(
    grade_of: Callable[..., Grade],
) -> None:
    """What it does at the end of the watch is what it hangs in."""
    hung = both(LOW_US).replace("while (1) {", "while (RB7 == 0)\n  ;\nwhile (1) {", 1)
    grade = grade_of(hung)
    assert any("there are no pulses for the servo 'arm' on RB0" in each for each in grade.reasons)
    moment, line = lines_at_work(grade)
    assert (moment, line) in ((0, "while (RB7 == 0)"), (0, "  ;"))
    assert grade.film is not None and grade.film.end_us == 1e6
