"""[program] of a job: an arm, its hand and a file of the arm command language become servo angles."""

import math
from pathlib import Path

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.job import PlannedJob, load, loads, plan_job
from servogen.kinematics.catalogue import arm
from servogen.kinematics.forward import fk_position
from servogen.pulse.plan import plan

JOBS = Path(__file__).parents[2] / "jobs"
TEXT = (JOBS / "rvm1-program.toml").read_text("utf-8")


def made(folder: Path, program: str, *replacements: tuple[str, str]) -> PlannedJob:
    text = TEXT
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new, 1)
    (folder / "rvm1-program.rvm").write_text(program, "utf-8")
    (folder / "job.toml").write_text(text, "utf-8")
    return plan_job(load(folder / "job.toml"))


def error_of(folder: Path, program: str, *replacements: tuple[str, str]) -> str:
    with pytest.raises(InputError) as caught:
        made(folder, program, *replacements)
    return str(caught.value).replace(f"{folder}/", "")


def joints(job: PlannedJob) -> np.ndarray:
    """The arm's joints (frames, 5): the servos' angles less zero_deg, as the job's file says."""
    return job.trajectory.angles[:, :5] - np.radians([0, 45, 150, 60, 0])


def test_the_job_fills_its_pallet_and_begins_anew() -> None:
    job = plan_job(load(JOBS / "rvm1-program.toml"))
    planned = plan(job.trajectory, job.servos, job.frame)
    assert (job.warnings, planned.warnings, planned.schedule.lead_in) == ((), (), ())
    assert job.trajectory.joints == ("waist", "shoulder", "elbow", "pitch", "roll", "hand")
    robot = arm("rv-m1")
    # TL 60: the hand's tip is 60 mm beyond the arm's own end, which is 72 mm from the wrist
    tips = 1000 * fk_position(robot.with_lengths(d5=0.132), joints(job))
    for place in [(0, 300, 200), (80, 300, 200), (0, 370, 200), (80, 370, 200), (-160, 280, 220)]:
        assert np.linalg.norm(tips - place, axis=1).min() < 1e-6


def test_the_hand_is_closed_on_the_way_to_each_place_and_open_on_the_way_back() -> None:
    job = plan_job(load(JOBS / "rvm1-program.toml"))
    hand = np.degrees(job.trajectory.angles[:, 5])
    assert (hand.min(), hand.max()) == pytest.approx((40, 110))
    closed = np.isclose(hand, 110).astype(int)
    assert (np.diff(closed) == 1).sum() == 4


def test_no_servo_is_asked_for_more_than_it_can_do() -> None:
    job = plan_job(load(JOBS / "rvm1-program.toml"))
    steps = np.abs(np.diff(np.vstack([job.trajectory.angles, job.trajectory.angles[:1]]), axis=0)) / 0.02
    tops = [servo.model.speed or math.inf for servo in job.servos]
    assert (steps.max(axis=0) <= np.array(tops) * (1 + 1e-9)).all()


def test_a_program_may_end_and_hold_or_release(tmp_path: Path) -> None:
    once = ("repeat = true # after ED it begins again", "repeat = false")
    held = made(tmp_path, "10 TI 10", once).trajectory
    assert (held.loop_start, len(held.angles)) == (51, 52)
    assert not np.isnan(held.angles).any()
    released = made(tmp_path, "10 TI 10", (once[0], 'repeat = false\nend = "release"')).trajectory
    assert np.isnan(released.angles[-1]).all()
    assert not np.isnan(released.angles[:-1]).any()


def test_inputs_come_from_the_job(tmp_path: Path) -> None:
    once = ("repeat = true # after ED it begins again", 'repeat = false\ninputs = ["2=&1F"]')
    assert len(made(tmp_path, "10 IN\n20 ED", once).trajectory.angles) == 101


def test_outputs_are_said_not_to_be_in_the_firmware(tmp_path: Path) -> None:
    notes = {note.code: str(note) for note in made(tmp_path, "10 OD 1\n20 TI 5\n30 OB -0").notes}
    assert "the program writes its output port 2 times: firmware only makes pulses" in notes["output-port"]


