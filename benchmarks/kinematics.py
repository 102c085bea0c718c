"""Forward and inverse kinematics on arrays of 100 000 poses, against roboticstoolbox-python on the same.

Run: `pip install 'servogen[benchmarks]'`, then `python benchmarks/kinematics.py`. Exit code 1 when a demand
is missed: per RV-M1 pose, FK 50 times faster than DHRobot.fkine and 5 times than ets.eval, IK 30 times than
ik_LM.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from servogen.errors import ServogenError, ToolError
from servogen.kinematics.catalogue import arm
from servogen.kinematics.forward import fk, fk_position
from servogen.kinematics.inverse.numerical import limits, search
from servogen.kinematics.inverse.solve import ik, solve
from servogen.kinematics.transforms import Floats
from servogen.robot.model import Arm

POSES = 100_000
DEMANDS = {"FK against DHRobot.fkine": 50.0, "FK against ets.eval": 5.0, "IK against ik_LM": 30.0}


def per_pose_us(work: Callable[[], object], poses: int, rounds: int = 7) -> float:
    """Microseconds a pose, the best of `rounds`."""
    best = float("inf")
    for _ in range(rounds):
        start = time.perf_counter()
        work()
        best = min(best, time.perf_counter() - start)
    return 1e6 * best / poses


def poses_of(robot: Arm, count: int) -> tuple[Floats, Floats]:
    """Random joint positions within the limits, and the tool's poses there."""
    lower, upper = limits(robot)
    q = np.random.default_rng(1).uniform(lower, upper, (count, len(lower)))
    return q, np.ascontiguousarray(fk(robot, q))


def ours(name: str) -> tuple[float, float, float]:
    """Microseconds a pose of FK, of the chosen IK solution and of all solutions, which are checked."""
    robot = arm(name)
    q, pose = poses_of(robot, POSES)
    position, turn = pose[:, :3, 3], pose[:, :3, :3]
    found = ik(robot, position, turn)
    if np.abs(fk_position(robot, found) - position).max() > 1e-9:
        raise ServogenError(f"{name}: an inverse solution is wrong")
    return (
        per_pose_us(lambda: fk(robot, q), POSES),
        per_pose_us(lambda: ik(robot, position, turn), POSES),
        per_pose_us(lambda: solve(robot, position, turn), POSES),
    )


def their_rv_m1() -> Any:
    """The RV-M1 of the catalogue as a robot of the toolbox."""
    try:
        from roboticstoolbox import DHRobot, RevoluteDH
    except ImportError as error:
        raise ToolError(
            "tool-missing", "roboticstoolbox-python is missing", hint="pip install roboticstoolbox-python"
        ) from error
    robot = arm("rv-m1")
    return DHRobot(
        [
            RevoluteDH(
                d=row.d.value(robot.length), a=row.a.value(robot.length), alpha=row.alpha, offset=row.theta
            )
            for row in robot.rows
        ]
    )


def compare() -> dict[str, float]:
    """How many times faster than the toolbox, on the same RV-M1 poses in the same run."""
    robot, theirs = arm("rv-m1"), their_rv_m1()
    ets = theirs.ets()
    q, pose = poses_of(robot, POSES)
    if np.abs(ets.eval(q[:100]) - pose[:100]).max() > 1e-12:
        raise ServogenError("the toolbox and servogen disagree on the poses")
    few, fewer = 2000, 300
    our_fk, our_ik, _ = ours("rv-m1")
    fkine = per_pose_us(lambda: theirs.fkine(q[:few]), few, rounds=3)
    evaluate = per_pose_us(lambda: ets.eval(q), POSES)
    solved = per_pose_us(lambda: [ets.ik_LM(each) for each in pose[:fewer]], fewer, rounds=3)
    print(f"toolbox, rv-m1: fkine {fkine:.2f}, ets.eval {evaluate:.3f}, ik_LM {solved:.2f} µs a pose")
    return {
        "FK against DHRobot.fkine": fkine / our_fk,
        "FK against ets.eval": evaluate / our_fk,
        "IK against ik_LM": solved / our_ik,
    }


def main() -> int:
    print(f"servogen, {POSES} poses, µs a pose:   FK      IK chosen   IK all solutions")
    for name in ("leg", "scara", "rv-m1", "irb6400c"):
        forward, chosen, everything = ours(name)
        print(f"  {name:<30} {forward:8.4f} {chosen:10.4f} {everything:12.4f}")
    for name in ("rv-m1", "irb6400c"):
        robot = arm(name)
        _, pose = poses_of(robot, 10_000)
        start = time.perf_counter()
        found = search(robot, pose[:, :3, 3], pose[:, :3, :3])
        spent = 1e6 * (time.perf_counter() - start) / len(pose)
        reached = 100 * found.within(1e-7).mean()
        print(f"  {name}, numerical: {reached:.2f} % of {len(pose)} targets, {spent:.1f} µs a pose")
    missed = 0
    for what, factor in compare().items():
        enough = factor >= DEMANDS[what]
        missed += not enough
        print(f"  {what:<26} {factor:7.1f} times, demanded {DEMANDS[what]:g}{'' if enough else '   MISSED'}")
    return 1 if missed else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except ServogenError as error:
        print(error, file=sys.stderr)
        sys.exit(error.exit_code)
