"""Robots as a command's argument names them: of the catalogue, of a TOML file, of a URDF file.

In: a short name or a path. Out: a `Robot`.
"""

from __future__ import annotations

from pathlib import Path

from servogen.errors import InputError, Location
from servogen.inputs import read_input
from servogen.kinematics.urdf import from_urdf
from servogen.robot import robots
from servogen.robot.model import Arm, Robot

URDF = ".urdf"


def robot(name: str) -> Robot:
    """Raises InputError for a name that is none and a file that is wrong."""
    return _read(Path(name)) if name.lower().endswith(URDF) else robots.robot(name)


def arm(name: str) -> Arm:
    """As `robot`, for what only an arm or the leg has. Raises InputError for the others."""
    return _read(Path(name)) if name.lower().endswith(URDF) else robots.arm(name)


def _read(path: Path) -> Arm:
    try:
        text = read_input(path).decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError("not-utf8", "is not UTF-8 text", Location(str(path))) from error
    return from_urdf(text, str(path))
