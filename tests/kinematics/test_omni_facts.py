"""The facts of an omni base and its routines by the geometry of table 10.1."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.kinematics import omni
from servogen.kinematics.omni import OmniBase, as_stretch, translation
from servogen.kinematics.protocol import Routine
from servogen.kinematics.registry import KINDS

BASE = OmniBase("o", "", 0.04, 0.135, 16.0, 2048, sensors=9)


@pytest.mark.parametrize("signs", list(product((1, 0, -1), repeat=3)))
def test_each_row_of_the_table_is_the_motion_of_three_wheels(signs: tuple[int, int, int]) -> None:
    """Each wheel drives the rim along its direction: clockwise wheels at 60°, 300° and 180° along -30°, 210°
    and 90°. The centre's velocity is 2/3 of the sum of the rims', the turn minus a third of the sum over l.
    """
    row = omni.motion_of(signs)
    drives = np.exp(1j * np.radians([-30, 210, 90]))
    velocity = 2 / 3 * (np.array(signs) @ drives)
    turn = -sum(signs) / 3
    assert row.signs == signs
    assert row.turning == np.sign(turn)
    moving = abs(velocity) > 1e-9
    assert (
        row.kind
        == {
            (False, False): "stop",
            (True, False): "translation",
            (False, True): "turning",
            (True, True): "circle",
        }[(bool(moving), bool(turn))]
    )
    expected = round(math.degrees(math.atan2(velocity.imag, velocity.real))) % 360 if moving else None
    assert row.direction_deg == expected
    radius = abs(velocity / turn) if moving and turn else None
    assert row.radius == (None if radius is None else pytest.approx(radius))
    assert row.size == (None if radius is None else {1: "small", 2: "medium", 4: "large"}[round(radius)])


def test_other_signs_are_not_wheels() -> None:
    for wrong in ((1, 1), (1, 0, 2), (1, 1, 1, 1)):
        with pytest.raises(InputError, match="are not wheel signs"):
            omni.motion_of(wrong)  # type: ignore[arg-type]
    assert len(omni.table()) == 27
    assert list(omni.directions()) == [0, 60, 120, 180, 240, 300]


def test_travel_wheels_and_sensors() -> None:
    way = omni.travel(BASE, 0.5)
    assert (way.distance_m, way.wheel_m) == (0.5, pytest.approx(0.5 * math.sqrt(3) / 2))
    assert way.motor_turns == pytest.approx(16 * way.wheel_m / (2 * math.pi * 0.04))
    assert np.degrees(omni.sensor_angles(BASE)) == pytest.approx([40 * n for n in range(9)])
    assert (BASE.limbs, BASE.wheel_count) == ((), 3)


def test_the_outline_is_a_rim_a_front_and_wheels_across_their_spokes() -> None:
    rim, front, *wheels = BASE.outline()
    assert np.abs(rim) == pytest.approx(np.full(len(rim), 0.135))
    assert rim[0] == pytest.approx(rim[-1])
    assert front[0] == 0 and front[1].imag == 0 and 0 < front[1].real < 0.135
    for wheel, degrees in zip(wheels, (60, 300, 180), strict=True):
        spoke = np.exp(1j * math.radians(degrees))
        assert wheel.mean() == pytest.approx(0.135 * spoke)
        assert abs(wheel[1] - wheel[0]) == pytest.approx(0.08)
        assert ((wheel[1] - wheel[0]) / spoke).real == pytest.approx(0, abs=1e-15)


@pytest.mark.parametrize(
    ("degrees", "is_routine"),
    [(60.0, True), (60.0 + 5e-8, True), (60.0 + 1e-7, False), (59.9, False), (-60, True)],
)
def test_a_translation_is_a_routine_in_one_of_six_directions(degrees: float, is_routine: bool) -> None:
    """A nanoradian is 5.7e-8 degrees."""
    turn = math.radians(degrees)
    part = translation(BASE, (0.2 * math.cos(turn), 0.2 * math.sin(turn)))
    assert (part.direction_deg is not None) == is_routine
    assert part.length == pytest.approx(0.2)
    stretch = as_stretch(BASE, part)
    wheels = BASE.wheel_speeds((*part.displacement, 0.0))
    assert stretch.wheel_angles == pytest.approx(tuple(wheels), abs=1e-8)
    if is_routine:
        assert part.direction_deg == round(degrees) % 360
        assert "two wheels" in stretch.text and 0.0 in stretch.wheel_angles
    else:
        assert f"200.0 mm at {degrees:.1f}°, three wheels" == stretch.text


def test_routines_take_their_values_and_no_others() -> None:
    for name, needed in (
        ("translation", {"direction", "distance"}),
        ("turn", {"turn"}),
        ("small-circle", {"direction", "turn"}),
    ):
        values = {"direction": math.pi / 2, "distance": 0.1, "turn": 1.0}
        given = {key: values[key] for key in needed}
        assert BASE.routine(Routine(name, **given))
        for key in values:
            with pytest.raises(InputError, match="takes"):
                wrong = (
                    {k: v for k, v in given.items() if k != key}
                    if key in needed
                    else given | {key: values[key]}
                )
                try:
                    BASE.routine(Routine(name, **wrong))
                except InputError as error:
                    raise InputError(error.code, f"{error.message} takes {error.hint}") from error
    for distance in (0.0, -0.1):
        with pytest.raises(InputError, match="distance_mm must be more than 0"):
            BASE.routine(Routine("translation", 0.0, distance))


@pytest.mark.parametrize(("name", "radius"), [("small-circle", 1), ("medium-circle", 2), ("large-circle", 4)])
@pytest.mark.parametrize("turn", [1.5, -1.5])
def test_a_circle_turns_the_base_as_far_as_asked_on_its_radius(name: str, radius: int, turn: float) -> None:
    rows = [
        row
        for row in omni.table()
        if row.size == name.removesuffix("-circle") and row.turning == np.sign(turn)
    ]
    assert len(rows) == 3
    for row in rows:
        assert row.direction_deg is not None
        (stretch,) = BASE.routine(Routine(name, math.radians(row.direction_deg), turn=turn))
        assert stretch.length == pytest.approx(radius * 0.135 * 1.5)
        # the wheels' angles turn the base by the angle
        vx, vy, heading = BASE.body_speed(stretch.wheel_angles)
        assert heading == pytest.approx(turn)
        assert math.hypot(vx, vy) == pytest.approx(radius * 0.135 * 1.5)
        assert math.degrees(math.atan2(vy, vx)) % 360 == pytest.approx(row.direction_deg % 360, abs=1e-9)
        assert f"radius {135 * radius:.1f} mm, by {math.degrees(turn):.1f}°" in stretch.text
        turns = 16 * max(map(abs, stretch.wheel_angles)) / (2 * math.pi)
        assert stretch.remark.endswith(f"{turns:.3f} motor turns, {2048 * turns:.0f} counts")


def test_a_turn_on_the_spot_is_as_long_as_the_way_of_a_wheel() -> None:
    for turn in (0.5, -0.5):
        (stretch,) = BASE.routine(Routine("turn", turn=turn))
        assert stretch.length == pytest.approx(0.135 * 0.5)
        assert BASE.body_speed(stretch.wheel_angles) == pytest.approx([0, 0, turn], abs=1e-12)
    with pytest.raises(InputError, match="turn_deg must not be 0"):
        BASE.routine(Routine("turn", turn=0.0))


def test_a_circle_begins_in_one_of_three_directions_to_a_millionth_of_a_degree() -> None:
    for off, fits in ((9e-7, True), (-9e-7, True), (2e-6, False), (15.0, False)):
        for direction in (0.0, 360.0, -360.0):
            (known, *_) = [
                row.direction_deg for row in omni.table() if row.size == "large" and row.turning == 1
            ]
            assert known is not None
            asked = Routine("large-circle", math.radians(known + direction + off), turn=1.0)
            if fits:
                assert BASE.routine(asked)
            else:
                with pytest.raises(InputError, match="no large circle that begins towards") as caught:
                    BASE.routine(asked)
                assert "turns counter-clockwise" in caught.value.message
                assert (caught.value.hint or "").count("°") == 3


def test_the_details_of_a_base() -> None:
    kind = KINDS["omni"]
    details = kind.details(BASE)
    assert (details["wheel_radius_m"], details["wheel_distance_m"]) == (0.04, 0.135)
    assert (details["gear"], details["counts_per_turn"]) == (16.0, 2048)
    assert len(details["sensor_angles_deg"]) == 9
    assert details["table"][0]["wheels"] == ["clockwise"] * 3
    wheels = kind.wheel_details(BASE, np.array([math.pi, 0.0, -math.pi]))
    assert wheels["rim_speeds_m_s"].tolist() == pytest.approx([0.04 * math.pi, 0, -0.04 * math.pi])
    assert wheels["motor_turns_per_s"].tolist() == [8, 0, -8]
    assert wheels["encoder_counts_per_s"].tolist() == [8 * 2048, 0, -8 * 2048]
    mobility = kind.mobility(BASE)
    assert (mobility.elements, mobility.joints, mobility.passive, mobility.mobility) == (
        4,
        ("turning",) * 3,
        0,
        3,
    )
    assert mobility.manoeuvrability == -3
