"""What the commands answer: degrees and millimetres in, metres and radians out, JSON all the way."""

import json
from math import radians

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.kinematics import queries as q
from servogen.kinematics.arm import length_text
from servogen.kinematics.catalogue import names
from servogen.kinematics.inverse.unreachable import Unreachable
from servogen.kinematics.transforms import parse
from servogen.robot.model import Length


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


@pytest.mark.parametrize(
    ("text", "column"),
    [
        ("Ry(30) Qx(5)", 8),
        ("Ry(30", 1),
        ("Ry(30) Tx(a)", 8),
        ("Trans(1,2)", 1),
        ("Rx(30) )", 8),
        ("Rx(inf)", 1),
    ],
)
def test_what_is_no_transform_is_refused_with_its_column(text: str, column: int) -> None:
    with pytest.raises(InputError, match=f"column {column}") as caught:
        parse(text)
    assert caught.value.location is not None
    assert caught.value.location.column == column


def test_no_transform_at_all_is_refused() -> None:
    with pytest.raises(InputError, match="there is no transform"):
        parse("  ")
    with pytest.raises(InputError, match="three coordinates"):
        q.transform_answer("Rx(1)", (1, 2))


def test_fk_and_ik_of_the_worked_pose() -> None:
    answer = q.fk_answer("scara", (30, 60, 200, 0))
    assert answer["position_m"] == pytest.approx([0.34641, 0.5, 0.25], abs=5e-6)
    assert np.shape(answer["rotation"]) == (3, 3)
    assert answer["beyond_limits"] == []
    back = q.ik_answer("scara", [1000 * value for value in answer["position_m"]], everything=True)
    assert back["solutions"][0] == pytest.approx([radians(30), radians(60), 0.2, 0.0])
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
    assert answer["joints"] == ["q1", "q2", "q3", "q4", "q5"]
    # Turned round and with the elbow up it would be reached as well, but not within the limits
    assert answer["found"] == 1
    with pytest.raises(InputError, match="rv-m1 takes x y z or x y z pitch roll, not 4 numbers"):
        q.ik_answer("rv-m1", (200, 100, 400, -60))
    with pytest.raises(InputError, match="theta-r takes x y z, not 6 numbers"):
        q.ik_answer("theta-r", (1, 2, 3, 4, 5, 6))
    assert q.ik_answer("irb6400c", (900, 300, 700, 10, 20, 30), everything=True)["found"] == 8
    with pytest.raises(Unreachable):
        q.ik_answer("scara", (900, 0, 300))


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
    assert answer["manipulability"] == pytest.approx(0, abs=1e-12)
    assert np.shape(q.jacobian_answer("rv-m1", (0,) * 5, "n")["jacobian"]) == (6, 5)
    with pytest.raises(InputError, match="the symbolic Jacobian is in the frame 0 or n, not 2"):
        q.jacobian_symbolic("scara", 2)
    with pytest.raises(InputError, match="unknown style 'html'"):
        q.fk_symbolic("scara", "html")


def test_robots_without_joints_are_refused_by_name() -> None:
    with pytest.raises(InputError, match="'omni' drives on wheels"):
        q.fk_answer("omni", (1, 2, 3))
    with pytest.raises(InputError, match="'hexapod' has 6 legs"):
        q.ik_answer("hexapod", (1, 2, 3))
    with pytest.raises(InputError, match=r"unknown robot 'skara'[\s\S]*did you mean 'scara'"):
        q.fk_answer("skara", (1, 2, 3))


def test_lengths_read_as_they_are_written() -> None:
    assert length_text(Length((("l2", 1.0), ("l3", -1.0)))) == "l2 - l3"
    assert length_text(Length((("l2", -1.0),), 0.04)) == "-l2 + 40 mm"
    assert length_text(Length()) == "0 mm"
