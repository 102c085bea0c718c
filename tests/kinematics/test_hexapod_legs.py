"""Legs of a walking robot, each quantity by a formula of its own: stances, footholds, files, facts."""

from __future__ import annotations

import cmath
import math
import re
from dataclasses import replace

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.kinematics import hexapod as h
from servogen.kinematics.catalogue import arm, robot, robot_of
from servogen.kinematics.hexapod import HEXAPOD, Hexapod
from servogen.kinematics.inverse.unreachable import Unreachable
from servogen.kinematics.leg import Leg
from servogen.kinematics.protocol import BodyMotion, Posture
from servogen.kinematics.registry import KINDS
from servogen.kinematics.stance import LegStance, least_bent
from servogen.kinematics.transforms import to_body, to_leg
from servogen.robot.model import Joint, Mount
from servogen.toml import file as toml_file

LENGTHS = {"ab": 0.02, "bc": 0.05, "cd": 0.03, "df": 0.07}
LEG = Leg.of(LENGTHS)  # r 50 mm; the foot from 120 mm (β = 0) to 20 mm (β = π) below the body's joints
ALPHA = Joint("alpha", "turning", -1.0, 1.2, 0.0)


def made(*mounts: Mount) -> Hexapod:
    found = robot("hexapod")
    assert isinstance(found, Hexapod)
    return replace(found, leg=found.leg.with_lengths(**LENGTHS), mounts=mounts or found.mounts)


LEFT, RIGHT = Mount("L", 0.1, 0.04, 0.0, 0.3), Mount("R", -0.05, -0.06, 0.0, -0.2, mirrored=True)


def stance_of(mount: Mount, beta: float = 0.6) -> LegStance:
    return LegStance(mount, LEG, ALPHA, beta)


# ---- the leg itself -------------------------------------------------------------------------------------


@pytest.mark.parametrize("beta", [0.0, 0.7, -1.1, math.pi / 2])
def test_the_foot_is_at_rho_from_the_axis_of_alpha(beta: float) -> None:
    stance = stance_of(LEFT, beta)
    x, y, _ = LEG.fk(0.4, beta)
    assert stance.radius == pytest.approx(math.hypot(x, y))
    assert stance.axis == 0.1 + 0.04j


@pytest.mark.parametrize(("mount", "out"), [(LEFT, (0.0, 1.0)), (RIGHT, (0.0, 1.0))])
def test_outward_is_where_the_leg_s_y_axis_points_in_the_body(mount: Mount, out: tuple[float, float]) -> None:
    heading, side = mount.heading, -1 if mount.mirrored else 1
    x, y = out[0], side * out[1]
    expected = complex(
        math.cos(heading) * x - math.sin(heading) * y, math.sin(heading) * x + math.cos(heading) * y
    )
    assert stance_of(mount).outward == pytest.approx(expected)


@pytest.mark.parametrize("mount", [LEFT, RIGHT])
@pytest.mark.parametrize("centre", [0j, 0.4 + 0.3j, -0.4 - 0.3j, 0.02 + 0.01j])
def test_a_foot_stands_on_the_line_from_the_centre_of_rotation_through_the_axis(
    mount: Mount, centre: complex
) -> None:
    turn = 0.1
    motion = BodyMotion(centre * turn / 1j, turn, 0.5)
    assert motion.centre == pytest.approx(centre)
    stance = stance_of(mount)
    unit = stance.direction(motion)
    away = stance.axis - centre
    assert abs(unit) == pytest.approx(1)
    assert (unit * away.conjugate()).imag == pytest.approx(0, abs=1e-15)  # along the line
    assert (unit * stance.outward.conjugate()).real > 0  # and out of the body
    # α turns the foot from where α = 0 has it, on either side, to that line
    alpha = stance.bend(motion) + (ALPHA.lower + ALPHA.upper) / 2
    foot = to_body(mount, LEG.fk(alpha, stance.lift))
    assert complex(foot[0], foot[1]) == pytest.approx(stance.axis + stance.radius * unit)


