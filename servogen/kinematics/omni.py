"""The kind `omni`: three omni wheels at 120°, their speeds and the body's, 27 motions, routes, encoders.

In: its file; wheel speeds (..., 3) in rad/s, body speeds (..., 3) as vx, vy in m/s and Ω in rad/s; corners of
a contour in metres. Out: `OmniBase`; `Translation`s, each with its motor turns and encoder counts.
Body frame: x at 0°, z up, Ω > 0 counter-clockwise; a wheel's ω > 0 is the source's "clockwise".

        ▲ y  1        wheel 1 at  60° drives towards -30°     r ω1 =  (√3/2) vx - vy/2 - l Ω
        │  ╱          wheel 2 at 300° drives towards 210°     r ω2 = -(√3/2) vx - vy/2 - l Ω
    3 ──┼─────▶ x     wheel 3 at 180° drives towards  90°     r ω3 =               vy  - l Ω
        │  ╲
             2

         120°   60°        Six directions need only two wheels, at equal and opposite speeds (table 10.1).
            ╲   ╱          One along them is a routine of lab 10; any other is driven with three
    180° ────●──── 0°      wheels (inverse kinematics), or as two routines, those on either side of it:
            ╱   ╲
         240°   300°       L at φ beyond 60° k  =  L sin(60° - φ)/sin 60° along 60° k
                                                 + L sin φ/sin 60° along 60° (k + 1)
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise, product
from math import hypot, pi, sin
from types import MappingProxyType
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from servogen.errors import InputError, check_known, did_you_mean
from servogen.kinematics.mobility import IN_PLANE, Mobility, manoeuvrability
from servogen.kinematics.protocol import Answer, Directions, RobotKind, Routine, Stretch
from servogen.kinematics.transforms import Complexes, Floats
from servogen.robot.arm_file import MAX_GRAMS, Find, RobotKeys, kilograms
from servogen.robot.model import Dimensions, Limb
from servogen.toml.file import Document, Table

_HALF_ROOT = float(np.sqrt(3) / 2)
SIGN_NAMES: Mapping[int, str] = MappingProxyType({1: "clockwise", 0: "stop", -1: "counter-clockwise"})
SIXTH = math.pi / 3
_SAME_DIRECTION = 1e-9
"""Radians within which a translation has one of the six directions: floating-point noise."""


@dataclass(frozen=True, slots=True)
class OmniBase:
    """Three omni wheels at 120°: radius and distance from the centre in metres, gear, encoder, sensors."""

    kind: ClassVar[str] = "omni"

    name: str
    title: str
    wheel_radius: float
    wheel_distance: float
    gear: float
    counts_per_turn: int
    sensors: int = 0
    dimensions: Dimensions = "user"
    source: str = ""
    mass: float | None = None
    """The mass of the whole robot, kg; None: not stated."""

    @property
    def limbs(self) -> tuple[Limb, ...]:
        """Return no limbs: the base has wheels only."""
        return ()

    @property
    def wheel_count(self) -> int:
        """Return 3."""
        return 3

    def wheel_speeds(self, body: ArrayLike) -> Floats:
        """Return ω1, ω2, ω3 (..., 3) that give the body speed (vx, vy, Ω) (..., 3)."""
        vx, vy, turn = np.moveaxis(np.asarray(body, float), -1, 0)
        spin = self.wheel_distance * turn
        one, two, three = _HALF_ROOT * vx - vy / 2 - spin, -_HALF_ROOT * vx - vy / 2 - spin, vy - spin
        return np.stack([one, two, three], axis=-1) / self.wheel_radius

    def body_speed(self, wheels: ArrayLike) -> Floats:
        """Return (vx, vy, Ω) (..., 3) of the wheel speeds ω1, ω2, ω3 (..., 3)."""
        one, two, three = np.moveaxis(np.asarray(wheels, float), -1, 0)
        r = self.wheel_radius
        vx = r * (one - two) / np.sqrt(3)
        vy = r * (-one - two + 2 * three) / 3
        turn = -r * (one + two + three) / (3 * self.wheel_distance)
        return np.stack([vx, vy, turn], axis=-1)

    def route(
        self, corners: Sequence[Sequence[float]], directions: Directions = "any"
    ) -> tuple[Stretch, ...]:
        """Return the translations from corner to corner and back to the first; the base does not turn."""
        return tuple(as_stretch(self, part) for part in contour(self, corners, directions))

    def routine(self, routine: Routine, directions: Directions = "any") -> tuple[Stretch, ...]:
        """Return the stretches of `translation`, `turn`, or `small-`, `medium-` or `large-circle`."""
        _check_values(routine)
        if routine.name == "translation":
            part = _along(routine)
            parts = (translation(self, part),) if directions == "any" else decomposed(self, part)
            return tuple(as_stretch(self, part) for part in parts)
        return (arc(self, routine),)

    def outline(self) -> tuple[Complexes, ...]:
        """Return the rim, a line to the front and the three wheels, by number."""
        out, half = self.wheel_distance, 1j * self.wheel_radius
        rim, front = out * np.exp(1j * np.linspace(0, 2 * np.pi, 49)), np.array([0, 0.8 * out], complex)
        wheels = [
            direction * np.array([out - half, out + half])
            for direction in np.exp(1j * np.radians([60, 300, 180]))
        ]
        return (rim, front, *wheels)


@dataclass(frozen=True, slots=True)
class OmniMotion:
    """One row of table 10.1: the wheels' signs and the motion that follows.

    `direction_deg` is the direction of the centre at the start, None if it stands; `radius` is in wheel
    distances l; `turning` is the sign of Ω (1 counter-clockwise).
    """

    signs: tuple[int, int, int]
    kind: Literal["stop", "translation", "turning", "circle"]
    direction_deg: int | None
    turning: int
    radius: int | None
    size: Literal["small", "medium", "large"] | None


_SIZES: dict[int, Literal["small", "medium", "large"]] = {1: "small", 2: "medium", 4: "large"}

ROUTINES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "translation": ("direction", "distance"),
        "turn": ("turn",),
        **dict.fromkeys(("small-circle", "medium-circle", "large-circle"), ("direction", "turn")),
    }
)
"""The routines, all motions of table 10.1 but standing still, and the values that each takes."""

_KEYS = {"direction": "direction_deg", "distance": "distance_mm", "turn": "turn_deg"}
"""The values of a routine as a job spells them."""


def motion_of(signs: tuple[int, int, int]) -> OmniMotion:
    """Return the motion of wheels at equal speed with signs 1 clockwise, 0 stop, -1 counter-clockwise."""
    if len(signs) != 3 or any(sign not in SIGN_NAMES for sign in signs):
        raise InputError(
            "bad-option", f"{signs} are not wheel signs", hint="three of 1 (clockwise), 0 (stop), -1"
        )
    # with r = 1 and l = 1 the speed of the centre over |Ω| is the radius in wheel distances
    vx, vy, turn = (
        OmniBase(name="", title="", wheel_radius=1.0, wheel_distance=1.0, gear=1.0, counts_per_turn=1)
        .body_speed(signs)
        .tolist()
    )
    speed, total = hypot(vx, vy), sum(signs)
    moving = speed > 1e-9
    direction = round(float(np.degrees(np.arctan2(vy, vx)))) % 360 if moving else None
    turning = -1 if total > 0 else 1 if total < 0 else 0
    if not moving:
        return OmniMotion(
            signs=signs,
            kind="turning" if turning else "stop",
            direction_deg=None,
            turning=turning,
            radius=None,
            size=None,
        )
    if not turning:
        return OmniMotion(
            signs=signs, kind="translation", direction_deg=direction, turning=0, radius=None, size=None
        )
    # Exactly 1, 2 or 4 but for rounding.
    radius = round(speed / abs(turn))
    return OmniMotion(
        signs=signs,
        kind="circle",
        direction_deg=direction,
        turning=turning,
        radius=radius,
        size=_SIZES[radius],
    )


@cache
def table() -> tuple[OmniMotion, ...]:
    """Return table 10.1: all 27 combinations of clockwise, stop and counter-clockwise."""
    return tuple(motion_of((one, two, three)) for one, two, three in product((1, 0, -1), repeat=3))


@cache
def directions() -> Mapping[int, tuple[int, int, int]]:
    """Return the six directions in degrees in which the base moves without turning, and the wheels' signs."""
    signs_of = {row.direction_deg: row.signs for row in table() if row.kind == "translation"}
    return MappingProxyType({angle: signs for angle, signs in sorted(signs_of.items()) if angle is not None})


