"""The command of the second witness: check-certificate."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from servogen.cli.options import Json
from servogen.cli.show import as_json, status
from servogen.inputs import read_input

MAX_CERTIFICATE_BYTES = 4 << 20


def register(app: typer.Typer) -> None:
    app.command()(check_certificate)


def check_certificate(
    certificate: Annotated[Path, typer.Argument(help="What servogen prove wrote.", show_default=False)],
    hex_file: Annotated[Path, typer.Argument(metavar="HEX", help="The program.", show_default=False)],
    against: Annotated[Path, typer.Option(help="The schedule.json of the proof.", show_default=False)],
    json: Json = False,
) -> None:
    """Check a certificate of `prove` with a checker of its own: the second witness.

    Exit code 0: the certificate proves that every edge is the schedule's; 1: refused, with the reason; 2: the
    files are not what they should be.
    """
    from servogen import checker
    from servogen.pic.image import read_hex
    from servogen.programs import MAX_SCHEDULE_BYTES, read_source

    claim = checker.read_certificate(read_input(certificate, MAX_CERTIFICATE_BYTES), str(certificate))
    image = read_hex(read_source(hex_file), str(hex_file)).image
    held = ", ".join(f"{pin} held at {level}" for pin, level in claim.held.items())
    try:
        with status(f"{hex_file.name}: checking {claim.count} states"):
            schedule = read_input(against, MAX_SCHEDULE_BYTES)
            found = checker.check_certificate(claim, image, schedule, str(against))
    except checker.Refused as refused:
        if json:
            as_json({"valid": False, "reason": str(refused), "held": claim.held})
        else:
            print(f"{certificate}: refused: {refused}")
        raise typer.Exit(1) from None
    if json:
        as_json({"valid": True, "held": claim.held} | asdict(found))
        return
    print(f"{certificate}: valid{', with ' + held if held else ''}")
    counts = f"{found.states} states, {found.frames} frames, {found.cycles} cycles, {found.forks} splits"
    print(f"  checked: {counts}")
