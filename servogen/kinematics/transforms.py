"""Homogeneous transforms: rotations, translations, inverses, points, cylindrical and spherical coordinates.

In: angles in radians and lengths in metres, arrays of any leading shape. Out: (..., 3, 3) rotations,
(..., 4, 4) transforms. Frames are right-handed; post-multiplying turns about the moving axes, pre-multiplying
about the fixed ones.

        ┌ n o a p ┐   n, o, a: the unit vectors of the moved frame in the fixed one (a: approach)
    T = │         │   p: its origin
        └ 0 0 0 1 ┘
"""

from __future__ import annotations

import re
from math import radians

import numpy as np
from numpy.typing import ArrayLike, NDArray

from servogen.errors import InputError, Location
from servogen.inputs import number_in
from servogen.robot.model import FixedFrame, Mount

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
"""Points x + iy of a plane."""

AXES = {"x": 0, "y": 1, "z": 2}
_PARALLEL = 1e-15
"""Below it a cosine or sine is 0: cos 90° is 6e-17 in floating point."""


def exact_cos_sin(angle: float) -> tuple[float, float]:
    """Return cos and sin of a constant angle; multiples of 90° give exactly 0 and ±1, so that structure is
    visible.
    """
    cosine, sine = np.cos(angle), np.sin(angle)
    cosine = 0.0 if abs(cosine) < _PARALLEL else cosine
    sine = 0.0 if abs(sine) < _PARALLEL else sine
    return (float(np.sign(cosine)) if sine == 0.0 else float(cosine)), (
        float(np.sign(sine)) if cosine == 0.0 else float(sine)
    )


def cos_sin(angle: Floats) -> tuple[Floats, Floats]:
    """Return cos and sin of many angles from one tangent of the half angle, to a few 1e-16.

    numpy has a vector tangent but only a scalar sine, so this is several times faster than the two calls.

        t = tan(x/2):   cos x = (1 - t²)/(1 + t²)   sin x = 2t/(1 + t²)
    """
    tangent = np.tan(0.5 * angle)
    scale = 1.0 / (1.0 + tangent * tangent)
    return 2.0 * scale - 1.0, 2.0 * tangent * scale


def rot(axis: str, angle: ArrayLike) -> Floats:
    """Return the rotation (..., 3, 3) by `angle` about "x", "y" or "z"."""
    if axis not in AXES:
        raise InputError("bad-rotation", f"'{axis}' is not an axis", hint="x, y or z")
    angle = np.asarray(angle, float)
    first, second = (AXES[axis] + 1) % 3, (AXES[axis] + 2) % 3
    matrix = np.zeros((*angle.shape, 3, 3))
    matrix[..., AXES[axis], AXES[axis]] = 1.0
    matrix[..., first, first] = matrix[..., second, second] = np.cos(angle)
    matrix[..., second, first] = np.sin(angle)
    matrix[..., first, second] = -np.sin(angle)
    return matrix


def transform(rotation: ArrayLike | None = None, position: ArrayLike = (0.0, 0.0, 0.0)) -> Floats:
    """Return the transform (..., 4, 4) of a rotation (..., 3, 3), by default none, and a
    position (..., 3).
    """
    position = np.asarray(position, float)
    rotation = np.eye(3) if rotation is None else np.asarray(rotation, float)
    shape = np.broadcast_shapes(rotation.shape[:-2], position.shape[:-1])
    matrix = np.zeros((*shape, 4, 4))
    matrix[..., :3, :3] = rotation
    matrix[..., :3, 3] = position
    matrix[..., 3, 3] = 1.0
    return matrix


def rotation(axis: str, angle: ArrayLike) -> Floats:
    """Return Rot(axis, angle) as a transform (..., 4, 4)."""
    matrix = rot(axis, angle)
    return transform(matrix, np.zeros((*matrix.shape[:-2], 3)))


def translation(x: ArrayLike, y: ArrayLike, z: ArrayLike) -> Floats:
    """Return Trans(x, y, z) as a transform (..., 4, 4)."""
    arrays = np.broadcast_arrays(*(np.asarray(value, float) for value in (x, y, z)))
    return transform(None, np.stack(arrays, axis=-1))


def frame_matrix(frame: FixedFrame) -> Floats:
    """Return a robot's fixed frame as a transform; right angles are exact."""
    matrices = []
    for axis, angle in (("z", frame.rz), ("y", frame.ry), ("x", frame.rx)):
        cosine, sine = exact_cos_sin(angle)
        first, second = (AXES[axis] + 1) % 3, (AXES[axis] + 2) % 3
        matrix = np.eye(3)
        matrix[first, first] = matrix[second, second] = cosine
        matrix[second, first], matrix[first, second] = sine, -sine
        matrices.append(matrix)
    return transform(matrices[0] @ matrices[1] @ matrices[2], (frame.x, frame.y, frame.z))


