"""The static torque of every servo of a job in every frame, compared with its model's.

In: an arm or a walk, the bindings of joints to servos, the servos. Out: warnings. A robot without stated
masses, and a servo without a stated torque, are not checked.

    a servo that turns `ratio` radians for each unit of a joint gives 1 / ratio of the joint's torque
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from servogen.errors import Diagnostic
from servogen.job.tip import Tip
from servogen.kinematics.protocol import WalkingRobot
from servogen.kinematics.statics import gravity_torques, has_masses
from servogen.motion.gait.walk import Walk
from servogen.motion.loads import loads_of
from servogen.motion.trajectory import Floats
from servogen.pulse.lint import SAME_DIGITS, check_torque
from servogen.robot.binding import Binding
from servogen.robot.servo import Servo


def arm_torques(tip: Tip, angles: Floats, servos: Sequence[Servo]) -> Iterator[Diagnostic]:
    """Yield a warning for each servo of an arm whose links and payload need more than its torque.

    `angles` (frames, servos): NaN where there is no pulse; such a frame needs no torque.
    """
    if not has_masses(tip.limb.arm):
        return
    columns = [servos.index(servo) for servo in tip.servos]
    pulsed = np.flatnonzero(~np.isnan(angles[:, columns]).any(axis=1))
    distinct, back = np.unique(angles[pulsed][:, columns], axis=0, return_inverse=True)
    if not len(pulsed):
        return
    joints = [each.position(column) for each, column in zip(tip.bindings, distinct.T, strict=True)]
    held = gravity_torques(tip.limb.arm, np.stack(joints, axis=1))[back.reshape(-1)]
    for index, (binding, servo) in enumerate(zip(tip.bindings, tip.servos, strict=True)):
        torque = np.full(len(angles), np.nan)
        torque[pulsed] = np.abs(held[:, index] / binding.ratio)
        yield from check_torque(servo, binding.joint, torque)


def walk_torques(
    robot: WalkingRobot, walk: Walk, bindings: Sequence[Binding], servos: Sequence[Servo]
) -> Iterator[Diagnostic]:
    """Yield a warning for each servo of a walking robot whose weight needs more than its torque."""
    loads = loads_of(robot, walk)
    if loads is None:
        return
    by_joint = {binding.joint: binding for binding in bindings}
    by_name = {servo.name: servo for servo in servos}
    for index, leg in enumerate(loads.legs):
        binding = by_joint[f"{leg}_{robot.lifting_joint}"]
        torque = loads.torques[:, index] / abs(binding.ratio)
        warnings = check_torque(by_name[binding.servo], binding.joint, torque)
        for warning in warnings:
            frame = int(np.nanargmax(np.round(torque, SAME_DIGITS)))
            yield replace(warning, message=f"{warning.message}; {loads.detail(index, frame)}")
