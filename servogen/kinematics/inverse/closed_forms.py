"""Inverse kinematics in closed form: every branch of each robot that has one.

In: the components of many targets (position, and orientation if it is given) in the frame before the first
row. Out: candidate joint positions, branch by branch. A candidate is not a solution yet: `checked_forms`
turns the angles into the limits and keeps only those that forward kinematics confirms, so that a form may
clip impossible values.

Without an orientation, the joints that only it determines stay at home. Of the arms with six joints, three
joints place the wrist and three turn it (ZYZ).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from servogen.kinematics.leg import Leg
from servogen.kinematics.serial_legs import HipLift
from servogen.kinematics.transforms import Floats, cos_sin
from servogen.robot.model import Arm

Branch = tuple[Floats | float, ...]
"""One candidate per joint: an array over the targets, or one number for all."""


@dataclass(frozen=True, slots=True)
class TargetComponents:
    """Components over the targets: `p` three, `n`, `o`, `a` three each, None without an orientation."""

    p: tuple[Floats, Floats, Floats]
    n: tuple[Floats, Floats, Floats] | None = None
    o: tuple[Floats, Floats, Floats] | None = None
    a: tuple[Floats, Floats, Floats] | None = None


ON_AXIS = 1e-12
"""A point nearer than this to the first joint's axis, in metres, leaves that joint free: it stays at home."""


def azimuth(y: Floats, x: Floats, home: float) -> Floats:
    """Return atan2(y, x), or `home` on the axis, where every angle is correct."""
    return np.where(np.hypot(x, y) < ON_AXIS, home, np.arctan2(y, x))


def cosine_sine_sum(a: Floats | float, b: Floats | float, c: Floats | float) -> tuple[Floats, Floats]:
    """Return both x with a cos x + b sin x = c: atan2(b, a) ± acos(c / √(a² + b²)).

    If |c| > √(a² + b²) or a = b = 0 they are candidates that are not solutions; `checked_forms` refuses them.
    """
    length = np.hypot(a, b)
    half = np.arccos(np.clip(c / np.where(length == 0.0, 1.0, length), -1.0, 1.0))
    middle = np.arctan2(b, a)
    return middle + half, middle - half


def irb6400c(arm: Arm, target: TargetComponents) -> list[Branch]:
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
    for three in cosine_sine_sum(u, w, -across):
        cosine, sine = cos_sin(three)
        forward = sine * u - cosine * w
        for two in cosine_sine_sum(v, -forward, z):
            c_two, s_two = cos_sin(two)
            one = direction - np.arctan2(first + across, forward * c_two + v * s_two)
            if target.a is None:
                branches.append((one, two, three, *arm.home[3:]))
                continue
            c_one, s_one = cos_sin(one)
            side = c_two * sine, -cosine, -s_two * sine
            up = s_two, np.zeros_like(s_two), c_two
            on = -c_two * cosine, -sine, s_two * cosine
            third = tuple(_rotate(c_one, s_one, axis) for axis in (side, up, on))
            branches += [(one, two, three, *wrist) for wrist in _zyz(third, target, arm.home[3])]
    return branches


def _rotate(cosine: Floats, sine: Floats, axis: Sequence[Floats]) -> tuple[Floats, Floats, Floats]:
    """Return an axis turned about z."""
    return cosine * axis[0] - sine * axis[1], sine * axis[0] + cosine * axis[1], axis[2]


