"""The elements of a model for MuJoCo, as XML: what a servo adds to its joint, the ground, rods."""

from __future__ import annotations

import math
from dataclasses import replace
from xml.etree import ElementTree as xml

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.kinematics.catalogue import arm, robot
from servogen.kinematics.hexapod import Hexapod
from servogen.twin.bodies import bodies
from servogen.twin.ground import ROUGH_CELL_M, ROUGH_HALF_M, Ground
from servogen.twin.mjcf import Actuator, Scene, Variation, add_actuators, add_joint, add_rod, document


def values(element: xml.Element | None, key: str) -> list[float]:
    assert element is not None
    return [float(value) for value in element.get(key, "").split()]


def joints_of(servo: Actuator | None, lower: float = -1.0, upper: float = 2.0) -> list[xml.Element]:
    """Return the joint "elbow" with this servo, and its play if there is one."""
    root, world = document("test", Ground())
    scene = Scene(root, world, Ground(), () if servo is None else (servo,))
    add_joint(scene, world, "elbow", (0.0, 0.0, -1.0), lower, upper)
    return world.findall("joint")


def test_the_servo_of_a_joint_brings_its_inertia_friction_stops_and_play() -> None:
    """Through a gear of ratio -3: inertia times 9, friction times 3, and a third of the play."""
    servo = Actuator("s", "elbow", -3.0, -0.5, 5.0, friction=0.02, armature=4e-5, backlash=0.06)
    joint, play = joints_of(servo)
    assert (joint.get("name"), joint.get("type"), values(joint, "axis")) == ("elbow", "hinge", [0, 0, -1])
    assert values(joint, "armature") == pytest.approx([9 * 4e-5])
    assert values(joint, "frictionloss") == pytest.approx([3 * 0.02])
    assert values(joint, "range") == [-0.5, 2.0]  # the servo's stop below, the joint's above
    assert (play.get("name"), play.get("type"), values(play, "axis")) == ("elbow_play", "hinge", [0, 0, -1])
    assert values(play, "range") == pytest.approx([-0.01, 0.01])


def test_a_joint_without_a_servo_or_with_an_ideal_one_has_its_limits_only() -> None:
    ideal = Actuator("s", "elbow", 1.0, -math.inf, math.inf)
    for servo in (None, ideal, Actuator("s", "other", 1.0, -0.1, 0.1, 0.02, 4e-5, 0.06)):
        (joint,) = joints_of(servo)
        assert values(joint, "range") == [-1.0, 2.0]
        assert joint.get("armature") is None and joint.get("frictionloss") is None
    (endless,) = joints_of(ideal, 1.0, 0.0)
    assert endless.get("range") is None


def test_each_servo_is_an_actuator_with_its_ratio_as_gear() -> None:
    root, world = document("test", Ground())
    add_actuators(Scene(root, world, Ground()))
    assert root.find("actuator") is None
    servos = (Actuator("a", "one", 2.0, 0.0, 1.0), Actuator("b", "two", -0.5, 0.0, 1.0))
    scene = Scene(root, world, Ground(), servos)
    add_actuators(scene)
    rows = root.findall("actuator/general")
    assert [(row.get("name"), row.get("joint"), values(row, "gear")) for row in rows] == [
        ("a", "one", [2.0]),
        ("b", "two", [-0.5]),
    ]
    assert scene.joint_actuator("two") == servos[1] and scene.joint_actuator("three") is None


def test_gravity_points_down_the_slope() -> None:
    """Up the slope is +x: of g, g sin φ pulls towards -x."""
    root, _ = document("test", Ground(slope=math.radians(30)), 0.0005)
    option = root.find("option")
    assert values(option, "gravity") == pytest.approx([-9.80665 / 2, 0, -9.80665 * math.sqrt(3) / 2])
    assert values(option, "timestep") == [0.0005]
    assert values(document("test", Ground())[0].find("option"), "timestep") == [0.001]


def test_a_step_rises_to_its_height_from_its_place_on() -> None:
    root, _ = document("test", Ground(step=0.03, step_at=0.2))
    ground, step = root.findall("worldbody/geom")
    centre, half = values(step, "pos"), values(step, "size")
    assert (ground.get("type"), step.get("type")) == ("plane", "box")
    assert centre[0] - half[0] == pytest.approx(0.2)
    assert centre[2] + half[2] == pytest.approx(0.03)
    assert centre[2] - half[2] < -0.5 and centre[1] == 0
    assert len(document("test", Ground())[0].findall("worldbody/geom")) == 1


