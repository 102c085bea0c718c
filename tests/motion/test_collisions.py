"""Legs that meet: the distance of their centre lines, against points along them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.kinematics.catalogue import robot
from servogen.kinematics.hexapod import Hexapod
from servogen.kinematics.protocol import Posture
from servogen.motion.gait.collisions import nearest_collision, segment_distance
from servogen.motion.gait.phases import gait
from servogen.motion.gait.steps import Segment
from servogen.motion.gait.walk import walk
from servogen.robot.model import Mount
from servogen.units import Clock, Cycles


def test_the_distance_of_two_segments_is_the_least_of_their_points() -> None:
    chance = np.random.default_rng(51)
    a, b, c, d = chance.normal(size=(4, 300, 3))
    b[:20], c[:20] = a[:20] + (d[:20] - c[:20]), c[:20]  # parallel
    d[20:30] = c[20:30]  # a point
    share = np.linspace(0, 1, 101)[:, None, None]
    one, other = a + share * (b - a), c + share * (d - c)
    sampled = np.linalg.norm(one[:, None] - other[None], axis=-1).min(axis=(0, 1))
    found = segment_distance(a, b, c, d)
    assert (found <= sampled + 1e-12).all()
    assert (sampled - found).max() < 0.03, "as near as samples a hundredth of a segment apart can be"


def found(name: str) -> Hexapod:
    chosen = robot(name)
    assert isinstance(chosen, Hexapod)
    return chosen


@pytest.mark.parametrize("name", ["hexapod", "hexapod-hip-lift", "hexapod-coxa-femur-tibia"])
def test_two_legs_that_turn_towards_each_other_meet_and_are_named(name: str) -> None:
    chosen = found(name)
    joints, frames = len(chosen.leg.joints), 21
    angles = np.zeros((frames, 6, joints))
    angles[:, 0, 0] = np.linspace(0.0, 1.2, frames)  # L1 to the rear, L2 to the front
    angles[:, 1, 0] = np.linspace(0.0, -1.2, frames)
    met = nearest_collision(chosen, angles, 0.012)
    assert met is not None
    assert (met.one, met.other) == ("the leg L1", "the leg L2")
    assert met.distance < 0.012
    lines = [chosen.corners(index, angles[met.frame : met.frame + 1, index])[0] for index in (0, 1)]
    share = np.linspace(0, 1, 201)[:, None, None]
    one, other = ((line[:-1] + share * np.diff(line, axis=0)).reshape(-1, 3) for line in lines)
    sampled = np.linalg.norm(one[:, None] - other[None], axis=-1).min()
    assert met.distance <= sampled < met.distance + 0.002
    assert f"come within {1000 * met.distance:.1f} mm of each other in frame {met.frame}" in met.text()
    assert nearest_collision(chosen, np.zeros((1, 6, joints)), 0.012) is None
    assert nearest_collision(chosen, angles, 0.0) is None


def test_a_tibia_that_is_pulled_in_meets_the_body() -> None:
    chosen = found("quadruped-coxa-femur-tibia")
    angles = np.zeros((2, 4, 3))
    angles[1, 2] = [0.0, 0.9, -1.55]
    met = nearest_collision(chosen, angles, 0.03)
    assert met is not None
    assert (met.one, met.other, met.frame) == ("the leg RF", "the body", 1)


def test_a_walk_whose_legs_meet_is_refused_unless_the_gap_allows_it() -> None:
    mounts = [
        Mount(f"{side}{row}", x, y, 0.0, 0.0, y < 0)
        for side, y in (("L", 0.04), ("R", -0.04))
        for row, x in ((1, 0.05), (2, 0.0), (3, -0.05))
    ]
    near = replace(found("hexapod-hip-lift"), mounts=tuple(mounts))

    def walked(stride: float, gap: float = 0.012) -> None:
        ripple = gait("ripple", near)
        walk(
            near,
            ripple,
            [Segment(forward=stride)],
            Posture(),
            Cycles(20_000),
            Clock(4_000_000),
            frames_per_cycle=48,
            gap=gap,
        )

    walked(0.03)
    with pytest.raises(
        InputError, match=r"the leg [LR]\d and the leg [LR]\d come within .* mm of each other in frame"
    ):
        walked(0.06)
    walked(0.06, gap=0.001)