@pytest.mark.parametrize("away", [0j, 0.9e-9 + 0j])
def test_a_leg_above_the_centre_of_rotation_stands_straight_out(away: complex) -> None:
    centre = LEFT.x + 1j * LEFT.y + away
    stance = stance_of(LEFT)
    assert stance.direction(BodyMotion(centre * 0.1 / 1j, 0.1, 0.5)) == stance.outward
    assert stance.direction(BodyMotion(0j, 0.0, 0.5)) == stance.outward
    beside = BodyMotion((centre + 1e-6) * 0.1 / 1j, 0.1, 0.5)
    assert abs(stance.direction(beside) - stance.outward) > 0.1


@pytest.mark.parametrize("mount", [LEFT, RIGHT])
@pytest.mark.parametrize("step", [0.04 + 0j, -0.04 + 0j, 0.03 + 0.02j])
def test_a_foot_of_a_straight_walk_stands_as_in_a_turn_about_a_centre_far_away(
    mount: Mount, step: complex
) -> None:
    straight, turning = BodyMotion(step, 0.0, 0.6), BodyMotion(step, 1e-7, 0.6)
    for width in (3.0, 0.3, 0.01):
        stance = LegStance(mount, LEG, replace(ALPHA, lower=0.1 - width, upper=0.1 + width), 0.6)
        assert stance.direction(straight) == pytest.approx(stance.direction(turning), abs=1e-6)
        assert stance.foothold(straight, 0.055) == pytest.approx(stance.foothold(turning, 0.055), abs=1e-6)
    across = (stance.direction(straight) * step.conjugate()).real
    assert across == pytest.approx(0, abs=1e-15)


@pytest.mark.parametrize("mount", [LEFT, RIGHT])
@pytest.mark.parametrize("beyond", [0.0, 0.1])
def test_limits_hold_a_foot_back_by_what_the_sweep_of_a_stance_leaves_of_them(
    mount: Mount, beyond: float
) -> None:
    """The foot at `reach` turns by a known angle about the axis of α: measured here with plane geometry."""
    duty, turn, reach = 0.6, 0.5, 0.055
    motion = BodyMotion(0.02 + 0j, turn, duty, beyond)
    centre = motion.centre or 0j
    for width in (3.0, 0.6, 0.35, 0.01):
        joint = replace(ALPHA, lower=0.1 - width, upper=0.1 + width)
        stance = LegStance(mount, LEG, joint, 0.6)
        foot = stance.axis + reach * stance.direction(motion)
        ends = [centre + (foot - centre) * cmath.exp(1j * sign * turn * duty / 2) for sign in (1, -1)]
        arms = [end - stance.axis for end in ends]
        cosine = (arms[0] * arms[1].conjugate()).real / abs(arms[0]) / abs(arms[1])
        sweep = math.acos(cosine)
        free = max(width - sweep * (0.5 + 0.15 * (1 - duty) / duty + beyond), 0.0)
        bend = stance.bend(motion)
        expected = math.copysign(max(abs(bend) - free, 0.0), bend)
        assert stance.held_back(motion, reach) == pytest.approx(expected, abs=1e-9)
        # what is left of the bend after the foothold is turned back is within what is free
        hold = stance.foothold(motion, reach) - stance.axis
        assert abs(hold) == pytest.approx(reach)
        turned = cmath.phase(hold / stance.direction(motion)) * (-1 if mount.mirrored else 1)
        assert bend + turned == pytest.approx(bend - expected, abs=1e-9)
    assert stance.held_back(BodyMotion(0j, 0.0, duty), reach) == 0.0


