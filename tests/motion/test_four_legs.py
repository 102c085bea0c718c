"""A body on four legs leans before a foot lifts; on legs of three joints it stands over its feet as asked."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.kinematics.catalogue import robot
from servogen.kinematics.hexapod import Hexapod
from servogen.kinematics.protocol import Posture
from servogen.motion.gait.lean import Lean, least_rest, offset_over
from servogen.motion.gait.phases import gait
from servogen.motion.gait.quasistatic import rigid_body_path
from servogen.motion.gait.stability import margin
from servogen.motion.gait.steps import Segment
from servogen.motion.gait.walk import Walk, walk
from servogen.robot.model import Mount
from servogen.units import Clock, Cycles

STRIDE = Segment(forward=0.03, cycles=2)


STANDS = Posture()


def walked(
    name: str, *segments: Segment, posture: Posture = STANDS, rhythm: str = "crawl", count: int = 96
) -> Walk:
    found = robot(name)
    assert isinstance(found, Hexapod)
    return walk(
        found,
        gait(rhythm, found),
        segments,
        posture,
        Cycles(20_000),
        Clock(4_000_000),
        frames_per_cycle=count,
    )


@pytest.mark.parametrize(
    "segment",
    [
        STRIDE,
        Segment(left=0.02, cycles=1),
        Segment(turn=0.15, cycles=1),
        Segment(forward=0.02, turn=0.1, cycles=1.5),
    ],
)
def test_a_crawl_keeps_its_margin_from_standstill_to_standstill_and_no_foot_slips(segment: Segment) -> None:
    made = walked("quadruped-coxa-femur-tibia", segment)
    assert made.minimum_margin_m == pytest.approx(0.01, abs=0.003)
    assert made.largest_correction_m < 1e-12
    path = rigid_body_path(made.feet, (0.0, 0.0), made.ground).pose[-1]
    position, heading = segment.travelled(np.array(segment.cycles))
    assert path == pytest.approx([float(position.real), float(position.imag), float(heading)], abs=1e-5)
    moving = np.abs(np.diff(made.trajectory.angles, axis=0)).max(axis=1)
    assert moving.max() < 0.2, "no joint jumps"


def test_without_its_lean_a_crawl_is_refused() -> None:
    with pytest.raises(InputError, match="falls over"):
        walked("quadruped-coxa-femur-tibia", STRIDE, posture=Posture(margin=0.0, body_height=0.08))
    with pytest.raises(InputError, match="leaves no time in which the body could lean"):
        walked("quadruped-coxa-femur-tibia", STRIDE, posture=Posture(margin=0.01), rhythm="trot")


def test_an_endless_crawl_repeats_without_a_jump() -> None:
    made = walked("quadruped-coxa-femur-tibia", Segment(forward=0.03))
    angles, start = made.trajectory.angles, made.trajectory.loop_start
    across = np.abs(angles[start] - angles[-1]).max()
    inside = np.abs(np.diff(angles[start:], axis=0)).max()
    assert across <= inside


def test_legs_of_two_joints_lean_along_the_body() -> None:
    made = walked("quadruped-hip-lift", STRIDE)
    assert made.minimum_margin_m == pytest.approx(0.005, abs=0.002)
    x, y, yaw = rigid_body_path(made.feet, (0.0, 0.0), made.ground).pose[-1]
    assert (x, abs(yaw)) == (pytest.approx(0.06, rel=0.02), pytest.approx(0.0, abs=math.radians(1.5)))
    assert abs(y) < 0.002


def test_the_body_stands_over_its_feet_as_asked_while_it_walks() -> None:
    plain, posed = (
        walked("hexapod-coxa-femur-tibia", Segment(forward=0.03), posture=posture, rhythm="tripod", count=24)
        for posture in (
            Posture(body_height=0.08),
            Posture(body_height=0.08, shift=0.01 - 0.005j, yaw=0.1, roll=0.05, pitch=-0.06),
        )
    )
    # The same pattern of feet, seen from a body that is shifted and turned over them.
    before, after = ((made.feet + made.corrections)[0, :, :2] @ [1, 1j] for made in (plain, posed))
    assert (before.mean() - (after * np.exp(0.1j)).mean()) == pytest.approx(0.01 - 0.005j, abs=0.004)
    assert np.ptp(posed.feet[posed.ground][:, 2]) < 1e-12
    x, y, yaw = rigid_body_path(posed.feet, (0.0, 0.0), posed.ground).pose[posed.trajectory.loop_start]
    x_end, y_end, yaw_end = rigid_body_path(posed.feet, (0.0, 0.0), posed.ground).pose[-1]
    assert (x_end - x, y_end - y, yaw_end - yaw) == pytest.approx((0.03 * 23 / 24, 0.0, 0.0), abs=1e-4)


def test_an_offset_puts_the_centre_its_margin_inside_every_polygon() -> None:
    chance = np.random.default_rng(61)
    for _ in range(50):
        corners = 0.1 * np.exp(1j * (np.array([0.3, 1.9, 3.6, 5.2]) + chance.uniform(-0.2, 0.2, 4)))
        others = np.delete(corners, int(chance.integers(4)))
        offset = offset_over([others], 0j, 0.012, along_x=False)
        inside = margin(np.stack([others.real, others.imag], axis=1), np.array([offset.real, offset.imag]))
        assert inside == pytest.approx(0.012, abs=1e-6) or offset == 0
    assert offset_over([np.array([1 + 1j, -1 + 1j, -1 - 1j, 1 - 1j])], 0j, 0.5, along_x=False) == 0


def test_a_lean_passes_from_offset_to_offset_at_rest_at_both_ends() -> None:
    lean = Lean(np.array([0.0, 1.0, 2.0, 3.0]), np.array([0j, 0j, 1 + 2j, 1 + 2j]))
    assert lean.at(np.array([-5.0, 0.5, 1.0, 1.5, 2.0, 2.5, 9.0])) == pytest.approx(
        [0, 0, 0, 0.5 + 1j, 1 + 2j, 1 + 2j, 1 + 2j]
    )
    around = np.abs(np.diff(lean.at(np.array([1.0, 1.001, 1.5, 1.501, 1.999, 2.0]))))
    assert around[[0, 4]].max() < 1e-6 < around[2]


def test_eight_legs_have_gaits_and_a_gait_for_other_bodies_names_those_that_fit() -> None:
    found = robot("hexapod-hip-lift")
    assert isinstance(found, Hexapod)
    eight = replace(
        found,
        mounts=tuple(
            Mount(f"{side}{row}", 0.12 - 0.08 * row, y, 0.0, 0.0, y < 0)
            for side, y in (("L", 0.05), ("R", -0.05))
            for row in range(4)
        ),
    )
    for name, up in (("tetrapod", 4), ("wave", 1)):
        made = walk(
            eight,
            gait(name, eight),
            [Segment(forward=0.02)],
            Posture(),
            Cycles(20_000),
            Clock(4_000_000),
            frames_per_cycle=48,
        )
        assert (~made.ground).sum(axis=1).max() == up
        assert made.minimum_margin_m > 0.02
    assert least_rest(gait("wave", eight)) == 0
    with pytest.raises(InputError, match="for three legs on each side") as caught:
        gait("tripod", eight)
    assert "its gaits: wave, tetrapod" in (caught.value.hint or "")
