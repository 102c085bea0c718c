"""[[servo]], [leg] and [robot] of a job -> `Servo` values, the joints that they turn, and the end of the leg
or arm.

In: the validated tables. Out: `JobRig`, whose servos, one for each table, have the limits that they and their
joints have in common. Raises InputError for two servos on one pin, an open drain, limits beyond the travel,
and joints that do not exist.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from servogen.edges import PINS
from servogen.errors import InputError, Location
from servogen.job.chips import PairedChip
from servogen.job.followers import Follower, at_their_leaders, read_followers, within_each_other
from servogen.job.schema import JobTable, LegTable, ServoTable
from servogen.job.tip import ArmTip, LegTip, Tip
from servogen.kinematics import catalogue
from servogen.kinematics.leg import Leg
from servogen.pic.device import OPEN_DRAIN_PIN
from servogen.robot.binding import Binding
from servogen.robot.calibration import read_calibration
from servogen.robot.model import Arm, Joint, Robot
from servogen.robot.servo import Calibration, Servo, ServoModel, servo
from servogen.robot.servo_models import FILE_ENDING, points_of, servo_model
from servogen.toml.file import Document


def read_servos(
    document: Document, rows: tuple[ServoTable, ...], chips: Sequence[PairedChip] = ()
) -> tuple[Servo, ...]:
    """Return all servos, in the order of the file; each pin is one of its chip. Raises InputError."""
    if len(rows) > len(PINS) and not chips:
        raise document.error(
            "too-many-servos",
            ("servo", len(PINS)),
            f"{len(rows)} servos, but the chip has {len(PINS)} pins: two chips are needed",
            'write [[chip]] twice: see "Two chips" in docs/job.md',
        )
    by_name: dict[str, int] = {}
    by_pin: dict[tuple[int, str], str] = {}
    for index, row in enumerate(rows):
        if row.name in by_name:
            raise document.error(
                "duplicate-name",
                ("servo", index, "name"),
                f"two servos have the name '{row.name}'",
                f"the other one is servo[{by_name[row.name] + 1}]",
            )
        document.check_known(
            "unknown-pin", ("servo", index, "pin"), row.pin, PINS, f"unknown pin '{row.pin}'"
        )
        pin = next((number for number, chip in enumerate(chips) if row.name in chip.servos), 0), row.pin
        if pin in by_pin:
            raise document.error(
                "pin-in-use",
                ("servo", index, "pin"),
                f"two servos are on pin {row.pin}: {by_pin[pin]} and {row.name}",
                "each servo needs a pin of its own",
            )
        if row.pin == OPEN_DRAIN_PIN and not row.open_drain:
            raise document.error(
                "open-drain",
                ("servo", index, "pin"),
                f"{OPEN_DRAIN_PIN} is an open drain: without a pull-up resistor it never goes high",
                "add a pull-up to VDD and write open_drain = true, or use another pin",
            )
        if row.pin != OPEN_DRAIN_PIN and row.open_drain:
            raise document.error(
                "open-drain",
                ("servo", index, "open_drain"),
                f"{row.pin} is not an open drain: only {OPEN_DRAIN_PIN} is",
            )
        by_name[row.name], by_pin[pin] = index, row.name
    return tuple(_servo(document, index, row) for index, row in enumerate(rows))


def _servo(document: Document, index: int, row: ServoTable) -> Servo:
    """Return the servo of a table. Raises InputError."""

    def place(key: str) -> Location:
        return document.place("servo", index, key)

    beside = Path(document.file).parent / row.model
    name = str(beside) if row.model.endswith(FILE_ENDING) else row.model
    servo_model(name, place=place("model"))  # an unknown model is an error whatever its supply is
    model = servo_model(name, row.supply_v, row, place("supply_v" if row.supply_v else "travel_deg"))
    for name in ("joint", "min_deg", "max_deg"):
        if model.continuous and getattr(row, name) is not None:
            raise document.error(
                "wrong-servo-kind",
                ("servo", index, name),
                f"{row.name} turns continuously: {name} needs a servo with angles",
            )
    return servo(
        row.name,
        row.pin,
        model,
        points=_points(document, index, row, model),
        limits=(
            None if row.min_deg is None else math.radians(row.min_deg),
            None if row.max_deg is None else math.radians(row.max_deg),
        ),
        trim_us=row.trim_us,
        reverse=row.reverse,
        place=document.place("servo", index),
        limits_place=place("max_deg" if row.min_deg is None else "min_deg"),
        trim_place=place("trim_us"),
    )


def _points(document: Document, index: int, row: ServoTable, model: ServoModel) -> Calibration | None:
    """Return the servo's own points, from the job or a file beside it; None if it uses the model's."""
    if row.calibration is None:
        place = document.place("servo", index, "points")
        return points_of(row.points, place, model.continuous) if row.points else None
    key = ("servo", index, "calibration")
    if row.points:
        raise document.error(
            "conflicting-keys", key, f"{row.name} already has points of its own", "remove one of the two"
        )
    file = Path(document.file).parent / row.calibration
    return read_calibration(file, row.name, model.name, model.continuous, document.place(*key))


def read_bindings(
    document: Document, rows: tuple[ServoTable, ...], sliding: dict[str, bool]
) -> tuple[Binding, ...]:
    """Return the joints that the servos turn, in the order of the servos; `sliding` states for each of the
    robot's joints whether it slides.
    """
    bindings: list[Binding] = []
    for index, row in enumerate(rows):
        if row.joint is None:
            continue
        key = ("servo", index, "joint")
        if not sliding:
            raise document.error(
                "missing-robot",
                key,
                "the job has no robot to which the joint could belong",
                "add [robot] name = …",
            )
        document.check_known(
            "unknown-joint", key, row.joint, sliding, f"the robot has no joint '{row.joint}'"
        )
        if row.joint in [binding.joint for binding in bindings]:
            first = next(binding.servo for binding in bindings if binding.joint == row.joint)
            raise document.error(
                "joint-binding",
                key,
                f"two servos turn the joint '{row.joint}'",
                f'write follows = "{first}" in place of joint; reverse = true if they face each other',
            )
        if sliding[row.joint] != (row.deg_per_mm is not None):
            kind, wanted = ("slides", "deg_per_mm") if sliding[row.joint] else ("turns", "ratio")
            raise document.error(
                "wrong-unit", key, f"the joint '{row.joint}' {kind}", f"give the servo's {wanted}"
            )
        # Radians per metre.
        ratio = row.ratio if row.deg_per_mm is None else math.radians(row.deg_per_mm) * 1000
        if not ratio:
            raise document.error("out-of-range", key, "a joint with a ratio of 0 cannot move")
        bindings.append(Binding(row.joint, row.name, math.radians(row.zero_deg), ratio))
    return tuple(bindings)


SIGNS = {"nearest": 0, "positive": 1, "negative": -1}


@dataclass(frozen=True, slots=True)
class JobRig:
    """What the servos move; `tip` is None if it cannot be positioned: no robot, or joints without servos."""

    servos: tuple[Servo, ...]
    followers: tuple[Follower, ...]
    robot: Robot | None
    bindings: tuple[Binding, ...]
    tip: Tip | None


def read_rig(document: Document, table: JobTable, chips: Sequence[PairedChip] = ()) -> JobRig:
    """Return what the servos of a job move. Raises InputError."""
    followers = read_followers(document, table.servo)
    servos = within_each_other(document, read_servos(document, table.servo, chips), followers)
    rig = _rig(document, table, servos, followers)
    return replace(rig, servos=at_their_leaders(rig.servos, followers))


def _rig(
    document: Document, table: JobTable, servos: tuple[Servo, ...], followers: tuple[Follower, ...]
) -> JobRig:
    if table.leg is not None:
        if table.robot is not None:
            raise document.error(
                "conflicting-keys", ("robot",), "[leg] is itself a robot", "remove one of the two"
            )
        read_bindings(document, table.servo, {})
        tip = _leg(document, table.leg, servos, {follower.name for follower in followers})
        return JobRig(servos, followers, None, tip.bindings, tip)
    if table.robot is None:
        return JobRig(servos, followers, None, read_bindings(document, table.servo, {}), None)
    robot = _robot(document, table.robot.name)
    joints = {name: joint for limb in robot.limbs for name, joint in limb.joints.items()}
    bindings = read_bindings(
        document, table.servo, {name: not joint.turning for name, joint in joints.items()}
    )
    by_name = {servo.name: servo for servo in servos}
    for binding in bindings:
        place = document.place("servo", list(by_name).index(binding.servo), "zero_deg")
        joints[binding.joint], by_name[binding.servo] = binding.within_both(
            replace(joints[binding.joint], name=binding.joint), by_name[binding.servo], place
        )
    return JobRig(tuple(by_name.values()), followers, robot, bindings, _tip(robot, joints, bindings, by_name))


def _robot(document: Document, name: str) -> Robot:
    """Return the robot of [robot]: of a file beside the job, or of the catalogue. Raises InputError."""
    folder, (file, _) = Path(document.file).parent, catalogue.file_of(name)
    if file is not None and not (folder / file).is_file():
        raise document.error("unknown-robot", ("robot", "name"), f"there is no robot file '{folder / file}'")
    try:
        return catalogue.robot(name if file is None else str(folder / name))
    except InputError as error:
        # An error inside the robot's file is reported there, all others at [robot] name.
        if error.location is not None and error.location.file and error.location.file != document.file:
            raise
        raise error.at(document.place("robot", "name")) from error


def _tip(
    robot: Robot, joints: Mapping[str, Joint], bindings: tuple[Binding, ...], servos: Mapping[str, Servo]
) -> ArmTip | None:
    """Return the tip of an arm whose joints all have a servo; None for other robots."""
    if not isinstance(robot, Arm):
        return None
    by_joint = {binding.joint: binding for binding in bindings}
    if any(joint.name not in by_joint for joint in robot.joints):
        return None
    mine = tuple(by_joint[joint.name] for joint in robot.joints)
    on_servos = replace(robot, joints=tuple(joints[joint.name] for joint in robot.joints))
    return ArmTip(robot, on_servos, mine, tuple(servos[binding.servo] for binding in mine))


def _leg(document: Document, table: LegTable, servos: tuple[Servo, ...], following: set[str]) -> LegTip:
    """Return the two-joint leg of [leg]. Raises InputError."""
    by_name = {servo.name: servo for servo in servos}
    for key in ("alpha", "beta"):
        name = getattr(table, key)
        document.check_known("unknown-servo", ("leg", key), name, by_name, f"there is no servo '{name}'")
        if name in following:
            raise document.error(
                "joint-binding", ("leg", key), f"{name} follows another servo: name that one here"
            )
    if table.alpha == table.beta:
        raise document.error("joint-binding", ("leg", "beta"), f"'{table.beta}' is the servo of both joints")
    if table.ab_mm + table.cd_mm <= 0:
        raise document.error(
            "bad-length", ("leg", "cd_mm"), "ab_mm and cd_mm are both 0: the leg would have no length"
        )
    lengths = (table.ab_mm, table.bc_mm, table.cd_mm, table.df_mm)
    return LegTip(
        leg=Leg(*(length / 1000 for length in lengths)),
        bindings=(
            Binding("alpha", table.alpha, math.radians(table.alpha_zero_deg)),
            Binding("beta", table.beta, math.radians(table.beta_zero_deg)),
        ),
        servos=(by_name[table.alpha], by_name[table.beta]),
        beta_sign=SIGNS[table.beta_sign],
        tolerance=table.tolerance_mm / 1000,
    )
