"""The numerical inverse kinematics: how many starts and steps it takes, and what it measures."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from servogen.kinematics.catalogue import arm
from servogen.kinematics.forward import fk, fk_position
from servogen.kinematics.inverse import numerical
from servogen.kinematics.inverse.numerical import NumericalSolution, improved, limits, search

RV_M1, SCARA = arm("rv-m1"), arm("scara")


def counted(monkeypatch: pytest.MonkeyPatch, name: str) -> list[int]:
    """Return the list to which each call of a function of the module adds the number of its rows."""
    rows: list[int] = []
    original: Callable[..., object] = getattr(numerical, name)

    def counting(robot: object, q: np.ndarray, *rest: object) -> object:
        rows.append(len(q))
        return original(robot, q, *rest)

    monkeypatch.setattr(numerical, name, counting)
    return rows


def test_a_solution_is_within_a_tolerance_in_both_its_distance_and_its_angle() -> None:
    found = NumericalSolution(
        np.zeros((4, 1)), np.array([1.0, 1.0, 2.0, 0.0]), np.array([1.0, 2.0, 1.0, 0.0])
    )
    assert found.within(1.0).tolist() == [True, False, False, True]
    lower, upper = limits(SCARA)
    assert lower.tolist() == [joint.lower for joint in SCARA.joints]
    assert upper.tolist() == [joint.upper for joint in SCARA.joints]


def test_a_target_out_of_reach_is_given_up_after_forty_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    """One alone: first from home, then 39 at once. Of many as many at once as make 512 rows at most."""
    monkeypatch.setattr(numerical, "_descend", lambda robot, q, *rest: q)  # no descent could help
    rows = counted(monkeypatch, "_descend")
    found = search(SCARA, [9.0, 0.0, 0.0])
    assert rows == [1, 39]
    assert found.distance_m[0] > 8
    rows.clear()
    search(SCARA, np.tile([9.0, 0.0, 0.0], (171, 1)), starts=6)
    assert rows == [171, 2 * 171, 2 * 171, 171]
    rows.clear()
    search(SCARA, np.tile([9.0, 0.0, 0.0], (600, 1)), starts=2)
    assert rows == [600, 600]


def test_a_target_that_is_met_at_once_needs_one_start_and_few_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """From a tenth of a radian away: a method of second order squares the error in each step, of two
    evaluations; 0.1, 0.01, 1e-4, 1e-8, 1e-16.
    """
    q = np.array([[0.3, 0.5, -0.9, 0.4, 0.2]])
    target = fk(RV_M1, q)
    starts, evaluations = counted(monkeypatch, "_descend"), counted(monkeypatch, "with_pose")
    found = search(RV_M1, target[:, :3, 3], target[:, :3, :3], q + 0.1)
    assert found.within(1e-9).all()
    assert found.q == pytest.approx(q, abs=1e-8)
    assert starts == [1]
    assert len(evaluations) <= 1 + 1 + 2 * 6  # one for the joints without an effect, one at the start


def test_nearly_right_positions_are_improved_within_the_limits() -> None:
    random = np.random.default_rng(12)
    lower, upper = limits(RV_M1)
    q = lower + random.uniform(0.4, 0.6, (30, 5)) * (upper - lower)
    target = fk(RV_M1, q)
    better = improved(RV_M1, q + random.uniform(-0.02, 0.02, q.shape), target[:, :3, 3], target[:, :3, :3])
    missed = np.abs(fk(RV_M1, better) - target).max()
    assert missed < 1e-9


def test_joints_without_an_effect_stay_where_they_start() -> None:
    """Without an orientation the last joint of a SCARA turns nothing that is asked for."""
    q = np.array([0.4, 0.8, 0.1, 0.7])
    found = search(SCARA, fk_position(SCARA, q), None, [0.0, 0.5, 0.05, 0.123])
    assert found.distance_m[0] < 1e-9
    assert found.q[0, 3] == pytest.approx(0.123)
    turned = fk(SCARA, q)
    other = search(SCARA, turned[:3, 3], turned[:3, :3], [0.0, 0.5, 0.05, 0.123])
    assert other.within(1e-8).all()
    assert other.q[0, 3] == pytest.approx(0.7)


def test_a_start_beyond_the_limits_begins_at_them_and_the_result_is_within() -> None:
    lower, upper = limits(SCARA)
    for near in (lower - 1, upper + 1):
        found = search(SCARA, [0.3, 0.3, 0.3], None, near)
        assert ((found.q[0] >= lower) & (found.q[0] <= upper)).all()


def test_the_size_of_an_arm_is_the_sum_of_its_lengths_and_slides() -> None:
    """A SCARA's rows: l0 down to the tool in d, l1 and l2 in a, and the travel of q3."""
    lengths = SCARA.length
    slide = SCARA.joints[2]
    rows = sum(abs(row.d.value(lengths)) + abs(row.a.value(lengths)) for row in SCARA.rows)
    assert numerical._reach(SCARA) == pytest.approx(rows + slide.upper - slide.lower)
    assert lengths["l1"] + lengths["l2"] < rows <= 2 * sum(lengths.values())
