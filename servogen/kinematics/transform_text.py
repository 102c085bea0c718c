"""A product of transforms as people write it: 'Ry(30) Tx(50) Rz(60)'.

In: text; angles in degrees, lengths in any one unit. Out: the transform (4, 4) in the same unit.
Words: Rx Ry Rz (angle), Tx Ty Tz (length), Rot(axis, angle), Trans(x, y, z); blanks, * or · between them.
"""

from __future__ import annotations

import re
from math import radians

import numpy as np

from servogen.errors import InputError, Location
from servogen.kinematics.transforms import Floats, frame_matrix, translation
from servogen.robot.model import Frame

_FACTOR = re.compile(r"(?P<word>[A-Za-z]+)\s*\((?P<inside>[^()]*)\)")
_BETWEEN = re.compile(r"[\s*·]*")
_HINT = "Rx(deg) Ry(deg) Rz(deg) Tx(mm) Ty(mm) Tz(mm) Rot(axis, deg) Trans(x, y, z)"


MAX_TEXT = 10_000
"""A thousand factors."""


def parse(text: str) -> Floats:
    """The product of the factors of `text`, from left to right. Raises InputError with the column."""
    if len(text) > MAX_TEXT:
        raise InputError("transform-syntax", f"the product has more than {MAX_TEXT} characters")
    matrix, at = np.eye(4), 0
    while True:
        at = _end_of(_BETWEEN.match(text, at), at)
        if at == len(text):
            break
        found = _FACTOR.match(text, at)
        if not found:
            raise _error(at, f"'{text[at:].split()[0]}' is no transform")
        matrix = matrix @ _factor(found["word"], found["inside"].split(","), at)
        at = found.end()
    if not text.strip():
        raise InputError("transform-syntax", "there is no transform", hint=_HINT)
    return np.asarray(matrix)


def _end_of(found: re.Match[str] | None, at: int) -> int:
    return found.end() if found else at


def _error(at: int, message: str) -> InputError:
    return InputError("transform-syntax", message, Location(column=at + 1, key=f"column {at + 1}"), _HINT)


def _factor(name: str, inside: list[str], at: int) -> Floats:
    word = name.lower()
    if word == "rot" and len(inside) == 2 and inside[0].strip().lower() in ("x", "y", "z"):
        return _turn(inside[0].strip().lower(), _number(inside[1], at))
    if word == "trans" and len(inside) == 3:
        return translation(*(_number(each, at) for each in inside))
    if len(word) == 2 and word[0] in "rt" and word[1] in "xyz" and len(inside) == 1:
        value = _number(inside[0], at)
        if word[0] == "r":
            return _turn(word[1], value)
        return translation(*(value if axis == word[1] else 0.0 for axis in "xyz"))
    raise _error(at, f"'{name}({','.join(inside)})' is no transform")


def _turn(axis: str, degrees: float) -> Floats:
    angle = radians(degrees)
    return frame_matrix({"x": Frame(rx=angle), "y": Frame(ry=angle), "z": Frame(rz=angle)}[axis])


def _number(text: str, at: int) -> float:
    try:
        value = float(text)
    except ValueError:
        raise _error(at, f"'{text.strip()}' is not a number") from None
    if not np.isfinite(value):
        raise _error(at, f"'{text.strip()}' is not a finite number")
    return value
