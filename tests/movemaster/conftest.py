"""Running programs in tests: an RV-M1 with stated speeds, a hand from 30° (open) to 90°, frames of 20 ms."""

import math
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from typing import Any

import pytest

from servogen.errors import InputError
from servogen.kinematics.catalogue import arm
from servogen.movemaster import Budget, Hand, Manipulator, ProgramRun, manipulator, parse, run
from servogen.robot.model import Arm
from servogen.units import Clock, Cycles


def _ran(text: str, **options: Any) -> ProgramRun:
    speeds = tuple(math.radians(speed) for speed in (120, 72, 109, 100, 163))
    robot = options.pop("robot", None) or manipulator(arm("rv-m1"), speeds)
    hand = Hand("hand", math.radians(30), math.radians(90), math.radians(300))
    given = {"hand": hand, "budget": Budget(2000, Fraction(600))} | options
    return run(parse(text, "a.rvm"), robot, Cycles(20_000), Clock(4_000_000), **given)


def _refused(text: str, **options: Any) -> str:
    with pytest.raises(InputError) as caught:
        _ran(text, **options)
    return str(caught.value)


def full_turns(found: Arm, degrees: float = 180) -> Manipulator:
    """The arm with speeds and without limits but a full turn of each joint: every branch is allowed."""
    joints = [
        replace(each, lower=math.radians(-degrees), upper=math.radians(degrees)) for each in found.joints
    ]
    return manipulator(replace(found, joints=tuple(joints)))


@pytest.fixture
def ran() -> Callable[..., ProgramRun]:
    """The run of a program, stopped soon if it does not end."""
    return _ran


@pytest.fixture
def refused() -> Callable[..., str]:
    """The text of the error with which a program is refused."""
    return _refused
