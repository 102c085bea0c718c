"""A job file -> `Job`. Every error names the line, the key, the value and what is allowed.

In: the path (or the text) of a job file. Out: the frozen `Job`; `plan` plans the motion of its servos.
"""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files
from pathlib import Path

from servogen.errors import InputError, Location
from servogen.job.firmware import firmware_of
from servogen.job.job import Job
from servogen.job.robots import rig_of
from servogen.job.schema import SECTIONS, JobTable, Section
from servogen.job.servos import servos_of
from servogen.pic.device import Device, device
from servogen.pulse.slots import Frame
from servogen.toml import file as toml_file
from servogen.toml.file import Document, exact
from servogen.units import Clock

MIN_CLOCK_HZ = 32_000
"""Watch crystals have 32768 Hz (DS35007, table of crystal capacitors, mode LP)."""

MIN_PERIOD_US = 1000.0
"""The length of a servo's pulse."""


def load(path: str | Path) -> Job:
    """Return the job in the file at `path`. Raises InputError."""
    return _job(toml_file.read(path))


def loads(text: str, file: str) -> Job:
    """Return the job in a text; `file` is its name in errors. Raises InputError."""
    return _job(toml_file.parse(text, file))


def calibrated(job: Job, servo: str, file: str) -> Job:
    """Return the job with the calibration in `file`, beside the job, for one servo. Raises InputError."""
    document = job.document
    rows = [
        {**{key: value for key, value in row.items() if key != "points"}, "calibration": file}
        if row.get("name") == servo
        else row
        for row in document.data["servo"]
    ]
    return _job(replace(document, data={**document.data, "servo": tuple(rows)}))


def changed(job: Job, table: str, key: str, value: object) -> Job:
    """Return the job with another value for a key of one of its tables. Raises InputError."""
    document = job.document
    rows = {**document.data.get(table, {}), key: value}
    return _job(replace(document, data={**document.data, table: rows}))


def _job(document: Document) -> Job:
    table = toml_file.validate(document, JobTable)
    chip, clock = _chip(document, table)
    servos = servos_of(document, table.servo)
    rig = rig_of(document, table, servos)
    frame = _frame(document, table, clock)
    firmware, stream = firmware_of(document, table, servos, frame, clock)
    return Job(
        name=_name(document),
        document=document,
        device=chip,
        clock=clock,
        servos=servos,
        bindings=rig.bindings,
        robot=rig.robot,
        tip=rig.tip,
        wheels=table.drive.wheels if table.drive else (),
        frame=frame,
        firmware=firmware,
        stream=stream,
        section=_section(document, table, needed=stream is None),
    )


def _section(document: Document, table: JobTable, needed: bool) -> Section | None:
    """Return the one section that moves the servos; None if there is none and none is needed."""
    given = [part for part in SECTIONS if getattr(table, part) is not None]
    if not given and not needed:
        return None
    if len(given) != 1:
        raise document.error(
            "job-sections",
            (given[1],) if given else (),
            "a job has one of " + ", ".join(f"[{part}]" for part in SECTIONS),
            None if given else "add [motion] poses = [ … ]",
        )
    part = given[0]
    if document.data[part].get("repeat", True) and "end" in document.data[part]:
        raise document.error(
            "endless-motion",
            (part, "end"),
            "a motion that repeats has no end",
            "write repeat = false, or omit end",
        )
    section: Section = getattr(table, part)
    return section


def _name(document: Document) -> str:
    """Return the job's name, which is used for a folder in `build/` and in comments of the C."""
    name = Path(document.file).stem
    if name in (".", "..") or any(ord(sign) < ord(" ") for sign in name):
        raise InputError(
            "unwritable-file",
            f"the file's name makes the job's name {name!r}, which cannot be a folder",
            Location(document.file),
            "name the file after the job, as arm.toml",
        )
    return name


def _chip(document: Document, table: JobTable) -> tuple[Device, Clock]:
    try:
        chip = device(table.chip.device)
    except InputError as error:
        raise error.at(document.place("chip", "device")) from error
    if table.chip.clock_hz > chip.max_clock_hz:
        raise document.error(
            "wrong-clock",
            ("chip", "clock_hz"),
            f"{table.chip.clock_hz} Hz is above the {chip.name}'s limit of {chip.max_clock_hz} Hz",
            "the PIC16F84 runs at up to 10 MHz, the PIC16F84A at up to 20 MHz",
        )
    if table.chip.clock_hz < MIN_CLOCK_HZ:
        raise document.error(
            "wrong-clock",
            ("chip", "clock_hz"),
            f"{table.chip.clock_hz} Hz is slower than any crystal: at least {MIN_CLOCK_HZ} Hz",
            "4 MHz are 4_000_000",
        )
    return chip, Clock(table.chip.clock_hz)


def _frame(document: Document, table: JobTable, clock: Clock) -> Frame:
    if table.frame.period_us < MIN_PERIOD_US:
        raise document.error(
            "out-of-range",
            ("frame", "period_us"),
            f"{table.frame.period_us:g} µs is no longer than a pulse",
            "20 ms are 20_000 µs",
        )
    return Frame(
        clock.round_us(exact(table.frame.period_us)),
        exact(table.frame.gap_us),
        None if table.frame.slot_us is None else exact(table.frame.slot_us),
        table.frame.per_slot,
        table.frame.max_together,
        document.place("frame", "period_us"),
    )


def template() -> str:
    """Return the commented job file that `servogen new` writes; it loads without changes."""
    return (files("servogen.job") / "template.toml").read_text(encoding="utf-8")