def test_of_two_stances_the_one_that_bends_less_is_taken_and_the_first_of_equal_ones() -> None:
    motions = [BodyMotion(0.0, 0.3, 0.5), BodyMotion(0.02, -0.2, 0.5), BodyMotion(0.5, 0.0, 0.5)]
    both = [stance_of(LEFT, sign * 0.6) for sign in (1, -1)]
    worst = [max(abs(stance.bend(motion)) for motion in motions) for stance in both]
    assert abs(worst[0] - worst[1]) > 0.1
    best = both[0] if worst[0] < worst[1] else both[1]
    assert least_bent(both, motions) is best
    assert least_bent(both[::-1], motions) is best
    even = replace(ALPHA, lower=-1.1, upper=1.1)
    ahead = [LegStance(Mount("S", 0.1, 0.04), LEG, even, sign * 0.6) for sign in (1, -1)]
    straight = [BodyMotion(0.05 + 0j, 0.0, 0.5)]  # α bends alike: the asked sign
    assert least_bent(ahead, straight) is ahead[0]
    assert least_bent(ahead[::-1], straight) is ahead[1]
    nearly = [both[1], replace(both[1], lift=both[1].lift + 1e-10)]
    assert least_bent(nearly, motions) is nearly[0]
    assert least_bent(nearly[::-1], motions) is nearly[1]


# ---- the stance of the whole robot ----------------------------------------------------------------------


def test_a_robot_stands_as_high_as_it_is_asked_to_or_as_its_legs_reach() -> None:
    low = made().stance(Posture(body_height=0.1, lift=0.03), [])
    for index in range(6):
        angles = low.angles(index, np.array([0.2 + 0.1j]))
        assert low.feet(index, angles)[0, 2] == pytest.approx(-0.1)
        lifted = low.lifted(index, angles, np.array([1.0]))
        assert low.feet(index, lifted)[0, 2] == pytest.approx(-0.07)
        half = low.lifted(index, angles, np.array([0.5]))
        assert half[0, 1] == pytest.approx((angles[0, 1] + lifted[0, 1]) / 2)
        assert half[0, 0] == angles[0, 0]
    tall = made().stance(Posture(), [])
    assert [leg.lift for leg in tall.legs] == [0.0] * 6
    assert tall.feet(0, tall.angles(0, np.array([1j])))[0, 2] == pytest.approx(-0.12)
    # cos β at the top of the swing of 20 mm is (100 - 70)/50
    assert tall.legs[0].raised == pytest.approx(math.acos(0.6))


def test_mounts_above_the_body_s_origin_make_the_legs_stand_less_bent() -> None:
    raised = made(replace(LEFT, z=0.01))
    assert raised.stance(Posture(body_height=0.1), []).legs[0].lift == pytest.approx(math.acos(0.8))
    both = made(LEFT, replace(RIGHT, z=0.01)).stance(Posture(), [])
    assert [leg.lift for leg in both.legs] == pytest.approx([math.acos(0.8), 0.0]), "the lower one reaches"
    for index in (0, 1):
        assert both.feet(index, both.angles(index, np.array([0.1 + 0.1j])))[0, 2] == pytest.approx(-0.11)


@pytest.mark.parametrize("sign", [1, -1])
def test_the_asked_sign_of_beta_is_that_of_all_legs_of_a_straight_walk(sign: int) -> None:
    stance = made().stance(Posture(0.1, beta_sign=sign), [BodyMotion(0.04, 0.0, 0.5)])
    assert {math.copysign(1, leg.lift) for leg in stance.legs} == {sign}
    top = stance.lifted(0, np.array([[0.0, stance.legs[0].lift]]), np.ones(1))
    assert math.copysign(1, top[0, 1]) == sign


