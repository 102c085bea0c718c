"""The omni base's drives: routines, closed contours by translations alone, their closing error."""

import math
from fractions import Fraction
from math import cos, pi, radians, sin, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from servogen.errors import InputError
from servogen.kinematics.omni import (
    OmniBase,
    Translation,
    as_stretch,
    contour,
    decomposed,
    routine,
    translation,
)
from servogen.kinematics.protocol import Routine
from servogen.motion.drive import PlannedDrive, drive, positions
from servogen.units import Clock, Cycles

BASE = OmniBase("robotino", "", 0.040, 0.135, 16.0, 2048)
CLOCK, PERIOD = Clock(4_000_000), Cycles(20_000)

# Specification: direction -> signs of the three wheels ("clockwise" is +).
SIX = {0: (1, -1, 0), 60: (0, -1, 1), 120: (-1, 0, 1), 180: (-1, 1, 0), 240: (0, 1, -1), 300: (1, 0, -1)}


WHEELS = ("one", "two", "three")


def driven(parts: tuple[Translation, ...], speed: float = 0.1, **options: object) -> PlannedDrive:
    stretches = [as_stretch(BASE, part) for part in parts]
    return drive(stretches, speed, PERIOD, CLOCK, wheels=WHEELS, **options)  # type: ignore[arg-type]


def end(made: PlannedDrive) -> np.ndarray:
    return positions(BASE, made.trajectory.angles, 0.02)[-1]


@pytest.mark.parametrize("direction", SIX)
def test_a_routine_drives_two_wheels_with_equal_and_opposite_speeds(direction: int) -> None:
    made = driven((routine(BASE, direction, 0.3),))
    signs = np.sign(made.trajectory.angles)
    assert (signs == SIX[direction]).all()
    assert np.abs(made.trajectory.angles.sum(axis=1)).max() < 1e-12
    assert routine(BASE, direction, 0.3).signs == SIX[direction]


@pytest.mark.parametrize("direction", SIX)
def test_a_routine_goes_its_way_without_turning(direction: int) -> None:
    at = end(driven((routine(BASE, direction, 0.3),)))
    expected = (0.3 * cos(radians(direction)), 0.3 * sin(radians(direction)), 0)
    assert at == pytest.approx(expected, abs=1e-12)


def test_motor_turns_and_counts_are_the_specification_s() -> None:
    # π d = 251.327 mm; L = 1 m: 16 · 1000 · sin 60° / 251.327 turns, 2048 counts each
    travel = routine(BASE, 60, 1.0).travel
    assert travel is not None
    assert travel.wheel_m == pytest.approx(sqrt(3) / 2)
    assert travel.motor_turns == pytest.approx(16 * 1000 * sin(pi / 3) / 251.327, rel=1e-5)
    assert travel.counts == pytest.approx(2048 * 16 * 1000 * sin(pi / 3) / (pi * 80))


def test_the_wheels_turn_as_far_as_the_way_needs() -> None:
    made = driven((routine(BASE, 300, 0.5),))
    turned = made.trajectory.angles.sum(axis=0) * 0.02
    assert turned * 0.040 == pytest.approx([0.5 * sin(pi / 3), 0, -0.5 * sin(pi / 3)])


def test_other_directions_and_negative_distances_are_no_routine() -> None:
    with pytest.raises(InputError, match=r"90° is not one of the six directions"):
        routine(BASE, 90, 0.1)
    with pytest.raises(InputError, match="take the opposite direction"):
        routine(BASE, 60, -0.1)


def test_90_degrees_is_as_far_along_60_as_along_120() -> None:
    one, two = decomposed(BASE, (0.0, 0.3))
    assert (one.direction_deg, two.direction_deg) == (60, 120)
    assert one.length == pytest.approx(0.3 / (2 * cos(pi / 6)))
    assert two.length == pytest.approx(one.length)


@settings(max_examples=200)
@given(st.floats(-1, 1), st.floats(-1, 1))
def test_the_parts_of_any_way_add_up_to_it_in_six_directions(x: float, y: float) -> None:
    parts = decomposed(BASE, (x, y))
    assert len(parts) <= 2
    assert all(part.direction_deg in SIX for part in parts)
    assert sum(part.displacement[0] for part in parts) == pytest.approx(x, abs=1e-9)
    assert sum(part.displacement[1] for part in parts) == pytest.approx(y, abs=1e-9)


def test_a_stretch_in_any_other_direction_takes_three_wheels() -> None:
    made = driven((translation(BASE, (0.0, 0.3)),))
    assert translation(BASE, (0.0, 0.3)).direction_deg is None
    assert (made.trajectory.angles != 0).all()
    assert end(made) == pytest.approx((0, 0.3, 0), abs=1e-12)


