"""`servogen calibrate`: from a servo that moves to a job that knows its widths."""

import io
import json
import math
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from servogen.cli.calibrate_command import angle_question
from servogen.drive.controller import ControllerChannel, ServoController, job_controller
from servogen.drive.serial_link import SerialLink
from servogen.drive.sweep import Sweep, ask_from, positions, sweep_readings
from servogen.errors import InputError
from servogen.job import load, loads, plan_job
from tests.drive.conftest import ROOT, Run, Serial
from tests.drive.mini_ssc import Robot

RANGE = ("--range-us", "500,2500")
LAB8 = ROOT / "jobs" / "lab8-exercise.toml"
Start = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def job(tmp_path: Path) -> Path:
    path = tmp_path / "job.toml"
    path.write_text(LAB8.read_text())
    return path


def named_in(job: Path, file: str) -> Path:
    """The same job with the calibration file."""
    changed = job.with_name("calibrated.toml")
    changed.write_text(job.read_text().replace("trim_us = 0", f'calibration = "{file}"\ntrim_us = 0'))
    return changed


def write_readings(
    path: Path, zero_us: float, us_per_deg: float, sigma_deg: float = 0.0, count: int = 25
) -> None:
    noise = np.random.default_rng(3).normal(0, sigma_deg, count) if sigma_deg else np.zeros(count)
    rows = [
        f"{width:.4f},{(width - zero_us) / us_per_deg + off:.6f}"
        for width, off in zip(np.linspace(1000, 2000, count), noise, strict=True)
    ]
    path.write_text("width_us,angle_deg\n" + "\n".join(rows) + "\n")


def test_a_job_with_the_file_sends_the_widths_of_the_servo_that_was_read(run: Run, job: Path) -> None:
    write_readings(job.with_name("seen.csv"), 1012.5, 5.4)
    done = run("calibrate", job, "--readings", job.with_name("seen.csv"))
    assert done.code == 0, done.err
    assert 'calibration = "arm.calibration.toml"' in done.out
    assert "width = 1012.5 µs +5.4000 µs/°; rms 0.00°, worst " in done.out
    servo = plan_job(load(named_in(job, "arm.calibration.toml"))).servos[0]
    for degrees in (30, 90, 120):
        assert servo.width_us(math.radians(degrees)) == pytest.approx(1012.5 + 5.4 * degrees, abs=0.01)


def test_with_noise_the_line_is_within_what_least_squares_promise(run: Run, job: Path) -> None:
    """The fitted angle's standard error is at most 2 sigma / sqrt(n) anywhere in the range; four of them."""
    sigma, count = 1.0, 100
    write_readings(job.with_name("seen.csv"), 1012.5, 5.4, sigma, count)
    found = json.loads(run("calibrate", job, "--readings", job.with_name("seen.csv"), "--json").out)
    for width in (1000.0, 1500.0, 2000.0):
        true, mine = (width - 1012.5) / 5.4, (width - found["zero_us"]) / found["us_per_deg"]
        assert abs(true - mine) < 4 * 2 * sigma / math.sqrt(count)
    assert found["rms_deg"] == pytest.approx(sigma, rel=4 / math.sqrt(2 * count))


@pytest.mark.campaign
def test_a_servo_is_moved_and_its_angles_are_asked_for(start: Start, serial: Serial, job: Path) -> None:
    process = start(
        *("calibrate", job, "--port", serial.path, *RANGE, "--points", 3, "--plot", job.with_name("a.png")),
        stdin=subprocess.PIPE,
    )
    assert process.stdin is not None
    least, middle, most = (position(width) for width in (1003.94, 1500, 1996.06))
    for number, answer in ((least, "0.7"), (middle, "ninety\n90"), (most, "179.3")):
        serial.wait_for(lambda decoder, number=number: decoder.positions.get(0) == number)
        process.stdin.write(f"{answer}\n")
        process.stdin.flush()
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    assert "'ninety' is not a number of degrees" in err
    serial.wait_for(lambda decoder: decoder.positions == {0: middle})  # it ends in the neutral pose
    assert all(least <= number <= most for _, number in serial.decoder.moves), "its limits are never passed"
    assert "3 of 3, 1996.1 µs: what do you see" in out
    assert (job.with_name("a.png")).read_bytes().startswith(b"\x89PNG")
    assert plan_job(load(named_in(job, "arm.calibration.toml"))).servos[0].width_us(
        math.pi / 2
    ) == pytest.approx(1500, abs=1)


class Screen(io.StringIO):
    """Shows what has been flushed."""

    shown = ""

    def flush(self) -> None:
        self.shown = self.getvalue()