# The legs reach 120 to 20 mm; a foot may be at its lowest and at its highest point up to rounding.
@pytest.mark.parametrize(
    ("posture", "refusal"),
    [
        (Posture(0.12), None),
        (Posture(0.12 + 0.9e-9), None),
        (Posture(0.12 + 1e-6), "the legs cannot stand 120.001 mm high and lift their feet by 20 mm"),
        (Posture(0.12, lift=0.0999), None),
        *((Posture(stands / 1000, lift=(stands - 20) / 1000), None) for stands in range(21, 121)),
        (Posture(0.12, lift=0.101), "the legs cannot stand 120 mm high and lift their feet by 101 mm"),
        (Posture(0.03, lift=0.011), "the legs cannot stand 30 mm high and lift their feet by 11 mm"),
        (Posture(lift=0.0), "a lift of 0 mm does not take the foot off the ground"),
        (Posture(lift=-0.005), "a lift of -5 mm does not take the foot off the ground"),
    ],
)
def test_a_posture_beyond_the_legs_is_refused(posture: Posture, refusal: str | None) -> None:
    if refusal is None:
        assert made().stance(posture, []).legs
        return
    with pytest.raises(InputError, match=re.escape(refusal)) as caught:
        made().stance(posture, [])
    if "cannot" in refusal:
        assert caught.value.hint == "their feet are 20 to 120 mm below the body's joints"


def test_neutral_of_a_straight_walk_is_inside_the_circle_by_a_sixteenth_of_the_square_of_the_stance() -> None:
    motion = BodyMotion(0.04 + 0j, 0.0, 0.75)
    stance = made(LEFT, RIGHT).stance(Posture(0.1), [motion])
    rho = math.hypot(0.05, 0.05 * math.sin(stance.legs[0].lift))
    out = rho - 0.03**2 / (16 * rho)
    for index, leg in enumerate(stance.legs):
        across = -1j if leg.mount.mirrored else 1j
        assert stance.neutral(index, motion) == pytest.approx(leg.axis + out * across)
        assert stance.held_back(index, motion) == 0.0


def test_a_stance_width_sets_the_distance_of_the_feet_from_the_axis() -> None:
    motion = BodyMotion(0.04 + 0j, 0.0, 0.75)
    stance = made(LEFT, RIGHT).stance(Posture(0.1, stance_width=0.22), [motion])
    for index, y in ((0, 0.11), (1, -0.11)):
        assert stance.neutral(index, motion).imag == pytest.approx(y)
    turning = BodyMotion(0j, 0.2, 0.75)
    for index, leg in enumerate(stance.legs):
        reach = (0.11 - abs(leg.mount.y)) / math.cos(leg.mount.heading)
        assert abs(stance.neutral(index, turning) - leg.axis) == pytest.approx(reach)
        assert stance.held_back(index, turning) == pytest.approx(abs(leg.held_back(turning, reach)))


def test_alpha_turns_a_foot_towards_its_foothold_on_both_sides() -> None:
    stance = made(LEFT, RIGHT).stance(Posture(0.1), [])
    for index, leg in enumerate(stance.legs):
        wanted = leg.axis + np.array([0.09, 0.08, 0.07]) * leg.outward * np.exp(
            1j * np.array([-0.3, 0.0, 0.4])
        )
        feet = stance.feet(index, stance.angles(index, wanted))
        away = feet[:, 0] + 1j * feet[:, 1] - leg.axis
        assert np.abs(away) == pytest.approx(np.full(3, leg.radius))
        assert np.angle(away / (wanted - leg.axis)) == pytest.approx(np.zeros(3), abs=1e-12)


def test_feet_and_angles_of_a_robot_with_turned_mounts_are_inverse() -> None:
    found = made(LEFT, RIGHT)
    angles = np.random.default_rng(5).uniform(-1, 1, (7, 2, 2))
    feet = h.feet(found, angles)
    assert feet.shape == (7, 2, 3)
    both = np.stack(
        [LEG.ik(to_leg(mount, feet[:, index])) for index, mount in enumerate((LEFT, RIGHT))], axis=1
    )
    assert np.abs(both - angles[:, :, None, :]).max(axis=-1).min(axis=-1).max() < 1e-6
    with pytest.raises(Unreachable):
        LEG.ik(to_leg(LEFT, feet[:, 0] + np.array([0.0, 0.0, 0.2])))


