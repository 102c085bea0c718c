"""The fastest way along lines of six arms against TOPP-RA, with limits of speed, acceleration and torque.

    pip install toppra; python -m tests.motion.against_toppra --lines 12 --seed 1

TOPP-RA gets the course as a spline through servogen's own inverse solutions, divided as servogen divides
it, and its torques by virtual work from numerical differences here, not from `servogen.motion.torque`.
The first ratio is that of the durations before they are rounded to frames. Its own result rises with a finer
grid where a joint turns fast: on equal shares of such lines it is up to 10 % too short with 200 places.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import toppra
from toppra import algorithm, constraint

from servogen.errors import ServogenError
from servogen.kinematics.catalogue import arm
from servogen.kinematics.forward import fk, fk_position, link_frames
from servogen.kinematics.inverse.solve import solutions_near
from servogen.motion.follow import Branch, trace
from servogen.motion.limits import JointLimits
from servogen.motion.moves import quickest_along
from servogen.motion.paths import StraightLine
from servogen.motion.time_optimal import time_optimal
from servogen.motion.torque import TorqueLimits
from servogen.robot.binding import Binding
from servogen.robot.model import Arm

ARMS = ("scara", "spherical", "anthropomorphic", "irb6400c", "spherical-wrist", "cylindrical-r2p")
"""Of three, four and six joints: one of five holds only a part of an orientation along a line."""
SPEED, ACCELERATION, FRAME_S = np.radians(300), np.radians(1500), 0.02
SLIDE = 0.3
"""The speed (m/s) of a sliding joint; its acceleration is five times that."""
DIFFERENCE = 1e-5
GRAVITY = np.array([0.0, 0.0, 9.80665])


def loaded(name: str) -> Arm:
    """An arm of the catalogue with a mass at the end of each link, and a payload."""
    plain = arm(name)
    joints = tuple(
        replace(joint, mass=0.2 / (1 + index), centre=(0.0, 0.0, 0.0))
        for index, joint in enumerate(plain.joints)
    )
    return replace(plain, joints=joints, payload=0.1)


def points_of_mass(robot: Arm, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The masses (k,) and their places (..., k, 3): the frame after each joint's last row, and the tool."""
    frames = link_frames(robot, q)
    rows = [
        max(i for i, row in enumerate(robot.rows) if row.joint == joint) + 1
        for joint in range(len(robot.joints))
    ]
    places = frames[..., [*rows, len(robot.rows) + 1], :, :][..., :3, 3]
    return np.array([*(joint.mass for joint in robot.joints), robot.payload]), places


def needed(robot: Arm, q: np.ndarray, speed: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """The torques (n, joints) by the virtual work of all masses, accelerations and slopes by differences."""

    def places(at: np.ndarray) -> np.ndarray:
        return points_of_mass(robot, at)[1]

    masses = points_of_mass(robot, q)[0]
    h = 1e-4
    ahead, behind = (places(q + sign * h * speed + h * h / 2 * acceleration) for sign in (1, -1))
    force = masses[:, None] * ((ahead - 2 * places(q) + behind) / h**2 + GRAVITY)
    around, steps = q[:, None, :], DIFFERENCE * np.eye(q.shape[1])
    slopes = (places(around + steps) - places(around - steps)) / (2 * DIFFERENCE)
    return np.asarray(np.einsum("njkc,nkc->nj", slopes, force))


def line_of(robot: Arm, random: np.random.Generator) -> tuple[Branch, float]:
    """A line between two poses of an arm that one branch follows, its orientation held at the start's, and
    the processor time in seconds that its branch took.
    """
    lower = np.array([joint.lower for joint in robot.joints])
    upper = np.array([joint.upper for joint in robot.joints])
    while True:
        q = random.uniform(lower, upper, (2, len(lower)))
        start, end = fk_position(robot, q)
        if 0.15 < np.linalg.norm(end - start) < 1.5:
            begun = time.process_time()
            try:
                branch = _traced(robot, StraightLine(tuple(start), tuple(end)), q[0])
                return branch, time.process_time() - begun
            except ServogenError:
                continue


def _traced(robot: Arm, path: StraightLine, q: np.ndarray) -> Branch:
    turn = fk(robot, q)[:3, :3] if len(robot.joints) == 6 else None

    def inverse(shares: np.ndarray, near: np.ndarray) -> np.ndarray:
        turns = None if turn is None else np.broadcast_to(turn, (len(shares), 3, 3))
        return solutions_near(robot, path.point(shares), turns, near)

    return trace(path, inverse, inverse(np.zeros(1), q[None])[0, 0], str)


def torques_on(
    robot: Arm, course: toppra.SplineInterpolator, shares: np.ndarray
) -> Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]:
    """`needed` as TOPP-RA asks for it, place by place; it is calculated for all places at once."""
    angles, slope, bend = (course(shares, order) for order in range(3))
    still = np.zeros_like(angles)
    known = {}
    for motion in ((angles, still, still), (angles, still, slope), (angles, slope, bend)):
        known |= {
            np.concatenate(row[:-1]).tobytes(): row[-1]
            for row in zip(*motion, needed(robot, *motion), strict=True)
        }
    return lambda *motion: known[np.concatenate(motion).tobytes()]


