"""The kinds of legs of walking robots: what a body on such legs needs to stand, be drawn, loaded and collide.

A kind is the arm of the catalogue of the same name, whose rows and closed form give forward and inverse
kinematics, Jacobian and statics, and a line here.

    pantograph          α turns, β swings the foot fore and aft; a slider mechanism keeps its part upright
    hip-lift            hip turns, lift raises the rigid rest of the leg, outwards
    coxa-femur-tibia    coxa turns, femur and tibia lift and stretch
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from servogen.kinematics.forward import link_frames
from servogen.kinematics.leg import Leg
from servogen.kinematics.protocol import BodyMotion, Posture, Stance
from servogen.kinematics.serial_legs import CoxaFemurTibia, HipLift
from servogen.kinematics.stance import circle_stance, free_stance
from servogen.kinematics.transforms import Floats
from servogen.robot.model import Arm, Mount

Lengths = Mapping[str, float]


@dataclass(frozen=True, slots=True)
class LegKind:
    """A kind of leg, by the name that a robot file gives for `leg`.

    `parts`: the parts of the leg from its hip to its foot, as `leg_mass_g` names them; `rods`: the two
    corners between which each of them lies. `lifting` is the index
    of the joint that carries the weight, `torque` its static torque (...,) for angles (..., k) and vertical
    forces (...,) at the foot. `corners`: the points (n, corners, 3) of the leg's centre line for angles
    (n, k), in the leg's frame. `wrong` returns the length that is wrong, and why, or None.
    """

    name: str
    parts: tuple[str, ...]
    rods: tuple[tuple[int, int], ...]
    lifting: int
    sidesteps: bool
    wrong: Callable[[Lengths], tuple[str, str] | None]
    stance: Callable[[Arm, Sequence[Mount], Posture, Sequence[BodyMotion]], Stance]
    torque: Callable[[Lengths, Floats, Floats], Floats]
    corners: Callable[[Arm, Floats], Floats]


def _pantograph_wrong(lengths: Lengths) -> tuple[str, str] | None:
    if not lengths["bc"]:
        return "bc", "bc is 0: β would lift nothing"
    if not lengths["ab"] + lengths["cd"]:
        return "ab", "ab and cd are both 0: the leg would have no length"
    return None


def _pantograph_corners(arm: Arm, joints: Floats) -> Floats:
    """Return A, B, C, D and F, see `kinematics.leg`."""
    leg = Leg.of(arm.length)
    alpha, beta = joints.T
    zero = np.zeros_like(alpha)
    outward = np.stack([-np.sin(alpha), np.cos(alpha), zero], axis=1)
    forward = np.stack([np.cos(alpha), np.sin(alpha), zero], axis=1)
    down = np.array([0.0, 0.0, -1.0])
    a = np.zeros_like(outward)
    b = a + leg.ab * outward
    c = b - leg.bc * np.sin(beta)[:, None] * forward + leg.bc * np.cos(beta)[:, None] * down
    d = c + leg.cd * outward
    return np.stack([a, b, c, d, d + leg.df * down], axis=1)


def _serial_wrong(lengths: Lengths) -> tuple[str, str] | None:
    for name in ("femur", "tibia"):
        if not lengths[name]:
            return name, f"{name} is 0: measure from axis to axis, and from the last one to the foot"
    return None


def _serial_corners(arm: Arm, joints: Floats) -> Floats:
    """Return the hip, the ends of coxa and femur, and the foot."""
    return link_frames(arm, joints)[:, : len(arm.rows) + 1, :3, 3]


PANTOGRAPH = LegKind(
    name="pantograph",
    parts=("coxa", "thigh", "foot"),
    rods=((0, 1), (1, 2), (3, 4)),
    lifting=1,
    sidesteps=False,
    wrong=_pantograph_wrong,
    stance=lambda arm, *how: circle_stance(Leg.of(arm.length), arm, *how),
    torque=lambda lengths, angles, forces: Leg.of(lengths).torque(angles[..., 1], forces),
    corners=_pantograph_corners,
)

HIP_LIFT = LegKind(
    name="hip-lift",
    parts=("coxa", "femur", "tibia"),
    rods=((0, 1), (1, 2), (2, 3)),
    lifting=1,
    sidesteps=False,
    wrong=_serial_wrong,
    stance=lambda arm, *how: circle_stance(HipLift.of(arm.length), arm, *how),
    torque=lambda lengths, angles, forces: HipLift.of(lengths).torque(angles[..., 1], forces),
    corners=_serial_corners,
)

COXA_FEMUR_TIBIA = LegKind(
    name="coxa-femur-tibia",
    parts=("coxa", "femur", "tibia"),
    rods=((0, 1), (1, 2), (2, 3)),
    lifting=1,
    sidesteps=True,
    wrong=_serial_wrong,
    stance=lambda arm, mounts, posture, motions: free_stance(
        CoxaFemurTibia.of(arm.length), arm, mounts, posture
    ),
    torque=lambda lengths, angles, forces: CoxaFemurTibia.of(lengths).torque(angles, forces),
    corners=_serial_corners,
)

LEG_KINDS: Mapping[str, LegKind] = MappingProxyType(
    {kind.name: kind for kind in (PANTOGRAPH, HIP_LIFT, COXA_FEMUR_TIBIA)}
)
"""The kinds of legs by name."""
