"""Checks an image before it is programmed: the chip, whether its pulses are exact, the image itself.

In: an image, the schedule it was built for, the requested device. Out: a `FlashCheck`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from servogen.bench.programmers.flash import objections, remarks
from servogen.errors import Diagnostic, InputError, Location
from servogen.pic.device import Device
from servogen.pic.device import device as device_named
from servogen.pic.image import Image
from servogen.pulse import PulseSchedule
from servogen.workflows.verification import judge_image

SCHEDULE = "schedule.json"
"""The file name of the schedule that a build writes beside its images."""


@dataclass(frozen=True, slots=True)
class FlashCheck:
    """The device to program, the objections to programming it, and warnings."""

    device: Device
    against: tuple[Diagnostic, ...]
    remarks: tuple[Diagnostic, ...]

    def warnings(self, force: bool) -> tuple[Diagnostic, ...]:
        """Return the warnings. Raises InputError if there are objections, unless `force`."""
        if self.against and not force:
            raise InputError.of(
                replace(objection, hint="--force programs it anyway") for objection in self.against
            )
        return (*(replace(objection, severity="warning") for objection in self.against), *self.remarks)


def schedule_beside(file: Path) -> Path | None:
    """Return the schedule that a build left beside an image; None if there is none."""
    path = file.parent / SCHEDULE
    return path if path.exists() else None


def check(
    file: Path, image: Image, asked: str | None, path: Path | None, schedule: PulseSchedule | None
) -> FlashCheck:
    """Return the check of `image`, read from `file` and built for `schedule`, which was read from `path`.

    Raises InputError if neither the schedule nor `asked` names the device.
    """
    name, wrong_chip = _device(file, asked, schedule)
    device, place = device_named(name), Location(str(file))
    against = (*objections(image), *wrong_chip, *_inexact(image, path, schedule))
    return FlashCheck(
        device,
        tuple(replace(objection, location=place) for objection in against),
        tuple(replace(diagnostic, location=place) for diagnostic in remarks(image, device)),
    )


def _device(
    file: Path, asked: str | None, schedule: PulseSchedule | None
) -> tuple[str, tuple[Diagnostic, ...]]:
    """Return the device's name, and the objections to it."""
    built = schedule.device if schedule else None
    name = asked or built
    if name is None:
        raise InputError(
            "missing-option",
            "the chip is not known",
            Location(str(file)),
            "add --device PIC16F84 or --device PIC16F84A; a schedule.json that servogen built names it",
        )
    if built is None or device_named(name) == device_named(built):
        return name, ()
    text = f"it was built for a {device_named(built).name}, --device is {device_named(name).name}"
    return name, (Diagnostic("error", "wrong-chip", text),)


def _inexact(image: Image, path: Path | None, schedule: PulseSchedule | None) -> tuple[Diagnostic, ...]:
    """Return the objection that the image's pulses are not exact; empty if they are."""
    if schedule is None:
        text = "there is no schedule.json beside it with which to compare its pulses (--against)"
        return (Diagnostic("error", "not-exact", text),)
    verdict = judge_image(schedule, image)
    if verdict.passed:
        return ()
    text = f"its pulses are not exact against {path}: {verdict.reasons[0]}"
    return (Diagnostic("error", "not-exact", text),)
