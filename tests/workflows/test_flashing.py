"""What speaks against programming an image, and what --force makes of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from servogen.errors import InputError
from servogen.pic.image import Image
from servogen.programs import read_program, read_schedule
from servogen.pulse import PulseSchedule
from servogen.workflows.flashing import FlashCheck, check, schedule_beside

LAB8 = Path(__file__).parents[2] / "firmware" / "lab8-exercise"
HEX, SCHEDULE = LAB8 / "main.hex", LAB8 / "schedule.json"


@pytest.fixture(scope="module")
def image() -> Image:
    return read_program(HEX).image


@pytest.fixture(scope="module")
def schedule() -> PulseSchedule:
    return read_schedule(SCHEDULE)


def codes(found: FlashCheck) -> list[str]:
    return [each.code for each in found.against]


def test_a_proven_image_may_be_programmed(image: Image, schedule: PulseSchedule) -> None:
    found = check(HEX, image, None, SCHEDULE, schedule)
    assert (found.device.name, found.against) == (schedule.device, ())
    assert [each.code for each in found.warnings(force=False)] == ["no-device-id"]


def test_without_a_schedule_nothing_is_proven_and_the_chip_must_be_named(image: Image) -> None:
    with pytest.raises(InputError, match="the chip is not known"):
        check(HEX, image, None, None, None)
    found = check(HEX, image, "16f84a", None, None)
    assert (found.device.name, codes(found)) == ("PIC16F84A", ["not-exact"])


def test_another_image_and_another_chip_are_refused_each_with_its_reason(
    image: Image, schedule: PulseSchedule
) -> None:
    """One word of the program is a NOP instead; each refusal names the file and the way out."""
    address = max(image.program)
    other = replace(image, program={**image.program, address: 0, 5: 0})
    found = check(HEX, other, "PIC16F84A", SCHEDULE, schedule)
    assert codes(found) == ["wrong-chip", "not-exact"]
    with pytest.raises(InputError) as error:
        found.warnings(force=False)
    assert [each.location.file for each in error.value.diagnostics if each.location] == [str(HEX)] * 2
    assert all("--force" in (each.hint or "") for each in error.value.diagnostics)


def test_force_makes_warnings_of_it(image: Image) -> None:
    forced = check(HEX, replace(image, config=None), "PIC16F84A", None, None).warnings(force=True)
    assert [(each.severity, each.code) for each in forced] == [
        ("warning", "no-configuration"),
        ("warning", "not-exact"),
    ]


def test_the_schedule_of_a_build_lies_beside_its_image(tmp_path: Path) -> None:
    assert schedule_beside(HEX) == SCHEDULE
    assert schedule_beside(tmp_path / "main.hex") is None
