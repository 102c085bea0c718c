"""A servo as electronics, motor and gear: `ServoModel` -> `ServoDrive`, the constants of its equations.

In: a servo's model at its supply voltage U. Out: constants at the servo's shaft, and what was assumed.

    electronics   e = commanded angle - angle - Td ω;  u = 0 within the dead band, ±1 at `band` beyond it
    motor         i = (u Vs - Ke ω) / R          u: the share of the time for which the bridge is on
    gear          τ = Kt i - τf sign ω           current from the supply: u i + idle

    R = U / Is      Ke = (U - R i0) / ω0      Kt = τs / (Is - i0)      τf = Kt i0

Is is the motor's current at standstill, i0 that at full speed: with these constants the no-load speed is ω0,
the stall torque τs and the stall current Is, as the catalogue states them. Kt is less than Ke by the
efficiency of the gear. The inertia at the shaft is J = T Kt Ke / R for a mechanical time constant T.
Servos are built not to overshoot: Td, the feedback of the motor's speed, makes the loop without load
critically damped. With the stiffness K = τs / band and the motor's own damping D = Kt Ke / R that is

    Td = (2 √(K J) - D) / K      or 0 where the motor's own damping is enough
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from servogen.errors import InputError
from servogen.robot.servo import Servo, ServoModel

DEAD_BAND_US, FULL_DRIVE_US = 2.0, 5.0
LOST_S = 0.1
"""The default time without a pulse after which the motor is open; labs use periods of up to 43 ms."""
START_S = 0.01
EFFICIENCY = 0.66
"""The default efficiency: four stages of spur gears with 0.9 each."""
IDLE_A = 0.008
"""The default current of the electronics: that of the S3001."""
SUPPLY_V = 5.0

PHASE_RAD = 0.3
"""The maximum phase of the loop's own oscillation in a step of the physics."""
MAX_STEPS_PER_MS = 20


@dataclass(frozen=True, slots=True)
class ServoDrive:
    """The constants of one servo, at its shaft, in SI units; `assumptions` are sentences."""

    supply_v: float
    resistance: float
    torque_constant: float
    speed_constant: float
    friction: float
    inertia: float
    idle_a: float
    dead_band: float
    band: float
    """Radians (of a continuous servo: radians per second) beyond the dead band up to the full voltage."""
    damping_s: float
    """Td, the feedback of the speed."""
    lost_s: float
    backlash: float
    continuous: bool
    assumptions: tuple[str, ...]

    @property
    def stall_torque(self) -> float:
        """Return the torque at standstill with the full voltage."""
        return self.torque_constant * (self.supply_v / self.resistance) - self.friction

    @property
    def no_load_speed(self) -> float:
        """Return the speed without load at the full voltage."""
        needed = self.friction / self.torque_constant
        return (self.supply_v - self.resistance * needed) / self.speed_constant

    @property
    def steps_per_ms(self) -> int:
        """Return the fewest steps of the physics per millisecond in which the loop is followed."""
        if self.continuous:  # no loop: the width is the share of the voltage
            return 1
        own = math.sqrt(self.stall_torque / self.band / self.inertia)
        return max(1, math.ceil(own / (1000 * PHASE_RAD) * (1 - 1e-9)))


def servo_drive(servo: Servo) -> ServoDrive:
    """Return the constants of a servo. Raises InputError for a model without speed or torque."""
    model, facts = servo.model, _StatedFacts(servo.model)
    supply = facts.value("supply_v", model.supply_v, SUPPLY_V, "V")
    if model.continuous and model.speed is None:
        speed = max(abs(speed) for speed in servo.calibration.angles)
    else:
        speed = _require(servo, model.speed, "speed_deg_s")
    if model.continuous and model.torque_nm is None:
        torque = facts.value("torque_ncm", None, CONTINUOUS_TORQUE, "N·m")
    else:
        torque = _require(servo, model.torque_nm, "torque_ncm")
    idle = facts.value("idle_ma", model.idle_a, IDLE_A, "A")
    no_load = facts.value("no_load_ma", model.motor.no_load_a, 0.0, "A, no dry friction")
    facts.tell("speed_deg_s", f"speed_deg_s = {math.degrees(speed):.4g}")
    facts.tell("torque_ncm", f"torque_ncm = {100 * torque:.4g}")
    if servo.calibration == model.calibration:
        facts.tell("points", "the pulses of its travel are assumed")
    stall = _stall_current(servo, facts, torque * speed / supply, no_load, idle)
    resistance = supply / stall
    speed_constant = (supply - resistance * no_load) / speed
    torque_constant = torque / (stall - no_load)
    if torque_constant > speed_constant * (1 + 1e-9):
        raise InputError(
            "out-of-range",
            f"{servo.name}: {torque:g} N·m at {stall:g} A and {math.degrees(speed):.4g} °/s at {supply:g} V "
            "are more power than the motor takes",
            servo.place,
            "its stall_ma is too small",
        )
    per_us = servo.calibration.per_us
    damping = torque_constant * speed_constant / resistance
    start, dead, full = _loop_times(servo, facts, torque, damping)
    stiffness = torque / (full * per_us)
    critical = 2 * math.sqrt(stiffness * start * damping)
    return ServoDrive(
        supply_v=supply,
        resistance=resistance,
        torque_constant=torque_constant,
        speed_constant=speed_constant,
        friction=torque_constant * no_load,
        inertia=start * damping,
        idle_a=idle,
        dead_band=dead * per_us,
        band=full * per_us,
        damping_s=max(0.0, (critical - damping) / stiffness),
        lost_s=facts.value("lost_ms", model.motor.lost_s, LOST_S, "s"),
        backlash=facts.value("backlash_deg", model.motor.backlash, 0.0, ""),
        continuous=model.continuous,
        assumptions=tuple(facts.sentences),
    )


