"""What the commands answer: degrees and millimetres in, metres and radians out, JSON all the way."""

import json
from math import atan2, degrees, hypot, pi, radians, sin, sqrt
from pathlib import Path

import numpy as np
import pytest

import servogen
from servogen.errors import InputError
from servogen.kinematics import queries as q
from servogen.kinematics.catalogue import arm, names
from servogen.kinematics.forward import fk_position
from servogen.kinematics.inverse.configuration import configuration_of
from servogen.kinematics.inverse.unreachable import Unreachable
from servogen.kinematics.transforms import parse

ROBOTS = Path(servogen.__file__).parent / "robot" / "catalogue" / "robots"


def test_the_worked_product_of_three_transforms() -> None:
    answer = q.transform_answer("Ry(30) Tx(50) Rz(60)", (2, 4, 1))
    assert answer["point"] == pytest.approx([41.6673, 3.7321, -22.9019], abs=5e-5)
    assert np.shape(answer["matrix"]) == (4, 4)
    assert "point" not in q.transform_answer("Rx(90)")


@pytest.mark.parametrize(
    "text", ["ry(30)*Tx(50)·Rz(60)", " Rot(y, 30)Trans(50,0,0) Rot(z,60)", "Ry( 3e1 )Tx(50)Rz(60)"]
)
def test_other_ways_to_write_the_same(text: str) -> None:
    np.testing.assert_array_equal(parse(text), parse("Ry(30) Tx(50) Rz(60)"))


def test_no_transform_at_all_is_refused() -> None:
    with pytest.raises(InputError, match="the product is empty"):
        parse("  ")
    with pytest.raises(InputError, match="three coordinates"):
        q.transform_answer("Rx(1)", (1, 2))


def test_fk_and_ik_of_the_worked_pose() -> None:
    answer = q.fk_answer("scara", (30, 60, 200, 0))
    assert answer["position_m"] == pytest.approx([0.34641, 0.5, 0.25], abs=5e-6)
    assert np.shape(answer["rotation"]) == (3, 3)
    assert answer["beyond_limits"] == []
    back = q.ik_answer("scara", [1000 * value for value in answer["position_m"]], everything=True)
    assert back["solutions"][0] == pytest.approx({"q1_deg": 30, "q2_deg": 60, "q3_mm": 200, "q4_deg": 0})
    assert (len(back["solutions"]), back["found"]) == (2, 2)
    assert len(q.ik_answer("scara", (346.41, 500, 250))["solutions"]) == 1


def test_fk_says_what_is_beyond_the_limits() -> None:
    assert q.fk_answer("scara", (130, 0, 250, 0))["beyond_limits"] == ["q1", "q3"]


def test_the_feet_of_the_six_legged_robot() -> None:
    feet = q.fk_answer("hexapod", (10, 0) * 6)["feet_m"]
    assert set(feet) == {"L1", "L2", "L3", "R1", "R2", "R3"}
    assert feet["L2"][0] == pytest.approx(feet["R2"][0])
    assert feet["L2"][1] == pytest.approx(-feet["R2"][1])
    assert feet["L2"][0] < 0
    with pytest.raises(InputError, match="has 12 joints, not 5"):
        q.fk_answer("hexapod", (0,) * 5)


@pytest.mark.parametrize("wrong", [float("nan"), float("inf")])
def test_numbers_that_are_none_are_refused(wrong: float) -> None:
    for ask in (
        lambda: q.fk_answer("scara", (wrong, 0, 0, 0)),
        lambda: q.fk_answer("hexapod", (wrong,) * 12),
        lambda: q.ik_answer("scara", (wrong, 0, 0)),
        lambda: q.ik_answer("scara", (400, 0, 300, wrong)),
        lambda: q.jacobian_answer("scara", (wrong, 0, 0, 0)),
        lambda: q.transform_answer("Rx(1)", (wrong, 0, 0)),
    ):
        with pytest.raises(InputError, match="finite"):
            ask()