def optimum(
    robot: Arm, branch: Branch, limits: list[JointLimits], torque: np.ndarray | None, shares: np.ndarray
) -> float:
    """TOPP-RA's duration in seconds of the course at rising `shares` (n,)."""
    course = toppra.SplineInterpolator(shares, branch.at(shares))
    speed = np.array([[-limit.speed, limit.speed] for limit in limits])
    acceleration = np.array([[-limit.acceleration, limit.acceleration] for limit in limits])
    kept = [constraint.JointVelocityConstraint(speed), constraint.JointAccelerationConstraint(acceleration)]
    if torque is not None:
        both = np.stack([-torque, torque], axis=1)
        kept.append(constraint.JointTorqueConstraint(torques_on(robot, course, shares), both, 0 * torque))
    instance = algorithm.TOPPRA(kept, course, gridpoints=shares, solver_wrapper="seidel")
    planned = instance.compute_trajectory()
    return float("nan") if planned is None else float(planned.duration)


@dataclass
class Lines:
    """What the lines of an arm showed."""

    ratios: list[float] = field(default_factory=list)
    frames: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    limited: int = 0

    def compare(self, robot: Arm, random: np.random.Generator, with_torque: bool) -> None:
        """Add a line with torques of 1.2 to 2 times what the weight needs on it."""
        limits = [
            JointLimits(SPEED, ACCELERATION) if joint.turning else JointLimits(SLIDE, 5 * SLIDE)
            for joint in robot.joints
        ]
        branch, seconds = line_of(robot, random)
        still = np.zeros(len(limits))
        rest = np.abs(needed(robot, branch.at(np.linspace(0, 1, 50)), still, still)).max(axis=0)
        maximum = random.uniform(1.2, 2.0) * rest + 0.02 * rest.max() + 1e-3
        bindings = tuple(Binding(joint.name, joint.name) for joint in robot.joints)
        torque = TorqueLimits(robot, bindings, tuple(range(len(bindings))), maximum) if with_torque else None

        def forward(q: np.ndarray) -> np.ndarray:
            return fk_position(robot, q)

        begun = time.process_time()
        move = quickest_along(lambda shares: branch.followed(shares, forward), limits, FRAME_S, torque)
        self.seconds.append(seconds + time.process_time() - begun)
        timed, free = time_optimal(branch.at, limits, torque), time_optimal(branch.at, limits)
        assert timed is not None and move is not None and free is not None
        best = optimum(robot, branch, limits, maximum if with_torque else None, timed.shares)
        self.limited += free.duration < 0.99 * timed.duration
        self.ratios.append(timed.duration / best)
        self.frames.append((len(move.angles) - 1) * FRAME_S / best)
        print(
            f"  {timed.duration:.3f} s, {self.ratios[-1]:.4f}, planned in {self.seconds[-1]:.2f} s",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--lines", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--arm", choices=ARMS)
    parser.add_argument("--without-torque", action="store_true")
    given = parser.parse_args()
    toppra.setup_logging("ERROR")
    for name in [given.arm] if given.arm else ARMS:
        random, robot, lines = np.random.default_rng(given.seed), loaded(name), Lines()
        for _ in range(given.lines):
            lines.compare(robot, random, not given.without_torque)
        print(
            f"{name:16} {given.lines} lines, {lines.limited} limited by torque: duration / TOPP-RA's "
            f"{np.nanmin(lines.ratios):.4f} to {np.nanmax(lines.ratios):.4f}, median "
            f"{np.nanmedian(lines.ratios):.4f}, "
            f"{int(np.isnan(lines.ratios).sum())} without; in whole frames at most "
            f"{np.nanmax(lines.frames):.3f}; planned in at most {max(lines.seconds):.2f} s of processor time",
            flush=True,
        )


if __name__ == "__main__":
    main()
