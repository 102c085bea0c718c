"""Bodies and contacts of a watched job: a run of the twin that hears what was done by hand."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the twin's physics needs MuJoCo: pip install 'servogen[twin]'")

from servogen.errors import InputError
from servogen.watch import recorded_twin as module
from servogen.watch.recorded_twin import recorded_twin
from servogen.watch.session import Session
from servogen.watch.subject import Setting, Subject, load_subject

ROOT = Path(__file__).parent.parent.parent


@pytest.fixture(scope="module")
def on_command() -> Subject:
    return load_subject(ROOT / "jobs" / "hexapod-command.toml", Setting())


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "AHEAD_S", 1.0)


def places(run: dict[str, Any]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """The feet in metres: pictures, legs, axes."""
    return np.array(run["feet"]) / 1e4


def test_a_standing_robot_stands_on_six_feet_that_carry_its_weight(on_command: Subject) -> None:
    run = recorded_twin(on_command, 2_500_000, ())
    assert run["count"] == 175 and run["picture_s"] == 0.02  # 2.5 s and 1 s
    assert run["legs"] == ["L1", "L2", "L3", "R1", "R2", "R3"]
    force = np.array(run["force"])
    assert (force[-20:] > run["touch"]).all()
    assert force[-20:].sum(axis=1) == pytest.approx(0.64 * 9.81, rel=0.03)  # 0.64 kg
    assert np.array(run["height"][-20:]) / 10 == pytest.approx(130, abs=2)
    assert places(run)[-20:, :, 2] == pytest.approx(0, abs=0.0005)
    assert abs(run["yaw"][-1]) < 0.1 and run["inputs"] == 0
    assert len(run["lines"]) == 1 + 6
    tips = np.array([line["points"] for line in run["lines"][1:]])[:, :, -1]
    assert (tips.swapaxes(0, 1) == np.array(run["feet"])).all()


def test_what_is_done_by_hand_moves_the_bodies_too(on_command: Subject) -> None:
    """A turn to the left of 20° in each cycle of 0.96 s, of three feet on the ground at a time."""
    session = Session(on_command)
    list(session.handle({"do": "seek", "cycle": 2_500_000}))
    list(session.handle({"do": "walk", "way": "left"}))
    assert session.chip is not None
    run = recorded_twin(on_command, 5_500_000, session.chip.inputs)
    assert run["inputs"] == len(session.chip.inputs) > 0
    assert math.degrees(run["yaw"][-1]) > 20
    assert abs(run["x"][-1]) < 200  # tenths of a millimetre: it turns on the spot
    down = (np.array(run["force"])[-60:] > run["touch"]).sum(axis=1)
    assert (down == 3).mean() > 0.7


def test_what_moves_no_robot_has_no_bodies() -> None:
    lab = load_subject(ROOT / "firmware" / "lab8-exercise" / "main.hex", Setting())
    assert not Session(lab).model()["bodies"]
    with pytest.raises(InputError, match="only a job has bodies"):
        recorded_twin(lab, 0, ())
    alone = load_subject(ROOT / "jobs" / "lab8-exercise.toml", Setting())
    assert not Session(alone).model()["bodies"]
    with pytest.raises(InputError, match="needs a robot"):
        recorded_twin(alone, 0, ())
