"""Lines, arcs and splines go where they should, and their chord error is what it is said to be."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from servogen.errors import InputError
from servogen.motion.follow import ChangesBranch, Inverse, LeavesReach, trace
from servogen.motion.limits import JointLimits
from servogen.motion.moves import fastest_spline, spline
from servogen.motion.paths import SpatialPath, StraightLine, arc

SHARES = np.linspace(0, 1, 101)
coordinate = st.floats(-1, 1)
point = st.tuples(coordinate, coordinate, coordinate)


@settings(max_examples=200)
@given(start=point, through=point, end=point)
def test_an_arc_passes_its_three_points_on_a_circle(
    start: tuple[float, ...], through: tuple[float, ...], end: tuple[float, ...]
) -> None:
    a, b, c = (np.array(each) for each in (start, through, end))
    if np.linalg.norm(np.cross(b - a, c - a)) < 1e-3:
        return
    made = arc(start, through, end)
    points = made.point(SHARES)
    assert points[0] == pytest.approx(a, abs=1e-6)
    assert points[-1] == pytest.approx(c, abs=1e-6)
    assert made.distance(np.array([through]))[0] == pytest.approx(0, abs=1e-6)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert np.ptp(steps) < 1e-9
    assert made.distance(points).max() < 1e-9


@pytest.mark.parametrize("points", [((0, 0, 0), (1, 1, 1), (2, 2, 2)), ((0, 0, 0), (0, 0, 0), (0, 0, 0))])
def test_three_points_of_a_line_are_no_arc(points: tuple[tuple[float, ...], ...]) -> None:
    with pytest.raises(InputError, match="on one line"):
        arc(*points)


# A planar arm of two links of 0.5 m: both solutions by the law of cosines.


def forward(angles: np.ndarray) -> np.ndarray:
    first, both = angles[:, 0], angles.sum(axis=1)
    x, y = 0.5 * (np.cos(first) + np.cos(both)), 0.5 * (np.sin(first) + np.sin(both))
    return np.stack([x, y, np.zeros(len(x))], axis=1)


def solved(points: np.ndarray) -> np.ndarray:
    x, y = points[:, 0], points[:, 1]
    cosine = (x**2 + y**2 - 0.5) / 0.5
    bend = np.where(np.abs(cosine) <= 1 + 1e-12, np.arccos(np.clip(cosine, -1, 1)), np.nan)
    first = np.arctan2(y, x)[:, None] - np.stack([bend, -bend], axis=1) / 2
    return np.stack([first, np.stack([bend, -bend], axis=1)], axis=2)


def inverse_of(path: SpatialPath, most_bend: float = np.pi, counted: list[int] | None = None) -> Inverse:
    """The arm's inverse along a path; its elbow bends to the left by `most_bend` at most."""

    def inverse(shares: np.ndarray, near: np.ndarray) -> np.ndarray:
        if counted is not None:
            counted.append(len(shares))
        found = solved(path.point(shares))
        found[found[..., 1] > most_bend] = np.nan
        return found

    return inverse


def degrees_of(angles: np.ndarray) -> str:
    return " ".join(f"{angle:.2f}" for angle in np.degrees(angles))


LINE = StraightLine((0.9, 0.0, 0.0), (0.3, 0.5, 0.0))


@pytest.mark.parametrize("elbow", [0, 1])
def test_a_traced_path_stays_on_its_branch(elbow: int) -> None:
    start = solved(LINE.point([0.0]))[0, elbow]
    branch = trace(LINE, inverse_of(LINE), start, degrees_of)
    angles = branch.at(SHARES)
    assert (np.sign(angles[:, 1]) == np.sign(start[1])).all()
    assert forward(angles) == pytest.approx(LINE.point(SHARES), abs=1e-12)
    assert branch.end == pytest.approx(angles[-1])


def test_two_frames_end_on_the_same_branch_as_a_thousand() -> None:
    # Past the base at 10 mm the first joint turns by half a turn: seen from the start, the end of the other
    # branch is nearer, so choosing the nearest from frame to frame would change to it.
    passing = StraightLine((0.8, -0.01, 0.0), (-0.8, -0.01, 0.0))
    start = solved(passing.point([0.0]))[0, 0]
    end = solved(passing.point([1.0]))[0]
    assert np.argmin(np.abs(end - start).max(axis=1)) == 1
    branch = trace(passing, inverse_of(passing), start, degrees_of)
    assert branch.at(np.array([0.0, 1.0]))[1] == pytest.approx(end[0])
    assert branch.at(np.linspace(0, 1, 1000))[-1] == pytest.approx(end[0])