def _zyz(frame: Sequence[Sequence[Floats]], target: TargetComponents, home: float) -> list[Branch]:
    """Return both (q4, q5, q6) of a wrist that turns `frame` (its x, y, z axes) into the target, ZYZ.

    Stretched (sin q5 = 0) only q4 ± q6 is determined: q4 stays at home.
    """
    assert target.n is not None and target.o is not None and target.a is not None
    x, y, _ = frame
    a = [_dot(axis, target.a) for axis in frame]
    stretched = np.hypot(a[0], a[1]) < 1e-12
    branches: list[Branch] = []
    for half_turn in (0.0, np.pi):
        four = np.where(stretched, home, np.arctan2(a[1], a[0]) + half_turn)
        cosine, sine = cos_sin(four)
        five = np.arctan2(cosine * a[0] + sine * a[1], a[2])
        # q6 turns the frame after q4 and q5 into n and o; its y axis does not depend on q5, so q5 is not
        # needed.
        six = np.arctan2(
            cosine * _dot(y, target.n) - sine * _dot(x, target.n),
            cosine * _dot(y, target.o) - sine * _dot(x, target.o),
        )
        branches.append((four, five, six))
    return branches


def _dot(one: Sequence[Floats], two: Sequence[Floats]) -> Floats:
    return np.asarray(one[0] * two[0] + one[1] * two[1] + one[2] * two[2])


def spherical(arm: Arm, target: TargetComponents) -> list[Branch]:
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


def spherical_wrist(arm: Arm, target: TargetComponents) -> list[Branch]:
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


Solver = Callable[[Arm, TargetComponents], list[Branch]]


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


def _theta_r(arm: Arm, target: TargetComponents) -> list[Branch]:
    """Return the branches of p = (q2 sin q1, -q2 cos q1, d1)."""
    x, y, _ = target.p
    turn, out = azimuth(x, -y, arm.home[0]), np.hypot(x, y)
    return [(turn, out), (turn + np.pi, -out)]


def _theta_theta(arm: Arm, target: TargetComponents) -> list[Branch]:
    """Return the branches of p = (l1 c1 + l2 c12, l1 s1 + l2 s12, 0)."""
    return list(_two_links(target.p[0], target.p[1], arm.length["l1"], arm.length["l2"]))


def _cylindrical(arm: Arm, target: TargetComponents) -> list[Branch]:
    """Return the branches of p = (c1 (q3 + l4), s1 (q3 + l4), q2 + l1), n_z = sin q4, o_z = cos q4."""
    x, y, z = target.p
    turn, out, up = azimuth(y, x, arm.home[0]), np.hypot(x, y), z - arm.length["l1"]
    roll: Floats | float = arm.home[3]
    if target.n is not None and target.o is not None:
        roll = np.arctan2(target.n[2], target.o[2])
    hand = arm.length["l4"]
    return [(turn, up, out - hand, roll), (turn + np.pi, up, -out - hand, roll)]


def _cylindrical_r2p(arm: Arm, target: TargetComponents) -> list[Branch]:
    """Return the branches of p = (q3 c1, q3 s1, q2)."""
    x, y, z = target.p
    turn, out = azimuth(y, x, arm.home[0]), np.hypot(x, y)
    return [(turn, z, out), (turn + np.pi, z, -out)]


def _cartesian(arm: Arm, target: TargetComponents) -> list[Branch]:
    """Return the branch of p = (q3, q2, q1)."""
    x, y, z = target.p
    return [(z, y, x)]


def _scara(arm: Arm, target: TargetComponents) -> list[Branch]:
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


def _wrist_arm(arm: Arm, target: TargetComponents) -> list[Branch]:
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


def _roll_of(home: float, turn: Floats, target: TargetComponents) -> Floats | float:
    """Return the last joint from n and o, seen along the horizontal normal (s1, -c1, 0) of the
    arm's plane.
    """
    if target.n is None or target.o is None:
        return home
    cosine, sine = cos_sin(turn)
    return np.arctan2(sine * target.n[0] - cosine * target.n[1], sine * target.o[0] - cosine * target.o[1])


def _anthropomorphic(arm: Arm, target: TargetComponents) -> list[Branch]:
    """Return the branches of p = (-K s1, K c1, l2 s2 + l3 s23), K = l2 c2 + l3 c23 of either sign."""
    x, y, z = target.p
    turn, out = azimuth(-x, y, arm.home[0]), np.hypot(x, y)
    second, third = arm.length["l2"], arm.length["l3"]
    return [
        (base, two, three)
        for base, reach in ((turn, out), (turn + np.pi, -out))
        for two, three in _two_links(reach, z, second, third)
    ]


