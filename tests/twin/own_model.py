"""Random robots in a physics model of this file's own, beside `servogen twin`: do both go the same way?

    python -m tests.twin.own_model --robots 12 --seed 1

Each robot walks eight cycles forward (or `--cycles 3`) and turns. This model is built from the robot's and
the job's files alone, which it reads itself, and is driven by the edges of the program's run, in the format
of `edges.csv`. It shares nothing with `servogen.twin` but MuJoCo: bodies, joints, contacts, servos and steps
are its own. The legs are capsules that meet each other and the ground. A robot passes if the way differs by
at most 4 % and the heading by at most 3°.
"""

from __future__ import annotations

import argparse
import cmath
import math
import random
import re
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import mujoco
import numpy as np

from servogen.errors import ServogenError
from servogen.traces.formats import write_edges
from servogen.workflows.engines import planned
from servogen.workflows.twinning import twin_of_image
from servogen.workflows.verification import motion_cycles, running
from tests.engines.player.own_robots import Robot, drawn

STEP_S, CONTROL_S, SETTLE_S = 0.0005, 0.001, 0.3
RADIUS_M, FRICTION = 0.003, 0.8
TORQUE_NM, SPEED_DEG_S = 0.6, 500.0
DEAD_RAD, BAND_RAD, START_S, STICK_NM = math.radians(0.15), math.radians(1.0), 0.005, 0.02
"""How far off a servo does nothing, from there on how far it drives with all its torque, in what time it
reaches most of its speed, and the friction of its gear: assumed.
"""
BRAKE_S = 2 * math.sqrt(BAND_RAD * START_S / math.radians(SPEED_DEG_S)) - BAND_RAD / math.radians(SPEED_DEG_S)
"""How far ahead a servo looks, so that it does not swing beyond its angle: critical damping. Without it the
joints overshoot in every frame, and a ripple of 102 mm gets 111 mm far instead of 105.
"""

CYCLE_S = 1e-6
TWO_JOINTS = ("pantograph", "hip-lift")
"""The legs of which twelve servos walk with one chip."""
WAY, HEADING = 0.04, math.radians(3)

Pose = tuple[float, float, float]
"""x, y in metres and yaw in radians."""


@dataclass(frozen=True)
class Hinge:
    """A joint, and for a servo its pin and how widths are its angles."""

    name: str
    pin: str
    low_us: float
    high_us: float
    travel_deg: float
    zero_deg: float
    reverse: bool

    def angle(self, width_us: float) -> float:
        """The joint's angle in radians of a pulse."""
        turned = (width_us - self.low_us) / (self.high_us - self.low_us) * self.travel_deg
        return math.radians((self.travel_deg - turned if self.reverse else turned) - self.zero_deg)


def hinges_of(job: dict[str, Any]) -> list[Hinge]:
    """The servos of a job's file."""
    found = []
    for servo in job["servo"]:
        (_, travel), (low, high) = servo["travel_deg"], (point["width_us"] for point in servo["points"])
        reverse = servo.get("reverse", False)
        found.append(Hinge(servo["joint"], servo["pin"], low, high, travel, servo["zero_deg"], reverse))
    return found


def _capsule(end: tuple[float, ...], leg: int, start: tuple[float, ...] = (0.0, 0.0, 0.0)) -> str:
    """A link that meets the ground and all legs but its own."""
    others = 1 | sum(1 << other for other in range(1, 9) if other != leg + 1)
    places = " ".join(f"{value:.6f}" for value in (*start, *end))
    return (
        f'<geom type="capsule" fromto="{places}" size="{RADIUS_M}" mass="0" '
        f'friction="{FRICTION} 0.005 0.0001" '
        f'contype="{1 << leg + 1}" conaffinity="{others}"/>'
    )


def _body(
    place: tuple[float, ...], mass: float, centre: tuple[float, ...], inside: str, turn: float = 0.0
) -> str:
    spread = mass * 0.015**2
    text = [" ".join(f"{value:.6f}" for value in values) for values in (place, centre)]
    return (
        f'<body pos="{text[0]}" euler="0 0 {turn:.6f}"><inertial pos="{text[1]}" mass="{mass}" '
        f'diaginertia="{spread} {spread} {spread}"/>{inside}</body>'
    )