@pytest.mark.parametrize("straight_deg", [10.0, 1.0, 0.1])
def test_near_the_stretched_arm_the_branch_is_kept(straight_deg: float) -> None:
    # An arc about the base whose radius grows to that of an elbow bent by so little, and falls again.
    radius = float(np.cos(np.radians(straight_deg / 2)))
    bow = arc((0.8, -0.3, 0.0), (radius, 0.0, 0.0), (0.8, 0.3, 0.0))
    start = solved(bow.point([0.0]))[0, 0]
    angles = trace(bow, inverse_of(bow), start, degrees_of).at(np.linspace(0, 1, 999))
    assert (angles[:, 1] > 0).all()
    assert np.degrees(angles[:, 1].min()) == pytest.approx(straight_deg, rel=1e-2)


def test_a_path_that_touches_the_end_of_the_reach_is_followed() -> None:
    touching = StraightLine((1.0, -0.0, 0.0), (0.2, 0.0, 0.0))
    branch = trace(touching, inverse_of(touching), (0.0, 0.0), degrees_of)
    assert forward(branch.at(SHARES)) == pytest.approx(touching.point(SHARES), abs=1e-7)


def test_a_path_that_would_change_the_branch_is_refused_with_its_place_and_both_branches() -> None:
    # The left elbow bends by 100° at most: |p|² = 0.5 + 0.5 cos 100°, where the line along y = 0 stops.
    along = StraightLine((0.9, 0.0, 0.0), (0.1, 0.0, 0.0))
    start = solved(along.point([0.0]))[0, 0]
    x = math.sqrt(0.5 + 0.5 * math.cos(math.radians(100)))
    counted: list[int] = []
    with pytest.raises(ChangesBranch) as caught:
        trace(along, inverse_of(along, math.radians(100), counted), start, degrees_of)
    assert caught.value.point == pytest.approx((x, 0.0, 0.0), abs=1e-9)
    assert caught.value.branches == ("-50.00 100.00", "50.00 -100.00")
    assert f"({1000 * x:.3f}, 0.000, 0.000) mm: from -50.00 100.00 to 50.00 -100.00" in str(caught.value)
    assert sum(counted) < 4000
    # Without the limit, and from the other elbow, the same line is followed.
    trace(along, inverse_of(along), start, degrees_of)
    trace(along, inverse_of(along, math.radians(100)), -start, degrees_of)


def test_a_start_that_is_not_on_the_path_s_branches_is_refused_there() -> None:
    with pytest.raises(
        ChangesBranch, match=r"at its start, \(900\.000, 0\.000, 0\.000\) mm: from 0.00 57.30 to "
    ):
        trace(LINE, inverse_of(LINE), (0.0, 1.0), degrees_of)


def test_a_single_point_where_the_inverse_does_not_know_a_joint_is_passed() -> None:
    def inverse(shares: np.ndarray, near: np.ndarray) -> np.ndarray:
        found = solved(LINE.point(shares))
        found[shares == 0.5] = [7.0, 7.0]  # half way, as at home where a joint is free
        found[shares == 1.0] = [7.0, 7.0]
        return found

    start = solved(LINE.point([0.0]))[0, 0]
    angles = trace(LINE, inverse, start, degrees_of).at(SHARES)
    assert angles == pytest.approx(solved(LINE.point(SHARES))[:, 0], abs=1e-6)


def test_the_stated_chord_error_is_the_worst_there_is() -> None:
    start = solved(LINE.point([0.0]))[0, 0]
    made = trace(LINE, inverse_of(LINE), start, degrees_of).followed(np.linspace(0, 1, 5), forward)
    dense = np.linspace(0, 4, 4001)
    between = np.stack([np.interp(dense, np.arange(5), column) for column in made.angles.T], axis=1)
    assert made.chord_error_m == pytest.approx(LINE.distance(forward(between)).max(), rel=0.05)
    assert made.missed_m < 1e-12


