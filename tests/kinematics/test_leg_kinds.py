"""The legs of the field: against plane geometry written out here, and pinocchio where it is installed."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from servogen.errors import InputError
from servogen.kinematics.catalogue import arm, robot, robot_of
from servogen.kinematics.forward import fk_position
from servogen.kinematics.hexapod import Hexapod
from servogen.kinematics.inverse.solve import ik_all
from servogen.kinematics.inverse.unreachable import Unreachable
from servogen.kinematics.jacobian import jacobian
from servogen.kinematics.leg_kinds import LEG_KINDS
from servogen.kinematics.protocol import BodyMotion, Posture
from servogen.kinematics.serial_legs import CoxaFemurTibia, HipLift
from servogen.kinematics.stance import CircleStance
from servogen.robot.model import Arm
from servogen.toml import file as toml_file

Floats = NDArray[np.float64]
NEW = ("hip-lift", "coxa-femur-tibia")
ROBOTS = (
    "hexapod",
    "hexapod-hip-lift",
    "hexapod-coxa-femur-tibia",
    "quadruped-hip-lift",
    "quadruped-coxa-femur-tibia",
)


def by_hand(kind: str, lengths: dict[str, float], angles: list[float]) -> list[complex | float]:
    """Return where the foot is, as (x' + iy', z), with the plane of the leg as complex numbers out + i up."""
    hip, first, *second = angles
    knee = lengths["femur"] * cmath.exp(1j * first)
    foot = knee - 1j * lengths["tibia"] * cmath.exp(1j * (first + sum(second)))
    out = lengths["coxa"] + foot.real
    return [1j * out * cmath.exp(1j * hip), foot.imag]


def drawn(kind: str, chance: np.random.Generator) -> tuple[Arm, Floats]:
    """Return a random leg and one of its postures, any turn of each joint."""
    lengths = {name: float(chance.uniform(0.02, 0.15)) for name in ("coxa", "femur", "tibia")}
    joints = tuple(replace(joint, lower=-math.pi, upper=math.pi) for joint in arm(kind).joints)
    leg = replace(arm(kind).with_lengths(**lengths), joints=joints)
    return leg, chance.uniform(-math.pi, math.pi, len(joints))


@pytest.mark.parametrize("kind", NEW)
def test_forward_and_every_inverse_solution_agree_with_plane_geometry(kind: str) -> None:
    chance = np.random.default_rng(41)
    for _ in range(60):
        leg, angles = drawn(kind, chance)
        ground, height = by_hand(kind, leg.length, angles.tolist())
        assert isinstance(ground, complex)
        foot = fk_position(leg, angles)
        assert foot == pytest.approx([ground.real, ground.imag, height], abs=1e-12)
        every = ik_all(leg, foot)
        assert np.abs((every - angles + math.pi) % (2 * math.pi) - math.pi).max(axis=1).min() < 1e-6
        for each in every:
            assert fk_position(leg, each) == pytest.approx(foot, abs=1e-9)


def test_a_leg_of_three_joints_has_four_solutions_and_one_of_two_has_two() -> None:
    chance = np.random.default_rng(42)
    wide = {
        kind: replace(
            arm(kind), joints=tuple(replace(each, lower=-math.pi, upper=math.pi) for each in arm(kind).joints)
        )
        for kind in NEW
    }
    for _ in range(20):
        foot = np.array([0.03, 0.07, -0.03]) + chance.uniform(-0.01, 0.01, 3)
        assert len(ik_all(wide["coxa-femur-tibia"], foot)) == 4
        # Of the two lifts of a rigid leg at a height only one has the foot at this distance from the hip.
        on = fk_position(wide["hip-lift"], chance.uniform(-1, 1, 2))
        assert len(ik_all(wide["hip-lift"], on)) == 1
    with pytest.raises(Unreachable):
        ik_all(wide["hip-lift"], [0.0, 0.2, 0.0])


@pytest.mark.parametrize("kind", NEW)
def test_the_quick_forms_of_the_planner_are_those_of_the_rows(kind: str) -> None:
    leg = arm(kind)
    angles = np.random.default_rng(43).uniform(-1.5, 1.5, (200, len(leg.joints)))
    if kind == "hip-lift":
        quick = HipLift.of(leg.length).fk(angles[:, 0], angles[:, 1])
    else:
        three = CoxaFemurTibia.of(leg.length)
        quick = three.fk(angles)
        solved = three.solve(quick)
        assert np.nanmin(np.abs(solved - angles[:, None]).max(axis=-1), axis=-1).max() < 1e-6
        assert np.nanmax(np.abs(three.fk(solved) - quick[:, None])) < 1e-12
    assert np.abs(quick - fk_position(leg, angles)).max() < 1e-15


@pytest.mark.parametrize("kind", LEG_KINDS)
def test_the_torque_of_the_lifting_joint_is_that_of_the_jacobian(kind: str) -> None:
    """τ = Jᵀ F, by virtual work: no lever is written out."""
    leg = arm(kind)
    angles = np.random.default_rng(44).uniform(-1.2, 1.2, (50, len(leg.joints)))
    force = np.array([0.0, 0.0, 3.0, 0.0, 0.0, 0.0])
    expected = np.einsum("nij,i->nj", jacobian(leg, angles), force)[:, LEG_KINDS[kind].lifting]
    found = LEG_KINDS[kind].torque(leg.length, angles, np.full(50, 3.0))
    assert np.abs(np.abs(found) - np.abs(expected)).max() < 1e-12


@pytest.mark.parametrize("kind", LEG_KINDS)
def test_the_centre_line_begins_at_the_hip_and_ends_at_the_foot_and_its_parts_keep_their_lengths(
    kind: str,
) -> None:
    leg = arm(kind)
    angles = np.random.default_rng(45).uniform(-1, 1, (30, len(leg.joints)))
    corners = LEG_KINDS[kind].corners(leg, angles)
    assert np.abs(corners[:, 0]).max() == 0
    assert np.abs(corners[:, -1] - fk_position(leg, angles)).max() < 1e-12
    parts = np.linalg.norm(np.diff(corners, axis=1), axis=2)
    assert parts == pytest.approx(np.broadcast_to(list(leg.length.values()), parts.shape))


@pytest.mark.parametrize("name", ROBOTS)
def test_every_robot_stands_on_its_footholds_and_lifts_by_what_it_is_asked(name: str) -> None:
    found = robot(name)
    assert isinstance(found, Hexapod)
    stance = found.stance(Posture(lift=0.015), [])
    here = [stance.neutral(index, BodyMotion(0j, 0.0, 0.5)) for index in range(len(found.mounts))]
    feet, tops = [], []
    for index, foothold in enumerate(here):
        angles = stance.angles(index, np.array([foothold]))
        feet.append(stance.feet(index, angles)[0])
        tops.append(stance.feet(index, stance.lifted(index, angles, np.ones(1)))[0])
    assert [complex(x, y) for x, y, _ in feet] == pytest.approx(here)
    assert np.ptp(np.array(feet)[:, 2]) < 1e-12, "on level ground"
    assert np.array(tops)[:, 2] - np.array(feet)[:, 2] == pytest.approx(np.full(len(here), 0.015))


def test_a_rigid_leg_throws_its_foot_outwards_as_it_lifts_and_a_leg_of_three_joints_does_not() -> None:
    """40 mm out and 60 mm down, raised to 14.7 mm: sin(λ - 56.31°) = -45.3 / 72.11, hence λ = 17.39°."""
    for name, moved in (("hexapod-hip-lift", 0.01611), ("hexapod-coxa-femur-tibia", 0.0)):
        found = robot(name)
        assert isinstance(found, Hexapod)
        stance = found.stance(Posture(lift=0.0147), [])
        stands = stance.angles(1, np.array([stance.neutral(1, BodyMotion(0j, 0.0, 0.5))]))
        low, high = stance.feet(1, stands)[0], stance.feet(1, stance.lifted(1, stands, np.ones(1)))[0]
        assert high[1] - low[1] == pytest.approx(moved, abs=1e-5)


def test_three_joints_tilt_the_body_over_feet_that_stay_and_two_joints_refuse() -> None:
    found = robot("hexapod-coxa-femur-tibia")
    assert isinstance(found, Hexapod)
    level, tilted = (
        found.stance(Posture(body_height=0.09, roll=roll, pitch=pitch), [])
        for roll, pitch in ((0, 0), (0.1, -0.08))
    )
    still, heights = BodyMotion(0j, 0.0, 0.5), []
    for index in range(len(found.mounts)):
        here = np.array([level.neutral(index, still)])
        angles = tilted.angles(index, here)
        assert tilted.feet(index, angles)[0] == pytest.approx([here[0].real, here[0].imag, -0.09])
        # In the tilted body's own frame the feet are no longer on one height.
        own = found.corners(index, angles)[0, -1]
        heights.append(own[2])
        turned = math.cos(0.1) * math.cos(-0.08)
        assert own @ [math.sin(0.08), math.sin(0.1) * math.cos(0.08), turned] == pytest.approx(-0.09)
    assert np.ptp(heights) > 0.02
    for name in ("hexapod", "hexapod-hip-lift"):
        two = robot(name)
        assert isinstance(two, Hexapod)
        with pytest.raises(InputError, match="legs of two joints cannot tilt, turn or shift the body"):
            two.stance(Posture(roll=0.1), [])


@pytest.mark.parametrize("leg", ["", "pantograph", "hip-lift"])
def test_the_kind_of_leg_is_asked_for(leg: str) -> None:
    text = 'name = "my"\nkind = "hexapod"\n' + (f'leg = "{leg}"\n' if leg else "")
    text += 'mount = [{ name = "A", x_mm = 0, y_mm = 40 }]\n[lengths_mm]\ncoxa = 30\n'
    if leg == "hip-lift":
        found = robot_of(toml_file.parse(text, "my.toml"))
        assert isinstance(found, Hexapod) and found.leg.length["coxa"] == 0.03
        return
    with pytest.raises(InputError) as caught:
        robot_of(toml_file.parse(text, "my.toml"))
    if leg:
        assert "'leg' has no length 'coxa'" in caught.value.message
    else:
        assert "'leg' is missing: which kind of legs it has" in caught.value.message
        assert all(f'leg = "{name}"' in (caught.value.hint or "") for name in LEG_KINDS)


def test_a_file_states_the_limits_of_its_joints() -> None:
    text = """\
