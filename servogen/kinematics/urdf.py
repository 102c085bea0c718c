"""URDF: an `Arm` (the leg too) written as the robot description of ROS, and a serial chain read from one.

In and out: URDF text, metres and radians. Reading and writing the XML is urdf_parser_py's (extra `urdf`).
URDF cannot hold the names of the lengths, home positions and the closed form: they are lost.
A row that follows another joint becomes a joint with `mimic`.

What is read are joint axes at position zero, in the base's frame, and the tool's pose there; `arm_of_axes`
makes standard Denavit–Hartenberg rows of them, with the same forward kinematics:

        z_{k-1}            z_k is the axis of joint k+1. Origin k is where z_k meets z_{k-1}, or where their
          │   a_k          common normal meets it; x_k goes along the normal, away from z_{k-1}.
      b_k ├───────▶ x_k    b_k is where x_k meets z_{k-1}:
          │      o_k         θ_k from x_{k-1} to x_k about z_{k-1}     d_k from o_{k-1} to b_k along z_{k-1}
      o_{k-1}                a_k from b_k to o_k along x_k             α_k from z_{k-1} to z_k about x_k

Where the normal is not unique, parallel axes take the one through the previous origin (d = 0), and collinear
ones keep the previous frame; in both cases the last frame is at the tool. Axes that intersect take the x_k
that is nearer to x_{k-1}.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from servogen.errors import Diagnostic, InputError, Location, ToolError, did_you_mean
from servogen.kinematics.orientation import from_angles, to_angles
from servogen.kinematics.transforms import Floats, frame_matrix, inverse, transform
from servogen.robot.model import Arm, DHRow, FixedFrame, Joint, Length

SAME_M = 1e-9
"""Points nearer than this are equal; directions with a smaller cross product are parallel."""


@dataclass(frozen=True, slots=True)
class JointAxis:
    """An axis at position zero: a point on it and its direction. `joint` and `ratio` as in `DHRow`."""

    point: tuple[float, float, float]
    direction: tuple[float, float, float]
    joint: int
    ratio: float = 1.0
    offset: float = 0.0


def arm_of_axes(name: str, joints: Sequence[Joint], axes: Sequence[JointAxis], tool: ArrayLike) -> Arm:
    """Return the arm whose joints turn about or slide along `axes`, and whose tool is at `tool` (4, 4) at
    zero.
    """
    if not axes:
        raise InputError("wrong-robot-kind", f"'{name}' has no joints that move")
    lines = [(np.asarray(axis.point, float), _unit(axis.direction)) for axis in axes]
    tool = np.asarray(tool, float)
    frame = _next_frame(np.eye(4), *lines[0])
    base, rows = frame_of(frame), []
    # The tool is the axis after the last joint: the last row leads to it.
    lines.append((tool[:3, 3], tool[:3, 2]))
    for index, (axis, (point, direction)) in enumerate(zip(axes, lines[1:], strict=True), 1):
        following = _next_frame(frame, point, direction, last=index == len(axes))
        rows.append(_row(frame, following, axis, joints[axis.joint].turning))
        frame = following
    rest = frame_of(inverse(frame) @ tool)
    return Arm(
        name=name,
        title="",
        convention="standard",
        joints=tuple(joints),
        rows=tuple(rows),
        base=base,
        tool=rest,
    )


def frame_of(matrix: Floats) -> FixedFrame:
    """Return a transform as a fixed frame; values below a nanometre or nanoradian become 0."""
    rz, ry, rx = to_angles(matrix[:3, :3], "ZYX")
    values = (*matrix[:3, 3], rx, ry, rz)
    return FixedFrame(*(0.0 if abs(value) < 1e-12 else float(value) for value in values))


def _unit(direction: Sequence[float]) -> Floats:
    vector = np.asarray(direction, float)
    length = np.linalg.norm(vector)
    if length == 0.0:
        raise InputError("bad-rotation", "the axis of a joint has no direction (0, 0, 0)")
    return np.asarray(vector / length)


def _next_frame(frame: Floats, point: Floats, z: Floats, last: bool = False) -> Floats:
    """Return frame k on the line through `point` along `z`, from frame k-1; `last`: at the tool, if that is
    free.
    """
    x_before, z_before, origin = frame[:3, 0], frame[:3, 2], frame[:3, 3]
    across = np.cross(z_before, z)
    sine = float(np.linalg.norm(across))
    if sine > SAME_M:
        # feet of the common normal: along z from `point` by t
        t = np.dot(np.cross(point - origin, z_before), across) / sine**2
        foot = point + t * z
        between = np.dot(foot - origin, across) / sine
        x = across / sine
        if abs(between) > SAME_M:
            x = x * np.sign(between)
        elif np.dot(x, x_before) < 0:
            x = -x
    else:
        start = origin + np.dot(point - origin, z_before) * z_before if last else origin
        foot = point + np.dot(start - point, z) * z
        away = foot - start
        distance = float(np.linalg.norm(away))
        x = away / distance if distance > SAME_M else x_before
    x = x - np.dot(x, z) * z
    x = x / np.linalg.norm(x)
    return transform(np.stack([x, np.cross(z, x), z], axis=-1), foot)


def _row(before: Floats, after: Floats, axis: JointAxis, turning: bool) -> DHRow:
    """Return the row that leads from one frame to the next."""
    seen = inverse(before) @ after
    # The x axis of the next frame, seen from this one, is (cos θ, sin θ, 0).
    theta = float(np.arctan2(seen[1, 0], seen[0, 0]))
    d = float(seen[2, 3])
    a = float(np.dot(after[:3, 3] - before[:3, 3] - d * before[:3, 2], after[:3, 0]))
    alpha = float(np.arctan2(np.dot(np.cross(before[:3, 2], after[:3, 2]), after[:3, 0]), seen[2, 2]))
    theta, d = (theta + axis.offset, d) if turning else (theta, d + axis.offset)
    return DHRow(
        theta=_clean(theta),
        d=_length(d),
        a=_length(a),
        alpha=_clean(alpha),
        joint=axis.joint,
        ratio=axis.ratio,
    )


def _clean(value: float) -> float:
    return 0.0 if abs(value) < 1e-12 else value


def _length(value: float) -> Length:
    return Length((), _clean(value))


_KINDS = {"revolute": "turning", "continuous": "turning", "prismatic": "sliding"}


def _library() -> Any:
    try:
        from urdf_parser_py import urdf
    except ImportError as error:
        raise ToolError(
            "tool-missing", "URDF needs the package urdf-parser-py", hint="pip install 'servogen[urdf]'"
        ) from error
    return urdf


def to_urdf(arm: Arm) -> str:
    """Return the arm as URDF: links base, one per row, tool; joint axes are z.

    The turn about z and the slide along z of a row commute, so the constant part of a row follows its joint:
    joint k is where the constant part of row k-1 ends.
    """
    urdf = _library()
    robot = urdf.Robot(name=arm.name, version="1.0")
    robot.add_link(urdf.Link(name="base"))
    parent, waiting, owners = "base", frame_matrix(arm.base), dict[int, str]()
    for row in arm.rows:
        before, after = _constant_parts(arm, row)
        waiting = waiting @ before
        if row.joint is not None:
            child = f"link{len(robot.joints) + 1}"
            robot.add_link(urdf.Link(name=child))
            robot.add_joint(_urdf_joint(urdf, arm, row, parent, child, waiting, owners))
            parent, waiting = child, np.eye(4)
        waiting = waiting @ after
    robot.add_link(urdf.Link(name="tool"))
    end = waiting @ frame_matrix(arm.tool)
    robot.add_joint(urdf.Joint("tool", parent, "tool", "fixed", origin=_pose(urdf, end)))
    return str(robot.to_xml_string())


def _constant_parts(arm: Arm, row: DHRow) -> tuple[Floats, Floats]:
    """Return the constant parts of a row before and after its joint."""
    screw = _about("z", row.theta) @ transform(None, (0.0, 0.0, row.d.value(arm.length)))
    across = transform(None, (row.a.value(arm.length), 0.0, 0.0)) @ _about("x", row.alpha)
    return (np.eye(4), screw @ across) if arm.convention == "standard" else (across, screw)


def _about(axis: str, angle: float) -> Floats:
    return frame_matrix(FixedFrame(rz=angle) if axis == "z" else FixedFrame(rx=angle))


def _urdf_joint(
    urdf: Any, arm: Arm, row: DHRow, parent: str, child: str, at: Floats, owners: dict[int, str]
) -> Any:
    """Return the URDF joint of a row, at the transform `at` in its parent."""
    number = row.joint or 0
    joint = arm.joints[number]
    # The first row of a joint owns it; further rows become joints that mimic it.
    follows = number in owners
    if not follows and row.ratio != 1.0:
        raise InputError(
            "urdf-unsupported",
            f"{arm.name}: the first row of '{joint.name}' has the ratio {row.ratio}, URDF needs 1",
        )
    name = f"{joint.name}_follower_{child}" if follows else owners.setdefault(number, joint.name)
    scale = abs(row.ratio)
    # A negative ratio exchanges the ends.
    ends = sorted((joint.lower * row.ratio, joint.upper * row.ratio))
    if joint.continuous:
        kind, limit = "continuous", None if joint.speed is None else urdf.JointLimit(NOT_STATED, joint.speed)
    else:
        speed = NOT_STATED if joint.speed is None else joint.speed * scale
        kind = "revolute" if joint.turning else "prismatic"
        limit = urdf.JointLimit(NOT_STATED, speed, *ends)
    return urdf.Joint(
        name,
        parent,
        child,
        kind,
        axis=[0, 0, 1],
        origin=_pose(urdf, at),
        limit=limit,
        mimic=urdf.JointMimic(owners[number], row.ratio, 0.0) if follows else None,
    )


def _pose(urdf: Any, matrix: Floats) -> Any:
    frame = frame_of(matrix)
    return urdf.Pose(xyz=[frame.x, frame.y, frame.z], rpy=[frame.rx, frame.ry, frame.rz])


def from_urdf(text: str, file: str, tip: str | None = None) -> Arm:
    """Return the serial chain from the root to the link `tip`, by default the only end.

    Its rows come from the joint axes; fixed joints belong to the links. Raises InputError for a tree whose
    tip is not named, for other kinds of joints and for a text that is not URDF.
    """
    robot, notes = _parse(text, file)
    chain = _chain(robot, file, tip)
    moving = [joint for joint in chain if joint.type in _KINDS and joint.mimic is None]
    numbers = {joint.name: index for index, joint in enumerate(moving)}
    joints = [_joint(joint, file) for joint in moving]
    frame, axes = np.eye(4), []
    for joint in chain:
        frame = frame @ _matrix(joint.origin)
        if joint.type in _KINDS:
            axes.append(_axis(joint, frame, numbers, file))
        elif joint.type != "fixed":
            raise InputError(
                "urdf-unsupported",
                f"the joint '{joint.name}' is {joint.type}",
                Location(file),
                f"known: {', '.join(_KINDS)}, fixed",
            )
    return replace(arm_of_axes(robot.name, joints, axes, frame), source=file, notes=notes)


def _parse(text: str, file: str) -> tuple[Any, tuple[Diagnostic, ...]]:
    """Return the library's robot, and notes about what it does not read. Raises InputError."""
    urdf = _library()
    from urdf_parser_py.xml_reflection import core

    # The library checks by assertions and conversions: whatever it raises, the text is wrong.
    wrong = (core.ParseError, ValueError, AssertionError, KeyError, AttributeError, TypeError, SyntaxError)
    said: list[str] = []
    usual, core.on_error = core.on_error, said.append  # which writes to stderr
    try:
        robot = urdf.URDF.from_xml_string(text.encode())
    except wrong as error:
        raise InputError("urdf-syntax", f"is not a URDF file: {error}", Location(file)) from error
    finally:
        core.on_error = usual
    if len(robot.joints) > MAX_JOINTS:
        raise InputError(
            "urdf-unsupported", f"has {len(robot.joints)} joints", Location(file), f"at most {MAX_JOINTS}"
        )
    for joint in robot.joints:
        for number in _numbers(joint):
            if not abs(number) <= MAX_NUMBER:  # refuses NaN, too
                raise InputError(
                    "urdf-syntax",
                    f"the joint '{joint.name}' has the number {number}",
                    Location(file),
                    _NUMBERS,
                )
    return robot, tuple(_notes(text, file, said))


