"""Random arms of six turning joints, and an inverse kinematics of its own: Newton from many starts.

    python -m tests.kinematics.random_arms --arms 20 --targets 5 --starts 500 --seed 1 --poses 200

The solver here has its own forward kinematics (a product of matrices after Paul) and takes plain Newton
steps, without limits, from random starts: what it finds `ik_all` must list. And `ik` must not refuse a pose
that some joint positions have.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from servogen.kinematics.inverse.solve import ik_all, solve
from servogen.kinematics.inverse.unreachable import Unreachable
from servogen.robot.model import Arm, DHRow, Joint, Length

RIGHT = np.pi / 2
Rows = list[list[float]]
"""θ, d, a, α of each joint's row."""


def arm_of(rows: Rows, turn: np.ndarray) -> Arm:
    """The arm of Denavit–Hartenberg rows, each with a joint that turns by ± its `turn` (6,)."""
    joints = tuple(
        Joint(f"q{index + 1}", "turning", -end, end, 0.0) for index, end in enumerate(turn.tolist())
    )
    return Arm(
        name="own",
        title="",
        convention="standard",
        joints=joints,
        rows=tuple(
            DHRow(theta, Length(constant=d), Length(constant=a), alpha, index)
            for index, (theta, d, a, alpha) in enumerate(rows)
        ),
        orientation=("rpy",),
    )


def _any(random: np.random.Generator) -> Rows:
    """Rows without a structure, or with that of many arms: right angles and lengths of 0."""
    exact = [0.0, RIGHT, -RIGHT]
    return [
        [
            float(random.choice([0.0, random.uniform(-3, 3)])),
            float(random.choice([0.0, random.uniform(-0.2, 0.2)])),
            float(random.choice([0.0, random.uniform(0.05, 0.3)])),
            float(random.choice([*exact, random.uniform(-1.5, 1.5)])),
        ]
        for _ in range(6)
    ]


def _meeting(random: np.random.Generator, first: int) -> Rows:
    """Rows in which the axes `first` to `first` + 2 meet, at right angles or others."""
    rows = _any(random)
    for row in (first, first + 1):
        rows[row][2] = 0.0
        rows[row][3] = float(random.choice([RIGHT, -RIGHT, random.uniform(0.5, 2.5)]))
    rows[first + 1][1] = 0.0
    return rows


def _generic(random: np.random.Generator) -> Rows:
    """Rows in which nothing is 0 and nothing is at right angles."""
    return [
        [
            float(random.uniform(-3, 3)),
            float(random.uniform(-0.2, 0.2)),
            float(random.uniform(0.05, 0.3)),
            float(random.uniform(0.3, 1.5) * random.choice([-1, 1])),
        ]
        for _ in range(6)
    ]


def _three_parallel(random: np.random.Generator) -> Rows:
    """Rows like those of a UR5: the axes 2 to 4 are parallel, the wrist has an offset."""
    d1, a2, a3, d4, d5, d6 = random.uniform(0.05, 0.4, 6).tolist()
    return [
        [0.0, d1, 0.0, RIGHT],
        [0.0, 0.0, -a2, 0.0],
        [0.0, 0.0, -a3, 0.0],
        [0.0, d4, 0.0, RIGHT],
        [0.0, d5, 0.0, -RIGHT],
        [0.0, d6, 0.0, 0.0],
    ]


def _puma(random: np.random.Generator) -> Rows:
    """Rows like those of a Puma 560."""
    a2, d3, a3, d4, d6 = random.uniform(0.02, 0.45, 5).tolist()
    return [
        [0.0, 0.0, 0.0, -RIGHT],
        [0.0, d3, a2, 0.0],
        [0.0, 0.0, a3, RIGHT],
        [0.0, d4, 0.0, -RIGHT],
        [0.0, 0.0, 0.0, RIGHT],
        [0.0, d6, 0.0, 0.0],
    ]


KINDS: dict[str, Callable[[np.random.Generator], Rows]] = {
    "puma-like": _puma,
    "last three meet": lambda random: _meeting(random, 3),
    "first three meet": lambda random: _meeting(random, 0),
    "three parallel": _three_parallel,
    "generic": _generic,
}


def drawn(kind: str, random: np.random.Generator) -> Rows:
    """Rows of a kind whose joints move the tool in all directions: others reach a pose in endless ways."""
    while True:
        rows = KINDS[kind](random)
        _, matrix = _error(rows, random.uniform(-np.pi, np.pi, (8, 6)), np.eye(4))
        if np.median(np.linalg.svd(matrix, compute_uv=False)[:, -1]) > 1e-3:
            return rows


