"""A servo: pulse width as a function of shaft angle, and the facts of its model.

In: a model's facts and the properties of one servo (pin, calibration, trim, mounting, limits).
Out: `Servo`, which turns angles (radians) into widths (microseconds) and back. For a continuous-rotation
servo the width is the speed: every angle here is then a speed (radians per second, 0 is stop).

    width                                 reverse: the servo is mounted mirrored, so angles
    max ┤            ╱   calibration:     count from the other end of its travel;
        │       ╱        straight lines   trim: shifts every width by the same time
    min ┤  ╱             between points
        └──┴────┴────┴── angle
           0   90°  180°
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from servogen.errors import InputError, Location

TRAVEL = "the servo's travel_deg, min_deg, max_deg and calibration points set it"
"""What limits a servo that no joint limits further."""

TOLERANCE_RAD = 1e-9
"""Angles up to this far outside a limit are accepted, because degrees in files are not exact in radians."""


@dataclass(frozen=True, slots=True)
class CalibrationPoint:
    """The pulse width in µs at a shaft angle in radians, or at a speed in radians per second."""

    angle: float
    """Shaft angle in radians."""
    width_us: float


@dataclass(frozen=True, slots=True)
class Calibration:
    """Straight lines between at least two points, angles and widths both strictly monotonic."""

    points: tuple[CalibrationPoint, ...]

    @property
    def angles(self) -> tuple[float, float]:
        """Return the minimum and maximum calibrated angle."""
        return self.points[0].angle, self.points[-1].angle

    @property
    def widths_us(self) -> tuple[float, float]:
        """Return the minimum and maximum width in µs."""
        ends = sorted((self.points[0].width_us, self.points[-1].width_us))
        return ends[0], ends[1]

    @property
    def per_us(self) -> float:
        """Return the mean change of the angle per microsecond, without its sign."""
        (low, high), (shortest, longest) = self.angles, self.widths_us
        return (high - low) / (longest - shortest)

    @property
    def bend_us(self) -> float:
        """Return how far (µs) its points are off the straight line between its ends."""
        first, last = self.points[0], self.points[-1]
        slope = (last.width_us - first.width_us) / (last.angle - first.angle)
        return max(
            abs(point.width_us - first.width_us - slope * (point.angle - first.angle))
            for point in self.points
        )

    def width_us(self, angle: float) -> float:
        """Return the width at `angle` in µs; beyond the end points, the nearest segment is extrapolated."""
        before, after = self._around([point.angle for point in self.points], angle)
        share = (angle - before.angle) / (after.angle - before.angle)
        return before.width_us + share * (after.width_us - before.width_us)

    def angle(self, width_us: float) -> float:
        """Return the angle at `width_us`; beyond the end points, the nearest segment is extrapolated."""
        sign = 1 if self.points[-1].width_us > self.points[0].width_us else -1
        before, after = self._around([sign * point.width_us for point in self.points], sign * width_us)
        share = (width_us - before.width_us) / (after.width_us - before.width_us)
        return before.angle + share * (after.angle - before.angle)

    def _around(self, rising: list[float], value: float) -> tuple[CalibrationPoint, CalibrationPoint]:
        index = 1
        # Stops at the last segment, which is extrapolated beyond its end.
        while index < len(rising) - 1 and value > rising[index]:
            index += 1
        return self.points[index - 1], self.points[index]


def calibration(points: tuple[tuple[float, float], ...], place: Location | None = None) -> Calibration:
    """Return a calibration from (angle in radians, width in µs) pairs in any order. Raises InputError."""
    ordered = tuple(CalibrationPoint(*point) for point in sorted(points))
    if len(ordered) < 2:
        raise InputError(
            "bad-calibration",
            "a calibration needs at least two points",
            place,
            "give the width at two angles",
        )
    steps = list(pairwise(ordered))
    if any(after.angle == before.angle for before, after in steps):
        raise InputError("bad-calibration", "two calibration points have the same angle", place)
    slopes = [after.width_us - before.width_us for before, after in steps]
    if not (all(slope > 0 for slope in slopes) or all(slope < 0 for slope in slopes)):
        raise InputError(
            "bad-calibration",
            "the widths of the calibration points do not all rise, or all fall, with the angle",
            place,
        )
    return Calibration(ordered)


@dataclass(frozen=True, slots=True)
class Motor:
    """Facts about a servo's motor and electronics for the physics; None if the file does not state them.

    `assumed` are the keys of the file whose values do not come from the manufacturer.
    """

    stall_a: float | None = None
    """The current at standstill with the full voltage, without the electronics."""
    no_load_a: float | None = None
    """The motor's current at full speed without load, which overcomes its dry friction."""
    efficiency: float | None = None
    """The efficiency of the gear, from which the stall current follows if it is not stated."""
    dead_band_us: float | None = None
    full_drive_us: float | None = None
    """The error beyond the dead band at which the motor receives the full voltage."""
    lost_s: float | None = None
    """The time without a pulse after which the electronics stop driving the motor."""
    start_s: float | None = None
    """The mechanical time constant of the motor without load."""
    backlash: float | None = None
    """The backlash of the gear, in radians at the shaft."""
    assumed: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class ServoModel:
    """Facts about a model; None means that its data sheet does not specify the value."""

    name: str
    title: str
    travel: tuple[float, float]
    """The angles of the mechanical stops, radians; infinite for a continuous-rotation servo,
    which has none.
    """
    calibration: Calibration
    """The calibration of the data sheet; a servo may have its own."""
    speed: float | None
    """Radians per second without load."""
    acceleration: float | None
    """Radians per second squared."""
    torque_nm: float | None
    idle_a: float | None
    max_a: float | None
    mass_kg: float | None
    size_m: tuple[float, float, float] | None
    source: str
    spline_teeth: int | None = None
    """The teeth of its shaft, which say in what steps a horn goes on."""
    continuous: bool = False
    """Whether its angles are speeds."""
    supply_v: float | None = None
    """The voltage at which speed and torque hold; None: the file states no voltage."""
    motor: Motor = Motor()

    def lost_motion(self, calibration: Calibration) -> float:
        """Return the angle (radians) that the shaft loses when it reverses, with a servo's calibration.

        It is the dead band on both sides and the backlash of the gear; values that are not stated count as 0.
        """
        dead = 2 * (self.motor.dead_band_us or 0.0) * calibration.per_us
        return dead + (self.motor.backlash or 0.0)

    @property
    def unit(self) -> str:
        """Return the unit in which its angles are displayed."""
        return "°/s" if self.continuous else "°"

    def mirrored(self, angle: float) -> float:
        """Return the angle of a servo that is mounted in reverse."""
        low, high = self.travel
        return -angle if self.continuous else low + high - angle

    def shown(self, angle: float) -> str:
        """Return an angle (radians) as text, in degrees."""
        return f"{math.degrees(angle):zg}{self.unit}"