POLYGONS = {
    "square": [(0, 0), (0.3, 0), (0.3, 0.3), (0, 0.3)],
    "triangle": [(0, 0), (0.4, 0), (0.2, 0.2 * sqrt(3))],
    "hexagon": [(0.2 * cos(k * pi / 3), 0.2 * sin(k * pi / 3)) for k in range(6)],
    "kite": [(0, 0), (0.1, -0.25), (0.5, 0.05), (0.07, 0.31)],
}


@pytest.mark.parametrize("using", ["any", "six"])
@pytest.mark.parametrize("name", POLYGONS)
def test_a_contour_passes_its_corners_and_closes_without_turning(name: str, using: str) -> None:
    corners = POLYGONS[name]
    made = driven(contour(BASE, corners, using))  # type: ignore[arg-type]
    at = positions(BASE, made.trajectory.angles, 0.02)
    assert np.abs(at[:, 2]).max() < 1e-12
    assert at[-1] == pytest.approx((0, 0, 0), abs=1e-12)
    for corner in corners:
        away = at[:, :2] + corners[0] - corner
        assert np.hypot(*away.T).min() < 1e-9


@pytest.mark.parametrize("name", ["triangle", "hexagon"])
def test_contours_of_the_six_directions_are_routines_only(name: str) -> None:
    parts = contour(BASE, POLYGONS[name], "any")
    assert [part.direction_deg in SIX for part in parts] == [True] * len(POLYGONS[name])
    assert parts == contour(BASE, POLYGONS[name], "six")


def test_a_contour_that_comes_back_by_itself_has_no_stretch_of_no_length() -> None:
    assert len(contour(BASE, [(0, 0), (0.1, 0), (0.1, 0), (0, 0)])) == 2


def test_a_contour_without_length_is_refused() -> None:
    with pytest.raises(InputError, match="the contour has no length"):
        contour(BASE, [(0.1, 0.1), (0.1, 0.1)])


def test_ramps_change_the_time_but_not_the_way() -> None:
    made = driven((routine(BASE, 0, 0.3),), ramp_s=Fraction(1, 5))
    speeds = np.abs(made.trajectory.angles[:, 0])
    assert (np.diff(speeds[:10]) > 0).all()
    assert (np.diff(speeds[-10:]) < 0).all()
    assert made.frames[0] == 160
    assert end(made) == pytest.approx((0.3, 0, 0), abs=1e-12)


def test_a_stretch_shorter_than_its_ramps_is_still_the_way() -> None:
    made = driven((routine(BASE, 0, 0.002),), ramp_s=Fraction(1, 5))
    assert end(made) == pytest.approx((0.002, 0, 0), abs=1e-12)
    assert np.hypot(*np.diff(positions(BASE, made.trajectory.angles, 0.02)[:, :2], axis=0).T).max() <= 0.002


def test_a_drive_without_end_is_refused() -> None:
    with pytest.raises(InputError, match="frames long"):
        driven((routine(BASE, 0, 1e6),), 1e-3)
    with pytest.raises(InputError, match="the speed must be more than 0"):
        driven((routine(BASE, 0, 1.0),), 0.0)


def test_equal_wheels_turn_the_base_on_the_spot() -> None:
    at = positions(BASE, np.full((50, 3), 1.0), 0.02)
    assert at[-1] == pytest.approx((0, 0, -0.040 / 0.135), abs=1e-12)


def test_one_wheel_alone_drives_a_circle_of_twice_the_wheel_distance() -> None:
    # table 10.1: "medium", radius 2l; a whole circle takes 2π / |Ω| with Ω = r ω / (3 l)
    omega = 0.040 / (3 * 0.135)
    frames = 500
    at = positions(BASE, np.tile([1.0, 0, 0], (frames, 1)), 2 * pi / omega / frames)
    assert at[-1, :2] == pytest.approx((0, 0), abs=1e-9)
    centre = at[:, :2].mean(axis=0)
    assert np.hypot(*(at[:-1, :2] - at[:-1, :2].mean(axis=0)).T) == pytest.approx(
        np.full(frames, 0.27), abs=1e-4
    ), centre


def test_whole_cycles_of_the_pulses_are_what_a_closing_error_comes_from() -> None:
    # speeds as a 1 µs clock gives them at 1.5 °/s a microsecond: the square no longer closes, by millimetres
    made = driven(contour(BASE, POLYGONS["kite"]), 0.08)
    step = math.radians(1.5)
    rounded = np.round(made.trajectory.angles / step) * step
    dx, dy, turn = positions(BASE, rounded, 0.02)[-1]
    assert 1e-5 < math.hypot(dx, dy) < 0.02
    assert abs(turn) < 0.1


# ---- routines by name -----------------------------------------------------------------------------------

