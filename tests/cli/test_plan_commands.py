"""`plan` and `gait` as a user runs them."""

import builtins
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.cli.conftest import rows_of

Run = Callable[..., Any]

JOBS = Path(__file__).parents[2] / "jobs"
PNG = b"\x89PNG\r\n\x1a\n"


@pytest.fixture
def without_matplotlib(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def refuse(name: str, *rest: Any, **more: Any) -> Any:
        if name.split(".")[0] == "matplotlib":
            raise ImportError(name)
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", refuse)


def test_plan_says_what_a_job_does_without_building_it(run: Run) -> None:
    done = run("plan", JOBS / "lab9-exercise.toml")
    assert done.code == 0
    assert "2 servos, loop of 30 frames, 0.6 s" in done.out
    assert "horizontal" in done.out
    assert "750.0" in done.out  # the Tiny-S turns 60° in 0.08 s
    assert "-100.00 to -92.00" in done.out  # z of the foot
    assert "error of rounding to whole cycles: at worst" in done.out


def test_the_csv_has_a_row_a_frame_and_columns_that_say_their_unit(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "out.csv"
    assert run("plan", JOBS / "lab9-exercise.toml", "--csv", path).code == 0
    rows = rows_of(path)
    assert list(rows[0]) == [
        "time_s",
        "vertical_deg",
        "horizontal_deg",
        "vertical_width_us",
        "horizontal_width_us",
        "x_mm",
        "y_mm",
        "z_mm",
    ]
    assert [float(row["time_s"]) for row in rows] == pytest.approx([0.02 * frame for frame in range(30)])
    first = {name: float(value) for name, value in rows[0].items()}
    assert (first["x_mm"], first["y_mm"], first["z_mm"]) == (25, 60, -100)
    # 250 µs for 90°, so 1500 µs at 90° and 25/9 µs a degree
    assert first["horizontal_width_us"] == round(1500 + (first["horizontal_deg"] - 90) * 25 / 9)


def test_the_csv_of_a_walking_robot_names_each_foot(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "out.csv"
    assert run("plan", JOBS / "hexapod-tripod.toml", "--csv", path).code == 0
    assert {"L1_x_mm", "R3_z_mm", "R3-lift_deg"} <= set(rows_of(path)[0])


def test_a_frame_without_pulses_has_empty_cells(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "out.csv"
    assert run("plan", JOBS / "lab8-program.toml", "--csv", path).code == 0
    rows = rows_of(path)
    assert len(rows) == 700
    assert (rows[99]["arm_width_us"], rows[100]["arm_width_us"]) == ("1000.000", "")
    assert (rows[99]["arm_deg"], rows[100]["arm_deg"]) == ("0.0000", "")


def test_plans_json_is_in_metres_radians_and_seconds(run: Run) -> None:
    found = json.loads(run("plan", JOBS / "scara-pick.toml", "--json").out)
    (tool,) = found["ends"]
    assert tool["kind"] == "tool"
    assert tool["minimum_m"] == pytest.approx([0.05, 0.2, 0.3])
    assert tool["maximum_m"] == pytest.approx([0.5, 0.606, 0.45])
    assert 0 < tool["error"]["rms_m"] < tool["error"]["worst_m"] < 0.002
    shoulder = found["servos"][0]
    assert shoulder["speed_limit_deg_s"] == pytest.approx(math.degrees(1.8))
    assert 0 < shoulder["peak_speed_deg_s"] <= math.degrees(1.8)
    assert (shoulder["lower_limit_deg"], shoulder["upper_limit_deg"]) == pytest.approx((0, 180))
    assert found["period_s"] == 0.02


def test_plan_draws_a_picture(run: Run, tmp_path: Path) -> None:
    assert run("plan", JOBS / "lab9-exercise.toml", "--plot", tmp_path / "a.png").code == 0
    assert (tmp_path / "a.png").read_bytes().startswith(PNG)


def test_a_picture_of_unknown_kind_is_refused_with_the_known_ones(run: Run, tmp_path: Path) -> None:
    done = run("plan", JOBS / "lab8-exercise.toml", "--plot", tmp_path / "out.bmp")
    assert done.code == 2
    assert ".png, .svg, .pdf" in done.err


@pytest.mark.usefixtures("without_matplotlib")
def test_without_matplotlib_a_picture_says_what_to_install(run: Run, tmp_path: Path) -> None:
    done = run("plan", JOBS / "lab8-exercise.toml", "--plot", tmp_path / "out.png")
    assert done.code == 3
    assert "servogen[plot]" in done.err


@pytest.mark.usefixtures("without_matplotlib")
def test_without_matplotlib_all_but_pictures_works(run: Run) -> None:
    assert run("plan", JOBS / "hexapod-tripod.toml").code == 0


def test_a_job_that_is_wrong_is_named_with_its_line(run: Run, tmp_path: Path) -> None:
    job = tmp_path / "job.toml"
    job.write_text((JOBS / "lab8-exercise.toml").read_text().replace("arm_deg = 120", "arm_deg = 190"))
    done = run("plan", job)
    assert done.code == 2
    assert f"{job}:19:" in done.err
    assert "0° to 180°" in done.err


def test_what_the_checks_warn_of_is_said(run: Run, tmp_path: Path) -> None:
    job = tmp_path / "job.toml"
    job.write_text((JOBS / "lab8-exercise.toml").read_text().replace("hold_s = 2", "hold_s = 0.2"))
    done = run("plan", job)
    assert done.code == 0
    assert "warning: " in done.err
    assert "before it can reach it" in done.err


def test_servos_that_fit_a_frame_two_at_a_time_only_are_planned_as_their_engine_does(
    run: Run, tmp_path: Path
) -> None:
    """Twelve servos of up to 2 ms, one after the other, are longer than 20 ms."""
    pins = [f"RB{number}" for number in range(8)] + [f"RA{number}" for number in range(4)]
    servos = "".join(
        f'[[servo]]\nname = "s{n}"\npin = "{pin}"\nmodel = "futaba-s3001"\n' for n, pin in enumerate(pins)
    )
    angles = ", ".join(f"s{number}_deg = 90" for number in range(12))
    job = tmp_path / "twelve.toml"
    job.write_text(
        f'[chip]\ndevice = "PIC16F84"\nclock_hz = 4_000_000\n{servos}'
        f"[motion]\nposes = [ {{ {angles}, hold_s = 1 }}, {{ s0_deg = 120, hold_s = 1 }} ]\n"
    )
    assert run("check", job).code == 0
    done = run("plan", job, "--json")
    assert done.code == 0, done.err
    assert len(json.loads(done.out)["servos"]) == 12