def test_rough_ground_is_a_square_of_heights_up_to_its_roughness() -> None:
    rough = Ground(rough=0.02, seed=3)
    root, _ = document("test", rough)
    field = root.find("asset/hfield")
    assert field is not None
    count = round(2 * ROUGH_HALF_M / ROUGH_CELL_M) + 1
    assert (field.get("nrow"), field.get("ncol")) == (str(count), str(count))
    assert values(field, "size") == pytest.approx([ROUGH_HALF_M, ROUGH_HALF_M, 0.02, 0.1])
    shares = np.array(values(field, "elevation"))  # of the height in `size`
    assert shares == pytest.approx(rough.heights().ravel() / 0.02, abs=1e-6)
    assert 0 <= shares.min() < 0.01 and 0.99 < shares.max() <= 1
    assert rough.level == 0.01 and Ground().level == 0


def test_a_rod_that_is_shorter_than_it_is_thick_is_a_ball_in_its_middle() -> None:
    body = xml.Element("body")
    add_rod(body, (0.0, 0.01, 0.0), (0.0, 0.05, 0.02), 0.3)
    add_rod(body, (0.01, 0.0, 0.002), (0.021, 0.0, 0.002), 0.2)
    rod, ball = body.findall("geom")
    assert (rod.get("type"), values(rod, "fromto")) == ("capsule", [0, 0.01, 0, 0, 0.05, 0.02])
    assert (ball.get("type"), values(ball, "pos")) == ("sphere", pytest.approx([0.0155, 0, 0.002]))
    assert (values(rod, "mass"), values(ball, "mass")) == ([0.3], [0.2])
    for part in (rod, ball):
        assert values(part, "size") == [0.006] and part.get("contype") == part.get("conaffinity") == "0"


def test_what_the_bodies_of_a_hexapod_assume_is_said() -> None:
    """Its file states no mass: 0.64 kg, of which a coxa has 3 %, thigh and foot 1 % each."""
    found = bodies(robot("hexapod"))
    assert found.mass == 0.64
    assert found.assumptions == (
        "mass of the robot: 0.64 kg (its file states no mass_g)",
        "masses of each leg: coxa 19.2 g, thigh 6.4 g, foot 6.4 g "
        "(its file does not state them in leg_mass_g)",
        "springs E': rigid (the robot's file states no spring_n_m)",
        "the body is a homogeneous box around the mounts, links are rods",
    )
    text = xml.fromstring(found.text)
    rods = [values(each, "mass")[0] for each in text.iter("geom") if each.get("type") in ("capsule",)]
    assert sorted({round(mass, 6) for mass in rods}) == [0.0064, 0.0192] and len(rods) == 18
    trunk = next(each for each in text.iter("body") if each.get("name") == "body").find("inertial")
    assert values(trunk, "mass") == pytest.approx([0.64 - 6 * 0.032])
    box = next(each for each in text.iter("geom") if each.get("name") == "body")
    assert values(box, "size")[2] == 0.015  # half of the body's height, to which it lies on the ground


def test_a_hexapod_that_states_all_is_built_of_it() -> None:
    chosen = robot("hexapod")
    assert isinstance(chosen, Hexapod)
    parts = (("coxa", 0.02), ("thigh", 0.006), ("foot", 0.004))
    stated = replace(chosen, mass=1.0, leg_masses=parts, spring=400.0)
    found = bodies(stated, ground=Ground(0.5), variation=Variation((0.6, 1, 1, 1, 1, 2.0), (0.01, -0.02)))
    assert found.assumptions == ("the body is a homogeneous box around the mounts, links are rods",)
    text = xml.fromstring(found.text)
    tips = [each for each in text.iter("geom") if (each.get("name") or "").endswith("_tip")]
    assert [values(tip, "friction")[0] for tip in tips] == pytest.approx([0.3, 0.5, 0.5, 0.5, 0.5, 1.0])
    spring = next(each for each in text.iter("joint") if each.get("stiffness"))
    assert values(spring, "damping") == pytest.approx([math.sqrt(400.0 * 0.004)])  # half of 2 √(k m)
    plain = xml.fromstring(bodies(stated, ground=Ground(0.5)).text)
    centres = [
        values(next(each for each in one.iter("body") if each.get("name") == "body").find("inertial"), "pos")
        for one in (plain, text)
    ]
    assert np.subtract(centres[1], centres[0]) == pytest.approx([0.01, -0.02, 0], abs=1e-8)
    leg = chosen.leg.length
    assert values(next(text.iter("site")), "pos") == pytest.approx([0, 0, -leg["df"] + 0.003])
    assert 0.003 < values(next(text.iter("site")), "size")[0] < 0.02  # it contains the tip and no more
    levels = [each.attrib for each in text.findall("equality/joint")]
    assert [(each["joint1"], each["joint2"], each["polycoef"]) for each in levels] == [
        (f"{mount.name}_level", f"{mount.name}_beta", "0 -1 0 0 0") for mount in chosen.mounts
    ]
    touched = [each.get("site") for each in text.findall("sensor/touch")]
    assert touched == [f"{mount.name}_foot" for mount in chosen.mounts]