ODD = {"counter-clockwise": (90, 210, 330), "clockwise": (30, 150, 270)}
BEGINS = {"small-circle": ODD, "large-circle": ODD} | {
    "medium-circle": {"counter-clockwise": (30, 150, 270), "clockwise": (90, 210, 330)}
}
RADIUS = {"small-circle": 1, "medium-circle": 2, "large-circle": 4}


def named(name: str, **values: float) -> PlannedDrive:
    return drive(BASE.routine(Routine(name, **values)), 0.1, PERIOD, CLOCK, wheels=WHEELS)


@pytest.mark.parametrize("degrees", [90, -90, 720])
def test_a_turn_is_on_the_spot_with_all_wheels_alike(degrees: float) -> None:
    made = named("turn", turn=radians(degrees))
    assert end(made) == pytest.approx((0, 0, radians(degrees)), abs=1e-9)
    assert np.ptp(made.trajectory.angles, axis=1).max() < 1e-12
    # the rims go at up to the drive's speed: l θ at 0.1 m/s
    assert made.frames == (math.ceil(0.135 * radians(abs(degrees)) / 0.1 / 0.02),)


@pytest.mark.parametrize("sense", ODD)
@pytest.mark.parametrize("name", RADIUS)
def test_a_circle_has_its_radius_its_beginning_and_its_sense(name: str, sense: str) -> None:
    sign = 1 if sense == "counter-clockwise" else -1
    for begin in BEGINS[name][sense]:
        made = named(name, direction=radians(begin), turn=sign * 2 * pi)
        at = positions(BASE, made.trajectory.angles, 0.02)
        assert at[-1] == pytest.approx((0, 0, sign * 2 * pi), abs=1e-9)
        # counter-clockwise the centre of the circle lies to the left of where the base goes at first
        towards = radians(begin + sign * 90)
        centre = RADIUS[name] * 0.135 * np.array([cos(towards), sin(towards)])
        assert np.hypot(*(at[:, :2] - centre).T) == pytest.approx(RADIUS[name] * 0.135)
        first = at[1, :2] / np.hypot(*at[1, :2])
        assert first == pytest.approx([cos(radians(begin)), sin(radians(begin))], abs=0.02)


def test_all_motions_of_the_table_but_standing_are_routines() -> None:
    signs = {tuple(np.sign(driven((routine(BASE, way, 0.1),)).trajectory.angles[0]).tolist()) for way in SIX}
    signs |= {tuple(np.sign(named("turn", turn=turn).trajectory.angles[0]).tolist()) for turn in (1.0, -1.0)}
    for name, senses in BEGINS.items():
        for sense, begins in senses.items():
            turn = 1.0 if sense == "counter-clockwise" else -1.0
            for begin in begins:
                made = named(name, direction=radians(begin), turn=turn)
                signs.add(tuple(np.sign(made.trajectory.angles[0]).tolist()))
    assert len(signs) == 26
    assert (0, 0, 0) not in signs


def test_a_translation_by_name_is_the_routine_of_the_lab() -> None:
    (stretch,) = BASE.routine(Routine("translation", radians(60), 0.3))
    assert stretch == as_stretch(BASE, routine(BASE, 60, 0.3))
    assert end(named("translation", direction=radians(90), distance=0.3)) == pytest.approx((0, 0.3, 0))
    two = BASE.routine(Routine("translation", radians(90), 0.3), "six")
    assert ["two wheels" in each.text for each in two] == [True, True]


def test_a_turn_names_its_motor_turns_and_counts() -> None:
    # the rim goes l θ: 135 mm π/2, over 251.327 mm a turn, times 16, times 2048
    (stretch,) = BASE.routine(Routine("turn", turn=pi / 2))
    turns = 16 * 135 * pi / 2 / (pi * 80)
    assert turns == pytest.approx(13.5)
    assert stretch.remark.endswith("13.500 motor turns, 27648 counts")


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        (Routine("spin", turn=1.0), "'spin' is not a routine"),
        (Routine("turn"), "turn needs turn_deg"),
        (Routine("turn", turn=0.0), "turn_deg must not be 0"),
        (Routine("turn", distance=1.0, turn=1.0), "turn does not take distance_mm"),
        (Routine("translation", 0.0), "translation needs distance_mm"),
        (Routine("translation", 0.0, -1.0), "distance_mm must be more than 0, not -1000"),
        (Routine("small-circle", radians(90), turn=-1.0), "towards 90° turns clockwise"),
        (Routine("small-circle", radians(91), turn=1.0), "towards 91° turns counter-clockwise"),
    ],
)
def test_what_is_not_a_routine_is_refused(asked: Routine, message: str) -> None:
    with pytest.raises(InputError, match=message):
        BASE.routine(asked)