def test_a_path_out_of_reach_is_refused_with_the_point() -> None:
    beyond = StraightLine((0.5, 0.0, 0.0), (1.5, 0.0, 0.0))
    start = solved(beyond.point([0.0]))[0, 0]
    with pytest.raises(LeavesReach, match=r"leaves the reachable space at \(1000\.000, 0\.000, 0\.000\) mm"):
        trace(beyond, inverse_of(beyond), start, degrees_of)


def test_joints_that_go_to_and_fro_without_end_are_given_up_after_so_many_samples() -> None:
    counted: list[int] = []

    def inverse(shares: np.ndarray, near: np.ndarray) -> np.ndarray:
        counted.append(len(shares))
        return np.stack([shares, 5 * np.sin(1e5 * shares)], axis=1)[:, None]

    with pytest.raises(InputError, match="too steeply there for 16384 samples"):
        trace(StraightLine((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)), inverse, (0.0, 0.0), degrees_of)
    assert sum(counted) <= 16384 + 64


VIA = np.array([[0.0, 0.0], [1.0, -1.0], [0.5, 2.0], [3.0, 0.0]])
TIMES = np.array([0.0, 1.0, 1.5, 4.0])


@pytest.mark.parametrize("closed", [False, True])
def test_a_spline_passes_its_points_without_a_jump_of_speed_or_acceleration(closed: bool) -> None:
    points = np.vstack([VIA[:-1], VIA[:1]]) if closed else VIA
    made = spline(points, TIMES, closed)
    assert made.at(TIMES) == pytest.approx(points)
    for order in (0, 1, 2):
        for time in TIMES[1:-1]:
            assert made.at(time - 1e-9, order) == pytest.approx(made.at(time + 1e-9, order), abs=1e-6)
    if closed:
        for order in (0, 1, 2):
            assert made.at(TIMES[0], order) == pytest.approx(made.at(TIMES[-1], order))
    else:
        assert made.at(TIMES[[0, -1]], 1) == pytest.approx(np.zeros((2, 2)))


def test_the_derivatives_of_a_spline_are_differences() -> None:
    made, times = spline(VIA, TIMES), np.linspace(0.05, 3.95, 77)
    for order in (1, 2):
        slope = (made.at(times + 1e-6, order - 1) - made.at(times - 1e-6, order - 1)) / 2e-6
        assert made.at(times, order) == pytest.approx(slope, abs=1e-4)


def test_the_peaks_of_a_spline_are_its_greatest_values() -> None:
    made, dense = spline(VIA, TIMES), np.linspace(0, 4, 40_001)
    speed, acceleration = made.peaks()
    assert speed == pytest.approx(np.abs(made.at(dense, 1)).max(axis=0), rel=1e-4)
    assert acceleration == pytest.approx(np.abs(made.at(dense, 2)).max(axis=0), rel=1e-3)


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("acceleration", [0.5, 5.0, math.inf])
def test_the_fastest_spline_keeps_its_limits_and_touches_one(closed: bool, acceleration: float) -> None:
    points = np.vstack([VIA, VIA[:1]]) if closed else VIA
    limits = [JointLimits(2.0, acceleration), JointLimits(1.0, 2 * acceleration)]
    speed, peak = fastest_spline(points, limits, closed).peaks()
    used = [*(speed / [2.0, 1.0]), *(peak / [acceleration, 2 * acceleration])]
    assert max(used) == pytest.approx(1)


def test_an_arc_back_to_its_start_is_a_whole_circle_through_the_opposite_point() -> None:
    """Counter-clockwise from above; as level as its diameter, here along x and 3-4-5 upwards along y."""
    level = arc((2, 0, 1), (0, 0, 1), (2, 0, 1))
    assert level.length == pytest.approx(2 * math.pi)
    assert level.point([0, 0.25, 0.5, 1]) == pytest.approx(
        np.array([[2, 0, 1], [1, 1, 1], [0, 0, 1], [2, 0, 1]])
    )
    tilted = arc((0, 0, 0), (0, 8, 6), (0, 0, 0))
    assert tilted.point([0.25, 0.75]) == pytest.approx(np.array([[5, 4, 3], [-5, 4, 3]]))
    assert tilted.distance(np.array([[5.0, 4, 3], [0, 8, 6], [6, 4, 3]])) == pytest.approx([0, 0, 1])
    with pytest.raises(InputError, match="opposite point, which must lie beside the start"):
        arc((1, 2, 3), (1, 2, 4), (1, 2, 3))
