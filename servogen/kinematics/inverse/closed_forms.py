"""Inverse kinematics in closed form: every branch of each robot that has one.

In: the components of many targets (position, and orientation if it is given) in the frame before the
first row. Out: candidate joint positions, branch by branch. A candidate is not a solution yet: `solve` turns
the angles into the limits and keeps only those that forward kinematics confirms. So a form may clip
impossible values: the check rejects them.

Without an orientation, the joints that only it determines stay at home.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from servogen.kinematics.inverse.six_joints import irb6400c, spherical, spherical_wrist
from servogen.kinematics.inverse.target import ON_AXIS, Branch, Target, azimuth
from servogen.kinematics.leg import Leg
from servogen.kinematics.transforms import Floats, cos_sin
from servogen.robot.model import Arm

ClosedForm = Callable[[Arm, Target], list[Branch]]


def _two_links(x: Floats, y: Floats, first: float, second: float) -> list[tuple[Floats, Floats]]:
    """Return both angles of two links that reach (x, y) in their plane, with the elbow on either side.

               ● (x, y)
      second  ╱ q_b: from the direction of the first link
             ●────
    first   ╱            cos q_b = (x² + y² - first² - second²) / (2 first second)
           ● q_a         q_a = atan2(y, x) - atan2(second sin q_b, first + second cos q_b)
    """
    cosine = np.clip((x * x + y * y - (first**2 + second**2)) / (2 * first * second), -1.0, 1.0)
    sine = np.sqrt(1.0 - cosine * cosine)
    direction = np.arctan2(y, x)
    inner, bend = np.arctan2(second * sine, first + second * cosine), np.arctan2(sine, cosine)
    return [(direction - inner, bend), (direction + inner, -bend)]


def _theta_r(arm: Arm, target: Target) -> list[Branch]:
    """Return the branches of p = (q2 sin q1, -q2 cos q1, d1)."""
    x, y, _ = target.p
    turn, out = azimuth(x, -y, arm.home[0]), np.hypot(x, y)
    return [(turn, out), (turn + np.pi, -out)]


def _theta_theta(arm: Arm, target: Target) -> list[Branch]:
    """Return the branches of p = (l1 c1 + l2 c12, l1 s1 + l2 s12, 0)."""
    return list(_two_links(target.p[0], target.p[1], arm.length["l1"], arm.length["l2"]))


def _cylindrical(arm: Arm, target: Target) -> list[Branch]:
    """Return the branches of p = (c1 (q3 + l4), s1 (q3 + l4), q2 + l1), n_z = sin q4, o_z = cos q4."""
    x, y, z = target.p
    turn, out, up = azimuth(y, x, arm.home[0]), np.hypot(x, y), z - arm.length["l1"]
    roll: Floats | float = arm.home[3]
    if target.n is not None and target.o is not None:
        roll = np.arctan2(target.n[2], target.o[2])
    hand = arm.length["l4"]
    return [(turn, up, out - hand, roll), (turn + np.pi, up, -out - hand, roll)]


def _cylindrical_r2p(arm: Arm, target: Target) -> list[Branch]:
    """Return the branches of p = (q3 c1, q3 s1, q2)."""
    x, y, z = target.p
    turn, out = azimuth(y, x, arm.home[0]), np.hypot(x, y)
    return [(turn, z, out), (turn + np.pi, z, -out)]


def _cartesian(arm: Arm, target: Target) -> list[Branch]:
    """Return the branch of p = (q3, q2, q1)."""
    x, y, z = target.p
    return [(z, y, x)]


def _scara(arm: Arm, target: Target) -> list[Branch]:
    """Return the branches of p = (l1 c1 + l2 c12, l1 s1 + l2 s12, l0 - l3 - q3 - l4).

    The orientation's angle is q1 + q2 - q4.
    """
    x, y, z = target.p
    lengths = arm.length
    down = lengths["l0"] - lengths["l3"] - lengths["l4"] - z
    branches: list[Branch] = []
    for one, two in _two_links(x, y, lengths["l1"], lengths["l2"]):
        roll: Floats | float = arm.home[3]
        if target.n is not None:
            roll = one + two - np.arctan2(target.n[1], target.n[0])
        branches.append((one, two, down, roll))
    return branches


def _wrist_arm(arm: Arm, target: Target) -> list[Branch]:
    """Return the branches of p = (L c1 c2, L s1 c2, L s2 + l1), L = l2 + l3: a sphere, with q3 about the arm.

    sin q3 = s1 n_x - c1 n_y and cos q3 = s1 o_x - c1 o_y hold when the arm is upright too, where the source's
    atan2(-a32, a31) is undefined.
    """
    x, y, z = target.p
    turn, out, up = azimuth(y, x, arm.home[0]), np.hypot(x, y), z - arm.length["l1"]
    return [
        (turn, np.arctan2(up, out), _roll_of(arm.home[2], turn, target)),
        (turn + np.pi, np.arctan2(up, -out), _roll_of(arm.home[2], turn + np.pi, target)),
    ]


def _roll_of(home: float, turn: Floats, target: Target) -> Floats | float:
    """Return the last joint from n and o, seen along the horizontal normal (s1, -c1, 0) of the
    arm's plane.
    """
    if target.n is None or target.o is None:
        return home
    cosine, sine = cos_sin(turn)
    return np.arctan2(sine * target.n[0] - cosine * target.n[1], sine * target.o[0] - cosine * target.o[1])


def _anthropomorphic(arm: Arm, target: Target) -> list[Branch]:
    """Return the branches of p = (-K s1, K c1, l2 s2 + l3 s23), K = l2 c2 + l3 c23 of either sign."""
    x, y, z = target.p
    turn, out = azimuth(-x, y, arm.home[0]), np.hypot(x, y)
    second, third = arm.length["l2"], arm.length["l3"]
    return [
        (base, two, three)
        for base, reach in ((turn, out), (turn + np.pi, -out))
        for two, three in _two_links(reach, z, second, third)
    ]


def _rv_m1(arm: Arm, target: Target) -> list[Branch]:
    """Return the branches of p = (c1 K, s1 K, d1 + a2 s2 + a3 s23 - d5 c234), K = a2 c2 + a3 c23 + d5 s234.

    With an orientation the wrist is d5 back along a = (c1 s234, s1 s234, -c234). Without one q4 stays at
    home, and from the elbow to the tip is one link of length √(u² + v²), u = a3 + d5 sin q4, v = -d5 cos q4,
    turned by atan2(v, u).
    """
    x, y, z = target.p
    second, third, hand = arm.length["a2"], arm.length["a3"], arm.length["d5"]
    if target.a is None:
        return _rv_m1_position(arm, target)
    a_x, a_y, a_z = target.a
    # over the first joint's axis the plane of the arm is that of the approach vector
    turn = np.where(np.hypot(x, y) < ON_AXIS, azimuth(a_y, a_x, arm.home[0]), np.arctan2(y, x))
    out, up = np.hypot(x, y), z - arm.length["d1"] + hand * -a_z
    cosine, sine = cos_sin(turn)
    lean = cosine * a_x + sine * a_y
    roll = _roll_of(arm.home[4], turn, target)
    branches: list[Branch] = []
    for base, side, last in ((turn, 1.0, roll), (turn + np.pi, -1.0, roll + np.pi)):
        pitch = np.arctan2(side * lean, -a_z)
        for two, three in _two_links(side * (out - hand * lean), up, second, third):
            branches.append((base, two, three, pitch - two - three, last))
    return branches


def _rv_m1_position(arm: Arm, target: Target) -> list[Branch]:
    x, y, z = target.p
    hand, (fourth, fifth) = arm.length["d5"], arm.home[3:]
    u, v = arm.length["a3"] + hand * np.sin(fourth), -hand * np.cos(fourth)
    turn, out = azimuth(y, x, arm.home[0]), np.hypot(x, y)
    return [
        (base, two, three - np.arctan2(v, u), fourth, fifth)
        for base, reach in ((turn, out), (turn + np.pi, -out))
        for two, three in _two_links(reach, z - arm.length["d1"], arm.length["a2"], float(np.hypot(u, v)))
    ]


def _leg(arm: Arm, target: Target) -> list[Branch]:
    angles = Leg.of(arm.length).at_height(np.stack(target.p, axis=-1))
    return [(angles[..., side, 0], angles[..., side, 1]) for side in (0, 1)]


WRIST_JOINTS: Mapping[str, int] = MappingProxyType(
    {"cylindrical": 1, "scara": 1, "wrist-arm": 1, "rv-m1": 2, "irb6400c": 3, "spherical-wrist": 3}
)
"""The number of last joints that stay at home if a target has no orientation."""

DIVISORS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "theta1-theta2": ("l1", "l2"),
        "scara": ("l1", "l2"),
        "anthropomorphic": ("l2", "l3"),
        "rv-m1": ("a2", "a3"),
        "irb6400c": ("l1",),
    }
)
"""The lengths that a closed form divides by: if one of them is 0, the form does not apply."""

CLOSED_FORMS: Mapping[str, ClosedForm] = MappingProxyType(
    {
        "theta-r": _theta_r,
        "theta1-theta2": _theta_theta,
        "cylindrical": _cylindrical,
        "cylindrical-r2p": _cylindrical_r2p,
        "cartesian": _cartesian,
        "scara": _scara,
        "wrist-arm": _wrist_arm,
        "anthropomorphic": _anthropomorphic,
        "rv-m1": _rv_m1,
        "irb6400c": irb6400c,
        "spherical": spherical,
        "spherical-wrist": spherical_wrist,
        "leg": _leg,
    }
)
"""The closed forms by the name that a robot's file gives."""
