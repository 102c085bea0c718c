"""One servo with a disc on its shaft, in the physics: what a workbench would measure."""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree import ElementTree as xml

import numpy as np

from servogen.robot.servo import Servo
from servogen.twin.bodies import Bodies
from servogen.twin.drive import ServoDrive, servo_drive
from servogen.twin.ground import Ground
from servogen.twin.mjcf import document
from servogen.twin.pulses import ReceivedPulse
from servogen.twin.supply import Supply
from servogen.twin.world import Energies, ServoWiring, World, mujoco


@dataclass(frozen=True)
class Seen:
    """The greatest steady speed, the torque and the current at a stop; `speeds` at `times`, from rest on."""

    speed: float
    torque: float
    current: float
    times: np.ndarray
    speeds: np.ndarray


DISC = 1e-5
"""The inertia of the disc, kg·m²."""


def disc(drive: ServoDrive, upper: float, step_s: float = 0.001, inertia: float = DISC) -> Bodies:
    """Return a disc on the servo's shaft, which a stop holds at the angle `upper`."""
    root, world = document("disc", Ground(), step_s)
    body = xml.SubElement(world, "body", pos="0 0 1")
    stiff = {"solreffriction": "0.002 1", "solimpfriction": ".9999 .9999 .001"}  # as in servogen.twin.mjcf
    friction = {"frictionloss": str(drive.friction), **stiff} if drive.friction else {}
    xml.SubElement(
        body,
        "joint",
        name="shaft",
        axis="0 0 1",
        armature=str(drive.inertia),
        range=f"-100 {upper}",
        **friction,
    )
    xml.SubElement(body, "inertial", pos="0 0 0", mass="0.01", diaginertia=f"{inertia} {inertia} {inertia}")
    actuators = xml.SubElement(root, "actuator")
    xml.SubElement(
        actuators, "general", joint="shaft", gaintype="fixed", biastype="affine", gainprm="1", biasprm="0 0 0"
    )
    return Bodies(xml.tostring(root, encoding="unicode"), (), 0.01)


def world_of(servo: Servo, upper: float, supply: Supply | None = None, **options: float) -> World:
    """Return the bench: the servo turns its disc towards any angle that a width names as radians."""
    drive = servo_drive(servo)
    return World(
        disc(drive, upper, **options),
        [ServoWiring(drive, lambda width: width, 0.0)],
        supply or Supply(drive.supply_v),
        options.get("step_s", 0.001),
    )


def on_the_bench(servo: Servo) -> Seen:
    """Return what the servo does when it is sent far away, with and without a stop in its way."""
    per_ms = servo_drive(servo).steps_per_ms
    free, held = (world_of(servo, upper, step_s=0.001 / per_ms) for upper in (1e3, 0.0))
    speeds = []
    for step in range(300 * per_ms):
        for world in (free, held):
            if step % (20 * per_ms) == 0:
                world.pulse(ReceivedPulse(step, 0, 500.0))
            world.advance()
        speeds.append(float(free.data.qvel[0]))
    times = np.arange(1, len(speeds) + 1) * free.step_s
    limit = held.data.efc_type == int(mujoco().mjtConstraint.mjCNSTR_LIMIT_JOINT)
    torque = float(held.data.efc_force[limit].sum())
    return Seen(float(np.max(speeds)), torque, held.current, times, np.array(speeds))


def speed_against(servo: Servo, load: float) -> float:
    """Return the speed after 0.3 s of a servo that is sent far away against a torque."""
    per_ms = servo_drive(servo).steps_per_ms
    world = world_of(servo, 1e3, step_s=0.001 / per_ms)
    world.data.qfrc_applied[0] = -load
    for step in range(300 * per_ms):
        if step % (20 * per_ms) == 0:
            world.pulse(ReceivedPulse(step, 0, 500.0))
        world.advance()
    return float(world.data.qvel[0])


def weight_world(servo: Servo, mass: float, arm: float) -> tuple[World, Energies]:
    """Return a servo that lifts a weight on an arm from where it hangs, and its account of energies."""
    drive = servo_drive(servo)
    root, world = document("weight", Ground())
    body = xml.SubElement(world, "body", pos="0 0 1")
    xml.SubElement(body, "joint", name="shaft", axis="0 -1 0", armature=str(drive.inertia))
    xml.SubElement(body, "inertial", pos=f"0 0 {-arm}", mass=str(mass), diaginertia="1e-9 1e-9 1e-9")
    actuators = xml.SubElement(root, "actuator")
    xml.SubElement(
        actuators, "general", joint="shaft", gaintype="fixed", biastype="affine", gainprm="1", biasprm="0 0 0"
    )
    made = Bodies(xml.tostring(root, encoding="unicode"), (), mass)
    found = World(made, [ServoWiring(drive, lambda width: width, 0.0)], Supply(drive.supply_v), 0.001)
    found.energies = Energies()
    return found, found.energies