_UNKNOWN = re.compile(r'Unknown (tag|attribute) "(.*)" in (.*)', re.DOTALL)
_KNOWN = {
    "robot": "link, joint, material, transmission, gazebo",
    "link": "origin, inertial, visual, collision",
    "joint": "origin, parent, child, axis, limit, mimic, dynamics, calibration, safety_controller",
    "limit": "lower, upper, effort, velocity",
    "mimic": "joint, multiplier, offset",
}


def _notes(text: str, file: str, said: Sequence[str]) -> Iterator[Diagnostic]:
    """Yield a note for each kind of tag or attribute that the library does not know, at the first of them."""
    groups: dict[tuple[str, str, str], list[str]] = {}
    for message in said:
        match = _UNKNOWN.fullmatch(message)
        kind, name, path = match.groups() if match else ("", message, "")
        parent = re.sub(r"\[.*?\]", "", path).rpartition("/")[2]
        groups.setdefault((kind, name, parent), []).append(path)
    for (kind, name, parent), paths in groups.items():
        if not kind:
            yield Diagnostic("note", "urdf-ignored", name, Location(file))
            continue
        what = f"the tag <{name}>" if kind == "tag" else f'the attribute "{name}"'
        whose = re.findall(r"@name='([^']*)'", paths[0])
        where = f"of <{parent}>" + (f" in '{whose[-1]}'" if whose else "")
        more = f", nor are {len(paths) - 1} more" if len(paths) > 1 else ""
        known = _KNOWN.get(parent)
        yield Diagnostic(
            "note",
            "urdf-ignored",
            f"{what} {where} is not read{more}",
            Location(file, _line(text, paths[0], name if kind == "tag" else f"@{name}")),
            known and f"<{parent}> has: {known}",
        )