def _stall_current(servo: Servo, facts: _StatedFacts, power_a: float, no_load: float, idle: float) -> float:
    """Return the motor's current at standstill, in amperes: stated, from max_ma, or from its efficiency.

    `power_a` is the mechanical power (torque times speed) divided by the supply's voltage. Raises InputError.
    """
    model, motor = servo.model, servo.model.motor
    stall = motor.stall_a
    # No motor gives more power than it takes: Kt <= Ke. The root is where both are equal.
    least_a = no_load + power_a / 2 + math.sqrt(power_a**2 / 4 + power_a * no_load)
    if stall is None and model.max_a is not None and model.max_a - idle >= least_a:
        facts.note(f"the current at standstill is its max_ma, {model.max_a:g} A")
        stall = model.max_a - idle
    if stall is None:
        efficiency = facts.value("efficiency", motor.efficiency, EFFICIENCY, "")
        stall = max(least_a, power_a / efficiency + no_load)
        facts.note(f"the current at standstill is {stall:.3g} A, from speed, torque and efficiency")
    if stall <= no_load:
        raise InputError(
            "out-of-range",
            f"{servo.name}: its current at standstill of {stall:g} A is not above that at full speed",
            servo.place,
        )
    return stall


def _loop_times(
    servo: Servo, facts: _StatedFacts, torque: float, damping: float
) -> tuple[float, float, float]:
    """Return the start time in seconds, the dead band and the error up to the full voltage, both in µs.

    Raises InputError for a position loop that the finest steps of the physics cannot follow.
    """
    motor = servo.model.motor
    # The finest steps follow a product of both from `least` on: what nobody stated never makes it smaller.
    fastest = 1000 * MAX_STEPS_PER_MS * PHASE_RAD
    least = 0.0 if servo.model.continuous else torque / (servo.calibration.per_us * fastest**2 * damping)
    slow = START_S if motor.full_drive_us is None else max(START_S, least / motor.full_drive_us)
    start = facts.value("start_ms", motor.start_s, slow, "s")
    dead = facts.value("dead_band_us", motor.dead_band_us, DEAD_BAND_US, "µs")
    soft = math.ceil(1000 * max(FULL_DRIVE_US, least / start)) / 1000
    full = facts.value("full_drive_us", motor.full_drive_us, soft, "µs")
    if full * start < least * (1 - 1e-9):
        raise InputError(
            "out-of-range",
            f"{servo.name}: with start_ms = {1000 * start:g} and full_drive_us = {full:g} "
            f"its loop is too fast for steps of {1000 // MAX_STEPS_PER_MS} µs",
            servo.place,
            "state a greater start_ms or full_drive_us",
        )
    return start, dead, full


CONTINUOUS_TORQUE = 0.3
"""The torque of a continuous-rotation servo whose file states none: that of a standard servo, N·m."""


class _StatedFacts:
    """A model's facts as they are used, with a sentence for each that is assumed."""

    def __init__(self, model: ServoModel) -> None:
        self._model = model
        self.sentences: list[str] = []

    def value(self, key: str, stated: float | None, default: float, unit: str) -> float:
        """Return the stated value, or the default, which is noted as an assumption."""
        value = default if stated is None else stated
        if stated is None or key in self._model.motor.assumed:
            self.note(f"{key} = {_in_key(key, value):.4g}" + (f" ({unit})" if "," in unit else ""))
        return value

    def tell(self, key: str, text: str) -> None:
        """Note a sentence if the value of `key` is assumed."""
        if key in self._model.motor.assumed:
            self.note(text)

    def note(self, text: str) -> None:
        self.sentences.append(f"{self._model.title}: {text}")


def _in_key(key: str, value: float) -> float:
    """Return a value in the unit of its key."""
    if key.endswith(("_ma", "_ms")):
        return 1000 * value
    if key.endswith("_ncm"):
        return 100 * value
    return value


def _require(servo: Servo, value: float | None, key: str) -> float:
    if value is None:
        raise InputError(
            "missing-key",
            f"{servo.name}: its model '{servo.model.name}' states no {key}",
            servo.place,
            f"add {key} to the servo, or to its model's file",
        )
    return value


@dataclass(frozen=True, slots=True, eq=False)
class Bank:
    """The constants of all servos of a robot as arrays, and their equations."""

    resistance: np.ndarray[tuple[int], np.dtype[np.float64]]
    torque_constant: np.ndarray[tuple[int], np.dtype[np.float64]]
    speed_constant: np.ndarray[tuple[int], np.dtype[np.float64]]
    dead_band: np.ndarray[tuple[int], np.dtype[np.float64]]
    band: np.ndarray[tuple[int], np.dtype[np.float64]]
    damping: np.ndarray[tuple[int], np.dtype[np.float64]]
    idle_a: float


def bank(drives: tuple[ServoDrive, ...]) -> Bank:
    """Return the constants of servos as arrays."""
    return Bank(
        np.array([drive.resistance for drive in drives]),
        np.array([drive.torque_constant for drive in drives]),
        np.array([drive.speed_constant for drive in drives]),
        np.array([drive.dead_band for drive in drives]),
        np.array([drive.band for drive in drives]),
        np.array([drive.damping_s for drive in drives]),
        sum(drive.idle_a for drive in drives),
    )