def test_the_torque_at_beta_is_the_force_times_its_lever() -> None:
    """A vertical force at the foot has the lever bc sin β about the axis of β."""
    angles = np.array([[[0.3, 0.5], [0.1, -0.5]]])
    torques = made(LEFT, RIGHT).torques(angles, np.array([[4.0, 8.0]]))
    assert torques == pytest.approx(np.array([[0.2, 0.4]]) * math.sin(0.5))


def test_a_hexapod_names_its_parts() -> None:
    found = made()
    assert (found.lifting_joint, found.sidesteps) == ("beta", False)
    assert [limb.name for limb in found.limbs] == ["L1", "L2", "L3", "R1", "R2", "R3"]
    assert {limb.end for limb in found.limbs} == {"foot"}
    assert found.with_leg("L2").mounts == (found.mounts[1],)
    with pytest.raises(InputError, match="no leg 'L9'"):
        found.with_leg("L9")


# ---- its file and its facts -----------------------------------------------------------------------------

FILE = """\
name = "bug"
kind = "hexapod"
leg = "pantograph"
lengths_mm = { ab = 15, bc = 30, cd = 25, df = 45 }
centre_of_mass_mm = [4, -6, 10]
mass_g = 850
leg_mass_g = { coxa = 12, foot = 8 }
spring_n_m = 400
mount = [
    { name = "A", x_mm = 60, y_mm = 35, z_mm = 12, heading_deg = 30 },
    { name = "B", x_mm = -60, y_mm = -35, z_mm = 12, mirrored = true },
]
"""


def read(text: str) -> Hexapod:
    found = robot_of(toml_file.parse(text, "bug.toml"))
    assert isinstance(found, Hexapod)
    return found


def test_a_file_gives_a_hexapod_its_values_in_metres_kilograms_and_radians() -> None:
    bug = read(FILE)
    first, second = bug.mounts
    assert (first.x, first.y, first.z, first.heading) == pytest.approx((0.06, 0.035, 0.012, math.pi / 6))
    assert (second.x, second.y, second.heading, second.mirrored) == (-0.06, -0.035, 0.0, True)
    assert bug.centre_of_mass == pytest.approx((0.004, -0.006, 0.01))
    assert (bug.mass, bug.spring) == (pytest.approx(0.85), 400)
    assert dict(bug.leg_masses) == pytest.approx({"coxa": 0.012, "foot": 0.008})
    assert bug.leg.length == pytest.approx({"ab": 0.015, "bc": 0.03, "cd": 0.025, "df": 0.045})


@pytest.mark.parametrize("line", ["mass_g", "leg_mass_g", "spring_n_m", "centre_of_mass_mm"])
def test_what_a_file_does_not_state_is_not_known(line: str) -> None:
    bare = read("".join(row for row in FILE.splitlines(keepends=True) if not row.startswith(line)))
    expected = {
        "mass_g": bare.mass is None,
        "leg_mass_g": bare.leg_masses == (),
        "spring_n_m": bare.spring is None,
    }
    expected["centre_of_mass_mm"] = bare.centre_of_mass == (0.0, 0.0, 0.0)
    assert [key for key, missing in expected.items() if missing] == [line]


def test_a_hexapod_like_the_catalogue_s_has_its_legs_and_mounts() -> None:
    found = read(
        'name = "mine"\nkind = "hexapod"\nlike = "hexapod"\nlengths_mm = { bc = 33 }\nmass_g = 500\n'
    )
    model = made()
    assert [mount.name for mount in found.mounts] == [mount.name for mount in model.mounts]
    assert found.leg.length == arm("leg").length | {"bc": 0.033}
    assert (found.mass, found.spring) == (0.5, None)