@dataclass(frozen=True, slots=True)
class WheelTravel:
    """The rotation of the driven wheels while the base moves along one of the six directions."""

    distance_m: float
    wheel_m: float
    motor_turns: float
    counts: float


def circumference(base: OmniBase) -> float:
    """Return the distance in metres that a wheel rolls in one turn."""
    return 2 * pi * base.wheel_radius


def travel(base: OmniBase, distance_m: float) -> WheelTravel:
    """Return wheel path L sin 60°, motor turns and encoder counts for L along one of the six directions."""
    wheel = distance_m * sin(pi / 3)
    turns = base.gear * wheel / circumference(base)
    return WheelTravel(distance_m, wheel, turns, base.counts_per_turn * turns)


def sensor_angles(base: OmniBase) -> tuple[float, ...]:
    """Return the directions of the distance sensors, evenly spaced, in radians from the camera's x axis."""
    return tuple(2 * pi * index / base.sensors for index in range(base.sensors))


@dataclass(frozen=True, slots=True)
class Translation:
    """A translation by `displacement` (x, y in metres).

    `direction_deg`, the wheels' `signs` and the driven wheels' `travel` are those of a routine, in one of the
    six directions; None where three wheels drive.
    """

    displacement: tuple[float, float]
    direction_deg: int | None
    signs: tuple[int, int, int] | None
    travel: WheelTravel | None

    @property
    def length(self) -> float:
        """Return the length in metres."""
        return math.hypot(*self.displacement)


