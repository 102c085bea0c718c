"""A law of motion goes from 0 to 1, and its derivatives are derivatives."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from servogen.errors import InputError
from servogen.motion.laws import NAMES, Law, law
from servogen.motion.limits import JointLimits, fastest

U = np.linspace(0, 1, 2001)
SMOOTH = {"linear": 0, "cubic": 1, "quintic": 2, "trapezoid": 1, "s-curve": 2}
"""The highest derivative that is 0 at both ends and never jumps."""


@pytest.mark.parametrize("name", NAMES)
def test_every_law_goes_from_0_to_1_without_turning_back(name: str) -> None:
    share = law(name).share(U)
    assert (share[0], share[-1]) == (pytest.approx(0, abs=1e-12), pytest.approx(1, abs=1e-12))
    assert (np.diff(share) >= -1e-12).all()


@pytest.mark.parametrize("name", NAMES)
def test_every_law_is_symmetric(name: str) -> None:
    share = law(name).share(U)
    assert share + share[::-1] == pytest.approx(np.ones(len(U)), abs=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_a_law_stands_before_and_after(name: str) -> None:
    assert law(name).share([-1.0, 2.0]).tolist() == pytest.approx([0, 1], abs=1e-12)
    assert law(name).derivative([-1.0, 2.0], 1).tolist() == [0, 0]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("order", [1, 2])
def test_derivatives_are_differences(name: str, order: int) -> None:
    made, step = law(name), 1e-5
    inner = np.linspace(0.013, 0.987, 200)  # no corner of a law is met
    below, above = (
        made.share(inner + side) if order == 1 else made.derivative(inner + side, order - 1)
        for side in (-step, step)
    )
    assert made.derivative(inner, order) == pytest.approx((above - below) / (2 * step), abs=2e-3)


@pytest.mark.parametrize("name", NAMES)
def test_what_must_not_jump_does_not(name: str) -> None:
    for order in range(1, SMOOTH[name] + 1):
        values = law(name).derivative(U, order)
        assert values[[0, -1]] == pytest.approx([0, 0], abs=1e-9)
        assert np.abs(np.diff(values)).max() < 0.2


@pytest.mark.parametrize(
    ("name", "peaks"),
    [  # by hand: cubic 3/2 and 6; quintic 15/8, 10/√3 and 60; trapezoid 1/(1-r) and 1/(r(1-r)) at r = 1/4
        ("linear", (1, 0, 0)),
        ("cubic", (1.5, 6, 12)),
        ("quintic", (1.875, 10 / math.sqrt(3), 60)),
        ("trapezoid", (4 / 3, 16 / 3, 0)),
        ("s-curve", (4 / 3, 32 / 3, 256 / 3)),
    ],
)
def test_the_peaks_are_those_found_by_hand(name: str, peaks: tuple[float, ...]) -> None:
    assert [law(name).peak(order) for order in (1, 2, 3)] == pytest.approx(list(peaks), abs=1e-9)


def test_an_unknown_law_is_refused_with_the_nearest() -> None:
    with pytest.raises(InputError, match="did you mean 'quintic'"):
        law("quintik")


def peaks_of(made: Law, seconds: float, way: float) -> list[float]:
    return [made.peak(order) * way / seconds**order for order in (1, 2, 3)]


limit = st.floats(0.05, 50)


@settings(max_examples=200)
@given(name=st.sampled_from(NAMES), way=st.floats(0.01, 5), speed=limit, acceleration=limit, jerk=limit)
def test_the_fastest_keeps_its_limits_and_touches_one(
    name: str, way: float, speed: float, acceleration: float, jerk: float
) -> None:
    timing = fastest(name, [way], [JointLimits(speed, acceleration, jerk)])
    peaks = peaks_of(timing.law, timing.duration, way)
    used = [peak / most for peak, most in zip(peaks, (speed, acceleration, jerk), strict=True)]
    assert max(used) == pytest.approx(1)


@settings(max_examples=100)
@given(
    name=st.sampled_from(NAMES),
    ways=st.lists(st.sampled_from((0.0, 0.01, -0.5, 1.0, 3.0)), min_size=2, max_size=4),
)
def test_synchronised_joints_all_keep_their_limits_and_one_is_at_its_limit(
    name: str, ways: list[float]
) -> None:
    limits = [JointLimits(1.0 + index, 5.0 + index) for index in range(len(ways))]
    timing = fastest(name, ways, limits)
    if not any(ways):
        assert timing.duration == 0
        return
    used = []
    for way, most in zip(ways, limits, strict=True):
        speed, acceleration, _ = peaks_of(timing.law, timing.duration, abs(way))
        used += [speed / most.speed, acceleration / most.acceleration]
    assert max(used) == pytest.approx(1)


def test_a_move_that_nothing_limits_is_refused() -> None:
    with pytest.raises(InputError, match="the speed of this move is not known"):
        fastest("quintic", [1.0], [JointLimits()])
