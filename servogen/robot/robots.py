"""The catalogue of robots: data files by short name.

In: a short name (`scara`, `rv-m1`, …), an alias, or the path of a TOML file. Out: a `Robot`.
"""

from __future__ import annotations

from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path

from servogen.errors import InputError, did_you_mean
from servogen.robot import reader
from servogen.robot.model import Arm, Hexapod, OmniBase, Robot
from servogen.toml import file as toml_file


def _files() -> dict[str, Traversable]:
    folder = resources.files("servogen.robot") / "catalogue" / "robots"
    return {each.name.removesuffix(".toml"): each for each in folder.iterdir() if each.name.endswith(".toml")}


def names() -> tuple[str, ...]:
    """Return the short names of the catalogue's robots, in alphabetical order."""
    return tuple(sorted(_files()))


@cache
def _aliases() -> dict[str, str]:
    """Return other names of the catalogue's robots, such as `robotino` for `omni`."""
    documents = {name: toml_file.parse(each.read_text("utf-8"), each.name) for name, each in _files().items()}
    return {alias: name for name, document in documents.items() for alias in document.data.get("aliases", ())}


def catalogue(name: str) -> Robot:
    """Return the catalogue's robot with a short name or an alias. Raises InputError that suggests a similar
    name.
    """
    files = _files()
    short = name.lower().replace("_", "-")
    short = short if short in files else _aliases().get(short, short)
    if short not in files:
        raise InputError("unknown-robot", f"unknown robot '{name}'", hint=did_you_mean(name, files))
    return _read(short)


@cache
def _read(short: str) -> Robot:
    document = toml_file.parse(_files()[short].read_text("utf-8"), f"catalogue/robots/{short}.toml")
    return reader.robot_of(document, catalogue)


def robot(name: str) -> Robot:
    """Return the robot with a short name, or of the TOML file at a path that ends in .toml."""
    if name.lower().endswith(".toml"):
        return reader.load(Path(name), catalogue)
    return catalogue(name)


def arm(name: str) -> Arm:
    """Return the same as `robot` for an arm or the leg. Raises InputError for other kinds."""
    found = robot(name)
    if isinstance(found, Hexapod):
        raise InputError(
            "wrong-robot-kind",
            f"'{name}' has six legs, each a robot of its own",
            hint=f"use '{found.leg.name}'",
        )
    if isinstance(found, OmniBase):
        raise InputError(
            "wrong-robot-kind",
            f"'{name}' drives on wheels: it has no joints",
            hint="its commands are the motion's",
        )
    return found
