"""Jobs whose motion is on a tape, planned and compiled; what a tape says, read by the table of its format.

`frames_of` reads the records as docs/firmware.md states them, and shares nothing with what writes them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from servogen.engines.board import machine_of
from servogen.engines.tape.taping import Taped, taped
from servogen.job import PlannedJob, load, plan_job
from servogen.pic.image import Image
from servogen.pulse import PulseSchedule
from servogen.simulator import Machine
from servogen.verify import Verdict
from servogen.workflows.engines import PlayedJob, planned
from servogen.workflows.verification import judge_run

POSES = (
    "{ arm_deg = 30, hand_deg = 120, foot_deg = 80, hold_s = 0.1 }",
    "{ arm_deg = 60, hand_deg = 30, foot_deg = 85, move_s = 0.3 }",
    "{ arm_deg = 30, hand_deg = 120, foot_deg = 80, move_s = 0.4 }",
)


def text(tape: str = "", poses: tuple[str, ...] = POSES, hz: int = 4_000_000, foot: str = "RA0") -> str:
    servos = "".join(
        f'[[servo]]\nname = "{name}"\npin = "{pin}"\nmodel = "futaba-s3001"\n'
        for name, pin in (("arm", "RB0"), ("hand", "RB1"), ("foot", foot))
    )
    return (
        f'[chip]\ndevice = "PIC16F84A"\nclock_hz = {hz}\n{servos}'
        f"[motion]\nrepeat = true\nposes = [{', '.join(poses)}]\n"
        f"[frame]\nperiod_us = 20_000\n[tape]\n{tape}\n[firmware]\nsoft_start_s = 0.1\n"
    )


@cache
def job(*args: object, **values: object) -> PlannedJob:
    with TemporaryDirectory() as folder:
        file = Path(folder, "dance.toml")
        file.write_text(text(*args, **values))  # type: ignore[arg-type]
        return plan_job(load(file))


@cache
def made(dialect: str = "c2c", **values: object) -> tuple[PlayedJob, Image]:
    """A job as its engine plays it, and its program."""
    played = planned(job(**values))
    return played, played.make(dialect).compilation.image


@cache
def tape_of(**values: object) -> Taped:
    return taped(job(**values))


def with_content(schedule: PulseSchedule, content: bytes) -> PulseSchedule:
    """The schedule beside another EEPROM."""
    assert schedule.tape is not None
    return replace(schedule, tape=replace(schedule.tape, content=content))


def without_eeprom(schedule: PulseSchedule) -> PulseSchedule:
    return replace(schedule, tape=None)


def judged(image: Image, schedule: PulseSchedule) -> Verdict:
    return judge_run(schedule, image).verdict


def running(image: Image, schedule: PulseSchedule, cycles: int) -> Machine:
    machine = machine_of(schedule, image)
    machine.run(cycles)
    return machine


def widths_of(schedule: PulseSchedule, order: tuple[int, ...]) -> list[list[int] | None]:
    """Every frame's widths in the order of the slots; None without pulses."""
    rows: list[list[int] | None] = []
    for run in (*schedule.lead_in, *schedule.loop):
        pulses = [run.pulses[channel] for channel in order]
        rows += [None if None in pulses else [pulse.width for pulse in pulses if pulse]] * run.frames
    return rows


def frames_of(data: bytes, servos: int) -> Iterator[list[int] | None]:
    """Read a tape from address 2 to its end: the widths of each frame."""
    at, widths = 2, [0] * servos
    while data[at] != 0xC0:
        kind, more, begin = data[at] & 0xC0, data[at] & 0x3F, at
        at += 1
        if kind == 0x40:
            widths = [data[at + 2 * n] | data[at + 2 * n + 1] << 8 for n in range(servos)]
            at += 2 * servos
        elif kind == 0x00:
            widths = [
                width + (byte - 256 if byte > 127 else byte)
                for width, byte in zip(widths, data[at : at + servos], strict=True)
            ]
            at += servos
        total = 0x5A
        for byte in data[begin:at]:
            total = ((total * 2) % 256 + total // 128 + byte) % 256
        assert data[at] == total
        at += 1
        for _ in range(more + 1):
            yield None if kind == 0x80 else list(widths)