def translation(base: OmniBase, displacement: Sequence[float]) -> Translation:
    """Return the straight translation by `displacement`."""
    x, y = (float(value) for value in displacement)
    sixths = math.atan2(y, x) / SIXTH
    if abs(sixths - round(sixths)) * SIXTH > _SAME_DIRECTION:
        return Translation((x, y), None, None, None)
    direction = 60 * (round(sixths) % 6)
    return Translation((x, y), direction, directions()[direction], travel(base, math.hypot(x, y)))


def routine(base: OmniBase, direction_deg: int, distance: float) -> Translation:
    """Return the routine of lab 10 for one of the six directions. Raises InputError for another direction."""
    if direction_deg not in directions():
        known = [str(direction) for direction in directions()]
        raise InputError(
            "unknown-name",
            f"{direction_deg}° is not one of the six directions",
            hint=did_you_mean(str(direction_deg), known),
        )
    if distance < 0:
        raise InputError(
            "out-of-range",
            f"a distance must not be negative: {distance:g} m",
            hint="take the opposite direction",
        )
    angle = math.radians(direction_deg)
    displacement = distance * math.cos(angle), distance * math.sin(angle)
    return Translation(displacement, direction_deg, directions()[direction_deg], travel(base, distance))


def decomposed(base: OmniBase, displacement: Sequence[float]) -> tuple[Translation, ...]:
    """Return a translation as at most two routines, along the six directions on either side of it."""
    one = translation(base, displacement)
    if one.length == 0.0:
        return ()
    if one.direction_deg is not None:
        return (one,)
    angle = math.atan2(one.displacement[1], one.displacement[0])
    sixth = math.floor(angle / SIXTH)
    beyond = angle - sixth * SIXTH
    # The sine rule in the triangle of the two routines and the translation.
    first = one.length * math.sin(SIXTH - beyond) / math.sin(SIXTH)
    second = one.length * math.sin(beyond) / math.sin(SIXTH)
    return routine(base, 60 * (sixth % 6), first), routine(base, 60 * ((sixth + 1) % 6), second)