name = "my"
kind = "hexapod"
leg = "coxa-femur-tibia"
mount = [{ name = "A", x_mm = 0, y_mm = 40 }]
joint = [{ name = "femur", lower_deg = -30, upper_deg = 75 }]
"""
    found = robot_of(toml_file.parse(text, "my.toml"))
    assert isinstance(found, Hexapod)
    limits = [(math.degrees(joint.lower), math.degrees(joint.upper)) for joint in found.leg.joints]
    assert np.array(limits) == pytest.approx(np.array([(-90, 90), (-30, 75), (-90, 90)]))
    with pytest.raises(InputError, match="no joint 'femr'"):
        robot_of(toml_file.parse(text.replace('"femur"', '"femr"'), "my.toml"))


# ---- a second opinion -----------------------------------------------------------------------------------

POSES = 200
"""For each kind; `python -m tests.kinematics.against_pinocchio` compares 5000."""


@pytest.mark.parametrize("kind", NEW)
def test_pinocchio_has_the_same_foot_jacobian_and_torques(kind: str) -> None:
    pytest.importorskip("pinocchio")
    from tests.kinematics.against_pinocchio import differences

    assert max(differences(kind, POSES).values()) <= 1e-9
    assert max(differences(kind, 5, wrong=1e-6).values()) > 1e-8, "a femur that is 1 µm longer is seen"


def test_a_rigid_leg_stands_although_its_raised_foot_has_no_second_lift() -> None:
    """At 75 mm both lifts are before the hip, at 47 mm only the outer one: 67 + 6 - 81.5 mm is behind it."""
    example = robot("hexapod-hip-lift")
    assert isinstance(example, Hexapod)
    leg = example.leg.with_lengths(coxa=0.067, femur=0.032, tibia=0.083)
    stance = replace(example, leg=leg).stance(Posture(body_height=0.075, lift=0.028), [])
    assert isinstance(stance, CircleStance)
    lifts = HipLift.of(leg.length)
    assert [len(lifts.lifts_at(-height)) for height in (0.075, 0.047)] == [2, 1]
    heights = [lifts.fk(0.0, (each.lift, each.raised))[:, 2] for each in stance.legs]
    assert np.array(heights) == pytest.approx(np.tile([-0.075, -0.047], (6, 1)), abs=1e-9)