def test_a_hexapod_like_another_has_all_of_it_but_what_its_file_states() -> None:
    model = read(f'title = "Bug"\nsource = "a page"\ndimensions = "manufacturer"\n{FILE}')

    def like(text: str) -> Hexapod:
        document = toml_file.parse(f'name = "mine"\nkind = "hexapod"\nlike = "bug"\n{text}', "mine.toml")
        found = HEXAPOD.read(document, toml_file.validate(document, HEXAPOD.table), lambda name: model)
        assert isinstance(found, Hexapod)
        return found

    assert like("") == replace(model, name="mine")
    for text, changes in (
        ("centre_of_mass_mm = [1, 2, 3]", {"centre_of_mass": (0.001, 0.002, 0.003)}),
        ("centre_of_mass_mm = [0, 0, 0]", {"centre_of_mass": (0.0, 0.0, 0.0)}),
        ("mass_g = 500", {"mass": 0.5}),
        ('title = "Mine"', {"title": "Mine"}),
        ('source = "here"', {"source": "here"}),
    ):
        assert like(text) == replace(model, name="mine", **changes)
    for text in ("lengths_mm = { bc = 33 }", '[[mount]]\nname = "A"\nx_mm = 1\ny_mm = 2'):
        assert like(text).dimensions == "user", "they are no longer the manufacturer's"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("ab = 15, bc = 30, cd = 25", "ab = 0, bc = 30, cd = 0"), "ab and cd are both 0"),
        (("bc = 30", "bc = 0"), "bc is 0"),
        (('name = "B"', 'name = "A"'), "the name 'A' is used twice"),
        (('leg = "pantograph"', 'leg = "scara"'), "'scara' is not a kind of leg"),
        (('leg = "pantograph"', 'like = "omni"'), "'omni' has no legs"),
        (('leg = "pantograph"', 'leg = "lag"'), "'lag' is not a kind of leg"),
        (('leg = "pantograph"\n', ""), "'leg' is missing: which kind of legs it has"),
        (("foot = 8", "tibia = 8"), "a leg of the kind 'pantograph' has no part 'tibia'"),
        (('leg = "pantograph"', 'like = "hexapod"\nleg = "hip-lift"'), "are 'pantograph'"),
    ],
)
def test_a_file_that_is_not_a_hexapod_is_refused(change: tuple[str, str], message: str) -> None:
    assert change[0] in FILE
    with pytest.raises(InputError, match=message):
        read(FILE.replace(*change))


def test_one_of_two_lengths_may_be_zero() -> None:
    assert read(FILE.replace("ab = 15", "ab = 0")).leg.length["ab"] == 0
    assert read(FILE.replace("cd = 25", "cd = 0")).leg.length["cd"] == 0
    assert read(FILE.replace("ab = 15", "ab = 25")).leg.length["ab"] == 0.025


def test_the_facts_of_a_hexapod_are_those_of_its_file_and_its_mobility_that_of_its_legs() -> None:
    bug = read(FILE)
    details = KINDS["hexapod"].details(bug)
    assert details["centre_of_mass_m"] == list(bug.centre_of_mass)
    assert [each["name"] for each in details["mounts"]] == ["A", "B"]
    assert details["mounts"][0]["position_m"] == pytest.approx([0.06, 0.035, 0.012])
    assert details["mounts"][0]["heading_deg"] == pytest.approx(30)
    assert [each["mirrored"] for each in details["mounts"]] == [False, True]
    mobility = KINDS["hexapod"].mobility(bug)
    # a leg is a chain of links and joints; the slider mechanism's joint follows β
    legs = len(bug.leg.rows)
    assert mobility.mobility == 4
    assert mobility.manoeuvrability == -2
    assert mobility.elements == 1 + len(mobility.joints)
    assert len(mobility.joints) == 2 * sum(row.joint is not None for row in bug.leg.rows) <= 2 * legs
    assert mobility.passive == len(mobility.joints) - 4
    # a body on three two-joint legs keeps 3 freedoms, with springs all 6 (Kutzbach)
    assert mobility.note == "2 legs of 2; standing on three, the body has 3, with the spring joints 6"