def _line(text: str, path: str, name: str) -> int | None:
    """Return the line of a tag or attribute by the path that the library gives; None if it finds none."""
    from lxml import etree

    try:
        found = etree.fromstring(text.encode()).xpath(f"{path}/{name}")
    except etree.XPathError:  # a name with a quote or a prefix
        return None
    if not found:
        return None
    return int(getattr(found[0], "sourceline", None) or found[0].getparent().sourceline)


MAX_JOINTS = 1000
MAX_NUMBER = 1e6
"""The maximum absolute value of a number, in metres, radians, and those per second."""

NOT_STATED = MAX_NUMBER
"""What is written for a speed or an effort that is not known: URDF requires both of a joint with limits, 0
says that the joint cannot move, and parsers refuse inf (https://wiki.ros.org/urdf/XML/joint).
"""

_NUMBERS = f"numbers are finite, in metres and radians, of at most {MAX_NUMBER:g}"


def _numbers(joint: Any) -> Iterator[float]:
    """Yield every number of a joint that is read."""
    if joint.origin is not None:
        yield from joint.origin.xyz or ()
        yield from joint.origin.rpy or ()
    yield from joint.axis or ()
    parts = (joint.limit, ("lower", "upper", "velocity")), (joint.mimic, ("multiplier", "offset"))
    for part, names in parts:
        for name in names if part is not None else ():
            yield getattr(part, name) or 0.0


