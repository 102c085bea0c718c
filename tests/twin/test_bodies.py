"""The bodies against the kinematics and statics, which share nothing with MuJoCo; arms and the omni base."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast
from xml.etree import ElementTree as xml

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.kinematics.catalogue import arm, names, robot
from servogen.kinematics.forward import fk_position
from servogen.kinematics.hexapod import Hexapod, feet
from servogen.kinematics.statics import gravity_torques
from servogen.robot.model import Arm
from servogen.twin import Ground, TwinSettings, Variation
from servogen.twin.bodies import FOOT_RADIUS_M, bodies
from servogen.twin.causes import EventKind
from tests.campaigns import sampled
from tests.twin.walking import JOBS, firmware

mujoco = pytest.importorskip("mujoco", reason="the twin's physics needs MuJoCo: pip install 'servogen[twin]'")

ARMS = [name for name in names() if isinstance(robot(name), Arm) and name != "leg"]  # its rows: below


def loaded(text: str) -> tuple[object, object]:
    model = mujoco.MjModel.from_xml_string(text)
    return model, mujoco.MjData(model)


@pytest.mark.parametrize("name", ARMS)
def test_the_tool_of_an_arm_is_where_forward_kinematics_has_it(name: str) -> None:
    chosen, rng = arm(name), np.random.default_rng(1)
    model, data = loaded(bodies(chosen).text)
    for _ in range(5):
        low = np.array([max(joint.lower, -1.0) for joint in chosen.joints])
        high = np.array([min(joint.upper, 1.0) for joint in chosen.joints])
        data.qpos[:] = rng.uniform(low, high)
        mujoco.mj_kinematics(model, data)
        assert data.site("tool").xpos == pytest.approx(fk_position(chosen, data.qpos), abs=1e-8)


def test_a_row_that_follows_a_joint_is_a_joint_that_is_held_to_it() -> None:
    """The slider mechanism of the leg turns its foot part back by what β turns."""
    chosen = arm("leg")
    made = bodies(chosen)
    model, data = loaded(made.text)
    assert "the link that follows beta has 10 g in addition" in made.assumptions
    assert made.mass == pytest.approx(sum(model.body_mass)) == pytest.approx(0.03)
    assert [model.joint(index).name for index in range(model.njnt)] == ["alpha", "beta", "beta_3"]
    assert model.jnt_limited.tolist() == [1, 1, 0]
    for alpha, beta, off in ((0.3, 0.5, 0.0), (-0.8, -0.4, 0.0), (0.2, 0.6, 0.1)):
        data.qpos[:] = [alpha, beta, off - beta]
        mujoco.mj_forward(model, data)
        assert (data.ne, data.efc_pos[0]) == (1, pytest.approx(off))
        if not off:
            assert data.site("tool").xpos == pytest.approx(fk_position(chosen, [alpha, beta]), abs=1e-8)


def test_a_joint_that_turns_its_first_row_by_more_is_refused() -> None:
    """MuJoCo's axes have no length: the row would turn as far as the joint."""
    chosen = arm("scara")
    rows = [replace(row, ratio=-1.0) if row.joint == 0 else row for row in chosen.rows]
    bodies(replace(chosen, rows=tuple(rows)))
    rows = [replace(row, ratio=2.0) if row.joint == 0 else row for row in chosen.rows]
    with pytest.raises(InputError, match="q1 moves its first row by 2 times its position") as caught:
        bodies(replace(chosen, rows=tuple(rows)))
    assert caught.value.code == "wrong-robot-kind"


def test_a_robot_of_another_kind_is_refused_with_the_kinds_that_are_modelled() -> None:
    rails = cast(Any, SimpleNamespace(name="tram", kind="rails"))
    with pytest.raises(InputError) as caught:
        bodies(rails)
    assert str(caught.value) == (
        "servogen: error: tram is of the kind 'rails': its bodies are not modelled [wrong-robot-kind]\n"
        "  bodies are modelled for the kinds arm, hexapod, omni"
    )


@pytest.mark.parametrize("name", ["scara", "rv-m1", "anthropomorphic"])
def test_gravity_pulls_at_the_joints_as_the_statics_say(name: str) -> None:
    plain = arm(name)
    joints = tuple(
        replace(joint, mass=0.1 + 0.05 * index, centre=(-0.03, 0.01 * index, 0.02))
        for index, joint in enumerate(plain.joints)
    )
    heavy = replace(plain, joints=joints, payload=0.25)
    model, data = loaded(bodies(heavy).text)
    data.qpos[:] = [0.3, 0.4, 0.1, 0.2, -0.5][: len(joints)]
    mujoco.mj_forward(model, data)
    assert data.qfrc_bias == pytest.approx(gravity_torques(heavy, data.qpos), rel=1e-6, abs=1e-9)