def test_ik_with_an_orientation_and_with_the_wrong_number_of_values() -> None:
    answer = q.ik_answer("rv-m1", (200, 100, 400, -60, 25), everything=True)
    assert list(answer["solutions"][0]) == ["q1_deg", "q2_deg", "q3_deg", "q4_deg", "q5_deg"]
    # Turned round and with the elbow up it would be reached as well, but not within the limits
    assert answer["found"] == 1
    with pytest.raises(InputError, match="rv-m1 takes x y z or x y z pitch roll, not 4 numbers"):
        q.ik_answer("rv-m1", (200, 100, 400, -60))
    with pytest.raises(InputError, match="theta-r takes x y z, not 6 numbers"):
        q.ik_answer("theta-r", (1, 2, 3, 4, 5, 6))
    assert q.ik_answer("irb6400c", (900, 300, 700, 10, 20, 30), everything=True)["found"] == 8
    with pytest.raises(Unreachable):
        q.ik_answer("scara", (900, 0, 300))


def test_ik_says_if_there_are_more_solutions_than_it_lists(tmp_path: Path) -> None:
    """On the first axis there is one for each q1; with a stretched wrist a configuration vector leaves q4
    free; a robot without a closed form is searched.
    """
    every = q.ik_answer("anthropomorphic", (200, 0, 300))
    assert (every["free"], every["complete"]) == ([], True)
    above = q.ik_answer("anthropomorphic", (0, 0, 300))
    assert (above["free"], above["complete"]) == (["q1"], False)
    vector = configuration_of(arm("spherical-wrist"), [0.3, 0.4, 0.3, 0.2, 0.0, 0.1]) * ([1000] * 3 + [1] * 3)
    stretched = q.configuration_answer("spherical-wrist", vector.tolist())
    assert (stretched["free"], stretched["complete"]) == (["q4"], False)
    searched = tmp_path / "searched.toml"
    text = (ROBOTS / "anthropomorphic.toml").read_text()
    searched.write_text(text.replace('closed_form = "anthropomorphic"\n', ""))
    answer = q.ik_answer(str(searched), (200, 0, 300))
    assert (answer["free"], answer["complete"]) == ([], False)


@pytest.mark.parametrize(("name", "joints"), [("leg", (10, 30)), ("wrist-arm", (30, 45, 60))])
def test_a_target_typed_with_two_digits_is_the_nearest_point_that_an_arm_reaches(
    name: str, joints: tuple[float, ...]
) -> None:
    exact = 1000 * np.array(q.fk_answer(name, joints)["position_m"])
    typed, roll = np.round(exact, 2), [joints[2]] if name == "wrist-arm" else []
    answer = q.ik_answer(name, [*typed, *roll], everything=True)
    assert 0 < answer["missed_m"] <= np.linalg.norm(exact - typed) / 1000 + 1e-9
    at = [fk_position(arm(name), np.radians([*each.values()])) for each in answer["solutions"]]
    assert np.linalg.norm(np.array(at) - typed / 1000, axis=1) == pytest.approx(answer["missed_m"], abs=1e-9)
    assert q.ik_answer(name, [*exact, *roll])["missed_m"] < 1e-9
    with pytest.raises(Unreachable):
        q.ik_answer(name, [*(1.001 * exact), *roll])


def test_every_answer_is_json() -> None:
    answers = [q.robot_list(), q.mobility_answer("scara"), q.jacobian_answer("scara", (0, 0, 0, 0))]
    answers += [q.fk_symbolic("scara", "c"), q.jacobian_symbolic("scara", "n", "latex")]
    answers += [q.robot_details(name) for name in names()] + [q.mobility_answer(name) for name in names()]
    for answer in answers:
        assert json.loads(json.dumps(answer, allow_nan=False)) == answer