def _chain(robot: Any, file: str, tip: str | None) -> list[Any]:
    """Return the joints from the root to the tip. Raises InputError."""
    parents = {joint.child: joint for joint in robot.joints}
    inner = {joint.parent for joint in robot.joints}
    ends = [link.name for link in robot.links if link.name not in inner]
    if tip is None and len(ends) != 1:
        raise InputError(
            "urdf-unsupported",
            f"'{robot.name}' is not a serial chain: it ends in {', '.join(ends) or 'nothing'}",
            Location(file),
            f"name the link at the tip behind the file: {file}#{ends[0]}" if ends else "URDF describes trees",
        )
    link = tip or ends[0]
    if link not in {part.name for part in robot.links}:
        raise InputError(
            "urdf-unsupported",
            f"no link '{link}'",
            Location(file),
            did_you_mean(link, [part.name for part in robot.links]),
        )
    chain: list[Any] = []
    while link in parents:
        joint = parents[link]
        if joint in chain:
            raise InputError(
                "urdf-unsupported",
                f"the joint '{joint.name}' closes a loop",
                Location(file),
                "URDF describes trees",
            )
        chain.insert(0, joint)
        link = joint.parent
    return chain


def _joint(joint: Any, file: str) -> Joint:
    """Return a URDF joint with its limits. Raises InputError."""
    kind = _KINDS[joint.type]
    if joint.type == "continuous" or joint.limit is None:
        if kind == "sliding":
            raise InputError(
                "urdf-syntax",
                f"the sliding joint '{joint.name}' has no limits",
                Location(file),
                "add <limit …/>",
            )
        lower, upper, speed = -np.pi, np.pi, joint.limit.velocity if joint.limit else None
    else:
        lower, upper, speed = joint.limit.lower or 0.0, joint.limit.upper or 0.0, joint.limit.velocity
    if speed is not None and not 0 < speed < NOT_STATED:
        # Exporters write 0 for a speed that they do not know.
        speed = None
    if not lower < upper:
        raise InputError(
            "urdf-syntax",
            f"the limits of '{joint.name}' are not in order: {lower} to {upper}",
            Location(file),
        )
    home = min(max(0.0, lower), upper) if kind == "turning" else lower
    return Joint(
        name=joint.name,
        kind="turning" if kind == "turning" else "sliding",
        lower=lower,
        upper=upper,
        home=home,
        speed=speed,
        continuous=joint.type == "continuous" or (kind == "turning" and joint.limit is None),
    )


