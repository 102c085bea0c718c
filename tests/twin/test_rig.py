"""Which servo of a job turns which joint of the model, on which supply."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pytest

from servogen.errors import InputError
from servogen.job import loads
from servogen.twin.rig import TwinRig, twin_rig, unplugged_servos
from servogen.twin.supply import Supply
from tests.twin.walking import JOBS

SCARA = (JOBS / "scara-pick.toml").read_text().partition("[motion]")[0]
GRIPPER = '[[servo]]\nname = "grip"\npin = "RB4"\nmodel = "mpx-tiny-s"\n\n'
POSES = (
    "[motion]\nposes = [{ hold_s = 1, shoulder_deg = 90, elbow_deg = 90, lift_deg = 90, wrist_deg = 90 }]\n"
)


def rig(text: str, broken: Sequence[str] = ()) -> TwinRig:
    return twin_rig(loads(text, str(JOBS / "test.toml")), broken)


def scara(extra: str = "", broken: Sequence[str] = ()) -> TwinRig:
    return rig(SCARA + POSES + extra, broken)


def test_each_servo_of_a_joint_has_an_actuator_with_its_stops_at_the_joint() -> None:
    """0 to 180° with zero at 90° and a ratio of 0.75 are ±120° of the joint; 0.9° are one millimetre."""
    found = scara()
    assert [servo.name for servo in found.servos] == ["shoulder", "elbow", "lift", "wrist"]
    assert found.columns == (0, 1, 2, 3)
    assert [actuator.name for actuator in found.actuators] == ["shoulder", "elbow", "lift", "wrist"]
    assert [actuator.joint for actuator in found.actuators] == ["q1", "q2", "q3", "q4"]
    shoulder, _, lift, _ = found.actuators
    assert (math.degrees(shoulder.lower), math.degrees(shoulder.upper)) == pytest.approx((-120, 120))
    assert (1000 * lift.lower, 1000 * lift.upper) == pytest.approx((0, 200))
    assert lift.ratio == pytest.approx(math.radians(0.9) / 0.001)
    for actuator, drive in zip(found.actuators, found.drives, strict=True):
        assert (actuator.friction, actuator.armature, actuator.backlash) == (
            drive.friction,
            drive.inertia,
            drive.backlash,
        )
    assert [wiring.zero for wiring in found.wirings] == [binding.zero for binding in found.bindings]
    assert math.degrees(found.wirings[0].zero) == pytest.approx(90) and found.wirings[2].zero == 0.0
    middle = found.servos[0].calibration.width_us(math.pi / 2)
    assert found.wirings[0].angle_of(middle) == pytest.approx(math.pi / 2)


def test_a_joint_that_turns_against_its_servo_has_its_stops_in_order() -> None:
    text = (SCARA + POSES).replace("ratio = 0.75 # ±120° of the joint", "ratio = -1.0")
    actuator = rig(text).actuators[0]
    assert (math.degrees(actuator.lower), math.degrees(actuator.upper)) == pytest.approx((-90, 90))
    assert actuator.ratio == -1.0


def test_a_servo_that_turns_no_joint_is_not_modelled() -> None:
    """It is first in the job, so that the columns of the others are one further."""
    found = rig(SCARA.replace("[[servo]]", GRIPPER + "[[servo]]", 1) + POSES.replace("{", "{ grip_deg = 90,"))
    assert found.columns == (1, 2, 3, 4)
    assert found.assumptions[-1] == "grip turns no joint and is not modelled"
    assert not any("turns no joint" in text for text in scara().assumptions)


def test_broken_and_unplugged_servos_are_named() -> None:
    found = scara(broken=("elbow", "wrist"))
    assert [wiring.broken for wiring in found.wirings] == [False, True, False, True]
    assert unplugged_servos(found, ("wrist", "shoulder")) == {0, 3}
    assert unplugged_servos(found, ()) == frozenset()
    with pytest.raises(InputError, match="there is no servo 'elbo'") as caught:
        scara(broken=("elbo",))
    assert "elbow" in (caught.value.hint or "")
    with pytest.raises(InputError, match="there is no servo 'lifts'") as caught:
        unplugged_servos(found, ("shoulder", "lifts"))
    assert "lift" in (caught.value.hint or "")


def test_wheels_are_bound_by_their_numbers_and_have_no_stops() -> None:
    text = (JOBS / "omni-square.toml").read_text()
    found = rig(text.replace('wheels = ["wheel1", "wheel2"', 'wheels = ["wheel2", "wheel1"'))
    assert [actuator.joint for actuator in found.actuators] == ["wheel1", "wheel2", "wheel3"]
    assert [actuator.name for actuator in found.actuators] == ["wheel2", "wheel1", "wheel3"]
    assert found.columns == (1, 0, 2)
    assert all((each.lower, each.upper) == (-math.inf, math.inf) for each in found.actuators)


def test_without_a_supply_it_is_an_ideal_one_of_the_lowest_voltage_of_the_servos() -> None:
    """The S3001 of the catalogue is at 4.8 V; a Tiny-S may be at 6 V."""
    found = rig((SCARA + POSES).replace('"mpx-tiny-s"', '"mpx-tiny-s"\nsupply_v = 6.0'))
    assert found.supply == Supply(4.8, 0.0, None, False, 4.0)
    assert "supply: 4.8 V without resistance or limit (the job has no [supply])" in found.assumptions
    assert len(set(found.assumptions)) == len(found.assumptions)  # two servos of one model: said once


def test_a_supply_of_the_job_feeds_the_chip_above_the_least_voltage_of_its_clock() -> None:
    """DS35007 section 9.1, D001 and D001A: 4.0 V up to 4 MHz, 4.5 V in HS mode."""
    given = "[supply]\nvoltage_v = 6.5\nresistance_ohm = 0.2\nlimit_a = 3.0\n"
    found = scara(given)
    assert found.supply == Supply(6.5, 0.2, 3.0, True, 4.0)
    assert not any("supply:" in text for text in found.assumptions)
    assert not scara(given + "feeds_chip = false\n").supply.feeds_chip
    for hz, volts in ((4_000_000, 4.0), (4_000_001, 4.5), (20_000_000, 4.5)):
        text = (SCARA + POSES + given).replace("4_000_000", str(hz)).replace('PIC16F84"', 'PIC16F84A"')
        assert rig(text).supply.chip_minimum_v == volts


def test_a_job_without_a_robot_has_none() -> None:
    with pytest.raises(InputError, match="the twin needs a robot") as caught:
        rig((JOBS / "lab8-exercise.toml").read_text())
    assert caught.value.hint == 'add [robot] name = "…"'
