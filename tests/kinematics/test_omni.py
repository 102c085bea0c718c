"""The omni base: forward and inverse, the 27 motions, encoder counts."""

from math import pi, radians, sin, sqrt

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.kinematics import omni
from servogen.kinematics.catalogue import robot
from servogen.kinematics.omni import OmniBase

BASE = robot("omni")


def test_the_catalogues_base_is_the_sources() -> None:
    assert isinstance(BASE, OmniBase)
    assert (2 * BASE.wheel_radius, BASE.gear, BASE.counts_per_turn, BASE.sensors) == (0.08, 16, 2048, 9)
    assert np.degrees(omni.sensor_angles(BASE)) == pytest.approx(range(0, 360, 40))


def test_wheel_speeds_are_the_three_equations() -> None:
    vx, vy, turn = 0.3, -0.2, 0.7
    r, spin = BASE.wheel_radius, BASE.wheel_distance * 0.7
    expected = [sqrt(3) / 2 * vx - vy / 2 - spin, -sqrt(3) / 2 * vx - vy / 2 - spin, vy - spin]
    assert r * BASE.wheel_speeds([vx, vy, turn]) == pytest.approx(expected)


def test_forward_and_inverse_undo_each_other() -> None:
    speeds = np.random.default_rng(6).normal(size=(1000, 3))
    np.testing.assert_allclose(BASE.body_speed(BASE.wheel_speeds(speeds)), speeds, atol=1e-12)


def test_the_equations_follow_from_where_the_wheels_stand() -> None:
    for wheel, (at, drives) in enumerate(((60, -30), (300, 210), (180, 90))):
        point = BASE.wheel_distance * np.array([np.cos(radians(at)), np.sin(radians(at))])
        along = np.array([np.cos(radians(drives)), np.sin(radians(drives))])
        vx, vy, turn = 0.3, -0.2, 0.7
        speed = np.array([vx - turn * point[1], vy + turn * point[0]]) @ along
        assert BASE.wheel_radius * BASE.wheel_speeds([vx, vy, turn])[wheel] == pytest.approx(speed)


# typed from the specification, apart from the code
TRANSLATIONS = {
    (1, -1, 0): 0, (0, -1, 1): 60, (-1, 0, 1): 120, (-1, 1, 0): 180, (0, 1, -1): 240, (1, 0, -1): 300,
}  # fmt: skip


def test_there_are_27_motions_and_six_are_translations() -> None:
    rows = {row.signs: row for row in omni.table()}
    assert len(rows) == 27
    found = {signs: row.direction_deg for signs, row in rows.items() if row.kind == "translation"}
    assert found == TRANSLATIONS
    assert dict(omni.directions()) == {angle: signs for signs, angle in TRANSLATIONS.items()}


# the source's table 10.1, typed from it: three wheels (c clockwise, t counter-clockwise, 0 stop), then the
# motion; "c small": the robot turns clockwise on a small circle, "c": on the spot, a number: goes that way
PRINTED = """
ccc c       | cc0 c small  | cct c large  | c0c c small  | c00 c medium | c0t 300
ctc c large | ct0 0        | ctt t large  | 0cc c small  | 0c0 c medium | 0ct 240
00c c medium| 000 stop     | 00t t medium | 0tc 60       | 0t0 t medium | 0tt t small
tcc c large | tc0 180      | tct t large  | t0c 120      | t00 t medium | t0t t small
ttc t large | tt0 t small  | ttt t
"""


def as_printed(row: omni.OmniMotion) -> str:
    letters = {1: "c", 0: "0", -1: "t"}
    wheels = "".join(letters[sign] for sign in row.signs)
    if row.kind == "translation":
        return f"{wheels} {row.direction_deg}"
    turn = letters[-row.turning]
    return {"stop": f"{wheels} stop", "turning": f"{wheels} {turn}"}.get(
        row.kind, f"{wheels} {turn} {row.size}"
    )


def test_the_generated_table_is_the_printed_one() -> None:
    printed = [" ".join(cell.split()) for cell in PRINTED.replace("\n", "|").split("|") if cell.strip()]
    assert [as_printed(row) for row in omni.table()] == printed


@pytest.mark.parametrize("row", omni.table(), ids=lambda row: str(row.signs))
def test_every_motion_is_the_rule_of_the_table(row: omni.OmniMotion) -> None:
    signs = row.signs
    moving, different = sum(sign != 0 for sign in signs), set(signs)
    if moving == 0:
        assert row.kind == "stop"
    elif len(different) == 1:
        assert (row.kind, row.direction_deg) == ("turning", None)
    elif sum(signs) == 0:
        assert (row.kind, row.turning) == ("translation", 0)
    elif moving == 1:
        assert (row.kind, row.radius, row.size) == ("circle", 2, "medium")
    elif moving == 2:
        assert (row.kind, row.radius, row.size) == ("circle", 1, "small")
    else:
        assert (row.kind, row.radius, row.size) == ("circle", 4, "large")
    assert row.turning == -np.sign(sum(signs))


@pytest.mark.parametrize("row", omni.table(), ids=lambda row: str(row.signs))
def test_every_motion_is_what_the_base_does(row: omni.OmniMotion) -> None:
    vx, vy, turn = BASE.body_speed(np.array(row.signs, float))
    if row.direction_deg is not None:
        way = np.hypot(vx, vy) * np.array(
            [np.cos(radians(row.direction_deg)), np.sin(radians(row.direction_deg))]
        )
        assert (vx, vy) == pytest.approx(tuple(way), abs=1e-12)
    if row.radius is not None:
        assert np.hypot(vx, vy) / abs(turn) == pytest.approx(row.radius * BASE.wheel_distance)


def test_the_circumference_is_251_327_millimetres() -> None:
    assert 1000 * omni.circumference(BASE) == pytest.approx(251.327, abs=5e-4)


def test_the_travel_of_a_metre() -> None:
    found = omni.travel(BASE, 1.0)
    assert found.wheel_m == pytest.approx(sin(radians(60)))
    assert found.motor_turns == pytest.approx(16 * sin(radians(60)) / (pi * 0.08))
    assert found.counts == pytest.approx(2048 * found.motor_turns)
    assert round(found.counts) == 112912


def test_counts_of_a_direction_are_the_travel_with_the_wheels_signs() -> None:
    for angle, signs in omni.directions().items():
        displacement = [np.cos(radians(angle)), np.sin(radians(angle)), 0.0]
        turns = BASE.wheel_speeds(displacement) * BASE.gear / (2 * pi)
        expected = np.array(signs) * omni.travel(BASE, 1.0).counts
        assert turns * BASE.counts_per_turn == pytest.approx(expected, abs=1e-6)


def test_wrong_signs_are_refused() -> None:
    with pytest.raises(InputError, match="not wheel signs"):
        omni.motion_of((2, 0, 0))