def test_the_feet_of_the_hexapod_are_where_its_kinematics_has_them() -> None:
    chosen = robot("hexapod")
    assert isinstance(chosen, Hexapod)
    model, data = loaded(bodies(chosen).text)
    rng = np.random.default_rng(2)
    angles = rng.uniform(-0.8, 0.8, (6, 2))
    for mount, (alpha, beta) in zip(chosen.mounts, angles, strict=True):
        for joint, value in (("alpha", alpha), ("beta", beta), ("level", -beta)):
            data.joint(f"{mount.name}_{joint}").qpos[0] = value
    mujoco.mj_kinematics(model, data)
    seen = [data.site(f"{mount.name}_foot").xpos - [0, 0, FOOT_RADIUS_M] for mount in chosen.mounts]
    assert np.array(seen) == pytest.approx(feet(chosen, angles), abs=1e-9)


@pytest.mark.parametrize(
    "name", ["hexapod-hip-lift", "hexapod-coxa-femur-tibia", "quadruped-coxa-femur-tibia"]
)
def test_the_feet_of_the_legs_of_the_field_are_where_their_kinematics_has_them(name: str) -> None:
    chosen = robot(name)
    assert isinstance(chosen, Hexapod)
    model, data = loaded(bodies(chosen).text)
    names = [joint.name for joint in chosen.leg.joints]
    angles = np.random.default_rng(3).uniform(-0.8, 0.8, (len(chosen.mounts), len(names)))
    for mount, row in zip(chosen.mounts, angles, strict=True):
        for joint, value in zip(names, row, strict=True):
            data.joint(f"{mount.name}_{joint}").qpos[0] = value
    mujoco.mj_kinematics(model, data)
    for mount, foot in zip(chosen.mounts, feet(chosen, angles), strict=True):
        site = data.site(f"{mount.name}_foot")
        # The ball of the foot is above the tip of the tibia, along it.
        tip = site.xpos + site.xmat.reshape(3, 3) @ [0.0, 0.0, -FOOT_RADIUS_M]
        assert tip == pytest.approx(foot, abs=1e-9)
    lying, level = loaded(bodies(chosen).text)
    mujoco.mj_forward(lying, level)
    assert level.subtree_com[1] == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    assert lying.body_subtreemass[1] == pytest.approx(0.64 * len(chosen.mounts) * len(names) / 12)


def test_the_centre_of_mass_is_the_one_of_the_file() -> None:
    chosen = replace(robot("hexapod"), mass=1.2, centre_of_mass=(0.01, -0.02, 0.005))
    model, data = loaded(bodies(chosen).text)
    mujoco.mj_forward(model, data)
    assert data.subtree_com[1] == pytest.approx((0.01, -0.02, 0.005), abs=1e-9)
    assert model.body_subtreemass[1] == pytest.approx(1.2)
    turned = tuple(replace(mount, heading=0.3 * index) for index, mount in enumerate(chosen.mounts[:4]))
    model, data = loaded(bodies(replace(chosen, mounts=turned)).text)  # legs that do not balance each other
    mujoco.mj_forward(model, data)
    assert data.subtree_com[1] == pytest.approx((0.01, -0.02, 0.005), abs=1e-9)


def test_the_trunk_is_a_homogeneous_box_around_the_mounts() -> None:
    """m / 12 (a² + b²) about each axis; its sides are twice as far apart as the farthest mounts are out."""
    text = bodies(replace(robot("hexapod"), mass=1.2)).text
    (trunk,) = (each for each in xml.fromstring(text).iter("body") if each.get("name") == "body")
    inertial, box = trunk.find("inertial"), trunk.find("geom")
    assert inertial is not None and box is not None
    mass = float(inertial.get("mass", "nan"))
    x, y, z = (2 * float(each) for each in box.get("size", "").split())
    assert (x, y) == pytest.approx(
        [2 * max(abs(getattr(mount, axis)) for mount in robot("hexapod").mounts) for axis in ("x", "y")]
    )
    about = [mass / 12 * (one**2 + other**2) for one, other in ((y, z), (x, z), (x, y))]
    assert [float(each) for each in inertial.get("diaginertia", "").split()] == pytest.approx(about)


