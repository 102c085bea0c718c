"""Poses and paths -> `JointTrajectory`, joint angles frame by frame."""

from servogen.motion.poses import Motion, Pose, trajectory
from servogen.motion.trajectory import JointTrajectory

__all__ = ["JointTrajectory", "Motion", "Pose", "trajectory"]
