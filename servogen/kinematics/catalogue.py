"""Robots by name: those of the catalogue, of a TOML file, of a URDF file.

In: a short name (`scara`, `rv-m1`, …), an alias, or a path that ends in .toml or .urdf. Out: a `Robot`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path

from servogen.errors import InputError, Location, did_you_mean
from servogen.inputs import read_input
from servogen.kinematics.registry import KINDS
from servogen.kinematics.urdf import from_urdf
from servogen.robot.model import Arm, Robot
from servogen.toml import file as toml_file
from servogen.toml.file import Document

TOML, URDF = ".toml", ".urdf"
TIP = "#"
"""Separates the path of a URDF file from the link at the tip of the chain that is meant."""


def names() -> tuple[str, ...]:
    """Return the short names of the catalogue's robots, in alphabetical order."""
    return tuple(sorted(_files()))


def robot(name: str) -> Robot:
    """Return the robot with a short name or an alias, or the one in the file at a path.

    A URDF file may have the link of its tip behind it: arm.urdf#hand. Raises InputError for an unknown name,
    which suggests a similar one, and for an invalid file.
    """
    path, tip = file_of(name)
    if path is None:
        return _catalogue_robot(name)
    return _urdf(path, tip) if path.name.lower().endswith(URDF) else robot_of(toml_file.read(path))


def file_of(name: str) -> tuple[Path | None, str | None]:
    """Return the file that a name states, and the tip behind it; None for what the name does not state."""
    file, mark, tip = name.rpartition(TIP)
    if mark and file.lower().endswith(URDF):
        return Path(file), tip
    return (Path(name) if name.lower().endswith((TOML, URDF)) else None), None


def arm(name: str) -> Arm:
    """Return the same as `robot` for an arm or a single leg. Raises InputError for other kinds."""
    named = robot(name)
    if isinstance(named, Arm):
        return named
    parts = {limb.arm.name: None for limb in named.limbs}
    if not parts:
        raise InputError(
            "wrong-robot-kind",
            f"'{name}' drives on wheels: it has no joints",
            hint="[drive] moves it",
        )
    raise InputError(
        "wrong-robot-kind",
        f"'{name}' has {len(named.limbs)} legs, each a robot of its own",
        hint=f"use '{next(iter(parts))}'",
    )


def robot_of(document: Document) -> Robot:
    """Return the robot that `document` describes. Raises InputError with its location."""
    name = document.data.get("kind", Arm.kind)
    if not isinstance(name, str) or name not in KINDS:
        raise document.error(
            "not-allowed",
            ("kind",),
            f"{toml_file.shown(name)} is not allowed here",
            f"allowed: {', '.join(KINDS)}",
        )
    kind = KINDS[name]
    for key in document.data:
        others = [other.name for other in KINDS.values() if key in other.table.model_fields]
        if others and name not in others:
            where = " or ".join(f'kind = "{other}"' for other in others)
            raise document.error(
                "unknown-key",
                (key,),
                f"'{key}' belongs in a file of {where}, not of {name}",
                "without kind = …, the robot is an arm",
            )

    def find(other: str) -> Robot:
        """Return the robot of `like`: of the catalogue, or a URDF file beside this one."""
        path, tip = file_of(other)
        if path is None or not path.name.lower().endswith(URDF):
            return _catalogue_robot(other)
        return _urdf(Path(document.file).parent / path, tip)

    return kind.read(document, toml_file.validate(document, kind.table), find)


def _catalogue_robot(name: str) -> Robot:
    """Return the catalogue's robot with a short name or an alias. Raises InputError."""
    entries = _files()
    short = name.lower().replace("_", "-")
    short = short if short in entries else _name_of(short, entries) or short
    if short not in entries:
        raise InputError("unknown-robot", f"unknown robot '{name}'", hint=did_you_mean(name, entries))
    return _read(short)


def _files() -> dict[str, Traversable]:
    folder = resources.files("servogen.robot") / "catalogue" / "robots"
    return {entry.name.removesuffix(TOML): entry for entry in folder.iterdir() if entry.name.endswith(TOML)}


def _name_of(alias: str, entries: Mapping[str, Traversable]) -> str | None:
    """Return the short name of the robot that has another name, such as `omni` for `robotino`."""
    for name, entry in entries.items():
        text = entry.read_text("utf-8")
        # Only a file with the word is parsed: parsing all takes longer than to plan a job.
        if f'"{alias}"' in text and alias in toml_file.parse(text, entry.name).data.get("aliases", ()):
            return name
    return None


@cache
def _read(short: str) -> Robot:
    return robot_of(toml_file.parse(_files()[short].read_text("utf-8"), f"catalogue/robots/{short}.toml"))


def _urdf(path: Path, tip: str | None) -> Arm:
    try:
        text = read_input(path).decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError("not-utf8", "is not UTF-8 text", Location(str(path))) from error
    return from_urdf(text, str(path), tip)