def test_the_list_has_every_short_name_and_says_where_dimensions_come_from() -> None:
    rows = {row["name"]: row for row in q.robot_list()}
    assert set(rows) == set(names())
    assert {rows[name]["dimensions"] for name in ("scara", "rv-m1", "leg")} == {
        "source",
        "manufacturer",
        "example",
    }
    assert (rows["hexapod"]["joints"], rows["omni"]["joints"]) == (12, 3)


def test_the_jacobian_names_the_lost_directions() -> None:
    answer = q.jacobian_answer("anthropomorphic", (10, 20, 0))
    assert answer["singular"] is (answer["rank"] < 3)
    assert answer["manipulability"] == 0
    assert np.shape(q.jacobian_answer("rv-m1", (0,) * 5, "n")["jacobian"]) == (6, 5)
    with pytest.raises(InputError, match="the symbolic Jacobian is in the frame 0 or n, not 2"):
        q.jacobian_symbolic("scara", 2)
    with pytest.raises(InputError, match="unknown style 'html'"):
        q.fk_symbolic("scara", "html")


def test_robots_without_joints_are_refused_by_name() -> None:
    with pytest.raises(InputError, match="'omni' drives on wheels"):
        q.statics_answer("omni", (1, 2, 3), (1, 0, 0), (0, 0, 0))
    with pytest.raises(InputError, match="'hexapod' has 6 legs"):
        q.ik_answer("hexapod", (1, 2, 3))
    with pytest.raises(InputError, match=r"unknown robot 'skara'[\s\S]*did you mean 'scara'"):
        q.fk_answer("skara", (1, 2, 3))


def test_the_speed_of_the_omni_base_is_the_three_equations() -> None:
    # r = 40 mm, l = 135 mm: vx = r (ω1 - ω2)/√3, vy = r (-ω1 - ω2 + 2 ω3)/3, Ω = -r (ω1 + ω2 + ω3)/3l
    one, two, three = np.radians([100.0, -40.0, 10.0])
    answer = q.fk_answer("omni", (100, -40, 10))
    assert answer["vx_m_s"] == pytest.approx(0.04 * (one - two) / sqrt(3))
    assert answer["vy_m_s"] == pytest.approx(0.04 * (-one - two + 2 * three) / 3)
    assert radians(answer["turn_deg_s"]) == pytest.approx(-0.04 * (one + two + three) / (3 * 0.135))
    assert answer["radius_m"] == pytest.approx(
        np.hypot(answer["vx_m_s"], answer["vy_m_s"]) / abs(radians(answer["turn_deg_s"]))
    )
    on_the_spot, straight, still = (q.fk_answer("omni", each) for each in ((9, 9, 9), (9, -9, 0), (0, 0, 0)))
    assert (on_the_spot["direction_deg"], on_the_spot["radius_m"]) == (None, 0)
    assert (straight["direction_deg"], straight["radius_m"]) == (0, None)
    assert (still["direction_deg"], still["radius_m"]) == (None, None)


def test_a_metre_in_a_second_is_the_travel_of_the_lab() -> None:
    # a wheel goes L sin 60°, its motor 16 L sin 60° / (π 80 mm) turns of 2048 counts
    answer = q.ik_answer("omni", (1000, 0, 0))
    assert answer["rim_speeds_m_s"] == pytest.approx([sin(pi / 3), -sin(pi / 3), 0], abs=1e-12)
    turns = 16 * 1000 * sin(pi / 3) / (pi * 80)
    assert answer["motor_turns_per_s"] == pytest.approx([turns, -turns, 0])
    assert answer["encoder_counts_per_s"][0] == pytest.approx(2048 * turns)
    back = q.fk_answer("omni", answer["wheel_speeds_deg_s"])
    assert (back["vx_m_s"], back["turn_deg_s"]) == (pytest.approx(1), pytest.approx(0))


