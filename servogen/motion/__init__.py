"""Poses and paths -> `JointTrajectory`, joint angles frame by frame."""

from servogen.motion.poses import Motion, PlannedPoses, Pose, trajectory
from servogen.motion.trajectory import JointTrajectory, Part, bound

__all__ = ["JointTrajectory", "Motion", "Part", "PlannedPoses", "Pose", "bound", "trajectory"]