def test_the_question_is_seen_before_its_answer_is_waited_for(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    channel = SimpleNamespace(widths_us=[1500.0], servo=SimpleNamespace(model=SimpleNamespace(unit="°")))
    screen, seen = Screen(), []
    (tmp_path / "keys").touch()
    with (tmp_path / "keys").open() as keys:
        monkeypatch.setattr(sys, "stdin", keys)
        monkeypatch.setattr(sys, "stdout", screen)
        sweep = SimpleNamespace(at=0, wait_for=lambda _: seen.append(screen.shown) or "90")
        assert angle_question(channel, 3)(sweep, 1) == pytest.approx(math.pi / 2)  # type: ignore[arg-type]
    assert seen == ["2 of 3, 1500.0 µs: what do you see, °? "]


def position(width_us: float) -> int:
    return round((width_us - 500) / 2000 * 254)


def test_whoever_gives_up_writes_nothing(
    run: Run, serial: Serial, job: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    reading, writing = os.pipe()
    with os.fdopen(writing, "w") as pipe:
        pipe.write("quit\n")
    with os.fdopen(reading) as pipe:
        monkeypatch.setattr(sys, "stdin", pipe)
        done = run("calibrate", job, "--port", serial.path, *RANGE)
    assert done.code == 2
    assert "ended after 0 of 7 readings: nothing is written" in done.err
    assert not job.with_name("arm.calibration.toml").exists()


def test_an_old_file_is_kept(run: Run, job: Path) -> None:
    angles = ("--points", 3, "--angles-deg")
    first = run("calibrate", job, *RANGE, *angles, "1,90,179")
    old = job.with_name("arm.calibration.toml").read_text()
    second = run("calibrate", job, *RANGE, *angles, "2,91,179", "--json")
    assert (first.code, second.code) == (0, 0)
    kept = json.loads(second.out)["kept"]
    assert Path(kept).read_text() == old != job.with_name("arm.calibration.toml").read_text()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ((*RANGE, "--points", 3, "--angles-deg", "1,90"), "2 angles for 3 points"),
        ((*RANGE, "--points", 3, "--angles-deg", "1,ninety,179"), "reading 2: 'ninety' is not a number"),
        ((*RANGE, "--points", 3, "--angles-deg", "1,90,80"), "does not rise from reading 2"),
        (
            (*RANGE, "--points", 5, "--angles-deg", "0,45,120,135,180"),
            r"reading 3 (120° at 1500 µs) is 30.0° off",
        ),
        (
            (*RANGE, "--from-us", 900, "--angles-deg", "0"),
            "accepts 1000 to 2000 µs, not 900 to 2000",
        ),
        (
            (*RANGE, "--to-us", 2100, "--angles-deg", "0"),
            "accepts 1000 to 2000 µs, not 1000 to 2100",
        ),
        (
            (*RANGE, "--from-us", 1490, "--to-us", 1510, "--angles-deg", "0"),
            "the controller produces 3 widths there",
        ),
        (RANGE, "no serial port is given"),
        (("--angles-deg", "1,2,3"), "the widths of positions 0 and 254"),
        ((*RANGE, "--servo", "leg", "--angles-deg", "1"), "there is no servo 'leg'"),
        (("--readings", "gone.csv"), "gone.csv: error: cannot be read"),
    ],
)
def test_what_cannot_be_is_refused_and_nothing_is_written(
    run: Run, job: Path, options: tuple[object, ...], says: str
) -> None:
    done = run("calibrate", job, *options)
    assert done.code == 2
    assert says in done.err
    assert [file.name for file in job.parent.iterdir()] == ["job.toml"]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("width_us,angle\n1000,1\n", "seen.csv:1: error: there is no column angle_deg"),
        ("width_us,angle_deg\n1000,1\n1500,\n", "seen.csv:3: error: a reading is two numbers"),
        ("width_us,angle_deg\n1000,1\n1500\n", "seen.csv:3: error: a reading is two numbers"),
    ],
)
def test_a_wrong_file_of_readings_is_refused_with_its_line(run: Run, job: Path, text: str, says: str) -> None:
    job.with_name("seen.csv").write_text(text)
    done = run("calibrate", job, "--readings", job.with_name("seen.csv"))
    assert done.code == 2
    assert says in done.err


def test_a_motion_that_the_calibrated_servo_cannot_do_is_said(run: Run, job: Path) -> None:
    done = run(
        "calibrate",
        job,
        *RANGE,
        "--points",
        3,
        "--from-us",
        1300,
        "--to-us",
        1900,
        "--angles-deg",
        "54,108,160",
    )
    assert done.code == 1
    assert "with this calibration the job's motion is not possible" in done.err
    assert "arm cannot go to 30°" in done.err


def test_a_wheels_speeds_are_calibrated(run: Run, tmp_path: Path) -> None:
    job = tmp_path / "base.toml"
    job.write_text((ROOT / "jobs" / "omni-square.toml").read_text())
    options = (*RANGE, "--points", 5, "--angles-deg=-270,-140,0,128,265", "--servo", "wheel2")
    done = run("calibrate", job, *options)
    assert done.code == 0, done.err
    assert "speed_deg_s" in (tmp_path / "wheel2.calibration.toml").read_text()


