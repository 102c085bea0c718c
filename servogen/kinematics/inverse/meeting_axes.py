"""Inverse kinematics in closed form of any arm of six turning joints whose last or first three axes meet.

In: the arm and targets with an orientation. Out: eight branches; as in `closed_forms` some may be no
solutions.

Only the first three joints place the point w where the axes of the wrist meet. Joint 1 changes neither its
height along axis 1 nor its distance from a point of it; joint 2 turns it in a plane, in which m is the part
of axis 1's direction and g, at right angles to m, the common normal from axis 1 to axis 2:

    axis 1 │          ╱ axis 2     w(q3) = centre + P cos q3 + Q sin q3; u is its part in the plane
           │───g─────╱             height:     m · (u turned by q2) = C(q3)
           │        ╱ ╲ u          distance:   g · (u turned by q2) = F(q3)
           │       ╱   ● w         so (C/|m|)² + (F/|g|)² = |u|², of degree 2 in cos q3 and sin q3: four roots

Where the axes 1 and 2 are parallel (m = 0), C(q3) = 0 gives two q3, each with two q2; where they meet
(g = 0), F(q3) = 0 does. After Pieper, "The kinematics of manipulators under computer control" (Stanford,
1968). If the first three axes meet, they are the wrist of the arm seen from its tool.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from servogen.kinematics.forward import row_axes
from servogen.kinematics.inverse.closed_forms import Branch, TargetComponents, cosine_sine_sum
from servogen.kinematics.orientation import from_axis_angle
from servogen.kinematics.transforms import Floats, inverse
from servogen.robot.model import Arm

MEET = 1e-10
"""Axes that pass a point nearer than this (metres) meet there; lengths and sines below it count as 0."""

LEADING = 1e-13
"""The smallest leading coefficient, as a part of the largest one, with which roots are calculated."""


@dataclass(frozen=True, slots=True, eq=False)
class MeetingAxes:
    """The six axes where all joints are at 0, those of the wrist last: unit vectors and points (6, 3)."""

    direction: Floats
    point: Floats
    joints: tuple[int, ...]
    """The number of the joint that turns about each axis."""
    wrist: Floats
    """The point (3,) where the last three meet."""
    back: Floats
    """The inverse (4, 4) of the tool's pose where all joints are at 0."""
    from_tool: bool
    """Whether the axes are in the order seen from the tool, about which they turn the base."""


@lru_cache(maxsize=64)
def meeting_axes(arm: Arm) -> MeetingAxes | None:
    """Return the axes of an arm whose last three, or else first three, meet; None for any other arm."""
    if len(arm.joints) != 6 or not all(joint.turning for joint in arm.joints):
        return None
    axes, zero = row_axes(arm, np.zeros(6))
    joints = tuple(axis.row.joint for axis in axes if axis.row.joint is not None)
    if sorted(joints) != list(range(6)) or any(abs(axis.row.ratio) != 1.0 for axis in axes):
        return None
    direction = np.stack([axis.row.ratio * axis.direction for axis in axes])
    point = np.stack([axis.point for axis in axes])
    for order in (1, -1):
        wrist = _meeting_point(direction[::order][3:], point[::order][3:])
        if wrist is not None and _places(direction[::order], point[::order], wrist):
            # Seen from the tool a joint turns the other way: about the opposite direction.
            ordered = order * direction[::order]
            return MeetingAxes(ordered, point[::order], joints[::order], wrist, inverse(zero), order < 0)
    return None


def _meeting_point(direction: Floats, point: Floats) -> Floats | None:
    """Return where three lines (3, 3) meet; None if they do not, or if two in a row are parallel."""
    if np.linalg.norm(np.cross(direction[:-1], direction[1:]), axis=1).min() < MEET:
        return None
    across = np.eye(3) - direction[:, :, None] * direction[:, None, :]
    place = np.linalg.solve(across.sum(axis=0), (across @ point[:, :, None]).sum(axis=0))[:, 0]
    missed = np.linalg.norm(across @ (place - point)[:, :, None], axis=1)
    return np.asarray(place) if missed.max() < MEET else None


