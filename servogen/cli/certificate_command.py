"""`servogen check-certificate`: a certificate of `prove`, checked by the independent checker."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from servogen import checker
from servogen.cli.options import Json
from servogen.cli.schedule_proof import NOT_PROVEN, checked_lines, checked_to_json
from servogen.cli.show import as_json, status
from servogen.inputs import read_input
from servogen.pic.image import read_hex
from servogen.programs import MAX_SCHEDULE_BYTES, program_file, read_source
from servogen.pulse.schedule import TAPE_FILE
from servogen.workflows.certificates import MAX_CERTIFICATE_BYTES


def check_certificate(
    certificate: Annotated[
        Path, typer.Argument(help="The certificate that servogen prove wrote.", show_default=False)
    ],
    hex_file: Annotated[Path, typer.Argument(metavar="HEX", help="The program.", show_default=False)],
    against: Annotated[Path, typer.Option(help="The schedule.json of the proof.", show_default=False)],
    allow_held: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PIN",
            help="Accept a certificate that is about one level of this button or line only (repeatable).",
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Check a certificate of `prove` with an independent checker.

    Exit code 0: the certificate proves that every edge is the schedule's; 1: refused, or outside what the
    checker covers, with the reason; 2: a file is not valid.
    """
    claim = checker.read_certificate(read_input(certificate, MAX_CERTIFICATE_BYTES), str(certificate))
    hex_file = program_file(hex_file)
    image = read_hex(read_source(hex_file), str(hex_file)).image
    try:
        with status(f"{hex_file.name}: checking {claim.count} states"):
            schedule = read_input(against, MAX_SCHEDULE_BYTES)
            file = against.with_name(TAPE_FILE)
            tape = read_input(file) if claim.tape or file.is_file() else b""
            held = allow_held or ()
            checked = checker.check_certificate(claim, image, schedule, str(against), held, tape=tape)
    except checker.Refused as refused:
        covered = not isinstance(refused, checker.NotCovered)
        if json:
            as_json({"valid": False, "covered": covered, "reason": str(refused), "held": claim.held})
        else:
            print(f"{certificate}: {'refused' if covered else 'not covered'}: {refused}")
        raise typer.Exit(NOT_PROVEN) from None
    if json:
        as_json({"valid": True, "held": claim.held, **checked_to_json(checked)})
        return
    print(f"{certificate}: valid{''.join(f', with {text}' for text in checked.restrictions)}")
    print("\n".join(checked_lines(checked)))
