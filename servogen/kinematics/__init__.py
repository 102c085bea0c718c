"""Kinematics: from joint positions to poses and back, for the robots of `servogen.robot`."""