def _hinge(name: str, axis: str, driven: bool = True) -> str:
    speed = math.radians(SPEED_DEG_S)
    own = (
        f'damping="{TORQUE_NM / speed}" armature="{TORQUE_NM / speed * START_S}" frictionloss="{STICK_NM}"'
        if driven
        else 'armature="1e-5"'
    )
    return f'<joint name="{name}" type="hinge" axis="{axis}" {own}/>'


def _leg(kind: str, name: str, leg: int, side: int, m: dict[str, float], mass: dict[str, float]) -> str:
    """The bodies of a leg; y points outwards, which is -y of a right one (`side` -1)."""
    up, along, across = f"0 0 {side}", f"{side} 0 0", "0 1 0"
    if kind == "pantograph":
        thigh, down = (0.0, 0.0, -m["bc"]), (0.0, side * m["cd"], -m["df"])
        knee = (0.0, side * m["cd"], 0.0)
        foot = _hinge(f"{name}_back", across, driven=False) + _capsule(knee, leg) + _capsule(down, leg, knee)
        inside = _hinge(f"{name}_beta", across) + _capsule(thigh, leg)
        inside += _body(thigh, mass["foot"], tuple(value / 2 for value in down), foot)
        hip = (0.0, side * m["ab"], 0.0)
        rest = _body(hip, mass["thigh"], tuple(value / 2 for value in thigh), inside)
        return _hinge(f"{name}_alpha", up) + _capsule(hip, leg) + rest
    hip, femur, tibia = (0.0, side * m["coxa"], 0.0), (0.0, side * m["femur"], 0.0), (0.0, 0.0, -m["tibia"])
    shin = _capsule(tibia, leg)
    if kind == "coxa-femur-tibia":
        shin = _hinge(f"{name}_tibia", along) + shin
    last = _body(femur, mass["tibia"], tuple(value / 2 for value in tibia), shin)
    lift = _hinge(f"{name}_{'femur' if kind == 'coxa-femur-tibia' else 'lift'}", along)
    middle = tuple(value / 2 for value in femur)
    rest = _body(hip, mass["femur"], middle, lift + _capsule(femur, leg) + last)
    return _hinge(f"{name}_{'coxa' if kind == 'coxa-femur-tibia' else 'hip'}", up) + _capsule(hip, leg) + rest


def model_of(robot: dict[str, Any]) -> str:
    """The MJCF text of a robot's file."""
    kind, lengths = robot["leg"], {name: value / 1000 for name, value in robot["lengths_mm"].items()}
    mass = {part: grams / 1000 for part, grams in robot["leg_mass_g"].items()}
    mounts, legs, back = robot["mount"], "", ""
    trunk = robot["mass_g"] / 1000 - len(mounts) * sum(mass.values())
    for index, mount in enumerate(mounts):
        side = -1 if mount["mirrored"] else 1
        place = (mount["x_mm"] / 1000, mount["y_mm"] / 1000, 0.0)
        coxa = (0.0, side * lengths.get("ab", lengths.get("coxa", 0.0)) / 2, 0.0)
        inside = _leg(kind, mount["name"], index, side, lengths, mass)
        legs += _body(place, mass["coxa"], coxa, inside, math.radians(mount.get("heading_deg", 0.0)))
        if kind == "pantograph":
            joints = f'joint1="{mount["name"]}_back" joint2="{mount["name"]}_beta"'
            back += f'<joint {joints} polycoef="0 -1 0 0 0" solref="0.002 1"/>'
    half = [max(abs(mount[axis]) for mount in mounts) / 1000 for axis in ("x_mm", "y_mm")]
    box = [trunk / 3 * (a * a + b * b) for a, b in ((half[1], 0.015), (half[0], 0.015), (half[0], half[1]))]
    return f"""<mujoco>
<compiler angle="radian" autolimits="true"/>
<option timestep="{STEP_S}" integrator="implicitfast" cone="elliptic" impratio="20" noslip_iterations="5"/>
<worldbody>
<geom type="plane" size="5 5 1" friction="{FRICTION} 0.005 0.0001" contype="1" conaffinity="0"/>
<body name="trunk"><freejoint/>
<inertial pos="0 0 0" mass="{trunk}" diaginertia="{box[0]} {box[1]} {box[2]}"/>
{legs}</body></worldbody>
<equality>{back}</equality></mujoco>"""


