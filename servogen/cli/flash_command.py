"""`servogen flash`: programs a chip."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from servogen.bench.programmers.flash import flash as flashed
from servogen.bench.programmers.flash import programming_command
from servogen.bench.programmers.table import ProgrammingRequest, find
from servogen.cli.files import read_image
from servogen.cli.options import Json
from servogen.cli.show import as_json, next_step, status, warn
from servogen.errors import InputError, Location
from servogen.programs import PAIR_FOLDERS, is_built_pair, is_job, program_file, read_schedule
from servogen.workflows.flashing import check, schedule_beside


@dataclass(frozen=True, slots=True)
class FlashOptions:
    """Who programs which chip."""

    programmer: Annotated[
        str | None,
        "picpro, pk2cmd, ipecmd, pickit3, usbpicprog, picprog or a path (default: the first found).",
    ] = None
    port: Annotated[str | None, typer.Option("--port", "-p", help="The programmer's serial port.")] = None
    device: Annotated[
        str | None, "The chip: PIC16F84 or PIC16F84A (default: what the program was built for)."
    ] = None
    timeout: Annotated[float, typer.Option(min=1, help="Seconds to wait for the chip.")] = 120.0
    number: Annotated[
        int | None,
        typer.Option("--chip", min=1, max=2, help="Which of the two chips of a job, whose folder FILE is."),
    ] = None

    def folder(self, path: Path) -> Path:
        """Return the build of the chosen chip in the folder of a job of two; without two, `path`.

        Raises InputError for a job of two chips without a choice, and for a choice without two chips.
        """
        if not is_built_pair(path):
            if self.number is not None:
                message = "is not the folder of a job of two chips"
                raise InputError(
                    "conflicting-options", message, Location(str(path), key="--chip"), "omit --chip"
                )
            return path
        if self.number is None:
            hint = "--chip 1, then, with the other chip in the programmer, --chip 2"
            raise InputError("missing-option", "is the build of two chips", Location(str(path)), hint)
        return path / PAIR_FOLDERS[self.number - 1]


def flash(
    file: Annotated[
        Path, typer.Argument(help="The HEX file to program, or the folder of a build.", show_default=False)
    ],
    chosen: FlashOptions,
    against: Annotated[Path | None, "The schedule to compare it with (default: the one beside it)."] = None,
    force: Annotated[bool, "Program the chip even if the checks fail."] = False,
    dry_run: Annotated[bool, "Print the command without running it."] = False,
    json: Json = False,
) -> None:
    """Compare a program's pulses with their schedule, program a chip, and check that it was programmed."""
    if is_job(file):
        hint = f"build it, then flash its folder: servogen build {file}"
        raise InputError(
            "no-program", "is a job, and a programmer takes a HEX file", Location(str(file)), hint
        )
    built = file
    file = program_file(chosen.folder(built))
    image = read_image(file)
    path = against or schedule_beside(file)
    checked = check(file, image, chosen.device, path, read_schedule(path) if path else None)
    order = ProgrammingRequest(file, checked.device, chosen.port)
    installed = find(chosen.programmer)
    command = programming_command(installed, order)
    for warning in checked.warnings(force):
        warn(warning)
    if dry_run:
        if json:
            as_json({"command": list(command), "programmer": installed.programmer.name})
        else:
            print(shlex.join(command))
        return
    with status(f"programming with {installed.programmer.name}"):
        outcome = flashed(installed, order, image, chosen.timeout)
    if outcome.compared:
        how = f"read back and compared: {', '.join(outcome.compared)}"
    elif installed.programmer.verifies:
        how = "verified by the programmer, not read back"
    else:
        how = "programmed; this programmer does not show that it compared: capture and verify"
    if json:
        as_json(
            {
                "programmer": installed.programmer.name,
                "words": image.words,
                "compared": list(outcome.compared),
            }
        )
        return
    print(f"{file}: {image.words} words on the {order.device.name}, {how}")
    if chosen.number == 1:
        print(next_step("flash", built, "--chip", 2))
    else:
        against = built if chosen.number == 2 else path  # a capture of two chips has the pins of both
        schedule = ("--against", against) if against else ()
        print(next_step("capture", "--port", "PORT", "-o", "capture.vcd", *schedule))
