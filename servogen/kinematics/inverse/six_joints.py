"""Closed forms of the arms with six joints: three place the wrist, three turn it (ZYZ).

In: an `Arm` and a `Target`. Out: the branches, as in `closed_forms`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from servogen.kinematics.inverse.target import Branch, Target, azimuth
from servogen.kinematics.transforms import Floats, cos_sin
from servogen.robot.model import Arm


def _cosine_sine_sum(a: Floats | float, b: Floats | float, c: Floats) -> tuple[Floats, Floats]:
    """Return both x with a cos x + b sin x = c: atan2(b, a) ± acos(c / √(a² + b²))."""
    length = np.hypot(a, b)
    half = np.arccos(np.clip(c / np.where(length == 0.0, 1.0, length), -1.0, 1.0))
    middle = np.arctan2(b, a)
    return middle + half, middle - half


def irb6400c(arm: Arm, target: Target) -> list[Branch]:
    """Return the branches: three joints place a point t = (u, v, w) of the third link, three turn the wrist
    (ZYZ).

    With an orientation t is the wrist, (0, 0, l3), and its place p - l4 a; without one q4 and q5 stay
    at home and t is the tip. Seen from the frame that turns with q1, with X = s3 (u - l2) - c3 w:

        x' = X c2 + v s2      y' = l1 - c3 (u - l2) - s3 w      z' = -X s2 + v c2

    |p|² gives y' and so q3; z' gives q2; q1 is the turn from (x', y') to (x, y).
    """
    lengths, p = arm.length, target.p
    first, reach, hand = lengths["l1"], lengths["l3"], lengths["l4"]
    u, v, w = 0.0, 0.0, reach
    if target.a is not None:
        p = (p[0] - hand * target.a[0], p[1] - hand * target.a[1], p[2] - hand * target.a[2])
    else:
        fourth, fifth = arm.home[3], arm.home[4]
        u = float(hand * np.cos(fourth) * np.sin(fifth))
        v = float(hand * np.sin(fourth) * np.sin(fifth))
        w = float(reach + hand * np.cos(fifth))
    x, y, z = p
    u -= lengths["l2"]
    across = (x * x + y * y + z * z - u * u - v * v - w * w - first**2) / (2 * first)
    direction = np.arctan2(y, x)
    branches: list[Branch] = []
    for three in _cosine_sine_sum(u, w, -across):
        cosine, sine = cos_sin(three)
        forward = sine * u - cosine * w
        for two in _cosine_sine_sum(v, -forward, z):
            c_two, s_two = cos_sin(two)
            one = direction - np.arctan2(first + across, forward * c_two + v * s_two)
            if target.n is None or target.o is None or target.a is None:
                branches.append((one, two, three, *arm.home[3:]))
                continue
            c_one, s_one = cos_sin(one)
            side = c_two * sine, -cosine, -s_two * sine
            up = s_two, np.zeros_like(s_two), c_two
            on = -c_two * cosine, -sine, s_two * cosine
            third = tuple(_turned(c_one, s_one, axis) for axis in (side, up, on))
            branches += [(one, two, three, *wrist) for wrist in _zyz(third, target, arm.home[3])]
    return branches


def _turned(cosine: Floats, sine: Floats, axis: Sequence[Floats]) -> tuple[Floats, Floats, Floats]:
    """Return an axis turned about z."""
    return cosine * axis[0] - sine * axis[1], sine * axis[0] + cosine * axis[1], axis[2]


def _zyz(frame: Sequence[Sequence[Floats]], target: Target, home: float) -> list[Branch]:
    """Return both (q4, q5, q6) of a wrist that turns `frame` (its x, y, z axes) into the target, ZYZ.

    Stretched (sin q5 = 0) only q4 ± q6 is determined: q4 stays at home.
    """
    if target.n is None or target.o is None or target.a is None:
        return []
    x, y, _ = frame
    a = [_dot(axis, target.a) for axis in frame]
    stretched = np.hypot(a[0], a[1]) < 1e-12
    branches: list[Branch] = []
    for half_turn in (0.0, np.pi):
        four = np.where(stretched, home, np.arctan2(a[1], a[0]) + half_turn)
        cosine, sine = cos_sin(four)
        five = np.arctan2(cosine * a[0] + sine * a[1], a[2])
        six = np.arctan2(
            cosine * _dot(y, target.n) - sine * _dot(x, target.n),
            cosine * _dot(y, target.o) - sine * _dot(x, target.o),
        )
        branches.append((four, five, six))
    return branches


def _dot(one: Sequence[Floats], two: Sequence[Floats]) -> Floats:
    return np.asarray(one[0] * two[0] + one[1] * two[1] + one[2] * two[2])


def spherical(arm: Arm, target: Target) -> list[Branch]:
    """Return the branches of p = q3 (c1 s2, s1 s2, c2): both halves of the turn, the slide either way."""
    x, y, z = target.p
    turn, across = azimuth(y, x, arm.home[0]), np.hypot(x, y)
    lean, out = np.arctan2(across, z), np.hypot(across, z)
    return [
        (turn, lean, out),
        (turn + np.pi, -lean, out),
        (turn, lean + np.pi, -out),
        (turn + np.pi, np.pi - lean, -out),
    ]


def spherical_wrist(arm: Arm, target: Target) -> list[Branch]:
    """Return the branches of the spherical arm with a wrist ZYZ whose axes meet at p."""
    branches: list[Branch] = []
    for one, two, out in spherical(arm, target):
        if target.a is None:
            branches.append((one, two, out, *arm.home[3:]))
            continue
        c_one, s_one = cos_sin(np.asarray(one))
        c_two, s_two = cos_sin(np.asarray(two))
        nothing = np.zeros_like(c_one)
        frame = (
            (c_one * c_two, s_one * c_two, -s_two),
            (-s_one, c_one, nothing),
            (c_one * s_two, s_one * s_two, c_two),
        )
        branches += [(one, two, out, *wrist) for wrist in _zyz(frame, target, arm.home[3])]
    return branches
