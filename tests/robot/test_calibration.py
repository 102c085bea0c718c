"""Readings -> line -> file -> the widths of a job."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from servogen.errors import InputError, ToolError
from servogen.job import load, plan_job
from servogen.robot.calibration import Fit, Reading, calibration_text, fit, write_calibration

JOB = """
[chip]
device = "PIC16F84"
clock_hz = 4_000_000
[[servo]]
name = "arm"
pin = "RB0"
model = "futaba-s3001"
{facts}
[motion]
poses = [{{ arm_deg = 90, hold_s = 1 }}]
"""


def readings_of(pairs: Sequence[tuple[float, float]]) -> list[Reading]:
    """(width in µs, angle in degrees) pairs."""
    return [Reading(width, math.radians(angle)) for width, angle in pairs]


def straight(zero_us: float, us_per_deg: float, count: int = 7) -> list[tuple[float, float]]:
    widths = np.linspace(1000, 2000, count).tolist()
    return [(width, (width - zero_us) / us_per_deg) for width in widths]


@given(st.floats(600, 1400), st.floats(3, 12), st.booleans())
def test_readings_on_a_line_give_that_line(zero_us: float, slope: float, falling: bool) -> None:
    slope = -slope if falling else slope
    made = fit(readings_of(straight(zero_us, slope)))
    assert made.zero_us == pytest.approx(zero_us, abs=1e-6)
    assert made.us_per_rad * math.radians(1) == pytest.approx(slope, rel=1e-9)
    assert made.rms < 1e-9


@given(st.lists(st.floats(-2, 2), min_size=9, max_size=9))
def test_the_line_is_the_least_squares_line_of_the_angles(noise: list[float]) -> None:
    pairs = [(w, a + n) for (w, a), n in zip(straight(1000, 5.5, 9), noise, strict=True)]
    made = fit(readings_of(pairs))
    slope, start = np.polyfit([width for width, _ in pairs], [angle for _, angle in pairs], 1)
    line = [math.degrees((width - made.zero_us) / made.us_per_rad) for width in (1000, 1500, 2000)]
    assert line == pytest.approx([start + slope * width for width in (1000, 1500, 2000)], abs=1e-6)
    assert sum(made.residuals) == pytest.approx(0, abs=1e-9)


def test_rms_of_the_residuals_estimates_the_noise() -> None:
    noise = np.random.default_rng(1).normal(0, 1.0, 400)
    pairs = [(w, a + n) for (w, a), n in zip(straight(1000, 5.5, 400), noise.tolist(), strict=True)]
    assert math.degrees(fit(readings_of(pairs)).rms) == pytest.approx(1.0, rel=4 / math.sqrt(2 * 400))


@pytest.mark.parametrize(
    ("pairs", "said"),
    [
        ([(1000, 0), (2000, 180)], "error of the line, not 2"),
        ([(1000, 0), (1000, 1), (1000, 2), (2000, 180)], "error of the line, not 2"),
        ([(1000, 90), (1500, 90), (2000, 90)], "did not move"),
        ([(1000, 0), (1500, math.nan), (2000, 180)], r"reading 2 \(nan° at 1500 µs\) is not a number"),
        ([(1000, 0), (1200, 50), (1400, 40), (2000, 180)],
            r"reading 3 \(40° at 1400 µs\) does not rise from reading 2 \(50° at 1200 µs\)"),
        ([(1000, 180), (1300, 180), (1600, 40), (2000, 0)],
            r"reading 2 \(180° at 1300 µs\) does not fall from reading 1"),
        ([(1000, 0), (1250, 45), (1500, 60), (1750, 135), (2000, 180)],
            r"reading 3 \(60° at 1500 µs\) is 30.0° off the line of the others"),
        ([(1000, 0), (1250, 54), (1500, 90), (1750, 135), (2000, 180)],
            r"reading 2 \(54° at 1250 µs\) is 9.0° off the line of the others"),
        (
            [(1000, 90), (1500, 90), (2000, 90), (2500, 150)],
            r"reading 2 \(90° at 1500 µs\) does not rise from reading 1 \(90° at 1000 µs\), as the others do",
        ),
        ([(1000, 0), (1500, 20), (2000, 0)],
            r"reading 3 \(0° at 2000 µs\) does not rise from reading 2 \(20° at 1500 µs\)"),
        ([(1000, 90), (1500, 91), (2000, 90)],
            r"hardly moved: by 0\.0° over all widths, and reading 2 \(91° at 1500 µs\) is 0\.7° off"),
        ([(1000, 0), (1500, 1), (2000, 0)], "the servo hardly moved"),
        ([(1000, 0.0), (1200, 1.0), (1400, 0.1), (1600, 0.5)], "the servo hardly moved: by 0"),
        ([(w, (w - 1000) ** 2 / 5555) for w in (1000, 1250, 1500, 1750, 2000)], "not on a straight line"),
    ],
)  # fmt: skip
def test_bad_readings_are_named(pairs: list[tuple[float, float]], said: str) -> None:
    with pytest.raises(InputError, match=said):
        fit(readings_of(pairs))


def test_readings_may_come_in_any_order_and_more_than_once() -> None:
    pairs = [(2000, 180), (1000, 0), (1500, 89), (1500, 91), (1250, 45)]
    assert math.degrees(fit(readings_of(pairs)).angle(1500)) == pytest.approx(90)


def made_of(tmp_path: Path, pairs: list[tuple[float, float]], facts: str = "") -> tuple[Fit, Path]:
    """The fit of readings of the job's servo, and the job with the file of it."""
    job = tmp_path / "job.toml"
    job.write_text(JOB.format(facts=facts))
    made = fit(readings_of(pairs))
    write_calibration(tmp_path / "arm.toml", calibration_text(made, plan_job(load(job)).servos[0]))
    job.write_text(JOB.format(facts=facts + '\ncalibration = "arm.toml"'))
    return made, job


