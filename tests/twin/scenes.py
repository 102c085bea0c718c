"""Scenes with known answers for the physics' settings: a pendulum, a falling ball, a block on a slope."""

from __future__ import annotations

import math
from typing import Any
from xml.etree import ElementTree as xml

from servogen.twin.ground import Ground
from servogen.twin.mjcf import ROBOT_BITS, document
from servogen.twin.world import mujoco


def loaded(root: xml.Element) -> tuple[Any, Any]:
    """Return MuJoCo's model and data of a document."""
    engine = mujoco()
    model = engine.MjModel.from_xml_string(xml.tostring(root, encoding="unicode"))
    return model, engine.MjData(model)


def pendulum_period(start: float, length: float, periods: int, step_s: float = 0.001) -> float:
    """Return the mean period of a pendulum of a point mass, released at an angle."""
    root, world = document("pendulum", Ground(), step_s)
    body = xml.SubElement(world, "body", pos="0 0 5")
    xml.SubElement(body, "joint", type="hinge", axis="0 1 0", name="swing")
    xml.SubElement(body, "inertial", pos=f"0 0 {-length}", mass="0.1", diaginertia="1e-12 1e-12 1e-12")
    model, data = loaded(root)
    data.qpos[0] = start
    crossings: list[float] = []
    before = start
    while len(crossings) < periods + 1:
        mujoco().mj_step(model, data)
        now = float(data.qpos[0])
        if before > 0 >= now:
            crossings.append(data.time - step_s * now / (now - before))
        before = now
    return (crossings[-1] - crossings[0]) / periods


def fall(seconds: float, step_s: float = 0.001) -> tuple[float, float]:
    """Return distance and speed of a ball after a fall."""
    root, world = document("fall", Ground(), step_s)
    body = xml.SubElement(world, "body", pos="0 0 100")
    xml.SubElement(body, "freejoint")
    xml.SubElement(body, "geom", type="sphere", size="0.01", mass="0.1", **ROBOT_BITS)
    model, data = loaded(root)
    for _ in range(round(seconds / step_s)):
        mujoco().mj_step(model, data)
    return 100.0 - float(data.qpos[2]), -float(data.qvel[2])


def slides(slope: float, friction: float) -> bool:
    """Return whether a block slides down a slope: more than 2 mm in the second second."""
    root, world = document("slope", Ground(friction, slope=slope), 0.001)
    body = xml.SubElement(world, "body", pos="0 0 0.0101")
    xml.SubElement(body, "freejoint")
    xml.SubElement(
        body, "geom", type="box", size=".05 .05 .01", mass="0.5", friction=f"{friction} 0 0", **ROBOT_BITS
    )
    model, data = loaded(root)
    engine = mujoco()
    engine.mj_step(model, data, 1000)
    start = float(data.qpos[0])
    engine.mj_step(model, data, 1000)
    return abs(float(data.qpos[0]) - start) > 0.002


def elliptic_period(start: float, length: float, gravity: float) -> float:
    """Return a pendulum's period in closed form, by the arithmetic-geometric mean."""
    a, b = 1.0, math.cos(start / 2)
    while abs(a - b) > 1e-15:
        a, b = (a + b) / 2, math.sqrt(a * b)
    return 2 * math.pi * math.sqrt(length / gravity) / a