def pulses_of(text: str, pins: list[str]) -> Iterator[tuple[float, str, float]]:
    """The ends of the pulses in seconds, their pins and widths in µs, from the text of an `edges.csv`."""
    risen: dict[str, int] = {}
    for line in text.splitlines()[1:]:
        cycle, pin, level = line.split(",")
        if pin in pins and level == "1":
            risen[pin] = int(cycle)
        elif pin in risen and level == "0":
            yield int(cycle) * CYCLE_S, pin, (int(cycle) - risen.pop(pin)) * CYCLE_S * 1e6


def _driven(away: np.ndarray) -> np.ndarray:
    """The torques of servos at so many radians from where they should be."""
    beyond = np.maximum(np.abs(away) - DEAD_RAD, 0.0)
    return np.asarray(TORQUE_NM * np.sign(away) * np.minimum(beyond / BAND_RAD, 1.0))


def moved(robot: dict[str, Any], job: dict[str, Any], edges: str, lead_s: float) -> Pose:
    """How far the model goes, and by how much it turns, from `lead_s` after the first pulse on, when the soft
    start has brought it to its stance.
    """
    hinges = {hinge.pin: hinge for hinge in hinges_of(job)}
    events = [(time, hinges[pin], hinges[pin].angle(us)) for time, pin, us in pulses_of(edges, [*hinges])]
    model = mujoco.MjModel.from_xml_string(model_of(robot))
    data = mujoco.MjData(model)
    names = [hinge.name for hinge in hinges.values()]
    place = np.array([model.joint(name).qposadr[0] for name in names])
    speed = np.array([model.joint(name).dofadr[0] for name in names])
    target = np.zeros(len(names))
    for _, hinge, angle in reversed(events):
        target[names.index(hinge.name)] = angle
    data.qpos[place] = target
    for name in names:
        if name.endswith("_beta"):
            data.joint(name.replace("_beta", "_back")).qpos[0] = -data.joint(name).qpos[0]
    mujoco.mj_forward(model, data)
    ends = [
        data.geom_xpos[i, 2] - model.geom_size[i, 1] * abs(data.geom_xmat[i, 8])
        for i in range(1, model.ngeom)
    ]
    data.qpos[2] = RADIUS_M - min(ends) + 1e-4
    start = events[0][0] - SETTLE_S
    coming, number = 0, 0
    while start + number * STEP_S < events[-1][0] + SETTLE_S:
        now = start + number * STEP_S
        while coming < len(events) and events[coming][0] <= now:
            target[names.index(events[coming][1].name)] = events[coming][2]
            coming += 1
        if number % round(CONTROL_S / STEP_S) == 0:
            data.qfrc_applied[speed] = _driven(target - data.qpos[place] - BRAKE_S * data.qvel[speed])
        if now < events[0][0] + lead_s:
            first = data.qpos[:7].copy()
        mujoco.mj_step(model, data)
        number += 1
    (here, heading), (there, last) = _seen(first), _seen(data.qpos)
    way = (there - here) * cmath.exp(-1j * heading)
    return way.real, way.imag, last - heading


def _seen(pose: np.ndarray) -> tuple[complex, float]:
    """Where a body is over the ground, and its heading."""
    x, y, _, *turn = pose[:7].tolist()
    w, i, j, k = turn
    return complex(x, y), math.atan2(2 * (w * k + i * j), 1 - 2 * (j * j + k * k))