def test_the_jacobian_of_the_omni_base_and_its_inverse() -> None:
    answer = q.jacobian_answer("omni", ())
    r, l = 0.04, 0.135  # noqa: E741
    forward = [
        [r / sqrt(3), -r / sqrt(3), 0],
        [-r / 3, -r / 3, 2 * r / 3],
        [-r / (3 * l), -r / (3 * l), -r / (3 * l)],
    ]
    back = [
        [sqrt(3) / 2 / r, -1 / 2 / r, -l / r],
        [-sqrt(3) / 2 / r, -1 / 2 / r, -l / r],
        [0, 1 / r, -l / r],
    ]
    np.testing.assert_allclose(answer["jacobian"], forward, atol=1e-15)
    np.testing.assert_allclose(answer["inverse"], back, atol=1e-9)


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda: q.fk_answer("omni", (1, 2)), "omni has 3 wheels, not 2"),
        (lambda: q.fk_answer("omni", (1, 2, float("nan"))), "finite"),
        (lambda: q.ik_answer("omni", (1, 2)), "omni takes vx vy turn, not 2 numbers"),
        (lambda: q.jacobian_answer("omni", (1, 2, 3)), "is the same everywhere"),
        (lambda: q.jacobian_answer("omni", (), "n"), "is the same everywhere"),
        (lambda: q.jacobian_answer("scara", (0, 0, 0, 0), 0, (1, 2)), "joints"),
    ],
)
def test_what_a_base_on_wheels_does_not_take_is_refused(ask, message: str) -> None:
    with pytest.raises(InputError, match=message):
        ask()


def test_the_velocity_of_the_tool_is_the_derivative_of_its_position() -> None:
    at, rates, step = np.array([30.0, 60.0, 100.0, 20.0]), np.array([10.0, -20.0, 30.0, 5.0]), 1e-4
    answer = q.jacobian_answer("scara", at, 0, rates)
    ahead, behind = (q.fk_answer("scara", at + sign * step * rates)["position_m"] for sign in (1, -1))
    assert answer["velocity_m_s"] == pytest.approx(np.subtract(ahead, behind) / (2 * step), abs=1e-8)
    # the rotation about z is θ1 + θ2 - θ4
    assert answer["angular_velocity_deg_s"] == pytest.approx([0, 0, 10 - 20 - 5])


def test_the_torques_of_a_force_on_the_tool_are_levers_times_it() -> None:
    # SCARA: the tool at (0.34641, 0.5) turns about (0, 0) and (0.34641, 0.2); z is along the slide, downwards
    answer = q.statics_answer("scara", (30, 60, 200, 0), (3, 4, -5), (0, 0, 0.7))
    loads = [next(joint[key] for key in joint if key.startswith("load")) for joint in answer["joints"]]
    assert loads == pytest.approx([0.34641 * 4 - 0.5 * 3 + 0.7, -0.3 * 3 + 0.7, 5, -0.7], abs=1e-5)
    assert answer["joints"][2]["motor_n"] == pytest.approx(-5)


def test_the_torque_of_a_vertical_force_on_a_foot_is_f_l_bc_sin_beta() -> None:
    for name, leg in (("leg", None), ("hexapod", "L2"), ("hexapod", "R1")):
        alpha, beta = q.statics_answer(name, (20, 30), (0, 0, 10), (0, 0, 0), leg)["joints"]
        assert alpha["load_nm"] == pytest.approx(0, abs=1e-12)
        assert beta["load_nm"] == pytest.approx(10 * 0.060 * sin(radians(30)))
        assert beta["motor_nm"] == -beta["load_nm"]


@pytest.mark.parametrize("leg", ["L1", "L3", "R1", "R3"])
def test_the_power_of_a_force_on_a_foot_is_that_of_the_joints(leg: str) -> None:
    """Virtual work in the frame of the body: F · dx = τ · dq, also for the mirrored legs."""
    force, at, step = np.array([3.0, -2.0, 5.0]), np.array([20.0, 30.0]), 1e-4
    loads = [joint["load_nm"] for joint in q.statics_answer("hexapod", at, force, (0, 0, 0), leg)["joints"]]
    order = ("L1", "L2", "L3", "R1", "R2", "R3").index(leg)
    assert list(q.fk_answer("hexapod", (0,) * 12)["feet_m"])[order] == leg
    for joint in range(2):
        feet = []
        for sign in (1, -1):
            angles = np.zeros((6, 2))
            angles[order] = at
            angles[order, joint] += sign * step
            feet.append(np.array(q.fk_answer("hexapod", angles.ravel())["feet_m"][leg]))
        way = (feet[0] - feet[1]) / radians(2 * step)
        assert loads[joint] == pytest.approx(force @ way, abs=1e-8)