@pytest.mark.parametrize("facts", ["", "trim_us = 25", "reverse = true", "trim_us = -10\nreverse = true"])
def test_a_job_that_names_the_file_sends_the_widths_that_were_read(tmp_path: Path, facts: str) -> None:
    slope = -6.0 if "reverse" in facts else 6.0
    zero = 2040.0 if "reverse" in facts else 960.0
    _, job = made_of(tmp_path, straight(zero, slope), facts)
    servo = plan_job(load(job)).servos[0]
    for angle in (20, 90, 160):
        assert servo.width_us(math.radians(angle)) == pytest.approx(zero + slope * angle, abs=1e-3)


def test_a_bend_in_the_readings_is_a_third_point_of_the_file(tmp_path: Path) -> None:
    """12 µs/° up to 90°, 10 beyond, read to half a degree. The same errors about one line are no bend."""
    widths = range(600, 2401, 300)
    off = (0.4, -0.3, 0.2, -0.4, 0.3, -0.2, 0.1)
    true = [15 + (width - 600) / 12 if width < 1500 else 90 + (width - 1500) / 10 for width in widths]
    made, job = made_of(tmp_path, [(w, a + o) for w, a, o in zip(widths, true, off, strict=True)])
    servo = plan_job(load(job)).servos[0]
    assert len(servo.calibration.points) == 3
    for width, angle in list(zip(widths, true, strict=True))[1:-1]:
        assert servo.width_us(math.radians(angle)) == pytest.approx(width, abs=0.5 * 12)
    assert math.degrees(made.rms) < 0.6
    assert fit(readings_of([(w, (w - 500) / 11 + o) for w, o in zip(widths, off, strict=True)])).bent is None


def test_nothing_beyond_what_was_read_is_allowed(tmp_path: Path) -> None:
    _, job = made_of(tmp_path, [(1200, 36), (1500, 90), (1800, 144)])
    servo = plan_job(load(job)).servos[0]
    assert [math.degrees(limit) for limit in servo.limits] == pytest.approx([36, 144], abs=1e-4)
    with pytest.raises(InputError, match="cannot go to 150°"):
        servo.width_us(math.radians(150))


def test_the_line_ends_at_the_mechanical_stops(tmp_path: Path) -> None:
    _, job = made_of(tmp_path, [(900, -9), (1500, 90), (2100, 189)])
    servo = plan_job(load(job)).servos[0]
    assert [math.degrees(limit) for limit in servo.limits] == pytest.approx([0, 180], abs=1e-6)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (('servo = "arm"', 'servo = "leg"'), r"arm.toml:2:1: error: servo: this calibrates the servo 'leg'"),
        (("futaba-s3001", "mpx-tiny-s"), "this calibrates the model 'mpx-tiny-s'"),
        (("angle_deg", "speed_deg_s"), "a calibration point of this servo is"),
        (("width_us =", "width_ms ="), "width_us"),
    ],
)
def test_a_wrong_file_is_refused_with_its_place(tmp_path: Path, change: tuple[str, str], said: str) -> None:
    _, job = made_of(tmp_path, straight(1000, 5.5))
    file = tmp_path / "arm.toml"
    file.write_text(file.read_text().replace(*change))
    with pytest.raises(InputError, match=said):
        plan_job(load(job))


def test_a_file_that_is_missing_or_one_fact_too_many_is_refused(tmp_path: Path) -> None:
    job = tmp_path / "job.toml"
    job.write_text(JOB.format(facts='calibration = "gone.toml"'))
    with pytest.raises(InputError, match="there is no calibration file"):
        plan_job(load(job))
    points = "points = [{ angle_deg = 0, width_us = 1000 }, { angle_deg = 90, width_us = 1500 }]"
    job.write_text(JOB.format(facts='calibration = "gone.toml"\n' + points))
    with pytest.raises(InputError, match="already has points of its own"):
        plan_job(load(job))


def test_old_files_are_kept_each_under_a_name_of_its_own(tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    kept = [write_calibration(path, f"{text}\n") for text in ("one", "two", "three")]
    assert kept == [None, tmp_path / "arm.toml.1.bak", tmp_path / "arm.toml.2.bak"]
    found = {file.name: file.read_text() for file in tmp_path.iterdir()}
    assert found == {"arm.toml": "three\n", "arm.toml.1.bak": "one\n", "arm.toml.2.bak": "two\n"}


def test_a_file_whose_old_contents_cannot_be_kept_is_not_overwritten(tmp_path: Path) -> None:
    """The longest name of a file is 255 bytes, so NAME.1.bak has two too many."""
    path = tmp_path / ("n" * 251)
    path.write_text("old\n")
    with pytest.raises(ToolError) as caught:
        write_calibration(path, "new\n")
    assert str(caught.value) == (
        f"{path}.1.bak: error: the old file cannot be kept: File name too long [write-failed]"
    )
    assert {file.name: file.read_text() for file in tmp_path.iterdir()} == {path.name: "old\n"}


def test_a_failing_disk_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "arm.toml"
    write_calibration(path, "old\n")

    def full(self: Path, target: Path) -> Path:
        raise OSError(28, "No space left on device", str(self))

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(Exception, match="No space left"):
        write_calibration(path, "new\n")
    assert {file.name: file.read_text() for file in tmp_path.iterdir()} == {"arm.toml": "old\n"}