def inverse(matrix: ArrayLike) -> Floats:
    """Return T⁻¹ = [Rᵀ, -Rᵀp; 0, 1] of transforms (..., 4, 4)."""
    matrix = np.asarray(matrix, float)
    turned = np.swapaxes(matrix[..., :3, :3], -1, -2)
    return transform(turned, -(turned @ matrix[..., :3, 3:])[..., 0])


def apply(matrix: ArrayLike, points: ArrayLike) -> Floats:
    """Return points (..., 3) moved by transforms (..., 4, 4)."""
    matrix, points = np.asarray(matrix, float), np.asarray(points, float)
    return np.asarray((matrix[..., :3, :3] @ points[..., None])[..., 0] + matrix[..., :3, 3])


def homogeneous(point: ArrayLike, scale: ArrayLike = 1.0) -> Floats:
    """Return (X, Y, Z, W) of a point; scale 0 makes it a direction."""
    point, scale = np.asarray(point, float), np.asarray(scale, float)[..., None]
    whole = np.where(scale == 0.0, point, point * scale)
    return np.concatenate([whole, np.broadcast_to(scale, (*whole.shape[:-1], 1))], axis=-1)


def is_rotation(matrix: ArrayLike, tolerance: float = 1e-9) -> bool:
    """Return whether RᵀR = I and det R = +1 for all of (..., 3, 3)."""
    matrix = np.asarray(matrix, float)
    unit = np.abs(np.swapaxes(matrix, -1, -2) @ matrix - np.eye(3)).max(initial=0.0)
    return bool(unit <= tolerance and np.all(np.linalg.det(matrix) > 0))


def skew(vector: ArrayLike) -> Floats:
    """Return the matrix (..., 3, 3) of the cross product: skew(a) b = a × b."""
    vector = np.asarray(vector, float)
    matrix = np.zeros((*vector.shape, 3))
    for axis in range(3):
        first, second = (axis + 1) % 3, (axis + 2) % 3
        matrix[..., second, first] = vector[..., axis]
        matrix[..., first, second] = -vector[..., axis]
    return matrix


def cylindrical(r: ArrayLike, alpha: ArrayLike, c: ArrayLike, keep_orientation: bool = False) -> Floats:
    """Return T(0,0,c) Rot(z, α) T(r,0,0), whose position is (r cos α, r sin α, c). Append Rot(z, -α) to keep
    the axes parallel.
    """
    r, alpha, c = np.broadcast_arrays(*(np.asarray(value, float) for value in (r, alpha, c)))
    turn = rot("z", np.zeros_like(alpha) if keep_orientation else alpha)
    return transform(turn, np.stack([r * np.cos(alpha), r * np.sin(alpha), c], axis=-1))


def spherical(r: ArrayLike, beta: ArrayLike, gamma: ArrayLike, keep_orientation: bool = False) -> Floats:
    """Return Rot(z, γ) Rot(y, β) T(0,0,r): position r (sin β cos γ, sin β sin γ, cos β)."""
    r, beta, gamma = np.broadcast_arrays(*(np.asarray(value, float) for value in (r, beta, gamma)))
    turn = rot("z", gamma) @ rot("y", beta)
    rotation = np.broadcast_to(np.eye(3), turn.shape) if keep_orientation else turn
    return transform(rotation, turn[..., :, 2] * r[..., None])


def wrapped(angle: ArrayLike) -> Floats:
    """Return the same angles in (-π, π]."""
    return np.asarray(np.pi - np.mod(np.pi - np.asarray(angle, float), 2 * np.pi))


def mount_matrix(mount: Mount) -> Floats:
    """Return the matrix (4, 4) from leg points to body points; a mirrored leg's has the determinant -1."""
    mirror = np.diag([1.0, -1.0 if mount.mirrored else 1.0, 1.0])
    return transform(rot("z", mount.heading) @ mirror, (mount.x, mount.y, mount.z))


def to_body(mount: Mount, points: ArrayLike) -> Floats:
    """Return points (..., 3) of a leg's frame in the body frame."""
    matrix = mount_matrix(mount)
    return np.asarray(np.asarray(points, float) @ matrix[:3, :3].T + matrix[:3, 3])


def to_leg(mount: Mount, points: ArrayLike) -> Floats:
    """Return points (..., 3) of the body frame in a leg's frame."""
    matrix = mount_matrix(mount)
    return np.asarray((np.asarray(points, float) - matrix[:3, 3]) @ matrix[:3, :3])


