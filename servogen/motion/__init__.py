"""Poses and paths -> `JointTrajectory`, joint angles frame by frame."""

from servogen.motion.poses import Motion, Planned, Pose, trajectory
from servogen.motion.trajectory import JointTrajectory, Part, bound

__all__ = ["JointTrajectory", "Motion", "Part", "Planned", "Pose", "bound", "trajectory"]