def test_a_robot_of_too_few_legs_is_held_at_its_height() -> None:
    chosen = robot("hexapod")
    assert isinstance(chosen, Hexapod)
    found = bodies(chosen.with_leg("L1"), held_at=0.1234)
    assert "the body is held at 123.4 mm: it has too few legs to stand" in found.assumptions
    text = xml.fromstring(found.text)
    body = next(each for each in text.iter("body") if each.get("name") == "body")
    assert values(body, "pos") == [0, 0, 0.1234] and text.find(".//freejoint") is None
    for legs in (3, 6):
        assert (
            xml.fromstring(bodies(replace(chosen, mounts=chosen.mounts[:legs])).text).find(".//freejoint")
            is not None
        )


def test_joints_of_an_arm_without_a_servo_are_held_at_home_if_others_have_one() -> None:
    chosen = arm("scara")
    servo = Actuator("s", "q1", 1.0, -1.0, 1.0)
    assert bodies(chosen).assumptions == ("links of q1, q2, q3, q4: 10 g each (without mass_g)",)
    found = bodies(chosen, (servo,))
    assert found.assumptions[1:] == tuple(
        f"{name} has no servo and is held at its home position" for name in ("q2", "q3", "q4")
    )
    held = xml.fromstring(found.text).findall("equality/joint")
    homes = {joint.name: joint.home for joint in chosen.joints}
    assert [each.get("joint1") for each in held] == ["q2", "q3", "q4"]
    assert [values(each, "polycoef") for each in held] == [
        pytest.approx([homes[name], 0, 0, 0, 0]) for name in ("q2", "q3", "q4")
    ]


def test_the_mass_of_an_arm_is_that_of_its_links_and_of_what_it_carries() -> None:
    plain = arm("scara")
    joints = tuple(
        replace(joint, mass=mass) for joint, mass in zip(plain.joints, (0.3, 0.0, 0.2, 0.0), strict=True)
    )
    chosen = replace(plain, joints=joints, payload=0.05)
    found = bodies(chosen)
    assert found.assumptions == ("links of q2, q4: 10 g each (without mass_g)",)
    assert found.mass == pytest.approx(0.3 + 0.01 + 0.2 + 0.01 + 0.05)
    assert bodies(chosen, variation=Variation(payload=0.4)).mass == pytest.approx(0.52 + 0.4)
    empty = bodies(chosen, variation=Variation(payload=0.0))
    assert empty.mass == pytest.approx(0.52) and 'name="payload"' not in empty.text


def test_a_base_on_wheels_is_a_disc_with_a_twentieth_of_its_mass_in_each_wheel() -> None:
    """The disc's inertia is m l²/2 about its axis and a quarter about a diameter."""
    chosen = replace(robot("omni"), mass=2.0)
    found = bodies(chosen, ground=Ground(0.6))
    assert found.mass == 2.0 and len(found.assumptions) == 1
    assert bodies(robot("omni")).assumptions[0] == "mass of the robot: 1 kg (its file states no mass_g)"
    text = xml.fromstring(found.text)
    body = next(each for each in text.iter("body") if each.get("name") == "body")
    out, radius = chosen.wheel_distance, chosen.wheel_radius
    inertial = body.find("inertial")
    assert values(body, "pos") == pytest.approx([0, 0, radius])
    assert values(inertial, "mass") == pytest.approx([1.7])
    assert values(inertial, "diaginertia") == pytest.approx([1.7 * out**2 / n for n in (4, 4, 2)])
    for hub, degrees in zip(body.findall("body"), (60, 300, 180), strict=True):
        along = [math.cos(math.radians(degrees)), math.sin(math.radians(degrees)), 0]
        joint, geom = hub.find("joint"), hub.find("geom")
        assert values(hub, "pos") == pytest.approx([out * part for part in along], abs=1e-9)
        assert values(joint, "axis") == pytest.approx(along, abs=1e-9) and joint.get("range") is None
        half = [0.002 * part for part in along]
        assert values(geom, "fromto") == pytest.approx([*(-part for part in half), *half], abs=1e-9)
        assert (values(geom, "size"), values(geom, "mass")) == ([radius], pytest.approx([0.1]))
    pairs = text.findall("contact/pair")
    assert [pair.get("geom2") for pair in pairs] == ["wheel1", "wheel2", "wheel3"]
    assert all(values(pair, "friction")[:2] == [0.001, 0.6] for pair in pairs)
    with pytest.raises(InputError, match="on a plane only"):
        bodies(chosen, ground=Ground(rough=0.01))