def contour(
    base: OmniBase, corners: Sequence[Sequence[float]], using: Directions = "any"
) -> tuple[Translation, ...]:
    """Return the translations from corner to corner and back to the first (x, y in metres).

    Consecutive equal corners count once. Raises InputError if all corners are equal.
    """
    closed = [*corners, corners[0]]
    displacements = [(end[0] - start[0], end[1] - start[1]) for start, end in pairwise(closed)]
    moving = [displacement for displacement in displacements if math.hypot(*displacement) > 0]
    if not moving:
        raise InputError("no-pulses", "the contour has no length", hint="give at least two different corners")
    if using == "any":
        return tuple(translation(base, displacement) for displacement in moving)
    return tuple(part for displacement in moving for part in decomposed(base, displacement))


def as_stretch(base: OmniBase, part: Translation) -> Stretch:
    """Return a translation as a stretch of a route; in a routine the idle wheel does not turn at all."""
    length = f"{1000 * part.length:z.1f} mm"
    if part.signs is None or part.travel is None:
        angle = math.degrees(math.atan2(part.displacement[1], part.displacement[0])) % 360
        wheels = base.wheel_speeds((*part.displacement, 0.0))
        return Stretch(part.length, tuple(wheels.tolist()), f"{length} at {angle:z.1f}°, three wheels")
    # From the routine's formula, because `wheel_speeds` would give the idle wheel a speed of about 1e-17.
    wheels = np.array(part.signs) * part.travel.wheel_m / base.wheel_radius
    return Stretch(
        part.length,
        tuple(wheels.tolist()),
        f"{length} at {part.direction_deg}°, two wheels",
        f"with the base's gear and encoder {part.travel.motor_turns:z.3f} motor turns, "
        f"{part.travel.counts:z.0f} counts",
    )


def _check_values(routine: Routine) -> None:
    """Raise InputError for an unknown routine and one whose values are missing or do not belong to it."""
    check_known("unknown-name", routine.name, ROUTINES, f"'{routine.name}' is not a routine of the omni base")
    wanted = ROUTINES[routine.name]
    given = [name for name in _KEYS if getattr(routine, name) is not None]
    takes = " and ".join(_KEYS[name] for name in wanted)
    for name in wanted:
        if name not in given:
            raise InputError("missing-key", f"{routine.name} needs {_KEYS[name]}", hint=f"it takes {takes}")
    for name in given:
        if name not in wanted:
            raise InputError(
                "not-allowed", f"{routine.name} does not take {_KEYS[name]}", hint=f"it takes {takes}"
            )


def _along(routine: Routine) -> tuple[float, float]:
    direction, distance = routine.direction or 0.0, routine.distance or 0.0
    if distance <= 0:
        raise InputError(
            "out-of-range",
            f"distance_mm must be more than 0, not {1000 * distance:zg}",
            hint="take the opposite direction",
        )
    return distance * math.cos(direction), distance * math.sin(direction)


def arc(base: OmniBase, routine: Routine) -> Stretch:
    """Return the stretch of a turn on the spot or a circle, whose wheels turn at equal speed or stand.

    Ω = -r (ω1 + ω2 + ω3) / 3l, so that the base turns by θ while each driven wheel turns by
    3 l θ / (r |s1 + s2 + s3|) with the signs s of its motion; the centre goes along radius times θ.
    """
    turn = routine.turn or 0.0
    if turn == 0.0:
        raise InputError(
            "out-of-range", "turn_deg must not be 0", hint="counter-clockwise is positive, clockwise negative"
        )
    motion = _motion_named(routine, 1 if turn > 0 else -1)
    wheel_angle = 3 * base.wheel_distance * abs(turn) / (base.wheel_radius * abs(sum(motion.signs)))
    radius = base.wheel_distance * (motion.radius or 1)
    degrees = math.degrees(turn)
    text = f"turn by {degrees:z.1f}°"
    if motion.kind == "circle":
        text = f"{motion.size} circle, radius {1000 * radius:z.1f} mm, by {degrees:z.1f}°"
        text += f", first towards {motion.direction_deg}°"
    turns = base.gear * wheel_angle / (2 * pi)
    counts = base.counts_per_turn * turns
    return Stretch(
        radius * abs(turn),
        tuple(sign * wheel_angle for sign in motion.signs),
        text,
        f"with the base's gear and encoder {turns:z.3f} motor turns, {counts:z.0f} counts",
    )