def _places(direction: Floats, point: Floats, wrist: Floats) -> bool:
    """Return whether the first three joints move the wrist in all directions, at some of four positions."""
    angles = np.random.default_rng(0).uniform(-np.pi, np.pi, (3, 4))
    place: Floats = np.broadcast_to(wrist, (4, 3))
    columns: list[Floats] = []
    for joint in (2, 1, 0):
        turn = from_axis_angle(direction[joint], angles[joint])
        place = point[joint] + _rotate(turn, place - point[joint])
        columns = [_rotate(turn, column) for column in columns]
        columns.append(np.cross(direction[joint], place - point[joint]))
    return bool(np.linalg.svd(np.stack(columns, axis=1), compute_uv=False)[:, -1].max() > MEET)


def meeting_axes_branches(arm: Arm, target: TargetComponents) -> list[Branch]:
    """Return the branches of an arm that has `meeting_axes`, for targets with an orientation."""
    axes = meeting_axes(arm)
    assert axes is not None and target.n is not None and target.o is not None and target.a is not None
    pose = np.zeros((target.p[0].size, 4, 4))
    pose[:, 3, 3] = 1.0
    for column, vector in enumerate((target.n, target.o, target.a, target.p)):
        pose[:, :3, column] = np.stack(vector, axis=-1)
    moved = pose @ axes.back
    if axes.from_tool:
        moved = inverse(moved)
    home = [arm.joints[joint].home for joint in axes.joints]
    branches: list[Branch] = []
    for placing in _placing(axes, moved[:, :3, :3] @ axes.wrist + moved[:, :3, 3], home):
        rest = moved[:, :3, :3]
        for axis, angle in zip(axes.direction[:3], placing, strict=True):
            rest = np.swapaxes(from_axis_angle(axis, angle), 1, 2) @ rest
        for turning in _turning(axes, rest, home[3]):
            angles = dict(zip(axes.joints, (*placing, *turning), strict=True))
            branches.append(tuple(angles[joint] for joint in range(6)))
    return branches


def _placing(axes: MeetingAxes, target: Floats, home: list[float]) -> list[tuple[Floats, Floats, Floats]]:
    """Return four positions of the first three joints that bring the wrist to `target` (m, 3)."""
    first, second, third = axes.direction[:3]
    foot, o2, o3 = *_common_normal(first, axes.point[0], second, axes.point[1]), axes.point[2]
    normal, raised = o2 - foot, first - second * (first @ second)
    # w - o2, its part along axis 2 and its square: numbers, factors of cos q3 and of sin q3
    arm = axes.wrist - o3
    along = third * (third @ arm)
    parts = np.stack([o3 + along - o2, arm - along, np.cross(third, arm)])
    offset, base = parts @ second, parts[0]
    square = np.array([base @ base + parts[1] @ parts[1], 2 * base @ parts[1], 2 * base @ parts[2]])
    away = target - foot
    height = np.outer(away @ first, [1.0, 0.0, 0.0]) - (first @ second) * offset
    reach = np.outer(np.einsum("ij,ij->i", away, away) - normal @ normal, [0.5, 0.0, 0.0]) - square / 2
    m, g = float(np.linalg.norm(raised)), float(np.linalg.norm(normal))
    if m < MEET:
        threes = _both_angles(height)
    elif g < MEET:
        threes = _both_angles(reach)
    else:
        plane = np.append(square, [0.0, 0.0]) - _product(offset, offset)
        threes = _roots(
            g * g * _product(height, height) + m * m * _product(reach, reach) - (m * g) ** 2 * plane
        )
    placings = []
    for three in threes:
        wave = np.stack([np.ones_like(three), np.cos(three), np.sin(three)], axis=-1)
        w = wave @ parts
        u = w - (w @ second)[:, None] * second
        for turned in _in_plane(wave, (height, m, raised), (reach, g, normal), u, second):
            two = _angle(second, u, turned, home[1])
            now = o2 + turned + (w @ second)[:, None] * second - foot
            placings.append((_angle(first, now, away, home[0]), two, three))
    return placings


def _in_plane(
    wave: Floats,
    height: tuple[Floats, float, Floats],
    reach: tuple[Floats, float, Floats],
    u: Floats,
    axis: Floats,
) -> list[Floats]:
    """Return u turned by q2 (m, 3), from its components along m and g: one, or two if one of these is 0."""
    known = [
        (np.einsum("ij,ij->i", wave, np.broadcast_to(value, wave.shape)) / length, vector / length)
        for value, length, vector in (height, reach)
        if length >= MEET
    ]
    if len(known) == 2:
        return [sum((component[:, None] * unit for component, unit in known), np.zeros_like(u))]
    ((component, unit),) = known
    rest = np.sqrt(np.maximum(np.einsum("ij,ij->i", u, u) - component**2, 0.0))[:, None] * np.cross(
        axis, unit
    )
    return [component[:, None] * unit + rest, component[:, None] * unit - rest]