def test_the_weight_of_the_links_is_held_too(tmp_path: Path) -> None:
    path = tmp_path / "lamp.toml"
    path.write_text(
        'name = "lamp"\nconvention = "standard"\npayload_g = 1000\n[lengths_mm]\nl = 200\n'
        '[[joint]]\nname = "q"\nkind = "turning"\nlower_deg = -90\nupper_deg = 90\nhome_deg = 0\n'
        '[[row]]\njoint = "q"\na_mm = "l"\n[base]\nrx_deg = 90\n'
    )
    (joint,) = q.statics_answer(str(path), (0,), (0, 0, -2), (0, 0, 0))["joints"]
    # its plane of motion stands upright: 1 kg and 2 N pull down 200 mm from the joint
    assert joint["weight_nm"] == pytest.approx(9.80665 * 0.2)
    assert joint["load_nm"] == pytest.approx(-2 * 0.2)
    assert joint["motor_nm"] == pytest.approx((9.80665 + 2) * 0.2)
    assert q.statics_answer(str(path), (0,), (0, 0, 0), (0, 0, 0))["joints"][0]["load_nm"] == 0


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (
            lambda: q.statics_answer("scara", (0, 0, 0, 0), (0, 0, 0), (0, 0, 0)),
            "nothing loads scara",
        ),
        (lambda: q.statics_answer("scara", (0,), (1, 0, 0), (0, 0, 0)), "joints"),
        (lambda: q.statics_answer("scara", (0, 0, 0, 0), (float("inf"), 0, 0), (0, 0, 0)), "finite"),
        (lambda: q.statics_answer("hexapod", (0, 0), (1, 0, 0), (0, 0, 0)), "has 6 legs: name one"),
        (lambda: q.statics_answer("hexapod", (0, 0), (1, 0, 0), (0, 0, 0), "L7"), "has no leg 'L7'"),
        (lambda: q.statics_answer("scara", (0,) * 4, (1, 0, 0), (0, 0, 0), "L1"), "it has no legs"),
    ],
)
def test_statics_refuses_what_it_cannot_answer(ask, message: str) -> None:
    with pytest.raises(InputError, match=message):
        ask()


def test_a_small_motion_seen_from_the_frame() -> None:
    # T has n = y, o = z, a = x and p = (10, 5, 0): δ × p + d = (0, 0, -1) + (1, 0, 0.5)
    answer = q.differential_answer("Trans(10,5,0) Rz(90) Rx(90)", (1, 0, 0.5), (0, 0.1, 0))
    assert answer["matrix"] == [[0, 0, 1, 10], [1, 0, 0, 5], [0, 1, 0, 0], [0, 0, 0, 1]]
    assert answer["moving"]["translation"] == pytest.approx([0, -0.5, 1])
    assert answer["moving"]["rotation_rad"] == pytest.approx([0.1, 0, 0])
    np.testing.assert_allclose(
        answer["change"], [[0, 0.1, 0, 1], [0, 0, 0, 0], [0, 0, -0.1, -0.5], [0, 0, 0, 0]], atol=1e-15
    )
    again = q.differential_answer("Trans(10,5,0) Rz(90) Rx(90)", (0, -0.5, 1), (0.1, 0, 0), moving=True)
    assert again["fixed"]["translation"] == pytest.approx([1, 0, 0.5])
    np.testing.assert_allclose(again["change"], answer["change"], atol=1e-15)
    with pytest.raises(InputError, match="finite"):
        q.differential_answer("Rx(1)", (float("nan"), 0, 0), (0, 0, 0))


