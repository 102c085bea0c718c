"""Programs that do an exercise in different ways, right and wrong: each verdict is right and says why."""

import math
from pathlib import Path

import pytest

from servogen.grade import Grade, Submission, load_lab
from servogen.grade.checks import Attempt, ChipFacts, order, order_faults
from servogen.grade.watch import Commanded, Visit, Watched
from servogen.programs import read_submission
from servogen.workflows.grading import GradingTask, grade_submissions
from tests.campaigns import sampled

PROGRAMS = Path(__file__).parent / "programs"
ROOT = Path(__file__).parents[2]


def graded(lab: str, file: Path) -> Grade:
    submission = Submission(file.name, file, file.parent)
    (done,) = grade_submissions([submission], GradingTask(load_lab(lab), read_submission))
    assert not done.defect
    return done.grade


LAB8_RIGHT = ("delays.c", "held.c", "interrupt.c", "loops.asm", "other_pin.c", "ramp.c", "timer.asm")


@pytest.mark.parametrize("name", sampled(LAB8_RIGHT, 3))
def test_a_right_program_of_exercise_8_4_passes(name: str) -> None:
    grade = graded("lab8-exercise", PROGRAMS / "lab8-right" / name)
    assert grade.passed, grade.reasons
    assert [row.name for row in grade.rows] == ["30°", "90°", "120°"]
    assert all(row.visits >= 3 for row in grade.rows)


def test_every_program_of_the_folders_is_asked_for() -> None:
    assert sorted(path.name for path in (PROGRAMS / "lab8-right").iterdir()) == sorted(LAB8_RIGHT)
    for lab, wrong in (("lab8", LAB8_WRONG), ("lab9", LAB9_WRONG)):
        assert sorted(path.name for path in (PROGRAMS / f"{lab}-wrong").iterdir()) == sorted(wrong)


LAB8_WRONG = {
    "angle.c": (
        "where 30° is expected, 'arm' gets pulses of 1334 µs",
        "the width is that of the Multiplex Tiny-S",
    ),
    "count11.asm": ("the pulses stop after 109.8 s; the motion must repeat endlessly",),
    "crystal.c": ("written for a crystal of 8 MHz, but the board has 4 MHz",),
    "drift.c": ("the period on RB0 drifts at",),
    "few.c": ("the pulses for 90° last 0.18 s", "needs 0.58 s to get there"),
    "four_rounds.c": ("the pulses stop after 60.3 s; the motion must repeat endlessly",),
    "hangs.c": ("there are no pulses for the servo 'arm' on RB0", "the program hangs before that"),
    "hangs_later.c": ("no complete round in 100 s", "after 3.9 s nothing moves"),
    "interrupted.asm": ("the pulses for", "stop, and go on 0.10 s later; a pause comes after the last one"),
    "inputs.c": ("there are no pulses for the servo 'arm' on RB0: the pin is still an input", "TRISB"),
    "no_config.asm": ("the watchdog resets the chip", "no configuration word, so the watchdog is on"),
    "once.c": ("no complete round", "the pulses stop after 12.8 s; the motion must repeat endlessly"),
    "open_drain.c": ("the pulses are on RA4, which is an open drain and needs a pull-up resistor",),
    "order.c": ("the order is 30° → 120° → 90° → 30°", "it should be 30° → 90° → 120°"),
    "pause.c": ("after 90° there are no pulses for 4.02 s; the pause should be 5 s",),
    "past_its_end.asm": ("the program runs on past its end; it needs an endless loop",),
    "period.c": ("the period on RB0 at", "42.", "it should be 17.5 to 20.5 ms"),
    "ram.asm": (
        "it depends on the chip: if bit 0 of RAM 0x30 is 1 at power-up, there are no pulses for the servo",
    ),
    "stuck.c": ("RB0 goes high", "stays high: a pulse must end"),
    "syntax.c": ("the program cannot be run", "syntax.c:11", "error: syntax error before 'for'"),
    "too_wide.c": ("gets pulses of 301 µs; the Futaba S3001 takes 1000 to 2000 µs",),
    "two.c": ("the order is 30° → 90° → 30° → 90°",),
    "watchdog.asm": ("the watchdog resets the chip", "turn it off"),
    "wrong_pin.c": ("no pulses for the servo 'arm' on RB0", "nor does another", "or writes to inputs"),
}


