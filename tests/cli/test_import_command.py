"""`servogen import`: a job that moves as the recording does, within the error that it states."""

import json
import math
import sys
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

from servogen.cli import main
from servogen.job import load, plan_job
from tests.cli.conftest import Run, rows_of


def angle(time: float) -> float:
    """A wave of a second, a rest of half a second, then a straight way."""
    return 90 - 40 * math.cos(math.pi * min(time, 1.0)) - 60 * max(0.0, time - 1.5)


def csv_of(times: list[float], moved: int | None = None) -> str:
    rows = [
        f"{time:.3f},{angle(time) + (3 if index == moved else 0):.4f}" for index, time in enumerate(times)
    ]
    return "\n".join(["time_s,arm_deg", *rows, ""])


TIMES = [index / 100 for index in range(201)]


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    file = tmp_path / "wave.csv"
    file.write_text(csv_of(TIMES))
    return file


@pytest.fixture(scope="module")
def waving(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The job of the wave: it is only read."""
    folder = tmp_path_factory.mktemp("wave")
    (folder / "wave.csv").write_text(csv_of(TIMES))
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(StringIO()) as out:
        patch.setattr(
            sys, "argv", ["servogen", "import", f"{folder}/wave.csv", "-o", f"{folder}/job.toml", "--json"]
        )
        with pytest.raises(SystemExit) as ended:
            main()
    assert not ended.value.code
    (folder / "told.json").write_text(out.getvalue())
    return folder / "job.toml"


def test_the_job_moves_as_the_recording_within_the_error_that_is_told(waving: Path) -> None:
    told = json.loads(waving.with_name("told.json").read_text())
    assert told["within_max_error"] and told["duration_s"] == 2
    error_deg = told["deviations"][0]["error_deg"]
    assert error_deg < 10 * 0.18 and told["poses"] < 20  # 10 µs of this servo
    # The plan alone leaves room for the engine's rounding; it follows the formula, not the file.
    planned = np.degrees(plan_job(load(waving)).trajectory.angles[:101, 0])
    np.testing.assert_allclose(planned, [angle(0.02 * frame) for frame in range(101)], atol=5.1 * 0.18)


def test_one_sample_that_is_moved_beyond_the_tolerance_is_reported_with_its_line(
    run: Run, waving: Path, recorded: Path
) -> None:
    recorded.write_text(csv_of(TIMES, moved=77))  # between two frames
    ran = run("import", recorded, "--against", waving)
    assert ran.code == 1 and f"{recorded}:79: warning: arm is " in ran.err and "at 0.77 s" in ran.err


def test_the_csv_of_a_plan_comes_back_as_the_same_motion(run: Run, waving: Path, tmp_path: Path) -> None:
    table = tmp_path / "plan.csv"
    assert run("plan", waving, "--csv", table).code == 0
    ran = run("import", table, "--against", waving, "--json")
    assert ran.code == 0 and len(rows_of(table)) == 102
    assert json.loads(ran.out)["deviations"][0]["error_us"] < 1


JOB = """\
# kept
[chip]
device = "PIC16F84"
clock_hz = 4_000_000

[[servo]]
name = "base"
pin = "RB0"
model = "futaba-s3001" # mine
joint = "q1"
zero_deg = 80

[[servo]]
name = "shoulder"
pin = "RB1"
model = "futaba-s3001"
joint = "q2"

[[servo]]
name = "elbow"
pin = "RB2"
model = "futaba-s3001"
joint = "q3"

[robot]
name = "anthropomorphic"

[motion] # replaced
poses = [{ base_deg = 90, shoulder_deg = 90, elbow_deg = 90, hold_s = 1 }]
"""


def test_joints_of_ros_turn_the_servos_of_a_job_whose_comments_stay(run: Run, tmp_path: Path) -> None:
    job, out, file = (tmp_path / name for name in ("mine.toml", "out.toml", "move.json"))
    job.write_text(JOB)
    points = [
        {"positions": [end], "time_from_start": time} for time, end in ((1, 0.0), (2, math.radians(50)))
    ]
    file.write_text(json.dumps({"joint_names": ["q1"], "points": points}))
    ran = run("import", file, "--job", job, "-o", out)
    assert ran.code == 0 and "tool: at worst" in ran.out and "a computer plays it" not in ran.out
    text = out.read_text()
    assert "# kept" in text and "# mine" in text
    degrees = np.degrees(plan_job(load(out)).trajectory.angles[:, 0])
    assert degrees[0] == pytest.approx(80) and degrees[-1] == pytest.approx(130)


def test_a_horn_is_turned_where_the_motion_would_leave_the_servos_travel(run: Run, tmp_path: Path) -> None:
    """From -100 to -20° about 150° is 50 to 130°, the middle of 0 to 180°."""
    file, job = tmp_path / "far.csv", tmp_path / "job.toml"
    file.write_text("time_s,q1_deg\n0,-100\n1,-20\n2,-100\n")
    words = ("import", file, "--robot", "anthropomorphic", "--map", "q1=q1", "-o", job)
    assert run(*words).code == 0 and "zero_deg = 150\n" in job.read_text()
    before = job.read_bytes()
    again = run(*words)
    assert (again.code, "[output-exists]" in again.err, job.read_bytes()) == (2, True, before)


def test_a_motion_that_is_too_long_says_how_many_seconds_fit_and_that_a_stream_plays_it(
    run: Run, tmp_path: Path
) -> None:
    file, job = tmp_path / "long.csv", tmp_path / "job.toml"
    turns = np.random.default_rng(1).uniform(85, 95, (70, 8))
    lines = [",".join(f"{value:.2f}" for value in (0.08 * row, *turns[row])) for row in range(len(turns))]
    file.write_text("\n".join(["time_s," + ",".join(f"{name}_deg" for name in "abcdefgh"), *lines]))
    ran = run("import", file, "-o", job)
    assert ran.code == 2 and not job.exists() and "the chip holds the first" in ran.err
    seconds = ran.err.split("--to-s ")[1].split()[0]
    assert 0.5 < float(seconds) < 5.52
    streamed = run("import", file, "-o", job, "--stream", "--force")
    assert streamed.code == 0 and "a computer plays it" in streamed.out
    assert plan_job(load(job)).stream is not None


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ((), "-o: error: the job to write is not given"),
        (("-o", "wave.csv"), "is what is read"),
        (("-o", "new.toml", "--map", "leg=arm"), "has no track 'leg'"),
        (("-o", "new.toml", "--map", "leg"), "'leg' is not a track and a name"),
        (("-o", "new.toml", "--unit", "grad"), "'grad' is no unit"),
        (("-o", "new.toml", "--robot", "scara"), "the robot has no joint 'arm'"),
        (("--against", "new.toml", "-o", "x.toml"), "--against writes no job"),
        (("--job", "new.toml", "--servo", "sg90", "-o", "x.toml"), "are those of --job"),
        (("--job", "walk.toml", "-o", "x.toml"), "[walk] moves the servos"),
    ],
)
def test_wrong_options_are_answered_with_what_is_wrong(
    run: Run, recorded: Path, monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...], message: str
) -> None:
    monkeypatch.chdir(recorded.parent)
    Path("walk.toml").write_text('[chip]\ndevice = "PIC16F84"\n[walk]\ngait = "tripod"\n')
    ran = run("import", "wave.csv", *options)
    assert ran.code == 2 and message in ran.err


def test_a_sample_that_a_servo_cannot_follow_is_told_with_its_line(run: Run, tmp_path: Path) -> None:
    file = tmp_path / "far.csv"
    file.write_text("time_s,arm_deg\n0,90\n1,190\n2,90\n")
    ran = run("import", file, "-o", tmp_path / "job.toml")
    assert ran.code == 2 and f"{file}:3: error: arm cannot go to 190°" in ran.err


def test_an_export_of_blender_needs_its_unit_and_says_which_is_likely(run: Run, tmp_path: Path) -> None:
    file, job = tmp_path / "a.json", tmp_path / "job.toml"
    file.write_text(json.dumps({"fps": 30, "positions": [{"0": 200}, {"0": 260}, {"0": 320}]}))
    ran = run("import", file, "-o", job)
    assert ran.code == 2 and "probably --unit pca9685" in ran.err
    assert run("import", file, "-o", job, "--unit", "pca9685", "--map", "0=jaw", "--servo", "sg90").code == 0
    # 200 of 4096 steps of 20 ms are 976.6 µs.
    servo = load(job).servos[0]
    assert servo.name == "jaw"
    first = plan_job(load(job)).trajectory.angles[0, 0]
    assert servo.width_us(first) == pytest.approx(200 * 20_000 / 4096, abs=0.1)
