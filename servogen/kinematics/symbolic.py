"""Symbolic kinematics: link matrices, their product, the position and the Jacobian of an `Arm`, simplified.

In: an `Arm`. Out: sympy matrices in its joints and lengths by name, as text, LaTeX or C. sympy is large and
slow to import, so it belongs to the extra "symbolic" and is imported where it is used.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import degrees
from typing import TYPE_CHECKING, Any, Literal

from servogen.errors import InputError, ToolError
from servogen.robot.model import Arm, DHRow, FixedFrame, Length

if TYPE_CHECKING:
    import sympy

Style = Literal["text", "latex", "c"]


@dataclass(frozen=True, slots=True)
class SymbolicKinematics:
    """The link matrices A_1 … A_n, the base and tool frames and the product of all, simplified."""

    joints: tuple[Any, ...]
    base: sympy.ImmutableMatrix
    links: tuple[sympy.ImmutableMatrix, ...]
    tool: sympy.ImmutableMatrix
    product: sympy.ImmutableMatrix

    @property
    def position(self) -> sympy.ImmutableMatrix:
        """Return the tool's position (3, 1)."""
        return self.product[:3, 3]


def _sympy() -> Any:
    """Return the module. Raises ToolError if it is not installed."""
    try:
        import sympy
    except ImportError as error:
        raise ToolError(
            "tool-missing", "symbolic kinematics need sympy", hint="pip install 'servogen[symbolic]'"
        ) from error
    return sympy


@cache
def symbolic_fk(arm: Arm) -> SymbolicKinematics:
    """Return the forward kinematics of `arm` in symbols: joints q1 …, and the lengths by name."""
    sympy = _sympy()

    links, tool = _links(arm), _frame(arm.tool)
    return SymbolicKinematics(
        joints=_joint_symbols(arm),
        base=_frame(arm.base),
        links=links,
        tool=tool,
        product=sympy.ImmutableMatrix((_first(arm, len(links)) * tool).applyfunc(_tidy)),
    )


@cache
def symbolic_jacobian(arm: Arm, frame: Literal["0", "n"] = "0") -> sympy.ImmutableMatrix:
    """Return the geometric Jacobian, 6 × n, in the base's frame or in the tool's.

    In the base's frame the upper rows are the derivative of the position. In the tool's, with U = [R, p] the
    product of the links after the joint's axis z: upper rows Rᵀ (z × p), lower rows Rᵀ z.
    """
    sympy = _sympy()

    chain = symbolic_fk(arm)
    columns = [sympy.zeros(6, 1) for _ in arm.joints]
    for index, row in enumerate(arm.rows):
        if row.joint is None:
            continue
        turning = arm.joints[row.joint].turning
        if frame == "n":
            column = _column_at_tool(_after(arm, index), turning)
        else:
            axis = _before(arm, index)[:3, 2] if turning else sympy.zeros(3, 1)
            column = sympy.Matrix.vstack(sympy.zeros(3, 1), axis)
        columns[row.joint] += _metres(row.ratio) * column
    if frame == "0":
        for column, joint in zip(columns, chain.joints, strict=True):
            # Shorter expressions than the cross product of axis and lever.
            column[:3, 0] = chain.position.diff(joint)
    return sympy.ImmutableMatrix(sympy.Matrix.hstack(*columns).applyfunc(_tidy))


@cache
def _links(arm: Arm) -> tuple[Any, ...]:
    sympy = _sympy()

    joints = _joint_symbols(arm)
    return tuple(sympy.ImmutableMatrix(_link(arm, row, joints)) for row in arm.rows)


@cache
def _first(arm: Arm, count: int) -> Any:
    """Return the product of the base and the first `count` links."""
    if not count:
        return _frame(arm.base)
    return (_first(arm, count - 1) * _links(arm)[count - 1]).applyfunc(_tidy)


@cache
def _last(arm: Arm, count: int) -> Any:
    """Return the product of the last `count` links and the tool."""
    if not count:
        return _frame(arm.tool)
    return (_links(arm)[-count] * _last(arm, count - 1)).applyfunc(_tidy)


def _before(arm: Arm, index: int) -> Any:
    """Return the frame whose z is the axis of row `index`: the row's own if modified, else the one before."""
    return _first(arm, index + (arm.convention == "modified"))


def _after(arm: Arm, index: int) -> Any:
    """Return the tool's frame seen from the frame of `_before`."""
    return _last(arm, len(arm.rows) - index - (arm.convention == "modified"))


def _column_at_tool(seen: Any, turning: bool) -> Any:
    sympy = _sympy()

    turn, p = seen[:3, :3].T, seen[:3, 3]
    if not turning:
        return sympy.Matrix.vstack(turn[:, 2], sympy.zeros(3, 1))
    return sympy.Matrix.vstack(turn * sympy.Matrix([-p[1], p[0], 0]), turn[:, 2])