def stronger(robot: Robot, number: int, cycles: int) -> Robot:
    """The robot with masses, quick servos, and a walk of so many cycles and a turn."""
    count = robot.job.count("[[servo]]")
    kind = re.search(r'leg = "([^"]*)"', robot.robot)
    assert kind is not None
    parts = {"pantograph": ("coxa", "thigh", "foot")}.get(kind[1], ("coxa", "femur", "tibia"))
    masses = ", ".join(f"{part} = {grams}" for part, grams in zip(parts, (20, 8, 8), strict=True))
    turn = re.search(r"turn_deg = \d+", robot.job)
    forward = re.search(r"forward_mm = \d+", robot.job)
    assert turn is not None and forward is not None
    route = f"route = [{{ {forward[0]}, cycles = {cycles} }}, {{ {turn[0]}, cycles = 2 }}]\nrepeat = false"
    job = re.sub(r"route = .*", route, robot.job).replace("gap_mm = 0\n", "")
    job = re.sub(r"cycle_s = .*", f"cycle_s = {1.0 + 0.04 * (number % 10):g}", job)
    facts = f"speed_deg_s = {SPEED_DEG_S}\ntorque_ncm = {100 * TORQUE_NM}\ntravel_deg"
    job = job.replace("travel_deg", facts).replace('start_pin = "RA4"\n', "")
    own = robot.robot.replace("mount = [", f"mass_g = {53 * count}\nleg_mass_g = {{ {masses} }}\nmount = [")
    return Robot(robot.number, robot.gait, own, job)


@dataclass(frozen=True)
class Compared:
    """Where a robot goes in this model and in the twin."""

    own: Pose
    twin: Pose

    @property
    def ways(self) -> tuple[float, float]:
        """The lengths of both ways in metres."""
        return math.hypot(*self.own[:2]), math.hypot(*self.twin[:2])

    @property
    def apart(self) -> float:
        """The difference of the headings in radians."""
        return abs(math.remainder(self.own[2] - self.twin[2], 2 * math.pi))

    @property
    def good(self) -> bool:
        """Whether both go the same way."""
        own, twin = self.ways
        return abs(own - twin) <= WAY * own and self.apart <= HEADING


def compared(robot: Robot) -> Compared:
    """Let a robot walk in both. Raises ServogenError where it cannot walk or does not fit the chip."""
    with TemporaryDirectory() as folder:
        job = robot.planned(Path(folder))
        found = planned(job)
        image = found.make(job.firmware.dialect).compilation.image
        schedule = found.plan.schedule
        file = Path(folder) / "edges.csv"
        write_edges(running(schedule, image, motion_cycles(schedule)), file)
        edges = file.read_text()
    lead = found.job.trajectory.loop_start - job.trajectory.loop_start
    lead_s = lead * float(schedule.clock.seconds(schedule.period))
    own = moved(tomllib.loads(robot.robot), tomllib.loads(robot.job), edges, lead_s)
    return Compared(own, twin_of_image(job, found.job, schedule, image).done)


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robots", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cycles", type=int, default=8, help="how many cycles each walks before it turns")
    parser.add_argument("--kind", choices=TWO_JOINTS)
    given = parser.parse_args()
    kinds, chance = [given.kind] if given.kind else list(TWO_JOINTS), random.Random(given.seed)
    passed = number = done = 0
    while done < given.robots:
        kind = kinds[done % len(kinds)]
        robot = stronger(drawn(number, chance, kind), number, given.cycles)
        number += 1
        try:
            found = compared(robot)
        except ServogenError as error:
            print(f"  not: {kind} {robot.gait}: {error.first.message}", flush=True)
            continue
        passed, done = passed + found.good, done + 1
        own, twin = (1000 * way for way in found.ways)
        headings = [math.degrees(pose[2]) for pose in (found.own, found.twin)]
        print(
            f"{kind} {robot.gait}: way {own:.1f} mm here, {twin:.1f} in the twin "
            f"({100 * (twin / own - 1):+.1f} %), heading {headings[0]:.1f} and {headings[1]:.1f}°"
            f"{'' if found.good else ': APART'}",
            flush=True,
        )
    print(f"{passed} of {done} within {100 * WAY:g} % and {math.degrees(HEADING):g}°")
    return 0 if passed == done else 1


if __name__ == "__main__":
    sys.exit(main())