@pytest.mark.parametrize("name", sampled(LAB8_WRONG, 6))
def test_a_wrong_program_of_exercise_8_4_is_told_what_is_wrong(name: str) -> None:
    grade = graded("lab8-exercise", PROGRAMS / "lab8-wrong" / name)
    assert not grade.passed
    # One fault has one reason: what only follows from it is not told.
    assert len(grade.reasons) == 1, grade.reasons
    for words in LAB8_WRONG[name]:
        assert words in grade.reasons[0]


LAB9_WRONG = {
    "backwards.c": ("the order is down and front → up and front → up and back → down and back",),
    "one_servo.c": ("there are no pulses for the servo 'horizontal' on RB1",),
    "other_pins.c": ("no pulses for the servo 'vertical' on RB0: the pulses are on RB4 and RB5",),
    "swapped.c": (
        "the order is",
        "It would be right if 'vertical' were on RB1 and 'horizontal' were on RB0: are their pins swapped?",
    ),
    "too_quick.c": ("the pulses for up and back last 0.02 s: a Multiplex Tiny-S needs 0.12 s",),
}


@pytest.mark.parametrize("name", sampled(LAB9_WRONG, 3))
def test_a_wrong_program_of_exercise_9_5_is_told_what_is_wrong(name: str) -> None:
    grade = graded("lab9-exercise", PROGRAMS / "lab9-wrong" / name)
    assert not grade.passed
    for words in LAB9_WRONG[name]:
        assert words in grade.reasons[0]


def test_a_right_program_of_exercise_9_5_passes() -> None:
    assert graded("lab9-exercise", PROGRAMS / "lab9-right" / "leg.c").passed


def test_the_printed_program_of_lab_9_has_a_width_that_the_servo_does_not_take() -> None:
    reasons = graded("lab9-exercise", ROOT / "tests" / "labs" / "PICIOR.c").reasons
    assert any("502 µs; the Multiplex Tiny-S takes 1250 to 1750 µs" in reason for reason in reasons)


@pytest.mark.parametrize("lab", sampled(["lab8-exercise", "lab9-exercise"]))
@pytest.mark.parametrize("hex_file", ["main.hex", "main.xc8.hex"])
def test_servogens_own_firmware_passes(lab: str, hex_file: str) -> None:
    grade = graded(lab, ROOT / "firmware" / lab / hex_file)
    assert grade.passed, grade.reasons
    assert grade.repeats


def test_another_pin_is_right_and_remarked() -> None:
    grade = graded("lab8-exercise", PROGRAMS / "lab8-right" / "other_pin.c")
    assert grade.pins == (("arm", "RB3"),)
    assert grade.remarks[0].message == "the servo 'arm' is on RB3, not on the lab's RB0: wire it there"
    assert str(grade.remarks[1]).startswith(
        "servogen: warning: cycle 1, address 0x001: other chips may behave differently: RB0, RB1"
    )


def test_what_is_measured_is_what_the_program_does() -> None:
    """delays.c: 1167 µs, low for 18 ms, then 2 s without pulses, and the cycles of its loops."""
    row = graded("lab8-exercise", PROGRAMS / "lab8-right" / "delays.c").rows[0]
    assert all(1167 <= width <= 1172 for width in row.widths_us[0])
    assert row.periods_ms is not None and row.silent_s is not None and row.stays_s is not None
    assert all(19.167 <= period <= 19.2 for period in row.periods_ms)
    assert all(2.018 <= silent <= 2.019 for silent in row.silent_s)
    assert all(3.91 <= stay <= 3.93 for stay in row.stays_s)


def test_a_strange_position_in_a_wrong_order_is_named_once() -> None:
    """30°, 120° and 90°, where 30°, 90°, 120° is asked for, and twice 1250 µs, which is 45°."""
    lab = load_lab("lab8-exercise")
    solution = lab.solutions[0]

    def visit(degrees: float, *places: int) -> Visit:
        command = Commanded(0, (math.radians(degrees),), (1000 + degrees / 0.18,))
        return Visit(0, 100, frozenset(places), (command,))

    one, two, three, strange = visit(30, 0), visit(90, 1), visit(120, 2), visit(45)
    visits = [one, three, two, strange, one, three, two, strange]
    attempt = Attempt(lab, solution, Watched(lab.clock, 800, {}, {}, False), ChipFacts(), {})
    said = [str(fault) for fault in order_faults(attempt, visits, order(visits, solution))]
    assert len(said) == 2
    assert "it should be 30° → 90° → 120°" in said[0]
    assert "not a position of the task: 'arm' gets pulses of 1250 µs, which is 45.0°" in said[1]