_FACTOR = re.compile(r"(?P<word>[A-Za-z]+)\s*\((?P<inside>[^()]*)\)")
_BETWEEN = re.compile(r"[\s*·]*")
_HINT = (
    "Rx(deg) Ry(deg) Rz(deg) Tx(mm) Ty(mm) Tz(mm) Rot(axis, deg) Rot(x, y, z, deg) Trans(x, y, z) "
    "inv(…) (…)^-1"
)


MAX_NUMBER = 1e9
"""The largest number that may be typed: a thousand kilometres, in millimetres."""

MAX_TEXT = 10_000
"""The longest product, about a thousand factors."""


MAX_NESTING = 50
"""Parentheses inside each other in a product."""
_INVERSE = re.compile(r"\s*\^\s*-\s*1")
_OPENING = re.compile(r"(?:[iI][nN][vV]\s*)?\(")


def parse(text: str) -> Floats:
    """Return the product of the factors of `text`, from left to right. `inv(…)` and `^-1` are inverses, and
    parentheses group. Raises InputError with the column.
    """
    if len(text) > MAX_TEXT:
        raise InputError("transform-syntax", f"the product has more than {MAX_TEXT} characters")
    if not text.strip():
        raise InputError("transform-syntax", "the product is empty", hint=_HINT)
    matrix, position = _product(text, 0, 0)
    if position < len(text):
        raise _error(position, "there is no '(' for this ')'")
    return matrix


def _product(text: str, position: int, depth: int) -> tuple[Floats, int]:
    """Return a product, and the position of the `)` or the end of the text behind it."""
    matrix = np.eye(4)
    while True:
        position = _match_end(_BETWEEN.match(text, position), position)
        if position == len(text) or text[position] == ")":
            return matrix, position
        factor, position = _power(text, position, depth)
        matrix = matrix @ factor


def _power(text: str, position: int, depth: int) -> tuple[Floats, int]:
    """Return a factor or its inverse, and the position behind it."""
    opening = _OPENING.match(text, position)
    if opening:
        if depth == MAX_NESTING:
            raise _error(position, f"parentheses are nested more than {MAX_NESTING} deep")
        matrix, end = _product(text, opening.end(), depth + 1)
        if end == len(text):
            raise _error(position, "this '(' is not closed")
        position = end + 1
        matrix = inverse(matrix) if opening.group() != "(" else matrix
    else:
        factor = _FACTOR.match(text, position)
        if not factor:
            raise _error(position, f"'{text[position:].split()[0]}' is not a transform")
        matrix = _factor(factor["word"], factor["inside"].split(","), position)
        position = factor.end()
    power = _INVERSE.match(text, position)
    return (inverse(matrix), power.end()) if power else (matrix, position)


def _match_end(match: re.Match[str] | None, position: int) -> int:
    return match.end() if match else position


def _error(position: int, message: str) -> InputError:
    return InputError("transform-syntax", message, Location(column=position + 1), _HINT)


def _factor(name: str, inside: list[str], position: int) -> Floats:
    word = name.lower()
    if word == "rot" and len(inside) == 2 and inside[0].strip().lower() in ("x", "y", "z"):
        return _turn(inside[0].strip().lower(), _number(inside[1], position))
    if word == "rot" and len(inside) == 4:
        *axis, turned = (_number(number, position) for number in inside)
        if not any(axis):
            raise _error(position, "an axis of length 0 has no direction")
        return _turn_about(np.array(axis), turned)
    if word == "trans" and len(inside) == 3:
        return translation(*(_number(number, position) for number in inside))
    if len(word) == 2 and word[0] in "rt" and word[1] in "xyz" and len(inside) == 1:
        value = _number(inside[0], position)
        if word[0] == "r":
            return _turn(word[1], value)
        return translation(*(value if axis == word[1] else 0.0 for axis in "xyz"))
    raise _error(position, f"'{name}({','.join(inside)})' is not a transform")


def _turn(axis: str, degrees: float) -> Floats:
    angle = radians(degrees)
    return frame_matrix(
        {"x": FixedFrame(rx=angle), "y": FixedFrame(ry=angle), "z": FixedFrame(rz=angle)}[axis]
    )


def _turn_about(axis: Floats, degrees: float) -> Floats:
    """Return Rodrigues' rotation about any axis, by degrees."""
    cross, angle = skew(axis / np.linalg.norm(axis)), radians(degrees)
    return transform(np.eye(3) + np.sin(angle) * cross + 2 * np.sin(angle / 2) ** 2 * (cross @ cross))


def _number(text: str, position: int) -> float:
    value = number_in(text)
    if value is None:
        raise _error(position, f"'{text.strip()}' is not a number")
    if not np.isfinite(value):
        raise _error(position, f"'{text.strip()}' is not a finite number")
    if abs(value) > MAX_NUMBER:
        raise _error(position, f"'{text.strip()}' is not a number from -{MAX_NUMBER:g} to {MAX_NUMBER:g}")
    return value