@pytest.mark.parametrize(
    ("joints", "message"),
    [
        (("turning:four",), "'turning:four' is not a kind of joint and its number"),
        (("turning:0",), "is not 1 to 1000 joints"),
        (("turning:99999",), "is not 1 to 1000 joints"),
        (("turning:" + "9" * 5000,), f"'turning:{'9' * 52}' is not 1 to 1000 joints"),
        (("turning:-1",), "'turning:-1' is not a kind of joint and its number"),
        (("hinge:3",), "unknown kind of joint 'hinge'"),
    ],
)
def test_joints_that_are_not_joints_are_refused(joints: tuple[str, ...], message: str) -> None:
    with pytest.raises(InputError, match=message):
        q.mechanism_answer(4, joints)


def test_joints_are_counted_by_kind() -> None:
    assert q.mechanism_answer(4, ("turning:3", "sliding"), plane=True)["mobility"] == 1
    assert q.mechanism_answer(14, ("universal:6", "sliding:6", "spherical:6"))["mobility"] == 6


def test_a_configuration_vector_is_typed_in_millimetres() -> None:
    vector = q.fk_answer("rv-m1", (90, 10, -20, 100, 90))["configuration_vector"]
    typed = [1000 * value for value in vector[:3]] + vector[3:]
    answer = q.configuration_answer("rv-m1", typed, everything=True)
    assert any(
        np.allclose([*each.values()], (90, 10, -20, 100, 90), atol=1e-6) for each in answer["solutions"]
    )
    with pytest.raises(InputError, match="a configuration vector has six numbers, not 3"):
        q.configuration_answer("rv-m1", (1, 2, 3))


@pytest.mark.parametrize(
    ("coefficients", "solutions"),
    [
        ((1, 0, -0.5), [-60, 60]), ((1, 0, 0), [-90, 90]), ((0, 1, 0), [0, 180]),
        ((3, 4, -5), [degrees(atan2(4, 3))]),  # the greatest value of a cos x + b sin x
        ((1, 0, 1), [180]),  # where tan(x/2) has none
        ((1e-9, 1e-9, 0), [-45, 135]), ((3, 4, 5.000001), []), ((0, 0, 1), []),
    ],
)  # fmt: skip
def test_an_equation_of_cosine_and_sine_has_these_solutions(
    coefficients: tuple[float, float, float], solutions: list[float]
) -> None:
    answer = q.equation_answer(*coefficients)
    assert answer["solutions_deg"] == pytest.approx(solutions, abs=1e-6)
    assert not answer["every_angle"]


def test_an_equation_that_says_nothing_of_the_angle_is_solved_by_every_one() -> None:
    answer = q.equation_answer(0, 0, 0)
    assert (answer["every_angle"], answer["solutions_deg"]) == (True, [])


def test_every_solution_of_an_equation_solves_it_and_where_the_sign_changes_there_is_one() -> None:
    """Substituted, and counted by the sign changes of the left side over a turn."""
    random, turn = np.random.default_rng(5), np.radians(np.arange(0.05, 360, 0.1))
    counts = set()
    for a, b, c in random.normal(size=(300, 3)) * 10.0 ** random.integers(-6, 6, (300, 1)):
        x = np.radians(q.equation_answer(a, b, c)["solutions_deg"])
        scale = hypot(a, b) + abs(c)
        assert np.abs(a * np.cos(x) + b * np.sin(x) + c).max(initial=0) < 1e-12 * scale
        side = np.sign(a * np.cos(turn) + b * np.sin(turn) + c)
        assert len(x) == np.count_nonzero(side != np.roll(side, 1)), (a, b, c)
        assert (np.diff(x) > 0).all() and (np.abs(x) <= np.pi).all()
        counts.add(len(x))
    assert counts == {0, 2}