@dataclass(frozen=True, slots=True)
class Servo:
    """One servo on one pin; `limits` (radians) are within the travel: those of the user and of the joint that
    it turns.
    """

    name: str
    pin: str
    model: ServoModel
    calibration: Calibration
    limits: tuple[float, float]
    trim_us: float = 0.0
    reverse: bool = False
    place: Location | None = None
    limited_by: str = TRAVEL
    """What sets the limits, for messages."""
    rest: float | None = None
    """The neutral angle, if it is that of another servo on the same joint."""

    @property
    def widths_us(self) -> tuple[float, float]:
        """Return the minimum and maximum width of this servo in µs, including its trim."""
        ends = sorted((self._width_us(self.limits[0]), self._width_us(self.limits[1])))
        return ends[0], ends[1]

    @property
    def neutral(self) -> float:
        """Return the middle of the travel, or the nearest angle within the limits; for a wheel,
        standstill.
        """
        if self.rest is not None:
            return self.rest
        low, high = self.limits
        middle = 0.0 if self.model.continuous else sum(self.model.travel) / 2
        return min(max(middle, low), high)

    @property
    def whole(self) -> tuple[float, float]:
        """Return the angles that travel and calibration allow, whatever the limits."""
        return _widest(self.model, self.calibration, self.reverse)

    def allows(self, angle: float) -> bool:
        """Return whether an angle (radians) is within the limits."""
        low, high = self.limits
        return low - TOLERANCE_RAD <= angle <= high + TOLERANCE_RAD

    def allows_each(self, angles: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return for every angle whether it is allowed; NaN is not."""
        low, high = self.limits
        return np.asarray((angles >= low - TOLERANCE_RAD) & (angles <= high + TOLERANCE_RAD))

    def width_us(self, angle: float) -> float:
        """Return the pulse width in µs at a shaft angle in radians. Raises InputError outside the limits."""
        self.check(angle)
        return self._width_us(angle)

    def check(self, angle: float, place: Location | None = None) -> None:
        """Raise InputError, at `place`, for an angle (radians) outside the limits."""
        if not self.allows(angle):
            low, high = (self.model.shown(limit) for limit in self.limits)
            what = ("turn at", "speeds are") if self.model.continuous else ("go to", "travel is")
            raise InputError(
                "servo-limit",
                f"{self.name} cannot {what[0]} {self.model.shown(angle)}: its {what[1]} {low} to {high}",
                place or self.place,
                "the servo's calibration points set it" if self.model.continuous else self.limited_by,
            )

    def angle(self, width_us: float) -> float:
        """Return the shaft angle in radians commanded by a width, even beyond the limits (for
        measurements).
        """
        return self.mounted(self.calibration.angle(width_us - self.trim_us))

    def mounted(self, angle: float) -> float:
        """Return the shaft's angle at an angle of the mounted servo, and vice versa."""
        return self.model.mirrored(angle) if self.reverse else angle

    def _width_us(self, angle: float) -> float:
        return self.calibration.width_us(self.mounted(angle)) + self.trim_us


def _widest(model: ServoModel, curve: Calibration, reverse: bool) -> tuple[float, float]:
    """Return the range of the mounted servo's angles that both the travel and the calibration cover."""
    low, high = model.travel
    first, last = curve.angles
    # Mirroring exchanges the ends.
    ends = (model.mirrored(last), model.mirrored(first)) if reverse else (first, last)
    return max(low, ends[0]), min(high, ends[1])


def servo(
    name: str,
    pin: str,
    model: ServoModel,
    *,
    points: Calibration | None = None,
    limits: tuple[float | None, float | None] = (None, None),
    trim_us: float = 0.0,
    reverse: bool = False,
    place: Location | None = None,
    limits_place: Location | None = None,
    trim_place: Location | None = None,
) -> Servo:
    """Return a servo of `model`; its limits are the user's, else the range common to travel and calibration.

    Raises InputError for limits outside that range, because the calibration is not extrapolated.
    """
    curve = points or model.calibration
    widest = _widest(model, curve, reverse)
    chosen = (
        widest[0] if limits[0] is None else limits[0],
        widest[1] if limits[1] is None else limits[1],
    )
    if None not in limits and chosen[0] >= chosen[1]:
        asked, other = (model.shown(end) for end in chosen)
        raise InputError(
            "servo-range",
            f"{name}'s minimum angle of {asked} is not below its maximum of {other}",
            limits_place or place,
        )
    if (
        chosen[0] < widest[0] - TOLERANCE_RAD
        or chosen[1] > widest[1] + TOLERANCE_RAD
        or chosen[0] >= chosen[1]
    ):
        asked, known = (" to ".join(model.shown(end) for end in pair) for pair in (chosen, widest))
        raise InputError(
            "servo-range",
            f"{name} cannot have limits of {asked}: travel and calibration allow {known}",
            limits_place or place,
            "calibrate it at angles farther apart, or set min_deg and max_deg within these",
        )
    result = Servo(
        name=name,
        pin=pin,
        model=model,
        calibration=curve,
        limits=chosen,
        trim_us=trim_us,
        reverse=reverse,
        place=place,
    )
    if result.widths_us[0] <= 0:
        raise InputError(
            "servo-range",
            f"{name}'s shortest pulse would be {result.widths_us[0]:g} µs: its trim is {trim_us:zg} µs",
            trim_place or place,
            "a trim is a small correction of every pulse",
        )
    return result
