"""Inverse kinematics: closed forms, numerical iteration, and the choice between their solutions."""