@pytest.mark.parametrize(
    ("base", "servo", "column", "values", "allowed"),
    [
        ("lab8-exercise", "arm", "angle_deg", (0, 45, 90, 135, 180), 5.0),
        ("omni-square", "wheel2", "speed_deg_s", (-200, -100, 0, 100, 200), 20.0),
    ],
)
def test_the_usual_tolerance_is_5_degrees_and_of_a_wheel_20_degrees_per_second(
    base: str, servo: str, column: str, values: tuple[int, ...], allowed: float, run: Run, tmp_path: Path
) -> None:
    """Of five readings the middle one is off by e: by least squares it is 4/5 e from the line."""
    readings = tmp_path / "seen.csv"
    for off, code in ((allowed - 0.1, 0), (allowed + 0.1, 2)):
        seen = [value + (off * 5 / 4 if n == 2 else 0) for n, value in enumerate(values)]
        rows = [f"{1000 + 250 * n},{value}" for n, value in enumerate(seen)]
        readings.write_text("\n".join([f"width_us,{column}", *rows]) + "\n")
        job = ROOT / "jobs" / f"{base}.toml"
        done = run("calibrate", job, "--servo", servo, "--readings", readings, "-o", tmp_path / "c.toml")
        assert done.code == code, done.err
        assert ("[bad-readings]" in done.err) == bool(code)


def test_a_sweep_goes_by_small_steps() -> None:
    job = plan_job(loads(LAB8.read_text(), "job.toml"))
    robot = Robot(9600)
    _, controller = job_controller(job, 9600, "500,2500", 0)
    channel = controller.channels[0]
    with SerialLink(robot.open, 9600, robot.time(), 0) as line:
        sweep = Sweep(controller, 0, line, robot.time(), 127)
        for stop in positions(channel, None, None, 7):
            sweep.go(stop)
    moves = [each for _, _, each in robot.arrived]
    assert np.abs(np.diff(moves)).max() <= 4
    assert moves[-1] == channel.position(math.pi)


def test_a_sweep_reads_every_stop_and_ends_at_rest() -> None:
    """A servo whose horn stands 2° beyond the line of its model: 90° is 1500 µs."""
    robot, controller, stops = sweep_of_lab8()
    with SerialLink(robot.open, 9600, robot.time(), 0) as line:
        found = sweep_readings(
            controller, 0, stops, line, robot.time(), lambda sweep, point: seen_angle(sweep) + math.radians(2)
        )
    assert [each.width_us for each in found] == [controller.channels[0].widths_us[each] for each in stops]
    assert [math.degrees(each.angle) for each in found] == pytest.approx(
        [90 + (each.width_us - 1500) * 180 / 1000 + 2 for each in found]
    )
    assert robot.arrived[-1][2] == 127, "neutral: 1500 of 500 to 2500 µs"


def test_a_sweep_that_is_given_up_goes_back_to_rest_too() -> None:
    robot, controller, stops = sweep_of_lab8()

    def give_up(sweep: Sweep, point: int) -> float:
        if point == 1:
            raise InputError("bad-readings", "enough")
        return 0.0

    with SerialLink(robot.open, 9600, robot.time(), 0) as line, pytest.raises(InputError, match="enough"):
        sweep_readings(controller, 0, stops, line, robot.time(), give_up)
    assert robot.arrived[-1][2] == 127
    assert max(position for _, _, position in robot.arrived) <= stops[1]


def test_angles_that_were_seen_before_must_be_as_many_as_the_points() -> None:
    robot, controller, stops = sweep_of_lab8()
    angles = [0.1, 0.2, 0.3]
    with SerialLink(robot.open, 9600, robot.time(), 0) as line:
        found = sweep_readings(controller, 0, stops, line, robot.time(), ask_from(angles, stops))
    assert [each.angle for each in found] == angles
    with pytest.raises(InputError, match="2 angles for 3 points"):
        ask_from(angles[:2], stops)


def sweep_of_lab8() -> tuple[Robot, ServoController, tuple[int, ...]]:
    """A robot, its controller, and three stops over the servo's range."""
    job = plan_job(loads(LAB8.read_text(), "job.toml"))
    _, controller = job_controller(job, 9600, "500,2500", 0)
    return Robot(9600), controller, positions(controller.channels[0], None, None, 3)


def seen_angle(sweep: Sweep) -> float:
    """The angle of the position that was sent last: 1000 µs at 0°, 2000 µs at 180°."""
    return math.radians((500 + sweep.at * 2000 / 254 - 1000) * 180 / 1000)


def test_points_are_spread_evenly_over_the_range_and_inside_it() -> None:
    job = plan_job(loads(LAB8.read_text().replace("trim_us = 0", "min_deg = 20\nmax_deg = 160"), "job.toml"))
    servo = job.servos[0]
    channel = ControllerChannel(servo, 0, tuple(np.linspace(500, 2500, 255).tolist()))
    widths = [channel.widths_us[each] for each in positions(channel, None, None, 9)]
    assert servo.widths_us[0] <= widths[0] <= servo.widths_us[0] + channel.step_us
    assert servo.widths_us[1] - channel.step_us <= widths[-1] <= servo.widths_us[1]
    assert np.ptp(np.diff(widths)) <= 1.01 * channel.step_us
    with pytest.raises(InputError, match="accepts"):
        positions(channel, 1000, None, 5)
