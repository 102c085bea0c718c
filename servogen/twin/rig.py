"""A job's servos on the joints of its robot: `Job` -> actuators for the bodies, wirings for the physics.

In: a job, deviations of one specimen. Out: `TwinRig`. Every servo that turns a joint or a wheel has an
actuator; others, such as a hand's, are not modelled.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from servogen.errors import InputError, check_known
from servogen.job import Job
from servogen.robot.binding import Binding
from servogen.robot.model import Robot
from servogen.robot.servo import Servo
from servogen.twin.drive import ServoDrive, servo_drive
from servogen.twin.mjcf import Actuator
from servogen.twin.supply import Supply
from servogen.twin.world import ServoWiring

HIGH_SPEED_HZ = 4_000_000
"""The clock above which the mode is HS, with a higher minimum voltage (DS35007 section 9.1, D001, D001A)."""

MIN_V, MIN_HS_V = 4.0, 4.5


@dataclass(frozen=True, slots=True)
class TwinRig:
    """Actuators and wirings, one for each of `servos`, in the same order; `columns` are their job columns."""

    robot: Robot
    servos: tuple[Servo, ...]
    columns: tuple[int, ...]
    bindings: tuple[Binding, ...]
    drives: tuple[ServoDrive, ...]
    actuators: tuple[Actuator, ...]
    wirings: tuple[ServoWiring, ...]
    supply: Supply
    assumptions: tuple[str, ...]

    @property
    def steps_per_ms(self) -> int:
        """Return the fewest steps of the physics per millisecond that follow the fastest servo."""
        return max((drive.steps_per_ms for drive in self.drives), default=1)

    def pins(self, job: Job, shown: int = 0) -> tuple[int, ...]:
        """Return the numbers of the servos' pins, as `Job.pin_numbers`."""
        numbers = job.pin_numbers(shown)
        return tuple(numbers[column] for column in self.columns)


def twin_rig(job: Job, broken: Sequence[str] = ()) -> TwinRig:
    """Return a job's servos on its robot. Raises InputError where there is none, or no such servo."""
    if job.robot is None:
        raise InputError(
            "missing-robot",
            f"{job.name}: the twin needs a robot",
            job.document.place("robot"),
            'add [robot] name = "…"',
        )
    names = [servo.name for servo in job.servos]
    for name in broken:
        check_known("unknown-servo", name, names, f"there is no servo '{name}'")
    bindings = job.bindings
    if job.wheels:
        bindings = tuple(Binding(f"wheel{number}", name) for number, name in enumerate(job.wheels, 1))
    by_servo = {binding.servo: binding for binding in bindings}
    bindings += tuple(
        each.binding(by_servo[each.leader]) for each in job.followers if each.leader in by_servo
    )
    columns = tuple(names.index(binding.servo) for binding in bindings)
    servos = tuple(job.servos[column] for column in columns)
    drives = tuple(servo_drive(servo) for servo in servos)
    actuators = tuple(
        _actuator(servo, binding, drive)
        for servo, binding, drive in zip(servos, bindings, drives, strict=True)
    )
    wirings = tuple(
        ServoWiring(drive, servo.angle, binding.zero, servo.name in broken)
        for servo, binding, drive in zip(servos, bindings, drives, strict=True)
    )
    supply, said = _supply(job, drives)
    assumptions = dict.fromkeys(text for drive in drives for text in drive.assumptions)
    unmodelled = [name for name in names if name not in {binding.servo for binding in bindings}]
    if unmodelled:
        said.append(f"{', '.join(unmodelled)} turns no joint and is not modelled")
    return TwinRig(
        job.robot, servos, columns, bindings, drives, actuators, wirings, supply, (*assumptions, *said)
    )


def unplugged_servos(rig: TwinRig, names: Sequence[str]) -> frozenset[int]:
    """Return the numbers of servos whose signal wire is off. Raises InputError for an unknown name."""
    known = [servo.name for servo in rig.servos]
    for name in names:
        check_known("unknown-servo", name, known, f"there is no servo '{name}'")
    return frozenset(known.index(name) for name in names)


def _actuator(servo: Servo, binding: Binding, drive: ServoDrive) -> Actuator:
    lower, upper = -math.inf, math.inf
    if not servo.model.continuous:
        lower, upper = sorted(float(binding.position(angle)) for angle in servo.model.travel)
    return Actuator(
        servo.name,
        binding.joint,
        binding.ratio,
        lower,
        upper,
        drive.friction,
        drive.inertia,
        drive.backlash,
    )


def _supply(job: Job, drives: Sequence[ServoDrive]) -> tuple[Supply, list[str]]:
    """Return the job's supply; without one, an ideal source of the servos' own voltage."""
    least = MIN_V if job.clock.hz <= HIGH_SPEED_HZ else MIN_HS_V
    if job.supply is None:
        volts = min(drive.supply_v for drive in drives)
        said = [f"supply: {volts:g} V without resistance or limit (the job has no [supply])"]
        return Supply(volts, feeds_chip=False, chip_minimum_v=least), said
    table = job.supply
    return Supply(table.voltage_v, table.resistance_ohm, table.limit_a, table.feeds_chip, least), []