def _axis(joint: Any, frame: Floats, numbers: dict[str, int], file: str) -> JointAxis:
    """Return the axis of a URDF joint in the base's frame. Raises InputError."""
    direction = frame[:3, :3] @ np.asarray(joint.axis if joint.axis is not None else (1.0, 0.0, 0.0), float)
    x, y, z = frame[:3, 3].tolist()
    a, b, c = direction.tolist()
    if joint.mimic is None:
        return JointAxis((x, y, z), (a, b, c), numbers[joint.name])
    if joint.mimic.joint not in numbers:
        raise InputError(
            "urdf-unsupported",
            f"'{joint.name}' mimics '{joint.mimic.joint}', which is not in the chain",
            Location(file),
        )
    ratio = 1.0 if joint.mimic.multiplier is None else joint.mimic.multiplier
    return JointAxis(
        point=(x, y, z),
        direction=(a, b, c),
        joint=numbers[joint.mimic.joint],
        ratio=ratio,
        offset=joint.mimic.offset or 0.0,
    )


def _matrix(origin: Any) -> Floats:
    if origin is None:
        return np.eye(4)
    xyz = origin.xyz if origin.xyz is not None else (0.0, 0.0, 0.0)
    roll, pitch, yaw = origin.rpy if origin.rpy is not None else (0.0, 0.0, 0.0)
    return transform(from_angles([yaw, pitch, roll], "ZYX"), xyz)
