"""What `gait` and `run-program` print and pass on, of walks and runs made by hand."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from fractions import Fraction
from math import pi
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from servogen import movemaster
from servogen.cli import gait_command
from servogen.errors import Diagnostic
from servogen.motion import loads
from servogen.motion.gait import walk as walk_module
from servogen.report import gait_facts, motion_table
from servogen.robot import servo_models
from servogen.units import Clock, Cycles
from tests.cli.conftest import Run
from tests.cli.stand_ins import stand_in

Tables = list[tuple[Any, ...]]
Lines = Callable[..., list[str]]


@pytest.fixture
def tables(monkeypatch: pytest.MonkeyPatch) -> Tables:
    shown: Tables = []
    stand_in(monkeypatch, "servogen.cli.show", "table", lambda *given: shown.append(given))
    return shown


def said(text: str) -> Any:
    return SimpleNamespace(text=lambda: text)


def walked(**others: Any) -> Any:
    given = {
        "trajectory": SimpleNamespace(angles=np.zeros((30, 2)), loop_start=10),
        "frames_per_cycle": 20,
        "changes": [said("change")],
        "centre_texts": lambda: [("L1", "centre")],
        "held_back": [said("held")],
        "slip": said("slip"),
        "lost_motion_text": lambda: None,
        "full_height": lambda: None,
        "stretched_text": lambda: "",
    }
    return SimpleNamespace(**{**given, **others})


JOINT = SimpleNamespace(name="L1_alpha", minimum=-pi / 6, maximum=pi / 4, limits=(-pi / 2, pi / 2), speed=pi)


def facts(**others: Any) -> Any:
    given = {
        "joints": (JOINT,),
        "cycle_s": 0.4,
        "margin": 0.012345,
        "margin_feet": ("L1", "R2"),
        "margin_frame": 7,
        "correction": 0.00125,
        "correction_leg": "R1",
        "correction_frame": 3,
        "lift": 0.02,
        "body_height": 0.13,
        "clearance": 0.0955,
    }
    return SimpleNamespace(**{**given, **others})


RHYTHM: Any = SimpleNamespace(
    name="own", duty=Fraction(3, 4), swing=Fraction(1, 4), lifts=(("L1", Fraction(0)), ("R1", Fraction(7, 8)))
)


@pytest.fixture
def show(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tables: Tables) -> Lines:
    """`show(walk, facts)`: the lines that are printed below the tables."""
    stand_in(monkeypatch, gait_facts, "diagram", lambda rhythm: {"L1": "▔▁", "R1": "▁▁"})

    def lines(planned: Any, found: Any) -> list[str]:
        gait_command.show_walk(SimpleNamespace(), RHYTHM, planned, found)  # type: ignore[arg-type]
        return capsys.readouterr().out.splitlines()

    return lines


@pytest.fixture
def planning(monkeypatch: pytest.MonkeyPatch, tables: Tables) -> dict[str, Any]:
    """`gait` plans seen["walk"] with seen["facts"]; the arguments of the plan."""
    seen: dict[str, Any] = {"walk": walked(), "facts": facts(), "loads": []}

    def plan(
        robot: Any, rhythm: Any, segments: Any, posture: Any, period: Any, clock: Any, **named: Any
    ) -> Any:
        seen["segment"], seen["posture"] = segments[0], posture
        seen["period"], seen["clock"], seen["rhythm"], seen["robot"] = period, clock, rhythm, robot
        seen.update(named)
        return seen["walk"]

    stand_in(monkeypatch, walk_module, "walk", plan)
    stand_in(monkeypatch, gait_facts, "walk_facts", lambda *_: seen["facts"])
    stand_in(monkeypatch, gait_facts, "diagram", lambda rhythm: dict.fromkeys(dict(rhythm.lifts), ""))
    stand_in(monkeypatch, gait_facts, "walk_to_json", lambda *_: {"walk": 1})
    stand_in(monkeypatch, loads, "walk_loads", lambda *_: None)
    stand_in(monkeypatch, loads, "check_loads", lambda *_: seen["loads"])
    return seen


def test_a_gait_without_options_is_the_documented_one(run: Run, planning: dict[str, Any]) -> None:
    """docs/motion.md: 40 mm forward a cycle, feet 20 mm up, frames of 20 ms at 1 µs a cycle; β positive."""
    assert run("gait").code == 0
    segment, posture = planning["segment"], planning["posture"]
    assert [getattr(segment, name) for name in segment.__slots__] == [pytest.approx(0.04), 0, 0, None]
    assert (planning["period"], planning["clock"].hz) == (20_000, 4_000_000)
    assert [getattr(posture, name) for name in posture.__slots__[:4]] == [None, None, 0.02, 1]
    assert (planning["robot"].name, planning["rhythm"].name) == ("hexapod", "tripod")
    assert (planning["frames_per_cycle"], planning["spring_m"]) == (None, None)
    assert planning["allow_falling"] is False
    model = servo_models.servo_model("mpx-tiny-s")
    assert planning["limits"].speed == model.speed
    assert planning["lost"] == model.lost_motion(model.calibration) > 0


def test_the_options_of_a_gait_are_in_millimetres_and_degrees(run: Run, planning: dict[str, Any]) -> None:
    """50 mm at 30° is 43.3 mm forward and 25 mm to the left."""
    words = ("--stride-mm", 50, "--direction-deg", 30, "--turn-deg", 90, "--lift-mm", 15, "--cycles", 2.5)
    words += ("--body-height-mm", 120, "--stance-width-mm", 230, "--beta-sign", -1, "--spring-mm", 0.5)
    assert run("gait", *words, "--period-us", 18_000, "--no-compensate", "--allow-falling").code == 0
    segment, posture = planning["segment"], planning["posture"]
    moved = [0.05 * math.cos(pi / 6), 0.025, pi / 2, 2.5]
    assert [getattr(segment, name) for name in segment.__slots__] == pytest.approx(moved)
    stands = [getattr(posture, name) for name in posture.__slots__[:4]]
    assert stands == pytest.approx([0.12, 0.23, 0.015, -1])
    assert (planning["period"], planning["spring_m"], planning["lost"]) == (18_000, 0.0005, 0.0)
    assert planning["allow_falling"] is True


@pytest.mark.parametrize(
    ("seconds", "frames"), [(0.4, 20), (0.41, 21), (0.4000001, 20), (0.42, 21), (0.001, 1)]
)
def test_the_duration_of_a_cycle_is_rounded_up_to_frames(
    run: Run, planning: dict[str, Any], seconds: float, frames: int
) -> None:
    """Of 20 ms; what a typed decimal differs by from its fraction is no frame."""
    run("gait", "--cycle-s", seconds)
    assert planning["frames_per_cycle"] == frames


def test_a_servo_without_a_stated_speed_is_no_limit(
    run: Run, planning: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    model = SimpleNamespace(speed=None, calibration=None, lost_motion=lambda calibration: 0.125)
    stand_in(monkeypatch, servo_models, "servo_model", lambda name: model)
    run("gait", "--servo", "any")
    assert (planning["limits"].speed, planning["lost"]) == (math.inf, 0.125)


@pytest.mark.parametrize(("asked", "code"), [(95.4, 0), (95.5, 0), (95.6, 2)])
def test_a_walk_with_less_clearance_than_required_is_refused(
    run: Run, planning: dict[str, Any], asked: float, code: int
) -> None:
    planning["facts"] = facts(clearance=0.0955)
    ran = run("gait", "--clearance-mm", asked)
    assert ran.code == code
    message = "the ground clearance is 95.5 mm, less than the 95.6 mm required"
    assert (message in ran.err) == (code == 2)


def test_warnings_of_a_walk_come_last_or_in_the_json(
    run: Run, planning: dict[str, Any], tables: Tables
) -> None:
    planning["loads"] = [Diagnostic("warning", "too-heavy", "heavy")]
    planning["walk"] = walked(full_height=lambda: "upright")
    ran = run("gait")
    assert (ran.code, ran.err.splitlines()[0]) == (0, "2 warnings:")
    assert "heavy" in ran.err
    assert "upright" in ran.err
    count = len(tables)
    shown = run("gait", "--json")
    assert (shown.err, len(tables)) == ("", count)
    found = json.loads(shown.out)
    assert found.pop("walk") == 1
    assert [each["code"] for each in found["diagnostics"]] == ["too-heavy", "full-height"]


def test_the_sign_of_beta_is_one_or_minus_one(run: Run, planning: dict[str, Any]) -> None:
    for sign in (0, 2, -2):
        ran = run("gait", "--beta-sign", sign)
        assert (ran.code, f"the sign of β is 1 or -1, not {sign}" in ran.err) == (2, True)
    assert [run("gait", "--beta-sign", sign).code for sign in (1, -1)] == [0, 0]


def test_a_gait_of_ones_own_needs_its_duty_and_its_phases(run: Run, planning: dict[str, Any]) -> None:
    lifts = "L1=0,L2=0.5,L3=0,R1=0.5,R2=0,R3=0.5"
    for words in (("--duty", 0.5), ("--lifts", lifts)):
        ran = run("gait", *words)
        assert (ran.code, "needs a duty factor and the phase of each leg" in ran.err) == (2, True)
    assert run("gait", "--duty", 0.5, "--lifts", lifts).code == 0
    assert planning["rhythm"].name == "own"
    assert run("gait", "--leg", "L2").code == 0
    assert [leg for leg, _ in planning["rhythm"].lifts] == ["L2"]
    assert [leg.name for leg in planning["robot"].limbs] == ["L2"]


@pytest.fixture
def running(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """`run-program` gives this run; the arguments that it is asked with."""
    pose = SimpleNamespace(values=(300.04, -20.0, 250.0, -90.0, 0.0))
    first, second = SimpleNamespace(number=10, text="MO 1"), SimpleNamespace(number=None, text="GO")
    steps = [
        SimpleNamespace(statement=first, frame=0, frames=50, pose=pose, hand="C"),
        SimpleNamespace(statement=second, frame=50, frames=25, pose=pose, hand="O"),
    ]
    seen: dict[str, Any] = {}
    seen["run"] = SimpleNamespace(
        steps=steps,
        outputs=[SimpleNamespace(frame=75, value=0x1F), SimpleNamespace(frame=76, value=5)],
        seconds=lambda frames: 0.02 * frames,
        trajectory=SimpleNamespace(angles=np.zeros((80, 5)), loop_start=75),
        warnings=(Diagnostic("warning", "w", "a warning"),),
        to_json=lambda: {"steps": 2},
    )

    def program(source: Any, arm: Any, period: Cycles, clock: Clock, **named: Any) -> Any:
        seen.update(named, period=period, hz=clock.hz, arm=arm)
        return seen["run"]

    stand_in(monkeypatch, movemaster, "run", program)
    stand_in(monkeypatch, movemaster, "read", lambda file: "source")
    stand_in(monkeypatch, movemaster, "manipulator", lambda arm: arm.name)
    stand_in(monkeypatch, motion_table, "joint_lines", lambda trajectory, arm: iter(["a", "b"]))
    return seen


def test_a_program_run_is_a_table_of_moves_and_one_of_outputs(
    run: Run, running: dict[str, Any], tables: Tables
) -> None:
    ran = run("run-program", "x.rvm")
    assert (ran.code, ran.out) == (0, "x.rvm: 80 frames, 1.6 s; the last 5 of them repeat\n")
    assert ran.err.startswith("1 warning:\n")
    columns = ("line", "command", "from s", "for s", "x mm", "y mm", "z mm", "pitch °", "roll °", "hand")
    place = ("300.0", "-20.0", "250.0", "-90.0", "0.0")
    rows = [(10, "MO 1", "0.00", "1.00", *place, "closed"), ("", "GO", "1.00", "0.50", *place, "open")]
    outputs = [("1.50", "&1F"), ("1.52", "&05")]
    assert tables == [("Motion", columns, rows), ("Output port", ("at s", "value"), outputs)]
    assert (running["period"], running["hz"], running["arm"]) == (20_000, 4_000_000, "rv-m1")
    assert (running["repeat"], running["inputs"]) == (False, ())
    budget = running["budget"]
    assert [getattr(budget, name) for name in budget.__slots__] == [100_000, 3600]


def test_the_options_of_a_program_run_reach_it(
    run: Run, running: dict[str, Any], tables: Tables, tmp_path: Path
) -> None:
    running["run"].outputs = []
    words = ("--period-us", 18_000, "--repeat", "--max-commands", 5, "--max-s", 2.5, "--input", "1.5=&1F")
    ran = run("run-program", "x.rvm", *words, "--csv", tmp_path / "a.csv")
    assert ran.code == 0
    assert (tmp_path / "a.csv").read_text() == "a\nb\n"
    assert (running["period"], running["repeat"], len(running["inputs"])) == (18_000, True, 1)
    budget = running["budget"]
    assert [getattr(budget, name) for name in budget.__slots__] == [5, Fraction(5, 2)]
    assert [title for title, *_ in tables] == ["Motion"]
    shown = run("run-program", "x.rvm", "--json")
    assert (shown.err, len(tables)) == ("", 1)
    found = json.loads(shown.out)
    assert (found["robot"], found["steps"]) == ("rv-m1", 2)
    assert [each["code"] for each in found["diagnostics"]] == ["w"]