def test_errors_of_the_program_have_the_program_s_place(tmp_path: Path) -> None:
    assert error_of(tmp_path, "10 NT\n20 MOVE 1").startswith(
        "rvm1-program.rvm:2:4: error: program line 20: unknown"
    )
    said = error_of(tmp_path, "PD 5, 0, -300, 300, -90, 90\n10 MO 5")
    assert said.startswith("rvm1-program.rvm:2:4: error: program line 10: position 5 (0.0, -300.0, 300.0) mm")
    assert "cannot be reached" in said


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('file = "rvm1-program.rvm"', 'file = "none.rvm"', "none.rvm: error: cannot be read: No such file"),
        ('servo = "hand"', 'servo = "hnd"',
            "program.hand.servo: there is no servo 'hnd' [unknown-servo]\n  did you mean 'hand'"),
        ('servo = "hand"', 'servo = "roll"', "program.hand.servo: 'roll' already turns a joint of the arm"),
        ('model = "mpx-tiny-s"', 'model = "continuous"',
            "program.hand.servo: 'hand' turns continuously: a hand needs angles [wrong-servo-kind]"),
        ("closed_deg = 110", "closed_deg = 210", "program.hand.closed_deg: hand cannot go to 210°"),
        ('joint = "q5"\nzero_deg = 0', "", "program: no servo turns the joint 'q5'"),
        ('hand = { servo = "hand", open_deg = 40, closed_deg = 110 }', "",
            "servo[6]: hand turns no joint of the arm"),
        ('joint = "q1"\nzero_deg = 0', 'joint = "q1"\nzero_deg = 120',
            "servo[1].zero_deg: waist cannot bring q1 to its home of 90°: it reaches -60° to 60°"),
        ('name = "rv-m1"', 'name = "omni"', "robot"),
        ("repeat = true # ", 'inputs = ["1=300"]\nrepeat = false # ',
            "program.inputs[1]: '1=300' is not an input"),
        ("repeat = true # ", 'end = "release"\n # ', "program.end: a motion that repeats has no end"),
    ],
)  # fmt: skip
def test_what_is_wrong_in_the_job_is_said_with_its_key(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    assert message in error_of(tmp_path, "10 TI 5", (old, new))


@pytest.mark.parametrize("robot", ["", '[robot]\nname = "omni"\n'])
def test_a_program_without_an_arm_is_refused(tmp_path: Path, robot: str) -> None:
    model = "continuous" if robot else "futaba-s3001"
    head = '[chip]\ndevice = "PIC16F84A"\nclock_hz = 4_000_000\n'
    servo = f'[[servo]]\nname = "waist"\npin = "RB0"\nmodel = "{model}"\n'
    with pytest.raises(InputError) as caught:
        plan_job(loads(f'{head}{servo}{robot}[program]\nfile = "p.rvm"\n', str(tmp_path / "job.toml")))
    assert str(caught.value) == (
        f"{tmp_path}/job.toml:{10 if robot else 8}:1: error: program: a program moves an arm "
        '[missing-robot]\n  add [robot] name = "rv-m1"'
    )


@pytest.mark.parametrize(
    ("speed", "tool", "message"),
    [
        ("speed_deg_s = 9", "z_mm = 1", ""),
        ("speed_deg_s = 9", "x_mm = 1",
            "own's tool is not on its approach axis: TL sets a length along it [wrong-robot-kind]"),
        ("", "z_mm = 1", "the maximum speed of own's joint turn is not known [no-speed]\n"
            "  state its speed_deg_s in the robot's file, or bind it to a servo with a known speed"),
    ],
)  # fmt: skip
def test_an_arm_that_the_language_cannot_move_is_refused_at_the_program(
    tmp_path: Path, speed: str, tool: str, message: str
) -> None:
    (tmp_path / "own.toml").write_text(
        'name = "own"\nconvention = "standard"\n'
        f'[[joint]]\nname = "turn"\nlower_deg = 0\nupper_deg = 90\n{speed}\n'
        f'[[row]]\njoint = "turn"\na_mm = 100\n[tool]\n{tool}\n'
    )
    (tmp_path / "slow.toml").write_text(
        'title = "no speed"\n'
        "points = [{ angle_deg = 0, width_us = 600 }, { angle_deg = 90, width_us = 2400 }]\n"
    )
    (tmp_path / "p.rvm").write_text("10 ED\n")
    text = (
        '[chip]\ndevice = "PIC16F84A"\nclock_hz = 4_000_000\n[robot]\nname = "own.toml"\n'
        '[[servo]]\nname = "s"\npin = "RB0"\nmodel = "slow.toml"\njoint = "turn"\nzero_deg = 0\n'
        '[program]\nfile = "p.rvm"\n'
    )
    job = loads(text, str(tmp_path / "job.toml"))
    if not message:
        assert plan_job(job).trajectory.joints == ("s",)
        return
    with pytest.raises(InputError) as caught:
        plan_job(job)
    assert str(caught.value) == f"{tmp_path}/job.toml:12:1: error: program: {message}"


def test_a_job_has_one_kind_of_motion(tmp_path: Path) -> None:
    said = error_of(tmp_path, "10 TI 5", ("[frame]", "[motion]\nposes = [{ waist_deg = 1 }]\n\n[frame]"))
    assert "a job has one of [motion], [walk], [program], [drive]" in said


def test_an_endless_program_is_stopped(tmp_path: Path) -> None:
    said = error_of(tmp_path, "10 TI 5\n20 GT 10", ("repeat = true # ", "max_s = 60\nrepeat = true # "))
    assert "rvm1-program.rvm:1:4: error: program line 10: the program would take longer than 60 s" in said