def poses_of(rows: Rows, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The tool's poses (m, 4, 4) after Paul's matrices, and the axes' directions and points (m, 6, 6)."""
    pose, axes = np.broadcast_to(np.eye(4), (len(q), 4, 4)), []
    for index, (theta, d, a, alpha) in enumerate(rows):
        axes.append(np.concatenate([pose[:, :3, 2], pose[:, :3, 3]], axis=1))
        turn = theta + q[:, index]
        c, s, ca, sa, o = np.cos(turn), np.sin(turn), np.cos(alpha), np.sin(alpha), np.zeros(len(q))
        lines = [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [o, o + sa, o + ca, o + d]]
        row = np.stack([np.stack(line, axis=-1) for line in [*lines, [o, o, o, o + 1]]], axis=1)
        pose = pose @ row
    return pose, np.stack(axes, axis=1)


def newton(rows: Rows, target: np.ndarray, starts: np.ndarray, steps: int = 60) -> np.ndarray:
    """The different solutions (k, 6), within ± 180°, to which Newton's steps lead from `starts` (m, 6)."""
    q = starts.copy()
    for _ in range(steps):
        error, matrix = _error(rows, q, target)
        square = np.swapaxes(matrix, 1, 2) @ matrix + 1e-12 * np.eye(6)
        step = np.linalg.solve(square, np.swapaxes(matrix, 1, 2) @ error[..., None])[..., 0]
        length = np.linalg.norm(step, axis=1, keepdims=True)
        q = q + step * np.minimum(1.0, 1.0 / np.maximum(length, 1e-9))
    met = q[np.abs(_error(rows, q, target)[0]).max(axis=1) < 1e-10]
    return different((met + np.pi) % (2 * np.pi) - np.pi)


def _error(rows: Rows, q: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What is missing to the target (m, 6), metres and radians, and its derivatives (m, 6, joints)."""
    pose, axes = poses_of(rows, q)
    turn = target[:3, :3] @ np.swapaxes(pose[:, :3, :3], 1, 2)
    sine = np.stack(
        [turn[:, 2, 1] - turn[:, 1, 2], turn[:, 0, 2] - turn[:, 2, 0], turn[:, 1, 0] - turn[:, 0, 1]], 1
    )
    length = np.linalg.norm(sine, axis=1)
    angle = np.arctan2(length, np.trace(turn, axis1=1, axis2=2) - 1)
    vector = sine * (angle / np.where(length == 0, 1.0, length))[:, None]
    z, point = axes[..., :3], axes[..., 3:]
    matrix = np.concatenate([np.cross(z, pose[:, None, :3, 3] - point), z], axis=2)
    return np.concatenate([target[:3, 3] - pose[:, :3, 3], vector], axis=1), np.swapaxes(matrix, 1, 2)


def apart(one: np.ndarray, others: np.ndarray) -> np.ndarray:
    """The largest difference of a joint between one position (6,) and others (k, 6), over full turns."""
    return np.abs((others - one + np.pi) % (2 * np.pi) - np.pi).max(axis=1)


def different(solutions: np.ndarray) -> np.ndarray:
    """The solutions (k, 6) that differ by more than 1e-4 in some joint."""
    kept: list[np.ndarray] = []
    for q in solutions:
        if not kept or apart(q, np.array(kept)).min() > 1e-4:
            kept.append(q)
    return np.array(kept).reshape(-1, 6)


@dataclass
class Count:
    """What was compared: solutions of Newton's starts and how many of these `ik_all` lists; poses refused."""

    found: int = 0
    listed: int = 0
    own: int = 0
    poses: int = 0
    refused: int = 0
    seconds: float = 0.0
    ik_seconds: float = 0.0


def compare(
    rows: Rows,
    turn: np.ndarray,
    targets: int,
    starts: int,
    poses: int,
    random: np.random.Generator,
    count: Count | None = None,
) -> Count:
    """What an arm's comparison is, added to `count`."""
    count = Count() if count is None else count
    robot = arm_of(rows, turn)
    q = random.uniform(-turn, turn, (poses, 6))
    pose = poses_of(rows, q)[0]
    begun = time.perf_counter()
    reached = solve(robot, pose[:, :3, 3], pose[:, :3, :3]).valid.any(axis=1)
    count.ik_seconds += time.perf_counter() - begun
    count.poses += poses
    count.refused += int((~reached).sum())
    for target in pose[:targets]:
        begun = time.perf_counter()
        try:
            listed = ik_all(robot, target[:3, 3], target[:3, :3])
        except Unreachable:
            listed = np.empty((0, 6))
        count.seconds += time.perf_counter() - begun
        known = newton(rows, target, random.uniform(-np.pi, np.pi, (starts, 6)))
        known = known[(np.abs(known) <= turn).all(axis=1)]
        count.found += len(known)
        count.own += len(different(listed))
        count.listed += sum(bool(apart(one, listed).min(initial=9.0) < 1e-4) for one in known)
    return count


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for name, number in (("arms", 10), ("targets", 5), ("starts", 500), ("poses", 100), ("seed", 1)):
        parser.add_argument(f"--{name}", type=int, default=number)
    parser.add_argument("--kind", choices=list(KINDS))
    given = parser.parse_args()
    for kind in KINDS:
        if given.kind not in (None, kind):
            continue
        random = np.random.default_rng(given.seed)
        count = Count()
        for number in range(given.arms):
            # half of the arms turn all around, the others stop at limits
            turn = np.full(6, np.pi) if number % 2 else random.uniform(np.pi / 2, np.pi, 6)
            compare(drawn(kind, random), turn, given.targets, given.starts, given.poses, random, count)
        print(
            f"{kind:17} {given.arms} arms: {count.listed} of {count.found} solutions of {given.starts} starts"
            f" listed ({count.own} in all, {count.seconds:.1f} s); {count.refused} of {count.poses} poses"
            f" refused ({count.ik_seconds:.1f} s)"
        )


if __name__ == "__main__":
    main()
