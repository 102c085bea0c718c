"""Facts of a walk of four frames made by hand, in metres, seconds and radians."""

from __future__ import annotations

import math
from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from servogen.report import gait_facts
from servogen.report.gait_facts import GaitFacts, JointFacts, walk_facts, walk_to_json
from servogen.units import Clock, Cycles

FEET = np.full((4, 2, 3), -0.1)
FEET[1, 0, 2] = -0.07
FEET[2, 1, 2] = -0.1300
DOWN = np.array([[True, True], [False, True], [True, False], [True, True]])
SPRINGS = np.zeros((4, 2, 3))
SPRINGS[1, 1] = [0.003, 0.0, 0.004]  # 5 mm
SPRINGS[3, 0] = [0.0, 0.005, 0.0000000001]  # the same within a nanometre, and later


def walked(**others: Any) -> Any:
    angles = np.array([[0.0, 1.0], [0.1, 0.5], [0.3, 0.5], [0.4, 0.7]])
    given = {
        "legs": ("L", "R"),
        "feet": FEET,
        "ground": DOWN,
        "corrections": SPRINGS,
        "margins": np.array([0.02, 0.010000002, 0.01, 0.03]),
        "minimum_margin_m": 0.01,
        "largest_correction_m": 0.005,
        "lift_m": 0.03,
        "frames_per_cycle": 25,
        "trajectory": SimpleNamespace(
            angles=angles, loop_start=1, joints=("a", "b"), clock=Clock(4_000_000), period=Cycles(20_000)
        ),
        "changes": [
            SimpleNamespace(what="duty", asked=Fraction(1, 2), used=Fraction(3, 4), frames=Fraction(5, 2))
        ],
        "slip": SimpleNamespace(metres=0.001, leg="R", frame=2),
        "lost": 0.02,
        "beyond": 0.03,
        "centres": [None, 1 - 2j],
        "held_back": [SimpleNamespace(leg="L", angle=0.1)],
        "liftoff_slide_m": 0.004,
    }
    return SimpleNamespace(**{**given, **others})


@pytest.fixture
def robot(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A robot whose legs are 40 mm at least above the lowest foot; their feet are left out."""
    sticks = np.zeros((4, 3, 3))
    sticks[:, -1, 2] = -0.13
    sticks[2, 1, 2] = -0.09
    monkeypatch.setattr(gait_facts, "leg_sticks", lambda robot, planned: [np.zeros((4, 3, 3)), sticks])
    joints = [SimpleNamespace(lower=-1.0, upper=2.0), SimpleNamespace(lower=-3.0, upper=4.0)]
    limbs = [SimpleNamespace(joints={"alpha": joints[0]}), SimpleNamespace(joints={"beta": joints[1]})]
    return SimpleNamespace(name="biped", limbs=limbs)


def test_the_facts_of_a_walk_are_where_it_is_worst_first(robot: Any) -> None:
    """Margins within a nanometre are alike: the first counts. Springs as well."""
    found = walk_facts(robot, walked())
    assert found.cycle_s == pytest.approx(0.5)
    assert (found.margin, found.margin_frame, found.margin_feet) == (0.01, 2, ("L",))
    near = walked(margins=np.array([0.02, 0.0100000001, 0.01, 0.03]))
    assert walk_facts(robot, near).margin_frame == 1
    assert (found.correction, found.correction_leg, found.correction_frame) == (0.005, "R", 1)
    assert (found.lift, found.body_height) == (0.03, pytest.approx(0.13))
    assert found.clearance == pytest.approx(0.04)
    assert walk_facts(robot, walked(minimum_margin_m=math.inf)).margin is None
    assert walk_facts(robot, walked(minimum_margin_m=-math.inf)).margin == -math.inf


def test_joints_have_their_range_and_their_greatest_speed_around_the_loop(robot: Any) -> None:
    """From 0.4 back to 0.1 in a frame of 20 ms is 15 rad/s, from 0.7 to 0.5 is 10; at first 0.5 is 25."""
    first, second = walk_facts(robot, walked()).joints
    assert (first.name, first.minimum, first.maximum, first.limits) == ("a", 0.0, 0.4, (-1.0, 2.0))
    assert (second.name, second.minimum, second.maximum, second.limits) == ("b", 0.5, 1.0, (-3.0, 4.0))
    assert (first.speed, second.speed) == (pytest.approx(15), pytest.approx(25))
    assert first.to_json() == {
        "name": "a",
        "minimum_deg": 0.0,
        "maximum_deg": math.degrees(0.4),
        "lower_limit_deg": math.degrees(-1),
        "upper_limit_deg": math.degrees(2),
        "peak_speed_deg_s": pytest.approx(math.degrees(15)),
    }


FACTS = GaitFacts(
    cycle_s=0.5,
    margin=0.01,
    margin_frame=2,
    margin_feet=("L",),
    correction=0.005,
    correction_leg="R",
    correction_frame=1,
    lift=0.03,
    clearance=0.04,
    body_height=0.13,
    joints=(JointFacts("a", 0.0, 1.0, (-1.0, 2.0), 3.0),),
)
RHYTHM: Any = SimpleNamespace(
    name="own", duty=Fraction(3, 4), lifts=(("L", Fraction(0)), ("R", Fraction(1, 2)))
)


def test_the_json_of_a_walk_has_all_of_it(robot: Any) -> None:
    loads: Any = SimpleNamespace(
        worst=(1, 3),
        legs=("L", "R"),
        torques=np.arange(8.0).reshape(4, 2),
        forces=np.arange(10.0, 18.0).reshape(4, 2),
    )
    shown = walk_to_json(robot, RHYTHM, walked(), FACTS, loads)
    assert shown == {
        "robot": "biped",
        "gait": "own",
        "duty": 0.75,
        "lifts": {"L": 0.0, "R": 0.5},
        "frames": 4,
        "loop_start": 1,
        "frames_per_cycle": 25,
        "cycle_s": 0.5,
        "phase_changes": [{"what": "duty", "asked": 0.5, "used": 0.75, "frames": 2.5}],
        "stability": {"minimum_m": 0.01, "frame": 2, "feet": ["L"]},
        "spring": {"largest_m": 0.005, "leg": "R", "frame": 1},
        "slip": {"largest_m": 0.001, "leg": "R", "frame": 2},
        "lost_motion": {"angle_deg": math.degrees(0.02), "swing_beyond": 0.03},
        "centres_of_rotation_m": [None, [1.0, -2.0]],
        "held_back": [{"leg": "L", "angle_deg": math.degrees(0.1)}],
        "first_millimetre_m": 0.004,
        "torque": {"largest_nm": 7.0, "leg": "R", "frame": 3, "foot_n": 17.0},
        "lift_m": 0.03,
        "clearance_m": 0.04,
        "body_height_m": 0.13,
        "joints": [FACTS.joints[0].to_json()],
    }


@pytest.mark.parametrize("loads", [None, SimpleNamespace(worst=None)])
def test_without_loads_there_is_no_torque(robot: Any, loads: Any) -> None:
    assert walk_to_json(robot, RHYTHM, walked(), FACTS, loads)["torque"] is None


def test_without_feet_on_the_ground_there_is_no_least_margin(robot: Any) -> None:
    from dataclasses import replace

    air = walk_to_json(robot, RHYTHM, walked(), replace(FACTS, margin_feet=(), margin=-math.inf), None)
    assert air["stability"] == {"minimum_m": None, "frame": 2, "feet": []}
    assert walk_to_json(robot, RHYTHM, walked(), replace(FACTS, margin=None), None)["stability"] is None