def _rv_m1(arm: Arm, target: TargetComponents) -> list[Branch]:
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


def _rv_m1_position(arm: Arm, target: TargetComponents) -> list[Branch]:
    x, y, z = target.p
    hand, (fourth, fifth) = arm.length["d5"], arm.home[3:]
    u, v = arm.length["a3"] + hand * np.sin(fourth), -hand * np.cos(fourth)
    turn, out = azimuth(y, x, arm.home[0]), np.hypot(x, y)
    return [
        (base, two, three - np.arctan2(v, u), fourth, fifth)
        for base, reach in ((turn, out), (turn + np.pi, -out))
        for two, three in _two_links(reach, z - arm.length["d1"], arm.length["a2"], float(np.hypot(u, v)))
    ]


def _pantograph(arm: Arm, target: TargetComponents) -> list[Branch]:
    angles = Leg.of(arm.length).at_height(np.stack(target.p, axis=-1))
    return [(angles[..., side, 0], angles[..., side, 1]) for side in (0, 1)]


def _hip_lift(arm: Arm, target: TargetComponents) -> list[Branch]:
    """Return both lifts at the foot's height, each with the hip towards the foot and away from it."""
    x, y, z = target.p
    lifts, towards = HipLift.of(arm.length).at_height(z), azimuth(-x, y, arm.home[0])
    return [(towards + turn, lifts[..., side]) for side in (0, 1) for turn in (0.0, np.pi)]


def _coxa_femur_tibia(arm: Arm, target: TargetComponents) -> list[Branch]:
    x, y, z = target.p
    knee = np.pi / 2
    return [
        (hip, femur, bend + knee)
        for hip, reach in (
            (azimuth(-x, y, arm.home[0]), np.hypot(x, y)),
            (azimuth(-x, y, arm.home[0]) + np.pi, -np.hypot(x, y)),
        )
        for femur, bend in _two_links(reach - arm.length["coxa"], z, arm.length["femur"], arm.length["tibia"])
    ]


@dataclass(frozen=True, slots=True)
class ClosedForm:
    """A closed form; the number of last joints that stay at home if a target has no orientation; the lengths
    that it divides by: if one of them is 0, it does not apply.
    """

    branches: Solver
    wrist_joints: int
    divisors: tuple[str, ...]


CLOSED_FORMS: Mapping[str, ClosedForm] = MappingProxyType(
    {
        "theta-r": ClosedForm(_theta_r, 0, ()),
        "theta1-theta2": ClosedForm(_theta_theta, 0, ("l1", "l2")),
        "cylindrical": ClosedForm(_cylindrical, 1, ()),
        "cylindrical-r2p": ClosedForm(_cylindrical_r2p, 0, ()),
        "cartesian": ClosedForm(_cartesian, 0, ()),
        "scara": ClosedForm(_scara, 1, ("l1", "l2")),
        "wrist-arm": ClosedForm(_wrist_arm, 1, ()),
        "anthropomorphic": ClosedForm(_anthropomorphic, 0, ("l2", "l3")),
        "rv-m1": ClosedForm(_rv_m1, 2, ("a2", "a3")),
        "irb6400c": ClosedForm(irb6400c, 3, ("l1",)),
        "spherical": ClosedForm(spherical, 0, ()),
        "spherical-wrist": ClosedForm(spherical_wrist, 3, ()),
        "pantograph": ClosedForm(_pantograph, 0, ()),
        "hip-lift": ClosedForm(_hip_lift, 0, ()),
        "coxa-femur-tibia": ClosedForm(_coxa_femur_tibia, 0, ("femur", "tibia")),
    }
)
"""The closed forms by the name that a robot's file gives."""


def wrist_joints(arm: Arm) -> int:
    """Return how many last joints of `arm` only an orientation determines."""
    form = CLOSED_FORMS.get(arm.closed_form or "")
    return form.wrist_joints if form else 0
