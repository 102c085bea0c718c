"""Every servo of the catalogue runs in the physics, at the speed and with the torque of its file."""

import math
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from servogen.job import loads, plan_job
from servogen.job.starter import starter
from servogen.robot.servo import ServoModel, servo
from servogen.robot.servo_models import ORIGINS, figures, names, servo_model
from servogen.twin import TwinSettings
from servogen.twin.run import standing
from tests.campaigns import sampled

PAGE = Path(__file__).parents[2] / "docs" / "servos.md"
FEW = 24


@cache
def stated(name: str) -> tuple[ServoModel, float, float, float]:
    """Return a model at its lowest voltage, its speed (rad/s), torque (N·m) and time constant (s); the
    example of a continuous servo states neither speed nor torque: that of its points, 0.3 N·m.
    """
    model = servo_model(name)
    speed = model.speed or max(abs(speed) for speed in model.calibration.angles)
    return model, speed, model.torque_nm or 0.3, model.motor.start_s or 0.01


@pytest.mark.parametrize("name", sampled(names(), 8))
def test_it_has_the_speed_and_the_torque_of_its_file(name: str) -> None:
    """From rest with a disc on its shaft, a motor whose torque falls evenly from τs at rest to 0 at ω0 has
    the speed ω0 (1 - exp(-t / (T + Jd ω0 / τs))): T is its time constant, Jd the disc's inertia.
    Against a load τ it turns at ω0 (1 - τ / τs), and not at all where τ is more than τs.
    """
    pytest.importorskip("mujoco", reason="the twin's physics needs MuJoCo: pip install 'servogen[twin]'")
    from tests.twin.bench import DISC, on_the_bench, speed_against

    model, speed, torque, start = stated(name)
    arm = servo("arm", "RB0", model)
    seen = on_the_bench(arm)
    assert seen.speed == pytest.approx(speed, rel=0.02)
    expected = speed * (1 - np.exp(-seen.times / (start + DISC * speed / torque)))
    assert np.abs(seen.speeds - expected).max() <= 0.01 * speed
    assert speed_against(arm, 0.98 * torque) == pytest.approx(0.02 * speed, rel=0.05)
    assert speed_against(arm, 1.02 * torque) <= 1e-3 * speed


@pytest.mark.parametrize(("name", "per_ms"), [("futaba-s3001", 1), ("mg90s", 2)])
def test_the_steps_of_a_robot_follow_its_servos(name: str, per_ms: int) -> None:
    """600 °/s over 1900 µs of 180°: 356/s, which 0.3 rad allow only in half a millisecond."""
    pytest.importorskip("mujoco", reason="the twin's physics needs MuJoCo: pip install 'servogen[twin]'")
    job = plan_job(loads(starter("arm", name, Path("arm.toml")), "arm.toml"))
    rig, _, world = standing(job, TwinSettings())
    assert world.step_s == 0.001 / per_ms
    assert TwinSettings().following(rig).steps_per_ms == per_ms
    assert TwinSettings(steps_per_ms=8).following(rig).steps_per_ms == 8


def test_the_page_states_every_servo_with_its_speed_and_its_torque() -> None:
    """`python -m tests.twin.soak servos` prints the table of docs/servos.md."""
    rows = dict(re.findall(r"^\| `([^`]+)` \| (.*) \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE))
    assert tuple(sorted(rows)) == names() and len(rows) >= FEW
    for name, row in rows.items():
        _, speed, torque, _ = stated(name)
        cells = [cell.strip() for cell in row.split("|")]
        assert [float(cell) for cell in cells[1:5:2]] == pytest.approx(
            [math.degrees(speed), 100 * torque], rel=1e-3
        )
        assert [float(cell) for cell in cells[2:6:2]] == pytest.approx(
            [math.degrees(speed), 100 * torque], rel=0.02
        )


@pytest.mark.parametrize("name", names())
def test_every_figure_is_somebodys_or_assumed(name: str) -> None:
    shown = figures(name)
    assert {figure.origin for figure in shown} <= set(ORIGINS)
    assert all(figure.source for figure in shown if figure.origin != "assumed")
    assert {"points"} <= {figure.key for figure in shown}