def test_legs_that_weigh_more_than_the_robot_are_refused() -> None:
    with pytest.raises(InputError, match="weigh more than its mass_g of 100"):
        bodies(replace(robot("hexapod"), mass=0.1, leg_masses=(("coxa", 0.05),)))


def test_a_spring_is_a_joint_with_the_stiffness_of_the_file() -> None:
    text = bodies(replace(robot("hexapod"), spring=500.0)).text
    springs = [each for each in xml.fromstring(text).iter("joint") if each.get("stiffness")]
    assert len(springs) == 6 and {each.get("stiffness") for each in springs} == {"500"}
    assert "rigid" not in " ".join(bodies(replace(robot("hexapod"), spring=500.0)).assumptions)


@pytest.mark.campaign
def test_omni_square_closes_and_stays_on_its_way() -> None:
    verdict = firmware((JOBS / "omni-square.toml").read_text()).twin()
    record, rigid = verdict.record, verdict.planned.rigid
    assert rigid is not None and math.hypot(*verdict.done[:2]) < 0.003
    assert abs(math.degrees(verdict.done[2])) < 0.5
    frames = ((record.time[record.first :] - record.motion[0]) / verdict.planned.frame_s).astype(int)
    away = record.pose[record.first :, :2] - record.pose[record.first, :2] - rigid[frames + 1, :2]
    assert np.linalg.norm(away, axis=1).max() < 0.010
    assert np.ptp(record.pose[:, 0]) == pytest.approx(0.3, abs=0.003)


def test_a_base_on_a_step_is_refused() -> None:
    with pytest.raises(InputError, match="on a plane only"):
        bodies(robot("omni"), ground=Ground(step=0.01))


@pytest.mark.campaign
@pytest.mark.parametrize(("name", "within"), sampled([("scara-pick", 0.008), ("rvm1-program", 0.008)]))
def test_the_tool_of_an_arm_rests_where_it_should(name: str, within: float) -> None:
    """2 µs of dead band are 0.36° of an S3001 over gears and 0.7 m of reach: 7 mm at the SCARA's tool."""
    made = firmware((JOBS / f"{name}.toml").read_text())
    empty = made.twin(TwinSettings(seconds=8.0))
    assert empty.tool_rest_error is not None and empty.tool_rest_error < within
    assert empty.events == ()


def test_an_arm_whose_pulses_end_has_no_path_to_compare_its_tool_with() -> None:
    text = (JOBS / "scara-pick.toml").read_text().partition("poses = [")[0]
    poses = ", ".join(
        f"{{ tip_mm = [500, 200, {z}], orientation_deg = [0], hold_s = 0.1 }}" for z in (450, 440)
    )
    made = firmware(f'{text}repeat = false\nend = "release"\nposes = [{poses}]\n')
    seen = made.twin(TwinSettings(seconds=0.5))
    assert np.isnan(made.job.trajectory.angles[-1]).all()
    assert seen.record.tool.shape[1] == 3
    assert (seen.tool_error, seen.tool_rest_error) == (None, None)


@pytest.mark.campaign
def test_a_payload_bends_an_arm_and_too_much_of_it_is_the_first_cause() -> None:
    made = firmware((JOBS / "rvm1-program.toml").read_text())
    light, heavy = (
        made.twin(TwinSettings(variation=Variation(payload=mass), seconds=8.0)) for mass in (0.02, 0.4)
    )
    assert light.tool_rest_error is not None and heavy.tool_rest_error is not None
    assert heavy.tool_rest_error > 2 * light.tool_rest_error
    assert light.events == ()
    assert heavy.cause is not None and heavy.cause.kind == EventKind.SATURATED


@pytest.mark.parametrize("name", ["hexapod", "hexapod-hip-lift"])
def test_legs_touch_other_legs_but_neither_themselves_nor_the_body(name: str) -> None:
    chosen = robot(name)
    assert isinstance(chosen, Hexapod)
    model, data = loaded(bodies(chosen).text)
    turn = chosen.leg.joints[0].name

    def touching() -> set[frozenset[str]]:
        mujoco.mj_forward(model, data)
        names = [
            [model.body(model.geom_bodyid[geom]).name[:2] for geom in each.geom] for each in data.contact
        ]
        return {frozenset(pair) for pair in names if "wo" not in pair}

    data.qpos[2] = 1.0  # off the ground
    assert touching() == set()
    data.joint(f"L1_{turn}").qpos[0] = 1.2
    data.joint(f"L2_{turn}").qpos[0] = -1.2
    assert touching() == {frozenset({"L1", "L2"})}
