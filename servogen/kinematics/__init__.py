"""Kinematics: joint positions to poses and back; the kinds of robots and the catalogue."""
