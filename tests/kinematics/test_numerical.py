"""The numerical inverse kinematics: how many starts and steps it takes, and what it measures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from servogen.kinematics.catalogue import arm
from servogen.kinematics.forward import fk, fk_position
from servogen.kinematics.inverse import numerical
from servogen.kinematics.inverse.numerical import NumericalSolution, improved, limits, search
from servogen.kinematics.inverse.solve import solutions_near
from servogen.kinematics.jacobian import jacobian
from servogen.kinematics.orientation import rotation_vector
from servogen.kinematics.transforms import wrapped
from servogen.robot.model import Arm

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
    monkeypatch.setattr(numerical, "descend", lambda robot, q, *rest: q)  # no descent could help
    rows = counted(monkeypatch, "descend")
    found = search(SCARA, [9.0, 0.0, 0.0])
    assert rows == [1, 39]
    assert found.distance_m[0] > 8
    rows.clear()
    search(SCARA, np.tile([9.0, 0.0, 0.0], (171, 1)), starts=6)
    assert rows == [171, 2 * 171, 2 * 171, 171]
    rows.clear()
    search(SCARA, np.tile([9.0, 0.0, 0.0], (600, 1)), starts=3)
    assert rows == [600, 600, 600]


def test_the_solution_near_a_configuration_is_searched_from_there_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """In the turn of the start, with the elbow on its side; one search, even for a target out of reach."""
    waist, *others = SCARA.joints
    robot = replace(SCARA, closed_form=None, joints=(replace(waist, lower=-9.0, upper=9.0), *others))
    wanted = np.array([[0.4, 0.8, 0.1, 0.0], [0.4 + 2 * np.pi, -0.8, 0.1, 0.0]])
    near = wanted + np.array([0.05, -0.1, 0.01, 0.0])
    found = solutions_near(robot, fk_position(robot, wanted), None, near)
    assert found.shape == (2, 1, 4)
    assert found[:, 0, :3] == pytest.approx(wanted[:, :3], abs=1e-6)
    monkeypatch.setattr(numerical, "descend", lambda robot, q, *rest: q)  # no descent could help
    rows = counted(monkeypatch, "descend")
    assert np.isnan(solutions_near(robot, [[9.0, 0.0, 0.0]], None, near[:1])).all()
    assert rows == [1]


def test_all_starts_but_the_first_are_random(monkeypatch: pytest.MonkeyPatch) -> None:
    guesses: list[np.ndarray] = []
    monkeypatch.setattr(numerical, "descend", lambda robot, q, *rest: guesses.append(q) or q)
    search(SCARA, np.tile([9.0, 0.0, 0.0], (300, 1)), starts=3)
    first, second, third = guesses
    assert (first == SCARA.home).all()
    lower, upper = limits(SCARA)
    for guess in (second, third):
        assert (guess != first)[:, :3].all()
        assert ((guess >= lower) & (guess <= upper)).all()
        assert (np.ptp(guess, axis=0)[:3] > 0.95 * (upper - lower)[:3]).all()
        assert (guess[:, 3] == SCARA.home[3]).all()  # without an orientation it has no effect
    assert (second != third)[:, :3].all()


def test_a_target_that_is_met_at_once_needs_one_start_and_few_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """From a tenth of a radian away: a method of second order squares the error in each step, of two
    evaluations; 0.1, 0.01, 1e-4, 1e-8, 1e-16.
    """
    q = np.array([[0.3, 0.5, -0.9, 0.4, 0.2]])
    target = fk(RV_M1, q)
    starts, evaluations = counted(monkeypatch, "descend"), counted(monkeypatch, "with_pose")
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
    assert numerical.arm_size(SCARA) == pytest.approx(rows + slide.upper - slide.lower)
    further = replace(slide, lower=slide.lower - 0.05)
    longer = replace(SCARA, joints=(*SCARA.joints[:2], further, SCARA.joints[3]))
    assert numerical.arm_size(longer) == pytest.approx(numerical.arm_size(SCARA) + 0.05)
    assert lengths["l1"] + lengths["l2"] < rows <= 2 * sum(lengths.values())


def by_the_book(
    robot: Arm, q: np.ndarray, position: np.ndarray, rotation: np.ndarray | None, steps: int
) -> np.ndarray:
    """Return `q` after steps of Levenberg and Marquardt with the acceleration of Transtrum and Sethna.

    One target, dense least squares: δ minimises |J δ - e|² + λ |δ|², the acceleration a the same for the
    second derivative of e along δ; the step is δ + a/2 if |a/2| < |δ|/2, and δ otherwise. λ is a factor, 0.01
    at first, a fifth after a step that helps and eight times as much after one that does not, times |e|² up
    to 1. A radian counts as half the arm's size; a joint at a limit beyond which it should go stands still.
    """
    lower, upper = limits(robot)
    free = np.array([joint.turning for joint in robot.joints]) & (upper - lower > 6.283)
    weight = 0.5 * numerical.arm_size(robot)

    def error(at: np.ndarray) -> np.ndarray:
        pose = fk(robot, at)
        parts = [position - pose[:3, 3]]
        if rotation is not None:
            parts.append(weight * rotation_vector(rotation @ pose[:3, :3].T))
        return np.concatenate(parts)

    def least_squares(matrix: np.ndarray, wanted: np.ndarray, damping: float) -> np.ndarray:
        whole = np.vstack([matrix, np.sqrt(damping) * np.eye(len(q))])
        return np.linalg.lstsq(whole, np.concatenate([wanted, np.zeros(len(q))]), rcond=None)[0]

    factor, h = 0.01, 0.1
    for _ in range(steps):
        e = error(q)
        matrix = jacobian(robot, q)[: len(e)] * np.repeat([1.0, weight], 3)[: len(e), None]
        downhill = matrix.T @ e
        stuck = ~free & (((q <= lower) & (downhill < 0)) | ((q >= upper) & (downhill > 0)))
        matrix = np.where(stuck, 0.0, matrix)
        damping = factor * min(float(e @ e), 1.0)
        # A column of zeros need not give exactly 0: the joint would stand a rounding beside its limit.
        step = np.where(stuck, 0.0, least_squares(matrix, e, damping))
        second = 2 / h * ((e - error(q + h * step)) / h - jacobian_times(robot, q, step, weight)[: len(e)])
        half = np.where(stuck, 0.0, -0.5 * least_squares(matrix, second, damping))
        if np.linalg.norm(half) < 0.5 * np.linalg.norm(step):
            step = step + half
        trial = np.where(free, q + step, np.clip(q + step, lower, upper))
        better = error(trial) @ error(trial) < e @ e
        q, factor = (trial, factor / 5) if better else (q, factor * 8)
    return np.where(free, (lower + upper) / 2 + wrapped(q - (lower + upper) / 2), q)


def jacobian_times(robot: Arm, q: np.ndarray, step: np.ndarray, weight: float) -> np.ndarray:
    return jacobian(robot, q) @ step * np.repeat([1.0, weight], 3)


def test_a_descent_is_that_of_the_book() -> None:
    random = np.random.default_rng(16)
    joints = [replace(joint, lower=-np.pi / 2, upper=3 * np.pi / 2) for joint in RV_M1.joints]
    joints[1] = replace(joints[1], lower=-3.1, upper=3.1)  # less than a turn
    turning = replace(RV_M1, joints=tuple(joints))
    for robot, oriented in ((RV_M1, True), (SCARA, False), (turning, True), (arm("irb6400c"), True)):
        lower, upper = limits(robot)
        start, goal = random.uniform(lower, upper, (2, 4, len(lower)))
        start[0], start[1] = lower, np.where(np.arange(len(lower)) % 2, upper, start[1])
        goal[:2] = goal[2]
        pose = fk(robot, goal)
        pose[0, :3, 3] *= 4  # out of reach
        position, rotation = pose[:, :3, 3], pose[:, :3, :3] if oriented else None
        found = numerical.descend(robot, start, position, rotation, 1e-10, 4)
        for row in range(len(start)):
            turn = None if rotation is None else rotation[row]
            wanted = by_the_book(robot, start[row], position[row], turn, 4)
            assert found[row] == pytest.approx(wanted, abs=1e-6), (robot.name, row)