def _turning(axes: MeetingAxes, rotation: Floats, home: float) -> list[tuple[Floats, Floats, Floats]]:
    """Return both positions of the wrist's joints that make `rotation` (m, 3, 3).

    Stretched, only a sum or difference of the outer two is determined: the first of them stays at home.
    """
    first, second, third = axes.direction[3:]
    tip = rotation @ third
    along = second * (second @ third)
    # The angle of the tip to axis 4: first · (third turned by q5) = first · tip
    cosine, sine = first @ (third - along), first @ np.cross(second, third)
    fives = _both_angles(
        np.stack([first @ along - tip @ first, *np.full((2, len(tip)), [[cosine], [sine]])], axis=-1)
    )
    # A vector that joint 6 turns
    mark = np.cross(third, np.eye(3)[int(np.argmin(np.abs(third)))])
    branches = []
    for five in fives:
        bend = from_axis_angle(second, five)
        four = _angle(first, bend @ third, tip, home)
        back = np.swapaxes(from_axis_angle(first, four) @ bend, 1, 2) @ rotation
        branches.append((four, five, _angle(third, np.broadcast_to(mark, tip.shape), back @ mark, 0.0)))
    return branches


def _common_normal(one: Floats, on_one: Floats, two: Floats, on_two: Floats) -> tuple[Floats, Floats]:
    """Return the points of two lines nearest to each other; of parallel ones, the nearest to `on_two`."""
    between, cosine = on_two - on_one, one @ two
    sine_square = np.cross(one, two) @ np.cross(one, two)
    along_two = 0.0 if sine_square < MEET**2 else (cosine * (between @ one) - between @ two) / sine_square
    return on_one + (between @ one + along_two * cosine) * one, on_two + along_two * two


def _both_angles(wave: Floats) -> list[Floats]:
    """Return both zeros (m,) of waves (m, 3): number, factor of the cosine and of the sine."""
    number, cosine, sine = wave.T
    return list(cosine_sine_sum(cosine, sine, -number))


def _product(one: Floats, two: Floats) -> Floats:
    """Return the product (..., 5) of two waves (..., 3), with the factors of cos 2q and sin 2q last."""
    (a, b, c), (d, e, f) = np.moveaxis(one, -1, 0), np.moveaxis(two, -1, 0)
    both = [
        a * d + (b * e + c * f) / 2,
        a * e + b * d,
        a * f + c * d,
        (b * e - c * f) / 2,
        (b * f + c * e) / 2,
    ]
    return np.stack(both, axis=-1)


def _roots(wave: Floats) -> list[Floats]:
    """Return the angles (m,) of the four roots z = e^iq of waves (m, 5): those of size 1 are zeros."""
    one, two = wave[:, 1] - 1j * wave[:, 2], wave[:, 3] - 1j * wave[:, 4]
    size = np.abs(wave).max(axis=1)
    two = np.where(np.abs(two) < LEADING * size, LEADING * size, two)
    companion = np.zeros((len(wave), 4, 4), complex)
    companion[:, (1, 2, 3), (0, 1, 2)] = 1.0
    companion[:, 0] = -np.stack([one, 2 * wave[:, 0] + 0j, one.conj(), two.conj()], axis=-1) / two[:, None]
    return list(np.angle(np.linalg.eigvals(companion)).T)


def _angle(axis: Floats, one: Floats, two: Floats, home: float) -> Floats:
    """Return the angle (m,) about `axis` from vectors `one` to `two` (m, 3); home if they are along it."""
    normal = np.cross(axis, one)
    sine, cosine = np.einsum("ij,ij->i", normal, two), np.einsum("ij,ij->i", normal, np.cross(axis, two))
    return np.where(np.hypot(sine, cosine) < MEET**2, home, np.arctan2(sine, cosine))


def _rotate(turn: Floats, vector: Floats) -> Floats:
    return np.asarray((turn @ vector[..., None])[..., 0])
