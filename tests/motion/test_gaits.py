"""Gaits are phase tables; the stability margin is the signed distance from the support polygon."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from servogen.errors import InputError
from servogen.motion.gait.phases import Gait, custom, gait
from servogen.motion.gait.stability import margin
from tests.motion.robots import hexapod


def in_the_air(made: Gait, time: Fraction) -> set[str]:
    return {leg for leg, lift in made.lifts if (time - lift) % 1 < made.swing}


@pytest.mark.parametrize(("name", "duty", "airborne"), [("tripod", 3, 3), ("ripple", 4, 2), ("wave", 5, 1)])
def test_the_named_gaits_always_have_as_many_legs_in_the_air(name: str, duty: int, airborne: int) -> None:
    made = gait(name, hexapod())
    assert made.duty == Fraction(duty, 6)
    for twelfth in range(1, 24, 2):
        assert len(in_the_air(made, Fraction(twelfth, 24))) == airborne


@pytest.mark.parametrize("name", ("tripod", "ripple", "wave"))
def test_no_two_neighbours_are_ever_in_the_air_together(name: str) -> None:
    neighbours = [("L1", "L2"), ("L2", "L3"), ("R1", "R2"), ("R2", "R3"), ("L1", "R1"), ("L3", "R3")]
    for twelfth in range(1, 24, 2):
        airborne = in_the_air(gait(name, hexapod()), Fraction(twelfth, 24))
        assert not any({one, other} <= airborne for one, other in neighbours)


@pytest.mark.parametrize("name", ["ripple", "wave"])
def test_on_each_side_the_steps_run_from_the_rear_to_the_front(name: str) -> None:
    lifts = dict(gait(name, hexapod()).lifts)
    for side in "LR":
        first = lifts[f"{side}3"]
        assert (lifts[f"{side}2"] - first) % 1 < (lifts[f"{side}1"] - first) % 1


@pytest.mark.parametrize(("name", "grain"), [("tripod", 2), ("ripple", 6), ("wave", 6)])
def test_a_cycle_can_be_divided_so_that_every_leg_lifts_on_a_frame(name: str, grain: int) -> None:
    assert gait(name, hexapod()).grain == grain


def test_a_gait_can_be_given_by_duty_factor_and_phases() -> None:
    made = custom("mine", 0.667, [0, 0.5, 0, 0.5, 0, 0.5], hexapod())
    assert made.duty == Fraction(2, 3)
    assert dict(made.lifts)["L2"] == Fraction(1, 2)


@pytest.mark.parametrize(
    ("duty", "lifts", "says"),
    [
        (0.5, [0.0] * 5, "5 phases for 6 legs"),
        (0.5, [0, 0, 0, 0, 0, 1.0], "the phase of R3 is 1"),
        (0.5, {"L1": 0}, "the phase of the leg L2 is missing"),
        (0.5, {"L7": 0}, "has no leg 'L7'"),
        (1.0, [0.0] * 6, "the duty factor is between 0 and 1, at least 1/24 away from both, not 1"),
        (0.0, [0.0] * 6, "the duty factor is between 0 and 1, at least 1/24 away from both, not 0"),
    ],
)
def test_a_gait_that_is_none_is_refused(duty: float, lifts: list[float], says: str) -> None:
    with pytest.raises(InputError, match=says):
        custom("mine", duty, lifts, hexapod())


def test_an_unknown_gait_is_refused_with_the_nearest() -> None:
    with pytest.raises(InputError, match="did you mean 'tripod'"):
        gait("tripot", hexapod())


def test_a_named_gait_needs_three_legs_on_each_side() -> None:
    with pytest.raises(InputError, match="three or four legs on each side: hexapod has 1 on the left and 0"):
        gait("wave", hexapod().with_leg("L1"))


coordinate = st.integers(-20, 20).map(lambda value: value / 10)


@settings(max_examples=150)
@given(
    feet=st.lists(st.tuples(coordinate, coordinate), min_size=1, max_size=6),
    centre=st.tuples(coordinate, coordinate),
)
def test_the_margin_is_the_least_over_all_directions(
    feet: list[tuple[float, float]], centre: tuple[float, float]
) -> None:
    # The signed distance from a convex set is the least of: its reach in a direction less the point's.
    turn = np.linspace(0, 2 * math.pi, 7201)
    directions = np.stack([np.cos(turn), np.sin(turn)])
    points, point = np.array(feet), np.array(centre)
    least = float(((points @ directions).max(axis=0) - point @ directions).min())
    assert margin(points, point) == pytest.approx(least, abs=2e-3)


@given(
    duty=st.floats(0.05, 0.95),
    lifts=st.lists(st.floats(0, 0.999), min_size=6, max_size=6),
    count=st.integers(4, 200),
)
def test_on_frames_every_leg_lifts_and_lands_on_one_and_the_order_stays(
    duty: float, lifts: list[float], count: int
) -> None:
    asked = custom("mine", duty, lifts, hexapod())
    made = asked.on_frames(count)
    assert count % made.grain == 0
    assert 0 <= asked.swing - made.swing < Fraction(1, count)
    for (leg, before), (same, after) in zip(asked.lifts, made.lifts, strict=True):
        away = abs(after - before) % 1
        assert leg == same
        assert min(away, 1 - away) <= Fraction(1, 2 * count)
    for one, first in asked.lifts:
        for other, second in asked.lifts:
            gap = (second - first - asked.swing) % 1
            new = (dict(made.lifts)[other] - dict(made.lifts)[one] - made.swing) % 1
            if asked.swing + gap < 1:  # `other` lifted after `one` had landed: it still does
                assert made.swing + new <= 1, (one, other)


@pytest.mark.parametrize("name", ("tripod", "ripple", "wave"))
def test_a_gait_that_is_on_the_frames_already_is_not_moved(name: str) -> None:
    asked = gait(name, hexapod())
    assert asked.on_frames(48) == asked
    assert asked.on_frames(48).changes_from(asked, 48) == ()


def test_what_moves_by_more_than_half_a_frame_is_said() -> None:
    """A third of 50 frames is 16.67: a swing of 16, two thirds of a frame shorter. No lift moves so far."""
    asked = gait("ripple", hexapod())
    (change,) = asked.on_frames(50).changes_from(asked, 50)
    assert (change.what, change.used, change.frames) == ("duty", Fraction(34, 50), Fraction(2, 3))
    assert change.text() == "the duty factor is 0.68 of the cycle, not 0.6667: 0.67 frames"
