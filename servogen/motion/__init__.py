"""Poses and paths -> `JointTrajectory`, joint angles frame by frame."""

from servogen.motion.poses import Motion, Planned, Pose, trajectory
from servogen.motion.trajectory import JointTrajectory, bound

__all__ = ["JointTrajectory", "Motion", "Planned", "Pose", "bound", "trajectory"]