def text_of(matrix: Any, style: Style = "text", name: str = "T") -> str:
    """Return a sympy matrix or expression as text, LaTeX, or C assignments name[row][column] = …;"""
    sympy = _sympy()

    if style == "latex":
        return str(sympy.latex(matrix))
    if style == "text":
        if not isinstance(matrix, sympy.MatrixBase):
            return str(matrix)
        return _table([[str(matrix[i, j]) for j in range(matrix.cols)] for i in range(matrix.rows)])
    if style != "c":
        raise InputError("bad-option", f"'{style}' is not a style", hint="text, latex or c")
    if not isinstance(matrix, sympy.MatrixBase):
        return f"{name} = {sympy.ccode(matrix)};"
    vector = matrix.cols == 1
    return "\n".join(
        f"{name}[{row}]{'' if vector else f'[{column}]'} = {sympy.ccode(matrix[row, column])};"
        for row in range(matrix.rows)
        for column in range(matrix.cols)
    )


def _table(cells: list[list[str]]) -> str:
    widths = [max(len(line[column]) for line in cells) for column in range(len(cells[0]))]
    lines = ("  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)) for line in cells)
    return "\n".join(f"[ {line} ]" for line in lines)


def _joint_symbols(arm: Arm) -> tuple[Any, ...]:
    """Return the joints' symbols; one that is called like a length is q_ and its name."""
    sympy = _sympy()

    names = (f"q_{joint.name}" if joint.name in arm.length else joint.name for joint in arm.joints)
    return tuple(sympy.Symbol(name, real=True) for name in names)


def _angle(radians: float) -> Any:
    """Return a constant angle as a fraction of π, to nine decimals of a degree."""
    sympy = _sympy()

    # Rational, so that sympy finds the exact sines of right angles and thirds of them.
    return sympy.Rational(str(round(degrees(radians), 9))) * sympy.pi / 180


def _metres(value: float) -> Any:
    sympy = _sympy()

    return sympy.Rational(str(round(value, 12)))


def _length(length: Length) -> Any:
    sympy = _sympy()

    terms = (int(factor) * sympy.Symbol(name, real=True) for name, factor in length.terms)
    return sum(terms, _metres(length.constant))


def _link(arm: Arm, row: DHRow, joints: tuple[Any, ...]) -> Any:
    theta, d, moved = _angle(row.theta), _length(row.d), 0
    if row.joint is not None:
        moved = _metres(row.ratio) * joints[row.joint]
        if arm.joints[row.joint].turning:
            theta += moved
        else:
            d += moved
    screw = _turn("z", theta) * _shift(0, 0, d)
    across = _shift(_length(row.a), 0, 0) * _turn("x", _angle(row.alpha))
    return screw * across if arm.convention == "standard" else across * screw


def _frame(frame: FixedFrame) -> Any:
    sympy = _sympy()

    shift = _shift(*(_metres(value) for value in (frame.x, frame.y, frame.z)))
    turns = _turn("z", _angle(frame.rz)) * _turn("y", _angle(frame.ry)) * _turn("x", _angle(frame.rx))
    return sympy.ImmutableMatrix(shift * turns)


def _turn(axis: str, angle: Any) -> Any:
    sympy = _sympy()

    place = "xyz".index(axis)
    first, second = (place + 1) % 3, (place + 2) % 3
    matrix = sympy.eye(4)
    matrix[first, first] = matrix[second, second] = sympy.cos(angle)
    matrix[second, first], matrix[first, second] = sympy.sin(angle), -sympy.sin(angle)
    return matrix


def _shift(x: Any, y: Any, z: Any) -> Any:
    sympy = _sympy()

    matrix = sympy.eye(4)
    matrix[:3, 3] = sympy.Matrix([x, y, z])
    return matrix


def _tidy(expression: Any) -> Any:
    """Return an expression simplified as the labs write it: sums of parallel turns in one sine or cosine.

    sympy's own `simplify` is slow on these products and splits them into sines of sums of unrelated joints,
    so the addition theorems are applied only where they shorten the expression.
    """
    sympy = _sympy()
    from sympy.simplify.fu import TR5, TR6, TR10i

    forms = [sympy.expand(expression)]
    if forms[0].has(sympy.sin) and forms[0].has(sympy.cos):
        # sin² as 1 - cos² and the other way round, so that sin² + cos² meet; then the addition theorems
        forms += [sympy.expand(rule(forms[0])) for rule in (TR5, TR6)]
        forms += [TR10i(form) for form in forms]
    return min((*forms, *map(sympy.factor_terms, forms)), key=sympy.count_ops)
