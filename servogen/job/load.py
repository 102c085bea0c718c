"""A job file -> `Job`. Every error names the line, the key, the value and what is allowed.

In: the path (or the text) of a job file. Out: the frozen `Job`, with what had to be rounded as warnings.
"""

from __future__ import annotations

import math
from pathlib import Path

from servogen import tomlfile
from servogen.edges import PINS
from servogen.errors import InputError, Place, nearest
from servogen.job.job import Firmware, Job, LegBinding
from servogen.job.model import JobTable, LegTable, ServoTable
from servogen.job.poses import poses_of
from servogen.kinematics.leg import Leg
from servogen.motion import Motion, trajectory
from servogen.pic.device import OPEN_DRAIN_PIN, Device, device
from servogen.pulse.slots import Frame, rises
from servogen.robot.servo import Servo, servo
from servogen.robot.servo_models import points_of, servo_model
from servogen.tomlfile import Document, exact
from servogen.units import Clock


def load(path: str | Path) -> Job:
    """The job in the file at `path`. Raises InputError."""
    return _job(tomlfile.read(path))


def loads(text: str, file: str) -> Job:
    """The job that `text` is; `file` is its name in errors. Raises InputError."""
    return _job(tomlfile.parse(text, file))


def _job(document: Document) -> Job:
    table = tomlfile.validate(document, JobTable)
    chip, clock = _chip(document, table)
    servos = _servos(document, table)
    leg = _leg(document, table.leg, servos) if table.leg else None
    motion = Motion(
        tuple(each.name for each in servos),
        poses_of(document, table.motion, servos, leg),
        table.motion.repeat,
        table.motion.end == "release",
    )
    if table.motion.repeat and "end" in document.data["motion"]:
        raise document.error(
            ("motion", "end"), "a motion that repeats has no end", "write repeat = false, or leave end away"
        )
    frame = Frame(
        clock.round_us(exact(table.frame.period_us)),
        exact(table.frame.gap_us),
        None if table.frame.slot_us is None else exact(table.frame.slot_us),
        document.place("frame", "period_us"),
    )
    rises(servos, frame, clock)
    angles, warnings = trajectory(motion, frame.period.cycles, clock)
    firmware = Firmware(table.firmware.dialect, table.firmware.engine)
    name = Path(document.file).stem
    return Job(name, document.file, chip, clock, servos, leg, motion, frame, firmware, angles, warnings)


def _chip(document: Document, table: JobTable) -> tuple[Device, Clock]:
    try:
        chip = device(table.chip.device)
    except InputError as error:
        raise document.error(("chip", "device"), error.message, error.hint) from error
    if table.chip.clock_hz > chip.max_clock_hz:
        raise document.error(
            ("chip", "clock_hz"),
            f"{table.chip.clock_hz} Hz is above the {chip.name}'s limit of {chip.max_clock_hz} Hz",
            "the PIC16F84 runs at up to 10 MHz, the PIC16F84A at up to 20 MHz",
        )
    return chip, Clock(table.chip.clock_hz)


def _servos(document: Document, table: JobTable) -> tuple[Servo, ...]:
    by_name: dict[str, int] = {}
    by_pin: dict[str, str] = {}
    for index, row in enumerate(table.servo):
        if row.name in by_name:
            raise document.error(
                ("servo", index, "name"),
                f"two servos have the name '{row.name}'",
                f"the other one is servo[{by_name[row.name] + 1}]",
            )
        if row.pin not in PINS:
            raise document.error(("servo", index, "pin"), f"unknown pin '{row.pin}'", nearest(row.pin, PINS))
        if row.pin in by_pin:
            raise document.error(
                ("servo", index, "pin"),
                f"two servos are on pin {row.pin}: {by_pin[row.pin]} and {row.name}",
                "each servo has a pin of its own",
            )
        if row.pin == OPEN_DRAIN_PIN and not row.open_drain:
            raise document.error(
                ("servo", index, "pin"),
                f"{OPEN_DRAIN_PIN} is an open drain: without a pull-up resistor it never goes high",
                "add a pull-up to VDD and write open_drain = true, or take another pin",
            )
        if row.pin != OPEN_DRAIN_PIN and row.open_drain:
            raise document.error(
                ("servo", index, "open_drain"), f"{row.pin} is no open drain: only {OPEN_DRAIN_PIN} is"
            )
        by_name[row.name], by_pin[row.pin] = index, row.name
    return tuple(_servo(document, index, row) for index, row in enumerate(table.servo))


def _servo(document: Document, index: int, row: ServoTable) -> Servo:
    def place(key: str) -> Place:
        return document.place("servo", index, key)

    servo_model(row.model, place=place("model"))  # an unknown model is wrong whatever its supply is
    model = servo_model(row.model, row.supply_v, row, place("supply_v" if row.supply_v else "travel_deg"))
    return servo(
        row.name,
        row.pin,
        model,
        points=points_of(row.points, place("points")) if row.points else None,
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


def _leg(document: Document, table: LegTable, servos: tuple[Servo, ...]) -> LegBinding:
    names = [each.name for each in servos]
    for key in ("alpha", "beta"):
        name = getattr(table, key)
        if name not in names:
            raise document.error(("leg", key), f"there is no servo '{name}'", nearest(name, names))
    if table.alpha == table.beta:
        raise document.error(("leg", "beta"), f"'{table.beta}' is both joints' servo")
    lengths = (table.ab_mm, table.bc_mm, table.cd_mm, table.df_mm)
    if table.ab_mm + table.cd_mm <= 0:
        raise document.error(("leg", "cd_mm"), "ab_mm and cd_mm are both 0: a leg has a reach")
    return LegBinding(
        Leg(*(length / 1000 for length in lengths)),
        table.alpha,
        table.beta,
        math.radians(table.alpha_zero_deg),
        math.radians(table.beta_zero_deg),
        {"nearest": 0, "positive": 1, "negative": -1}[table.beta_sign],
        table.tolerance_mm / 1000,
    )