def _motion_named(routine: Routine, turning: int) -> OmniMotion:
    """Return the row of table 10.1 of a turn or circle in a sense. Raises InputError if there is none."""
    if routine.name == "turn":
        return next(row for row in table() if row.kind == "turning" and row.turning == turning)
    asked = math.degrees(routine.direction or 0.0) % 360
    size = routine.name.removesuffix("-circle")
    rows = {row.direction_deg: row for row in table() if row.size == size and row.turning == turning}
    for direction, row in rows.items():
        if direction is not None and abs((asked - direction + 180) % 360 - 180) < 1e-6:
            return row
    sense = "counter-clockwise" if turning > 0 else "clockwise"
    starts = ", ".join(
        f"{direction}°" for direction in sorted(direction for direction in rows if direction is not None)
    )
    raise InputError(
        "not-allowed",
        f"no {size} circle that begins towards {asked:zg}° turns {sense}",
        hint=f"those begin towards {starts}",
    )


class OmniTable(RobotKeys, Table):
    """The file of an omni base."""

    wheel_diameter_mm: float = Field(gt=0)
    wheel_distance_mm: float = Field(gt=0)
    gear: float = Field(default=1.0, gt=0)
    counts_per_turn: int = Field(default=1, gt=0)
    sensors: int = Field(default=0, ge=0)
    mass_g: float | None = Field(default=None, gt=0, le=MAX_GRAMS)


def _read(document: Document, table: OmniTable, find: Find) -> OmniBase:
    return OmniBase(
        name=table.name,
        title=table.title,
        wheel_radius=table.wheel_diameter_mm / 2000,
        wheel_distance=table.wheel_distance_mm / 1000,
        gear=table.gear,
        counts_per_turn=table.counts_per_turn,
        sensors=table.sensors,
        dimensions=table.dimensions,
        source=table.source,
        mass=kilograms(table.mass_g, None),
    )


def _details(base: OmniBase) -> Answer:
    """Return the facts of the base for `servogen robots`, with table 10.1."""
    return {
        "wheel_radius_m": base.wheel_radius,
        "wheel_distance_m": base.wheel_distance,
        "gear": base.gear,
        "counts_per_turn": base.counts_per_turn,
        "sensor_angles_deg": [math.degrees(angle) for angle in sensor_angles(base)],
        "table": [
            {
                "wheels": [SIGN_NAMES[sign] for sign in row.signs],
                "motion": row.kind,
                "direction_deg": row.direction_deg,
                "turning": row.turning,
                "radius_in_wheel_distances": row.radius,
                "size": row.size,
            }
            for row in table()
        ],
    }


def _wheel_details(base: OmniBase, speeds: Floats) -> dict[str, Floats]:
    turns = speeds * base.gear / (2 * pi)
    return {
        "rim_speeds_m_s": speeds * base.wheel_radius,
        "motor_turns_per_s": turns,
        "encoder_counts_per_s": turns * base.counts_per_turn,
    }


def _mobility(base: OmniBase) -> Mobility:
    return Mobility(
        elements=4,
        joints=("turning",) * 3,
        passive=0,
        mobility=IN_PLANE,
        manoeuvrability=manoeuvrability(IN_PLANE),
        note="in the plane: two translations and one rotation; each omni wheel rolls in one direction and "
        "slides in the other",
    )


OMNI = RobotKind(
    name=OmniBase.kind,
    table=OmniTable,
    read=_read,
    details=_details,
    mobility=_mobility,
    wheel_details=_wheel_details,
)
